"""Points spread onto a grid over range and Doppler, strip by strip of Doppler cells, so that it stays in the cache."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import finufft
import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline

from .nufft import Chebyshev, num_nodes

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complexfloating]

KERNEL_CELLS, KERNEL_SHIFTS = 64, 8
"""Grid and shifts of the point on which the spreading kernel is measured."""
GUARD = 10
"""Cells that a point may reach beyond the cell that it is in: half of finufft's widest kernel, and `LOOSE`."""
LOOSE = 1.5
"""Cells by which a point may lie beyond its strip, so that points sorted once serve all pairs of antennas."""
STRIP_CELLS = 128
"""Doppler cells of a strip, about: a strip of 768 range cells in complex128 has 1.6 MB."""
RANGE_BITS = 5
"""Points of a strip are worked on in the order of their range cells, so many bits of the cell's number left out."""


@dataclass(frozen=True)
class Spreader:
    """Precision of one term's spreading, and the Fourier transform of its kernel."""

    dtype: str
    eps: float
    upsampling: float

    def plan(self, shape: tuple[int, int]) -> finufft.Plan:
        """Return a plan that only spreads, points in the order in which they are given."""
        return finufft.Plan(
            1,
            shape,
            eps=self.eps,
            isign=1,
            dtype=self.dtype,
            nthreads=1,
            upsampfac=self.upsampling,
            spreadinterponly=1,
            spread_sort=0,
        )

    @property
    def real(self) -> type[np.floating]:
        """Type of the points."""
        return np.float64 if self.dtype == "complex128" else np.float32

    @lru_cache(maxsize=64)  # noqa: B019
    def kernel_transform(self) -> CubicSpline:
        """Return the kernel's Fourier transform over cycles a cell in [-1/2, 1/2], measured on points between cells."""
        plan = self.plan((KERNEL_CELLS, KERNEL_CELLS))
        turns = np.linspace(-0.5, 0.5, 4097)
        total = np.zeros_like(turns)
        for shift in range(KERNEL_SHIFTS):  # the mean over shifts removes the aliases that one set of samples has
            point = np.full(1, 2.0 * np.pi * shift / (KERNEL_SHIFTS * KERNEL_CELLS), dtype=self.real)
            plan.setpts(point, point.copy())
            values = plan.execute(np.ones(1, dtype=self.dtype)).real.astype(np.float64)
            samples = values.sum(axis=1) / np.sqrt(values.sum())
            used = np.flatnonzero(samples)
            offset = used - KERNEL_CELLS // 2 - shift / KERNEL_SHIFTS
            total += np.cos(2.0 * np.pi * turns[:, None] * offset) @ samples[used]
        return CubicSpline(turns, total / KERNEL_SHIFTS)


def along(kernel: CubicSpline, x: Array, stretch: Array, y: Array) -> Array:
    """Return a kernel's transform at (x + y) times the stretch [turns a cell], shape (len(x), len(y)).

    `x` is even about 0 and the stretch a straight line over it: the transform is worked out at some x, and from there
    by polynomials, to 1e-13.
    """
    edge = x[[0, -1]]
    ends = (edge[:, None] + y) * stretch[[0, -1], None]
    half = 0.5 * float(np.abs(ends[1] - ends[0]).max())
    series = Chebyshev(float(edge[0]), float(edge[1]), num_nodes(2.0 * np.pi * GUARD * half, 1e-13))
    if series.count >= len(x):
        return np.asarray(kernel((x[:, None] + y) * stretch[:, None]))
    nodes = series.nodes
    values = kernel((nodes[:, None] + y) * np.interp(nodes, x, stretch)[:, None])
    # not by BLAS: its second thread waits busily after each product, longer than this one takes
    terms = np.einsum("ij,jy->iy", series.coefficients, values)
    return np.asarray(np.einsum("ix,iy->xy", series.polynomials(x), terms))


@dataclass(frozen=True)
class Strips:
    """A grid over range and Doppler in strips of Doppler cells.

    Range goes round after `rows` cells; the strips are spread over `reach` cells of range that do not go round, from
    `first_row` on, and folded.

    Attributes
    ----------
    rows : int
        Range cells that are one turn.
    reach : int
        Range cells that are spread onto.
    first_row : int
        Number of the first of them.
    count, width : int
        Strips, and Doppler cells of each.
    """

    rows: int
    reach: int
    first_row: int
    count: int
    width: int

    @classmethod
    def over(cls, rows: int, range_cells: tuple[float, float], doppler_cells: float) -> Strips:
        """Return the strips for points within some range cells and a number of Doppler cells."""
        first = int(np.floor(range_cells[0])) - GUARD
        reach = max(KERNEL_CELLS, int(np.ceil(range_cells[1])) + GUARD + 1 - first)
        inner = max(int(np.ceil(doppler_cells)) + 4, KERNEL_CELLS)
        count = max(1, round(inner / STRIP_CELLS))
        width = -(-inner // count)
        return cls(rows, reach, first, count, width + (width % 8 == 0))  # rows of the same place in the cache are slow

    @property
    def columns(self) -> int:
        """Doppler cells in all, guards included; points lie between the guards."""
        return self.count * self.width + 2 * GUARD

    @property
    def shape(self) -> tuple[int, int]:
        """Of what a strip is spread onto."""
        return self.reach, self.width + 2 * GUARD

    def order(self, row: Array, column: Array) -> npt.NDArray[np.intp]:
        """Return the order in which points at some range and Doppler cells are best worked on."""
        strip = np.clip((column - GUARD) / self.width, 0, self.count - 1).astype(np.int64)
        key = strip * ((self.reach >> RANGE_BITS) + 2)
        key += np.clip(row - self.first_row, 0, self.reach).astype(np.int64) >> RANGE_BITS
        if self.count * ((self.reach >> RANGE_BITS) + 2) < 1 << 16:
            key = key.astype(np.uint16)  # sorted by counting
        return np.argsort(key, kind="stable")

    def slices(self, column: Array) -> list[slice] | None:
        """Return the points of each strip, None if they are not in the order of strips."""
        strip = np.floor((column - GUARD) / self.width)
        np.clip(strip, 0, self.count - 1, out=strip)
        np.maximum.accumulate(strip, out=strip)
        if len(strip) and float((column - GUARD - strip * self.width).min()) < -LOOSE:
            return None
        ends = np.searchsorted(strip, np.arange(1, self.count + 1))
        return [slice(int(first), int(last)) for first, last in zip([0, *ends[:-1]], ends, strict=True)]

    def angles(self, row: Array, column: Array, strip: int, real: type[np.floating]) -> tuple[Array, Array]:
        """Return points of a strip as the angles that its plan takes."""
        reach, wide = self.shape
        over_range = (row - (self.first_row + 0.5 * reach)) * (2.0 * np.pi / reach)
        over_doppler = (column - (strip * self.width + 0.5 * wide)) * (2.0 * np.pi / wide)
        return over_range.astype(real, copy=False), over_doppler.astype(real, copy=False)

    def columns_of(self, strip: int) -> slice:
        """Return the Doppler cells that are complete after a strip: of the last one all that are left."""
        last = self.columns if strip == self.count - 1 else (strip + 1) * self.width
        return slice(strip * self.width, last)

    @cached_property
    def _folds(self) -> list[tuple[slice, slice]]:
        """Range cells that are spread onto, and those of the turn that they are, piece by piece."""
        pieces, start = [], 0
        while start < self.reach:
            row = (self.first_row + start) % self.rows
            turn = self.rows if start < self.rows else self.reach
            many = min(self.reach - start, self.rows - row, turn - start)
            pieces.append((slice(start, start + many), slice(row, row + many)))
            start += many
        return pieces

    @cached_property
    def _gaps(self) -> list[slice]:
        """Range cells of the turn that are not spread onto, piece by piece."""
        first, stop = (self.first_row + self.reach) % self.rows, self.first_row % self.rows
        if self.reach >= self.rows:
            return []
        return [slice(first, stop)] if first < stop else [slice(first, self.rows), slice(0, stop)]

    def fold(self, cells: Complex, out: Complex, weighted: tuple[Complex, Array] | None = None) -> None:
        """Put a strip's cells onto those of one turn.

        Parameters
        ----------
        cells, out : ndarray of complex, shape (reach, columns) and (rows, columns)
        weighted : pair of ndarray, optional
            Cells of a turn that get the same times weights over range, and the weights, shape (reach, 1).
        """
        for target in self._gaps:
            out[target] = 0.0
            if weighted is not None:
                weighted[0][target] = 0.0
        for source, target in self._folds:
            if source.start >= self.rows:  # a second turn
                out[target] += cells[source]
                if weighted is not None:
                    weighted[0][target] += cells[source] * weighted[1][source]
                continue
            out[target] = cells[source]
            if weighted is not None:
                real = weighted[1].dtype
                np.multiply(out[target].view(real), weighted[1][source], out=weighted[0][target].view(real))
