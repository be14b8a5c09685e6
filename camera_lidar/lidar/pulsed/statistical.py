"""The pulsed receiver by its statistics: speckle, detection, false alarms, estimates; fog and spray as waveforms.

One row a return; a waveform is made only of the stretch that the air fills.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from camera_lidar.lidar.detections import NO_ECHO, Detections, keep_strongest
from camera_lidar.lidar.returns import Echoes, join, nearest_of, place_in_group, take
from camera_lidar.lidar.spray import CloudCells
from scarl_sionna.core.specs.lidar.spec import LidarSpec

from .air import air_electrons, mean_profile, sample_step
from .detection import filtered, level_of, noise_deviation, range_deviation, threshold_ratio
from .link import full_scale, photoelectrons, pulse_spread, pulsed, speckle_cells
from .waveform import SAMPLES_AT_ONCE, convolved, detected, peaks_in, reported, through_filter

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]

_FAINTEST = 0.1
"""Air whose mean waveform is below this share of the noise's deviation adds no false alarm worth a waveform."""


def receive_pulsed(
    spec: LidarSpec,
    returns: Echoes,
    density: Array,
    rng: np.random.Generator,
    spray: Sequence[CloudCells] = (),
) -> Detections:
    """Return what a pulsed receiver reports of ideal returns.

    Parameters
    ----------
    spec : LidarSpec
        With a :class:`~scarl_sionna.core.specs.lidar.receiver.PulsedReceiver`.
    returns : Echoes
        By shot and distance, at most `spec.max_returns` a shot.
    density : ndarray of float64, shape (num_shots,)
        Of the noise, see :func:`.link.density_of_shots`.
    rng : numpy.random.Generator
        Every effect has a stream of its own with a fixed number of draws a place for a return, so that what one shot
        meets does not change the noise of another.
    spray : sequence of CloudCells
        See :func:`.air.spray_cells`.

    Notes
    -----
    A return's peak is its mean, times speckle (Gamma of :func:`.link.speckle_cells`), plus normal noise; it is
    detected above :func:`.detection.threshold_ratio`, and its distance has the error of
    :func:`.detection.range_deviation`. Noise alone gives false alarms anywhere, with heights of Rice's law. Where fog
    or spray can be seen the waveform up to the first surface is drawn and searched, as the raw receiver does.
    """
    receiver = pulsed(spec)
    speckle, heights, times, alarms, air = rng.spawn(5)
    slot = returns.shot * spec.max_returns + place_in_group(returns.shot)
    num_slots = spec.num_shots * spec.max_returns
    electrons = photoelectrons(spec, returns.intensity, returns.distance)
    if receiver.speckle:
        cells = np.ones(num_slots)
        cells[slot] = speckle_cells(spec, returns.distance)
        electrons = electrons * (speckle.standard_gamma(cells) / cells)[slot]
    of_return = density[returns.shot]
    spread = pulse_spread(spec, returns.cos_incidence, returns.distance)
    peaks = filtered(spec, electrons, spread, of_return)
    if not receiver.noise:
        seen = np.flatnonzero(peaks.height > 0.0)
        return _reported(spec, returns, seen, peaks.height[seen], returns.distance[seen], of_return[seen])
    height = peaks.height + peaks.noise * heights.standard_normal(num_slots)[slot]
    step_down = _pedestal(spec, returns.distance) / 2.0  # a pulse stands out of the air before it, which ends there
    seen = np.flatnonzero(height - step_down > level_of(spec, of_return))
    error = range_deviation(spec, take(peaks, seen)) * times.standard_normal(num_slots)[slot][seen]
    found = _reported(spec, returns, seen, height[seen], returns.distance[seen] + error, of_return[seen])
    filled = _filled(spec, float(density.min()), spray)
    false = _false_alarms(spec, density, alarms)
    false = take(false, np.flatnonzero(false.distance > filled * sample_step(spec)))
    drawn = [found, false]
    if filled:
        of_air = _air_peaks(
            spec, nearest_of(spec.num_shots, returns.shot, returns.distance), density, filled, spray, air
        )
        measured = nearest_of(spec.num_shots, found.shot, found.distance)
        apart = of_air.distance < measured[of_air.shot] - spec.range_resolution
        drawn.append(take(of_air, np.flatnonzero(apart)))
    return keep_strongest(join(drawn), spec.max_returns)


def _reported(
    spec: LidarSpec, returns: Echoes, rows: Index, height: Array, distance: Array, density: Array
) -> Detections:
    """Return detections of returns; heights are clipped and distances rounded as the receiver does."""
    height = np.minimum(height, full_scale(spec))
    unit = photoelectrons(spec, 1.0, returns.distance[rows])
    noise = np.maximum(noise_deviation(spec, density), 1e-300)
    found = reported(spec, returns.shot[rows], rows, distance, (height, noise, unit))
    return take(found, np.flatnonzero((found.distance > 0.0) & (found.distance <= spec.max_distance)))


def _false_alarms(spec: LidarSpec, density: Array, rng: np.random.Generator) -> Detections:
    """Return the shots in which noise alone passes the threshold, at any distance."""
    chance, place, excess = rng.random(spec.num_shots), rng.random(spec.num_shots), rng.random(spec.num_shots)
    shot = np.flatnonzero(chance < pulsed(spec).false_alarm_probability)
    ratio = np.sqrt(threshold_ratio(spec) ** 2 - 2.0 * np.log1p(-excess[shot]))
    distance = np.maximum(place[shot], 1e-9) * spec.max_distance
    intensity = ratio * noise_deviation(spec, density[shot]) / photoelectrons(spec, 1.0, spec.max_distance)
    nothing = np.full(len(shot), NO_ECHO)
    return Detections(shot, nothing, distance, np.full(len(shot), np.nan), ratio**2, intensity)


@lru_cache(maxsize=16)
def _mean_air(spec: LidarSpec) -> Array:
    """Return the mean waveform of fog, rain and snow without a surface, shape (num_samples,); read-only."""
    mean = convolved(spec, mean_profile(spec)[None], pulsed(spec).pulse_deviation)
    waveform = through_filter(spec, mean)[0]
    waveform.setflags(write=False)
    return waveform


def _has_weather(spec: LidarSpec) -> bool:
    return pulsed(spec).backscatter and spec.atmosphere.weather_extinction(spec.wavelength) > 0.0


def _pedestal(spec: LidarSpec, distance: Array) -> Array:
    """Return the mean waveform of the weather at distances [photoelectrons], shape kept."""
    if not _has_weather(spec):
        return np.zeros_like(distance)
    return np.interp(distance, np.arange(spec.num_samples) * sample_step(spec), _mean_air(spec))


def _filled(spec: LidarSpec, density: float, spray: Sequence[CloudCells]) -> int:
    """Return up to which sample the air adds to the noise; 0 where it nowhere does."""
    faintest = _FAINTEST * float(noise_deviation(spec, density))
    last = 0
    if _has_weather(spec):
        last = int(np.flatnonzero(_mean_air(spec) > faintest).max(initial=-1)) + 1
    for cells in spray:
        # a long cloud of a cell's electrons has a waveform of so many times as much
        unit = np.sqrt(2.0 * np.pi) * np.hypot(pulsed(spec).pulse_deviation, pulsed(spec).filter_deviation)
        height = photoelectrons(spec, cells.intensity, cells.distance) * unit * pulsed(spec).sampling_frequency
        far = float(cells.distance[height > faintest].max(initial=0.0))
        last = max(last, int(np.ceil(far / sample_step(spec))) + 1) if far > 0.0 else last
    return min(last, spec.num_samples)


def _air_peaks(
    spec: LidarSpec,
    nearest: Array,
    density: Array,
    filled: int,
    spray: Sequence[CloudCells],
    rng: np.random.Generator,
) -> Detections:
    """Return the peaks of fog, drops and spray before the first surface of each shot, up to a sample."""
    drops, noise = rng.spawn(2)
    step = max(SAMPLES_AT_ONCE // filled, 1)
    blocks = []
    for first in range(0, spec.num_shots, step):
        shots = np.arange(first, min(first + step, spec.num_shots))
        air = air_electrons(spec, shots, nearest[shots], spray, filled, drops)
        waveform = detected(spec, convolved(spec, air, pulsed(spec).pulse_deviation), density[shots], noise)
        blocks.append(peaks_in(spec, waveform, density[shots], first))
    return join(blocks)
