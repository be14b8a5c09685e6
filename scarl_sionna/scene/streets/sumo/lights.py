"""Lights of a network of SUMO: which lanes each group stops, when it is green, where its head stands."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..geometry.road import RoadShape
from ..model import Finding, MapSignal, Program
from ..network.ways import KINDS
from .net import Net, NetProgram
from .roads import NetRoads, Place

_GREEN = "gG"
_BESIDE, _APART = 0.6, 0.7
"""From the border of the carriageway to the first head of an approach, and on to the next [m]."""
_BEFORE = 0.5


@dataclass(frozen=True)
class JunctionLights:
    """Signals by road, signals by controller, and when each controller is green."""

    signals: dict[str, tuple[MapSignal, ...]]
    controllers: dict[str, tuple[str, ...]]
    program: Program | None


def junction_lights(net: Net, found: NetRoads, findings: list[Finding]) -> JunctionLights:
    """Return the lights of all junctions.

    A lane is stopped by one group: green while all its links are, or, if they never are together, while one is. Lanes
    of one approach that are green at the same time share a head.
    """
    links: dict[tuple[str, str], dict[int, list[int]]] = {}
    for link in net.links:
        if link.light is not None and (link.source, link.from_lane) in found.places:
            place = found.places[link.source, link.from_lane]
            kind = found.roads[place.road].sections[0].lanes[place.lane].kind
            if link.target in net.edges and KINDS.get(kind) in ("drive", "cycle"):
                own = links.setdefault((link.light[0], link.source), {})
                own.setdefault(link.from_lane, []).append(link.light[1])
    cycles = {name: sum(duration for duration, _ in program.phases) for name, program in net.programs.items()}
    used = [cycles[name] for name, _ in links if name in cycles]
    cycle = max(used, default=0.0)
    signals: dict[str, list[MapSignal]] = {}
    controllers: dict[str, tuple[str, ...]] = {}
    greens: dict[str, tuple[float, float]] = {}
    for (name, edge), lanes in links.items():
        program = net.programs.get(name)
        if program is None or not 1.0 <= cycle <= 600.0:
            findings.append(Finding(net.edges[edge].line, f"lights '{name}' have no program of 1 to 600 s"))
            continue
        if program.offset:
            findings.append(Finding(program.line, "the offset of a <tlLogic> is not used"))
        if abs(cycles[name] - cycle) > 1e-6:
            findings.append(Finding(program.line, f"a <tlLogic> of {cycles[name]:g} s is stretched to {cycle:g} s"))
        groups: dict[tuple[float, float], list[Place]] = {}
        for index, numbers in lanes.items():
            span = _green(program, numbers, cycle / cycles[name])
            if span is None:
                findings.append(Finding(program.line, "a <tlLogic> never shows green to a lane; it has no light"))
            else:
                groups.setdefault(span, []).append(found.places[edge, index])
        for number, (span, places) in enumerate(groups.items()):
            group = f"{name}_{edge}_{number}"
            signal = _signal(net, found, group, places, number)
            signals.setdefault(places[0].road, []).append(signal)
            controllers[group], greens[group] = (group,), span
    return JunctionLights(
        {road: tuple(own) for road, own in signals.items()}, controllers, Program(cycle, greens) if greens else None
    )


def _green(program: NetProgram, numbers: list[int], stretch: float) -> tuple[float, float] | None:
    """Return the longest time in which all links are green, or one of them if never all: start and end [s]."""
    for test in (all, any):
        spans: list[list[float]] = []
        time = 0.0
        for duration, state in program.phases:
            if test(number < len(state) and state[number] in _GREEN for number in numbers):
                if spans and abs(spans[-1][1] - time) < 1e-9:
                    spans[-1][1] = time + duration
                else:
                    spans.append([time, time + duration])
            time += duration
        if spans:
            start, stop = max(spans, key=lambda span: span[1] - span[0])
            if stop > start:
                return start * stretch, min(stop * stretch, time * stretch)
    return None


def _signal(net: Net, found: NetRoads, name: str, places: list[Place], number: int) -> MapSignal:
    """Return the head of a group, beside the end of its lanes."""
    road = found.roads[places[0].road]
    section, is_forward = road.sections[0], places[0].is_forward
    s = max(road.length - _BEFORE, 0.5 * road.length) if is_forward else min(_BEFORE, 0.5 * road.length)
    side = 1 if places[0].lane > 0 else -1
    shape = RoadShape(road)
    wheels = [k for k, lane in section.lanes.items() if k * side > 0 and KINDS.get(lane.kind) in ("drive", "cycle")]
    border = float(shape.borders(section, max(wheels, key=abs), np.array([s]))[1][0])
    away = border + side * (_BESIDE + _APART * number)
    return MapSignal(
        road.line, name, s, away, 0.0, 0.0, "+" if is_forward else "-", True, "", "1000001", "-1", None, "", 0.0, 0.0,
        tuple(sorted(place.lane for place in places)),
    )  # fmt: skip # a row of a table
