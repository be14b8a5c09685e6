"""Waveforms of a pulsed receiver, and the search for pulses in them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt
from scipy.fft import irfft, next_fast_len, rfft, rfftfreq
from scipy.special import ndtr

from camera_lidar.lidar.detections import NO_ECHO, Detections, match
from camera_lidar.lidar.returns import Echoes, join, nearest_of, take
from camera_lidar.lidar.spray import CloudCells
from scarl_sionna.core.specs.lidar.spec import LidarSpec
from scarl_sionna.core.units import SPEED_OF_LIGHT

from .air import air_electrons, sample_step
from .detection import EDGE, level_of, noise_deviation
from .link import excess_noise_factor, full_scale, photoelectrons, pulse_spread, pulsed, speckle_cells

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]
Waveform = npt.NDArray[np.float32]

SAMPLES_AT_ONCE = 1 << 21
"""Samples that are worked on at once: 16 MB each temporary array."""
_SAMPLE = 1.0 / math.sqrt(12.0)
"""Standard deviation of the time within a sample, which widens a pulse [samples]."""


def synthesize_waveforms(
    spec: LidarSpec,
    echoes: Echoes,
    density: Array,
    rng: np.random.Generator,
    spray: Sequence[CloudCells] = (),
) -> Waveform:
    r"""Return the filtered waveforms of all shots.

    Parameters
    ----------
    spec : LidarSpec
        With a pulsed receiver.
    echoes : Echoes
        Every ray and surface on its own, by shot.
    density : ndarray of float64, shape (num_shots,)
        Of the noise, see :func:`~camera_lidar.lidar.pulsed.link.noise_density`.
    rng : numpy.random.Generator
        Speckle and noise.
    spray : sequence of CloudCells

    Returns
    -------
    ndarray of float32, shape (num_shots, num_samples)
        Photoelectrons of the pulse's peak; the first sample is the pulse's departure.

    Notes
    -----
    Sample k of the detector has the mean :math:`n_k`, echoes as Gaussians (:func:`.link.pulse_spread`) and the air
    convolved with the pulse, and the variance :math:`(F n_k + S / f_s) / P`, normal: in the mean over the filter's time
    tens of photoelectrons or the amplifier's noise make it so. The filter is Gaussian, the output clips at full scale.
    """
    receiver = pulsed(spec)
    nearest = nearest_of(spec.num_shots, echoes.shot, echoes.distance)
    gain = np.ones(echoes.number)
    speckle, noise, drops = rng.spawn(3)
    if receiver.speckle:
        cells = speckle_cells(spec, echoes.distance) / spec.sub_rays  # the rays of a spot sum to its cells
        gain = speckle.standard_gamma(cells) / cells
    electrons = gain * photoelectrons(spec, echoes.intensity, echoes.distance)
    spread = pulse_spread(spec, echoes.cos_incidence, echoes.distance, spec.sub_rays)
    waveform = np.empty((spec.num_shots, spec.num_samples), dtype=np.float32)
    step = max(SAMPLES_AT_ONCE // spec.num_samples, 1)
    for first in range(0, spec.num_shots, step):
        shots = np.arange(first, min(first + step, spec.num_shots))
        start, stop = np.searchsorted(echoes.shot, (shots[0], shots[-1] + 1))
        mean = convolved(
            spec,
            air_electrons(spec, shots, nearest[shots], spray, spec.num_samples, drops),
            receiver.pulse_deviation,
        )
        rows = slice(start, stop)
        _add_pulses(spec, mean, echoes.shot[rows] - first, echoes.distance[rows], electrons[rows], spread[rows])
        waveform[shots] = detected(spec, mean, density[shots], noise)
    return waveform


def _add_pulses(spec: LidarSpec, mean: Array, row: Index, distance: Array, electrons: Array, spread: Array) -> None:
    """Add Gaussian pulses to the photoelectrons a sample, exactly integrated over each sample."""
    rate = pulsed(spec).sampling_frequency
    middle = 2.0 * distance / SPEED_OF_LIGHT * rate
    deviation = spread * rate
    reach = np.ceil(6.0 * deviation).astype(np.int64)
    for half in np.unique(reach):
        some = np.flatnonzero(reach == half)
        place = np.round(middle[some]).astype(np.int64)[:, None] + np.arange(-half, half + 1)
        low = ndtr((place - 0.5 - middle[some, None]) / deviation[some, None])
        high = ndtr((place + 0.5 - middle[some, None]) / deviation[some, None])
        inside = (place >= 0) & (place < mean.shape[1])
        rows = np.broadcast_to(row[some][:, None], place.shape)
        np.add.at(mean, (rows[inside], place[inside]), (electrons[some, None] * (high - low))[inside])


def convolved(spec: LidarSpec, samples: Array, deviation: float) -> Array:
    """Return samples, shape (num_shots, num_samples), through a Gaussian of unit area and a standard deviation [s]."""
    number = samples.shape[1]
    spread = deviation * pulsed(spec).sampling_frequency
    length = next_fast_len(number + math.ceil(12.0 * spread), real=True)
    response = np.exp(-2.0 * (np.pi * spread * rfftfreq(length)) ** 2)
    return np.asarray(irfft(rfft(samples, length, axis=-1) * response, length, axis=-1)[:, :number])


def detected(spec: LidarSpec, mean: Array, density: Array, rng: np.random.Generator) -> Array:
    """Return filtered waveforms from mean photoelectrons a sample, shape (num_shots, num_samples), as their peaks."""
    receiver = pulsed(spec)
    if receiver.noise:
        variance = excess_noise_factor(receiver) * mean + density[:, None] / receiver.sampling_frequency
        mean = mean + np.sqrt(variance / receiver.num_pulses) * rng.standard_normal(mean.shape)
    return np.minimum(through_filter(spec, mean), full_scale(spec))


def through_filter(spec: LidarSpec, samples: Array) -> Array:
    """Return photoelectrons a sample through the receiver's filter, in those of a pulse's peak; shape kept."""
    receiver = pulsed(spec)
    rate = receiver.sampling_frequency
    unit = math.hypot(receiver.pulse_deviation * rate, receiver.filter_deviation * rate, _SAMPLE)
    return convolved(spec, samples, receiver.filter_deviation) * (math.sqrt(2.0 * math.pi) * unit)


def estimate_waveforms(spec: LidarSpec, waveform: Waveform, density: Array, returns: Echoes) -> Detections:
    """Return what the receiver reports, from waveforms.

    Parameters
    ----------
    spec : LidarSpec
    waveform : ndarray of float32, shape (num_shots, num_samples)
    density : ndarray of float64, shape (num_shots,)
        Of the noise; the receiver knows it from samples without a pulse.
    returns : Echoes
        True returns by shot and distance; only to name the surface that a detection comes from.

    Returns
    -------
    Detections
    """
    step = max(SAMPLES_AT_ONCE // waveform.shape[1], 1)
    blocks = [
        peaks_in(spec, waveform[first : first + step], density[first : first + step], first)
        for first in range(0, len(waveform), step)
    ]
    found = join(blocks)
    return replace(found, echo=match(spec, found, returns))


def peaks_in(spec: LidarSpec, waveform: npt.NDArray[np.floating], density: Array, first_shot: int = 0) -> Detections:
    """Return the strongest `max_returns` pulses of each waveform, by shot and distance; labels are left out.

    Parameters
    ----------
    spec : LidarSpec
    waveform : ndarray of float, shape (num_shots, num_samples)
    density : ndarray of float64, shape (num_shots,)
        Of the noise.
    first_shot : int
        Number of the first of them.

    Notes
    -----
    A pulse is a local maximum above the threshold that also stands out by the threshold from the lowest place between
    it and a stronger pulse. Its time is the top of the parabola through the logarithm of the three samples there, which
    is exact for a Gaussian, or the middle of the passages of a quarter of full scale where the output clips.
    """
    samples = np.asarray(waveform, dtype=np.float64)
    level = level_of(spec, density)
    middle = samples[:, 1:-1]
    top = (middle > samples[:, :-2]) & (middle >= samples[:, 2:]) & (middle > 0.5 * level[:, None])
    candidate = np.zeros_like(samples)
    candidate[:, 1:-1] = np.where(top, middle, 0.0)
    noise = np.maximum(noise_deviation(spec, density), 1e-300)
    clip = full_scale(spec)
    found: list[Detections] = []
    for _ in range(spec.max_returns):
        shot = np.flatnonzero(candidate.max(axis=1, initial=0.0) > 0.0)
        if shot.size == 0:
            break
        place = np.argmax(candidate[shot], axis=1)
        time, height = _top(samples, shot, place)
        clipped = np.flatnonzero(height >= clip * (1.0 - 1e-6))
        if clipped.size:
            time[clipped], height[clipped] = _middle(samples, shot[clipped], place[clipped], clip), clip
        distance = time * sample_step(spec)
        good = (height > level[shot]) & (distance > 0.0) & (distance <= spec.max_distance)
        found.append(_reported(spec, shot[good] + first_shot, distance[good], height[good], noise[shot[good]]))
        candidate[shot] *= candidate[shot] - _lowest_on_the_way(samples[shot], place) > level[shot, None]
    if not found:
        nothing = np.zeros(0)
        return _reported(spec, np.zeros(0, dtype=np.int64), nothing, nothing, nothing)
    joined = join(found)
    return take(joined, np.lexsort((joined.distance, joined.shot)))


def _lowest_on_the_way(samples: Array, place: Index) -> Array:
    """Return the lowest sample between every sample and the one at `place` of its row; shape of `samples`."""
    column = np.arange(samples.shape[1])
    after = np.where(column >= place[:, None], samples, np.inf)
    before = np.where(column <= place[:, None], samples, np.inf)
    right = np.minimum.accumulate(after, axis=1)
    left = np.minimum.accumulate(before[:, ::-1], axis=1)[:, ::-1]
    return np.minimum(right, left)


def _reported(spec: LidarSpec, shot: Index, distance: Array, height: Array, noise: Array) -> Detections:
    unit = photoelectrons(spec, 1.0, np.maximum(distance, 1e-3))
    return reported(spec, shot, np.full(len(shot), NO_ECHO), distance, (height, noise, unit))


def reported(
    spec: LidarSpec, shot: Index, echo: Index, distance: Array, peak: tuple[Array, Array, Array]
) -> Detections:
    """Return detections as the receiver puts them out: distances in its steps, intensity and ratio from the peak.

    Parameters
    ----------
    spec : LidarSpec
    shot, echo : ndarray of int64, shape (num_detections,)
    distance : ndarray of float64, shape (num_detections,)
        [m].
    peak : tuple of ndarray of float64, shape (num_detections,) each
        Height, standard deviation of the noise, and the height that a white diffuser across the beam at 1 m would have
        from there [photoelectrons].
    """
    height, noise, unit = peak
    intensity = np.divide(height, unit, out=np.zeros_like(height), where=unit > 0.0)
    step = pulsed(spec).range_step
    if step > 0.0:
        distance = np.round(distance / step) * step
    return Detections(shot, echo, distance, np.full(len(shot), np.nan), (height / noise) ** 2, intensity)


def _top(samples: Array, shot: Index, place: Index) -> tuple[Array, Array]:
    """Return time [samples] and height of the top of the parabola through the logarithm around samples."""
    low, mid, high = (np.log(np.maximum(samples[shot, place + side], 1e-12)) for side in (-1, 0, 1))
    bend = low - 2.0 * mid + high
    step = np.divide(low - high, 2.0 * bend, out=np.zeros_like(bend), where=bend < 0.0)
    step = np.clip(step, -0.5, 0.5)
    return place + step, np.exp(mid + 0.25 * (high - low) * step)


def _middle(samples: Array, shot: Index, place: Index, clip: float) -> Array:
    """Return the middle of the passages of a share of full scale to both sides of clipped tops [samples].

    Edges are exponential between two samples.
    """
    level, time = clip * EDGE, np.empty(len(shot))
    for number, (row, top) in enumerate(zip(shot, place, strict=True)):
        values = np.log(np.maximum(samples[row], level * 1e-6) / level)
        left, right = _above(values, int(top), 0.0)
        last = len(values) - 1
        rise = left - values[left] / (values[left] - values[left - 1]) if left > 0 else 0.0
        fall = right + values[right] / (values[right] - values[right + 1]) if right < last else float(last)
        time[number] = (rise + fall) / 2.0
    return time


def _above(values: Array, top: int, level: float) -> tuple[int, int]:
    """Return the first and the last sample of the stretch around `top` that is above a level."""
    low = np.flatnonzero(values[:top] <= level)
    high = np.flatnonzero(values[top:] <= level)
    return (int(low[-1]) + 1 if low.size else 0), (top + int(high[0]) - 1 if high.size else len(values) - 1)
