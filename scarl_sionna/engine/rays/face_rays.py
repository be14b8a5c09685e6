"""Rays against triangles inside Dr.Jit kernels: which face is met first, and whether anything is met.

The triangles are those of a state of the world, or of one mesh. Geometry is float64 up to the ray itself, which the
engine takes in float32: the face that it finds is right, its distance is not used.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from contextlib import AbstractContextManager
from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from scarl_sionna.engine import variant
from scarl_sionna.engine.device import Device
from scarl_sionna.engine.twins import MISS
from scarl_sionna.engine.types import DeviceArray, MitsubaObject

from .nearby import mesh_of, scene_near

if TYPE_CHECKING:
    from scarl_sionna.engine.world import WorldState

Array = npt.NDArray[np.float64]

STATE_LIFT = 4e-7
"""In a scene a ray starts this far above its face, relative to the largest coordinate in the engine's frame:
some float32 steps of it."""
SMALLEST_LIFT = 1e-6
"""[m]."""
MESH_LIFT = 2e-5
"""The same for one mesh, in radii of it: some hundred float32 steps of a coordinate, so that a ray does not meet its
own surface again."""


class FaceRays(Device, ABC):
    """Rays against the faces of one set of triangles. Make and use it inside ``variant.use(twin)``.

    Points are given in the frame of the rays, see :meth:`placed`.

    Parameters
    ----------
    mi : module
        Mitsuba in the variant of the twin.
    scene : mitsuba.Scene
    twin : {"optical", "radio"}

    Attributes
    ----------
    Fine, FinePoint : type
        Dr.Jit arrays that are fine enough for the many points of a lattice on each tube.
    """

    Fine: type[DeviceArray]
    FinePoint: type[DeviceArray]

    def __init__(self, mi: ModuleType, scene: MitsubaObject, twin: str) -> None:
        super().__init__(mi)
        self._scene = scene
        self.twin = twin

    def fine(self, values: Array) -> DeviceArray:
        """Return an array of any shape on the device, row after row, as :attr:`Fine`."""
        return self.reals(values) if self.Fine is self.Real else self.single(values)

    def active(self) -> AbstractContextManager[ModuleType]:
        """Return the context manager of the variant in which these rays work."""
        return variant.use(self.twin)

    @abstractmethod
    def placed(self, points: Array) -> Array:
        """Return points (..., 3) [m] in the frame of the rays."""

    @abstractmethod
    def lifted(self, point: DeviceArray, normal: DeviceArray) -> DeviceArray:
        """Return points moved along unit normals so far that a ray does not meet the face again on which it starts."""

    def _ray(self, origin: DeviceArray, direction: DeviceArray) -> MitsubaObject:
        """Return the engine's rays."""
        return self.mi.Ray3f(self.mi.Point3f(origin), self.mi.Vector3f(direction))

    @abstractmethod
    def _face(self, found: MitsubaObject) -> DeviceArray:
        """Return the face of each of the engine's intersections, or `MISS`."""

    def first(
        self, origin: DeviceArray, direction: DeviceArray, active: DeviceArray = True, coherent: bool = False
    ) -> DeviceArray:
        """Return the face that each active ray meets first, or `MISS`.

        Parameters
        ----------
        origin, direction : Dr.Jit Array3f or Array3f64
            In the frame of the rays, and unit vectors.
        active : Dr.Jit Bool
        coherent : bool
            Neighbouring rays run side by side, which the engine may use.
        """
        ray = self._ray(origin, direction)
        return self._face(self._scene.ray_intersect_preliminary(ray, coherent=coherent, active=active))

    def first_within(
        self,
        origin: DeviceArray,
        direction: DeviceArray,
        distance: DeviceArray,
        active: DeviceArray = True,
        coherent: bool = False,
    ) -> tuple[DeviceArray, DeviceArray]:
        """Return the face that each active ray meets first before a distance, or `MISS`, and how far away that is.

        In the frame of the rays; that distance is the engine's, a float32 number. `coherent` as of :meth:`first`.
        """
        ray = self._ray(origin, direction)
        ray.maxt = self.mi.Float(distance)
        found = self._scene.ray_intersect_preliminary(ray, coherent=coherent, active=active)
        return self._face(found), self.dr.select(found.is_valid(), found.t, 0.0)

    def blocked(
        self,
        origin: DeviceArray,
        direction: DeviceArray,
        distance: DeviceArray | None = None,
        active: DeviceArray = True,
    ) -> DeviceArray:
        """Return whether each active ray meets anything, before a distance in the frame of the rays if one is given."""
        ray = self._ray(origin, direction)
        if distance is not None:
            ray.maxt = self.mi.Float(self.dr.maximum(distance, 0.0))  # below 0 is the engine's mark of what is blocked
        return self._scene.ray_test(ray, coherent=False, active=active)


class StateRays(FaceRays):
    """Rays of one state of the world, in its frame; faces are rows of :class:`~.face_planes.FaceTable`.

    Parameters
    ----------
    mi : module
        Mitsuba in the variant of the twin.
    state : WorldState
    place : array_like of float, shape (3,), optional
        Around which rays begin [m, world]: the engine's coordinates are relative to it where it is far from the
        origin, see :mod:`.nearby`; the origin if left out.
    twin : {"optical", "radio"}
    """

    def __init__(
        self, mi: ModuleType, state: WorldState, place: npt.ArrayLike | None = None, twin: str = "optical"
    ) -> None:
        engine = scene_near(state, place, twin)
        super().__init__(mi, engine.mi_scene, twin)
        self._origin = engine.origin
        self._shift = None if engine.origin is None else self.vector(engine.origin)
        self.Fine, self.FinePoint = self.Real, self.Vector  # far from the origin float32 is not fine enough
        self._engine = engine

    def placed(self, points: Array) -> Array:
        """Return points as they are: the frame is the world's [m]."""
        return points

    def lifted(self, point: DeviceArray, normal: DeviceArray) -> DeviceArray:
        """Return points moved along unit normals by `STATE_LIFT`."""
        dr = self.dr
        within = point if self._shift is None else point - self._shift
        return point + dr.maximum(STATE_LIFT * dr.max(dr.abs(within)), SMALLEST_LIFT) * normal

    def lift_of(self, points: Array) -> Array:
        """Return how far :meth:`lifted` moves points (n, 3), shape (n,) [m]."""
        within = points if self._origin is None else points - self._origin
        return np.maximum(STATE_LIFT * np.abs(within).max(axis=1, initial=0.0), SMALLEST_LIFT)

    def _ray(self, origin: DeviceArray, direction: DeviceArray) -> MitsubaObject:
        return super()._ray(origin if self._shift is None else self.Vector(origin) - self._shift, direction)

    def _face(self, found: MitsubaObject) -> DeviceArray:
        return self._engine.faces(found)


class MeshRays(FaceRays):
    """Rays against one mesh, in a frame in which it is at the origin and has unit radius.

    So its rounding to float32 is 6e-8 of its size wherever it stands and whatever unit it is in.

    Parameters
    ----------
    mi : module
        Mitsuba in the variant of the twin.
    corners : ndarray of float64, shape (num_faces, 3, 3)
        Triangles, none degenerate [m].
    twin : {"optical", "radio"}
    """

    def __init__(self, mi: ModuleType, corners: Array, twin: str = "radio") -> None:
        self._center, self._radius = center_and_radius(corners)
        body = mesh_of(mi, self.placed(corners.reshape(-1, 3)))
        super().__init__(mi, mi.load_dict({"type": "scene", "body": body}), twin)
        self.Fine, self.FinePoint = mi.Float, mi.Point3f  # as fine as the rays themselves

    def placed(self, points: Array) -> Array:
        """Return points in radii from the middle of the mesh."""
        return (points - self._center) / self._radius

    def lifted(self, point: DeviceArray, normal: DeviceArray) -> DeviceArray:
        """Return points moved along unit normals by `MESH_LIFT`."""
        return self.mi.Point3f(point) + self.mi.Vector3f(MESH_LIFT * normal)

    def _face(self, found: MitsubaObject) -> DeviceArray:
        return self.dr.select(found.is_valid(), self.mi.Int32(found.prim_index), MISS)

    def first_faces(self, origins: Array, directions: Array, normal: Array) -> npt.NDArray[np.int64]:
        """Return the face that each ray meets first, or `MISS`, of and as NumPy arrays.

        Parameters
        ----------
        origins, directions, normal : ndarray of float64, shape (num_rays, 3)
            Start [m] on a surface, unit direction, and unit normal of that surface on the side on which the ray runs.
        """
        with self.active():
            origin, direction, above = (self.vectors(a) for a in (self.placed(origins), directions, normal))
            return np.asarray(self.first(self.lifted(origin, above), direction).numpy(), dtype=np.int64)


def center_and_radius(corners: Array) -> tuple[Array, float]:
    """Return the middle of the box around triangles (n, 3, 3) and the distance of their farthest corner from it [m]."""
    points = corners.reshape(-1, 3)
    center = (points.min(axis=0) + points.max(axis=0)) / 2.0
    return center, float(np.linalg.norm(points - center, axis=1).max())
