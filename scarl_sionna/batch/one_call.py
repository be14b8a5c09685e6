"""``ss.export``: what the command does, as one call."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import fields
from pathlib import Path
from typing import Any, Literal, cast

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from scarl_sionna.core.errors import InputTypeError, UnknownNameError
from scarl_sionna.core.settings.radar import RadarSettings
from scarl_sionna.scenario.spec.named import scenario_of
from scarl_sionna.scenario.spec.scenario import ScenarioSpec

from .driver import ExportSettings
from .driver import export as run
from .report import ExportReport

OnProgress = Callable[[int, int], None]
"""Called with the frames that are done and the frames in all."""

Scenario = ScenarioSpec | str | Path


def export(
    scenarios: Scenario | Iterable[Scenario],
    out: str | Path,
    workers: int = 0,
    *,
    radar: RadarSettings | None = None,
    on_progress: OnProgress | Literal["bar"] | None = None,
    **settings: object,
) -> ExportReport:
    """Make a dataset of scenarios, or what is missing of it: the same call goes on where it was stopped.

    ``ss.export(["cut_in", "drive.yaml"], "out/", workers=2)``, then ``ss.open_dataset("out/")``.

    Parameters
    ----------
    scenarios : ScenarioSpec, str, path, or several of them
        Scenarios, their files (.yaml, .json), names of ready scenarios, or names of scenes; all have the same rig. For
        many drives of one, see :class:`scarl_sionna.batch.Sweep`.
    out : path or str
        Folder of the dataset, or its address in an object store (``s3://bucket/data``).
    workers : int
        Processes on this machine; 0: in this process. The bytes do not depend on it. A script that asks for some needs
        ``if __name__ == "__main__":``, as every program that starts processes.
    radar : RadarSettings, optional
        The fields that are set in it replace those of every scenario: method, tolerance, noise and the like.
    on_progress : callable or "bar"
        Called with the frames done and in all; ``"bar"`` draws a progress bar, in a notebook, too.
    **settings
        Further fields of :class:`scarl_sionna.batch.ExportSettings`: ``overwrite``, ``licence``, ``on_error``, ...

    Returns
    -------
    ExportReport

    Raises
    ------
    InputTypeError
        If a scenario is neither a specification nor a text nor a path.
    UnknownNameError
        If there is no such scenario, scene or setting.
    OutputError
        If the folder cannot be written, is in use, or holds frames of another configuration.
    ExportError
        If a frame fails, or a worker dies again and again.
    """
    known = [item.name for item in fields(ExportSettings)]
    for name in settings:
        if name not in known:
            raise UnknownNameError("setting of an export", name, known)
    several = [scenarios] if isinstance(scenarios, ScenarioSpec | str | Path) else list(scenarios)
    chosen = [_scenario(item) for item in several]
    if radar is not None:
        chosen = [item.with_(radar=radar if item.radar is None else item.radar.merged(radar)) for item in chosen]
    if on_progress is not None and on_progress != "bar" and not callable(on_progress):
        raise InputTypeError("on_progress", on_progress, 'a function or "bar"', "leave it out for no progress")
    chosen_settings = ExportSettings(workers=workers, **cast("dict[str, Any]", settings))
    with _bar() if on_progress == "bar" else nullcontext(on_progress or (lambda done, total: None)) as report:
        return run(chosen, out, chosen_settings, on_event=_Progress(report))


@contextmanager
def _bar() -> Iterator[OnProgress]:
    """Yield a callback that draws a progress bar, in a terminal or a notebook."""
    columns = (TextColumn("frames"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TimeRemainingColumn())
    with Progress(*columns) as progress:
        task = progress.add_task("export", total=None)
        yield lambda done, total: progress.update(task, completed=done, total=total)


def _scenario(item: Scenario) -> ScenarioSpec:
    if isinstance(item, ScenarioSpec):
        return item
    if not isinstance(item, str | Path):
        raise InputTypeError(
            "scenarios", item, "a ScenarioSpec", "give scenarios, their files, or names: ss.export('cut_in', out)"
        )
    return scenario_of(str(item))


class _Progress:
    """Counts frames as an export tells of them."""

    def __init__(self, report: OnProgress) -> None:
        self._report, self._done, self._total = report, 0, 0

    def __call__(self, kind: str, data: dict[str, Any]) -> None:
        if kind == "plan":
            self._done, self._total = int(data["done"]), int(data["frames"])
        elif kind == "frame":
            self._done += 1
        else:
            return
        self._report(self._done, self._total)
