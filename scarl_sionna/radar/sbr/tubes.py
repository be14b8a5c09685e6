"""Cutting ray tubes until each one meets a single thing.

A tube has a triangular footprint. Rays probe it on a lattice; where all of them meet the same thing (the same plane, or
nothing), the tube stays whole, however large it is. Where they do not, it is halved, and a small tube that straddles an edge is
cut along that edge, whose place is found by bisection with further rays. So partly hit tubes do not set the error.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]
LabelOf = Callable[[Array, Index], Index]
"""Maps points (n, 3) on footprints and the rows of their tubes to what the tubes' rays meet there."""

_LARGEST_LATTICE = 8
"""Segments along the longest side of a tube that is probed at once; a longer tube is halved first."""
_SLIVER_SEGMENTS = (4, 8, 16, 32, 64)
"""The same for a tube narrower than the spacing, which is probed along its sides only."""
_INSET = 1e-3
"""Probes stand this part of the tube's size inside its border, which may be an edge shared with another face."""
_POINT_LIKE = 0.125
"""Tubes below this part of the edge spacing are probed by one ray: what they straddle is too small to matter."""
_CORNER_SIZE = 0.125
"""Tubes in which more than two things meet are halved on, down to this part of the edge spacing."""
_BISECTIONS = 11
"""The place of an edge is found to 2^-11 of the edge spacing."""


def refine(
    corners: Array, rows: Index, label_of: LabelOf, spacing: Array, edge_spacing: Array, max_rays: int
) -> Iterator[tuple[Array, Index, Index]]:
    """Cut tubes until each one has one label.

    Parameters
    ----------
    corners : ndarray of float64, shape (num_tubes, 3, 3)
        Footprints [m].
    rows : ndarray of int64, shape (num_tubes,)
        Row of each tube in the tables of the caller; pieces inherit it.
    label_of : callable
        What the rays of a tube meet, at points of its footprint.
    spacing, edge_spacing : ndarray of float64, shape (num_tubes,)
        Largest distance of the probes, and size down to which straddling tubes are halved [m].
    max_rays : int
        Rays worked at once.

    Yields
    ------
    corners, rows, labels
        Pieces that together cover the tubes.
    """
    per_batch = max(max_rays // _COUNTS.max(), 1)
    stack = _batches((corners, rows, spacing, edge_spacing), per_batch)[::-1]
    while stack:
        tri, row, wide, fine = stack.pop()
        longest, layout, long = _layout(tri, wide, fine)
        pieces, uneven = _probe(tri[~long], row[~long], fine[~long], longest[~long], layout[~long], label_of)
        if len(pieces[0]):
            yield pieces
        again = np.concatenate([np.flatnonzero(long), np.flatnonzero(~long)[uneven]])
        if len(again):
            halves = _halve(tri[again])
            stack += _batches((halves, *(np.tile(a[again], 2) for a in (row, wide, fine))), per_batch)


def _batches(arrays: tuple[Any, ...], size: int) -> list[tuple[Any, ...]]:
    return [tuple(array[i : i + size] for array in arrays) for i in range(0, len(arrays[0]), size)]


def _layout(tri: Array, wide: Array, fine: Array) -> tuple[Array, Index, npt.NDArray[np.bool_]]:
    """Return each tube's longest side, its layout of probes, and whether it is too long to be probed as it is."""
    sides = np.roll(tri, -1, axis=1) - tri
    longest = np.linalg.norm(sides, axis=2).max(axis=1)
    height = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1) / longest
    segments = np.maximum(np.ceil(longest / wide), 1)
    layout = np.minimum(segments, _LARGEST_LATTICE).astype(np.int64)
    layout[longest <= _POINT_LIKE * fine] = 0
    sliver = (segments > 2) & (height <= wide)
    step = np.searchsorted(_SLIVER_SEGMENTS, segments[sliver])
    layout[sliver] = _LARGEST_LATTICE + 1 + np.minimum(step, len(_SLIVER_SEGMENTS) - 1)
    return longest, layout, segments > np.where(sliver, _SLIVER_SEGMENTS[-1], _LARGEST_LATTICE)


def _probe(
    tri: Array, row: Index, fine: Array, longest: Array, layout: Index, label_of: LabelOf
) -> tuple[tuple[Array, Index, Index], Index]:
    """Return the pieces that are settled, and the numbers of the tubes to halve."""
    inner = _inset(tri)
    points, start = _probe_points(inner, layout)
    labels = label_of(points, np.repeat(row, _COUNTS[layout]))
    if not len(tri):
        return (tri, row, labels), np.zeros(0, dtype=np.int64)
    same = np.minimum.reduceat(labels, start) == np.maximum.reduceat(labels, start)
    straddles = ~same & (longest <= fine)
    cut, corner = _cut(tri, inner, row, labels, start, np.flatnonzero(straddles), longest / fine, label_of)
    parts = [(tri[same], row[same], labels[start[same]]), *cut]
    settled = tuple(np.concatenate([part[i] for part in parts]) for i in range(3))
    return settled, np.concatenate([np.flatnonzero(~same & ~straddles), corner])  # type: ignore[return-value]


def _cut(
    tri: Array, inner: Array, row: Index, labels: Index, start: Index, chosen: Index, size: Array, label_of: LabelOf
) -> tuple[list[tuple[Array, Index, Index]], Index]:
    """Cut the chosen tubes along the edge that they straddle; the second result are those to halve once more."""
    at_corner = labels[start[chosen, None] + np.arange(3)]
    equal = at_corner == np.roll(at_corner, -1, axis=1)  # corner i against i + 1
    two = equal.sum(axis=1) == 1
    large = size[chosen] > _CORNER_SIZE
    again = [chosen[~two & large]]
    rest = ~two & ~large
    small = chosen[rest]
    whole = np.where(equal[rest, 0], at_corner[rest, 0], labels[start[small] + 3])
    pieces = [(tri[small], row[small], whole)]
    if two.any():
        odd = (equal[two].argmax(axis=1) + 2) % 3
        halved = chosen[two]
        cut, clean = _along_edge(tri[halved], inner[halved], row[halved], at_corner[two], odd, label_of)
        kept = clean | ~large[two]
        pieces += [(corners[kept], rows[kept], label[kept]) for corners, rows, label in cut]
        again.append(halved[~kept])
    return pieces, np.concatenate(again)


def _along_edge(
    tri: Array, inner: Array, row: Index, at_corner: Index, odd: Index, label_of: LabelOf
) -> tuple[list[tuple[Array, Index, Index]], npt.NDArray[np.bool_]]:
    """Cut triangles one corner of which (`odd`) has another label than the other two.

    The second result says where the cut is clean: beyond it the other two corners' label begins at once.
    """
    order = (odd[:, None] + np.arange(3)) % 3
    pick = np.arange(len(tri))[:, None]
    tri, inner, label = tri[pick, order], inner[pick, order], at_corner[pick, order]
    low = np.zeros((len(tri), 2))
    high = np.ones((len(tri), 2))
    beyond = label[:, 1:]
    for _ in range(_BISECTIONS):
        middle = (low + high) / 2.0
        points = inner[:, :1] + middle[:, :, None] * (inner[:, 1:] - inner[:, :1])
        found = label_of(points.reshape(-1, 3), np.repeat(row, 2)).reshape(-1, 2)
        inside = found == label[:, :1]
        low, high = np.where(inside, middle, low), np.where(inside, high, middle)
        beyond = np.where(inside, beyond, found)
    border = tri[:, :1] + ((low + high) / 2.0)[:, :, None] * (tri[:, 1:] - tri[:, :1])
    tip = np.stack([tri[:, 0], border[:, 0], border[:, 1]], axis=1)
    near = np.stack([border[:, 0], tri[:, 1], tri[:, 2]], axis=1)
    far = np.stack([border[:, 0], tri[:, 2], border[:, 1]], axis=1)
    pieces = [(tip, row, label[:, 0]), (near, row, label[:, 1]), (far, row, label[:, 1])]
    return pieces, (beyond == label[:, 1:]).all(axis=1)


def _inset(tri: Array) -> Array:
    center = tri.mean(axis=1, keepdims=True)
    return np.asarray(tri + _INSET * (center - tri))


def _halve(tri: Array) -> Array:
    """Cut triangles in two across their longest side."""
    sides = np.linalg.norm(np.roll(tri, -1, axis=1) - tri, axis=2)  # from corner i to i + 1
    order = (sides.argmax(axis=1)[:, None] + np.arange(3)) % 3
    a, b, c = np.moveaxis(tri[np.arange(len(tri))[:, None], order], 1, 0)
    middle = (a + b) / 2.0
    return np.concatenate([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)])


def _lattice(segments: int) -> Array:
    """Return barycentric coordinates of the probes: the corners first; for one segment also the centroid."""
    corner = np.eye(3)
    if segments == 0:
        return np.full((1, 3), 1.0 / 3.0)
    if segments == 1:
        return np.vstack([corner, np.full((1, 3), 1.0 / 3.0)])
    nodes = [(i, j, segments - i - j) for i in range(segments + 1) for j in range(segments + 1 - i)]
    inside = [node for node in nodes if max(node) < segments]
    return np.vstack([corner, np.array(inside, dtype=np.float64) / segments])


def _border(segments: int) -> Array:
    """Return barycentric coordinates of probes along the three sides, the corners first."""
    part = np.arange(1, segments)[:, None] / segments
    corner = np.eye(3)
    return np.vstack([corner, *((1.0 - part) * corner[i] + part * corner[(i + 1) % 3] for i in range(3))])


_LAYOUTS = [_lattice(n) for n in range(_LARGEST_LATTICE + 1)] + [_border(n) for n in _SLIVER_SEGMENTS]
_COUNTS = np.array([len(layout) for layout in _LAYOUTS])
_OFFSETS = np.cumsum(_COUNTS) - _COUNTS
_TABLE = np.vstack(_LAYOUTS)


def _probe_points(tri: Array, layout: Index) -> tuple[Array, Index]:
    """Return the probes of all tubes, tube after tube, and where each tube's begin."""
    count = _COUNTS[layout]
    start = np.cumsum(count) - count
    owner = np.repeat(np.arange(len(tri)), count)
    weight = _TABLE[np.arange(len(owner)) - start[owner] + _OFFSETS[layout][owner]]
    points = weight[:, :1] * tri[owner, 0]
    points += weight[:, 1:2] * tri[owner, 1]
    points += weight[:, 2:] * tri[owner, 2]
    return points, start
