"""Filters of the beat signal before the converter."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import scipy.fft

from scarl_sionna.core.specs.radar.impairments import IfFilter
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.specs.radar.waveforms.coded import is_coded

BLEND = 0.2
"""Part of the sample rate over which beat frequencies below its top go over into those below 0 Hz (noise, images)."""


def transfer(filters: IfFilter, frequency: npt.NDArray[np.float64]) -> npt.NDArray[np.complex128]:
    """Return the transfer function of the filters at frequencies [Hz]; conjugate symmetric.

    References
    ----------
    .. [1] A. V. Oppenheim, A. S. Willsky, *Signals and Systems*, 2nd ed., Prentice Hall, 1997, sections 6.5 and 9.7.
    """
    out = np.ones(np.shape(frequency), dtype=np.complex128)
    for corner in filters.high_pass:
        out *= frequency / (frequency - 1j * corner)
    if filters.low_pass is not None:
        from scipy.signal import butter, freqs  # 0.7 s, which few need

        top, bottom = butter(filters.low_pass_order, filters.low_pass, analog=True)
        # of angular frequency and corner alike, so that both may stand in Hz
        out *= freqs(top, bottom, np.ravel(frequency))[1].reshape(np.shape(frequency))
    return out


def sampled_transfer(radar: RadarSpec, frequency: npt.NDArray[np.float64]) -> npt.NDArray[np.complex128]:
    """Return the transfer function of a radar's filters for samples of a beat signal, at any frequencies [Hz].

    By definition of :func:`apply_filters`; 1 without filters.
    """
    filters, rate = radar.front_end.filters, radar.sample_rate
    if filters is None:
        return np.ones(np.shape(frequency), dtype=np.complex128)
    share = np.mod(np.asarray(frequency) / rate, 1.0)
    above = 0.5 + 0.5 * np.cos(np.pi * np.clip((share - 1.0 + BLEND) / BLEND, 0.0, 1.0))
    below = transfer(filters, (share - 1.0) * rate)
    return np.asarray(above * transfer(filters, share * rate) + (1.0 - above) * below)


def filter_factor(radar: RadarSpec) -> npt.NDArray[np.complex128]:
    """Return what :func:`apply_filters` multiplies the spectrum of a row by, as long as the row or longer.

    Of symbols as long: they go on periodically. Of ramps at least twice, so that what is before a row and what the
    filters leave after it do not meet.
    """
    if radar.front_end.filters is not None and is_coded(radar.waveform):
        frequency = scipy.fft.fftfreq(radar.num_samples, 1.0 / radar.sample_rate)
        return transfer(radar.front_end.filters, frequency)
    count = scipy.fft.next_fast_len(2 * radar.num_samples)
    return sampled_transfer(radar, np.arange(count, dtype=np.float64) * (radar.sample_rate / count))


def noise_share_left(radar: RadarSpec) -> float:
    """Return the power of white noise behind the filters over that before them; 1 without filters.

    By definition, the mean of the squared transfer function over the samples' band.
    """
    return float(np.mean(np.abs(filter_factor(radar)) ** 2))


class Before(NamedTuple):
    """What a receiver's rows are before their first sample.

    Attributes
    ----------
    still : ndarray of complex, shape (num_rows, 1)
        The constant to which the filters have settled [sqrt(W)].
    lead : ndarray of complex, shape (num_rows, num_lead), or None
        The samples before the row, that constant and noise [sqrt(W)]; None: that constant alone.
    """

    still: npt.NDArray[np.complex64]
    lead: npt.NDArray[np.complex64] | None = None


def apply_filters(
    adc: npt.NDArray[np.complexfloating], radar: RadarSpec, before: Callable[[int, int], Before] | None = None
) -> npt.NDArray[np.complex64]:
    """Return the signal behind the filters [sqrt(W)], same shape (num_rx, num_rows, num_samples).

    Parameters
    ----------
    adc : ndarray of complex
        [sqrt(W)]
    radar : RadarSpec
        Its front end has filters.
    before : callable, optional
        From a receiver and a number of samples to what stands before its rows, of ramps; left out: their first sample.

    Notes
    -----
    The analogue transfer function itself, not a digital copy of it. Samples tell frequencies apart modulo the sample
    rate only: over the top `BLEND` of the band the transfer function goes over into that of frequencies below 0 Hz
    (raised cosine: a jump would ring over the whole chirp), so echoes beyond ``(1 - BLEND) max_range`` are filtered as
    if partly there. A filter has settled to the first sample's value before the first sample: a constant is
    suppressed from the start, an oscillation after the filter's own settling time, 1 us at 175 kHz. Noise goes on
    before it (`before`), for at least as long as the row is and periodically: behind the filters it is stationary.

    Symbols go on periodically within a window (a prefix, or a code that is sent all the time), so they are in a steady
    state: their frequencies on both sides of the carrier have the transfer function as it is.
    """
    filters = radar.front_end.filters
    if filters is None:
        return np.asarray(adc, dtype=np.complex64)
    factor = filter_factor(radar).astype(np.complex64)
    if is_coded(radar.waveform):
        spectrum = scipy.fft.fft(np.asarray(adc, dtype=np.complex64), axis=-1)
        spectrum *= factor
        return np.asarray(scipy.fft.ifft(spectrum, axis=-1, overwrite_x=True))
    through = np.complex64(transfer(filters, np.zeros(1))[0])
    num_samples = adc.shape[-1]
    out = np.empty(adc.shape, dtype=np.complex64)
    for index, rows in enumerate(np.asarray(adc, dtype=np.complex64)):
        still, lead = Before(rows[:, :1]) if before is None else before(index, len(factor) - num_samples)
        moved = rows - still
        if lead is not None:
            moved = np.concatenate([moved, lead - still], axis=1)
        spectrum = scipy.fft.fft(moved, len(factor), axis=1) * factor
        out[index] = scipy.fft.ifft(spectrum, axis=1)[:, :num_samples] + through * still
    return out
