"""The beat signal as the plain sum over paths in float64: the exact reference of the fast method."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.specs.radar.spec import RadarSpec

from .motion import PathMotion
from .phase import FrameGrid, beat_cycles, delay_terms, phasor

MAX_CHUNK_VALUES = 2_000_000
"""Complex values held at once."""


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
    rows = max(1, MAX_CHUNK_VALUES // radar.num_samples)
    for path in range(len(length)):
        for start in range(0, radar.num_chirps, rows):
            block = slice(start, start + rows)
            time = chirp[block, None] + ts[None, :]
            tau = delay[path] + time * (delay_rate[path] + 0.5 * time * delay_acceleration[path])
            out[block] += amplitude[path] * phasor(beat_cycles(radar, tau, ts, step[block]))
    return out


def sum_moving(motion: PathMotion, radar: RadarSpec, tx: int, rx: int) -> npt.NDArray[np.complex128]:
    """Return the noise-free beat signal of one pair [sqrt(W)] with exact motion, shape (num_chirps, num_samples).

    Exact in the middle of every ramp, to second order in time within it (the strength to first order).
    """
    grid = FrameGrid(radar)
    ramp, step = grid.starts(tx) + grid.ts_center, grid.step[:, None]
    ts, x = grid.ts_center + grid.x, grid.x
    out = np.zeros((radar.num_chirps, radar.num_samples), dtype=np.complex128)
    rows = max(1, MAX_CHUNK_VALUES // radar.num_samples)
    for start in range(0, radar.num_chirps, rows):
        block = slice(start, start + rows)
        for path, amplitude in enumerate(motion.of_pair(tx, rx)):
            (length, rate, bend), strength, growth = motion.select(np.array([path])).terms(tx, rx, ramp[block])
            tau, turn, curve = delay_terms(length, rate, bend)
            tau = tau + x * (turn + 0.5 * x * curve)
            grown = amplitude * strength * (1.0 + growth * x)
            out[block] += grown * phasor(beat_cycles(radar, tau, ts, step[block]))
    return out
