"""The beat signal as the plain sum over paths in float64: the exact reference of the fast method."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.arrays.blocks import in_blocks
from scarl_sionna.core.specs.radar.spec import RadarSpec

from .motion import PathMotion
from .phase import FrameGrid, beat_cycles, delay_terms, phasor

BLOCK_VALUES = 1 << 13
"""Samples of a path worked out at once, whole ramps, so that they stay in the cache."""


def sum_paths(
    amplitude: npt.NDArray[np.complex128],
    length: npt.NDArray[np.float64],
    rate: npt.NDArray[np.float64],
    acceleration: npt.NDArray[np.float64],
    radar: RadarSpec,
    tx: int,
) -> npt.NDArray[np.complex128]:
    """Return the noise-free beat signal of one pair [sqrt(W)], shape (num_chirps, num_samples)."""
    grid = FrameGrid(radar)
    ts = radar.waveform.sweep.first + np.arange(radar.num_samples) / radar.sample_rate
    chirp, step = grid.starts(tx), grid.step[:, None]
    out = np.zeros((radar.num_chirps, radar.num_samples), dtype=np.complex128)
    delay, delay_rate, delay_acceleration = delay_terms(length, rate, acceleration)
    for path in range(len(length)):
        for block in in_blocks(radar.num_chirps, max(1, BLOCK_VALUES // radar.num_samples)):
            time = chirp[block, None] + ts
            tau = delay[path] + time * (delay_rate[path] + 0.5 * time * delay_acceleration[path])
            tone = phasor(beat_cycles(radar, tau, ts, step[block]))
            tone *= amplitude[path]
            out[block] += tone
    return out


def sum_moving(motion: PathMotion, radar: RadarSpec, tx: int, rx: int) -> npt.NDArray[np.complex128]:
    """Return the noise-free beat signal of one pair [sqrt(W)] with exact motion, shape (num_chirps, num_samples).

    Exact in the middle of every ramp, to second order in time within it (the strength to first order).
    """
    grid = FrameGrid(radar)
    ramp, step = grid.starts(tx) + grid.ts_center, grid.step[:, None]
    ts, x = grid.ts_center + grid.x, grid.x
    out = np.zeros((radar.num_chirps, radar.num_samples), dtype=np.complex128)
    for path, amplitude in enumerate(motion.of_pair(tx, rx)):
        (length, rate, bend), strength, growth = motion.select(np.array([path])).terms(tx, rx, ramp)
        tau, turn, curve = delay_terms(length, rate, bend)
        start = amplitude * strength
        grown = start * growth
        for block in in_blocks(radar.num_chirps, max(1, BLOCK_VALUES // radar.num_samples)):
            late = tau[block] + x * (turn[block] + 0.5 * x * curve[block])
            tone = phasor(beat_cycles(radar, late, ts, step[block]))
            tone *= start[block] + grown[block] * x
            out[block] += tone
    return out
