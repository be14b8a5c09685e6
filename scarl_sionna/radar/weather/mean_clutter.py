"""How much power rain and snow send back in the mean, and how far that matters: the radar equation over a volume."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt
from scipy.special import expi

from scarl_sionna.core.settings.radar import RadarSettings
from scarl_sionna.core.specs.radar.array import AntennaArray
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.specs.weather import Weather
from scarl_sionna.core.units import dbm_to_watt
from scarl_sionna.scene.materials.dielectrics import CELSIUS
from scarl_sionna.signal.angle import directions
from scarl_sionna.signal.antenna import two_way_gain
from scarl_sionna.signal.link import radar_gain
from scarl_sionna.signal.noise import angle_cell_noise_power

from .attenuation import weather_attenuation
from .hydrometeors import Hydrometeors, rain, snow

Array = npt.NDArray[np.float64]

GRID_DEG = 1.0
"""Cells of the two-way gain [deg], a direction in each. The integral is the same to 1e-12 for cells of 0.25 to 4 deg
(preset ``awr1843boost``)."""


@dataclass(frozen=True)
class ClutterBudget:
    """What the weather sends back at most, against the noise of a range-Doppler-angle cell.

    Attributes
    ----------
    reflectivity_db : float
        eta [dB, 1 m2/m3].
    reach : float
        Range up to which a cell may hold more than the tolerance allows to leave out [m]; 0: nothing is computed.
    snr_db : tuple of float
        Power of the strongest cell at 5, 10, 20 and 50 m over the noise of one cell [dB].
    """

    reflectivity_db: float
    reach: float
    snr_db: tuple[float, ...]


def falling(weather: Weather, frequency: float) -> list[Hydrometeors]:
    """Return what falls in a weather: rain, snow, both or nothing.

    The droplets of fog send back 50 dB less and are left out. For the sources see :mod:`.hydrometeors` (Mie's series
    over the drop sizes).

    References
    ----------
    .. [1] C. F. Bohren, D. R. Huffman, *Absorption and Scattering of Light by Small Particles*, 1983, chapter 4.
    """
    kelvin = weather.temperature_celsius + CELSIUS
    found = []
    if weather.rain_rate > 0.0:
        found.append(rain(weather.rain_rate, frequency, kelvin, weather.drop_sizes))
    if weather.snow_rate > 0.0:
        found.append(snow(weather.snow_rate, frequency, weather.snow, kelvin))
    return found


@lru_cache(maxsize=16)
def gain_cells(array: AntennaArray, fine: tuple[int, int] = (1, 1)) -> tuple[Array, Array, Array]:
    """Return azimuth and elevation of cells of the sphere [rad], and the two-way gain times their solid angle [sr].

    Shapes (num_azimuth,), (num_elevation,) and (num_azimuth, num_elevation); cells of 1 deg over `fine`.
    """
    steps = [GRID_DEG / number for number in fine]
    azimuth = np.radians(np.arange(-180.0, 180.0 - 1e-9, steps[0]) + steps[0] / 2.0)
    elevation = np.radians(np.arange(-90.0, 90.0 - 1e-9, steps[1]) + steps[1] / 2.0)
    if array.is_uniform:
        gain = 10.0 ** (array.pattern.gain_db(azimuth[:, None], elevation[None]) / 5.0)
    else:
        gain = two_way_gain(array, directions(azimuth[:, None], elevation[None]))
    return azimuth, elevation, gain * np.cos(elevation) * np.radians(steps[0]) * np.radians(steps[1])


def two_way_gain_integral(array: AntennaArray) -> float:
    """Return the integral of the squared power gain over all directions [sr], by definition."""
    return float(gain_cells(array)[2].sum())


def beam_share(radar: RadarSpec) -> float:
    """Return the part of the two-way gain that one beam of the virtual array holds at most, 0 to 1.

    A beam is by definition as wide as the wavelength over the array's extent, in azimuth and in elevation; an array
    without extent does not tell directions apart.
    """
    density = gain_cells(radar.array)[2]
    density = density / density.sum()
    extent = np.ptp((radar.tx_array[:, None] + radar.rx_array[None]).reshape(-1, 3), axis=0)
    share = 1.0
    for axis, marginal in ((1, density.sum(axis=1)), (2, density.sum(axis=0))):
        if extent[axis] > 0.0:
            width = math.degrees(radar.wavelength / float(extent[axis]))
            share *= min(1.0, float(marginal.max()) / GRID_DEG * width)
    return share


def mean_clutter_power(
    radar: RadarSpec, reflectivity: float, near: npt.ArrayLike, far: npt.ArrayLike, attenuation_db_per_km: float = 0.0
) -> Array:
    r"""Return the mean power that one antenna pair receives from a volume between two ranges [W].

    Parameters
    ----------
    radar : RadarSpec
    reflectivity : float
        eta [m2/m3].
    near, far : array_like of float, of shapes that broadcast
        [m], > 0.
    attenuation_db_per_km : float
        One way.

    Returns
    -------
    ndarray of float64, of the shape of both
        [W].

    Notes
    -----
    .. math:: P = \frac{P_t \lambda^2 \eta}{(4 \pi)^3} \int G^2 d\Omega \int_{R_1}^{R_2} \frac{e^{-2 \alpha R}}{R^2} dR

    the radar equation over the volume around the radar; the last integral is that of an exponential integral.

    References
    ----------
    .. [1] M. I. Skolnik, *Introduction to Radar Systems*, 3rd ed., 2001, section 7.6.
    """
    scale = dbm_to_watt(radar.front_end.tx_power_dbm) * float(radar_gain(radar.wavelength, 1.0)) * reflectivity
    near, far = np.asarray(near, dtype=np.float64), np.asarray(far, dtype=np.float64)
    rate = 2.0 * attenuation_db_per_km * math.log(10.0) / 1e4
    integral = 1.0 / near - 1.0 / far
    if rate > 0.0:
        integral = (np.exp(-rate * near) / near + rate * expi(-rate * near)) - (
            np.exp(-rate * far) / far + rate * expi(-rate * far)
        )
    return np.asarray(scale * two_way_gain_integral(radar.array) * integral)


def clutter_budget(
    weather: Weather, radar: RadarSpec, reach: float | None = None, settings: RadarSettings | None = None
) -> ClutterBudget:
    """Return how far the weather's own echoes matter.

    Parameters
    ----------
    weather : Weather
    radar : RadarSpec
    reach : float, optional
        Longest range looked at [m]; the unambiguous range if left out.
    settings : RadarSettings, optional
        Its `accuracy` (the floor) and `weather_echoes`.

    Notes
    -----
    The radar equation over a volume [1]_. The Doppler of a range bin is taken to be spread by turbulence alone, so a
    cell holds less than this. Bins that stay below ``Accuracy.channel_floor_db`` against the noise of one cell of the
    range-Doppler-angle cube are left out.

    References
    ----------
    .. [1] M. I. Skolnik, *Introduction to Radar Systems*, 3rd ed., 2001, section 7.6.
    """
    settings = settings or RadarSettings()
    eta = sum(item.reflectivity for item in falling(weather, radar.center_frequency))
    if eta == 0.0:
        return ClutterBudget(-math.inf, 0.0, ())
    step = radar.range_resolution
    edges = np.maximum(
        np.arange(int(min(reach or math.inf, radar.max_range) / step) + 1) * step, settings.weather_echoes.nearest
    )
    spread = math.sqrt(2.0 * math.pi) * max(weather.turbulence, 1e-6)
    share = min(1.0, radar.velocity_resolution / spread)
    over_noise = share * beam_share(radar) / angle_cell_noise_power(radar)
    loss = weather_attenuation(weather, radar.center_frequency, radar.array.polarization)
    power = mean_clutter_power(radar, eta, edges[:-1], np.maximum(edges[1:], edges[:-1] + 1e-6), loss) * over_noise
    above = np.flatnonzero(power > 10.0 ** (settings.accuracy.channel_floor_db / 10.0))
    middle = np.array([5.0, 10.0, 20.0, 50.0])
    at = mean_clutter_power(radar, eta, middle - step / 2.0, middle + step / 2.0, loss) * over_noise
    return ClutterBudget(
        10.0 * math.log10(eta),
        float(edges[above[-1] + 1]) if above.size else 0.0,
        tuple(round(10.0 * math.log10(value), 1) for value in at),
    )
