"""Which Doppler frequencies a frame of chirps tells apart, by when its chirps start."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.units import SPEED_OF_LIGHT

Array = npt.NDArray[np.float64]

FASTEST = 100.0
"""Nothing on a road closes or opens faster [m/s]."""
ALIKE_DB = -1.0
"""Two Doppler frequencies are ambiguous if their tones at the chirps' starts are as alike as that [dB]."""
_STEPS_A_BIN = 4
_VALUES_A_BLOCK = 2_000_000


def likeness(starts: Array, delays: Array, difference: Array) -> Array:
    r"""Return how alike tones of two Doppler frequencies are at the starts of chirps, 0 to 1.

    Parameters
    ----------
    starts : ndarray of float64, shape (num_chirps,)
        Of the first transmitter's chirps [s].
    delays : ndarray of float64, shape (num_tx,)
        Of the transmitters' chirps after the first one's [s].
    difference : ndarray of float64, shape (n,)
        Of the Doppler frequencies [Hz].

    Returns
    -------
    ndarray of float64, shape (n,)
        :math:`|\sum_m e^{j 2 \pi \Delta t_m}| / M \cdot |\sum_i e^{j 2 \pi \Delta d_i}| / N`: the ambiguity function
        over Doppler. Its second factor counts transmitters whose phases differ as told apart, as the directions of the
        array tell them.

    References
    ----------
    .. [1] M. A. Richards, *Fundamentals of Radar Signal Processing*, 2nd ed., 2014, chapter 5 (staggered intervals).
    """
    out = np.empty(len(difference))
    block = max(1, _VALUES_A_BLOCK // len(starts))
    for first in range(0, len(difference), block):
        turn = 2j * np.pi * difference[first : first + block]
        alike = np.abs(np.exp(np.multiply.outer(turn, starts)).mean(axis=1))
        out[first : first + block] = alike * np.abs(np.exp(np.multiply.outer(turn, delays)).mean(axis=1))
    return out


@lru_cache(maxsize=64)
def doppler_span(starts: tuple[float, ...], delays: tuple[float, ...], frequency: float) -> float:
    """Return the width of the interval of Doppler frequencies that are told apart [Hz].

    By definition the smallest difference beyond the main lobe whose tones are alike to `ALIKE_DB`; of intervals that
    alternate the inverse of their greatest common divisor, as the Chinese remainder theorem has it. At most that of
    `FASTEST` either way at the frequency [Hz].
    """
    most = 4.0 * FASTEST * frequency / SPEED_OF_LIGHT
    times, after = np.array(starts), np.array(delays)
    length = float(np.ptp(times)) * len(times) / max(len(times) - 1, 1)
    if not length:
        return most
    step = 1.0 / (_STEPS_A_BIN * length)
    difference = np.asarray(np.arange(2 * _STEPS_A_BIN, int(most / step) + 1) * step, dtype=np.float64)
    level = likeness(times, after, difference)
    alike = np.flatnonzero(level > 10.0 ** (ALIKE_DB / 20.0))
    if not len(alike):
        return most
    peak = int(alike[0])
    while peak + 1 < len(level) and level[peak + 1] > level[peak]:
        peak += 1
    return float(difference[peak])
