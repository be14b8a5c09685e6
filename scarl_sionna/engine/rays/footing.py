"""What feet stand on: the height of what stands still below a place, without rays, so that a joint may ask for it."""

from __future__ import annotations

from functools import cached_property

import numpy as np
import numpy.typing as npt

from .geometry import Triangles

Array = npt.NDArray[np.float64]

STEEPEST = 0.1
"""Least vertical part of the unit normal of a face that counts: the bevel of a kerb does, its front does not."""
BLOCK = 64
"""Faces whose box is looked at before those of each."""


class Footing:
    """Faces of a scene that stand still and are not upright.

    Parameters
    ----------
    triangles : Triangles
        Of all parts, those of actors in their own frames.
    static : ndarray of bool, shape (num_parts,)
        Which parts stand still.
    """

    def __init__(self, triangles: Triangles, static: npt.NDArray[np.bool_]) -> None:
        self._triangles, self._static = triangles, static

    @cached_property
    def _faces(self) -> tuple[Array, Array, Array]:
        """Corners of the faces, and lower and upper corner of the box of each in plan."""
        faces = np.repeat(self._static, np.diff(self._triangles.first))
        corners = self._triangles.corners[faces & (np.abs(self._triangles.normal[:, 2]) > STEEPEST)]
        return corners, corners[:, :, :2].min(axis=1), corners[:, :, :2].max(axis=1)

    @cached_property
    def _blocks(self) -> tuple[Array, Array]:
        """Lower and upper corner of the box in plan of every `BLOCK` faces: neighbours of a mesh lie side by side."""
        _, lower, upper = self._faces
        starts = np.arange(0, len(lower), BLOCK)
        return np.minimum.reduceat(lower, starts), np.maximum.reduceat(upper, starts)

    def _near(self, low: Array, high: Array) -> Array:
        """Return the corners of the faces whose box in plan meets another, from `low` to `high`, in their order."""
        corners, lower, upper = self._faces
        if not len(corners):
            return corners
        block = np.flatnonzero(_meet(*self._blocks, low, high))
        rows = (BLOCK * block[:, None] + np.arange(BLOCK)).ravel()
        rows = rows[rows < len(corners)]
        return corners[rows[_meet(lower[rows], upper[rows], low, high)]]

    def heights(self, points: Array, reach: float) -> Array:
        """Return the height (N,) [m] of the highest face at most `reach` [m] above or below points (N, 3) [m, world].

        NaN where there is none.
        """
        near = self._near(points[:, :2].min(axis=0), points[:, :2].max(axis=0))
        if not len(near):
            return np.full(len(points), np.nan)
        (x, y, z), (x1, y1, z1), (x2, y2, z2) = (near[:, corner].T for corner in range(3))
        ax, ay, bx, by = x1 - x, y1 - y, x2 - x, y2 - y
        size = ax * by - ay * bx
        dx, dy = points[:, :1] - x, points[:, 1:2] - y
        u, v = (dx * by - dy * bx) / size, (ax * dy - ay * dx) / size
        height = z + u * (z1 - z) + v * (z2 - z)
        slack = 1e-9
        under = (u >= -slack) & (v >= -slack) & (u + v <= 1.0 + slack) & (np.abs(height - points[:, 2:]) <= reach)
        highest = np.where(under, height, -np.inf).max(axis=1)
        return np.where(np.isfinite(highest), highest, np.nan)


def _meet(lower: Array, upper: Array, low: Array, high: Array) -> npt.NDArray[np.bool_]:
    """Return which boxes in plan, (n, 2) each corner, meet another."""
    (x0, y0), (x1, y1) = lower.T, upper.T
    return np.asarray((x0 <= high[0]) & (x1 >= low[0]) & (y0 <= high[1]) & (y1 >= low[1]))
