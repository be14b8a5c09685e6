"""Runs a storyboard: steps of 10 ms with the motion in closed form, cut where something begins or ends."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

from scarl_sionna.core.errors import ScenarioError
from scarl_sionna.scenario.openscenario.reading.entities import Entity
from scarl_sionna.scenario.openscenario.reading.environment import Clock, Environment, Surroundings
from scarl_sionna.scenario.openscenario.reading.source import Node
from scarl_sionna.scenario.openscenario.reading.swarms import Swarm
from scarl_sionna.scenario.openscenario.roads.network import Roads, Spot

from .actions import START, Action
from .motion import Motion
from .placing import FollowTrajectoryAction, TeleportAction, at_place
from .positions import placed
from .processes import Process, Shift
from .shapes import Follow
from .signals import TrafficSignals
from .storyboard import Element, Running, Storyboard
from .triggers import Trigger

STEP = 0.01
"""Longest step [s]."""
EXACT = 2e-6
"""Time to which the instant is found at which a condition becomes true, or an action has done its work [s]."""
LONGEST = 300.0
"""Longest run [s]."""
AFTER = 1.0
"""How long a run goes on after its end [s]: sensors look at instants within a frame."""
SUN_STEP = 60.0
"""Light follows a time of day that goes on in steps of so long [s]: the sun moves by 0.25 deg, half its diameter."""
_MOST_ROUNDS = 200
MOST_STATES = 1_500_000
"""States of entities in a run."""


@dataclass
class Run:
    """What a run leaves.

    Attributes
    ----------
    tracks : dict
        Motions of each entity, in the order of time.
    stop : float
        When the storyboard ends, or the run is cut [s].
    reason : str
        Why it ends.
    seen : dict
        Times from and to which each entity is in the scene [s].
    surroundings : list of (float, dict)
        Times [s] and the `lighting` and `weather` from then on, as a scenario file states them; the first are those of
        the start.
    signals : dict
        What signals show, by their id: times [s] and the state from then on.
    swarms : list of Swarm
    """

    tracks: dict[str, list[Motion]]
    stop: float
    reason: str
    seen: dict[str, list[tuple[float, float]]]
    surroundings: list[tuple[float, dict[str, Any]]] = field(default_factory=list)
    signals: dict[str, list[tuple[float, str]]] = field(default_factory=dict)
    swarms: list[Swarm] = field(default_factory=list)


class Simulation:
    """A storyboard that runs; the world that positions, conditions and actions see.

    Parameters
    ----------
    roads : Roads or None
    entities : mapping of str to Entity
    parameters : mapping of str to str
    storyboard : Storyboard
    hero : str or None
        The run ends where it leaves the roads.
    """

    def __init__(
        self,
        roads: Roads | None,
        entities: Mapping[str, Entity],
        parameters: Mapping[str, str],
        storyboard: Storyboard,
        hero: str | None,
    ) -> None:
        self.roads, self.entities, self.parameters = roads, dict(entities), dict(parameters)
        self.motions: dict[str, Motion] = {}
        self.routes: dict[str, tuple[str, ...]] = {}
        self.time = 0.0
        self.signals = TrafficSignals()
        self.swarms: list[Swarm] = []
        self._surroundings = Surroundings()
        self._environments: list[tuple[float, dict[str, Any]]] = []
        self._noted = 0.0
        self._board, self.hero = storyboard, hero
        self._running: dict[tuple[str, str], Running] = {}
        self._now: list[tuple[Element, str]] = []
        self._next: list[tuple[Element, str]] = []
        self._asked: dict[int, Trigger] = {}
        self._seen: dict[str, list[tuple[float, float]]] = {}
        self._true: set[int] = set()
        self._has_ended = False

    def motion(self, name: str, node: Node) -> Motion:
        """Return the present motion of an entity that an element names."""
        if name not in self.entities:
            raise node.error(f"'{name}' is no entity", f"known: {', '.join(self.entities)}")
        if name not in self.motions:
            raise node.error(f"'{name}' has no place at {self.time:.4g} s", "give it a TeleportAction in <Init>")
        return self.motions[name]

    def ahead_on_line(self, name: str, x: float, y: float) -> float | None:
        """Return the way along the trajectory that an entity follows to a point [m]; None where it follows none."""
        running = self._running.get((name, "lateral"))
        if running is None or not isinstance(running.process, Follow):
            return None
        return running.process.line.nearest(x, y) - self.motions[name].along

    def put(self, name: str, motion: Motion) -> None:
        """Replace the present motion of an entity."""
        self.motions[name] = motion

    def show(self, name: str, is_present: bool, node: Node) -> None:
        """Let an entity be in the scene or not from now on."""
        self.motions[name] = replace(self.motion(name, node), is_present=is_present)

    def surround(self, stated: Environment) -> None:
        """Let light and weather be those of an environment from now on."""
        self._surroundings.take(stated, self.time)
        self._note_surroundings(self.time)

    @property
    def clock(self) -> Clock | None:
        """The time of day, where it is stated."""
        return self._surroundings.clock

    def _note_surroundings(self, time: float) -> None:
        """Take note of light and weather from a time on [s]; what changes within `START` is one change."""
        self._noted, before = time, self._environments
        if before and time - before[-1][0] < START:
            time = before.pop()[0]
        found = self._surroundings.at(time)
        if not before or before[-1][1] != found:
            before.append((0.0 if time < START else time, found))

    def element_state(self, kind: str, name: str, state: str, node: Node) -> bool:
        """Return whether an element of the storyboard is in a state, or in a transition right now."""
        wanted = name.split("::")[-1].split(":")[-1]
        found = [one for one in self._board.elements if one.kind == kind and one.name in (name, wanted)]
        if not found:
            raise node.error(f"there is no {kind} '{name}'")
        if state.endswith("State"):
            return any(one.state == state for one in found)
        return any(element in found and transition == state for element, transition in self._now)

    def changed(self, element: Element, transition: str) -> None:
        """Take note of a transition; conditions see it in the next round of this instant."""
        self._next.append((element, transition))

    def asked(self, trigger: Trigger) -> None:
        """Take note that a trigger was asked at this instant."""
        self._asked[id(trigger)] = trigger

    def run(self, action: Action, actor: str) -> Running | None:
        """Begin an action; a process takes the place of the one of its domain."""
        if actor:
            self.motion(actor, action.node)
        process = action.begin(self, actor)
        if process is None:
            for domain in _domains_at_once(action):
                self._end(actor, domain)
            return None
        running = Running(process, actor)
        for domain in process.domains:
            self._end(actor, domain)
        for domain in process.domains:
            self._running[actor, domain] = running
        return running

    def _end(self, actor: str, domain: str) -> None:
        before = self._running.pop((actor, domain), None)
        if before is not None:
            self.stop(before)

    def stop(self, running: Running) -> None:
        """End a process before its time, or at it."""
        running.is_over = True
        for key, one in list(self._running.items()):
            if one is running:
                del self._running[key]
        if isinstance(running.process, Follow):
            self._leave(running.actor)

    def _leave(self, actor: str) -> None:
        """Let an entity go on along the roads from where its trajectory ends."""
        motion = self.motions[actor]
        place = placed(self.roads, motion.x, motion.y, motion.heading)
        self.motions[actor] = replace(motion, spot=place.spot, left=place.left, beyond=0.0, drift=0.0)

    def start(self, actions: list[tuple[Action, str]]) -> None:
        """Do the actions of <Init>: those that give a place, in an order in which each knows what it refers to.

        Then the others, in the order of the file.
        """
        placed_first = {actor for action, actor in actions if isinstance(action, TeleportAction)}
        waiting = [one for one in actions if isinstance(one[0], TeleportAction | FollowTrajectoryAction)]
        while waiting:
            left, problem = [], None
            for action, actor in waiting:
                try:
                    if isinstance(action, TeleportAction):
                        action.begin(self, actor)
                    elif isinstance(action, FollowTrajectoryAction) and actor not in placed_first:
                        self.motions[actor] = at_place(action.first_place(self), self.time)
                except ScenarioError as error:
                    problem = problem or error
                    left.append((action, actor))
            if problem is not None and len(left) == len(waiting):
                raise problem
            waiting = left
        for action, actor in actions:
            if not isinstance(action, TeleportAction):
                self.run(action, actor)

    def simulate(self, longest: float = LONGEST) -> Run:
        """Run the storyboard to its end and return the motions."""
        tracks: dict[str, list[Motion]] = {name: [] for name in self.entities}
        self._board.begin(self)
        stop, reason = math.inf, ""
        states = 0
        while True:
            ended = self._settle()
            self.signals.note(self.time)
            for name, motion in self.motions.items():
                tracks[name].append(motion)
                self._note_presence(name, motion)
            states += len(self.motions)
            if math.isinf(stop):
                stop, reason = self._end_of_run(ended, longest, states)
            if self.time >= stop + AFTER - 1e-9 or states > 2 * MOST_STATES:
                end = min(stop, self.time)
                return Run(tracks, end, reason, self._seen, self._environments, self.signals.shown, self.swarms)
            self._advance()
            if self.clock is not None and self.clock.goes_on and self.time >= self._noted + SUN_STEP:
                self._note_surroundings(self._noted + SUN_STEP)

    def _end_of_run(self, ended: bool, longest: float, states: int) -> tuple[float, str]:
        if ended:
            return self.time, "StopTrigger"
        hero = None if self.hero is None else self.motions.get(self.hero)
        if hero is not None and hero.beyond > 0.0:
            return self.time, f"'{self.hero}' comes to the end of the roads"
        if self.time >= longest - 1e-9:
            return self.time, f"no StopTrigger within {longest:g} s"
        if states > MOST_STATES:
            return self.time, f"more than {MOST_STATES} states of entities"
        return math.inf, ""

    def _note_presence(self, name: str, motion: Motion) -> None:
        spans = self._seen.setdefault(name, [])
        is_there = motion.is_present and motion.beyond <= 0.0
        if is_there and (not spans or not math.isinf(spans[-1][1])):
            spans.append((motion.time, math.inf))
        elif not is_there and spans and math.isinf(spans[-1][1]):
            spans[-1] = (spans[-1][0], motion.time)

    def _settle(self) -> bool:
        """Do all that is due at this instant, round after round; returns whether the run ends."""
        for running in {id(one): one for one in self._running.values()}.values():
            if running.process.finished(self.motions[running.actor], self):
                self.stop(running)
                speed = running.process.last_speed(self)
                if speed is not None:
                    self.put(running.actor, replace(self.motions[running.actor], speed=speed))
            elif isinstance(running.process, Shift) and running.process.is_late(self.motions[running.actor]):
                said = f"'{running.actor}' drives too little meanwhile: it goes to the side only as far as it drives"
                running.process.node.note(said)
        ends = False
        self._now, self._next = self._next, []
        for _ in range(_MOST_ROUNDS):
            self._asked = {}
            trigger = self._board.stop_trigger
            if trigger is not None:
                ends = ends or trigger.holds(self)
                self.asked(trigger)
            changed = self._board.update(self)
            for one in self._asked.values():
                one.keep(self)
            self._now, self._next = self._next, []
            if not changed and not self._now:
                break
        self._has_ended = self._has_ended or ends
        self._true = {id(one) for one in self._listening() if one.holds(self)}
        return ends

    def _advance(self) -> None:
        """Go on by a step, or to where the next thing happens."""
        until = self.time + STEP
        for one in self._running.values():
            if one.process.ends_at > self.time + EXACT:
                until = min(until, one.process.ends_at)
        start, motions = self.time, self.motions
        if self._happens(start, motions, until):
            low, high = start, until
            while high - low > EXACT:
                middle = 0.5 * (low + high)
                if self._happens(start, motions, middle):
                    high = middle
                else:
                    low = middle
            until = high
        self.time, self.motions = until, self._moved(start, motions, until)

    def _happens(self, start: float, motions: dict[str, Motion], until: float) -> bool:
        """Return whether something would begin or end after a step until a time."""
        self.time, self.motions = until, self._moved(start, motions, until)
        try:
            listening = self._listening()
            if any(trigger.holds(self) for trigger in listening if id(trigger) not in self._true):
                return True
            if any(trigger.stirs(self) for trigger in listening):
                return True
            if any(one.speed * motions[name].speed < 0.0 for name, one in self.motions.items()):
                return True  # it changes its direction
            return any(
                one.process.ends_at > until + EXACT and one.process.finished(self.motions[one.actor], self)
                for one in self._running.values()
            )
        finally:
            self.time, self.motions = start, motions

    def _listening(self) -> list[Trigger]:
        last = self._board.stop_trigger
        return self._board.listening() + ([] if last is None or self._has_ended else [last])

    def _moved(self, start: float, motions: dict[str, Motion], until: float) -> dict[str, Motion]:
        self.time, self.motions = start, motions
        return {name: self._step(name, motion, until) for name, motion in motions.items()}

    def _step(self, name: str, motion: Motion, until: float) -> Motion:
        lead, side = self._running.get((name, "longitudinal")), self._running.get((name, "lateral"))
        step = until - motion.time
        if lead is None:
            way, speed = motion.speed * step, motion.speed
        else:
            way, speed = lead.process.advanced(motion, until, self)
        pull = (speed - motion.speed) / step if step > 1e-9 else motion.acceleration
        gone = _Gone(until, way, speed, pull)
        if side is not None and isinstance(side.process, Follow):
            return self._on_line(motion, side.process, gone)
        return self._on_lane(name, motion, None if side is None else side.process, gone)

    def _on_line(self, motion: Motion, follow: Follow, gone: _Gone) -> Motion:
        along = min(max(motion.along + follow.facing * gone.way, 0.0), follow.line.length)
        x, y, heading = follow.line.at(along)
        heading += 0.0 if follow.facing > 0 else math.pi
        place = placed(self.roads, x, y, heading, near=motion.spot)
        return Motion(
            gone.until,
            x,
            y,
            heading,
            gone.speed,
            gone.pull,
            motion.travelled + abs(gone.way),
            place.spot,
            place.left,
            0.0,
            along,
            0.0,
            motion.z,
            motion.is_present,
            motion.leap,
        )

    def _on_lane(self, name: str, motion: Motion, side: Process | None, gone: _Gone) -> Motion:
        until, way, speed, pull = gone
        travelled = motion.travelled + abs(way)
        if self.roads is None or motion.spot is None:
            x, y = motion.x + way * math.cos(motion.heading), motion.y + way * math.sin(motion.heading)
            return replace(motion, time=until, x=x, y=y, speed=speed, acceleration=pull, travelled=travelled)
        step, left, beyond = until - motion.time, motion.left, motion.beyond
        spot = motion.spot
        if side is not None:
            left = side.left(motion, until, travelled, self)
        drift = (left - motion.left) / step if step > 1e-9 else motion.drift
        if beyond > 0.0:
            beyond += abs(way)
        elif way != 0.0:
            mean = 0.5 * (left + motion.left)
            spot, moved, beyond = self._gone(motion.spot, way, mean, self.routes.get(name, ()))
            left += moved - mean if side is None else 0.0
        t = self.roads.middle(spot) + spot.way * left
        x, y, along = self.roads.point(spot.road, spot.s, t)
        heading = along + (0.0 if spot.way > 0 else math.pi)
        away = math.copysign(beyond, speed)
        x, y = x + away * math.cos(heading), y + away * math.sin(heading)
        if abs(speed) > 0.05:
            heading += math.atan(drift / speed)
        return Motion(
            until, x, y, heading, speed, pull, travelled, spot, left, beyond, 0.0, drift, motion.z, motion.is_present,
            motion.leap,
        )  # fmt: skip # values in their order

    def _gone(self, spot: Spot, way: float, left: float, route: tuple[str, ...]) -> tuple[Spot, float, float]:
        """Return spot, offset to the left and what is beyond the roads after a way [m], against its heading if < 0."""
        assert self.roads is not None
        if way > 0.0:
            return self.roads.move(spot, way, left, route)
        found, right, beyond = self.roads.move(replace(spot, way=-spot.way), -way, -left, route)
        return replace(found, way=-found.way), -right, beyond


class _Gone(NamedTuple):
    """A step: when it ends [s], the way [m], the speed then [m/s] and the acceleration [m/s2]."""

    until: float
    way: float
    speed: float
    pull: float


def _domains_at_once(action: Action) -> tuple[str, ...]:
    """Return the domains that an action takes which is done at once."""
    name = type(action).__name__
    if isinstance(action, TeleportAction):
        return ("lateral",) if action.has_carried else ()
    if name in ("SpeedAction", "SpeedProfileAction"):
        return ("longitudinal",)
    return ("lateral",) if name in ("LaneChangeAction", "LaneOffsetAction") else ()
