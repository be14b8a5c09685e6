"""Waypoints of what moves.

A way along joined centre lines at a speed that changes smoothly, on the ground as it is built.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.ndimage import gaussian_filter1d

from ..geometry.mesh import Array
from ..geometry.polygon import length_along
from .ground import Ground

STEP = 0.1
"""Spacing at which ways are smoothed [m]."""


def joined(*lines: Array) -> Array:
    """Return lines that continue each other as one, in plan, shape (n, 2) [m]; points that coincide count once."""
    points = np.vstack([np.asarray(line, float)[:, :2] for line in lines])
    keep = np.r_[True, np.linalg.norm(np.diff(points, axis=0), axis=1) > 1e-3]
    return points[keep]


def smooth(line: Array, sigma: float) -> Array:
    """Return a plane line without jumps of curvature: averaged over some `sigma` [m], in steps of `STEP`.

    The ends stay straight.
    """
    s = length_along(line)
    even = np.arange(0.0, s[-1], STEP)
    points = np.column_stack([np.interp(even, s, line[:, k]) for k in (0, 1)])
    pad = int(np.ceil(4 * sigma / STEP))
    ramp = np.arange(1, pad + 1)[:, None]
    before = points[0] - ramp[::-1] * (points[1] - points[0])
    after = points[-1] + ramp * (points[-1] - points[-2])
    return gaussian_filter1d(np.vstack([before, points, after]), sigma / STEP, axis=0)[pad:-pad]


def drive(
    line: Array,
    times: Array,
    speeds: Sequence[tuple[float, float]],
    start: float = 0.0,
    ground: Ground | None = None,
    sigma: float = 1.5,
    offset: float = 0.0,
) -> tuple[Array, Array]:
    """Return positions (n, 3) [m] and headings (n,) [deg] at `times` [s].

    Parameters
    ----------
    line : ndarray, shape (m, 2 or 3)
        Way to follow [m].
    speeds : sequence of (time, speed)
        Speed [m/s] at times [s]; between them it changes without overshoot, and outside it stays.
    start : float
        Way already gone at the first time [m].
    ground : Ground, optional
        Gives the heights; without it they are 0.
    sigma : float
        Length over which the way is smoothed [m].
    offset : float
        Shift of the way to its left [m].

    Raises
    ------
    ValueError
        If the way is too short.
    """
    way = smooth(np.asarray(line, float)[:, :2], sigma)
    step = np.gradient(way, axis=0)
    heading = np.unwrap(np.arctan2(step[:, 1], step[:, 0]))
    way = way + offset * np.column_stack([-np.sin(heading), np.cos(heading)])
    s = length_along(way)
    fine = np.linspace(times[0], times[-1], 4001)
    knots = np.asarray(speeds, float)
    if len(knots) == 1:
        speed = np.full_like(fine, knots[0, 1])
    else:
        speed = np.maximum(PchipInterpolator(*knots.T)(np.clip(fine, knots[0, 0], knots[-1, 0])), 0.0)
    gone = start + np.r_[0.0, np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(fine))]
    if start < 0.0 or gone[-1] > s[-1]:
        raise ValueError(f"the way is {s[-1]:.1f} m long; {start:.1f} to {gone[-1]:.1f} m are asked for")
    here = np.interp(times, fine, gone)
    xy = np.column_stack([np.interp(here, s, way[:, k]) for k in (0, 1)])
    z = np.zeros(len(times)) if ground is None else ground.height(xy)
    return np.column_stack([xy, z]), np.degrees(np.interp(here, s, heading))
