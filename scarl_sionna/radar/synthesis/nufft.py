r"""The beat signal by non-uniform FFT, with range migration kept to a proven bound.

Each path is a tone over fast and slow time, times a residual phase that depends on the rate u of its delay (and on its
bend b) and on the sample only. For every sample that factor is a smooth function of (u, b), so it is interpolated between a
few Chebyshev nodes: one transform a node, with the same points, and one known phase screen a node. With k the largest
residual phase [rad] about the middle of a box, K nodes leave at most ``4 sum_{n >= K} |J_n(k)|`` of a path's amplitude.
"""

from __future__ import annotations

from dataclasses import dataclass

import finufft
import numpy as np
import numpy.typing as npt
from scipy.special import jv

from scarl_sionna.core.radar_spec import RadarSpec

from .phase import FrameGrid, delay_terms

Array = npt.NDArray[np.float64]

MAX_CHUNK_PATHS = 200_000
"""Paths transformed at once: bounds the memory."""
SINGLE_PRECISION_LIMIT = 3e-4
"""Smallest tolerance for which the transform may run in float32: its points are rounded to 2**-24 of a turn, times 512 modes."""
MAX_NODES = 64


def num_nodes(phase: float, tolerance: float) -> int:
    """Return how many Chebyshev nodes interpolate exp(1j * phase * p), p in [-1, 1], within a tolerance."""
    for count in range(1, MAX_NODES):
        if 4.0 * np.abs(jv(np.arange(count, count + 40), phase)).sum() <= tolerance:
            return count
    return MAX_NODES


@dataclass(frozen=True, eq=False)
class Interpolation:
    """Chebyshev nodes of one variable over an interval."""

    low: float
    high: float
    count: int

    @property
    def nodes(self) -> Array:
        """The nodes, shape (count,)."""
        angle = (np.arange(self.count) + 0.5) * np.pi / self.count
        return 0.5 * (self.low + self.high) + 0.5 * (self.high - self.low) * np.cos(angle)

    def weights(self, values: Array) -> Array:
        """Return the weight of each node for each value, shape (count, num_values)."""
        if self.count == 1:
            return np.ones((1, len(values)))
        unit = (2.0 * values - (self.low + self.high)) / (self.high - self.low)
        angle = (np.arange(self.count) + 0.5) * np.pi / self.count
        order = np.arange(self.count)
        polynomials = np.cos(order[:, None] * np.arccos(np.clip(unit, -1.0, 1.0))[None, :])
        scale = np.full(self.count, 2.0 / self.count)
        scale[0] = 1.0 / self.count
        return (np.cos(order[None, :] * angle[:, None]) * scale) @ polynomials


def sum_paths(
    amplitude: npt.NDArray[np.complex128],
    length: Array,
    rate: Array,
    acceleration: Array,
    radar: RadarSpec,
    tx: int,
    transform: Transform,
) -> npt.NDArray[np.complex128]:
    """Return the noise-free beat signal of one pair [sqrt(W)], shape (num_chirps, num_samples)."""
    grid = FrameGrid(radar)
    delay, delay_rate, delay_acceleration = delay_terms(length, rate, acceleration)
    constant, over_x, over_y, middle_rate = grid.expand(delay, delay_rate, delay_acceleration, tx)
    turn_x = over_x / radar.sample_rate
    turn_y = over_y * radar.doppler_interval
    # the transform counts modes from -(N // 2); the middle of the samples lies half a mode higher if N is even
    half_x = 0.5 * (1 - radar.num_samples % 2)
    half_y = 0.5 * (1 - radar.num_chirps % 2)
    cycles = constant + half_x * turn_x + half_y * turn_y
    strength = amplitude * np.exp(2j * np.pi * (cycles - np.floor(cycles)))
    return transform.run(strength, turn_x, turn_y, middle_rate, grid.bend(delay, delay_acceleration))


class Transform:
    """The nodes and the plan that all pairs of a radar share for one chunk of paths."""

    def __init__(self, radar: RadarSpec, rate: Array, acceleration: Array, tolerance: float) -> None:
        grid = FrameGrid(radar)
        _, delay_rate, delay_acceleration = delay_terms(np.zeros_like(rate), rate, acceleration)
        first = delay_rate + grid.center_time(0) * delay_acceleration
        last = delay_rate + grid.center_time(radar.num_tx - 1) * delay_acceleration
        bends = grid.bend(np.zeros_like(rate), delay_acceleration)
        span = 2.0 * radar.frame_time * radar.chirp_slope / radar.start_frequency  # delay's part in the bend, generously
        self.rate = self._nodes(
            min(first.min(), last.min()), max(first.max(), last.max()), lambda u: grid.residual_cycles(u, 0.0), tolerance
        )
        low, high = bends.min(), bends.max()
        margin = span * max(abs(low), abs(high))
        self.bend = self._nodes(low - margin, high + margin, lambda b: grid.residual_cycles(0.0, b), tolerance)
        self.screens = np.stack(
            [
                np.exp(2j * np.pi * grid.residual_cycles(u, b))
                for u in self.rate.nodes
                for b in self.bend.nodes
            ]
        )
        single = tolerance >= SINGLE_PRECISION_LIMIT
        self.dtype = np.complex64 if single else np.complex128
        self.real = np.float32 if single else np.float64
        self.plan = finufft.Plan(
            1,
            (radar.num_chirps, radar.num_samples),
            n_trans=len(self.screens),
            eps=max(0.1 * tolerance, 1e-6 if single else 1e-14),
            isign=1,
            dtype="complex64" if single else "complex128",
            fftw=0,
            upsampfac=1.25 if tolerance > 1e-8 else 2.0,
        )

    @staticmethod
    def _nodes(low: float, high: float, cycles, tolerance: float) -> Interpolation:
        """Return nodes over an interval, as many as the residual phase within it needs."""
        phase = np.pi * np.ptp([cycles(low), cycles(high)], axis=0).max()
        count = num_nodes(float(phase), 0.25 * tolerance)
        return Interpolation(low, high, count)

    def run(
        self, strength: npt.NDArray[np.complex128], turn_x: Array, turn_y: Array, rate: Array, bend: Array
    ) -> npt.NDArray[np.complex128]:
        """Return the sum of all tones with their residual phase, shape (num_chirps, num_samples)."""
        weights = self.rate.weights(rate)
        if self.bend.count > 1:
            weights = (weights[:, None, :] * self.bend.weights(bend)[None, :, :]).reshape(len(self.screens), -1)
        self.plan.setpts(_angle(turn_y, self.real), _angle(turn_x, self.real))
        spectra = self.plan.execute((weights * strength).astype(self.dtype))
        spectra = spectra.reshape(self.screens.shape)
        return np.einsum("kmn,kmn->mn", self.screens, spectra)


def _angle(turns: Array, dtype: type) -> npt.NDArray[np.floating]:
    """Return turns as an angle in [-pi, pi]."""
    return (2.0 * np.pi * (turns - np.rint(turns))).astype(dtype)
