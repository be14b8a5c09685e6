"""One driver: the Intelligent Driver Model along a route of tracks, within what a driver and a vehicle can do.

References
----------
.. [1] M. Treiber, A. Hennecke, D. Helbing, Congested traffic states in empirical observations and microscopic
   simulations, Phys. Rev. E 62, 1805, 2000 (the model and its parameters).
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from scarl_sionna.scenario.motion.bodies import ActorBody

from .bends import RoutePaths, bend_speeds
from .lane_changes import SHARED, LaneChange
from .tracks import Track

Array = npt.NDArray[np.float64]

HARDEST_BRAKING, FIRM_BRAKING = 8.0, 4.0
"""What brakes can give, and what a driver brakes with at a signal that has just turned red [m/s^2]."""
EASY_BRAKING, _SHORT = 2.0, 1.0
"""What a driver brakes with to let others go first [m/s^2], and how far from them it stops [m]."""
_CREEP = 0.3
"""Who is slower stands [m/s]."""
_JERK, _EMERGENCY_JERK = 6.0, 25.0
_RELEASE_JERK, _STOP_JERK = 12.0, 8.0
"""How fast brakes are let go when the way is free, and towards a stop [m/s^3]."""
_HALT = 0.3
"""Time before a stop at which its last moments begin [s]."""
_EASE = 0.75
"""Share of the braking of the model with which drivers slow down for bends and limits."""
_LOOK = 0.6
"""How far ahead drivers look for the speed that they shall have [s]: what it takes to step on the brake."""

_HALVINGS = 14
"""Of the range of speeds where one is sought: to 4 mm/s at 60 m/s."""


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
    enters: list[float] = field(default_factory=list)
    changes: list[LaneChange] = field(default_factory=list)
    needed: float = 0.0
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
        self.enters = self.starts[:-1]
        self.limit(tracks, paths)
        self.place = bisect_right(self.starts, self.way) - 1

    def change(self, route: Sequence[int], place: float, length: float, tracks: Sequence[Track]) -> None:
        """Go on along another route, whose first track lies beside the present one.

        `place` is the way of the front along it, `length` that of the change [m].
        """
        self.changes.append(LaneChange(self.place, self.way - self.reference, length))
        starts = self.way - place + np.concatenate([[0.0], np.cumsum([tracks[index].length for index in route])])
        self.route = [*self.route[: self.place + 1], *route]
        self.starts = [*self.starts[: self.place + 1], *starts.tolist()]
        self.enters = [*self.enters[: self.place + 1], self.changes[-1].start, *starts[1:-1].tolist()]
        self.place += 1

    def limit(self, tracks: Sequence[Track], paths: RoutePaths) -> None:
        """Fill the speed [m/s] at which each metre is driven, from the present lane on."""
        first = self.changes[-1].place + 1 if self.changes else 0
        route, kept = self.route[first:], int(self.way) if self.changes else 0
        ways = np.arange(kept, self.starts[-1] + 1.0)
        limits = np.zeros(len(ways))
        for index, enter in zip(route, self.enters[first:], strict=True):
            limits[max(math.ceil(enter) - kept, 0) :] = tracks[index].speed
        limits = np.minimum(limits * self.share, self.top_speed)
        path = paths.path(route, self.body)
        limits = np.minimum(limits, bend_speeds(path, self.body, ways - self.starts[first]))
        rise = 2.0 * _EASE * self.braking * np.arange(len(ways))  # braking in time: v(x)^2 <= v(x + 1)^2 + 2 b
        squares = np.minimum.accumulate((limits**2 + rise)[::-1])[::-1] - rise
        self.limits = np.concatenate([self.limits[:kept], np.sqrt(squares)])

    @property
    def reference(self) -> float:
        """How far the rear axle is behind the front [m]."""
        return self.body.length / 2.0 - self.body.rear_axle

    @property
    def shared(self) -> int | None:
        """Place on the route of the track that is being left, while the body is partly there."""
        if not self.changes:
            return None
        last = self.changes[-1]
        return last.place if self.way - self.reference < last.start + SHARED * last.length else None

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

    def settle(self, gap: float, ahead: float, desired: float) -> None:
        """Take the speed, at most that wished [m/s], at which the model neither accelerates nor brakes.

        `gap` [m] and `ahead` [m/s] are the distance and the speed of the next body.
        """
        low, high = 0.0, desired
        for _ in range(_HALVINGS):
            self.speed = 0.5 * (low + high)
            low, high = (self.speed, high) if self.follow(gap, self.speed - ahead, desired) > 0.0 else (low, self.speed)

    def can_stop(self, away: float) -> bool:
        """Return whether brakes stop it before a place some way ahead [m], as at a signal that has just turned red."""
        return self.speed**2 <= 2.0 * FIRM_BRAKING * max(away, 0.1)

    def stops_at_ease(self, away: float) -> bool:
        """Return whether it stands, or stops some way ahead [m] without hard braking; who does not goes on."""
        return self.speed < _CREEP or self.speed**2 <= 2.0 * EASY_BRAKING * (away - _SHORT)

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
