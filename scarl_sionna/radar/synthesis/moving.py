"""The beat signal of paths whose pairs have rates of their own: groups of similar motion, each in its cheapest way."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.radar.paths import RadarPaths

from . import direct, groups
from .expansion import FAST_NODES, MAX_NODES, PAIR_SHARE, REST_SHARE, Block, Expansion, Series, Tones
from .motion import Ends, PairTerms, PathMotion
from .orders import Change, frame_span, largest_wavenumber
from .phase import chirps_of

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.intp]
Signal = Callable[[int, int], npt.NDArray[np.complexfloating]]
"""From a transmitter and a receiver to their noise-free beat signal [sqrt(W)], shape (num_chirps, num_samples)."""

NUM_TRIED = 24
"""Paths of a group on which the length of its series is found: those that bend and grow most."""
SCREEN_COST, POINT_COST, BLOCK_COST = 2.0e-7, 8.0e-8, 1.0e-3
"""Measured seconds of one pair: a sample of one term, a path of one node of a pair's own coefficients, and a block
whatever is in it. Only their ratios matter."""
MAX_CHUNK_PATHS = 100_000
"""Paths of a group worked at once: bounds the memory."""
COARSEST = 1e-2
"""Largest tolerance asked of a transform."""


@dataclass(frozen=True)
class Tolerances:
    """Of the transforms, over the peak, and of the motion, over a path's amplitude."""

    synthesis: float
    motion: float


@dataclass(frozen=True)
class Plan:
    """How a group of moving paths is computed.

    Attributes
    ----------
    size : int
        Chirps of a block.
    series : Series or None
        None for the plain sum.
    pairwise : bool
        Whether every pair has its own coefficients, or those of the array centres serve all.
    cost : float
        Seconds of one pair.
    """

    size: int
    series: Series | None
    pairwise: bool
    cost: float


def linear_signal(paths: RadarPaths, radar: RadarSpec, tolerance: float | None) -> Signal:
    """Return what makes the signal of paths in linear motion; None as the tolerance is the plain sum."""
    method = None
    if tolerance is not None:
        samples, apart = radar.num_samples * radar.num_chirps, float(Change.of(paths, radar).apart.max())
        if paths.num_paths * samples * groups.DIRECT_COST > samples * SCREEN_COST:
            tones = Tones(paths.length, paths.length_rate)
            method = _straight(radar, tones, apart, paths.num_paths, tolerance)
            if method is not None:
                paths = paths.select(method.order(*tones))
    terms = PairTerms.of(paths, radar)
    terms.start(0, 0)  # what all pairs share, before there are threads
    geometry, still = terms.geometry, np.zeros(paths.num_paths)

    def of_pair(tx: int, rx: int) -> npt.NDArray[np.complexfloating]:
        found = terms.start(tx, rx)
        columns = geometry.pair_amplitude(tx, rx), found.value, found.rate, still
        return direct.sum_paths(*columns, radar, tx) if method is None else method.signal(*columns, tx)

    return of_pair


def _straight(radar: RadarSpec, tones: Tones, apart: float, count: int, tolerance: float) -> groups.Method | None:
    """Return the cheapest transform of straight paths whose rates differ by up to `apart` between pairs."""
    low, high = (float(pick(tones.length)) for pick in (np.min, np.max))
    slow, fast = float(tones.rate.min()) - apart, float(tones.rate.max()) + apart
    rates = [slow, fast, min(max(0.0, slow), fast)]  # of the squared rate the smallest, too
    return groups.straight(radar, np.repeat([low, high], len(rates)), np.tile(rates, 2), count, tolerance)


def moving_signals(paths: RadarPaths, radar: RadarSpec, tolerances: Tolerances | None) -> Iterator[tuple[int, Signal]]:
    """Yield first chirps and what makes the signals from there on of paths in exact motion, to be added up.

    Without tolerances by the plain sum.
    """
    if tolerances is None:
        yield 0, _plain(paths, radar)
        return
    for index, plan in grouped(paths, radar, tolerances.motion):
        for chunk in np.array_split(index, -(-len(index) // MAX_CHUNK_PATHS)):
            group = paths.select(chunk)
            if plan.series is None:
                yield 0, _plain(group, radar)
            else:
                yield from _Group(group, radar, plan, plan.series, tolerances).signals()


def _plain(paths: RadarPaths, radar: RadarSpec) -> Signal:
    motion = PathMotion.of(paths, radar)
    return lambda tx, rx: direct.sum_moving(motion, radar, tx, rx)


def grouped(paths: RadarPaths, radar: RadarSpec, tolerance: float) -> list[tuple[Index, Plan]]:
    """Return groups of moving paths that bend alike, joined where that is cheaper, and how each is computed.

    Parameters
    ----------
    paths : RadarPaths
    radar : RadarSpec
    tolerance : float
        Of the motion, over a path's amplitude.
    """
    change = Change.of(paths, radar)
    half = 0.5 * frame_span(radar)
    phase = 0.25 * largest_wavenumber(radar) * half**2
    weight = np.maximum(phase * (change.bend + half * change.third), (half * change.growth) ** 2)
    level = np.ceil(0.5 * np.log2(np.clip(weight, 0.1 * tolerance, 1e9))).astype(np.int64)
    planner = _Planner(paths, radar, weight, phase * change.uneven, tolerance)
    found: list[tuple[Index, Plan]] = []
    for value in np.unique(level):
        index = np.flatnonzero(level == value)
        plan = planner.plan(index)
        if found:
            both = np.concatenate([found[-1][0], index])
            joined = planner.plan(both)
            if joined.cost < found[-1][1].cost + plan.cost:
                found[-1] = (both, joined)
                continue
        found.append((index, plan))
    return found


@dataclass(frozen=True, eq=False)
class _Planner:
    """Finds the cheapest way for paths.

    `weight` says which bend or grow most, `uneven` by what phase the pairs of each bend apart over a frame [rad].
    """

    paths: RadarPaths
    radar: RadarSpec
    weight: Array
    uneven: Array
    tolerance: float
    tried: dict[bytes, _Tried] = field(default_factory=dict)

    def plan(self, index: Index) -> Plan:
        """Return the cheapest way for some paths: blocks are halved as long as that pays."""
        radar, count = self.radar, len(index)
        samples = radar.num_samples * radar.num_chirps
        best = Plan(0, None, True, count * samples * groups.DIRECT_COST)
        size = radar.num_chirps
        if self._least_cost(count, size) > best.cost:
            return best
        worst = index[np.argsort(-self.weight[index], kind="stable")[:NUM_TRIED]]
        tried = self._tried(worst)
        while self._least_cost(count, size) < best.cost:
            series = tried.series(size)
            if series is not None:
                share = float(self.uneven[index].max()) * (size / radar.num_chirps) ** 2
                pairwise = share > PAIR_SHARE * self.tolerance
                cost = self._cost(series, count, size, pairwise)
                if cost < best.cost:
                    best = Plan(size, series, pairwise, cost)
                if len(series.terms) == 1 and not pairwise:
                    break
            if size == 1:
                break
            size = -(-size // 2)
        return best

    def _tried(self, worst: Index) -> _Tried:
        """Return the series of some paths: a group and what it is joined with often have the same ones to try."""
        key = worst.tobytes()
        if key not in self.tried:
            self.tried[key] = _Tried(PathMotion.of(self.paths.select(worst), self.radar), self.radar, self.tolerance)
        return self.tried[key]

    def _least_cost(self, count: int, size: int) -> float:
        samples, blocks = self.radar.num_samples * self.radar.num_chirps, -(-self.radar.num_chirps // size)
        return samples * SCREEN_COST + blocks * (count * groups.CHIRPZ_SPREAD_COST + BLOCK_COST)

    def _cost(self, series: Series, count: int, size: int, pairwise: bool) -> float:
        blocks, terms = -(-self.radar.num_chirps // size), len(series.terms)
        extra = (terms - 1) * (count * groups.SPREAD_COST * blocks)
        extra += (terms - 1) * self.radar.num_samples * self.radar.num_chirps * SCREEN_COST
        if pairwise:
            extra += blocks * count * series.nodes[0] * series.nodes[1] * POINT_COST
        return self._least_cost(count, size) + extra + blocks * terms * BLOCK_COST


@dataclass(frozen=True, eq=False)
class _Tried:
    """The series of some paths, each size of block once."""

    motion: PathMotion
    radar: RadarSpec
    tolerance: float
    known: dict[int, Series | None] = field(default_factory=dict)

    def series(self, size: int) -> Series | None:
        """Return the series for blocks of so many chirps; None if it does not end."""
        if size not in self.known:
            self.known[size] = _ended(self.motion, self.radar, size, self.tolerance)
        return self.known[size]


def _ended(motion: PathMotion, radar: RadarSpec, size: int, tolerance: float) -> Series | None:
    """Return the series of the first, the middle and the last block for some paths, or None if one does not end."""
    first = {0, (radar.num_chirps // size // 2) * size, (radar.num_chirps - 1) // size * size}
    tried = []
    for start in sorted(first):
        block = _block(radar, start, size)
        for tx in sorted({0, radar.num_tx - 1}):
            tried.append(block.expand(motion, (None, None), tx, (MAX_NODES, FAST_NODES)).coefficients)
    return Series.of(np.concatenate(tried, axis=2), tolerance)


@lru_cache(maxsize=256)
def _block(radar: RadarSpec, first: int, size: int) -> Block:
    """Return some chirps of a frame; the same blocks are tried for many paths, and taken again for the next frame."""
    count = min(size, radar.num_chirps - first)
    return Block(radar if count == radar.num_chirps else chirps_of(radar, first, count), first)


def _likeness(block: Block) -> tuple[int, int]:
    """Return what blocks have in common that one transform serves; one of uneven chirps is like no other."""
    return block.radar.num_chirps, -1 if block.grid.even else block.first


class _Center(NamedTuple):
    """What all pairs of one transmission time share in a block: of the centres, and distances of the receivers."""

    expansion: Expansion
    ends: Ends
    received: list[Array]


class _Group:
    """Paths that are computed alike, block by block."""

    def __init__(self, paths: RadarPaths, radar: RadarSpec, plan: Plan, series: Series, tolerances: Tolerances) -> None:
        self._radar, self._plan, self._series = radar, plan, series
        self._motion = PathMotion.of(paths, radar)
        self._apart = 1.2 * float(Change.of(paths, radar).apart.max())
        self._tolerances = tolerances

    def signals(self) -> Iterator[tuple[int, Signal]]:
        """Yield what makes the signals of each block, and its first chirp."""
        size, radar = self._plan.size, self._radar
        blocks = [_block(radar, first, size) for first in range(0, radar.num_chirps, size)]
        tools = {}
        for key in sorted({_likeness(block) for block in blocks}):
            alike = [block for block in blocks if _likeness(block) == key]
            tools[key] = (*self._methods(alike), self._series.screens(alike[0]))
        for block in blocks:
            yield block.first, self._signal(block, tools[_likeness(block)])

    def _methods(self, blocks: list[Block]) -> tuple[groups.Method | None, groups.Method | None]:
        """Return the transforms of the main and of the other terms for blocks of one size."""
        corners, radar = [], blocks[0].radar
        for block in blocks:
            for tx in sorted({0, self._radar.num_tx - 1}):
                tones = block.expand(self._motion, (None, None), tx, (3, 1)).tones
                corners.append([[column.min(), column.max()] for column in tones])
        tones = Tones(*np.moveaxis(np.array(corners), 1, 0).reshape(2, -1))
        count, wanted = len(self._motion.reach), self._tolerances
        main = _straight(radar, tones, self._apart, count, wanted.synthesis)
        if len(self._series.terms) == 1:
            return main, None
        rest = REST_SHARE * wanted.motion / max(self._series.rest, REST_SHARE * wanted.motion / COARSEST)
        return main, _straight(radar, tones, self._apart, count, max(rest, wanted.synthesis))

    def _signal(self, block: Block, tools: tuple[groups.Method | None, groups.Method | None, Array]) -> Signal:
        motion, terms = self._motion, self._series.terms
        main, rest, screens = tools
        centers: dict[float, _Center] = {}
        sent: list[Array] = []
        if not self._plan.pairwise:
            for tx in range(self._radar.num_tx):
                times = block.times(tx, 2)
                sent.append(motion.tx.distance(tx, times))
                if self._radar.tx_delay(tx) not in centers:
                    centers[self._radar.tx_delay(tx)] = _Center(
                        block.expand(motion, (None, None), tx, self._series.nodes),
                        motion.ends(None, None, times),
                        [motion.rx.distance(rx, times) for rx in range(self._radar.num_rx)],
                    )

        def of_pair(tx: int, rx: int) -> npt.NDArray[np.complexfloating]:
            if self._plan.pairwise:
                tones, found = block.expand(motion, (tx, rx), tx, self._series.nodes)
                amplitude = motion.of_pair(tx, rx)
            else:
                center = centers[self._radar.tx_delay(tx)]
                known = sent[tx], center.received[rx]
                tones, strength = block.of_pair(motion, (tx, rx), center.expansion, center.ends, known)
                found, amplitude = center.expansion.coefficients, motion.of_pair(tx, rx) * strength
            rows = np.stack([amplitude * found[order] for order in terms])
            out = next(_signals(main, rows[:1], tones, block.radar, tx))
            if len(terms) > 1:
                for part, screen in zip(_signals(rest, rows[1:], tones, block.radar, tx), screens, strict=True):
                    part *= screen.astype(part.real.dtype, copy=False)
                    out += part
            return out

        return of_pair


def _signals(
    method: groups.Method | None, rows: npt.NDArray[np.complex128], tones: Tones, radar: RadarSpec, tx: int
) -> Iterator[npt.NDArray[np.complexfloating]]:
    """Yield the signal of straight paths for each row of amplitudes."""
    if method is not None:
        return method.signals(rows, *tones, tx)
    still = np.zeros_like(tones.rate)
    return (direct.sum_paths(row, *tones, still, radar, tx) for row in rows)
