"""Drops and flakes at millimetre waves.

How many there are of each size, what they send back and take, how fast they fall.

Rayleigh's law does not hold at 77 GHz, where a drop is as large as the wavelength: cross-sections are those of the Mie
series.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.specs.drop_sizes import (
    P838_SLOPE,
    RAIN_POWER,
    RAIN_SIZES,
    SNOW_FALL_SPEED,
    SNOW_SIZES,
    SNOW_SOLID,
    DropSizes,
    terminal_speed,
)
from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.scene.materials.dielectrics import CELSIUS, ice_permittivity, refractive_mixture, water_permittivity

from .itu_rain import rain_attenuation
from .mie import mie_efficiencies

Array = npt.NDArray[np.float64]

LARGEST_DROP = 8e-3
"""Diameter to which the distribution of drops goes [m]; larger ones break up."""
LARGEST_FLAKE = 6e-3
"""Melted diameter to which the distribution of flakes goes [m]."""
WET_SNOW_WATER = 0.1
"""Share of a wet flake's ice and water that is water."""
_BOTH: tuple[Literal["V", "H"], ...] = ("V", "H")
_STEPS = 400
_WATER = 1e6
"""Density of water [g/m3]."""


@dataclass(frozen=True, eq=False)
class Hydrometeors:
    """A volume full of drops or flakes, as a radar at one frequency meets it.

    Attributes
    ----------
    reflectivity : float
        eta, monostatic radar cross-section in a volume [m2/m3].
    extinction : float
        One-way power extinction coefficient [1/m].
    water_content : float
        [g/m3].
    fall_speed : ndarray of float64, shape (num_sizes,)
        Of each size [m/s].
    backscatter_share : ndarray of float64, shape (num_sizes,)
        Part of the reflectivity that each size makes; they sum to 1.
    """

    reflectivity: float
    extinction: float
    water_content: float
    fall_speed: Array
    backscatter_share: Array

    @property
    def attenuation_db_per_km(self) -> float:
        """One-way specific attenuation [dB/km]."""
        return self.extinction * 1e4 / math.log(10.0)

    @property
    def mean_fall_speed(self) -> float:
        """Mean speed of fall, weighted with what each size sends back [m/s]."""
        return float(self.fall_speed @ self.backscatter_share)

    def draw_fall_speeds(self, number: int, rng: np.random.Generator) -> Array:
        """Return speeds of fall [m/s] of random scatterers, drawn by the power they send back, shape (number,)."""
        edges = np.cumsum(self.backscatter_share)
        return np.interp(rng.random(number) * edges[-1], np.concatenate([[0.0], edges]), self._speed_edges)

    def fall_classes(self, number: int) -> tuple[Array, Array]:
        """Return the mean speed of fall [m/s] of classes of drops that send back the same power, and their shares.

        Shapes (number,); the shares sum to 1, and the mean over classes is `mean_fall_speed`.
        """
        edges = np.concatenate([[0.0], np.cumsum(self.backscatter_share)])
        moment = np.concatenate([[0.0], np.cumsum(self.backscatter_share * self.fall_speed)])
        at = np.linspace(0.0, edges[-1], number + 1)
        return np.diff(np.interp(at, edges, moment)) * number / edges[-1], np.full(number, 1.0 / number)

    @property
    def _speed_edges(self) -> Array:
        middle = (self.fall_speed[1:] + self.fall_speed[:-1]) / 2.0
        return np.concatenate([self.fall_speed[:1], middle, self.fall_speed[-1:]])


@lru_cache(maxsize=64)
def rain(rain_rate: float, frequency: float, temperature: float, sizes: DropSizes = "marshall_palmer") -> Hydrometeors:
    r"""Return rain: exponential distribution of spheres of water.

    Parameters
    ----------
    rain_rate : float
        [mm/h], > 0.
    frequency : float
        [Hz].
    temperature : float
        Of the drops [K].
    sizes : str
        Distribution of the drops: one of `RAIN_SIZES`, or ``"p838"``.

    Raises
    ------
    ParameterRangeError
        If a value is out of range.

    Notes
    -----
    .. math:: N(D) = N_0 e^{-\Lambda D}, \quad \Lambda = \Lambda_1 R^{-0.21}, \quad
        \eta = \int \sigma_b(D) N(D) \, dD

    ``"p838"`` has the slope of Marshall and Palmer and the N_0 with which it attenuates as Recommendation ITU-R P.838
    says, in the mean of V and H: what is measured on links, and an echo that belongs to it. The water that it brings
    down is 0.8 to 1.25 times the rate at 77 GHz and 1 to 100 mm/h (Marshall and Palmer's own: 1.03 to 1.18 times).

    *Error*: real drops are flattened (VV and HH differ by about 1 dB at 50 mm/h), and measured distributions of one
    rain rate differ by several dB in eta: compare those of `sizes`.
    """
    if sizes != "p838" and sizes not in RAIN_SIZES:
        raise ParameterRangeError("sizes", repr(sizes), ", ".join(["p838", *RAIN_SIZES]))
    _positive("rain_rate", rain_rate, "mm/h")
    number, slope = RAIN_SIZES.get(sizes, (1.0, P838_SLOPE))
    diameter, step = _grid(LARGEST_DROP)
    density = number * np.exp(-slope * rain_rate**RAIN_POWER * diameter) * step
    permittivity = water_permittivity(frequency, temperature)
    if sizes == "p838":
        stated = 0.5 * sum(rain_attenuation(rain_rate, frequency, name) for name in _BOTH)
        unit = _cloud(diameter, density, diameter, permittivity, frequency, terminal_speed(diameter))
        density *= stated / unit.attenuation_db_per_km
    return _cloud(diameter, density, diameter, permittivity, frequency, terminal_speed(diameter))


@lru_cache(maxsize=64)
def spray(water_content: float, median_diameter: float, frequency: float, temperature: float) -> Hydrometeors:
    """Return spray: an exponential distribution of drops of a water content [g/m3] and a median volume diameter [m].

    Its slope is 3.67 over the median volume diameter (half of the water is in larger drops).
    """
    _positive("water_content", water_content, "g/m3")
    _positive("median_diameter", median_diameter, "m")
    slope = 3.67 / median_diameter
    diameter, step = _grid(10.0 * median_diameter)
    weight = np.exp(-slope * diameter) * step
    weight *= water_content / (np.pi / 6.0 * _WATER * float(np.sum(weight * diameter**3)))
    permittivity = water_permittivity(frequency, temperature)
    return _cloud(diameter, weight, diameter, permittivity, frequency, terminal_speed(diameter))


@lru_cache(maxsize=64)
def snow(snow_rate: float, frequency: float, kind: Literal["dry", "wet"], temperature: float) -> Hydrometeors:
    r"""Return falling snow: flakes as spheres of ice, air and, if wet, water.

    Parameters
    ----------
    snow_rate : float
        As melted water [mm/h], > 0.
    frequency : float
        [Hz].
    kind : {"dry", "wet"}
        Wet flakes hold 10 % of liquid water and are denser.
    temperature : float
        [K], up to 0 degrees Celsius is used for ice.

    Raises
    ------
    ParameterRangeError
        If a value is out of range.

    Notes
    -----
    Recommendation ITU-R P.838 does not cover snow. The sizes are those of Sekhon and Srivastava over the melted
    diameter; the flake is a sphere of the same mass whose ice and water fill the share 0.2 (dry) or 0.4 (wet) of its
    volume, with the mean refractive index of its parts. Flakes are no spheres: backscatter of dry snow is right within
    about 5 dB up to 2 mm/h.
    """
    if kind not in SNOW_SOLID:
        raise ParameterRangeError("kind", repr(kind), "'dry' or 'wet'")
    _positive("snow_rate", snow_rate, "mm/h")
    number, number_power, slope, slope_power = SNOW_SIZES
    melted, step = _grid(LARGEST_FLAKE)
    density = number * snow_rate**number_power * np.exp(-slope * snow_rate**slope_power * melted)
    liquid = WET_SNOW_WATER if kind == "wet" else 0.0
    solid = SNOW_SOLID[kind]
    mass_density = solid * ((1.0 - liquid) * 0.917 + liquid)
    ice = ice_permittivity(frequency, min(temperature, CELSIUS))
    parts = [(solid * (1.0 - liquid), ice), (solid * liquid, water_permittivity(frequency, CELSIUS))]
    diameter = melted * mass_density ** (-1.0 / 3.0)
    fall = np.full(len(melted), SNOW_FALL_SPEED)
    return _cloud(melted, density * step, diameter, refractive_mixture(parts), frequency, fall)


def _grid(largest: float) -> tuple[Array, float]:
    step = largest / _STEPS
    return np.asarray((np.arange(_STEPS) + 0.5) * step, dtype=np.float64), step


def _cloud(
    melted: Array, number: Array, diameter: Array, permittivity: complex, frequency: float, fall: Array
) -> Hydrometeors:
    """Return the sums over sizes.

    `number` [1/m3] spheres of each `diameter`, which hold the water of `melted` diameters.
    """
    extinction, _, backscatter = mie_efficiencies(permittivity, np.pi * diameter * frequency / SPEED_OF_LIGHT)
    disc = np.pi / 4.0 * diameter**2
    echoes = number * disc * backscatter
    return Hydrometeors(
        reflectivity=float(echoes.sum()),
        extinction=float(np.sum(number * disc * extinction)),
        water_content=float(np.sum(number * np.pi / 6.0 * melted**3)) * _WATER,
        fall_speed=fall,
        backscatter_share=echoes / echoes.sum(),
    )


def _positive(name: str, value: float, unit: str) -> None:
    if not (value > 0.0 and math.isfinite(value)):
        raise ParameterRangeError(name, f"{value} {unit}", f"> 0 {unit}")
