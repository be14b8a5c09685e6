"""What years leave in a carriageway: patches, covers of manholes, and the rails of a tram, all flush with it."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Mapping

import numpy as np

from scarl_sionna.scene.lanes import LaneNetwork
from scenes_xml.generators.geometry.mesh import Mesh
from scenes_xml.generators.roads.wear import PATCHES, LaneSurface

from ..geometry.road import RoadShape
from ..model import LaneSection, Road, StreetMap
from ..network.lanes import lane_name
from ..network.ways import KINDS, Key, keys
from .character import character, is_in_town

TRAMS = 0.4
"""Share of maps with streets of a town that have a tram."""
_TRACK = 2.6
"""Narrowest lane in which a tram runs [m]."""
_SHARPEST = np.radians(60.0)

Rows = defaultdict[tuple[str, str], list[Mesh]]


def add_roadway(
    street: StreetMap, shapes: Mapping[str, RoadShape], network: LaneNetwork, tolerance: float, seed: int
) -> Rows:
    """Return what lies in the carriageways: meshes by class and material.

    Parameters
    ----------
    street : StreetMap
    shapes : mapping
        Geometry of each road by its id.
    network : LaneNetwork
        Of the map; a tram follows it as straight as it goes.
    tolerance : float
        Of the chords of surfaces, on which all of it lies [m].
    seed : int
        Same seed, same things.
    """
    rows: Rows = defaultdict(list)
    roads = [one for one in street.roads.values() if one.junction not in street.junctions]
    for number, road in enumerate(roads):
        generator = np.random.default_rng([seed, 20, number])
        for section in road.sections:
            kind = character(road, section)
            for lane in section.lanes.values():
                if KINDS.get(lane.kind) == "drive" and kind != "motorway":
                    surface = _surface(shapes[road.id], section, lane.id, tolerance)
                    if kind == "town":
                        rows["Roads", "manhole_iron"] += surface.covers(generator, _is_on_ground(road))
                    rows["Roads", "asphalt_dark"] += surface.patches(PATCHES[kind], generator)
    for key in tram_lanes(street, network, np.random.default_rng([seed, 21])):
        surface = _surface(shapes[key[0]], street.roads[key[0]].sections[key[1]], key[2], tolerance)
        rows["RailTrack", "grey_steel"] += surface.rails()
    return defaultdict(list, {key: meshes for key, meshes in rows.items() if meshes})


def _surface(shape: RoadShape, section: LaneSection, lane: int, tolerance: float) -> LaneSurface:
    s = shape.stations(section, tolerance)
    return LaneSurface(s, *shape.edges(section, lane, s))


def _is_on_ground(road: Road) -> Callable[[float], bool]:
    return lambda place: not any(one.s - 2.0 < place < one.s + one.length + 2.0 for one in road.structures)


def tram_lanes(street: StreetMap, network: LaneNetwork, generator: np.random.Generator) -> list[Key]:
    """Return the lanes that a tram runs in, in both directions; none in most maps."""
    by_name = {lane_name(key): key for key in keys(street)}
    lanes = {lane.name: lane for lane in network.lanes if lane.kind == "drive" and lane.width >= _TRACK}
    starts = [name for name in lanes if _is_street(street, by_name[name])]
    if not starts or generator.uniform() > TRAMS:
        return []
    first = by_name[starts[int(generator.integers(len(starts)))]]
    back = first[0], first[1], -first[2]
    before: defaultdict[str, list[str]] = defaultdict(list)
    for lane in lanes.values():
        for name in lane.next:
            before[name].append(lane.name)
    found: dict[str, None] = {}
    for key in (first, back):
        name = lane_name(key)
        if name not in lanes:
            continue
        for goes_on in (True, False):
            here: str | None = name
            while here is not None and (here == name or here not in found):
                found[here] = None
                ways = [one for one in (lanes[here].next if goes_on else before[here]) if one in lanes]
                ways = [one for one in ways if is_track(street, by_name[one])]
                turns = {one: _turn(lanes[one].end_headings) for one in ways}
                here = min(turns, key=lambda one: turns[one], default=None)
                here = None if here is None or turns[here] > _SHARPEST else here
    return [by_name[name] for name in found]


def _turn(headings: tuple[float, float]) -> float:
    return abs(float((headings[1] - headings[0] + np.pi) % (2.0 * np.pi) - np.pi))


def _is_street(street: StreetMap, key: Key) -> bool:
    road = street.roads[key[0]]
    return road.junction not in street.junctions and is_in_town(road, road.sections[key[1]])


def is_track(street: StreetMap, key: Key) -> bool:
    """Return whether a tram may run in a lane: in a street of a town, or over a junction."""
    return street.roads[key[0]].junction in street.junctions or _is_street(street, key)
