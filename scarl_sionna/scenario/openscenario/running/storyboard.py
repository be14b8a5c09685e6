"""The storyboard as a state machine: stories, acts, groups, maneuvers and events, and when each begins and ends."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from typing import Protocol

from scarl_sionna.scenario.openscenario.reading.catalogs import Catalogs
from scarl_sionna.scenario.openscenario.reading.source import Node

from .actions import Action
from .actions import Stage as ActionStage
from .conditions import Stage as ConditionStage
from .processes import Process
from .registry import read_action
from .triggers import Trigger, read_trigger

STANDBY, RUNNING, COMPLETE = "standbyState", "runningState", "completeState"
START, END, STOP, SKIP = "startTransition", "endTransition", "stopTransition", "skipTransition"
_MOST_EXECUTIONS = 10_000
_MOST_ELEMENTS = 20_000
GLOBAL = (
    "InfrastructureAction",
    "EnvironmentAction",
    "ParameterAction",
    "VariableAction",
    "EntityAction",
    "TrafficAction",
    "SetMonitorAction",
)
"""Actions that nobody in particular does."""


@dataclass(eq=False)
class Running:
    """A process that an event, or the start, runs on an actor."""

    process: Process
    actor: str
    is_over: bool = False


class Stage(ActionStage, ConditionStage, Protocol):
    """The run as the storyboard sees and changes it."""

    def run(self, action: Action, actor: str) -> Running | None:
        """Begin an action; a process takes the place of the one of its domain."""

    def stop(self, running: Running) -> None:
        """End a process before its time."""

    def asked(self, trigger: Trigger) -> None:
        """Take note that a trigger was asked at this instant."""

    def changed(self, element: Element, transition: str) -> None:
        """Take note of a transition."""


class Element:
    """One element: its kind as conditions name it, its name and state."""

    def __init__(self, kind: str, node: Node) -> None:
        self.kind, self.node, self.name = kind, node, node.name()
        self.state = STANDBY

    def begin(self, stage: Stage) -> None:
        """Go to the running state."""
        self.state = RUNNING
        stage.changed(self, START)

    def finish(self, stage: Stage, transition: str = END) -> None:
        """Go to the complete state."""
        self.state = COMPLETE
        stage.changed(self, transition)


class Event(Element):
    """An event with its actions, which run on all actors of its group."""

    def __init__(self, node: Node, catalogs: Catalogs, actors: list[str]) -> None:
        super().__init__("event", node)
        self.actors = actors
        priority = node.choice("priority", ("overwrite", "override", "skip", "parallel"))
        self.priority = "override" if priority == "overwrite" else priority
        self._most = node.whole("maximumExecutionCount", 1)
        if not 1 <= self._most <= _MOST_EXECUTIONS:
            raise node.error(f"maximumExecutionCount = {self._most} is outside 1 to {_MOST_EXECUTIONS}")
        self.trigger = read_trigger(node, "StartTrigger", catalogs)
        self._actions: list[tuple[Element, list[Action]]] = []
        for one in node.children("Action"):
            self._actions.append((Element("action", one), read_action(one, catalogs)))
        if not self._actions:
            raise node.error("has no <Action>")
        self._running: list[tuple[Element, list[Running]]] = []
        self._count = 0
        self.tried_at = -1.0  # it begins once at an instant

    def elements(self) -> Iterator[Element]:
        """Yield it and its actions."""
        yield self
        for element, _ in self._actions:
            yield element

    def reset(self) -> None:
        """Be as before the first start."""
        self.state, self._count, self.tried_at = STANDBY, 0, -1.0
        for element, _ in self._actions:
            element.state = STANDBY

    def start(self, stage: Stage) -> None:
        """Begin all actions on all actors."""
        self.begin(stage)
        self._count += 1
        self._running = []
        for element, actions in self._actions:
            element.begin(stage)
            begun = []
            for action in actions:
                is_global = not _is_private(action)
                for actor in [""] if is_global else self.actors:
                    running = stage.run(action, actor)
                    begun += [] if running is None else [running]
            self._running.append((element, begun))

    def update(self, stage: Stage) -> bool:
        """End the actions whose processes are over, then itself; returns whether something changed."""
        changed = False
        for element, begun in self._running:
            if element.state == RUNNING and all(one.is_over for one in begun):
                element.finish(stage)
                changed = True
        if all(element.state == COMPLETE for element, _ in self._running):
            if self._count >= self._most:
                self.finish(stage)
            else:
                self.state = STANDBY
                stage.changed(self, END)
            return True
        return changed

    def halt(self, stage: Stage) -> None:
        """Stop what runs, for good."""
        for element, begun in self._running:
            if element.state == RUNNING:
                for one in begun:
                    stage.stop(one)
                element.finish(stage, STOP)
        self.finish(stage, STOP)


def _is_private(action: Action) -> bool:
    """Return whether an action is done by actors."""
    return action.node.tag not in GLOBAL


class Maneuver(Element):
    """Events that can stop each other."""

    def __init__(self, node: Node, catalogs: Catalogs, actors: list[str]) -> None:
        node = node.declared()
        super().__init__("maneuver", node)
        self.events: list[Event] = []
        for one in node.children("Event"):
            with node.problems.collected():
                self.events.append(Event(one, catalogs, actors))

    def update(self, stage: Stage) -> bool:
        """Start and end events; returns whether something changed."""
        changed = False
        for event in self.events:
            if event.state == RUNNING:
                changed |= event.update(stage)
        for event in self.events:
            if event.state != STANDBY or event.tried_at == stage.time:
                continue
            fires = event.trigger is None or event.trigger.holds(stage)
            if event.trigger is not None:
                stage.asked(event.trigger)
            if fires:
                changed |= self._start(event, stage)
        if self.state == RUNNING and all(event.state == COMPLETE for event in self.events):
            self.finish(stage)
            changed = True
        return changed

    def _start(self, event: Event, stage: Stage) -> bool:
        event.tried_at = stage.time
        others = [one for one in self.events if one is not event and one.state == RUNNING]
        if event.priority == "skip" and others:
            stage.changed(event, SKIP)
            return False
        if event.priority == "override":
            for one in others:
                one.halt(stage)
        event.start(stage)
        return True


class Group(Element):
    """A ManeuverGroup: maneuvers and those who do them, who are among the entities `known`."""

    def __init__(self, node: Node, catalogs: Catalogs, known: Collection[str]) -> None:
        super().__init__("maneuverGroup", node)
        actors = node.child("Actors")
        if actors is not None and actors.truth("selectTriggeringEntities", False):
            raise actors.unsupported("name the actors", "with selectTriggeringEntities is not read")
        names = []
        for one in [] if actors is None else actors.children("EntityRef"):
            names.append(one.text("entityRef"))
            if names[-1] not in known:
                raise one.error(f"'{names[-1]}' is no entity", f"known: {', '.join(known)}")
        self.actors = names
        self._most = node.whole("maximumExecutionCount", 1)
        self._count = 0
        self.maneuvers: list[Maneuver] = []
        for one in node.children("Maneuver", "CatalogReference"):
            with node.problems.collected():
                found = catalogs.resolve(one) if one.tag == "CatalogReference" else one
                self.maneuvers.append(Maneuver(found, catalogs, names))

    def start(self, stage: Stage) -> None:
        """Begin with all maneuvers."""
        self.begin(stage)
        self._count += 1
        for one in self.maneuvers:
            for event in one.events:
                event.reset()
            one.begin(stage)

    def update(self, stage: Stage) -> bool:
        """Run the maneuvers; returns whether something changed."""
        changed = False
        for one in self.maneuvers:
            if one.state == RUNNING:
                changed |= one.update(stage)
        if all(one.state == COMPLETE for one in self.maneuvers):
            if self._count < self._most and self.maneuvers:
                stage.changed(self, END)
                self.start(stage)
            else:
                self.finish(stage)
            changed = True
        return changed


class Act(Element):
    """An act with its groups."""

    def __init__(self, node: Node, catalogs: Catalogs, known: Collection[str]) -> None:
        super().__init__("act", node)
        self.start_trigger = read_trigger(node, "StartTrigger", catalogs)
        self.stop_trigger = read_trigger(node, "StopTrigger", catalogs)
        self.groups: list[Group] = []
        for one in node.children("ManeuverGroup"):
            with node.problems.collected():
                self.groups.append(Group(one, catalogs, known))

    def update(self, stage: Stage) -> bool:
        """Begin, run or end it; returns whether something changed."""
        if self.state == STANDBY:
            if not _fires(self.start_trigger, stage, default=True):
                return False
            self.begin(stage)
            for group in self.groups:
                group.start(stage)
            return True
        if self.state == COMPLETE:
            return False
        if _fires(self.stop_trigger, stage, default=False):
            self.halt(stage)
            return True
        changed = False
        for group in self.groups:
            if group.state == RUNNING:
                changed |= group.update(stage)
        if all(group.state == COMPLETE for group in self.groups):
            self.finish(stage)
            changed = True
        return changed

    def halt(self, stage: Stage) -> None:
        """Stop all that runs inside."""
        for group in self.groups:
            for maneuver in group.maneuvers:
                for event in maneuver.events:
                    if event.state == RUNNING:
                        event.halt(stage)
                if maneuver.state == RUNNING:
                    maneuver.finish(stage, STOP)
            if group.state == RUNNING:
                group.finish(stage, STOP)
        self.finish(stage, STOP)


class Story(Element):
    """A story with its acts."""

    def __init__(self, node: Node, catalogs: Catalogs, known: Collection[str]) -> None:
        node = node.declared()
        super().__init__("story", node)
        self.acts: list[Act] = []
        for one in node.children("Act"):
            with node.problems.collected():
                self.acts.append(Act(one, catalogs, known))

    def update(self, stage: Stage) -> bool:
        """Run the acts; returns whether something changed."""
        changed = False
        for act in self.acts:
            changed |= act.update(stage)
        if self.state == RUNNING and all(act.state == COMPLETE for act in self.acts):
            self.finish(stage)
            changed = True
        return changed


class Storyboard:
    """All stories, and the trigger that ends the run; `known` are the names of the entities."""

    def __init__(self, node: Node, catalogs: Catalogs, known: Collection[str]) -> None:
        self.stories: list[Story] = []
        for one in node.children("Story"):
            with node.problems.collected():
                self.stories.append(Story(one, catalogs, known))
        self.stop_trigger: Trigger | None = None
        with node.problems.collected():
            self.stop_trigger = read_trigger(node, "StopTrigger", catalogs)
        self.elements = list(self._all())
        if len(self.elements) > _MOST_ELEMENTS:
            raise node.error(f"has more than {_MOST_ELEMENTS} elements")

    def _all(self) -> Iterator[Element]:
        for story in self.stories:
            yield story
            for act in story.acts:
                yield act
                for group in act.groups:
                    yield group
                    for maneuver in group.maneuvers:
                        yield maneuver
                        for event in maneuver.events:
                            yield from event.elements()

    def begin(self, stage: Stage) -> None:
        """Begin with all stories."""
        for story in self.stories:
            story.begin(stage)

    def update(self, stage: Stage) -> bool:
        """Do what is due at this instant; returns whether something changed."""
        changed = False
        for story in self.stories:
            changed |= story.update(stage)
        return changed

    def listening(self) -> list[Trigger]:
        """Return the triggers that are asked now."""
        found: list[Trigger | None] = []
        for story in self.stories:
            for act in story.acts:
                if act.state == STANDBY:
                    found.append(act.start_trigger)
                if act.state != RUNNING:
                    continue
                found.append(act.stop_trigger)
                for group in act.groups:
                    for maneuver in group.maneuvers if group.state == RUNNING else ():
                        found += [one.trigger for one in maneuver.events if one.state == STANDBY]
        return [one for one in found if one is not None]


def _fires(trigger: Trigger | None, stage: Stage, *, default: bool) -> bool:
    if trigger is None:
        return default
    found = trigger.holds(stage)
    stage.asked(trigger)
    return found
