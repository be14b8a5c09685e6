"""What an action does to the motion of an entity while it lasts: its speed, its place beside the lane, or both."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from scarl_sionna.scenario.openscenario.reading.source import Node

from .distances import Distance, along_road
from .dynamics import Ramp, share
from .motion import Motion, World
from .positions import Place

HARDEST = 10.0
"""Acceleration that a step of speed is made with where the file states none, and at most [m/s2]."""
STEEPEST = 0.7
"""Way to the side over way along the lane, at most: 35 deg between heading and lane."""
NARROWEST = 3.5
"""Radius of the bend with which a change of the offset begins, at least [m]: what small cars drive."""
_BACK = 3.0
"""Lateral acceleration with which a change of the offset ends that had too little way [m/s2]."""
_SOON = 1e-6
_THERE = 1e-3


class Process:
    """An action that runs on one entity; nothing of it changes but by the motions that it is given."""

    domains: frozenset[str] = frozenset({"longitudinal"})
    ends_at: float = math.inf
    """When it is over, if that is known from its start [s]."""

    def finished(self, motion: Motion, world: World) -> bool:
        """Return whether it has done its work at a motion's time."""
        return motion.time >= self.ends_at - _SOON

    def last_speed(self, world: World) -> float | None:
        """Return the speed at which it leaves the entity when it is finished [m/s]; None: the one that it has."""
        return None

    def advanced(self, motion: Motion, until: float, world: World) -> tuple[float, float]:
        """Return the way that is gone until a time [m], and the speed then [m/s]; of longitudinal ones."""
        raise NotImplementedError

    def left(self, motion: Motion, until: float, travelled: float, world: World) -> float:
        """Return the offset to the left of the lane's middle at a time [m]; of lateral ones."""
        raise NotImplementedError


@dataclass(frozen=True, eq=False)
class Speed(Process):
    """A speed along one ramp after the other."""

    ramps: tuple[Ramp, ...]

    def __post_init__(self) -> None:
        last = self.ramps[-1]
        object.__setattr__(self, "ends_at", last.start + last.duration)

    def _at(self, time: float) -> tuple[float, float]:
        """Return way since the start and speed."""
        way = 0.0
        for ramp in self.ramps[:-1]:
            if time < ramp.start + ramp.duration:
                return way + ramp.way(time), ramp.speed(time)
            way += ramp.way(ramp.start + ramp.duration)
        return way + self.ramps[-1].way(time), self.ramps[-1].speed(time)

    def advanced(self, motion: Motion, until: float, world: World) -> tuple[float, float]:
        """Return way and speed of the closed form."""
        first, _ = self._at(motion.time)
        second, speed = self._at(until)
        return second - first, speed


@dataclass(frozen=True, eq=False)
class Match(Process):
    """A speed held relative to that of another entity, for good; `target` tells it some time ahead [s]."""

    target: Callable[[World, float], float]
    rates: tuple[float, float]

    def finished(self, motion: Motion, world: World) -> bool:
        """Never."""
        return False

    def advanced(self, motion: Motion, until: float, world: World) -> tuple[float, float]:
        """Go to the target's speed within the rates."""
        step = until - motion.time
        wanted = self.target(world, step)
        change = min(max(wanted - motion.speed, -self.rates[1] * step), self.rates[0] * step)
        return (motion.speed + 0.5 * change) * step, motion.speed + change


@dataclass(frozen=True, eq=False)
class KeepDistance(Process):
    """Goes to a distance to another entity and keeps it.

    The speed that is wanted is that of the other one plus 0.4 /s of the error, at most what braking in time allows; it
    is reached with a time constant of 0.4 s, within the limits.
    """

    actor: str
    other: str
    measure: Distance
    gap: float | None
    time_gap: float | None
    leads: bool | None
    is_continuous: bool
    limits: tuple[float, float, float]

    def _error(self, motion: Motion, world: World) -> float | None:
        now = self.measure.signed(world, self.actor, self.other)
        if now is None:
            return None
        wanted = self.gap if self.gap is not None else (self.time_gap or 0.0) * motion.speed
        leads = self.leads if self.leads is not None else now < 0.0
        return now + wanted if leads else now - wanted

    def finished(self, motion: Motion, world: World) -> bool:
        """Return whether distance and speed are reached, unless it goes on for good."""
        if self.is_continuous:
            return False
        error = self._error(motion, world)
        other = world.motion(self.other, self.measure.node)
        return error is not None and abs(error) < 0.05 and abs(other.speed - motion.speed) < 0.05

    def last_speed(self, world: World) -> float | None:
        """Return the speed of the other one, so that the distance stays."""
        return world.motion(self.other, self.measure.node).speed

    def advanced(self, motion: Motion, until: float, world: World) -> tuple[float, float]:
        """Return way and speed under the law above."""
        step, (gain, brake, top) = until - motion.time, self.limits
        error = self._error(motion, world)
        if error is None:
            return motion.speed * step, motion.speed
        other = world.motion(self.other, self.measure.node)
        pull = brake if error > 0.0 else gain
        wanted = other.speed + math.copysign(min(0.4 * abs(error), math.sqrt(2.0 * pull * abs(error))), error)
        wanted = min(max(wanted, 0.0), top)
        change = min(max((wanted - motion.speed) / 0.4, -brake), gain) * step
        change = max(change, -motion.speed)
        return (motion.speed + 0.5 * change) * step, motion.speed + change


@dataclass(frozen=True, eq=False)
class KeepAside(Process):
    """Goes to a lateral distance to another entity and keeps it, under the law of `KeepDistance`."""

    actor: str
    other: str
    measure: Distance
    gap: float
    side: float
    is_continuous: bool
    limits: tuple[float, float, float]

    domains = frozenset({"lateral"})

    def _error(self, world: World) -> float | None:
        """Return how far the entity has to go to the left [m]; `side` is 1 where the other is to be to its left."""
        now = self.measure.signed(world, self.actor, self.other)
        return None if now is None else now - self.side * self.gap

    def finished(self, motion: Motion, world: World) -> bool:
        """Return whether the distance is reached, unless it goes on for good."""
        error = self._error(world)
        return not self.is_continuous and error is not None and abs(error) < 0.02 and abs(motion.drift) < 0.02

    def left(self, motion: Motion, until: float, travelled: float, world: World) -> float:
        """Return the offset to the left under the law."""
        step, (gain, brake, top) = until - motion.time, self.limits
        error = self._error(world)
        if error is None:
            return motion.left
        other = world.motion(self.other, self.measure.node)
        same = 1.0 if math.cos(other.heading - motion.heading) >= 0.0 else -1.0
        wanted = math.copysign(min(0.4 * abs(error), math.sqrt(2.0 * brake * abs(error))), error) + same * other.drift
        wanted = min(max(wanted, -top), top)
        change = min(max((wanted - motion.drift) / 0.4, -brake), gain) * step
        return _within(
            motion.left + (motion.drift + change) * step, motion.left, STEEPEST * (travelled - motion.travelled)
        )


@dataclass(frozen=True, eq=False)
class Synchronize(Process):
    """Comes to a place when another entity comes to its own.

    The way is the cubic of time that leads from the present speed to the final one and covers the distance in the time
    that the other one needs at its present speed; without a final speed the acceleration is constant.
    """

    node: Node
    actor: str
    master: str
    own: Place
    others: Place
    final: Callable[[World], float] | None
    steady: tuple[float, float]

    def _left(self, world: World) -> tuple[float, float]:
        """Return the distance that is left to go [m], and the time that the master needs [s]."""
        found: list[float] = []
        for name, place in ((self.actor, self.own), (self.master, self.others)):
            motion = world.motion(name, self.node)
            away = world.ahead_on_line(name, place.x, place.y)
            if away is not None:
                pass  # along its trajectory
            elif place.spot is not None and motion.spot is not None:
                away = self._ahead(world, name, place)
                if away is None:
                    raise self.node.error(f"no road leads '{name}' to its target position")
            else:
                away = math.hypot(place.x - motion.x, place.y - motion.y)
            found.append(away)
        speed = world.motion(self.master, self.node).speed
        return found[0], found[1] / speed if speed > 1e-3 else math.inf

    @staticmethod
    def _ahead(world: World, name: str, place: Place) -> float | None:
        """Return the way to a place along the entity's lane [m], along the roads where the lane leads elsewhere."""
        spot, roads = world.motions[name].spot, world.roads
        assert spot is not None and roads is not None and place.spot is not None
        along = along_road(world, name, place.spot)
        if along is None or along <= 0.0:
            return along
        found = roads.ahead(spot, place.spot.road, place.spot.s, world.routes.get(name, ()))
        return along if found is None else found

    def finished(self, motion: Motion, world: World) -> bool:
        """Return whether the entity or its master is there."""
        away, time = self._left(world)
        return away <= 1e-3 or time <= 1e-3

    def last_speed(self, world: World) -> float | None:
        """Return the final speed."""
        return None if self.final is None else max(self.final(world), 0.0)

    def advanced(self, motion: Motion, until: float, world: World) -> tuple[float, float]:
        """Return way and speed of the cubic."""
        step, speed = until - motion.time, motion.speed
        away, time = self._left(world)
        final = None if self.final is None else max(self.final(world), 0.0)
        if math.isinf(time):
            return self._braked(motion, step)
        if final is not None:
            steady = max(self.steady[0], self.steady[1] * final)
            if steady > 0.0 and away <= steady:
                return final * step, final
            away, time = away - steady, time - (steady / final if final > 0.0 else 0.0)
        time = max(time, step)
        pull, jerk = 2.0 * (away - speed * time) / time**2, 0.0
        if final is not None:
            pull = 6.0 * away / time**2 - (4.0 * speed + 2.0 * final) / time
            jerk = 2.0 * (final - speed - pull * time) / time**2
        after = speed + step * (pull + 0.5 * jerk * step)
        if after < 0.0:
            return 0.5 * speed * step, 0.0
        return step * (speed + step * (0.5 * pull + jerk * step / 6.0)), after

    def _braked(self, motion: Motion, step: float) -> tuple[float, float]:
        """Stand while the master stands."""
        change = min(motion.speed, 2.0 * step)
        return (motion.speed - 0.5 * change) * step, motion.speed - change


@dataclass(frozen=True, eq=False)
class Shift(Process):
    """A change of the offset from the middle of a lane in a closed form of time or of the way.

    Who drives too slowly for it, or stands, goes to the side only as far as the way allows: it begins with a bend of
    radius `NARROWEST`, is nowhere steeper than `STEEPEST`, and lasts until the offset is reached.
    """

    node: Node
    start: float
    travelled: float
    before: float
    after: float
    shape: str
    duration: float
    distance: float
    is_continuous: bool = False

    domains = frozenset({"lateral"})

    def __post_init__(self) -> None:
        if self.distance <= 0.0 and not self.is_continuous:
            object.__setattr__(self, "ends_at", self.start + self.duration)

    def _part(self, time: float, travelled: float) -> float:
        if self.distance > 0.0:
            return (travelled - self.travelled) / self.distance
        return 1.0 if self.duration <= 0.0 else (time - self.start) / self.duration

    def finished(self, motion: Motion, world: World) -> bool:
        """Return whether the end of its time or way is reached, and the offset."""
        return not self.is_continuous and self._is_due(motion) and abs(motion.left - self.after) < _THERE

    def is_late(self, motion: Motion) -> bool:
        """Return whether its time or way is over before the offset is reached."""
        return self._is_due(motion) and abs(motion.left - self.after) >= _THERE

    def _is_due(self, motion: Motion) -> bool:
        return self._part(motion.time, motion.travelled) >= 1.0 - 1e-9 or motion.time >= self.ends_at - _SOON

    def left(self, motion: Motion, until: float, travelled: float, world: World) -> float:
        """Return the offset of the closed form, as far as the way allows it."""
        part = self._part(until, travelled)
        wanted = self.after if part >= 1.0 else self.before + (self.after - self.before) * share(self.shape, part)
        wanted = _within(wanted, self.before, (travelled - self.travelled) ** 2 / (2.0 * NARROWEST))
        steepest = STEEPEST
        if self.is_late(motion):  # and bends back before it is there
            bend = max(NARROWEST, motion.speed**2 / _BACK)
            steepest = min(steepest, math.sqrt(2.0 * abs(self.after - motion.left) / bend))
        return _within(wanted, motion.left, steepest * (travelled - motion.travelled))


def _within(value: float, middle: float, most: float) -> float:
    """Return the value that is nearest to one and at most so far from a middle."""
    return min(max(value, middle - most), middle + most)
