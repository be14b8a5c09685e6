"""How people on foot go over roads: all lanes at once, before vehicles that can stop, after those that cannot."""

from __future__ import annotations

from collections.abc import Sequence

from .driver import Driver
from .tracks import Track, TrackGraph

ISLAND = 1.5
"""Lanes of vehicles with less between them are crossed without a stop [m]."""
_LOOK, _STEP_OFF = 2.0, 1.5
"""How far ahead people look for what crosses their way: way of so many seconds, and so much more [m]."""
CLEARANCE = 1.0
"""Time for which the way over stays free behind who crossed [s]."""


def reach(driver: Driver) -> float:
    """Return how far ahead somebody on foot looks for vehicles [m]."""
    return _LOOK * driver.speed + _STEP_OFF


def crossing(driver: Driver, graph: TrackGraph) -> tuple[float, float] | None:
    """Return the first and the last way of the next lanes of vehicles to go over, from the front [m].

    None where none is in reach. Lanes with less than `ISLAND` between them are one; the first way is below 0 for who is
    on them already.
    """
    span: tuple[float, float] | None = None
    look = reach(driver)
    for place in range(driver.place, len(driver.route)):
        base = driver.starts[place] - driver.way
        for zone, first, last, _ in graph.tracks[driver.route[place]].zones:
            if base + last < 0.0 or not of_vehicles(graph, zone):
                continue
            if span is None:
                if base + first > look:
                    return None
                span = base + first, base + last
            elif base + first > span[1] + ISLAND:
                return span
            else:
                span = span[0], max(span[1], base + last)
        if base > (look if span is None else span[1] + ISLAND):
            break
    return span


def of_vehicles(graph: TrackGraph, zone: int) -> bool:
    """Return whether a zone is shared with a lane that is not for walking."""
    return any(graph.tracks[side].kind != "walk" for side in graph.sides[zone])


def lets_over(driver: Driver, zone: int, tracks: Sequence[Track]) -> bool:
    """Return whether a driver who has a zone ahead can stop before it at ease."""
    track, _ = driver.held[zone]
    for place in range(driver.place, len(driver.route)):
        if driver.route[place] != track:
            continue
        for other, first, _, _ in tracks[track].zones:
            away = driver.starts[place] + first - driver.way
            if other == zone and away > 0.0:
                return driver.stops_at_ease(away)
    return False
