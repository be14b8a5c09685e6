"""Attenuation by rain as Recommendation ITU-R P.838 states it, and the band check that the laws of the air share."""

from __future__ import annotations

import math
from typing import Literal

from scarl_sionna.core.errors import ParameterRangeError

# Recommendation ITU-R P.838-3 (2005), Tables 1 to 4: rows a_j, b_j, c_j; then the slope m and the constant c
_LOG_K = {
    "H": (
        (
            (-5.33980, -0.35351, -0.23789, -0.94158),
            (-0.10008, 1.26970, 0.86036, 0.64552),
            (1.13098, 0.45400, 0.15354, 0.16817),
        ),
        (-0.18961, 0.71147),
    ),
    "V": (
        (
            (-3.80595, -3.44965, -0.39902, 0.50167),
            (0.56934, -0.22911, 0.73042, 1.07319),
            (0.81061, 0.51059, 0.11899, 0.27195),
        ),
        (-0.16398, 0.63297),
    ),
}
_ALPHA = {
    "H": (
        (
            (-0.14318, 0.29591, 0.32177, -5.37610, 16.1721),
            (1.82442, 0.77564, 0.63773, -0.96230, -3.29980),
            (-0.55187, 0.19822, 0.13164, 1.47828, 3.43990),
        ),
        (0.67849, -1.95537),
    ),
    "V": (
        (
            (-0.07771, 0.56727, -0.20238, -48.2991, 48.5833),
            (2.33840, 0.95545, 1.14520, 0.791669, 0.791459),
            (-0.76284, 0.54039, 0.26809, 0.116226, 0.116479),
        ),
        (-0.053739, 0.83433),
    ),
}
_RAIN_BAND = (1e9, 1000e9)


def rain_attenuation(rain_rate: float, frequency: float, polarization: Literal["V", "H"]) -> float:
    r"""Return the one-way specific attenuation by rain on a horizontal path [dB/km].

    Parameters
    ----------
    rain_rate : float
        [mm/h], >= 0.
    frequency : float
        [Hz], 1e9 to 1000e9.
    polarization : {"V", "H"}

    Raises
    ------
    ParameterRangeError
        If a value is out of range.

    Notes
    -----
    .. math:: \gamma = k R^\alpha, \quad \log_{10} k = \sum_j a_j e^{-((\log_{10} f - b_j) / c_j)^2} + m \log_{10} f + c

    and the same sum for :math:`\alpha`, f in GHz. A path at the elevation e differs by ``cos(e)**2`` in the difference
    between the polarisations, 0.3 % of the attenuation at 20 degrees and 100 mm/h.

    References
    ----------
    .. [1] Recommendation ITU-R P.838-3, "Specific attenuation model for rain for use in prediction methods", 2005.
    """
    if not (rain_rate >= 0.0 and math.isfinite(rain_rate)):
        raise ParameterRangeError("rain_rate", f"{rain_rate} mm/h", "finite and >= 0 mm/h")
    if polarization not in ("V", "H"):
        raise ParameterRangeError("polarization", repr(polarization), "'V' or 'H'")
    require_band(frequency, _RAIN_BAND)
    factor = 10.0 ** _regression(*_LOG_K[polarization], frequency)
    return factor * float(rain_rate) ** _regression(*_ALPHA[polarization], frequency)


def _regression(rows: tuple[tuple[float, ...], ...], line: tuple[float, float], frequency: float) -> float:
    x = math.log10(frequency / 1e9)
    bells = sum(a * math.exp(-(((x - b) / c) ** 2)) for a, b, c in zip(*rows, strict=True))
    return bells + line[0] * x + line[1]


def require_band(frequency: float, band: tuple[float, float]) -> None:
    """Refuse a frequency [Hz] outside of a band [Hz].

    Raises
    ------
    ParameterRangeError
        If it is.
    """
    if not band[0] <= frequency <= band[1]:
        allowed = f"{band[0] / 1e9:g} to {band[1] / 1e9:g} GHz"
        raise ParameterRangeError("frequency", f"{frequency / 1e9:g} GHz", allowed, "the model has no data outside")
