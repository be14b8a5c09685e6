"""All drivers together: who follows whom, signals, right of way, lane changes, and one at a time where ways cross.

References
----------
.. [1] Highway Capacity Manual, 2010, ch. 21: a critical headway of 4.1 to 5.2 s of drivers who enter a roundabout.
"""

from __future__ import annotations

import math
from bisect import insort
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from scarl_sionna.scene.lanes import Signals

from . import on_foot
from .bends import RoutePaths
from .driver import FIRM_BRAKING, Driver
from .lane_changes import (
    DURATION,
    GIVEN_HEADWAY,
    GIVEN_TIME,
    NEAREST,
    PAUSE,
    SHORTEST,
    SLOWEST,
    STRAIGHT,
    TOO_FAST,
    has_room,
    is_clear,
    is_wanted,
)
from .tracks import Track, TrackGraph

STEP = 0.1
"""Step of the car-following model [s]."""
CRITICAL_HEADWAY = 4.5
"""Time that a vehicle with the right of way must be away for another one to go first [s]."""
_SETTING_OFF = 1.5
"""Acceleration that is expected of a driver who has the right of way and may set off [m/s^2]."""
_HORIZON = 120.0
"""How far ahead a driver looks for others [m]."""
_CONSIDER = 5
"""Steps from one look at the lanes beside to the next."""
_SETTLING = 8
"""How often a driver's first speed is fitted to that of who is ahead: rows of so many settle wholly."""
PASSES = 4
"""How often a crowd moves at most, so that queues at junctions do not grow without end: the density asked for holds on
all lanes and their continuations at first, and where signals or right of way let fewer through, fewer come."""
DRIFT, CHANCE = 0.25, 2.0
"""Surplus over what is asked for that is allowed: this share, and so many standard deviations of a Poisson number."""
_LATE = 3
"""The last third of the time counts."""
Onward = Callable[[list[int], float], bool]
"""Makes a route, of which the first track is given, as long as asked for [m]; returns whether it ends before."""
_Near = tuple[tuple[float, float, int], tuple[float, float, int]]
"""Who is ahead and who behind: gap [m], speed [m/s], number."""


@dataclass(frozen=True)
class _Leader:
    """The next body ahead: distances of its rear (`gap`) and of its front [m], its speed [m/s] and its number."""

    gap: float
    front: float
    speed: float
    number: int


@dataclass(eq=False)
class Obstacle:
    """A body whose motion is given: on which tracks its front is, at each step: ``{track: (way [m], speed [m/s])}``."""

    length: float
    places: list[dict[int, tuple[float, float]]]


class Crowd:
    """All drivers of a network, moved together in steps of time.

    Parameters
    ----------
    graph : TrackGraph
    drivers : sequence of Driver
    signals : Signals or None
    obstacles : sequence of Obstacle
        Bodies that do not react.
    onward, paths : callable and RoutePaths, optional
        How routes go on after a lane change, and their paths; without them nobody changes lanes.
    """

    def __init__(
        self,
        graph: TrackGraph,
        drivers: Sequence[Driver],
        signals: Signals | None,
        obstacles: Sequence[Obstacle] = (),
        onward: Onward | None = None,
        paths: RoutePaths | None = None,
    ) -> None:
        self.graph, self.drivers, self.signals, self.obstacles = graph, list(drivers), signals, list(obstacles)
        self.onward, self.paths = onward, paths
        self.holders: list[dict[int, int]] = [{} for _ in graph.sides]
        self._on: dict[int, list[tuple[float, float, float, int]]] = {}
        self._index = 0
        for number, driver in enumerate(self.drivers):
            self._take_present_zones(number, driver)

    def run(self, start_time: float, num_steps: int) -> None:
        """Move all drivers by `STEP`, and keep way, speed and acceleration at each instant."""
        self._settle(start_time)
        for index in range(num_steps + 1):
            for driver in self.drivers:
                driver.history.append((driver.way, driver.speed, driver.pull))
            if index < num_steps:
                self._step(start_time + index * STEP, index)

    def _settle(self, time: float) -> None:
        """Let all drivers begin at the speed that suits the road, who is ahead, and where they must stop."""
        self._place(0)
        leaders = [self._leader(number, driver) for number, driver in enumerate(self.drivers)]
        wished = [float(driver.limits[min(int(driver.way), len(driver.limits) - 1)]) for driver in self.drivers]
        for driver, desired in zip(self.drivers, wished, strict=True):
            driver.speed = desired
        for _ in range(_SETTLING):
            for driver, leader, desired in zip(self.drivers, leaders, wished, strict=True):
                if leader is not None:
                    ahead = self.drivers[leader.number].speed if leader.number >= 0 else leader.speed
                    driver.settle(leader.gap, ahead, desired)
        for number, (driver, leader) in enumerate(zip(self.drivers, leaders, strict=True)):
            line = self._stop_line(number, driver, leader, time)
            if line is not None:
                driver.settle(line - 0.5 + driver.gap, 0.0, driver.speed)

    def _step(self, time: float, index: int) -> None:
        self._place(index)
        for number in range(index % _CONSIDER, len(self.drivers), _CONSIDER):
            self._consider(number, self.drivers[number])
        wishes = [self._wish(number, driver, time) for number, driver in enumerate(self.drivers)]
        for number, (driver, wish) in enumerate(zip(self.drivers, wishes, strict=True)):
            driver.advance(wish, STEP)
            while driver.place < len(driver.route) - 1 and driver.way >= driver.starts[driver.place + 1]:
                driver.place += 1
            for zone, (_, free_at) in list(driver.held.items()):
                if driver.way > free_at:
                    del driver.held[zone]
                    del self.holders[zone][number]

    def _place(self, index: int) -> None:
        """Note who is on which track: (way of the front, length, speed, number), in the order of the ways."""
        self._on, self._index = {}, index
        for number, driver in enumerate(self.drivers):
            rear = driver.way - driver.body.length
            for place in range(driver.place, -1, -1):
                entry = (driver.way - driver.starts[place], driver.body.length, driver.speed, number)
                self._on.setdefault(driver.route[place], []).append(entry)
                if rear >= driver.starts[place]:
                    break
            if (left := driver.shared) is not None and left < place:
                entry = (driver.way - driver.starts[left], driver.body.length, driver.speed, number)
                self._on.setdefault(driver.route[left], []).append(entry)
        for number, obstacle in enumerate(self.obstacles):
            for track, (way, speed) in obstacle.places[min(index, len(obstacle.places) - 1)].items():
                self._on.setdefault(track, []).append((way, obstacle.length, speed, -1 - number))
        for entries in self._on.values():
            entries.sort()

    def _wish(self, number: int, driver: Driver, time: float) -> float:
        """Return the acceleration that a driver wishes [m/s^2]."""
        desired = float(driver.limits[min(int(driver.way), len(driver.limits) - 1)])
        wish = min(driver.follow(math.inf, 0.0, desired), driver.slow_down())
        leader = self._leader(number, driver)
        if leader is not None:
            wish = min(wish, driver.follow(leader.gap, driver.speed - leader.speed, desired))
        if (left := driver.shared) is not None:
            gap, speed, _ = self._beside(number, driver.route[left], driver.way - driver.starts[left])[0]
            wish = min(wish, -(max(driver.speed - speed, 0.0) ** 2) / (2.0 * max(gap - NEAREST, 0.1)))
        line = self._stop_line(number, driver, leader, time)
        if line is not None:
            wish = min(wish, driver.follow(line - 0.5 + driver.gap, driver.speed, desired))
            if line > 0.1:
                needed = driver.speed**2 / (2.0 * line)
                if needed > FIRM_BRAKING:
                    wish = min(wish, -needed)
        return wish

    def _beside(self, number: int, index: int, way: float) -> _Near:
        """Return who is ahead and who behind a front on a track: gap to its rear or front [m], speed [m/s], number.

        Where nobody is, the gap is infinite and the number that of the driver.
        """
        ahead, behind = (math.inf, 0.0, number), (math.inf, 0.0, number)
        track, length = self.graph.tracks[index], self.drivers[number].body.length
        spans = [(index, 0.0), *((one, track.length) for one in track.next)]
        spans += [(one, -self.graph.tracks[one].length) for one in track.before]
        for span, base in spans:
            for there, size, speed, other in self._on.get(span, ()):
                if other == number:
                    continue
                if base + there > way:
                    ahead = min(ahead, (base + there - size - way, speed, other))
                else:
                    behind = min(behind, (way - length - base - there, speed, other))
        return ahead, behind

    def _consider(self, number: int, driver: Driver) -> None:
        """Begin a lane change where one is possible, safe and pays."""
        here = driver.route[driver.place]
        track = self.graph.tracks[here]
        if self.onward is None or self.paths is None or track.beside == (None, None) or driver.held:
            return
        if driver.body.motion != "vehicle" or driver.speed < SLOWEST:
            return
        if driver.changes and driver.way - driver.reference < driver.changes[-1].end + PAUSE:
            return
        length, size = max(DURATION * driver.speed, SHORTEST), driver.body.length
        if not is_clear(track, driver.local, size, length):
            return
        now = self._beside(number, here, driver.local)
        for other, to_left in zip(track.beside, (True, False), strict=True):
            if other is None:
                continue
            beside = self.graph.tracks[other]
            place, away = beside.nearest(track.at(driver.local))
            if away > track.width + 2.0 or driver.speed > TOO_FAST * beside.speed * driver.share:
                continue
            then = self._beside(number, other, place)
            if not is_clear(beside, place, size, length) or not has_room(then[0][0], then[1][0]):
                continue
            fronts = place + np.arange(-size, length + size)
            if (
                self._pays(driver, (track, now), (beside, then), to_left)
                and self.paths.lateral(other, driver.body, fronts, driver.speed) < STRAIGHT
            ):
                route = [other]
                driver.blocked_end = self.onward(route, driver.needed - driver.way + place)
                driver.change(route, place, length, self.graph.tracks)
                driver.limit(self.graph.tracks, self.paths)
                insort(self._on.setdefault(other, []), (place, size, driver.speed, number))
                return

    def _pays(self, driver: Driver, now: tuple[Track, _Near], then: tuple[Track, _Near], to_left: bool) -> bool:
        """Return whether a change is safe and pays for a driver and those behind, by MOBIL."""
        own = tuple(
            driver.follow(ahead[0], driver.speed - ahead[1], min(track.speed * driver.share, driver.top_speed))
            for track, (ahead, _) in (now, then)
        )
        rows = []
        for (_, (ahead, behind)), leaves in ((now, True), (then, False)):
            gap, speed, number = behind
            if math.isinf(gap):
                rows.append((0.0, 0.0))
            elif number < 0:
                apart = max(GIVEN_HEADWAY * speed, GIVEN_TIME * (speed - driver.speed))
                rows.append((0.0, 0.0 if leaves or gap > apart else -math.inf))
            else:
                one = self.drivers[number]
                desired = float(one.limits[min(int(one.way), len(one.limits) - 1)])
                with_it = one.follow(gap, one.speed - driver.speed, desired)
                without = one.follow(gap + driver.body.length + ahead[0], one.speed - ahead[1], desired)
                rows.append((with_it, without) if leaves else (without, with_it))
        return is_wanted((own[0], own[1]), rows[0], rows[1], to_left)

    def _leader(self, number: int, driver: Driver) -> _Leader | None:
        """Return the next body on the route."""
        best: _Leader | None = None
        for place in range(driver.place, len(driver.route)):
            base = driver.starts[place] - driver.way
            if base > _HORIZON:
                break
            track = driver.route[place]
            for way, length, speed, other in self._on.get(track, ()):
                if other == number or base + way <= 0.0:
                    continue
                if best is None or base + way - length < best.gap:
                    best = _Leader(base + way - length, base + way, speed, other)
                if (
                    way <= self.graph.tracks[track].length
                ):  # else it has left the track for another one: look on along the route, too
                    return best
        return best

    def _stop_line(self, number: int, driver: Driver, leader: _Leader | None, time: float) -> float | None:
        """Return the distance of the front [m] to where it must stop, None where it may go on.

        Takes the zones that are free.
        """
        tracks = self.graph.tracks
        over = None
        if driver.body.motion == "walk":
            over = on_foot.crossing(driver, self.graph)
            reach = max(on_foot.reach(driver), over[1] if over else 0.0)
        else:
            reach = driver.speed**2 / (2.0 * 1.5) + driver.speed + 12.0
        if driver.speed < 0.3:
            self._give_back(number, driver, 0.0, tracks)
        for place in range(driver.place, len(driver.route)):
            track, base = tracks[driver.route[place]], driver.starts[place] - driver.way
            if base > reach:
                return None
            last_one = place == len(driver.route) - 1
            wait = None if last_one else self._must_wait(driver, track, base, time)
            if wait is not None:
                return self._give_back(number, driver, wait, tracks)
            for zone, first, last, merging in track.zones:
                if base + last < 0.0 or zone in driver.held or base + first > reach:
                    continue
                if leader is not None and leader.front < base + first and leader.number not in self.holders[zone]:
                    return None  # those in front go first
                no_room = (
                    leader is not None
                    and leader.speed < 1.5
                    and leader.gap < base + last + 1.0
                    and base + first > 0.5
                    and driver.stops_at_ease(base + first)
                )
                free_at = driver.way + base + last + (0.0 if merging else driver.body.length)
                if no_room or not self._take(number, driver, zone, driver.route[place], free_at):
                    line = base + first if over is None or over[0] < 0.0 else min(over[0], base + first)
                    stop = self._give_back(number, driver, line, tracks)
                    return stop if stop > -3.0 else None
            if last_one and driver.blocked_end:
                return base + track.length
        return None

    def _take(self, number: int, driver: Driver, zone: int, track: int, free_at: float) -> bool:
        others = [other for other, side in self.holders[zone].items() if other != number and side != track]
        if driver.body.motion == "walk" and on_foot.of_vehicles(self.graph, zone):
            if self._is_due(zone, track, (free_at - driver.way) / driver.top_speed + on_foot.CLEARANCE):
                return False
            if all(on_foot.lets_over(self.drivers[other], zone, self.graph.tracks) for other in others):
                for other in others:
                    del self.drivers[other].held[zone], self.holders[zone][other]
                others = []
        if others:
            return False
        self.holders[zone][number] = track
        driver.held[zone] = (track, free_at)
        return True

    def _is_due(self, zone: int, track: int, within: float) -> bool:
        """Return whether a body of given motion is on the other track of a zone within some time [s]."""
        (other,) = (side for side in self.graph.sides[zone] if side != track)
        first, last = next(span[1:3] for span in self.graph.tracks[other].zones if span[0] == zone)
        soon = slice(self._index, self._index + math.ceil(within / STEP) + 1)
        return any(
            other in places and places[other][0] >= first and places[other][0] - obstacle.length <= last
            for obstacle in self.obstacles
            for places in obstacle.places[soon]
        )

    def _give_back(self, number: int, driver: Driver, line: float, tracks: Sequence[Track]) -> float:
        """Give back zones beyond a stop line, and those before it in which the body would stand.

        Of the latter only those before which it stops at ease. Return the stop line then [m].
        """
        spans, beyond = [], line
        for place in range(driver.place, len(driver.route)):
            base = driver.starts[place] - driver.way
            spans += [
                (base + first, base + last, zone)
                for zone, first, last, _ in tracks[driver.route[place]].zones
                if zone in driver.held
            ]
            if base > line + _HORIZON:
                break
        for first, last, zone in sorted(spans, reverse=True):
            if first <= 0.0 or not (driver.can_stop if first >= beyond else driver.stops_at_ease)(first):
                break
            if last + driver.body.length + 1.0 < line or zone not in driver.held:
                continue
            del driver.held[zone]
            del self.holders[zone][number]
            line = min(line, first)
        return line

    def _must_wait(self, driver: Driver, track: Track, base: float, time: float) -> float | None:
        """Return the line before which a signal or others' right of way stops a driver on a track [m], None where not.

        The track begins `base` ahead of the front [m].
        """
        end = base + track.length
        if track.signal is not None and self.signals is not None:
            line = _line_before(track, base, track.length)
            left = self.signals.green_left(track.signal, time)
            is_red = left <= 0.0 or (left < 3.0 and end / max(driver.speed, 1.0) > left)
            if is_red and line >= -0.5 and driver.can_stop(line):
                return line
        for index in track.yield_to:
            here, there = _meeting(track, self.graph.tracks[index])
            line = _line_before(track, base, here)
            beyond = there - self.graph.tracks[index].length
            if line >= -0.5 and driver.stops_at_ease(line) and self._comes(index, index, time, beyond, 3):
                return line
        return None

    def _comes(self, goal: int, index: int, time: float, base: float, depth: int) -> bool:
        """Return whether someone on a track who is bound for another gets to a place within the critical headway.

        The place is `base` [m] beyond the end of the track.
        """
        track = self.graph.tracks[index]
        if track.signal is not None and self.signals is not None and not self.signals.is_green(track.signal, time):
            return False
        for way, _, speed, other in self._on.get(index, ()):
            if other >= 0 and goal not in self.drivers[other].route[self.drivers[other].place :]:
                continue
            away = base + track.length - way
            arrival = (math.sqrt(speed * speed + 2.0 * _SETTING_OFF * max(away, 0.0)) - speed) / _SETTING_OFF
            if away >= 0.0 and min(arrival, away / max(speed, 1.0)) < CRITICAL_HEADWAY:
                return True
        further = base + track.length
        if depth == 0 or further > 25.0 * CRITICAL_HEADWAY:
            return False
        return any(self._comes(goal, before, time, further, depth - 1) for before in track.before)

    def _take_present_zones(self, number: int, driver: Driver) -> None:
        """Take the zones in which a driver stands at the beginning."""
        for place, index in enumerate(driver.route):
            base = driver.starts[place] - driver.way
            for zone, first, last, merging in self.graph.tracks[index].zones:
                length = 0.0 if merging else driver.body.length
                if base + first <= 0.0 <= base + last + length:
                    self._take(number, driver, zone, index, driver.way + base + last + length)


def _line_before(track: Track, base: float, place: float) -> float:
    """Return where to wait for a place on a track: before all that others share next to it, from the front [m]."""
    shared = [first for _, first, last, _ in track.zones if first < place < last + 2.0 and base + first > -2.0]
    return base + min([place, *shared])


def _meeting(track: Track, other: Track) -> tuple[float, float]:
    """Return where a track meets one with the right of way: where it begins on the one, and ends on the other [m].

    The ends of both where they share nothing.
    """
    theirs = {zone: last for zone, _, last, _ in other.zones}
    shared = [(first, theirs[zone]) for zone, first, _, _ in track.zones if zone in theirs]
    return min(shared, default=(track.length, other.length))


def fresh(driver: Driver) -> Driver:
    """Return a driver as before it moved."""
    return replace(driver, held={}, history=[], halting=[], changes=[])


def is_outside(driver: Driver, tracks: Sequence[Track]) -> bool:
    """Return whether a vehicle that has not moved yet is to come from beyond the scene."""
    return driver.body.motion == "vehicle" and tracks[driver.route[driver.place]].lane is None


def inside(driver: Driver, tracks: Sequence[Track]) -> npt.NDArray[np.bool_]:
    """Return whether a driver's front is in the scene at each instant of its history."""
    there = np.array([tracks[index].lane is not None for index in driver.route])
    ways = np.array(driver.history)[:, 0]
    return np.asarray(there[np.clip(np.searchsorted(driver.enters, ways, side="right") - 1, 0, len(there) - 1)])


def too_many(drivers: Sequence[Driver], coming: Sequence[bool], tracks: Sequence[Track], wanted: float) -> float:
    """Return the share of those to come that are too many, 0 where the number inside is right.

    Parameters
    ----------
    drivers : sequence of Driver
        After they have moved.
    coming : sequence of bool
        Who came from beyond the scene.
    tracks : sequence of Track
    wanted : float
        Number of vehicles inside that is asked for.
    """
    rows = [inside(driver, tracks) for driver in drivers if driver.body.motion == "vehicle"]
    late = float(np.mean([row[-len(row) // _LATE :].mean() for row in rows])) * len(rows) if rows else 0.0
    surplus = late - wanted
    if surplus <= max(DRIFT * wanted, CHANCE * math.sqrt(wanted)):
        return 0.0
    came = sum(bool(is_new and inside(driver, tracks).any()) for driver, is_new in zip(drivers, coming, strict=True))
    return min(surplus / max(came, 1), 0.9)


def thinned(coming: Sequence[bool], share: float) -> list[bool]:
    """Return whom to keep where a share of those to come is left out, evenly in their order."""
    kept, count = [], 0.0
    for is_new in coming:
        before = math.floor(count)
        count += (1.0 - share) * is_new
        kept.append(not is_new or math.floor(count) > before)
    return kept
