"""What filters and channels leave of an echo in a map: known to whoever knows the front end."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import scipy.fft

from scarl_sionna.core.specs.radar.impairments import ChannelErrors
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.specs.radar.waveforms.coded import Coded, is_coded
from scarl_sionna.core.units import SPEED_OF_LIGHT

from ..processing import coupling
from ..receivers import noise_weights, response_weights
from .channels import rx_matrix, tx_matrix
from .filters import sampled_transfer, transfer

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]

_FINER = 64
"""Zero padding of the response over range whose peak is looked for."""


def beat_frequency(radar: RadarSpec, distance: npt.ArrayLike, radial_velocity: npt.ArrayLike) -> Array:
    """Return the beat frequency of echoes in the middle of a frame of ramps, negative for falling ones [Hz].

    Broadcast.

    Parameters
    ----------
    radar : RadarSpec
    distance, radial_velocity : array_like of float
        At the start of the first ramp [m], [m/s].

    References
    ----------
    .. [1] A. G. Stove, "Linear FMCW radar techniques", IEE Proc. F 139(5), 1992.
    """
    slope = radar.waveform.sweep.slope
    doppler = 2.0 * radar.center_frequency / SPEED_OF_LIGHT * np.asarray(radial_velocity, dtype=np.float64)
    beat = slope * 2.0 / SPEED_OF_LIGHT * np.asarray(distance, dtype=np.float64)
    return np.asarray(beat + coupling(radar) * doppler)


def echo_transfer(radar: RadarSpec, beat: Array, window: str | None = "hann") -> Complex:
    """Return the amplitude that the filters leave of echoes in a map, complex, shape of `beat`; 1 without filters.

    Parameters
    ----------
    radar : RadarSpec
    beat : ndarray of float64
        Beat frequencies of ramps [Hz], :func:`beat_frequency`. Of symbols it does not count: every echo takes all of
        the band.
    window : str or None
        Of the range transform; counts for symbols only.

    Notes
    -----
    Of ramps the filters' transfer function at the beat frequency, as :func:`apply_filters` has it. Of symbols the peak
    of the response over range, which is later by :func:`filter_delay`. *Approximated*: codes within a ramp
    have the transfer of the ramp without it; in maps of real samples, ``radar.one_sided``, the last fifth of the range
    has that of complex samples at the same place.

    References
    ----------
    .. [1] A. V. Oppenheim, A. S. Willsky, *Signals and Systems*, 2nd ed., Prentice Hall, 1997, section 9.7.
    """
    if not is_coded(radar.waveform):
        return sampled_transfer(radar, beat)
    return np.full(np.shape(beat), np.abs(_over_delay(radar, window)).max(), dtype=np.complex128)


def noise_left(radar: RadarSpec, beat: Array, window: str | None = "hann") -> Array:
    """Return the power that the filters leave of the noise beside echoes in a map, shape of `beat`; 1 without filters.

    Parameters
    ----------
    radar, beat, window
        As of :func:`echo_transfer`.

    Notes
    -----
    Of ramps it is as much as of the echo. Of symbols it is the same in every range bin, since each takes all of the
    band: the mean of ``abs(H)**2`` with the squares of the receiver's weights.
    """
    waveform, filters = radar.waveform_of(0), radar.front_end.filters
    if not is_coded(radar.waveform):
        return np.asarray(np.abs(sampled_transfer(radar, beat)) ** 2)
    if filters is None or not is_coded(waveform):
        return np.ones(np.shape(beat))
    kept = np.abs(transfer(filters, _tones(waveform))) ** 2
    return np.full(np.shape(beat), np.average(kept, weights=noise_weights(radar, window)))


def filter_delay(radar: RadarSpec, window: str | None = "hann") -> float:
    """Return by how much the filters delay the response over range of symbols [s]; 0 for ramps.

    By definition, the place of its peak, to a sixty-fourth of a range bin.

    Parameters
    ----------
    radar : RadarSpec
    window : str or None
        Of the range transform.
    """
    waveform = radar.waveform_of(0)
    if radar.front_end.filters is None or not is_coded(waveform):
        return 0.0
    over_delay = np.abs(_over_delay(radar, window))
    step = int(waveform.used[1] - waveform.used[0]) if len(waveform.used) > 1 else 1
    later = int(over_delay.argmax()) / len(over_delay)
    return (later - round(later)) / (step * waveform.spacing)


def _tones(waveform: Coded) -> Array:
    """Return the frequencies of the tones that a receiver of symbols uses, about the carrier [Hz]."""
    return np.asarray((waveform.used - waveform.num_samples // 2) * waveform.spacing, dtype=np.float64)


def _over_delay(radar: RadarSpec, window: str | None) -> Complex:
    """Return the response over delay of symbols behind the filters, over a period of the tones' step."""
    waveform, filters = radar.waveform_of(0), radar.front_end.filters
    lines = np.asarray(response_weights(radar, window), dtype=np.complex128)
    if filters is not None and is_coded(waveform):
        lines *= transfer(filters, _tones(waveform))
    return np.asarray(scipy.fft.ifft(lines, _FINER * len(lines), norm="forward"))


def through_channels(
    fields: npt.NDArray[np.complexfloating], errors: ChannelErrors, num_tx: int
) -> npt.NDArray[np.complexfloating]:
    """Return the fields of ideal channels behind gains, phases and coupling of the antennas [sqrt(W)], same shape.

    Exact: linear in the fields.

    Parameters
    ----------
    fields : ndarray of complex, shape (num_echoes, num_virtual)
        With the phases of a beat signal, transmitters before receivers [sqrt(W)].
    errors : ChannelErrors
    num_tx : int
    """
    split = fields.reshape(len(fields), num_tx, -1)
    sent, heard = np.conj(tx_matrix(errors, num_tx)), np.conj(rx_matrix(errors, split.shape[2]))
    mixed = np.einsum("nir,ik,qr->nkq", split, sent, heard, optimize=True)
    return np.asarray(mixed.reshape(fields.shape), dtype=fields.dtype)
