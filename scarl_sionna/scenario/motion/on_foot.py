"""People who go from point to point and turn back: they stop, turn on the spot and go on."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.scene.motion.pieces import InPieces

from .bodies import ActorBody
from .paths import PathTrajectory, quintic_step
from .profiles import SpeedProfile, smooth_way
from .routes import Ground, fresh_points, rising_times, timed_along, walked

Array = npt.NDArray[np.float64]

GAIT = (1.5, 4.0)
"""Acceleration [m/s2] and jerk [m/s3] with which a pedestrian sets off and stops."""
BACK = float(np.radians(100.0))
"""Change of the direction from which on people stop and turn on the spot."""
TURNING = float(np.radians(90.0))
"""Rate at which they turn there, on average [rad/s], 1.9 times that at the most: half a turn takes 2 s. An estimate.
Faster where stated times leave less: on each side of its point a turn takes at most half of the time of the step there,
a quarter where that step has a turn at both ends."""
_LEAST = 1e-3


@dataclass(frozen=True, eq=False)
class TurnOnSpot:
    """Somebody who stands from `start` to `stop` [s] and turns from one pose's heading by `change` [rad] to another's.

    The quintic of :func:`~scarl_sionna.scenario.motion.paths.quintic_step` over time; also for the fraction of a
    millimetre by which the ways before and after miss their common point.
    """

    before: Pose
    after: Pose
    change: float
    start: float
    stop: float

    def _share(self, time: float) -> float:
        return min(max((time - self.start) / (self.stop - self.start), 0.0), 1.0)

    def pose(self, time: float) -> Pose:
        """Return world_from_actor at a time [s]."""
        done, first = float(quintic_step(self._share(time))), self.before.position
        return Pose.from_heading(first + done * (self.after.position - first), self.before.yaw + done * self.change)

    def twist(self, time: float) -> Twist:
        """Return the velocity at a time [s]."""
        x = self._share(time)
        rate = 30.0 * (x * (1.0 - x)) ** 2 / (self.stop - self.start)
        return Twist(rate * (self.after.position - self.before.position), np.array([0.0, 0.0, rate * self.change]))

    def forward_speeds(self, times: Array) -> Array:
        """Return zeros [m/s] at times (N,) [s]."""
        return np.zeros(np.shape(times))


@dataclass(frozen=True, eq=False)
class Walk(InPieces[PathTrajectory | TurnOnSpot]):
    """Ways on foot with turns on the spot between them."""

    pieces: tuple[PathTrajectory | TurnOnSpot, ...]
    name: str = "actor"

    @property
    def _body(self) -> str:
        return self.name


def legs_of(points: Array, name: str) -> list[tuple[int, int]]:
    """Return first and last of the points (N, 3) of each way between two turns back by more than `BACK`.

    Points that repeat there, which are a stand, belong to none: a way ends at the first and the next begins at the
    last of them. Who only goes up or down keeps the direction of before.
    """
    kept = np.flatnonzero(fresh_points(points, name))
    steps = np.diff(points[kept, :2], axis=0)
    level = np.flatnonzero(np.linalg.norm(steps, axis=1) > _LEAST)
    if level.size == 0:
        return [(0, len(points) - 1)]
    steps = steps[level[np.maximum(np.searchsorted(level, np.arange(len(steps)), "right") - 1, 0)]]
    headings = np.arctan2(steps[:, 1], steps[:, 0])
    turned = np.abs((np.diff(headings) + np.pi) % (2.0 * np.pi) - np.pi)
    legs, first = [], 0
    for corner in np.flatnonzero(turned > BACK) + 1:
        legs.append((first, int(kept[corner])))
        first = int(kept[corner + 1]) - 1
    return [*legs, (first, len(points) - 1)]


def timed_walk(
    points: Array, times: npt.ArrayLike, body: ActorBody, name: str, ground: Ground | None = None
) -> PathTrajectory | Walk:
    """Return the motion of somebody who passes points (N, 3) [m] at times (N,) [s].

    Who turns back stops for it, half of the time before and half of it after the point's time, or while standing there;
    for each half at most half of the time of the step there, a quarter of a step with turns at both ends.

    Raises
    ------
    ParameterRangeError
        If shapes disagree, or times do not rise.
    """
    time = rising_times(times, len(points), name)
    legs = legs_of(points, name)
    if len(legs) == 1:
        path, ways = walked(points, body, name, ground)
        return timed_along(path, ways, time, body, name)
    shares = [0.25 if last == first + 1 and 0 < leg < len(legs) - 1 else 0.5 for leg, (first, last) in enumerate(legs)]
    spans = [[time[first], time[last]] for first, last in legs]
    for before, after in pairwise(range(len(legs))):
        arrival, departure = legs[before][1], legs[after][0]
        room = min(
            shares[before] * (time[arrival] - time[arrival - 1]),
            shares[after] * (time[departure + 1] - time[departure]),
        )
        lacks = max(np.pi / TURNING - (time[departure] - time[arrival]), 0.0)
        spans[before][1] -= min(0.5 * lacks, room)
        spans[after][0] += min(0.5 * lacks, room)
    pieces: list[PathTrajectory] = []
    for index, ((first, last), (begin, end)) in enumerate(zip(legs, spans, strict=True)):
        path, ways = walked(points[first : last + 1], body, name, ground)
        when, way = time[first : last + 1].copy(), ways
        when[0], when[-1] = begin, end
        if index > 0:  # from a stand, which is before the piece
            when, way = np.concatenate([[begin - 1.0], when]), np.concatenate([way[:1], way])
        if index < len(legs) - 1:
            when, way = np.concatenate([when, [end + 1.0]]), np.concatenate([way, way[-1:]])
        pieces.append(PathTrajectory(path, smooth_way(when, way), body, float(begin), float(end), name))
    return joined(pieces, name)


def paced_walk(
    points: Array, profile: SpeedProfile, start: float, stop: float, walker: tuple[ActorBody, str, Ground | None]
) -> PathTrajectory | Walk:
    """Return the motion of somebody who goes along points (N, 3) [m] and stays at the last one.

    Parameters
    ----------
    points : ndarray of float64, shape (N, 3)
        [m]
    profile : SpeedProfile
        Speed from `start` on; after a turn on the spot its last one again. Less from a stand where a way is too short
        for it, see `stopping`.
    start, stop : float
        Times at which the motion shall be known [s].
    walker : (ActorBody, str, callable or None)
        Body, name, and the ground below the way.

    Raises
    ------
    ParameterRangeError
        If the first way is too short to stop on it from the speed at `start`.
    """
    body, name, ground = walker
    legs, speed = legs_of(points, name), profile.final_speed
    pieces: list[PathTrajectory] = []
    for first, last in legs:
        path, ways = walked(points[first : last + 1], body, name, ground)
        total = float(ways[-1] - ways[0])
        if pieces:
            ahead = path.at(float(ways[0]), 1)
            heading = pieces[-1].pose(start).yaw
            start += abs(_turn(heading, float(np.arctan2(ahead[1], ahead[0])))) / TURNING
            profile = SpeedProfile(0.0).reach(speed, *GAIT)
        profile = stopping(profile, total)
        known = profile.duration if last < len(points) - 1 else max(stop - start, _LEAST)
        way = profile.way(known, start, float(ways[0]))
        pieces.append(PathTrajectory(path, way, body, start, start + known, name))
        start += known
    return joined(pieces, name)


def stopping(profile: SpeedProfile, way: float) -> SpeedProfile:
    """Return a profile that ends at rest after a way [m]; from a stand it gets only as fast as there is way for.

    Raises
    ------
    ParameterRangeError
        If it does not begin at rest, and the way is too short to stop on it.
    """
    if profile.initial == 0.0:
        wait = sum(duration for duration, jerk in profile.pieces[:1] if jerk == 0.0)
        profile = SpeedProfile(0.0).hold(wait).reach(_reachable(profile.final_speed, way), *GAIT)
    return profile.stop_at(way, *GAIT)


def joined(pieces: list[PathTrajectory], name: str) -> PathTrajectory | Walk:
    """Return one motion of several, with turns on the spot in the times between them."""
    if len(pieces) == 1:
        return pieces[0]
    found: list[PathTrajectory | TurnOnSpot] = [pieces[0]]
    for before, after in pairwise(pieces):
        first, second = before.pose(before.stop), after.pose(after.start)
        found += [TurnOnSpot(first, second, _turn(first.yaw, second.yaw), before.stop, after.start), after]
    return Walk(tuple(found), name)


def _turn(before: float, after: float) -> float:
    """Return the shorter turn from one heading to another [rad], to the left for half a turn."""
    change = (after - before + np.pi) % (2.0 * np.pi) - np.pi
    return float(np.pi if np.pi - abs(change) < 1e-6 else change)


def _reachable(speed: float, way: float) -> float:
    """Return the speed up to which somebody can set off, and stop again within a way [m]."""

    def fits(top: float) -> bool:
        return SpeedProfile(0.0).reach(top, *GAIT).reach(0.0, *GAIT).final_way <= way

    if fits(speed):
        return speed
    low, high = 0.0, speed
    for _ in range(50):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if fits(middle) else (low, middle)
    return low
