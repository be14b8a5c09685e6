"""Where something may stand: what lanes, crossings and things that stand already leave free."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import shapely

from ..building.bodies import Place, corners_of, spots
from ..building.buildings import building_plan
from ..building.ground import GroundFrame
from ..building.objects import kind_of
from ..building.surfaces import Piece
from ..geometry.road import RoadShape
from ..model import Array, MapObject, StreetMap

CLEAR = 0.3
"""Least distance of a thing from a carriageway [m]."""
_CROSSING, _BESIDE, _SIGNAL = 2.0, 0.4, 0.8
"""Room kept around crossings, things of the file, and its signals [m]."""
_CELL = 25.0


class Room:
    """The ground plan of what there is.

    Parameters
    ----------
    street : StreetMap
    shapes : mapping
        Geometry of each road by its id.
    pieces : sequence of Piece
        Surfaces of the lanes.
    ground : GroundFrame
    """

    def __init__(
        self, street: StreetMap, shapes: Mapping[str, RoadShape], pieces: Sequence[Piece], ground: GroundFrame
    ) -> None:
        frames: list[tuple[Place, MapObject]] = [
            (shapes[road.id], thing) for road in street.roads.values() for thing in road.objects
        ]
        frames += [(ground, thing) for thing in street.objects]
        walls = [piece.footprint for piece in pieces if piece.semantic in ("Roads", "RailTrack")]
        things: list[shapely.Geometry] = [building_plan(one) for one in street.buildings]
        things += [shapely.make_valid(shapely.Polygon(area.rings[0])) for area in street.areas]
        for place, thing in frames:
            kind = kind_of(thing)
            if kind in ("crosswalk", "parkingSpace"):
                walls += [shapely.buffer(plan, _CROSSING) for plan in _plans(place, thing, kind)]
            else:
                things += [shapely.buffer(plan, _BESIDE) for plan in _plans(place, thing, kind)]
        for road in street.roads.values():
            places = [shapes[road.id].point(signal.s, signal.t)[:2] for signal in road.signals]
            things += [shapely.buffer(shapely.Point(place), _SIGNAL) for place in places]
        self._roads = shapely.STRtree(walls)
        self._walks = shapely.STRtree([piece.footprint for piece in pieces if piece.semantic == "SideWalks"])
        self._things = shapely.STRtree(things)
        self._taken: defaultdict[tuple[int, int], list[shapely.Geometry]] = defaultdict(list)

    def is_off_roads(self, plan: shapely.Geometry, clear: float = CLEAR) -> bool:
        """Return whether a ground plan keeps away from carriageways and crossings."""
        return len(self._roads.query(plan, "dwithin", clear)) == 0

    def is_free(self, plan: shapely.Geometry, on_walk: bool = False) -> bool:
        """Return whether something may stand on a ground plan; `on_walk` whether on a pavement, too."""
        if not self.is_off_roads(plan) or len(self._things.query(plan, "intersects")):
            return False
        if not on_walk and len(self._walks.query(plan, "intersects")):
            return False
        return not any(shapely.intersects(plan, one) for cell in _cells(plan) for one in self._taken[cell])

    def take(self, plan: shapely.Geometry) -> None:
        """Let something stand on a ground plan."""
        for cell in _cells(plan):
            self._taken[cell].append(plan)

    def taken(self, plan: shapely.Geometry, on_walk: bool = False) -> bool:
        """Return whether a ground plan was free and is taken now."""
        if not self.is_free(plan, on_walk):
            return False
        self.take(plan)
        return True


def _cells(plan: shapely.Geometry) -> list[tuple[int, int]]:
    x0, y0, x1, y1 = (int(np.floor(value / _CELL)) for value in plan.bounds)
    return [(i, j) for i in range(x0, x1 + 1) for j in range(y0, y1 + 1)]


def _plans(place: Place, thing: MapObject, kind: str) -> Iterator[shapely.Geometry]:
    """Return the ground plans of an object of the file."""
    for outline in thing.outlines:
        corners = corners_of(place, thing, outline)[0][:, :2]
        if len(corners) > 2:
            yield shapely.convex_hull(shapely.MultiPoint(corners))
    if thing.outlines:
        return
    for row in thing.repeats:
        if row.distance == 0.0 and isinstance(place, RoadShape):
            s = np.linspace(row.s, min(row.s + row.length, place.road.length), 2 + int(row.length / 5.0))
            t = np.linspace(row.numbers.get("tStart", thing.t), row.numbers.get("tEnd", thing.t), len(s))
            yield shapely.LineString(place.point(s, t)[:, :2])
    for spot in spots(thing, kind):
        yield shapely.buffer(shapely.Point(place.point(spot.s, spot.t)[:2]), 0.5 * max(spot.size[:2]) + 0.05)


def rectangle(middle: Array, yaw: float, x: tuple[float, float], y: tuple[float, float]) -> shapely.Polygon:
    """Return a rectangle between two `x` and two `y` of a frame at `middle` (2,), turned by `yaw` [rad]."""
    corners = np.array([(x[0], y[0]), (x[1], y[0]), (x[1], y[1]), (x[0], y[1])])
    cos, sin = np.cos(yaw), np.sin(yaw)
    return shapely.Polygon(middle[:2] + corners @ np.array([[cos, sin], [-sin, cos]]))


def disc(middle: Array, radius: float) -> shapely.Polygon:
    """Return a disc."""
    return shapely.buffer(shapely.Point(middle[:2]), radius, quad_segs=4)
