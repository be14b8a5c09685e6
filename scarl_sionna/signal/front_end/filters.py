"""Filters of the beat signal before the converter."""

from __future__ import annotations

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


def apply_filters(adc: npt.NDArray[np.complexfloating], radar: RadarSpec) -> npt.NDArray[np.complex64]:
    """Return the signal behind the filters [sqrt(W)], same shape (num_rx, num_rows, num_samples).

    Parameters
    ----------
    adc : ndarray of complex
        [sqrt(W)]
    radar : RadarSpec
        Its front end has filters.

    Notes
    -----
    The analogue transfer function itself, not a digital copy of it. Samples tell frequencies apart modulo the sample
    rate only: over the top `BLEND` of the band the transfer function goes over into that of frequencies below 0 Hz
    (raised cosine: a jump would ring over the whole chirp), so echoes beyond ``(1 - BLEND) max_range`` are filtered as
    if partly there. A filter has settled to the first sample's value before the first sample: a constant is
    suppressed from the start, an oscillation after the filter's own settling time, 1 us at 175 kHz.

    Symbols go on periodically within a window (a prefix, or a code that is sent all the time), so they are in a steady
    state: their frequencies on both sides of the carrier have the transfer function as it is.
    """
    filters = radar.front_end.filters
    if filters is None:
        return np.asarray(adc, dtype=np.complex64)
    if is_coded(radar.waveform):
        frequency = scipy.fft.fftfreq(adc.shape[-1], 1.0 / radar.sample_rate)
        spectrum = scipy.fft.fft(np.asarray(adc, dtype=np.complex64), axis=-1)
        spectrum *= transfer(filters, frequency).astype(np.complex64)
        return np.asarray(scipy.fft.ifft(spectrum, axis=-1, overwrite_x=True))
    count = scipy.fft.next_fast_len(2 * adc.shape[-1])
    factor = sampled_transfer(radar, np.arange(count, dtype=np.float64) * (radar.sample_rate / count))
    factor = factor.astype(np.complex64)
    still = transfer(filters, np.zeros(1))[0]
    out = np.empty(adc.shape, dtype=np.complex64)
    for index, rows in enumerate(np.asarray(adc, dtype=np.complex64)):
        first = rows[:, :1]
        spectrum = scipy.fft.fft(rows - first, count, axis=1) * factor
        out[index] = scipy.fft.ifft(spectrum, axis=1)[:, : adc.shape[-1]] + np.complex64(still) * first
    return out
