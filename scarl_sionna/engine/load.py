"""Scenes by name or path, and actors put into them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from scarl_sionna.core.prompt.arguments import expect
from scarl_sionna.scene.document.find import find_scene
from scarl_sionna.scene.document.scene_file import read_document
from scarl_sionna.scene.document.staging import StagedActor
from scarl_sionna.scene.document.staging import stage as stage_document
from scarl_sionna.scene.materials.table import MaterialTable, load_materials

from .world import World

__all__ = ["load_scene", "stage"]


def load_scene(
    name_or_path: str | Path, materials: MaterialTable | None = None, *, variant: int = 0, detail: str = "detailed"
) -> World:
    """Load a scene.

    Parameters
    ----------
    name_or_path : str or Path
        A scene of ``scenes_xml`` (``"highway_guardrail"``), a scene of Sionna RT
        (``"simple_street_canyon_with_cars"``), or the path of a Mitsuba or Sionna XML; a ``scene.toml`` beside it
        states classes, materials and actors. Or the path of a map (``.xodr``, ``.osm``, ``.net.xml``), from which a
        scene is built into the cache folder on first use.
    materials : MaterialTable, optional
        Radio materials; default: the built-in table. See :func:`scarl_sionna.scene.materials.table.load_materials`.
    variant : int
        Of a scene of ``scenes_xml``: 0 is the one of the package, any other number the seed of another place of its
        kind, which is built on first use into a cache folder. Of a map: 0 is what its file states, any other number the
        seed of kerbs, verges, street furniture, trees and houses beside its roads where it states none.
    detail : str
        Level of geometry: ``"detailed"`` or ``"light"`` (few shapes and triangles). It goes for actors that name a
        model, too; of a scene given by its path only for those.

    Returns
    -------
    World

    Raises
    ------
    UnknownNameError
        If there is no such scene or level.
    SceneError, MeshError, MaterialError
        If its files are missing or broken, or a material is unknown.
    MapError
        If a map is broken; it names the line.
    ParameterRangeError
        If the variant is not allowed, or not 0 for a scene that has none (a user's XML, one of Sionna RT).

    Warns
    -----
    MapWarning
        If a map holds what is not used; ``world.document.info["findings"]`` lists it by line.
    """
    expect("name_or_path", name_or_path, (str, Path), "give the name of a scene or the path of an XML file")
    document = read_document(find_scene(name_or_path, variant, detail), detail)
    return World(document, materials or load_materials())


def stage(
    world: World | str | Path,
    actors: Sequence[StagedActor],
    ego: str | None = None,
    *,
    variant: int = 0,
    detail: str = "detailed",
) -> World:
    """Return a scene with actors put into it.

    Parameters
    ----------
    world : World, str or Path
        A loaded scene, which stays as it is, or what `load_scene` takes; with a name the scene is loaded once only.
    actors : sequence of StagedActor
    ego : str, optional
        The actor that carries the rig from now on; None: that of the scene.
    variant, detail
        As in `load_scene`; used where `world` is a name or a path.

    Raises
    ------
    SceneError, UnknownNameError
        If a name stands twice, or `ego` is no actor of the scene.
    """
    if isinstance(world, World):
        return world.with_actors(actors, ego)
    document = read_document(find_scene(world, variant, detail), detail)
    return World(stage_document(document, actors, ego), load_materials())
