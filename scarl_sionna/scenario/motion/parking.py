"""Parking manoeuvres: clothoids and arcs within the steering limit between a lane and a place, also in reverse."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.interpolate import PPoly
from scipy.optimize import brentq

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.pose import Pose
from scarl_sionna.scene.lanes import Lane
from scarl_sionna.scene.motion.pieces import InPieces
from scarl_sionna.scene.motion.trajectory import Motion, WheelWay

from .bodies import STEERING, ActorBody
from .paths import PathTrajectory, SmoothPath
from .profiles import SpeedProfile
from .tilt import Springs

Array = npt.NDArray[np.float64]

STEERING_WAY = 3.0
"""Way over which the front wheels go from straight to that angle [m]: 2 s at 1.5 m/s."""
PARALLEL = np.radians(15.0)
"""A place whose axis differs from the lane's by less is parked in along the lane."""
ACCELERATION, JERK = 0.8, 1.5
"""Of a manoeuvre [m/s2, m/s3]; on the street 1.5 and 2."""
PAUSE = 1.0
"""Time that a vehicle stands before it changes its direction [s]."""
_STREET = (1.5, 2.0)
_STRAIGHT = 1.0
_STEP = 0.05
_STEEPEST = np.radians(75.0)
_BENT = 0.15
"""How far a lane may leave its tangent along a manoeuvre [m]."""


@dataclass(frozen=True, eq=False)
class JoinedTrajectory(InPieces[PathTrajectory]):
    """Motions of one body one after the other, each of which begins where the one before stands."""

    pieces: tuple[PathTrajectory, ...]

    @property
    def _body(self) -> str:
        return self.pieces[0].name

    def wheel_way(self, time: float, place: tuple[float, float]) -> WheelWay:
        """Return where a wheel points, and how far it has rolled since the start of the first piece."""
        index = self._index(time)
        now = self.pieces[index].wheel_way(time, place)
        before = sum(piece.wheel_way(piece.stop, place).rolled for piece in self.pieces[:index])
        return WheelWay(now.angle, now.rate, now.rolled + before, now.speed)

    def on_springs(self, springs: Springs) -> JoinedTrajectory:
        """Return the same motions of a body that pitches and rolls, each from the tilt with which the last ends."""
        pieces = [self.pieces[0].on_springs(springs)]
        for piece in self.pieces[1:]:
            pieces.append(piece.on_springs(springs, pieces[-1]))
        return JoinedTrajectory(tuple(pieces))

    def body_from_road(self, time: float) -> Motion | None:
        """Return how the frame on which the wheels stand moves in the body's; None for one without springs."""
        return self.pieces[self._index(time)].body_from_road(time)

    def road_height(self, time: float, x: float) -> tuple[float, float]:
        """Return the height of the present piece's path at x of the body over its origin [m], and its rate [m/s]."""
        return self.pieces[self._index(time)].road_height(time, x)


@dataclass(frozen=True)
class Manoeuvre:
    """What a vehicle does at a place: `way` in or out, `nose` out of the place or in it, along the lane if it is so.

    `speed` of the manoeuvre and `street_speed` before or after it [m/s]; `since`: when it begins, standing in the place
    or driving `approach` [m] before the place where it stops.
    """

    way: str
    nose: str
    speed: float
    street_speed: float
    since: float
    approach: float


def park(
    place: Pose, lane: Lane, what: Manoeuvre, body: ActorBody, span: tuple[float, float], name: str = "actor"
) -> PathTrajectory | JoinedTrajectory:
    """Return the motion of a vehicle that parks in a place beside a lane, or leaves it.

    Parameters
    ----------
    place : Pose
        World_from_place: middle on the ground; its axis is that of the parked body, in either direction.
    lane : Lane
        From which, or on which, it drives.
    what : Manoeuvre
    body : ActorBody
    span : (float, float)
        First and last time at which the motion shall be known [s].
    name : str
        For messages.

    Raises
    ------
    ParameterRangeError
        If the body has no axles, the place is too near to the lane for the steering limit, the lane bends beside it or
        is too short, or a way is too short for a speed.

    Notes
    -----
    The rear axle follows straight lines, clothoids whose curvature grows by tan(`STEERING`) / wheelbase within
    `STEERING_WAY`, and arcs of that curvature; front wheels steer as the kinematic bicycle's. Across a lane: one turn
    from the place's axis to the lane's. Along it: two turns of equal size, whose angle follows from the distance.
    """
    if body.wheelbase <= 0.0:
        raise ParameterRangeError(f"{name}.model", "a body without axles", "a vehicle")
    frame = _Frame.of(lane, place, what.nose, body)
    sharpest = body.sharpest
    across, phi = frame.across, frame.angle
    if frame.is_parallel:
        plan = _sideways(across, phi, sharpest, name)
    elif what.nose == "out":
        plan = _turned(across, phi, 0.0, sharpest, name)
    else:
        plan = _turned(across, phi + np.pi, np.pi, sharpest, name)
    line = frame.world(plan, float(place.position[2]))
    frame.check_straight(lane, plan, name)
    forwards_in = not frame.is_parallel and what.nose == "in"
    street = _Street(lane, frame.way + float(frame.along(line[-1])), body, name)
    if forwards_in:
        if what.way == "in":
            points = np.concatenate([street.before(what.approach), line[::-1][1:]])
            return _once(points, what, body, span, name)
        inside = _path(line[::-1], body)
        back = _back(inside, what, body, name, max(what.since, span[0]))
        return _then(back, street.after(), what, body, span, name)
    if what.way == "out":
        points = np.concatenate([line, street.after()[1:]])
        return _leave(points, float(len(line) - 1), what, body, span, name)
    return _reverse_in(street.before(what.approach), _path(line, body), what, body, span, name)


@dataclass(frozen=True, eq=False)
class _Frame:
    """Axes at the point of a lane nearest to a parked rear axle: x along the lane, y to its left."""

    origin: Array
    heading: float
    way: float
    across: float
    angle: float
    is_parallel: bool

    @classmethod
    def of(cls, lane: Lane, place: Pose, nose: str, body: ActorBody) -> _Frame:
        way, _ = lane.nearest(place.position)
        step = lane.at(min(way + 1.0, lane.length)) - lane.at(max(way - 1.0, 0.0))
        heading = float(np.arctan2(step[1], step[0]))
        side = np.array([-np.sin(heading), np.cos(heading)])
        axis = place.yaw - heading
        middle = float((place.position[:2] - lane.at(way)[:2]) @ side)
        is_parallel = bool(abs(np.sin(axis)) < np.sin(PARALLEL))
        if is_parallel:
            axis += np.pi if np.cos(axis) < 0.0 else 0.0
        elif (np.sin(axis) * middle > 0.0) == (nose == "out"):
            axis += np.pi
        axis = float((axis + np.pi) % (2.0 * np.pi) - np.pi)
        turn = heading + axis
        rear = place.position[:2] + body.rear_axle * np.array([np.cos(turn), np.sin(turn)])
        way, _ = lane.nearest(rear)
        origin = lane.at(way)
        return cls(origin, heading, way, float((rear - origin[:2]) @ side), axis, is_parallel)

    def world(self, plan: Array, height: float) -> Array:
        """Return points (N, 2) of these axes in the world (N, 3), from the place's height to the lane's."""
        cos, sin = np.cos(self.heading), np.sin(self.heading)
        share = np.clip(plan[:, 1] / self.across, 0.0, 1.0) if self.across else np.zeros(len(plan))
        x, y = (self.origin[:2] + plan @ np.array([[cos, sin], [-sin, cos]])).T
        return np.column_stack([x, y, self.origin[2] + share * (height - self.origin[2])])

    def check_straight(self, lane: Lane, plan: Array, name: str) -> None:
        """Raise if the lane leaves its tangent here along a manoeuvre (N, 2) [m]."""
        ways = np.linspace(self.way + plan[:, 0].min(), self.way + plan[:, 0].max(), 20)
        away = lane.at(np.clip(ways, 0.0, lane.length))[:, :2] - self.origin[:2]
        bent = float(np.abs(away @ [-np.sin(self.heading), np.cos(self.heading)]).max())
        if bent > _BENT:
            raise ParameterRangeError(
                f"{name}: bend of lane '{lane.name}' beside the place",
                f"{bent:.2g} m off its tangent",
                f"up to {_BENT} m",
            )

    def along(self, point: Array) -> float:
        """Return how far along the lane from the origin a point of the world is [m]."""
        return float((point[:2] - self.origin[:2]) @ [np.cos(self.heading), np.sin(self.heading)])


@dataclass(frozen=True, eq=False)
class _Street:
    """The lane round the end of a manoeuvre at a way [m]."""

    lane: Lane
    way: float
    body: ActorBody
    name: str

    def before(self, length: float) -> Array:
        """Return the centre line up to the end of the manoeuvre (N, 3) [m]."""
        first = self.way - length
        if first < -self.body.rear_axle:
            raise ParameterRangeError(
                f"{self.name}.approach",
                length,
                f"up to {max(self.way + self.body.rear_axle, 0.0):.3g} m on lane '{self.lane.name}'",
            )
        return self._line(first, self.way)

    def after(self) -> Array:
        """Return the centre line from the end of the manoeuvre to that of the lane (N, 3) [m]."""
        if self.way > self.lane.length - 2.0:
            raise ParameterRangeError(f"{self.name}.lane", self.lane.name, "a lane that goes on beside the place")
        return self._line(self.way, self.lane.length)

    def _line(self, first: float, last: float) -> Array:
        return self.lane.at(np.linspace(first, last, max(int((last - first) / 0.5), 2) + 1))


def _walked(pieces: Sequence[tuple[float, float, float]], heading: float) -> Array:
    """Return the points (N, 2) [m] of pieces (length, curvature at both ends) one after the other, from (0, 0)."""
    points, place = [np.zeros((1, 2))], np.zeros(2)
    for length, first, last in pieces:
        if length <= 1e-9:
            continue
        edges = np.linspace(0.0, length, max(int(np.ceil(length / _STEP)), 1) + 1)
        nodes = edges[:-1, None] + np.diff(edges)[:, None] * np.array([0.5 - np.sqrt(1 / 12), 0.5 + np.sqrt(1 / 12)])
        turn = heading + first * nodes + (last - first) * nodes**2 / (2.0 * length)
        steps = np.stack([np.cos(turn), np.sin(turn)], axis=-1).mean(1) * np.diff(edges)[:, None]
        points.append(place + np.cumsum(steps, axis=0))
        place = points[-1][-1]
        heading += 0.5 * (first + last) * length
    return np.concatenate(points)


def _turn(angle: float, sharpest: float) -> list[tuple[float, float, float]]:
    """Return a turn of an angle [rad]: clothoid, arc of the sharpest curvature where it is reached, clothoid."""
    side, size, rate = float(np.sign(angle)), abs(angle), sharpest / STEERING_WAY
    peak = min(sharpest, float(np.sqrt(size * rate)))
    ramp, arc = peak / rate, (size - peak**2 / rate) / peak if peak > 0.0 else 0.0
    return [(ramp, 0.0, side * peak), (max(arc, 0.0), side * peak, side * peak), (ramp, side * peak, 0.0)]


def _turned(across: float, heading: float, end: float, sharpest: float, name: str) -> Array:
    """Return the way out of a place across a lane: straight on, one turn, straight on the lane (N, 2) [m]."""
    angle = float((end - heading + np.pi) % (2.0 * np.pi) - np.pi)
    turn = _turn(angle, sharpest)
    rise = float(_walked(turn, heading)[-1, 1])
    straight = -(across + rise) / np.sin(heading)
    if straight < -1e-6:
        limit = f"{np.degrees(abs(angle)):.0f} deg with the wheels at {np.degrees(STEERING):.0f} deg"
        raise ParameterRangeError(
            f"{name}: distance of the parked rear axle from the lane's middle",
            f"{abs(across):.3g} m",
            f"{abs(rise):.3g} m or more: a turn of {limit}",
            "park with the nose " + ("out" if end else "in") + ", from another lane, or with a shorter vehicle",
        )
    return _walked([(straight, 0.0, 0.0), *turn, (_STRAIGHT, 0.0, 0.0)], heading) + [0.0, across]


def _sideways(across: float, heading: float, sharpest: float, name: str) -> Array:
    """Return the way out of a place along a lane: towards it and back by two turns, straight on the lane (N, 2) [m]."""
    side = -float(np.sign(across))

    def pieces(angle: float) -> list[tuple[float, float, float]]:
        return [*_turn(side * angle - heading, sharpest), *_turn(-side * angle, sharpest)]

    def rest(angle: float) -> float:
        return float(side * (across + _walked(pieces(angle), heading)[-1, 1]))

    low = max(1e-3, side * heading + 1e-3)
    if rest(low) > 0.0 or rest(_STEEPEST) < 0.0:
        raise ParameterRangeError(
            f"{name}: distance of the place from the lane's middle",
            f"{abs(across):.3g} m",
            "what two turns of up to 75 deg go over",
        )
    angle = float(brentq(rest, low, _STEEPEST, xtol=1e-6))
    return _walked([*pieces(angle), (_STRAIGHT, 0.0, 0.0)], heading) + [0.0, across]


def _path(points: Array, body: ActorBody) -> SmoothPath:
    return SmoothPath(points, 0.5, (body.length + 1.0, body.length + 1.0))


def _unhurried(way: float, speed: float, wait: float = 0.0) -> SpeedProfile:
    """Return from standing to standing over a way [m], slower where it is short; after a wait [s]."""
    while True:
        try:
            return SpeedProfile(0.0).hold(wait).reach(speed, ACCELERATION, JERK).stop_at(way, ACCELERATION, JERK)
        except ParameterRangeError:
            speed *= 0.85
            if speed < 0.05:
                raise


def _back(
    path: SmoothPath,
    what: Manoeuvre,
    body: ActorBody,
    name: str,
    since: float,
    stop: float | None = None,
) -> PathTrajectory:
    """Return the drive back over a whole path, from standing to standing; `stop`: known until then at least [s]."""
    profile = _unhurried(path.length, what.speed)
    lasts = profile.duration if stop is None else max(profile.duration, stop - since)
    way = profile.way(lasts, since)
    turned = -way.c
    turned[-1] += path.length
    way = PPoly(turned, way.x)
    return PathTrajectory(path, way, body, since, since + lasts, name)


def _once(points: Array, what: Manoeuvre, body: ActorBody, span: tuple[float, float], name: str) -> PathTrajectory:
    """Return the drive forwards from the street into a place: slow when the turn begins."""
    path = _path(points, body)
    slow = SpeedProfile(what.street_speed).reach(what.speed, *_STREET)
    if slow.final_way > what.approach:
        raise ParameterRangeError(f"{name}.approach", what.approach, f"{slow.final_way:.3g} m or more to slow down")
    held = SpeedProfile(what.street_speed).hold((what.approach - slow.final_way) / what.street_speed)
    profile = held.reach(what.speed, *_STREET).stop_at(path.length, ACCELERATION, JERK)
    lasts = max(profile.duration, span[1] - what.since)
    return PathTrajectory(path, profile.way(lasts, what.since), body, what.since, what.since + lasts, name)


def _leave(
    points: Array, num_manoeuvre: float, what: Manoeuvre, body: ActorBody, span: tuple[float, float], name: str
) -> PathTrajectory:
    """Return the drive forwards out of a place and on along the street."""
    path = _path(points, body)
    inside = float(np.linalg.norm(np.diff(points[: int(num_manoeuvre) + 1], axis=0), axis=1).sum())
    begin = min(span[0], what.since)
    profile = SpeedProfile(0.0).hold(what.since - begin).reach(what.speed, ACCELERATION, JERK)
    profile = profile.hold(max(inside - profile.final_way, 0.0) / what.speed).reach(what.street_speed, *_STREET)
    return _as_far(path, profile, begin, span[1], body, name)


def _as_far(
    path: SmoothPath, profile: SpeedProfile, begin: float, stop: float, body: ActorBody, name: str
) -> PathTrajectory:
    """Return the drive of a path until a time [s], or as far as the path goes."""
    way = profile.way(stop - begin, begin)
    last = stop
    if float(way(stop)) > path.length:
        last = min(float(root) for root in np.real(way.solve(path.length, extrapolate=False)) if np.isfinite(root))
    return PathTrajectory(path, way, body, begin, last, name)


def _reverse_in(
    before: Array, inside: SmoothPath, what: Manoeuvre, body: ActorBody, span: tuple[float, float], name: str
) -> JoinedTrajectory:
    """Return the drive past a place, and backwards into it."""
    path = _path(before, body)
    profile = SpeedProfile(what.street_speed).stop_at(path.length, *_STREET).hold(PAUSE)
    turning = what.since + profile.duration
    first = PathTrajectory(path, profile.way(profile.duration, what.since), body, what.since, turning, name)
    last = _back(inside, what, body, name, turning, max(span[1], turning))
    return JoinedTrajectory((first, last))


def _then(
    back: PathTrajectory, after: Array, what: Manoeuvre, body: ActorBody, span: tuple[float, float], name: str
) -> JoinedTrajectory:
    """Return standing, the drive backwards out of a place, and on along the street."""
    pieces = [back]
    if back.start > span[0]:
        still = PPoly(np.array([[back.path.length]]), np.array([span[0], back.start]))
        pieces.insert(0, PathTrajectory(back.path, still, body, span[0], back.start, name))
    profile = SpeedProfile(0.0).hold(PAUSE).reach(what.street_speed, *_STREET)
    stop = max(span[1], back.stop + 0.1)
    pieces.append(_as_far(_path(after, body), profile, back.stop, stop, body, name))
    return JoinedTrajectory(tuple(pieces))
