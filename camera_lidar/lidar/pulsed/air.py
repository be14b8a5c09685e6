"""What fog, rain, snow and spray send back to a pulsed receiver: photoelectrons a sample, before pulse and filter."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from camera_lidar.lidar.beam import beam_radius
from camera_lidar.lidar.spray import CloudCells, FreePaths, cloud_cells
from scarl_sionna.core.specs.atmosphere import Atmosphere
from scarl_sionna.core.specs.drop_sizes import RAIN_POWER, RAIN_SIZES, SNOW_SIZES
from scarl_sionna.core.specs.lidar.spec import LidarSpec
from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.engine.spray import SprayCloud

from .link import photoelectrons, pulsed

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]

_WINGS = 6.0
"""Drops are looked for out to where the beam has fallen by exp(-6)."""
_WEIGHT_VARIANCE = 3.0 * _WINGS - 1.0
"""Variance of a drop's light over its squared mean: 24 / 2^2 of the squared diameters, half of `_WINGS` of the beam."""
_ONE_BY_ONE = 2.0
"""Cells with fewer drops than this in the mean are drawn drop by drop, the others by mean and variance."""


def sample_step(spec: LidarSpec) -> float:
    """Return the distance between two samples of the waveform [m]."""
    return SPEED_OF_LIGHT / (2.0 * pulsed(spec).sampling_frequency)


@dataclass(frozen=True, eq=False)
class Falling:
    """Drops or flakes that are so few in the beam that they come one by one.

    Attributes
    ----------
    electrons : ndarray of float64, shape (num_samples,)
        Mean photoelectrons of one pulse from each cell.
    number : ndarray of float64, shape (num_samples,)
        Mean number of them in the beam in each cell.
    """

    electrons: Array
    number: Array


@lru_cache(maxsize=16)
def fog_profile(spec: LidarSpec) -> Array:
    r"""Return the photoelectrons of one pulse that fog sends back, shape (num_samples,).

    Sample k is the cell around the distance of :math:`c k / 2 f_s`.

    Notes
    -----
    A cell of the length :math:`\Delta R` is a volume target: :math:`\rho \cos\theta / \pi` of the lidar equation
    becomes :math:`\beta \Delta R` with the backscatter coefficient of
    :class:`~scarl_sionna.core.specs.atmosphere.Atmosphere`. It has no speckle: droplets over the depth of a pulse and
    over the lens are far more than cells of speckle. *Validity*: single scattering.
    """
    return _profile(spec, spec.atmosphere.with_(rain_rate=0.0, snow_rate=0.0))


@lru_cache(maxsize=16)
def falling_profiles(spec: LidarSpec) -> tuple[Falling, ...]:
    r"""Return what rain and snow send back, as drops that are counted.

    Notes
    -----
    The mean is that of a homogeneous air, as of :func:`fog_profile`. Of N drops a volume a cell holds
    :math:`n = N \frac{\pi}{2} w(R)^2 G \Delta R` within the radius at which a Gaussian beam has fallen by
    :math:`e^{-G}`; N is :math:`N_0 / \Lambda` of an exponential distribution of diameters.

    References
    ----------
    .. [1] J. S. Marshall, W. M. Palmer, "The distribution of raindrops with size", J. Meteorol. 5, 1948.
    .. [2] R. S. Sekhon, R. C. Srivastava, "Snow size spectra and radar reflectivity", J. Atmos. Sci. 27(2), 1970.
    """
    air, found = spec.atmosphere, []
    distance = _cells(spec)
    volume = np.pi / 2.0 * beam_radius(spec, distance) ** 2 * _WINGS * sample_step(spec)
    if air.rain_rate > 0.0:
        many, slope = RAIN_SIZES["marshall_palmer"]
        density = many / (slope * air.rain_rate**RAIN_POWER)
        rain = _profile(spec, air.with_(visibility=None, snow_rate=0.0))
        found.append(Falling(rain, density * volume))
    if air.snow_rate > 0.0:
        many, many_power, slope, slope_power = SNOW_SIZES
        density = many * air.snow_rate**many_power / (slope * air.snow_rate**slope_power)
        snow = _profile(spec, air.with_(visibility=None, rain_rate=0.0))
        found.append(Falling(snow, density * volume))
    return tuple(found)


def mean_profile(spec: LidarSpec) -> Array:
    """Return the mean photoelectrons of one pulse from fog, rain and snow, shape (num_samples,)."""
    return np.sum([fog_profile(spec), *(some.electrons for some in falling_profiles(spec))], axis=0)


def _cells(spec: LidarSpec) -> Array:
    """Return the middles of the samples' cells [m], shape (num_samples,); the first is a quarter of a step."""
    step = sample_step(spec)
    return np.maximum(np.arange(spec.num_samples) * step, step / 4.0)


def _profile(spec: LidarSpec, air: Atmosphere) -> Array:
    step, place = sample_step(spec), _cells(spec)
    backscatter = air.weather_backscatter(spec.wavelength) * step
    intensity = np.pi * backscatter * np.exp(-2.0 * spec.extinction * place) / place**2
    profile = np.where(place <= spec.max_distance, photoelectrons(spec, intensity, place), 0.0)
    profile.setflags(write=False)
    return profile


def spray_cells(spec: LidarSpec, clouds: Sequence[SprayCloud], paths: FreePaths) -> tuple[CloudCells, ...]:
    """Return clouds of spray in cells of the waveform's samples; none where the receiver does not see the air."""
    if not pulsed(spec).backscatter:
        return ()
    return tuple(cloud_cells(spec, cloud, paths, sample_step(spec)) for cloud in clouds)


def air_electrons(
    spec: LidarSpec,
    shots: Index,
    nearest: Array,
    spray: Sequence[CloudCells],
    num_samples: int,
    rng: np.random.Generator,
) -> Array:
    r"""Return the photoelectrons a sample that the air before the first surface sends back, one pulse.

    Parameters
    ----------
    spec : LidarSpec
    shots : ndarray of int64, shape (num_shots,)
        Rising.
    nearest : ndarray of float64, shape (num_shots,)
        Distance of the first surface of each [m].
    spray : sequence of CloudCells
        See :func:`spray_cells`.
    num_samples : int
        From the first on.
    rng : numpy.random.Generator
        Drops and flakes in the beam.

    Returns
    -------
    ndarray of float64, shape (num_shots, num_samples)

    Notes
    -----
    The number of drops of a cell follows Poisson's law. The light of each goes with its area, of an exponentially
    distributed diameter, and with the beam's intensity :math:`e^{-G u}` at its place, u uniform. Where many are in a
    cell their sum is drawn as Gamma of the same mean and variance. Fog and spray are the same in every shot.
    """
    if not pulsed(spec).backscatter:
        return np.zeros((len(shots), num_samples))
    before = np.arange(num_samples) * sample_step(spec) < nearest[:, None]
    electrons = np.where(before, fog_profile(spec)[:num_samples], 0.0)
    for falling in falling_profiles(spec):
        light = _light_of_drops(falling.number[:num_samples], len(shots), rng)
        electrons += np.where(before, falling.electrons[:num_samples] * light, 0.0)
    for cells in spray:
        row = np.searchsorted(shots, cells.shot)
        mine = np.flatnonzero((row < len(shots)) & (shots[np.minimum(row, len(shots) - 1)] == cells.shot))
        place = np.round(cells.distance[mine] / sample_step(spec)).astype(np.int64)
        of_cell = photoelectrons(spec, cells.intensity[mine], cells.distance[mine])
        inside = place < num_samples
        rows = np.broadcast_to(row[mine][:, None], place.shape)
        np.add.at(electrons, (rows[inside], place[inside]), of_cell[inside])
    return electrons


def _light_of_drops(number: Array, num_shots: int, rng: np.random.Generator) -> Array:
    """Return the light of the drops in each cell over its mean, shape (num_shots, num_samples), from mean numbers."""
    drops = rng.poisson(number, (num_shots, len(number)))
    light = np.zeros(drops.shape)
    few = number < _ONE_BY_ONE
    many = np.flatnonzero(~few)
    light[:, many] = _WEIGHT_VARIANCE * rng.standard_gamma(drops[:, many] / _WEIGHT_VARIANCE)
    shot, cell = np.nonzero(drops * few)
    cells = np.repeat(shot * len(number) + cell, drops[shot, cell])
    size = rng.standard_exponential(len(cells)) ** 2 / 2.0
    weight = size * _WINGS * np.exp(-_WINGS * rng.random(len(cells)))
    light += np.bincount(cells, weight, light.size).reshape(light.shape)
    return light / number
