"""Parts whose faces overlap in one plane.

Nothing tells which of them is in front, so a solver that meets both counts both.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from scarl_sionna.engine.world import World, WorldState

Array = npt.NDArray[np.float64]

SAME_PLANE = 2e-5
"""Planes whose normals and offsets [m] agree within this are one."""
LEAST_DEPTH = 1e-3
"""Faces that reach into each other by less than this [m] only touch."""

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
    part = np.repeat(np.arange(len(triangles.first) - 1), np.diff(triangles.first))
    normal = triangles.normal
    plane = np.column_stack([normal, triangles.offset])
    on_joint = {shape for actor in world.actors for joint in actor.joints for shape in joint.shapes}
    own = [len(world.actors) + p if name in on_joint else -1 for p, name in enumerate(world.parts.name)]
    body = np.where(np.array(own) < 0, world.parts.actor, own)[part]
    found: dict[tuple[int, int], Array] = {}
    for shift in (0.0, 0.5):  # two roundings, so that no pair of planes falls on both sides of both
        keys = np.column_stack([body, np.floor(plane / SAME_PLANE + shift).astype(np.int64)])
        order = np.lexsort(keys.T)
        borders = np.flatnonzero(np.any(np.diff(keys[order], axis=0) != 0, axis=1)) + 1
        for faces in np.split(order, borders):
            if len(faces) > 1 and normal[faces[0]].any() and len(np.unique(part[faces])) > 1:
                _add_overlaps(found, triangles.corners[faces], normal[faces[0]], part[faces])
    return found


def _add_overlaps(
    found: dict[tuple[int, int], Array], corners: Array, normal: Array, part: npt.NDArray[np.int64]
) -> None:
    """Add the pairs of parts that have overlapping triangles among some of one plane."""
    u = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
    u /= np.linalg.norm(u)
    flat = corners @ np.stack([u, np.cross(normal, u)], axis=1)
    low, high = flat.min(axis=1), flat.max(axis=1)
    area = np.prod(high - low, axis=1)
    order = np.argsort(low[:, 0], kind="stable")
    for place, first in enumerate(order):
        stop = place + 1 + int(np.searchsorted(low[order[place + 1 :], 0], high[first, 0] - LEAST_DEPTH))
        others = order[place + 1 : stop]
        near = (low[others, 1] < high[first, 1] - LEAST_DEPTH) & (high[others, 1] > low[first, 1] + LEAST_DEPTH)
        others = others[near & (part[others] != part[first])]
        if not len(others):
            continue
        for other in others[_intersect(flat[first], flat[others])]:
            smaller = first if area[first] < area[other] else other
            pair = (int(min(part[first], part[other])), int(max(part[first], part[other])))
            found.setdefault(pair, corners[smaller].mean(axis=0))


def _intersect(one: Array, others: Array) -> npt.NDArray[np.bool_]:
    """Return which of some triangles, shape (n, 3, 2), reach into one triangle, by separating axes."""
    result = np.ones(len(others), dtype=np.bool_)
    both = np.broadcast_to(one, others.shape)
    for polygon in (both, others):
        edge = np.roll(polygon, -1, axis=1) - polygon
        axis = np.stack([-edge[..., 1], edge[..., 0]], axis=-1)
        axis /= np.maximum(np.linalg.norm(axis, axis=-1, keepdims=True), 1e-12)
        a = np.einsum("nkc,nvc->nkv", axis, both)
        b = np.einsum("nkc,nvc->nkv", axis, others)
        apart = (a.max(axis=2) < b.min(axis=2) + LEAST_DEPTH) | (b.max(axis=2) < a.min(axis=2) + LEAST_DEPTH)
        result &= ~apart.any(axis=1)
    return result
