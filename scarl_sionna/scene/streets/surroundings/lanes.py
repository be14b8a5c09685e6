"""Kerbs and verges of a map that has none: pavements are raised, carriageways without an edge get one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..model import Array, Cubics, LaneSection, MapLane, Road, RoadLink, StreetMap
from .character import WALKS, is_in_town

KERB, KERB_WIDTH, RAMP = 0.12, 0.15, 1.0
"""Height of a made-up kerb, width of its stones, and way over which it rises where it begins [m]."""
VERGE = 1.0
"""Width of the gravel beside a road of the country [m]."""
_EDGES = {*WALKS, "border", "none", "curb", "median", "shoulder", "stop"}


def with_kerbs(street: StreetMap) -> StreetMap:
    """Return a map whose pavements stand `KERB` above the road and whose carriageways have an edge.

    Lanes of type sidewalk without heights are raised. Where nothing lies beside a carriageway outside of a junction, in
    towns kerb stones are added, else a verge of gravel. What the file states stays. Pavements and kerbs rise over
    `RAMP` from the road at an end that no other pavement continues.
    """
    return replace(street, roads={name: _edged(street, road) for name, road in street.roads.items()})


def _edged(street: StreetMap, road: Road) -> Road:
    sections = []
    for number, section in enumerate(road.sections):
        at_ends = number == 0, number == len(road.sections) - 1
        lanes = {key: _raised(street, road, section, lane, at_ends) for key, lane in section.lanes.items()}
        if road.junction not in street.junctions:
            lanes |= _added(road, section, at_ends)
        sections.append(replace(section, lanes=dict(sorted(lanes.items()))))
    return replace(road, sections=tuple(sections))


def _raised(street: StreetMap, road: Road, section: LaneSection, lane: MapLane, at_ends: tuple[bool, bool]) -> MapLane:
    if lane.kind not in WALKS or len(lane.heights):
        return lane
    links = (road.predecessor, lane.predecessors), (road.successor, lane.successors)
    ramps = [at_end and not _goes_on(street, *link) for at_end, link in zip(at_ends, links, strict=True)]
    return replace(lane, heights=_heights(section, ramps[0], ramps[1]))


def _goes_on(street: StreetMap, link: RoadLink | None, lanes: tuple[int, ...]) -> bool:
    """Return whether a pavement is continued beyond an end of its road."""
    if link is None:
        return False
    if link.kind == "road":
        return bool(lanes)
    inside = (road for road in street.roads.values() if road.junction == link.id)
    return any(lane.kind in WALKS for road in inside for section in road.sections for lane in section.lanes.values())


def _heights(section: LaneSection, begins: bool, ends: bool) -> Array:
    """Return heights that rise after the beginning and fall before the end where asked for."""
    length = section.stop - section.s
    ramp = min(RAMP, 0.3 * length)
    rows = [(0.0, 0.0 if begins else KERB), (ramp, KERB), (length - ramp, KERB), (length, 0.0 if ends else KERB)]
    return np.array([(s, height, height) for s, height in rows])


def _added(road: Road, section: LaneSection, at_ends: tuple[bool, bool]) -> dict[int, MapLane]:
    """Return the edges of a section's sides that have none."""
    added = {}
    for sign in (1, -1):
        own = [lane for key, lane in section.lanes.items() if key * sign > 0]
        if not own or any(lane.kind in _EDGES for lane in own) or any(lane.border is not None for lane in own):
            continue
        in_town = is_in_town(road, section)
        width = Cubics(np.zeros(1), np.array([[KERB_WIDTH if in_town else VERGE, 0.0, 0.0, 0.0]]))
        heights = _heights(section, *at_ends) if in_town else np.zeros((0, 3))
        number = sign * (1 + max(abs(lane.id) for lane in own))
        kind = "curb" if in_town else "border"
        added[number] = MapLane(section.line, number, kind, False, width, None, heights, (), (), ())
    return added
