"""Warns where one solve from an array's centre does not hold for all of its antennas: some do not see the path."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ScarlWarning
from scarl_sionna.engine.paths.tracing import DIFFRACTION, REFRACTION, SPECULAR

from .images import Chain
from .legs import Legs
from .station import Station

if TYPE_CHECKING:
    from scarl_sionna.engine.world import WorldState

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

SURFACE = 2e-3
"""A ray may meet a surface this far from where it should [m]: round-off, float32 hits are within 1e-4 m at 300 m.
Decides a warning only."""


def warn_of_hidden_antennas(state: WorldState, legs: list[tuple[Legs, Station]], wide_arm: float) -> int:
    """Warn once where outer antennas of a wide array do not see a path that its centre sees.

    Return the number of such legs.

    Arrays whose antennas are all within `wide_arm` [m] of their centre are not tested: within the first Fresnel zone
    seen or not seen is no property of a single antenna.
    """
    hidden, total = 0, 0
    for block, station in legs:
        total += len(block.length)
        if len(block.length) and np.linalg.norm(station.arms, axis=1).max(initial=0.0) > wide_arm:
            hidden += int(np.count_nonzero(~_seen_by_all(state, block, station)))
    if hidden:
        warnings.warn(
            f"{hidden} of {total} path(s) are not seen by all antennas: the array is wide, and an edge or the end of "
            "a mirror is close to where they pass. Visibility is that of the array's centre, so their signal at the "
            "outer antennas is wrong; solve for parts of the array apart (a RadarSpec with some of the antennas at a "
            "pose of their own)",
            ScarlWarning,
            stacklevel=4,
        )
    return hidden


def _seen_by_all(state: WorldState, legs: Legs, station: Station) -> Flags:
    """Return which legs all outermost antennas see; legs over an edge count as seen."""
    outer = np.unique(np.concatenate([station.arms.argmax(axis=0), station.arms.argmin(axis=0)]))
    mirror, pane = legs.kind == SPECULAR, legs.kind == REFRACTION
    rows = state._triangles.first[np.maximum(legs.part, 0)] + np.maximum(legs.face, 0)
    used = (mirror | pane)[..., None]
    chain = Chain(mirror, pane, np.where(used, state._triangles.normal[rows], 0.0), state._triangles.offset[rows])
    ends = np.einsum("pji,pj->pi", legs.isometry[:, :, :3], legs.image - legs.isometry[:, :, 3])
    straight = ~(legs.kind == DIFFRACTION).any(axis=1)
    images = chain.images(np.where(straight[:, None], ends, legs.image))
    seen = np.ones(len(legs.length), dtype=np.bool_)
    for antenna in station.position + station.arms[outer]:
        points, right = chain.vertices(antenna, images)
        seen &= right & _unbroken(state, antenna, points, images[:, -1], legs.depth)
    return seen | ~straight


def _unbroken(state: WorldState, start: Array, points: Array, ends: Array, depth: npt.NDArray[np.int32]) -> Flags:
    """Return which polylines from a start over points to ends meet their surfaces and nothing else."""
    count, width = points.shape[:2]
    good = np.ones(count, dtype=np.bool_)
    line = np.concatenate([np.broadcast_to(start, (count, 1, 3)), points, ends[:, None]], axis=1)
    line = np.where((np.arange(width + 2) <= depth[:, None])[..., None], line, ends[:, None])
    for k in range(width + 1):
        step = line[:, k + 1] - line[:, k]
        length = np.linalg.norm(step, axis=1)
        live = np.flatnonzero(good & (k <= depth) & (length > 2.0 * SURFACE))
        direction = step[live] / length[live, None]
        offset = SURFACE if k else 0.0
        hits = state.cast(line[live, k] + offset * direction, direction, twin="radio")
        distance = np.full(len(live), np.inf)
        distance[hits.ray] = hits.distance + offset
        free = distance > length[live] - SURFACE
        good[live] = np.where(k < depth[live], free & (distance < length[live] + SURFACE), free)
    return good
