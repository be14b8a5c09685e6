"""Trajectories along lanes and through waypoints."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.interpolate import PPoly

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.scene.lanes import LaneNetwork

from .bodies import ActorBody, BodyLike, body_of
from .paths import SMOOTHING, LateralShift, PathTrajectory, SmoothPath
from .profiles import SpeedProfile, constant_way, smooth_way

Array = npt.NDArray[np.float64]
Ground = Callable[[Array], Array]
"""Heights (M,) [m] of the ground at places (M, 2) [m]."""

WALK_SMOOTHING = 1.5
"""Distance of the knots of a walker's path [m]: about two steps; a corner is taken in three."""

CORNER = 1.0
"""Way before and after a corner on which people who walk straight from point to point turn [m], at most half the way to
the next point: two to three steps in all."""
_CORNER_KNOTS = 0.5
"""Distance of the knots of such a way [m]: what is straight stays straight within 2 mm and one degree."""


def smoothing_of(body: ActorBody) -> float:
    """Return the distance of the knots of a body's path [m]: longer for what steers than for what walks."""
    return SMOOTHING if body.wheelbase > 0.8 else WALK_SMOOTHING


def route_points(network: LaneNetwork, lanes: Sequence[str]) -> tuple[Array, Array]:
    """Return the centre line (N, 3) [m] of consecutive lanes, and the distance along it at which each begins.

    Raises
    ------
    UnknownNameError
        If there is no such lane, or one does not continue the one before it.
    """
    route = network.check_route(lanes)
    parts = [route[0].points]
    for lane in route[1:]:
        gap = np.linalg.norm(lane.points[0] - parts[-1][-1])
        parts[-1] = parts[-1][:-1] if gap < 0.5 and len(parts[-1]) > 1 else parts[-1]
        parts.append(lane.points)
    points = np.concatenate(parts)
    chord = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    firsts = np.cumsum([0, *(len(part) for part in parts[:-1])])
    return points, chord[firsts]


@dataclass(frozen=True, eq=False)
class Route:
    """Where a vehicle goes.

    Attributes
    ----------
    network : LaneNetwork
    lanes : sequence of str
        Names of lanes, each one a continuation of the one before.
    offset : float
        Constant distance to the left of the centre lines [m].
    shifts : sequence of LateralShift
        Lane changes: their `start` counts from the beginning of the first lane.
    """

    network: LaneNetwork
    lanes: Sequence[str]
    offset: float = 0.0
    shifts: Sequence[LateralShift] = ()

    def trajectory(
        self,
        start: float = 0.0,
        speed: float | SpeedProfile = 10.0,
        *,
        model: BodyLike | str | None = None,
        duration: float | None = None,
        start_time: float = 0.0,
        name: str = "actor",
    ) -> PathTrajectory:
        """Return the motion of a vehicle along the lanes.

        Parameters
        ----------
        start : float
            Where the actor's origin is at `start_time`: distance along the lanes' centre lines from the start of the
            first [m].
        speed : float or SpeedProfile
            [m/s]
        model : actor model, str or None
            Whose axles follow the lanes: an actor model, the name of one, or None for a saloon.
        duration : float or None
            How long the motion is known [s]; None: until the front axle reaches the end of the last lane (60 s for one
            that stops before).
        start_time : float
            First time [s].
        name : str
            For error messages.

        Returns
        -------
        PathTrajectory
            C2, on the ground of the lanes.

        Raises
        ------
        ParameterRangeError
            If the start does not lie on the lanes, or the lanes end before the motion does.
        UnknownNameError
            If a lane or a model is unknown.
        """
        points, _ = route_points(self.network, self.lanes)
        body = body_of(model)
        beyond = (body.length + 1.0, 0.5)
        path = SmoothPath(points, smoothing_of(body), beyond, self.offset, self.shifts).of_lanes()
        profile = speed if isinstance(speed, SpeedProfile) else SpeedProfile(float(speed))
        rear = float(path.way_of(start)) + body.rear_axle
        room = path.length - body.wheelbase - rear
        if not start >= 0.0 or room < 0.0:
            raise ParameterRangeError(
                f"{name}.start", start, f"0 to {path.length - body.wheelbase - body.rear_axle:.4g} m along the lanes"
            )
        if duration is None:
            duration = _time_to(profile, room)
        end = float(profile.way(duration, start_time)(start_time + duration))
        if not duration > 0.0 or end > room + 0.4:
            raise ParameterRangeError(
                f"{name}.duration",
                f"{duration:g} s, {end:.4g} m",
                f"at most the {room:.4g} m to the end of lane '{self.lanes[-1]}'",
                "name more lanes, drive slower or end earlier",
            )
        way = profile.way(duration, start_time, rear)
        return PathTrajectory(path, way, body, start_time, start_time + duration, name)


def _time_to(profile: SpeedProfile, way: float, longest: float = 60.0) -> float:
    """Return when a profile has covered a way [s], or `longest` where it stops before."""
    left = way - profile.final_way
    if left >= 0.0:
        return (
            profile.duration + left / profile.final_speed
            if profile.final_speed > 0.0
            else max(longest, profile.duration)
        )
    curve = profile.way(profile.duration)
    roots = curve.solve(way, extrapolate=False)
    return float(np.real(roots[np.isfinite(roots)][0]))


def vehicle_trajectory(
    waypoints: npt.ArrayLike,
    times: npt.ArrayLike | None = None,
    speed: float | SpeedProfile | None = None,
    *,
    model: BodyLike | str | None = None,
    start_time: float = 0.0,
    name: str = "actor",
) -> PathTrajectory:
    """Return the motion of a vehicle through waypoints, by the kinematic bicycle.

    Its rear axle follows the curve through them.

    Parameters
    ----------
    waypoints : array_like of float, shape (N, 3)
        Points of the origin on the ground, N >= 2; points that repeat mean a stop [m].
    times : array_like of float, shape (N,), or None
        Strictly rising times of the origin at the waypoints [s].
    speed : float, SpeedProfile or None
        Instead of times: the speed [m/s] from `start_time` on.
    model : actor model, str or None
        Whose axles; None for a saloon.
    start_time : float
        First time, where a speed is given [s].
    name : str
        For error messages.

    Notes
    -----
    The knots of the path are 3 m apart, for a walker 1.5 m, and less between waypoints that lie closer. In a bend the
    origin is some ``rear_axle**2 / (2 R)`` outside the waypoints, as a vehicle's middle is.

    Raises
    ------
    ParameterRangeError
        If shapes disagree, times do not rise, or neither or both of times and speed are given.
    """
    if (times is None) == (speed is None):
        raise ParameterRangeError(f"{name}.times", "and speed", "one of the two")
    body = body_of(model)
    if times is not None:
        return timed_trajectory(waypoints, times, body, name=name)
    assert speed is not None
    path, ways = _through(waypoints, body, name)
    profile = speed if isinstance(speed, SpeedProfile) else SpeedProfile(float(speed))
    duration = _time_to(profile, float(ways[-1] - ways[0]))
    way = profile.way(duration, start_time, float(ways[0]))
    return PathTrajectory(path, way, body, start_time, start_time + duration, name)


def timed_trajectory(
    waypoints: npt.ArrayLike,
    times: npt.ArrayLike,
    body: ActorBody,
    *,
    ground: Ground | None = None,
    reverse: bool = False,
    name: str = "actor",
) -> PathTrajectory:
    """Return the motion of a vehicle through waypoints at given times, forwards or backwards.

    Parameters
    ----------
    waypoints, times
        As in `vehicle_trajectory`.
    body : ActorBody
    ground : callable or None
        Heights (M,) [m] of the ground at places (M, 2) [m], on which both axles stand; None: those of the waypoints.
    reverse : bool
        Whether it drives backwards: it heads against its way.
    name : str
        For error messages.

    Raises
    ------
    ParameterRangeError
        If shapes disagree, or times do not rise.
    """
    path, ways = _through(waypoints, body, name, ground, reverse)
    return timed_along(path, ways, times, body, name)


def timed_along(path: SmoothPath, ways: Array, times: npt.ArrayLike, body: ActorBody, name: str) -> PathTrajectory:
    """Return the motion along a path whose ways (N,) [m] are met at times (N,) [s].

    Raises
    ------
    ParameterRangeError
        If shapes disagree, or times do not rise.
    """
    time = rising_times(times, len(ways), name)
    way: PPoly = (
        constant_way(float((ways[-1] - ways[0]) / (time[1] - time[0])), float(time[0]), float(time[1]), float(ways[0]))
        if len(time) == 2
        else smooth_way(time, ways)
    )
    return PathTrajectory(path, way, body, name=name)


def rising_times(times: npt.ArrayLike, count: int, name: str) -> Array:
    """Return times (N,) [s] of as many points as there are.

    Raises
    ------
    ParameterRangeError
        If there are more or fewer, or they do not rise.
    """
    time = np.asarray(times, dtype=np.float64)
    if time.shape != (count,) or not np.all(np.diff(time) > 0.0):
        raise ParameterRangeError(f"{name}.times", f"shape {time.shape}", f"{count} strictly rising times [s]")
    return time


def _through(
    waypoints: npt.ArrayLike,
    body: ActorBody,
    name: str,
    ground: Ground | None = None,
    reverse: bool = False,
) -> tuple[SmoothPath, Array]:
    """Return the path through waypoints in the direction of the heading, and the way of the rear axle at each [m]."""
    points = _checked(waypoints, name)
    points = points[::-1] if reverse else points
    fresh = fresh_points(points, name)
    kept = points[fresh]
    smoothing = min(smoothing_of(body), float(np.median(np.linalg.norm(np.diff(kept, axis=0), axis=1))))
    path = SmoothPath(kept, smoothing, (body.length + 1.0, body.length + 1.0), sparse=True)
    path = path if ground is None else path.on_ground(ground)
    chord = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(kept, axis=0), axis=1))])[np.cumsum(fresh) - 1]
    ways = path.way_of(chord) + body.rear_axle
    return path, ways[::-1] if reverse else ways


def walked(
    waypoints: npt.ArrayLike, body: ActorBody, name: str, ground: Ground | None = None
) -> tuple[SmoothPath, Array]:
    r"""Return the way of a body that goes straight from point to point, and where on it each point is passed [m].

    Parameters
    ----------
    waypoints : array_like of float, shape (N, 3)
        N >= 2; points that repeat mean a stop [m].
    body : ActorBody
    name : str
        For error messages.
    ground : callable or None
        Heights (M,) [m] of the ground at places (M, 2) [m]; None: straight between those of the waypoints.

    Raises
    ------
    ParameterRangeError
        If shapes disagree, or all points are one.

    Notes
    -----
    Within :math:`h` = `CORNER` of a corner the way is :math:`P + u_1 s + (u_2 - u_1) \int_{-h}^s q(t) \, dt` with
    the directions before and after it and the quintic step q over 2 h: it turns to one side only, and cuts the corner
    by 0.16 h :math:`|u_2 - u_1|`, 0.22 m at a right angle.
    """
    points = _checked(waypoints, name)
    fresh = fresh_points(points, name)
    kept = points[fresh]
    steps = np.diff(kept, axis=0)
    legs = np.linalg.norm(steps, axis=1)
    corners, units = np.concatenate([[0.0], np.cumsum(legs)]), steps / legs[:, None]
    close = np.linspace(0.0, corners[-1], max(int(np.ceil(corners[-1] / (0.1 * _CORNER_KNOTS))), 16) + 1)
    straight = np.stack([np.interp(close, corners, kept[:, axis]) for axis in range(3)], axis=1)
    for index in range(1, len(kept) - 1):
        half = min(CORNER, legs[index - 1] / 2.0, legs[index] / 2.0)
        near = np.flatnonzero(np.abs(close - corners[index]) < half)
        x = (close[near] - corners[index] + half) / (2.0 * half)
        gone = 2.0 * half * (x**4 * (2.5 + x * (x - 3.0)))  # the integral of the quintic step
        gone -= np.maximum(close[near] - corners[index], 0.0)
        straight[near] += gone[:, None] * (units[index] - units[index - 1])
    margin = (body.length + 1.0, body.length + 1.0)
    path = SmoothPath(straight, min(_CORNER_KNOTS, float(corners[-1])), margin)
    path = path if ground is None else path.on_ground(ground)
    chord = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(straight, axis=0), axis=1))])
    ways = path.way_of(np.interp(corners, close, chord))[np.cumsum(fresh) - 1]
    return path, ways + body.rear_axle


def _checked(waypoints: npt.ArrayLike, name: str) -> Array:
    points = np.asarray(waypoints, dtype=np.float64)
    if points.ndim != 2 or len(points) < 2 or points.shape[1] != 3 or not np.isfinite(points).all():
        raise ParameterRangeError(f"{name}.waypoints", f"shape {points.shape}", "finite, shape (N, 3) with N >= 2 [m]")
    return points


def fresh_points(points: Array, name: str) -> npt.NDArray[np.bool_]:
    """Return which of the points (N, 3) are not those before them."""
    fresh = np.concatenate([[True], np.linalg.norm(np.diff(points, axis=0), axis=1) > 1e-3])
    if fresh.sum() < 2:
        raise ParameterRangeError(
            f"{name}.waypoints", "all at one place", "two distinct points", "use a static trajectory"
        )
    return fresh
