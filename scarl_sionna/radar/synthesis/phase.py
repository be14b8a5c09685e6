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

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.units import SPEED_OF_LIGHT

Array = npt.NDArray[np.float64]


def delay_terms(length: Array, rate: Array, acceleration: Array) -> tuple[Array, Array, Array]:
    """Return delay [s], its rate and its acceleration [1/s] at the first ramp's start."""
    speed = SPEED_OF_LIGHT + 0.5 * rate
    return length / speed, rate / speed, acceleration / speed


def beat_cycles(radar: RadarSpec, delay: Array, ts: Array | float) -> Array:
    """Return the phase of the beat signal in cycles, exact."""
    slope = radar.waveform.chirp_slope
    return radar.waveform.start_frequency * delay + slope * delay * (ts - 0.5 * delay)


def phasor(cycles: Array) -> npt.NDArray[np.complex128]:
    """Return exp(2j pi cycles); cosine and sine apart take 0.6 of the time of the complex exponential."""
    angle = (2.0 * np.pi) * (cycles - np.rint(cycles))
    out = np.empty(angle.shape, dtype=np.complex128)
    np.cos(angle, out=out.real)
    np.sin(angle, out=out.imag)
    return out


@dataclass(frozen=True)
class FrameGrid:
    """Sampling times of a frame about its middle.

    A sample is at ``ts = ts_center + x`` in its ramp, and its ramp starts at ``t_center + y + tx_delay`` in the frame.
    """

    radar: RadarSpec

    @property
    def x(self) -> Array:
        """Fast time about the middle of the samples [s], shape (num_samples,)."""
        count = self.radar.num_samples
        return np.asarray((np.arange(count) - (count - 1) / 2.0) / self.radar.sample_rate, dtype=np.float64)

    @property
    def y(self) -> Array:
        """Slow time about the middle of the chirps [s], shape (num_chirps,)."""
        count = self.radar.num_chirps
        return np.asarray((np.arange(count) - (count - 1) / 2.0) * self.radar.doppler_interval, dtype=np.float64)

    @property
    def ts_center(self) -> float:
        """Middle of the samples in a ramp [s]."""
        return (self.radar.num_samples - 1) / (2.0 * self.radar.sample_rate)

    def tx_delay(self, tx: int) -> float:
        """Start of a transmitter's ramps after the first transmitter's [s]."""
        return self.radar.tx_delay(tx)

    def center_time(self, tx: int) -> float:
        """Time of the middle sample of the middle chirp of a transmitter in the frame [s]."""
        return (self.radar.num_chirps - 1) / 2.0 * self.radar.doppler_interval + self.ts_center + self.tx_delay(tx)

    def expand(self, delay: Array, rate: Array, acceleration: Array, tx: int) -> tuple[Array, Array, Array, Array]:
        """Return constant [cycles], frequencies over x and y [Hz] and rate of the delay at the transmitter's middle.

        With ``q = x + y`` and the delay ``tau + u q + b q**2 / 2`` about the middle, what the expansion leaves is
        :meth:`residual_cycles`.
        """
        radar, slope = self.radar, self.radar.waveform.chirp_slope
        time = self.center_time(tx)
        middle = delay + time * (rate + 0.5 * time * acceleration)
        middle_rate = rate + time * acceleration
        constant = beat_cycles(radar, middle, self.ts_center)
        over_y = middle_rate * (radar.waveform.start_frequency + slope * (self.ts_center - middle))
        return constant, over_y + slope * middle, over_y, middle_rate

    def bend(self, delay: Array | float, acceleration: Array | float) -> Array:
        """Return the acceleration scaled by the part of the residual that depends on the delay itself."""
        center = self.radar.waveform.start_frequency + self.radar.waveform.chirp_slope * self.ts_center
        return np.asarray(acceleration) * (1.0 - self.radar.waveform.chirp_slope * delay / center)

    def residual_cycles(self, rate: float, bend: float, edges_only: bool = False) -> Array:
        """Return what the expansion leaves for one rate and bend [cycles], shape (num_chirps, num_samples).

        `edges_only` takes the first and the last sample and chirp, where it is largest.
        ``S x (u q + b q**2 / 2) + (f0 + S ts_center) b q**2 / 2 - S (u q + b q**2 / 2)**2 / 2``.
        """
        x, y = (self.x[[0, -1]], self.y[[0, -1]]) if edges_only else (self.x, self.y)
        x = x[None, :]
        q = x + y[:, None]
        slope = self.radar.waveform.chirp_slope
        change = q * (rate + 0.5 * bend * q)
        center = self.radar.waveform.start_frequency + slope * self.ts_center
        return slope * change * (x - 0.5 * change) + 0.5 * center * bend * q * q
