"""Where paths lie in a range-Doppler map, and their fields in the cells around.

The transform, local to the main lobe.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import numpy as np
import numpy.typing as npt
from scipy.sparse import csc_array

from scarl_sionna.core.arrays.blocks import in_blocks
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.specs.radar.tones import seen_by
from scarl_sionna.core.specs.radar.waveforms.coded import is_coded
from scarl_sionna.core.specs.radar.waveforms.phase_coded import PcFmcw
from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.radar.paths import RadarPaths
from scarl_sionna.radar.synthesis.motion import PairTerms
from scarl_sionna.radar.synthesis.phase import FrameGrid, delay_terms, phasor
from scarl_sionna.signal.front_end.echoes import beat_frequency, echo_transfer, filter_delay, through_channels
from scarl_sionna.signal.processing import RangeDoppler, coupling
from scarl_sionna.signal.receivers import response_weights
from scarl_sionna.signal.uneven import middle_time
from scarl_sionna.signal.windows import window_values

from .lobes import (
    STEPS_PER_BIN,
    Lobe,
    above,
    lobe_at,
    lobe_of,
    sides_of,
    turned,
    without_main,
    wrapped,
)

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
_FieldsT = TypeVar("_FieldsT", bound="npt.NDArray[np.complexfloating]")
Index = npt.NDArray[np.int64]
Cells = npt.NDArray[np.int32]

_CELLS_PER_BLOCK, _PATHS_PER_BLOCK, _PATHS_AT_ONCE = 1_000_000, 1 << 14, 1 << 13
MAX_REACH = 32
"""Bins to which a window's sidelobes are followed: Hann's are 95 dB down there, those without a window 40 dB. Those of
a code do not fall: they are followed all the way."""


@dataclass(frozen=True, eq=False)
class PathCells:
    """Places of paths in the map and their fields in every channel.

    Attributes
    ----------
    beat_bin, doppler_bin : ndarray of float64, shape (num_paths,)
        Beat frequency before the compensation of motion, and Doppler, in bins of the map without zero padding; Doppler
        is within [0, num_chirps), 0 at rest.
    kept : ndarray of bool, shape (num_paths,)
        False for paths that the receiver's filter removes.
    response : ndarray of float64, shape (num_range_bins,)
        Weights over what is sampled whose transform is the response over range.
    reach : int or None
        Bins to which the sidelobes over range are followed; None for all.
    loss : ndarray of complex128, shape (num_paths,)
        What the receiver's filters leave of the amplitude, and of symbols Doppler within their window.
    """

    radar: RadarSpec
    beat_bin: Array
    doppler_bin: Array
    kept: npt.NDArray[np.bool_]
    range_lobe: Array
    doppler_lobe: Array
    doppler_window: Array
    response: Array
    reach: int | None
    loss: Complex
    paths: RadarPaths

    @classmethod
    def of(
        cls, paths: RadarPaths, radar: RadarSpec, window: str | None = "hann", doppler_window: str | None = None
    ) -> PathCells:
        """Return the places of paths, as `range_doppler` has them after its compensation of motion."""
        window = "rect" if window is None else window
        response, waveform, sampled, radar = response_weights(radar, window), radar.waveform, radar, seen_by(radar)
        seconds = waveform.repetitions / waveform.spacing if is_coded(waveform) else 0.0
        length = paths.length
        grid = FrameGrid(radar)
        _, over_x, over_y, _ = grid.expand(*delay_terms(length, paths.length_rate, paths.length_acceleration), 0)
        weights = window_values(window if doppler_window is None else doppler_window, radar.num_chirps)
        beat = over_x if radar is sampled else beat_frequency(sampled, 0.5 * length, 0.5 * paths.length_rate)
        doppler_bin = turned(over_y * radar.doppler_interval * radar.num_chirps, radar.num_chirps)
        return cls(
            radar=radar,
            beat_bin=over_x * radar.num_samples / radar.sample_rate
            + filter_delay(sampled, window) * radar.sampled_bandwidth,
            doppler_bin=doppler_bin,
            kept=(length < 2.0 * radar.max_range) | (not radar.waveform.sweep.video),
            range_lobe=lobe_of(response),
            doppler_lobe=lobe_of(weights),
            doppler_window=weights,
            response=response,
            reach=None if is_coded(waveform) and not waveform.divides else MAX_REACH,
            loss=np.sinc(over_y * seconds) * echo_transfer(sampled, beat, window),
            paths=paths,
        )

    def range_bin(self, index: Index, doppler: float | Array) -> Array:
        """Return the places over range in the row of a Doppler frequency [Hz], not padded, modulo num_samples.

        Of each path's own rows, if `doppler` has the shape (len(index), num_rows).
        """
        radar = self.radar
        removed = np.asarray(doppler) * coupling(radar) * radar.num_samples / radar.sample_rate
        beat = np.take(self.beat_bin, index)
        if removed.ndim > 1:
            beat = np.repeat(beat, removed.shape[1]).reshape(removed.shape)
        return turned(np.copysign(1.0, radar.waveform.sweep.slope) * (beat - removed), radar.num_samples)

    def fields(self, index: Index, distance: float, doppler: float) -> npt.NDArray[np.complex128]:
        """Return beat amplitudes with their phases at mid-frame [sqrt(W)], shape (len(index), num_virtual).

        `distance` [m] and `doppler` [Hz] are those of the map's cell: what its motion does between the transmitters is
        removed, and what its distance does between their carriers.
        """
        tx = np.repeat(np.arange(self.radar.num_tx), self.radar.num_rx)
        after = np.array([self.radar.tx_delay(int(number)) for number in tx])
        higher = np.array([self.radar.tx_frequency(int(number)) for number in tx])
        delay = 2.0 * distance / SPEED_OF_LIGHT + doppler * middle_time(self.radar) / self.radar.center_frequency
        return np.asarray(self._middle[index] * phasor(-doppler * after - higher * delay))

    def _removed(self, delay: Array) -> Array | float:
        """Return the residual video phase that the filter of coded ramps takes off [cycles]."""
        waveform = self.radar.waveform
        if not isinstance(waveform, PcFmcw) or waveform.coding == "across":
            return 0.0
        return 0.5 * waveform.chirp_slope * delay**2

    @cached_property
    def range_sides(self) -> Array:
        """Response over range to many bins, as :func:`sides_of` has it."""
        return sides_of(self.response, self.reach)

    @cached_property
    def doppler_sides(self) -> Array:
        """Response over Doppler to many bins, as :func:`sides_of` has it."""
        return sides_of(self.doppler_window, MAX_REACH)

    @cached_property
    def _middle(self) -> npt.NDArray[np.complex128]:
        """Fields of all paths at mid-frame [sqrt(W)], shape (num_paths, num_virtual)."""
        return self.put_middle(np.empty((len(self.kept), self.radar.num_virtual), dtype=np.complex128))

    def put_middle(self, out: _FieldsT) -> _FieldsT:
        """Fill the fields of all paths at mid-frame [sqrt(W)] into an array (num_paths, num_virtual), and return it."""
        radar = self.radar
        for block in in_blocks(len(self.kept), _PATHS_PER_BLOCK):
            pairs = PairTerms.of(self.paths.select(block), radar)
            put = self._put_linear if pairs.is_linear else self._put_bent
            put(pairs, self.loss[block], out[block])
            if radar.front_end.channels is not None:
                out[block] = through_channels(out[block], radar.front_end.channels, radar.num_tx)
        return out

    def _put_bent(self, pairs: PairTerms, loss: Complex, out: npt.NDArray[np.complexfloating]) -> None:
        """Fill the fields of paths of any motion."""
        grid, radar = FrameGrid(self.radar), self.radar
        for tx in range(radar.num_tx):
            for rx in range(radar.num_rx):
                terms = delay_terms(*pairs.start(tx, rx))
                middle = terms[0] + grid.center_time(tx) * terms[1]
                cycles = grid.expand(*terms, tx)[0] + self._removed(middle) + radar.tx_frequency(tx) * middle
                amplitude = pairs.geometry.pair_amplitude(tx, rx) * pairs.growth(tx, rx, grid.center_time(tx))
                out[:, tx * radar.num_rx + rx] = amplitude * loss * phasor(cycles)

    def _put_linear(self, pairs: PairTerms, loss: Complex, out: npt.NDArray[np.complexfloating]) -> None:
        """Fill the fields of paths whose every pair has a rate and nothing else: the same, in a third of the time."""
        grid, radar, sweep = FrameGrid(self.radar), self.radar, self.radar.waveform.sweep
        for block in in_blocks(len(loss), _PATHS_AT_ONCE):
            sent, heard = pairs.shares(block)
            for tx, (length, rate, strength) in enumerate(sent):
                time = grid.center_time(tx)
                amplitude = pairs.geometry.amplitude[block] * (strength * loss[block])
                for rx, (more, faster, stronger) in enumerate(heard):
                    whole = rate + faster
                    delay = length + more + time * whole
                    delay /= SPEED_OF_LIGHT + 0.5 * whole
                    tone = grid.center_frequency + radar.tx_frequency(tx) - (0.5 * sweep.video * sweep.slope) * delay
                    turned = phasor(tone * delay + self._removed(delay))
                    turned *= stronger
                    np.multiply(turned, amplitude, out=out[block, tx * radar.num_rx + rx], casting="same_kind")

    def _stepped_lobe(self, x: Array, y: Array) -> Array:
        """Return how well a tone `x` range and `y` Doppler bins off adds up over chirps with own carriers."""
        radar = self.radar
        steps, chirp = np.asarray(radar.waveform.chirp_frequencies), np.arange(radar.num_chirps)
        cycles = np.outer(y / radar.num_chirps, chirp) + np.outer(x / radar.sampled_bandwidth, steps)
        return np.asarray(np.abs(phasor(cycles) @ self.doppler_window))

    def near(self, distance: float, radial_velocity: float) -> tuple[Index, Array]:
        """Return the paths whose main lobe covers a range [m] and a velocity [m/s], and the lobe's value there."""
        radar = self.radar
        doppler = 2.0 * radial_velocity * radar.center_frequency / SPEED_OF_LIGHT
        y = wrapped(doppler * radar.doppler_interval * radar.num_chirps - self.doppler_bin, radar.num_chirps)
        steps = radar.waveform.chirp_frequencies
        wide = np.inf if steps is not None else len(self.doppler_lobe)
        index = np.flatnonzero((np.abs(y) * STEPS_PER_BIN < wide) & self.kept)
        x = wrapped(distance / radar.range_resolution - self.range_bin(index, doppler), radar.num_samples)
        weight = lobe_at(self.range_lobe, x)
        if steps is None:
            weight *= lobe_at(self.doppler_lobe, y[index])
        else:
            index, x, weight = index[weight != 0.0], x[weight != 0.0], weight[weight != 0.0]
            weight *= self._stepped_lobe(x, y[index])
        return index[weight != 0.0], weight[weight != 0.0]


@dataclass(frozen=True, eq=False)
class CellSpread:
    """Fields of all paths, ready to be put onto the cells of a map."""

    cells: PathCells
    field: npt.NDArray[np.complex64]
    shape: tuple[int, int]

    @classmethod
    def of(cls, rd: RangeDoppler, paths: RadarPaths) -> CellSpread:
        """Return the fields of paths in the channels of a map."""
        cells = PathCells.of(paths, rd.radar, *rd.window)
        # the power of a channel does not depend on the phase that TDM adds to it, the same for all paths of a row
        field = cells.put_middle(np.empty((paths.num_paths, rd.radar.num_virtual), dtype=np.complex64))
        field[~cells.kept] = 0.0
        return cls(cells, field, (rd.data.shape[1], rd.data.shape[2]))

    def power(self, index: Index, limit: float | None = None) -> tuple[Index, Array]:
        """Return the cells that some paths fill, flat and rising, and their power there, the mean of the channels [W].

        Parameters
        ----------
        index : ndarray of int64
        limit : float, optional
            Sidelobes of the paths' strongest cell down to this power are put onto the cells as well [W], along the
            range and along the Doppler axis, of all but paths too weak together. Left out: main lobes only.
        """
        filled = np.zeros(len(self._total), dtype=np.bool_)
        self._put(index, self._footprint, self._num_cells(*self._main), filled)
        used, found = self._found(filled)
        highest = float(found.max(initial=0.0))
        if limit is not None and highest:
            arms = self._arms(float(np.sqrt(limit / highest)))
            if arms is not None:
                size = self._size[index]
                rising = np.argsort(size)
                few = np.cumsum(size[rising]) * arms.highest < 0.5 * np.sqrt(limit)
                self._put(index[np.sort(rising[~few])], arms.footprint, arms.num_cells, filled)
                used, found = self._found(filled)
        self._total[used] = 0.0
        some = np.flatnonzero(found)
        return used[some], found[some]

    @cached_property
    def _size(self) -> Array:
        """Amplitude of each path, its root mean square over the channels [sqrt(W)]."""
        return np.asarray(np.sqrt(np.mean(np.abs(self.field) ** 2, axis=1)))

    def _arms(self, level: float) -> _Arms | None:
        """Return the sidelobes above a level of the amplitude; None if there are none."""
        wide = [above(side, level) for side in (self.cells.doppler_sides, self.cells.range_sides)]
        main = len(self.cells.doppler_lobe), len(self.cells.range_lobe)
        if all(len(lobe) <= count for lobe, count in zip(wide, main, strict=True)):
            return None
        highest = max(float(np.abs(lobe[count:]).max(initial=0.0)) for lobe, count in zip(wide, main, strict=True))
        beside = [Lobe(without_main(lobe, count), count) for lobe, count in zip(wide, main, strict=True)]
        return _Arms(self, beside[0], beside[1], highest)

    def _put(self, index: Index, footprint: _Footprint, num_cells: int, filled: npt.NDArray[np.bool_]) -> None:
        """Add the fields of paths to those in the `num_cells` cells of their footprints, and mark these as filled."""
        total, place = self._total, self._place
        for block in _blocks(index, num_cells):
            arms = footprint(block)
            touched = np.zeros(len(total), dtype=np.bool_)
            reached = [arm.reached(len(total)) for arm in arms]
            for _, cells in reached:
                touched[cells] = True
            filled |= touched
            used = np.flatnonzero(touched)
            place[used] = np.arange(len(used), dtype=np.int32)
            rows = [
                np.take(place[cells], number[arm.first], axis=0).reshape(len(block), -1)
                for arm, (number, cells) in zip(arms, reached, strict=True)
            ]
            weights = [arm.weight.reshape(len(block), -1) for arm in arms]
            row, weight = (parts[0] if len(parts) == 1 else np.concatenate(parts, axis=1) for parts in (rows, weights))
            starts = np.arange(len(block) + 1, dtype=np.int32) * np.int32(row.shape[1])
            spread = csc_array((weight.ravel(), row.ravel(), starts), shape=(len(used), len(block)))
            field = np.take(self.field, block, axis=0).astype(np.complex128)
            total[used] += spread @ field.view(np.float64)

    def _found(self, filled: npt.NDArray[np.bool_]) -> tuple[Index, Array]:
        """Return the cells that were filled, and the power of what was put onto them."""
        used = np.flatnonzero(filled)
        fields = self._total[used]
        return used, np.einsum("cf,cf->c", fields, fields) / self.field.shape[1]

    @cached_property
    def _place(self) -> npt.NDArray[np.int32]:
        """Room for the numbers of cells among those that a block of paths fills."""
        return np.empty(len(self._total), dtype=np.int32)

    @cached_property
    def _total(self) -> Array:
        """Real and imaginary parts of the field in every cell and channel, zeros between the sums of two groups."""
        return np.zeros((self.shape[0] * self.shape[1], 2 * self.field.shape[1]))

    def _footprint(
        self, index: Index, doppler_lobe: Lobe | None = None, range_lobe: Lobe | None = None
    ) -> list[_Footing]:
        """Return where each path's lobe is and its value there."""
        radar = self.cells.radar
        num_doppler, num_range = self.shape
        over_doppler, over_range = doppler_lobe or self._main[0], range_lobe or self._main[1]
        row, by_row = over_doppler.at(self.cells.doppler_bin[index], radar.num_chirps, num_doppler)
        row = row[:, None] + over_doppler.columns(radar.num_chirps, num_doppler)
        rows = (np.arange(2 * num_doppler) + num_doppler // 2) % num_doppler  # a lobe goes around once at most
        doppler = (rows - num_doppler // 2) / (num_doppler * radar.doppler_interval)
        place = self.cells.range_bin(index, np.take(doppler, row))
        first, weight = over_range.at(place, radar.num_samples, num_range, by_row)
        first += np.take(rows * num_range, row)
        columns = over_range.columns(radar.num_samples, num_range).astype(np.int32)
        return [_Footing(first, columns, num_range, weight)]

    def _num_cells(self, doppler_lobe: Lobe, range_lobe: Lobe) -> int:
        """Return how many cells a path's footprint has."""
        radar, (num_doppler, num_range) = self.cells.radar, self.shape
        rows = len(doppler_lobe.columns(radar.num_chirps, num_doppler))
        return rows * len(range_lobe.columns(radar.num_samples, num_range))

    @cached_property
    def _main(self) -> tuple[Lobe, Lobe]:
        """Main lobes over Doppler and over range."""
        return Lobe(self.cells.doppler_lobe), Lobe(self.cells.range_lobe)


@dataclass(frozen=True, eq=False)
class _Arms:
    """Sidelobes of paths along both axes, through their main lobes; `highest` is the highest sidelobe."""

    spread: CellSpread
    beside_doppler: Lobe
    beside_range: Lobe
    highest: float

    @property
    def num_cells(self) -> int:
        """Cells of each path's sidelobes."""
        spread, (doppler_lobe, range_lobe) = self.spread, self.spread._main
        return spread._num_cells(doppler_lobe, self.beside_range) + spread._num_cells(self.beside_doppler, range_lobe)

    def footprint(self, index: Index) -> list[_Footing]:
        """Return where each path's sidelobes are and their values there."""
        along = self.spread._footprint(index, None, self.beside_range)
        return along + self.spread._footprint(index, self.beside_doppler, None)


@dataclass(frozen=True, eq=False)
class _Footing:
    """Cells of lobes over range, in some rows of each of some paths.

    Attributes
    ----------
    first : ndarray of int64, shape (num_paths, num_rows)
        Flat cell at which each lobe starts.
    columns : ndarray of int32, shape (num_columns,)
        How far a lobe's bins are after that at which it starts, around the axis once at most.
    num_bins : int
        Of the axis over range.
    weight : ndarray of float64, shape (num_paths, num_rows, num_columns)
    """

    first: Index
    columns: Cells
    num_bins: int
    weight: Array

    def reached(self, num_cells: int) -> tuple[Cells, Cells]:
        """Return the number of each flat cell among those at which lobes start, and all cells of the lobes there.

        Shapes (num_cells,), of other cells anything, and (num_starts, num_columns). Many paths share few cells.
        """
        used = np.zeros(num_cells, dtype=np.bool_)
        used[self.first.ravel()] = True
        starts = np.flatnonzero(used).astype(np.int32)
        number = np.empty(num_cells, dtype=np.int32)
        number[starts] = np.arange(len(starts), dtype=np.int32)
        cells = starts[:, None] + self.columns
        beyond = np.int32(self.num_bins) - starts % np.int32(self.num_bins)  # columns from there on go around
        late = np.flatnonzero(beyond <= self.columns.max(initial=0))
        cells[late] -= np.int32(self.num_bins) * (self.columns >= beyond[late, None])
        return number, cells


_Footprint = Callable[[Index], list[_Footing]]


def _blocks(index: Index, num_cells: int) -> list[Index]:
    """Return paths with so many cells each in blocks of a bounded number of cells."""
    width = max(1, _CELLS_PER_BLOCK // max(1, num_cells))
    return [index[block] for block in in_blocks(len(index), width)]
