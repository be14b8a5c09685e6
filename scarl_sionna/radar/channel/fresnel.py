"""Fresnel reflection of a half space and of one layer, for the polarisation of a radar.

Time dependence e^{+j 2 pi f t}: losses are a negative imaginary part of the permittivity.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.world.materials import RadioMaterial

Real = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]


def halfspace_reflection(permittivity: complex, cos_incidence: npt.ArrayLike) -> tuple[Complex, Complex]:
    r"""Return the reflection coefficients of a half space in air.

    Parameters
    ----------
    permittivity : complex
        Relative permittivity, imaginary part <= 0.
    cos_incidence : array_like of float
        Cosine of the angle from the normal, 0 to 1.

    Returns
    -------
    te, tm : ndarray of complex128
        Electric field perpendicular to, and in, the plane of incidence. The sign of `tm` is that of a field which keeps
        its direction along the surface in the ray's own frame (+1 for a perfect conductor).

    Notes
    -----
    .. math:: \Gamma_{TE} = \frac{\cos\theta - q}{\cos\theta + q}, \quad
              \Gamma_{TM} = \frac{\varepsilon\cos\theta - q}{\varepsilon\cos\theta + q}, \quad
              q = \sqrt{\varepsilon - \sin^2\theta}

    References
    ----------
    .. [1] Recommendation ITU-R P.2040-3, Eqs. (31), (32).
    """
    cosine = np.asarray(cos_incidence, dtype=np.float64)
    q = np.sqrt(permittivity - (1.0 - cosine**2) + 0j)
    te = (cosine - q) / (cosine + q)
    tm = (permittivity * cosine - q) / (permittivity * cosine + q)
    return te, tm


def layer_reflection(
    permittivity: complex, cos_incidence: npt.ArrayLike, thickness: float, frequency: float
) -> tuple[Complex, Complex]:
    r"""Return the reflection coefficients of one layer with air on both sides.

    Parameters
    ----------
    permittivity : complex
        Relative permittivity, imaginary part <= 0.
    cos_incidence : array_like of float
        Cosine of the angle from the normal, 0 to 1.
    thickness : float
        [m].
    frequency : float
        [Hz].

    Returns
    -------
    te, tm : ndarray of complex128
        As in :func:`halfspace_reflection`.

    Notes
    -----
    .. math:: R = \Gamma \frac{1 - e^{-2jq}}{1 - \Gamma^2 e^{-2jq}}, \quad
              q = \frac{2\pi d}{\lambda}\sqrt{\varepsilon - \sin^2\theta}

    At exactly grazing incidence of a layer without losses the form is 0/0 where the layer is a whole number of half
    wavelengths thick; its limit in angle, -1, is returned.

    References
    ----------
    .. [1] Recommendation ITU-R P.2040-3, section 2.2.2.2, single-layer slab.
    """
    cosine = np.asarray(cos_incidence, dtype=np.float64)
    phase = 2.0 * np.pi * thickness * frequency / SPEED_OF_LIGHT * np.sqrt(permittivity - (1.0 - cosine**2) + 0j)
    round_trip = np.exp(-2j * phase)
    coefficients = []
    for gamma in halfspace_reflection(permittivity, cosine):
        denominator = 1.0 - gamma**2 * round_trip
        ratio = np.divide(1.0 - round_trip, denominator, out=np.ones_like(denominator), where=denominator != 0)
        coefficients.append(gamma * ratio)
    return coefficients[0], coefficients[1]


def power_reflectance(material: RadioMaterial, frequency: float, cos_incidence: npt.ArrayLike) -> tuple[Real, Real]:
    """Return the power reflectances of a material, TE and TM, each 0 to 1.

    Parameters
    ----------
    material : RadioMaterial
        With a thickness it reflects as one layer with air behind, without as a half space.
    frequency : float
        [Hz].
    cos_incidence : array_like of float
        Cosine of the angle from the normal, 0 to 1.

    Raises
    ------
    MaterialRangeError
        If the material has no data at this frequency.
    """
    permittivity = material.at(frequency)
    if material.thickness is None:
        te, tm = halfspace_reflection(permittivity, cos_incidence)
    else:
        te, tm = layer_reflection(permittivity, cos_incidence, material.thickness, frequency)
    return np.abs(te) ** 2, np.abs(tm) ** 2


def te_fraction_of_h(directions: Real, normals: Real) -> Real:
    """Return how much of the power of a horizontally polarised wave (along phi-hat) is TE at a surface.

    The same fraction of a vertically polarised wave (theta-hat) is TM.

    Parameters
    ----------
    directions : ndarray of float64, shape (num_hits, 3)
        Unit directions of travel, radar frame (z up).
    normals : ndarray of float64, shape (num_hits, 3)
        Unit surface normals, radar frame.

    Returns
    -------
    ndarray of float64, shape (num_hits,)
        0 to 1; 1 where the incidence is normal, since TE and TM do not differ there.
    """
    x, y, z = directions.T
    nx, ny, nz = normals.T
    rho_squared = np.maximum(x * x + y * y, 1e-300)
    # s = direction x normal; phi_hat = (-y, x, 0) / rho
    projection = z * (x * nx + y * ny) - rho_squared * nz
    sine_squared = (y * nz - z * ny) ** 2 + (z * nx - x * nz) ** 2 + (x * ny - y * nx) ** 2
    fraction = np.ones_like(sine_squared)
    oblique = sine_squared > 1e-12
    np.divide(projection**2, rho_squared * sine_squared, out=fraction, where=oblique)
    return np.clip(fraction, 0.0, 1.0)
