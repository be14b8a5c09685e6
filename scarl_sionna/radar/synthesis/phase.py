r"""Phase of the beat signal of one path, exact and expanded about the middle of the frame.

The delay of a path of length L, rate L' and acceleration L'' is, at the time t of reception since the first ramp's
start,

.. math:: \tau(t) = \tau_0 + u t + b t^2 / 2, \quad
          (\tau_0, u, b) = (L, L', L'') / (c + L'/2)

which for one radar and one point in straight motion along the line of sight is the exact 2 (R + v t) / (c + v), and the
beat signal's phase in cycles, at the time ts since the ramp's own start, is ``f0 tau + S tau ts - S tau**2 / 2``.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.units import SPEED_OF_LIGHT

Array = npt.NDArray[np.float64]

ROWS = 32
"""Of :func:`outer_phasor`: changes no result beyond rounding."""


def chirps_of(radar: RadarSpec, first: int, count: int) -> RadarSpec:
    """Return the radar with some of its chirps only; the delays of their starts stay."""
    return radar.with_(waveform=radar.waveform.chirps(first, count))


def delay_terms(length: Array, rate: Array, acceleration: Array) -> tuple[Array, Array, Array]:
    """Return delay [s], its rate and its acceleration [1/s] at the first ramp's start."""
    speed = SPEED_OF_LIGHT + 0.5 * rate
    return length / speed, rate / speed, acceleration / speed


def beat_cycles(radar: RadarSpec, delay: Array, ts: Array | float, step: Array | float = 0.0) -> Array:
    """Return the phase of the beat signal in cycles, exact; `step` is the chirp's carrier above the mean one [Hz]."""
    sweep = radar.waveform.sweep
    return (sweep.start_frequency + step) * delay + sweep.slope * delay * (ts - 0.5 * sweep.video * delay)


def phasor(cycles: Array, dtype: npt.DTypeLike = np.complex128) -> npt.NDArray[Any]:
    """Return exp(2j pi cycles) as complex128, to 1e-15, or as complex64, to 1e-7.

    From the tangent of half the angle: where NumPy has it for eight numbers at once (AVX-512) it takes a tenth of the
    time of a cosine and a sine, elsewhere no longer than these.
    """
    out = np.empty(cycles.shape, dtype=dtype)
    turn = cycles - np.rint(cycles)
    tangent = np.tan(np.pi * turn.astype(out.real.dtype, copy=False))
    twice = 2.0 / (1.0 + tangent * tangent)
    np.subtract(twice, 1.0, out=out.real)
    np.multiply(twice, tangent, out=out.imag)
    return out


def outer_phasor(
    count: int, start: Array, step: Array, dtype: npt.DTypeLike = np.complex128
) -> npt.NDArray[np.complexfloating]:
    """Return exp(2j pi (start + n step)) for n = 0 to `count` - 1, shape (count, *start.shape), to three roundings.

    Every `ROWS`-th row, and the first `ROWS`, are worked out; the others are products of two.
    """
    coarse, fine = np.arange(0, count, ROWS)[:, None], np.arange(min(ROWS, count))[:, None]
    rows = phasor(start + coarse * step, dtype)[:, None] * phasor(fine * step, dtype)
    return rows.reshape(-1, *start.shape)[:count]


@dataclass(frozen=True)
class FrameGrid:
    """Sampling times of a frame about its middle.

    A sample is at ``ts = ts_center + x`` in its ramp, and its ramp starts at ``t_center + y + tx_delay`` in the frame,
    with a carrier that is higher by `step`. The sample's frequency is ``slope * z`` above the middle one.
    """

    radar: RadarSpec

    @cached_property
    def x(self) -> Array:
        """Fast time about the middle of the samples [s], shape (num_samples,)."""
        count = self.radar.num_samples
        return np.asarray((np.arange(count) - (count - 1) / 2.0) / self.radar.sample_rate, dtype=np.float64)

    @cached_property
    def y(self) -> Array:
        """Slow time about the middle of the chirps [s], shape (num_chirps,)."""
        count, offsets = self.radar.num_chirps, self.radar.waveform.chirp_delays
        even = np.asarray((np.arange(count) - (count - 1) / 2.0) * self.radar.doppler_interval, dtype=np.float64)
        return even if offsets is None else even + np.asarray(offsets)

    @property
    def step(self) -> Array:
        """Carriers of the chirps above the mean one [Hz], shape (num_chirps,)."""
        steps = self.radar.waveform.chirp_frequencies
        return np.zeros(self.radar.num_chirps) if steps is None else np.asarray(steps)

    @property
    def even(self) -> bool:
        """Whether chirps follow each other at equal times with one carrier: what regular transforms need."""
        waveform = self.radar.waveform
        return waveform.chirp_delays is None and waveform.chirp_frequencies is None

    @property
    def z(self) -> Array:
        """Frequencies of the samples over the slope [s], shape (num_chirps, num_samples), or (num_samples,) if even."""
        return self.x if self.even else self.x + self.step[:, None] / self.radar.waveform.sweep.slope

    @property
    def reach(self) -> tuple[float, float]:
        """Largest absolute values of x and of y [s]."""
        return float(self.x[-1]), float(self.y[-1]) if self.even else float(np.abs(self.y).max())

    @property
    def ts_center(self) -> float:
        """Middle of the samples in a ramp [s]."""
        return self.radar.waveform.sweep.first + (self.radar.num_samples - 1) / (2.0 * self.radar.sample_rate)

    def tx_delay(self, tx: int) -> float:
        """Start of a transmitter's ramps after the first transmitter's [s]."""
        return self.radar.tx_delay(tx)

    def starts(self, tx: int) -> Array:
        """Return when a transmitter's chirps start in the frame [s], shape (num_chirps,)."""
        even = np.arange(self.radar.num_chirps, dtype=np.float64) * self.radar.doppler_interval + self.tx_delay(tx)
        even += self.radar.waveform.sweep.wait
        offsets = self.radar.waveform.chirp_delays
        return even if offsets is None else even + np.asarray(offsets)

    def center_time(self, tx: int) -> float:
        """Time of the middle sample of the middle chirp of a transmitter in the frame [s]."""
        middle = (self.radar.num_chirps - 1) / 2.0 * self.radar.doppler_interval + self.ts_center + self.tx_delay(tx)
        return middle + self.radar.waveform.sweep.wait

    def expand(self, delay: Array, rate: Array, acceleration: Array, tx: int) -> tuple[Array, Array, Array, Array]:
        """Return constant [cycles], frequencies over x and y [Hz] and rate of the delay at the transmitter's middle.

        With ``q = x + y`` and the delay ``tau + u q + b q**2 / 2`` about the middle, what the expansion leaves is
        :meth:`residual_cycles`.
        """
        radar, sweep = self.radar, self.radar.waveform.sweep
        time = self.center_time(tx)
        middle = delay + time * (rate + 0.5 * time * acceleration)
        middle_rate = rate + time * acceleration
        constant = beat_cycles(radar, middle, self.ts_center)
        over_y = middle_rate * (sweep.start_frequency + sweep.slope * (self.ts_center - sweep.video * middle))
        return constant, over_y + sweep.slope * middle, over_y, middle_rate

    def bend(self, delay: Array | float, acceleration: Array | float) -> Array:
        """Return the acceleration scaled by the part of the residual that depends on the delay itself."""
        sweep = self.radar.waveform.sweep
        return np.asarray(acceleration) * (1.0 - sweep.video * sweep.slope * delay / self.center_frequency)

    @property
    def center_frequency(self) -> float:
        """Frequency of the middle sample [Hz], about which the phase is expanded."""
        sweep = self.radar.waveform.sweep
        return sweep.start_frequency + sweep.slope * self.ts_center

    def residual_cycles(self, rate: float, bend: float, edges_only: bool = False) -> Array:
        """Return what the expansion leaves for one rate and bend [cycles], shape (num_chirps, num_samples).

        `edges_only` takes the first and the last sample and chirp, where it is largest.
        ``S z (u q + b q**2 / 2) + (f0 + S ts_center) b q**2 / 2 - S (u q + b q**2 / 2)**2 / 2``.
        """
        x, y, step = self.x, self.y, self.step
        if edges_only and self.even:
            x, y, step = x[[0, -1]], y[[0, -1]], step[[0, -1]]
        elif edges_only:
            x, y, step = x[[0, -1]], np.repeat([y.min(), y.max()], 2), np.tile([step.min(), step.max()], 2)
        x = x[None, :]
        q = x + y[:, None]
        sweep = self.radar.waveform.sweep
        z = x if self.even else x + step[:, None] / sweep.slope
        change = q * (rate + 0.5 * bend * q)
        center = self.center_frequency
        return sweep.slope * change * (z - 0.5 * sweep.video * change) + 0.5 * center * bend * q * q
