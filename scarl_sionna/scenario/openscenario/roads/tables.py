"""Reference lines and lanes of a road in tables of even steps: a place is looked up in microseconds."""

from __future__ import annotations

import math

import numpy as np

from scarl_sionna.scene.streets.geometry.road import RoadShape
from scarl_sionna.scene.streets.model import LaneSection

STEP = 0.25
"""Distance of the rows [m]: between two of them a lane's middle is off by less than 1 mm where it bends by 0.1 /m."""
_MOST_ROWS = 40_000


class RoadTable:
    """The reference line of one road.

    Parameters
    ----------
    shape : RoadShape
    """

    def __init__(self, shape: RoadShape) -> None:
        self.length = shape.road.length
        self._count = min(max(math.ceil(self.length / STEP), 1), _MOST_ROWS)
        self._step = self.length / self._count
        self.places = np.linspace(0.0, self.length, self._count + 1)
        frame = shape.frame(self.places)
        self.x, self.y = frame.x, frame.y
        self._rows = list(
            zip(
                frame.x.tolist(),
                frame.y.tolist(),
                np.unwrap(frame.heading).tolist(),
                frame.curvature.tolist(),
                strict=True,
            )
        )

    def at(self, s: float) -> tuple[float, float, float, float]:
        """Return x, y [m], heading [rad] and curvature [1/m] at `s` [m], held at both ends."""
        where = min(max(s, 0.0), self.length) / self._step
        index = min(int(where + 0.5), self._count)
        x, y, heading, curvature = self._rows[index]
        away = (where - index) * self._step
        middle = heading + 0.5 * curvature * away
        return x + away * math.cos(middle), y + away * math.sin(middle), heading + curvature * away, curvature

    def project(self, x: float, y: float, s: float) -> tuple[float, float]:
        """Return s and t [m] of a point, beginning at a place near it."""
        t = 0.0
        for _ in range(6):
            px, py, heading, curvature = self.at(s)
            cos, sin = math.cos(heading), math.sin(heading)
            along, t = (x - px) * cos + (y - py) * sin, (y - py) * cos - (x - px) * sin
            step = along / max(1.0 - curvature * t, 0.2)
            s = min(max(s + step, 0.0), self.length)
            if abs(step) < 1e-6:
                break
        return s, t


class LaneTable:
    """The borders of the lanes of one section; widths are those of the file."""

    def __init__(self, shape: RoadShape, section: LaneSection) -> None:
        self._start = section.s
        span = max(section.stop - section.s, 1e-6)
        self._count = min(max(math.ceil(span / STEP), 1), _MOST_ROWS)
        self._step = span / self._count
        places = np.clip(np.linspace(section.s, section.stop, self._count + 1), section.s, section.stop)
        self._borders, self._lengths = {}, {}
        curvature = shape.frame(places).curvature
        for lane in (0, *section.lanes):
            inner, outer = shape.borders(section, lane, places)
            self._borders[lane] = (np.asarray(inner).tolist(), np.asarray(outer).tolist())
            stretch = 1.0 - curvature * 0.5 * (inner + outer)
            self._lengths[lane] = np.r_[0.0, np.cumsum(0.5 * self._step * (stretch[:-1] + stretch[1:]))].tolist()
        self.lanes = tuple(sorted(section.lanes))
        self.paved = tuple(lane for lane in self.lanes if section.lanes[lane].kind != "none")

    def borders(self, lane: int, s: float) -> tuple[float, float]:
        """Return t of the inner and of the outer border of a lane [m] at `s` of the road."""
        where = min(max((s - self._start) / self._step, 0.0), float(self._count))
        index = min(int(where), self._count - 1)
        share = where - index
        inner, outer = self._borders[lane]
        return (
            inner[index] + share * (inner[index + 1] - inner[index]),
            outer[index] + share * (outer[index + 1] - outer[index]),
        )

    def length(self, lane: int, s: float) -> float:
        """Return the length of a lane's middle from the start of the section to `s` of the road [m]."""
        where = min(max((s - self._start) / self._step, 0.0), float(self._count))
        index = min(int(where), self._count - 1)
        rows = self._lengths[lane]
        return float(rows[index] + (where - index) * (rows[index + 1] - rows[index]))

    def middle(self, lane: int, s: float) -> float:
        """Return t of the middle of a lane [m]."""
        inner, outer = self.borders(lane, s)
        return 0.5 * (inner + outer)

    def beside(self, s: float, t: float) -> float:
        """Return how far t is beside the lanes that are of some kind [m]."""
        ends = [self.borders(lane, s) for lane in self.paved]
        return min((max(min(a, b) - t, t - max(a, b), 0.0) for a, b in ends), default=math.inf)

    def lane_at(self, s: float, t: float) -> tuple[int, float]:
        """Return the lane that holds t, and how far outside of it t is [m]: the nearest one where none does."""
        best, away = 0, math.inf
        for lane in self.lanes:
            inner, outer = self.borders(lane, s)
            low, high = min(inner, outer), max(inner, outer)
            if high - low < 0.05 and len(self.lanes) > 1:
                continue
            outside = max(low - t, t - high, 0.0)
            if outside < away:
                best, away = lane, outside
            if outside == 0.0:
                break
        return best, away
