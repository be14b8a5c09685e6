"""Which mirror a ray has met: exactly one, also where mirrors share an edge, a plane or what lies on them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.arrays.rows import row_all
from scarl_sionna.core.settings.mirrors import DEFAULT_MIRRORS
from scarl_sionna.scene.tables import RayHits

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]
Index = npt.NDArray[np.int64]

NO_MIRROR = -1
"""Of a hit that is on no mirror."""
COINCIDENT = 1e-4
"""Planes this near to each other [m] are one up to the rounding of float32 meshes: of several mirrors there, the first
is met."""
_NEAR = 10.0 * COINCIDENT
"""By which the boxes of triangles are widened [m]: what is within `COINCIDENT` of the edges of a sharp corner may be
farther from its point."""
_PAIRS = 1 << 20
"""Points and triangles near to them that are compared in one piece: bounds the memory, changes no result."""
_COMPARED = 1 << 18
"""Points and mirrors that are compared in one piece: what the processor's cache holds, changes no result."""
_WAITING = 1 << 22
"""Points and mirrors of which the nearest is found in one piece: bounds the memory, changes no result."""
_MOST_CELLS = 1024
"""Of a grid along each axis: bounds the memory, changes no result."""


class MirrorFaces:
    """The triangles of mirrors, and who owns a hit.

    A reflection over a mirror counts only where the mirror owns the hit, so the same echo is not there twice: not over
    both planes of a road near its crown, where they are less than `thickness` apart, and not over two instances that
    lie in one plane.

    Parameters
    ----------
    num_faces : int
        Of the state.
    faces : sequence of ndarray of int64
        Triangles of each mirror, rows of the state's :class:`~scarl_sionna.engine.rays.face_planes.FaceTable`.
    normal : ndarray of float64, shape (num_mirrors, 3)
    offset : ndarray of float64, shape (num_mirrors,)
        Planes of the mirrors: normal . x = offset [m, world].
    corners : sequence of ndarray of float64, shape (num_triangles, 3, 3)
        Of each mirror's triangles [m, world].
    thickness : float
        What lies this near to a mirror's plane, such as a road marking, belongs to it [m].
    """

    def __init__(
        self,
        num_faces: int,
        faces: Sequence[Index],
        normal: Array,
        offset: Array,
        corners: Sequence[Array],
        thickness: float = DEFAULT_MIRRORS.thickness,
    ) -> None:
        self.thickness = thickness
        self._of_face = np.full(num_faces, NO_MIRROR, dtype=np.int64)
        for number, rows in enumerate(faces):
            self._of_face[rows] = number
        self._normal, self._offset = normal.reshape(-1, 3), offset
        self._corners = tuple(corners)

    def on(self, number: Index, hits: RayHits, aim: Array) -> Flags:
        """Return which hits are on the mirror with a number, shape (num_hits,): those that it owns, see :meth:`owner`.

        Parameters
        ----------
        number : ndarray of int64, shape (num_hits,)
        hits : RayHits
        aim : ndarray of float64, shape (num_hits, 3)
            As of :meth:`owner`.
        """
        own, limit = self._of_face[hits.face], np.full(len(number), self.thickness)
        rows = np.flatnonzero(own != NO_MIRROR)
        limit[rows] = self._height(hits.point[rows], own[rows]) + COINCIDENT
        found = self._height(hits.point, number) < limit + COINCIDENT  # few are: the others are not compared with all
        rows = np.flatnonzero(found)
        for some in np.array_split(rows, 1 + len(rows) * len(self._normal) // _WAITING):
            found[some] = self.owner(hits.face[some], hits.point[some], aim[some]) == number[some]
        return found

    def owner(self, face: Index, point: Array, aim: Array) -> Index:
        """Return the number of the mirror that each hit is on, `NO_MIRROR` where it is on none.

        A hit on a mirror's own triangle is on that mirror. One on anything else within `thickness` of mirrors is on the
        nearest of those that go on where the ray was aimed, or, where none does, of all of them: a marking may fill a
        hole.

        Parameters
        ----------
        face : ndarray of int64, shape (num_hits,)
            Triangles that are met, rows of the state's table.
        point : ndarray of float64, shape (num_hits, 3)
            Where [m, world].
        aim : ndarray of float64, shape (num_hits, 3)
            Points in planes of mirrors that the rays of the hits were sent to [m, world].
        """
        own, result, waiting = self._of_face[face], np.empty(len(face), dtype=np.int64), []
        for some in np.array_split(np.arange(len(face)), 1 + len(face) * len(self._normal) // _COMPARED):
            height = np.abs(point[some] @ self._normal.T - self._offset)
            here = np.full(len(some), self.thickness)
            rows = np.flatnonzero(own[some] != NO_MIRROR)
            here[rows] = height[rows, own[some[rows]]] + COINCIDENT
            may = height < here[:, None]
            count = np.count_nonzero(may, axis=1)
            result[some] = np.where(count > 0, may.argmax(axis=1), NO_MIRROR)
            several = np.flatnonzero(count > 1)
            waiting.append((some[several], height[several], may[several]))
        rows, height, may = (np.concatenate(column) for column in zip(*waiting, strict=True))
        result[rows] = self._nearest(aim[rows], height, may, own[rows])
        return result

    def _height(self, point: Array, number: Index) -> Array:
        """Return the distances of points from the planes of mirrors, one mirror each [m]."""
        return np.asarray(np.abs(np.einsum("ij,ij->i", point, self._normal[number]) - self._offset[number]))

    def _nearest(self, aim: Array, height: Array, may: Flags, own: Index) -> Index:
        """Return the first of the nearest mirrors that go on where rays were aimed, of those that may own the hits."""
        under = np.zeros_like(may)
        for number in np.flatnonzero(may.any(axis=0)):
            rows = np.flatnonzero(may[:, number])
            on_it = own[rows] == number
            under[rows[on_it], number] = True
            rows = rows[~on_it]
            under[rows, number] = inside(aim[rows], self._corners[number], self._normal[number])
        chosen = np.where(under.any(axis=1, keepdims=True), under, may)
        height = np.where(chosen, height, np.inf)
        return np.asarray((height < height.min(axis=1, keepdims=True) + COINCIDENT).argmax(axis=1), dtype=np.int64)


def inside(point: Array, corners: Array, normal: Array) -> Flags:
    """Return which points are over one of the triangles in a plane, or within `COINCIDENT` of its edges [m]."""
    if not len(point):
        return np.zeros(0, dtype=np.bool_)
    across = np.delete(np.arange(3), np.abs(normal).argmax())
    flat, triangles = point[:, across], corners[:, :, across]
    lower, upper = triangles.min(axis=1) - _NEAR, triangles.max(axis=1) + _NEAR
    used = row_all((upper > flat.min(axis=0)) & (lower < flat.max(axis=0)))
    triangles, cells = triangles[used], _Cells(lower[used], upper[used])
    edge = np.roll(triangles, -1, axis=1) - triangles
    turn = np.sign(edge[:, 0, 0] * edge[:, 1, 1] - edge[:, 0, 1] * edge[:, 1, 0])
    edge /= np.maximum(np.linalg.norm(edge, axis=2, keepdims=True), COINCIDENT)
    found = np.zeros(len(flat), dtype=np.bool_)
    for row, near in cells.pairs(flat):
        away = flat[row, None] - triangles[near]
        side = (edge[near, :, 0] * away[..., 1] - edge[near, :, 1] * away[..., 0]) * turn[near, None]
        found[row[row_all(side > -COINCIDENT) & (turn[near] != 0.0)]] = True
    return found


class _Cells:
    """Boxes in a plane by the cells of a grid, so that each point is compared with the few boxes about it.

    `lower` and `upper` are the corners of the boxes, (n, 2).
    """

    def __init__(self, lower: Array, upper: Array) -> None:
        self.num_boxes = len(lower)
        if not self.num_boxes:
            return
        self._origin, size = lower.min(axis=0), np.ptp(np.concatenate([lower, upper]), axis=0)
        side = float(np.sqrt(max(size[0] * size[1], 1e-12) / self.num_boxes))
        cells = np.clip(size / side, 1, _MOST_CELLS)
        while True:
            self._shape = np.maximum(cells, 1).astype(np.int64)
            self._side = np.maximum(size, 1e-9) / self._shape
            first, wide = self._cell(lower), self._cell(upper) - self._cell(lower) + 1
            count = wide.prod(axis=1)
            if count.sum() <= max(_PAIRS, 4 * self.num_boxes):
                break
            cells /= 2.0  # boxes that overlap a lot
        box = np.repeat(np.arange(self.num_boxes), count)
        step = np.arange(len(box)) - np.repeat(np.cumsum(count) - count, count)
        cell = first[box] + np.stack([step // wide[box, 1], step % wide[box, 1]], axis=1)
        number = self._number(cell)
        self._box = box[np.argsort(number, kind="stable")]
        self._count = np.bincount(number, minlength=int(self._shape.prod()))
        self._start = np.cumsum(self._count) - self._count

    def _cell(self, point: Array) -> Index:
        return np.clip(((point - self._origin) / self._side).astype(np.int64), 0, self._shape - 1)

    def _number(self, cell: Index) -> Index:
        return np.asarray(cell[:, 0] * self._shape[1] + cell[:, 1])

    def pairs(self, point: Array) -> Iterator[tuple[Index, Index]]:
        """Yield rows of points and of the boxes in their cells, piece by piece."""
        if not self.num_boxes or not len(point):
            return
        number = self._number(self._cell(point))
        done = np.cumsum(self._count[number])
        edges = np.searchsorted(done // _PAIRS, np.arange(1, done[-1] // _PAIRS + 1))
        for first, last in zip([0, *edges], [*edges, len(point)], strict=True):
            count = self._count[number[first:last]]
            row = np.repeat(np.arange(first, last), count)
            step = np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count)
            yield row, self._box[self._start[number[row]] + step]
