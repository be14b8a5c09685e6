"""Trajectories of OpenSCENARIO: polyline, clothoid, clothoid spline and NURBS as lines of points, with their times."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt
from scipy.interpolate import BSpline, PPoly

from scarl_sionna.scenario.openscenario.reading.catalogs import Catalogs
from scarl_sionna.scenario.openscenario.reading.source import Node
from scarl_sionna.scene.streets.geometry.curves import evaluate
from scarl_sionna.scene.streets.model import PlanPiece

from .motion import Motion, World
from .positions import WITH_CATALOGS, Place, Position, placed, read_position
from .processes import Process

Array = npt.NDArray[np.float64]
_STEP = 0.25
_MOST_POINTS = 200_000
_CHANGE = 8.0
"""Acceleration with which the speed changes from one piece of a trajectory with times to the next [m/s2]."""
_MOST_VERTICES = 20_000
_MOST_TURN = 200.0
"""Largest turn of a clothoid [rad]."""


@dataclass(frozen=True, eq=False)
class Line:
    """A trajectory in the world: points (N, 2) [m], their way (N,) [m], and times where it has them.

    `knots` (M,) are the ways [m] of the places that have `times` (M,) [s].
    """

    points: Array
    ways: Array
    knots: Array | None
    times: Array | None

    @property
    def length(self) -> float:
        """Its length [m]."""
        return float(self.ways[-1])

    def nearest(self, x: float, y: float) -> float:
        """Return the way of the place nearest to a point [m]."""
        start, step = self.points[:-1], np.diff(self.points, axis=0)
        part = np.clip((([x, y] - start) * step).sum(1) / (step * step).sum(1), 0.0, 1.0)
        index = int(np.linalg.norm(start + part[:, None] * step - [x, y], axis=1).argmin())
        return float(self.ways[index] + part[index] * (self.ways[index + 1] - self.ways[index]))

    def at(self, way: float) -> tuple[float, float, float]:
        """Return x, y [m] and the heading [rad] at a way, held at both ends."""
        index = int(np.clip(np.searchsorted(self.ways, way, "right") - 1, 0, len(self.ways) - 2))
        span = self.ways[index + 1] - self.ways[index]
        part = min(max((way - self.ways[index]) / span, 0.0), 1.0)
        step = self.points[index + 1] - self.points[index]
        x, y = self.points[index] + part * step
        return float(x), float(y), math.atan2(step[1], step[0])


class Trajectory:
    """A trajectory as the file states it; its line is known when it begins."""

    def __init__(self, node: Node, catalogs: Catalogs) -> None:
        self.node = node
        self._is_closed = node.truth("closed", False)
        self._shape = node.need("Shape").only()
        readers = {
            "Polyline": self._read_polyline,
            "Clothoid": self._read_clothoid,
            "ClothoidSpline": self._read_spline,
            "Nurbs": self._read_nurbs,
        }
        if self._shape.tag not in readers:
            raise self._shape.unsupported("Polyline, Clothoid, ClothoidSpline and Nurbs are read")
        self._places: list[Position] = []
        self._times: list[float] | None = None
        self._weights: list[float] = []
        readers[self._shape.tag](catalogs)

    def line(self, world: World, actor: str) -> Line:
        """Return the line of points with the positions as they are now.

        A clothoid spline without a start begins where the actor is.
        """
        shape = self._shape
        if shape.tag == "Polyline":
            return self._polyline(world)
        if shape.tag == "Nurbs":
            return self._nurbs(world)
        return self._clothoids(world, actor)

    def _read_polyline(self, catalogs: Catalogs) -> None:
        self._read_points(self._shape.children("Vertex"), catalogs)

    def _read_points(self, nodes: list[Node], catalogs: Catalogs) -> None:
        if not 2 <= len(nodes) <= _MOST_VERTICES:
            raise self._shape.error(f"has {len(nodes)} points", f"give 2 to {_MOST_VERTICES}")
        self._places = [read_position(one.need("Position"), catalogs) for one in nodes]
        stated = [one.has("time") for one in nodes]
        if any(stated) and not all(stated):
            raise nodes[stated.index(False)].error("has no 'time', others have", "give all of them a time or none")
        if all(stated):
            self._times = [one.number("time") for one in nodes]
            for node, before, after in zip(nodes[1:], self._times[:-1], self._times[1:], strict=True):
                if after <= before:
                    raise node.error(f"time = {after:g} s does not come after {before:g} s")

    def _read_clothoid(self, catalogs: Catalogs) -> None:
        node = self._shape
        self._places = [read_position(node.need("Position"), catalogs)]
        prime = "curvaturePrime" if node.has("curvaturePrime") else "curvatureDot"
        first, length = node.number("curvature"), node.number("length", low=1e-3, high=1e5)
        self._pieces = [(first, first + node.number(prime) * length, length)]
        if node.has("startTime") != node.has("stopTime"):
            raise node.error("has one of startTime and stopTime", "give both or none")
        if node.has("startTime"):
            self._times = [node.number("startTime"), node.number("stopTime")]
        self._check_pieces()

    def _read_spline(self, catalogs: Catalogs) -> None:
        nodes = self._shape.children("ClothoidSplineSegment")
        if not nodes:
            raise self._shape.error("has no <ClothoidSplineSegment>")
        start = nodes[0].child("PositionStart")
        for later in nodes[1:]:
            if later.child("PositionStart") is not None or later.number("hOffset", 0.0) != 0.0:
                raise later.unsupported(
                    "let each segment begin where the one before ends", "with its own start is not read"
                )
        self._places = [] if start is None else [read_position(start, catalogs)]
        self._pieces = [
            (one.number("curvatureStart"), one.number("curvatureEnd"), one.number("length", low=1e-3, high=1e5))
            for one in nodes
        ]
        if all(one.has("timeStart") for one in nodes) and self._shape.has("timeEnd"):
            self._times = [*(one.number("timeStart") for one in nodes), self._shape.number("timeEnd")]
        self._check_pieces()

    def _check_pieces(self) -> None:
        if sum(max(abs(a), abs(b)) * length for a, b, length in self._pieces) > _MOST_TURN:
            raise self._shape.error(f"turns by more than {_MOST_TURN:g} rad")
        times = self._times or []
        if any(b <= a for a, b in pairwise(times)):
            raise self._shape.error("has times that do not rise")

    def _read_nurbs(self, catalogs: Catalogs) -> None:
        nodes = self._shape.children("ControlPoint")
        self._read_points(nodes, catalogs)
        self._weights = [one.number("weight", 1.0, 1e-6, 1e6) for one in nodes]
        self._order = self._shape.whole("order")
        self._knots = [one.number("value") for one in self._shape.children("Knot")]
        if not 2 <= self._order <= min(len(nodes), 20):
            raise self._shape.error(f"order = {self._order} with {len(nodes)} control points", "2 to their number")
        if len(self._knots) != len(nodes) + self._order:
            raise self._shape.error(
                f"has {len(self._knots)} knots", f"{len(nodes) + self._order}: control points plus order"
            )
        if any(b < a for a, b in pairwise(self._knots)):
            raise self._shape.error("has knots that fall")
        if not self._knots[len(nodes)] > self._knots[self._order - 1]:
            raise self._shape.error("has knots without a span")

    def _points(self, world: World) -> Array:
        return np.array([(place.x, place.y) for place in (one.place(world) for one in self._places)])

    def _polyline(self, world: World) -> Line:
        points, times = self._points(world), self._times
        if self._is_closed:
            points = np.concatenate([points, points[:1]])
            times = None if times is None else [*times, 2.0 * times[-1] - times[-2]]
        ways = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))]
        kept = np.r_[True, np.diff(ways) > 1e-6]
        if kept.sum() < 2:
            raise self._shape.error("has points at one place only")
        known = None if times is None else np.array(times)
        return Line(points[kept], ways[kept], ways if known is not None else None, known)

    def _nurbs(self, world: World) -> Line:
        points, weights = self._points(world), np.array(self._weights)
        columns = [weights, weights * points[:, 0], weights * points[:, 1]]
        if self._times is not None:
            columns.append(weights * np.array(self._times))
        degree = self._order - 1
        curve = BSpline(np.array(self._knots), np.column_stack(columns), degree)
        low, high = self._knots[degree], self._knots[len(points)]
        rough = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
        count = int(np.clip(rough / (0.2 * _STEP), 200, _MOST_POINTS))
        rows = np.asarray(curve(np.linspace(low, high, count + 1)))
        plan = rows[:, 1:3] / rows[:, :1]
        ways = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(plan, axis=0), axis=1))]
        kept = np.r_[True, np.diff(ways) > 1e-7]
        if kept.sum() < 2:
            raise self._shape.error("has points at one place only")
        if self._times is None:
            return Line(plan[kept], ways[kept], None, None)
        every = np.unique(np.linspace(0, count, 20 * len(points) + 1).astype(int))
        return Line(plan[kept], ways[kept], ways[every], (rows[:, 3] / rows[:, 0])[every])

    def _clothoids(self, world: World, actor: str) -> Line:
        place = self._places[0].place(world) if self._places else world.motion(actor, self._shape)
        x, y, heading = place.x, place.y, place.heading
        parts, ends = [np.array([[x, y]])], [0.0]
        for first, last, length in self._pieces:
            count = int(np.clip(np.ceil(length / _STEP), 2, _MOST_POINTS))
            way = np.linspace(0.0, length, count + 1)
            piece = PlanPiece(
                self.node.line, 0.0, x, y, heading, length, "spiral", {"curvStart": first, "curvEnd": last}
            )
            frame = evaluate(piece, way)
            parts.append(np.column_stack([frame.x, frame.y])[1:])
            x, y, heading = float(frame.x[-1]), float(frame.y[-1]), float(frame.heading[-1])
            ends.append(ends[-1] + length)
        points = np.concatenate(parts)
        ways = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))]
        if self._times is None:
            return Line(points, ways, None, None)
        return Line(points, ways, np.array(ends) * (ways[-1] / ends[-1]), np.array(self._times))


class OnTrajectory(Position):
    """TrajectoryPosition (1.1): a place by its way along a trajectory, and beside it."""

    def __init__(self, node: Node, catalogs: Catalogs) -> None:
        super().__init__(node)
        found = node.need("TrajectoryRef").need("Trajectory", "CatalogReference")
        if found.tag == "CatalogReference":
            found = catalogs.resolve(found)
        self._trajectory = Trajectory(found.declared(), catalogs)
        self._way, self._aside = node.number("s", low=0.0, unit="m"), node.number("t", 0.0)

    def place(self, world: World) -> Place:
        """Return the place on the trajectory as its positions are now."""
        line = self._trajectory.line(world, "")
        if self._way > line.length + 1e-6:
            raise self.node.error(f"s = {self._way:g} m is not on the trajectory, which is {line.length:.6g} m long")
        x, y, heading = line.at(self._way)
        x, y = x - self._aside * math.sin(heading), y + self._aside * math.cos(heading)
        return placed(world.roads, x, y, self.turned(heading))


WITH_CATALOGS["TrajectoryPosition"] = OnTrajectory


def even_way(times: Array, ways: Array) -> PPoly:
    """Return the way over time [s] that goes from place to place at an even speed.

    Where the speed changes it does so evenly around the time of the place: with 8 m/s2, and at most from
    the middle of the piece before to that of the piece after. Ways (N,) [m] do not fall.
    """
    speeds = np.diff(ways) / np.diff(times)
    half = np.minimum(np.abs(np.diff(speeds)) / (2.0 * _CHANGE), 0.5 * np.minimum(*_neighbours(np.diff(times))))
    half = np.maximum(half, 1e-9)
    knots = np.sort(np.r_[times[0], times[1:-1] - half, times[1:-1] + half, times[-1]])
    at_knots = np.r_[speeds[0], np.column_stack([speeds[:-1], speeds[1:]]).ravel(), speeds[-1]]
    kept = np.r_[True, np.diff(knots) > 0.0]
    knots, at_knots = knots[kept], at_knots[kept]
    pieces = np.diff(knots)
    gone = ways[0] + np.r_[0.0, np.cumsum(0.5 * pieces * (at_knots[:-1] + at_knots[1:]))]
    return PPoly(np.array([0.5 * np.diff(at_knots) / pieces, at_knots[:-1], gone[:-1]]), knots)


def _neighbours(spans: Array) -> tuple[Array, Array]:
    return spans[:-1], spans[1:]


class Follow(Process):
    """Goes along a trajectory: at its own times, or at the speed that the entity has.

    Who goes backwards when it begins has its rear ahead (`facing` -1); who changes direction on it goes back along it.
    """

    def __init__(self, line: Line, start: float, law: PPoly | None, facing: int = 1) -> None:
        self.line, self.start, self._law, self.facing = line, start, law, facing
        self.domains = frozenset({"lateral"} if law is None else {"longitudinal", "lateral"})
        self.ends_at = math.inf if law is None else float(law.x[-1])

    @classmethod
    def timed(cls, line: Line, now: float, scale: float, offset: float, start: float) -> Follow:
        """Return the motion with the times of the line, scaled and moved [s]; from a way on [m]."""
        assert line.times is not None and line.knots is not None
        times, ways = now + offset + scale * line.times, line.knots
        return cls(line, start, even_way(times, np.asarray(ways)))

    def finished(self, motion: Motion, world: World) -> bool:
        """Return whether the end of the line is reached."""
        if self._law is not None:
            return motion.time >= self.ends_at - 1e-6
        is_back = motion.along <= 1e-9 and self.facing * motion.speed < 0.0
        return is_back or motion.along >= self.line.length - 1e-6

    def advanced(self, motion: Motion, until: float, world: World) -> tuple[float, float]:
        """Return way and speed of the times of the line."""
        assert self._law is not None
        low, high = float(self._law.x[0]), float(self._law.x[-1])
        first, second = (min(max(time, low), high) for time in (motion.time, until))
        speed = float(self._law(second, 1)) if low <= until <= high else 0.0
        return max(float(self._law(second) - self._law(first)), 0.0), max(speed, 0.0)

    def way_at(self, time: float) -> float:
        """Return the way along the line at a time [m]."""
        if self._law is None:
            return self.start
        return float(self._law(min(max(time, float(self._law.x[0])), float(self._law.x[-1]))))
