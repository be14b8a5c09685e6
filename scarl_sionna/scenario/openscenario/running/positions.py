"""Positions of OpenSCENARIO: read once, and resolved to a place when they are used."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise

from scarl_sionna.scenario.openscenario.reading.catalogs import Catalogs
from scarl_sionna.scenario.openscenario.reading.source import Node
from scarl_sionna.scenario.openscenario.roads.network import Roads, Spot

from .motion import World, wrapped

_READ = (
    "WorldPosition, RelativeWorldPosition, RelativeObjectPosition, RoadPosition, RelativeRoadPosition, LanePosition, "
    "RelativeLanePosition, RoutePosition and TrajectoryPosition are read"
)


@dataclass(frozen=True)
class Place:
    """A place in plan: x, y [m], heading [rad], and where that is on the roads; `z` [m] where it is stated."""

    x: float
    y: float
    heading: float
    spot: Spot | None = None
    left: float = 0.0
    z: float | None = None


class Position(ABC):
    """A position as the file states it."""

    def __init__(self, node: Node) -> None:
        self.node = node
        orientation = node.child("Orientation")
        kinds = ("relative", "absolute")
        self._is_relative = orientation is not None and orientation.choice("type", kinds, "absolute") == "relative"
        self._heading = None if orientation is None else orientation.number("h", 0.0)
        self.entity = node.text("entityRef", "")

    @abstractmethod
    def place(self, world: World) -> Place:
        """Return the place now."""

    def turned(self, base: float) -> float:
        """Return the heading that the orientation states [rad]; without one that of the surroundings."""
        if self._heading is None:
            return base
        return base + self._heading if self._is_relative else self._heading

    def _roads(self, world: World) -> Roads:
        if world.roads is None:
            raise self.node.error("needs roads, and the scenario has no map", "name a <LogicFile> or a scene of .xodr")
        return world.roads


WITH_CATALOGS: dict[str, Callable[[Node, Catalogs], Position]] = {}
"""Positions that other modules read, by their element."""


def read_position(holder: Node, catalogs: Catalogs) -> Position:
    """Return the position in an element such as ``<Position>``.

    Raises
    ------
    ScenarioError
        If it is of a kind that is not read, or a value is missing.
    """
    node = holder.only()
    kinds: dict[str, type[Position]] = {
        "WorldPosition": _World,
        "RelativeWorldPosition": _RelativeWorld,
        "RelativeObjectPosition": _RelativeObject,
        "RoadPosition": _Road,
        "RelativeRoadPosition": _RelativeRoad,
        "LanePosition": _Lane,
        "RelativeLanePosition": _RelativeLane,
    }
    if node.tag == "RoutePosition":
        return _OnRoute(node, catalogs)
    if node.tag in WITH_CATALOGS:
        return WITH_CATALOGS[node.tag](node, catalogs)
    if node.tag not in kinds:
        raise node.unsupported(_READ)
    return kinds[node.tag](node)


class _World(Position):
    def __init__(self, node: Node) -> None:
        super().__init__(node)
        self._point = (node.number("x"), node.number("y"))
        self._z = node.number("z") if node.has("z") else None
        self._heading = node.number("h", 0.0)

    def place(self, world: World) -> Place:
        x, y = self._point
        if world.roads is not None:
            x, y = x - world.roads.shift[0], y - world.roads.shift[1]
        return placed(world.roads, x, y, float(self._heading or 0.0), self._z)


class _RelativeWorld(Position):
    def __init__(self, node: Node) -> None:
        super().__init__(node)
        self._step = (node.number("dx"), node.number("dy"))

    def place(self, world: World) -> Place:
        base = world.motion(self.entity, self.node)
        return placed(world.roads, base.x + self._step[0], base.y + self._step[1], self.turned(base.heading))


class _RelativeObject(Position):
    def __init__(self, node: Node) -> None:
        super().__init__(node)
        self._step = (node.number("dx"), node.number("dy"))

    def place(self, world: World) -> Place:
        base = world.motion(self.entity, self.node)
        cos, sin = math.cos(base.heading), math.sin(base.heading)
        dx, dy = self._step
        return placed(
            world.roads, base.x + dx * cos - dy * sin, base.y + dx * sin + dy * cos, self.turned(base.heading)
        )


class _Road(Position):
    def __init__(self, node: Node) -> None:
        super().__init__(node)
        self._where = (node.text("roadId"), node.number("s"), node.number("t"))

    def place(self, world: World) -> Place:
        roads, (road, s, t) = self._roads(world), self._where
        check_road(self.node, roads, road, s)
        return self._on_road(roads, road, s, t)

    def _on_road(self, roads: Roads, road: str, s: float, t: float) -> Place:
        spot, left = roads.spot_at(road, s, t)
        x, y, along = roads.point(road, s, t)
        heading = self.turned(along + (0.0 if spot.way > 0 else math.pi))
        return Place(x, y, heading, *_facing(spot, left, heading, along))


class _RelativeRoad(_Road):
    def __init__(self, node: Node) -> None:
        Position.__init__(self, node)
        self._step = (node.number("ds"), node.number("dt"))

    def place(self, world: World) -> Place:
        roads, base = self._roads(world), world.motion(self.entity, self.node)
        assert base.spot is not None
        ahead = roads_along(self.node, roads, base.spot, self._step[0] * base.spot.way)
        t = base.t(roads) + self._step[1]
        return self._on_road(roads, ahead.road, ahead.s, t)


class _Lane(Position):
    def __init__(self, node: Node) -> None:
        super().__init__(node)
        self._where = (node.text("roadId"), node.whole("laneId"), node.number("s"), node.number("offset", 0.0))

    def place(self, world: World) -> Place:
        roads, (road, lane, s, offset) = self._roads(world), self._where
        check_road(self.node, roads, road, s)
        return on_lane(self, roads, road, lane, s, offset)


class _RelativeLane(Position):
    def __init__(self, node: Node) -> None:
        super().__init__(node)
        self._lanes, self._offset = node.whole("dLane"), node.number("offset", 0.0)
        self._ds = node.number("dsLane" if node.has("dsLane") else "ds", 0.0)

    def place(self, world: World) -> Place:
        roads, base = self._roads(world), world.motion(self.entity, self.node)
        assert base.spot is not None
        spot = Spot(base.spot.road, base.spot.section, base.lane(roads), base.spot.s, base.spot.way)
        ahead = roads_along(self.node, roads, spot, self._ds)
        lane = beside(ahead.lane, self._lanes * ahead.way)
        place = on_lane(self, roads, ahead.road, lane, ahead.s, self._offset)
        own, there = (roads.direction(ahead.road, ahead.section, one) for one in (ahead.lane, lane))
        if self._heading is not None or ahead.way == own or there != own:
            return place
        assert place.spot is not None  # who drives against the traffic of its lane has others beside it do so
        return Place(place.x, place.y, place.heading + math.pi, replace(place.spot, way=-place.spot.way), -place.left)


class _OnRoute(Position):
    def __init__(self, node: Node, catalogs: Catalogs) -> None:
        super().__init__(node)
        self._route = read_route(node.need("RouteRef"), catalogs)
        self._where = node.need("InRoutePosition").only()
        if self._where.tag not in ("FromRoadCoordinates", "FromLaneCoordinates"):
            raise self._where.unsupported("FromRoadCoordinates and FromLaneCoordinates are read")
        self._way = self._where.number("pathS", low=0.0)

    def place(self, world: World) -> Place:
        roads = self._roads(world)
        start, names = self._route.planned(world)
        spot, _, rest = roads.move(start, self._way, None, names)
        if rest > 0.0:
            raise self._where.error(f"pathS = {self._way:g} m is {rest:.4g} m beyond the end of the route")
        if self._where.tag == "FromRoadCoordinates":
            t = self._where.number("t", 0.0)
            placed_spot, left = roads.spot_at(spot.road, spot.s, t, spot.way)
            x, y, along = roads.point(spot.road, spot.s, t)
            return Place(x, y, self.turned(along + (0.0 if spot.way > 0 else math.pi)), placed_spot, left)
        lane, offset = self._where.whole("laneId"), self._where.number("laneOffset", 0.0)
        return on_lane(self, roads, spot.road, lane, spot.s, offset)


class Route:
    """A route as the file states it: waypoints, between which the shortest way is taken."""

    def __init__(self, node: Node, catalogs: Catalogs) -> None:
        self.node = node
        self.points = [read_position(one.need("Position"), catalogs) for one in node.children("Waypoint")]
        if len(self.points) < 2:
            raise node.error(f"has {len(self.points)} waypoints", "give two or more")

    def planned(self, world: World) -> tuple[Spot, tuple[str, ...]]:
        """Return where the route begins and the roads that it leads over."""
        roads = world.roads
        if roads is None:
            raise self.node.error("needs roads, and the scenario has no map")
        spots = []
        for point in self.points:
            spot = point.place(world).spot
            assert spot is not None
            spots.append(spot)
        names: list[str] = []
        for number, (first, second) in enumerate(pairwise(spots)):
            found = roads.roads_between(first, second.road)
            if found is None:
                raise self.points[number + 1].node.error("no road leads here from the waypoint before")
            names += [one for one in found if one not in names]
        return spots[0], tuple(names)


def read_route(holder: Node, catalogs: Catalogs) -> Route:
    """Return the route in an element, stated there or in a catalog."""
    node = holder.need("Route", "CatalogReference")
    if node.tag == "CatalogReference":
        node = catalogs.resolve(node)
    return Route(node.declared(), catalogs)


def placed(
    roads: Roads | None, x: float, y: float, heading: float, z: float | None = None, near: Spot | None = None
) -> Place:
    """Return a place of the world with where that is on the roads; `near` is where it was before."""
    if roads is None:
        return Place(x, y, heading, z=z)
    road, s, t = roads.locate(x, y, None if near is None else near.road)
    spot, left = roads.spot_at(road, s, t)
    return Place(x, y, heading, *_facing(spot, left, heading, roads.table(road).at(s)[2]), z)


def _facing(spot: Spot, left: float, heading: float, along: float) -> tuple[Spot, float]:
    """Return a spot and its offset in the way that a heading has along the reference line."""
    way = 1 if math.cos(heading - along) >= 0.0 else -1
    if way == spot.way:
        return spot, left
    return Spot(spot.road, spot.section, spot.lane, spot.s, way), -left


def on_lane(position: Position, roads: Roads, road: str, lane: int, s: float, offset: float) -> Place:
    """Return the place beside the middle of a lane, with the heading of the position."""
    section = roads.section_at(road, s)
    known = roads.street.roads[road].sections[section].lanes
    if lane not in known and lane != 0:
        numbers = ", ".join(str(one) for one in sorted(known))
        raise position.node.error(f"road '{road}' has no lane {lane} at s = {s:g} m", f"it has {numbers}")
    own = roads.direction(road, section, lane)
    spot = Spot(road, section, lane, s, own)
    x, y, along = roads.point(road, s, roads.middle(spot) + offset)
    heading = position.turned(along + (0.0 if own > 0 else math.pi))
    return Place(x, y, heading, *_facing(spot, own * offset, heading, along))


def check_road(node: Node, roads: Roads, road: str, s: float) -> None:
    """Raise if a road is not there, or a place lies beyond its ends."""
    if road not in roads.street.roads:
        known = ", ".join(list(roads.street.roads)[:12])
        raise node.error(f"map '{roads.name}' has no road '{road}'", f"it has {known}")
    length = roads.street.roads[road].length
    if not -0.01 <= s <= length + 0.01:
        raise node.error(f"s = {s:g} m is not on road '{road}', which is {length:.6g} m long")


def roads_along(node: Node, roads: Roads, spot: Spot, ahead: float) -> Spot:
    """Return the spot some way ahead, or behind, along the lane."""
    start = spot if ahead >= 0.0 else Spot(spot.road, spot.section, spot.lane, spot.s, -spot.way)
    found, _, rest = roads.move(start, abs(ahead), None)
    if rest > 0.01:
        raise node.error(f"{ahead:g} m along the road is {rest:.4g} m beyond its end")
    return found if ahead >= 0.0 else Spot(found.road, found.section, found.lane, found.s, -found.way)


def beside(lane: int, step: int) -> int:
    """Return the id of the lane some lanes in the direction of t from another; there is no lane 0."""
    found = lane + step
    return found + (1 if step > 0 else -1) if found == 0 or (lane < 0 < found) or (found < 0 < lane) else found


def angle_between(one: float, other: float) -> float:
    """Return the angle between two headings, 0 to pi [rad]."""
    return abs(wrapped(one - other))
