"""What a surface does to a plane wave: reflection of its field, and the currents that physical optics puts in its place.

Time dependence e^{+jwt}. A metal is a perfect conductor; any other material reflects with Fresnel's coefficients as a half
space, or as one layer with air behind where it has a thickness. Nothing passes through.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, cast

import numpy as np
import numpy.typing as npt

from scarl_sionna.scene.materials.fresnel import film_coefficients, halfspace_reflection, layer_reflection

Real = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]


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
        Part of the reflected field that a rough surface leaves in the mirror reflection, 0 to 1.
    film : tuple of (complex, float), optional
        Relative permittivity and depth [m] of a film on the face, such as water.
    """

    permittivity: complex | None = None
    thickness: float | None = None
    frequency: float = 77e9
    coherence: float = 1.0
    film: tuple[complex, float] | None = None

    def coefficients(self, cosine: Real) -> tuple[Complex, Complex]:
        """Return TE and TM reflection coefficients; a perfect conductor has -1 and +1."""
        if self.permittivity is None:
            ones = np.ones(len(cosine), dtype=np.complex128)
            return -ones, ones
        if self.film is not None:
            return film_coefficients(*self.film, self.permittivity, self.thickness, cosine, self.frequency)[0]
        if self.thickness is None:
            return halfspace_reflection(self.permittivity, cosine)
        return layer_reflection(self.permittivity, cosine, self.thickness, self.frequency)

    def reflect(self, field: Complex, direction: Real, normal: Real) -> tuple[Complex, Real]:
        """Return the reflected field and its direction.

        Parameters
        ----------
        field : ndarray of complex128, shape (num_tubes, 3, num_polarizations)
            Incident electric field.
        direction, normal : ndarray of float64, shape (num_tubes, 3)
            Direction of travel and unit normal on the lit side.
        """
        cosine = -np.einsum("ij,ij->i", direction, normal)
        onward = direction + 2.0 * cosine[:, None] * normal
        if self.permittivity is None:  # n x E changes its sign, n . E keeps it
            along = np.einsum("ij,ijp->ip", normal, field)
            return self.coherence * (2.0 * normal[:, :, None] * along[:, None, :] - field), onward
        te, tm = (self.coherence * value for value in self.coefficients(np.clip(cosine, 0.0, 1.0)))
        axis = _te_axis(direction, normal)
        amplitude_te = te[:, None] * np.einsum("ij,ijp->ip", axis, field)
        amplitude_tm = tm[:, None] * np.einsum("ij,ijp->ip", np.cross(direction, axis), field)
        tm_axis = np.cross(onward, axis)
        return axis[:, :, None] * amplitude_te[:, None] + tm_axis[:, :, None] * amplitude_tm[:, None], onward


@dataclass(frozen=True)
class PartSurfaces:
    """What the parts of a body reflect like."""

    parts: tuple[Surface, ...] = (Surface(),)

    def reflect(
        self, part: npt.NDArray[np.int64], field: Complex, direction: Real, normal: Real
    ) -> tuple[Complex, Real]:
        """Return the reflected field and its direction; `part` (num_tubes,) numbers the surfaces, the rest is as for one."""
        if len(set(self.parts)) == 1:
            return self.parts[0].reflect(field, direction, normal)
        reflected, onward = np.empty_like(field), np.empty_like(direction)
        for number, surface in enumerate(self.parts):
            rows = np.flatnonzero(part == number)
            if len(rows):
                reflected[rows], onward[rows] = surface.reflect(field[rows], direction[rows], normal[rows])
        return reflected, onward


def _te_axis(direction: Real, normal: Real) -> Real:
    """Return unit vectors across the plane of incidence; any tangent where the incidence is normal."""
    axis = np.cross(direction, normal)
    length = np.linalg.norm(axis, axis=1)
    head_on = length < 1e-9
    if head_on.any():
        helper = np.eye(3)[np.abs(normal[head_on]).argmin(axis=1)]
        axis[head_on] = np.cross(helper, normal[head_on])
        length[head_on] = np.linalg.norm(axis[head_on], axis=1)
    return cast(Real, axis / length[:, None])


def radiating_vector(
    incident: Complex, reflected: Complex, direction: Real, onward: Real, normal: Real, scattered: Real
) -> Complex:
    r"""Return eta J - s x M of the physical-optics currents, whose part across s is radiated towards s.

    Parameters
    ----------
    incident, reflected : ndarray of complex128, shape (n, 3, num_polarizations)
        Electric fields on the surface.
    direction, onward, normal, scattered : ndarray of float64, shape (n, 3)
        Directions of travel before and after, normal on the lit side, direction s to the observer.

    Notes
    -----
    .. math:: J = n \times (H_i + H_r), \quad M = -n \times (E_i + E_r), \quad \eta H = k \times E

    References
    ----------
    .. [1] C. A. Balanis, *Advanced Engineering Electromagnetics*, 2nd ed., section 6.8 (far field) and 7.10 (physical optics).
    """
    magnetic = _cross(direction, incident) + _cross(onward, reflected)
    return _cross(normal, magnetic) + _cross(scattered, _cross(normal, incident + reflected))


def _cross(vector: Real, field: Complex) -> Any:
    """Return the cross product of (n, 3) with (n, 3, p)."""
    x, y, z = (vector[:, i, None] for i in range(3))
    fx, fy, fz = field[:, 0], field[:, 1], field[:, 2]
    return np.stack([y * fz - z * fy, z * fx - x * fz, x * fy - y * fx], axis=1)
