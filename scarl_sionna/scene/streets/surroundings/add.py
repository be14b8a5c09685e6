"""Adds surroundings to a map's scene: what the file has of a kind is left to it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from scenes_xml.generators.kit import SceneKit
from scenes_xml.generators.surfaces import leaves

from ..building.ground import GroundFrame
from ..building.heights import GroundHeight
from ..building.objects import kind_of
from ..building.surfaces import Piece
from ..geometry.road import RoadShape
from ..model import Array, StreetMap
from . import furniture, houses, rows, trees
from .room import Room
from .sides import Side, sides
from .site import Site

_REACH = (90.0, 220.0)
"""How far the dense middle of a town or village reaches [m], drawn by seed."""


def surroundings(
    kit: SceneKit,
    street: StreetMap,
    shapes: Mapping[str, RoadShape],
    pieces: Sequence[Piece],
    height: GroundHeight,
    seed: int,
) -> Site:
    """Add houses, gardens, lamps, signs, rails and trees to a scene, and return what is left to add as rows.

    Parameters
    ----------
    kit : SceneKit
    street : StreetMap
    shapes : mapping
        Geometry of each road by its id.
    pieces : sequence of Piece
        Surfaces of the lanes; nothing is put onto one of a carriageway.
    height : GroundHeight
    seed : int
        Same seed, same things.
    """
    kit.materials |= leaves.MATERIALS
    kit.textures |= leaves.IMAGES
    beside = tuple(side for side in sides(street, shapes) if len(side.s) > 3)
    generator = np.random.default_rng([seed, 0])
    site = Site(
        kit,
        Room(street, shapes, pieces, GroundFrame(height)),
        height,
        seed,
        beside,
        _centre(beside, generator),
        float(generator.uniform(*_REACH)),
    )
    has = kinds_in(street)
    steps = [
        ("building", houses.add_houses),
        ("guardRail", rows.add_rails),
        ("pole", rows.add_delineators),
        ("limit", furniture.add_limits),
        ("streetLamp", furniture.add_lamps),
        ("", furniture.add_bus_stops),
        ("", rows.add_power_lines),
        ("tree", trees.add_trees),
        ("", furniture.add_small_things),
    ]
    for kind, step in steps:
        if kind not in has:
            step(site)
    return site


def _centre(beside: Sequence[Side], generator: np.random.Generator) -> Array:
    """Return the middle of the town: a place beside a street of one, else beside a road of the country."""
    towns = [side for side in beside if side.character == "town"]
    found = towns or [side for side in beside if side.character == "country"]
    if not found:
        return np.full(2, np.inf)
    length = np.array([side.length + 1.0 for side in found])
    side = found[int(generator.choice(len(found), p=length / length.sum()))]
    return np.array(side.front[int(generator.integers(len(side.s))), :2])


def kinds_in(street: StreetMap) -> set[str]:
    """Return the kinds of things that a map has: nothing of them is made up."""
    things = [thing for road in street.roads.values() for thing in road.objects] + list(street.objects)
    has = {kind_of(thing) for thing in things}
    if street.buildings:
        has.add("building")
    if has & {"railing", "barrier", "wall"}:
        has.add("guardRail")
    if "vegetation" in has:
        has.add("tree")
    if any(signal.kind in ("274", "274.1", "speedLimit", "maximumSpeed") for road in street.roads.values()
           for signal in road.signals):  # fmt: skip # one condition
        has.add("limit")
    return has
