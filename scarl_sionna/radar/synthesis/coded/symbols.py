r"""The signal of waveforms made of symbols (OFDM, phase codes), from the channel at their tones.

With the tones f_k above the carrier and the time t_n of a sample after the start of its window,

.. math:: y(t_n) = \sum_k X_k e^{j 2 \pi f_k t_n} H_k(t_n), \quad
          H_k(t) = \sum_p a_p e^{-j 2 \pi (f_c + f_k) \tau_p(t)}

The channel changes over a window by Doppler only, by a turn or less. It is computed at Chebyshev's nodes in the window,
each a frame of tones that take no time (the transforms of ramps make it), and interpolated between them: ``H_k(t) =
sum_j l_j(t) H_k(t_j)``. Periods that are averaged share ``exp(2j pi f_k t)``, so their weights are averaged as well.
Paths longer than the prefix leave the first samples empty, or bring the end of the symbol before:
:mod:`scarl_sionna.radar.synthesis.coded.late`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import product

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.specs.radar.waveforms.coded import Coded, window_start
from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.radar.antenna import PathGeometry
from scarl_sionna.radar.paths import RadarPaths

from ..motion import PairTerms, PathMotion
from ..nufft import num_nodes
from ..orders import orders
from ..phase import delay_terms, phasor

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
Signal = Callable[[int, int], npt.NDArray[np.complexfloating]]
Span = tuple[int, int]
"""From which sample of a window on, of all repetitions, and before which one."""

NODES_SHARE = 0.3
"""Share of the tolerance that interpolation between the nodes may take."""
CHANNEL_SHARE = 0.4
"""Share of the tolerance that the channel at each node may take: weights of nodes add up to less than two."""


@dataclass(frozen=True, eq=False)
class Nodes:
    """Times in the receiver's window at which the channel is computed, and what each sample takes of each.

    Attributes
    ----------
    wait : ndarray of float64, shape (num_nodes,)
        After the chirp's start [s].
    weight : ndarray of float64, shape (num_nodes, repetitions, num_samples)
    """

    wait: Array
    weight: Array

    @classmethod
    def of(cls, waveform: Coded, rate: float, tolerance: float) -> Nodes:
        """Return the nodes for lengths that change by up to `rate` [m/s] either way."""
        count, repeats = waveform.num_samples, waveform.repetitions
        half = 0.5 * (repeats * count - 1) / waveform.sample_rate
        phase = 2.0 * np.pi * waveform.top_frequency * rate / SPEED_OF_LIGHT * half
        number = num_nodes(phase, NODES_SHARE * tolerance)
        angle = (np.arange(number) + 0.5) * np.pi / number
        time = np.arange(repeats * count) / waveform.sample_rate
        weight = lagrange(np.cos(angle), (time - half) / half if half else time)
        return cls(window_start(waveform) + half * (1.0 + np.cos(angle)), weight.reshape(number, repeats, count))

    def shares(self, node: int, spans: Mapping[int, Span]) -> dict[int, Array]:
        """Return what each sample takes of a node, (num_samples,), in spans, by name; averaged over the repetitions."""
        weight, out = self.weight[node], {}
        for name, (first, last) in spans.items():
            inside = np.arange(weight.size).reshape(weight.shape)
            out[name] = np.where((inside >= first) & (inside < last), weight, 0.0).mean(axis=0)
        return out


def lagrange(nodes: Array, values: Array) -> Array:
    """Return the polynomials that are 1 at one of Chebyshev's nodes and 0 at the others, at values in [-1, 1]."""
    order = np.arange(len(nodes))
    shares = np.cos(np.outer(order, np.arccos(nodes))) * (2.0 / len(nodes))
    shares[0] *= 0.5
    return np.asarray(shares.T @ np.cos(np.outer(order, np.arccos(np.clip(values, -1.0, 1.0)))))


def modulated(
    signal: Signal,
    radar: RadarSpec,
    waveform: Coded,
    first: int,
    weights: Mapping[int, Array],
    codes: Complex | None = None,
) -> Signal:
    """Return what makes the samples of a pair from the channel at all tones at one node.

    Parameters
    ----------
    signal : callable
        Channel of a pair with the sign of a ramp's beat signal, some chirps from `first` on.
    radar : RadarSpec
    waveform : Coded
    first : int
        First chirp.
    weights : mapping of int to ndarray of float64, shape (num_samples,)
        Of the node, for the window's own symbol (0) and those so many before.
    codes : ndarray of complex128, shape (num_chirps, num_tx), optional
        As of :func:`plain`.
    """
    strengths, count, sent = waveform.spectrum, waveform.num_samples, waveform.sent

    def of_pair(tx: int, rx: int) -> npt.NDArray[np.complexfloating]:
        channel = np.conj(signal(tx, rx))
        out = np.zeros((len(channel), count), dtype=np.complex128)
        for back, weight in weights.items():
            skip = max(0, back - first)  # nothing was sent before the frame
            of_window = slice(first + skip, first + len(channel))
            of_symbol = slice(first + skip - back, first + len(channel) - back)
            rows = strengths if len(strengths) == 1 else strengths[of_symbol]
            if back:
                turns = back * radar.doppler_interval * waveform.spacing
                rows = rows * phasor(turns * (sent - count // 2).astype(np.float64))
                if codes is not None:
                    rows = rows * (codes[of_symbol, tx] / codes[of_window, tx])[:, None]
            lines = np.zeros((len(channel[skip:]), count), dtype=np.complex128)
            for few in range(0, len(sent), count):  # tones beyond the band of the samples fold
                some = slice(few, few + count)
                lines[:, (sent[some] - count // 2) % count] += rows[:, some] * channel[skip:, some]
            out[skip:] += np.fft.ifft(lines, axis=1, norm="forward") * weight
        return out

    return of_pair


def reach_of(paths: RadarPaths, radar: RadarSpec) -> Array:
    """Return bounds of the lengths over the whole frame, whichever pair of antennas, (num_paths,) [m]."""
    arms = sum(float(np.linalg.norm(array, axis=1).max()) for array in (radar.tx_array, radar.rx_array))
    change = radar.frame_time * (np.abs(paths.length_rate) + radar.frame_time * np.abs(paths.length_acceleration))
    return np.asarray(PathGeometry.of(paths, radar).center_length() + arms + change)


def within_prefix(paths: RadarPaths, radar: RadarSpec, waveform: Coded) -> npt.NDArray[np.bool_]:
    """Return which paths arrive within the prefix over the whole frame, whichever pair of antennas.

    Raises
    ------
    ParameterRangeError
        If a code without a prefix stands among the chirps of other transmitters.
    """
    if math.isinf(waveform.prefix_time):
        if radar.doppler_interval > waveform.chirp_interval * (1.0 + 1e-9):
            raise ParameterRangeError(
                "radar.waveform.prefix_chips",
                "0",
                ">= 1 where transmitters take turns",
                "a code that pauses needs a prefix as long as the delay of the farthest echo",
            )
        return np.ones(paths.num_paths, dtype=np.bool_)
    return np.asarray(reach_of(paths, radar) <= waveform.prefix_time * SPEED_OF_LIGHT)


@dataclass(frozen=True, eq=False)
class Law:
    """Delays and strengths of the paths of each kind of motion, about given times; see :func:`orders`.

    `order` says which path each column is, (num_paths,).
    """

    held: RadarPaths
    linear: RadarPaths
    moving: RadarPaths
    radar: RadarSpec
    order: npt.NDArray[np.intp]

    @classmethod
    def of(cls, paths: RadarPaths, radar: RadarSpec, tolerance: float | None) -> Law:
        """Return the laws of paths; the tolerance is that of the motion."""
        held, bent, linear, moving = orders(paths, radar, tolerance)
        kinds = held | bent, linear, moving
        order = np.concatenate([np.flatnonzero(kind) for kind in kinds])
        some = [paths.select(kind) for kind in kinds]
        return cls(some[0], some[1], some[2], radar, order)

    def at(self, tx: int, rx: int, times: Array) -> tuple[Array, Array, Array, Complex, Complex]:
        """Return delays [s] with two derivatives, amplitudes and their relative rates, (num_times, num_paths) each."""
        time, found = times[:, None], []
        for paths, of_pairs in ((self.held, False), (self.linear, True)):
            terms = PairTerms.of(paths, self.radar)
            own = terms.geometry.length(tx, rx), paths.length_rate, paths.length_acceleration
            start, turn, bend = delay_terms(*(terms.start(tx, rx) if of_pairs else own))
            columns = start + time * (turn + 0.5 * time * bend), turn + time * bend, bend + 0.0 * time
            amplitude = np.broadcast_to(terms.geometry.pair_amplitude(tx, rx), columns[0].shape)
            found.append((*columns, amplitude, np.zeros(columns[0].shape, dtype=np.complex128)))
        if self.moving.num_paths:
            motion = PathMotion.of(self.moving, self.radar)
            lengths, strength, growth = motion.terms(tx, rx, times)
            found.append((*delay_terms(*lengths), motion.of_pair(tx, rx) * strength, growth.astype(np.complex128)))
        return tuple(np.concatenate(columns, axis=1) for columns in zip(*found, strict=True))  # type: ignore[return-value]


def plain(
    paths: RadarPaths, radar: RadarSpec, waveform: Coded, tolerance: float | None, codes: Complex | None = None
) -> Signal:
    """Return what makes the samples of a pair as a plain sum in float64 over paths, samples and tones.

    A sample is what was sent a delay earlier: of its own symbol, of its prefix, of a symbol before, or nothing. Symbols
    before are those of all transmitters where they take turns, and have codes of their own where they send at once.
    """
    law, strengths, count = Law.of(paths, radar, tolerance), waveform.spectrum, waveform.num_samples
    tones = waveform.spacing * (waveform.sent - count // 2)
    period = waveform.repetitions / waveform.spacing
    half = 0.5 * (waveform.repetitions * count - 1) / waveform.sample_rate
    time = np.arange(waveform.repetitions * count) / waveform.sample_rate
    step, prefix = radar.doppler_interval, waveform.prefix_time

    def envelope(row: int, after: Array, tx: int) -> Complex:
        """Return what was sent at times after the start of a chirp's window."""
        out = np.zeros(len(after), dtype=np.complex128)
        for back in range(row + 1):
            moved = after + back * step
            inside = (moved >= -prefix) & (moved < period)
            if inside.any():
                lines = strengths[0 if len(strengths) == 1 else row - back]
                turn = 1.0 if codes is None else codes[row - back, tx] / codes[row, tx]
                out[inside] = turn * (phasor(np.outer(moved[inside], tones)) @ lines)
            if np.all(moved >= -prefix):
                break
        return out

    def of_pair(tx: int, rx: int) -> npt.NDArray[np.complexfloating]:
        middle = np.arange(radar.num_chirps, dtype=np.float64) * step + radar.tx_delay(tx)
        middle += window_start(waveform) + half
        out = np.zeros((radar.num_chirps, count), dtype=np.complex128)
        x = time - half
        for sender in range(radar.num_tx) if radar.tx_delay(radar.num_tx - 1) > 0.0 else (tx,):
            since = radar.tx_delay(tx) - radar.tx_delay(sender)
            earlier = int(since < 0.0)  # its last chirp was in the turn before
            since += earlier * step
            delay, turn, bend, amplitude, growth = law.at(sender, rx, middle)
            late = np.flatnonzero(delay.max(axis=0) + np.abs(turn).max(axis=0) * half > since - period)
            for row, path in product(range(earlier, radar.num_chirps), late):
                tau = delay[row, path] + x * (turn[row, path] + 0.5 * x * bend[row, path])
                sent = envelope(row - earlier, time - tau + since, sender)
                carried = phasor(-waveform.carrier_frequency * tau) * sent
                strength = np.conj(amplitude[row, path] * (1.0 + growth[row, path] * x))
                out[row] += (strength * carried).reshape(waveform.repetitions, count).mean(axis=0)
        return out

    return of_pair
