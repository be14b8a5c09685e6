"""Which networks are trained on which frames, and what they find in the test drives."""

from __future__ import annotations

import json
import re
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from .data import INPUTS, Samples
from .grid import Objects

NUM_RUNS = 3
"""Trainings of each kind, from other first weights."""
_SEED = re.compile(r"_s(\d+)$")


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


def experiments(methods: Sequence[str], num_runs: int = NUM_RUNS) -> list[Experiment]:
    """Return the trainings of the tables in docs/baseline.md for a dataset's methods, the most telling first."""
    runs = range(num_runs)
    best = methods[0]
    kinds = [(inputs, method, "all") for inputs in INPUTS for method in methods]
    kinds += [("map", best, frames) for frames in ("one seed", "three seeds, thinned", "three seeds")]
    kinds += [(inputs, best, "clear") for inputs in INPUTS]
    kinds += [("camera and map", best, frames) for frames in ("one seed", "three seeds, thinned", "three seeds")]
    return [Experiment(*kind, run) for kind in kinds for run in runs]


def training_rows(samples: Samples, frames: str, run: int) -> npt.NDArray[np.intp]:
    """Return the frames that an experiment learns from."""
    drives = sorted(set(samples.drives[samples.splits == "train"]))
    seeds = sorted({_seed_of(drive) for drive in drives})
    first = [seeds[(run + step) % len(seeds)] for step in range(3)]
    if frames in ("all", "clear"):
        return samples.rows("train", "clear" if frames == "clear" else None)
    if frames == "one seed":
        return samples.rows("train", drives=[drive for drive in drives if _seed_of(drive) == first[0]])
    rows = samples.rows("train", drives=[drive for drive in drives if _seed_of(drive) in first])
    if frames == "three seeds":
        return rows
    count = len(training_rows(samples, "one seed", run))
    return rows[np.linspace(0, len(rows) - 1, min(count, len(rows))).round().astype(int)]


def _seed_of(drive: str) -> int:
    found = _SEED.search(drive)
    return int(found[1]) if found else 0


@dataclass(frozen=True, eq=False)
class Outcome:
    """What the network of an experiment finds in the test frames whose radar is simulated by a method."""

    experiment: Experiment
    test_method: str
    num_frames: int
    seconds: float
    found: list[Objects]


def run_experiments(
    samples: Samples,
    chosen: Iterable[Experiment],
    file: str | Path,
    num_steps: int,
    on_done: Callable[[str], None] = print,
) -> None:
    """Train and test, a line of a JSON file for each; what stands in the file already is not done again."""
    from .training import TrainingSettings, detections, train  # imports TensorFlow

    done = {(outcome.experiment, outcome.test_method) for outcome in read_outcomes(file)}
    test = samples.rows("test")
    for experiment in chosen:
        if all((experiment, method) in done for method in samples.methods):
            continue
        rows = training_rows(samples, experiment.frames, experiment.run)
        started = time.process_time()
        settings = TrainingSettings(num_steps=num_steps, seed=experiment.run)
        network = train(samples, rows, experiment.inputs, experiment.method, settings)
        seconds = time.process_time() - started
        with open(file, "a", encoding="utf-8") as out:
            for method in samples.methods:
                found = detections(network, samples, test, experiment.inputs, method)
                out.write(json.dumps(_line(Outcome(experiment, method, len(rows), seconds, found))) + "\n")
        on_done(f"{experiment}: {len(rows)} frames, {seconds:.1f} s of CPU")


def _line(outcome: Outcome) -> dict[str, object]:
    frames = [
        {"places": some.places.round(3).tolist(), "kinds": some.kinds.tolist(), "scores": some.scores.round(5).tolist()}
        for some in outcome.found
    ]
    about = {"test_method": outcome.test_method, "num_frames": outcome.num_frames, "seconds": outcome.seconds}
    return {"experiment": asdict(outcome.experiment), **about, "found": frames}


def read_outcomes(file: str | Path) -> Iterator[Outcome]:
    """Yield what :func:`run_experiments` wrote; nothing where there is no file."""
    if not Path(file).exists():
        return
    for text in Path(file).read_text(encoding="utf-8").splitlines():
        line = json.loads(text)
        found = [
            Objects(
                np.array(frame["places"], np.float64).reshape(-1, 2),
                np.array(frame["kinds"], np.int64),
                np.array(frame["scores"], np.float64),
            )
            for frame in line["found"]
        ]
        experiment = Experiment(**line["experiment"])
        yield Outcome(experiment, line["test_method"], line["num_frames"], line["seconds"], found)
