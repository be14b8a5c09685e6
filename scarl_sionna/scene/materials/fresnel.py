"""Fresnel reflection of a half space and of one layer, for the polarisation of a radar.

Time dependence e^{+j 2 pi f t}: losses are a negative imaginary part of the permittivity.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.units import SPEED_OF_LIGHT

from .dielectrics import water_permittivity
from .layers import HOST, Arithmetic, layers
from .table import RadioMaterial

Real = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]


def halfspace_reflection(permittivity: complex, cos_incidence: npt.ArrayLike) -> tuple[Complex, Complex]:
    r"""Return the reflection coefficients of a half space in air.

    Parameters
    ----------
    permittivity : complex
        Relative permittivity, imaginary part <= 0.
    cos_incidence : array_like of float, any shape
        Cosine of the angle from the normal, 0 to 1.

    Returns
    -------
    te, tm : ndarray of complex128, shape of `cos_incidence`
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


def halfspace_reflection_slopes(permittivity: complex, cos_incidence: npt.ArrayLike) -> tuple[Complex, Complex]:
    r"""Return the derivatives of :func:`halfspace_reflection` to the complex permittivity.

    That to the conductivity [S/m] is the same times ``-1j / (2 pi f eps0)``.

    Parameters
    ----------
    permittivity : complex
        Relative permittivity, imaginary part <= 0.
    cos_incidence : array_like of float, any shape
        Cosine of the angle from the normal, above 0 to 1.

    Returns
    -------
    te, tm : ndarray of complex128, shape of `cos_incidence`

    Notes
    -----
    By differentiation of the two coefficients,

    .. math:: \Gamma_{TE}' = -\frac{\cos\theta}{q (\cos\theta + q)^2}, \quad
              \Gamma_{TM}' = \frac{\cos\theta (2 q - \varepsilon / q)}{(\varepsilon\cos\theta + q)^2}
    """
    cosine = np.asarray(cos_incidence, dtype=np.float64)
    q = np.sqrt(permittivity - (1.0 - cosine**2) + 0j)
    te = -cosine / (q * (cosine + q) ** 2)
    tm = cosine * (2.0 * q - permittivity / q) / (permittivity * cosine + q) ** 2
    return te, tm


def layer_reflection(
    permittivity: complex, cos_incidence: npt.ArrayLike, thickness: float, frequency: float
) -> tuple[Complex, Complex]:
    r"""Return the reflection coefficients of one layer with air on both sides.

    Parameters
    ----------
    permittivity : complex
        Relative permittivity, imaginary part <= 0.
    cos_incidence : array_like of float, any shape
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


def film_coefficients(
    film: complex,
    film_thickness: float,
    permittivity: complex,
    thickness: float | None,
    cos_incidence: npt.ArrayLike,
    frequency: float,
) -> tuple[tuple[Complex, Complex], tuple[Complex, Complex]]:
    r"""Return reflection and transmission coefficients, TE and TM each, of a film on a half space or on a layer in air.

    Parameters
    ----------
    film, permittivity : complex
        Relative permittivities of the film and of what it lies on, imaginary parts <= 0.
    film_thickness : float
        [m].
    thickness : float or None
        Of the layer below, with air behind [m]; None: a half space, which lets nothing through.
    cos_incidence : array_like of float, any shape
        Cosine of the angle from the normal in air, 0 to 1.
    frequency : float
        [Hz].

    Returns
    -------
    (te, tm), (te, tm) : ndarray of complex128
        Reflection, signs as in :func:`halfspace_reflection`; transmission between the outer faces.

    Notes
    -----
    From the last interface to the first, with the interfaces' coefficients r and the phase q of a layer:

    .. math:: R_i = \frac{r_i + R_{i+1} e^{-2jq_{i+1}}}{1 + r_i R_{i+1} e^{-2jq_{i+1}}}, \quad
              T_i = \frac{(1 + r_i) T_{i+1} e^{-jq_{i+1}}}{1 + r_i R_{i+1} e^{-2jq_{i+1}}}

    for the tangential field of TE, the magnetic field of TM.

    References
    ----------
    .. [1] M. Born, E. Wolf, *Principles of Optics*, 7th ed., section 1.6; Recommendation ITU-R P.2040-3, section 2.2.2.
    """
    media = [film, permittivity] if thickness is None else [film, permittivity, 1.0 + 0j]
    depths = [film_thickness] if thickness is None else [film_thickness, thickness]
    reflected, passed = layer_coefficients(media, depths, cos_incidence, frequency)
    return reflected, passed if thickness is not None else (np.zeros_like(passed[0]), np.zeros_like(passed[1]))


def layer_coefficients(
    permittivities: Sequence[complex], depths: Sequence[float], cos_incidence: npt.ArrayLike, frequency: float
) -> tuple[tuple[Complex, Complex], tuple[Complex, Complex]]:
    r"""Return reflection and transmission coefficients, TE and TM each, of any layers seen from air.

    Parameters
    ----------
    permittivities : sequence of complex
        Relative permittivities of the layers from the face on, and of what is behind the last; imaginary parts <= 0.
    depths : sequence of float
        Of the layers, one fewer [m].
    cos_incidence : array_like of float, any shape
        Cosine of the angle from the normal in air, 0 to 1.
    frequency : float
        [Hz].

    Returns
    -------
    (te, tm), (te, tm) : ndarray of complex128
        Reflection, signs as in :func:`halfspace_reflection`; transmission between the outer faces.

    Notes
    -----
    The recursion of :func:`film_coefficients`.

    References
    ----------
    .. [1] M. Born, E. Wolf, *Principles of Optics*, 7th ed., section 1.6.
    """
    cosine = np.asarray(cos_incidence, dtype=np.float64)
    wave = 2.0 * np.pi * frequency / SPEED_OF_LIGHT
    media = [np.complex128(medium) for medium in permittivities]
    return layers(HOST, media, [wave * depth for depth in depths], cosine)


def film_of(material: RadioMaterial, frequency: float) -> tuple[complex, float] | None:
    """Return relative permittivity and depth [m] of the water on the face of a material at a frequency [Hz].

    None where it is dry.

    Permittivity as of :func:`~scarl_sionna.scene.materials.dielectrics.water_permittivity`, by definition at the
    film's temperature.
    """
    if material.water_film == 0.0:
        return None
    return water_permittivity(frequency, material.water_temperature), material.water_film


def stack_reflection(
    permittivity: complex,
    thickness: float | None,
    film: tuple[complex, float] | None,
    cos_incidence: npt.ArrayLike,
    frequency: float,
) -> tuple[Complex, Complex]:
    """Return the TE and TM reflection coefficients of a half space or layer in air, dry or with a film of water.

    Parameters
    ----------
    permittivity : complex
        Relative permittivity, imaginary part <= 0.
    thickness : float or None
        Of a layer with air behind [m]; None: a half space.
    film : tuple of (complex, float) or None
        Relative permittivity and depth [m] of a film, see :func:`film_coefficients`.
    cos_incidence : array_like of float, any shape
        Cosine of the angle from the normal, 0 to 1.
    frequency : float
        [Hz].

    References
    ----------
    .. [1] Recommendation ITU-R P.2040-3, section 2.2.2.
    """
    if film is not None:
        return film_coefficients(*film, permittivity, thickness, cos_incidence, frequency)[0]
    if thickness is None:
        return halfspace_reflection(permittivity, cos_incidence)
    return layer_reflection(permittivity, cos_incidence, thickness, frequency)


def reflection(material: RadioMaterial, frequency: float, cos_incidence: npt.ArrayLike) -> tuple[Complex, Complex]:
    """Return the reflection coefficients of a material, TE and TM.

    Of one layer if it has a thickness, else a half space.

    A film of water lies on its face where the material has one, see :func:`film_coefficients`.

    Parameters
    ----------
    material : RadioMaterial
    frequency : float
        [Hz].
    cos_incidence : array_like of float, any shape
        Cosine of the angle from the normal, 0 to 1.

    Raises
    ------
    MaterialRangeError
        If the material has no data at this frequency.

    References
    ----------
    .. [1] Recommendation ITU-R P.2040-3, section 2.2.2.
    """
    cosine = np.asarray(cos_incidence, dtype=np.float64)
    return stack_reflection(material.at(frequency), material.thickness, film_of(material, frequency), cosine, frequency)


def transmission(material: RadioMaterial, frequency: float, cos_incidence: npt.ArrayLike) -> tuple[Complex, Complex]:
    r"""Return the transmission coefficients of a material, TE and TM; zero for a half space.

    They stand for the layer in place of the same thickness of air along the straight ray, so 1 is a layer that is not
    there.

    Parameters
    ----------
    material : RadioMaterial
    frequency : float
        [Hz].
    cos_incidence : array_like of float, any shape
        Cosine of the angle from the normal, 0 to 1.

    Raises
    ------
    MaterialRangeError
        If the material has no data at this frequency.

    Notes
    -----
    .. math:: T = \frac{(1 - \Gamma^2) e^{-jq}}{1 - \Gamma^2 e^{-2jq}} e^{j k d \cos\theta}

    with Gamma of the half space and q as in :func:`layer_reflection`. The last factor takes away the phase of the air
    that the layer replaces. *Not modelled*: the sideways shift of the ray.

    References
    ----------
    .. [1] Recommendation ITU-R P.2040-3, section 2.2.2.2, single-layer slab.
    """
    cosine = np.asarray(cos_incidence, dtype=np.float64)
    permittivity = material.at(frequency)
    if material.thickness is None:
        nothing = np.zeros(cosine.shape, dtype=np.complex128)
        return nothing, nothing.copy()
    if (film := film_of(material, frequency)) is not None:
        whole = 2.0 * np.pi * (material.thickness + material.water_film) * frequency / SPEED_OF_LIGHT
        te, tm = film_coefficients(*film, permittivity, material.thickness, cosine, frequency)[1]
        return te * np.exp(1j * whole * cosine), tm * np.exp(1j * whole * cosine)
    depth = 2.0 * np.pi * material.thickness * frequency / SPEED_OF_LIGHT
    phase = depth * np.sqrt(permittivity - (1.0 - cosine**2) + 0j)
    once = np.exp(-1j * phase)
    coefficients = []
    for gamma in halfspace_reflection(permittivity, cosine):
        denominator = 1.0 - gamma**2 * once**2
        ratio = np.divide((1.0 - gamma**2) * once, denominator, out=np.zeros_like(denominator), where=denominator != 0)
        coefficients.append(ratio * np.exp(1j * depth * cosine))
    return coefficients[0], coefficients[1]


def power_reflectance(material: RadioMaterial, frequency: float, cos_incidence: npt.ArrayLike) -> tuple[Real, Real]:
    """Return the power reflectances of a material, TE and TM, each 0 to 1.

    Parameters
    ----------
    material : RadioMaterial
        With a thickness it reflects as one layer with air behind, without as a half space.
    frequency : float
        [Hz].
    cos_incidence : array_like of float, any shape
        Cosine of the angle from the normal, 0 to 1.

    Raises
    ------
    MaterialRangeError
        If the material has no data at this frequency.

    References
    ----------
    .. [1] Recommendation ITU-R P.2040-3, section 2.2.2.
    """
    te, tm = reflection(material, frequency, cos_incidence)
    return np.abs(te) ** 2, np.abs(tm) ** 2


def te_fraction_of_h(sine_elevation: Real, cos_incidence: Real, normal_up: Real, on: Arithmetic = HOST) -> Real:
    r"""Return how much of the power of a horizontally polarised wave (along phi-hat) is TE at a surface.

    The same fraction of a vertically polarised wave (theta-hat) is TM.

    Parameters
    ----------
    sine_elevation : ndarray of float64, shape (num_hits,)
        Component of the unit direction u of travel along the radar's z axis.
    cos_incidence : ndarray of float64, shape (num_hits,)
        Cosine of the angle from the surface's normal n, 0 to 1.
    normal_up : ndarray of float64, shape (num_hits,)
        Component along the radar's z axis of the unit normal that points towards the radar.
    on : Arithmetic
        What the numbers are made of.

    Returns
    -------
    ndarray of float64, shape (num_hits,)
        0 to 1; 1 where the incidence is normal or the ray runs along z, since there the two do not differ or have no
        meaning.

    Notes
    -----
    With phi-hat along z x u and the TE direction along u x n, by Lagrange's identity

    .. math:: \frac{[(z \times u) \cdot (u \times n)]^2}{|z \times u|^2 |u \times n|^2}
              = \frac{(u_z \cos\theta + n_z)^2}{(1 - u_z^2)(1 - \cos^2\theta)}
    """
    area_squared = (1.0 - sine_elevation * sine_elevation) * (1.0 - cos_incidence * cos_incidence)
    numerator = (sine_elevation * cos_incidence + normal_up) ** 2
    defined = area_squared > 1e-12
    return on.minimum(on.where(defined, numerator / on.where(defined, area_squared, 1.0), 1.0), 1.0)
