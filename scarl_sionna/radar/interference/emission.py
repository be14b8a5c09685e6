r"""What a radar sends, as chirps in time that are sums of lines.

The phase of a line of a chirp with start T, carrier f and slope S is, at the time t, ``f t + S (t - T)**2 / 2 + nu (t -
T)`` cycles: carriers run on from chirp to chirp, as those of one oscillator do. Ramps have one line, coded ramps and
symbols one for each of their tones.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import cast

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.specs.radar.waveforms.coded import Ofdm, is_coded, window_start
from scarl_sionna.core.specs.radar.waveforms.phase_coded import PcFmcw
from scarl_sionna.signal.front_end.channels import tx_matrix

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class Emission:
    """A frame of chirps.

    Attributes
    ----------
    start : ndarray of float64, shape (num_rows,)
        Times T of the chirps after the frame's start, rising [s]. Of symbols the end of the prefix.
    before, after : float
        A chirp is sent from T - before to T + after [s].
    carrier : ndarray of float64, shape (num_rows,)
        [Hz]
    slope : float
        [Hz/s]
    line : ndarray of float64, shape (num_lines,)
        Frequencies above the carrier, equally spaced [Hz].
    strength : ndarray of complex128, shape (num_rows, num_lines)
        Of the lines, power 1 in all.
    factor : ndarray of complex128, shape (num_rows, num_tx)
        Of the field of each transmitter.
    """

    start: Array
    before: float
    after: float
    carrier: Array
    slope: float
    line: Array
    strength: Complex
    factor: Complex

    @classmethod
    def of(cls, radar: RadarSpec) -> Emission:
        """Return the frame of a radar.

        Of an ideal multiplexing, which no real signal has, the first transmitter sends alone.
        """
        waveform, (start, chirp, factor) = radar.waveform, rows_of(radar)
        if radar.front_end.channels is not None:
            factor = factor @ tx_matrix(radar.front_end.channels, radar.num_tx).T
        steps = waveform.chirp_frequencies
        carrier: Array = np.full(len(start), waveform.sweep.start_frequency)
        carrier += 0.0 if steps is None else np.asarray(steps)[chirp]
        before, after = 0.0, waveform.sweep.duration
        line: Array = np.zeros(1)
        strength: Complex = np.ones((1, 1), dtype=np.complex128)
        if is_coded(waveform):
            before, after = window_start(waveform), waveform.repetitions / waveform.spacing
            line = waveform.spacing * (waveform.sent - waveform.num_samples // 2).astype(np.float64)
            carrier, strength = np.full(len(start), waveform.carrier_frequency), waveform.spectrum
        elif isinstance(waveform, PcFmcw):
            strength = waveform.by_chirp[:, None]
            if waveform.coding == "within":
                line, lines = waveform.lines
                strength = lines[None]
        if not radar.multiplexing.shares_band:
            start, carrier = np.repeat(start, radar.num_tx), np.repeat(carrier, radar.num_tx)
            strength, factor = _interleaved(radar), _alone(radar, len(chirp))
            chirp = np.arange(len(start))
        strength = strength[chirp] if len(strength) > 1 else np.broadcast_to(strength, (len(start), len(line)))
        slope = 0.0 if is_coded(waveform) else waveform.sweep.slope
        return cls(start + before, before, after, carrier, slope, line, strength, factor)

    def repeated(self, first: float, interval: float, begin: float, end: float) -> Emission:
        """Return the chirps of all frames that are sent between two times.

        Parameters
        ----------
        first : float
            Start of one frame [s].
        interval : float
            From frame to frame [s].
        begin, end : float
            [s]
        """
        lowest = math.floor((begin - first - self.start[-1] - self.after) / interval)
        frames = first + interval * np.arange(lowest, math.ceil((end - first) / interval) + 1)
        start = (frames[:, None] + self.start).ravel()
        rows = np.tile(np.arange(len(self.start)), len(frames))
        keep = (start + self.after > begin) & (start - self.before < end)
        rows = rows[keep]
        ends = self.before, self.after
        chosen = self.strength[rows], self.factor[rows]
        return Emission(start[keep], *ends, self.carrier[rows], self.slope, self.line, *chosen)


def _interleaved(radar: RadarSpec) -> Complex:
    """Return the strengths of all subcarriers in frequency division, a row for each transmitter in each symbol.

    By definition of :class:`Fdm`, shape (num_chirps * num_tx, num_lines).
    """
    whole = radar.waveform
    assert isinstance(whole, Ofdm)  # checked with the radar
    out = np.zeros((radar.num_chirps, radar.num_tx, len(whole.sent)), dtype=np.complex128)
    for tx in range(radar.num_tx):
        own = cast(Ofdm, radar.waveform_of(tx))
        out[:, tx, np.searchsorted(whole.sent, own.sent)] = own.spectrum
    return out.reshape(-1, len(whole.sent))


def _alone(radar: RadarSpec, count: int) -> Complex:
    """Return 1 for the transmitter of each row, with coupling as of the others; shape (count * num_tx, num_tx)."""
    factor: Complex = np.tile(np.eye(radar.num_tx, dtype=np.complex128), (count, 1))
    channels = radar.front_end.channels
    return factor if channels is None else factor @ tx_matrix(channels, radar.num_tx).T


def rows_of(radar: RadarSpec) -> tuple[Array, npt.NDArray[np.intp], Complex]:
    """Return when chirps start in a frame [s], which chirp of a transmitter each is, and the field's factors.

    By definition of the multiplexing: codes are those of the beat signal of ramps, transmit times conj(receive), and of
    symbols as they arrive. Chirps that share their time stand once.

    Returns
    -------
    start : ndarray of float64, shape (num_rows,)
    chirp : ndarray of int, shape (num_rows,)
    factor : ndarray of complex128, shape (num_rows, num_tx)
    """
    plan, num_tx = radar.multiplexing, radar.num_tx
    late = np.zeros(radar.num_chirps)
    if radar.waveform.chirp_delays is not None:
        late = np.asarray(radar.waveform.chirp_delays)
    if plan.is_coded:
        count = radar.num_chirps_total
        chirp = np.arange(count) * radar.num_chirps // count
        codes = plan.codes(radar.num_chirps, num_tx)
        start = np.arange(count) * radar.doppler_interval + late[chirp]
        return start, chirp, codes if is_coded(radar.waveform) else np.conj(codes)
    chirp = np.arange(radar.num_chirps)
    if num_tx == 1 or radar.tx_delay(num_tx - 1) == 0.0:
        factor = np.zeros((len(chirp), num_tx), dtype=np.complex128)
        factor[:, 0] = 1.0
        return chirp * radar.doppler_interval + late, chirp, factor
    chirp = np.repeat(chirp, num_tx)
    wait = np.tile([radar.tx_delay(tx) for tx in range(num_tx)], radar.num_chirps)
    return chirp * radar.doppler_interval + wait + late[chirp], chirp, plan.codes(radar.num_chirps, num_tx)
