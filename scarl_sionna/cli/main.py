"""Command line: argument parsing, progress and messages only."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table

from scarl_sionna.core.errors import OutputError
from scarl_sionna.scenario.spec.named import named_scenario
from scarl_sionna.scenario.spec.scenario import ScenarioSpec, scenario_names
from scarl_sionna.scene.document.find import scene_names

from . import calibrate, datasets, formats, scenes
from .common import collected_warnings, completing, reported
from .options import ScenarioOptions, grouped_options, scenario_options

if TYPE_CHECKING:
    from scarl_sionna.app.demo import RunSummary

app = typer.Typer(
    name="scarl-sionna",
    help="Synchronized synthetic camera, lidar and MIMO radar data of driving scenes.",
    no_args_is_help=True,
    rich_markup_mode=None,  # the markup takes [s], [m] and [deg] for its own tags
    pretty_exceptions_enable=False,
)
app.add_typer(datasets.app)
app.add_typer(calibrate.app)
app.add_typer(formats.app)
app.add_typer(scenes.app)
_DEFAULTS = ScenarioSpec()
_STATUS_COLORS = {"ok": "green", "warn": "yellow", "missing": "red"}


def _show_version(asked: bool) -> None:
    if asked:
        from importlib.metadata import version

        typer.echo(f"scarl-sionna {version('scarl-sionna')}")
        raise typer.Exit


@app.callback()
def _global_options(
    context: typer.Context,
    version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version and exit.")
    ] = False,
    debug: Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")] = False,
) -> None:
    context.obj = {"debug": debug}


@app.command()
@scenario_options
def demo(
    context: typer.Context,
    chosen: ScenarioOptions,
    out: Annotated[Path, typer.Option(help="Folder to write to.")] = Path("demo_out"),
    scenario: Annotated[
        str | None,
        typer.Option(
            help="Scenario file (.yaml, .json, .xosc) or the name of a ready scenario; the other options win over it.",
            autocompletion=completing(scenario_names),
        ),
    ] = None,
    scene: Annotated[
        str | None,
        typer.Option(
            help=f"Scene name or path of an XML file (default: {_DEFAULTS.scene}).",
            autocompletion=completing(scene_names),
        ),
    ] = None,
    overwrite: Annotated[
        bool,
        typer.Option(
            "--overwrite",
            help="Remove the dataset in the folder first; without it its frames are kept. Other files always stay.",
        ),
    ] = False,
) -> None:
    """Simulate consecutive frames of a scene, write them to a folder, and draw a contact sheet.

    A run that was stopped goes on where it was: frames of the same settings that are complete are kept.
    """
    kept = f"go on with the same command; finished frames are kept in {out}"
    with reported(context, kept), collected_warnings(context):
        base = named_scenario(scenario) if scenario else _DEFAULTS
        started = perf_counter()
        base = base if scene is None else base.with_(scene=scene)
        summary = _run(chosen.apply(base), out, overwrite)
        _print_summary(summary, perf_counter() - started)


@dataclass(frozen=True)
class _Cut:
    """Options of a cut of the radar cross section."""

    freq: Annotated[float, typer.Option(help="Frequency [Hz].")] = 77e9
    cut: Annotated[
        str,
        typer.Option(help="azimuth: phi from -180 to 180 deg at theta 90; elevation: theta from 0 to 180 at phi 0."),
    ] = "azimuth"
    fixed: Annotated[float | None, typer.Option(help="The angle that does not turn [deg].")] = None
    step: Annotated[float, typer.Option(help="Step of the angle [deg].")] = 1.0
    polarization: Annotated[str, typer.Option(help="Receive letter first; several with commas.")] = "VV,HH"
    material: Annotated[str, typer.Option(help="metal, or another radio material by name.")] = "metal"


@app.command()
@grouped_options("asked")
def rcs(
    context: typer.Context,
    mesh: Annotated[Path, typer.Argument(help="Triangle mesh in metres (PLY, OBJ, STL, glTF).")],
    asked: _Cut,
    plot: Annotated[Path | None, typer.Option(help="Image file (default: the mesh's name with _rcs.png).")] = None,
) -> None:
    """Print the monostatic radar cross section of a mesh over angle [dBsm], and plot it."""
    with reported(context, "nothing was written"), collected_warnings(context):
        from scarl_sionna.radar.rcs import rcs_cut  # takes seconds

        names = [name.strip() for name in asked.polarization.split(",") if name.strip()]
        console = Console(stderr=True)
        columns = (TextColumn("angles"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TextColumn("left"))
        with Progress(*columns, TimeRemainingColumn(), console=console) as progress:
            task = progress.add_task("rcs", total=None)
            result = rcs_cut(
                mesh,
                asked.freq,
                asked.cut,  # type: ignore[arg-type]
                names,
                asked.material,
                step_deg=asked.step,
                fixed_angle_deg=asked.fixed,
                on_progress=lambda done, total: progress.update(task, completed=done, total=total),
            )
        typer.echo(result.table())
        target = plot or Path(f"{mesh.stem}_rcs.png")
        try:
            result.plot(target)
        except OSError as error:
            raise OutputError(
                f"cannot write {target}: {error.strerror}; choose a file that you may write to"
            ) from error
        console.print(f"plot: {target}", highlight=False)


@app.command()
def info(
    context: typer.Context,
    dataset: Annotated[
        str | None, typer.Argument(help="Folder or address of a dataset, to show what it holds.")
    ] = None,
) -> None:
    """Show what was found on this machine, and the remedy for what is missing; or what a dataset holds."""
    with reported(context, "nothing was shown"), collected_warnings(context):
        if dataset is not None:
            typer.echo(datasets.show_dataset(dataset))
            return
        from scarl_sionna.engine.backend.doctor import doctor_report

        table = Table()
        for title in ("", "found", "status", "remedy"):
            table.add_column(title, overflow="fold")
        rows = doctor_report()
        for row in rows:
            color = _STATUS_COLORS.get(row.status, "red")
            table.add_row(escape(row.name), escape(row.found), f"[{color}]{row.status}[/{color}]", escape(row.remedy))
        Console().print(table)
        if any(row.status == "missing" for row in rows):
            raise typer.Exit(1)


def _run(scenario: ScenarioSpec, out: Path, overwrite: bool) -> RunSummary:
    """Run a scenario under a progress bar."""
    columns = (
        TextColumn("frames"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
        TextColumn("{task.description}"),
    )
    with Progress(*columns, console=Console(stderr=True), speed_estimate_period=3600.0) as progress:
        task = progress.add_task("starting", total=scenario.num_frames)
        from scarl_sionna.app.demo import run  # takes seconds: under the bar

        def show(stage: str, num_done: float) -> None:
            progress.update(task, description=stage, completed=num_done)

        return run(scenario, out, overwrite=overwrite, on_stage=show)


def _print_summary(summary: RunSummary, seconds: float) -> None:
    """Print what was done, with the time of each stage."""
    stages = ", ".join(f"{stage} {taken:.1f}" for stage, taken in summary.timings.items())
    kept = f", {summary.num_kept} kept from before" if summary.num_kept else ""
    typer.echo(f"{summary.num_written} frames written{kept} in {seconds:.1f} s ({stages})")
    typer.echo(f"dataset: {summary.folder}   contact sheet: {summary.contact_sheet}")
