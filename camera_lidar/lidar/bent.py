"""Surfaces that bend while a scan goes on: cast at the middle of a slice of time, placed at each ray's own time."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from scarl_sionna.engine.rays.apart import Apart
from scarl_sionna.scene.tables import RayHits

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]

SLICE = 5e-3
"""Length of a slice of a scan [s]: which face a ray meets is that of its middle, 2.5 ms away at most. Where the face is
then is cubic between the ends: error of a place h^4 / 384 of its fourth derivative, 2e-9 m at 1000 m/s4."""
_GRAZING = 0.02
"""Cosine of incidence below which a hit stays where the middle of the slice has it."""
_FARTHEST = 0.1
"""A face moves less than this within half a slice [m]."""


class BentSlice:
    """The faces that bend in a slice of a scan.

    Parameters
    ----------
    apart : Apart
    first, last : float
        Ends of the slice [s, of the world].
    """

    def __init__(self, apart: Apart, first: float, last: float) -> None:
        self.state = apart.bent_state((first + last) / 2.0)
        self._first, self._length = first, last - first
        self._ends = [apart.bent_faces(time) for time in (first, last)]

    def placed(self, start: Array, direction: Array, times: Array, hits: RayHits) -> tuple[Array, Array, Array]:
        """Return distance [m], normal and velocity [m/s] of hits at times of the world, in the frame of `state`.

        Zero velocity for what does not bend. Rows of `start`, `direction` and `times` are those of the hits.
        """
        distance, normal, velocity = hits.distance.copy(), hits.normal.copy(), np.zeros_like(hits.point)
        number = self._ends[0].number[hits.face]
        rows = np.flatnonzero(number >= 0)
        if rows.size == 0:
            return distance, normal, velocity
        corners, rates = self._between(number[rows], times[rows])
        sides = corners[:, 1:] - corners[:, :1]
        across = np.cross(sides[:, 0], sides[:, 1])
        unit = across / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-300)
        cosine = np.einsum("ni,ni->n", direction[rows], unit)
        height = np.einsum("ni,ni->n", corners[:, 0] - start[rows], unit)
        found = np.divide(height, cosine, out=distance[rows], where=np.abs(cosine) > _GRAZING)
        distance[rows] = np.where(np.abs(found - distance[rows]) < _FARTHEST, found, distance[rows])
        normal[rows] = np.where((cosine > 0.0)[:, None], -unit, unit)
        point = start[rows] + distance[rows, None] * direction[rows]
        velocity[rows] = _by_shares(corners, rates, point)
        return distance, normal, velocity

    def _between(self, number: Index, times: Array) -> tuple[Array, Array]:
        """Return corners [m] and their velocities [m/s] of faces at times: cubic Hermite, and its derivative."""
        begin, end = self._ends
        h, s = self._length, ((times - self._first) / self._length)[:, None, None]
        x0, v0 = begin.corners[number], begin.velocity[number]
        x1, v1 = end.corners[number], end.velocity[number]
        corners = (
            x0 + (x1 - x0) * (s * s * (3.0 - 2.0 * s)) + h * (v0 * (s * (1.0 - s) ** 2) - v1 * (s * s * (1.0 - s)))
        )
        rates = (x1 - x0) * (6.0 * s * (1.0 - s) / h) + v0 * ((1.0 - s) * (1.0 - 3.0 * s)) + v1 * (s * (3.0 * s - 2.0))
        return corners, rates


def _by_shares(corners: Array, rates: Array, point: Array) -> Array:
    """Return what barycentric coordinates of points in the planes of triangles make of rates at their corners."""
    one, other, offset = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0], point - corners[:, 0]
    normal = np.cross(one, other)
    square = np.maximum(np.einsum("ni,ni->n", normal, normal), 1e-300)
    second = np.einsum("ni,ni->n", np.cross(offset, other), normal) / square
    third = np.einsum("ni,ni->n", np.cross(one, offset), normal) / square
    share = np.stack([1.0 - second - third, second, third], axis=1)
    return np.asarray(np.einsum("nk,nki->ni", share, rates))
