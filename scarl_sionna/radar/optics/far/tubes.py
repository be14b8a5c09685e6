"""Cutting ray tubes until each one meets a single thing.

A tube has a triangular footprint. Rays probe it on a lattice; where all of them meet the same thing (the same plane, or
nothing), the tube stays whole, however large it is. Where they do not, it is halved, and a small tube that straddles an edge is
cut along that edge, whose place is found by bisection with further rays. So partly hit tubes do not set the error.

Tubes wait in pools, one for each number of halvings and one for those to cut, so that every call of the engine has many rays.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from scarl_sionna.engine.rays.mesh_caster import Probe
from scarl_sionna.radar.optics.tube_shape import (
    CORNER_SIZE,
    COUNTS,
    INSET,
    OFFSETS,
    TOO_LONG,
    WEIGHTS,
    cut_off,
    halved,
    layouts,
)

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]
Pieces: TypeAlias = "tuple[Array, Index, Index]"
"""Corners, rows and labels."""

BISECTIONS = 11
"""By default the place of an edge is found to 2^-11 of the edge spacing."""
_CUT = 1 << 20
"""Pool of the tubes that are cut along an edge: the last one to be worked on."""


def refine(
    corners: Array,
    rows: Index,
    probe: Probe,
    spacing: Array,
    edge_spacing: Array,
    max_rays: int,
    bisections: int = BISECTIONS,
) -> Iterator[Pieces]:
    """Cut tubes until each one has one label.

    Parameters
    ----------
    corners : ndarray of float64, shape (num_tubes, 3, 3)
        Footprints [m].
    rows : ndarray of int64, shape (num_tubes,)
        Row of each tube in the tables of the caller; pieces inherit it.
    probe : Probe
        What the rays of a tube meet, at points of its footprint.
    spacing, edge_spacing : ndarray of float64, shape (num_tubes,)
        Largest distance of the probes, and size down to which straddling tubes are halved [m].
    max_rays : int
        Rays worked at once.
    bisections : int
        The place of an edge is found to 2^-bisections of the tube that it cuts.

    Yields
    ------
    corners, rows, labels
        Pieces that together cover the tubes.
    """
    pools = _Pools(max_rays)
    pools.put(0, _Waiting.of(corners, rows, spacing, edge_spacing))
    while pools:
        number, tubes = pools.take()
        if number == _CUT:
            pieces, again = _along_edge(tubes, probe, bisections)
            yield from pieces
            number >>= 1  # their halves have pools of their own
        else:
            pieces, again, straddling = _probed(tubes, probe)
            yield from pieces
            pools.put(_CUT, straddling)
        pools.put(number + 1, again.halved())


@dataclass(frozen=True, eq=False)
class _Waiting:
    """Tubes that wait to be probed, or with `label` and `odd` to be cut.

    `label` (n, 3) is what the corners meet, `odd` the corner that meets another thing than the two others.
    """

    tri: Array
    row: Index
    wide: Array
    fine: Array
    longest: Array
    layout: Index
    label: Index | None = None
    odd: Index | None = None

    @classmethod
    def of(cls, tri: Array, row: Index, wide: Array, fine: Array) -> _Waiting:
        longest, layout = _layout(tri, wide, fine)
        return cls(tri, row, wide, fine, longest, layout)

    def __len__(self) -> int:
        return len(self.row)

    def take(self, some: Index | slice) -> _Waiting:
        return self._of_columns(None if column is None else column[some] for column in vars(self).values())

    @classmethod
    def _of_columns(cls, columns: Iterable[Any]) -> _Waiting:
        return cls(*columns)

    def to_cut(self, some: Index, label: Index, odd: Index) -> _Waiting:
        return replace(self.without_cut(some), label=label, odd=odd)

    def without_cut(self, some: Index) -> _Waiting:
        return self._of_columns(column[some] for column in list(vars(self).values())[:-2])

    def halved(self) -> _Waiting:
        """Cut tubes in two across their longest side."""
        return _Waiting.of(halved(self.tri), np.tile(self.row, 2), np.tile(self.wide, 2), np.tile(self.fine, 2))

    @property
    def rays(self) -> Index:
        """Rays with which each is worked on at once."""
        return COUNTS[self.layout] if self.odd is None else np.full(len(self), 2)

    @classmethod
    def joined(cls, parts: list[_Waiting]) -> _Waiting:
        if len(parts) == 1:
            return parts[0]
        columns = zip(*(vars(part).values() for part in parts), strict=True)
        return cls._of_columns(None if column[0] is None else np.concatenate(column) for column in columns)


@dataclass(eq=False)
class _Pools:
    """Tubes by the number of times that they were halved, in batches of at most `limit` rays.

    The pool of the smallest tubes that fills a batch goes first, which bounds the memory; where none does, that of the largest.
    """

    limit: int
    parts: dict[int, list[_Waiting]] = field(default_factory=dict)
    weight: dict[int, int] = field(default_factory=dict)

    def __bool__(self) -> bool:
        return bool(self.parts)

    def put(self, number: int, tubes: _Waiting) -> None:
        if not len(tubes):
            return
        done = np.cumsum(tubes.rays)
        edges = np.searchsorted(done // self.limit, np.arange(1, done[-1] // self.limit + 1))
        for first, last in zip([0, *edges], [*edges, len(tubes)], strict=True):
            if last > first:
                self.parts.setdefault(number, []).append(tubes.take(slice(first, last)))
        self.weight[number] = self.weight.get(number, 0) + int(done[-1])

    def take(self) -> tuple[int, _Waiting]:
        full = [number for number, weight in self.weight.items() if weight >= self.limit]
        number = max(full) if full else min(self.weight)
        waiting, weight = self.parts[number], 0
        chosen: list[_Waiting] = []
        while waiting and (not chosen or weight + int(waiting[-1].rays.sum()) <= self.limit):
            chosen.append(waiting.pop())
            weight += int(chosen[-1].rays.sum())
        self.weight[number] -= weight
        if not waiting:
            del self.parts[number], self.weight[number]
        return number, _Waiting.joined(chosen)


def _layout(tri: Array, wide: Array, fine: Array) -> tuple[Array, Index]:
    """Return each tube's longest side and its layout of probes, `TOO_LONG` for a tube that is halved before it is probed."""
    sides = np.roll(tri, -1, axis=1) - tri
    longest = np.sqrt(np.einsum("nij,nij->ni", sides, sides).max(axis=1, initial=0.0))
    height = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1) / longest
    return longest, layouts(longest, height, wide, fine)


def _probed(tubes: _Waiting, probe: Probe) -> tuple[list[Pieces], _Waiting, _Waiting]:
    """Return the pieces that are settled, the tubes to halve, and those to cut along an edge."""
    short = np.flatnonzero(tubes.layout != TOO_LONG)
    long = np.flatnonzero(tubes.layout == TOO_LONG)
    if not len(short):
        return [], tubes, tubes.take(short)
    probed = tubes.take(short) if len(long) else tubes
    count = COUNTS[probed.layout]
    start = np.cumsum(count) - count
    labels = probe.within(_inset(probed.tri), probed.row, WEIGHTS, count, OFFSETS[probed.layout])
    same = np.minimum.reduceat(labels, start) == np.maximum.reduceat(labels, start)
    pieces = [(probed.tri[same], probed.row[same], labels[start[same]])] if same.any() else []
    uneven = np.flatnonzero(~same)
    fine = probed.longest[uneven] <= probed.fine[uneven]
    small, halve = uneven[fine], uneven[~fine]
    at_corner = labels[start[small, None] + np.arange(3)]
    equal = at_corner == np.roll(at_corner, -1, axis=1)  # corner i against i + 1
    two = equal.sum(axis=1) == 1
    large = _above_corner_size(probed.take(small))
    rest = np.flatnonzero(~two & ~large)
    if len(rest):
        tiny = small[rest]
        whole = np.where(equal[rest, 0], at_corner[rest, 0], labels[start[tiny] + 3])
        pieces.append((probed.tri[tiny], probed.row[tiny], whole))
    again = np.concatenate([long, short[halve], short[small[~two & large]]])
    odd = (equal[two].argmax(axis=1) + 2) % 3
    return pieces, tubes.take(again), probed.to_cut(small[two], at_corner[two], odd)


def _above_corner_size(tubes: _Waiting) -> npt.NDArray[np.bool_]:
    return np.asarray(tubes.longest > CORNER_SIZE * tubes.fine)


def _along_edge(tubes: _Waiting, probe: Probe, bisections: int) -> tuple[list[Pieces], _Waiting]:
    """Cut tubes one corner of which (`odd`) has another label than the other two.

    A cut is clean where beyond it the other two corners' label begins at once; the second result are the tubes where it does
    not, which are halved once more.
    """
    assert tubes.label is not None and tubes.odd is not None
    order = (tubes.odd[:, None] + np.arange(3)) % 3
    pick = np.arange(len(tubes))[:, None]
    tri, label = tubes.tri[pick, order], tubes.label[pick, order]
    inner = _inset(tri)
    arms = inner[:, 1:] - inner[:, :1]
    rows = np.repeat(tubes.row, 2)
    low = np.zeros((len(tri), 2))
    high = np.ones((len(tri), 2))
    beyond = label[:, 1:]
    for _ in range(bisections):
        middle = (low + high) / 2.0
        points = inner[:, :1] + middle[:, :, None] * arms
        found = probe.at(points.reshape(-1, 3), rows).reshape(-1, 2)
        inside = found == label[:, :1]
        low, high = np.where(inside, middle, low), np.where(inside, high, middle)
        beyond = np.where(inside, beyond, found)
    kept = (beyond == label[:, 1:]).all(axis=1) | ~_above_corner_size(tubes)
    border = tri[kept, :1] + ((low + high) / 2.0)[kept, :, None] * (tri[kept, 1:] - tri[kept, :1])
    row, label = tubes.row[kept], label[kept]
    tip, near, far = cut_off(tri[kept], border)
    pieces = [(tip, row, label[:, 0]), (near, row, label[:, 1]), (far, row, label[:, 1])]
    return pieces if len(row) else [], tubes.without_cut(np.flatnonzero(~kept))


def _inset(tri: Array) -> Array:
    center = tri.mean(axis=1, keepdims=True)
    return np.asarray(tri + INSET * (center - tri))
