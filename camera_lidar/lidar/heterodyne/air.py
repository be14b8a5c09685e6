"""What fills the air, as a heterodyne receiver meets it: peaks of the spectra over fog, rain, snow and spray.

A cell of the range resolution holds countless drops: its amplitude is circular normal, and over the cells the spectrum
of a chirp is a random process with peaks anywhere. They are drawn here without making the signal.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from camera_lidar.lidar.detections import NO_ECHO
from scarl_sionna.core.specs.lidar.receiver import HeterodyneReceiver
from scarl_sionna.core.specs.lidar.spec import LidarSpec
from scarl_sionna.core.units import SPEED_OF_LIGHT

from .detection import UNIFORM_CELL_CNR, frequency_deviation, peaks_per_cell, threshold
from .link import mean_cnr
from .tones import Tones, fold

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]

_NEWTON_STEPS = 4


@dataclass(frozen=True, eq=False)
class AirPeaks:
    """Places in the air at which the spectrum of one chirp has a peak above the threshold.

    Attributes
    ----------
    shot : ndarray of int64, shape (num_peaks,)
    distance : ndarray of float64, shape (num_peaks,)
        [m].
    radial_velocity : ndarray of float64, shape (num_peaks,)
        Of the drops [m/s].
    cnr : ndarray of float64, shape (num_peaks,)
        Mean carrier-to-noise ratio of the cell.
    """

    shot: Index
    distance: Array
    radial_velocity: Array
    cnr: Array


@dataclass(frozen=True, eq=False)
class AirProfile:
    """Fog, rain and snow along a ray, in cells of the range resolution.

    Attributes
    ----------
    cnr : ndarray of float64, shape (num_cells,)
        Mean carrier-to-noise ratio of each cell.
    peaks : ndarray of float64, shape (num_cells,)
        Mean number of peaks above the threshold that a chirp has up to and with this cell, over those of noise alone.
    """

    cnr: Array
    peaks: Array


@lru_cache(maxsize=16)
def air_profile(spec: LidarSpec) -> AirProfile:
    r"""Return what fog, rain and snow send back, as a function of distance.

    Notes
    -----
    A cell of length :math:`\Delta R = c / 2B` is a volume target: :math:`\rho \cos\theta / \pi` of the lidar equation
    becomes :math:`\beta \Delta R` with the backscatter coefficient of
    :class:`~scarl_sionna.core.specs.atmosphere.Atmosphere`.
    """
    step = spec.range_resolution
    distance = (np.arange(max(int(spec.max_distance / step), 1)) + 0.5) * step
    backscatter = spec.atmosphere.weather_backscatter(spec.wavelength) * step
    intensity = np.pi * backscatter * np.exp(-2.0 * spec.extinction * distance) / distance**2
    cnr = mean_cnr(spec, intensity, distance)
    return AirProfile(cnr, np.cumsum(excess_peaks(spec, cnr)))


def excess_peaks(spec: LidarSpec, cnr: Array) -> Array:
    """Return the mean number of peaks above the threshold of cells [1], over those of noise alone; any shape, kept."""
    receiver = spec.receiver
    assert isinstance(receiver, HeterodyneReceiver)
    level, looks = threshold(spec), receiver.num_looks
    return np.maximum(peaks_per_cell(level / (1.0 + cnr), looks) - peaks_per_cell(level, looks), 0.0)


def weather_peaks(spec: LidarSpec, nearest: Array, air_velocity: Array, rng: np.random.Generator) -> AirPeaks:
    """Return the peaks of one chirp over the weather's fog, rain and snow, before the first surface of each shot.

    Parameters
    ----------
    spec : LidarSpec
    nearest : ndarray of float64, shape (num_shots,)
        Distance of the first surface [m].
    air_velocity : ndarray of float64, shape (num_shots,)
        Radial velocity of the air along each shot [m/s].
    rng : numpy.random.Generator
        What it draws does not depend on the surfaces.

    Notes
    -----
    Their number is taken to be of Poisson's law, with the rates of :func:`excess_peaks`: peaks are rare, or so many
    that only the strongest matter.
    """
    profile = air_profile(spec)
    total = float(profile.peaks[-1])
    shot = np.repeat(np.arange(spec.num_shots), rng.poisson(total, spec.num_shots))
    draws = rng.random((2, shot.size))
    cell = np.minimum(np.searchsorted(profile.peaks, draws[0] * total, side="right"), len(profile.cnr) - 1)
    distance = (cell + draws[1]) * spec.range_resolution
    kept = np.flatnonzero(distance < np.minimum(nearest[shot], spec.max_distance))
    shot = shot[kept]
    return AirPeaks(shot, distance[kept], air_velocity[shot], profile.cnr[cell[kept]])


def air_tones(spec: LidarSpec, peaks: AirPeaks, leads: int, rng: np.random.Generator) -> list[Tones]:
    r"""Return the tones of all chirps that peaks in one chirp stand for.

    Parameters
    ----------
    spec : LidarSpec
    peaks : AirPeaks
    leads : int
        The chirp that has the peaks: 0 up, 1 down. Peaks of the down chirp that are above the threshold in the up chirp
        as well are left out: they are among the up chirp's.
    rng : numpy.random.Generator

    Returns
    -------
    list of Tones
        Of the up and of the down chirp, or of the only one.

    Notes
    -----
    Heights over a threshold follow the rate of peaks, see :func:`peaks_per_cell`. The amplitude of a cell with the mean
    ratio C is x = a + n in the one chirp and y = b + n' in the other. A return that is late by tau has swept a part of
    the band that differs by 2 tau of the chirp's T between the two, so that
    :math:`\langle a b^* \rangle = \rho C, \; \rho = 1 - 2 \tau / T`,
    and given x

    .. math:: y = \frac{\rho C}{1 + C} x + w, \quad \langle |w|^2 \rangle = 1 + C - \frac{(\rho C)^2}{1 + C}

    is noncentral chi-square in power. Its peak lies beside that of x by the Cramer-Rao bound of a tone of the first
    part in the noise w.
    """
    receiver = spec.receiver
    assert isinstance(receiver, HeterodyneReceiver)
    looks, level, cnr = float(receiver.num_looks), threshold(spec), peaks.cnr
    height = (1.0 + cnr) * _peak_over(level / (1.0 + cnr), looks, rng)
    none = np.full(len(cnr), NO_ECHO)
    signs = (1.0, -1.0) if leads == 0 else (-1.0, 1.0)
    slope, shift = 2.0 * spec.chirp_slope / SPEED_OF_LIGHT, 2.0 * peaks.radial_velocity / spec.wavelength
    beat = fold(spec, slope * peaks.distance + signs[0] * shift)
    if receiver.chirps == "up":
        return [Tones(peaks.shot, beat, height, none)]
    alike = np.maximum(1.0 - 4.0 * peaks.distance / (SPEED_OF_LIGHT * spec.chirp_time), 0.0) * cnr
    spread = 1.0 + cnr - alike**2 / (1.0 + cnr)
    carrier = (alike / (1.0 + cnr)) ** 2 * height / spread
    noise = rng.standard_normal((3, len(cnr)))
    other = (np.sqrt(carrier) + noise[0] * np.sqrt(0.5)) ** 2 + noise[1] ** 2 / 2.0
    if looks > 1.0:
        other += rng.standard_gamma(looks - 1.0, len(cnr))
    other *= spread
    both = other > level
    if leads == 1:
        alone = np.flatnonzero(~both)
        nothing = np.zeros(0, dtype=np.int64)
        down = Tones(peaks.shot[alone], beat[alone], height[alone], none[alone])
        return [Tones(peaks.shot[nothing], beat[nothing], height[nothing], nothing), down]
    rows = np.flatnonzero(both)
    beside = noise[2, rows] * frequency_deviation(
        np.maximum(carrier[rows], UNIFORM_CELL_CNR), spec.chirp_time, spec.num_samples
    )
    other_beat = fold(spec, slope * peaks.distance[rows] + signs[1] * (shift[rows] + beside))
    return [Tones(peaks.shot, beat, height, none), Tones(peaks.shot[rows], other_beat, other[rows], none[rows])]


def _peak_over(level: Array, looks: float, rng: np.random.Generator) -> Array:
    """Return heights of peaks above levels, in units of the mean power: where the rate has fallen by a uniform draw."""
    power = looks - 0.5
    start = np.maximum(level, power * (1.0 + 1e-6))
    goal = start - power * np.log(start) - np.log1p(-rng.random(level.shape))
    height = goal + power * np.log(np.maximum(goal, 1.0))
    for _ in range(_NEWTON_STEPS):
        error = height - power * np.log(height) - goal
        height = np.maximum(height - error / (1.0 - power / height), start)
    return height
