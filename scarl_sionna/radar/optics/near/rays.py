"""What the rays of tubes meet, in one kernel for all points of all tubes, and where along a side that changes."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.engine.rays.face_rays import MISS, FaceRays

from .refine import inset

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]

LIFT = 4e-7
"""A ray starts this far above its face, relative to the largest coordinate: some float32 steps of it."""
SMALLEST_LIFT = 1e-6
"""[m]."""
SAME_DISTANCE = 1e-6
"""What is met this near to a point (relative to 1 m + distance) is the point itself: float32 directions are 6e-8 off, which a
face at grazing incidence makes larger."""
_BISECTIONS = 9
"""The place of an edge is found to 2^-9 of the edge spacing."""


class _Probe:
    """Labels at points of tubes; subclasses say what the label of a point is."""

    def __init__(self, rays: FaceRays) -> None:
        self.rays = rays

    def _label(self, point: Any, row: Any) -> Any:
        raise NotImplementedError

    def labels(self, corners: Array, rows: Index, tube: Index, weight: Index, weights: Array) -> Index:
        """Return the label at each point ``weights[weight]`` (barycentric) of the tubes ``tube``."""
        dr, mi, rays = self.rays.dr, self.rays.mi, self.rays
        table, flat = _loaded(rays.Real, weights), _loaded(rays.Real, corners)
        which, share = mi.UInt32(tube.astype(np.uint32)), mi.UInt32(weight.astype(np.uint32))
        point = rays.Vector(0.0)
        for corner in range(3):
            part = dr.gather(rays.Real, table, 3 * share + corner)
            point += part * dr.gather(rays.Vector, flat, 3 * which + corner)
        row = dr.gather(mi.UInt32, mi.UInt32(rows.astype(np.uint32)), which)
        return np.asarray(self._label(point, row).numpy(), dtype=np.int64)

    def border(self, corners: Array, rows: Index, label: Index) -> tuple[Array, Index]:
        """Return where along the two sides from corner 0 its label ends, (n, 2), and the label beyond, (n, 2).

        `label` holds those of the three corners, (n, 3).
        """
        dr, mi, rays = self.rays.dr, self.rays.mi, self.rays
        inner = np.einsum("ij,njk->nik", inset(np.eye(3)), corners)
        side = dr.arange(mi.UInt32, 2 * len(rows))
        tube = side // 2
        flat = _loaded(rays.Real, inner)
        start = dr.gather(rays.Vector, flat, 3 * tube)
        along = dr.gather(rays.Vector, flat, 3 * tube + 1 + side % 2) - start
        row = dr.gather(mi.UInt32, mi.UInt32(rows.astype(np.uint32)), tube)
        known = mi.Int32(label.astype(np.int32).ravel())
        own, other = dr.gather(mi.Int32, known, 3 * tube), dr.gather(mi.Int32, known, 3 * tube + 1 + side % 2)

        def step(count: Any, low: Any, high: Any, beyond: Any) -> tuple[Any, ...]:
            middle = 0.5 * (low + high)
            found = self._label(start + middle * along, row)
            inside = found == own
            return (
                count + 1, dr.select(inside, middle, low), dr.select(inside, high, middle),
                dr.select(inside, beyond, found),
            )  # fmt: skip

        state = (mi.UInt32(0), dr.zeros(rays.Real, 2 * len(rows)), dr.ones(rays.Real, 2 * len(rows)), other)
        _, low, high, beyond = dr.while_loop(
            state, lambda count, low, high, beyond: count < _BISECTIONS, step, label="bisection of edges"
        )
        share = 0.5 * (low + high)
        dr.eval(share, beyond)
        return share.numpy().reshape(-1, 2), beyond.numpy().astype(np.int64).reshape(-1, 2)


class ScreenedProbe(_Probe):
    """Whether a point is hidden (1) from a station or not (0)."""

    def __init__(self, rays: FaceRays, station: Array) -> None:
        super().__init__(rays)
        self._station = rays.vector(station)

    def _label(self, point: Any, row: Any) -> Any:
        dr, mi = self.rays.dr, self.rays.mi
        station = self._station
        ray = point - station
        distance = dr.norm(ray)
        before = distance - SAME_DISTANCE * (1.0 + distance)
        return dr.select(self.rays.blocked(station, ray / distance, before), mi.Int32(1), mi.Int32(0))


class PlaneProbe(_Probe):
    """The plane that a tube's ray meets behind a point, `MISS` if it is one that does not scatter.

    Parameters
    ----------
    rays : FaceRays
    plane_of_face : ndarray of int64, shape (num_faces,)
        `MISS` for faces at which tubes end.
    image, lift : ndarray of float64, shape (num_rows, 3)
        Where the rays come from [m, world], and the unit normal on the side on which they run on.
    own : ndarray of int64, shape (num_rows,)
        Plane that the tubes leave.
    """

    def __init__(self, rays: FaceRays, plane_of_face: Index, image: Array, lift: Array, own: Index) -> None:
        super().__init__(rays)
        mi = rays.mi
        self._plane = mi.Int32(plane_of_face.astype(np.int32))
        self._image, self._lift = _loaded(rays.Real, image), _loaded(rays.Real, lift)
        self._own = mi.Int32(own.astype(np.int32))
        self._faces: tuple[Any, Any, Any] | None = None

    def only_towards(self, station: Array, normal: Array, offset: Array) -> None:
        """Let planes of which the lit side is turned away from a station count as missed, as on the last bounce.

        Parameters
        ----------
        station : ndarray of float64, shape (3,)
        normal, offset : ndarray of float64, shape (num_faces, 3) and (num_faces,)
            Planes of the faces.
        """
        rays = self.rays
        self._faces = rays.vector(station), _loaded(rays.Real, normal), _loaded(rays.Real, offset)

    def _label(self, point: Any, row: Any) -> Any:
        dr, mi, rays = self.rays.dr, self.rays.mi, self.rays
        ray = dr.normalize(point - dr.gather(rays.Vector, self._image, row))
        lift = dr.maximum(LIFT * dr.max(dr.abs(point)), SMALLEST_LIFT)
        face = rays.first(point + lift * dr.gather(rays.Vector, self._lift, row), ray)
        plane = dr.gather(mi.Int32, self._plane, mi.UInt32(face), face != MISS)
        met = (face != MISS) & (plane != dr.gather(mi.Int32, self._own, row))
        if self._faces is not None:
            station, normals, offsets = self._faces
            normal = dr.gather(rays.Vector, normals, mi.UInt32(face), met)
            towards = dr.dot(normal, station) - dr.gather(rays.Real, offsets, mi.UInt32(face), met)
            met &= dr.dot(normal, ray) * towards < 0.0
        return dr.select(met, plane, MISS)


def _loaded(kind: Any, array: Array) -> Any:
    return kind(np.ascontiguousarray(array, dtype=np.float64).ravel())
