r"""The beat signal by non-uniform FFT, with range migration kept to a known bound.

Each path is a tone over fast and slow time, times a residual phase that depends on the rate u of its delay (and on its
bend b) and on the sample only: at 70 m/s some 2 rad at the corners of a frame. For every sample that factor is a smooth
function of (u, b), so it is a short series of Chebyshev polynomials in (u, b) with one known screen over the samples
each, and each term of the series is one transform of the same points. With k the largest residual phase [rad] about the
middle of a box, terms from K on hold at most ``2 sum_{n >= K} |J_n(k)|`` of a path's amplitude. A term whose screen is
small needs few digits, so it runs in float32 with a narrow kernel.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import finufft
import numpy as np
import numpy.typing as npt
from scipy.special import jv

from scarl_sionna.core.specs.radar.spec import RadarSpec

from .phase import FrameGrid, delay_terms, phasor

Array = npt.NDArray[np.float64]

TRANSFORM_SHARE, SERIES_SHARE = 0.6, 0.4
"""Shares of the tolerance: the errors of all transforms together, and the terms left out of the series."""
EPS_TO_ERROR = {"complex128": 13.0, "complex64": 15.0, "uneven": 30.0}
"""Measured largest error of a lone tone over the transform's `eps`, at upsampling 1.25."""
SINGLE_ERROR = 4e-4
"""Smallest error that a float32 transform is trusted with: its points are rounded to 2**-24 of a turn, times 512
modes."""
COARSE_ERROR = 5e-3
"""Terms that allow this error go to a transform of their own with a narrower kernel."""


ROWS_AT_ONCE = 4
"""Rows of amplitudes whose signals are made together: bounds the memory."""
FFTW_ESTIMATE = 64
"""Plans chosen without timing: 0 (measure) is 1.7 times faster but takes over 1 s a size and may differ between two
runs."""


@lru_cache(maxsize=512)
def num_nodes(phase: float, tolerance: float) -> int:
    """Return how many Chebyshev nodes interpolate exp(1j * phase * p), p in [-1, 1], within a tolerance."""
    count = max(1, int(phase))  # |J_n(k)| falls with n from n = k on only
    while 4.0 * np.abs(jv(np.arange(count, count + 40), phase)).sum() > tolerance:
        count += 1
    return count


@dataclass(frozen=True, eq=False)
class Chebyshev:
    """Chebyshev polynomials T_0 .. T_(count-1) over an interval."""

    low: float
    high: float
    count: int

    @property
    def nodes(self) -> Array:
        """Roots of T_count, shape (count,)."""
        return 0.5 * (self.low + self.high) + 0.5 * (self.high - self.low) * np.cos(self._angle)

    @property
    def _angle(self) -> Array:
        return (np.arange(self.count) + 0.5) * np.pi / self.count

    @property
    def coefficients(self) -> Array:
        """Matrix from values at the nodes to coefficients of the series, shape (count, count)."""
        matrix = np.cos(np.arange(self.count)[:, None] * self._angle[None, :]) * (2.0 / self.count)
        matrix[0] *= 0.5
        return matrix

    def polynomials(self, values: Array) -> Array:
        """Return the polynomials at values, shape (count, num_values)."""
        out = np.ones((self.count, len(values)))
        if self.count == 1:
            return out
        out[1] = (2.0 * values - (self.low + self.high)) / (self.high - self.low)
        for order in range(2, self.count):
            out[order] = 2.0 * out[1] * out[order - 1] - out[order - 2]
        return out


@dataclass(frozen=True)
class Box:
    """Range of the delay's rate and bend over some paths, and how many terms the series needs in each."""

    rates: tuple[float, float]
    bends: tuple[float, float]
    num_terms: tuple[int, int]
    phases: tuple[float, float]

    @classmethod
    def of(cls, radar: RadarSpec, rate: Array, acceleration: Array, tolerance: float) -> Box:
        """Return the box of some paths (rate and acceleration of their lengths)."""
        grid = FrameGrid(radar)
        _, delay_rate, delay_acceleration = delay_terms(np.zeros_like(rate), rate, acceleration)
        first = delay_rate + grid.center_time(0) * delay_acceleration
        last = delay_rate + grid.center_time(radar.num_tx - 1) * delay_acceleration
        rates = float(np.minimum(first, last).min()), float(np.maximum(first, last).max())
        # the bend is smaller than the acceleration by the delay's part in it, at most that of the largest range
        shrink = float(grid.bend(radar.num_samples / radar.sample_rate + radar.waveform.sweep.duration, 1.0))
        edges = [s * float(e) for s in (1.0, shrink) for e in (delay_acceleration.min(), delay_acceleration.max())]
        bends = min(edges), max(edges)
        phases = tuple(
            float(np.pi * np.ptp([grid.residual_cycles(*low, True), grid.residual_cycles(*high, True)], axis=0).max())
            for low, high in (((rates[0], 0.0), (rates[1], 0.0)), ((0.0, bends[0]), (0.0, bends[1])))
        )
        terms = tuple(num_nodes(phase, SERIES_SHARE * tolerance) for phase in phases)
        return cls(rates, bends, terms, phases)  # type: ignore[arg-type]


class _Tones(NamedTuple):
    """Paths as tones: phase factor, angles a sample and a chirp, and what the series needs, shape (num_paths,) each.

    Of an uneven frame the angles are frequencies over z and q [Hz].
    """

    factor: npt.NDArray[np.complex128]
    x: Array
    y: Array
    rate: Array
    bend: Array


@dataclass(frozen=True, eq=False)
class _Batch:
    """Terms of the series that share one plan: their orders in (u, b), screens (T, chirps, samples) and precision."""

    order: npt.NDArray[np.intp]
    screens: npt.NDArray[np.complexfloating]
    dtype: str
    eps: float


class Transform:
    """The series and the plans that all pairs of a radar share for one bin of paths."""

    def __init__(self, radar: RadarSpec, box: Box, tolerance: float) -> None:
        self._rate = Chebyshev(*box.rates, box.num_terms[0])
        self._bend = Chebyshev(*box.bends, box.num_terms[1])
        self._radar = radar
        self._shape = (radar.num_chirps, radar.num_samples)
        self._grid = FrameGrid(radar)
        self._batches = self._batch(self._grid, tolerance)
        self._local = threading.local()

    def _batch(self, grid: FrameGrid, tolerance: float) -> list[_Batch]:
        """Return the terms of the series, batched by the precision that they need."""
        at_nodes = np.array([[phasor(grid.residual_cycles(u, b)) for b in self._bend.nodes] for u in self._rate.nodes])
        screens = np.einsum(
            "kl,lbs->kbs", self._rate.coefficients, at_nodes.reshape(*at_nodes.shape[:2], -1), optimize=True
        )
        if self._bend.count > 1:
            screens = np.einsum("cb,kbs->kcs", self._bend.coefficients, screens, optimize=True)
        screens = screens.reshape(-1, *self._shape)
        size = np.abs(screens).max(axis=(1, 2))
        by_size = np.argsort(size, kind="stable")
        dropped = by_size[: int(np.searchsorted(np.cumsum(size[by_size]), 0.5 * SERIES_SHARE * tolerance))]
        kept = np.setdiff1d(np.arange(len(size)), dropped)
        allowed = TRANSFORM_SHARE * tolerance / (size[kept] * len(kept) ** 0.5)
        single = (allowed >= SINGLE_ERROR) & grid.even
        coarse = single & (allowed >= COARSE_ERROR)
        batches = []
        for chosen, dtype in ((~single, "complex128"), (single & ~coarse, "complex64"), (coarse, "complex64")):
            if chosen.any():
                eps = float(allowed[chosen].min()) / EPS_TO_ERROR[dtype if grid.even else "uneven"]
                eps = max(eps, 1e-14 if dtype == "complex128" else 1e-5)
                batches.append(_Batch(kept[chosen], screens[kept[chosen]].astype(dtype), dtype, min(eps, 0.01)))
        return batches

    def _plans(self) -> list[finufft.Plan]:
        """Return the calling thread's plans.

        They run on that thread alone, so that sums keep their order: same bytes.
        """
        if not hasattr(self._local, "plans"):
            self._local.plans = [
                finufft.Plan(
                    1 if self._grid.even else 3,
                    self._modes if self._grid.even else 2,
                    n_trans=len(batch.order),
                    eps=batch.eps,
                    isign=1,
                    dtype=batch.dtype,
                    nthreads=1,
                    fftw=FFTW_ESTIMATE,
                    upsampfac=1.25 if batch.eps > 1e-8 else 2.0,
                )
                for batch in self._batches
            ]
        return self._local.plans

    @property
    def _modes(self) -> tuple[int, ...]:
        """Of the regular transform: of a single chirp there is one axis only."""
        return self._shape if self._shape[0] > 1 else self._shape[1:]

    def order(self, length: Array, rate: Array) -> npt.NDArray[np.intp]:
        """Return the order of the paths as it is: finufft sorts them itself."""
        return np.arange(len(length))

    def signal(
        self, amplitude: npt.NDArray[np.complex128], length: Array, rate: Array, acceleration: Array, tx: int
    ) -> npt.NDArray[np.complex128]:
        """Return the noise-free beat signal of one pair [sqrt(W)], shape (num_chirps, num_samples)."""
        return next(iter(self.signals(amplitude[None], length, rate, tx, acceleration)))

    def signals(
        self,
        amplitudes: npt.NDArray[np.complex128],
        length: Array,
        rate: Array,
        tx: int,
        acceleration: Array | None = None,
    ) -> Iterator[npt.NDArray[np.complex128]]:
        """Yield the signal for each row of amplitudes, shape (num_rows, num_paths), of the same paths.

        They are straight if no acceleration is given.
        """
        bending = np.zeros_like(rate) if acceleration is None else acceleration
        tones = self._tones(length, rate, bending, tx)
        for first in range(0, len(amplitudes), ROWS_AT_ONCE):
            yield from self._run(amplitudes[first : first + ROWS_AT_ONCE] * tones.factor, tones)

    def _tones(self, length: Array, rate: Array, acceleration: Array, tx: int) -> _Tones:
        radar, grid = self._radar, self._grid
        delay, delay_rate, delay_acceleration = delay_terms(length, rate, acceleration)
        constant, over_x, over_y, middle_rate = grid.expand(delay, delay_rate, delay_acceleration, tx)
        turn_x = over_x / radar.sample_rate
        turn_y = over_y * radar.doppler_interval
        bent = grid.bend(delay, delay_acceleration)
        if not grid.even:
            return _Tones(phasor(constant), over_x - over_y, over_y, middle_rate, bent)
        # the transform counts modes from -(N // 2); the middle of the samples lies half a mode higher if N is even
        half_x = 0.5 * (1 - radar.num_samples % 2)
        half_y = 0.5 * (1 - radar.num_chirps % 2)
        factor = phasor(constant + half_x * turn_x + half_y * turn_y)
        return _Tones(factor, _angle(turn_x), _angle(turn_y), middle_rate, bent)

    def _run(self, strengths: npt.NDArray[np.complex128], tones: _Tones) -> npt.NDArray[np.complex128]:
        """Return the sums of all tones with their residual phase, shape (num_rows, num_chirps, num_samples)."""
        over_rate = self._rate.polynomials(tones.rate)
        over_bend = self._bend.polynomials(tones.bend)
        out = np.zeros((len(strengths), *self._shape), dtype=np.complex128)
        for batch, plan in zip(self._batches, self._plans(), strict=True):
            real = np.float64 if batch.dtype == "complex128" else np.float32
            if self._grid.even:
                angles = (tones.y, tones.x)[-len(self._modes) :]
                plan.setpts(*(angle.astype(real) for angle in angles))
            else:
                z, q = self._grid.z, self._grid.x + self._grid.y[:, None]
                plan.setpts(2.0 * np.pi * tones.y, 2.0 * np.pi * tones.x, None, q.ravel(), z.ravel())
            weights = []
            for order in batch.order:
                weight = over_rate[order // self._bend.count]
                if self._bend.count > 1:
                    weight = weight * over_bend[order % self._bend.count]
                weights.append(weight.astype(real))
            for signal, strength in zip(out, strengths, strict=True):
                points = strength.astype(batch.dtype)
                weighted = np.empty((len(batch.order), len(points)), dtype=batch.dtype)
                for row, weight in zip(weighted, weights, strict=True):
                    np.multiply(points, weight, out=row)
                spectra = plan.execute(weighted).reshape(batch.screens.shape)
                spectra *= batch.screens
                signal += spectra.sum(axis=0)
        return out


def _angle(turns: Array) -> Array:
    """Return turns as an angle in [-pi, pi]."""
    return 2.0 * np.pi * (turns - np.rint(turns))
