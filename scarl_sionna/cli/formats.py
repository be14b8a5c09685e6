"""Commands that show a dataset, count it and write it in other formats: arguments, progress and messages only."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
import yaml
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from scarl_sionna.core.errors import ParameterRangeError, UnknownNameError
from scarl_sionna.core.untrusted.yaml_text import parse_yaml
from scarl_sionna.dataset.formats import FORMATS

from .common import collected_warnings, reported
from .options import grouped_options

if TYPE_CHECKING:
    from scarl_sionna.dataset.formats import FrameSource

app = typer.Typer()

_COMMON = ("data", "out", "overwrite", "on_progress")
_OVERWRITE = Annotated[bool, typer.Option("--overwrite", help="Replace what an earlier conversion wrote.")]


@dataclass(frozen=True)
class _Frames:
    """Options of which frames are taken."""

    source: Annotated[str, typer.Argument(help="Dataset folder or URL.")]
    scene: Annotated[
        list[str] | None, typer.Option("--scene", help="Scene to take; several times for several (default: all).")
    ] = None
    split: Annotated[
        list[str] | None, typer.Option("--split", help="Split to take, for instance val; several times for several.")
    ] = None
    frames: Annotated[int | None, typer.Option(help="Take the first frames of each scene only.")] = None

    def read(self) -> FrameSource:
        """Return the frames."""
        from scarl_sionna.dataset.formats import as_source

        return as_source(self.source).subset(self.scene or (), self.frames, self.split or ())


@app.command()
@grouped_options("taken")
def convert(
    context: typer.Context,
    taken: _Frames,
    form: Annotated[
        str,
        typer.Argument(metavar="FORMAT", help=f"One of {', '.join(FORMATS)}.", show_default=False),
    ],
    out: Annotated[Path, typer.Argument(help="Folder or file to write.", show_default=False)],
    option: Annotated[
        list[str] | None,
        typer.Option(
            help="Option of the format as name=value, for instance keyframe_every=5; several times for several."
        ),
    ] = None,
    overwrite: _OVERWRITE = False,
) -> None:
    """Write a dataset in a format that other tools read."""
    with reported(context, "nothing was written"), collected_warnings(context):
        from scarl_sionna.dataset.formats import convert as run

        if form not in FORMATS:
            raise UnknownNameError("format", form, FORMATS)
        chosen = FORMATS[form]
        module = import_module(f"scarl_sionna.dataset.formats.{chosen.module}")
        options = _options(option or [], getattr(module, chosen.function))
        data = taken.read()
        with _progress() as report:
            written = run(data, form, out, overwrite=overwrite, on_progress=report, **options)
        typer.echo(f"{data.num_frames} frames written to {written}")


@app.command()
@grouped_options("taken")
def view(
    context: typer.Context,
    taken: _Frames,
    save: Annotated[Path | None, typer.Option(help="Write an .rrd file instead of opening the viewer.")] = None,
    overwrite: _OVERWRITE = False,
) -> None:
    """Show a dataset in the Rerun viewer: images, lidar, radar points and maps, boxes, over time."""
    with (
        reported(context, "the viewer keeps what it has" if save is None else "nothing was written"),
        collected_warnings(context),
    ):
        from scarl_sionna.dataset.formats.rerun import export_rerun, view_rerun

        data = taken.read()
        with _progress() as report:
            if save is None:
                view_rerun(data, on_progress=report)
            else:
                export_rerun(data, save, overwrite=overwrite, on_progress=report)
        typer.echo(f"{data.num_frames} frames " + ("shown" if save is None else f"written to {save}"))


@dataclass(frozen=True)
class _Counting:
    """Options of what is counted."""

    every: Annotated[int, typer.Option(min=1, help="Count only every n-th frame of each scene.")] = 1
    pfa: Annotated[float, typer.Option(help="Probability of false alarm of the radar detector.")] = 1e-6
    margin: Annotated[float, typer.Option(help="A radar point this far from a box is still the object's [m].")] = 0.5
    most_points: Annotated[
        int | None, typer.Option(min=1, help="Keep the strongest points of a radar and frame only (default: all).")
    ] = None


@app.command()
@grouped_options("taken", "counting")
def stats(
    context: typer.Context,
    taken: _Frames,
    counting: _Counting,
    out: Annotated[Path, typer.Option(help="Page to write (HTML, one file).")] = Path("stats.html"),
) -> None:
    """Count what a dataset holds and write it as a page, beside published figures of other datasets.

    Radar points of objects against range, their RCS and SNR, class balance, occlusion, weather.
    """
    with reported(context, "nothing was written"), collected_warnings(context):
        from scarl_sionna.dataset.statistics.collect import dataset_statistics

        data = taken.read()
        with _progress() as report:
            found = dataset_statistics(data, **asdict(counting), on_progress=report)
        typer.echo(str(found))
        typer.echo(f"page: {found.save(out)}")


@app.command()
def archive(
    context: typer.Context,
    source: Annotated[str, typer.Argument(help="Dataset folder or URL.")],
    out: Annotated[Path, typer.Argument(help="Folder to write.", show_default=False)],
    restore: Annotated[bool, typer.Option("--restore", help="Take a dataset out of its archives again.")] = False,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace archives that were written before.")] = False,
) -> None:
    """Put a finished dataset into one ZIP file a shard, for quotas and object stores; it is read as it is."""
    with reported(context, "nothing was written"), collected_warnings(context):
        from scarl_sionna.dataset.archive import archive_dataset, restore_dataset

        if restore and overwrite:
            raise ParameterRangeError("--overwrite", "given", "without --restore", "choose a folder that is not there")
        with _progress("shards") as report:
            if restore:
                written = restore_dataset(source, out, on_progress=report)
            else:
                written = archive_dataset(source, out, overwrite=overwrite, on_progress=report)
        typer.echo(f"{source} written to {written}")


@app.command()
def repack(
    context: typer.Context,
    source: Annotated[str, typer.Argument(help="Dataset folder or URL.")],
    out: Annotated[Path, typer.Argument(help="Folder to write.", show_default=False)],
    layout: Annotated[str, typer.Option(metavar="packed|files", help="Layout of the new dataset.")] = "files",
) -> None:
    """Write a dataset with a file for each image and array, or with two files a shard; all bytes stay the same."""
    with reported(context, "what is copied stays; go on with the same command"), collected_warnings(context):
        from scarl_sionna.dataset.repack import repack_dataset

        if layout not in ("packed", "files"):
            raise ParameterRangeError("--layout", layout, "packed or files")
        with _progress("shards") as report:
            written = repack_dataset(source, out, "packed" if layout == "packed" else "files", on_progress=report)
        typer.echo(f"{source} written to {written}")


@contextmanager
def _progress(what: str = "frames") -> Iterator[Callable[[int, int], None]]:
    """Yield a function that moves a progress bar."""
    columns = (TextColumn(what), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TextColumn("left"))
    with Progress(*columns, TimeRemainingColumn(), console=Console(stderr=True)) as progress:
        task = progress.add_task("convert", total=None)
        yield lambda done, total: progress.update(task, completed=done, total=total)


def _options(given: list[str], function: Callable[..., Any]) -> dict[str, Any]:
    """Return name=value options of an exporter, values read as YAML; ``none`` is None where that is allowed."""
    parameters = inspect.signature(function).parameters
    known = [name for name in parameters if name not in _COMMON]
    out = {}
    for text in given:
        name, sign, value = text.partition("=")
        if not sign:
            raise ParameterRangeError("--option", repr(text), "name=value", f"names: {', '.join(known)}")
        if name not in known:
            raise UnknownNameError("option of this format", name, known)
        try:
            is_none = value.strip().lower() == "none" and "None" in str(parameters[name].annotation)
            out[name] = None if is_none else parse_yaml(value)
        except yaml.YAMLError as error:
            raise ParameterRangeError(
                f"--option {name}", repr(value), "a number, true, false, a text or a list"
            ) from error
    return out
