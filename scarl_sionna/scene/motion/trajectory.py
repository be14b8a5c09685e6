"""Trajectories: pose and velocity of an actor as functions of time; velocities are derivatives, never user input."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, Protocol

import numpy as np
import numpy.typing as npt
from scipy.interpolate import PPoly

from scarl_sionna.core.errors import InputTypeError, ParameterRangeError, TimeRangeError, UnknownNameError
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.prompt.describe import Described

from .splines import STILL, shaped_spline

_REST_SPEED = 1e-3
"""Below this speed [m/s] a heading cannot be read off the velocity."""


class Trajectory(Protocol):
    """Pose and velocity of a rigid body over time; `start` and `stop` bound the times that may be asked for [s].

    A trajectory may have a method ``forward_speeds(times)``, see the function of that name, where it can answer for
    many times at once, a method ``is_present(time)``, which is False while the body is not in the scene: it then has no
    box, a method ``wheel_way(time, place)``, see the function of that name, where it knows its bends also while it
    stands, a method ``road_height(time, x)``, see the function of that name, where it knows the road behind it, a
    method ``lane_offsets(times)``, see the function of that name, where it follows lanes, a method
    ``body_from_road(time)``, see the function of that name, where the body tilts over its wheels, an attribute
    ``known_until``, see the function of that name, and an attribute ``is_steady``, see the function of that name.
    """

    @property
    def start(self) -> float:
        """First time at which the motion is known [s]."""

    @property
    def stop(self) -> float:
        """Last time at which the motion is known [s]."""

    def pose(self, time: float) -> Pose:
        """Return world_from_actor at a time [s]."""

    def twist(self, time: float) -> Twist:
        """Return the velocity at a time [s]."""


def expect_trajectory(name: str, value: object) -> None:
    """Raise if a value is no trajectory.

    Parameters
    ----------
    name : str
        Of the argument, for the message.
    value : object

    Raises
    ------
    InputTypeError
        If it lacks `pose`, `twist`, `start` or `stop`.
    """
    missing = [part for part in ("pose", "twist", "start", "stop") if not hasattr(value, part)]
    if missing:
        wanted = f"a trajectory: it has no {', '.join(missing)}"
        raise InputTypeError(name, value, wanted, "pose(time) and twist(time) are asked for from start to stop [s]")


def is_present(trajectory: Trajectory, time: float) -> bool:
    """Return whether a body is in the scene at a time [s]; True for a trajectory that does not say."""
    says = getattr(trajectory, "is_present", None)
    return True if says is None else bool(says(time))


def known_until(trajectory: Trajectory) -> float:
    """Return the time [s] up to which a trajectory will not change: infinite for one that does not say."""
    return float(getattr(trajectory, "known_until", np.inf))


def is_steady(trajectory: Trajectory) -> bool:
    """Return whether speed along the heading and yaw rate are the same at all times; False where nobody says."""
    return bool(getattr(trajectory, "is_steady", False))


@dataclass(frozen=True)
class WheelWay:
    """Where a wheel that follows the way of its middle points, and how far it has rolled, with their derivatives.

    `angle` [rad] to the left of the body's x axis and `rate` [rad/s]; `rolled` [m] since the start and `speed` [m/s].
    """

    angle: float
    rate: float
    rolled: float
    speed: float


def wheel_way(trajectory: Trajectory, time: float, place: tuple[float, float]) -> WheelWay | None:
    """Return how a wheel at x, y of a body [m] goes at a time [s]; None for a trajectory that does not say."""
    says = getattr(trajectory, "wheel_way", None)
    return None if says is None else says(time, place)


def lane_offsets(trajectory: Trajectory, times: npt.ArrayLike) -> npt.NDArray[np.float64] | None:
    """Return how far an actor is to the left of the lanes that it follows [m] at times (N,) [s].

    Up to a constant; None for a trajectory that follows none, or does not say.
    """
    says = getattr(trajectory, "lane_offsets", None)
    return None if says is None else says(np.asarray(times, dtype=np.float64))


def road_height(trajectory: Trajectory, time: float, x: float) -> tuple[float, float] | None:
    """Return how high the road is at x of a body [m] along its path, over its origin [m], and the rate of that [m/s].

    None for a trajectory that does not say.
    """
    says = getattr(trajectory, "road_height", None)
    return None if says is None else says(time, x)


def body_from_road(trajectory: Trajectory, time: float) -> Motion | None:
    """Return how the frame in which an actor's wheels stand moves in that of its body, about the same origin.

    None for a trajectory whose body does not tilt over its wheels.
    """
    says = getattr(trajectory, "body_from_road", None)
    return None if says is None else says(time)


def road_pose(trajectory: Trajectory, time: float) -> Pose:
    """Return world_from_road at a time [s]: the pose of the body as its wheels stand, however that tilts over them."""
    tilt = body_from_road(trajectory, time)
    return trajectory.pose(time) if tilt is None else trajectory.pose(time).compose(tilt.pose)


def forward_speeds(trajectory: Trajectory, times: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """Return the speed of an actor's origin along its heading [m/s], negative when it reverses, at times (N,) [s]."""
    when = np.asarray(times, dtype=np.float64)
    if own := getattr(trajectory, "forward_speeds", None):  # those that can answer for many times at once
        return np.asarray(own(when))
    return np.array([trajectory.twist(time).linear @ trajectory.pose(time).rotation[:, 0] for time in when.tolist()])


@dataclass(frozen=True, eq=False, repr=False)
class Motion(Described):
    """Pose of a frame in its parent's, and its velocity relative to the parent, in the parent's axes."""

    pose: Pose = field(default_factory=Pose)
    twist: Twist = field(default_factory=Twist)

    @classmethod
    def about(cls, axis: npt.ArrayLike, angle: float, rate: float, center: npt.ArrayLike | None = None) -> Motion:
        """Return the turn about a unit axis (3,), of an angle [rad] and its rate [rad/s].

        Through a point (3,) [m] of the parent, `center`, or its origin.
        """
        unit = np.asarray(axis, dtype=np.float64)
        quaternion = np.concatenate([[np.cos(angle / 2.0)], np.sin(angle / 2.0) * unit])
        turn = Pose._made(np.zeros(3), quaternion)
        if center is None:
            return cls(turn, Twist._made(np.zeros(3), rate * unit))
        middle = np.asarray(center, dtype=np.float64)
        arm = turn.rotate(middle)
        return cls(Pose(middle - arm, quaternion), Twist(-rate * np.cross(unit, arm), rate * unit))

    def then(self, inner: Motion) -> Motion:
        """Return the motion, in this one's parent, of a frame that moves like `inner` in this one's frame."""
        lever = self.pose.rotate(inner.pose.position)
        linear = self.twist.velocity_at(lever) + self.pose.rotate(inner.twist.linear)
        angular = self.twist.angular + self.pose.rotate(inner.twist.angular)
        return Motion(self.pose.compose(inner.pose), Twist._made(linear, angular))


@dataclass(frozen=True, eq=False, repr=False)
class StaticTrajectory(Described):
    """A body that stays where it is; `start` and `stop` [s] bound the times that may be asked for."""

    world_from_actor: Pose
    start: float = -np.inf
    stop: float = np.inf
    is_steady: ClassVar[bool] = True

    def pose(self, time: float) -> Pose:
        """Return the constant pose at a time [s]."""
        return self.world_from_actor

    def twist(self, time: float) -> Twist:
        """Return zero velocity at a time [s]."""
        return _REST

    def forward_speeds(self, times: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """Return zeros [m/s] at times (N,) [s]."""
        return np.zeros(times.shape)


@dataclass(frozen=True, eq=False, repr=False)
class ConstantTwistTrajectory(Described):
    """A body with constant linear velocity of its origin and constant angular velocity; known at all times."""

    pose_at_zero: Pose
    velocity: Twist
    start: float = -np.inf
    stop: float = np.inf

    @property
    def is_steady(self) -> bool:
        """Whether speed along the heading and yaw rate stay: if it does not turn, or turns on the spot."""
        return not self.velocity.angular.any() or not (self.velocity.angular[:2].any() or self.velocity.linear.any())

    def pose(self, time: float) -> Pose:
        """Return the pose at a time [s]."""
        start, origin = self.pose_at_zero, self.pose_at_zero.position + self.velocity.linear * time
        rate = math.sqrt(self.velocity.angular @ self.velocity.angular)
        if rate == 0.0:
            return Pose(origin, start.quaternion)
        turn = Motion.about(self.velocity.angular / rate, rate * time, rate).pose
        return Pose(origin, turn.compose(start).quaternion)

    def twist(self, time: float) -> Twist:
        """Return the constant velocity at a time [s]."""
        return self.velocity


_REST = Twist()


class WaypointTrajectory:
    """Smooth curve through positions at times; the heading follows the velocity unless it is given.

    The cubic spline (C2) through the waypoints. Between equal ones the body stands, and where the spline would drive
    back or far ahead to swing into a stop or a sudden change of speed it is held back there
    (:func:`~scarl_sionna.scene.motion.splines.shaped_spline`): at these waypoints the velocity is continuous, the
    acceleration is not.

    Parameters
    ----------
    times : array_like of float, shape (N,)
        Strictly rising, N >= 2 [s].
    positions : array_like of float, shape (N, 3)
        Origin of the actor [m, world].
    yaw_deg : array_like of float, shape (N,), or None
        Heading at the waypoints [deg], as a curve of the same kind after unwrapping; None: along the velocity. Between
        equal waypoints it then turns from the direction in which the body came to that in which it leaves.
    name : str
        Whose motion it is, for error messages.

    Raises
    ------
    ParameterRangeError
        If times do not rise, or shapes do not fit or hold values that are not finite.
    """

    def __init__(
        self,
        times: npt.ArrayLike,
        positions: npt.ArrayLike,
        yaw_deg: npt.ArrayLike | None = None,
        name: str = "actor",
    ) -> None:
        self.name = name
        time_array = _numbers(times, f"{name}.trajectory.times")
        points = _numbers(positions, f"{name}.trajectory.positions")
        if time_array.ndim != 1 or time_array.size < 2 or not np.all(np.diff(time_array) > 0):
            raise ParameterRangeError(f"{name}.trajectory.times", times, "two or more strictly rising times [s]")
        if points.shape != (time_array.size, 3) or not np.isfinite(points).all():
            raise ParameterRangeError(
                f"{name}.trajectory.positions", f"shape {points.shape}", f"finite, shape ({time_array.size}, 3) [m]"
            )
        self.start, self.stop = float(time_array[0]), float(time_array[-1])
        self._position = _spline(time_array, points, name)
        self._points = points
        self._times = time_array
        self._stops = _stops(time_array, points, self._position)
        self._yaw = None
        if yaw_deg is not None:
            yaw = _numbers(yaw_deg, f"{name}.trajectory.yaw_deg")
            if yaw.shape != time_array.shape or not np.isfinite(yaw).all():
                raise ParameterRangeError(
                    f"{name}.trajectory.yaw_deg", yaw_deg, f"finite, shape ({time_array.size},) [deg]"
                )
            self._yaw = _spline(time_array, np.unwrap(np.radians(yaw)), name)

    def _check(self, time: float) -> None:
        if not self.start <= time <= self.stop:
            raise TimeRangeError(time, self.start, self.stop, f"'{self.name}'")

    def forward_speeds(self, times: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """Return the speed along the heading [m/s] at times (N,) [s]."""
        if times.size:
            self._check(float(times.min()))
            self._check(float(times.max()))
        velocity = self._position(times, 1)
        if self._yaw is not None:
            yaw = self._yaw(times)
            return np.asarray(velocity[:, 0] * np.cos(yaw) + velocity[:, 1] * np.sin(yaw))
        speed = np.hypot(velocity[:, 0], velocity[:, 1])
        for row in np.flatnonzero(speed < _REST_SPEED):
            heading = self._heading(float(times[row]))[0]
            speed[row] = velocity[row, 0] * np.cos(heading) + velocity[row, 1] * np.sin(heading)
        return np.asarray(speed)

    def _heading(self, time: float) -> tuple[float, float]:
        """Return heading [rad] and its rate [rad/s]."""
        if self._yaw is not None:
            return float(self._yaw(time)), float(self._yaw(time, 1))
        vx, vy, _ = self._position(time, 1)
        speed_squared = vx * vx + vy * vy
        if speed_squared < _REST_SPEED**2:
            return self._resting(time)
        ax, ay, _ = self._position(time, 2)
        return float(np.arctan2(vy, vx)), float((vx * ay - vy * ax) / speed_squared)

    def _resting(self, time: float) -> tuple[float, float]:
        """Return heading [rad] and its rate [rad/s] where the velocity does not tell."""
        stop = next((one for one in self._stops if one.near[0] <= time <= one.near[1]), None)
        if stop is not None:
            return stop.heading(time)
        dx, dy = self._chord(time)
        return float(np.arctan2(dy, dx)), 0.0

    def _chord(self, time: float) -> npt.NDArray[np.float64]:
        """Return a horizontal direction from the last waypoint before `time` to the next one that differs."""
        index = int(np.clip(np.searchsorted(self._times, time, side="right") - 1, 0, len(self._times) - 2))
        steps = np.diff(self._points[:, :2], axis=0)
        moving = np.flatnonzero(np.linalg.norm(steps, axis=1) > 1e-6)
        if moving.size == 0:
            return np.array([1.0, 0.0])
        return steps[moving[np.argmin(np.abs(moving - index))]]

    def pose(self, time: float) -> Pose:
        """Return world_from_actor at a time [s]; x points along the heading, z up."""
        self._check(time)
        return Pose.from_heading(self._position(time), self._heading(time)[0])

    def twist(self, time: float) -> Twist:
        """Return the velocity at a time [s]: derivatives of the curves."""
        self._check(time)
        return Twist(self._position(time, 1), np.array([0.0, 0.0, self._heading(time)[1]]))


def _numbers(values: npt.ArrayLike, name: str) -> npt.NDArray[np.float64]:
    try:
        return np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):  # a text, or lists of different lengths
        raise ParameterRangeError(name, f"{values!r:.60}", "numbers in lists of one length") from None


@dataclass(frozen=True)
class _Stop:
    """A stand between waypoints: its times [s], the headings before and after it [rad], the times nearest to it [s]."""

    span: tuple[float, float]
    turn: tuple[float, float]
    near: tuple[float, float]

    def heading(self, time: float) -> tuple[float, float]:
        """Return the heading [rad] and its rate [rad/s]: a smooth turn while the body stands."""
        duration = self.span[1] - self.span[0]
        share = min(max((time - self.span[0]) / duration, 0.0), 1.0)
        change = self.turn[1] - self.turn[0]
        turned = change * share * share * (3.0 - 2.0 * share)
        return self.turn[0] + turned, change * 6.0 * share * (1.0 - share) / duration


def _stops(times: npt.NDArray[np.float64], points: npt.NDArray[np.float64], curve: PPoly) -> list[_Stop]:
    """Return where a body stands between equal waypoints and does not do so from the first to the last of them."""
    still = np.linalg.norm(np.diff(points, axis=0), axis=1) < STILL
    edges = np.flatnonzero(np.diff(np.concatenate([[False], still, [False]]).astype(np.int8)))
    found = []
    for first, last in edges.reshape(-1, 2).tolist():
        sides = []
        if first > 0:  # from a stand on, and up to it, the velocity is along the acceleration
            sides.append((-curve.derivative(2)(np.nextafter(times[first], -np.inf)), points[first] - points[first - 1]))
        if last < len(times) - 1:
            sides.append((curve(times[last], 2), points[last + 1] - points[last]))
        ways = [along if np.hypot(*along[:2]) > _REST_SPEED else chord for along, chord in sides]
        headings = [float(np.arctan2(way[1], way[0])) for way in ways if np.hypot(*way[:2]) > STILL]
        if not headings:
            continue
        change = math.remainder(headings[-1] - headings[0], 2.0 * math.pi)
        low = times[first] if first == 0 else (times[first - 1] + times[first]) / 2.0
        high = times[last] if last == len(times) - 1 else (times[last] + times[last + 1]) / 2.0
        span = (float(times[first]), float(times[last]))
        found.append(_Stop(span, (headings[0], headings[0] + change), (float(low), float(high))))
    return found


def _spline(times: npt.NDArray[np.float64], values: npt.NDArray[np.float64], name: str) -> PPoly:
    """Return the curve through values, or raise where its derivatives are beyond all numbers."""
    if np.isfinite(times).all():
        with np.errstate(all="ignore"):
            try:
                spline = shaped_spline(times, values)
            except (ValueError, np.linalg.LinAlgError):
                spline = None
        if spline is not None and np.isfinite(spline.c).all():
            return spline
    raise ParameterRangeError(f"{name}.trajectory.times", f"{times[:4].tolist()} ...", "finite, apart [s]")


def _take(table: Mapping[str, Any], actor: str, kind: str, required: set[str], optional: set[str]) -> dict[str, Any]:
    """Return the values of a trajectory table, after a check of its keys."""
    keys = set(table) - {"kind"}
    if missing := required - keys:
        raise ParameterRangeError(f"{actor}.trajectory.{sorted(missing)[0]}", "missing", f"needed for kind '{kind}'")
    if unknown := keys - required - optional:
        raise UnknownNameError(f"key of {actor}.trajectory", sorted(unknown)[0], required | optional)
    return {key: table[key] for key in keys}


def trajectory_from_table(table: Mapping[str, Any], actor: str) -> Trajectory:
    """Return the trajectory that a table of a scene.toml describes.

    Kinds: ``waypoints`` (times, positions[, yaw_deg]), ``static`` (position[, yaw_deg]), ``constant_twist``
    (position, velocity[, yaw_deg, angular_velocity_z]).

    Raises
    ------
    UnknownNameError
        If there is no such kind.
    """
    kind = table.get("kind", "waypoints")
    if kind == "waypoints":
        values = _take(table, actor, kind, {"times", "positions"}, {"yaw_deg"})
        return WaypointTrajectory(values["times"], values["positions"], values.get("yaw_deg"), name=actor)
    if kind == "static":
        values = _take(table, actor, kind, {"position"}, {"yaw_deg"})
        return StaticTrajectory(_place(values, actor))
    if kind == "constant_twist":
        values = _take(table, actor, kind, {"position", "velocity"}, {"yaw_deg", "angular_velocity_z"})
        angular = np.array([0.0, 0.0, float(values.get("angular_velocity_z", 0.0))])
        return ConstantTwistTrajectory(_place(values, actor), Twist(values["velocity"], angular))
    raise UnknownNameError(f"trajectory kind of '{actor}'", str(kind), ("waypoints", "static", "constant_twist"))


def _place(values: Mapping[str, Any], actor: str) -> Pose:
    """Return the pose of a position [m] and a heading [deg]."""
    yaw = _numbers(values.get("yaw_deg", 0.0), f"{actor}.trajectory.yaw_deg")
    if yaw.ndim:
        raise ParameterRangeError(f"{actor}.trajectory.yaw_deg", values["yaw_deg"], "one number [deg]")
    return Pose.from_euler(values["position"], yaw=float(np.radians(yaw)))
