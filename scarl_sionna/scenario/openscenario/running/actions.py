"""Actions of OpenSCENARIO that decide motion: read once, and begun on each actor."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import replace
from typing import Protocol

from scarl_sionna.scenario.openscenario.reading.catalogs import Catalogs
from scarl_sionna.scenario.openscenario.reading.environment import Environment
from scarl_sionna.scenario.openscenario.reading.source import Node
from scarl_sionna.scenario.openscenario.reading.swarms import Swarm

from .distances import Distance
from .dynamics import Ramp, Transition
from .motion import Motion, World
from .positions import read_position
from .processes import HARDEST, KeepDistance, Match, Process, Speed, Synchronize
from .signals import TrafficSignals

_ONLY_FORWARDS = ("bicycle", "motorbike", "standup_scooter", "standupScooter", "wheelchair", "animal")
START = 1e-3
"""Until then a step of speed or place is that of the start [s]."""


class Stage(World, Protocol):
    """The run as actions change it."""

    time: float
    hero: str | None
    signals: TrafficSignals
    swarms: list[Swarm]

    def put(self, name: str, motion: Motion) -> None:
        """Replace the present motion of an entity."""

    def show(self, name: str, is_present: bool, node: Node) -> None:
        """Let an entity be in the scene or not from now on."""

    def surround(self, stated: Environment) -> None:
        """Let light and weather be those of an environment from now on."""


class Action(ABC):
    """An action as the file states it."""

    def __init__(self, node: Node) -> None:
        self.node = node

    @abstractmethod
    def begin(self, stage: Stage, actor: str) -> Process | None:
        """Begin on an actor; returns what goes on, None for what is done at once."""


class SpeedAction(Action):
    """LongitudinalAction/SpeedAction."""

    def __init__(self, node: Node) -> None:
        super().__init__(node)
        self._dynamics = Transition.read(node.need("SpeedActionDynamics"))
        self._target = node.need("SpeedActionTarget").only()
        if self._target.tag == "AbsoluteTargetSpeed":
            self._value = self._target.number("value", unit="m/s")
            self._is_continuous = False
        elif self._target.tag == "RelativeTargetSpeed":
            self._value = self._target.number("value")
            self._kind = self._target.choice("speedTargetValueType", ("delta", "factor"), "delta")
            self._is_continuous = self._target.truth("continuous", False)
            self._other = self._target.text("entityRef")
        else:
            raise self._target.unsupported("AbsoluteTargetSpeed and RelativeTargetSpeed are read")

    def _wanted(self, world: World, ahead: float = 0.0) -> float:
        if self._target.tag == "AbsoluteTargetSpeed":
            found = self._value
        else:
            motion = world.motion(self._other, self._target)
            other = motion.speed + ahead * motion.acceleration
            found = other * self._value if self._kind == "factor" else other + self._value
        return 0.0 if abs(found) < 1e-9 else found

    def begin(self, stage: Stage, actor: str) -> Process | None:
        """Begin the transition to the target's speed now."""
        motion, limits = stage.motions[actor], limits_of(stage, actor)
        if self._is_continuous:
            rates = limits
            if self._dynamics.shape != "step" and self._dynamics.dimension == "rate":
                rates = (self._dynamics.value, self._dynamics.value)
            check_backwards(stage, actor, self._wanted(stage), self._target)
            if stage.time <= START and self._dynamics.shape == "step":
                stage.put(actor, at_speed(motion, self._wanted(stage)))
            return Match(self._wanted, rates)
        wanted = self._wanted(stage)
        check_backwards(stage, actor, wanted, self._target)
        ramp = ramp_to(stage.time, motion.speed, wanted, self._dynamics, limits, self.node)
        if ramp.duration <= 0.0:
            stage.put(actor, at_speed(motion, wanted))
            return None
        return Speed((ramp,))


class SpeedProfileAction(Action):
    """LongitudinalAction/SpeedProfileAction (1.2): speeds one after the other, linear between them."""

    def __init__(self, node: Node) -> None:
        super().__init__(node)
        self._entries = node.children("SpeedProfileEntry")
        if not self._entries:
            raise node.error("has no <SpeedProfileEntry>")
        self._speeds = [one.number("speed", unit="m/s") for one in self._entries]
        self._times = [one.number("time", 0.0, 0.0) if one.has("time") else None for one in self._entries]
        self._other = node.text("entityRef", "")
        constraints = node.child("DynamicConstraints")
        self._limits = (
            (math.inf, math.inf)
            if constraints is None
            else (
                constraints.limit("maxAcceleration"),
                constraints.limit("maxDeceleration"),
            )
        )

    def begin(self, stage: Stage, actor: str) -> Process | None:
        """Begin the first ramp now; the time of an entry is that since the one before."""
        own = limits_of(stage, actor)
        limits = (min(self._limits[0], own[0]), min(self._limits[1], own[1]))
        base = stage.motion(self._other, self.node).speed if self._other else 0.0
        start, speed, ramps = stage.time, stage.motions[actor].speed, []
        for entry, wanted, time in zip(self._entries, self._speeds, self._times, strict=True):
            target = base + wanted
            check_backwards(stage, actor, target, entry)
            least = abs(target - speed) / (limits[0] if abs(target) > abs(speed) else limits[1])
            duration = least if time is None else time
            if duration < least - 1e-9 and start > START:
                duration = least
            ramps.append(Ramp(start, speed, target, "linear", duration))
            start, speed = start + duration, target
        return Speed(tuple(ramps))


class DistanceAction(Action):
    """LongitudinalAction/LongitudinalDistanceAction."""

    def __init__(self, node: Node) -> None:
        super().__init__(node)
        self._other = node.text("entityRef")
        self._measure = Distance(node, "longitudinal")
        if node.has("distance") == node.has("timeGap"):
            raise node.error("needs one of 'distance' and 'timeGap'")
        self._gap = node.number("distance", low=0.0, unit="m") if node.has("distance") else None
        self._time_gap = node.number("timeGap", low=0.0, unit="s") if node.has("timeGap") else None
        leads = node.choice("displacement", ("any", "trailingReferencedEntity", "leadingReferencedEntity"), "any")
        self._leads = None if leads == "any" else leads == "leadingReferencedEntity"
        self._is_continuous = node.truth("continuous", False)
        constraints = node.child("DynamicConstraints")
        names = ("maxAcceleration", "maxDeceleration", "maxSpeed")
        self._limits = [math.inf] * 3 if constraints is None else [constraints.limit(name) for name in names]

    def begin(self, stage: Stage, actor: str) -> Process | None:
        """Begin to keep the distance."""
        gain, brake = limits_of(stage, actor)
        stage.motion(self._other, self.node)
        limits = (min(self._limits[0], gain), min(self._limits[1], brake), self._limits[2])
        if self._measure.signed(stage, actor, self._other) is None:
            raise self.node.error(f"no road leads from '{actor}' to '{self._other}'")
        return KeepDistance(
            actor, self._other, self._measure, self._gap, self._time_gap, self._leads, self._is_continuous, limits
        )


class SynchronizeAction(Action):
    """PrivateAction/SynchronizeAction."""

    def __init__(self, node: Node, catalogs: Catalogs) -> None:
        super().__init__(node)
        self._master = node.text("masterEntityRef")
        self._others = read_position(node.need("TargetPositionMaster"), catalogs)
        self._own = read_position(node.need("TargetPosition"), catalogs)
        final = node.child("FinalSpeed")
        self._final = None if final is None else final.only()
        self._steady = (0.0, 0.0)
        if self._final is not None:
            if self._final.tag not in ("AbsoluteSpeed", "RelativeSpeedToMaster"):
                raise self._final.unsupported("AbsoluteSpeed and RelativeSpeedToMaster are read")
            name = "value" if self._final.has("value") else "speed"
            self._value = self._final.number(name, unit="m/s")
            self._kind = self._final.choice("speedTargetValueType", ("delta", "factor"), "delta")
            distance, time = (self._final.child(f"Target{kind}SteadyState") for kind in ("Distance", "Time"))
            self._steady = (
                0.0 if distance is None else distance.number("distance", low=0.0),
                0.0 if time is None else time.number("time", low=0.0),
            )

    def begin(self, stage: Stage, actor: str) -> Process | None:
        """Begin with the target positions as they are now."""
        stage.motion(self._master, self.node)
        final: Callable[[World], float] | None = None
        if self._final is not None:
            final = self._final_speed
        return Synchronize(
            self.node,
            actor,
            self._master,
            self._own.place(stage),
            self._others.place(stage),
            final,
            self._steady,
        )

    def _final_speed(self, world: World) -> float:
        assert self._final is not None
        if self._final.tag == "AbsoluteSpeed":
            return self._value
        master = world.motion(self._master, self._final).speed
        return master * self._value if self._kind == "factor" else master + self._value


def at_speed(motion: Motion, speed: float) -> Motion:
    """Return a motion with another speed."""
    return replace(motion, speed=speed)


def check_backwards(world: World, actor: str, speed: float, node: Node) -> None:
    """Raise where somebody would go backwards who does not: people, two-wheelers, and what is no vehicle."""
    entity = world.entities[actor]
    if speed < 0.0 and (entity.kind != "vehicle" or entity.category in _ONLY_FORWARDS):
        raise node.unsupported(
            "let it turn round; vehicles on four wheels or more go backwards",
            f"asks for {speed:g} m/s of '{actor}' ({entity.category})",
        )


def limits_of(world: World, actor: str) -> tuple[float, float]:
    """Return the largest acceleration and deceleration of an entity [m/s2]."""
    entity = world.entities[actor]
    return min(entity.max_acceleration, HARDEST), min(entity.max_deceleration, HARDEST)


def ramp_to(
    time: float, speed: float, wanted: float, dynamics: Transition, limits: tuple[float, float], node: Node
) -> Ramp:
    """Return the ramp to a speed; a step during the run is made with the entity's largest acceleration."""
    change = wanted - speed
    if dynamics.shape == "step" or (dynamics.dimension == "time" and dynamics.value <= 0.0):
        if time <= START or abs(change) < 1e-6:
            return Ramp(time, speed, wanted, "linear", 0.0)
        gains = abs(wanted) > abs(speed)
        return Ramp(time, speed, wanted, "linear", abs(change) / (limits[0] if gains else limits[1]))
    if dynamics.dimension == "distance":
        if speed * wanted < 0.0:
            raise node.unsupported("give a rate or a time", f"turns from {speed:g} to {wanted:g} m/s over a distance")
        total = abs(speed + wanted)
        if total <= 0.0:
            return Ramp(time, speed, wanted, dynamics.shape, 0.0)
        return Ramp(time, speed, wanted, dynamics.shape, 2.0 * dynamics.value / total)
    return Ramp(time, speed, wanted, dynamics.shape, dynamics.time(change, node))
