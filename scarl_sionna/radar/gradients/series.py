r"""What a path's signal has beyond a tone over fast and slow time, as a short series of known screens.

About the middle of a frame a path is a tone, times a factor of the rate u and the bend b of its delay and of the growth
g of its strength,

.. math:: R(u, b, g; x, y) = e^{j 2 \pi \rho(u, b; x, y)} (A + g q)
          = \sum_r w_r(u, b, g) \, S_r(x, y), \quad q = x + y

with Chebyshev polynomials in the weights w. Their derivatives are known, so the derivative of the signal is a sum of
the same transforms, and so is its adjoint.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.radar.synthesis.nufft import SERIES_SHARE, Chebyshev, num_nodes
from scarl_sionna.radar.synthesis.phase import FrameGrid, phasor

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]

LEAST_RATE_PHASE, LEAST_BEND_PHASE = 1e-3, 1e-2
"""Phases [rad] that the intervals of rate and bend span at least: a series over a point would have no derivative."""
SLOPE_SHARE = 1e-4
"""Nodes resolve the series to this share of the tolerance, since derivatives weigh term n by up to n**2."""
COARSE = 17
"""Samples along each axis of a frame from which the size of a term is found: the screens are smooth."""


class Factors(NamedTuple):
    """What the weights of paths depend on, shape (num_paths,) each.

    Attributes
    ----------
    rate : ndarray of float64
        Of the delay at the middle of the frame.
    bend : ndarray of float64
        Of the delay, scaled as :meth:`FrameGrid.bend` has it [1/s].
    level : ndarray of float64
        Strength at the middle of the frame over that at its start.
    growth : ndarray of float64
        Of the strength over that at the start [1/s].
    """

    rate: Array
    bend: Array
    level: Array
    growth: Array


class Box(NamedTuple):
    """Intervals of the rate and of the bend of some paths, and the largest growth.

    The edges are rounded outwards to an eighth of the width, so that small steps of a fit stay in one box.
    """

    rates: tuple[float, float]
    bends: tuple[float, float]
    growth: float

    @classmethod
    def of(cls, radar: RadarSpec, factors: Factors) -> Box:
        """Return the box of factors of any shape, of a width at which the series has derivatives."""
        fastest = float(np.abs(factors.rate).max())
        per_rate, per_bend = residual_scales(radar, fastest)
        growth = float(np.abs(factors.growth).max())
        return cls(
            _interval(factors.rate, LEAST_RATE_PHASE / per_rate),
            _interval(factors.bend, LEAST_BEND_PHASE / per_bend),
            2.0 ** math.ceil(math.log2(growth)) if growth else 0.0,
        )


def residual_scales(radar: RadarSpec, fastest: float) -> tuple[float, float]:
    """Return bounds on what the residual phase changes with the rate [rad] and with the bend [rad s]."""
    grid = FrameGrid(radar)
    slope, fast, span = abs(radar.waveform.sweep.slope), max(grid.reach[0], 0.5 / radar.sample_rate), _span(grid)
    per_rate = 2.0 * np.pi * slope * span * (fast + fastest * span)
    return per_rate, np.pi * (grid.center_frequency + slope * fast) * span**2


@dataclass(frozen=True, eq=False)
class Series:
    """Terms that the paths of one box need.

    Attributes
    ----------
    rate, bend : Chebyshev
    orders : ndarray of int, shape (num_terms, 3)
        In rate, bend and growth.
    screens : ndarray of complex128, shape (num_terms, num_chirps, num_samples)
    span : float
        Largest time from the frame's middle [s]: growth counts over it.
    """

    rate: Chebyshev
    bend: Chebyshev
    orders: npt.NDArray[np.intp]
    screens: Complex
    span: float

    @property
    def is_steady(self) -> bool:
        """Whether there is no term for growth: all strengths stay."""
        return not self.orders[:, 2].any()

    @classmethod
    def of(cls, radar: RadarSpec, box: Box, tolerance: float) -> Series:
        """Return the series for the paths of a box, to a tolerance."""
        grid = FrameGrid(radar)
        per_rate, per_bend = residual_scales(radar, max(map(abs, box.rates)))
        span, middle = _span(grid), grid.center_frequency
        widths = 0.5 * (box.rates[1] - box.rates[0]), 0.5 * (box.bends[1] - box.bends[0])
        counts = _counts(widths[0] * per_rate, widths[1] * per_bend, SLOPE_SHARE * tolerance)
        rate, bend = Chebyshev(*box.rates, counts[0]), Chebyshev(*box.bends, counts[1])
        # error of the derivatives over their size: those of the tone, which a term's T_n' <= n**2 stands against
        gain = [widths[0] * 2.0 * np.pi * middle * span, widths[1] * np.pi * middle * span**2]
        size = np.abs(_screens(grid, rate, bend, None)).max(axis=(2, 3))[..., None]
        size = size * np.array([1.0, span * box.growth][: 2 if box.growth else 1])
        n, m = np.arange(counts[0])[:, None, None], np.arange(counts[1])[None, :, None]
        counted = (size * np.maximum(1.0, np.maximum(n**2 / gain[0], m**2 / gain[1]))).ravel()
        by_size = np.argsort(counted, kind="stable")
        dropped = int(np.searchsorted(np.cumsum(counted[by_size]), 0.5 * SERIES_SHARE * tolerance))
        orders = np.stack(np.unravel_index(np.sort(by_size[dropped:]), size.shape), axis=1)
        return cls(rate, bend, orders, _screens(grid, rate, bend, orders), span)

    def weights(self, factors: Factors) -> Array:
        """Return each term's weights, shape (num_terms, num_paths)."""
        return self._product(self.rate.polynomials(factors.rate), self.bend.polynomials(factors.bend), factors)

    def _product(self, over_rate: Array, over_bend: Array, factors: Factors) -> Array:
        n, m, grows = self.orders.T
        strength = np.stack([factors.level, self.span * factors.growth])
        return np.asarray(over_rate[n] * over_bend[m] * strength[grows])

    def weight_slopes(self, factors: Factors) -> tuple[Array, Array, Array, Array]:
        """Return the derivatives of the weights to rate, bend, level and growth, (num_terms, num_paths) each."""
        rate, bend = self.rate.polynomials(factors.rate), self.bend.polynomials(factors.bend)
        none, one = np.zeros_like(factors.level), np.ones_like(factors.level)
        return (
            self._product(_slopes(self.rate, factors.rate, rate), bend, factors),
            self._product(rate, _slopes(self.bend, factors.bend, bend), factors),
            self._product(rate, bend, factors._replace(level=one, growth=none)),
            self._product(rate, bend, factors._replace(level=none, growth=one)),
        )


def num_terms(radar: RadarSpec, box: Box, tolerance: float) -> int:
    """Return about how many terms the series of a box has: half of all products of the orders, some more for growth."""
    per_rate, per_bend = residual_scales(radar, max(map(abs, box.rates)))
    widths = 0.5 * (box.rates[1] - box.rates[0]), 0.5 * (box.bends[1] - box.bends[0])
    counts = _counts(widths[0] * per_rate, widths[1] * per_bend, tolerance)
    return int(np.ceil(0.5 * counts[0] * counts[1] * (1.5 if box.growth else 1.0)))


def _counts(rate_phase: float, bend_phase: float, tolerance: float) -> list[int]:
    return [1 + num_nodes(phase, SERIES_SHARE * tolerance) for phase in (rate_phase, bend_phase)]


def _span(grid: FrameGrid) -> float:
    """Return the largest time from the middle of a frame [s], never 0."""
    return max(sum(grid.reach), 0.5 / grid.radar.sample_rate)


def _interval(values: Array, least: float) -> tuple[float, float]:
    """Return an interval around values, of at least some half-width."""
    low, high = float(values.min()), float(values.max())
    step = 2.0 ** math.ceil(math.log2(max(high - low, 2.0 * least))) / 8.0
    wider = max(0.0, least - 0.5 * (high - low))
    return step * math.floor((low - wider) / step), step * math.ceil((high + wider) / step)


def _slopes(basis: Chebyshev, values: Array, polynomials: Array) -> Array:
    """Return the derivatives of the polynomials at values, shape (count, num_values)."""
    place = polynomials[1] if basis.count > 1 else np.zeros_like(values)
    out = np.zeros_like(polynomials)
    if basis.count > 1:
        out[1] = 1.0
    for order in range(2, basis.count):
        out[order] = 2.0 * polynomials[order - 1] + 2.0 * place * out[order - 1] - out[order - 2]
    return out * (2.0 / (basis.high - basis.low))


def _screens(
    grid: FrameGrid,
    rate: Chebyshev,
    bend: Chebyshev,
    orders: npt.NDArray[np.intp] | None,
) -> Complex:
    """Return the screens of some terms over the frame, or of all without growth at a few of its samples."""
    every = [np.arange(len(axis)) for axis in (grid.y, grid.x)]
    if orders is None:
        every = [np.unique(np.linspace(0, len(a) - 1, min(COARSE, len(a))).round().astype(int)) for a in every]
    rows = np.ix_(*every)
    shape = len(every[0]), len(every[1])
    count = rate.count * bend.count if orders is None else len(orders)
    n, m = np.divmod(np.arange(count), bend.count) if orders is None else (orders[:, 0], orders[:, 1])
    out = np.zeros((count, *shape), dtype=np.complex128)
    for share, place in zip(bend.coefficients.T, bend.nodes, strict=True):
        values = np.stack([phasor(grid.residual_cycles(u, place)[rows]) for u in rate.nodes])
        over_rate = (rate.coefficients @ values.reshape(rate.count, -1).view(np.float64)).view(np.complex128)
        over_rate = over_rate.reshape(rate.count, *shape)
        for screen, first, second in zip(out, n, m, strict=True):
            screen += share[second] * over_rate[first]
    if orders is None:
        return out.reshape(rate.count, bend.count, *shape)
    out[orders[:, 2] == 1] *= (grid.x[None, :] + grid.y[:, None]) / _span(grid)
    return out
