"""What a ray meets first: the engine's float32 intersection of one mesh, scaled to unit size about its centre."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from scarl_sionna.engine import variant

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]

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
        self.num_faces = len(corners)
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

    def scaled(self, points: Array) -> npt.NDArray[np.float32]:
        """Return points in the engine's frame, as one row of x, y, z after the other."""
        return np.ascontiguousarray((points - self.center) / self.radius, dtype=np.float32).reshape(-1)

    def first_face(self, origins: Array, directions: Array, lift: Array) -> npt.NDArray[np.int64]:
        """Return the number of the face that each ray meets first, or `MISS`.

        Parameters
        ----------
        origins, directions, lift : ndarray of float64, shape (num_rays, 3)
            Start [m] on a surface, unit direction, and unit normal of that surface on the side on which the ray runs.
        """
        rays = Rays(self, directions, lift, np.arange(self.num_faces))
        return rays.at(origins, np.arange(len(origins)))

    def labels(self, mi: Any, start: Any, direction: Any, label: Any) -> npt.NDArray[np.int32]:
        """Return what rays of the engine meet: the label of the first face or `MISS`; without labels 1 for anything and 0."""
        import drjit as dr

        ray = mi.Ray3f(start, direction)
        if label is None:
            return np.asarray(dr.select(self._scene.ray_test(ray), mi.Int32(1), mi.Int32(0)).numpy())
        found = self._scene.ray_intersect_preliminary(ray, coherent=False)
        valid = found.is_valid()
        return np.asarray(dr.select(valid, dr.gather(mi.Int32, label, found.prim_index, valid), MISS).numpy())


class Probe(Protocol):
    """What rays that leave tubes meet, as numbers that are equal where it is the same thing."""

    def at(self, points: Array, row: Index) -> Index:
        """Return labels of rays from points (n, 3) [m] on footprints; `row` (n,) names the tube of each."""

    def within(self, tri: Array, row: Index, weights: Array, count: Index, first: Index) -> Index:
        """Return labels of rays from many points within each footprint, footprint after footprint.

        Footprint i (corners `tri` (n, 3, 3), tube `row` (n,)) has `count` (n,) points, whose barycentric coordinates are the rows of
        `weights` (m, 3) from `first` (n,) on.
        """


class Rays:
    """Rays that leave tubes in one direction each, on the engine.

    Parameters
    ----------
    caster : Caster
    directions, lift : ndarray of float64, shape (num_tubes, 3)
        Unit direction, and unit normal of the surface on the side on which the rays run.
    label : ndarray of int64, shape (num_faces,), optional
        Equal for faces that count as one thing. Without it only whether a ray meets anything is asked (1) or not (0).
    """

    def __init__(self, caster: Caster, directions: Array, lift: Array, label: Index | None = None) -> None:
        self._caster = caster
        with variant.radio() as mi:
            self._direction = mi.Float(np.ascontiguousarray(directions, dtype=np.float32).reshape(-1))
            self._lift = mi.Float(np.ascontiguousarray(LIFT * lift, dtype=np.float32).reshape(-1))
            self._label = None if label is None else mi.Int32(label.astype(np.int32))

    def at(self, points: Array, row: Index) -> Index:
        """Return labels; see :class:`Probe`."""
        if not len(points):
            return np.zeros(0, dtype=np.int64)
        import drjit as dr

        with variant.radio() as mi:
            lane = dr.arange(mi.UInt32, len(points))
            start = dr.gather(mi.Point3f, mi.Float(self._caster.scaled(points)), lane)
            return self._met(mi, dr, start, mi.UInt32(row.astype(np.uint32)))

    def within(self, tri: Array, row: Index, weights: Array, count: Index, first: Index) -> Index:
        """Return labels; see :class:`Probe`."""
        if not len(tri):
            return np.zeros(0, dtype=np.int64)
        import drjit as dr

        begin = np.cumsum(count) - count
        owner = np.repeat(np.arange(len(tri), dtype=np.uint32), count)
        with variant.radio() as mi:
            tube = mi.UInt32(owner)
            shift = mi.Int32((first - begin).astype(np.int32))
            node = mi.UInt32(mi.Int32(dr.arange(mi.UInt32, len(owner))) + dr.gather(mi.Int32, shift, tube))
            weight = dr.gather(mi.Vector3f, mi.Float(np.ascontiguousarray(weights, np.float32).reshape(-1)), node)
            corners = mi.Float(self._caster.scaled(tri))
            a, b, c = (dr.gather(mi.Vector3f, corners, 3 * tube + i) for i in range(3))
            start = mi.Point3f(weight.x * a + weight.y * b + weight.z * c)
            return self._met(mi, dr, start, dr.gather(mi.UInt32, mi.UInt32(row.astype(np.uint32)), tube))

    def _met(self, mi: Any, dr: Any, start: Any, row: Any) -> Index:
        lifted = start + dr.gather(mi.Vector3f, self._lift, row)
        direction = dr.gather(mi.Vector3f, self._direction, row)
        return self._caster.labels(mi, lifted, direction, self._label).astype(np.int64)
