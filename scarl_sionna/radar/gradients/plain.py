"""Signal of one pair of antennas as the plain sum over paths, with its derivatives: the cheaper way for few paths."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.radar.synthesis.phase import FrameGrid, beat_cycles, phasor

from .columns import Columns, Delays, delays, delays_forward, delays_reverse

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]


class PlainSum:
    """The exact sum, path by path.

    Parameters
    ----------
    radar : RadarSpec
    """

    def __init__(self, radar: RadarSpec) -> None:
        self._radar, self._grid = radar, FrameGrid(radar)
        self._ts = self._grid.ts_center + self._grid.x

    def value(self, columns: Columns, tx: int) -> Complex:
        """Return the signal of a pair [sqrt(W)], shape (num_chirps, num_samples)."""
        time, out = self._time(tx), self._empty()
        for path, (amplitude, growth) in enumerate(zip(columns.amplitude, columns.growth, strict=True)):
            tone = phasor(beat_cycles(self._radar, self._delay(delays(columns), path, time), self._ts))
            out += amplitude * tone if growth == 0.0 else amplitude * (1.0 + growth * time) * tone
        return out

    def forward(self, columns: Columns, change: Columns, tx: int) -> Complex:
        """Return how the signal of a pair changes with the columns, to first order."""
        time, out, moved = self._time(tx), self._empty(), delays_forward(columns, change)
        for path, amplitude in enumerate(columns.amplitude):
            delay = self._delay(delays(columns), path, time)
            level = 1.0 + columns.growth[path] * time
            turned = 2j * np.pi * self._frequency(delay) * self._delay(moved, path, time)
            factor = level * (change.amplitude[path] + amplitude * turned)
            factor += amplitude * change.growth[path] * time
            out += factor * phasor(beat_cycles(self._radar, delay, self._ts))
        return out

    def reverse(self, columns: Columns, gradient: Complex, tx: int) -> Columns:
        """Return the adjoint of :meth:`forward` for a change of the signal, shape (num_chirps, num_samples)."""
        time, above = self._time(tx), np.conj(gradient)
        out = Columns._make(np.zeros_like(column) for column in columns)
        back = Delays._make(np.zeros(len(columns.length)) for _ in Delays._fields)
        for path, amplitude in enumerate(columns.amplitude):
            delay = self._delay(delays(columns), path, time)
            seen = phasor(beat_cycles(self._radar, delay, self._ts)) * above
            out.growth[path] = (amplitude * np.vdot(time, seen)).real
            out.amplitude[path] = np.conj(seen.sum()) + columns.growth[path] * np.conj(np.vdot(time, seen))
            turned = (2j * np.pi * amplitude * seen).real * self._frequency(delay)
            turned *= 1.0 + columns.growth[path] * time
            for order, part in enumerate(back):
                part[path] = turned.sum()
                turned *= time / (order + 1.0)
        length, rate, acceleration = delays_reverse(columns, back)
        return out._replace(length=length, rate=rate, acceleration=acceleration)

    def _time(self, tx: int) -> Array:
        """Return each sample's time after the frame's start [s], shape (num_chirps, num_samples)."""
        return self._grid.starts(tx)[:, None] + self._ts

    def _empty(self) -> Complex:
        return np.zeros((self._radar.num_chirps, self._radar.num_samples), dtype=np.complex128)

    @staticmethod
    def _delay(terms: Delays, path: int, time: Array) -> Array:
        delay, rate, acceleration = (part[path] for part in terms)
        return np.asarray(delay + time * (rate + 0.5 * time * acceleration))

    def _frequency(self, delay: Array) -> Array:
        """Return the derivative of the phase to the delay [Hz]."""
        sweep = self._radar.waveform.sweep
        return np.asarray(sweep.start_frequency + sweep.slope * (self._ts - sweep.video * delay))
