"""The two sides of every road: where its kerb, its pavement and the land beside it are, metre by metre."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ..geometry.road import RoadShape
from ..model import Array, LaneSection, Road, StreetMap
from .character import WALKS, Character, character, speed_limit

STEP = 1.0
"""Distance between places along a side [m]."""
LAND = {"none", "border", "median"}
"""Types of lanes on which things may stand."""


@dataclass(frozen=True, eq=False)
class Side:
    """One side of a stretch of road, from its beginning on.

    Attributes
    ----------
    road : str
    sign : int
        1 to the left of the reference line, -1 to the right.
    character : str
    speed : float or None
        Limit of speed [m/s].
    s : ndarray of float64, shape (n,)
        Stations along the road [m].
    kerb, walk, front : ndarray of float64, shape (n, 3)
        Where the carriageway ends, where the pavement ends (the kerb where there is none) and where the land begins
        [m, world].
    out : ndarray of float64, shape (n, 2)
        Unit vector away from the road.
    is_open : ndarray of bool, shape (n,)
        Whether neither bridge nor tunnel is there.
    runs_forward : bool
        Whether traffic beside it runs along the reference line.
    """

    road: str
    sign: int
    character: Character
    speed: float | None
    s: Array
    kerb: Array
    walk: Array
    front: Array
    out: Array
    is_open: npt.NDArray[np.bool_]
    runs_forward: bool

    @property
    def length(self) -> float:
        """Return the length along the road [m]."""
        return float(self.s[-1] - self.s[0])

    def at(self, way: float) -> int:
        """Return the number of the place that is `way` [m] behind the first one."""
        return int(np.clip(round(way / STEP), 0, len(self.s) - 1))

    def yaw(self, place: int) -> float:
        """Return the direction away from the road [rad]."""
        return float(np.arctan2(self.out[place, 1], self.out[place, 0]))

    def along(self, place: int) -> Array:
        """Return the unit vector along the reference line, (2,)."""
        return self.sign * np.array([self.out[place, 1], -self.out[place, 0]])


def sides(street: StreetMap, shapes: Mapping[str, RoadShape]) -> Iterator[Side]:
    """Return the sides of all roads outside of junctions; sections of one character as one."""
    for road in street.roads.values():
        if road.junction in street.junctions:
            continue
        for sign in (1, -1):
            parts = [_part(shapes[road.id], road, section, sign) for section in road.sections]
            parts = [part for part in parts if len(part.s)]
            run: list[Side] = []
            for part in parts:
                if run and (part.character, part.speed) != (run[-1].character, run[-1].speed):
                    yield _joined(run)
                    run = []
                run.append(part)
            if run:
                yield _joined(run)


def _joined(run: list[Side]) -> Side:
    first = run[0]
    tables = {
        name: np.concatenate([getattr(part, name) for part in run])
        for name in ("s", "kerb", "walk", "front", "out", "is_open")
    }
    return Side(first.road, first.sign, first.character, first.speed, runs_forward=first.runs_forward, **tables)


def _part(shape: RoadShape, road: Road, section: LaneSection, sign: int) -> Side:
    s = np.arange(np.ceil(section.s + 0.25), section.stop - 0.25, STEP)
    own = [section.lanes[key] for key in sorted(section.lanes, key=abs) if key * sign > 0]
    edge = {0: shape.edges(section, 0, s)[0]} | {lane.id: shape.edges(section, lane.id, s)[1] for lane in own}
    roads = [lane.id for lane in own if lane.kind not in (*LAND, *WALKS, "curb")]
    walks = [lane.id for lane in own if lane.kind in WALKS]
    used = [lane.id for lane in own if lane.kind not in LAND]
    kerb = edge[roads[-1] if roads else 0]
    front = edge[used[-1] if used else 0]
    walk = edge[walks[0]] if walks and used and abs(walks[0]) > abs(roads[-1] if roads else 0) else kerb
    heading = shape.frame(s).heading if len(s) else np.zeros(0)
    out = sign * np.column_stack([-np.sin(heading), np.cos(heading)])
    closed = np.zeros(len(s), dtype=bool)
    for one in road.structures:
        closed |= (s > one.s - 3.0) & (s < one.s + one.length + 3.0)
    forward = (sign < 0) ^ road.is_left_hand
    return Side(road.id, sign, character(road, section), speed_limit(road, section), s, kerb, walk, front, out, ~closed,
                forward)  # fmt: skip # the attributes in their order
