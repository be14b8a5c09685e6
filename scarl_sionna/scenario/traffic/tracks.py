"""Lanes as traffic drives them.

Run-ins and run-outs at open ends, both directions of walkways, and where ways cross or merge.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from scarl_sionna.scene.lanes import Lane, LaneNetwork

Array = npt.NDArray[np.float64]

_SAMPLE = 1.0
"""Distance of the points at which ways are compared [m]."""
_MARGIN = 0.25
"""Room that is kept free beside a body where ways cross [m]."""
_COMFORTABLE_TURN = 2.0
"""Lateral acceleration of a driver who takes a bend at ease [m/s^2]."""


@dataclass(eq=False)
class Track:
    """One way to go: a lane, a walkway in one direction, or the straight continuation of a lane beyond the scene.

    `lane` is the lane's name, None beyond the scene; `zones` holds (zone, first, last way [m], whether both tracks
    merge there) in the order of travel; `right` is how far to the right of the points one keeps [m]; `beside` are the
    tracks of the same direction to the left and to the right.
    """

    points: Array
    kind: str
    width: float
    speed: float
    lane: str | None
    signal: str | None = None
    next: list[int] = field(default_factory=list)
    yield_to: list[int] = field(default_factory=list)
    before: list[int] = field(default_factory=list)
    zones: list[tuple[int, float, float, bool]] = field(default_factory=list)
    length: float = 0.0
    right: float = 0.0
    beside: tuple[int | None, int | None] = (None, None)

    def __post_init__(self) -> None:
        self.chord = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(self.points, axis=0), axis=1))])
        self.length = float(self.chord[-1])

    def at(self, way: npt.ArrayLike) -> Array:
        """Return points [m] at ways [m] along the track."""
        return np.stack(
            [np.interp(np.asarray(way, dtype=np.float64), self.chord, self.points[:, axis]) for axis in range(3)],
            axis=-1,
        )

    def nearest(self, point: Array) -> tuple[float, float]:
        """Return the way along the track and the distance in plan [m] of its point nearest to one."""
        start, step = self.points[:-1, :2], np.diff(self.points[:, :2], axis=0)
        share = np.clip(((point[:2] - start) * step).sum(1) / (step * step).sum(1), 0.0, 1.0)
        away = np.linalg.norm(start + share[:, None] * step - point[:2], axis=1)
        index = int(away.argmin())
        return float(self.chord[index] + share[index] * (self.chord[index + 1] - self.chord[index])), float(away[index])


@dataclass(eq=False)
class TrackGraph:
    """All tracks of a network; `sides` are the two tracks of each place that tracks share, by its zone."""

    tracks: list[Track]
    sides: list[tuple[int, int]] = field(default_factory=list)

    def of_kind(self, kinds: Iterable[str], inside: bool = False) -> list[int]:
        """Return the indices of tracks of some kinds; `inside`: only those in the scene."""
        wanted = set(kinds)
        return [
            index
            for index, one in enumerate(self.tracks)
            if one.kind in wanted and (one.lane is not None or not inside)
        ]


def track_graph(
    network: LaneNetwork, run_out: float, half_width: float, longest: float, on_foot: bool = True
) -> TrackGraph:
    """Return the tracks of a network.

    Parameters
    ----------
    network : LaneNetwork
    run_out : float
        Seconds at the speed limit by which lanes with an open end are continued straight beyond the scene [s].
    half_width, longest : float
        Half the width, and the length of the largest vehicle [m].
    on_foot : bool
        Whether there are people on walkways.
    """
    graph = TrackGraph([])
    index_of: dict[tuple[str, bool], int] = {}
    for lane in network.lanes:
        if lane.kind == "walk":
            both = lane.width >= 1.4 and not any(_is_reverse(lane, other) for other in network.lanes)
            for backwards in (False, True) if on_foot and both else (False,) if on_foot else ():
                index_of[lane.name, backwards] = len(graph.tracks)
                graph.tracks.append(_walkway(lane, backwards))
        elif lane.kind in ("drive", "cycle"):
            index_of[lane.name, False] = len(graph.tracks)
            graph.tracks.append(Track(lane.points, lane.kind, lane.width, lane.speed, lane.name, lane.signal))
    for lane in network.lanes:
        for name in lane.next:
            for first, second in (((lane.name, False), (name, False)), ((name, True), (lane.name, True))):
                if first in index_of and second in index_of:
                    graph.tracks[index_of[first]].next.append(index_of[second])
        if (lane.name, False) in index_of:
            graph.tracks[index_of[lane.name, False]].yield_to = [
                index_of[one, False] for one in lane.yield_to if (one, False) in index_of
            ]
    for index in range(len(graph.tracks)):
        if graph.tracks[index].kind != "walk":
            _continue(graph, index, run_out)
    for index, track in enumerate(graph.tracks):
        for following in track.next:
            graph.tracks[following].before.append(index)
    for lane in network.lanes:
        if lane.kind == "drive" and (str(lane.left), False) in index_of:
            _put_beside(graph, index_of[str(lane.left), False], index_of[lane.name, False])
    _find_zones(graph, half_width + _MARGIN, longest)
    return graph


def _is_reverse(lane: Lane, other: Lane) -> bool:
    """Return whether another lane is the same walkway in the opposite direction."""
    ends = np.linalg.norm(lane.points[[0, -1]] - other.points[[-1, 0]], axis=1)
    return other.kind == "walk" and bool(ends.max() < 0.5) and other.nearest(lane.at(lane.length / 2.0))[1] < 0.5


def _walkway(lane: Lane, backwards: bool) -> Track:
    """Return a walkway in one direction: people keep to the right."""
    points = lane.points[::-1] if backwards else lane.points
    chord = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    count = max(int(np.ceil(chord[-1])), 2)
    points = np.stack(
        [np.interp(np.linspace(0.0, chord[-1], count), chord, points[:, axis]) for axis in range(3)], axis=1
    )
    right = min(0.25 * lane.width, 0.6) if lane.width >= 1.4 else 0.0
    return Track(points, "walk", 0.7, lane.speed, lane.name, None if backwards else lane.signal, right=right)


def _continue(graph: TrackGraph, index: int, run_out: float) -> None:
    """Add straight, level tracks beyond the open ends of a lane."""
    track = graph.tracks[index]
    length = run_out * track.speed + 30.0
    entered = any(index in other.next for other in graph.tracks)
    for is_open, outer, inner, sign in ((not entered, 0, 1, -1.0), (not track.next, -1, -2, 1.0)):
        if not is_open:
            continue
        step = (track.points[outer] - track.points[inner]) * [1.0, 1.0, 0.0]
        far = track.points[outer] + length * step / np.linalg.norm(step)
        ends = np.stack([track.points[outer], far])[:: int(sign)]
        graph.tracks.append(Track(ends, track.kind, track.width, track.speed, None))
        (track.next if sign > 0 else graph.tracks[-1].next).append(len(graph.tracks) - 1 if sign > 0 else index)


def _put_beside(graph: TrackGraph, left: int, right: int) -> None:
    """Note that two tracks lie side by side, and so do their continuations beyond the scene."""
    tracks = graph.tracks
    pairs = [(left, right)]
    for ways in ("before", "next"):
        beyond = [[one for one in getattr(tracks[index], ways) if tracks[one].lane is None] for index in (left, right)]
        pairs += zip(*beyond, strict=False)
    for one, other in pairs:
        tracks[one].beside = tracks[one].beside[0], other
        tracks[other].beside = one, tracks[other].beside[1]


def curve_speed(points: Array, chord: Array, ways: Array) -> Array:
    """Return the speed [m/s] at which bends of a polyline are taken at ease, at rising ways (N,) [m].

    Infinite where straight.
    """
    line = np.stack([np.interp(ways, chord, points[:, axis]) for axis in range(2)], axis=1)
    reach = max(int(round(3.0 / max(ways[1] - ways[0], 1e-6))), 1)  # noqa: RUF046  (a NumPy number)
    bend = np.zeros(len(ways))
    if len(ways) > 2 * reach:
        first, second = line[reach:-reach] - line[: -2 * reach], line[2 * reach :] - line[reach:-reach]
        cross = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
        sizes = np.linalg.norm(first, axis=1) * np.linalg.norm(second, axis=1) * np.linalg.norm(first + second, axis=1)
        bend[reach:-reach] = 2.0 * np.abs(cross) / np.maximum(sizes, 1e-9)  # Menger curvature
    return np.sqrt(_COMFORTABLE_TURN / np.maximum(bend, 1e-6))


def _find_zones(graph: TrackGraph, half_width: float, longest: float) -> None:
    """Find the stretches that two tracks share, and give each pair of them a zone."""
    tracks = graph.tracks
    ways = [np.linspace(0.0, track.length, max(int(np.ceil(track.length / _SAMPLE)), 2) + 1) for track in tracks]
    lines = [track.at(way) for track, way in zip(tracks, ways, strict=True)]
    headings = [np.arctan2(*np.gradient(line[:, :2], axis=0).T[::-1]) for line in lines]
    reaches = [_reach(track, way, half_width, longest) for track, way in zip(tracks, ways, strict=True)]
    trees = [cKDTree(line) for line in lines]
    lows, highs = (np.array([edge(line, axis=0) for line in lines]).reshape(-1, 3) for edge in (np.min, np.max))
    top = max((float(reach.max()) for reach in reaches), default=0.0)
    for first in range(len(tracks)):
        near = np.all((lows[first] - 2.0 * top <= highs) & (highs[first] + 2.0 * top >= lows), axis=1)
        for second in np.flatnonzero(near[first + 1 :]) + first + 1:
            if tracks[first].kind == "walk" == tracks[second].kind and tracks[first].lane == tracks[second].lane:
                continue
            pairs = trees[first].sparse_distance_matrix(trees[second], 2.0 * top, output_type="ndarray")
            if not pairs.size:
                continue
            one, other, away = pairs["i"], pairs["j"], pairs["v"]
            allowed = reaches[first][one] + reaches[second][other]
            parallel = np.abs(np.sin(headings[first][one] - headings[second][other])) < 0.2
            beside = (tracks[first].width + tracks[second].width) / 2.0 - 0.25
            shared = away < np.where(parallel, np.minimum(allowed, beside), allowed)
            if (
                tracks[first].kind == tracks[second].kind == "walk"
            ):  # those who come towards each other keep to the right
                shared &= np.cos(headings[first][one] - headings[second][other]) > -0.8
            _add_zones(graph, ways, (first, int(second)), one[shared], other[shared])


def _reach(track: Track, way: Array, half_width: float, longest: float) -> Array:
    """Return how far a body reaches to the side of a track [m].

    Its half width, and more where a long one turns or people keep to the right.
    """
    if track.kind == "walk":
        return np.full(len(way), 0.45 + track.right)
    if track.kind == "cycle":
        return np.full(len(way), 0.6)
    radius = curve_speed(track.points, track.chord, way) ** 2 / _COMFORTABLE_TURN
    return half_width + np.minimum(longest**2 / (8.0 * radius), 1.5)


def _add_zones(graph: TrackGraph, ways: list[Array], pair: tuple[int, int], one: Array, other: Array) -> None:
    """Add a zone for each contiguous stretch of a track that is close to another one.

    `ways` [m] are those of the points of each track of the graph; `one` and `other` are the points of the pair's tracks
    that are close.
    """
    first, second = pair
    touched = np.unique(one)
    if not touched.size:
        return
    a, b = graph.tracks[first], graph.tracks[second]
    for run in np.split(touched, np.flatnonzero(np.diff(touched) > 3) + 1):
        partner = other[np.isin(one, run)]
        span_a = (float(ways[first][run[0]]), float(ways[first][run[-1]]))
        span_b = (float(ways[second][partner.min()]), float(ways[second][partner.max()]))
        if second in a.next and span_a[1] > a.length - 1.5 and span_b[0] < 1.5:
            continue
        if first in b.next and span_b[1] > b.length - 1.5 and span_a[0] < 1.5:
            continue
        merging = bool(set(a.next) & set(b.next)) and span_a[1] > a.length - 1.5 and span_b[1] > b.length - 1.5
        for track, span in ((a, span_a), (b, span_b)):
            track.zones.append((len(graph.sides), max(span[0] - 0.5, 0.0), min(span[1] + 0.5, track.length), merging))
            track.zones.sort(key=lambda zone: zone[1])
        graph.sides.append(pair)
