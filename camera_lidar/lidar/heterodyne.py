"""The heterodyne receiver by its statistics: speckle, detection, false alarms, estimates.

One row a return, no signal is made.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt
from scipy.special import gammaincc, gammainccinv

from scarl_sionna.core.specs.lidar import LidarSpec
from scarl_sionna.core.specs.lidar_receiver import HeterodyneReceiver
from scarl_sionna.core.units import SPEED_OF_LIGHT

from .detection import (
    UNIFORM_CELL_CNR,
    beat_limits,
    detection_probability,
    frequency_deviation,
    threshold,
)
from .link import mean_cnr, saturated
from .returns import Echoes, join, place_in_group, take

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]

NO_ECHO = -1
"""Echo of a detection that is not from a surface: fog, rain, or noise."""


@dataclass(frozen=True, eq=False)
class Detections:
    """What a receiver reports, by shot and distance.

    Attributes
    ----------
    shot : ndarray of int64, shape (num_detections,)
    echo : ndarray of int64, shape (num_detections,)
        Row of the returns that it comes from, or `NO_ECHO`.
    distance : ndarray of float64, shape (num_detections,)
        Measured [m].
    radial_velocity : ndarray of float64, shape (num_detections,)
        Measured [m/s]; NaN for a single chirp.
    cnr : ndarray of float64, shape (num_detections,)
        Measured carrier-to-noise ratio, linear.
    intensity : ndarray of float64, shape (num_detections,)
        Measured, in the unit of the returns.
    """

    shot: Index
    echo: Index
    distance: Array
    radial_velocity: Array
    cnr: Array
    intensity: Array


def receive_heterodyne(
    spec: LidarSpec,
    returns: Echoes,
    air_velocity: Array,
    rng: np.random.Generator,
) -> Detections:
    """Return what the heterodyne receiver reports of ideal returns.

    Parameters
    ----------
    spec : LidarSpec
        With a :class:`HeterodyneReceiver`.
    returns : Echoes
        By shot and distance, at most `spec.max_returns` a shot.
    air_velocity : ndarray of float64, shape (num_shots,)
        Radial velocity of still air along each shot [m/s].
    rng : numpy.random.Generator
        Every effect has a stream of its own with a fixed number of draws a place for a return, so that what one shot
        meets does not change the noise of another.

    Notes
    -----
    For looks m with speckle e_m (exponential of mean 1, or 1) and circular noise n of unit power, each chirp's peak is
    ``sum_m abs(sqrt(C e_m) + n_m)^2``; it depends on the speckle through its sum alone. Peaks above the threshold in
    all chirps are detections. The measured carrier-to-noise ratio is the mean peak over looks and chirps, less the
    noise's 1: mean C, and with many looks or a high ratio the contrast 1 / sqrt(num_looks) of speckle. Beat frequencies
    have normal errors at the Cramer-Rao bound of the look's own ratio, at most uniform in the resolution cell.

    References
    ----------
    .. [1] J. W. Goodman, "Some effects of target-induced scintillation on optical radar performance", Proc. IEEE
       53(11), 1965.
    """
    receiver = spec.receiver
    assert isinstance(receiver, HeterodyneReceiver)
    seeds = rng.integers(2**63, size=5)
    speckle, peaks, estimates, alarms, weather = (np.random.Generator(np.random.PCG64(int(seed))) for seed in seeds)
    slot = returns.shot * spec.max_returns + place_in_group(returns.shot)
    num_slots = spec.num_shots * spec.max_returns

    mean = mean_cnr(spec, returns.intensity, returns.distance)
    looks = float(receiver.num_looks)
    share = np.full(returns.number, looks)
    if receiver.speckle:
        share = _draw_gamma(speckle, looks, num_slots)[slot]
    carrier = saturated(spec, mean * share / looks) * looks  # summed over looks
    num_chirps = 2 if receiver.chirps == "up_down" else 1
    if receiver.noise:
        level = threshold(spec)
        heights = np.stack([_draw_peak(peaks, carrier, looks, num_slots, slot) for _ in range(num_chirps)])
        kept = np.flatnonzero((heights > level).all(axis=0))
        measured = heights.mean(axis=0) / looks - 1.0
    else:
        kept = np.arange(returns.number)
        measured = carrier / looks
    errors = np.zeros((num_chirps, returns.number))
    if receiver.noise:
        bound = frequency_deviation(np.maximum(carrier, UNIFORM_CELL_CNR), spec.chirp_time, spec.num_samples)
        errors = np.stack([estimates.standard_normal(num_slots)[slot] * bound for _ in range(num_chirps)])
    distance, velocity, valid = estimate(spec, returns.distance, returns.radial_velocity, errors)
    kept = kept[valid[kept]]
    gain = np.divide(measured, mean, out=np.ones_like(mean), where=mean > 0.0)
    found = Detections(
        returns.shot[kept], kept, distance[kept], velocity[kept], measured[kept], (returns.intensity * gain)[kept]
    )
    if receiver.noise:
        found = join([found, _false_alarms(spec, alarms), *_backscatter(spec, returns, air_velocity, weather)])
    return keep_strongest(found, spec.max_returns)


def _draw_gamma(rng: np.random.Generator, shape: float, number: int) -> Array:
    return rng.standard_exponential(number) if shape == 1.0 else rng.standard_gamma(shape, number)


def _draw_peak(rng: np.random.Generator, carrier: Array, looks: float, num_slots: int, slot: Index) -> Array:
    """Return peaks of summed looks: half a noncentral chi-square of 2 * looks degrees, noncentrality 2 * carrier."""
    noise = rng.standard_normal((2, num_slots))[:, slot] * np.sqrt(0.5)
    peak = (np.sqrt(carrier) + noise[0]) ** 2 + noise[1] ** 2
    if looks > 1.0:
        peak += rng.standard_gamma(looks - 1.0, num_slots)[slot]
    return peak


def estimate(
    spec: LidarSpec, distance: Array, velocity: Array, errors: Array
) -> tuple[Array, Array, npt.NDArray[np.bool_]]:
    r"""Return distance and radial velocity from beat frequencies, and whether they are among those searched.

    Parameters
    ----------
    spec : LidarSpec
    distance, velocity : ndarray, shape (num_returns,)
        True ones [m], [m/s].
    errors : ndarray, shape (2, num_returns) or (1, num_returns)
        Of the beat frequencies of the up and the down chirp, or of the only one [Hz].

    Notes
    -----
    With I/Q detection a beat has a sign (transmitted times the conjugate of received, as for the radar):

    .. math::
        f_\uparrow = \frac{2 S R}{c} + \frac{2 v}{\lambda}, \quad
        f_\downarrow = -\frac{2 S R}{c} + \frac{2 v}{\lambda}

    .. math:: R = \frac{c}{4 S} (f_\uparrow - f_\downarrow), \quad v = \frac{\lambda}{4} (f_\uparrow + f_\downarrow)

    A single chirp gives :math:`R + c v / (\lambda S)`: range and velocity are coupled. Frequencies are known up to
    multiples of the sampling frequency and are taken within one from the lowest that is searched.

    References
    ----------
    .. [1] D. G. Pierrottet et al., "Linear FMCW laser radar for precision range and vector velocity measurements", MRS
       Proc. 1076, 2008.
    """
    slope = 2.0 * spec.chirp_slope / SPEED_OF_LIGHT
    shift = 2.0 * velocity / spec.wavelength
    up = fold(spec, slope * distance + shift + errors[0])
    if len(errors) == 1:
        measured = up / slope
        return measured, np.full(measured.shape, np.nan), (measured > 0.0) & (measured <= spec.max_distance)
    down = -fold(spec, slope * distance - shift - errors[1])
    return from_beats(spec, up, down)


def fold(spec: LidarSpec, frequency: Array) -> Array:
    """Return the beats of an up chirp (or the negative ones of a down chirp) as the sampling shows them [Hz].

    Any shape, kept. By definition of sampling: frequencies modulo the sampling frequency.
    """
    receiver = spec.receiver
    assert isinstance(receiver, HeterodyneReceiver)
    low, rate = beat_limits(spec)[0], receiver.sampling_frequency
    return low + np.mod(frequency - low, rate)


def from_beats(spec: LidarSpec, up: Array, down: Array) -> tuple[Array, Array, npt.NDArray[np.bool_]]:
    """Return distance [m] and radial velocity [m/s] of pairs of beats [Hz], and whether they are searched.

    Arrays of any one shape. By definition of the chirps: the exact inverse of the two beat frequencies.
    """
    receiver = spec.receiver
    assert isinstance(receiver, HeterodyneReceiver)
    distance = SPEED_OF_LIGHT / (4.0 * spec.chirp_slope) * (up - down)
    velocity = spec.wavelength / 4.0 * (up + down)
    valid = (distance > 0.0) & (distance <= spec.max_distance) & (np.abs(velocity) <= receiver.max_velocity)
    return distance, velocity, valid


def _false_alarms(spec: LidarSpec, rng: np.random.Generator) -> Detections:
    """Return the peaks of noise alone that pass for a return: at most one a shot, anywhere among what is searched."""
    receiver = spec.receiver
    assert isinstance(receiver, HeterodyneReceiver)
    looks, level = float(receiver.num_looks), threshold(spec)
    shot = np.flatnonzero(rng.random(spec.num_shots) < receiver.false_alarm_probability)
    place, speed, height = rng.random((3, shot.size))
    velocity = (2.0 * speed - 1.0) * receiver.max_velocity
    if receiver.chirps == "up":
        velocity = np.full(shot.size, np.nan)
    peak = gammainccinv(looks, height * gammaincc(looks, level))
    return _without_echo(spec, shot, place * spec.max_distance, velocity, peak / looks - 1.0)


def _backscatter(spec: LidarSpec, returns: Echoes, air_velocity: Array, rng: np.random.Generator) -> list[Detections]:
    """Return the first cell of fog or rain that is detected in each shot, before its first surface."""
    receiver = spec.receiver
    assert isinstance(receiver, HeterodyneReceiver)
    if not receiver.backscatter or spec.atmosphere.weather_extinction(spec.wavelength) == 0.0:
        return []
    looks, level, profile = float(receiver.num_looks), threshold(spec), backscatter_profile(spec)
    draws = rng.random((3, spec.num_shots))
    first = np.full(spec.num_shots, spec.max_distance)
    np.minimum.at(first, returns.shot, returns.distance)
    cell, cells = np.searchsorted(profile.detected_before, draws[0], side="right"), len(profile.cnr)
    place = (np.minimum(cell, cells - 1) + draws[1]) * spec.range_resolution
    shot = np.flatnonzero((cell < cells) & (place < first))
    strength = 1.0 + profile.cnr[cell[shot]]
    peak = strength * gammainccinv(looks, draws[2, shot] * gammaincc(looks, level / strength))
    errors = np.zeros((2 if receiver.chirps == "up_down" else 1, shot.size))
    distance, velocity, valid = estimate(spec, place[shot], air_velocity[shot], errors)
    return [take(_without_echo(spec, shot, distance, velocity, peak / looks - 1.0), np.flatnonzero(valid))]


def _without_echo(spec: LidarSpec, shot: Index, distance: Array, velocity: Array, cnr: Array) -> Detections:
    unit = mean_cnr(spec, 1.0 / np.maximum(distance, 1e-3) ** 2, distance)  # of a white diffuser at this distance
    intensity = cnr / unit / np.maximum(distance, 1e-3) ** 2
    return Detections(shot, np.full(shot.size, NO_ECHO), distance, velocity, cnr, intensity)


@dataclass(frozen=True, eq=False)
class BackscatterProfile:
    """Fog and rain along a ray, in cells of the range resolution.

    Attributes
    ----------
    cnr : ndarray of float64, shape (num_cells,)
        Mean carrier-to-noise ratio of each cell.
    detected_before : ndarray of float64, shape (num_cells,)
        Probability that one of the cells up to and with this one is detected, above what noise alone would be.
    """

    cnr: Array
    detected_before: Array


@lru_cache(maxsize=16)
def backscatter_profile(spec: LidarSpec) -> BackscatterProfile:
    r"""Return what fog and rain send back, as a function of distance.

    Notes
    -----
    A cell of length :math:`\Delta R = c / 2B` is a volume target: :math:`\rho \cos\theta / \pi` of the lidar equation
    becomes :math:`\beta \Delta R` with the backscatter coefficient of :class:`Atmosphere`. Its droplets are many: fully
    developed speckle, independent from cell to cell.
    """
    receiver = spec.receiver
    assert isinstance(receiver, HeterodyneReceiver)
    step = spec.range_resolution
    distance = (np.arange(max(int(spec.max_distance / step), 1)) + 0.5) * step
    backscatter = spec.atmosphere.weather_backscatter(spec.wavelength) * step
    intensity = np.pi * backscatter * np.exp(-2.0 * spec.extinction * distance) / distance**2
    cnr = mean_cnr(spec, intensity, distance)
    chirps = 2 if receiver.chirps == "up_down" else 1
    level = threshold(spec)
    grid = np.geomspace(1e-3, max(cnr.max(), 1e-2), 200)
    on_grid = detection_probability(grid, level, receiver.num_looks, True, chirps)
    noise_alone = gammaincc(receiver.num_looks, level) ** chirps
    detected = np.clip(np.interp(cnr, grid, on_grid, left=noise_alone) - noise_alone, 0.0, 1.0 - 1e-12)
    return BackscatterProfile(cnr, -np.expm1(np.cumsum(np.log1p(-detected))))


def keep_strongest(found: Detections, number: int) -> Detections:
    """Return the `number` strongest detections of each shot, by shot and distance."""
    order = np.argsort(found.shot, kind="stable")  # fast: all but a few are in order
    shot = found.shot[order]
    equal = np.flatnonzero(np.diff(shot) == 0)
    if equal.size == 0:
        return take(found, order)
    shared = np.zeros(order.size, dtype=bool)
    shared[equal] = shared[equal + 1] = True
    rows = order[shared]
    rows = rows[np.lexsort((-found.cnr[rows], found.shot[rows]))]
    rows = rows[place_in_group(found.shot[rows]) < number]
    kept = np.concatenate([order[~shared], rows])
    return take(found, kept[np.lexsort((found.distance[kept], found.shot[kept]))])
