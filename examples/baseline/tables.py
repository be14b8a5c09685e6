"""Tables of average precision with their uncertainty, from what networks found in the test drives."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import numpy as np
import numpy.typing as npt

from .data import INPUTS, Samples
from .grid import CLASSES, Objects
from .metrics import Matched, matched_frames, mean_precision, table_of
from .outcomes import Outcome

RANGES = ((0.0, 20.0), (20.0, 40.0), (40.0, 64.0))
"""Classes of distance from the radar [m]."""
NUM_DRAWS = 200
"""Draws of test drives and trainings from which an interval is told."""
Frames = list[list[Matched]]


class Results:
    """Outcomes of experiments beside what is there in the test frames.

    Parameters
    ----------
    samples : Samples
    outcomes : iterable of Outcome
    """

    def __init__(self, samples: Samples, outcomes: Iterable[Outcome]) -> None:
        self.methods, self.best = samples.methods, samples.methods[0]
        self.rows = samples.rows("test")
        self.there: list[Objects] = [samples.objects[row] for row in self.rows]
        self.drives, self.weather = samples.drives[self.rows], samples.weather[self.rows]
        self.outcomes = list(outcomes)
        self._matched: dict[tuple[int, float, float], Frames] = {}

    def runs(self, inputs: str, method: str, frames: str, test_method: str | None = None) -> list[int]:
        """Return the numbers of the outcomes of a kind; tested as trained if no method is given."""
        return [
            number
            for number, outcome in enumerate(self.outcomes)
            if (outcome.experiment.inputs, outcome.experiment.method, outcome.experiment.frames)
            == (inputs, method, frames)
            and outcome.test_method == (test_method or method)
        ]

    def matched(self, number: int, near: float = 0.0, far: float = np.inf) -> Frames:
        """Return the matches of an outcome's frames, between two distances [m]."""
        key = (number, near, far)
        if key not in self._matched:
            self._matched[key] = matched_frames(self.outcomes[number].found, self.there, near, far)
        return self._matched[key]

    def value(
        self,
        numbers: Sequence[int],
        kind: int | None = None,
        span: tuple[float, float] = (0.0, np.inf),
        weather: str | None = None,
    ) -> tuple[float, float, float]:
        """Return the average precision of trainings, their mean, and an interval of 90 %.

        Parameters
        ----------
        numbers : sequence of int
            Of outcomes: the trainings.
        kind : int, optional
            Class; left out, the mean over classes.
        span : (float, float)
            Distances [m].
        weather : str, optional
            Of the test frames; left out, all.

        Returns
        -------
        mean, low, high : float
            The interval is of a bootstrap over trainings and whole test drives: frames of a drive are no independent
            ones, and the variants of a drive in other weather go together.
        """
        if not numbers:
            return (float("nan"),) * 3
        score = self._scorer(kind, span, weather)
        mean = _mean([score(number, np.arange(len(self.rows))) for number in numbers])
        drawn = [_mean([score(run, frames) for run in runs]) for runs, frames in self._draws(numbers)]
        low, high = np.nanquantile(drawn, (0.05, 0.95))
        return mean, float(low), float(high)

    def scatter(
        self, numbers: Sequence[int], kind: int | None = None, weather: str | None = None
    ) -> tuple[float, float]:
        """Return the mean and the standard deviation of the average precision of trainings on all test frames.

        The deviation is that of one training, nan for fewer than two; test drives do not vary in it.
        """
        score = self._scorer(kind, (0.0, np.inf), weather)
        values = [score(number, np.arange(len(self.rows))) for number in numbers]
        return _mean(values), float(np.std(values, ddof=1)) if len(values) > 1 else float("nan")

    def difference(
        self, numbers: Sequence[int], others: Sequence[int], kind: int | None = None, weather: str | None = None
    ) -> tuple[float, float, float]:
        """Return by how much the precision of trainings is above that of others, and an interval of 90 %.

        Both are tested on the same draws of drives, so that what is hard in a drive cancels. Of one class or the mean
        over classes, in one weather or in all.
        """
        score = self._scorer(kind, (0.0, np.inf), weather)
        everything = np.arange(len(self.rows))

        def apart(first: npt.ArrayLike, second: npt.ArrayLike, frames: npt.NDArray[np.intp]) -> float:
            means = [
                _mean([score(number, frames) for number in part]) for part in (np.asarray(first), np.asarray(second))
            ]
            return means[0] - means[1]

        rng = np.random.default_rng(1)
        drawn = [apart(runs, rng.choice(others, len(others)), frames) for runs, frames in self._draws(numbers)]
        low, high = np.nanquantile(drawn, (0.05, 0.95))
        return apart(numbers, others, everything), float(low), float(high)

    def num_objects(self, kind: int, span: tuple[float, float] = (0.0, np.inf)) -> int:
        """Return how many objects of a class are to be found in the test frames."""
        return sum(
            int(np.sum((some.kinds == kind) & (some.distance >= span[0]) & (some.distance < span[1])))
            for some in self.there
        )

    def _draws(self, numbers: Sequence[int]) -> Iterable[tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]]:
        rng = np.random.default_rng(0)
        drives = np.unique(self.drives)
        for _ in range(NUM_DRAWS):
            taken = rng.choice(drives, len(drives))
            frames = np.concatenate([np.flatnonzero(self.drives == drive) for drive in taken])
            yield rng.choice(numbers, len(numbers)), frames

    def _scorer(
        self, kind: int | None, span: tuple[float, float], weather: str | None
    ) -> Callable[[int, npt.NDArray[np.intp]], float]:
        def score(number: int, frames: npt.NDArray[np.intp]) -> float:
            if weather is not None:
                frames = frames[self.weather[frames] == weather]
            matched = self.matched(number, *span)
            table = table_of([matched[frame] for frame in frames])
            return mean_precision(table) if kind is None else float(table[kind].mean())

        return score


def _mean(values: Sequence[float]) -> float:
    """Return the mean of what is not nan; nan if all are: draws without an object of a class."""
    told = [value for value in values if not np.isnan(value)]
    return float(np.mean(told)) if told else float("nan")


def markdown(results: Results) -> str:
    """Return the tables of docs/baseline.md."""
    parts = [_by_input(results), _by_weather(results), _by_frames(results)]
    if len(results.methods) > 1:
        parts.append(_by_method(results))
    return "\n\n".join(parts) + "\n"


def _text(value: tuple[float, float, float]) -> str:
    mean, low, high = (100.0 * part for part in value)
    return "-" if np.isnan(mean) else f"{mean:.0f} ({low:.0f} to {high:.0f})"


def _deviating(value: tuple[float, float]) -> str:
    mean, deviation = (100.0 * part for part in value)
    return "-" if np.isnan(mean) else f"{mean:.0f}" if np.isnan(deviation) else f"{mean:.0f} ± {deviation:.0f}"


def _short(value: tuple[float, float, float]) -> str:
    return "-" if np.isnan(value[0]) else f"{100.0 * value[0]:.0f}"


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    return "\n".join([*lines, *("| " + " | ".join(row) + " |" for row in rows)])


def _by_input(results: Results) -> str:
    """Return average precision by input, class and distance, by the best method that the dataset has."""
    head = ["class, distance", "objects", *INPUTS]
    runs = [results.runs(inputs, results.best, "all") for inputs in INPUTS]
    rows = [["all", str(sum(len(some) for some in results.there)), *(_text(results.value(run)) for run in runs)]]
    for kind, name in enumerate(CLASSES):
        count = results.num_objects(kind)
        if count:
            rows.append([name, str(count), *(_text(results.value(run, kind)) for run in runs)])
        for span in RANGES:
            count = results.num_objects(kind, span)
            if count:
                where = f"{name}, {span[0]:.0f} to {span[1]:.0f} m"
                rows.append([where, str(count), *(_short(results.value(run, kind, span)) for run in runs)])
    return _table(head, rows)


def _by_method(results: Results) -> str:
    """Return precision by how the radar was simulated in training and in the test, with the scatter of trainings."""
    first, second = results.methods[:2]
    pairs = [(first, first), (second, second), (second, first), (first, second)]
    head = ["network sees", "class", *(f"trained on {one}, tested on {other}" for one, other in pairs)]
    head.append(f"tested on {first}: {first} above {second}")
    rows = []
    for inputs in INPUTS:
        runs = {(one, other): results.runs(inputs, one, "all", other) for one, other in pairs}
        if not all(runs.values()):
            continue
        for name, kind in ((CLASSES[0], 0), ("all classes", None)):
            above = results.difference(runs[first, first], runs[second, first], kind)
            values = [_deviating(results.scatter(run, kind)) for run in runs.values()]
            rows.append([inputs, name, *values, _text(above)])
    return _table(head, rows)


def _by_weather(results: Results) -> str:
    """Return precision by weather of training and test, with the scatter of trainings."""
    columns = [(frames, weather) for frames in ("all", "clear") for weather in ("clear", "rain")]
    named = {"all": "both", "clear": "clear"}
    head = ["network sees", "class", *(f"trained on {named[one]}, tested in {other}" for one, other in columns)]
    head.append("tested in rain: both above clear")
    rows = []
    for inputs in INPUTS:
        for name, kind in ((CLASSES[0], 0), ("all classes", None)):
            runs = {frames: results.runs(inputs, results.best, frames) for frames in named}
            values = [_deviating(results.scatter(runs[frames], kind, weather)) for frames, weather in columns]
            above = _text(results.difference(runs["all"], runs["clear"], kind, "rain")) if all(runs.values()) else "-"
            rows.append([inputs, name, *values, above])
    return _table(head, rows)


def _by_frames(results: Results) -> str:
    """Return the mean by how many frames of how many seeds were trained on."""
    rows = []
    for inputs in INPUTS:
        for frames in ("one seed", "three seeds, thinned", "three seeds", "all"):
            runs = results.runs(inputs, results.best, frames)
            if runs:
                count = np.mean([results.outcomes[run].num_frames for run in runs])
                rows.append([inputs, frames, f"{count:.0f}", _text(results.value(runs))])
    return _table(["network sees", "trained on", "frames", "mean AP"], rows)
