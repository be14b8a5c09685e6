"""Cells that hold targets: their channels' values at the target's own range and Doppler, and what these stand for."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.units import SPEED_OF_LIGHT

from ..peaks import tone_offset
from ..processing import RangeDoppler, bins_a_hertz
from .subbin import ToneAxis, fit_tones

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.intp]
Phasors = npt.NDArray[np.complex128]

_VALUES_A_BLOCK = 4_000_000


def is_regular(radar: RadarSpec) -> bool:
    """Return whether a map is a plain transform of even chirps, so that a point is one tone over both its axes.

    By definition; not so for ramps of different carriers and for chirps at uneven times.
    """
    waveform = radar.waveform
    return waveform.burst == 1 and waveform.chirp_frequencies is None and waveform.chirp_delays is None


@dataclass(frozen=True, eq=False)
class Cells:
    """Targets in cells of a map.

    Attributes
    ----------
    rd : RangeDoppler
    row, column : ndarray of int, shape (num_targets,)
        Over Doppler and range.
    offset : (ndarray, ndarray) of float64, shape (num_targets,)
        Of the target from the cell over Doppler and range [bins].
    fold : ndarray of int64, shape (num_targets,)
        Unambiguous intervals to add to the velocity.
    own : ndarray of complex128, shape (num_targets, num_virtual), or None
        The channels' values at the targets' own range and Doppler, where they were found otherwise than in the map
        [sqrt(W)].
    num_intervals : int
        Unambiguous intervals that are told apart, which velocities stay within.
    told : ndarray of float64, shape (num_targets,), or None
        Unambiguous intervals that each velocity is known modulo; None: one.
    """

    rd: RangeDoppler
    row: Index
    column: Index
    offset: tuple[Array, Array]
    fold: npt.NDArray[np.int64]
    own: Phasors | None = None
    num_intervals: int = 1
    told: Array | None = None

    @classmethod
    def of(cls, rd: RangeDoppler, power: npt.NDArray[np.float32], row: Index, column: Index) -> Cells:
        """Return cells with the offsets that their neighbours' powers tell; 0 over slow time of a single chirp."""
        return cls(rd, row, column, peak_offsets(rd, power, (row, column)), np.zeros(len(row), dtype=np.int64))

    @classmethod
    def joined(cls, first: Cells, second: Cells) -> Cells:
        """Return the targets of both, of one map; their channels' values are those of the map."""
        row, column, fold = (
            np.concatenate([getattr(part, name) for part in (first, second)]) for name in ("row", "column", "fold")
        )
        offset = tuple(np.concatenate(axes) for axes in zip(first.offset, second.offset, strict=True))
        told = np.concatenate([part.period for part in (first, second)])
        return replace(first, row=row, column=column, offset=(offset[0], offset[1]), fold=fold, own=None, told=told)

    def select(self, index: npt.NDArray[np.integer] | npt.NDArray[np.bool_]) -> Cells:
        """Return some of the targets."""
        offset = (self.offset[0][index], self.offset[1][index])
        own = None if self.own is None else self.own[index]
        row, column, fold = self.row[index], self.column[index], self.fold[index]
        return replace(self, row=row, column=column, offset=offset, fold=fold, own=own, told=self.period[index])

    def wrapped(self) -> Cells:
        """Return the cells with velocities within the intervals that are told apart.

        A target in the upper half of the last bin is seen below the first row: the next interval is its own, and its
        range is compensated with that one. By definition of the transform over even chirps; others stay as they are.
        """
        if self.own is not None or not is_regular(self.rd.radar):
            return self
        rows = len(self.rd.radial_velocity)
        cycles = (self.row - rows // 2 + self.offset[0]) / rows + self.fold
        beyond = np.floor(cycles / self.num_intervals + 0.5).astype(np.int64) * (rows > 1)
        return replace(self, fold=self.fold - self.num_intervals * beyond)

    @property
    def period(self) -> Array:
        """Unambiguous intervals that velocities are known modulo, shape (num_targets,)."""
        return np.ones(len(self.row)) if self.told is None else self.told

    @property
    def doppler(self) -> Array:
        """Doppler frequencies [Hz], shape (num_targets,)."""
        rows = len(self.rd.radial_velocity)
        cycles = (self.row - rows // 2 + self.offset[0]) / rows + self.fold
        return np.asarray(cycles / self.rd.radar.slow_interval)

    @property
    def distance(self) -> Array:
        """Ranges [m], shape (num_targets,); what noise puts before the radar is at 0."""
        rd = self.rd
        step = rd.range[1] - rd.range[0] if len(rd.range) > 1 else rd.radar.max_range
        aliased = self.fold * (bins_a_hertz(rd.radar, rd.data.shape[2]) / rd.radar.slow_interval)
        return np.asarray(np.maximum((self.column + self.offset[1] - aliased) * step, 0.0))

    @property
    def radial_velocity(self) -> Array:
        """Radial velocities [m/s], shape (num_targets,)."""
        interval, rows = 2.0 * self.rd.radar.unambiguous_velocity, len(self.rd.radial_velocity)
        return np.asarray(self.rd.radial_velocity[self.row] + (self.offset[0] / rows + self.fold) * interval)

    @property
    def snapshot(self) -> Phasors:
        """The channels' values in the cells, without what the targets' motion does between transmitters [sqrt(W)].

        Shape (num_targets, num_virtual).
        """
        if self.own is not None:
            return self.own
        data = self.rd.data[:, self.row, self.column].T.astype(np.complex128)
        rows = len(self.rd.radial_velocity)
        removed = (self.row - rows // 2) / (rows * self.rd.radar.slow_interval) if self.rd.is_compensated else 0.0
        return np.asarray(data * _turns(self, self.doppler - removed) * _carriers(self, self.offset[1]))


def peak_offsets(rd: RangeDoppler, power: npt.NDArray[np.float32], index: tuple[Index, ...]) -> tuple[Array, Array]:
    """Return how far tones are from cells over Doppler and range [bins], by the powers beside; see :class:`Cells`.

    By definition of the windows. `power` is over Doppler, range and whatever else `index` has, such as beams.
    """
    (row, column, *other), (num_doppler, num_range) = index, power.shape[:2]
    below, here, above = (power[((row + step) % num_doppler, column, *other)] for step in (-1, 0, 1))
    doppler = tone_offset(below, here, above, rd.window[1], rd.radar.num_doppler_bins, num_doppler)
    below, here, above = (power[(row, np.clip(column + step, 0, num_range - 1), *other)] for step in (-1, 0, 1))
    distance = tone_offset(below, here, above, rd.window[0], rd.radar.num_range_bins, num_range)
    return (doppler if num_doppler > 1 else np.zeros(len(row))), distance


def transmit_delays(radar: RadarSpec) -> Array:
    """Return the start of every channel's chirps after the first transmitter's [s], shape (num_virtual,)."""
    return np.repeat([radar.tx_delay(tx) for tx in range(radar.num_tx)], radar.num_rx)


def _turns(cells: Cells, doppler: Array) -> Phasors:
    """Return phasors (num_targets, num_virtual) that undo what Doppler frequencies [Hz] do between transmitters."""
    if not cells.rd.is_compensated:
        return np.ones((len(doppler), cells.rd.radar.num_virtual), dtype=np.complex128)
    return np.asarray(np.exp(-2j * np.pi * np.multiply.outer(doppler, transmit_delays(cells.rd.radar))))


def _carriers(cells: Cells, place: Array) -> Phasors | float:
    """Return phasors (num_targets, num_virtual) that undo what places over range [bins] do between carriers."""
    radar, rd = cells.rd.radar, cells.rd
    if radar.multiplexing.shares_band:
        return 1.0
    delay = place * (2.0 * radar.max_range / (SPEED_OF_LIGHT * rd.data.shape[2]))
    higher = np.repeat([radar.tx_frequency(tx) for tx in range(radar.num_tx)], radar.num_rx)
    return np.asarray(np.exp(-2j * np.pi * np.multiply.outer(delay, higher)))


def beat_place(cells: Cells) -> Array:
    """Return the places over range that targets have before the compensation of motion [bins], shape (num_targets,).

    By definition of :func:`bins_a_hertz`; the map knows of no intervals, so the row's own Doppler frequency counts.
    """
    shift = bins_a_hertz(cells.rd.radar, cells.rd.data.shape[2]) if cells.rd.is_compensated else 0.0
    return np.asarray(cells.column + cells.offset[1] + shift * replace(cells, fold=np.zeros_like(cells.fold)).doppler)


def at_targets(
    cells: Cells, data: npt.NDArray[np.complex64], weights: Phasors, noise_power: float
) -> tuple[Cells, Phasors, Array]:
    """Return where targets are between bins, and the channels' values there.

    Parameters
    ----------
    cells : Cells
    data : ndarray of complex64, shape (num_virtual, num_doppler_bins, num_range_bins)
        The map's, from :func:`~scarl_sionna.signal.processing.uncompensated` [sqrt(W)]; not used where the map is no
        plain transform (:func:`is_regular`).
    weights : ndarray of complex128, shape (num_targets, num_virtual)
        Of the channels, towards the target; they sum to 1 over its phasors, dimensionless.
    noise_power : float
        Of a cell of one channel [W].

    Returns
    -------
    cells : Cells
        The same with the offsets of the tones that fit best.
    snapshot : ndarray of complex128, shape (num_targets, num_virtual)
        [sqrt(W)].
    noise_power : ndarray of float64, shape (num_targets,)
        Of a value of it [W].

    Notes
    -----
    By definition: every cell is a linear combination of the samples, and so are the ones between bins. In the map a
    target's range differs from row to row, by the compensation of each row's own motion; that is undone first. Where a
    map is no plain transform (:func:`is_regular`), the cells' own values and offsets are taken.
    """
    if cells.own is not None:
        return cells, cells.own, noise_power / range_gain(cells)
    if not is_regular(cells.rd.radar):
        gain = straddle_gain(cells)
        return cells, cells.snapshot / np.sqrt(gain)[:, None], noise_power / gain
    rd, axes = cells.rd, ToneAxis.of(cells.rd)
    shift = bins_a_hertz(rd.radar, rd.data.shape[2]) if rd.is_compensated else 0.0
    folded, beat = replace(cells, fold=np.zeros_like(cells.fold)), beat_place(cells)
    column = np.rint(beat).astype(np.int64)
    offset, snapshot, noise = np.empty((2, len(beat))), np.empty((len(beat), len(rd.data)), dtype=np.complex128), []
    block = max(1, _VALUES_A_BLOCK // (len(rd.data) * len(axes[0].offset) * len(axes[1].offset)))
    for first in range(0, len(beat), block):
        own = slice(first, first + block)
        values = patches(cells.select(np.arange(len(beat))[own]), data)
        beam = np.einsum("nc,cnab->nab", weights[own], values)
        beam_noise = noise_power * np.sum(np.abs(weights[own]) ** 2, axis=1)
        tone = fit_tones(beam, beam_noise, *axes, (cells.offset[0][own], (beat - column)[own]))
        patch_weight = tone.doppler_weight[:, :, None] * tone.range_weight[:, None, :]
        snapshot[own] = np.einsum("cnab,nab->nc", values, patch_weight)  # one product: NumPy's own order took 500 times
        offset[:, own] = tone.doppler_offset, tone.range_offset
        noise.append(noise_power * tone.noise_gain)
    moved = replace(folded, offset=(offset[0], offset[1]))
    found = column + offset[1] - shift * moved.doppler - cells.column
    found = np.mod(found + 0.5 * data.shape[2], data.shape[2]) - 0.5 * data.shape[2]
    moved = replace(cells, offset=(offset[0], found)).wrapped()
    snapshot *= _turns(cells, moved.doppler - cells.doppler) * _carriers(cells, column + offset[1] - beat)
    return moved, snapshot, np.concatenate([*noise, np.zeros(0)])


def patches(cells: Cells, data: npt.NDArray[np.complex64]) -> Phasors:
    """Return the map around cells, at the offsets of :class:`~scarl_sionna.signal.detection.subbin.ToneAxis`.

    Shape (num_virtual, num_targets, num_doppler_cells, num_range_cells) [sqrt(W)], with phases at the middle of the
    frame and without what the targets' motion does between transmitters; by definition. `data` as for
    :func:`at_targets`.
    """
    axes, beat = ToneAxis.of(cells.rd), beat_place(cells)
    rows = (cells.row[:, None] + axes[0].offset) % data.shape[1]
    columns = (np.rint(beat).astype(np.int64)[:, None] + axes[1].offset) % data.shape[2]
    values = data[:, rows[:, :, None], columns[:, None, :]] * (axes[0].turn[:, None] * axes[1].turn)
    return np.asarray(values * (_turns(cells, cells.doppler) * _carriers(cells, beat)).T[:, :, None, None])


def range_gain(cells: Cells) -> Array:
    """Return the power of tones in their nearest range bins before the compensation of motion over that between bins.

    By definition of the window over range.
    """
    place, axis = beat_place(cells), ToneAxis.of(cells.rd)[1]
    return np.asarray(np.maximum(axis.response(place - np.rint(place))[:, len(axis.offset) // 2], 1e-6) ** 2)


def straddle_gain(cells: Cells) -> Array:
    """Return the power of tones in their cells over that between the bins, by definition of the windows."""
    gain = np.ones(len(cells.row))
    for axis, offset in zip(ToneAxis.of(cells.rd), cells.offset, strict=True):
        gain *= np.maximum(axis.response(offset)[:, len(axis.offset) // 2], 1e-6) ** 2
    return gain
