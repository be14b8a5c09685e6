"""Photons: constants, their energy, and the sun as a black body."""

from __future__ import annotations

import math

from scarl_sionna.core.units import BOLTZMANN, SPEED_OF_LIGHT

PLANCK = 6.626_070_15e-34
"""Planck constant [J s] (SI, exact)."""
ELEMENTARY_CHARGE = 1.602_176_634e-19
"""Elementary charge [C] (SI, exact)."""
SUN_TEMPERATURE = 5772.0
"""Effective temperature of the sun [K] (IAU 2015 Resolution B3)."""
SUN_RADIUS = 6.957e8
"""[m] (IAU 2015 Resolution B3)."""
ASTRONOMICAL_UNIT = 1.495_978_707e11
"""[m] (IAU 2012, exact)."""


def photon_energy(wavelength: float) -> float:
    """Return the energy of a photon [J] at a wavelength [m].

    By definition, h c / wavelength (SI 2019, exact constants).
    """
    return PLANCK * SPEED_OF_LIGHT / wavelength


def sun_irradiance(wavelength: float) -> float:
    r"""Return the irradiance of a surface across the sun's rays above the air [W/(m2 nm)].

    Parameters
    ----------
    wavelength : float
        [m].

    Notes
    -----
    .. math:: E_\lambda = \pi \left(\frac{r_\odot}{1\,\text{au}}\right)^2
        \frac{2 h c^2}{\lambda^5} \frac{1}{e^{h c / \lambda k T} - 1}

    with the sun as a black body of 5772 K (Planck; constants IAU 2015): over all wavelengths 1361 W/m2. *Left out*: the
    sun's absorption lines, and air, which takes a part of it; so this is the upper end of daylight.
    """
    solid_angle = math.pi * (SUN_RADIUS / ASTRONOMICAL_UNIT) ** 2
    exponent = photon_energy(wavelength) / (BOLTZMANN * SUN_TEMPERATURE)
    radiance = 2.0 * PLANCK * SPEED_OF_LIGHT**2 / wavelength**5 / math.expm1(exponent)
    return solid_angle * radiance * 1e-9
