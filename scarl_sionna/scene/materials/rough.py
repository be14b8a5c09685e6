"""What a rough surface scatters: one law for all solvers of the radar channel."""

from __future__ import annotations

from typing import Literal

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ParameterRangeError

from .fresnel import power_reflectance
from .table import RadioMaterial

Channel = Literal["VV", "HH", "HV", "VH"]


def diffuse_albedo(material: RadioMaterial, frequency: float) -> float:
    r"""Return the share of the incident power that a rough surface scatters diffusely, 0 to 1, the same for V and H.

    Parameters
    ----------
    material : RadioMaterial
        Its `diffuse_albedo` counts where it states one (measured backscatter), else scattering coefficient and
        reflectance.
    frequency : float
        [Hz].

    Raises
    ------
    MaterialRangeError
        If the material has no data at this frequency.

    Notes
    -----
    .. math:: \rho = S^2 |\Gamma(0)|^2

    with the reflectance along the normal: what comes back from a rough surface comes from facets that face the radar,
    so V and H do not differ and there is no Brewster angle, as in the limit of geometrical optics [1]_. Under a film of
    water a measured albedo is raised as the reflectance is, to 1 at most.

    References
    ----------
    .. [1] F. T. Ulaby, R. K. Moore, A. K. Fung, *Microwave Remote Sensing*, vol. II, 1982, chapter 12.
    """
    reflectance = float(power_reflectance(material, frequency, 1.0)[0])
    if material.diffuse_albedo is None:
        return material.scattering_coefficient**2 * reflectance
    if material.water_film > 0.0:
        dry = float(power_reflectance(material.with_(water_film=0.0), frequency, 1.0)[0])
        return min(material.diffuse_albedo * reflectance / dry, 1.0)
    return material.diffuse_albedo


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

    Lambert's pattern with the albedo of :func:`diffuse_albedo`; the coherent reflection is not in it.

    References
    ----------
    .. [1] V. Degli-Esposti et al., "Measurement and modelling of scattering from buildings", IEEE Trans. Antennas
           Propag. 55(1), 2007, Eqs. (2), (5).
    """
    if channel not in ("VV", "HH", "HV", "VH"):
        raise ParameterRangeError("channel", repr(channel), "'VV', 'HH', 'HV' or 'VH'")
    share = material.xpd_coefficient if channel in ("HV", "VH") else 1.0 - material.xpd_coefficient
    return np.asarray(4.0 * diffuse_albedo(material, frequency) * np.sin(grazing) ** 2 * share)
