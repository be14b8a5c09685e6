"""What comes back from a surface in the ideal case. Pure numpy."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

GLASS_INDEX = 1.5
"""Refractive index of glass at 1550 nm (fused silica 1.444, soda-lime about 1.50)."""


def radial_velocity(
    surface_velocity: npt.ArrayLike, sensor_velocity: npt.ArrayLike, directions: npt.ArrayLike
) -> Array:
    r"""Return how fast the distance to surface points opens.

    Parameters
    ----------
    surface_velocity : array_like of float, shape (..., 3)
        Velocity of the material point that is hit [m/s].
    sensor_velocity : array_like of float, shape (3,)
        Velocity of the point from which the light leaves [m/s], same axes.
    directions : array_like of float, shape (..., 3)
        Unit directions of the light, same axes.

    Returns
    -------
    ndarray of float64, shape (...)
        Positive = opening [m/s].

    Notes
    -----
    .. math:: v_r = (\mathbf v_\text{surface} - \mathbf v_\text{sensor}) \cdot \hat{\mathbf d}

    The Doppler shift of coherent light is :math:`-2 v_r / \lambda` of this material velocity: it is not the change of
    distance along a beam that sweeps over the surface. So the sensor's own rotation does not enter. *Error* of leaving
    relativity out: v/c, 2e-7 at 60 m/s.
    """
    relative = np.asarray(surface_velocity, dtype=np.float64) - np.asarray(sensor_velocity, dtype=np.float64)
    return np.einsum("...i,...i->...", relative, np.asarray(directions, dtype=np.float64))


def return_intensity(
    reflectance: npt.ArrayLike,
    cos_incidence: npt.ArrayLike,
    distance: npt.ArrayLike,
    attenuation: float,
    retroreflection: npt.ArrayLike = 0.0,
    retroreflected_luminance: npt.ArrayLike = 0.0,
) -> Array:
    r"""Return the received power of a return over that of a white diffuser at 1 m, hit normally, without air.

    Parameters
    ----------
    reflectance : array_like of float
        Diffuse (Lambertian) reflectance at the lidar's wavelength, 0 to 1.
    cos_incidence : array_like of float
        Cosine of the angle between ray and surface normal, 0 to 1.
    distance : array_like of float
        Along the ray [m], > 0.
    attenuation : float
        One-way power extinction coefficient of the air [1/m].
    retroreflection : array_like of float
        Of a sheet or a prism at normal incidence, R_A [cd/(lx m2)].
    retroreflected_luminance : array_like of float
        Of beads in a marking, R_L [cd/(lx m2)].

    Returns
    -------
    ndarray of float64

    Notes
    -----
    .. math:: I = \left[ \rho \cos\theta + \pi (R_A \cos^2\theta + R_L) \right]
        \frac{e^{-2 \alpha d}}{(d / 1\,\text{m})^2}

    A white diffuser has the luminance 1/pi for each unit of illuminance across the beam; a sheet has
    :math:`R_A(\theta) / \cos\theta` with :math:`R_A \sim \cos^3\theta` (EN 12899-1, class RA2: 250, 150, 110 at 5,
    30, 40 deg, within 10 %), a marking R_L by its definition (EN 1436, at 88.8 deg; taken to hold at all angles).
    *Validity*: a surface that holds the whole beam, monostatic optics focused at infinity. Retroreflection is specified
    in visible light, 0.2 deg or 1 deg off the source; straight back at 1550 nm it is an estimate within a factor of
    three. *Not modelled*: mirrors, beams across an edge, overlap loss at short distance, speckle.

    References
    ----------
    .. [1] P. McManamon, *Field Guide to Lidar*, SPIE, 2015, lidar range equation for an extended Lambertian target.
    .. [2] EN 12899-1:2007, table 9; EN 1436:2018, section 4.3.
    """
    distance = np.asarray(distance, dtype=np.float64)
    spreading = np.exp(-2.0 * attenuation * distance) / distance**2
    cosine = np.asarray(cos_incidence, dtype=np.float64)
    diffuse = np.asarray(reflectance, dtype=np.float64) * cosine
    back = np.asarray(retroreflection, dtype=np.float64) * cosine**2 + np.asarray(retroreflected_luminance)
    return (diffuse + np.pi * back) * spreading


def pane_transmittance(transmittance: npt.ArrayLike, cos_incidence: npt.ArrayLike) -> Array:
    r"""Return the share of power that passes a pane once.

    Parameters
    ----------
    transmittance : array_like of float
        At normal incidence, 0 to 1; 0 for what is opaque.
    cos_incidence : array_like of float

    Notes
    -----
    .. math:: T(\theta) = T_0 \, \frac{T_F(\theta)}{T_F(0)}, \quad
              T_F = \tfrac12 \sum_{s,p} \frac{1 - R}{1 + R}

    with Fresnel's reflectance R of glass (n = 1.5) for both polarizations: the incoherent sum over both faces. *Not
    modelled*: longer absorption paths at slant incidence (the path inside is at most 1.34 times the thickness), the
    ray's offset by the pane.

    References
    ----------
    .. [1] M. Born, E. Wolf, *Principles of Optics*, 7th ed., sections 1.5 and 7.6.
    """
    cosine = np.clip(np.asarray(cos_incidence, dtype=np.float64), 0.0, 1.0)
    return np.asarray(transmittance, dtype=np.float64) * _pane_fresnel(cosine) / _pane_fresnel(np.float64(1.0))


def pane_reflectance(transmittance: npt.ArrayLike, cos_incidence: npt.ArrayLike) -> Array:
    r"""Return the share of power that a pane reflects like a mirror.

    Parameters
    ----------
    transmittance : array_like of float
        At normal incidence, 0 to 1; 0 for what is opaque.
    cos_incidence : array_like of float

    Notes
    -----
    .. math:: R(\theta) = \tfrac12 \sum_{s,p} \left[ R + \frac{(1 - R)^2 R \, t^2}{1 - R^2 t^2} \right], \quad
              t = T_0 / T_F(0)

    the front face with Fresnel's reflectance R, and what comes back from the other through the glass, of which each
    pass leaves t. Without absorption that is :math:`1 - T_F(\theta)`, see :func:`pane_transmittance`.

    References
    ----------
    .. [1] M. Born, E. Wolf, *Principles of Optics*, 7th ed., sections 1.5 and 7.6.
    """
    inside = np.minimum(np.asarray(transmittance, dtype=np.float64) / _pane_fresnel(np.float64(1.0)), 1.0) ** 2
    faces = _fresnel(np.clip(np.asarray(cos_incidence, dtype=np.float64), 0.0, 1.0))
    return 0.5 * sum(face + (1.0 - face) ** 2 * face * inside / (1.0 - face**2 * inside + 1e-300) for face in faces)


def _pane_fresnel(cosine: Array | np.float64) -> Array:
    parallel, perpendicular = _fresnel(cosine)
    return 0.5 * ((1.0 - parallel) / (1.0 + parallel) + (1.0 - perpendicular) / (1.0 + perpendicular))


def _fresnel(cosine: Array | np.float64) -> tuple[Array, Array]:
    """Return the reflectances of one face of glass for light polarized parallel and perpendicular."""
    inner = np.sqrt(1.0 - (1.0 - cosine**2) / GLASS_INDEX**2)
    parallel = ((GLASS_INDEX * cosine - inner) / (GLASS_INDEX * cosine + inner)) ** 2
    perpendicular = ((cosine - GLASS_INDEX * inner) / (cosine + GLASS_INDEX * inner)) ** 2
    return parallel, perpendicular
