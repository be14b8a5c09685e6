"""What kind of place a road passes through, by what its file states: type, speed, lanes."""

from __future__ import annotations

from typing import Literal

from ..model import LaneSection, Road

WALKS = ("sidewalk", "walking")
"""Types of lanes for people on foot."""
Character = Literal["town", "country", "motorway"]
_TOWN_TYPES = ("town", "townCollector", "townArterial", "townPrivate", "townLocal", "townPlayStreet", "townExpressway",
               "lowSpeed", "pedestrian", "bicycle")  # fmt: skip # a table
_FAST, _TOWN = 30.0, 17.0
"""Limits of speed: from the first on a road is a motorway, below the second it lies in a town [m/s]."""


def character(road: Road, section: LaneSection) -> Character:
    """Return what a road passes through at a section.

    The road's type decides; else pavements and low limits of speed mean a town, hard shoulders or high limits a
    motorway, and everything else the country.
    """
    stated = [one for one in road.types if one[0] <= section.s + 1e-6]
    kind = stated[-1][1] if stated else "unknown"
    if kind in _TOWN_TYPES:
        return "town"
    if kind in ("motorway", "rural"):
        return "motorway" if kind == "motorway" else "country"
    kinds = {lane.kind for lane in section.lanes.values()}
    if kinds & set(WALKS):
        return "town"
    limit = speed_limit(road, section)
    if "stop" in kinds or (limit is not None and limit >= _FAST):
        return "motorway"
    return "town" if limit is not None and limit < _TOWN else "country"


def is_in_town(road: Road, section: LaneSection) -> bool:
    """Return whether a section lies in a town."""
    return character(road, section) == "town"


def speed_limit(road: Road, section: LaneSection) -> float | None:
    """Return the highest limit that the lanes of a section or its road's type state [m/s], None for none."""
    own = [speed for lane in section.lanes.values() for _, speed in lane.speeds[:1]]
    stated = [one[2] for one in road.types if one[0] <= section.s + 1e-6 and one[2] is not None]
    found = own or stated[-1:]
    return max(found) if found else None
