"""Lane changes of drivers: when, by MOBIL, and the line that is driven then.

References
----------
.. [1] A. Kesting, M. Treiber, D. Helbing, General lane-changing model MOBIL for car-following models, Transportation
   Research Record 1999, 86, 2007: Eqs. (2), (4) and (5), rules of Europe, and its values.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from scarl_sionna.scenario.motion.paths import quintic_step

from .tracks import Track

Array = npt.NDArray[np.float64]

SAFE_BRAKING = 2.0
"""Hardest braking that a change may ask of who is behind then [m/s^2]: b_safe of [1], where it is 4."""
GIVEN_TIME, GIVEN_HEADWAY = 10.0, 1.0
"""Before a body whose motion is given, which will not brake: least time to a collision, and least headway [s]."""
THRESHOLD, BIAS = 0.1, 0.3
"""Advantage that a change must have, and by how much more to the left and less to the right [m/s^2]."""
POLITENESS = 0.2
"""Share of the others' advantage that counts."""
DURATION, SHORTEST = 4.5, 30.0
"""Of a change [s] and its least way [m]: below 1.2 m/s^2 to the side in a lane of 3.75 m."""
SLOWEST = 5.0
"""Below this speed nobody changes [m/s]: queues stay in their lanes."""
TOO_FAST = 1.05
"""Speed over that wished in a lane beside, above which nobody goes there."""
STRAIGHT = 0.7
"""Lateral acceleration of a bend above which nobody changes [m/s^2]: both together stay below 2 m/s^2."""
SHARED = 0.5
"""Part of a change for which a body is in both lanes."""
PAUSE = 60.0
"""Way after a change before the next [m]."""
_ROOM = 40.0
"""Lanes share nothing, and do not end, so far beyond a change [m]."""
_APART = 2.0
"""Largest distance of the points of a line [m]."""
NEAREST = 2.0
"""Least distance between bodies in the lane that is changed to [m]."""


@dataclass(frozen=True)
class LaneChange:
    """A change from the track `place` of a route to the next one, over ways of the rear axle [m]."""

    place: int
    start: float
    length: float

    @property
    def end(self) -> float:
        """Way at which it ends [m]."""
        return self.start + self.length


class Legs(Protocol):
    """A way along tracks: track number i begins at the way `starts[i]` and is entered at the way `enters[i]` [m]."""

    route: list[int]
    starts: list[float]
    enters: list[float]
    changes: list[LaneChange]


def is_wanted(own: tuple[float, float], old: tuple[float, float], new: tuple[float, float], to_left: bool) -> bool:
    """Return whether a change is safe and pays, by accelerations before and after it [m/s^2].

    Parameters
    ----------
    own, old, new : (float, float)
        Of the driver, of who follows now, and of who would follow.
    to_left : bool
        Whether it is the lane for overtaking: going there takes more, going back less, and who stays behind on the
        right (old) or left (new) counts only for the lane that is free then (rules of Europe).
    """
    if new[1] < -SAFE_BRAKING:
        return False
    others = new[1] - new[0] if to_left else old[1] - old[0]
    return own[1] - own[0] + POLITENESS * others > THRESHOLD + (BIAS if to_left else -BIAS)


def is_clear(track: Track, way: float, behind: float, ahead: float) -> bool:
    """Return whether a stretch of a track is shared with no other, and the track goes on beyond it.

    It reaches from `behind` before to `ahead` beyond a way [m].
    """
    stops = track.signal is not None or bool(track.yield_to)
    if way - behind < 0.0 or way + ahead + (_ROOM if stops else 1.0) > track.length:
        return False
    return not any(first < way + ahead + _ROOM and last > way - behind for _, first, last, _ in track.zones)


def has_room(gap_ahead: float, gap_behind: float) -> bool:
    """Return whether bodies ahead and behind leave room to come between them [m]."""
    return gap_ahead > NEAREST and gap_behind > NEAREST


def changed_line(tracks: Sequence[Track], driver: Legs) -> tuple[Array, Array]:
    """Return the points (N, 3) [m] of a way with lane changes, and the driver's way at each (N,) [m]."""
    changes = {change.place: change for change in driver.changes}
    points, ways = [], []
    for place, index in enumerate(driver.route):
        track, start = tracks[index], driver.starts[place]
        before, after = changes.get(place - 1), changes.get(place)
        low = start if before is None else before.end
        high = start + track.length if after is None else after.start
        inner = track.chord + start
        own = _dense(np.concatenate([[low], inner[(inner > low + 0.05) & (inner < high - 0.05)], [high]]))
        points.append(track.at(own - start))
        ways.append(own)
        if after is not None:
            between = np.linspace(after.start, after.end, max(int(after.length), 4) + 1)[1:-1]
            share = quintic_step((between - after.start) / after.length)[:, None]
            other = tracks[driver.route[place + 1]].at(between - driver.starts[place + 1])
            points.append((1.0 - share) * track.at(between - start) + share * other)
            ways.append(between)
    line, along = np.concatenate(points), np.concatenate(ways)
    apart = np.concatenate([[True], np.linalg.norm(np.diff(line, axis=0), axis=1) > 0.02])
    return line[apart], along[apart]


def _dense(ways: Array) -> Array:
    """Return ways with more between those that are far apart: a spline through uneven ones would swing."""
    counts = np.maximum(np.ceil(np.diff(ways) / _APART).astype(int), 1)
    parts = [np.linspace(a, b, n, endpoint=False) for a, b, n in zip(ways[:-1], ways[1:], counts, strict=True)]
    return np.concatenate([*parts, ways[-1:]])
