"""Which Doppler frequencies a frame tells apart: by when its chirps start, and by transmitters that take turns."""

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
TOLD_APART_DB = 0.5
"""Power by which the beam of another interval of velocity must be higher for certain."""
_STEPS_A_BIN = 4
_STEPS_A_BEAM = 4
_VALUES_A_BLOCK = 2_000_000


Positions = tuple[tuple[float, ...], ...]


def likeness(starts: Array, difference: Array) -> Array:
    r"""Return how alike tones of two Doppler frequencies are at the starts of chirps, 0 to 1.

    Parameters
    ----------
    starts : ndarray of float64, shape (num_chirps,)
        Of the first transmitter's chirps [s].
    difference : ndarray of float64, shape (n,)
        Of the Doppler frequencies [Hz].

    Returns
    -------
    ndarray of float64, shape (n,)
        :math:`|\sum_m e^{j 2 \pi \Delta t_m}| / M`: the ambiguity function over Doppler.

    References
    ----------
    .. [1] M. A. Richards, *Fundamentals of Radar Signal Processing*, 2nd ed., 2014, chapter 5 (staggered intervals).
    """
    out = np.empty(len(difference))
    block = max(1, _VALUES_A_BLOCK // len(starts))
    for first in range(0, len(difference), block):
        turn = 2j * np.pi * difference[first : first + block]
        out[first : first + block] = np.abs(np.exp(np.multiply.outer(turn, starts)).mean(axis=1))
    return out


def likeness_of_directions(turns: Array, send: Positions, receive: Positions) -> Array:
    r"""Return how alike phases between transmitters are to those of another direction, 0 to 1.

    Parameters
    ----------
    turns : ndarray of float64, shape (n, num_tx)
        Phases that a wrong velocity adds to the transmitters [cycles].
    send, receive : tuple of (y, z)
        Positions of transmitters and receivers [wavelengths].

    Returns
    -------
    ndarray of float64, shape (n,)
        Amplitude of the largest beam of the whole array over that of the right velocity:
        :math:`\max_w |\sum_i e^{j 2 \pi (\phi_i + w p_i)}| \, |\sum_j e^{j 2 \pi w q_j}| / N`, over differences w of
        two directions' sines, -2 to 2. It is 1 where transmitters alone tell directions: a velocity that is off by an
        interval is another direction then.

    References
    ----------
    .. [1] F. Roos, J. Bechter, N. Appenrodt, J. Dickmann, C. Waldschmidt, "Enhancement of Doppler unambiguity for
       chirp-sequence modulated TDM-MIMO radars", IEEE ICMIM 2018.
    """
    places = np.array(send), np.array(receive)
    extent = np.ptp(places[0], axis=0) + np.ptp(places[1], axis=0)
    steps = np.ceil(2.0 * _STEPS_A_BEAM * extent).astype(int)
    grid = [2.0 * np.arange(-count, count + 1) / max(count, 1) for count in steps]
    phasors = np.exp(2j * np.pi * turns).T
    best, where = np.full(len(turns), -1.0), np.zeros((len(turns), 2))
    rows = max(1, _VALUES_A_BLOCK // (len(grid[1]) * max(len(turns), len(send))))
    for first in range(0, len(grid[0]), rows):
        sines = np.stack(np.meshgrid(grid[0][first : first + rows], grid[1], indexing="ij"), axis=-1).reshape(-1, 2)
        level = _beam(sines, phasors, places)
        top = level.max(axis=0)
        where[top > best] = sines[level.argmax(axis=0)[top > best]]
        best = np.maximum(best, top)
    near = np.stack(np.meshgrid(*[np.linspace(-1.0, 1.0, 9)] * 2, indexing="ij"), axis=-1).reshape(-1, 2)
    for number, sine in enumerate(where):  # about the best
        sines = np.clip(sine + near * 2.0 / np.maximum(steps, 1), -2.0, 2.0)
        best[number] = max(best[number], _beam(sines, phasors[:, number : number + 1], places).max())
    return best


def _beam(sines: Array, phasors: npt.NDArray[np.complex128], places: tuple[Array, Array]) -> Array:
    """Return amplitudes (num_sines, n) of beams of transmitters turned by phasors (num_tx, n), and all receivers."""
    send, receive = (np.exp(2j * np.pi * sines @ place.T) for place in places)
    return np.asarray(np.abs(send @ phasors) / send.shape[1] * np.abs(receive.mean(axis=1))[:, None])


@lru_cache(maxsize=64)
def intervals_told_apart(turns: tuple[float, ...], count: int, send: Positions, receive: Positions) -> int:
    """Return how many neighbouring intervals of velocity are told apart by phases between transmitters.

    By definition the smallest number of intervals to another one whose beam is within `TOLD_APART_DB` of the right one
    for some pair of directions, at most `count`, after which phases repeat. `turns` are the starts of the transmitters'
    chirps [intervals].
    """
    if count < 2:
        return 1
    number = np.arange(1, count)
    alike = likeness_of_directions(np.multiply.outer(number, np.array(turns)), send, receive)
    same = number[alike > 10.0 ** (-TOLD_APART_DB / 20.0)]
    return int(same[0]) if len(same) else count


@lru_cache(maxsize=64)
def doppler_span(
    starts: tuple[float, ...], delays: tuple[float, ...], frequency: float, send: Positions, receive: Positions
) -> float:
    """Return the width of the interval of Doppler frequencies that are told apart [Hz].

    By definition the smallest difference beyond the main lobe whose tones are alike to `ALIKE_DB`; of intervals that
    alternate the inverse of their greatest common divisor, as the Chinese remainder theorem has it. Transmitters that
    take turns tell more where no other direction explains their phases. At most that of `FASTEST` either way at the
    frequency [Hz].
    """
    most = 4.0 * FASTEST * frequency / SPEED_OF_LIGHT
    times, after = np.array(starts), np.array(delays)
    length = float(np.ptp(times)) * len(times) / max(len(times) - 1, 1)
    if not length:
        return most
    step = 1.0 / (_STEPS_A_BIN * length)
    difference = np.asarray(np.arange(2 * _STEPS_A_BIN, int(most / step) + 1) * step, dtype=np.float64)
    level = likeness(times, difference)
    limit = 10.0 ** (ALIKE_DB / 20.0)
    close = np.flatnonzero(level > limit)
    if len(after) > 1 and len(close):
        level[close] *= likeness_of_directions(np.multiply.outer(difference[close], after), send, receive)
    alike = np.flatnonzero(level > limit)
    if not len(alike):
        return most
    peak = int(alike[0])
    while peak + 1 < len(level) and level[peak + 1] > level[peak]:
        peak += 1
    return float(difference[peak])
