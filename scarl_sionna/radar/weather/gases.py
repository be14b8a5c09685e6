"""Attenuation by oxygen and water vapour, line by line, at the temperature and humidity of the air."""

from __future__ import annotations

import numpy as np

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.specs.weather import GAS_PRESSURE, REFERENCE_VAPOUR

from .gas_lines import OXYGEN, WATER_VAPOUR
from .itu_rain import require_band

_GAS_BAND = (75e9, 82e9)
REFERENCE_TEMPERATURE = 288.15
"""Of the air near the ground where no weather states another [K]."""


def gas_attenuation(
    frequency: float, temperature: float = REFERENCE_TEMPERATURE, vapour: float = REFERENCE_VAPOUR
) -> float:
    r"""Return the one-way specific attenuation by oxygen and water vapour [dB/km].

    Parameters
    ----------
    frequency : float
        [Hz], 75e9 to 82e9.
    temperature : float
        Of the air [K], 243.15 to 323.15.
    vapour : float
        Density of the water vapour [g/m3], 0 to 100.

    Raises
    ------
    ParameterRangeError
        If a value is outside.

    Notes
    -----
    The line-by-line method,

    .. math:: \gamma = 0.182 f N''(f), \quad N'' = \sum_i S_i F_i + N_D''

    over 44 lines of oxygen and 35 of water vapour, for dry air of 1013 hPa.

    References
    ----------
    .. [1] Recommendation ITU-R P.676-12, "Attenuation by atmospheric gases and related effects", 2019, Annex 1.
    """
    require_band(frequency, _GAS_BAND)
    if not 243.15 <= temperature <= 323.15:
        raise ParameterRangeError("temperature", f"{temperature} K", "243.15 to 323.15 K", "give kelvin")
    if not 0.0 <= vapour <= 100.0:
        raise ParameterRangeError("vapour", f"{vapour} g/m3", "0 to 100 g/m3")
    f, p, theta = frequency / 1e9, GAS_PRESSURE, 300.0 / temperature
    e = vapour * temperature / 216.7  # partial pressure [hPa]
    line, a1, a2, a3, a4, a5, a6 = OXYGEN.T
    width = np.hypot(a3 * 1e-4 * (p * theta ** (0.8 - a4) + 1.1 * e * theta), 1.5e-3)  # with Zeeman's splitting
    overlap = (a5 + a6 * theta) * 1e-4 * (p + e) * theta**0.8
    oxygen = float(np.sum(a1 * 1e-7 * p * theta**3 * np.exp(a2 * (1.0 - theta)) * _shape(f, line, width, overlap)))
    d = 5.6e-4 * (p + e) * theta**0.8
    dry = f * p * theta**2 * (6.14e-5 / (d * (1.0 + (f / d) ** 2)) + 1.4e-12 * p * theta**1.5 / (1.0 + 1.9e-5 * f**1.5))
    line, b1, b2, b3, b4, b5, b6 = WATER_VAPOUR.T
    width = b3 * 1e-4 * (p * theta**b4 + b5 * e * theta**b6)
    width = 0.535 * width + np.sqrt(0.217 * width**2 + 2.1316e-12 * line**2 / theta)  # with Doppler broadening
    water = float(np.sum(b1 * 0.1 * e * theta**3.5 * np.exp(b2 * (1.0 - theta)) * _shape(f, line, width, 0.0)))
    return 0.182 * f * (oxygen + dry + water)


def _shape(f: float, line: np.ndarray, width: np.ndarray, overlap: np.ndarray | float) -> np.ndarray:
    """Return the shape factors of lines."""
    below = (width - overlap * (line - f)) / ((line - f) ** 2 + width**2)
    above = (width - overlap * (line + f)) / ((line + f) ** 2 + width**2)
    return np.asarray(f / line * (below + above))
