"""Cubic splines through samples of a motion that stand where the samples stand and do not swing beyond a stop."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicHermiteSpline, CubicSpline

Array = npt.NDArray[np.float64]

STILL = 1e-6
"""Step between two samples below which they are the same: the body stands between them [m or rad]."""
_STEEPEST = 3.0
"""Largest slope at a sample over the mean slope beside it with which a cubic stays monotone (Fritsch and Carlson)."""
_MOST_PASSES = 20


def shaped_spline(times: Array, values: Array) -> CubicSpline | CubicHermiteSpline:
    """Return a piecewise cubic through values (N,) or (N, D) at rising times (N,) [s].

    Notes
    -----
    The cubic spline (C2, not-a-knot), where it does what the samples say. Between samples that are the same it stands,
    with zero slope at both ends. Where the slope of the spline runs against one of the steps beside a sample, or is
    more than three times as fast as one of them, it is brought to what a monotone cubic may have [1]_, along the
    steps' directions; where the steps turn back (by 90 degrees or more) it is left as it is. Between such samples the
    pieces are splines with these slopes at their ends, so that the first derivative is continuous everywhere, the
    second one except at these samples.

    References
    ----------
    .. [1] F. N. Fritsch, R. E. Carlson, Monotone piecewise cubic interpolation, SIAM J. Numer. Anal. 17, 1980.
    """
    whole = CubicSpline(times, values)
    points = values.reshape(len(times), -1)
    steps = np.diff(points, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    still = lengths < STILL
    if still.all():
        return whole
    fixed = np.zeros(len(times), dtype=bool)
    fixed[:-1] |= still
    fixed[1:] |= still
    slopes = np.where(fixed[:, None], 0.0, whole(times, 1).reshape(points.shape))
    directions = steps / np.maximum(lengths, STILL)[:, None]
    means = lengths / np.diff(times)
    for _ in range(_MOST_PASSES):
        slopes = _between(times, points, slopes, fixed)
        limited = _limited(slopes, directions, means)
        wrong = ~fixed & np.any(np.abs(limited - slopes) > 1e-9 * means.max(), axis=1)
        if not wrong.any():
            break
        slopes[wrong], fixed = limited[wrong], fixed | wrong
    return CubicHermiteSpline(times, values, slopes.reshape(values.shape)) if fixed.any() else whole


def _between(times: Array, points: Array, slopes: Array, fixed: npt.NDArray[np.bool_]) -> Array:
    """Return slopes (N, D) of the splines between samples whose slopes are fixed."""
    found = slopes.copy()
    bounds = np.unique(np.concatenate([[0], np.flatnonzero(fixed), [len(times) - 1]]))
    for first, last in zip(bounds[:-1].tolist(), bounds[1:].tolist(), strict=True):
        if last == first + 1 and fixed[first] and fixed[last]:
            continue
        ends = tuple((1, slopes[end]) if fixed[end] else "not-a-knot" for end in (first, last))
        part = slice(first, last + 1)
        found[part] = CubicSpline(times[part], points[part], bc_type=ends)(times[part], 1)
    found[fixed] = slopes[fixed]
    return found


def _limited(slopes: Array, directions: Array, means: Array) -> Array:
    """Return slopes (N, D) such that no piece runs back along its step (N - 1, D) of a mean speed (N - 1,)."""
    before, after = np.vstack([directions[:1], directions]), np.vstack([directions, directions[-1:]])
    low, high = np.concatenate([means[:1], means]), np.concatenate([means, means[-1:]])
    turns = np.sum(before * after, axis=1) <= 0.0
    found = slopes.copy()
    for step in (before, after):  # without what runs against a step; once more, for what the second one brings back
        found -= np.minimum(np.sum(found * step, axis=1), 0.0)[:, None] * step
    found -= np.minimum(np.sum(found * before, axis=1), 0.0)[:, None] * before
    share = np.ones(len(slopes))
    for step, mean in ((before, low), (after, high)):
        along = np.sum(found * step, axis=1)
        share = np.minimum(share, np.divide(_STEEPEST * mean, along, where=along > 0.0, out=np.full(len(along), 1.0)))
    return np.where(turns[:, None], slopes, share[:, None] * found)
