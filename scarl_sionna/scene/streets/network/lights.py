"""Traffic lights of a map: which lanes they stop, and a fixed plan of their greens."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from scarl_sionna.scene.lanes import Signals

from ..model import Array, MapSignal, StreetMap
from .ways import Key, forward

_ODD = r"[^A-Za-z0-9_\-]"
GREEN, CLEARING = 20.0, 5.0
"""Share of a group in the cycle, and what of it is no green [s]."""


@dataclass(frozen=True)
class Lights:
    """`signals`: the plan, None without lights; groups by lane and by signal (id of road, id of signal)."""

    signals: Signals | None = None
    of_lane: Mapping[Key, str] = field(default_factory=dict)
    of_signal: Mapping[tuple[str, str], str] = field(default_factory=dict)


def signal_lights(street: StreetMap, links: Mapping[Key, list[Key]], lines: Mapping[Key, Array]) -> Lights:
    """Return the lights of a map.

    Signals of one controller are one group. Without a controller, those at a junction whose lanes run along one axis
    are. Where the map has no program, the groups of a junction are green one after the other, each for 15 of 20 s.
    """
    of_lane: dict[Key, str] = {}
    of_signal: dict[tuple[str, str], str] = {}
    groups: dict[str, list[str]] = {}
    controller = {signal: name for name, signals in street.controllers.items() for signal in signals}
    for road, signal, home in _dynamic(street):
        lanes = _stopped(street, road, signal, links)
        if not lanes:
            continue
        place = _junction(street, lanes[0], links)
        group = controller.get(signal.id)
        name = f"controller_{group}" if group is not None else f"{place}_{_axis(lines[lanes[0]])}"
        name = of_signal.setdefault((home, signal.id), re.sub(_ODD, "_", name))
        if not any(name in names for names in groups.values()):
            groups.setdefault(place, []).append(name)
        for lane in lanes:
            of_lane.setdefault(lane, name)
    if not groups:
        return Lights()
    cycle = max([2, *(len(names) for names in groups.values())]) * GREEN
    cycle = street.program.cycle if street.program is not None else cycle
    greens: dict[str, tuple[float, float]] = {}
    stated = {} if street.program is None else {f"controller_{k}": v for k, v in street.program.green.items()}
    greens |= {re.sub(_ODD, "_", name): span for name, span in stated.items()}
    for names in groups.values():
        share = cycle / max(2, len(names))
        for number, name in enumerate(names):
            greens.setdefault(name, (number * share, (number + 1) * share - CLEARING))
    return Lights(Signals(cycle, greens), of_lane, of_signal)


def _dynamic(street: StreetMap) -> Iterator[tuple[str, MapSignal, str]]:
    """Return the lights and the road for which each holds, by itself or by reference, with the road where it stands."""
    homes: dict[str, tuple[str, MapSignal]] = {}
    for road in street.roads.values():
        for signal in road.signals:
            if signal.is_dynamic:
                homes.setdefault(signal.id, (road.id, signal))
                yield road.id, signal, road.id
    for road in street.roads.values():
        for one in road.references:
            if one.id in homes:
                home, signal = homes[one.id]
                yield road.id, replace(signal, s=one.s, orientation=one.orientation, lanes=one.lanes), home


def _stopped(street: StreetMap, road: str, signal: MapSignal, links: Mapping[Key, list[Key]]) -> list[Key]:
    """Return the lanes at whose end traffic waits for a light: of its road, or those before where it stands inside."""
    own = street.roads[road]
    number = max((k for k, section in enumerate(own.sections) if section.s <= signal.s), default=0)
    found = []
    for key in links:
        if key[0] != road or key[1] != number or (signal.lanes and key[2] not in signal.lanes):
            continue
        is_forward = forward(street, key)
        if signal.orientation in ("+", "-") and is_forward != (signal.orientation == "+"):
            continue
        while (further := links[key]) and len(further) == 1 and further[0][0] == road:
            key = further[0]
        found.append(key)
    if own.junction not in ("-1", "") and own.junction in street.junctions:
        inside = set(found)
        found = [key for key, following in links.items() if inside & set(following)]
    return found


def _junction(street: StreetMap, key: Key, links: Mapping[Key, list[Key]]) -> str:
    """Return the junction into which a lane goes; its own road where it goes into none."""
    for following in links[key]:
        junction = street.roads[following[0]].junction
        if junction in street.junctions:
            return f"junction_{junction}"
    return f"road_{key[0]}"


def _axis(points: Array) -> str:
    """Return which of the two axes a lane's end runs along: ``a`` east-west, ``b`` north-south."""
    dx, dy = np.abs(points[-1, :2] - points[-2, :2])
    return "a" if dx >= dy else "b"
