"""From recorded positions to smooth motion.

Lane changes that jump are drawn out, steps become a C2 way along a C2 path.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.interpolate import PPoly

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.pose import Pose
from scarl_sionna.scene.motion.trajectory import StaticTrajectory, Trajectory

from .bodies import ActorBody
from .paths import PathTrajectory, SmoothPath, quintic_step
from .profiles import smooth_way, way_from_states
from .routes import smoothing_of

Array = npt.NDArray[np.float64]

KNOT_TIME = 0.5
"""Least time between the knots of the way [s]: shorter steps of a simulator hold its random acceleration and its
rounding."""
CHANGE_TIME, CHANGE_LENGTH = 3.0, 12.0
"""Time that a lane change takes [s], and the shortest way [m] that it is drawn out over."""
CRUISE = 13.9
"""Speed of vehicles before they enter and after they leave a record [m/s]: one for all, so that they stay apart."""
_JUMP = 0.8
"""Sideways step between two samples that no vehicle makes [m]."""
_FAST, _FAST_SMOOTHING = 12.0, 0.75
"""Above this speed [m/s] the knots of a path are further apart, by this time [s]: a lane change at 30 m/s begins within
some 14 m."""
_PART_OF_BEND = 0.3
"""Largest distance of the knots as a part of the radius of a known bend."""
_SPARE = 15.0
"""How much further than planned the path of a prolonged record reaches [m]: for what it brakes or gains at its ends."""
FASTEST, FARTHEST_STEP = 90.0, 5.0
"""Speed between two samples above which a record was carried elsewhere [m/s], and a step [m] that is never a jump."""


@dataclass(frozen=True, eq=False)
class Record:
    """Samples of one body.

    Attributes
    ----------
    name : str
    times : ndarray of float64, shape (N,)
        Strictly rising [s].
    points : ndarray of float64, shape (N, 3)
        Of the reference point on the ground [m, world].
    headings : ndarray of float64, shape (N,)
        [rad]
    ahead : float
        How far the reference point lies in front of the origin of the body [m]: half the length for SUMO's vehicles.
    backwards : bool
        Whether it moves against its headings all the time.
    turns : bool
        Whether its way along its headings may go back, along the path on which it came; else what goes back is noise.
    """

    name: str
    times: Array
    points: Array
    headings: Array
    ahead: float = 0.0
    backwards: bool = False
    turns: bool = False


@dataclass(frozen=True, eq=False)
class Smoothed:
    """Smooth motion of a record; `deviation` [m] and `num_lane_changes` as in :class:`PlannedActor`."""

    trajectory: Trajectory
    deviation: float
    num_lane_changes: int


def smooth_record(
    record: Record,
    body: ActorBody,
    span: tuple[float, float] | None = None,
    knot_time: float = KNOT_TIME,
    sharpest: float = 0.0,
) -> Smoothed:
    """Return a smooth motion for recorded samples.

    Parameters
    ----------
    record : Record
    body : ActorBody
        Its rear axle follows the path of the record's reference point.
    span : (float, float) or None
        Times [s] at which the motion shall be known at least; outside those of the record, the body goes straight on
        with the speed that it has; vehicles come to the same speed within 4 s. Within the record the way is the same as
        without. None: the times of the record.
    knot_time : float
        Least time between the knots of the way [s].
    sharpest : float
        Largest curvature of the path [1/m], where it is known: knots are never so far apart that it is lost.

    Returns
    -------
    Smoothed
        `deviation` compares the path with the reference points and the way with the record's, within the record.

    Raises
    ------
    ParameterRangeError
        If shapes disagree, values are not finite, times do not rise, or the record jumps along its way (a teleport).

    Notes
    -----
    A sideways step of more than 0.8 m between two samples is a lane change: it is replaced by the quintic step over the
    way driven in 3 s (at least 12 m) round it. The way is a monotone C2 curve (:func:`smooth_way`) through samples at
    least `knot_time` apart.
    """
    if record.backwards:
        return _backwards(record, body, span, knot_time, sharpest)
    times, points = np.asarray(record.times, dtype=np.float64), np.asarray(record.points, dtype=np.float64)
    headings = np.unwrap(np.asarray(record.headings, dtype=np.float64))
    if times.ndim != 1 or not times.size or points.shape != (times.size, 3) or headings.shape != times.shape:
        raise ParameterRangeError(
            f"samples of '{record.name}'", f"shapes {times.shape}, {points.shape}", "(N,), (N, 3) and (N,)"
        )
    if not (np.isfinite(times).all() and np.isfinite(points).all() and np.isfinite(headings).all()):
        raise ParameterRangeError(f"samples of '{record.name}'", "not finite", "finite numbers")
    if np.any(np.diff(times) <= 0.0):
        index = int(np.flatnonzero(np.diff(times) <= 0.0)[0])
        raise ParameterRangeError(f"times of '{record.name}'", times[index : index + 2].tolist(), "strictly rising [s]")
    low, high = (min(times[0], span[0]), max(times[-1], span[1])) if span else (times[0], times[-1])
    way, sideways = _way_and_jumps(record, times, points, headings, body.wheelbase > 0.0)
    if np.ptp(way) < 0.25:
        return _standing(record, points, headings, (low, high) if high > low else (-np.inf, np.inf))
    shift, num_changes = _drawn_out(times, way, headings, sideways)
    points = points + shift
    cruise = CRUISE if body.length > 2.5 and not record.turns else None
    ends = _end_speed(times, way, 0), _end_speed(times, way, -1)
    own_times = times
    times, way, points = _continued(times, way, points, headings, (low, high), cruise)

    order = np.argsort(way, kind="stable") if record.turns else np.arange(len(way))
    kept = order[_apart(way[order], 0.3)]
    fastest = float(np.max(np.abs(np.diff(way) / np.diff(times))))
    smoothing = (
        max(smoothing_of(body), _FAST_SMOOTHING * (fastest - _FAST)) if body.wheelbase > 0.0 else smoothing_of(body)
    )
    if sharpest > 0.0:
        smoothing = max(min(smoothing, _PART_OF_BEND / sharpest), smoothing_of(body))
    spare = 3.0
    if len(times) > len(own_times):  # the speed of an end may last for a second more or less than planned
        spare += _SPARE + (0.0 if cruise is None else max(abs(speed - cruise) for speed in ends))
    path = SmoothPath(points[kept], smoothing, (2.0 * body.length + spare, body.length + spare))
    chord = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points[kept], axis=0), axis=1))])
    ways = path.way_of(np.interp(way, way[kept], chord))
    rear = ways - record.ahead + body.rear_axle
    own = np.isin(times, own_times)
    knots = _apart(own_times, knot_time)
    curve = smooth_way(own_times[knots], rear[own][knots], record.turns)
    if len(times) > len(own_times):
        curve = _prolonged(curve, (low, high), ends if cruise is None else (cruise, cruise))
    trajectory = PathTrajectory(path, curve, body, name=record.name)
    off_path = np.linalg.norm(path.at(ways[own]) - points[own], axis=1)
    return Smoothed(trajectory, float(np.hypot(off_path, np.abs(curve(own_times) - rear[own])).max()), num_changes)


def _backwards(
    record: Record, body: ActorBody, span: tuple[float, float] | None, knot_time: float, sharpest: float
) -> Smoothed:
    """Return the motion of a body that reverses: that of one that drives on while time runs back."""
    times, points, headings = (np.asarray(one)[::-1] for one in (record.times, record.points, record.headings))
    mirrored = replace(record, times=-times, points=points, headings=headings, backwards=False)
    found = smooth_record(mirrored, body, None if span is None else (-span[1], -span[0]), knot_time, sharpest)
    motion = found.trajectory
    if not isinstance(motion, PathTrajectory):
        return replace(found, trajectory=StaticTrajectory(motion.pose(motion.start), -motion.stop, -motion.start))
    way = motion.way
    pieces = [np.poly1d(own)(np.poly1d([-1.0, length])).c for own, length in zip(way.c.T, np.diff(way.x), strict=True)]
    rows = np.array([np.pad(one, (len(way.c) - len(one), 0)) for one in pieces])[::-1]
    return replace(found, trajectory=PathTrajectory(motion.path, PPoly(rows.T, -way.x[::-1]), body, name=record.name))


def _way_and_jumps(
    record: Record, times: Array, points: Array, headings: Array, on_wheels: bool
) -> tuple[Array, Array]:
    """Return the way along the headings (N,) and the sideways steps (N - 1,) that are jumps [m]."""
    steps = np.diff(points, axis=0)
    heading = (headings[:-1] + headings[1:]) / 2.0
    forward = np.stack([np.cos(heading), np.sin(heading)], axis=1)
    sideways = -steps[:, 0] * forward[:, 1] + steps[:, 1] * forward[:, 0]
    jumps = np.where(on_wheels & (np.abs(sideways) > _JUMP), sideways, 0.0)
    along = np.sqrt(np.maximum(np.square(steps).sum(1) - np.square(jumps), 0.0))
    far = np.maximum(FASTEST * np.diff(times), FARTHEST_STEP)
    if np.any((along > far) | (np.abs(jumps) > 8.0)):
        index = int(np.flatnonzero((along > far) | (np.abs(jumps) > 8.0))[0])
        raise ParameterRangeError(
            f"step of '{record.name}'",
            f"{np.linalg.norm(steps[index]):.4g} m from {times[index]:g} to {times[index + 1]:g} s",
            f"at most {FASTEST:g} m/s and a lane to the side",
            "it was carried elsewhere; in SUMO set time-to-teleport to -1",
        )
    along[along < 2e-3 * np.diff(times)] = 0.0
    if record.turns:
        along = np.copysign(along, (steps[:, :2] * forward).sum(1))
    return np.concatenate([[0.0], np.cumsum(along)]), jumps


def _drawn_out(times: Array, way: Array, headings: Array, sideways: Array) -> tuple[Array, int]:
    """Return what is added to the points (N, 3) so that lane changes take their time, and the number of these."""
    shift = np.zeros((len(times), 3))
    where = np.flatnonzero(sideways)
    for index in where:
        speed = (way[index + 1] - way[index]) / (times[index + 1] - times[index])
        length = max(CHANGE_LENGTH, CHANGE_TIME * speed)
        middle = (way[index] + way[index + 1]) / 2.0
        length = min(length, max(2.0 * min(middle - way[0], way[-1] - middle), 3.0))
        share = quintic_step((way - middle) / length + 0.5) - (np.arange(len(way)) > index)
        heading = (headings[index] + headings[index + 1]) / 2.0
        shift[:, :2] += share[:, None] * sideways[index] * np.array([-np.sin(heading), np.cos(heading)])
    return shift, len(where)


def _continued(
    times: Array, way: Array, points: Array, headings: Array, span: tuple[float, float], cruise: float | None
) -> tuple[Array, Array, Array]:
    """Return the samples with straight ones before and after, up to a span [s].

    At the speed of the ends, or from there to a cruising speed [m/s].
    """
    for index, stop, sign in ((0, span[0], -1.0), (-1, span[1], 1.0)):
        lack = sign * (stop - times[index])
        if lack < 1e-9:
            continue
        speed = _end_speed(times, way, index)
        away = np.linspace(0.0, lack, max(int(np.ceil(lack / KNOT_TIME)), 1) + 1)[1:]
        gone = _to_speed(away, speed, 0.0, speed if cruise is None else cruise)[0]
        direction = np.array([np.cos(headings[index]), np.sin(headings[index]), 0.0])
        extra = (times[index] + sign * away, way[index] + sign * gone, points[index] + sign * gone[:, None] * direction)
        merged = []
        for own, new in zip((times, way, points), extra, strict=True):
            merged.append(np.concatenate([new[::-1], own] if index == 0 else [own, new]))
        times, way, points = merged
    return times, way, points


def _end_speed(times: Array, way: Array, index: int) -> float:
    """Return the mean speed over the second beside an end of a record (0 or -1) [m/s]."""
    near = np.abs(times - times[index]) <= 1.0
    return float((way[near][-1] - way[near][0]) / np.ptp(times[near])) if near.sum() > 1 else 0.0


def _to_speed(later: Array, speed: float, pull: float, wanted: float) -> tuple[Array, Array, Array]:
    """Return way [m], speed [m/s] and acceleration [m/s^2] at times (N,) [s] after a body has one and the other.

    By definition: within a second the acceleration goes linearly to 0, sooner where the body would come to stand by
    that, then within `CHANGE_TIME` the speed to the wanted one, without a step of acceleration. Polynomials of the
    fifth degree or less between these times.
    """
    ease = _ease(speed, pull)
    first, after = np.minimum(later, ease), np.maximum(later - ease, 0.0)
    left = first / max(ease, 1e-12)
    mid, x = speed + 0.5 * pull * ease, np.minimum(after / CHANGE_TIME, 1.0)
    change = wanted - mid
    gone = speed * first + pull * first**2 * (0.5 - left / 6.0) + mid * after
    gone += change * (CHANGE_TIME * (x**3 - 0.5 * x**4) + np.maximum(after - CHANGE_TIME, 0.0))
    rate = speed + pull * first * (1.0 - 0.5 * left) + change * x**2 * (3.0 - 2.0 * x)
    bend = np.where(later < ease, pull * (1.0 - left), change * 6.0 * x * (1.0 - x) / CHANGE_TIME)
    return gone, rate, bend


def _ease(speed: float, pull: float) -> float:
    """Return the time in which an acceleration goes to 0 [s]."""
    if abs(pull) < 1e-9:
        return 0.0
    return 1.0 if speed * pull >= 0.0 else min(1.0, abs(speed / pull))


def _prolonged(curve: PPoly, span: tuple[float, float], wanted: tuple[float, float]) -> PPoly:
    """Return a way up to a span [s], as it is within its own times, to wanted speeds [m/s] before and after it."""
    states = [curve.x, *(curve(curve.x, order) for order in range(3))]
    for index, stop, sign, target in ((0, span[0], -1.0, wanted[0]), (-1, span[1], 1.0, wanted[1])):
        end, place, speed, pull = (float(one[index]) for one in states)
        lack = sign * (stop - end)
        if lack < 1e-9:
            continue
        ease = _ease(speed, sign * pull)
        later = np.unique([*(one for one in (ease, ease + CHANGE_TIME) if 1e-6 < one < lack - 1e-6), lack])
        gone, rate, bend = _to_speed(later, speed, sign * pull, target)
        extra = (end + sign * later, place + sign * gone, rate, sign * bend)
        states = [
            np.concatenate([new[::-1], own] if index == 0 else [own, new])
            for own, new in zip(states, extra, strict=True)
        ]
    return way_from_states(*states)


def _apart(values: Array, least: float) -> npt.NDArray[np.int64]:
    """Return indices of rising values that are at least some distance apart, the first and last one among them."""
    kept = [0]
    for index in range(1, len(values)):
        if values[index] - values[kept[-1]] >= least - 1e-9:
            kept.append(index)
    if kept[-1] != len(values) - 1:
        if len(kept) > 1:
            kept[-1] = len(values) - 1
        else:
            kept.append(len(values) - 1)
    return np.array(kept)


def _standing(record: Record, points: Array, headings: Array, span: tuple[float, float]) -> Smoothed:
    """Return the motion of a body that does not move."""
    direction = np.array([np.cos(headings[0]), np.sin(headings[0]), 0.0])
    pose = Pose.from_heading(points.mean(0) - record.ahead * direction, float(headings[0]))
    return Smoothed(StaticTrajectory(pose, *span), float(np.linalg.norm(points - points.mean(0), axis=1).max()), 0)
