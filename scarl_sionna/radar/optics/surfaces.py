"""Reflection of surfaces.

Those of a body in the far field (NumPy), and those of all faces of a scene (on the device).

Time dependence e^{+jwt}. A material reflects with Fresnel's coefficients as a half space, or as one layer with air
behind where it has a thickness; what passes through a layer is followed in a scene (:mod:`.faces.panes`). In the far
field each coefficient is computed as it is needed, for any complex permittivity, and "metal" is a perfect conductor; in
a scene they come from a table over the cosine of incidence, and a metal has its conductivity.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from scarl_sionna.engine.rays.face_planes import FaceTable
from scarl_sionna.engine.rays.face_rays import FaceRays
from scarl_sionna.engine.rays.moving_faces import MovingFaces
from scarl_sionna.engine.types import DeviceArray
from scarl_sionna.scene.materials.depolarization import quadrature
from scarl_sionna.scene.materials.fresnel import reflection, stack_reflection
from scarl_sionna.scene.materials.rough import (
    coherent_transmission,
    diffuse_albedo,
    height_loss,
    layer_albedo,
    scattered_part,
)

from .cosine_tables import CosineTable, table_cosines
from .fields import HOST, reflected_field

if TYPE_CHECKING:
    from scarl_sionna.engine.world import WorldState

Real = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
Index = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Surface:
    """Reflecting surface at one frequency.

    Attributes
    ----------
    permittivity : complex or None
        Relative permittivity, imaginary part <= 0; None is a perfect conductor.
    thickness : float or None
        Of a layer with air behind [m]; None is a half space.
    frequency : float
        [Hz].
    coherence : float
        Part of the reflected field that scattering leaves in the mirror reflection, 0 to 1.
    film : tuple of (complex, float), optional
        Relative permittivity and depth [m] of a film on the face, such as water.
    height : float
        Standard deviation of the face's heights, which take more of it, :func:`.rough.height_loss` [m].
    rounded : bool
        Whether faces of this material stand for a body that is curved everywhere.
    """

    permittivity: complex | None = None
    thickness: float | None = None
    frequency: float = 77e9
    coherence: float = 1.0
    film: tuple[complex, float] | None = None
    height: float = 0.0
    rounded: bool = False

    def coefficients(self, cosine: Real) -> tuple[Complex, Complex]:
        """Return TE and TM reflection coefficients; a perfect conductor has -1 and +1."""
        if self.permittivity is None:
            ones = np.ones(len(cosine), dtype=np.complex128)
            return -ones, ones
        return stack_reflection(self.permittivity, self.thickness, self.film, cosine, self.frequency)

    def reflect(self, field: Complex, direction: Real, normal: Real) -> tuple[Complex, Real]:
        """Return the reflected field and its direction.

        Parameters
        ----------
        field : ndarray of complex128, shape (num_tubes, 3, num_polarizations)
            Incident electric field.
        direction, normal : ndarray of float64, shape (num_tubes, 3)
            Direction of travel and unit normal on the lit side.
        """
        if (
            self.permittivity is None
        ):  # n x E changes its sign, n . E keeps it: the formula without its plane of incidence
            onward = direction - HOST.scaled(2.0 * HOST.dot(direction, normal), normal)
            return self.coherence * (2.0 * HOST.along(normal, HOST.component(normal, field)) - field), onward
        reflected, onward = reflected_field(HOST, self._coherent, field, direction, normal)
        return reflected, onward

    def _coherent(self, cosine: Real) -> tuple[Complex, Complex]:
        cosine = np.clip(cosine, 0.0, 1.0)
        te, tm = self.coefficients(cosine)
        kept = self.coherence * height_loss(self.height, self.frequency, cosine)
        return kept * te, kept * tm


@dataclass(frozen=True)
class PartSurfaces:
    """What the parts of a body reflect like."""

    parts: tuple[Surface, ...] = (Surface(),)

    @property
    def rounded(self) -> frozenset[int]:
        """Numbers of the parts that are curved everywhere."""
        return frozenset(number for number, surface in enumerate(self.parts) if surface.rounded)

    def reflect(
        self, part: npt.NDArray[np.int64], field: Complex, direction: Real, normal: Real
    ) -> tuple[Complex, Real]:
        """Return the reflected field and its direction.

        `part` (num_tubes,) numbers the surfaces, the rest is as for one.
        """
        if len(set(self.parts)) == 1:
            return self.parts[0].reflect(field, direction, normal)
        reflected, onward = np.empty_like(field), np.empty_like(direction)
        for number, surface in enumerate(self.parts):
            rows = np.flatnonzero(part == number)
            if len(rows):
                reflected[rows], onward[rows] = surface.reflect(field[rows], direction[rows], normal[rows])
        return reflected, onward

    def conduction(self, part: Index) -> Complex:
        """Return by what the fringe currents of a perfect conductor are scaled, for parts of any shape.

        That is minus the coherent reflection at normal incidence: 1 for a metal. It is a rule of thumb.
        """
        upright = np.ones(1)
        level = [-surface.coherence * surface.coefficients(upright)[0][0] for surface in self.parts]
        return np.asarray(np.array(level, dtype=np.complex128)[part])


class FaceSurfaces:
    """Planes, materials and velocities of all faces.

    Parameters
    ----------
    rays : FaceRays
    state : WorldState
    faces : FaceTable
    parts : ndarray of int64
        Rows of the part table that scatter or let waves through: their materials must have data.
    frequency : float
        [Hz].
    nodes : int
        Of the tables over the cosine of incidence, see :func:`.cosine_tables.table_cosines`.

    Raises
    ------
    MaterialRangeError
        If a material that scatters has no data at this frequency.
    """

    def __init__(
        self, rays: FaceRays, state: WorldState, faces: FaceTable, parts: Index, frequency: float, nodes: int
    ) -> None:
        self._rays = rays
        table = state.world.parts
        names = sorted({table.material[part] for part in parts})
        self.materials = tuple(state.world.materials[name] for name in names)
        cosine = table_cosines(nodes)
        columns, passed = (np.zeros((len(names), nodes, 4)) for _ in range(2))
        part = np.ones((len(names), nodes, 1))
        for index, material in enumerate(self.materials):
            lost = height_loss(material.roughness_rms, frequency, cosine)
            te, tm = (lost * value for value in reflection(material, frequency, cosine))
            columns[index] = np.stack([te.real, te.imag, tm.real, tm.imag], axis=1)
            if material.thickness is not None:
                te, tm = coherent_transmission(material, frequency, cosine)
                passed[index] = np.stack([te.real, te.imag, tm.real, tm.imag], axis=1)
            part[index, :, 0] = scattered_part(material, frequency, cosine)
        self._coefficient, self._passed, self._part = (CosineTable(rays, values) for values in (columns, passed, part))
        kept = np.array([material.coherence for material in self.materials])
        surface = np.array([diffuse_albedo(material, frequency) for material in self.materials])
        layer = np.array([material.volume_albedo or 0.0 for material in self.materials])
        albedo = np.where(layer > 0.0, layer, surface)
        crossed = np.array([material.xpd_coefficient for material in self.materials])
        alike, across = np.sqrt(1.0 - crossed), np.sqrt(crossed)
        opposite = quadrature(alike, alike, across)
        in_phase = np.sqrt(np.maximum(alike**2 - opposite**2, 0.0))
        rough = np.stack([kept, surface, layer, in_phase, opposite, across], axis=1)
        self._rough = rays.reals(rough)
        of_part = np.array([names.index(name) if name in names else 0 for name in table.material], dtype=np.uint32)
        scatters = np.array([name in names and albedo[names.index(name)] > 0.0 for name in table.material])
        self.is_rough = scatters[faces.part]
        """Whether a part of what each face reflects is scattered diffusely."""
        self._faces = MovingFaces.of(rays, state)
        self._material_of_part = rays.index(of_part)

    def plane(self, face: DeviceArray) -> tuple[DeviceArray, DeviceArray]:
        """Return the unit normals and offsets of faces."""
        return self._faces.plane(face)

    def velocity(self, face: DeviceArray, point: DeviceArray) -> DeviceArray:
        """Return the velocity of surface points [m/s]."""
        return self._faces.velocity(face, self._faces.part(face), point)

    def velocity_on_host(self, face: Index, point: Real) -> Real:
        """Return the velocity of surface points in NumPy, shape (n, 3) [m/s]."""
        return self._faces.velocity_on_host(face, point)

    def _material(self, face: DeviceArray) -> DeviceArray:
        dr, mi = self._rays.dr, self._rays.mi
        return dr.gather(mi.UInt32, self._material_of_part, self._faces.part(face))

    def coefficients(self, face: DeviceArray, cosine: DeviceArray) -> tuple[DeviceArray, DeviceArray]:
        """Return the TE and the TM reflection coefficient, less what heights take, each as real and imaginary part."""
        return _pairs(self._coefficient.at(self._material(face), cosine))

    def transmission(self, face: DeviceArray, cosine: DeviceArray) -> tuple[DeviceArray, DeviceArray]:
        """Return the TE and the TM transmission coefficient of a layer, as of :meth:`coefficients`; 0 for no layer."""
        return _pairs(self._passed.at(self._material(face), cosine))

    def kept(self, face: DeviceArray) -> DeviceArray:
        """Return what scattering leaves of the reflected field, sqrt(1 - S^2)."""
        return self._of_material(face, 0)

    def scattered(
        self, face: DeviceArray, arriving: DeviceArray, leaving: DeviceArray
    ) -> tuple[DeviceArray, DeviceArray, DeviceArray, DeviceArray]:
        """Return sqrt(rho), and what of the field is co-polar in phase, opposite in V and H, and cross-polar.

        rho is the albedo between two directions of given cosines (:func:`.rough.directional_albedo`); the others by
        :func:`.depolarization.rough_matrix` for the cross-polarisation coefficient.
        """
        dr = self._rays.dr
        layer = self._of_material(face, 2)
        deep = layer_albedo(layer, arriving, dr.maximum(leaving, 1e-9))
        albedo = dr.select(layer > 0.0, deep, self._of_material(face, 1))
        material = self._material(face)
        albedo *= dr.minimum(*(self._part.at(material, cosine)[0] for cosine in (arriving, leaving)))
        return dr.sqrt(albedo), *(self._of_material(face, column) for column in (3, 4, 5))

    def _of_material(self, face: DeviceArray, column: int) -> DeviceArray:
        return self._rays.dr.gather(self._rays.Real, self._rough, 6 * self._material(face) + column)


def _pairs(columns: tuple[DeviceArray, ...]) -> tuple[DeviceArray, DeviceArray]:
    """Return two complex numbers, each as real and imaginary part, from four columns."""
    return columns[:2], columns[2:]
