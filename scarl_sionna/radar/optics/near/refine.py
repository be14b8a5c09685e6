"""Cutting ray tubes until each one meets a single thing: levels of all tubes at once, each level one kernel.

A tube has a triangular footprint. Rays probe it on a lattice; where all of them meet the same thing (the same plane, or
nothing), the tube stays whole. Where they do not, it is halved, and a small tube that straddles an edge is cut along that edge,
whose place is found by bisection. So partly hit tubes do not set the error.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
import numpy.typing as npt

from scarl_sionna.radar.optics.tube_shape import (
    CORNER_SIZE,
    COUNTS,
    INSET,
    LARGEST_LATTICE,
    OFFSETS,
    TOO_LONG,
    WEIGHTS,
    cut_off,
    halved,
    layouts,
)

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]
Pieces = tuple[Array, Index, Index]

_RAYS_PER_BATCH = 2_000_000
"""Rays worked at once: some 200 MB."""


class Probe(Protocol):
    """What rays meet; see :mod:`~.sbr_rays`."""

    def labels(self, corners: Array, rows: Index, tube: Index, weight: Index, weights: Array) -> Index:
        """Return the label at each point ``weights[weight]`` (barycentric) of the tubes ``tube``."""
        ...

    def border(self, corners: Array, rows: Index, label: Index) -> tuple[Array, Index]:
        """Return where along the two sides from corner 0 its label ends, (n, 2), and the label beyond, (n, 2)."""
        ...


def refine(corners: Array, rows: Index, probe: Probe, spacing: Array, edge_spacing: Array) -> Pieces:
    """Cut tubes until each one has one label.

    Parameters
    ----------
    corners : ndarray of float64, shape (num_tubes, 3, 3)
        Footprints [m].
    rows : ndarray of int64, shape (num_tubes,)
        Row of each tube in the tables of the probe; pieces inherit it.
    probe : Probe
    spacing, edge_spacing : ndarray of float64, shape (num_tubes,)
        Largest distance of the probes, and size down to which straddling tubes are halved [m].

    Returns
    -------
    corners, rows, labels
        Pieces that together cover the tubes.
    """
    done: list[Pieces] = [(corners[:0], rows[:0], np.zeros(0, dtype=np.int64))]
    level = (corners, rows, spacing, edge_spacing)
    while len(level[1]):
        waiting = []
        for tri, row, wide, fine in _batches(level):
            longest, layout = _layout(tri, wide, fine)
            long = layout == TOO_LONG
            short = ~long
            settled, uneven = _probe(tri[short], row[short], fine[short], longest[short], layout[short], probe)
            done += settled
            again = np.concatenate([np.flatnonzero(long), np.flatnonzero(short)[uneven]])
            halves = halved(tri[again])
            waiting.append((halves, *(np.tile(a[again], 2) for a in (row, wide, fine))))
        level = tuple(np.concatenate(columns) for columns in zip(*waiting, strict=True))  # type: ignore[assignment]
    return tuple(np.concatenate(columns) for columns in zip(*done, strict=True))  # type: ignore[return-value]


def _batches(level: tuple[Array, Index, Array, Array]) -> list[tuple[Array, Index, Array, Array]]:
    size = max(_RAYS_PER_BATCH // _LARGEST_COUNT, 1)
    return [tuple(a[i : i + size] for a in level) for i in range(0, len(level[0]), size)]  # type: ignore[misc]


def _layout(tri: Array, wide: Array, fine: Array) -> tuple[Array, Index]:
    """Return each tube's longest side and its layout of probes."""
    side = tri[:, [1, 2, 0]] - tri
    longest = np.sqrt(np.einsum("nij,nij->ni", side, side).max(axis=1))
    a, b = side[:, 0], side[:, 1]
    dot = np.einsum("ni,ni->n", a, b)
    twice = np.einsum("ni,ni->n", a, a) * np.einsum("ni,ni->n", b, b) - dot**2
    height = np.sqrt(np.maximum(twice, 0.0)) / longest
    return longest, layouts(longest, height, wide, fine)


def _probe(
    tri: Array, row: Index, fine: Array, longest: Array, layout: Index, probe: Probe
) -> tuple[list[Pieces], Index]:
    """Return the pieces that are settled, and the numbers of the tubes to halve."""
    if not len(tri):
        return [], np.zeros(0, dtype=np.int64)
    count = COUNTS[layout]
    start = np.cumsum(count) - count
    tube = np.repeat(np.arange(len(tri)), count)
    weight = np.arange(len(tube)) - np.repeat(start - OFFSETS[layout], count)
    labels = probe.labels(tri, row, tube, weight, _TABLE)
    same = np.minimum.reduceat(labels, start) == np.maximum.reduceat(labels, start)
    straddles = ~same & (longest <= fine)
    cut, corner = _cut(tri, row, labels, start, np.flatnonzero(straddles), longest / fine, probe)
    pieces = [(tri[same], row[same], labels[start[same]]), *cut]
    return pieces, np.concatenate([np.flatnonzero(~same & ~straddles), corner])


def _cut(
    tri: Array, row: Index, labels: Index, start: Index, chosen: Index, size: Array, probe: Probe
) -> tuple[list[Pieces], Index]:
    """Cut the chosen tubes along the edge that they straddle; the second result are those to halve once more."""
    at_corner = labels[start[chosen, None] + np.arange(3)]
    equal = at_corner == np.roll(at_corner, -1, axis=1)  # corner i against i + 1
    two = equal.sum(axis=1) == 1
    large = size[chosen] > CORNER_SIZE
    rest = ~two & ~large
    small = chosen[rest]
    whole = np.where(equal[rest, 0], at_corner[rest, 0], labels[start[small] + 3])
    pieces, again = [(tri[small], row[small], whole)], [chosen[~two & large]]
    if two.any():
        odd = (equal[two].argmax(axis=1) + 2) % 3
        cut, clean = _along_edge(tri[chosen[two]], row[chosen[two]], at_corner[two], odd, probe)
        kept = clean | ~large[two]
        pieces += [(corners[kept], rows[kept], label[kept]) for corners, rows, label in cut]
        again.append(chosen[two][~kept])
    return pieces, np.concatenate(again)


def _along_edge(
    tri: Array, row: Index, at_corner: Index, odd: Index, probe: Probe
) -> tuple[list[Pieces], npt.NDArray[np.bool_]]:
    """Cut triangles one corner of which (`odd`) has another label than the other two.

    The second result says where the cut is clean: beyond it the other two corners' label begins at once.
    """
    order = (odd[:, None] + np.arange(3)) % 3
    pick = np.arange(len(tri))[:, None]
    tri, label = tri[pick, order], at_corner[pick, order]
    share, beyond = probe.border(tri, row, label)
    border = tri[:, :1] + share[:, :, None] * (tri[:, 1:] - tri[:, :1])
    tip, near, far = cut_off(tri, border)
    pieces = [(tip, row, label[:, 0]), (near, row, label[:, 1]), (far, row, label[:, 1])]
    return pieces, (beyond == label[:, 1:]).all(axis=1)


def inset(weights: Array) -> Array:
    """Return barycentric coordinates moved a little towards the middle."""
    return np.asarray(weights + INSET * (1.0 / 3.0 - weights))


_LARGEST_COUNT = int(COUNTS[: LARGEST_LATTICE + 1].max())
_TABLE = inset(WEIGHTS)
