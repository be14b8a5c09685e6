"""Distances between entities and places: along roads, in an entity's own axes, or straight."""

from __future__ import annotations

import math

import shapely

from scarl_sionna.scenario.openscenario.reading.entities import Box, Entity
from scarl_sionna.scenario.openscenario.reading.source import Node
from scarl_sionna.scenario.openscenario.roads.network import Spot

from .motion import Motion, World, wrapped
from .positions import Place

SYSTEMS = ("entity", "lane", "road", "trajectory", "world")
TYPES = ("longitudinal", "lateral", "cartesianDistance", "euclidianDistance", "euclideanDistance")


def along_road(world: World, name: str, spot: Spot) -> float | None:
    """Return the way along the roads from an entity to a spot [m], negative behind; None where there is none."""
    own, roads = world.motions[name].spot, world.roads
    if own is None or roads is None:
        return None
    if own.road == spot.road:
        return (spot.s - own.s) * own.way
    ahead = roads.distance(own, spot.road, spot.s, world.routes.get(name, ()))
    back = roads.distance(Spot(own.road, own.section, own.lane, own.s, -own.way), spot.road, spot.s)
    if ahead is None or (back is not None and back < ahead):
        return None if back is None else -back
    return ahead


def across_road(world: World, name: str, target: Motion | Place) -> float | None:
    """Return by how much t of a target is larger, to the left of the entity [m]."""
    own, roads = world.motions[name], world.roads
    if own.spot is None or roads is None or target.spot is None:
        return None
    t = roads.middle(target.spot) + target.spot.way * target.left
    return own.spot.way * (t - own.t(roads))


def in_axes(own: Motion, x: float, y: float) -> tuple[float, float]:
    """Return a point in an entity's axes: ahead and to the left [m]."""
    cos, sin = math.cos(own.heading), math.sin(own.heading)
    return (x - own.x) * cos + (y - own.y) * sin, (y - own.y) * cos - (x - own.x) * sin


def corners(motion: Motion | Place, box: Box) -> list[tuple[float, float]]:
    """Return the corners of a bounding box in plan [m]."""
    cos, sin = math.cos(motion.heading), math.sin(motion.heading)
    found = []
    for u, v in ((1, 1), (-1, 1), (-1, -1), (1, -1)):
        x, y = box.x + 0.5 * u * box.length, box.y + 0.5 * v * box.width
        found.append((motion.x + x * cos - y * sin, motion.y + x * sin + y * cos))
    return found


class Distance:
    """A distance as a condition asks for it.

    Parameters
    ----------
    node : Node
        With coordinateSystem, relativeDistanceType (or alongRoute, cartesianDistance of 1.0) and freespace.
    kind : str, optional
        Where the element does not say: ``longitudinal``, ...
    """

    def __init__(self, node: Node, kind: str = "euclidianDistance") -> None:
        self.node = node
        self.is_free = node.truth("freespace", False)
        along = node.truth("alongRoute", False)
        self.system = node.choice("coordinateSystem", SYSTEMS, "road" if along else "entity")
        self.kind = node.choice("relativeDistanceType", TYPES, "longitudinal" if along else kind)
        if kind == "lateral":  # of an action, which is always along the road
            self.system, self.kind = node.choice("coordinateSystem", SYSTEMS, "road"), kind
        if self.system == "trajectory":
            raise node.unsupported("coordinateSystem entity, lane and road are read")

    @property
    def is_straight(self) -> bool:
        """Whether it is the straight distance."""
        return self.kind not in ("longitudinal", "lateral")

    def signed(self, world: World, name: str, other: str | Place) -> float | None:
        """Return the distance [m], negative behind or to the right; between the boxes where the free space is asked."""
        own = world.motions[name]
        target = world.motion(other, self.node) if isinstance(other, str) else other
        box = world.entities[other].box if isinstance(other, str) else None
        mine = world.entities[name]
        if self.is_straight:
            return self._straight(own, mine, target, box)
        if self.system in ("lane", "road") and world.roads is not None and own.spot is not None:
            return self._by_road(world, name, target, box)
        return self._by_axes(own, mine, target, box)

    def _straight(self, own: Motion, mine: Entity, target: Motion | Place, box: Box | None) -> float:
        if not self.is_free:
            return math.hypot(target.x - own.x, target.y - own.y)
        first = shapely.Polygon(corners(own, mine.box))
        second = shapely.Point(target.x, target.y) if box is None else shapely.Polygon(corners(target, box))
        return float(shapely.distance(first, second))

    def _by_road(self, world: World, name: str, target: Motion | Place, box: Box | None) -> float | None:
        own, mine = world.motions[name], world.entities[name].box
        if target.spot is None:
            return None
        if self.kind == "lateral":
            found = across_road(world, name, target)
            return found if found is None or not self.is_free else _free(found, mine, box, lateral=True)
        found = along_road(world, name, target.spot)
        if found is None or not self.is_free:
            return found
        opposite = abs(wrapped(target.heading - own.heading)) > 0.5 * math.pi
        return _free(found, mine, box, opposite=opposite)

    def _by_axes(self, own: Motion, mine: Entity, target: Motion | Place, box: Box | None) -> float:
        axis = 0 if self.kind == "longitudinal" else 1
        middle = in_axes(own, target.x, target.y)[axis]
        if not self.is_free:
            return middle
        ends = [in_axes(own, x, y)[axis] for x, y in corners(target, box)] if box is not None else [middle]
        mine_ends = [in_axes(own, x, y)[axis] for x, y in corners(own, mine.box)]
        if min(ends) > max(mine_ends):
            return min(ends) - max(mine_ends)
        return max(ends) - min(mine_ends) if max(ends) < min(mine_ends) else 0.0

    def closing(self, world: World, name: str, other: str | Place, distance: float) -> float:
        """Return the speed at which the distance becomes smaller [m/s]."""
        own = world.motions[name]
        target = world.motion(other, self.node) if isinstance(other, str) else other
        vx, vy = own.velocity
        ux, uy = target.velocity if isinstance(target, Motion) else (0.0, 0.0)
        if self.is_straight:
            away = max(math.hypot(target.x - own.x, target.y - own.y), 1e-9)
            return ((vx - ux) * (target.x - own.x) + (vy - uy) * (target.y - own.y)) / away
        sign = 1.0 if distance >= 0.0 else -1.0
        if self.kind == "longitudinal" and self.system != "entity":
            opposite = isinstance(target, Motion) and abs(wrapped(target.heading - own.heading)) > 0.5 * math.pi
            other_speed = target.speed if isinstance(target, Motion) else 0.0
            return sign * (own.speed + (other_speed if opposite else -other_speed))
        cos, sin = math.cos(own.heading), math.sin(own.heading)
        ahead, left = (vx - ux) * cos + (vy - uy) * sin, (vy - uy) * cos - (vx - ux) * sin
        return sign * (ahead if self.kind == "longitudinal" else left)


def _free(distance: float, mine: Box, box: Box | None, opposite: bool = False, lateral: bool = False) -> float:
    """Return the free space of a distance between reference points [m], 0 where boxes are beside each other."""
    if lateral:
        taken = 0.5 * mine.width + (0.0 if box is None else 0.5 * box.width)
        return math.copysign(max(abs(distance) - taken, 0.0), distance)
    if distance >= 0.0:
        other = 0.0 if box is None else box.front if opposite else box.rear
        return max(distance - mine.front - other, 0.0)
    other = 0.0 if box is None else box.rear if opposite else box.front
    return -max(-distance - mine.rear - other, 0.0)
