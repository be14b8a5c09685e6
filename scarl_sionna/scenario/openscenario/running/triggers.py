"""Triggers: groups of conditions with edges and delays, asked at instants and between them."""

from __future__ import annotations

import math

from scarl_sionna.scenario.openscenario.reading.catalogs import Catalogs
from scarl_sionna.scenario.openscenario.reading.source import Node

from .conditions import Stage, Test, read_test, read_value_test

_EDGES = ("rising", "falling", "risingOrFalling", "none")
_MOST_FIRINGS = 1000


class Condition:
    """A condition with its edge and delay.

    An edge is true at the instant of the change; the first time that a condition is asked there was none before. With a
    delay it is what it was that long ago.
    """

    def __init__(self, node: Node, catalogs: Catalogs) -> None:
        self.node = node
        self._delay = node.number("delay", 0.0, 0.0, unit="s")
        self._edge = node.choice("conditionEdge", _EDGES, "none")
        kind = node.only()
        self._is_any = True
        self._tests: list[tuple[str, Test]]
        if kind.tag == "ByValueCondition":
            self._tests = [("", read_value_test(kind.only()))]
        elif kind.tag == "ByEntityCondition":
            entities = kind.need("TriggeringEntities")
            self._is_any = entities.choice("triggeringEntitiesRule", ("any", "all"), "any") == "any"
            names = [one.text("entityRef") for one in entities.children("EntityRef")]
            if not names:
                raise entities.error("has no <EntityRef>")
            inner = kind.need("EntityCondition").only()
            self._tests = [(name, read_test(inner, name, catalogs)) for name in names]
        else:
            raise kind.unsupported("ByValueCondition and ByEntityCondition are read")
        self._before: bool | None = None
        self._pulses: list[float] = []
        self._changes: list[tuple[float, bool]] = []

    @property
    def tests(self) -> list[Test]:
        """Its tests, one for each triggering entity."""
        return [test for _, test in self._tests]

    def _now(self, stage: Stage) -> bool:
        found = [test.holds(stage) for _, test in self._tests]
        return any(found) if self._is_any else all(found)

    def _pulse(self, now: bool) -> bool:
        if self._before is None or self._before == now:
            return False
        return self._edge == "risingOrFalling" or (self._edge == "rising") == now

    def holds(self, stage: Stage) -> bool:
        """Return whether it is true at the time of the stage."""
        now = self._now(stage)
        if self._edge == "none":
            if self._delay <= 0.0:
                return now
            when = stage.time - self._delay + 1e-9
            return next((value for time, value in reversed(self._changes) if time <= when), False)
        if self._delay <= 0.0:
            return self._pulse(now) or (bool(self._pulses) and self._pulses[-1] == stage.time)
        last = -math.inf if self._kept is None else self._kept
        when = stage.time - self._delay + 1e-9
        return any(last - self._delay + 1e-9 < pulse <= when for pulse in self._pulses) or (
            bool(self._pulses) and self._due == stage.time
        )

    _kept: float | None = None
    _due: float | None = None

    def keep(self, stage: Stage) -> None:
        """Take this instant as the one before the next."""
        now = self._now(stage)
        if self._edge != "none":
            if self._delay > 0.0 and self.holds(stage):
                self._due = stage.time
            if self._pulse(now):
                self._pulses = [*self._pulses[-_MOST_FIRINGS:], stage.time]
        elif self._delay > 0.0 and (not self._changes or self._changes[-1][1] != now):
            self._changes = [*self._changes[-_MOST_FIRINGS:], (stage.time, now)]
        self._before, self._kept = now, stage.time
        for _, test in self._tests:
            test.keep(stage)


class Trigger:
    """Groups of conditions: true where all conditions of one group are."""

    def __init__(self, node: Node, catalogs: Catalogs) -> None:
        self.node = node
        groups = [group.children("Condition") for group in node.children("ConditionGroup")]
        self._groups = [[Condition(one, catalogs) for one in group] for group in groups if group]

    @property
    def is_empty(self) -> bool:
        """Whether it has no condition."""
        return not self._groups

    def holds(self, stage: Stage) -> bool:
        """Return whether it is true at the time of the stage."""
        return any(all(one.holds(stage) for one in group) for group in self._groups)

    def stirs(self, stage: Stage) -> bool:
        """Return whether the time of a state begins or ends now."""
        return any(test.stirs(stage) for group in self._groups for one in group for test in one.tests)

    def keep(self, stage: Stage) -> None:
        """Take this instant as the one before the next."""
        for group in self._groups:
            for one in group:
                one.keep(stage)


def read_trigger(holder: Node, tag: str, catalogs: Catalogs) -> Trigger | None:
    """Return the trigger of an element; None where there is none, or one without conditions."""
    node = holder.child(tag)
    if node is None:
        return None
    trigger = Trigger(node, catalogs)
    return None if trigger.is_empty else trigger
