"""The faces of a state as the field kernel sees them: planes, reflection coefficients and velocities, on the device."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.engine.rays.face_planes import FaceTable
from scarl_sionna.engine.rays.face_rays import FaceRays
from scarl_sionna.scene.materials.fresnel import reflection

if TYPE_CHECKING:
    from scarl_sionna.engine.world import WorldState

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]

_NODES = 8193
"""Nodes of the table of reflection coefficients over the square root of the cosine of incidence, which is fine near grazing,
where those of a metal change fast. Linear interpolation is right to 2e-6 for layers of some millimetres."""


class Surfaces:
    """Planes, materials and velocities of all faces.

    Parameters
    ----------
    rays : FaceRays
    state : WorldState
    faces : FaceTable
    parts : ndarray of int64
        Rows of the part table that scatter: their materials must have data.
    frequency : float
        [Hz].

    Raises
    ------
    MaterialRangeError
        If a material that scatters has no data at this frequency.
    """

    def __init__(self, rays: FaceRays, state: WorldState, faces: FaceTable, parts: Index, frequency: float) -> None:
        mi, self._rays = rays.mi, rays
        table = state.world.parts
        names = sorted({table.material[part] for part in parts})
        self.materials = tuple(state.world.materials[name] for name in names)
        cosine = np.linspace(0.0, 1.0, _NODES) ** 2
        columns = np.zeros((len(names), _NODES, 4))
        for index, material in enumerate(self.materials):
            te, tm = reflection(material, frequency, cosine)
            columns[index] = np.stack([te.real, te.imag, tm.real, tm.imag], axis=1)
        self._coefficient = rays.Real(columns.ravel())
        scattered = np.array([material.scattering_coefficient for material in self.materials])
        crossed = np.array([material.xpd_coefficient for material in self.materials])
        rough = np.stack([np.sqrt(1.0 - scattered**2), scattered, np.sqrt(1.0 - crossed), np.sqrt(crossed)], axis=1)
        self._rough = rays.Real(rough.ravel())
        of_part = np.array([names.index(name) if name in names else 0 for name in table.material], dtype=np.uint32)
        scatters = np.array(
            [name in names and state.world.materials[name].scattering_coefficient > 0.0 for name in table.material]
        )
        self.is_rough = scatters[faces.part]
        """Whether a part of what each face reflects is scattered diffusely."""
        triangles = faces.triangles
        self._normal = rays.Real(triangles.normal.ravel())
        self._offset = rays.Real(triangles.offset)
        self._part = mi.UInt32(faces.part.astype(np.uint32))
        self._material_of_part = mi.UInt32(of_part)
        motion = np.zeros((len(table.name), 9))
        for part, moved in state._part_motion.items():  # joints included: wheels, limbs
            motion[part] = np.concatenate([moved.twist.linear, moved.twist.angular, moved.pose.position])
        self._motion = rays.Real(motion.ravel())

    def plane(self, face: Any) -> tuple[Any, Any]:
        """Return the unit normals and offsets of faces."""
        dr, rays = self._rays.dr, self._rays
        return dr.gather(rays.Vector, self._normal, face), dr.gather(rays.Real, self._offset, face)

    def velocity(self, face: Any, point: Any) -> Any:
        """Return the velocity of surface points [m/s]."""
        dr, rays = self._rays.dr, self._rays
        row = 3 * dr.gather(rays.mi.UInt32, self._part, face)
        linear, angular, origin = (dr.gather(rays.Vector, self._motion, row + k) for k in range(3))
        return linear + dr.cross(angular, point - origin)

    def _material(self, face: Any) -> Any:
        dr, mi = self._rays.dr, self._rays.mi
        return dr.gather(mi.UInt32, self._material_of_part, dr.gather(mi.UInt32, self._part, face))

    def coefficients(self, face: Any, cosine: Any) -> tuple[Any, Any, Any, Any]:
        """Return real and imaginary part of the TE and of the TM reflection coefficient, of a surface that is smooth."""
        dr, rays = self._rays.dr, self._rays
        place = dr.sqrt(dr.clip(cosine, 0.0, 1.0)) * (_NODES - 1)
        node = dr.minimum(rays.mi.UInt32(place), _NODES - 2)
        share = place - rays.Real(node)
        low = 4 * (self._material(face) * _NODES + node)
        return tuple(
            dr.lerp(
                dr.gather(rays.Real, self._coefficient, low + k),
                dr.gather(rays.Real, self._coefficient, low + 4 + k),
                share,
            )
            for k in range(4)
        )  # type: ignore[return-value]

    def roughness(self, face: Any) -> tuple[Any, Any, Any, Any]:
        """Return sqrt(1 - S^2), S, sqrt(1 - K) and sqrt(K): S the scattering, K the cross-polarisation coefficient."""
        dr, row = self._rays.dr, 4 * self._material(face)
        return tuple(dr.gather(self._rays.Real, self._rough, row + k) for k in range(4))  # type: ignore[return-value]
