"""Planes, parts and velocities of all faces of a state inside Dr.Jit kernels."""

from __future__ import annotations

from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt

from scarl_sionna.engine.device import Device
from scarl_sionna.engine.types import DeviceArray

from .geometry import NEARLY_IN_PLANE, PLANE_MISMATCH

if TYPE_CHECKING:
    from scarl_sionna.engine.world import WorldState

Array = npt.NDArray[np.float64]


class MovingFaces:
    """Faces of a state; a face is a row of :class:`~.face_planes.FaceTable`. Make it inside ``variant.use(twin)``.

    Parameters
    ----------
    on : Device
    state : WorldState
    """

    @classmethod
    def of(cls, on: Device, state: WorldState) -> MovingFaces:
        """Return the faces of a state on a device; made once a state and variant, for all sensors."""
        known, key = _known.setdefault(state, {}), on.mi.variant()
        if key not in known:
            known[key] = cls(Device(on.mi), state)
        return known[key]

    def __init__(self, on: Device, state: WorldState) -> None:
        self._on = on
        triangles = state._triangles
        self._normal, self._offset = on.reals(triangles.normal), on.reals(triangles.offset)
        self.part_on_host = triangles.part
        self._part = on.index(self.part_on_host)
        motion = np.zeros((len(triangles.first) - 1, 9))
        for part, moved in state._part_motion.items():  # joints included: wheels, limbs
            motion[part] = np.concatenate([moved.twist.linear, moved.twist.angular, moved.pose.position])
        self._motion_on_host, self._motion = motion, on.reals(motion)
        self._bent = state._bent_faces
        if self._bent is not None:  # row 0 is of faces that do not bend
            base, gradient = self._bent.affine
            table = np.concatenate([base[:, None], gradient.transpose(0, 2, 1)], axis=1).reshape(-1, 12)
            self._bending = on.reals(np.concatenate([np.zeros((1, 12)), table]))
            self._row = on.index(self._bent.number + 1)

    def plane(self, face: DeviceArray) -> tuple[DeviceArray, DeviceArray]:
        """Return the unit normals and offsets of faces."""
        dr, on = self._on.dr, self._on
        return dr.gather(on.Vector, self._normal, face), dr.gather(on.Real, self._offset, face)

    def part(self, face: DeviceArray) -> DeviceArray:
        """Return the rows of faces in the part table."""
        return self._on.dr.gather(self._on.mi.UInt32, self._part, face)

    def velocity(self, face: DeviceArray, part: DeviceArray, point: DeviceArray) -> DeviceArray:
        """Return the velocity of surface points [m/s]."""
        dr, on = self._on.dr, self._on
        linear, angular, origin = (dr.gather(on.Vector, self._motion, 3 * part + k) for k in range(3))
        velocity = linear + dr.cross(angular, point - origin)
        if self._bent is None:
            return velocity
        row = 4 * dr.gather(on.mi.UInt32, self._row, face)
        base, x, y, z = (dr.gather(on.Vector, self._bending, row + k) for k in range(4))
        return velocity + base + x * point.x + y * point.y + z * point.z

    def velocity_on_host(self, face: npt.NDArray[np.int64], point: Array) -> Array:
        """Return the velocity of surface points in NumPy, shape (n, 3) [m/s]."""
        linear, angular, origin = np.split(self._motion_on_host[self.part_on_host[face]], 3, axis=1)
        velocity = np.asarray(linear + np.cross(angular, point - origin))
        return velocity if self._bent is None else velocity + self._bent.at(face, point)

    def meet(
        self, origin: DeviceArray, direction: DeviceArray, face: DeviceArray, rough: DeviceArray
    ) -> tuple[DeviceArray, DeviceArray, DeviceArray]:
        """Return where rays meet the planes of the faces that the engine found, as :func:`~.geometry.refine_distance`.

        Parameters
        ----------
        origin, direction : Dr.Jit float64 vectors
            [m] and unit vectors.
        face : Dr.Jit UInt32
        rough : Dr.Jit Float
            The engine's distance [m].

        Returns
        -------
        distance, cosine, normal
            Distance [m], direction . normal, and the unit normals, by the right-hand rule.
        """
        dr, on = self._on.dr, self._on
        normal, offset = self.plane(face)
        cosine, engine = dr.dot(direction, normal), on.Real(rough)
        crosses = dr.abs(cosine) > NEARLY_IN_PLANE
        plane = dr.select(crosses, (offset - dr.dot(normal, origin)) / dr.select(crosses, cosine, 1.0), engine)
        trusted = dr.abs(plane - engine) <= PLANE_MISMATCH * (1.0 + engine)
        return dr.select(trusted, plane, engine), cosine, normal


_known: WeakKeyDictionary[WorldState, dict[str, MovingFaces]] = WeakKeyDictionary()
