"""Roads that bend both ways and go up and down."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from ..geometry.mesh import Array
from .road import RoadCurve


@dataclass(frozen=True)
class Way(RoadCurve):
    """Reference line through the origin along +x, with bends and heights.

    Attributes
    ----------
    bends : sequence of (start, stop, radius)
        Arc lengths between which it bends, and the radius [m], positive = to the left; the curvature grows and falls
        over `transition`.
    heights : sequence of (arc length, height)
        Points of a natural cubic spline [m]; none = level.
    crown : float
        Slope of the cross-section towards both sides, for `point` at offsets up to `half` [m].
    half : float
        Half the width of the carriageway [m]; further out the height is that of its edge.
    """

    bends: Sequence[tuple[float, float, float]] = ()
    heights: Sequence[tuple[float, float]] = ()
    crown: float = 0.0
    half: float = 3.0
    transition: float = 30.0
    step: float = 0.05

    def __post_init__(self) -> None:
        """Integrate as the base does, then move the line: along +x through the origin at arc length 0."""
        super().__post_init__()
        s, x, y, heading = self._table  # type: ignore[attr-defined]
        x0, y0, turn = (float(np.interp(0.0, s, column)) for column in (x, y, heading))
        c, si = np.cos(-turn), np.sin(-turn)
        moved = c * (x - x0) - si * (y - y0), si * (x - x0) + c * (y - y0)
        object.__setattr__(self, "_table", (s, *moved, heading - turn))
        spline = CubicSpline(*np.array(self.heights, float).T, bc_type="natural") if self.heights else None
        object.__setattr__(self, "_spline", spline)

    def curvature(self, s: Array) -> Array:
        """Return the curvature [1/m] at arc length `s` [m]; positive = to the left."""
        total = np.zeros_like(np.asarray(s, float))
        for start, stop, radius in self.bends:
            up = np.clip((s - start) / self.transition, 0.0, 1.0)
            down = np.clip((stop - s) / self.transition, 0.0, 1.0)
            total = total + (up * up * (3 - 2 * up)) * (down * down * (3 - 2 * down)) / radius
        return total

    def elevation(self, s: Array) -> Array:
        """Return the height of the reference line [m]; beyond the points it stays that of the last."""
        spline = self._spline  # type: ignore[attr-defined]
        if spline is None:
            return np.zeros_like(np.asarray(s, float))
        return np.asarray(spline(np.clip(s, spline.x[0], spline.x[-1])))

    def point(self, s: Array, offset: Array | float = 0.0, z: Array | float = 0.0) -> Array:
        """Return world points, shape (..., 3) [m]; `z` is above the road, whose cross-section falls to both sides."""
        points = super().point(s, offset, z)
        s, offset = np.broadcast_arrays(np.asarray(s, float), offset)
        points[..., 2] += self.elevation(s) - self.crown * np.minimum(np.abs(offset), self.half)
        return points

    def line(self, start: float, stop: float, offset: float = 0.0, step: float = 2.0) -> Array:
        """Return points at `offset` from one arc length to another, shape (n, 3) [m].

        Against the road where the second is smaller.
        """
        s = np.linspace(start, stop, max(2, int(np.ceil(abs(stop - start) / step)) + 1))
        return self.point(s, offset)

    def place(self, s: float, offset: float, z: float = 0.0) -> tuple[Array, float]:
        """Return a point, shape (3,) [m], and the direction of the road there [deg]."""
        return self.point(np.array(s), offset, z), float(np.degrees(self.heading(np.array(s))))
