"""Frequency responses of radio channels from their paths, at any time near that of the frame."""

from __future__ import annotations

from typing import Protocol

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.specs.radio import RadioSpec

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]


class Channels(Protocol):
    """What is read of :class:`scarl_sionna.core.channels.RadioChannels`, in memory or stored."""

    @property
    def spec(self) -> RadioSpec:
        """The radio."""

    @property
    def a(self) -> npt.NDArray[np.complex64]:
        """Coefficients, (num_stations, num_station_antennas, num_antennas, max_paths)."""

    @property
    def tau(self) -> Array:
        """Delays, (num_stations, max_paths) [s]."""

    @property
    def doppler(self) -> Array:
        """Doppler shifts, (num_stations, max_paths) [Hz]."""


def frequency_response(
    channels: Channels, times: npt.ArrayLike = 0.0, frequencies: npt.ArrayLike | None = None
) -> Complex:
    r"""Return the frequency response of radio channels over time and frequency.

    Parameters
    ----------
    channels : RadioChannels
        Or one that is stored in a dataset.
    times : array_like of float, shape (num_times,) or ()
        From the frame's time on [s]: as long as the paths stay the same, 0.1 to 10 ms on a street.
    frequencies : array_like of float, shape (num_frequencies,), optional
        From the carrier [Hz]; default: the radio's subcarriers.

    Returns
    -------
    ndarray of complex128, shape (num_stations, num_station_antennas, num_antennas, num_times, num_frequencies)
        Without the axis of the times where `times` is one number.

    Notes
    -----
    .. math:: H(f, t) = \sum_i a_i e^{j 2 \pi f_{D,i} t} e^{-j 2 \pi f \tau_i}

    References
    ----------
    .. [1] Sionna RT, ``Paths.cir`` and ``Paths.cfr``: the same definitions, there in float32.
    """
    offsets = channels.spec.subcarrier_frequencies if frequencies is None else np.asarray(frequencies, np.float64)
    return response(channels.a, channels.tau, channels.doppler, offsets, times)


def response(
    a: npt.NDArray[np.complexfloating], tau: Array, doppler: Array, frequencies: Array, times: npt.ArrayLike = 0.0
) -> Complex:
    """Return the sum of :func:`frequency_response` over paths; arguments have its shapes and units."""
    when = np.asarray(times, dtype=np.float64)
    over_time = np.exp(2j * np.pi * doppler[:, None] * np.atleast_1d(when)[:, None])  # station, time, path
    over_band = np.exp(-2j * np.pi * tau[:, None] * frequencies[:, None])  # station, frequency, path
    moved = a[..., None, :] * over_time[:, None, None]  # station, antennas, time, path
    found = np.einsum("sabtp,sfp->sabtf", moved, over_band, optimize=True)
    return found if when.ndim else found[..., 0, :]
