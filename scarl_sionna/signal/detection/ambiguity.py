"""Velocities beyond the unambiguous interval, told by the phases between transmitters that do not send at once."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.specs.radar.ambiguity import TOLD_APART_DB

from ..direction.manifold import Manifold
from .cells import Cells, is_regular

Array = npt.NDArray[np.float64]

_MARGIN_NOISE = 12.0
"""By how much noise of a beam that of another interval must be higher: a chance of 1e-4 to be wrong."""


def is_clear(top: Array, seen: Array, noise_power: float) -> npt.NDArray[np.bool_]:
    """Return whether the beams of other intervals are stronger for certain than those of the intervals seen.

    By definition of the margins; all powers in W.
    """
    return np.asarray((top > 10.0 ** (TOLD_APART_DB / 10.0) * seen) & (top - seen > _MARGIN_NOISE * noise_power))


def is_told(power: Array, noise_power: float) -> npt.NDArray[np.bool_]:
    """Return whether one interval's beam stands out from those of all others: which one it is is known, not assumed.

    By definition of the margins; `power` [W] has one row an interval.
    """
    ordered = np.sort(power, axis=0)
    return is_clear(ordered[-1], ordered[-2], noise_power)


def unfolded(cells: Cells, manifold: Manifold, noise_power: float) -> Cells:
    """Return cells with the intervals that their velocities are off.

    Parameters
    ----------
    cells : Cells
    manifold : Manifold
    noise_power : float
        Of a cell after beamforming [W].

    Returns
    -------
    Cells
        With `fold` set; 0 where the velocity seen explains the phases as well, for transmitters that send at once, and
        where a map is no plain transform of even chirps with motion compensated. `told` is the number of intervals
        tried where one stands out, and 1 elsewhere.

    Notes
    -----
    In an interval that is not the target's, the phases between transmitters are wrong and the beam of the whole array
    falls apart. The interval with the strongest beam is taken, as many as transmitters have different times: the
    velocities of all of them together are as ambiguous as those of a single transmitter that sends every chirp. Beyond
    `radar.num_intervals` some other direction explains the phases as well, or nearly so, and it may be a wrong one.
    Virtual elements at one place, if there are any, take part as all others do.

    References
    ----------
    .. [1] F. Roos, J. Bechter, N. Appenrodt, J. Dickmann, C. Waldschmidt, "Enhancement of Doppler unambiguity for
       chirp-sequence modulated TDM-MIMO radars", IEEE ICMIM 2018.
    """
    radar = cells.rd.radar
    count = radar.num_turns
    if count < 2 or not len(cells.row) or not cells.rd.is_compensated or not is_regular(radar):
        return cells
    tried = np.arange(-(count // 2), (count - 1) // 2 + 1)
    cells = replace(cells, num_intervals=count)
    others = [replace(cells, fold=np.full(len(cells.row), fold)).wrapped() for fold in tried]
    power = np.stack([manifold.peak(other.snapshot, other.distance)[1] for other in others])
    best, seen = power.argmax(axis=0), power[count // 2]
    top = power.max(axis=0)
    fold = np.where(is_clear(top, seen, noise_power), tried[best], 0)
    told = np.where(is_told(power, noise_power), float(count), 1.0)
    return replace(cells, fold=fold.astype(np.int64), told=told).wrapped()
