"""The results of trainings in a file, a line of JSON for each, so that a stopped run goes on where it was.

The file may be a user's, of another version or cut: it is read into checked data, and errors name its line.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field

from scarl_sionna.core.errors import InputFileError
from scarl_sionna.core.untrusted.checked import Number, Table, Text, checked
from scarl_sionna.core.untrusted.files import read_text
from scarl_sionna.core.untrusted.json_text import parse_json

from .grid import CLASSES, Objects

MOST_BYTES = 1_000_000_000
"""Largest file that is read [bytes]: some 10,000 trainings of the size of docs/baseline.md."""
_REMEDY = "give another --out, or remove the file; its trainings are then done again"


class MadeWith(Table):
    """What all results of a file have in common.

    Attributes
    ----------
    steps : int
        Of each training.
    dataset : str
        Digest of the frames.
    """

    steps: int = Field(ge=1)
    dataset: Text


@dataclass(frozen=True)
class Experiment:
    """A training.

    Parameters
    ----------
    inputs : str
        What the network sees.
    method : str
        How the radar was simulated in training.
    frames : str
        Which frames of the training split it learns from: ``"all"``; ``"clear"``, those without rain; ``"one seed"``,
        the drives of one seed of each scenario; ``"three seeds"``; ``"three seeds, thinned"``, as many frames as one
        seed has.
    run : int
        Number of the repetition: the seed of the training, and which seeds of the scenarios come first.
    """

    inputs: str
    method: str
    frames: str
    run: int


@dataclass(frozen=True, eq=False)
class Outcome:
    """What the network of an experiment finds in the test frames whose radar is simulated by a method.

    Attributes
    ----------
    experiment : Experiment
    test_method : str
    num_frames : int
        Frames in training.
    seconds : float
        CPU time of the training [s].
    found : list of Objects
        By test frame.
    made_with : MadeWith
    """

    experiment: Experiment
    test_method: str
    num_frames: int
    seconds: float
    found: list[Objects]
    made_with: MadeWith


class _Found(Table):
    """Detections in a frame."""

    places: list[Annotated[list[Number], Field(min_length=2, max_length=2)]]
    kinds: list[Annotated[int, Field(ge=0, lt=len(CLASSES))]]
    scores: list[Number]

    def objects(self) -> Objects:
        if not len(self.places) == len(self.kinds) == len(self.scores):
            raise ValueError(f"{len(self.places)} places, {len(self.kinds)} kinds and {len(self.scores)} scores")
        places = np.array(self.places, np.float64).reshape(-1, 2)
        return Objects(places, np.array(self.kinds, np.int64), np.array(self.scores, np.float64))


class _Experiment(Table):
    inputs: Text
    method: Text
    frames: Text
    run: int = Field(ge=0, lt=2**63)


class _Line(Table):
    """A training."""

    experiment: _Experiment
    num_frames: int = Field(ge=0, lt=2**63)
    seconds: Number
    made_with: MadeWith
    found: dict[Text, list[_Found]]


def add_outcomes(
    file: str | Path, experiment: Experiment, about: Mapping[str, object], found: Mapping[str, Sequence[Objects]]
) -> None:
    """Write the line of a training; what a killed one left of its line is cut off.

    Parameters
    ----------
    file : path
    experiment : Experiment
    about : mapping
        Its ``num_frames``, ``seconds`` and ``made_with``; see `Outcome`.
    found : mapping of str to sequence of Objects
        By the method that simulated the radar of the test frames: detections by test frame.
    """
    line = {"experiment": asdict(experiment), **about, "found": {name: _plain(some) for name, some in found.items()}}
    if Path(file).exists():
        with open(file, "rb+") as out:
            out.truncate(out.read().rfind(b"\n") + 1)
    with open(file, "a", encoding="utf-8") as out:
        out.write(json.dumps(line) + "\n")


def _plain(frames: Sequence[Objects]) -> list[dict[str, object]]:
    return [
        {
            "places": some.places.round(3).tolist(),
            "kinds": some.kinds.tolist(),
            "scores": some.scores.round(5).tolist(),
        }
        for some in frames
    ]


def read_outcomes(file: str | Path) -> Iterator[Outcome]:
    """Yield what :func:`add_outcomes` wrote; nothing where there is no file.

    A last line without its end is of a training that was killed while it was written, and does not count.

    Raises
    ------
    InputFileError
        If the file is no regular one or no text, or a line is not one of these, as those of older versions; it names
        file, line, and what is missing or wrong there.
    """
    if not Path(file).exists():
        return
    for number, text in enumerate(read_text(file, MOST_BYTES).split("\n")[:-1], 1):
        try:
            line = checked(_Line, parse_json(text))
            found = {method: [frame.objects() for frame in frames] for method, frames in line.found.items()}
        except ValueError as error:
            raise InputFileError(f"line {number} is no result of a training: {error}", file, _REMEDY) from None
        told = line.experiment
        experiment = Experiment(told.inputs, told.method, told.frames, told.run)
        for method, frames in found.items():
            yield Outcome(experiment, method, line.num_frames, line.seconds, frames, line.made_with)
