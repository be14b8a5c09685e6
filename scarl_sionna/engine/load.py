"""Scenes by name or path, and actors put into them."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from scarl_sionna.core.errors import ScarlWarning
from scarl_sionna.core.prompt.arguments import expect
from scarl_sionna.scene.document.find import find_scene
from scarl_sionna.scene.document.scene_file import read_document
from scarl_sionna.scene.document.staging import StagedActor
from scarl_sionna.scene.document.staging import stage as stage_document
from scarl_sionna.scene.materials.table import MaterialTable, load_materials

from .world import World

__all__ = ["load_scene", "stage"]

FAR_OUT = 4096.0
"""What stands still wholly beyond this [m] has vertices in steps of 0.5 mm and more: float32. At 77 GHz echoes of round
bodies are within 0.5 dB up to 2 km, off by 1 dB from here on, by 3 dB at 10 km and by 10 dB and more at 20 km."""


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
    ScarlWarning
        If something stands still so far from the origin that its shape is lost in float32.
    """
    expect("name_or_path", name_or_path, (str, Path), "give the name of a scene or the path of an XML file")
    document = read_document(find_scene(name_or_path, variant, detail), detail)
    return _warned_of_far_shapes(World(document, materials or load_materials()))


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
    return _warned_of_far_shapes(World(stage_document(document, actors, ego), load_materials()))


def _warned_of_far_shapes(world: World) -> World:
    """Return a world; warn if a static part lies wholly beyond `FAR_OUT` along an axis of the world."""
    lower, upper = world.part_bounds()
    nearest = np.maximum(lower, -upper).max(axis=1)
    far = np.flatnonzero((world.parts.actor < 0) & (nearest > FAR_OUT))
    if len(far):
        first = int(far[nearest[far].argmax()])
        step = 1e3 * float(np.spacing(np.float32(nearest[first])))
        warnings.warn(
            f"'{world.parts.name[first]}' and {len(far) - 1} more static shapes are up to {nearest[first] / 1e3:.3g} km"
            f" from the world's origin, where their vertices are in steps of {step:.2g} mm (float32): phases of echoes"
            " and fine shapes are off; move the scene to the origin. Actors are as exact as anywhere",
            ScarlWarning,
            stacklevel=3,
        )
    return world
