"""The command that calibrates materials: argument parsing, progress and messages only."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from .common import EXIT_INCOMPLETE, collected_warnings, fail, reported

if TYPE_CHECKING:
    from scarl_sionna.calibration import CalibrationResult

app = typer.Typer()


@app.command()
def calibrate(
    context: typer.Context,
    problem: Annotated[Path, typer.Argument(help="Problem file (.yaml), see docs/calibration.md.", show_default=False)],
    out: Annotated[Path, typer.Option(help="Folder for report.html, estimate.json and materials.toml.")] = Path(
        "report"
    ),
) -> None:
    """Estimate radio material parameters from measurements, with intervals and a report."""
    with reported(context, "nothing was written"), collected_warnings(context):
        columns = (TextColumn("starts"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TextColumn("left"))
        with Progress(*columns, TimeRemainingColumn(), console=Console(stderr=True)) as progress:
            task = progress.add_task("calibrate", total=None)
            from scarl_sionna.calibration import CalibrationProblem, calibrate  # takes seconds: under the bar
            from scarl_sionna.calibration.report import write_report

            spec = CalibrationProblem.load(problem)
            result = calibrate(spec, lambda done, total: progress.update(task, completed=done, total=total))
            page = write_report(result, out)
        typer.echo(_table(result))
        typer.echo(f"report: {page}")
    if not result.converged:
        fail(f"not converged: {result.reason}", EXIT_INCOMPLETE)


def _table(result: CalibrationResult) -> str:
    """Return the estimates and the misfits as text."""
    width = max(len(name) for name in result.names)
    lines = [
        f"{name:{width}}  {value:.5g}  (95 %: {low:.5g} to {high:.5g})"
        for name, value, (low, high) in zip(result.names, result.values, result.interval, strict=True)
    ]
    for channel in result.model.channels:
        kind = "held out" if channel.spec.held_out else "used"
        before, after = result.rms(channel, result.model.start), result.rms(channel)
        lines.append(f"{channel.spec.name} ({kind}): rms {before:.4g} before, {after:.4g} after")
    for weak in result.weak:
        lines.append("not identified: " + " ".join(f"{value:+.2f} {name}" for name, value in weak.weights.items()))
    if result.misfit > 1.1:
        lines.append(
            "the noise and the priors stated do not explain the misfit: "
            f"take the intervals {result.misfit:.2g} times as wide"
        )
    return "\n".join(lines)
