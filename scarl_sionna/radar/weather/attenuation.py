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

from .gases import gas_attenuation
from .hydrometeors import rain, snow
from .itu_rain import rain_attenuation, require_band

__all__ = [
    "FOG_TEMPERATURE",
    "attenuate",
    "attenuate_paths",
    "fog_attenuation",
    "gas_attenuation",
    "liquid_water",
    "rain_attenuation",
    "specific_attenuation",
    "weather_attenuation",
]

_FOG_BAND = (1e9, 200e9)
FOG_TEMPERATURE = 283.15
"""Default temperature of the droplets of fog [K]."""


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
    require_band(frequency, _FOG_BAND)
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
    The sum of its parts: gases (ITU-R P.676) at its temperature and humidity, fog (ITU-R P.840), rain and snow
    (Mie's series over the drop sizes that also send back the echo). V and H differ in rain as in ITU-R P.838.
    """
    kelvin = weather.temperature_celsius + CELSIUS
    total = gas_attenuation(frequency, kelvin, weather.vapour_density) if weather.gases else 0.0
    if weather.fog_liquid_water > 0.0:
        total += fog_attenuation(weather.fog_liquid_water, frequency, kelvin)
    if weather.rain_rate > 0.0:
        vertical, horizontal = (rain_attenuation(weather.rain_rate, frequency, name) for name in ("V", "H"))
        flat = {"V": vertical, "H": horizontal}[polarization] / (0.5 * (vertical + horizontal))
        total += flat * rain(weather.rain_rate, frequency, kelvin, weather.drop_sizes).attenuation_db_per_km
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
    return replace(paths.scaled(10.0 ** (-loss_db / 20.0)), diagnostics={**paths.diagnostics, **report})
