"""Positions of peaks between bins, exact for a tone in a known window."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import numpy.typing as npt

from .windows import window_values

Array = npt.NDArray[np.float64]

_TABLE_POINTS = 129


def parabola_offset(left: npt.ArrayLike, middle: npt.ArrayLike, right: npt.ArrayLike) -> Array:
    """Return the offset in bins of a parabola's vertex through three values about a maximum, within +- 0.5.

    Values of any one unit and any shape, kept. Exact for a parabola, by definition.
    """
    left, middle, right = (np.asarray(value, dtype=np.float64) for value in (left, middle, right))
    curvature = left - 2.0 * middle + right
    with np.errstate(divide="ignore", invalid="ignore"):
        offset = 0.5 * (left - right) / curvature
    return np.clip(np.where(curvature < 0, offset, 0.0), -0.5, 0.5)


@lru_cache(maxsize=32)
def _offset_table(window: str, count: int, num_bins: int) -> tuple[Array, Array]:
    """Return (vertex of the parabola through the decibels, true offset) for tones in a window, both rising."""
    values = window_values(window, count)
    position = np.arange(count) - (count - 1) / 2.0
    true = np.linspace(-0.5, 0.5, _TABLE_POINTS)
    three = [
        np.log(np.maximum(np.abs(np.cos(2.0 * np.pi * np.outer(step - true, position) / num_bins) @ values), 1e-12))
        for step in (-1, 0, 1)
    ]
    vertex = np.maximum.accumulate(parabola_offset(*three) + 1e-12 * np.arange(_TABLE_POINTS))
    return vertex, true


def tone_offset(
    left: npt.ArrayLike, middle: npt.ArrayLike, right: npt.ArrayLike, window: str, count: int, num_bins: int
) -> Array:
    """Return the offset in bins of a tone's true frequency from the bin of its maximum, within +- 0.5.

    By definition of a tone: found on the transform of the window itself.

    Parameters
    ----------
    left, middle, right : array_like of float, any shape
        Powers of three neighbouring bins, the middle one the largest [any unit].
    window : str
        Window of the transform over `count` values into `num_bins` bins.
    """
    powers = (np.log(np.maximum(np.asarray(value, dtype=np.float64), 1e-300)) for value in (left, middle, right))
    vertex, true = _offset_table(window, count, num_bins)
    return np.interp(parabola_offset(*powers), vertex, true)
