"""Thresholds in each beam: what stands out of its own direction, beside something stronger in another."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Unpack

import numpy as np
import numpy.typing as npt
import scipy.ndimage

from ..angle import RangeDopplerAngle
from ..direction.manifold import Manifold
from ..direction.several import Directions, resolution
from ..processing import RangeDoppler
from .cells import Cells, peak_offsets
from .threshold import Options, Statistic, Widths, above_mean, exceeds, windows_of

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.intp]

_REACH = 0.5
"""Part of a beamwidth that a direction may be off the beam in which its cell stands out."""


def maxima(rda: RangeDopplerAngle, axes: tuple[int, ...], over_cells: bool) -> npt.NDArray[np.bool_]:
    """Return which cells of the beams are the largest over the angles and, if asked for, over Doppler and range.

    By definition; the shape of `rda.data`. `axes` are what the array measures of azimuth (0) and elevation (1); of the
    other one only the first beam counts.
    """
    out = is_peak(rda.data, range(2, rda.data.ndim))
    if over_cells:
        out &= is_peak(rda.data, range(2))
    for axis in range(rda.data.ndim - 2):
        if axis not in axes:
            np.moveaxis(out, 2 + axis, 0)[1:] = False
    return out


def beams_above(
    rda: RangeDopplerAngle,
    pfa: float,
    window: tuple[Widths, Widths],
    tried: npt.NDArray[np.bool_] | None = None,
    **options: Unpack[Options],
) -> npt.NDArray[np.bool_]:
    """Return which cells of the beams stand out of the training cells of their own beam, the shape of `rda.data`.

    Parameters
    ----------
    rda : RangeDopplerAngle
    pfa : float
        Probability of false alarm of a cell of a beam in white noise; its bounds are those of
        :func:`~scarl_sionna.signal.detection.cfar`.
    window : (tuple of int, tuple of int)
        Half-widths in cells (Doppler, range) of guard and training, as for
        :func:`~scarl_sionna.signal.detection.cfar`.
    tried : ndarray of bool, the shape of `rda.data`, optional
        Which are looked at; default: all.
    **options
        `kind`, `along` and `rank`, as for :func:`~scarl_sionna.signal.detection.cfar`.

    Returns
    -------
    ndarray of bool, shape (num_doppler_bins, num_range_bins, num_azimuth[, num_elevation])

    Raises
    ------
    ParameterRangeError
        If a value is out of range, or the window is empty or larger than the map.

    Notes
    -----
    A beam of white noise is one look: exponential powers, whose links by the windows are those of a single channel's.

    References
    ----------
    .. [1] M. A. Richards, *Fundamentals of Radar Signal Processing*, 2nd ed., 2014, ch. 6.5.
    """
    statistic = Statistic(**options)
    areas, each = windows_of(rda.channels, 1, pfa, *window, statistic)
    shape = len(rda.radial_velocity), len(rda.range), -1
    chosen = np.ones(rda.data.shape, dtype=bool).reshape(shape) if tried is None else tried.reshape(shape)
    beams, out = rda.data.reshape(chosen.shape), np.zeros_like(chosen)
    for beam in range(chosen.shape[2]):
        power = np.ascontiguousarray(beams[..., beam])
        row, column = np.nonzero(chosen[..., beam])
        for area in areas:
            if statistic.kind == "ca":
                found = above_mean(area, power, 1, each)[row, column]
            else:
                found = exceeds(area, power, (row, column), 1, each, statistic)
            out[row, column, beam] |= found
    return out.reshape(rda.data.shape)


def is_peak(power: npt.NDArray[np.float32], axes: range) -> npt.NDArray[np.bool_]:
    """Return which cells are the largest of their neighbours along some axes; the first axis is periodic."""
    size = [3 if axis in axes else 1 for axis in range(power.ndim)]
    modes = ["wrap", *["nearest"] * (power.ndim - 1)]
    return np.asarray(power == scipy.ndimage.maximum_filter(power, size=size, mode=modes))


@dataclass(frozen=True, eq=False)
class Beams:
    """Cells that stand out in a beam, those of one cell one after another, the strongest first.

    Attributes
    ----------
    row, column : ndarray of int, shape (num_beams,)
        Over Doppler and range.
    sines : ndarray of float64, shape (num_beams, 2)
        Of the beam's azimuth and elevation; 0 where the array has no extent.
    offset : (ndarray, ndarray) of float64, shape (num_beams,)
        Of the beam's peak from the cell over Doppler and range [bins].
    first : ndarray of int, shape (num_cells,)
        The first beam of every cell.
    step : ndarray of float64, shape (2,)
        Of the map's sines; 0 where the array has no extent.
    """

    row: Index
    column: Index
    sines: Array
    offset: tuple[Array, Array]
    first: Index
    step: Array

    @classmethod
    def of(cls, rda: RangeDopplerAngle, found: npt.NDArray[np.bool_], axes: tuple[int, ...]) -> Beams:
        """Return the beams found; `axes` are those of azimuth (0) and elevation (1) that the array measures."""
        index = np.nonzero(found)
        power = rda.data[index]
        cell = index[0] * rda.data.shape[1] + index[1]
        order = np.lexsort((-power, cell))
        index = tuple(axis[order] for axis in index)
        sines, step = np.zeros((len(order), 2)), np.zeros(2)
        for axis, values in enumerate((rda.azimuth, rda.elevation)):
            if values is not None and axis in axes:
                sines[:, axis] = np.sin(values)[index[2 + axis]]
                step[axis] = np.ptp(np.sin(values[:2]))
        first = np.flatnonzero(np.diff(cell[order], prepend=-1))
        return cls(index[0], index[1], sines, peak_offsets(rda.channels, rda.data, index), first, step)

    def cells(self, rd: RangeDoppler) -> Cells:
        """Return the cells, with the offsets of the strongest beam of each."""
        offset = self.offset[0][self.first], self.offset[1][self.first]
        nothing = np.zeros(len(self.first), dtype=np.int64)
        return Cells(rd, self.row[self.first], self.column[self.first], offset, nothing)

    def own(self, found: Directions, located: Cells, manifold: Manifold) -> tuple[Directions, Cells]:
        """Return the directions, and their targets, in which their cells stand out, with the offsets of those beams.

        Where the velocity is beyond the unambiguous interval the map's beams are none, and all directions stay.
        """
        beam, near = self._nearest(found.cell, found.sines, manifold)
        offset = [np.where(near, mine[beam], theirs) for mine, theirs in zip(self.offset, located.offset, strict=True)]
        kept = near | (located.fold != 0)
        return found.select(kept), replace(located, offset=(offset[0], offset[1])).select(kept)

    def _nearest(
        self, cell: npt.NDArray[np.int64], sines: Array, manifold: Manifold
    ) -> tuple[Index, npt.NDArray[np.bool_]]:
        """Return for directions (n, 2) of the cells of these numbers the nearest beam, and whether it is near enough.

        Near enough is half a beamwidth, or a step of the map's angles.
        """
        reach = np.maximum(_REACH * resolution(manifold), self.step)
        last = np.append(self.first[1:], len(self.row))
        best, least = self.first[cell].copy(), np.full(len(cell), np.inf)
        for step in range(int((last - self.first).max(initial=0))):
            beam = self.first[cell] + step
            there = beam < last[cell]
            away = np.max(np.abs(self.sines[np.minimum(beam, len(self.row) - 1)] - sines) / reach, axis=1)
            closer = there & (away < least)
            best[closer], least[closer] = beam[closer], away[closer]
        return best, least <= 1.0
