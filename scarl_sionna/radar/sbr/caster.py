"""What a ray meets first: the engine's float32 intersection of one mesh, scaled to unit size about its centre."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.world import variant

Array = npt.NDArray[np.float64]

MISS = -1
"""Face number of a ray that meets nothing."""
LIFT = 2e-5
"""How far a ray starts above the surface that it leaves, in radii of the mesh: some hundred float32 steps of a coordinate,
so that it does not meet that surface again."""


class Caster:
    """Rays against one mesh.

    The mesh is moved to the origin and scaled to unit radius before it is rounded to float32, so the rounding is 6e-8 of
    its size wherever it stands and whatever unit it is in.

    Parameters
    ----------
    corners : ndarray of float64, shape (num_faces, 3, 3)
        Triangles, none degenerate.
    """

    def __init__(self, corners: Array) -> None:
        points = corners.reshape(-1, 3)
        low, high = points.min(axis=0), points.max(axis=0)
        self.center = (low + high) / 2.0
        self.radius = float(np.linalg.norm(points - self.center, axis=1).max())
        self._scene = self._build((points - self.center) / self.radius)

    @staticmethod
    def _build(points: Array) -> Any:
        with variant.radio() as mi:
            mesh = mi.Mesh("body", vertex_count=len(points), face_count=len(points) // 3)
            parameters = mi.traverse(mesh)
            parameters["vertex_positions"] = mi.Float(points.astype(np.float32).ravel())
            parameters["faces"] = mi.UInt32(np.arange(len(points), dtype=np.uint32))
            parameters.update()
            return mi.load_dict({"type": "scene", "body": mesh})

    def _rays(self, mi: Any, origins: Array, directions: Array, lift: Array) -> Any:
        start = (origins - self.center) / self.radius + LIFT * lift
        return mi.Ray3f(
            mi.Point3f(np.ascontiguousarray(start.T, dtype=np.float32)),
            mi.Vector3f(np.ascontiguousarray(directions.T, dtype=np.float32)),
        )

    def first_face(self, origins: Array, directions: Array, lift: Array) -> npt.NDArray[np.int64]:
        """Return the number of the face that each ray meets first, or `MISS`.

        Parameters
        ----------
        origins, directions, lift : ndarray of float64, shape (num_rays, 3)
            Start [m] on a surface, unit direction, and unit normal of that surface on the side on which the ray runs.
        """
        if not len(origins):
            return np.zeros(0, dtype=np.int64)
        import drjit as dr

        with variant.radio() as mi:
            found = self._scene.ray_intersect_preliminary(self._rays(mi, origins, directions, lift), coherent=False)
            face = dr.select(found.is_valid(), mi.Int32(found.prim_index), MISS)
            return np.asarray(face.numpy(), dtype=np.int64)

    def blocked(self, origins: Array, directions: Array, lift: Array) -> npt.NDArray[np.bool_]:
        """Return whether each ray meets anything; arguments as in :meth:`first_face`."""
        if not len(origins):
            return np.zeros(0, dtype=bool)
        with variant.radio() as mi:
            return np.asarray(self._scene.ray_test(self._rays(mi, origins, directions, lift)).numpy(), dtype=bool)
