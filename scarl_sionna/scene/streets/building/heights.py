"""Heights beside and between roads: those of their borders, by distance."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree

from ..model import Array
from .surfaces import Piece

STEP = 0.25
"""Distance between points of the borders from which heights follow [m]."""
_NEAREST = 6


def border_points(pieces: Sequence[Piece]) -> Array:
    """Return points along the outlines of pieces, `STEP` apart, shape (n, 3)."""
    found = []
    for piece in pieces:
        for line in (piece.inner, piece.outer):
            way = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(line[:, :2], axis=0), axis=1))]
            even = np.union1d(way, np.arange(0.0, way[-1], STEP))
            found.append(np.column_stack([np.interp(even, way, line[:, k]) for k in range(3)]))
        for end in (0, -1):
            share = np.linspace(0.0, 1.0, max(2, int(np.linalg.norm(piece.outer[end] - piece.inner[end]) / STEP) + 1))
            found.append(piece.inner[end] + share[:, None] * (piece.outer[end] - piece.inner[end]))
    return np.concatenate(found)


class GroundHeight:
    """Height of the ground at points of the plane: that of the borders there, between them by distance.

    Inverse distance weighting (Shepard, 1968) of the six nearest border points, by the third power.
    """

    def __init__(self, points: Array) -> None:
        self._tree, self._z = cKDTree(points[:, :2]), points[:, 2]

    def __call__(self, places: Array) -> Array:
        """Return heights (n,) [m] at places (n, 2)."""
        count = min(_NEAREST, len(self._z))
        distance, index = self._tree.query(places, count)
        distance, index = distance.reshape(len(places), count), index.reshape(len(places), count)
        weight = 1.0 / np.maximum(distance, 1e-4) ** 3
        return np.asarray((weight * self._z[index]).sum(1) / weight.sum(1))
