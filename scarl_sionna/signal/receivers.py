"""Receivers that undo a waveform of symbols: division by the data (OFDM), correlation with the code (PMCW)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import scipy.fft

from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.specs.radar.waveforms.coded import Coded, is_coded
from scarl_sionna.core.specs.radar.waveforms.phase_coded import PcFmcw

from .uneven import burst_weights
from .windows import window_values

Array = npt.NDArray[np.float64]


def channel_of(
    samples: npt.NDArray[np.complexfloating], radar: RadarSpec, first: int = 0, tx: int = 0
) -> npt.NDArray[np.complex64]:
    r"""Return what a receiver makes of the samples of a transmit-receive pair before its range transform.

    Parameters
    ----------
    samples : ndarray of complex, shape (num_chirps, num_samples)
        [sqrt(W)]; of ramps they come back as they are.
    radar : RadarSpec
    first : int
        Chirp of the frame that the first row is.
    tx : int
        Transmitter, which in frequency division has subcarriers of its own.

    Returns
    -------
    ndarray of complex64, shape (num_chirps, num_range_bins)
        The channel's transfer at rising tones with the sign of a ramp's beat signal: :math:`e^{+j 2 \pi f \tau}` for a
        delay. A correlator's is weighted with the power of the code's lines, times their number.

    References
    ----------
    .. [1] C. Sturm, W. Wiesbeck, "Waveform design and signal processing aspects for fusion of wireless communications
       and radar sensing", Proc. IEEE 99(7), 2011.
    """
    waveform = radar.waveform_of(tx)
    if isinstance(waveform, PcFmcw):
        chips = waveform.by_chirp[first : first + len(samples), None]
        taken = _aligned(samples, waveform) if waveform.coding == "within" else np.asarray(samples)
        return np.asarray(taken * chips, dtype=np.complex64)
    if not is_coded(waveform):
        return np.asarray(samples, dtype=np.complex64)
    count = waveform.num_samples
    lines = scipy.fft.fft(np.asarray(samples, dtype=np.complex64), axis=1, norm="forward", workers=-1)
    lines = lines[:, (waveform.used - count // 2) % count]
    strengths = _known(waveform)
    strengths = strengths if len(strengths) == 1 else strengths[first : first + len(lines)]
    found = lines / strengths if waveform.divides else lines * np.conj(strengths) * count
    return np.asarray(np.conj(found), dtype=np.complex64)


def _aligned(samples: npt.NDArray[np.complexfloating], waveform: PcFmcw) -> npt.NDArray[np.complexfloating]:
    """Return the samples of coded ramps with the codes of all echoes aligned and taken off, weighted with their power.

    A beat frequency f is advanced by the delay ``f / S`` that it stands for: the phase ``pi f**2 / S``.
    """
    count, rate, slope = waveform.num_samples, waveform.sample_rate, waveform.chirp_slope
    size = scipy.fft.next_fast_len(2 * count)
    edge = float(np.abs(waveform.lines[0]).max())
    lowest = -edge if slope > 0.0 else edge - rate  # echoes from distance 0 on, and the code's band
    frequency = np.mod(np.fft.fftfreq(size, 1.0 / rate) - lowest, rate) + lowest
    spectrum = scipy.fft.fft(np.asarray(samples, dtype=np.complex64), size, axis=1, workers=-1)
    spectrum *= np.exp(1j * np.pi * frequency**2 / slope).astype(np.complex64)
    together = scipy.fft.ifft(spectrum, axis=1, workers=-1, overwrite_x=True)[:, :count]
    return np.asarray(together * np.conj(waveform.aligned))


def _powers(radar: RadarSpec) -> Array | None:
    """Return what a correlator weights each column of :func:`channel_of` with; None if it weights all alike."""
    waveform = radar.waveform_of(0)
    if isinstance(waveform, PcFmcw) and waveform.coding == "within":
        return np.asarray(np.abs(waveform.aligned) ** 2)
    return _line_powers(waveform) if is_coded(waveform) and not waveform.divides else None


def _known(waveform: Coded) -> npt.NDArray[np.complex128]:
    """Return the strengths of the tones that the receiver uses, shape (num_chirps or 1, num_used)."""
    return waveform.spectrum[:, np.searchsorted(waveform.sent, waveform.used)]


def _line_powers(waveform: Coded) -> Array:
    """Return the mean powers of the used tones times the samples of a chirp: 1 for each if all are sent alike."""
    return np.asarray(np.mean(np.abs(_known(waveform)) ** 2, axis=0) * waveform.num_samples)


def range_weights(radar: RadarSpec, window: str | None) -> Array:
    """Return a window over what :func:`channel_of` returns, so that a point's peak is its amplitude.

    Shape (num_range_bins,). For a correlator the weights times the power of the code's lines sum to 1.
    """
    values, powers = window_values(window, radar.num_range_bins), _powers(radar)
    return values if powers is None else np.asarray(values / np.sum(values * powers))


def response_weights(radar: RadarSpec, window: str | None) -> Array:
    """Return the weights over the tones of an undistorted channel whose transform is the response over range.

    They sum to 1, shape (num_range_bins,).
    """
    values, powers = range_weights(radar, window), _powers(radar)
    return values if powers is None else np.asarray(values * powers)


def noise_weights(radar: RadarSpec, window: str | None) -> Array:
    """Return the noise power that each value of :func:`channel_of` adds to a range bin, over that of a sample.

    Shape (num_range_bins,), by definition of the receiver: the squares of all weights. Not for bursts.
    """
    waveform, powers = radar.waveform_of(0), _powers(radar)
    squares = range_weights(radar, window) ** 2
    if powers is not None:
        return np.asarray(squares * powers)
    return np.asarray(squares / _line_powers(waveform) if is_coded(waveform) else squares)


def noise_share(radar: RadarSpec, window: str | None) -> float:
    """Return the noise power of a range bin of one chirp over that of a sample.

    For ramps the window's equivalent noise bandwidth over the samples; for symbols by the definition of the receiver,
    the squares of all weights summed.
    """
    if radar.waveform.burst > 1:
        return float(np.sum(burst_weights(radar, window) ** 2))
    return float(np.sum(noise_weights(radar, window)))
