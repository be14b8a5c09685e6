"""What feet stand on: the height of what stands still below a place, without rays, so that a joint may ask for it."""

from __future__ import annotations

from functools import cached_property

import numpy as np
import numpy.typing as npt

from .geometry import Triangles

Array = npt.NDArray[np.float64]

STEEPEST = 0.1
"""Least vertical part of the unit normal of a face that counts: the bevel of a kerb does, its front does not."""


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

    def heights(self, points: Array, reach: float) -> Array:
        """Return the height (N,) [m] of the highest face at most `reach` [m] above or below points (N, 3) [m, world].

        NaN where there is none.
        """
        corners, lower, upper = self._faces
        low, high = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
        near = corners[np.all((lower <= high) & (upper >= low), axis=1)]
        found = np.full(len(points), np.nan)
        if not len(near):
            return found
        first, second = near[:, 1, :2] - near[:, 0, :2], near[:, 2, :2] - near[:, 0, :2]
        size = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
        for row, point in enumerate(points):
            away = point[:2] - near[:, 0, :2]
            u = (away[:, 0] * second[:, 1] - away[:, 1] * second[:, 0]) / size
            v = (first[:, 0] * away[:, 1] - first[:, 1] * away[:, 0]) / size
            slack = 1e-9
            height = near[:, 0, 2] + u * (near[:, 1, 2] - near[:, 0, 2]) + v * (near[:, 2, 2] - near[:, 0, 2])
            under = (u >= -slack) & (v >= -slack) & (u + v <= 1.0 + slack) & (np.abs(height - point[2]) <= reach)
            if under.any():
                found[row] = height[under].max()
        return found
