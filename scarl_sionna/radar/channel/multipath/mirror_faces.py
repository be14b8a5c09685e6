"""Which mirror a ray has met: exactly one, also where mirrors share an edge, a plane or what lies on them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.arrays.rows import row_all, row_dots
from scarl_sionna.core.settings.mirrors import DEFAULT_MIRRORS

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

    Attributes
    ----------
    of_face : ndarray of int64, shape (num_faces,)
        Number of the mirror that each face is part of, `NO_MIRROR` for none.
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
        self.of_face = np.full(num_faces, NO_MIRROR, dtype=np.int64)
        for number, rows in enumerate(faces):
            self.of_face[rows] = number
        self.normal, self.offset = normal.reshape(-1, 3), offset
        self._corners = tuple(corners)

    @property
    def boxes(self) -> Array:
        """Corners of boxes outside of which no point is :func:`inside` of each mirror, (num_mirrors, 2, 3) [m]."""
        found = np.empty((len(self._corners), 2, 3))
        for number, corners in enumerate(self._corners):
            points = corners.reshape(-1, 3)
            found[number] = points.min(axis=0) - 2.0 * _NEAR, points.max(axis=0) + 2.0 * _NEAR
            found[number, :, _along(self.normal[number])] = -np.inf, np.inf
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
        own, result, waiting = self.of_face[face], np.full(len(face), NO_MIRROR), [_Pairs.none()]
        for some in np.array_split(np.arange(len(face)), 1 + len(face) * len(self.normal) // _COMPARED):
            height = np.abs(row_dots(point[some], self.normal) - self.offset)
            limit = np.full(len(some), self.thickness)
            rows = np.flatnonzero(own[some] != NO_MIRROR)
            limit[rows] = height[rows, own[some[rows]]] + COINCIDENT
            row, number = np.divmod(np.flatnonzero(height < limit[:, None]), max(len(self.normal), 1))
            may = _Pairs(some[row], number, height[row, number])
            first, count = may.runs()
            result[may.row[first]] = may.number[first]
            is_settled = (may.number[first] == own[may.row[first]]) & may.is_nearest()[first]
            waiting.append(may.take(np.repeat((count > 1) & ~is_settled, count)))
        left = _Pairs._make(np.concatenate(column) for column in zip(*waiting, strict=True))
        chosen = self._nearest(left, own, aim)
        result[chosen.row] = chosen.number
        return result

    def _nearest(self, may: _Pairs, own: Index, aim: Array) -> _Pairs:
        """Return the first of the nearest mirrors that go on where rays were aimed, of those that may own the hits."""
        under = may.number == own[may.row]
        for number in np.unique(may.number).tolist():
            there = np.flatnonzero((may.number == number) & ~under)
            under[there] = inside(aim[may.row[there]], self._corners[number], self.normal[number])
        first, count = may.runs()
        if len(first):
            may = may.take(under | np.repeat(~np.logical_or.reduceat(under, first), count))
        may = may.take(may.is_nearest())
        return may.take(may.runs()[0])


class _Pairs(NamedTuple):
    """Hits and mirrors that may own them, those of one hit one after the other.

    `row` numbers the hits, `number` the mirrors, `height` is the distance of the hit from the mirror's plane [m]; each
    shape (num_pairs,).
    """

    row: Index
    number: Index
    height: Array

    @classmethod
    def none(cls) -> _Pairs:
        return cls(np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0))

    def take(self, pairs: Index | Flags) -> _Pairs:
        return _Pairs._make(column[pairs] for column in self)

    def runs(self) -> tuple[Index, Index]:
        """Return the first pair of each hit, and how many it has."""
        first = np.flatnonzero(np.diff(self.row, prepend=-1))
        return first, np.diff(first, append=len(self.row))

    def is_nearest(self) -> Flags:
        """Return which mirrors are as near to the hit as the nearest, shape (num_pairs,)."""
        first, count = self.runs()
        if not len(first):
            return np.zeros(0, dtype=np.bool_)
        return np.asarray(self.height < np.repeat(np.minimum.reduceat(self.height, first), count) + COINCIDENT)


def _along(normal: Array) -> int:
    """Return the axis along which points are brought to a plane."""
    return int(np.abs(normal).argmax())


def inside(point: Array, corners: Array, normal: Array) -> Flags:
    """Return which points are over one of the triangles in a plane, or within `COINCIDENT` of its edges [m]."""
    found = np.zeros(len(point), dtype=np.bool_)
    across = np.delete(np.arange(3), _along(normal))
    flat, triangles = point[:, across], corners[:, :, across]
    lower, upper = triangles.min(axis=1) - _NEAR, triangles.max(axis=1) + _NEAR
    about = np.flatnonzero(
        row_all((flat > lower.min(axis=0, initial=np.inf)) & (flat < upper.max(axis=0, initial=-np.inf)))
    )
    if not len(about):
        return found
    flat = flat[about]
    used = row_all((upper > flat.min(axis=0)) & (lower < flat.max(axis=0)))
    triangles, cells = triangles[used], _Cells(lower[used], upper[used])
    edge = np.roll(triangles, -1, axis=1) - triangles
    turn = np.sign(edge[:, 0, 0] * edge[:, 1, 1] - edge[:, 0, 1] * edge[:, 1, 0])
    edge /= np.maximum(np.linalg.norm(edge, axis=2, keepdims=True), COINCIDENT)
    for row, near in cells.pairs(flat):
        away = flat[row, None] - triangles[near]
        side = (edge[near, :, 0] * away[..., 1] - edge[near, :, 1] * away[..., 0]) * turn[near, None]
        found[about[row[row_all(side > -COINCIDENT) & (turn[near] != 0.0)]]] = True
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
