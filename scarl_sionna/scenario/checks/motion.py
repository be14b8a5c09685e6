"""Checks of planned motion against a world: who floats, sinks, leaves the scene, or moves as nothing can."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.engine.world import World, WorldState
from scarl_sionna.scenario.motion.bodies import ActorBody, BodyLike
from scarl_sionna.scenario.motion.paths import sample_motion
from scarl_sionna.scene.motion.trajectory import Trajectory, road_pose

Array = npt.NDArray[np.float64]
Planned = Sequence[tuple[str, Trajectory, BodyLike]]
"""Name, motion and body of each actor."""

WHEEL = 0.08
"""Height above the ground or depth below it that is let pass of one wheel [m].

Bodies stand level across: on a road banked by 10 % a wheel stands 7.5 cm off the ground that its axle's middle stands
on. On a plane banked by up to `STEEPEST_BANK` that is no fault of the place.
"""
STEEPEST_BANK = 0.15
"""Cross slope up to which ground is a banked road [m/m]: superelevation goes to 0.08, in mountains to 0.12."""
_PLANE = 0.015
"""How far the ground between two wheels may be off the line from one to the other where it is a plane [m]."""
_ABOVE, _BELOW = 1.0, 4.0
"""From how far above the origin to how far below it the ground is looked for [m]."""
_ASIDE = 1e4
"""How high actors are put out of the way of the rays [m]."""
_SEAM = np.array([3e-3, 2e-3, 0.0])
"""From a ray to the one beside it [m]: a ray on the edge of two triangles may pass between them."""
_GUST = 2e-3
"""Half of the time step by which a trajectory is compared with its own velocity [s]."""


@dataclass(frozen=True)
class GroundFault:
    """An actor that does not stand on the ground at a time [s]: `height` of its contact above it [m], negative below.

    The mean over its wheels, or, where that may be, of the wheel that is farthest from the ground. Infinite: no ground.
    """

    name: str
    time: float
    height: float


@dataclass(frozen=True)
class MotionFault:
    """A motion that is not possible.

    `what` (``speed``, ``acceleration`` or ``jump``), its `value` [m/s, m/s^2 or m], the `limit` and the time [s].
    """

    name: str
    time: float
    what: str
    value: float
    limit: float


def contacts(body: BodyLike) -> Array:
    """Return the points (C, 3) [m, actor's frame] with which a body stands: its wheels, or its middle."""
    whole = ActorBody.of(body)
    if whole.wheelbase <= 0.0:
        return np.zeros((1, 3))
    half = 0.4 * whole.width if whole.wheelbase > 1.6 and whole.motion != "cycle" else 0.0
    axles = (whole.rear_axle, whole.rear_axle + whole.wheelbase)
    return np.unique([[x, y, 0.0] for x in axles for y in (-half, half)], axis=0)


def ground_heights(world: World, points: npt.ArrayLike, time: float | None = None) -> Array:
    """Return the heights (N,) [m] of what stands still below points (N, 3) [m, world].

    Minus infinity where there is nothing.

    Parameters
    ----------
    world : World
    points : array_like of float, shape (N, 3)
        Ground is looked for from 1 m above to 4 m below each.
    time : float or None
        [s]; None: the world's first. The world's actors are out of the way.
    """
    origins = np.array(points, dtype=np.float64).reshape(-1, 3) + [0.0, 0.0, _ABOVE]
    start = world.time_range[0]
    moment = time if time is not None else float(start) if np.isfinite(start) else 0.0
    aside = {
        actor.name: Pose(np.array([0.0, 0.0, _ASIDE])) for actor in world.actors
    }  # a sole on the road would hide it
    state = WorldState(world, moment, aside, dict.fromkeys(aside, Twist()))
    heights = np.full(len(origins), -np.inf)
    hits = state.cast(origins, np.tile([0.0, 0.0, -1.0], (len(origins), 1)), _ABOVE + _BELOW)
    heights[hits.ray] = hits.point[:, 2]
    beside = state.cast(origins + _SEAM, np.tile([0.0, 0.0, -1.0], (len(origins), 1)), _ABOVE + _BELOW)
    heights[beside.ray] = np.maximum(heights[beside.ray], beside.point[:, 2])
    return heights


def check_ground(
    world: World, actors: Planned, times: npt.ArrayLike, tolerance: float = 0.05, wheel: float = WHEEL
) -> list[GroundFault]:
    """Return who floats or sinks, by rays from its wheels (or feet) down to what stands still.

    Parameters
    ----------
    world : World
        Its own actors do not count as ground.
    actors : sequence of (name, trajectory, body)
    times : array_like of float, shape (N,)
        [s]; an actor is looked at where its motion is known.
    tolerance : float
        Height above or depth below the ground that is allowed [m]: the mean over the wheels.
    wheel : float
        What is allowed for one wheel alone [m], so that none stands in a kerb. On a road that is banked by up to
        `STEEPEST_BANK`, on which bodies stand level, the mean over the two of an axle counts.

    Returns
    -------
    list of GroundFault
        One for each actor and time, in their order.
    """
    labels, spots = [], []
    for name, trajectory, body in actors:
        feet = contacts(body)
        for time in np.atleast_1d(np.asarray(times, dtype=np.float64)):
            if trajectory.start <= time <= trajectory.stop:
                labels.append((name, float(time), len(feet)))
                spots.append(road_pose(trajectory, float(time)).apply(feet))
    if not spots:
        return []
    points = np.concatenate(spots)
    away = points[:, 2] - ground_heights(world, points)
    faults, first = [], 0
    for name, time, count in labels:
        own = away[first : first + count]
        mean, worst = float(np.mean(own)), float(own[np.abs(own).argmax()])
        first += count
        if not abs(mean) <= tolerance:
            faults.append(GroundFault(name, time, mean))
        elif count > 1 and abs(worst) > wheel:
            worst = _without_bank(world, points[first - count : first], own)
            if abs(worst) > wheel:
                faults.append(GroundFault(name, time, worst))
    return faults


def _without_bank(world: World, feet: Array, away: Array) -> float:
    """Return the largest height [m] of wheels (C, 3), `away` (C,) over the ground, where banked axles count as one."""
    found = away.copy()
    for right in range(0, len(feet) - 1, 2):  # an axle's two stand next to each other, see `contacts`
        pair = feet[right : right + 2]
        across, tilt = float(np.linalg.norm(pair[1, :2] - pair[0, :2])), abs(float(pair[1, 2] - pair[0, 2]))
        if across == 0.0 or tilt > _PLANE:  # in line, or a body that does not stand level: that is its own fault
            continue
        share = np.linspace(0.0, 1.0, 9)
        ground = ground_heights(world, pair[0] + share[:, None] * (pair[1] - pair[0]))
        rise = ground[-1] - ground[0]
        if abs(rise) <= STEEPEST_BANK * across and np.abs(ground - ground[0] - share * rise).max() <= _PLANE:
            found[right : right + 2] = np.mean(away[right : right + 2])
    return float(found[np.abs(found).argmax()])


def scene_extent(world: World) -> tuple[Array, Array]:
    """Return the lowest and the highest corner (3,) [m] of all that stands still."""
    still = np.flatnonzero(world.parts.actor < 0)
    if not still.size:
        raise ParameterRangeError("world", world.name, "a scene with something that stands still")
    vertices = [world.mesh(int(part)).vertices for part in still]
    return np.min([points.min(0) for points in vertices], axis=0), np.max(
        [points.max(0) for points in vertices], axis=0
    )


def check_extent(
    world: World, actors: Sequence[tuple[str, Trajectory, object]], times: npt.ArrayLike, margin: float = 0.0
) -> list[tuple[str, float]]:
    """Return name and first time [s] of each actor whose origin leaves the scene in plan by more than a margin [m].

    The scene is the box round all that stands still. Traffic goes on beyond it; look at `PlannedActor.active` there.
    """
    low, high = scene_extent(world)
    found = []
    for name, trajectory, *_ in actors:
        instants = np.atleast_1d(np.asarray(times, dtype=np.float64))
        instants = instants[(instants >= trajectory.start) & (instants <= trajectory.stop)]
        if not instants.size:
            continue
        plan = sample_motion(trajectory, instants).position[:, :2]
        outside = np.any((plan < low[:2] - margin) | (plan > high[:2] + margin), axis=1)
        if outside.any():
            found.append((name, float(instants[outside.argmax()])))
    return found


def check_motion(
    actors: Sequence[tuple[str, Trajectory, object]],
    times: npt.ArrayLike,
    max_speed: float = 70.0,
    max_acceleration: float = 12.0,
    max_jump: float = 1e-3,
) -> list[MotionFault]:
    """Return what in motions is beyond what can be: too fast, too hard, or a jump.

    Parameters
    ----------
    actors : sequence of (name, trajectory, ...)
    times : array_like of float, shape (N,)
        Rising; accelerations are differences of the velocity from one to the next [s].
    max_speed, max_acceleration : float
        [m/s], [m/s^2]; 12 m/s^2 is more than any tyre gives.
    max_jump : float
        Difference [m] between two positions 4 ms apart and the way by the velocities there.

    Returns
    -------
    list of MotionFault
        The worst of each kind for each actor.
    """
    faults = []
    for name, trajectory, *_ in actors:
        instants = np.atleast_1d(np.asarray(times, dtype=np.float64))
        instants = instants[(instants >= trajectory.start + _GUST) & (instants <= trajectory.stop - _GUST)]
        if not instants.size:
            continue
        before, middle, after = (sample_motion(trajectory, instants + shift) for shift in (-_GUST, 0.0, _GUST))
        speed = np.linalg.norm(middle.velocity, axis=1)
        way = _GUST / 3.0 * (before.velocity + 4.0 * middle.velocity + after.velocity)  # Simpson's rule
        jump = np.linalg.norm(after.position - before.position - way, axis=1)
        rows = [("speed", speed, max_speed), ("jump", jump, max_jump)]
        if len(instants) > 1:
            rows.append(
                (
                    "acceleration",
                    np.linalg.norm(np.diff(middle.velocity, axis=0), axis=1) / np.diff(instants),
                    max_acceleration,
                )
            )
        for what, values, limit in rows:
            worst = int(values.argmax())
            if values[worst] > limit:
                faults.append(MotionFault(name, float(instants[worst]), what, float(values[worst]), limit))
    return faults
