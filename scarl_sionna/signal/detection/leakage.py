"""Leakage over the ends of the range axis: what a near target leaves at the largest ranges, and the reverse."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import numpy.typing as npt

from ..processing import RangeDoppler
from ..windows import window_values

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.intp]

_STEPS = 8
_MARGIN = 1.5
"""Power by which a cell must exceed the largest sidelobe that may stand there; 1.8 dB for noise and migration."""

_TARGET = 10.0
"""Power of a cell over the map's median from which on its sidelobes are looked for."""

_FLOOR = 1e-10
"""Sidelobes never count as lower: what single precision and the tolerance of a synthesis leave, -100 dB."""


@lru_cache(maxsize=32)
def sidelobe_envelope(window: str, count: int, num_bins: int) -> Array:
    """Return the largest power of a tone's transform from each distance on, shape (num_bins,); 1 at distance 0.

    Relative to the power of its largest cell wherever the tone lies between bins; distances in bins, by definition of
    the window. Beyond half of the axis it is that of the half: the transform is periodic.

    References
    ----------
    .. [1] F. J. Harris, "On the use of windows for harmonic analysis with the discrete Fourier transform", Proc.
       IEEE 66(1), 1978.
    """
    spectrum = np.abs(np.fft.fft(window_values(window, count), _STEPS * num_bins)) ** 2
    half = spectrum[: _STEPS * num_bins // 2 + 1]
    envelope = np.maximum.accumulate(half[::-1])[::-1]
    nearest = np.clip(np.arange(num_bins) * _STEPS - _STEPS // 2, 0, len(half) - 1)  # the tone may be half a bin nearer
    return np.asarray(np.minimum(np.maximum(envelope[nearest], _FLOOR) / half[_STEPS // 2], 1.0))


def leaked_over_the_ends(rd: RangeDoppler, doppler_index: Index, range_index: Index) -> npt.NDArray[np.bool_]:
    """Return which cells may be the sidelobe of a stronger cell of their row, reached over an end of the range axis.

    The transform is periodic: a target at half a bin has the half of its main lobe at the largest ranges, where the
    radar equation would make a giant of it. Whatever exceeds the noise leaks, detected or not: rain nearby and the
    ground behind it fill the first bins evenly and pass no threshold, but their leakage has empty cells around it.

    By definition of the window's transform; shape (num_cells,).
    """
    power = rd.power
    num_range = power.shape[1]
    strong = power > _TARGET * np.median(power)  # noise leaks, too, but is no wrong point
    envelope = sidelobe_envelope(rd.window[0], rd.radar.num_range_bins, num_range)
    column = np.arange(num_range)
    leaked = np.zeros(len(range_index), dtype=bool)
    for start in range(0, len(range_index), 1024):
        part = slice(start, start + 1024)
        apart = np.abs(range_index[part, None] - column)
        level = np.where(apart > num_range // 2, envelope[np.minimum(num_range - apart, num_range - 1)], 0.0)
        row = np.where(strong[doppler_index[part]], power[doppler_index[part]], 0.0)
        leaked[part] = power[doppler_index[part], range_index[part]] <= _MARGIN * (level * row).max(axis=1)
    return leaked
