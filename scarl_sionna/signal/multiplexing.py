"""Coded transmitters: their sum in the raw data, their separation, and the images that periodic codes leave."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.specs.radar.spec import RadarSpec

Complex = npt.NDArray[np.complexfloating]

CERTAIN = 4.0
"""A cell belongs to a target from this multiple of the noise power on; images of weaker ones stay in the noise."""


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


def suppress_images(data: npt.NDArray[np.complex64], radar: RadarSpec, noise_power: float) -> None:
    """Lower the images of targets to the noise, in place.

    Parameters
    ----------
    data : ndarray of complex64, shape (num_virtual, num_doppler_bins, num_range_bins)
        Range-Doppler maps of the channels of :func:`separate` [sqrt(W)]. The number of Doppler bins is a multiple of
        the code's period.
    radar : RadarSpec
        Without periodic codes nothing is done.
    noise_power : float
        Of a cell of one channel [W].

    Raises
    ------
    ParameterRangeError
        If the number of Doppler bins is no multiple of the code's period.

    Notes
    -----
    With a code of period H a target shows in H rows, ``num_doppler_bins / H`` apart. In its own row all power is in the
    channels of the codes that are sent, none in those of the unused ones; in the other rows the codes are mixed. All
    codes of a period together hold the same power in each of the H rows (their matrix is unitary), so the row with the
    most power in used codes is the target's, the maximum-likelihood choice. The other H - 1 cells are scaled to the
    noise power where they exceed it and the target is above `CERTAIN` times the noise. A weaker target in one of these
    cells is lost with them: the ambiguity of the code. The more codes stay unused, the surer the choice: with one
    unused of H, an image has at least ``(H - 2) / (H - 1)`` of the target's power.

    References
    ----------
    .. [1] F. Xu, S. A. Vorobyov, F. Yang, "Transmit beamspace DDMA based automotive MIMO radar", IEEE Trans. Veh.
       Technol. 71(2), 2022.
    """
    period = radar.multiplexing.code_period(radar.num_tx)
    if period is None:
        return
    num_doppler = data.shape[1]
    if num_doppler % period:
        raise ParameterRangeError("num_doppler_bins", num_doppler, f"a multiple of {period}, the period of the codes")
    power = np.zeros(data.shape[1:], dtype=np.float32)
    for channel in data:
        power += channel.real**2 + channel.imag**2
    power /= np.float32(len(data))
    folded = power.reshape(period, num_doppler // period, -1)
    best = folded.argmax(axis=0)
    found = folded.max(axis=0) > CERTAIN * noise_power
    is_image = (np.arange(period)[:, None, None] != best) & found & (folded > noise_power)
    scale = np.where(is_image, np.sqrt(noise_power / np.maximum(folded, np.float32(1e-38))), 1.0)
    data *= scale.reshape(power.shape).astype(np.float32)


__all__ = ["multiplex", "separate", "suppress_images"]
