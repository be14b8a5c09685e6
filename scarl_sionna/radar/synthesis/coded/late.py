r"""Echoes of symbols that come after the prefix: their first samples are empty, or hold the end of a symbol before.

A sample at the time t after the start of a window holds what was sent at ``t - tau + b T``, T being the time from
symbol to symbol: of the window's own symbol (b = 0) from the sample on where that is its prefix, and of the one b
before up to the sample where it ends. Within these samples a symbol is a sum of tones of one period, so that the
transforms that make whole windows make these, too: with the symbol's tones turned by ``exp(2j pi f_k b T)``, cut to
the samples that all paths of a group have in all windows of all pairs. The samples that single paths have beyond
those, some a window, are summed one by one; see :class:`Late`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.arrays.blocks import in_blocks
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.specs.radar.waveforms.coded import Coded, window_start
from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.radar.antenna import PathGeometry
from scarl_sionna.radar.paths import RadarPaths

from ..phase import phasor
from .symbols import Law, Signal, Span, reach_of

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
Count = npt.NDArray[np.int64]

PLAIN_COST = 3e-8
"""Seconds of a path, a pair, a sample and a tone in the plain sum; measured on one core."""
GROUP_COST = 200
"""Samples of a path in every window that take as long, one by one, as the transforms of a group: 30 of a still street,
1000 of paths that cross, measured."""
_DELAYS_AT_ONCE = 1 << 19


@dataclass(frozen=True, eq=False)
class _Delays:
    """Delays of some paths in the windows of a pair, (num_chirps, num_paths) each; see :meth:`Law.at`."""

    delay: Array
    turn: Array
    bend: Array
    amplitude: Complex
    growth: Complex

    def at(self, time: Array, half: float) -> Array:
        """Return the delays [s] at a time in each window, of the shape of the delays."""
        x = time - half
        return self.delay + x * (self.turn + 0.5 * x * self.bend)


@dataclass(frozen=True, eq=False)
class Late:
    """Paths that are longer than the prefix, and when what they bring was sent.

    Attributes
    ----------
    paths : RadarPaths
        Within the times at which no other transmitter has its turn.
    radar : RadarSpec
    waveform : Coded
    tolerance : float or None
        Of the motion.
    codes : ndarray of complex128, shape (num_chirps, num_tx), optional
        As of :func:`plain`.
    """

    paths: RadarPaths
    radar: RadarSpec
    waveform: Coded
    tolerance: float | None
    codes: Complex | None

    @cached_property
    def count(self) -> int:
        """Samples of a window, all repetitions."""
        return self.waveform.repetitions * self.waveform.num_samples

    @cached_property
    def backs(self) -> range:
        """How many symbols before that of the window may have been sent when the last sample's echo was."""
        longest = float(reach_of(self.paths, self.radar).max()) / SPEED_OF_LIGHT
        period = self.waveform.repetitions / self.waveform.spacing
        return range(min(math.floor((longest + period) / self.radar.doppler_interval), self.radar.num_chirps - 1) + 1)

    def _blocks(self) -> list[slice]:
        size = max(1, _DELAYS_AT_ONCE // self.radar.num_chirps)
        return list(in_blocks(self.paths.num_paths, size))

    @cached_property
    def _laws(self) -> list[tuple[npt.NDArray[np.intp], Law]]:
        """The laws of blocks of paths, and which path each column of a law is."""
        found = []
        for block in self._blocks():
            law = Law.of(self.paths.select(block), self.radar, self.tolerance)
            found.append((np.arange(self.paths.num_paths)[block][law.order], law))
        return found

    @cached_property
    def _half(self) -> float:
        return 0.5 * (self.count - 1) / self.waveform.sample_rate

    def _windows(self, law: Law, tx: int, rx: int) -> _Delays:
        middle = np.arange(self.radar.num_chirps, dtype=np.float64) * self.radar.doppler_interval
        middle += self.radar.tx_delay(tx) + window_start(self.waveform) + self._half
        return _Delays(*law.at(tx, rx, middle))

    def _sent_before(self, windows: _Delays, after: float, back: int) -> Count:
        """Return how many samples of each window hold what was sent before a time after a symbol's window starts."""
        rate, shift, last = self.waveform.sample_rate, back * self.radar.doppler_interval, self.count

        def since(number: Count) -> Array:
            time = number / rate
            return time - windows.at(time, self._half) + shift

        near = np.clip(windows.delay + after - shift, 0.0, last / rate)
        number = np.ceil((windows.at(near, self._half) + after - shift) * rate)
        number = np.clip(number, 0, last).astype(np.int64)
        number -= (number > 0) & (since(number - 1) >= after)
        number += (number < last) & (since(number) < after)
        return number

    def _held(self, windows: _Delays, back: int) -> tuple[Count, Count]:
        """Return from which sample to before which one each window holds a symbol, (num_chirps, num_paths)."""
        period = self.waveform.repetitions / self.waveform.spacing
        first = self._sent_before(windows, -self.waveform.prefix_time, back)
        last = self._sent_before(windows, period, back)
        first[:back] = last[:back] = 0  # nothing was sent before the frame
        return first, last

    @cached_property
    def _common(self) -> tuple[Count, Count]:
        """Samples that each path has in all windows of all pairs: from, to; (num_backs, num_paths)."""
        first = np.zeros((len(self.backs), self.paths.num_paths), dtype=np.int64)
        last = np.full_like(first, self.count)
        for index, law in self._laws:
            for tx in range(self.radar.num_tx):
                for rx in range(self.radar.num_rx):
                    windows = self._windows(law, tx, rx)
                    for back in self.backs:
                        low, high = self._held(windows, back)
                        first[back, index] = np.maximum(first[back, index], low[back:].max(axis=0))
                        last[back, index] = np.minimum(last[back, index], high[back:].min(axis=0))
        return first, last

    @cached_property
    def _groups(self) -> tuple[npt.NDArray[np.intp], list[dict[int, Span]]]:
        """The group of each path, and what samples of which symbols before each group has in all windows."""
        first, last = self._common
        values, counts = np.unique(first[0], return_counts=True)
        top, spent, number = 0, math.inf, -1
        group_of: dict[int, int] = {}
        for value, count in zip(values[::-1].tolist(), counts[::-1].tolist(), strict=True):
            spent += count * (top - value)
            if spent > GROUP_COST:
                top, spent, number = value, 0.0, number + 1
            group_of[value] = number
        member = np.array([group_of[value] for value in first[0].tolist()], dtype=np.intp)
        spans = []
        for group in range(number + 1):
            own = member == group
            ends = ((back, int(first[back, own].max()), int(last[back, own].min())) for back in self.backs)
            spans.append({back: (low, high) for back, low, high in ends if low < high})
        return member, spans

    def groups(self) -> Iterator[tuple[RadarPaths, dict[int, Span]]]:
        """Yield groups of paths and the samples that transforms make of them, by how many symbols before."""
        member, spans = self._groups
        for number, span in enumerate(spans):
            if span:
                yield self.paths.select(member == number), span

    def rest(self) -> Signal:
        """Return what makes the samples of a pair that :meth:`groups` leaves out, as a sum in float64 over paths."""
        member, spans = self._groups
        never = self.count, self.count
        ends = np.array([[group.get(back, never) for group in spans] for back in self.backs])[:, member]
        _ = self._laws, self._tables  # before there are threads

        def of_pair(tx: int, rx: int) -> npt.NDArray[np.complexfloating]:
            out = np.zeros((self.radar.num_chirps, self.waveform.num_samples), dtype=np.complex128)
            for index, law in self._laws:
                windows = self._windows(law, tx, rx)
                for back in self.backs:
                    low, high = self._held(windows, back)
                    first, last = ends[back, index].T
                    for start, stop in ((low, np.minimum(high, first)), (np.maximum(low, last), high)):
                        self._add(out, windows, (start, stop), back, tx)
            return out

        return of_pair

    def _add(self, out: Complex, windows: _Delays, ends: tuple[Count, Count], back: int, tx: int) -> None:
        """Add what some samples of each window hold of the symbol so many before."""
        waveform, start = self.waveform, ends[0]
        size = np.maximum(ends[1] - start, 0)
        for row in np.flatnonzero(size.any(axis=1)).tolist():
            path = np.repeat(np.arange(size.shape[1]), size[row])
            number = np.arange(len(path)) - np.repeat(np.cumsum(size[row]) - size[row], size[row]) + start[row, path]
            time = number / waveform.sample_rate
            x = time - self._half
            tau = windows.delay[row, path] + x * (windows.turn[row, path] + 0.5 * x * windows.bend[row, path])
            value = np.conj(windows.amplitude[row, path] * (1.0 + windows.growth[row, path] * x))
            value *= phasor(-waveform.carrier_frequency * tau)
            value *= self._envelope(row - back, time - tau + back * self.radar.doppler_interval)
            if self.codes is not None:
                value *= self.codes[row - back, tx] / self.codes[row, tx]
            np.add.at(out[row], number % waveform.num_samples, value / waveform.repetitions)

    def _envelope(self, row: int, time: Array) -> Complex:
        """Return what a symbol's tones are at times after its window's start.

        Of evenly spaced tones: each is a coarse step and a fine one, with phasors of both alone.
        """
        table, sent = self._tables[row % len(self._tables)], self.waveform.sent
        coarse, fine = table.shape
        step, lowest = (
            float(sent[1] - sent[0]) if len(sent) > 1 else 1.0,
            float(sent[0]) - self.waveform.num_samples // 2,
        )
        turn = self.waveform.spacing * time
        small = phasor(np.outer(turn, step * np.arange(fine) + lowest))
        large = phasor(np.outer(turn, step * fine * np.arange(coarse)))
        # not by BLAS: its threads take a hundred times as long for products so small, in threads of pairs
        return np.asarray((np.einsum("sk,kj->sj", large, table) * small).sum(axis=1))

    @cached_property
    def _tables(self) -> Complex:
        """Strengths of the tones, coarse and fine steps apart, shape (num_chirps or 1, num_coarse, num_fine)."""
        lines = self.waveform.spectrum
        fine = max(math.isqrt(lines.shape[1]), 1)
        out = np.zeros((len(lines), -(-lines.shape[1] // fine) * fine), dtype=np.complex128)
        out[:, : lines.shape[1]] = lines
        return out.reshape(len(lines), -1, fine)


def alone_in_turn(paths: RadarPaths, radar: RadarSpec, waveform: Coded) -> npt.NDArray[np.bool_]:
    """Return which paths end before the symbol of another transmitter does, which has its turn; by definition."""
    delays = [radar.tx_delay(tx) for tx in range(radar.num_tx)]
    if delays[-1] <= 0.0:
        return np.ones(paths.num_paths, dtype=np.bool_)
    apart = np.mod(np.subtract.outer(delays, delays), radar.doppler_interval)
    gap = float(apart[~np.eye(len(delays), dtype=np.bool_)].min()) - waveform.repetitions / waveform.spacing
    return np.asarray(reach_of(paths, radar) < gap * SPEED_OF_LIGHT)


def told(
    paths: RadarPaths,
    inside: npt.NDArray[np.bool_],
    in_turn: npt.NDArray[np.bool_],
    radar: RadarSpec,
    waveform: Coded,
) -> str:
    """Return what to say of paths that are longer than the prefix: what their first samples hold, and what it costs."""
    length = PathGeometry.of(paths, radar).center_length()[~inside]
    longest, count = float(length.max()) / SPEED_OF_LIGHT, waveform.repetitions * waveform.num_samples
    period = waveform.repetitions / waveform.spacing
    samples = min(math.ceil((longest - waveform.prefix_time) * waveform.sample_rate), count)
    before = longest > radar.doppler_interval - period or not in_turn.all()
    hold = "hold symbols before theirs, or nothing" if before else "are empty"
    text = (
        f"{len(length)} of {paths.num_paths} paths, up to {length.max():.4g} m long, are longer than the prefix of "
        f"{waveform.prefix_time * 1e6:.4g} us ({waveform.prefix_time * SPEED_OF_LIGHT:.4g} m): up to {max(samples, 1)} "
        f"of the {count} samples of their windows {hold}; a longer prefix spares it"
    )
    if in_turn.all():
        return text
    some = int((~in_turn).sum())
    cost = PLAIN_COST * radar.num_tx * radar.num_rx * radar.num_chirps * count * len(waveform.sent) * some
    return (
        f"{text}. {some} bring the symbol of another transmitter, and are summed sample by sample: some {cost:.2g} s "
        "of a core; a longer idle time spares it"
    )
