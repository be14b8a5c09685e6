"""Command of scenes: what one holds, and how it looks from above."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from scarl_sionna.core.errors import OutputError
from scarl_sionna.scene.document.find import scene_names

from .common import collected_warnings, completing, reported

app = typer.Typer()


@app.command()
def scene(
    context: typer.Context,
    name: Annotated[
        str,
        typer.Argument(
            help="Name of a scene, or path of a Mitsuba XML or a map (.xodr, .osm, .net.xml, .json).",
            autocompletion=completing(scene_names),
        ),
    ],
    preview: Annotated[bool, typer.Option("--preview", help="Write a picture from above.")] = False,
    out: Annotated[Path | None, typer.Option(help="File of the picture (default: <name>.png).")] = None,
    detail: Annotated[str, typer.Option(help="detailed or light.")] = "detailed",
    variant: Annotated[
        int,
        typer.Option(
            help="0: the scene, or what the map states. Else the seed of another, or of a map's surroundings."
        ),
    ] = 0,
) -> None:
    """Print what a scene holds, and what of a map's file is not used, by line."""
    with reported(context, "nothing was written"), collected_warnings(context):
        from scarl_sionna.engine.load import load_scene  # takes seconds

        world = load_scene(name, variant=variant, detail=detail)
        typer.echo(repr(world))
        findings = world.document.info.get("findings", [])
        for finding in findings:
            typer.echo(finding)
        if not preview:
            return
        import matplotlib

        matplotlib.use("Agg")
        axis = world.plot()
        target = out or Path(f"{world.name}.png")
        try:
            axis.figure.savefig(target, dpi=110, bbox_inches="tight")  # type: ignore[union-attr]
        except (OSError, ValueError) as error:
            raise OutputError(f"cannot write {target}: {error}; choose a file that you may write to") from error
        typer.echo(f"picture: {target}")
