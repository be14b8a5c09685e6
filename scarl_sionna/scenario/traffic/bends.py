"""How fast bends of a route are taken: from the curvature of the path that the rear axle follows."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from scarl_sionna.scenario.motion.bodies import ActorBody
from scarl_sionna.scenario.motion.paths import LateralShift, SmoothPath
from scarl_sionna.scenario.motion.routes import smoothing_of

from .lane_changes import Legs, changed_line
from .tracks import Track

Array = npt.NDArray[np.float64]

LATERAL = 2.0
"""Lateral acceleration that drivers keep below in bends [m/s^2]."""
_PLANNED = 1.8
"""What they aim at [m/s^2]: speeds are kept to within some per cent."""
_CHANGE = 1.5
"""Acceleration along the way while a bend is entered or left [m/s^2]: it moves the body's middle to the side, too."""
_CRAWL, _STEP = 1.0, 0.5
"""Speed at which any bend is taken, on wheels and on foot [m/s]."""
_STEPS = 2.0
"""How much farther apart the knots of walkers' paths are than elsewhere: a lane's corner is taken in some steps."""
_ASIDE = 2.0
"""Way on which people go aside where one walkway continues a wider one, half of it on each [m]."""
_SAMPLE = 0.5
"""Distance of the places at which a bend is looked at [m]."""
_MORE = 12.0
"""How much longer than what is driven a path is at both ends [m]."""
_ROOM = 5.0
"""Step of the lengths by which paths go on straight before the first and after the last point [m]."""


class RoutePaths:
    """The smooth paths along routes of tracks, each made once."""

    def __init__(self, tracks: Sequence[Track]) -> None:
        self._tracks = tracks
        self._known: dict[tuple[tuple[int, ...], float, float], SmoothPath] = {}

    def path(self, route: Sequence[int], body: ActorBody) -> SmoothPath:
        """Return the path along tracks that a body takes, with room for it before the start and behind the end."""
        room = _ROOM * float(np.ceil((body.length + 1.0) / _ROOM))
        key = tuple(route), smoothing_of(body) * (1.0 if body.wheelbase > 0.0 else _STEPS), room
        if key not in self._known:
            tracks = [self._tracks[index] for index in route]
            path = SmoothPath(line_of(tracks)[0], key[1], (room, room), -tracks[0].right, _shifts(tracks))
            self._known[key] = path.of_lanes()
        return self._known[key]

    def changed(self, driver: Legs, body: ActorBody, span: tuple[float, float]) -> tuple[SmoothPath, Array, Array]:
        """Return the path of a way with lane changes, and pairs of the driver's way and the distance along its points.

        Each of shape (N,) [m]; `span` are the first and the last way of the rear axle [m].
        """
        points, ways = changed_line(self._tracks, driver)
        first, last = np.searchsorted(ways, [span[0] - _MORE, span[1] + body.length + _MORE])
        kept = slice(max(int(first) - 1, 0), int(last) + 1)
        points, ways = points[kept], ways[kept]
        room = _ROOM * float(np.ceil((body.length + 1.0) / _ROOM))
        along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
        return SmoothPath(points, smoothing_of(body), (room, room)), ways, along

    def lateral(self, track: int, body: ActorBody, fronts: Array, speed: float) -> float:
        """Return the largest lateral acceleration [m/s^2] at a speed [m/s] on fronts (N,) [m] of a track."""
        return float(_PLANNED * (speed / bend_speeds(self.path([track], body), body, fronts).min()) ** 2)


def _shifts(tracks: Sequence[Track]) -> list[LateralShift]:
    """Return how a path keeps farther to the right, or less far, where walkways of other widths follow."""
    joints = np.cumsum([track.length for track in tracks])
    return [
        LateralShift(float(joint) - _ASIDE / 2.0, _ASIDE, one.right - other.right)
        for joint, one, other in zip(joints, tracks, tracks[1:], strict=False)
        if one.right != other.right
    ]


def along_line(way: Array, ways: Array, along: Array) -> Array:
    """Return distances along a line of points for ways of a driver, straight on beyond its ends [m]."""
    return np.interp(way, ways, along) + np.minimum(way - ways[0], 0.0) + np.maximum(way - ways[-1], 0.0)


def line_of(route: Sequence[Track]) -> tuple[Array, Array]:
    """Return the points of a route without the doubles at its joints, and the way along the tracks of each."""
    points, chord, start = [route[0].points], [route[0].chord], route[0].length
    for track in route[1:]:
        points.append(track.points[1:])
        chord.append(track.chord[1:] + start)
        start += track.length
    return np.concatenate(points), np.concatenate(chord)


def bend_speeds(path: SmoothPath, body: ActorBody, fronts: Array) -> Array:
    r"""Return the largest speed [m/s] at which a body takes the bends of a path at ease.

    Parameters
    ----------
    path : SmoothPath
        Of the rear axle.
    body : ActorBody
    fronts : ndarray of float64, shape (N,)
        Ways of the body's front along the points of the path, 1 m apart [m].

    Notes
    -----
    With the curvature k of the path at the rear axle and the distance l from there to the body's middle, the middle
    is accelerated to the side by :math:`(k + l k') v^2 + l k \dot v`. The tightest place within 1 m counts.
    """
    behind = body.length / 2.0 - body.rear_axle
    chord = np.arange(fronts[0] - behind - 1.0, fronts[-1] - behind + 1.0 + _SAMPLE, _SAMPLE)
    low, high = path.bounds
    ways = np.clip(path.way_of(chord) + np.minimum(chord, 0.0), low, high)
    first, second = path.at(ways, 1), path.at(ways, 2)
    bend = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
    lever = -body.rear_axle
    tightest = np.maximum(np.abs(bend), np.abs(bend + lever * np.gradient(bend, _SAMPLE)))
    left = np.maximum(_PLANNED - _CHANGE * lever * np.abs(bend), 0.3 * _PLANNED)
    speed = np.sqrt(left / np.maximum(tightest, 1e-6))
    reach = round(1.0 / _SAMPLE)
    widest = np.lib.stride_tricks.sliding_window_view(speed, 2 * reach + 1).min(1)
    least = _CRAWL if body.wheelbase > 0.0 else _STEP
    return np.maximum(np.interp(fronts - behind, chord[reach : reach + len(widest)], widest), least)
