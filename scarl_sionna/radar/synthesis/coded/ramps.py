r"""The signal of ramps with a phase code, from the beat signals of ramps without it.

With the code c of each ramp an echo's beat signal is multiplied with the conjugate of ``c(t - tau)``. Its lines nu_k
turn by ``exp(2j pi nu_k tau)``, as a carrier does that is nu_k higher. So the signal is a sum of beat signals at some
carriers (Chebyshev's nodes in the band of the code), each times one known screen over the samples; their number follows
from the band times the spread of the delays.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.specs.radar.waveforms.phase_coded import PcFmcw
from scarl_sionna.radar.paths import RadarPaths

from ..nufft import num_nodes
from ..phase import FrameGrid, beat_cycles, phasor
from .symbols import NODES_SHARE, Law, Signal, lagrange

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]


def carriers(waveform: PcFmcw, delays: tuple[float, float], tolerance: float) -> tuple[Array, Complex]:
    """Return how much higher the carriers of the ramps are [Hz], and the screen of each.

    Parameters
    ----------
    waveform : PcFmcw
        With its code within ramps.
    delays : tuple of float
        Between which those of all paths are [s].
    tolerance : float

    Returns
    -------
    higher : ndarray of float64, shape (num_carriers,)
    screens : ndarray of complex128, shape (num_carriers, num_samples)
    """
    frequency, strength = waveform.lines
    band = float(np.abs(frequency).max())
    middle, half = 0.5 * (delays[0] + delays[1]), 0.5 * (delays[1] - delays[0])
    count = num_nodes(2.0 * np.pi * band * half, NODES_SHARE * tolerance / np.abs(strength).sum())
    nodes = np.cos((np.arange(count) + 0.5) * np.pi / count)
    weight = lagrange(nodes, frequency / band) * phasor(np.subtract.outer(-band * nodes, -frequency) * middle)
    ts = waveform.adc_start_time + np.arange(waveform.num_samples) / waveform.sample_rate
    return band * nodes, (weight * np.conj(strength)) @ phasor(np.outer(-frequency, ts))


def screened(signal: Signal, rows: Complex, screen: Complex) -> Signal:
    """Return what makes a pair's signal times one factor a chirp and one a sample."""

    def of_pair(tx: int, rx: int) -> npt.NDArray[np.complexfloating]:
        found = signal(tx, rx)
        return np.asarray(found * rows[: len(found), None] * screen)

    return of_pair


def plain(paths: RadarPaths, radar: RadarSpec, waveform: PcFmcw, tolerance: float | None) -> Signal:
    """Return what makes the samples of a pair as a plain sum in float64 over paths and lines of the code."""
    law, grid, (frequency, strength) = Law.of(paths, radar, tolerance), FrameGrid(radar), waveform.lines
    ts, x, step = grid.ts_center + grid.x, grid.x, grid.step
    within, chips = waveform.coding == "within", np.conj(waveform.by_chirp)

    def of_pair(tx: int, rx: int) -> npt.NDArray[np.complexfloating]:
        delay, turn, bend, amplitude, growth = law.at(tx, rx, grid.starts(tx) + grid.ts_center)
        out = np.zeros((radar.num_chirps, radar.num_samples), dtype=np.complex128)
        for row in range(radar.num_chirps):
            for path in range(delay.shape[1]):
                tau = delay[row, path] + x * (turn[row, path] + 0.5 * x * bend[row, path])
                value = amplitude[row, path] * (1.0 + growth[row, path] * x)
                value = value * phasor(beat_cycles(radar, tau, ts, float(step[row])))
                if within:
                    value = value * np.conj(phasor(np.outer(ts - tau, frequency)) @ strength)
                out[row] += chips[row] * value
        return out

    return of_pair
