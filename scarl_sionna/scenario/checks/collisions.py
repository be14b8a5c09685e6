"""Collisions between planned motions: oriented boxes in plan, by separating axes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.scenario.motion.bodies import ActorBody, BodyLike, TrailerBody
from scarl_sionna.scenario.motion.paths import sample_motion
from scarl_sionna.scene.motion.towing import Towing
from scarl_sionna.scene.motion.trajectory import Trajectory

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]
Measures = Sequence[float] | BodyLike
"""(length, width) or (length, width, height) [m], or a body."""

_HEIGHT = 2.0
"""Height of a body for which only length and width are given [m]."""


@dataclass(frozen=True)
class Collision:
    """Two bodies whose boxes overlap.

    Attributes
    ----------
    first, second : str
        Names, in the order in which the bodies were given.
    time : float
        First of the given times at which they overlap [s].
    depth : float
        Largest depth of the overlap over all times: the shortest way that would part them [m].
    last : float
        Last of the given times at which they overlap [s].
    """

    first: str
    second: str
    time: float
    depth: float
    last: float


def find_collisions(
    actors: Sequence[tuple[str, Trajectory, Measures]], times: npt.ArrayLike, tolerance: float = 0.0
) -> list[Collision]:
    """Return the pairs of bodies that overlap at any of the times.

    Parameters
    ----------
    actors : sequence of (name, trajectory, measures)
        `measures`: (length, width) or (length, width, height) [m] of a box round the origin on the ground, or a body
        with these. Where a trajectory is not known, its body is not there.
    times : array_like of float, shape (N,)
        Instants [s]; a gap of 0.1 s misses less than 1 m at a closing speed of 10 m/s.
    tolerance : float
        Depth that still counts as apart [m].

    Returns
    -------
    list of Collision
        In the order of their first times.

    Raises
    ------
    ParameterRangeError
        If a name stands twice, or a measure or a time is not allowed.

    Notes
    -----
    Pairs nearer than their half diagonals (k-d tree) are compared along the four axes of their boxes; heights must
    overlap, too. Exact for boxes that stand upright. A vehicle with a trailer (`ActorBody.trailer`) is two boxes, which
    may touch each other. *Not modelled*: motion between the times, shapes other than boxes.
    """
    instants = np.atleast_1d(np.asarray(times, dtype=np.float64))
    if instants.ndim != 1 or not instants.size or not np.isfinite(instants).all():
        raise ParameterRangeError("times", times, "one or more finite instants [s]")
    names = [name for name, _, _ in actors]
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise ParameterRangeError("actors", twice, "every name once")
    if len(actors) < 2:
        return []
    boxes = _boxes(actors, instants)
    pairs = _near_pairs(boxes)
    depth = _overlap(boxes, pairs)
    hit = (depth > tolerance) & (boxes.owner[pairs.first] != boxes.owner[pairs.second])
    found = pairs.select(hit)
    owners = np.sort(boxes.owner[np.stack([found.first, found.second])], axis=0)
    return _summary(names, instants, _Pairs(owners[0], owners[1], found.moment), depth[hit])


@dataclass(frozen=True, eq=False)
class _Boxes:
    """Boxes of A bodies, and behind them B of what some of them tow, at N instants.

    `position` (A + B, N, 3) [m], NaN where a body is not there; `heading` (A + B, N) [rad]; `half` length and
    width (A + B, 2) [m]; `height` (A + B,) [m]; `owner` (A + B,): which body each belongs to.
    """

    position: Array
    heading: Array
    half: Array
    height: Array
    owner: Index


@dataclass(frozen=True, eq=False)
class _Pairs:
    """Pairs of bodies at instants.

    Rows `first` and `second` of the bodies, column `moment` of the instants, each (P,).
    """

    first: Index
    second: Index
    moment: Index

    def select(self, rows: npt.NDArray[np.bool_]) -> _Pairs:
        return _Pairs(self.first[rows], self.second[rows], self.moment[rows])


def _boxes(actors: Sequence[tuple[str, Trajectory, Measures]], instants: Array) -> _Boxes:
    """Return the boxes of all bodies at all instants."""
    half, height = _measures(actors)
    position = np.full((len(actors), len(instants), 3), np.nan)
    heading = np.zeros((len(actors), len(instants)))
    for index, (_, trajectory, _) in enumerate(actors):
        known = (instants >= trajectory.start) & (instants <= trajectory.stop)
        if known.any():
            motion = sample_motion(trajectory, instants[known])
            position[index, known], heading[index, known] = motion.position, motion.heading
    boxes = _Boxes(position, heading, half, height, np.arange(len(actors)))
    for index, (_, trajectory, measures) in enumerate(actors):
        if not isinstance(measures, Sequence) and (trailer := ActorBody.of(measures).trailer) is not None:
            boxes = _with_trailer(boxes, index, trajectory, trailer, instants)
    return boxes


_TAIL = 0.8
"""How far a towing vehicle reaches behind its coupling [m]."""


def _with_trailer(boxes: _Boxes, index: int, trajectory: Trajectory, trailer: TrailerBody, instants: Array) -> _Boxes:
    """Return boxes with that of a body drawn in to what tows, and one more: what is towed."""
    towing, seen = Towing(trajectory, (trailer.hitch, 0.0, 0.0), trailer.length), boxes.position[index, :, 0]
    origin, heading = boxes.position[index], boxes.heading[index]
    known = np.isfinite(seen).tolist()
    angle = np.array(
        [towing.angle(time) if there else 0.0 for time, there in zip(instants.tolist(), known, strict=True)]
    )
    front, rear, towed = boxes.half[index, 0], trailer.hitch - _TAIL, heading + angle
    middle = 0.5 * (trailer.front + trailer.rear) - trailer.hitch
    ahead = np.stack([np.cos(heading), np.sin(heading), 0.0 * heading], axis=1)
    behind = np.stack([np.cos(towed), np.sin(towed), 0.0 * towed], axis=1)
    position, half = boxes.position.copy(), boxes.half.copy()
    position[index] = origin + 0.5 * (front + rear) * ahead
    half[index, 0] = 0.5 * (front - rear)
    return _Boxes(
        np.concatenate([position, (origin + trailer.hitch * ahead + middle * behind)[None]]),
        np.concatenate([boxes.heading, towed[None]]),
        np.concatenate([half, [[0.5 * (trailer.front - trailer.rear), half[index, 1]]]]),
        np.append(boxes.height, boxes.height[index]),
        np.append(boxes.owner, index),
    )


def _measures(actors: Sequence[tuple[str, Trajectory, Measures]]) -> tuple[Array, Array]:
    """Return half length and half width (A, 2) and height (A,) [m]."""
    rows = []
    for name, _, measures in actors:
        values = (
            tuple(measures) if isinstance(measures, Sequence) else (measures.length, measures.width, measures.height)
        )
        row = np.array([*values, _HEIGHT][:3], dtype=np.float64)
        if len(values) not in (2, 3) or not np.isfinite(row).all() or row.min() <= 0.0:
            raise ParameterRangeError(f"measures of '{name}'", values, "length, width[, height] above 0 m")
        rows.append(row)
    table = np.array(rows)
    return table[:, :2] / 2.0, table[:, 2]


def _near_pairs(boxes: _Boxes) -> _Pairs:
    """Return pairs of bodies and instants at which circles round their boxes may touch."""
    position, radius = boxes.position, np.linalg.norm(boxes.half, axis=1)
    found: list[Index] = []
    for moment in range(position.shape[1]):
        present = np.flatnonzero(np.isfinite(position[:, moment, 0]))
        if present.size < 2:
            continue
        pairs = cKDTree(position[present, moment, :2]).query_pairs(
            2.0 * float(radius[present].max()), output_type="ndarray"
        )
        if pairs.size:
            pairs = np.sort(present[pairs], axis=1)
            away = np.linalg.norm(position[pairs[:, 0], moment, :2] - position[pairs[:, 1], moment, :2], axis=1)
            pairs = pairs[away < radius[pairs].sum(1)]
            found.append(np.column_stack([pairs, np.full(len(pairs), moment)]))
    table = np.concatenate(found).astype(np.int64) if found else np.zeros((0, 3), dtype=np.int64)
    return _Pairs(table[:, 0], table[:, 1], table[:, 2])


def _overlap(boxes: _Boxes, pairs: _Pairs) -> Array:
    """Return the depth of the overlap of pairs of boxes (P,) [m], negative where they are apart."""
    first, second, moment = pairs.first, pairs.second, pairs.moment
    between = boxes.position[second, moment] - boxes.position[first, moment]
    axes = []
    for index in (first, second):
        heading = boxes.heading[index, moment]
        cos, sin = np.cos(heading), np.sin(heading)
        axes.append(np.stack([np.stack([cos, sin], 1), np.stack([-sin, cos], 1)], 1))
    depth = np.full(len(first), np.inf)
    for axis in (axes[0][:, 0], axes[0][:, 1], axes[1][:, 0], axes[1][:, 1]):
        reach = np.zeros(len(first))
        for index, own in ((first, axes[0]), (second, axes[1])):
            reach += (boxes.half[index] * np.abs(np.einsum("pij,pj->pi", own, axis))).sum(1)
        depth = np.minimum(depth, reach - np.abs((between[:, :2] * axis).sum(1)))
    above = np.where(between[:, 2] >= 0.0, boxes.height[first], boxes.height[second])
    return np.where(np.abs(between[:, 2]) < above, depth, -np.inf)


def _summary(names: Sequence[str], times: Array, pairs: _Pairs, depth: Array) -> list[Collision]:
    """Return one entry a pair."""
    found: dict[tuple[int, int], tuple[float, float, float]] = {}
    for one, other, when, deep in zip(
        pairs.first.tolist(), pairs.second.tolist(), times[pairs.moment].tolist(), depth.tolist(), strict=True
    ):
        early, most, late = found.get((one, other), (when, deep, when))
        found[one, other] = (min(early, when), max(most, deep), max(late, when))
    hits = [
        Collision(names[one], names[other], early, most, late) for (one, other), (early, most, late) in found.items()
    ]
    return sorted(hits, key=lambda hit: (hit.time, hit.first, hit.second))
