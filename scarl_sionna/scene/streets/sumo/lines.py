"""Polylines as smooth plan views: corners as arcs, ways through junctions as cubics from lane to lane."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.interpolate import PchipInterpolator

from scenes_xml.generators.geometry.polygon import shifted

from ..model import Array, Cubics, PlanPiece

ROUNDING = 0.25
"""How far an arc at a corner may leave the corner [m]; more only where the lanes inside the bend need a radius."""
SIDEWAYS = 2.0
"""Acceleration in a bend above which no larger radius is asked for [m/s2]."""
_ROOM = 2.0
"""Least radius of the innermost border, where the segments are long enough [m]."""
_STRAIGHT = 1.5
"""What stays straight at both ends of a line [m]: there lanes meet others."""
_SHORTEST = 0.01
_FIT = 0.1
"""Largest distance of a way through a junction as one cubic from the points of the file [m]."""
_KNOTS = 1.5
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(12)


@dataclass(frozen=True, eq=False)
class Line:
    """A smooth line: its plan view, length [m] and height."""

    plan: tuple[PlanPiece, ...]
    length: float
    elevation: Cubics


@dataclass(frozen=True, eq=False)
class End:
    """Where a lane ends or begins: point (3,) [m], heading of travel [rad], slope along it, width [m]."""

    point: Array
    heading: float
    slope: float
    width: float


def wrapped(angle: Array) -> Array:
    """Return angles within -pi to pi."""
    return np.asarray((angle + np.pi) % (2.0 * np.pi) - np.pi)


def distinct(points: Array) -> Array:
    """Return a line without points that lie in plan on the one before."""
    steps = np.linalg.norm(np.diff(points[:, :2], axis=0), axis=1)
    kept = points[np.r_[True, steps >= _SHORTEST]]
    if len(kept) > 1 and np.linalg.norm(kept[-1, :2] - points[-1, :2]) > 0.0:
        kept[-1] = points[-1]
    return kept


def beside(points: Array, away: float) -> Array:
    """Return a line moved to the left by `away` [m], corners mitred as SUMO does, shape (n, 3)."""
    return np.column_stack([shifted(points, away), points[:, 2]])


def rounded(points: Array, speed: float, reach: tuple[float, float], line: int = 0) -> Line:
    """Return a polyline whose corners are arcs.

    Parameters
    ----------
    points : ndarray of float64, shape (n, 3)
        Distinct in plan, n >= 2 [m].
    speed : float
        Speed limit [m/s]: a radius with which it takes less than `SIDEWAYS` is enough.
    reach : (float, float)
        How far lanes reach to the left and to the right of the line [m]: arcs are wider, if the segments let them.
    line : int
        Of the file.
    """
    step = np.diff(points[:, :2], axis=0)
    lengths, headings = np.linalg.norm(step, axis=1), np.arctan2(step[:, 1], step[:, 0])
    turns = wrapped(np.diff(headings))
    cut = np.zeros(len(points))  # from each corner to the ends of its arc
    radius = np.zeros(len(points))
    for k, turn in enumerate(turns, 1):
        half = 0.5 * min(abs(float(turn)), 3.0)
        if half < 1e-6:
            continue
        wanted = min(speed * speed / SIDEWAYS, ROUNDING / (1.0 / np.cos(half) - 1.0))
        wanted = max(wanted, reach[0 if turn > 0.0 else 1] + _ROOM)
        before = lengths[0] - min(_STRAIGHT, 0.5 * lengths[0]) if k == 1 else 0.5 * lengths[k - 1]
        after = lengths[-1] - min(_STRAIGHT, 0.5 * lengths[-1]) if k == len(points) - 2 else 0.5 * lengths[k]
        cut[k] = min(wanted * np.tan(half), before, after)
        radius[k] = cut[k] / np.tan(half)
    pieces: list[PlanPiece] = []
    s, knots = 0.0, [0.0]
    for k in range(len(lengths)):
        direction = step[k] / lengths[k]
        straight = float(lengths[k] - cut[k] - cut[k + 1])
        if straight > 1e-6:
            place = points[k, :2] + cut[k] * direction
            pieces.append(_arc(line, s, place, float(headings[k]), straight, 0.0))
            s += straight
        if k < len(turns) and cut[k + 1] > 0.0:
            place = points[k + 1, :2] - cut[k + 1] * direction
            own = float(radius[k + 1] * abs(turns[k]))
            pieces.append(_arc(line, s, place, float(headings[k]), own, float(np.sign(turns[k]) / radius[k + 1])))
            knots.append(s + 0.5 * own)
            s += own
        else:
            knots.append(s)
    knots[-1] = s
    return Line(tuple(pieces), s, _profile(np.array(knots), points[:, 2]))


def _arc(line: int, s: float, place: Array, heading: float, length: float, curvature: float) -> PlanPiece:
    numbers = {"curvStart": curvature, "curvEnd": curvature} if curvature else {}
    return PlanPiece(
        line, s, float(place[0]), float(place[1]), heading, length, "arc" if curvature else "line", numbers
    )


def _profile(s: Array, z: Array) -> Cubics:
    """Return heights through points, without a hump between them."""
    kept = np.r_[True, np.diff(s) > 1e-6]
    s, z = s[kept], z[kept]
    if not np.any(z) or len(s) < 2:
        return Cubics() if not np.any(z) else Cubics(np.zeros(1), np.array([[z[0], 0.0, 0.0, 0.0]]))
    return Cubics(s[:-1].copy(), PchipInterpolator(s, z).c[::-1].T.copy())


def connecting(start: End, stop: End, guide: Array, line: int = 0) -> Line:
    """Return the way from the end of one lane to the start of another, along points of the file.

    Parameters
    ----------
    start, stop : End
    guide : ndarray of float64, shape (n, 3)
        Points that the way passes, without its ends [m]; may be none.
    line : int
        Of the file.

    Notes
    -----
    One cubic with the headings of both ends whose lengths of tangents fit the points in least squares; where a point
    is farther than 0.1 m from it, cubics from point to point.
    """
    ends, headings = np.array([start.point[:2], stop.point[:2]]), (start.heading, stop.heading)
    tangents = np.array([[np.cos(h), np.sin(h)] for h in headings])
    chord = float(np.linalg.norm(ends[1] - ends[0]))
    turn = abs(float(wrapped(np.array(stop.heading - start.heading))))
    size = np.full(2, chord / np.cos(0.25 * turn) ** 2)
    plane = _between(guide[:, :2], ends, tangents)
    if len(plane):
        size = _fitted(ends, tangents, plane, size)
        dense = _hermite(np.linspace(0.0, 1.0, 65), ends, tangents * size[:, None])
        far = np.linalg.norm(plane[:, None] - dense[None], axis=2).min(1).max() > _FIT
    else:
        far = False
    if far:
        points = [ends[0]]
        for point in plane:
            if np.linalg.norm(point - points[-1]) > _KNOTS and np.linalg.norm(point - ends[1]) > _KNOTS:
                points.append(point)
        knots = np.array([*points, ends[1]])
        plan = _spline(knots, tangents, line)
    else:
        plan = [_cubic(line, 0.0, ends, tangents * size[:, None])]
    length = plan[-1].s + plan[-1].length
    rise = float(stop.point[2] - start.point[2])
    c = (3.0 * rise / length - 2.0 * start.slope - stop.slope) / length
    d = (start.slope + stop.slope - 2.0 * rise / length) / length**2
    return Line(tuple(plan), length, Cubics(np.zeros(1), np.array([[start.point[2], start.slope, c, d]])))


def _between(points: Array, ends: Array, tangents: Array) -> Array:
    """Return the points that lie ahead of the start and before the end."""
    if not len(points):
        return points
    ahead = ((points - ends[0]) @ tangents[0] > 0.05) | (np.linalg.norm(points - ends[0], axis=1) > 2.0)
    before = ((ends[1] - points) @ tangents[1] > 0.05) | (np.linalg.norm(points - ends[1], axis=1) > 2.0)
    return np.asarray(points[ahead & before])


def _hermite(u: Array, ends: Array, tangents: Array) -> Array:
    u = u[:, None]
    return np.asarray(
        (2 * u**3 - 3 * u**2 + 1) * ends[0]
        + (u**3 - 2 * u**2 + u) * tangents[0]
        + (3 * u**2 - 2 * u**3) * ends[1]
        + (u**3 - u**2) * tangents[1]
    )


def _fitted(ends: Array, tangents: Array, points: Array, size: Array) -> Array:
    """Return the lengths of both tangents with which a cubic passes points best."""
    chord = float(np.linalg.norm(ends[1] - ends[0]))
    share = np.linspace(0.0, 1.0, 129)
    for _ in range(6):
        dense = _hermite(share, ends, tangents * size[:, None])
        u = share[np.linalg.norm(points[:, None] - dense[None], axis=2).argmin(1)]
        rest = points - _hermite(u, ends, np.zeros((2, 2)))
        first, second = (u**3 - 2 * u**2 + u)[:, None] * tangents[0], (u**3 - u**2)[:, None] * tangents[1]
        table = np.column_stack([first.ravel(), second.ravel()])
        weight = 1e-3 * np.eye(2)  # keeps the lengths where points say nothing of them
        best = np.linalg.solve(table.T @ table + weight, table.T @ rest.ravel() + weight @ size)
        size = np.clip(best, 0.3 * chord, 4.0 * chord)
    return size


def _spline(knots: Array, tangents: Array, line: int) -> list[PlanPiece]:
    steps = np.linalg.norm(np.diff(knots, axis=0), axis=1)
    slopes = np.zeros_like(knots)
    slopes[0], slopes[-1] = tangents
    for k in range(1, len(knots) - 1):
        before, after = (knots[k] - knots[k - 1]) / steps[k - 1], (knots[k + 1] - knots[k]) / steps[k]
        slopes[k] = (before * steps[k] + after * steps[k - 1]) / (steps[k] + steps[k - 1])
    plan: list[PlanPiece] = []
    for k, (first, second) in enumerate(pairwise(range(len(knots)))):
        s = plan[-1].s + plan[-1].length if plan else 0.0
        plan.append(_cubic(line, s, knots[[first, second]], slopes[[first, second]] * steps[k]))
    return plan


def _cubic(line: int, s: float, ends: Array, tangents: Array) -> PlanPiece:
    """Return the cubic between two points with tangents, as a piece of a plan view."""
    heading = float(np.arctan2(tangents[0, 1], tangents[0, 0]))
    turn = np.array([[np.cos(heading), np.sin(heading)], [-np.sin(heading), np.cos(heading)]])
    way, first, last = turn @ (ends[1] - ends[0]), turn @ tangents[0], turn @ tangents[1]
    rows = [np.zeros(2), first, 3.0 * way - 2.0 * first - last, first + last - 2.0 * way]
    numbers = {
        f"{key}{axis}": float(row[k]) for key, row in zip("abcd", rows, strict=True) for k, axis in enumerate("UV")
    }
    x, y = (float(value) for value in ends[0])
    return PlanPiece(line, s, x, y, heading, _length(rows), "paramPoly3", numbers, True)


def _length(rows: Sequence[Array]) -> float:
    edges = np.linspace(0.0, 1.0, 17)
    p = (edges[:-1, None] + np.diff(edges)[:, None] * 0.5 * (_NODES + 1.0)).ravel()[:, None]
    speed = np.linalg.norm(rows[1] + 2.0 * rows[2] * p + 3.0 * rows[3] * p * p, axis=1)
    return float((speed * np.tile(0.5 * _WEIGHTS, 16)).sum() / 16.0)
