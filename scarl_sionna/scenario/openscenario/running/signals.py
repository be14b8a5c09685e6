"""Traffic signals of a scenario: controllers with phases that follow each other, and what signals show at a time."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from scarl_sionna.scenario.openscenario.reading.source import Node

_SHORTEST = 1e-3
"""Of a cycle [s]."""


@dataclass
class _Controller:
    """Phases in their order: name, duration [s], states by signal; `start` is when the first one began [s]."""

    names: list[str]
    durations: list[float]
    states: list[dict[str, str]]
    start: float = 0.0

    def number(self, time: float) -> int:
        """Return the phase at a time."""
        left = math.fmod(time - self.start, sum(self.durations))
        left += sum(self.durations) if left < -1e-9 else 0.0
        for number, duration in enumerate(self.durations):
            if left < duration - 1e-9:
                return number
            left -= duration
        return 0

    def begun(self, time: float) -> float:
        """Return when the phase of a time began [s]."""
        number, cycle = self.number(time), sum(self.durations)
        into = math.fmod(time - self.start, cycle)
        into += cycle if into < -1e-9 else 0.0
        before = sum(self.durations[:number])
        return time - max(into - before, 0.0)


@dataclass
class TrafficSignals:
    """The controllers of a file, and states that were set during the run: by signal, with the time [s].

    `shown` is what signals have shown, by signal: times [s] and the state from then on.
    """

    controllers: dict[str, _Controller] = field(default_factory=dict)
    shown: dict[str, list[tuple[float, str]]] = field(default_factory=dict)
    _set: dict[str, tuple[str, float]] = field(default_factory=dict)

    def phase(self, name: str, time: float, node: Node) -> str:
        """Return the name of the phase of a controller at a time."""
        controller = self._controller(name, node)
        return controller.names[controller.number(time)]

    def state(self, signal: str, time: float) -> str | None:
        """Return what a signal shows: what was set last, by an action or by the phase of its controller."""
        found, since = self._set.get(signal, (None, -math.inf))
        for controller in self.controllers.values():
            shown = controller.states[controller.number(time)].get(signal)
            if shown is not None and (found is None or controller.begun(time) > since):
                found = shown
        return found

    def note(self, time: float) -> None:
        """Take note of what all signals show at a time, and since when."""
        known = {name for one in self.controllers.values() for states in one.states for name in states}
        for signal in sorted(known | set(self._set)):
            state = self.state(signal, time)
            if state is None or (self.shown.get(signal) and self.shown[signal][-1][1] == state):
                continue
            begun = [one.begun(time) for one in self.controllers.values() if signal in one.states[one.number(time)]]
            begun += [self._set[signal][1]] if signal in self._set else []
            self.shown.setdefault(signal, []).append((max(begun), state))

    def set_state(self, signal: str, state: str, time: float) -> None:
        """Let a signal show a state from now on, until the next phase of its controller."""
        self._set[signal] = (state, time)

    def set_phase(self, name: str, phase: str, time: float, node: Node) -> None:
        """Let a phase of a controller begin now; the others follow."""
        controller = self._controller(name, node)
        if phase not in controller.names:
            raise node.error(f"controller '{name}' has no phase '{phase}'", f"it has {', '.join(controller.names)}")
        controller.start = time - sum(controller.durations[: controller.names.index(phase)])

    def _controller(self, name: str, node: Node) -> _Controller:
        if name not in self.controllers:
            known = ", ".join(self.controllers) or "none"
            raise node.error(f"there is no controller '{name}' of traffic signals", f"known: {known}")
        return self.controllers[name]


def read_signals(network: Node) -> TrafficSignals:
    """Return the controllers of a ``<RoadNetwork>``.

    Raises
    ------
    ScenarioError
        If a value is wrong, or a controller refers to one that is not there.
    """
    found = TrafficSignals()
    holder = network.child("TrafficSignals")
    delays: dict[str, tuple[str, float, Node]] = {}
    for node in [] if holder is None else holder.children("TrafficSignalController"):
        phases = node.children("Phase")
        durations = [one.number("duration", low=0.0, unit="s") for one in phases]
        if sum(durations) < _SHORTEST:
            raise node.error("has no <Phase> that takes time")
        states = [
            {one.text("trafficSignalId"): one.text("state") for one in phase.children("TrafficSignalState")}
            for phase in phases
        ]
        for phase in phases:
            for one in (*phase.children("TrafficeSignalGroupState"), *phase.children("TrafficSignalGroupState")):
                one.note("is not used: it names no signal")
        name = node.text("name")
        found.controllers[name] = _Controller([one.text("name") for one in phases], durations, states)
        delays[name] = (node.text("reference", ""), node.number("delay", 0.0, 0.0, unit="s"), node)
    for name in delays:
        seen, start, at = {name}, 0.0, name
        while at:
            reference, delay, node = delays[at]
            start += delay
            if reference and (reference not in delays or reference in seen):
                raise node.error(f"refers to controller '{reference}', which is not there or refers back to it")
            seen.add(reference)
            at = reference
        found.controllers[name].start = start
    return found
