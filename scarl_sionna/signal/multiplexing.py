"""Coded transmitters: their sum in the raw data, their separation, and the images that periodic codes leave."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.special import gammainccinv

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.specs.radar.spec import RadarSpec

Complex = npt.NDArray[np.complexfloating]

CHANCE = 1e-4
"""Of noise to count as a target whose images are suppressed: above that of a detector, so that no image is detected."""
_STRIDE = 64
"""Cells along range by which the noise of images is another one from row to row: more than a threshold's window."""


def multiplex(alone: Complex, radar: RadarSpec) -> npt.NDArray[np.complex64]:
    """Return the raw data of a coded radar, from those of its transmitters each alone.

    By definition of the codes.

    Parameters
    ----------
    alone : ndarray of complex, shape (num_rx, num_rows * num_tx, num_samples)
        Raw data of ``radar.separated`` [sqrt(W)].
    radar : RadarSpec

    Returns
    -------
    ndarray of complex64, shape (num_rx, num_rows, num_samples)
        [sqrt(W)]
    """
    codes = _codes(radar)
    split = alone.reshape(radar.num_rx, len(codes), radar.num_tx, radar.num_samples)
    out = np.zeros((radar.num_rx, len(codes), radar.num_samples), dtype=np.complex64)
    for tx in range(radar.num_tx):
        out += split[:, :, tx] * codes[:, tx, None]
    return out


def separate(adc: Complex, radar: RadarSpec) -> npt.NDArray[np.complex64]:
    """Return the channels of a coded radar: the raw data times each transmitter's conjugate code.

    Parameters
    ----------
    adc : ndarray of complex, shape (num_rx, num_rows, num_samples)
        [sqrt(W)]
    radar : RadarSpec

    Returns
    -------
    ndarray of complex64, shape (num_virtual, num_rows, num_samples)
        [sqrt(W)]. A channel holds its own transmitter and, turned from chirp to chirp, the others: they are told apart
        by the Doppler transform.

    References
    ----------
    .. [1] J. Li, P. Stoica, *MIMO Radar Signal Processing*, Wiley, 2009.
    """
    codes = _codes(radar)
    gain = len(codes) / (np.abs(codes) ** 2).sum(axis=0)
    out = np.empty((radar.num_tx, radar.num_rx, *adc.shape[1:]), dtype=np.complex64)
    for tx in range(radar.num_tx):
        np.multiply(adc, (gain[tx] * codes[:, tx].conj())[:, None], out=out[tx])
    return out.reshape(radar.num_virtual, *adc.shape[1:])


def _codes(radar: RadarSpec) -> npt.NDArray[np.complex64]:
    return radar.multiplexing.codes(radar.num_chirps, radar.num_tx).astype(np.complex64)


def images(
    power: npt.NDArray[np.float32], num_channels: int, period: int, floor: float, moved: npt.NDArray[np.float64]
) -> npt.NDArray[np.bool_]:
    """Return which cells of a map hold images of targets that periodic codes leave.

    Parameters
    ----------
    power : ndarray of float32, shape (num_doppler_bins, 2 * num_range_bins)
        Mean power of the channels of :func:`separate` before the compensation of motion, in range bins and half-way
        between them [W].
    num_channels, period : int
        Virtual channels, chirps of a period of the codes (H).
    floor : float
        Noise of a cell of one channel [W].
    moved : ndarray of float64, shape (num_doppler_bins,)
        By how much the compensation moves a row down in range [bins].

    Returns
    -------
    ndarray of bool, shape (num_doppler_bins, num_range_bins)
        Cells after the compensation.

    Raises
    ------
    ParameterRangeError
        If the number of Doppler bins is no multiple of the code's period.

    Notes
    -----
    With a code of period H a target shows in H rows, ``num_doppler_bins / H`` apart. In its own row all power is in the
    channels of the codes that are sent, none in those of the unused ones; in the other rows the codes are mixed. All
    codes of a period together hold the same power in each of the H rows (their matrix is unitary), so the row with the
    most power in used codes is the target's, the maximum-likelihood choice. Where it exceeds what the mean of so many
    channels of noise does with a probability of `CHANCE` (gamma distribution), the other H - 1 cells are images. A
    weaker target in one of these cells is lost with them: the ambiguity of the code. The more codes stay unused, the
    surer the choice: with one unused of H, an image has up to ``(H - 2) / (H - 1)`` of the target's power.

    References
    ----------
    .. [1] F. Xu, S. A. Vorobyov, F. Yang, "Transmit beamspace DDMA based automotive MIMO radar", IEEE Trans. Veh.
       Technol. 71(2), 2022.
    """
    num_doppler, places = power.shape
    if num_doppler % period:
        raise ParameterRangeError("num_doppler_bins", num_doppler, f"a multiple of {period}, the period of the codes")
    folded = power.reshape(period, num_doppler // period, places)
    top, best = folded.max(axis=0), folded.argmax(axis=0)
    best[top <= floor * gammainccinv(num_channels, CHANCE) / num_channels] = -1
    place = np.arange(0, places, 2) + 2.0 * moved[:, None]  # of a cell before it was moved
    below, above = (np.mod(side(place), places).astype(np.intp) for side in (np.floor, np.ceil))
    row = np.arange(num_doppler)[:, None] % (num_doppler // period)
    own = best[row, np.where(top[row, below] >= top[row, above], below, above)]
    return np.asarray((own >= 0) & (own != np.arange(num_doppler)[:, None] // (num_doppler // period)))


def fill_with_noise(data: npt.NDArray[np.complex64], cells: npt.NDArray[np.bool_], floor: float) -> None:
    """Fill cells with white noise of all channels, in place, by definition.

    Images that are scaled down to the noise would stay coherent over channels and range. The noise is the same in every
    frame.

    Parameters
    ----------
    data : ndarray of complex64, shape (num_virtual, num_doppler_bins, num_range_bins)
        [sqrt(W)]
    cells : ndarray of bool, shape (num_doppler_bins, num_range_bins)
    floor : float
        Mean power of the noise in a cell of one channel [W].
    """
    rng, scale = np.random.default_rng(0), np.float32(np.sqrt(0.5 * floor))
    num_doppler, num_range = cells.shape
    for channel in data if cells.any() else ():
        line = rng.standard_normal((num_range + _STRIDE * num_doppler, 2), dtype=np.float32).view(np.complex64)[:, 0]
        noise = np.lib.stride_tricks.sliding_window_view(scale * line, num_range)[::_STRIDE][:num_doppler]
        np.copyto(channel, noise, where=cells)


__all__ = ["fill_with_noise", "images", "multiplex", "separate"]
