"""What a rough surface scatters: one law for all solvers of the radar channel."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.units import SPEED_OF_LIGHT

from .fresnel import film_of, power_reflectance, stack_reflection, transmission
from .layers import Number
from .table import RadioMaterial

Channel = Literal["VV", "HH", "HV", "VH"]


def height_loss(height: complex, frequency: npt.ArrayLike, cosine: npt.ArrayLike) -> npt.NDArray[Any]:
    r"""Return the part of the reflected field that heights of a surface leave in the mirror reflection, 0 to 1.

    Parameters
    ----------
    height : float
        Their standard deviation, a material's `roughness_rms` [m]; complex where a calibration differentiates.
    frequency : array_like of float, any shape
        [Hz].
    cosine : array_like of float, any shape
        Of the angle of incidence, which is the sine of the grazing angle.

    Notes
    -----
    .. math:: e^{-2 (k h \cos\theta)^2}

    for heights of normal distribution and standard deviation h [1]_. The phase of a facet is 2 k h cos(theta): near
    grazing every surface is smooth.

    References
    ----------
    .. [1] W. S. Ament, "Toward a theory of reflection by a rough surface", Proc. IRE 41(1), 1953.
    """
    wavenumber = 2.0 * np.pi / SPEED_OF_LIGHT * np.asarray(frequency)
    return np.asarray(np.exp(-2.0 * (wavenumber * height * np.asarray(cosine)) ** 2))


def coherent_share(material: RadioMaterial, frequency: npt.ArrayLike, cosine: npt.ArrayLike) -> npt.NDArray[Any]:
    r"""Return the part of the reflected field that a rough surface leaves in the mirror reflection, 0 to 1.

    All solvers and the calibration reflect by it.

    Parameters
    ----------
    material : RadioMaterial
        Its `scattering_coefficient` and `roughness_rms` count.
    frequency, cosine : array_like of float
        As of :func:`height_loss`.

    Notes
    -----
    .. math:: \sqrt{1 - S^2} \; e^{-2 (k h \cos\theta)^2}

    The scattering coefficient S [1]_ is what is lost at all angles, such as by texture finer than the wavelength and by
    grains within; the second factor is that of :func:`height_loss`.

    References
    ----------
    .. [1] V. Degli-Esposti et al., "Measurement and modelling of scattering from buildings", IEEE Trans. Antennas
           Propag. 55(1), 2007.
    """
    kept = np.sqrt(1.0 - material.scattering_coefficient**2)
    return np.asarray(kept * height_loss(material.roughness_rms, frequency, cosine))


def coherent_transmission(
    material: RadioMaterial, frequency: float, cosine: npt.ArrayLike
) -> tuple[npt.NDArray[np.complex128], npt.NDArray[np.complex128]]:
    r"""Return what passes a layer coherently, TE and TM: :func:`.fresnel.transmission` times sqrt(1 - S^2).

    All solvers let waves through by it; zero for a half space. *Not modelled*: what heights take from what passes, and
    what is scattered forward.

    Parameters
    ----------
    material : RadioMaterial
        Its `scattering_coefficient` S counts.
    frequency : float
        [Hz].
    cosine : array_like of float, any shape
        Of the angle of incidence.

    Raises
    ------
    MaterialRangeError
        If the material has no data at this frequency.
    """
    te, tm = transmission(material, frequency, cosine)
    kept = np.sqrt(1.0 - material.scattering_coefficient**2)
    return kept * te, kept * tm


def diffuse_share(material: RadioMaterial, frequency: npt.ArrayLike) -> npt.NDArray[Any]:
    r"""Return the share of the reflected power that is scattered diffusely, 0 to 1; parameters as of `coherent_share`.

    Notes
    -----
    .. math:: 1 - (1 - S^2) \, e^{-4 (k h)^2}

    What the mirror reflection along the normal loses: a power, which is smooth in S and h also where both vanish.
    """
    wavenumber = 2.0 * np.pi / SPEED_OF_LIGHT * np.asarray(frequency)
    scattered = material.scattering_coefficient**2
    return np.asarray(scattered - (1.0 - scattered) * np.expm1(-4.0 * (wavenumber * material.roughness_rms) ** 2))


def scatters(material: RadioMaterial) -> bool:
    """Return whether a surface of a material scatters diffusely at all, by whichever of its fields."""
    if material.volume_albedo is not None or material.diffuse_albedo is not None:
        return bool(material.volume_albedo or material.diffuse_albedo)
    return material.scattering_coefficient > 0.0 or material.roughness_rms > 0.0


def diffuse_albedo(material: RadioMaterial, frequency: float) -> float:
    r"""Return the share of the incident power that a rough surface scatters diffusely, 0 to 1, the same for V and H.

    Parameters
    ----------
    material : RadioMaterial
        Its `diffuse_albedo` counts where it states one (measured backscatter), else scattering coefficient, heights
        and reflectance; its `volume_albedo` does not count.
    frequency : float
        [Hz].

    Raises
    ------
    MaterialRangeError
        If the material has no data at this frequency.

    Notes
    -----
    .. math:: \rho = (1 - (1 - S^2) \, e^{-4 (k h)^2}) \, |\Gamma(0)|^2

    which is what the mirror reflection of :func:`coherent_share` lacks along the normal, with the reflectance there:
    what comes back from a rough surface comes from facets that face the radar, so V and H do not differ and there is no
    Brewster angle, as in the limit of geometrical optics [1]_. Under a film of water a measured albedo is raised as the
    reflectance is, to 1 at most.

    References
    ----------
    .. [1] F. T. Ulaby, R. K. Moore, A. K. Fung, *Microwave Remote Sensing*, vol. II, 1982, chapter 12.
    """
    return float(np.abs(_surface_albedo(material, frequency)))


def _surface_albedo(material: RadioMaterial, frequency: float) -> complex:
    """Return a number whose magnitude is :func:`diffuse_albedo`: with the square of the reflection coefficient."""
    permittivity, film = material.at(frequency), film_of(material, frequency)
    squared = [
        complex(stack_reflection(permittivity, material.thickness, top, 1.0, frequency)[0] ** 2) for top in (film, None)
    ]
    if material.diffuse_albedo is None:
        return complex(diffuse_share(material, frequency)) * squared[0]
    if film is None:
        return complex(material.diffuse_albedo)
    raised = material.diffuse_albedo * squared[0] / squared[1]
    return raised / max(abs(raised), 1.0)


def escape(albedo: Number, cosine: Number) -> Number:
    r"""Return how much multiple scattering adds to what enters or leaves a deep layer of scatterers, 1 and more.

    Parameters
    ----------
    albedo : float or array
        Of one scatterer, 0 to 1; NumPy's and the engine's numbers alike.
    cosine : float or array
        Of the angle to the layer's normal.

    Notes
    -----
    .. math:: H(\mu) \approx \frac{1 + 2 \mu}{1 + 2 \mu \sqrt{1 - w}}

    Chandrasekhar's function [1]_ of isotropic scatterers in the form of [2]_, within 4.1 % of it for w up to 0.95.

    References
    ----------
    .. [1] S. Chandrasekhar, *Radiative Transfer*, 1960, chapter V.
    .. [2] B. Hapke, "Bidirectional reflectance spectroscopy: 1. Theory", J. Geophys. Res. 86(B4), 1981.
    """
    return (1.0 + 2.0 * cosine) / (1.0 + 2.0 * cosine * (1.0 - albedo) ** 0.5)


def layer_albedo(albedo: Number, arriving: Number, leaving: Number) -> Number:
    r"""Return the albedo of the Lambertian surface that would scatter as a deep layer does between two directions.

    Parameters
    ----------
    albedo : float or array
        Of one scatterer of the layer, 0 to 1; NumPy's and the engine's numbers alike.
    arriving, leaving : float or array
        Cosines of the angles to the layer's normal, at least one above 0.

    Notes
    -----
    .. math:: \rho(\mu_i, \mu_s) = \frac{w}{4} \frac{H(\mu_i) H(\mu_s)}{\mu_i + \mu_s}

    with H of :func:`escape`: isotropic scatterers, such as blades of all directions, in a layer through which nothing
    is seen; how densely they stand does not count.
    """
    return 0.25 * albedo * escape(albedo, arriving) * escape(albedo, leaving) / (arriving + leaving)


def layer_reflectance(albedo: float, cosine: npt.ArrayLike) -> npt.NDArray[np.float64]:
    r"""Return the share of what arrives at an angle that a deep layer of scatterers sends back in all directions.

    Parameters
    ----------
    albedo : float
        Of one scatterer, 0 to 1.
    cosine : array_like of float, any shape
        Of the angle to the layer's normal.

    Notes
    -----
    .. math:: 1 - \sqrt{1 - w} \, H(\mu)

    with H of :func:`escape`; exact with Chandrasekhar's own [1]_.

    References
    ----------
    .. [1] S. Chandrasekhar, *Radiative Transfer*, 1960, chapter V.
    """
    return np.asarray(1.0 - np.sqrt(1.0 - albedo) * escape(albedo, np.asarray(cosine, dtype=np.float64)))


def scattered_part(material: RadioMaterial, frequency: float, cosine: npt.ArrayLike) -> npt.NDArray[np.float64]:
    r"""Return which part of its albedo a surface keeps at an angle of incidence, 0 to 1: what the mirror leaves of it.

    All solvers scatter by it: a direction of arrival and one of leaving keep the lesser of their two parts, which is
    the same both ways.

    Parameters
    ----------
    material : RadioMaterial
    frequency : float
        [Hz].
    cosine : array_like of float, any shape
        Of the angle to the normal.

    Raises
    ------
    MaterialRangeError
        If the material has no data at this frequency.

    Notes
    -----
    .. math:: \min\left(1, \frac{1 - \max_p (c^2 |\Gamma_p|^2 + (1 - S^2) |T_p|^2)}{\rho}\right)

    over both polarisations p, with c of :func:`coherent_share` and the albedo :math:`\rho` over all directions. Near
    grazing the coherent reflection takes nearly all power, whatever the albedo along the normal; what is scattered is
    bounded by what is left, so that no angle sends out more than arrives. By energy conservation and reciprocity; the
    form is ours.
    """
    cosine = np.asarray(cosine, dtype=np.float64)
    kept = np.abs(coherent_share(material, frequency, cosine)) ** 2  # complex where a calibration differentiates
    passed = coherent_transmission(material, frequency, cosine)
    sent = [
        kept * r + np.abs(t) ** 2 for r, t in zip(power_reflectance(material, frequency, cosine), passed, strict=True)
    ]
    room = np.maximum(1.0 - np.maximum(*sent), 0.0)
    if material.volume_albedo is None:
        whole = np.full(cosine.shape, diffuse_albedo(material, frequency))
    else:
        whole = layer_reflectance(material.volume_albedo, cosine)
    return np.asarray(np.minimum(1.0, np.divide(room, whole, out=np.ones_like(room), where=whole > 0.0)))


def directional_albedo(
    material: RadioMaterial, frequency: float, arriving: npt.ArrayLike, leaving: npt.ArrayLike
) -> npt.NDArray[np.float64]:
    """Return the albedo of the Lambertian surface that would scatter as a material does between two directions.

    Parameters
    ----------
    material : RadioMaterial
        A deep layer where it has a `volume_albedo` (:func:`layer_albedo`; a film of water on its top leaves that as it
        is), else a rough surface (:func:`diffuse_albedo`, the same for all directions); of both the part of
        :func:`scattered_part`.
    frequency : float
        [Hz].
    arriving, leaving : array_like of float
        Cosines of the angles to the normal; they broadcast.

    Raises
    ------
    MaterialRangeError
        If the material has no data at this frequency.
    """
    return np.abs(_albedo(material, frequency, arriving, leaving))


def _albedo(
    material: RadioMaterial, frequency: float, arriving: npt.ArrayLike, leaving: npt.ArrayLike
) -> npt.NDArray[np.float64] | npt.NDArray[np.complex128]:
    """Return numbers whose magnitudes are :func:`directional_albedo`, as of :func:`_surface_albedo`."""
    arriving, leaving = np.broadcast_arrays(np.asarray(arriving, float), np.asarray(leaving, float))
    part = np.minimum(*(scattered_part(material, frequency, cosine) for cosine in (arriving, leaving)))
    if material.volume_albedo is None:
        return np.asarray(part * _surface_albedo(material, frequency))
    return np.asarray(part * layer_albedo(material.volume_albedo, arriving, np.maximum(leaving, 1e-9)))


def sigma0(
    material: RadioMaterial, frequency: float, grazing: npt.ArrayLike, channel: Channel
) -> npt.NDArray[np.float64]:
    r"""Return the backscatter coefficient of a rough surface: radar cross-section over its area [m2/m2].

    Parameters
    ----------
    material : RadioMaterial
    frequency : float
        [Hz].
    grazing : array_like of float, any shape
        Angle between the ray and the surface [rad], 0 to pi/2.
    channel : {"VV", "HH", "HV", "VH"}

    Raises
    ------
    ParameterRangeError
        If the channel is another.
    MaterialRangeError
        If the material has no data at this frequency.

    Notes
    -----
    .. math:: \sigma^0 = 4 \rho \sin^2\psi \, (1 - K_x) \quad\text{and}\quad 4 \rho \sin^2\psi \, K_x

    Lambert's pattern with the albedo of :func:`directional_albedo`, which falls where the mirror leaves less near
    grazing: that of a deep layer rises as 1 / sin(psi) towards
    grazing, so that its sigma0 falls as sin(psi). The coherent reflection is not in it.

    References
    ----------
    .. [1] V. Degli-Esposti et al., "Measurement and modelling of scattering from buildings", IEEE Trans. Antennas
           Propag. 55(1), 2007, Eqs. (2), (5).
    """
    return np.abs(holomorphic_sigma0(material, frequency, grazing, channel))


def holomorphic_sigma0(
    material: RadioMaterial, frequency: float, grazing: npt.ArrayLike, channel: Channel
) -> npt.NDArray[np.complex128]:
    """Return numbers whose magnitudes are :func:`sigma0`, and which are holomorphic in what a material is made of.

    A calibration differentiates them. They have the square of the reflection coefficient where the power has its
    magnitude; their phase means nothing. The bound of :func:`scattered_part`, which films of water reach near grazing,
    counts as a constant.

    Parameters and errors as of :func:`sigma0`.
    """
    if channel not in ("VV", "HH", "HV", "VH"):
        raise ParameterRangeError("channel", repr(channel), "'VV', 'HH', 'HV' or 'VH'")
    share = material.xpd_coefficient if channel in ("HV", "VH") else 1.0 - material.xpd_coefficient
    sine = np.sin(grazing)
    albedo = _albedo(material, frequency, sine, sine)
    return np.asarray(4.0 * albedo * sine**2 * share, dtype=np.complex128)
