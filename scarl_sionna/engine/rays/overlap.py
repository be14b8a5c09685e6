"""Parts whose faces overlap in one plane.

Nothing tells which of them is in front, so a solver that meets both counts both.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt

from .face_planes import repeated_faces

if TYPE_CHECKING:
    from scarl_sionna.engine.world import World, WorldState

Array = npt.NDArray[np.float64]

SAME_PLANE = 2e-5
"""Planes whose normals and offsets [m] agree within this are one."""
LEAST_DEPTH = 1e-3
"""Faces that reach into each other by less than this [m] only touch."""
PAIRS = 1 << 18
"""Pairs of faces looked at at once: some 100 MB; changes no result."""
VISIBLE = 1e-4
"""A place whose distance differs from what a ray finds by less than this, relative, is seen."""


@dataclass(frozen=True)
class Overlap:
    """Two parts that overlap, and a place on the smaller of two of their faces, in the first part's frame [m]."""

    first: int
    second: int
    place: Array


_known: WeakKeyDictionary[World, tuple[Overlap, ...]] = WeakKeyDictionary()


def overlapping_parts(world: World) -> tuple[Overlap, ...]:
    """Return the pairs of parts of one body (or of what stands still) that overlap in a plane, each pair once, sorted.

    Only faces that look the same way are reported: where two solids touch, their faces look at each other and hide in
    between.
    """
    if world not in _known:
        found = _search(world)
        _known[world] = tuple(Overlap(*pair, found[pair]) for pair in sorted(found))
    return _known[world]


def seen_overlaps(state: WorldState, origin: npt.ArrayLike) -> tuple[Overlap, ...]:
    """Return the overlaps of which a place can be seen from a point [m, world]."""
    overlaps = overlapping_parts(state.world)
    if not overlaps:
        return ()
    start = np.asarray(origin, dtype=np.float64)
    places = np.array([state.part_pose(overlap.first).apply(overlap.place) for overlap in overlaps])
    distance = np.linalg.norm(places - start, axis=1)
    hits = state.cast(start, (places - start) / distance[:, None])
    nearest = np.full(len(overlaps), np.inf)
    nearest[hits.ray] = hits.distance
    return tuple(o for o, d, n in zip(overlaps, distance, nearest, strict=True) if abs(n - d) < VISIBLE * d)


def _search(world: World) -> dict[tuple[int, int], Array]:
    triangles = world._triangles
    part, normal = triangles.part, triangles.normal
    plane = np.column_stack([normal, triangles.offset])
    on_joint = {shape for actor in world.actors for joint in actor.joints for shape in joint.shapes}
    own = [len(world.actors) + p if name in on_joint else -1 for p, name in enumerate(world.parts.name)]
    body = np.where(np.array(own) < 0, world.parts.actor, own)[part]
    found: dict[tuple[int, int], Array] = {}
    repeated = repeated_faces(world)  # scatter once
    for shift in (0.0, 0.5):  # two roundings, so that no pair of planes falls on both sides of both
        keys = np.column_stack([body, np.floor(plane / SAME_PLANE + shift).astype(np.int64)])
        order = np.lexsort(keys.T)
        order = order[~repeated[order]]
        first = np.flatnonzero(np.concatenate([[True], np.any(np.diff(keys[order], axis=0) != 0, axis=1)]))
        parts = part[order]
        mixed = np.minimum.reduceat(parts, first) < np.maximum.reduceat(parts, first)
        mixed &= normal[order[first]].any(axis=1)
        stop = np.append(first[1:], len(order))
        for group in np.flatnonzero(mixed).tolist():
            faces = order[first[group] : stop[group]]
            _add_overlaps(found, triangles.corners[faces], normal[faces[0]], part[faces])
    return found


def _add_overlaps(
    found: dict[tuple[int, int], Array], corners: Array, normal: Array, part: npt.NDArray[np.int64]
) -> None:
    """Add the pairs of parts that have overlapping triangles among some of one plane."""
    u = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
    u /= np.linalg.norm(u)
    flat = corners @ np.stack([u, np.cross(normal, u)], axis=1)
    order = np.argsort(flat[:, :, 0].min(axis=1), kind="stable")
    corners, flat, part = corners[order], flat[order], part[order]
    low, high = flat.min(axis=1), flat.max(axis=1)
    area = np.prod(high - low, axis=1)
    row = np.arange(len(order))
    behind = np.maximum(np.searchsorted(low[:, 0], high[:, 0] - LEAST_DEPTH) - row - 1, 0)
    for rows in np.split(row, np.flatnonzero(np.diff(np.cumsum(behind) // PAIRS)) + 1):
        one = np.repeat(rows, behind[rows])
        other = one + 1 + np.arange(len(one)) - np.repeat(np.cumsum(behind[rows]) - behind[rows], behind[rows])
        near = (low[other, 1] < high[one, 1] - LEAST_DEPTH) & (high[other, 1] > low[one, 1] + LEAST_DEPTH)
        near &= part[other] != part[one]
        one, other = one[near], other[near]
        meet = _intersect(flat[one], flat[other])
        one, other = one[meet], other[meet]
        pairs = np.sort(np.column_stack([part[one], part[other]]), axis=1)
        smaller = np.where(area[one] < area[other], one, other)
        for place in np.sort(np.unique(pairs, axis=0, return_index=True)[1]).tolist():
            found.setdefault((int(pairs[place, 0]), int(pairs[place, 1])), corners[smaller[place]].mean(axis=0))


def _intersect(ones: Array, others: Array) -> npt.NDArray[np.bool_]:
    """Return which pairs of triangles, shape (n, 3, 2), reach into each other, by separating axes."""
    result = np.ones(len(others), dtype=np.bool_)
    for polygon in (ones, others):
        edge = np.roll(polygon, -1, axis=1) - polygon
        axis = np.stack([-edge[..., 1], edge[..., 0]], axis=-1)
        axis /= np.maximum(np.linalg.norm(axis, axis=-1, keepdims=True), 1e-12)
        a = np.einsum("nkc,nvc->nkv", axis, ones)
        b = np.einsum("nkc,nvc->nkv", axis, others)
        apart = (a.max(axis=2) < b.min(axis=2) + LEAST_DEPTH) | (b.max(axis=2) < a.min(axis=2) + LEAST_DEPTH)
        result &= ~apart.any(axis=1)
    return result
