"""The ground along a way, where it is rougher than a lane: kerbs, ramps, drives."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ParameterRangeError

Array = npt.NDArray[np.float64]

_APART = 1e-3
"""Distance in plan from which points of a way are two [m]."""
_CLOSE, _MOST = 0.1, 5000
"""Distance [m] of the places at which a way is compared with what lies over or below it, and how many there are."""
_LEVEL = 0.01
"""Difference of heights that is none [m]."""


class GroundLine:
    """Heights along a line on the ground, straight between its points and level beyond its ends.

    Parameters
    ----------
    points : array_like of float, shape (N, 3)
        On the ground, N >= 2, in order, distinct in plan [m].

    Raises
    ------
    ParameterRangeError
        If the shape is another one, or points are not distinct.
    """

    def __init__(self, points: npt.ArrayLike) -> None:
        line = np.asarray(points, dtype=np.float64)
        if line.ndim != 2 or len(line) < 2 or line.shape[1] != 3 or not np.isfinite(line).all():
            raise ParameterRangeError("ground", f"shape {line.shape}", "finite, shape (N, 3) with N >= 2 [m]")
        self._line, self._step = line, np.diff(line, axis=0)
        self._square = (self._step[:, :2] ** 2).sum(1)
        if self._square.min() < _APART**2:
            raise ParameterRangeError("ground", f"point {int(self._square.argmin())} twice in a row", "distinct points")

    def __call__(self, places: npt.ArrayLike) -> Array:
        """Return the heights (M,) [m] of the points of the line that are nearest in plan to places (M, 2) [m]."""
        return self._heights(np.asarray(places, dtype=np.float64), np.full((1, len(self._step)), True))

    def near(self, places: npt.ArrayLike, ways: npt.ArrayLike, reach: float) -> Array:
        """Return the heights (M,) [m] of what is nearest in plan to places (M, 2) [m] on a part of the line for each.

        Parameters
        ----------
        places : array_like of float, shape (M, 2)
            [m]
        ways : array_like of float, shape (M,)
            Distance along the line in plan, of the middle of that part [m].
        reach : float
            How far it goes on both sides of that, >= 0 [m]; pieces of the line count as a whole.
        """
        way = np.asarray(ways, dtype=np.float64)[:, None]
        among = (self.ways[:-1] <= way + reach + _APART) & (self.ways[1:] >= way - reach - _APART)
        return self._heights(np.asarray(places, dtype=np.float64), among)

    @property
    def ways(self) -> Array:
        """Distances along the line in plan, shape (N,) [m]."""
        return np.concatenate([[0.0], np.cumsum(np.sqrt(self._square))])

    def _heights(self, spot: Array, among: npt.NDArray[np.bool_]) -> Array:
        offset = spot[:, None] - self._line[:-1, :2]
        share = np.clip((offset * self._step[:, :2]).sum(2) / self._square, 0.0, 1.0)
        away = np.linalg.norm(offset - share[..., None] * self._step[:, :2], axis=2)
        nearest, rows = np.where(among, away, np.inf).argmin(1), np.arange(len(spot))
        return np.asarray(self._line[nearest, 2] + share[rows, nearest] * self._step[nearest, 2])


def shifted_way(points: Array, shift: Array) -> tuple[Array, GroundLine | None]:
    """Return a way that is shifted on its own ground, and that ground.

    Parameters
    ----------
    points : ndarray of float64, shape (N, 3)
        Of the way, on the ground; may repeat [m].
    shift : ndarray of float64, shape (3,)
        Horizontal [m].

    Returns
    -------
    ndarray of float64, shape (N, 3)
        Each at the height of what is nearest of the way within the shift before and after its own place, so that a ramp
        may wind over itself [m]. At heights as they were where the way stands, or goes straight up or down anywhere.
    GroundLine or None
        None where the ground is no function of the plan: where the way stands, goes straight up or down, or passes over
        or beside itself at another height.
    """
    moved, kept, own = points + shift, [0], []
    for index, point in enumerate(points):
        if np.linalg.norm(point[:2] - points[kept[-1], :2]) > _APART:
            kept.append(index)
        elif abs(point[2] - points[kept[-1], 2]) > _APART:
            return moved, None
        own.append(len(kept) - 1)
    if len(kept) < 2:
        return moved, None
    line, reach = GroundLine(points[kept]), float(np.linalg.norm(shift))
    moved[:, 2] = line.near(moved[:, :2], line.ways[own], reach)
    close = np.linspace(0.0, line.ways[-1], min(int(line.ways[-1] / _CLOSE), _MOST) + 2)
    plan = np.column_stack([np.interp(close, line.ways, points[kept, axis]) for axis in (0, 1)]) + shift[:2]
    one_level = np.abs(line(plan) - line.near(plan, close, reach)).max() < _LEVEL
    return moved, line if one_level else None
