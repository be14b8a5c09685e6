"""A trailer that an actor tows: it turns about its coupling by the way that the actor drives, and its wheels roll."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ParameterRangeError, UnknownNameError
from scarl_sionna.core.pose import Pose

from .panels import PANEL, origin_of, panels_to
from .trajectory import Motion, Trajectory, is_steady, known_until, road_height, wheel_way

STEPS = 8
"""Steps of the Runge-Kutta rule in a panel: at 30 m/s and 6 m from coupling to axle the angle is within 1e-7 rad."""
FOLDED = math.radians(80.0)
"""Angle to the towing vehicle beyond which the bodies touch each other."""
_REST = 1e-3
_Z, _Y = np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0, 0.0])


@dataclass(frozen=True)
class Towed:
    """Where a trailer is relative to the vehicle that tows it, with the derivatives by time.

    `angle` [rad] to the left of straight behind and `rate` [rad/s]; `pitch` [rad], nose up, and `pitching` [rad/s];
    `way` [m] along its own heading since the start and `speed` [m/s]; its heading has `turned` [rad] with `turning`.
    """

    angle: float
    rate: float
    pitch: float
    pitching: float
    way: float
    speed: float
    turned: float
    turning: float


class Towing:
    r"""Kinematics of a trailer whose axle does not slip sideways, shared by its joint and its wheels.

    Parameters
    ----------
    trajectory : Trajectory
        Of the towing vehicle.
    hitch : array_like of float, shape (3,)
        Middle of the coupling in the vehicle's frame [m].
    length : float
        From the coupling to the (middle of the) axles, level [m].
    name : str
        For messages.

    Notes
    -----
    With the velocity (u, w) of the coupling in the axes of the vehicle, whose yaw rate is :math:`\omega`, the angle
    :math:`\gamma` of the trailer obeys

    .. math:: \dot\gamma = (w \cos\gamma - u \sin\gamma) / L - \omega

    [1]_. It begins as in a steady bend like the first. The trailer's axle stands at the height that the road has where
    the vehicle drove `length` behind the coupling, on a trajectory that knows its road (`road_height`); else in the
    vehicle's plane. *Not modelled*: slip, so that of three axles the outer ones scrub; roll; a coupling with play.

    References
    ----------
    .. [1] R. M. Murray, S. S. Sastry, "Nonholonomic motion planning: steering using sinusoids", IEEE Trans. Automatic
       Control 38(5), 1993: the car with trailers.
    """

    def __init__(self, trajectory: Trajectory, hitch: npt.ArrayLike, length: float, name: str = "trailer") -> None:
        self.trajectory, self.length, self.name = trajectory, length, name
        self.hitch = np.asarray(hitch, dtype=np.float64)
        self._origin = origin_of(trajectory)
        self._known: dict[int, tuple[float, float, float]] = {}
        self._last: tuple[float, Towed] | None = None

    def on(self, trajectory: Trajectory) -> Towing:
        """Return the same trailer behind a vehicle that moves along another trajectory."""
        return Towing(trajectory, self.hitch, self.length, self.name)

    def _pull(self, time: float) -> tuple[float, float, float]:
        """Return the coupling's velocity along x and y of the vehicle [m/s] and the yaw rate [rad/s]."""
        turn, twist = self.trajectory.pose(time).rotation, self.trajectory.twist(time)
        u, w = (turn.T @ twist.velocity_at(turn @ self.hitch))[:2].tolist()
        return u, w, float(turn[:, 2] @ twist.angular)

    def _slope(self, angle: float, pull: tuple[float, float, float]) -> npt.NDArray[np.float64]:
        """Return the rates of angle, way and turn."""
        u, w, yaw_rate = pull
        cos, sin = math.cos(angle), math.sin(angle)
        turning = (w * cos - u * sin) / self.length
        return np.array([turning - yaw_rate, u * cos + w * sin, turning])

    def steady(self, time: float) -> float:
        """Return the angle [rad] that a bend as at a time [s] leads to, driven for ever."""
        u, w, yaw_rate = self._pull(time)
        places = ((float(self.hitch[0]) + ahead, float(self.hitch[1])) for ahead in (0.0, 1.0))
        here, ahead = (wheel_way(self.trajectory, time, place) for place in places)
        if here is not None and ahead is not None:  # known also while it stands
            u, w = 1.0, math.tan(here.angle)
            yaw_rate = math.tan(ahead.angle) - w
        pace = math.copysign(math.hypot(u, w), u)
        if abs(pace) < _REST:
            return 0.0
        return math.atan2(w / pace, u / pace) - math.asin(min(max(yaw_rate * self.length / pace, -0.9), 0.9))

    def _step(self, state: npt.NDArray[np.float64], time: float, span: float) -> npt.NDArray[np.float64]:
        """Return the state after a span of time [s], by the classical Runge-Kutta rule."""
        count = max(math.ceil(STEPS * span / PANEL - 1e-9), 1)
        step = span / count
        pulls = [self._pull(time + 0.5 * number * step) for number in range(2 * count + 1)]
        for start, middle, stop in zip(pulls[:-2:2], pulls[1::2], pulls[2::2], strict=True):
            first = self._slope(state[0], start)
            second = self._slope(state[0] + 0.5 * step * first[0], middle)
            third = self._slope(state[0] + 0.5 * step * second[0], middle)
            fourth = self._slope(state[0] + step * third[0], stop)
            state = state + step / 6.0 * (first + 2.0 * second + 2.0 * third + fourth)
        return state

    def _state(self, time: float) -> npt.NDArray[np.float64]:
        """Return angle [rad], way [m] and turn [rad] at a time [s]."""
        if time < self._origin or is_steady(self.trajectory):  # a motion without a beginning: what it has always been
            u, w, yaw_rate = self._pull(time)  # doing
            angle, before = self.steady(time), time - self._origin
            return np.array([angle, before * (u * math.cos(angle) + w * math.sin(angle)), before * yaw_rate])
        if not self._known:
            self._known[0] = (self.steady(self._origin), 0.0, 0.0)
        panel, known, _ = panels_to(time, self._origin, self._known)
        final, state = known_until(self.trajectory), np.array(self._known[known])
        for index in range(known, panel):
            start = self._origin + index * PANEL
            state = self._step(state, start, PANEL)
            if start + PANEL <= final:
                self._known[index + 1] = (float(state[0]), float(state[1]), float(state[2]))
        start = self._origin + panel * PANEL
        return self._step(state, start, time - start) if time > start else state

    def angle(self, time: float) -> float:
        """Return the angle to the towing vehicle [rad] at a time [s], however far it is folded."""
        return float(self._state(time)[0])

    def at(self, time: float) -> Towed:
        """Return where the trailer is at a time [s].

        Raises
        ------
        ParameterRangeError
            If it folds against the vehicle: it was backed round a bend, or the bend is tighter than it can follow.
        """
        if self._last is not None and self._last[0] == time:
            return self._last[1]
        state = self._state(time)
        angle, way, turned = (float(value) for value in state)
        if not abs(angle) < FOLDED:
            raise ParameterRangeError(
                f"angle of {self.name} at {time:.4g} s",
                f"{math.degrees(angle):.0f} deg",
                f"up to {math.degrees(FOLDED):.0f} deg to the vehicle that tows it",
                "drive wider bends, and back straight",
            )
        rate, speed, turning = (float(value) for value in self._slope(angle, self._pull(time)))
        pitch, pitching = self._pitch(time, angle, rate)
        found = Towed(angle, rate, pitch, pitching, way, speed, turned, turning)
        if time <= known_until(self.trajectory):
            self._last = time, found
        return found

    def _pitch(self, time: float, angle: float, rate: float) -> tuple[float, float]:
        """Return the pitch that sets the axle onto the road, and its rate.

        The third row r of the vehicle's rotation gives heights: with g = r . (cos, sin, 0), a trailer pitched by p has
        its axle a cos p + b sin p above the coupling, a = -g L - r_z h, b = g h - r_z L, h the coupling's height.
        """
        road = road_height(self.trajectory, time, float(self.hitch[0]) - self.length)
        if road is None:
            return 0.0, 0.0
        turn, spin = self.trajectory.pose(time).rotation, self.trajectory.twist(time).angular
        row, moving = turn[2], np.cross(spin, turn.T)[:, 2]
        cos, sin, height, length = math.cos(angle), math.sin(angle), float(self.hitch[2]), self.length
        lean = float(row[0] * cos + row[1] * sin)
        leaning = float(moving[0] * cos + moving[1] * sin + rate * (row[1] * cos - row[0] * sin))
        a, b = -lean * length - row[2] * height, lean * height - row[2] * length
        da, db = -leaning * length - moving[2] * height, leaning * height - moving[2] * length
        rise, rising = road[0] - float(row @ self.hitch), road[1] - float(moving @ self.hitch)
        size = math.hypot(a, b)
        pitch = math.atan2(b, a) + math.acos(min(max(rise / size, -1.0), 1.0))
        pitch = math.remainder(pitch, 2.0 * math.pi)
        return pitch, float(
            (rising - da * math.cos(pitch) - db * math.sin(pitch)) / (b * math.cos(pitch) - a * math.sin(pitch))
        )

    def motion(self, time: float) -> Motion:
        """Return the motion of the trailer's frame, which is the vehicle's where both stand in line, relative to it."""
        now = self.at(time)
        hitch = Motion(Pose(self.hitch)).then(Motion.about(_Z, now.angle, now.rate))
        return hitch.then(Motion.about(-_Y, now.pitch, now.pitching)).then(Motion(Pose(-self.hitch)))


@dataclass(frozen=True)
class InLine:
    """A trailer straight behind its vehicle: what the one box of both holds."""

    shapes: tuple[str, ...]

    def postures(self) -> Iterator[dict[str, Motion]]:
        """Yield the motion of each shape: none."""
        yield dict.fromkeys(self.shapes, Motion())


@dataclass(frozen=True, eq=False)
class Trailer:
    """What turns about the coupling; `shapes` are modelled in the actor's frame, in line."""

    shapes: tuple[str, ...]
    towing: Towing
    changes_shape: bool = True

    @property
    def reach(self) -> InLine:
        """In line."""
        return InLine(self.shapes)

    def motions(self, time: float) -> dict[str, Motion]:
        """Return the turn about the coupling."""
        return dict.fromkeys(self.shapes, self.towing.motion(time))


@dataclass(frozen=True, eq=False)
class TowedWheel:
    """A wheel of a trailer: it rolls about an axle along the trailer's y axis, `center` and `radius` [m]."""

    shapes: tuple[str, ...]
    center: npt.NDArray[np.float64]
    radius: float
    towing: Towing
    changes_shape: bool = False
    reach: None = None

    def motions(self, time: float) -> dict[str, Motion]:
        """Return the trailer's motion and the turn about the axle, way of the wheel / radius."""
        now, aside = self.towing.at(time), float(self.center[1])
        rolled, speed = now.way - aside * now.turned, now.speed - aside * now.turning
        return dict.fromkeys(self.shapes, rolled_on(self.towing.motion(time), self.center, self.radius, rolled, speed))


def rolled_on(frame: Motion, center: npt.NDArray[np.float64], radius: float, rolled: float, speed: float) -> Motion:
    """Return the motion of a wheel in a frame that moves as given: turned about its axle by way over radius.

    `rolled` [m] and `speed` [m/s] are its own; the axle is along the frame's y axis through `center` (3,) [m].
    """
    return frame.then(Motion.about(_Y, rolled / radius, speed / radius, center))


def towing_from_table(
    tables: Sequence[Mapping[str, Any]], actor: str, shapes: Sequence[str], trajectory: Trajectory
) -> Towing | None:
    """Return the kinematics of the joint ``trailer`` among ``[[joints]]``; None without one.

    Keys: shapes, hitch (3) and length [m], and span: x of the body's rear and front in line [m], for collisions.

    Raises
    ------
    ParameterRangeError, UnknownNameError
        If there are two, a key is missing, unknown or not allowed, or a shape is not there.
    """
    rows = [(number, table) for number, table in enumerate(tables) if table.get("kind") == "trailer"]
    if not rows:
        return None
    what = f"{actor}.joints[{rows[-1][0]}]"
    if len(rows) > 1:
        raise ParameterRangeError(f"{what}.kind", "a second trailer", "one trailer an actor")
    table, needed = rows[0][1], {"shapes", "hitch", "length", "span"}
    if missing := needed - set(table):
        raise ParameterRangeError(f"{what}.{sorted(missing)[0]}", "missing", "needed for this kind of joint")
    if unknown := set(table) - needed - {"kind"}:
        raise UnknownNameError(f"key of {what}", sorted(unknown)[0], needed | {"kind"})
    if absent := [shape for shape in table["shapes"] if shape not in shapes]:
        raise UnknownNameError(f"shape of {what}", str(absent[0]), shapes)
    hitch, length = np.asarray(table["hitch"], dtype=np.float64), float(table["length"])
    if hitch.shape != (3,) or not np.isfinite(hitch).all():
        raise ParameterRangeError(f"{what}.hitch", table["hitch"], "three finite coordinates [m]")
    if not 0.0 < length < 100.0:
        raise ParameterRangeError(f"{what}.length", f"{length} m", "above 0 to 100 m")
    span = np.asarray(table["span"], dtype=np.float64)
    if span.shape != (2,) or not span[0] < span[1]:
        raise ParameterRangeError(f"{what}.span", table["span"], "x of the rear and of the front [m]")
    return Towing(trajectory, hitch, length, f"the trailer of '{actor}'")
