"""Where a triangular footprint is probed, and how it is halved and cut."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.arrays.rows import row_max

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]

LARGEST_LATTICE = 8
"""Segments along the longest side of a tube that is probed at once; a longer tube is halved first. How far apart the
probes are is `ray_spacing`; this only says how many go at once."""
SLIVER_SEGMENTS = (4, 8, 16, 32, 64)
"""The same for a tube narrower than the spacing, which is probed along its sides only."""
INSET = 1e-3
"""Probes stand this part of the tube's size inside its border, which may be an edge shared with another face: a
guard against rounding, below the 2^-9 to which edges are found in a scene."""


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


_LAYOUTS = [_lattice(n) for n in range(LARGEST_LATTICE + 1)] + [_border(n) for n in SLIVER_SEGMENTS]
TOO_LONG = len(_LAYOUTS)
"""Layout of a tube that is halved before it is probed."""
COUNTS = np.array([*(len(layout) for layout in _LAYOUTS), 1])
"""Probes of each layout, the last that of `TOO_LONG`."""
OFFSETS = np.cumsum(COUNTS) - COUNTS
"""First row of each layout in `WEIGHTS`."""
WEIGHTS = np.vstack(_LAYOUTS)
"""Barycentric coordinates of the probes, layout after layout."""
_NEXT = np.array([1, 2, 0])
"""Corner behind each of a triangle's."""


def layouts(longest: Array, height: Array, wide: Array, point_like: Array) -> Index:
    """Return each tube's layout of probes.

    Parameters
    ----------
    longest, height : ndarray of float64, shape (num_tubes,)
        Of each tube, its longest side and the height over that [m].
    wide, point_like : ndarray of float64, shape (num_tubes,)
        Largest distance of the probes, and length up to which one probe does [m].
    """
    segments = np.maximum(np.ceil(longest / wide), 1)
    layout = np.minimum(segments, LARGEST_LATTICE).astype(np.int64)
    layout[longest <= point_like] = 0
    sliver = (segments > 2) & (height <= wide)
    step = np.searchsorted(SLIVER_SEGMENTS, segments[sliver])
    layout[sliver] = LARGEST_LATTICE + 1 + np.minimum(step, len(SLIVER_SEGMENTS) - 1)
    layout[segments > np.where(sliver, SLIVER_SEGMENTS[-1], LARGEST_LATTICE)] = TOO_LONG
    return layout


def halved(tri: Array) -> Array:
    """Cut triangles, shape (n, 3, 3), in two across their longest side: all first halves, then all second ones."""
    side = tri[:, _NEXT] - tri  # from corner i to i + 1
    first = np.einsum("nij,nij->ni", side, side).argmax(axis=1)
    a, b, c = (tri[np.arange(len(tri)), corner] for corner in (first, _NEXT[first], _NEXT[_NEXT[first]]))
    found = np.empty((2, *tri.shape))
    found[0, :, 0], found[1, :, 1], found[:, :, 2] = a, b, c
    found[0, :, 1] = found[1, :, 0] = (a + b) / 2.0
    return found.reshape(-1, 3, 3)


def cut_off(tri: Array, border: Array) -> tuple[Array, Array, Array]:
    """Cut triangles between points `border`, shape (n, 2, 3), of the sides at corner 0: tip and two rest pieces."""
    one, two, three = np.moveaxis(tri, 1, 0)
    first, second = np.moveaxis(border, 1, 0)
    return (
        np.stack([one, first, second], axis=1),
        np.stack([first, two, three], axis=1),
        np.stack([first, three, second], axis=1),
    )


@lru_cache(maxsize=8)
def spread(count: int) -> tuple[Array, Array, Array]:
    """Return steps from 0 to 1, and two coordinates in a triangle, evenly spread over it, for each of some points."""
    step = (np.arange(count) + 0.5) / count
    roberts = np.array([0.7548776662, 0.5698402910])
    first, second = (np.modf(step[:, None] * count * roberts)[0]).T
    flip = first + second > 1.0
    return step, np.where(flip, 1.0 - first, first), np.where(flip, 1.0 - second, second)


def inset(tri: Array) -> Array:
    """Return triangles, shape (n, 3, 3), a little smaller, so that their corners stand on no border."""
    return np.asarray(tri + INSET * (middle(tri)[:, None] - tri))


def middle(corners: Array) -> Array:
    """Return the centroids of triangles, shape (n, 3); faster than a mean."""
    return np.asarray((corners[:, 0] + corners[:, 1] + corners[:, 2]) / 3.0)


def sides_and_height(tri: Array) -> tuple[Array, Array]:
    """Return the longest side of triangles, shape (n, 3, 3), and the height over it [m]."""
    side = tri[:, _NEXT] - tri
    longest = np.sqrt(row_max(np.einsum("nij,nij->ni", side, side)))
    a, b = side[:, 0], side[:, 1]
    twice = np.einsum("ni,ni->n", a, a) * np.einsum("ni,ni->n", b, b) - np.einsum("ni,ni->n", a, b) ** 2
    return longest, np.sqrt(np.maximum(twice, 0.0)) / longest
