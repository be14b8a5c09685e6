"""Lanes of a scene: centre lines in the direction of travel, successors, right of way, signals, parking places.

Plain data that is checked once, when it is made: what drives on the lanes is planned in :mod:`scarl_sionna.scenario`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ParameterRangeError, UnknownNameError
from scarl_sionna.core.prompt.describe import Described

Array = npt.NDArray[np.float64]

LANE_KINDS = ("drive", "cycle", "walk", "parking")
"""What a lane is for."""
MAX_GAP = 0.1
"""Largest distance between the end of a lane and the start of one that continues it [m]."""
MAX_HEADING_STEP = np.radians(5.0)
"""Largest change of heading where a lane continues another [rad]; people on foot may turn at a corner."""
MAX_WIDTH, MAX_SPEED = 30.0, 70.0
"""Above these a width [m] or a speed [m/s] was most likely written in another unit."""
SIGNAL_COLORS = ("red", "amber", "green")
"""Lenses of a traffic light."""
AMBER, RED_AMBER = 3.0, 1.0
"""How long a light shows amber after green at 50 km/h, and red and amber before it [s] (RiLSA 2015)."""
_MAX_TURN = np.radians(50.0)
"""Largest turn between two segments of a centre line that is still a bend and not a corner [rad]."""


@dataclass(frozen=True, eq=False, repr=False)
class Lane(Described, units={"points": "m", "width": "m", "speed": "m/s"}):
    """One lane.

    Attributes
    ----------
    name : str
    points : ndarray of float64, shape (N, 3)
        Centre line in the direction of travel, on the ground, N >= 2, at most 2 m apart in bends [m, world].
    kind : str
        One of `LANE_KINDS`.
    width : float
        [m]
    speed : float
        Speed limit [m/s].
    next : tuple of str
        Lanes that continue it.
    left : str or None
        Neighbour to the left of the same direction, into which a vehicle may change (and back).
    yield_to : tuple of str
        Lanes whose vehicles have the right of way over those at the end of this one.
    signal : str or None
        Signal group that stops the end of this lane.

    Raises
    ------
    ParameterRangeError
        If a value is not finite or outside its range, or the centre line stands still or has a corner.
    UnknownNameError
        If the kind is unknown.
    """

    name: str
    points: Array
    kind: str = "drive"
    width: float = 3.25
    speed: float = 13.9
    next: tuple[str, ...] = ()
    left: str | None = None
    yield_to: tuple[str, ...] = ()
    signal: str | None = None

    def __post_init__(self) -> None:
        where = f"lanes.{self.name}"
        if not isinstance(self.name, str) or not self.name:
            raise ParameterRangeError("lanes.name", repr(self.name), "a word")
        if self.kind not in LANE_KINDS:
            raise UnknownNameError(f"kind of lane '{self.name}'", str(self.kind), LANE_KINDS)
        points = _points(self.points, f"{where}.points")
        object.__setattr__(self, "points", points)
        for key, top, unit in (("width", MAX_WIDTH, "m"), ("speed", MAX_SPEED, "m/s")):
            object.__setattr__(self, key, _number(getattr(self, key), f"{where}.{key}", 0.0, top, unit))
        for key in ("next", "yield_to"):
            object.__setattr__(self, key, _names(getattr(self, key), f"{where}.{key}"))
        steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
        if steps.min() < 1e-3:
            index = int(steps.argmin())
            raise ParameterRangeError(
                f"{where}.points", f"points {index} and {index + 1} coincide", "points 1 mm or more apart"
            )
        turns = np.abs(_turn(self.chord_headings[1:] - self.chord_headings[:-1]))
        if self.kind != "walk" and turns.size and turns.max() > _MAX_TURN:
            index = int(turns.argmax()) + 1
            raise ParameterRangeError(
                f"{where}.points",
                f"a turn of {np.degrees(turns.max()):.0f} deg at point {index}",
                f"at most {np.degrees(_MAX_TURN):.0f} deg between two segments",
                "put the points of a bend 2 m apart or closer",
            )

    @cached_property
    def distances(self) -> Array:
        """Length of the centre line up to each point, shape (N,) [m]."""
        return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(self.points, axis=0), axis=1))])

    @property
    def length(self) -> float:
        """Length of the centre line [m]."""
        return float(self.distances[-1])

    @cached_property
    def chord_headings(self) -> Array:
        """Heading of each segment, shape (N - 1,) [rad]."""
        steps = np.diff(self.points[:, :2], axis=0)
        return np.arctan2(steps[:, 1], steps[:, 0])

    @cached_property
    def end_headings(self) -> tuple[float, float]:
        """Heading of the tangent at the first and at the last point [rad].

        That of the circle through the outer three points.
        """
        chords, steps = self.chord_headings, np.diff(self.distances)
        if chords.size == 1:
            return float(chords[0]), float(chords[0])
        first = chords[0] - _turn(chords[1] - chords[0]) * steps[0] / (steps[0] + steps[1])
        last = chords[-1] + _turn(chords[-1] - chords[-2]) * steps[-1] / (steps[-1] + steps[-2])
        return float(first), float(last)

    def at(self, distance: npt.ArrayLike) -> Array:
        """Return points (..., 3) [m, world] of the polyline at distances [m] from its start, held at its ends."""
        way = np.asarray(distance, dtype=np.float64)
        return np.stack([np.interp(way, self.distances, self.points[:, axis]) for axis in range(3)], axis=-1)

    def nearest(self, point: npt.ArrayLike) -> tuple[float, float]:
        """Return the distance along the lane and in plan [m] of its point nearest to one, shape (2,) or (3,)."""
        target = np.asarray(point, dtype=np.float64)[:2]
        start, step = self.points[:-1, :2], np.diff(self.points[:, :2], axis=0)
        share = np.clip(((target - start) * step).sum(1) / np.maximum((step * step).sum(1), 1e-12), 0.0, 1.0)
        away = np.linalg.norm(start + share[:, None] * step - target, axis=1)
        index = int(away.argmin())
        return float(self.distances[index] + share[index] * (self.distances[index + 1] - self.distances[index])), float(
            away[index]
        )


@dataclass(frozen=True, eq=False, repr=False)
class ParkingPlace(Described, units={"position": "m", "yaw_deg": "deg", "length": "m", "width": "m"}):
    """A place of one parked car.

    `position` (3,) of its middle on the ground [m, world], `yaw_deg` [deg], `length`, `width` [m].

    Raises
    ------
    ParameterRangeError
        If the position is not three finite coordinates, or another value not a finite number.
    """

    position: Array
    yaw_deg: float = 0.0
    length: float = 5.0
    width: float = 2.2

    def __post_init__(self) -> None:
        position = _floats(self.position, "parking.position")
        if position.shape != (3,) or not np.isfinite(position).all():
            raise ParameterRangeError("parking.position", self.position, "three finite coordinates [m]")
        object.__setattr__(self, "position", _frozen(position))
        object.__setattr__(self, "yaw_deg", _number(self.yaw_deg, "parking.yaw_deg", -360.0, 360.0, "deg", closed=True))
        object.__setattr__(self, "length", _number(self.length, "parking.length", 0.0, 30.0, "m"))
        object.__setattr__(self, "width", _number(self.width, "parking.width", 0.0, 10.0, "m"))


@dataclass(frozen=True, eq=False, repr=False)
class Signals(Described, units={"cycle": "s"}):
    """Fixed-time signals: `cycle` [s], and for each group the start and the end of green within it [s].

    `stated` gives for some groups times [s] and what is lit from then on, of `SIGNAL_COLORS`; the plan holds before.

    Raises
    ------
    ParameterRangeError
        If a green does not lie within the cycle.
    """

    cycle: float
    green: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    stated: Mapping[str, tuple[tuple[float, frozenset[str]], ...]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "cycle", _number(self.cycle, "signals.cycle", 0.0, 600.0, "s"))
        spans = {}
        for group, span in dict(self.green).items():
            where = f"signals.green.{group}"
            values = _floats(span, where)
            if values.shape != (2,) or not 0.0 <= values[0] < values[1] <= self.cycle:
                raise ParameterRangeError(
                    where, list(np.atleast_1d(values)), f"start < end, both within 0 to {self.cycle:g} s"
                )
            spans[group] = (float(values[0]), float(values[1]))
        object.__setattr__(self, "green", spans)

    def is_green(self, group: str, time: float) -> bool:
        """Return whether a group shows green at a time [s]."""
        start, stop = self._span(group)
        now = self._stated(group, time)
        return start <= time % self.cycle < stop if now is None else "green" in now

    def shown(self, group: str, time: float) -> frozenset[str]:
        """Return which of `SIGNAL_COLORS` a group shows at a time [s]: red, red and amber, green, amber."""
        start, stop = self._span(group)
        now = self._stated(group, time)
        if now is not None:
            return now
        since = (time - start) % self.cycle
        if since < stop - start:
            return frozenset({"green"})
        if since < stop - start + AMBER:
            return frozenset({"amber"})
        return frozenset({"red", "amber"} if since >= self.cycle - RED_AMBER else {"red"})

    def green_left(self, group: str, time: float) -> float:
        """Return for how long a group stays green from a time on [s]; 0 where it is red."""
        start, stop = self._span(group)
        later = [(since, shown) for since, shown in self.stated.get(group, ()) if since > time]
        if not self.is_green(group, time):
            return 0.0
        if self._stated(group, time) is not None:
            return min((since - time for since, shown in later if "green" not in shown), default=float("inf"))
        left = float("inf") if stop - start >= self.cycle else stop - time % self.cycle
        return min(left, later[0][0] - time) if later and "green" not in later[0][1] else left

    def _stated(self, group: str, time: float) -> frozenset[str] | None:
        """Return what is stated of a group at a time [s]; None where the plan holds."""
        found = None
        for since, shown in self.stated.get(group, ()):
            if since <= time:
                found = shown
        return found

    def _span(self, group: str) -> tuple[float, float]:
        if group not in self.green:
            raise UnknownNameError("signal group", group, self.green)
        return self.green[group]


@dataclass(frozen=True, eq=False, repr=False)
class LaneNetwork(Described):
    """Lanes of a scene that fit together.

    Parameters
    ----------
    lanes : sequence of Lane
        With names of their own.
    parking : sequence of ParkingPlace
    signals : Signals or None
        Needed where a lane names a signal group.

    Raises
    ------
    ParameterRangeError
        If a name stands twice, or lanes that continue each other are more than 0.1 m or 5 deg apart, or neighbours are
        not side by side.
    UnknownNameError
        If a lane or a signal group that is named does not exist.
    """

    lanes: tuple[Lane, ...]
    parking: tuple[ParkingPlace, ...] = ()
    signals: Signals | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "lanes", tuple(self.lanes))
        object.__setattr__(self, "parking", tuple(self.parking))
        names = [lane.name for lane in self.lanes]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ParameterRangeError(
                "lanes.name", twice[0], "every name once", f"'{twice[0]}' stands {names.count(twice[0])} times"
            )
        groups = () if self.signals is None else tuple(self.signals.green)
        for lane in self.lanes:
            for key, known in (("next", names), ("yield_to", names), ("left", names), ("signal", groups)):
                value = getattr(lane, key)
                for name in (value,) if isinstance(value, str) else value or ():
                    if name not in known:
                        raise UnknownNameError(f"name in lanes.{lane.name}.{key}", name, known)
            for name in lane.next:
                check_joint(lane, self[name])
            if lane.left is not None:
                check_neighbour(lane, self[lane.left])

    @cached_property
    def _by_name(self) -> dict[str, Lane]:
        return {lane.name: lane for lane in self.lanes}

    def __getitem__(self, name: str) -> Lane:
        if name not in self._by_name:
            raise UnknownNameError("lane", name, self._by_name)
        return self._by_name[name]

    def __contains__(self, name: object) -> bool:
        return name in self._by_name

    def __iter__(self) -> Iterator[str]:
        """Names of the lanes, as of a mapping; the lanes themselves are `lanes`."""
        return iter(self._by_name)

    def of_kind(self, *kinds: str) -> tuple[Lane, ...]:
        """Return the lanes of some kinds, in the order of the network."""
        return tuple(lane for lane in self.lanes if lane.kind in kinds)

    def before(self, name: str) -> tuple[Lane, ...]:
        """Return the lanes that a lane continues."""
        return tuple(lane for lane in self.lanes if name in lane.next)

    def right_of(self, name: str) -> Lane | None:
        """Return the lane whose left neighbour a lane is."""
        return next((lane for lane in self.lanes if lane.left == name), None)

    def check_route(self, names: Sequence[str]) -> tuple[Lane, ...]:
        """Return the lanes of a route, after a check that each one continues the one before it.

        Raises
        ------
        ParameterRangeError
            If there is no lane.
        UnknownNameError
            If a lane is unknown, or does not continue the one before it.
        """
        lanes = tuple(self[name] for name in names)
        if not lanes:
            raise ParameterRangeError("lanes", list(names), "one lane or more")
        for first, second in pairwise(lanes):
            if second.name not in first.next:
                raise UnknownNameError(f"lane after '{first.name}'", second.name, first.next)
        return lanes


def lanes_from_tables(
    tables: Iterable[Mapping[str, Any]],
    parking: Iterable[Mapping[str, Any]] = (),
    signals: Mapping[str, Any] | None = None,
) -> LaneNetwork:
    """Return the network of the ``[[lanes]]``, ``[[parking]]`` and ``[signals]`` of a scene.toml.

    Raises
    ------
    ParameterRangeError, UnknownNameError
        As `Lane`, `ParkingPlace`, `Signals` and `LaneNetwork` do, and where a key is missing or unknown.
    """
    lanes = []
    for index, table in enumerate(tables):
        where = f"lanes.{table.get('name', index)}"
        lanes.append(
            Lane(
                **_keys(
                    table, where, ("name", "points"), ("kind", "width", "speed", "next", "left", "yield_to", "signal")
                )
            )
        )
    places = [
        ParkingPlace(**_keys(table, f"parking.{index}", ("position",), ("yaw_deg", "length", "width")))
        for index, table in enumerate(parking)
    ]
    lights = Signals(**_keys(signals, "signals", ("cycle", "green"), ())) if signals else None
    return LaneNetwork(tuple(lanes), tuple(places), lights)


def _keys(table: Mapping[str, Any], where: str, required: tuple[str, ...], optional: tuple[str, ...]) -> dict[str, Any]:
    for key in required:
        if key not in table:
            raise ParameterRangeError(f"{where}.{key}", "missing", "keys " + ", ".join(required))
    for key in table:
        if key not in required + optional:
            raise UnknownNameError(f"key of {where}", str(key), required + optional)
    return dict(table)


def _floats(value: object, name: str) -> Array:
    try:
        return np.array(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ParameterRangeError(name, str(value)[:80], "numbers") from error


def _frozen(array: Array) -> Array:
    array.setflags(write=False)
    return array


def _points(value: object, name: str) -> Array:
    points = _floats(value, name)
    if points.ndim != 2 or points.shape[0] < 2 or points.shape[1] != 3:
        raise ParameterRangeError(name, f"shape {points.shape}", "two or more points [x, y, z] [m]")
    if not np.isfinite(points).all():
        index = int(np.flatnonzero(~np.isfinite(points).all(1))[0])
        raise ParameterRangeError(f"{name}[{index}]", points[index].tolist(), "finite coordinates [m]")
    return _frozen(points)


def _number(value: object, name: str, low: float, high: float, unit: str, closed: bool = False) -> float:
    allowed = f"{'' if closed else 'above '}{low:g} to {high:g} {unit}"
    number = _floats(value, name)
    if number.shape != () or not (low <= float(number) if closed else low < float(number)) or not float(number) <= high:
        raise ParameterRangeError(name, value, allowed, f"the unit is {unit}")
    return float(number)


def _names(value: object, name: str) -> tuple[str, ...]:
    listed = (value,) if isinstance(value, str) or not isinstance(value, Iterable) else tuple(value)
    if isinstance(value, str) or not all(isinstance(one, str) for one in listed):
        raise ParameterRangeError(name, repr(value), "a list of names")
    return listed


def _turn(angle: npt.ArrayLike) -> Array:
    """Return angles [rad] wrapped to -pi to pi."""
    return np.asarray((np.asarray(angle) + np.pi) % (2.0 * np.pi) - np.pi)


def check_joint(lane: Lane, following: Lane) -> None:
    """Raise `ParameterRangeError` where a lane does not continue another."""
    where = f"lanes.{lane.name}.next"
    if lane.kind != following.kind and {lane.kind, following.kind} != {"drive", "parking"}:
        raise ParameterRangeError(
            where, f"'{following.name}' of kind '{following.kind}'", f"lanes of kind '{lane.kind}'"
        )
    gap = float(np.linalg.norm(following.points[0] - lane.points[-1]))
    if gap > MAX_GAP:
        raise ParameterRangeError(where, f"a gap of {gap:.3g} m to '{following.name}'", f"at most {MAX_GAP:g} m")
    tangents = abs(float(_turn(following.end_headings[0] - lane.end_headings[1])))
    chords = abs(float(_turn(following.chord_headings[0] - lane.chord_headings[-1])))
    step = min(tangents, chords)
    if lane.kind != "walk" and step > MAX_HEADING_STEP:
        raise ParameterRangeError(where, f"a kink of {np.degrees(step):.1f} deg to '{following.name}'", "at most 5 deg")


def check_neighbour(lane: Lane, left: Lane) -> None:
    """Raise `ParameterRangeError` where a lane's left neighbour is not beside it."""
    middle = lane.at(lane.length / 2.0)
    along, away = left.nearest(middle)
    headings = [
        one.chord_headings[np.searchsorted(one.distances[1:-1], way)]
        for one, way in ((lane, lane.length / 2.0), (left, along))
    ]
    side = np.array([-np.sin(headings[0]), np.cos(headings[0])]) @ (left.at(along) - middle)[:2]
    if away > lane.width + left.width or abs(float(_turn(headings[1] - headings[0]))) > np.radians(30.0) or side <= 0.0:
        raise ParameterRangeError(
            f"lanes.{lane.name}.left",
            f"'{left.name}', {away:.3g} m away",
            "a lane beside it on the left, of the same direction",
        )
