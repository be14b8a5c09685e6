"""The heterodyne receiver by its statistics: speckle, detection, false alarms, estimates.

One row a return, no signal is made.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from scipy.special import gammaincc, gammainccinv

from camera_lidar.lidar.detections import NO_ECHO, Detections, keep_strongest
from camera_lidar.lidar.returns import Echoes, join, nearest_of, place_in_group
from scarl_sionna.core.specs.lidar.receiver import HeterodyneReceiver
from scarl_sionna.core.specs.lidar.spec import LidarSpec
from scarl_sionna.core.units import SPEED_OF_LIGHT

from .air import AirPeaks, air_tones, weather_peaks
from .detection import (
    UNIFORM_CELL_CNR,
    beat_limits,
    frequency_deviation,
    num_cells,
    peaks_per_cell,
    threshold,
)
from .link import mean_cnr, saturated
from .tones import Tones, fold, from_beats, paired, single

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]


def receive_heterodyne(
    spec: LidarSpec,
    returns: Echoes,
    air_velocity: Array,
    rng: np.random.Generator,
    spray: Sequence[AirPeaks] = (),
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
    spray : sequence of AirPeaks
        More that is in the air, of one chirp each: up chirp, down chirp, up chirp, ...

    Notes
    -----
    For looks m with speckle e_m (exponential of mean 1, or 1) and circular noise n of unit power, each chirp's peak is
    ``sum_m abs(sqrt(C e_m) + n_m)^2``; it depends on the speckle through its sum alone. Peaks above the threshold,
    those of the air and of noise alone among them, are tones, which :func:`.tones.paired` makes
    returns of. The measured carrier-to-noise ratio is the mean peak over looks and chirps, less the noise's 1: mean C,
    and with many looks or a high ratio the contrast 1 / sqrt(num_looks) of speckle. Beat frequencies have normal errors
    at the Cramer-Rao bound of the look's own ratio, at most uniform in the resolution cell.

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
    if not receiver.noise:
        return _without_noise(spec, returns, carrier, mean)
    level = threshold(spec)
    bound = frequency_deviation(np.maximum(carrier, UNIFORM_CELL_CNR), spec.chirp_time, spec.num_samples)
    tones: list[list[Tones]] = []
    for chirp in range(num_chirps):
        height = _draw_peak(peaks, carrier, looks, num_slots, slot)
        error = estimates.standard_normal(num_slots)[slot] * bound
        kept = np.flatnonzero(height > level)
        beat = _beats(spec, returns.distance[kept], returns.radial_velocity[kept], error[kept], chirp)
        tones.append([Tones(returns.shot[kept], beat, height[kept], kept), _noise_tones(spec, alarms)])
    for number, some in enumerate([*_weather(spec, returns, air_velocity, weather), *spray]):
        for chirp, tone in enumerate(air_tones(spec, some, number % num_chirps, weather)):
            tones[chirp].append(tone)
    joined = [join(some) for some in tones]
    found = paired(spec, *joined) if num_chirps == 2 else single(spec, joined[0])
    surface = found.echo != NO_ECHO
    echo = found.echo[surface]
    gain = np.divide(found.cnr[surface], mean[echo], out=np.ones(len(echo)), where=mean[echo] > 0.0)
    found.intensity[surface] = returns.intensity[echo] * gain
    return keep_strongest(found, spec.max_returns)


def _without_noise(spec: LidarSpec, returns: Echoes, carrier: Array, mean: Array) -> Detections:
    receiver = spec.receiver
    assert isinstance(receiver, HeterodyneReceiver)
    nothing = np.zeros((2 if receiver.chirps == "up_down" else 1, returns.number))
    distance, velocity, valid = estimate(spec, returns.distance, returns.radial_velocity, nothing)
    kept, cnr = np.flatnonzero(valid), carrier / receiver.num_looks
    gain = np.divide(cnr, mean, out=np.ones_like(mean), where=mean > 0.0)
    found = Detections(
        returns.shot[kept], kept, distance[kept], velocity[kept], cnr[kept], (returns.intensity * gain)[kept]
    )
    return keep_strongest(found, spec.max_returns)


def _weather(spec: LidarSpec, returns: Echoes, air_velocity: Array, rng: np.random.Generator) -> list[AirPeaks]:
    """Return the peaks of fog, rain and snow in the up and in the down chirp."""
    receiver = spec.receiver
    assert isinstance(receiver, HeterodyneReceiver)
    if not receiver.backscatter or spec.atmosphere.weather_extinction(spec.wavelength) == 0.0:
        return []
    nearest = nearest_of(spec.num_shots, returns.shot, returns.distance)
    number = 2 if receiver.chirps == "up_down" else 1
    return [weather_peaks(spec, nearest, air_velocity, rng) for _ in range(number)]


def _noise_tones(spec: LidarSpec, rng: np.random.Generator) -> Tones:
    """Return the peaks of noise alone in one chirp: the highest of each shot, anywhere in the band of beats."""
    receiver = spec.receiver
    assert isinstance(receiver, HeterodyneReceiver)
    level, looks = threshold(spec), receiver.num_looks
    low, high = beat_limits(spec)
    high = min(high, low + receiver.sampling_frequency)
    chance = -math.expm1(-float(peaks_per_cell(level, looks)) * num_cells(spec))
    shot = np.flatnonzero(rng.random(spec.num_shots) < chance)
    place, height = rng.random((2, shot.size))
    peak = gammainccinv(looks, height * gammaincc(looks, level))
    return Tones(shot, low + place * (high - low), peak, np.full(shot.size, NO_ECHO))


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
    up = _beats(spec, distance, velocity, errors[0], 0)
    if len(errors) == 1:
        measured = up * SPEED_OF_LIGHT / (2.0 * spec.chirp_slope)
        return measured, np.full(measured.shape, np.nan), (measured > 0.0) & (measured <= spec.max_distance)
    return from_beats(spec, up, -_beats(spec, distance, velocity, errors[1], 1))


def _beats(spec: LidarSpec, distance: Array, velocity: Array, error: Array, chirp: int) -> Array:
    """Return the beats of the up chirp, 0, or the negative ones of the down chirp, 1, as the sampling shows them."""
    sign = 1.0 if chirp == 0 else -1.0
    shift = 2.0 * velocity / spec.wavelength + error
    return fold(spec, 2.0 * spec.chirp_slope / SPEED_OF_LIGHT * distance + sign * shift)
