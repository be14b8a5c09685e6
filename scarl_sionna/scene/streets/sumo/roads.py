"""Edges of a network of SUMO as roads: one for both directions where they lie side by side, with lanes and marks."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely

from ..geometry.road import RoadShape
from ..model import Array, Cubics, LaneSection, MapLane, Road, RoadLink, RoadMark
from ..network.ways import KINDS
from .lines import End, beside, distinct, rounded
from .net import Net, NetEdge, NetLane

CARS = frozenset(
    {
        "passenger", "private", "taxi", "delivery", "truck", "trailer", "motorcycle", "moped", "hov", "evehicle",
        "emergency", "authority", "army", "vip",
    }
)  # fmt: skip # a table
"""Classes of SUMO for which a lane is one for cars."""
KERB = 0.12
"""Height of a pavement beside a carriageway [m]."""
FAST = 16.0
"""Speed limit above which a carriageway has lines at its borders [m/s]."""
_SAME, _PARALLEL = 0.05, 0.1
_QUIET = ("residential", "living_street", "service", "unclassified", "track", "path", "footway", "pedestrian")
_LINE, _BORDER = 0.12, 0.15


def kind_of(lane: NetLane) -> str:
    """Return the type of a lane in the terms of OpenDRIVE, by who may use it."""
    everybody = not lane.allows or "all" in lane.allows

    def allowed(names: Sequence[str] | frozenset[str]) -> bool:
        if "all" in lane.disallows:
            return False
        return any(name not in lane.disallows if everybody else name in lane.allows for name in names)

    if everybody and not lane.disallows:
        return "driving"
    if allowed(CARS):
        return "driving"
    for names, kind in _OTHERS:
        if allowed(names):
            return kind
    return "restricted"


_OTHERS: tuple[tuple[tuple[str, ...], str], ...] = (
    (("bus", "coach"), "bus"), (("bicycle",), "biking"), (("pedestrian",), "sidewalk"),
    (("tram", "rail_urban"), "tram"), (("rail", "rail_electric", "rail_fast", "subway"), "rail"),
)  # fmt: skip # a table


@dataclass(frozen=True)
class Place:
    """Where a lane of the network is: road, its number there, and whether it runs along the road."""

    road: str
    lane: int
    is_forward: bool


@dataclass(frozen=True, eq=False)
class NetRoads:
    """Roads of a network, without links: by id; where each lane (edge, index) is; names of the file's edges by road."""

    roads: dict[str, Road]
    places: dict[tuple[str, int], Place]
    edges: dict[str, tuple[NetEdge, ...]]


def net_roads(net: Net) -> NetRoads:
    """Return the edges of a network as roads."""
    roads: dict[str, Road] = {}
    places: dict[tuple[str, int], Place] = {}
    used: dict[str, tuple[NetEdge, ...]] = {}
    by_ends: dict[tuple[str, str], list[NetEdge]] = {}
    for edge in net.edges.values():
        by_ends.setdefault((edge.start, edge.stop), []).append(edge)
    done: set[str] = set()
    for edge in net.edges.values():
        if edge.id in done:
            continue
        backs = [one for one in by_ends.get((edge.stop, edge.start), ()) if one.id not in done and one is not edge]
        for road, own in _roads_of(net, edge, backs):
            roads[road.id] = road
            used[road.id] = tuple(dict.fromkeys(net.edges[name] for (name, _), _ in own))
            places |= {key: Place(road.id, number, (number < 0) ^ net.is_left_hand) for key, number in own}
            done |= {name for (name, _), _ in own}
        done.add(edge.id)
    return NetRoads(roads, places, used)


_Own = list[tuple[tuple[str, int], int]]
"""Lanes of the network, each with its number in the road."""


def _roads_of(net: Net, edge: NetEdge, backs: Sequence[NetEdge]) -> Iterator[tuple[Road, _Own]]:
    """Return the road of an edge and of one that runs beside it the other way; or roads of single lanes."""
    inner = _inner_border(net, edge)
    if inner is not None:
        for back in backs:
            other = _inner_border(net, back)
            if other is not None and _are_one(inner, other[::-1]):
                yield _road(net, inner, edge, back)
                return
        yield _road(net, inner, edge, None)
        return
    for index, lane in enumerate(edge.lanes):
        shape = distinct(lane.shape)
        if len(shape) > 1:
            alone = replace(edge, id=lane.id, lanes=(lane,))
            border = beside(shape, (-0.5 if net.is_left_hand else 0.5) * lane.width)
            road, own = _road(net, border, alone, None)
            yield road, [((edge.id, index), number) for _, number in own]


def _inner_border(net: Net, edge: NetEdge) -> Array | None:
    """Return the border of an edge towards oncoming traffic, or None if its lanes are not parallel with common ends."""
    inmost = edge.lanes[-1]
    side = -1.0 if net.is_left_hand else 1.0
    shape = distinct(inmost.shape)
    if len(shape) < 2:
        return None
    border = beside(shape, 0.5 * side * inmost.width)
    away = 0.0
    for lane in edge.lanes[::-1]:
        own = distinct(lane.shape)
        if len(own) < 2:
            return None
        expected = beside(border, -side * (away + 0.5 * lane.width))
        away += lane.width
        if np.linalg.norm(expected[[0, -1]] - own[[0, -1]], axis=1).max() > _SAME:
            return None
        if shapely.hausdorff_distance(shapely.LineString(expected[:, :2]), shapely.LineString(own[:, :2])) > _PARALLEL:
            return None
    return border


def _are_one(one: Array, other: Array) -> bool:
    if np.linalg.norm(one[[0, -1]] - other[[0, -1]], axis=1).max() > _SAME:
        return False
    lines = shapely.LineString(one[:, :2]), shapely.LineString(other[:, :2])
    return bool(shapely.hausdorff_distance(*lines) < _SAME)


def _road(net: Net, border: Array, edge: NetEdge, back: NetEdge | None) -> tuple[Road, _Own]:
    """Return a road along the inner border of an edge, and of another that runs the other way on its far side."""
    sign = 1 if net.is_left_hand else -1
    reach = [sum(lane.width for lane in one.lanes) if one else 0.0 for one in (back, edge)]
    speed = max(lane.speed for lane in edge.lanes)
    line = rounded(border, speed, (reach[1], reach[0]) if net.is_left_hand else (reach[0], reach[1]), edge.line)
    lanes: dict[int, MapLane] = {}
    own: _Own = []
    for one, side in ((edge, sign), (back, -sign)):
        for number, index in enumerate(reversed(range(len(one.lanes) if one else 0)), 1):
            assert one is not None
            lanes[side * number] = _map_lane(one, index, side * number)
            own.append(((one.id, index), side * number))
    section = LaneSection(edge.line, 0.0, line.length, dict(sorted(lanes.items())), _center_marks(edge, back))
    road = Road(
        edge.line, edge.id, edge.name, line.length, "-1", net.is_left_hand, line.plan, line.elevation, Cubics(),
        (Cubics(), Cubics()), np.zeros((0, 6)), Cubics(), (section,), RoadLink("junction", edge.start, ""),
        RoadLink("junction", edge.stop, ""),
    )  # fmt: skip # a row of a table
    return road, own


def _map_lane(edge: NetEdge, index: int, number: int) -> MapLane:
    lane, kind = edge.lanes[index], kind_of(edge.lanes[index])
    is_beside = any(kind_of(other) != "sidewalk" for other in edge.lanes)
    heights = np.array([[0.0, KERB, KERB]]) if kind == "sidewalk" and is_beside else np.zeros((0, 3))
    return MapLane(
        lane.line, number, kind, False, constant(lane.width), None, heights, _outer_marks(edge, index), (), (),
        ((0.0, lane.speed),),
    )  # fmt: skip # a row of a table


def constant(value: float) -> Cubics:
    """Return a polynomial of one value."""
    return Cubics(np.zeros(1), np.array([[value, 0.0, 0.0, 0.0]]))


def _outer_marks(edge: NetEdge, index: int) -> tuple[RoadMark, ...]:
    """Return the mark on a lane's side away from oncoming traffic."""
    kind = kind_of(edge.lanes[index])
    if index > 0:
        other = kind_of(edge.lanes[index - 1])
        words = {KINDS.get(kind, ""), KINDS.get(other, "")}
        if words == {"drive"}:
            return (_mark(edge, "broken", _LINE),)
        return (_mark(edge, "solid", _LINE),) if words == {"drive", "cycle"} else ()
    is_marked = KINDS.get(kind) == "drive" and edge.lanes[index].speed > FAST
    return (_mark(edge, "solid", _BORDER),) if is_marked else ()


def _center_marks(edge: NetEdge, back: NetEdge | None) -> tuple[RoadMark, ...]:
    """Return the mark between both directions, or at the inner border of a carriageway for one."""
    motor = [sum(KINDS.get(kind_of(lane)) == "drive" for lane in one.lanes) if one else 0 for one in (edge, back)]
    if not motor[0] or (back is not None and not motor[1]):
        return ()
    if back is None:
        return (_mark(edge, "solid", _BORDER),) if edge.lanes[-1].speed > FAST else ()
    if max(motor) > 1:
        return (_mark(edge, "solid", _LINE),)
    return () if edge.kind.rpartition(".")[2] in _QUIET else (_mark(edge, "broken", _LINE),)


def _mark(edge: NetEdge, kind: str, width: float) -> RoadMark:
    return RoadMark(edge.line, 0.0, kind, "standard", "standard", width)


def lane_end(shape: RoadShape, place: Place, is_stop: bool) -> End:
    """Return where a lane of a road ends (`is_stop`) or begins, in the direction of its traffic."""
    road = shape.road
    at_end = place.is_forward == is_stop
    s = np.array([road.length if at_end else 0.0])
    section = road.sections[0]
    inner, outer = shape.edges(section, place.lane, s)
    heading = float(shape.heading(s)[0]) + (0.0 if place.is_forward else np.pi)
    slope = float(road.elevation.slope(s)[0]) * (1.0 if place.is_forward else -1.0)
    return End(0.5 * (inner + outer)[0], heading, slope, float(np.linalg.norm((outer - inner)[0, :2])))
