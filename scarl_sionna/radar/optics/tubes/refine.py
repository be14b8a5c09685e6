"""Cutting ray tubes until each one meets a single thing.

A tube has a triangular footprint. Rays probe it on a lattice; where all of them meet the same thing (the same plane, or
nothing), the tube stays whole, however large it is. Where they do not, it is halved, and a small tube that straddles an
edge is cut along that edge, whose place is found by bisection with further rays. So partly hit tubes do not set the
error.

Tubes wait in pools, one for each number of halvings and one for those to cut, so that every call of the engine has many
rays.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.arrays.rows import row_all
from scarl_sionna.core.settings.sbr import SbrSettings

from .probes import Probe
from .spacings import Spacings
from .tube_shape import COUNTS, OFFSETS, TOO_LONG, WEIGHTS, cut_off, halved, layouts, sides_and_height

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]
Pieces: TypeAlias = "tuple[Array, Index, Index]"
"""Corners, rows and labels."""

BESIDE = 2.0
"""Beside a narrow body tubes are halved at edges down to this many distances of their probes before they are cut.

One cut through a larger one does not follow both edges of a bar (docs/sbr.md, where it breaks)."""
CLOSER = int(2.0 * BESIDE)
"""Segments along the sides of such a tube when it is probed once more, after the cut: half as far apart or closer."""
ON_CUT = 0.1
"""Probes nearer to a cut than this part of their distance may have either label: its place is found by rays."""
_CUT = 1 << 20
"""Pool of the tubes that are cut along an edge: the last one to be worked on."""


def refine(corners: Array, rows: Index, probe: Probe, spacings: Spacings, settings: SbrSettings) -> Iterator[Pieces]:
    """Cut tubes until each one has one label.

    Parameters
    ----------
    corners : ndarray of float64, shape (num_tubes, 3, 3)
        Footprints [m].
    rows : ndarray of int64, shape (num_tubes,)
        Row of each tube in the tables of the probe; pieces inherit it.
    probe : Probe
        What the rays of a tube meet, at points of its footprint.
    spacings : Spacings
        How finely each tube is probed and halved; where there are bodies near, by `rows`.
    settings : SbrSettings
        Its `bisections`, `corner_share` and `max_rays`.

    Yields
    ------
    corners, rows, labels
        Pieces that together cover the tubes.
    """
    work = _Refinement(probe, spacings, settings)
    pools = _Pools(settings.max_rays)
    pools.put(0, work.waiting(corners, rows, spacings.wide, spacings.fine))
    while pools:
        number, tubes = pools.take()
        if number == _CUT:
            pieces, again = work.cut(tubes)
            yield from pieces
            number >>= 1  # their halves have pools of their own
        else:
            pieces, again, straddling = work.probed(tubes)
            yield from pieces
            pools.put(_CUT, straddling)
        pools.put(number + 1, work.halved(again))


def refined(corners: Array, rows: Index, probe: Probe, spacings: Spacings, settings: SbrSettings) -> Pieces:
    """Return all pieces of :func:`refine` at once."""
    nothing = corners[:0], rows[:0], np.zeros(0, dtype=np.int64)
    pieces = [nothing, *refine(corners, rows, probe, spacings, settings)]
    return tuple(np.concatenate(columns) for columns in zip(*pieces, strict=True))  # type: ignore[return-value]


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

    The pool of the smallest tubes that fills a batch goes first, which bounds the memory; where none does, that of the
    largest.
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


@dataclass(frozen=True, eq=False)
class _Refinement:
    """What is done with tubes that wait."""

    probe: Probe
    spacings: Spacings
    settings: SbrSettings

    def waiting(self, tri: Array, row: Index, wide: Array, fine: Array) -> _Waiting:
        """Return tubes with their layout of probes, `TOO_LONG` for one that is halved before it is probed."""
        longest, height = sides_and_height(tri)
        return _Waiting(tri, row, wide, fine, longest, layouts(longest, height, wide, self._corner_size(wide, fine)))

    def halved(self, tubes: _Waiting) -> _Waiting:
        """Cut tubes in two across their longest side."""
        tri, row = halved(tubes.tri), np.tile(tubes.row, 2)
        wide = self.spacings.of_pieces(tri, row, np.tile(tubes.wide, 2))
        return self.waiting(tri, row, wide, np.tile(tubes.fine, 2))

    def probed(self, tubes: _Waiting) -> tuple[list[Pieces], _Waiting, _Waiting]:
        """Return the pieces that are settled, the tubes to halve, and those to cut along an edge."""
        short = np.flatnonzero(tubes.layout != TOO_LONG)
        long = np.flatnonzero(tubes.layout == TOO_LONG)
        if not len(short):
            return [], tubes, tubes.take(short)
        probed = tubes.take(short) if len(long) else tubes
        count = COUNTS[probed.layout]
        start = np.cumsum(count) - count
        labels = self.probe.within(probed.tri, probed.row, count, OFFSETS[probed.layout])
        same = np.minimum.reduceat(labels, start) == np.maximum.reduceat(labels, start)
        pieces = [(probed.tri[same], probed.row[same], labels[start[same]])] if same.any() else []
        uneven = np.flatnonzero(~same)
        fine = probed.longest[uneven] <= self._edge_size(probed.row[uneven], probed.wide[uneven], probed.fine[uneven])
        small, halve = uneven[fine], uneven[~fine]
        at_corner = labels[start[small, None] + np.arange(3)]
        equal = at_corner == at_corner[:, [1, 2, 0]]  # corner i against i + 1
        two = equal.sum(axis=1) == 1
        large = self._above_corner_size(probed.take(small))
        rest = np.flatnonzero(~two & ~large)
        if len(rest):
            tiny = small[rest]
            whole = np.where(equal[rest, 0], at_corner[rest, 0], labels[start[tiny] + 3])
            pieces.append((probed.tri[tiny], probed.row[tiny], whole))
        again = np.concatenate([long, short[halve], short[small[~two & large]]])
        odd = (equal[two].argmax(axis=1) + 2) % 3
        return pieces, tubes.take(again), probed.to_cut(small[two], at_corner[two], odd)

    def _edge_size(self, row: Index, wide: Array, fine: Array) -> Array:
        """Return the size down to which tubes are halved before they are cut along an edge [m]."""
        size = fine.copy()
        near = self.spacings.are_near(row, wide)
        near = near[np.isfinite(fine[near])]  # the others are not cut at all
        size[near] = np.minimum(fine[near], BESIDE * wide[near])
        return size

    def _corner_size(self, wide: Array, fine: Array) -> Array:
        """Return the size down to which tubes are halved in which more than two things meet [m].

        Beside a narrow body that is no more than the distance of the probes; what is not cut at edges has no size.
        """
        size = self.settings.corner_share * fine
        return np.where(np.isfinite(size), np.minimum(size, wide), size)

    def _above_corner_size(self, tubes: _Waiting) -> npt.NDArray[np.bool_]:
        return np.asarray(tubes.longest > self._corner_size(tubes.wide, tubes.fine))

    def cut(self, tubes: _Waiting) -> tuple[list[Pieces], _Waiting]:
        """Cut tubes one corner of which (`odd`) has another label than the other two.

        A cut is clean where beyond it the other two corners' label begins at once, and where beside a narrow body all
        probes have the labels of the pieces in which they lie; the second result are the tubes where it is not, which
        are halved once more.
        """
        assert tubes.label is not None and tubes.odd is not None and self.settings.bisections is not None
        order = (tubes.odd[:, None] + np.arange(3)) % 3
        pick = np.arange(len(tubes))[:, None]
        tri, label = tubes.tri[pick, order], tubes.label[pick, order]
        share, beyond = self.probe.border(tri, tubes.row, label, self.settings.bisections)
        clean = np.flatnonzero(row_all(beyond == label[:, 1:]))
        kept = ~self._above_corner_size(tubes)
        kept[clean[self._fits(tubes.take(clean), tri[clean], label[clean], share[clean])]] = True
        border = tri[kept, :1] + share[kept, :, None] * (tri[kept, 1:] - tri[kept, :1])
        row, label = tubes.row[kept], label[kept]
        tip, near, far = cut_off(tri[kept], border)
        pieces = [(tip, row, label[:, 0]), (near, row, label[:, 1]), (far, row, label[:, 1])]
        return pieces if len(row) else [], tubes.without_cut(np.flatnonzero(~kept))

    def _fits(self, tubes: _Waiting, tri: Array, label: Index, share: Array) -> npt.NDArray[np.bool_]:
        """Return which cuts explain all probes: beside a narrow body a bar may lie across, which one cut is not.

        `tri` and `label` begin at the corner that is cut off at these shares of its sides.
        """
        fits = np.ones(len(tubes), dtype=np.bool_)
        near = self.spacings.are_near(tubes.row, tubes.wide)
        count, first = np.full_like(near, COUNTS[CLOSER]), np.full_like(near, OFFSETS[CLOSER])
        found = self.probe.within(tri[near], tubes.row[near], count, first).reshape(len(near), COUNTS[CLOSER])
        nodes = WEIGHTS[OFFSETS[CLOSER] :][: COUNTS[CLOSER], 1:]
        beyond = (nodes / share[near, None]).sum(axis=2) - 1.0  # -1 at the corner, 0 on the cut
        wanted = np.where(beyond > 0.0, label[near, 1:2], label[near, :1])
        slack = ON_CUT * tubes.wide[near] / _heights(tri[near], share[near])
        fits[near] = ((found == wanted) | (np.abs(beyond) <= slack[:, None])).all(axis=1)
        return fits


def _heights(tri: Array, share: Array) -> Array:
    """Return how far corners 0 are from cuts at these shares of their sides [m]."""
    one, two = np.moveaxis(share[:, :, None] * (tri[:, 1:] - tri[:, :1]), 1, 0)
    across = two - one
    length = np.einsum("ni,ni->n", across, across)
    foot = one - (np.einsum("ni,ni->n", one, across) / np.maximum(length, 1e-300))[:, None] * across
    return np.sqrt(np.maximum(np.einsum("ni,ni->n", foot, foot), 1e-300))
