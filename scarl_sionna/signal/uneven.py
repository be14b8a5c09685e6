"""Range-Doppler transforms of what a regular FFT cannot do alone: falling ramps, uneven chirps, stepped carriers."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import scipy.fft

from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.units import SPEED_OF_LIGHT

from .windows import window_values

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex64]


def middle_time(radar: RadarSpec) -> float:
    """Return the time of the middle sample of the first transmitter's middle chirp [s]."""
    sweep = radar.waveform.sweep
    in_chirp = sweep.wait + sweep.first + (radar.num_samples - 1) / (2.0 * radar.sample_rate)
    return (radar.num_chirps - 1) / 2.0 * radar.doppler_interval + in_chirp


def over_range(rows: npt.NDArray[np.complexfloating], radar: RadarSpec, num_range: int) -> Complex:
    """Return the spectrum over fast time with rising range: of a ramp that falls the frequencies are negative."""
    if radar.waveform.sweep.slope < 0.0:
        return np.asarray(scipy.fft.ifft(rows, num_range, axis=1, norm="forward", workers=-1), dtype=np.complex64)
    return np.asarray(scipy.fft.fft(rows, num_range, axis=1, workers=-1, overwrite_x=True), dtype=np.complex64)


def before_range(rows: npt.NDArray[np.complexfloating], radar: RadarSpec) -> npt.NDArray[np.complexfloating]:
    """Return the values whose :func:`over_range` without more bins is `rows`."""
    if radar.waveform.sweep.slope < 0.0:
        return np.asarray(scipy.fft.fft(rows, axis=1, norm="forward", workers=-1))
    return np.asarray(scipy.fft.ifft(rows, axis=1, workers=-1))


def dopplers(radar: RadarSpec, num_doppler: int) -> Array:
    """Return the Doppler frequencies of the rows of a map, rising [Hz]."""
    return (np.arange(num_doppler) - num_doppler // 2) / (num_doppler * radar.slow_interval)


def doppler_matrix(radar: RadarSpec, window: npt.NDArray[np.float32], num_doppler: int) -> Complex:
    """Return the transform over chirps that start when they do, window included, shape (num_doppler, num_chirps)."""
    cycles = dopplers(radar, num_doppler)[:, None] * chirp_times(radar)
    return np.asarray(window * np.exp(-2j * np.pi * cycles), dtype=np.complex64)


def chirp_times(radar: RadarSpec) -> Array:
    """Return the starts of the first transmitter's chirps [s]."""
    even = np.arange(radar.num_chirps, dtype=np.float64) * radar.doppler_interval
    late = radar.waveform.chirp_delays
    return even if late is None else even + np.asarray(late)


def burst_weights(radar: RadarSpec, window: str | None) -> Array:
    """Return a window over the whole band at the samples of a burst, sum 1, shape (burst, num_samples)."""
    waveform, count = radar.waveform, radar.num_range_bins
    carriers = np.asarray(waveform.chirp_frequencies)[: waveform.burst]
    place = np.abs(carriers - carriers[0])[:, None] * (count / radar.sampled_bandwidth) + np.arange(radar.num_samples)
    values = np.interp(place, np.arange(count), window_values(window, count))
    return np.asarray(values / values.sum())


def burst_map(
    samples: Complex, radar: RadarSpec, windows: tuple[str | None, str | None], shape: tuple[int, int], tx: int | None
) -> Complex:
    r"""Return the range-Doppler map of a channel of bursts of stepped ramps, put together to one band.

    Parameters
    ----------
    samples : ndarray of complex64, shape (num_chirps, num_samples)
    radar : RadarSpec
    windows : tuple of str or None
        Over the whole band and over the bursts.
    shape : tuple of int
        Doppler and range bins.
    tx : int or None
        Transmitter, whose motion is compensated; None for the plain transform.

    Returns
    -------
    ndarray of complex64, shape (num_doppler_bins, num_range_bins)

    Notes
    -----
    The transform over the bursts gives each row its Doppler frequency nu, and so the phase that motion adds from sample
    to sample of a burst. Then the samples' frequencies F over those of the mean ramp make range: ``sum exp(-2j pi F
    tau)``.

    References
    ----------
    .. [1] M. A. Richards, *Fundamentals of Radar Signal Processing*, 2nd ed., 2014, chapter 4 (stepped frequency).
    """
    (num_doppler, num_range), size, slope = shape, radar.waveform.burst, radar.waveform.sweep.slope
    carriers = np.asarray(radar.waveform.chirp_frequencies)[:size]
    slow = window_values(windows[1], radar.num_doppler_bins).astype(np.float32)
    bursts = samples.reshape(-1, size, radar.num_samples) * slow[:, None, None]
    rows = np.fft.fftshift(scipy.fft.fft(bursts, num_doppler, axis=0, workers=-1), axes=0)
    taper = burst_weights(radar, windows[0])
    x = (np.arange(radar.num_samples) - 0.5 * (radar.num_samples - 1)) / radar.sample_rate
    place = np.arange(num_range) * (2.0 * radar.max_range / (SPEED_OF_LIGHT * num_range))
    out = np.zeros(shape, dtype=np.complex64)
    for number, carrier in enumerate(carriers):
        factor = np.broadcast_to(taper[number], (num_doppler, radar.num_samples))
        if tx is not None:
            after = (number - 0.5 * (size - 1)) * radar.doppler_interval + x
            middle = middle_time(radar) + radar.tx_delay(tx)
            turned = after + (slope * x + carrier) / radar.center_frequency * (middle + after) + radar.tx_delay(tx)
            factor = factor * np.exp(-2j * np.pi * dopplers(radar, num_doppler)[:, None] * turned)
        part = over_range(np.asarray(rows[:, number] * factor, dtype=np.complex64), radar, num_range)
        out += part * np.exp(-2j * np.pi * carrier * place).astype(np.complex64)
    return out


def stepped_map(
    samples: Complex,
    radar: RadarSpec,
    window: npt.NDArray[np.float32],
    taper: npt.NDArray[np.complexfloating] | npt.NDArray[np.floating],
    shape: tuple[int, int],
    compensated: bool,
) -> Complex:
    r"""Return the range-Doppler map of a channel whose chirps have carriers of their own.

    Parameters
    ----------
    samples : ndarray of complex64, shape (num_chirps, num_samples)
    radar : RadarSpec
    window : ndarray of float32, shape (num_chirps,)
        Over the chirps.
    taper : ndarray, shape (num_doppler_bins, num_samples) or (num_samples,)
        Window over fast time with the compensation of motion of each Doppler row.
    shape : tuple of int
        Doppler and range bins.
    compensated : bool
        Whether the bins of range are those at the start of the first ramp.

    Returns
    -------
    ndarray of complex64, shape (num_doppler_bins, num_range_bins)

    Notes
    -----
    A chirp whose carrier is D higher has the phase :math:`2\pi D \tau` more, for the delay at its own time. It is
    removed for each range bin's delay and each row's Doppler frequency: every row is a transform of all chirps.

    References
    ----------
    .. [1] M. A. Richards, *Fundamentals of Radar Signal Processing*, 2nd ed., 2014, chapter 4 (stepped frequency).
    """
    num_doppler, num_range = shape
    steps = np.asarray(radar.waveform.chirp_frequencies)
    late = chirp_times(radar)
    place = np.arange(num_range) * (radar.num_samples / (num_range * radar.sampled_bandwidth))
    by_range = np.exp(-2j * np.pi * steps[:, None] * place).astype(np.complex64)
    middle = (radar.num_chirps - 1) / 2.0 * radar.doppler_interval
    out = np.empty(shape, dtype=np.complex64)
    for row, doppler in enumerate(dopplers(radar, num_doppler)):
        cycles = doppler * (late + steps / radar.center_frequency * (late - middle))
        if compensated:
            cycles += doppler * steps / radar.center_frequency * middle_time(radar)
        else:
            cycles -= doppler * steps / radar.waveform.sweep.slope
        turned = (window * np.exp(-2j * np.pi * cycles)).astype(np.complex64)
        spectra = over_range(samples * (taper if taper.ndim == 1 else taper[row]), radar, num_range)
        out[row] = np.einsum("m,mr,mr->r", turned, spectra, by_range)
    return out
