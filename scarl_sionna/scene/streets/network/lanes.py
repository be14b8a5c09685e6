"""The lane network of a map: centre lines in the direction of travel, what continues what, right of way, lights."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np
import shapely

from scarl_sionna.core.errors import ParameterRangeError, UnknownNameError
from scarl_sionna.scene.lanes import Lane, LaneNetwork, ParkingPlace, check_joint, check_neighbour

from ..geometry.road import RoadShape
from ..model import Array, Finding, MapLane, Road, StreetMap
from .lights import Lights, signal_lights
from .ways import KINDS, Key, beside, following, forward, keys

STEP = 2.0
"""Largest distance between two points of a centre line [m]."""
TURN = np.radians(10.0)
"""Largest turn from one of its pieces to the next where that needs no pieces of less than 0.1 m [rad]."""
NARROWEST = 0.5
"""A lane that is nowhere wider is none to move on [m]."""
_LIMITS = {"motorway": 36.1, "rural": 27.8, "town": 13.9, "lowSpeed": 8.3, "pedestrian": 2.0, "bicycle": 5.6}
_WALKING, _UNKNOWN = 1.5, 13.9
_SHORTEST = 0.01
_TOUCHING = 0.1


def lane_name(key: Key) -> str:
    """Return the name of a lane in the network: road, section (from 0) and lane, as ``12/0/-1``."""
    return f"{key[0]}/{key[1]}/{key[2]}"


def street_lanes(
    street: StreetMap, shapes: Mapping[str, RoadShape], parking: Iterable[ParkingPlace] = ()
) -> tuple[LaneNetwork, Lights, tuple[Finding, ...]]:
    """Return the lane network of a map, its lights, and what does not fit.

    Parameters
    ----------
    street : StreetMap
    shapes : mapping
        Geometry of each road by its id.
    parking : iterable of ParkingPlace

    Returns
    -------
    LaneNetwork
        Lanes named after road, section and lane; a link over a gap or a kink that no vehicle can follow is left out.
    Lights
    tuple of Finding
    """
    findings: list[Finding] = []
    lanes: dict[Key, Lane] = {}
    for key in keys(street):
        lane = _lane(street, shapes[key[0]], key, findings)
        if lane is not None:
            lanes[key] = lane
    links = {key: _next(street, key, lanes, findings) for key in lanes}
    lights = signal_lights(street, links, {key: lane.points for key, lane in lanes.items()})
    yields = _yields(street, lanes, links)
    found = []
    for key, lane in lanes.items():
        left = _left(street, key, lanes)
        found.append(
            replace(
                lane,
                next=tuple(lane_name(one) for one in links[key]),
                left=None if left is None else lane_name(left),
                yield_to=tuple(lane_name(one) for one in yields.get(key, ())),
                signal=lights.of_lane.get(key),
            )
        )
    return LaneNetwork(tuple(found), tuple(parking), lights.signals), lights, tuple(findings)


def _lane(street: StreetMap, shape: RoadShape, key: Key, findings: list[Finding]) -> Lane | None:
    road = street.roads[key[0]]
    section = road.sections[key[1]]
    own = section.lanes[key[2]]
    s = _places(shape, key, section.s, section.stop)
    widths = shape.width(section, own, s)
    if widths.max() < NARROWEST:
        return None
    inner, outer = shape.edges(section, key[2], s)
    points = 0.5 * (inner + outer)
    if not forward(street, key):
        points = points[::-1]
    if own.direction == "both" or own.kind == "bidirectional":
        findings.append(Finding(own.line, "a lane for both directions has traffic in one"))
    points = _apart(points)
    if len(points) < 2:
        findings.append(Finding(own.line, f"lane {lane_name(key)} is shorter than 1 cm: nothing drives on it"))
        return None
    try:
        width = float(min(np.median(widths[widths > 0.3 * widths.max()]), 30.0))
        return Lane(lane_name(key), points, KINDS[own.kind], width, _limit(road, own, section.s))
    except ParameterRangeError as error:
        findings.append(Finding(own.line, f"lane {lane_name(key)} is left out of the network: {error}"))
        return None


def _places(shape: RoadShape, key: Key, start: float, stop: float) -> Array:
    """Return places along a lane, `STEP` apart or, in tight bends, closer."""
    count = max(2 if stop - start < 0.5 else 5, int(np.ceil((stop - start) / STEP)) + 1)  # 5 points show an S
    for _ in range(5):
        s = np.linspace(start, stop, count)
        inner, outer = shape.edges(shape.road.sections[key[1]], key[2], s)
        steps = np.diff(0.5 * (inner + outer)[:, :2], axis=0)
        turns = np.diff(np.unwrap(np.arctan2(steps[:, 1], steps[:, 0])))
        length = float(np.linalg.norm(steps, axis=1).min(initial=np.inf))
        if np.abs(turns).max(initial=0.0) < TURN or length < 0.1:
            break
        count = 2 * count - 1
    return s


def _apart(points: Array) -> Array:
    """Return a line without points that are nearly the same as the one before."""
    kept = [points[0]]
    for point in points[1:]:
        if np.linalg.norm(point - kept[-1]) >= _SHORTEST:
            kept.append(point)
    return np.array(kept)


def _limit(road: Road, lane: MapLane, s: float) -> float:
    """Return the speed limit of a lane [m/s]: its own, that of its road, or what its road's type allows."""
    if KINDS[lane.kind] == "walk":
        return _WALKING
    stated = [speed for _, speed in lane.speeds[:1] if speed > 0.0]
    kind, limit = next(((one, value) for start, one, value in reversed(road.types) if start <= s), ("", None))
    chosen = stated[0] if stated else limit if limit is not None else _LIMITS.get(kind, _UNKNOWN)
    return float(min(max(chosen, 1.0), 70.0))


def _next(street: StreetMap, key: Key, lanes: Mapping[Key, Lane], findings: list[Finding]) -> list[Key]:
    """Return the lanes that continue one: those that the file names and that fit, else those that begin at its end."""
    lane, line = lanes[key], street.roads[key[0]].sections[key[1]].lanes[key[2]].line
    found = []
    for target in dict.fromkeys(following(street, key)):
        if target not in lanes:
            continue
        try:
            check_joint(lane, lanes[target])
            found.append(target)
        except ParameterRangeError as error:
            findings.append(Finding(line, f"the link to lane {lane_name(target)} is not used: {error}"))
    if found or lane.kind == "parking":
        return found
    for target in dict.fromkeys(beside(street, key)):
        other = lanes.get(target)
        if other is None or target == key or other.kind != lane.kind:
            continue
        if np.linalg.norm(other.points[0] - lane.points[-1]) > _TOUCHING:
            continue
        try:
            check_joint(lane, other)
        except ParameterRangeError:
            continue
        findings.append(Finding(line, f"lane {lane.name} has no link that fits; {other.name} begins where it ends"))
        found.append(target)
    return found


def _left(street: StreetMap, key: Key, lanes: Mapping[Key, Lane]) -> Key | None:
    """Return the neighbour to the left into which a vehicle may change: of one direction, and no solid line between."""
    section = street.roads[key[0]].sections[key[1]]
    is_forward = forward(street, key)
    number = key[2] + (1 if is_forward else -1)
    target = (key[0], key[1], number)
    if lanes[key].kind != "drive" or target not in lanes or lanes[target].kind != "drive":
        return None
    if number == 0 or forward(street, target) != is_forward:
        return None
    between = section.lanes[min(key[2], number, key=abs)]
    if any(mark.kind.startswith("solid") and "broken" not in mark.kind for mark in between.marks[:1]):
        return None
    try:
        check_neighbour(lanes[key], lanes[target])
    except (ParameterRangeError, UnknownNameError):
        return None
    return target


def _yields(street: StreetMap, lanes: Mapping[Key, Lane], links: Mapping[Key, list[Key]]) -> dict[Key, list[Key]]:
    """Return for lanes through junctions those that go first: by the file's priorities, else straight before left."""
    found: dict[Key, list[Key]] = {}
    for junction in street.junctions.values():
        own = {way.connecting for way in junction.connections}
        inside = [key for key in lanes if key[0] in own and lanes[key].kind == "drive"]
        ranked = set(junction.priorities)
        for one in inside:
            for other in inside:
                if one[0] == other[0] or not _cross(lanes[one].points, lanes[other].points):
                    continue
                if (other[0], one[0]) in ranked or (
                    (one[0], other[0]) not in ranked and _turns_before(lanes[one], lanes[other], street, one)
                ):
                    found.setdefault(one, []).append(other)
    return found


def _turns_before(lane: Lane, other: Lane, street: StreetMap, key: Key) -> bool:
    """Return whether a lane turns across oncoming traffic of another."""
    side = -1.0 if street.roads[key[0]].is_left_hand else 1.0
    first, last = lane.end_headings
    turn = side * _wrapped(last - first)
    straight = side * _wrapped(other.end_headings[1] - other.end_headings[0])
    is_oncoming = abs(_wrapped(other.end_headings[0] - first)) > np.radians(130.0)
    return bool(is_oncoming and turn > np.radians(30.0) and straight < np.radians(20.0))


def _wrapped(angle: float) -> float:
    return float((angle + np.pi) % (2.0 * np.pi) - np.pi)


def _cross(one: Array, other: Array) -> bool:
    """Return whether two lines come within half a metre of each other."""
    return bool(shapely.distance(shapely.LineString(one[:, :2]), shapely.LineString(other[:, :2])) < 0.5)
