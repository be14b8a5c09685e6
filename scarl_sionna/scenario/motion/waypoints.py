"""Motions through stated points: on foot, by wheels, or with stated headings; at times or at one speed."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.scenario.spec.motion import WaypointsSpec
from scarl_sionna.scene.motion.trajectory import Trajectory, WaypointTrajectory

from .bodies import ActorBody
from .on_foot import GAIT, paced_walk, stopping, timed_walk
from .paths import PathTrajectory, SmoothPath
from .profiles import SpeedProfile
from .routes import Ground, smoothing_of, timed_trajectory

Array = npt.NDArray[np.float64]

_SETTING_OFF = (2.0, 4.0)
"""Acceleration [m/s2] and jerk [m/s3] with which a vehicle sets off."""
_CLOSE = 0.02
"""Distance of the places at which the length of a way with stated headings is measured [m]."""
_MOST = 200_000
_STEP = 0.1
"""Between the instants at which such a motion is sampled [s]."""


def through(
    spec: WaypointsSpec, points: Array, body: ActorBody, span: tuple[float, float], name: str, ground: Ground | None
) -> Trajectory:
    """Return the motion through points.

    Parameters
    ----------
    spec : WaypointsSpec
        With times or a speed, and headings where they are stated.
    points : ndarray of float64, shape (N, 3)
        In place of its positions [m].
    body : ActorBody
    span : (float, float)
        First and last time at which a motion at one speed shall be known [s].
    name : str
        For error messages.
    ground : callable or None
        Heights of the ground below the way; None: those of the points.

    Raises
    ------
    ParameterRangeError
        If points repeat where they may not, or a way is too short.
    """
    if spec.speed is None:
        assert spec.times is not None
        if spec.yaw_deg is not None:
            return WaypointTrajectory(spec.times, points, spec.yaw_deg, name)
        if is_on_foot(body) and spec.ground is None and not spec.reverse:
            return timed_walk(points, spec.times, body, name, ground)
        return timed_trajectory(points, spec.times, body, ground=ground, reverse=spec.reverse, name=name)
    if np.linalg.norm(np.diff(points, axis=0), axis=1).min() < 1e-3:
        raise ParameterRangeError(f"{name}.positions", "a point twice in a row", "distinct points")
    start, profile = _setting_off(spec, GAIT if is_on_foot(body) else _SETTING_OFF, span[0])
    if spec.yaw_deg is not None:
        return _headed(points, spec.yaw_deg, (profile, start, span[1]), body, name)
    if is_on_foot(body):
        return paced_walk(points, profile, start, span[1], (body, name, ground))
    margin = (body.length + 1.0, body.length + 1.0)
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    path = SmoothPath(points, min(smoothing_of(body), float(np.median(steps))), margin, sparse=True)
    ends = path.way_of(np.array([0.0, steps.sum()])) + body.rear_axle
    known = _until(profile, float(ends[1] - ends[0]), span[1] - start)
    return PathTrajectory(path, profile.way(known, start, float(ends[0])), body, start, start + known, name)


def is_on_foot(body: ActorBody) -> bool:
    """Return whether a body walks, or stands as people do."""
    return body.motion in ("walk", "stand")


def _setting_off(spec: WaypointsSpec, limits: tuple[float, float], first: float) -> tuple[float, SpeedProfile]:
    """Return when a motion at one speed begins [s], and its speed from then on: it waits until it departs."""
    assert spec.speed is not None
    start = min(first, spec.depart)
    if spec.depart <= first:
        return start, SpeedProfile(spec.speed)
    return start, SpeedProfile(0.0).hold(spec.depart - start).reach(spec.speed, *limits)


def _until(profile: SpeedProfile, total: float, known: float) -> float:
    """Return when a way is at its end [m], or a time by which it is not [s]."""
    way = profile.way(known)
    if way(known) <= total:
        return known
    return float(np.real(next(root for root in way.solve(total, extrapolate=False) if np.isfinite(root))))


def _headed(
    points: Array, yaw_deg: npt.ArrayLike, speeds: tuple[SpeedProfile, float, float], body: ActorBody, name: str
) -> WaypointTrajectory:
    """Return the motion along the curve through points (N, 3) with stated headings, by the length of the curve."""
    profile, start, stop = speeds
    yaw = np.asarray(yaw_deg, dtype=np.float64)
    if not np.isfinite(yaw).all():
        raise ParameterRangeError(f"{name}.yaw_deg", yaw_deg, "finite [deg]")
    chord = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    values = np.column_stack([points, np.degrees(np.unwrap(np.radians(yaw)))])
    curve = CubicSpline(chord, values)
    close = np.linspace(0.0, chord[-1], min(max(int(chord[-1] / _CLOSE), 64), _MOST) + 1)
    ways = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(curve(close)[:, :3], axis=0), axis=1))])
    if is_on_foot(body):
        profile, known = stopping(profile, float(ways[-1])), stop - start
    else:
        known = _until(profile, float(ways[-1]), stop - start)
    times = start + np.linspace(0.0, known, max(int(np.ceil(known / _STEP)), 4) + 1)
    found = curve(np.interp(profile.way(known, start)(times), ways, close))
    return WaypointTrajectory(times, found[:, :3], found[:, 3], name)
