"""Ground beside the roads: it meets their outer borders, rises and falls with them, and leaves room for nothing."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely
from scipy.spatial import cKDTree

from scenes_xml.generators.geometry.mesh import Mesh

from ..model import Array
from .surfaces import LAP, Piece, polygons, sheet

REACH, TILE_SIZE = 60.0, 24.0
"""How far the ground reaches beside the roads, and side of the squares in which its height is sampled [m]."""
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


def ground_sheets(pieces: Sequence[Piece]) -> tuple[list[Mesh], GroundHeight]:
    """Return the ground around pieces that lie on it, as one mesh for each square kilometre, and its height."""
    low = [piece for piece in pieces if piece.structure != "bridge"] or list(pieces)
    height = GroundHeight(border_points(low))
    taken = shapely.union_all([piece.footprint for piece in low], grid_size=1e-4)
    area = shapely.buffer(shapely.simplify(taken, 1.0), REACH, quad_segs=4)
    free = shapely.difference(area, shapely.segmentize(shapely.buffer(taken, -LAP, join_style="mitre"), 2.0))
    shapely.prepare(free)
    x0, y0, x1, y1 = shapely.bounds(free)
    sheets = []
    for i in range(int(np.ceil((x1 - x0) / TILE_SIZE))):
        column = shapely.intersection(free, shapely.box(x0 + i * TILE_SIZE, y0, x0 + (i + 1) * TILE_SIZE, y1))
        if column.is_empty:
            continue
        for j in range(int(np.ceil((y1 - y0) / TILE_SIZE))):
            low_y = y0 + j * TILE_SIZE
            square = shapely.box(x0 + i * TILE_SIZE, low_y, x0 + (i + 1) * TILE_SIZE, low_y + TILE_SIZE)
            parts = polygons(shapely.intersection(column, square))
            if parts:
                sheets.append(sheet(shapely.MultiPolygon(parts), height))
    return sheets, height
