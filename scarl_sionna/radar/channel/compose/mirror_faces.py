"""Which mirror a ray has met: exactly one, also where mirrors share an edge, a plane or what lies on them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

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
_PAIRS = 1 << 20
"""Points times triangles that are looked at in one piece: bounds the memory, changes no result."""


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

    def owner(self, hits: RayHits, aim: Array) -> Index:
        """Return the number of the mirror that each hit is on, `NO_MIRROR` where it is on none.

        A hit on a mirror's own triangle is on that mirror. One on anything else within `thickness` of mirrors is on the
        nearest of those that go on where the ray was aimed, or, where none does, of all of them: a marking may fill a
        hole.

        Parameters
        ----------
        hits : RayHits
        aim : ndarray of float64, shape (num_hits, 3)
            Points in planes of mirrors that the rays of the hits were sent to [m, world].
        """
        own = self._of_face[hits.face]
        height = np.abs(hits.point @ self._normal.T - self._offset)
        here = np.where(own == NO_MIRROR, self.thickness, 0.0)
        rows = np.flatnonzero(own != NO_MIRROR)
        here[rows] = height[rows, own[rows]] + COINCIDENT
        may = height < here[:, None]
        result = np.where(may.any(axis=1), may.argmax(axis=1), NO_MIRROR)
        several = np.flatnonzero(may.sum(axis=1) > 1)
        result[several] = self._nearest(aim[several], height[several], may[several], own[several])
        return result

    def _nearest(self, aim: Array, height: Array, may: Flags, own: Index) -> Index:
        """Return the first of the nearest mirrors that go on where rays were aimed, of those that may own the hits."""
        under = np.zeros_like(may)
        for number in np.flatnonzero(may.any(axis=0)):
            rows = np.flatnonzero(may[:, number])
            over = inside(aim[rows], self._corners[number], self._normal[number])
            under[rows, number] = (own[rows] == number) | over
        chosen = np.where(under.any(axis=1, keepdims=True), under, may)
        height = np.where(chosen, height, np.inf)
        return np.asarray((height < height.min(axis=1, keepdims=True) + COINCIDENT).argmax(axis=1), dtype=np.int64)


def inside(point: Array, corners: Array, normal: Array) -> Flags:
    """Return which points are over one of the triangles in a plane, or within `COINCIDENT` of its edges [m]."""
    across = np.delete(np.arange(3), np.abs(normal).argmax())
    flat, triangles = point[:, across], corners[:, :, across]
    lower, upper = flat.min(axis=0) - COINCIDENT, flat.max(axis=0) + COINCIDENT
    triangles = triangles[((triangles.max(axis=1) > lower) & (triangles.min(axis=1) < upper)).all(axis=1)]
    edge = np.roll(triangles, -1, axis=1) - triangles
    turn = np.sign(edge[:, 0, 0] * edge[:, 1, 1] - edge[:, 0, 1] * edge[:, 1, 0])
    edge /= np.maximum(np.linalg.norm(edge, axis=2, keepdims=True), COINCIDENT)
    found = np.zeros(len(flat), dtype=np.bool_)
    step = max(_PAIRS // max(len(triangles), 1), 1)
    for first in range(0, len(flat), step):
        away = flat[first : first + step, None, None] - triangles
        side = (edge[..., 0] * away[..., 1] - edge[..., 1] * away[..., 0]) * turn[:, None]
        found[first : first + step] = ((side > -COINCIDENT).all(axis=2) & (turn != 0.0)).any(axis=1)
    return found
