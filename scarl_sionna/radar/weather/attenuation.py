"""The air between a radar and what it sees: attenuation by gases, fog, rain and snow at 75 to 82 GHz."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Literal

import numpy as np

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.specs.atmosphere import Atmosphere
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.specs.weather import Weather
from scarl_sionna.core.specs.weather import fog_water_of as liquid_water
from scarl_sionna.radar.antenna import PathGeometry
from scarl_sionna.radar.paths import RadarPaths
from scarl_sionna.scene.materials.dielectrics import CELSIUS, water_permittivity

from .hydrometeors import snow

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

_GAS_FREQUENCY = np.arange(75e9, 82.5e9, 1e9)
_GAS_DB_PER_KM = np.array([0.36244, 0.35373, 0.34794, 0.34441, 0.34263, 0.34228, 0.34308, 0.34484])
"""Line-by-line sum of Recommendation ITU-R P.676-12, Annex 1: 1013 hPa, 15 degrees C, 7.5 g/m3 of water vapour."""

_FOG_BAND = (1e9, 200e9)
FOG_TEMPERATURE = 283.15
"""Default temperature of the droplets of fog [K]."""


def gas_attenuation(frequency: float) -> float:
    """Return the one-way specific attenuation by oxygen and water vapour [dB/km].

    Parameters
    ----------
    frequency : float
        [Hz], 75e9 to 82e9.

    Raises
    ------
    ParameterRangeError
        If the frequency is outside.

    Notes
    -----
    Linear between values at every GHz (steps below 0.01 dB/km) of the line-by-line method, for 1013 hPa, 15 degrees C
    and 7.5 g/m3: near the ground in a moderate climate.

    References
    ----------
    .. [1] Recommendation ITU-R P.676-12, "Attenuation by atmospheric gases and related effects", 2019, Annex 1.
    """
    _require_band(frequency, (float(_GAS_FREQUENCY[0]), float(_GAS_FREQUENCY[-1])))
    return float(np.interp(frequency, _GAS_FREQUENCY, _GAS_DB_PER_KM))


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
    _require_band(frequency, _RAIN_BAND)
    factor = 10.0 ** _regression(*_LOG_K[polarization], frequency)
    return factor * float(rain_rate) ** _regression(*_ALPHA[polarization], frequency)


def _regression(rows: tuple[tuple[float, ...], ...], line: tuple[float, float], frequency: float) -> float:
    x = math.log10(frequency / 1e9)
    bells = sum(a * math.exp(-(((x - b) / c) ** 2)) for a, b, c in zip(*rows, strict=True))
    return bells + line[0] * x + line[1]


def fog_attenuation(water: float, frequency: float, temperature: float = FOG_TEMPERATURE) -> float:
    r"""Return the one-way specific attenuation by fog [dB/km].

    Parameters
    ----------
    water : float
        Liquid water content [g/m3], >= 0, see :func:`liquid_water`.
    frequency : float
        [Hz], 1e9 to 200e9: droplets are then far smaller than the wavelength.
    temperature : float
        Of the droplets [K], 253.15 to 313.15.

    Raises
    ------
    ParameterRangeError
        If a value is out of range.

    Notes
    -----
    .. math:: \gamma = K_l M, \quad K_l = \frac{0.819 f}{\varepsilon'' (1 + \eta^2)}, \quad
        \eta = \frac{2 + \varepsilon'}{\varepsilon''}

    with f in GHz: Rayleigh absorption, the same for both polarisations.

    References
    ----------
    .. [1] Recommendation ITU-R P.840-8, "Attenuation due to clouds and fog", 2019, Annex 1.
    """
    if not (water >= 0.0 and math.isfinite(water)):
        raise ParameterRangeError("water", f"{water} g/m3", "finite and >= 0 g/m3")
    if not CELSIUS - 20.0 <= temperature <= CELSIUS + 40.0:
        raise ParameterRangeError("temperature", f"{temperature} K", "253.15 to 313.15 K", "give kelvin")
    _require_band(frequency, _FOG_BAND)
    permittivity = water_permittivity(frequency, temperature)
    loss = -permittivity.imag
    eta = (2.0 + permittivity.real) / loss
    return 0.819 * frequency / 1e9 / (loss * (1.0 + eta**2)) * water


def specific_attenuation(
    atmosphere: Atmosphere, frequency: float, polarization: Literal["V", "H"], gases: bool = True
) -> float:
    """Return the one-way specific attenuation of gases, fog, rain and snow together [dB/km].

    Parameters
    ----------
    atmosphere : Atmosphere
        Its visibility and rain rate; the ones that the lidar and the camera take.
    frequency : float
        [Hz], 75e9 to 82e9.
    polarization : {"V", "H"}
    gases : bool
        False leaves out oxygen and water vapour.

    Raises
    ------
    ParameterRangeError
        If a value is out of range.

    Notes
    -----
    The sum of its parts: gases (ITU-R P.676), fog (ITU-R P.840), rain (ITU-R P.838), snow (Mie).
    """
    total = gas_attenuation(frequency) if gases else 0.0
    if atmosphere.visibility is not None:
        total += fog_attenuation(liquid_water(atmosphere.visibility), frequency)
    if atmosphere.snow_rate > 0.0:
        total += snow(atmosphere.snow_rate, frequency, atmosphere.snow, CELSIUS).attenuation_db_per_km
    return total + rain_attenuation(atmosphere.rain_rate, frequency, polarization)


def weather_attenuation(weather: Weather, frequency: float, polarization: Literal["V", "H"]) -> float:
    """Return the one-way specific attenuation of a weather [dB/km], of its drops at their own temperature.

    Parameters
    ----------
    weather : Weather
    frequency : float
        [Hz]; 75e9 to 82e9 where the weather has gases.
    polarization : {"V", "H"}

    Raises
    ------
    ParameterRangeError
        If a value is out of range.

    Notes
    -----
    The sum of its parts: gases (ITU-R P.676), fog (ITU-R P.840), rain (ITU-R P.838), snow (Mie).
    """
    kelvin = weather.temperature_celsius + CELSIUS
    total = gas_attenuation(frequency) if weather.gases else 0.0
    if weather.fog_liquid_water > 0.0:
        total += fog_attenuation(weather.fog_liquid_water, frequency, kelvin)
    if weather.rain_rate > 0.0:
        total += rain_attenuation(weather.rain_rate, frequency, polarization)
    if weather.snow_rate > 0.0:
        total += snow(weather.snow_rate, frequency, weather.snow, kelvin).attenuation_db_per_km
    return total


def attenuate_paths(paths: RadarPaths, radar: RadarSpec, atmosphere: Atmosphere, gases: bool = True) -> RadarPaths:
    """Return paths whose amplitudes are lowered by the air along them; the given ones stay as they are.

    Parameters
    ----------
    paths : RadarPaths
    radar : RadarSpec
        Gives the frequency, the middle of its sampled ramp.
    atmosphere : Atmosphere
        Homogeneous along every path.
    gases : bool
        False leaves out oxygen and water vapour.

    Returns
    -------
    RadarPaths
        `diagnostics["attenuation_db_per_km"]` holds the one-way values for V and H.

    Raises
    ------
    ParameterRangeError
        If the frequency is outside of 75 to 82 GHz.

    Notes
    -----
    A path of length L (there and back) loses ``gamma L`` dB. The way out has the transmitted polarisation, the way back
    the received one, so the cross-polar elements take the mean of both.

    *Not modelled*: depolarisation by drops, the refractive index of air (0.3 m in 1 km), wet radomes. Echoes of what
    falls are paths of their own, see :func:`scarl_sionna.radar.weather.clutter.volume_clutter`.
    """
    v, h = (specific_attenuation(atmosphere, radar.center_frequency, name, gases) for name in ("V", "H"))  # type: ignore[arg-type]
    return attenuate(paths, radar, (v, h))


def attenuate(paths: RadarPaths, radar: RadarSpec, values: tuple[float, float]) -> RadarPaths:
    """Return paths lowered by one-way specific attenuations for V and H [dB/km], see :func:`attenuate_paths`.

    By definition a path of length L loses their mean over both ways times L.
    """
    mean = (np.array(values)[:, None] + np.array(values)[None, :]) / 2.0
    length = PathGeometry.of(paths, radar).center_length()
    loss_db = mean * (length / 1e3)[:, None, None]
    report = {"attenuation_db_per_km": {"V": values[0], "H": values[1]}}
    return replace(paths, a=paths.a * 10.0 ** (-loss_db / 20.0), diagnostics={**paths.diagnostics, **report})


def _require_band(frequency: float, band: tuple[float, float]) -> None:
    if not band[0] <= frequency <= band[1]:
        allowed = f"{band[0] / 1e9:g} to {band[1] / 1e9:g} GHz"
        raise ParameterRangeError("frequency", f"{frequency / 1e9:g} GHz", allowed, "the model has no data outside")
