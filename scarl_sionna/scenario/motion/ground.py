"""The ground along a way, where it is rougher than a lane: kerbs, ramps, drives."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ParameterRangeError

Array = npt.NDArray[np.float64]


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
        if self._square.min() < 1e-6:
            raise ParameterRangeError("ground", f"point {int(self._square.argmin())} twice in a row", "distinct points")

    def __call__(self, places: npt.ArrayLike) -> Array:
        """Return the heights (M,) [m] of the points of the line that are nearest in plan to places (M, 2) [m]."""
        spot = np.asarray(places, dtype=np.float64)
        offset = spot[:, None] - self._line[:-1, :2]
        share = np.clip((offset * self._step[:, :2]).sum(2) / self._square, 0.0, 1.0)
        away = np.linalg.norm(offset - share[..., None] * self._step[:, :2], axis=2)
        nearest, rows = away.argmin(1), np.arange(len(spot))
        return np.asarray(self._line[nearest, 2] + share[rows, nearest] * self._step[nearest, 2])


def distinct(points: Array) -> Array:
    """Return those of points (N, 3) [m] that lie apart in plan from the one before, for a `GroundLine`."""
    return points[np.concatenate([[True], np.linalg.norm(np.diff(points[:, :2], axis=0), axis=1) > 1e-3])]
