r"""The beat signal of straight paths with one spreading: range migration by a chirp-z transform for every sample.

About the middle of a frame, at ``q = x + y`` and with the Doppler frequency ``alpha = u (f_c - S tau)`` [Hz], a path
without bend has the phase, in cycles,

.. math:: const + S \tau x + \alpha q (1 + S x / f_{ref}) + v\, x q - S u^2 q^2 / 2, \quad
          v = \alpha S (1 / (f_c - S \tau) - 1 / f_{ref}), \quad f_{ref} = f_c - S \tau_{ref}

so migration stretches slow time by a factor that depends on the sample alone. The points are spread once onto a grid
over (S tau, alpha), where alpha is not folded at the Doppler ambiguity; an FFT goes over fast time, and a chirp-z
transform of each sample's row evaluates the stretched slow times exactly. The last two terms, at most 5e-4 rad at 70
m/s and 250 m, are held to first order by terms of their own (weight of the path times a known screen) or left out if
the tolerance allows.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator
from dataclasses import dataclass

import finufft
import numpy as np
import numpy.typing as npt
from scipy import fft

from scarl_sionna.core.arrays.blocks import in_blocks
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.units import SPEED_OF_LIGHT

from .phase import FrameGrid, delay_terms, outer_phasor, phasor
from .spreading import GUARD, KERNEL_CELLS, Spreader, Strips, along

Array = npt.NDArray[np.float64]

SPREAD_SHARE, CORRECTION_SHARE, PHASE_SHARE, BEND_SHARE, ROUNDING_SHARE = 0.3, 0.1, 0.43, 0.02, 0.15
"""Shares of the tolerance: spreading of the main term, of the corrections, the phase that no term holds, the bend of
paths that count as straight, and rounding."""
EPS_TO_ERROR = 8.0
"""Measured largest error of a lone tone over the spreader's `eps`."""
SINGLE_ROUNDING = 1.2e-5
"""Measured largest error of a lone tone from float32 transforms after spreading: rounding, raised by the
deconvolution."""
SINGLE_POINT_ERROR = 2.2e-7
"""Error of a lone tone from float32 points over the cells of both axes: they are rounded to 2**-25 of a turn, two
times. Measured: 2.3e-4 for 768 + 1084 cells."""
MIN_TOLERANCE = 1e-9
"""Smallest tolerance of the method: float64 phases and the table of the kernel's transform hold no more."""
MAX_CELLS = 8_000_000
"""Largest grid: bounds the memory."""
MOST_TURNS = 1.25
"""Turns a sample over which paths are spread without a fold: what lies over more range goes round."""
BLOCK_PATHS = 1 << 14
"""Paths whose phases are worked out at once, so that they stay in the cache."""
EVEN = 32
"""Lengths of Bluestein's transforms are multiples of it: 1331 takes a third longer than 1344."""
BLOCK_VALUES = 1 << 16
"""Values of the chirp-z transform worked on at once, whole rows, so that they stay in the cache."""


@dataclass(frozen=True)
class PathPhase:
    """What the phase of straight paths depends on: arrays over paths."""

    constant: Array
    range_frequency: Array
    doppler: Array
    migration: Array
    squared_rate: Array

    @classmethod
    def of(cls, radar: RadarSpec, length: Array, rate: Array, tx: int, reference: float) -> PathPhase:
        """Return the constant [cycles], S tau and alpha [Hz], v [1/s2] and u squared; `reference` is tau_ref [s]."""
        grid, sweep = FrameGrid(radar), radar.waveform.sweep
        inverse = 1.0 / (SPEED_OF_LIGHT + 0.5 * rate)
        turn = rate * inverse
        delay = length * inverse + grid.center_time(tx) * turn
        beat = sweep.slope * delay
        seen, expected = sweep.video * beat, sweep.video * sweep.slope * reference
        constant = delay * (grid.center_frequency - 0.5 * seen)
        doppler = turn * (grid.center_frequency - seen)
        stretched = sweep.slope * stretch_apart(grid.center_frequency, seen, expected)
        return cls(constant, beat, doppler, doppler * stretched, turn * turn)


def stretch_apart(center: float, seen: npt.NDArray[np.floating], expected: float) -> Array:
    """Return 1 / (f_c - S tau) - 1 / f_ref [s] for beat frequencies that the mixer sees [Hz]."""
    return np.asarray((seen - expected) / ((center - seen) * (center - expected)))


@dataclass(frozen=True)
class Layout:
    """Grid, middle values and correction terms for one group of straight paths.

    Attributes
    ----------
    delay : float
        Reference delay tau_ref [s].
    doppler, squared_rate : tuple of float
        Middle and half the span of alpha [Hz], and of u squared.
    migration : float
        Largest ``abs(v)`` [1/s2].
    terms : tuple of str
        Corrections held: "migration", "square".
    cell : float
        Width of a Doppler cell [Hz].
    strips : Strips
        The grid over fast frequency and Doppler.
    beats : tuple of float
        Smallest and largest S tau [Hz].
    folds : bool
        Whether S tau is taken modulo the sample rate.
    """

    delay: float
    doppler: tuple[float, float]
    squared_rate: tuple[float, float]
    migration: float
    terms: tuple[str, ...]
    phases: dict[str, float]
    cell: float
    strips: Strips
    beats: tuple[float, float]
    folds: bool

    @classmethod
    def of(cls, radar: RadarSpec, length: Array, rate: Array, tolerance: float) -> Layout | None:
        """Return the layout for paths of some lengths and length rates, or None if it cannot hold the tolerance."""
        grid, sweep = FrameGrid(radar), radar.waveform.sweep
        delay = delay_terms(length, rate, np.zeros_like(rate))[0] + grid.center_time(0) * rate / SPEED_OF_LIGHT
        reference = 0.5 * float(delay.min() + delay.max())
        phase = PathPhase.of(radar, length, rate, 0, reference)
        doppler, squared = _middle(phase.doppler), _middle(phase.squared_rate)
        # antennas see other lengths than the array's centre; v follows the delay, where the receiver mixes with ramps
        extent = sum(float(np.linalg.norm(array, axis=1).max()) for array in (radar.tx_array, radar.rx_array))
        extent += grid.tx_delay(radar.num_tx - 1) * float(np.abs(rate).max())
        largest = float(np.abs(phase.doppler).max())
        migration = float(np.abs(phase.migration).max())
        migration += sweep.video * largest * extent * (sweep.slope / sweep.start_frequency) ** 2 / SPEED_OF_LIGHT
        x, q = float(grid.x[-1]), float(grid.x[-1] + grid.y[-1])
        phases = {
            "migration": 2.0 * np.pi * migration * x * q,
            # q squared is taken about its middle
            "square": 0.5 * np.pi * sweep.video * abs(sweep.slope) * squared[1] * q * q,
        }
        budget = PHASE_SHARE * tolerance - 0.5 * sum(phases.values()) ** 2
        terms: list[str] = []
        for name in sorted(phases, key=lambda name: phases[name]):
            if phases[name] <= budget:
                budget -= phases[name]
            else:
                terms.append(name)
        turns, folds = _turns(radar, phase, extent)
        cell, strips = cls._grid(radar, doppler[1] + 1e-6 * largest, (x, q), turns, tolerance)
        if not grid.even or tolerance < MIN_TOLERANCE or budget < 0.0 or strips.rows * strips.columns > MAX_CELLS:
            return None
        beats = float(phase.range_frequency.min()), float(phase.range_frequency.max())
        return cls(reference, doppler, squared, migration, tuple(terms), phases, cell, strips, beats, folds)

    @staticmethod
    def _grid(
        radar: RadarSpec, half_span: float, reach: tuple[float, float], turns: tuple[float, float], tolerance: float
    ) -> tuple[float, Strips]:
        x, q = reach
        stretch = 1.0 + abs(radar.waveform.sweep.slope) * x / radar.waveform.sweep.start_frequency
        upsampling = _upsampling(tolerance)
        cell = 1.0 / (2.0 * upsampling * max(q * stretch, 0.5 / radar.sample_rate))
        rows = max(KERNEL_CELLS, int(np.ceil(upsampling * radar.num_samples)))
        rows = 2 * fft.next_fast_len(-(-rows // 2))
        return cell, Strips.over(rows, (turns[0] * rows, turns[1] * rows), 2.0 * half_span / cell)

    @property
    def num_terms(self) -> int:
        """Number of spreadings and transforms a pair."""
        return 1 + len(self.terms)


def _turns(radar: RadarSpec, phase: PathPhase, extent: float) -> tuple[tuple[float, float], bool]:
    """Return between which turns a sample the beat frequencies of all pairs are, and whether whole turns are taken off.

    `extent` is by how much lengths differ between pairs [m].
    """
    around = abs(radar.waveform.sweep.slope) * extent / SPEED_OF_LIGHT
    low = (float(phase.range_frequency.min()) - around) / radar.sample_rate
    high = (float(phase.range_frequency.max()) + around) / radar.sample_rate
    return ((low, high), False) if high - low <= MOST_TURNS else ((0.0, 1.0), True)


def _middle(values: Array) -> tuple[float, float]:
    """Return the middle and half the span."""
    low, high = float(values.min()), float(values.max())
    return 0.5 * (low + high), 0.5 * (high - low)


def _upsampling(tolerance: float) -> float:
    """Return the grid's fineness over the number of modes: wide kernels lose digits on a coarse grid."""
    return 1.5 if tolerance >= 1e-7 else 2.0


@dataclass(frozen=True, eq=False)
class _Points:
    """Straight paths in the order of strips, shape (num_paths,).

    Attributes
    ----------
    order : ndarray of int, optional
        Places among the paths as given; None if that is their order.
    slices : list of slice
        Of each strip.
    row, column : ndarray of float64
        Cells over range and Doppler.
    factor : ndarray of complex128
        What the amplitudes are turned by.
    weights : dict of str to ndarray of float64
        Of the correction terms that are spread.
    """

    order: npt.NDArray[np.intp] | None
    slices: list[slice]
    row: Array
    column: Array
    factor: npt.NDArray[np.complex128]
    weights: dict[str, Array]


@dataclass(frozen=True, eq=False)
class _Room:
    """Memory that one thread works in: planned spreadings, cells of a strip, rows of samples for each term."""

    plans: list[finufft.Plan]
    spread: list[npt.NDArray[np.complexfloating]]
    folded: list[npt.NDArray[np.complexfloating]]
    samples: list[npt.NDArray[np.complexfloating]]


class Transform:
    """Tables that all pairs of a radar share for one group of straight paths."""

    def __init__(self, radar: RadarSpec, layout: Layout, tolerance: float) -> None:
        self._radar, self._layout, self._grid = radar, layout, FrameGrid(radar)
        self._dtype = np.dtype("complex64" if single_precision(tolerance) else "complex128")
        self._half_square = 0.5 * (self._grid.x[-1] + self._grid.y[-1]) ** 2
        self._spreaders = {"": _spreader(SPREAD_SHARE * tolerance, tolerance, layout.strips.shape)}
        sweep = radar.waveform.sweep
        center = sweep.start_frequency + sweep.slope * (self._grid.ts_center - sweep.video * layout.delay)
        stretch = 1.0 + sweep.slope * self._grid.x / center
        self._video_slope = sweep.video * sweep.slope
        self._by_cell: tuple[Array, Array] | None = None
        for name in layout.terms:
            error = CORRECTION_SHARE * tolerance / len(layout.terms)
            if name == "migration" and self._cell_error(stretch) <= error:
                self._by_cell = self._cell_weights()
            else:
                error /= layout.phases[name]
                self._spreaders[name] = _spreader(min(error, 0.03), tolerance, layout.strips.shape)
        self._length = EVEN * fft.next_fast_len(-(-(layout.strips.columns + radar.num_chirps - 1) // EVEN))
        self._first, self._kernel = self._chirps(stretch)
        self._last = self._screens(stretch)
        self._local = threading.local()

    def _cell_error(self, stretch: Array) -> float:
        """Return the largest error of the migration's correction if its weights are those of cells, not of paths.

        A weight by cell, linear over the cells, is that of the path and, in quadrature, the slope of the logarithm of
        the kernel's transform.
        """
        layout, radar, grid = self._layout, self._radar, self._grid
        if layout.folds:
            return float("inf")
        kernel, rows = self._spreaders[""].kernel_transform(), layout.strips.rows
        q = sum(grid.reach)
        edges = 0.5 * radar.num_samples / rows, layout.cell * q * stretch.max()
        by_range, by_doppler = (
            np.abs(kernel.derivative()(place) / kernel(place)).max() / (2.0 * np.pi)
            for place in (np.linspace(0.0, edge, 65) for edge in edges)
        )
        by_range *= np.ptp(self._stretch_apart(np.array([0.0, radar.sample_rate / rows])))
        by_doppler *= layout.cell
        apart, doppler = np.abs(self._stretch_apart(np.array(layout.beats))).max(), sum(np.abs(layout.doppler))
        error = doppler * by_range + apart * by_doppler + by_range * by_doppler
        return float(2.0 * np.pi * grid.reach[0] * q * error)

    def _stretch_apart(self, beat: npt.NDArray[np.floating]) -> Array:
        """Return v over alpha [1/s] at beat frequencies [Hz]."""
        expected = self._video_slope * self._layout.delay
        sweep = self._radar.waveform.sweep
        return np.asarray(sweep.slope * stretch_apart(self._grid.center_frequency, sweep.video * beat, expected))

    def _cell_weights(self) -> tuple[Array, Array]:
        """Return the factors of the migration's correction over range and over Doppler cells, once for re and im."""
        layout, strips = self._layout, self._layout.strips
        beat = (strips.first_row + np.arange(strips.reach)) * (self._radar.sample_rate / strips.rows)
        doppler = layout.doppler[0] + layout.cell * (np.arange(strips.columns) - strips.columns // 2)
        over_range, over_doppler = self._stretch_apart(beat)[:, None] / layout.migration, np.repeat(doppler, 2)
        real = np.zeros(0, dtype=self._dtype).real.dtype
        return over_range.astype(real), over_doppler.astype(real)

    def _chirps(self, stretch: Array) -> tuple[npt.NDArray[np.complexfloating], npt.NDArray[np.complexfloating]]:
        """Return Bluestein's factors before the convolution (samples, cells) and the kernel's spectrum.

        The spectrum has the shape (samples, length).
        """
        layout, (x, count) = self._layout, (self._grid.x, self._radar.num_samples)
        num_columns, num_chirps = layout.strips.columns, self._radar.num_chirps
        column = np.arange(num_columns) - num_columns // 2
        lag = np.zeros(self._length)
        lag[:num_chirps] = np.arange(num_chirps)
        lag[self._length - num_columns + 1 :] = np.arange(1 - num_columns, 0)
        lag += num_columns // 2 - 0.5 * (num_chirps - 1)
        # the stretch is a straight line over the samples: of its part of a phase a few rows give all others
        step = 0.5 * layout.cell * self._radar.doppler_interval * stretch[[0, 1 if count > 1 else 0]]
        step[1] -= step[0]
        first = outer_phasor(count, step[0] * column**2, step[1] * column**2, self._dtype)
        start = layout.cell * x * stretch
        first *= outer_phasor(num_columns, column[0] * start, start, self._dtype).T
        kernel = outer_phasor(count, -step[0] * lag**2, -step[1] * lag**2, self._dtype)
        return first, fft.fft(kernel, axis=1, overwrite_x=True)

    def _screens(self, stretch: Array) -> list[npt.NDArray[np.complexfloating]]:
        """Return each term's factors on the samples after the convolution, shape (samples, chirps)."""
        radar, layout = self._radar, self._layout
        q = self._grid.x[:, None] + self._grid.y
        slow = q * stretch[:, None]
        chirp = np.arange(radar.num_chirps) - 0.5 * (radar.num_chirps - 1)
        step = layout.cell * radar.doppler_interval * stretch[:, None]
        square = 0.5 * self._video_slope * (q * q - self._half_square)
        base = phasor(0.5 * step * chirp**2 + layout.doppler[0] * slow - layout.squared_rate[0] * square)
        factors: dict[str, Array] = {
            "migration": 2.0 * np.pi * layout.migration * self._grid.x[:, None] * q,
            "square": -2.0 * np.pi * layout.squared_rate[1] * square,
        }
        mode = np.arange(radar.num_samples) - radar.num_samples // 2
        known, screens = {}, []
        for name in ("", *layout.terms):
            spreader = self._spreaders.get(name, self._spreaders[""])
            if spreader not in known:
                kernel = spreader.kernel_transform()
                over_slow = along(kernel, self._grid.x, layout.cell * stretch, self._grid.y)
                known[spreader] = base / (kernel(mode / layout.strips.rows)[:, None] * over_slow)
            values = known[spreader] * (1j * factors[name]) if name else known[spreader]
            screens.append(values.astype(self._dtype))
        return screens

    def signal(
        self, amplitude: npt.NDArray[np.complex128], length: Array, rate: Array, acceleration: Array, tx: int
    ) -> npt.NDArray[np.complexfloating]:
        """Return the noise-free beat signal of one pair [sqrt(W)], shape (num_chirps, num_samples)."""
        return next(self.signals(amplitude[None], length, rate, tx))

    def signals(
        self, amplitudes: npt.NDArray[np.complex128], length: Array, rate: Array, tx: int
    ) -> Iterator[npt.NDArray[np.complexfloating]]:
        """Yield the signal for each row of amplitudes, shape (num_rows, num_paths), of the same paths."""
        points, room = self._points(length, rate, tx), self._room()
        for amplitude in amplitudes:
            self._spread(amplitude if points.order is None else amplitude[points.order], points, room)
            yield self._chirped(room).T

    def order(self, length: Array, rate: Array) -> npt.NDArray[np.intp]:
        """Return the order in which paths are worked on fastest, by lengths and rates between the array centres."""
        layout = self._layout
        phase = PathPhase.of(self._radar, length, rate, 0, layout.delay)
        return layout.strips.order(self._row(phase), self._column(phase))

    def _row(self, phase: PathPhase) -> Array:
        turn = phase.range_frequency / self._radar.sample_rate
        if self._layout.folds:
            turn -= np.floor(turn)
        return turn * self._layout.strips.rows

    def _column(self, phase: PathPhase) -> Array:
        layout = self._layout
        return (phase.doppler - layout.doppler[0]) / layout.cell + layout.strips.columns // 2

    def _points(self, length: Array, rate: Array, tx: int) -> _Points:
        layout, radar, count = self._layout, self._radar, len(length)
        row, column, factor = np.empty(count), np.empty(count), np.empty(count, dtype=np.complex128)
        weights = {name: np.empty(count) for name in self._spreaders if name}
        half = 0.5 * (1 - radar.num_samples % 2) / radar.sample_rate  # the modes are whole numbers from -(N // 2)
        for block in in_blocks(count, BLOCK_PATHS):
            phase = PathPhase.of(radar, length[block], rate[block], tx, layout.delay)
            offset = phase.constant + half * phase.range_frequency
            offset -= (0.5 * self._video_slope * self._half_square) * phase.squared_rate
            factor[block] = phasor(offset)
            row[block], column[block] = self._row(phase), self._column(phase)
            for name, weight in weights.items():
                if name == "migration":
                    weight[block] = phase.migration / layout.migration
                else:
                    weight[block] = (phase.squared_rate - layout.squared_rate[0]) / layout.squared_rate[1]
        slices = layout.strips.slices(column)
        if slices is not None:
            return _Points(None, slices, row, column, factor, weights)
        order = layout.strips.order(row, column)
        row, column, factor = row[order], column[order], factor[order]
        slices = layout.strips.slices(column)
        assert slices is not None  # sorted
        return _Points(order, slices, row, column, factor, {name: value[order] for name, value in weights.items()})

    def _room(self) -> _Room:
        """Return the calling thread's memory and plans, which no other uses: sums keep their order, same bytes."""
        if not hasattr(self._local, "room"):
            strips, spreaders, count = self._layout.strips, self._spreaders.values(), 1 + len(self._layout.terms)
            samples = [np.zeros((self._radar.num_samples, self._length), dtype=self._dtype) for _ in range(count)]
            self._local.room = _Room(
                plans=[spreader.plan(strips.shape) for spreader in spreaders],
                spread=[np.zeros(strips.shape, dtype=spreader.dtype) for spreader in spreaders],
                folded=[np.zeros((strips.rows, strips.shape[1]), dtype=self._dtype) for _ in range(count)],
                samples=samples,
            )
        room: _Room = self._local.room
        return room

    def _spread(self, amplitude: npt.NDArray[np.complex128], points: _Points, room: _Room) -> None:
        """Spread paths and transform over range: the samples of each term over Doppler cells, into `room.samples`."""
        strips, behind = self._layout.strips, 2 * GUARD
        carried: list[npt.NDArray[np.complexfloating]] | None = None  # what a strip reaches into the next, of each term
        for number, inside in enumerate(points.slices):
            done, filled = strips.columns_of(number), inside.stop > inside.start
            if filled:
                self._spread_strip(number, amplitude[inside], points, room)
                for cells, reached in zip(room.folded, carried or [], strict=carried is not None):
                    cells[:, :behind] += reached
            elif carried is not None:
                for cells, reached in zip(room.folded, carried, strict=True):
                    cells[:, :behind], cells[:, behind:] = reached, 0.0
            else:
                for samples in room.samples:
                    samples[:, done] = 0.0
                continue
            carried = [cells[:, strips.width :].copy() for cells in room.folded] if filled else None
            for name, cells, samples in zip(("", *self._layout.terms), room.folded, room.samples, strict=True):
                self._over_range(cells[:, : done.stop - done.start], samples, done)
                if name == "migration" and self._by_cell is not None:
                    weights, twice = self._by_cell[1], slice(2 * done.start, 2 * done.stop)
                    samples.view(weights.dtype)[:, twice] *= weights[twice]

    def _over_range(
        self, cells: npt.NDArray[np.complexfloating], out: npt.NDArray[np.complexfloating], columns: slice
    ) -> None:
        """Transform cells over range, in place, and put them times Bluestein's factors into columns of `out`."""
        found = fft.ifft(cells, axis=0, norm="forward", overwrite_x=True)
        before = self._radar.num_samples // 2
        rest = len(out) - before
        np.multiply(found[len(found) - before :], self._first[:before, columns], out=out[:before, columns])
        np.multiply(found[:rest], self._first[before:, columns], out=out[before:, columns])

    def _spread_strip(self, number: int, amplitude: npt.NDArray[np.complex128], points: _Points, room: _Room) -> None:
        """Put the points of a strip onto each term's cells of it."""
        strips, inside = self._layout.strips, points.slices[number]
        strength = amplitude * points.factor[inside]
        angles: dict[type[np.floating], tuple[Array, Array]] = {}
        targets = dict(zip(("", *self._layout.terms), room.folded, strict=True))
        for (name, spreader), plan, cells in zip(self._spreaders.items(), room.plans, room.spread, strict=True):
            if spreader.real not in angles:
                angles[spreader.real] = strips.angles(points.row[inside], points.column[inside], number, spreader.real)
            values = strength if not name else strength * points.weights[name][inside]
            plan.setpts(*angles[spreader.real])
            plan.execute(values.astype(spreader.dtype, copy=False), out=cells)
            by_cell = None if name or self._by_cell is None else (targets["migration"], self._by_cell[0])
            strips.fold(cells, targets[name], by_cell)

    def _chirped(self, room: _Room) -> npt.NDArray[np.complexfloating]:
        """Return the signal (samples, chirps) from the samples of each term over Doppler cells."""
        count, num_chirps = self._radar.num_samples, self._radar.num_chirps
        out = np.empty((count, num_chirps), dtype=self._dtype)
        for block in in_blocks(count, max(1, BLOCK_VALUES // self._length)):
            for number, (samples, screen) in enumerate(zip(room.samples, self._last, strict=True)):
                spectrum = fft.fft(samples[block], axis=1)
                spectrum *= self._kernel[block]
                values = fft.ifft(spectrum, axis=1, overwrite_x=True)[:, :num_chirps]
                if number:
                    out[block] += values * screen[block]
                else:
                    np.multiply(values, screen[block], out=out[block])
        return out


def is_straight(radar: RadarSpec, acceleration: Array, tolerance: float) -> npt.NDArray[np.bool_]:
    """Return which paths, by the second derivative of their length [m/s2], bend by less than the tolerance can tell."""
    grid = FrameGrid(radar)
    q = sum(grid.reach)
    # the largest phase is pi f_c b q**2; twice that bounds the small terms beside it
    phase = (2.0 * np.pi * grid.center_frequency * q * q / SPEED_OF_LIGHT) * np.abs(acceleration)
    return phase <= BEND_SHARE * tolerance


def single_precision(tolerance: float) -> bool:
    """Return whether the transforms after spreading may run in float32."""
    return ROUNDING_SHARE * tolerance >= SINGLE_ROUNDING


def _spreader(error: float, tolerance: float, shape: tuple[int, int]) -> Spreader:
    """Return the spreading that keeps a lone tone within an error."""
    dtype = "complex64" if error >= SINGLE_POINT_ERROR * sum(shape) else "complex128"
    return Spreader(dtype, min(max(error / EPS_TO_ERROR, 1e-14), 0.01), _upsampling(tolerance))
