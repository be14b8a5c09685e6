"""Receivers that undo a waveform of symbols: division by the data (OFDM), correlation with the code (PMCW)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import scipy.fft

from scarl_sionna.core.specs.radar.coded import Coded, is_coded
from scarl_sionna.core.specs.radar.spec import RadarSpec

from .uneven import burst_weights
from .windows import noise_bandwidth, window_values

Array = npt.NDArray[np.float64]


def channel_of(samples: npt.NDArray[np.complexfloating], radar: RadarSpec, first: int = 0) -> npt.NDArray[np.complex64]:
    r"""Return what a receiver makes of the samples of a transmit-receive pair before its range transform.

    Parameters
    ----------
    samples : ndarray of complex, shape (num_chirps, num_samples)
        [sqrt(W)]; of ramps they come back as they are.
    radar : RadarSpec
    first : int
        Chirp of the frame that the first row is.

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
    waveform = radar.waveform
    if not is_coded(waveform):
        return np.asarray(samples, dtype=np.complex64)
    count = waveform.num_samples
    lines = scipy.fft.fft(np.asarray(samples, dtype=np.complex64), axis=1, norm="forward", workers=-1)
    lines = lines[:, (waveform.used - count // 2) % count]
    strengths = _known(waveform)
    strengths = strengths if len(strengths) == 1 else strengths[first : first + len(lines)]
    found = lines / strengths if waveform.divides else lines * np.conj(strengths) * count
    return np.asarray(np.conj(found), dtype=np.complex64)


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
    values = window_values(window, radar.num_range_bins)
    if not is_coded(radar.waveform) or radar.waveform.divides:
        return values
    return np.asarray(values / np.sum(values * _line_powers(radar.waveform)))


def response_weights(radar: RadarSpec, window: str | None) -> Array:
    """Return the weights over the tones of an undistorted channel whose transform is the response over range.

    They sum to 1, shape (num_range_bins,).
    """
    values = range_weights(radar, window)
    if not is_coded(radar.waveform) or radar.waveform.divides:
        return values
    return values * _line_powers(radar.waveform)


def noise_share(radar: RadarSpec, window: str | None) -> float:
    """Return the noise power of a range bin of one chirp over that of a sample.

    For ramps the window's equivalent noise bandwidth over the samples; for symbols by the definition of the receiver,
    the squares of all weights summed.
    """
    waveform = radar.waveform
    if waveform.burst > 1:
        return float(np.sum(burst_weights(radar, window) ** 2))
    if not is_coded(waveform):
        return noise_bandwidth(window, radar.num_samples) / radar.num_samples
    powers = _line_powers(waveform)
    noise = 1.0 / powers if waveform.divides else powers
    return float(np.sum(range_weights(radar, window) ** 2 * noise))
