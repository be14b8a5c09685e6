"""Command line: argument parsing, progress and messages only."""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table

from scarl_sionna import cli_calibrate, cli_export
from scarl_sionna.cli_common import collected_warnings, reported
from scarl_sionna.core.errors import OutputError
from scarl_sionna.scenario.spec import ScenarioSpec

if TYPE_CHECKING:
    from scarl_sionna.demo import RunSummary

COMMANDS_OF_VIEWS = "scarl_sionna.cli_views"

app = typer.Typer(
    name="scarl-sionna",
    help="Synchronized synthetic camera, lidar and MIMO radar data of driving scenes.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
app.add_typer(cli_export.app)
app.add_typer(cli_calibrate.app)
if find_spec(COMMANDS_OF_VIEWS) is not None:
    app.add_typer(import_module(COMMANDS_OF_VIEWS).app)
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
def demo(
    context: typer.Context,
    out: Annotated[Path, typer.Option(help="Folder to write to.")] = Path("demo_out"),
    scenario: Annotated[
        str | None,
        typer.Option(help="Scenario file (.yaml, .json) or the name of a ready scenario; the options below win over it."),
    ] = None,
    frames: Annotated[int | None, typer.Option(help=f"Number of frames (default: {_DEFAULTS.num_frames}).")] = None,
    duration: Annotated[float | None, typer.Option(help="Length instead of a number of frames [s].")] = None,
    quality: Annotated[str | None, typer.Option(help=f"draft or full (default: {_DEFAULTS.quality}).")] = None,
    scene: Annotated[
        str | None, typer.Option(help=f"Scene name or path of an XML file (default: {_DEFAULTS.scene}).")
    ] = None,
    variant: Annotated[
        int | None, typer.Option(help=f"Variant of the scene, built on first use (default: {_DEFAULTS.variant}).")
    ] = None,
    detail: Annotated[
        str | None, typer.Option(help=f"Level of geometry, light or detailed (default: {_DEFAULTS.detail}).")
    ] = None,
    lighting: Annotated[
        str | None, typer.Option(help="day, dusk, night, overcast or rain (default: that of the scene).")
    ] = None,
    weather: Annotated[
        str | None, typer.Option(help="clear, drizzle, rain, heavy_rain, fog, dense_fog or snow (default: clear).")
    ] = None,
    rig: Annotated[
        str | None,
        typer.Option(
            help="front: one suite of five sensors; scarl: six suites all around; or the path of a rig file "
            f"(default: {_DEFAULTS.rig})."
        ),
    ] = None,
    seed: Annotated[int | None, typer.Option(help=f"Root of all random numbers (default: {_DEFAULTS.seed}).")] = None,
    frame_rate: Annotated[
        float | None, typer.Option(help=f"Frames a second [Hz] (default: {_DEFAULTS.frame_rate:g}).")
    ] = None,
    overwrite: Annotated[
        bool,
        typer.Option(
            "--overwrite", help="Remove the dataset in the folder first; without it its frames are kept. Other files always stay."
        ),
    ] = False,
) -> None:
    """Simulate consecutive frames of a scene, write them to a folder, and draw a contact sheet.

    A run that was stopped goes on where it was: frames of the same settings that are complete are kept.
    """
    given = {
        "num_frames": frames,
        "duration": duration,
        "quality": quality,
        "scene": scene,
        "variant": variant,
        "detail": detail,
        "lighting": lighting,
        "weather": weather,
        "rig": rig,
        "seed": seed,
        "frame_rate": frame_rate,
    }
    changes = {name: value for name, value in given.items() if value is not None}
    with reported(context, f"go on with the same command; finished frames are kept in {out}"):
        base = cli_export.named_scenario(scenario) if scenario else _DEFAULTS
        started = perf_counter()
        summary = _run(base.with_(**changes), out, overwrite)
        _print_summary(summary, perf_counter() - started)


@app.command()
def rcs(
    context: typer.Context,
    mesh: Annotated[Path, typer.Argument(help="Triangle mesh in metres (PLY, OBJ, STL, glTF).")],
    freq: Annotated[float, typer.Option(help="Frequency [Hz].")] = 77e9,
    cut: Annotated[
        str,
        typer.Option(help="azimuth: phi from -180 to 180 deg at theta 90; elevation: theta from 0 to 180 at phi 0."),
    ] = "azimuth",
    fixed: Annotated[float | None, typer.Option(help="The angle that does not turn [deg].")] = None,
    step: Annotated[float, typer.Option(help="Step of the angle [deg].")] = 1.0,
    polarization: Annotated[str, typer.Option(help="Receive letter first; several with commas.")] = "VV,HH",
    material: Annotated[str, typer.Option(help="metal, or another radio material by name.")] = "metal",
    plot: Annotated[Path | None, typer.Option(help="Image file (default: the mesh's name with _rcs.png).")] = None,
) -> None:
    """Print the monostatic radar cross section of a mesh over angle [dBsm], and plot it."""
    with reported(context, "nothing was written"):
        from scarl_sionna.radar.rcs import rcs_cut  # takes seconds

        names = [name.strip() for name in polarization.split(",") if name.strip()]
        console = Console(stderr=True)
        columns = (TextColumn("angles"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TextColumn("left"))
        with Progress(*columns, TimeRemainingColumn(), console=console) as progress:
            task = progress.add_task("rcs", total=None)
            result = rcs_cut(
                mesh, freq, cut, names, material, step_deg=step, fixed_angle_deg=fixed,  # type: ignore[arg-type]
                on_progress=lambda done, total: progress.update(task, completed=done, total=total),
            )  # fmt: skip
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
    with reported(context, "nothing was shown"):
        if dataset is not None:
            typer.echo(cli_export.show_dataset(dataset))
            return
        from scarl_sionna.world.doctor import doctor_report

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
        from scarl_sionna.demo import run  # takes seconds: under the bar

        def show(stage: str, num_done: float) -> None:
            progress.update(task, description=stage, completed=num_done)

        with collected_warnings():
            return run(scenario, out, overwrite=overwrite, on_stage=show)


def _print_summary(summary: RunSummary, seconds: float) -> None:
    """Print what was done, with the time of each stage."""
    stages = ", ".join(f"{stage} {taken:.1f}" for stage, taken in summary.timings.items())
    kept = f", {summary.num_kept} kept from before" if summary.num_kept else ""
    typer.echo(f"{summary.num_written} frames written{kept} in {seconds:.1f} s ({stages})")
    typer.echo(f"dataset: {summary.folder}   contact sheet: {summary.contact_sheet}")


if __name__ == "__main__":
    app()
