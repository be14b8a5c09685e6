"""What a map's file says, in the terms of OpenDRIVE, as plain data: metres, radians, lines of the file with all."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Finding:
    """Something in a file that is not used or does not fit: the line (from 1), and what it is."""

    line: int
    text: str

    def __str__(self) -> str:
        return f"line {self.line}: {self.text}"


@dataclass(frozen=True, eq=False)
class Cubics:
    """Cubic polynomials one after the other: from `starts` (n,) on, ``a + b d + c d2 + d d3`` of the way d since.

    Without a piece it is 0, before the first piece its first value.
    """

    starts: Array = field(default_factory=lambda: np.zeros(0))
    coefficients: Array = field(default_factory=lambda: np.zeros((0, 4)))

    def __call__(self, s: npt.ArrayLike) -> Array:
        """Return the values at `s` [m], same shape."""
        return self._value(np.asarray(s, dtype=np.float64), 0)

    def slope(self, s: npt.ArrayLike) -> Array:
        """Return the derivatives at `s`."""
        return self._value(np.asarray(s, dtype=np.float64), 1)

    def bend(self, s: npt.ArrayLike) -> Array:
        """Return the second derivatives at `s`."""
        return self._value(np.asarray(s, dtype=np.float64), 2)

    def _value(self, s: Array, order: int) -> Array:
        if not self.starts.size:
            return np.zeros_like(s)
        index = np.clip(np.searchsorted(self.starts, s, "right") - 1, 0, None)
        way = np.maximum(s - self.starts[index], 0.0)
        a, b, c, d = np.moveaxis(self.coefficients[index], -1, 0)
        if order == 0:
            return np.asarray(a + way * (b + way * (c + way * d)))
        return np.asarray(b + way * (2.0 * c + way * 3.0 * d) if order == 1 else 2.0 * c + 6.0 * d * way)


@dataclass(frozen=True)
class PlanPiece:
    """A piece of the plan view: where it starts, its kind and the numbers of the kind by name."""

    line: int
    s: float
    x: float
    y: float
    heading: float
    length: float
    kind: str
    numbers: dict[str, float]
    is_normalized: bool = False


@dataclass(frozen=True)
class MarkLine:
    """One line of a road mark: length of dash and gap (0: solid), offset to the left, start, width [m]."""

    length: float
    space: float
    t: float
    s: float
    width: float
    color: str | None = None


@dataclass(frozen=True)
class RoadMark:
    """A road mark at the outer border of a lane, from `s_offset` of its section on."""

    line: int
    s_offset: float
    kind: str
    color: str
    weight: str
    width: float | None
    lines: tuple[MarkLine, ...] = ()
    explicit: tuple[MarkLine, ...] = ()


@dataclass(frozen=True, eq=False)
class MapLane:
    """One lane of a section; `border` holds polynomials where the file gives borders in place of widths.

    `heights` (n, 3): from an offset of the section on, height of the inner and the outer border above the road [m].
    """

    line: int
    id: int
    kind: str
    is_level: bool
    width: Cubics
    border: Cubics | None
    heights: Array
    marks: tuple[RoadMark, ...]
    predecessors: tuple[int, ...]
    successors: tuple[int, ...]
    speeds: tuple[tuple[float, float], ...] = ()
    direction: str = "standard"


@dataclass(frozen=True, eq=False)
class LaneSection:
    """The lanes from `s` to `stop` along the reference line [m]: by id, positive to the left, without the centre."""

    line: int
    s: float
    stop: float
    lanes: dict[int, MapLane]
    center_marks: tuple[RoadMark, ...] = ()


@dataclass(frozen=True)
class RoadLink:
    """What a road continues, or is continued by: a road and its end (``start`` or ``end``), or a junction."""

    kind: str
    id: str
    contact: str


@dataclass(frozen=True)
class Corner:
    """A corner of an outline: by `s`, `t` of the road or by `u`, `v` of the object; height of foot and body [m]."""

    is_road: bool
    a: float
    b: float
    z: float
    height: float


@dataclass(frozen=True)
class Outline:
    """An outline of an object."""

    corners: tuple[Corner, ...]
    is_closed: bool = True


@dataclass(frozen=True)
class Repeat:
    """A row of an object: `numbers` has tStart, tEnd, heightStart, ... where stated; distance 0 is one body."""

    s: float
    length: float
    distance: float
    numbers: dict[str, float]


@dataclass(frozen=True)
class MapObject:
    """An object beside or on a road: `size` is length, width, height, radius, 0 where not stated [m]."""

    line: int
    id: str
    kind: str
    name: str
    s: float
    t: float
    z: float
    heading: float
    orientation: str
    size: tuple[float, float, float, float]
    outlines: tuple[Outline, ...] = ()
    repeats: tuple[Repeat, ...] = ()


@dataclass(frozen=True)
class Structure:
    """A bridge or a tunnel (`kind`) from `s` on [m]."""

    line: int
    kind: str
    s: float
    length: float


@dataclass(frozen=True)
class MapSignal:
    """A sign or a traffic light; `lanes` are the ids for which it is valid, empty for all of its direction."""

    line: int
    id: str
    s: float
    t: float
    z: float
    heading: float
    orientation: str
    is_dynamic: bool
    country: str
    kind: str
    subkind: str
    value: float | None
    unit: str
    height: float
    width: float
    lanes: tuple[int, ...] = ()


@dataclass(frozen=True)
class SignalReference:
    """A signal of another road that holds for this one, from `s` on; `lanes` and `orientation` as of a signal."""

    line: int
    id: str
    s: float
    orientation: str
    lanes: tuple[int, ...] = ()


@dataclass(frozen=True, eq=False)
class Road:
    """One road.

    `shapes` are cross-sections ``(s, t, a, b, c, d)``, shape (n, 6), empty where none is given; `crossfalls` holds the
    crossfall of the left and of the right side.
    """

    line: int
    id: str
    name: str
    length: float
    junction: str
    is_left_hand: bool
    plan: tuple[PlanPiece, ...]
    elevation: Cubics
    superelevation: Cubics
    crossfalls: tuple[Cubics, Cubics]
    shapes: Array
    lane_offset: Cubics
    sections: tuple[LaneSection, ...]
    predecessor: RoadLink | None = None
    successor: RoadLink | None = None
    types: tuple[tuple[float, str, float | None], ...] = ()
    objects: tuple[MapObject, ...] = ()
    signals: tuple[MapSignal, ...] = ()
    structures: tuple[Structure, ...] = ()
    references: tuple[SignalReference, ...] = ()

    @cached_property
    def breaks(self) -> Array:
        """Places where a polynomial or a section begins, with both ends, shape (n,) [m]."""
        parts = [np.array([0.0, self.length]), np.array([piece.s for piece in self.plan])]
        parts += [poly.starts for poly in (self.elevation, self.superelevation, *self.crossfalls, self.lane_offset)]
        parts.append(self.shapes[:, 0])
        for section in self.sections:
            parts.append(np.array([section.s, section.stop]))
            for lane in section.lanes.values():
                own = [lane.width.starts, lane.heights[:, 0]] + ([lane.border.starts] if lane.border else [])
                parts += [section.s + np.clip(one, 0.0, section.stop - section.s) for one in own]
        found = np.unique(np.clip(np.concatenate(parts), 0.0, self.length))
        return found[np.r_[True, np.diff(found) > 1e-6]]


@dataclass(frozen=True)
class Connection:
    """A way through a junction: from a road over a connecting one, which begins at its `contact`; lanes from, to."""

    line: int
    incoming: str
    connecting: str
    contact: str
    lanes: tuple[tuple[int, int], ...]


@dataclass(frozen=True)
class Junction:
    """A junction: its ways, and pairs of connecting roads of which the first has the right of way."""

    line: int
    id: str
    kind: str
    connections: tuple[Connection, ...]
    priorities: tuple[tuple[str, str], ...] = ()
    controllers: tuple[str, ...] = ()


@dataclass(frozen=True)
class Program:
    """Fixed times of lights: `cycle` [s], and by controller from when to when it is green within it [s]."""

    cycle: float
    green: dict[str, tuple[float, float]]


@dataclass(frozen=True, eq=False)
class Area:
    """A paved place of no road: outer ring and holes, (n, 2) each [m]; `rise` above the roads around it [m].

    Roads take what they need of it.
    """

    line: int
    rings: tuple[Array, ...]
    material: str
    semantic: str
    rise: float = 0.0


@dataclass(frozen=True, eq=False)
class Building:
    """A building or a part of one: outer ring and courts, (n, 2) each [m], and heights above its ground [m].

    `eaves` is where the walls end, `top` the highest point of the roof; `roof` its shape (``flat``, ``gabled``,
    ``hipped``, ``pyramidal``, ``skillion``), along the longer side or across it. `walls` and `cover` are materials.
    """

    line: int
    id: str
    rings: tuple[Array, ...]
    foot: float
    eaves: float
    top: float
    roof: str
    walls: str
    cover: str
    storeys: int = 0
    is_across: bool = False
    is_open: bool = False


@dataclass(frozen=True, eq=False)
class StreetMap:
    """A whole file.

    `controllers` lists the signals of each controller; `findings` is what is not used. What belongs to no road stands
    in the map's own coordinates: `areas`, `buildings`, and `objects`, whose s is x and whose t is y. `source` says what
    the file is, `licence` what its data asks for.
    """

    name: str
    version: tuple[int, int]
    roads: dict[str, Road]
    junctions: dict[str, Junction]
    controllers: dict[str, tuple[str, ...]]
    findings: tuple[Finding, ...] = ()
    program: Program | None = None
    areas: tuple[Area, ...] = ()
    buildings: tuple[Building, ...] = ()
    objects: tuple[MapObject, ...] = ()
    source: str = ""
    licence: str = ""
