"""Which networks are trained on which frames, and what they find in the test drives."""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import DatasetError, OutputError

from .data import INPUTS, Samples
from .outcomes import Experiment, MadeWith, Outcome, add_outcomes, read_outcomes

FRAMES = ("all", "clear", "one seed", "three seeds, thinned", "three seeds")
"""Which frames a network may learn from; see `Experiment`."""
NUM_RUNS = 3
"""Trainings of each kind, from other first weights."""
_SEED = re.compile(r"_s(\d+)$")


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


def run_experiments(
    samples: Samples,
    chosen: Iterable[Experiment],
    file: str | Path,
    num_steps: int,
    on_done: Callable[[str], None] = print,
) -> None:
    """Train and test, a line of a JSON file for each; what stands in the file already is not done again.

    Raises
    ------
    InputFileError, OutputError
        As of :func:`finished`.
    DatasetError
        If there is no frame to train on or to test with.
    """
    from .training import TrainingSettings, detections, train  # imports TensorFlow

    test = samples.rows("test")
    for split, rows in (("train", samples.rows("train")), ("test", test)):
        if not len(rows):
            raise DatasetError(f"no frame is in the split {split!r}: make more drives, or give --splits to the export")
    done = {outcome.experiment for outcome in finished(samples, file, num_steps)}
    made_with = MadeWith(steps=num_steps, dataset=samples.digest())
    for experiment in chosen:
        if experiment in done:
            continue
        rows = training_rows(samples, experiment.frames, experiment.run)
        started = time.process_time()
        settings = TrainingSettings(num_steps=num_steps, seed=experiment.run)
        network = train(samples, rows, experiment.inputs, experiment.method, settings)
        seconds = time.process_time() - started
        found = {method: detections(network, samples, test, experiment.inputs, method) for method in samples.methods}
        about = {"num_frames": len(rows), "seconds": seconds, "made_with": made_with.model_dump()}
        add_outcomes(file, experiment, about, found)
        on_done(f"{experiment}: {len(rows)} frames, {seconds:.1f} s of CPU")


def finished(samples: Samples, file: str | Path, num_steps: int | None = None) -> list[Outcome]:
    """Return what stands in a file of :func:`run_experiments`, all of it from these frames.

    Raises
    ------
    InputFileError
        As of :func:`read_outcomes`.
    OutputError
        If some is of other frames, or of another number of them, or of another number of steps than asked for, or than
        the rest.
    """
    outcomes, digest, num_test = list(read_outcomes(file)), samples.digest(), len(samples.rows("test"))
    for outcome in outcomes:
        steps = outcomes[0].made_with.steps if num_steps is None else num_steps
        if (outcome.made_with.steps, outcome.made_with.dataset, len(outcome.found)) != (steps, digest, num_test):
            raise OutputError(
                f"{file} holds results of other frames or another number of steps: give another --out, or remove it"
            )
    return outcomes
