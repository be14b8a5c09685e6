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
from functools import lru_cache

import finufft
import numpy as np
import numpy.typing as npt
from scipy import fft
from scipy.interpolate import CubicSpline

from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.units import SPEED_OF_LIGHT

from .phase import FrameGrid, delay_terms, phasor

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
KERNEL_CELLS, KERNEL_SHIFTS = 64, 8
"""Grid and shifts of the point on which the spreading kernel is measured."""
BLOCK_VALUES = 1 << 17
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
        constant, over_x, doppler, middle_rate = grid.expand(*delay_terms(length, rate, np.zeros_like(rate)), tx)
        beat = over_x - doppler
        seen, expected = sweep.video * beat, sweep.video * sweep.slope * reference
        difference = (seen - expected) / ((grid.center_frequency - seen) * (grid.center_frequency - expected))
        return cls(constant, beat, doppler, doppler * sweep.slope * difference, middle_rate**2)


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
    shape : tuple of int
        Cells over fast frequency and Doppler.
    """

    delay: float
    doppler: tuple[float, float]
    squared_rate: tuple[float, float]
    migration: float
    terms: tuple[str, ...]
    phases: dict[str, float]
    cell: float
    shape: tuple[int, int]

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
            "square": 0.5
            * np.pi
            * sweep.video
            * abs(sweep.slope)
            * squared[1]
            * q
            * q,  # q squared is taken about its middle
        }
        budget = PHASE_SHARE * tolerance - 0.5 * sum(phases.values()) ** 2
        terms: list[str] = []
        for name in sorted(phases, key=lambda name: phases[name]):
            if phases[name] <= budget:
                budget -= phases[name]
            else:
                terms.append(name)
        cell, shape = cls._grid(radar, doppler[1] + 1e-6 * largest, x, q, tolerance)
        if not grid.even or tolerance < MIN_TOLERANCE or budget < 0.0 or shape[0] * shape[1] > MAX_CELLS:
            return None
        return cls(reference, doppler, squared, migration, tuple(terms), phases, cell, shape)

    @staticmethod
    def _grid(
        radar: RadarSpec, half_span: float, x: float, q: float, tolerance: float
    ) -> tuple[float, tuple[int, int]]:
        stretch = 1.0 + abs(radar.waveform.sweep.slope) * x / radar.waveform.sweep.start_frequency
        upsampling = _upsampling(tolerance)
        cell = 1.0 / (2.0 * upsampling * max(q * stretch, 0.5 / radar.sample_rate))
        # no path may reach round the edge of the unfolded axis: room for the widest kernel
        columns = max(KERNEL_CELLS, 2 * int(half_span / cell + 0.5 * KERNEL_CELLS / 2))
        rows = max(KERNEL_CELLS, int(np.ceil(upsampling * radar.num_samples)))
        return cell, (2 * fft.next_fast_len(-(-rows // 2)), columns + columns % 2)

    @property
    def num_terms(self) -> int:
        """Number of spreadings and transforms a pair."""
        return 1 + len(self.terms)


def _middle(values: Array) -> tuple[float, float]:
    """Return the middle and half the span."""
    low, high = float(values.min()), float(values.max())
    return 0.5 * (low + high), 0.5 * (high - low)


def _upsampling(tolerance: float) -> float:
    """Return the grid's fineness over the number of modes: wide kernels lose digits on a coarse grid."""
    return 1.5 if tolerance >= 1e-7 else 2.0


@dataclass(frozen=True)
class _Spreader:
    """Precision of one term's spreading, and the Fourier transform of its kernel."""

    dtype: str
    eps: float
    upsampling: float

    def plan(self, shape: tuple[int, int]) -> finufft.Plan:
        """Return a plan that only spreads."""
        return finufft.Plan(
            1, shape, eps=self.eps, isign=1, dtype=self.dtype, nthreads=1, upsampfac=self.upsampling, spreadinterponly=1
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


class Transform:
    """Tables that all pairs of a radar share for one group of straight paths."""

    def __init__(self, radar: RadarSpec, layout: Layout, tolerance: float) -> None:
        self._radar, self._layout, self._grid = radar, layout, FrameGrid(radar)
        self._dtype = np.dtype("complex64" if single_precision(tolerance) else "complex128")
        self._half_square = 0.5 * (self._grid.x[-1] + self._grid.y[-1]) ** 2
        self._spreaders = [_spreader(SPREAD_SHARE * tolerance, tolerance, layout.shape)]
        for name in layout.terms:
            error = CORRECTION_SHARE * tolerance / (len(layout.terms) * layout.phases[name])
            self._spreaders.append(_spreader(min(error, 0.03), tolerance, layout.shape))
        sweep = radar.waveform.sweep
        center = sweep.start_frequency + sweep.slope * (self._grid.ts_center - sweep.video * layout.delay)
        stretch = 1.0 + sweep.slope * self._grid.x / center
        self._video_slope = sweep.video * sweep.slope
        self._length = fft.next_fast_len(layout.shape[1] + radar.num_chirps - 1)
        self._first, self._kernel = self._chirps(stretch)
        self._last = self._screens(stretch)
        self._local = threading.local()

    def _chirps(self, stretch: Array) -> tuple[npt.NDArray[np.complexfloating], npt.NDArray[np.complexfloating]]:
        """Return Bluestein's factors before the convolution (samples, cells) and the kernel's spectrum.

        The spectrum has the shape (samples, length).
        """
        num_columns, num_chirps = self._layout.shape[1], self._radar.num_chirps
        step = self._layout.cell * self._radar.doppler_interval * stretch[:, None]
        column = np.arange(num_columns) - num_columns // 2
        # the grid's first row is half a turn off: one sign for every mode
        mode = np.arange(self._radar.num_samples) - self._radar.num_samples // 2
        start = (self._layout.cell * self._grid.x * stretch)[:, None]
        first = phasor(column * (start + 0.5 * step * column) + 0.5 * mode[:, None])
        lag = np.zeros(self._length)
        lag[:num_chirps] = np.arange(num_chirps)
        lag[self._length - num_columns + 1 :] = np.arange(1 - num_columns, 0)
        lag += num_columns // 2 - 0.5 * (num_chirps - 1)
        kernel = phasor(-0.5 * step * lag**2)
        return first.astype(self._dtype), fft.fft(kernel, axis=1, overwrite_x=True).astype(self._dtype)

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
        screens = []
        for name, spreader in zip((None, *layout.terms), self._spreaders, strict=True):
            kernel = spreader.kernel_transform()
            values = base / (kernel(mode / layout.shape[0])[:, None] * kernel(layout.cell * slow))
            if name is not None:
                values *= 1j * factors[name]
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
        radar, layout = self._radar, self._layout
        phase = PathPhase.of(radar, length, rate, tx, layout.delay)
        turn = phase.range_frequency / radar.sample_rate
        half = 0.5 * (1 - radar.num_samples % 2)  # the modes are whole numbers from -(N // 2)
        square = phase.squared_rate - layout.squared_rate[0]
        offset = phase.constant + half * turn - (0.5 * self._video_slope * self._half_square) * phase.squared_rate
        turned = phasor(offset)
        over_range = 2.0 * np.pi * (turn - np.rint(turn))
        over_doppler = (2.0 * np.pi / (layout.cell * layout.shape[1])) * (phase.doppler - layout.doppler[0])
        weights = {"migration": (phase.migration, layout.migration), "square": (square, layout.squared_rate[1])}
        plans = self._plans()
        for spreader, plan in zip(self._spreaders, plans, strict=True):
            plan.setpts(over_range.astype(spreader.real), over_doppler.astype(spreader.real))
        for amplitude in amplitudes:
            strength = amplitude * turned
            out = np.zeros((radar.num_samples, radar.num_chirps), dtype=self._dtype)
            for name, spreader, plan, screen in zip(
                (None, *layout.terms), self._spreaders, plans, self._last, strict=True
            ):
                values = strength if name is None else strength * (weights[name][0] / weights[name][1])
                self._add(out, plan.execute(values.astype(spreader.dtype)).astype(self._dtype, copy=False), screen)
            yield out.T

    def _plans(self) -> list[finufft.Plan]:
        """Return the calling thread's plans.

        They run on that thread alone, so that sums keep their order: same bytes.
        """
        if not hasattr(self._local, "plans"):
            self._local.plans = [spreader.plan(self._layout.shape) for spreader in self._spreaders]
        return self._local.plans

    def _add(
        self,
        out: npt.NDArray[np.complexfloating],
        cells: npt.NDArray[np.complexfloating],
        screen: npt.NDArray[np.complexfloating],
    ) -> None:
        """Add one term's transform of the spread cells (range, Doppler) to `out` (samples, chirps)."""
        count, (num_chirps, num_rows) = len(out), (out.shape[1], len(cells))
        rows = fft.ifft(cells, axis=0, norm="forward", overwrite_x=True)
        many = max(1, BLOCK_VALUES // self._length)
        for start in range(0, count, many):
            block = slice(start, min(start + many, count))
            source = (np.arange(block.start, block.stop) - count // 2) % num_rows
            values = rows[source]
            values *= self._first[block]
            spectrum = fft.fft(values, n=self._length, axis=1)
            spectrum *= self._kernel[block]
            values = fft.ifft(spectrum, axis=1, overwrite_x=True)[:, :num_chirps]
            out[block] += values * screen[block]


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


def _spreader(error: float, tolerance: float, shape: tuple[int, int]) -> _Spreader:
    """Return the spreading that keeps a lone tone within an error."""
    dtype = "complex64" if error >= SINGLE_POINT_ERROR * sum(shape) else "complex128"
    return _Spreader(dtype, min(max(error / EPS_TO_ERROR, 1e-14), 0.01), _upsampling(tolerance))
