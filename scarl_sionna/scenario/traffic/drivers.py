"""Drivers: the Intelligent Driver Model along tracks, with signals, right of way, and one at a time where ways cross.

References
----------
.. [1] M. Treiber, A. Hennecke, D. Helbing, Congested traffic states in empirical observations and microscopic
   simulations, Phys. Rev. E 62, 1805, 2000 (the model and its parameters).
.. [2] Highway Capacity Manual, 2010, ch. 21: a critical headway of 4.1 to 5.2 s of drivers who enter a roundabout.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from scarl_sionna.scenario.motion.bodies import ActorBody
from scarl_sionna.scene.lanes import Signals

from .bends import RoutePaths, bend_speeds
from .tracks import Track, TrackGraph

Array = npt.NDArray[np.float64]

CRITICAL_HEADWAY = 4.5
"""Time that a vehicle with the right of way must be away for another one to go first [s]."""
HARDEST_BRAKING, FIRM_BRAKING = 8.0, 4.0
"""What brakes can give, and what a driver brakes with at a signal that has just turned red [m/s^2]."""
_JERK, _EMERGENCY_JERK = 6.0, 25.0
_RELEASE_JERK, _STOP_JERK = 12.0, 8.0
"""How fast brakes are let go when the way is free, and towards a stop [m/s^3]."""
_HALT = 0.3
"""Time before a stop at which its last moments begin [s]."""
_SETTING_OFF = 1.5
"""Acceleration that is expected of a driver who has the right of way and may set off [m/s^2]."""
_EASE = 0.75
"""Share of the braking of the model with which drivers slow down for bends and limits."""
_LOOK = 0.6
"""How far ahead drivers look for the speed that they shall have [s]: what it takes to step on the brake."""
_HORIZON = 120.0
"""How far ahead a driver looks for others [m]."""


@dataclass
class Driver:
    """A vehicle or a pedestrian on a route of tracks; `way` is that of the front, along the route [m].

    `headway` T [s], `acceleration` a, `braking` b [m/s^2], `gap` s0 [m] and `share` of the speed limit are those of the
    model.
    """

    body: ActorBody
    route: list[int]
    way: float
    speed: float
    headway: float
    acceleration: float
    braking: float
    gap: float
    share: float
    top_speed: float
    starts: list[float] = field(default_factory=list)
    limits: Array = field(default_factory=lambda: np.zeros(0))
    pull: float = 0.0
    place: int = 0
    held: dict[int, tuple[int, float]] = field(default_factory=dict)
    blocked_end: bool = False
    history: list[tuple[float, float, float]] = field(default_factory=list)
    halting: list[tuple[float, float, float]] = field(default_factory=list)

    def prepare(self, tracks: Sequence[Track], paths: RoutePaths) -> None:
        """Fill the start of each track along the route, and the speed [m/s] at which each metre is driven."""
        lengths = [tracks[index].length for index in self.route]
        self.starts = [0.0, *np.cumsum(lengths).tolist()]
        ways = np.arange(0.0, self.starts[-1] + 1.0)
        limits = np.repeat([tracks[index].speed for index in self.route], np.diff(np.ceil(self.starts)).astype(int))
        limits = np.append(limits, np.full(max(len(ways) - len(limits), 0), limits[-1]))[: len(ways)] * self.share
        limits = np.minimum(limits, self.top_speed)
        if tracks[self.route[0]].kind != "walk":
            limits = np.minimum(limits, bend_speeds(paths.path(self.route, self.body), self.body, ways))
        squares = limits**2  # braking in time: v(x)^2 <= v(x + 1)^2 + 2 b
        for index in range(len(squares) - 2, -1, -1):
            squares[index] = min(squares[index], squares[index + 1] + 2.0 * _EASE * self.braking)
        self.limits = np.sqrt(squares)
        self.place = bisect_right(self.starts, self.way) - 1

    @property
    def local(self) -> float:
        """Way of the front on its present track [m]."""
        return self.way - self.starts[self.place]

    def follow(self, gap: float, closing: float, desired: float) -> float:
        """Return the acceleration of the Intelligent Driver Model [m/s^2], Eqs. (2), (3) of [1]."""
        free = 1.0 - (self.speed / max(desired, 0.1)) ** 4
        if self.speed > desired:  # above what is wished: down at ease, not by the fourth power
            free = -min((self.speed - desired) / max(desired, 0.1) * 3.0, self.braking / self.acceleration)
        wished = self.gap + max(
            0.0, self.speed * self.headway + self.speed * closing / (2.0 * math.sqrt(self.acceleration * self.braking))
        )
        return self.acceleration * (free - (wished / max(gap, 0.1)) ** 2)

    def slow_down(self) -> float:
        """Return the acceleration that is needed for the speeds of the route ahead [m/s^2], infinite where none is."""
        ahead = max(_LOOK * self.speed, 2.0)
        row = self.way + ahead
        before = min(int(row), len(self.limits) - 2)
        share = min(max(row - before, 0.0), 1.0)
        wanted = float(self.limits[before] * (1.0 - share) + self.limits[before + 1] * share)
        return (wanted**2 - self.speed**2) / (2.0 * ahead) if wanted < self.speed else math.inf

    def advance(self, wish: float, step: float) -> None:
        """Move on for a step of time [s].

        The acceleration goes linearly to what is wished, as far as the jerk lets it.
        """
        if self._halt(wish, step):
            return
        jerk = _EMERGENCY_JERK if wish < -FIRM_BRAKING or self.pull < -FIRM_BRAKING else _JERK
        pull = min(max(wish, -HARDEST_BRAKING), self.acceleration)
        pull = min(
            max(pull, self.pull - jerk * step), self.pull + max(jerk, _RELEASE_JERK if self.pull < 0.0 else 0.0) * step
        )
        if pull < 0.0:  # brakes are let go towards the stop, so that it is reached without a jolt
            pull = max(pull, -math.sqrt(2.0 * _STOP_JERK * self.speed))
        speed = self.speed + 0.5 * (self.pull + pull) * step
        if speed < 0.02 and wish <= 0.0:
            self.way += 0.4 * self.speed * step
            self.speed = self.pull = 0.0
        elif speed < 0.0:
            self.way += 0.4 * self.speed * step
            self.speed, self.pull = 0.0, 0.0
        else:
            self.way += self.speed * step + (2.0 * self.pull + pull) * step * step / 6.0
            self.speed, self.pull = speed, pull

    def _halt(self, wish: float, step: float) -> bool:
        """Move on for a step of the last moments before a stop; return False where it is not as far as that.

        Who brakes so hard that letting the brakes go does not keep it rolling, stops whatever it wishes. The speed is
        the cubic of time that reaches rest without a jolt after a whole number of steps: about as long as brakes that
        are let go evenly take, at most `_HALT`, and so short that the cubic goes through no speed backward.
        """
        if not self.halting:
            evenly = 2.0 * self.speed / max(-self.pull, 1e-9)
            is_slow = self.pull < 0.2 and self.speed < (0.3 if wish < -1.0 else 0.05)
            must = self.pull < 0.0 and self.speed < self.pull**2 / (2.0 * _RELEASE_JERK)
            if self.speed == 0.0 or not (must or (wish <= 0.0 and (evenly <= _HALT or is_slow))):
                return False
            longest = max(math.floor(1.5 * evenly / step + 1e-9), 1)
            time = step * min(math.ceil(min(evenly, _HALT) / step - 1e-9), longest)
            self.halting = _halt_states(self.speed, self.pull, time, step)
        way, self.speed, self.pull = self.halting.pop(0)
        self.way += way
        return True


def _halt_states(speed: float, pull: float, time: float, step: float) -> list[tuple[float, float, float]]:
    """Return way in each step [m], and speed [m/s] and acceleration [m/s^2] at its end, up to rest after a time [s]."""
    cubic = (2.0 * speed / time + pull) / time**2, -(3.0 * speed / time + 2.0 * pull) / time, pull, speed
    ways = np.polynomial.polynomial.Polynomial([0.0, *(c / (n + 1.0) for n, c in enumerate(cubic[::-1]))])
    speeds = ways.deriv()
    ends = step * np.arange(round(time / step) + 1)
    states = np.column_stack([np.diff(ways(ends)), speeds(ends[1:]), speeds.deriv()(ends[1:])])
    states[-1, 1:] = 0.0
    return [(way, now, rate) for way, now, rate in states.tolist()]


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
    """

    def __init__(
        self, graph: TrackGraph, drivers: Sequence[Driver], signals: Signals | None, obstacles: Sequence[Obstacle] = ()
    ) -> None:
        self.graph, self.drivers, self.signals, self.obstacles = graph, list(drivers), signals, list(obstacles)
        self.holders: list[dict[int, int]] = [{} for _ in range(graph.num_zones)]
        self._on: dict[int, list[tuple[float, float, float, int]]] = {}
        for number, driver in enumerate(self.drivers):
            self._take_present_zones(number, driver)

    def run(self, start_time: float, num_steps: int, step: float) -> None:
        """Move all drivers, and keep way, speed and acceleration at each instant."""
        for index in range(num_steps + 1):
            for driver in self.drivers:
                driver.history.append((driver.way, driver.speed, driver.pull))
            if index < num_steps:
                self._step(start_time + index * step, index, step)

    def _step(self, time: float, index: int, step: float) -> None:
        self._place(index)
        wishes = [self._wish(number, driver, time) for number, driver in enumerate(self.drivers)]
        for number, (driver, wish) in enumerate(zip(self.drivers, wishes, strict=True)):
            driver.advance(wish, step)
            while driver.place < len(driver.route) - 1 and driver.way >= driver.starts[driver.place + 1]:
                driver.place += 1
            for zone, (_, free_at) in list(driver.held.items()):
                if driver.way > free_at:
                    del driver.held[zone]
                    del self.holders[zone][number]

    def _place(self, index: int) -> None:
        """Note who is on which track: (way of the front, length, speed, number), in the order of the ways."""
        self._on = {}
        for number, driver in enumerate(self.drivers):
            rear = driver.way - driver.body.length
            for place in range(driver.place, -1, -1):
                entry = (driver.way - driver.starts[place], driver.body.length, driver.speed, number)
                self._on.setdefault(driver.route[place], []).append(entry)
                if rear >= driver.starts[place]:
                    break
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
        line = self._stop_line(number, driver, leader, time)
        if line is not None:
            wish = min(wish, driver.follow(line - 0.5 + driver.gap, driver.speed, desired))
            if line > 0.1:
                needed = driver.speed**2 / (2.0 * line)
                if needed > FIRM_BRAKING:
                    wish = min(wish, -needed)
        return wish

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
        reach = driver.speed**2 / (2.0 * 1.5) + driver.speed + 12.0
        if driver.speed < 0.3:
            self._give_back(number, driver, 0.0, tracks)
        for place in range(driver.place, len(driver.route)):
            track, base = tracks[driver.route[place]], driver.starts[place] - driver.way
            if base > reach:
                return None
            end, last_one = base + track.length, place == len(driver.route) - 1
            at_end = [
                base + first for _, first, last, _ in track.zones if last > track.length - 2.0 and base + first > -2.0
            ]
            line = min([end, *at_end])  # where to wait: before what is shared at the end of the track
            if not last_one and line >= -0.5 and self._must_wait(driver, track, line, end, time):
                return self._give_back(number, driver, line, tracks)
            for zone, first, last, merging in track.zones:
                if base + last < 0.0 or zone in driver.held or base + first > reach:
                    continue
                if leader is not None and leader.front < base + first and leader.number not in self.holders[zone]:
                    return None  # those in front go first
                no_room = (
                    leader is not None and leader.speed < 1.5 and leader.gap < base + last + 1.0 and base + first > 0.5
                )
                free_at = driver.way + base + last + (0.0 if merging else driver.body.length)
                if no_room or not self._take(number, driver, zone, driver.route[place], free_at):
                    stop = self._give_back(number, driver, base + first, tracks)
                    return stop if stop > -3.0 else None
            if last_one and driver.blocked_end:
                return end
        return None

    def _take(self, number: int, driver: Driver, zone: int, track: int, free_at: float) -> bool:
        if any(side != track for other, side in self.holders[zone].items() if other != number):
            return False
        self.holders[zone][number] = track
        driver.held[zone] = (track, free_at)
        return True

    def _give_back(self, number: int, driver: Driver, line: float, tracks: Sequence[Track]) -> float:
        """Give back zones beyond a stop line, and those before it in which the body would stand.

        Return the stop line then [m].
        """
        spans = []
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
            if first <= 0.0 or driver.speed**2 / (2.0 * max(first, 0.1)) > FIRM_BRAKING:
                break
            if last + driver.body.length + 1.0 < line or zone not in driver.held:
                continue
            del driver.held[zone]
            del self.holders[zone][number]
            line = min(line, first)
        return line

    def _must_wait(self, driver: Driver, track: Track, line: float, end: float, time: float) -> bool:
        """Return whether a signal or others' right of way stops a driver at a line before the end of a track [m]."""
        can_stop = driver.speed**2 / (2.0 * max(line, 0.1)) <= FIRM_BRAKING
        if track.signal is not None and self.signals is not None:
            left = self.signals.green_left(track.signal, time)
            if left <= 0.0 or (left < 3.0 and end / max(driver.speed, 1.0) > left):
                return can_stop
        return (
            bool(track.yield_to)
            and can_stop
            and any(self._comes(index, index, time, 0.0, 3) for index in track.yield_to)
        )

    def _comes(self, goal: int, index: int, time: float, base: float, depth: int) -> bool:
        """Return whether someone on a track gets to its crossing with another within the critical headway.

        The crossing is `base` [m] before the end of the other track.
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
