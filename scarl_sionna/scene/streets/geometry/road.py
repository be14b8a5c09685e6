"""A road as a surface: points at s along its reference line, t to the left, h above; and the borders of its lanes."""

from __future__ import annotations

from collections import OrderedDict

import numpy as np
import numpy.typing as npt

from ..model import Array, LaneSection, MapLane, Road
from .curves import Frame, evaluate

LONGEST_STEP = 12.0
"""Largest distance between two stations of a surface [m]."""
_KEPT = 8
_INSIDE = np.array([0.2, 0.5, 0.8])


class RoadShape:
    """Geometry of one road.

    Parameters
    ----------
    road : Road

    Notes
    -----
    Superelevation turns the cross-section about the reference line, so that lanes are narrower in plan; crossfall and
    shapes lift it along the turned normal. Lanes marked as level go on horizontally from where they begin.
    """

    def __init__(self, road: Road) -> None:
        self.road = road
        self._starts = np.array([piece.s for piece in road.plan])
        self._known: OrderedDict[bytes, Frame] = OrderedDict()

    def frame(self, s: npt.ArrayLike) -> Frame:
        """Return the reference line in plan at `s` (n,) [m], held at both ends."""
        place = np.clip(np.atleast_1d(np.asarray(s, dtype=np.float64)), 0.0, self.road.length)
        key = place.tobytes()  # borders of many lanes are asked for at the same stations
        if key not in self._known:
            self._known[key] = self._frame(place)
            if len(self._known) > _KEPT:
                self._known.popitem(last=False)
        return self._known[key]

    def _frame(self, place: Array) -> Frame:
        index = np.clip(np.searchsorted(self._starts, place, "right") - 1, 0, None)
        table = np.zeros((4, place.size))
        for k in np.unique(index):
            piece, own = self.road.plan[k], index == k
            found = evaluate(piece, np.clip(place[own] - piece.s, 0.0, piece.length))
            table[:, own] = found.x, found.y, found.heading, found.curvature
        return Frame(table[0], table[1], table[2], table[3])

    def point(self, s: npt.ArrayLike, t: npt.ArrayLike = 0.0, h: npt.ArrayLike = 0.0) -> Array:
        """Return world points (..., 3) [m] at `s`, `t` to the left and `h` above the road's surface."""
        place, left, up = np.broadcast_arrays(np.asarray(s, float), np.asarray(t, float), np.asarray(h, float))
        flat, side = place.ravel(), left.ravel()
        frame, roll = self.frame(flat), self.road.superelevation(np.clip(flat, 0.0, self.road.length))
        lift = up.ravel() + self._lift(flat, side)
        across = side * np.cos(roll) - lift * np.sin(roll)
        z = self.road.elevation(np.clip(flat, 0.0, self.road.length)) + side * np.sin(roll) + lift * np.cos(roll)
        cos, sin = np.cos(frame.heading), np.sin(frame.heading)
        return np.stack([frame.x - across * sin, frame.y + across * cos, z], -1).reshape(*place.shape, 3)

    def heading(self, s: npt.ArrayLike) -> Array:
        """Return the direction of the reference line [rad]."""
        place = np.asarray(s, dtype=np.float64)
        return self.frame(place).heading.reshape(place.shape)

    def curvature(self, s: npt.ArrayLike) -> Array:
        """Return the curvature of the reference line [1/m]."""
        place = np.asarray(s, dtype=np.float64)
        return self.frame(place).curvature.reshape(place.shape)

    def _lift(self, s: Array, t: Array) -> Array:
        """Return how far crossfall and shapes lift the surface above the turned plane [m]."""
        left, right = self.road.crossfalls
        lift = np.zeros_like(s)
        if left.starts.size or right.starts.size:
            lift -= np.abs(t) * np.tan(np.where(t >= 0.0, left(s), right(s)))
        if len(self.road.shapes):
            lift += self._shape(s, t)
        return lift

    def _shape(self, s: Array, t: Array) -> Array:
        """Return the height of the shapes: between two of them in proportion."""
        rows = self.road.shapes
        places = np.unique(rows[:, 0])
        heights = []
        for place in places:
            own = rows[rows[:, 0] == place]
            index = np.clip(np.searchsorted(own[:, 1], t, "right") - 1, 0, None)
            way = t - own[index, 1]
            a, b, c, d = own[index, 2:].T
            heights.append(a + way * (b + way * (c + way * d)))
        table = np.stack(heights)
        k = np.clip(np.searchsorted(places, s, "right") - 1, 0, max(0, len(places) - 2))
        if len(places) == 1:
            return np.asarray(table[0])
        share = np.clip((s - places[k]) / (places[k + 1] - places[k]), 0.0, 1.0)
        columns = np.arange(len(s))
        return np.asarray(table[k, columns] * (1.0 - share) + table[k + 1, columns] * share)

    def section_at(self, s: float) -> LaneSection:
        """Return the lane section at `s`."""
        return next((one for one in reversed(self.road.sections) if one.s <= s), self.road.sections[0])

    def width(self, section: LaneSection, lane: MapLane, s: Array) -> Array:
        """Return the width of a lane [m] at `s` of the road."""
        inner, outer = self.borders(section, lane.id, s)
        return np.abs(outer - inner)

    def borders(self, section: LaneSection, lane: int, s: Array) -> tuple[Array, Array]:
        """Return t of the inner and of the outer border of a lane, (n,) each; of lane 0 the centre twice."""
        way, sign = s - section.s, 1 if lane > 0 else -1
        inner = outer = self.road.lane_offset(s)
        middle = inner
        for k in range(1, abs(lane) + 1):
            own = section.lanes[sign * k]
            inner = outer
            if own.border is not None:
                reach = np.abs(own.border(way))
                outer = middle + sign * np.maximum(reach, sign * (inner - middle))
            else:
                outer = inner + sign * np.maximum(own.width(way), 0.0)
        return inner, outer

    def edges(self, section: LaneSection, lane: int, s: Array) -> tuple[Array, Array]:
        """Return the inner and the outer border of a lane as world points, with its heights, shape (n, 3) each."""
        if lane == 0:
            points = self.point(s, self.borders(section, 0, s)[0])
            return points, points
        own, sign = section.lanes[lane], 1 if lane > 0 else -1
        inner, outer = self.borders(section, lane, s)
        level = next((k for k in range(1, abs(lane) + 1) if section.lanes[sign * k].is_level), None)
        if level is None:
            ends = [self.point(s, inner), self.point(s, outer)]
        else:
            start = self.borders(section, sign * level, s)[0]
            base, heading = self.point(s, start), self.frame(s).heading
            normal = np.column_stack([-np.sin(heading), np.cos(heading), np.zeros_like(heading)])
            ends = [base + (t - start)[:, None] * normal for t in (inner, outer)]
        for points, lift in zip(ends, lane_heights(own, s - section.s), strict=True):
            points[:, 2] += lift
        return ends[0], ends[1]

    def profile(self, section: LaneSection, s: Array) -> Array:
        """Return all borders of a section as world points, shape (n, num_borders, 3): both of each lane."""
        pairs = [edge for lane in section.lanes for edge in self.edges(section, lane, s)]
        return np.stack([self.edges(section, 0, s)[0], *pairs], 1)

    def stations(self, section: LaneSection, tolerance: float) -> Array:
        """Return places along a section so that no chord of a border leaves it by more than `tolerance` [m]."""
        inside = self.road.breaks
        inside = inside[(inside > section.s + 1e-6) & (inside < section.stop - 1e-6)]
        s = np.r_[section.s, inside, section.stop]
        for _ in range(14):
            low, high = s[:-1], s[1:]
            ends = self.profile(section, self._within(section, s))
            middles = (low[:, None] + (high - low)[:, None] * _INSIDE).ravel()
            points = self.profile(section, middles).reshape(len(low), len(_INSIDE), -1, 3)
            share = _INSIDE[None, :, None, None]
            chords = ends[:-1, None] * (1.0 - share) + ends[1:, None] * share
            away = np.linalg.norm(points - chords, axis=-1).max((1, 2))
            split = ((away > tolerance) & (high - low > 0.02)) | (high - low > LONGEST_STEP)
            if not split.any():
                break
            s = np.sort(np.r_[s, 0.5 * (low + high)[split]])
        return s

    @staticmethod
    def _within(section: LaneSection, s: Array) -> Array:
        """Return places held just inside a section, whose polynomials end there."""
        return np.clip(s, section.s, section.stop)


def lane_heights(lane: MapLane, way: Array) -> tuple[Array, Array]:
    """Return the heights of the inner and of the outer border of a lane above the road [m], (n,) each.

    Between two entries they change in proportion, before the first and after the last they are held.
    """
    if not len(lane.heights):
        return np.zeros_like(way), np.zeros_like(way)
    table = lane.heights
    return np.interp(way, table[:, 0], table[:, 1]), np.interp(way, table[:, 0], table[:, 2])
