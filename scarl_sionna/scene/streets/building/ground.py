"""Ground beside the roads: it meets their outer borders, rises and falls with them, and leaves room for nothing."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import shapely

from scenes_xml.generators.geometry.mesh import Mesh

from ..model import Array
from .areas import Paved
from .heights import GroundHeight, border_points
from .surfaces import LAP, Piece, polygons, sheet

REACH, TILE_SIZE = 60.0, 24.0
"""How far the ground reaches beside the roads, and side of the squares in which its height is sampled [m]."""
MARGIN = 10.0
"""How far it reaches beside what is built [m]."""


class GroundFrame:
    """Places of objects that belong to no road: s is x, t is y, heights above the ground."""

    def __init__(self, height: GroundHeight) -> None:
        self._height = height

    def point(self, s: npt.ArrayLike, t: npt.ArrayLike = 0.0, h: npt.ArrayLike = 0.0) -> Array:
        """Return world points (..., 3) [m]."""
        x, y, up = np.broadcast_arrays(np.asarray(s, float), np.asarray(t, float), np.asarray(h, float))
        ground = self._height(np.column_stack([x.ravel(), y.ravel()])).reshape(x.shape)
        return np.stack([x, y, ground + up], -1)

    def heading(self, s: npt.ArrayLike) -> Array:
        """Return 0, the direction of x [rad]."""
        return np.zeros_like(np.asarray(s, dtype=np.float64))


def ground_sheets(
    pieces: Sequence[Piece], paved: Sequence[Paved] = (), built: Sequence[shapely.Geometry] = ()
) -> tuple[list[Mesh], GroundHeight]:
    """Return the ground around pieces that lie on it, and its height.

    It leaves room for `paved` areas as well, and reaches beyond what is `built` beside the roads.
    """
    low = [piece for piece in pieces if piece.structure != "bridge"] or list(pieces)
    height = GroundHeight(np.concatenate([border_points(low), *(one.border for one in paved)]))
    taken = shapely.union_all([*(piece.footprint for piece in low), *(one.plan for one in paved)], grid_size=1e-4)
    area = shapely.buffer(shapely.simplify(taken, 1.0), REACH, quad_segs=4)
    if built:
        area = shapely.union(area, shapely.union_all([shapely.buffer(one, MARGIN, quad_segs=2) for one in built]))
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
