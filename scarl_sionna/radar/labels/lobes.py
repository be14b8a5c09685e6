"""Responses of a map's axes to one tone: windows' transforms as tables, and their values on bins."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from scarl_sionna.radar.synthesis.phase import phasor

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]

STEPS_PER_BIN = 256
_FEW_COLUMNS = 8
"""NumPy's loops along a last axis shorter than that take longer than steps over it."""


def sides_of(values: Array, reach: int | None = None) -> Array:
    """Return the transform of weights from 0 to `reach` bins, or half of all, real, as :func:`lobe_of` does."""
    count = len(values)
    length = (count // 2 if reach is None else min(reach, count // 2)) * STEPS_PER_BIN
    spectrum = np.asarray(np.fft.fft(values, count * STEPS_PER_BIN)[:length], dtype=np.complex128)
    turns = np.arange(length, dtype=np.float64) * ((count - 1) / 2.0 / (count * STEPS_PER_BIN))
    return np.asarray((spectrum * phasor(turns)).real)


def lobe_of(values: Array) -> Array:
    """Return the transform of real weights from 0 to its first minimum, `STEPS_PER_BIN` values a bin.

    The real part about their middle; 1 at 0 of a window.

    Raises
    ------
    TypeError
        If weights are complex: their transform is not symmetric.
    """
    return _lobe_of(np.asarray(values).astype(np.float64, casting="same_kind").tobytes())


@lru_cache(maxsize=32)
def _lobe_of(held: bytes) -> Array:
    """Return :func:`lobe_of`: the same weights come again with each frame."""
    values = np.frombuffer(held)
    count = len(values)
    position = np.arange(count) - (count - 1) / 2.0
    for reach in range(1, count + 2):
        offset = np.arange(reach * STEPS_PER_BIN + 2) / STEPS_PER_BIN
        response = np.cos(2.0 * np.pi * np.outer(offset, position) / count) @ values
        rising = np.flatnonzero(np.diff(np.abs(response)) > 0.0)
        if len(rising):
            response = response[: rising[0] + 1]
            break  # else one value only: the response is flat
    response.flags.writeable = False
    return np.asarray(response)


def lobe_at(lobe: Array, offset: Array) -> Array:
    """Return the transform at offsets [bins], 0 beyond the main lobe; linear between the values of the table."""
    last = len(lobe) - 1
    place = np.abs(offset) * STEPS_PER_BIN
    step = np.minimum(place, last + 1.0).astype(np.int64)
    slope = np.append(np.diff(lobe), (0.0, 0.0))
    value = np.append(lobe, 0.0)[step] + slope[step] * (place - step)
    value[place > last] = 0.0
    return value


def wrapped(offset: Array, period: int) -> Array:
    """Return offsets modulo a period, within half of it."""
    return np.asarray(np.mod(offset + period / 2.0, period) - period / 2.0)


def turned(place: Array, period: int) -> Array:
    """Put places into [0, period), in place: what ``np.mod`` gives, which takes ten times as long."""
    outside = (place < 0.0) | (place >= period)
    if outside.any():
        place[outside] = np.mod(place[outside], period)
    return place


def above(lobe: Array, level: float) -> Array:
    """Return a response up to where it stays below a level."""
    reached = np.flatnonzero(np.abs(lobe) > level)
    return lobe[: reached[-1] + 2] if len(reached) else lobe[:1]


def without_main(lobe: Array, count: int) -> Array:
    """Return a response with its main lobe, the first `count` values, set to 0."""
    out = lobe.copy()
    out[:count] = 0.0
    return out


@dataclass(frozen=True, eq=False)
class Lobe:
    """A response from 0 on, symmetric, `STEPS_PER_BIN` values a bin, and where it is on the bins of an axis."""

    values: Array
    hole: int = 0
    """Values from 0 on that are 0."""
    known: dict[tuple[int, bytes], tuple[Array, Array, Array]] = field(default_factory=dict)

    def at(self, place: Array, count: int, num_bins: int, factor: Array | None = None) -> tuple[Index, Array]:
        """Return the first bins of the response about places on an axis [bins of `count`], and its value on all bins.

        Shapes (...,) and (..., number of bins): :meth:`columns` tells the bins from the first one, of `num_bins` that
        are as wide as the axis together. Values are times a factor of shape (...,), if one is given.
        """
        scale = num_bins / count
        start = np.ceil(place * scale - len(self.values) / STEPS_PER_BIN * scale)
        step = (start / scale - place) * STEPS_PER_BIN
        goes_around, column = self._columns(count, num_bins)
        first = turned(start, num_bins).astype(np.int64)
        apart = STEPS_PER_BIN * count / num_bins
        if goes_around or apart != int(apart):
            offset = (step[..., None] + column * apart) / STEPS_PER_BIN
            found = lobe_at(self.values, wrapped(offset, count))
        else:
            whole = np.maximum(np.floor(step), -len(self.values))  # rounding may lead below the table
            row = whole.astype(np.int64) + len(self.values)
            found = self._between(row, step - whole, int(apart), column)
        return first, found if factor is None else _scaled(found, factor)

    def columns(self, count: int, num_bins: int) -> Index:
        """Return how far the bins of the response are after its first one, rising, modulo `num_bins` each once.

        Parameters as of :meth:`at`.
        """
        return self._columns(count, num_bins)[1]

    def _columns(self, count: int, num_bins: int) -> tuple[bool, Index]:
        """Return whether the response goes around the axis, and which of the bins within it are not in the hole.

        The first is at most a bin within its reach, wherever it is.
        """
        scale = num_bins / count
        reach = len(self.values) / STEPS_PER_BIN * scale
        width = min(int(np.floor(2.0 * reach)) + 1, num_bins)
        if len(self.values) / STEPS_PER_BIN > count / 2.0:
            return True, np.arange(width)
        inner = (self.hole - 1) / STEPS_PER_BIN * scale
        low, high = int(np.ceil(reach - inner)), int(np.floor(reach + inner))
        return False, np.r_[:low, high:width] if low < high else np.arange(width)

    def _between(self, row: Index, share: Array, apart: int, column: Index) -> Array:
        """Return the values at columns `apart` steps from each other, the first between two of the table.

        The bins of a path are equally far from the values of the table beside them: one row has them all.
        """
        value, slope, at_step = self._rows(apart, column)
        out = _scaled(np.take(slope, row, axis=0), share)
        out += np.take(value, row, axis=0)
        exact = share == 0.0
        if exact.any():
            out[exact] = at_step[row[exact]]
        return out

    def _rows(self, apart: int, column: Index) -> tuple[Array, Array, Array]:
        """Return values beyond each step, their slopes, and values on it, (num_steps, columns), from below the lobe on.

        They are 0 beyond the lobe, so that its last value counts on its step alone.
        """
        key = apart, column.tobytes()
        if key not in self.known:
            count = len(self.values)
            on_step = np.concatenate(
                [[0.0], self.values[:0:-1], self.values, np.zeros(apart * (int(column.max(initial=-1)) + 1) + 1)]
            )
            slope, beyond = np.diff(on_step, append=0.0), on_step.copy()
            slope[[0, 2 * count - 1]] = beyond[2 * count - 1] = 0.0
            place = np.arange(apart + 1)[:, None] + apart * column
            self.known[key] = beyond[place], slope[place], on_step[place]
        return self.known[key]


def _scaled(values: Array, factor: Array) -> Array:
    """Multiply values (..., columns) in place by factors (...,), and return them."""
    if values.shape[-1] > _FEW_COLUMNS:
        values *= factor[..., None]
        return values
    for column in range(values.shape[-1]):
        values[..., column] *= factor
    return values
