r"""Signal of one pair of antennas as non-uniform transforms, with its derivatives and their adjoints.

With strengths a, tones (c, f_x, f_y) and weights w of paths the signal is

.. math:: s(x, y) = \sum_r S_r(x, y) \sum_p a_p w_{rp} e^{j 2 \pi (c_p + f_{xp} x + f_{yp} y)}

a type-1 transform a term. Its derivatives to the tones are the same transforms, times x or y; the adjoint of each is
the type-2 transform of the same points, so that both agree to rounding, whatever the tolerance.
"""

from __future__ import annotations

import threading
from typing import NamedTuple

import finufft
import numpy as np
import numpy.typing as npt

from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.radar.synthesis.nufft import EPS_TO_ERROR, FFTW_ESTIMATE, TRANSFORM_SHARE
from scarl_sionna.radar.synthesis.phase import FrameGrid, beat_cycles, phasor

from .columns import Columns, Delays, delays, delays_forward, delays_reverse
from .series import Factors, Series

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]

MAX_TOGETHER = 8
"""Terms transformed at once: their spectra stay in a buffer that is used again."""


class Tones(NamedTuple):
    """Paths about the middle of a frame: constant [cycles], frequencies over x and y [Hz], and factors of the rest."""

    constant: Array
    over_x: Array
    over_y: Array
    factors: Factors


class Expansion:
    """From lengths and rates of paths to tones about the middle of a transmitter's frame, with derivatives."""

    def __init__(self, radar: RadarSpec, tx: int) -> None:
        self._radar, self._grid = radar, FrameGrid(radar)
        self._time = self._grid.center_time(tx)

    def _delays(self, columns: Columns) -> tuple[Array, Array, Array]:
        """Return delay and rate at the middle, and bend."""
        delay, rate, bend = delays(columns)
        time = self._time
        return delay + time * (rate + 0.5 * time * bend), rate + time * bend, bend

    def tones(self, columns: Columns) -> Tones:
        """Return the tones of paths."""
        grid, sweep = self._grid, self._radar.waveform.sweep
        delay, rate, bend = self._delays(columns)
        over_y = rate * (grid.center_frequency - sweep.slope * delay)
        level = 1.0 + self._time * columns.growth
        factors = Factors(rate, grid.bend(delay, bend), level, columns.growth)
        return Tones(beat_cycles(self._radar, delay, grid.ts_center), over_y + sweep.slope * delay, over_y, factors)

    def forward(self, columns: Columns, change: Columns) -> Tones:
        """Return how the tones change with the columns (the amplitude does not count)."""
        grid, slope, time = self._grid, self._radar.waveform.sweep.slope, self._time
        parts = delays_forward(columns, change)
        middle, rate = parts[0] + time * (parts[1] + 0.5 * time * parts[2]), parts[1] + time * parts[2]
        delay, own_rate, bend = self._delays(columns)
        frequency = grid.center_frequency - slope * delay
        over_y = rate * frequency - own_rate * slope * middle
        share = slope / grid.center_frequency
        bent = parts[2] * (1.0 - share * delay) - bend * share * middle
        factors = Factors(rate, bent, time * change.growth, change.growth)
        return Tones(frequency * middle, over_y + slope * middle, over_y, factors)

    def reverse(self, columns: Columns, gradient: Tones) -> Columns:
        """Return the adjoint of :meth:`forward`; its amplitude is 0."""
        grid, slope, time = self._grid, self._radar.waveform.sweep.slope, self._time
        delay, own_rate, bend = self._delays(columns)
        frequency = grid.center_frequency - slope * delay
        share = slope / grid.center_frequency
        over_y, factors = gradient.over_y + gradient.over_x, gradient.factors
        middle = frequency * gradient.constant + slope * gradient.over_x - own_rate * slope * over_y
        middle = middle - bend * share * factors.bend
        rate = frequency * over_y + factors.rate
        curved = (1.0 - share * delay) * factors.bend + time * (rate + 0.5 * time * middle)
        motion = delays_reverse(columns, Delays(middle, rate + time * middle, curved))
        return Columns(np.zeros_like(columns.amplitude), *motion, factors.growth + time * factors.level)


class PairTransform:
    """Transforms of one series, for every pair of a radar."""

    def __init__(self, radar: RadarSpec, series: Series, tolerance: float) -> None:
        self._series, self._radar, self._grid = series, radar, FrameGrid(radar)
        eps = TRANSFORM_SHARE * tolerance / EPS_TO_ERROR["complex128"] / len(series.screens) ** 0.5
        self._eps = min(max(eps, 1e-14), 0.01)
        self._expansions = [Expansion(radar, tx) for tx in range(radar.num_tx)]
        count = len(series.screens)
        self._together = -(-count // -(-count // MAX_TOGETHER))
        self._local = threading.local()

    def value(self, columns: Columns, tx: int) -> Complex:
        """Return the signal of a pair [sqrt(W)], shape (num_chirps, num_samples)."""
        tones = self._expansions[tx].tones(columns)
        strength = columns.amplitude * self._turned(tones)
        return self._sum(tones, strength * self._series.weights(tones.factors))

    def forward(self, columns: Columns, change: Columns, tx: int) -> Complex:
        """Return how the signal of a pair changes with the columns, to first order."""
        series, expansion = self._series, self._expansions[tx]
        tones, slope = expansion.tones(columns), expansion.forward(columns, change)
        weights, turned = series.weights(tones.factors), self._turned(tones)
        strength, cycles = columns.amplitude * turned, 2j * np.pi
        bent = sum(part * step for part, step in zip(series.weight_slopes(tones.factors), slope.factors, strict=True))
        rows = (change.amplitude * turned + cycles * slope.constant * strength) * weights + strength * bent
        over_x, over_y = (cycles * step * strength for step in (slope.over_x, slope.over_y))
        if series.is_steady:  # then the weights are of level 1, and growth is q = x + y
            over_x, over_y = (over + slope.factors.growth * strength for over in (over_x, over_y))
        out = self._sum(tones, rows)
        out += self._grid.x * self._sum(tones, over_x * weights)
        out += self._grid.y[:, None] * self._sum(tones, over_y * weights)
        return out

    def reverse(self, columns: Columns, gradient: Complex, tx: int) -> Columns:
        """Return the adjoint of :meth:`forward` for a change of the signal, shape (num_chirps, num_samples)."""
        series, expansion = self._series, self._expansions[tx]
        tones = expansion.tones(columns)
        weights, turned = series.weights(tones.factors), self._turned(tones)
        strength = columns.amplitude * turned
        found = self._adjoint(tones, gradient)
        whole, over_x, over_y = np.einsum("rp,krp->kp", weights, found)
        cycles = 2j * np.pi * strength
        of_weights = (strength * np.conj(found[0])).real
        parts = [np.einsum("rp,rp->p", slope, of_weights) for slope in series.weight_slopes(tones.factors)]
        if series.is_steady:
            parts[3] = (strength * np.conj(over_x + over_y)).real
        back = [(cycles * np.conj(part)).real for part in (whole, over_x, over_y)]
        out = expansion.reverse(columns, Tones(back[0], back[1], back[2], Factors._make(parts)))
        return out._replace(amplitude=np.conj(turned) * whole)

    def _turned(self, tones: Tones) -> Complex:
        """Return each tone at the transform's mode 0, which is half a mode off the middle of an even count."""
        (turn_x, turn_y), radar = self._turns(tones), self._radar
        half_x, half_y = 0.5 * (1 - radar.num_samples % 2), 0.5 * (1 - radar.num_chirps % 2)
        return phasor(tones.constant + half_x * turn_x + half_y * turn_y)

    def _turns(self, tones: Tones) -> tuple[Array, Array]:
        """Return the turns of tones from sample to sample and from chirp to chirp."""
        return tones.over_x / self._radar.sample_rate, tones.over_y * self._radar.doppler_interval

    def _sum(self, tones: Tones, rows: Complex) -> Complex:
        """Return the sum of tones with a row of strengths a term, each times its screen."""
        plan, screens = self._plan(1, tones), self._series.screens
        out = np.zeros(screens.shape[1:], dtype=np.complex128)
        spectra = np.empty((self._together, *screens.shape[1:]), dtype=np.complex128)
        for first in range(0, len(screens), self._together):
            chosen = _padded(rows[first : first + self._together], self._together)
            plan.execute(chosen, out=spectra)
            for spectrum, screen in zip(spectra, screens[first:], strict=False):
                spectrum *= screen
                out += spectrum
        return out

    def _adjoint(self, tones: Tones, gradient: Complex) -> Complex:
        """Return the adjoint of :meth:`_sum`, without weight and times x and y, shape (3, num_terms, num_paths)."""
        plan, screens = self._plan(2, tones), self._series.screens
        out = np.zeros((3, len(screens), len(tones.constant)), dtype=np.complex128)
        seen = np.zeros((self._together, *screens.shape[1:]), dtype=np.complex128)
        weights: list[Array] = [np.ones(1), self._grid.x, self._grid.y[:, None]]
        for row, weight in zip(out, weights, strict=True):
            above = np.conj(gradient * weight)
            for first in range(0, len(screens), self._together):
                chosen = screens[first : first + self._together]
                np.multiply(chosen, above, out=seen[: len(chosen)])
                row[first : first + len(chosen)] = plan.execute(seen).reshape(self._together, -1)[: len(chosen)]
        return np.conj(out, out=out)

    def _plan(self, kind: int, tones: Tones) -> finufft.Plan:
        """Return the calling thread's plan with the tones as its points: type 1, or 2 for its adjoint."""
        plans = self._local.__dict__.setdefault("plans", {})
        if kind not in plans:
            plans[kind] = finufft.Plan(
                kind,
                (self._radar.num_chirps, self._radar.num_samples),
                n_trans=self._together,
                eps=self._eps,
                isign=1,
                dtype="complex128",
                nthreads=1,
                fftw=FFTW_ESTIMATE,
                upsampfac=1.25 if self._eps > 1e-8 else 2.0,
            )
        turn_x, turn_y = (2.0 * np.pi * (turns - np.rint(turns)) for turns in self._turns(tones))
        plans[kind].setpts(turn_y, turn_x)
        return plans[kind]


def _padded(rows: Complex, count: int) -> Complex:
    """Return rows, with zeros up to a count."""
    if len(rows) < count:
        rows = np.concatenate([rows, np.zeros((count - len(rows), rows.shape[1]), dtype=np.complex128)])
    return np.ascontiguousarray(rows)
