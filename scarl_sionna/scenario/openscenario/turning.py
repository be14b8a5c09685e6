"""Smooth motion of entities that go backwards for a time: along the path on which they came, or along another one."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.scenario.motion.bodies import ActorBody
from scarl_sionna.scenario.motion.parking import JoinedTrajectory
from scarl_sionna.scenario.motion.paths import PathTrajectory
from scarl_sionna.scenario.motion.recorded import Record, Smoothed, smooth_record

Array = npt.NDArray[np.float64]
SAME = 0.02
"""How far ways may be apart that are one path [m]."""
_STANDING = 1e-4
_STRIDE = 2.0
_SHORT = 0.5
"""Shorter ways [m] belong to the path before them."""


def smooth_turning(
    record: Record, speeds: Array, body: ActorBody, span: tuple[float, float] | None, knot_time: float
) -> Smoothed:
    """Return the smooth motion of a record that goes forwards and backwards.

    Parameters
    ----------
    record : Record
        Its points are close together where its direction changes.
    speeds : ndarray of float64, shape (N,)
        Along the headings [m/s].
    body : ActorBody
    span, knot_time
        As of :func:`scarl_sionna.scenario.motion.recorded.smooth_record`.

    Returns
    -------
    Smoothed
        What goes back where it came is one path; from where it leaves that, another one, which begins in the same pose.

    Raises
    ------
    ParameterRangeError
        If the body is none that goes backwards, or as of `smooth_record`.
    """
    if body.motion != "vehicle" or body.trailer is not None:
        raise ParameterRangeError(
            f"motion of '{record.name}'",
            "backwards",
            "forwards for this body",
            "vehicles on four wheels or more without a trailer go backwards",
        )
    paths = _paths(record, speeds)
    pieces: list[PathTrajectory] = []
    worst = 0.0
    for number, (first, last) in enumerate(paths):
        part = slice(first, last + 1)
        times, points, headings = record.times[part], record.points[part], record.headings[part]
        own = replace(record, times=times, points=points, headings=headings, turns=True)
        bend = sharpest(points, signed_ways(points, headings))
        ends = None if span is None else (_end(span[0], number == 0, own), _end(span[1], number == len(paths) - 1, own))
        found = smooth_record(own, body, ends, knot_time, bend)
        if not isinstance(found.trajectory, PathTrajectory):
            return found  # it hardly moves
        if pieces:  # begins in the pose in which the piece before ends
            wanted, there = (one.pose(float(times[0])) for one in (pieces[-1], found.trajectory))
            angle, step = wanted.yaw - there.yaw, wanted.position - there.position
            own = replace(own, points=_moved(points, there.position, angle, step), headings=headings + angle)
            found = smooth_record(own, body, ends, knot_time, bend)
        worst = max(worst, found.deviation)
        assert isinstance(found.trajectory, PathTrajectory)
        pieces.append(found.trajectory)
    whole = pieces[0] if len(pieces) == 1 else JoinedTrajectory(tuple(pieces))
    return Smoothed(whole, worst, 0)


def _end(time: float, is_outer: bool, record: Record) -> float:
    """Return an end of the span of a piece: that of the whole, or within its record where others join it."""
    low, high = float(record.times[0]), float(record.times[-1])
    return time if is_outer else min(max(time, low), high)


def _moved(points: Array, about: Array, angle: float, step: Array) -> Array:
    """Return points (N, 3) turned about the vertical through a point [rad] and shifted [m]."""
    cos, sin = np.cos(angle), np.sin(angle)
    away = points - about
    turned = np.stack([cos * away[:, 0] - sin * away[:, 1], sin * away[:, 0] + cos * away[:, 1], away[:, 2]], axis=1)
    return np.asarray(about + turned + step)


def _paths(record: Record, speeds: Array) -> list[tuple[int, int]]:
    """Return first and last sample of each path; neighbours share a sample, at which the direction changes."""
    signs = np.where(speeds > _STANDING, 1, np.where(speeds < -_STANDING, -1, 0))
    cuts, now = [0], 0
    for index, sign in enumerate(signs.tolist()):
        if sign and now and sign != now:
            cuts.append(index - 1)
        now = sign or now
    cuts.append(len(signs) - 1)
    ways = signed_ways(record.points, record.headings)
    paths: list[tuple[int, int]] = []
    for first, last in pairwise(cuts):
        if paths and _is_same(record.points, ways, slice(paths[-1][0], first + 1), slice(first, last + 1)):
            paths[-1] = (paths[-1][0], last)
        else:
            paths.append((first, last))
    return paths


def signed_ways(points: Array, headings: Array) -> Array:
    """Return the way along the headings (N,) [m] of points (N, 3), which falls where they go back."""
    steps = np.diff(points, axis=0)
    middle = 0.5 * (headings[:-1] + headings[1:])
    forward = steps[:, 0] * np.cos(middle) + steps[:, 1] * np.sin(middle)
    return np.r_[0.0, np.cumsum(np.copysign(np.linalg.norm(steps, axis=1), forward))]


def _is_same(points: Array, ways: Array, before: slice, after: slice) -> bool:
    """Return whether a way is on the path before it, as far as both have the same ways."""
    if np.ptp(ways[after]) < _SHORT:
        return True
    order = np.argsort(ways[before], kind="stable")
    known, there = ways[before][order], points[before][order]
    shared = (ways[after] >= known[0]) & (ways[after] <= known[-1])
    at = np.stack([np.interp(ways[after][shared], known, there[:, axis]) for axis in (0, 1)], axis=1)
    return bool((np.linalg.norm(points[after][shared][:, :2] - at, axis=1) < SAME).all())


def sharpest(points: Array, ways: Array) -> float:
    """Return the largest curvature of a path of points (N, 3) at ways (N,) [m], in any order [1/m], over 2 m each."""
    order = np.argsort(ways, kind="stable")
    ways, plan = ways[order], points[order, :2]
    moving = np.r_[True, np.diff(ways) > 1e-6]
    if ways[-1] - ways[0] < 3.0 * _STRIDE:
        return 0.0
    places = np.arange(ways[0], ways[-1], _STRIDE)
    steps = np.diff([np.interp(places, ways[moving], plan[moving, axis]) for axis in (0, 1)], axis=1)
    turns = np.diff(np.unwrap(np.arctan2(steps[1], steps[0])))
    return float(np.abs(turns).max() / _STRIDE)


def goes_back(speeds: Array) -> bool:
    """Return whether some of the speeds [m/s] are backwards."""
    return bool(len(speeds)) and float(speeds.min()) < -_STANDING
