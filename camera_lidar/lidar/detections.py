"""What a receiver reports, the strongest of it, and which surface it comes from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.specs.lidar.spec import LidarSpec

from .returns import Echoes, place_in_group, take

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]

NO_ECHO = -1
"""Echo of a detection that is not from one surface: fog, rain, noise, or tones of two surfaces taken for one."""
_MATCH_CELLS = 2.0
"""A detection belongs to the return that lies within so many resolution cells of it."""


@dataclass(frozen=True, eq=False)
class Detections:
    """What a receiver reports, by shot and distance.

    Attributes
    ----------
    shot : ndarray of int64, shape (num_detections,)
    echo : ndarray of int64, shape (num_detections,)
        Row of the returns that it comes from, or `NO_ECHO`.
    distance : ndarray of float64, shape (num_detections,)
        Measured [m].
    radial_velocity : ndarray of float64, shape (num_detections,)
        Measured [m/s]; NaN for a single chirp or a pulse.
    cnr : ndarray of float64, shape (num_detections,)
        Measured carrier-to-noise ratio, or squared peak over the variance of the noise, linear.
    intensity : ndarray of float64, shape (num_detections,)
        Measured, in the unit of the returns.
    """

    shot: Index
    echo: Index
    distance: Array
    radial_velocity: Array
    cnr: Array
    intensity: Array


def keep_strongest(found: Detections, number: int) -> Detections:
    """Return the `number` strongest detections of each shot, by shot and distance."""
    order = np.argsort(found.shot, kind="stable")  # fast: all but a few are in order
    shot = found.shot[order]
    equal = np.flatnonzero(np.diff(shot) == 0)
    if equal.size == 0:
        return take(found, order)
    shared = np.zeros(order.size, dtype=bool)
    shared[equal] = shared[equal + 1] = True
    rows = order[shared]
    rows = rows[np.lexsort((-found.cnr[rows], found.shot[rows]))]
    rows = rows[place_in_group(found.shot[rows]) < number]
    kept = np.concatenate([order[~shared], rows])
    return take(found, kept[np.lexsort((found.distance[kept], found.shot[kept]))])


def match(spec: LidarSpec, found: Detections, returns: Echoes) -> Index:
    """Return the nearest return of the same shot, in cells of range and of velocity resolution, or `NO_ECHO`.

    A velocity that was not measured does not count.
    """
    echo = np.full(len(found.shot), NO_ECHO)
    best = np.full(len(found.shot), _MATCH_CELLS)
    first, stop = (np.searchsorted(returns.shot, found.shot, side=side) for side in ("left", "right"))
    for place in range(int((stop - first).max(initial=0))):
        row = np.flatnonzero(first + place < stop)
        candidate = first[row] + place
        away = np.fmax(
            np.abs(returns.distance[candidate] - found.distance[row]) / spec.range_resolution,
            np.abs(returns.radial_velocity[candidate] - found.radial_velocity[row]) / spec.velocity_resolution,
        )
        nearer = away < best[row]
        echo[row[nearer]], best[row[nearer]] = candidate[nearer], away[nearer]
    return echo
