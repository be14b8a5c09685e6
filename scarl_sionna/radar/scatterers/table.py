"""Amplitudes of scattering centres over aspects, held only where a centre is strong enough to matter.

Aspects are cut into blocks of neighbours. A centre that is weak in all aspects of a block takes no memory there.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.prompt.describe import Described

Index = npt.NDArray[np.int64]
Complex = npt.NDArray[np.complex64]

ABSENT = -1
"""Number of a centre that is not held in a block."""


def direction_of(azimuth: npt.ArrayLike, elevation: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """Return unit vectors (..., 3) from azimuth (from +x in the xy plane) and elevation [rad]."""
    az, el = np.broadcast_arrays(np.asarray(azimuth, dtype=np.float64), np.asarray(elevation, dtype=np.float64))
    return np.stack([np.cos(el) * np.cos(az), np.cos(el) * np.sin(az), np.sin(el)], axis=-1)


@dataclass(frozen=True, eq=False, repr=False)
class AspectTable(Described):
    """Scattering matrices over elevation, azimuth and centre.

    Attributes
    ----------
    row_start, column_start : ndarray of int64
        First elevation and first azimuth of each row and column of blocks; both begin with 0.
    num_rows, num_columns : int
        Elevations and azimuths.
    held : ndarray of int32, shape (num_row_blocks, num_column_blocks, num_centers)
        Where the aspects of a centre begin in `values`, or `ABSENT`.
    values : ndarray of complex64, shape (n, 2, 2)
        For each pair of a block and a centre the aspects of the block, azimuth running fastest [m].
    """

    row_start: Index
    column_start: Index
    num_rows: int
    num_columns: int
    held: npt.NDArray[np.int32]
    values: Complex

    @classmethod
    def dense(cls, amplitude: npt.ArrayLike) -> AspectTable:
        """Make a table of one block from an array (num_elevations, num_azimuths, num_centers, 2, 2)."""
        array = np.asarray(amplitude, dtype=np.complex64)
        if array.ndim != 5 or array.shape[3:] != (2, 2):
            raise ParameterRangeError(
                "amplitude", f"shape {array.shape}", "shape (elevations, azimuths, centres, 2, 2)"
            )
        rows, columns, count = array.shape[:3]
        start = (rows * columns * np.arange(count)).astype(np.int32).reshape(1, 1, count)
        values = np.ascontiguousarray(np.moveaxis(array, 2, 0)).reshape(-1, 2, 2)
        zero = np.zeros(1, dtype=np.int64)
        return cls(zero, zero.copy(), rows, columns, start, values)

    @property
    def shape(self) -> tuple[int, int, int, int, int]:
        """Shape of the same table as one array."""
        return (self.num_rows, self.num_columns, self.held.shape[2], 2, 2)

    @property
    def nbytes(self) -> int:
        """Memory [bytes]."""
        return int(self.values.nbytes + self.held.nbytes)

    @property
    def share(self) -> float:
        """Part of all amplitudes that is held."""
        return len(self.values) / max(int(np.prod(self.shape[:3])), 1)

    def present(self, row: Index, column: Index, centre: Index) -> npt.NDArray[np.bool_]:
        """Return whether centres are held in the blocks of their aspects."""
        return np.asarray(self.held[self._block_of_row[row], self._block_of_column[column], centre] >= 0)

    def at(self, row: Index, column: Index, centre: Index) -> Complex:
        """Return the matrices of centres at aspects, arrays of one shape (n,); zero where a centre is not held."""
        i, j = self._block_of_row[row], self._block_of_column[column]
        start = self.held[i, j, centre]
        width = np.diff(self.column_start, append=self.num_columns)
        place = start + (row - self.row_start[i]) * width[j] + column - self.column_start[j]
        if not len(self.values):
            return np.zeros((len(place), 2, 2), dtype=np.complex64)
        found = self.values[np.maximum(place, 0)]
        found[start < 0] = 0.0
        return np.asarray(found)

    @cached_property
    def _block_of_row(self) -> Index:
        return np.repeat(np.arange(len(self.row_start)), np.diff(self.row_start, append=self.num_rows))

    @cached_property
    def _block_of_column(self) -> Index:
        return np.repeat(np.arange(len(self.column_start)), np.diff(self.column_start, append=self.num_columns))

    def to_dense(self) -> Complex:
        """Return the whole table as one array."""
        grid = np.meshgrid(*(np.arange(n) for n in self.shape[:3]), indexing="ij")
        return self.at(*(axis.reshape(-1) for axis in grid)).reshape(self.shape)

    def tobytes(self) -> bytes:
        """Return all that the table holds as bytes, to compare tables."""
        return b"".join(np.ascontiguousarray(array).tobytes() for array in self.arrays().values())

    def arrays(self) -> dict[str, npt.NDArray[Any]]:
        """Return what a file of the table holds."""
        counts = np.array([self.num_rows, self.num_columns])
        return {
            "row_start": self.row_start,
            "column_start": self.column_start,
            "counts": counts,
            "held": self.held,
            "values": self.values,
        }

    @classmethod
    def from_arrays(cls, data: Mapping[str, npt.NDArray[Any]]) -> AspectTable:
        """Make a table from what :meth:`arrays` returned.

        Raises
        ------
        ValueError
            If the arrays do not fit each other.
        """
        rows, columns = (int(value) for value in data["counts"])
        starts = [_starts(data[name], size) for name, size in (("row_start", rows), ("column_start", columns))]
        held, values = data["held"], data["values"]
        if held.dtype != np.int32 or held.ndim != 3 or held.shape[:2] != (len(starts[0]), len(starts[1])):
            raise ValueError(f"`held` of type {held.dtype} and shape {held.shape} does not fit the blocks")
        if values.dtype != np.complex64 or values.shape[1:] != (2, 2) or not np.isfinite(values).all():
            raise ValueError("`values` are not finite complex64 matrices of shape (n, 2, 2)")
        aspects = np.diff(starts[0], append=rows)[:, None] * np.diff(starts[1], append=columns)
        if (held < ABSENT).any() or (np.where(held >= 0, held + aspects[:, :, None], 0) > len(values)).any():
            raise ValueError("`held` points outside of `values`")
        return cls(starts[0], starts[1], rows, columns, held, values)


def _starts(values: npt.NDArray[Any], size: int) -> Index:
    """Return the first rows or columns of blocks after a check that they rise from 0 and stay below a size."""
    if values.ndim != 1 or values.dtype.kind not in "iu" or not 0 < size < 10**6 or not len(values) or values[0] != 0:
        raise ValueError("blocks that do not begin with 0")
    starts = values.astype(np.int64)
    if np.any(np.diff(starts, append=size) <= 0):
        raise ValueError("blocks that do not rise")
    return starts


class TableBuilder:
    """Fills an :class:`AspectTable` block after block.

    Parameters
    ----------
    row_start, column_start : ndarray of int64
    num_rows, num_columns, num_centers : int
    """

    def __init__(
        self, row_start: Index, column_start: Index, num_rows: int, num_columns: int, num_centers: int
    ) -> None:
        self._row_start, self._column_start = row_start, column_start
        self._counts = (num_rows, num_columns)
        self._held = np.full((len(row_start), len(column_start), num_centers), ABSENT, dtype=np.int32)
        self._values: list[Complex] = []
        self._size = 0

    def put(self, row: int, column: int, centre: Index, values: Complex) -> None:
        """Add the centres of the block whose first aspect is (row, column).

        `values` have the shape (elevations, azimuths, centres, 2, 2).
        """
        aspects = values.shape[0] * values.shape[1]
        i, j = np.searchsorted(self._row_start, row), np.searchsorted(self._column_start, column)
        self._held[i, j, centre] = self._size + aspects * np.arange(len(centre))
        self._values.append(np.moveaxis(values, 2, 0).reshape(-1, 2, 2).astype(np.complex64))
        self._size += aspects * len(centre)

    def table(self) -> AspectTable:
        """Return the table."""
        values = np.concatenate(self._values) if self._values else np.zeros((0, 2, 2), np.complex64)
        return AspectTable(self._row_start, self._column_start, *self._counts, self._held, values)
