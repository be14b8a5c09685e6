"""Commands of datasets: export, verify, preview."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeVar

import typer
from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from scarl_sionna.core.errors import ParameterRangeError, UnknownNameError
from scarl_sionna.scenario.drawn import drawn_text
from scarl_sionna.scenario.spec.named import SCENARIO_FILES, scenario_of
from scarl_sionna.scenario.spec.scenario import ScenarioSpec, scenario_names

from .common import (
    EXIT_DAMAGED,
    EXIT_INCOMPLETE,
    EXIT_UNFINISHED,
    collected_warnings,
    completing,
    ready_names,
    reported,
)
from .options import ScenarioOptions, grouped_options, scenario_options

if TYPE_CHECKING:
    from scarl_sionna.batch import ExportReport, ExportSettings, Sweep

app = typer.Typer()


@dataclass(frozen=True)
class _Job:
    """Options of which drives a dataset is made of, and how."""

    seeds: Annotated[
        str | None,
        typer.Option(metavar="A:B", help="A drive for each seed: 0:1900 (1900 left out), 0:100:5, or 3,7,9."),
    ] = None
    splits: Annotated[
        str | None,
        typer.Option(metavar="TRAIN,VAL,TEST", help="Shares, for instance 0.8,0.1,0.1; variants of a drive together."),
    ] = None
    workers: Annotated[int, typer.Option(min=0, help="Processes on this machine (0: in this process).")] = 0
    scheduler: Annotated[
        str | None, typer.Option(help="Address of a Dask scheduler, for instance tcp://host:8786.")
    ] = None
    shard: Annotated[
        str | None,
        typer.Option(metavar="i/n", help="Only every n-th shard from the i-th (0-based) on, for jobs of an array."),
    ] = None
    plan: Annotated[
        Path | None,
        typer.Option(
            help="Plan of all drives that jobs of an array share: read if it is there, else computed once and written."
        ),
    ] = None
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Measure one frame, show size and time, write nothing.")
    ] = False
    on_error: Annotated[
        str, typer.Option(metavar="record|raise", help="A frame that fails: go on without it, or stop.")
    ] = "raise"

    def sweep(self, grid: Mapping[str, Sequence[object]]) -> Sweep:
        """Return the sweep over seeds and the values of fields."""
        from scarl_sionna.batch.sweep import Sweep, parse_seeds

        seeds = () if self.seeds is None else parse_seeds(self.seeds)
        if self.splits is None:
            return Sweep(seeds, grid)
        try:
            train, val, test = (float(share) for share in self.splits.split(","))
        except ValueError:
            raise ParameterRangeError("--splits", self.splits, "three numbers, for instance 0.8,0.1,0.1") from None
        return Sweep(seeds, grid, (train, val, test))


@dataclass(frozen=True)
class _Stored:
    """Options of what the folder of a dataset holds."""

    shard_frames: Annotated[
        int,
        typer.Option(
            min=0, max=1024, help="Frames in a shard, the unit of work (0: a quarter of all frames, but 3 to 8)."
        ),
    ] = 0
    radar_format: Annotated[
        str, typer.Option(metavar="int16|complex64", help="I/Q codes with their scale, or the beat signal.")
    ] = "int16"
    layout: Annotated[
        str, typer.Option(metavar="packed|files", help="Two files a shard, or one for each image and array.")
    ] = "packed"
    licence: Annotated[str, typer.Option(help="For the dataset card.")] = "not stated"
    description: Annotated[str, typer.Option(help="For the dataset card.")] = ""
    scratch: Annotated[
        Path | None, typer.Option(help="Folder for what is not finished, where --out is an address.")
    ] = None
    overwrite: Annotated[
        bool,
        typer.Option("--overwrite", help="Remove the dataset in the folder first; files that are not its own stay."),
    ] = False


@app.command()
@scenario_options
@grouped_options("job", "stored")
def export(
    context: typer.Context,
    chosen: ScenarioOptions,
    scenarios: Annotated[
        list[str],
        typer.Argument(
            metavar="SCENARIO...",
            help="Scenario files (.yaml, .json, .xosc), names of ready scenarios or of scenes.",
            autocompletion=completing(ready_names),
        ),
    ],
    out: Annotated[str, typer.Option(help="Folder of the dataset, or its address: s3://bucket/data.")],
    job: _Job,
    stored: _Stored,
) -> None:
    """Make a dataset of scenarios, or what is missing of it. Options about scenarios hold for each of them.

    However it was stopped, the same command goes on where it was; the bytes do not depend on the number of workers.
    """
    kept = f"go on with the same command; finished frames are kept in {out}"
    with reported(context, kept), collected_warnings(context):
        single, grid = chosen.divided()
        specs = job.sweep(grid).apply(single.apply(scenario_of(text)) for text in scenarios)
        settings = _settings(job, stored)
        if text := drawn_text(specs):
            typer.echo(text)
        if job.dry_run:
            from scarl_sionna.batch.estimate import estimate
            from scarl_sionna.batch.plan import plan_export

            typer.echo(str(estimate(plan_export(specs, settings.options, plan_file=job.plan), out, settings)))
            return
        report = _export(specs, out, settings)
        typer.echo(str(report))
        if report.failed:
            raise typer.Exit(EXIT_INCOMPLETE)


def _settings(job: _Job, stored: _Stored) -> ExportSettings:
    """Return the settings of an export that a command line says."""
    part = None if job.shard is None else _part(job.shard)
    from scarl_sionna.batch import ExportSettings
    from scarl_sionna.dataset.encoding import StoreOptions

    return ExportSettings(
        job.workers,
        job.scheduler,
        part,
        _choice("on-error", job.on_error, "record", "raise"),
        StoreOptions(
            stored.shard_frames,
            _choice("radar-format", stored.radar_format, "int16", "complex64"),
            layout=_choice("layout", stored.layout, "packed", "files"),
        ),
        stored.overwrite,
        stored.licence,
        stored.description,
        job.plan,
        stored.scratch,
    )


@app.command()
def verify(
    context: typer.Context,
    dataset: Annotated[str, typer.Argument(help="Folder of the dataset, or its address.")],
    repair: Annotated[
        bool, typer.Option("--repair", help="Remove damaged shards, so that the next export makes them again.")
    ] = False,
) -> None:
    """Check every checksum, count and cross-reference of a dataset.

    Exit code 0: whole and complete; 1: damaged; 2: no dataset; 3: whole, not complete.
    """
    with reported(context, "not all was checked"), collected_warnings(context):
        from scarl_sionna.dataset.findings import describe
        from scarl_sionna.dataset.verify import verify as check

        columns = (TextColumn("shards"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TextColumn("left"))
        with Progress(*columns, TimeRemainingColumn(), console=Console(stderr=True)) as progress:
            task = progress.add_task("verify", total=None)
            found = check(
                dataset, repair=repair, on_shard=lambda done, total: progress.update(task, completed=done, total=total)
            )
        typer.echo(describe(found))
        if not found.complete:
            raise typer.Exit(EXIT_UNFINISHED if found.ok else EXIT_DAMAGED)


@dataclass(frozen=True)
class _Sheet:
    """Options of a dataset's contact sheet."""

    frame: Annotated[int, typer.Option(help="Dataset: position of the frame; negative: from the end.")] = 0
    suite: Annotated[
        str | None, typer.Option(help="Dataset: group of sensors (default: front_center, or the first).")
    ] = None


@app.command()
@scenario_options
@grouped_options("sheet")
def preview(
    context: typer.Context,
    chosen: ScenarioOptions,
    target: Annotated[
        str,
        typer.Argument(
            help="Folder or address of a dataset; or a scenario: file, ready scenario, or scene name.",
            autocompletion=completing(ready_names),
        ),
    ],
    sheet: _Sheet,
    out: Annotated[
        Path | None,
        typer.Option(help="File to write (default: preview.png of a dataset, <name>.gif of a scenario; or .mp4)."),
    ] = None,
    strip: Annotated[bool, typer.Option(help="Scenario: render the ego vehicle's view five times, too.")] = True,
) -> None:
    """Draw a dataset's frame as a contact sheet, or a scenario from above as an animation with a strip of renders."""
    with reported(context, "nothing was written"), collected_warnings(context):
        if not _is_scenario(target):
            if chosen.says_anything:
                raise ParameterRangeError(
                    "options about scenarios", target, "a scenario or a scene", "a dataset is shown as it is"
                )
            if "://" not in target and not Path(target).exists():
                raise UnknownNameError(
                    "scenario or scene", target, ready_names(), "or give a scenario file, or the folder of a dataset"
                )
            from scarl_sionna.app.demo import write_sheet

            path = write_sheet(target, sheet.frame, out or Path("preview.png"), sheet.suite)
            typer.echo(f"contact sheet: {path}")
            return
        from scarl_sionna.app.preview import write_preview

        scenario = scenario_of(target)
        if Path(target).suffix not in SCENARIO_FILES and target not in scenario_names():
            scenario = scenario.with_(duration=8.0)  # a scene's own drive
        scenario = chosen.apply(scenario)
        if text := drawn_text([scenario]):
            typer.echo(text)
        columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
        with Progress(*columns, console=Console(stderr=True)) as progress:
            tasks: dict[str, Any] = {}

            def on_progress(stage: str, done: int, total: int) -> None:
                if stage not in tasks:
                    tasks[stage] = progress.add_task(stage, total=total)
                progress.update(tasks[stage], completed=done, total=total)

            made = write_preview(
                scenario,
                out or Path(f"{scenario.scene_name}.gif"),
                frame_rate=chosen.fields["frame_rate"],
                strip=strip,
                on_progress=on_progress,
            )
        typer.echo(f"animation: {made.animation} ({made.num_frames} pictures)")
        if made.strip is not None:
            typer.echo(f"renders: {made.strip}")


def _is_scenario(target: str) -> bool:
    """Return whether a text names a scenario or a scene, and no dataset."""
    path = Path(target)
    return path.suffix in (*SCENARIO_FILES, ".xml") or (not path.is_dir() and target in ready_names())


def show_dataset(place: str) -> str:
    """Return what a dataset holds, for people."""
    from scarl_sionna.dataset.readers.reader import open_dataset

    dataset = open_dataset(place)
    manifest = dataset.manifest
    rows = [row for items in manifest.shards.values() for row in items if row]
    lines = [
        f"Dataset {place}: {len(dataset)} frames in {len(dataset.scenes)} scenes, {len(dataset.sensors)} sensors",
        f"schema version {manifest.schema_version}, configuration {manifest.configuration_hash[:16]}, "
        f"{sum(row[3] for row in rows) / 1e6:.1f} MB, licence: {manifest.licence}",
    ]
    lines += [
        f"  scene {name}: {len(dataset.scene(name))} of {item.num_frames} frames, {item.split}"
        for name, item in manifest.scenes.items()
    ]
    lines += [f"  sensor {name}: {kind}" for name, kind in dataset.sensors.items()]
    return "\n".join(lines)


def _part(text: str) -> tuple[int, int]:
    match = re.fullmatch(r"(\d+)/(\d+)", text)
    if not match or int(match[1]) >= int(match[2]):
        raise ParameterRangeError("--shard", text, "i/n with 0 <= i < n, for instance 0/4")
    return int(match[1]), int(match[2])


ChoiceT = TypeVar("ChoiceT", bound=str)


def _choice(name: str, value: str, *allowed: ChoiceT) -> ChoiceT:
    if value not in allowed:
        raise ParameterRangeError(f"--{name}", value, " or ".join(allowed))
    return next(choice for choice in allowed if choice == value)


def _export(scenarios: list[ScenarioSpec], out: str, settings: ExportSettings) -> ExportReport:
    """Run an export under a progress bar."""
    columns = (
        BarColumn(bar_width=12),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
        TextColumn("{task.fields[rate]}"),
        TextColumn("{task.description}"),
    )
    with Progress(*columns, console=Console(stderr=True), speed_estimate_period=3600.0) as progress:
        task = progress.add_task("starting", total=None, rate="")
        from scarl_sionna.batch import export as run  # takes seconds: under the bar

        show = _Display(progress, task)
        return run(scenarios, out, settings, on_event=show)


class _Display:
    """Shows the events of an export on a progress bar."""

    def __init__(self, progress: Progress, task: TaskID) -> None:
        self._progress, self._task = progress, task
        self._done, self._first, self._bytes, self._failed = 0.0, 0, 0, 0

    def __call__(self, kind: Literal["plan", "stage", "frame", "shard"] | str, data: dict[str, Any]) -> None:
        """Take an event."""
        if kind == "plan":
            self._done = self._first = data["done"]
            self._progress.reset(self._task, total=data["frames"], completed=data["done"], rate="", description="scene")
        elif kind == "stage":
            self._progress.update(self._task, completed=self._done + data["part"], description=data["stage"])
        elif kind == "frame":
            self._done += 1
            self._bytes += data["bytes"]
            self._failed += "failed" in data
            elapsed = self._progress.tasks[0].elapsed or 1e-9
            failed = f", {self._failed} failed" if self._failed else ""
            rate = f"{(self._done - self._first) / elapsed:.2f} /s, {self._bytes / 1e6:.1f} MB{failed}"
            self._progress.update(self._task, completed=self._done, rate=rate)
