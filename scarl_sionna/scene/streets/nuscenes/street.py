"""A map expansion of nuScenes as a street map: a road of one lane for each lane and connector, areas, crossings.

References
----------
.. [1] nuScenes map expansion 1.3, see `tables.py`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from scarl_sionna.core.errors import MapError

from ..geometry.curves import evaluate
from ..model import (
    Area,
    Array,
    Connection,
    Corner,
    Cubics,
    Finding,
    Junction,
    LaneSection,
    MapLane,
    MapObject,
    MapSignal,
    Outline,
    PlanPiece,
    Road,
    RoadLink,
    SignalReference,
    StreetMap,
)
from ..sumo.roads import KERB, constant
from .dividers import MARKS, dividers
from .tables import SHIFT, Expansion, Row

WIDTH, WIDTHS = 3.5, (2.0, 6.0)
"""Width of a lane without a polygon, and what a polygon may say [m]."""
STOPS = ("TRAFFIC_LIGHT", "STOP_SIGN", "YIELD")
"""Kinds of stop lines that count: who waits at the latter two lets all others go first."""
_KINDS = {"CAR": "driving", "BUS": "bus", "BICYCLE": "biking"}
_SURFACES = (
    ("drivable_area", "asphalt_street", "Roads", 0.0), ("carpark_area", "asphalt_plain", "Roads", 0.0),
    ("walkway", "paving", "SideWalks", KERB),
)  # fmt: skip # a table
_SHORTEST, _SMALLEST, _AT_LINE, _CROSSING = 0.05, 1.0, 1.5, 0.5
_STEP = 1.0
_BESIDE, _BEFORE = 0.6, 0.5
"""From the border of an approach to its light, and from its end [m]."""
_UNUSED = {
    "traffic_light": "poses of traffic lights are not used: heads stand beside their stop line",
    "road_segment": "road segments and blocks say nothing beyond lanes and drivable areas",
}


def read_expansion(path: Path) -> StreetMap:
    """Return a map expansion of nuScenes 1.3 (``.json``) as a street map.

    Raises
    ------
    MapError
        If the file cannot be read, is no map expansion, or has no lane; names layer and token.

    Notes
    -----
    Positions are those of the map; where this package wrote it, those of the scene that was simulated. Traffic keeps
    left in maps whose name begins with ``singapore``.
    """
    return _Builder(Expansion(path)).street()


@dataclass(frozen=True, eq=False)
class _Way:
    """A lane or a connector: id of its road, row of its layer, outline (may be empty), plan view, length [m]."""

    road: str
    row: Row
    layer: str
    plan: tuple[PlanPiece, ...]
    length: float
    line: shapely.LineString
    width: float


class _Builder:
    """Makes a street map of tables."""

    def __init__(self, tables: Expansion) -> None:
        self.tables = tables
        self.is_left_hand = tables.path.name.startswith("singapore")
        self.side = 1 if self.is_left_hand else -1
        self.findings = [Finding(0, text) for layer, text in _UNUSED.items() if tables.has(layer)]
        self.ways = {way.row["token"]: way for layer in ("lane", "lane_connector") for way in self._ways(layer)}
        if not self.ways:
            raise MapError("has no lane with a path", tables.path, "give a whole map expansion")
        self.next = {token: [one for one in tables.links(token) if one in self.ways] for token in self.ways}
        missing = {one for token in self.ways for one in tables.links(token)} - set(self.ways)
        if missing:
            self.findings.append(Finding(0, f"{len(missing)} lanes that others lead to are not there"))

    def street(self) -> StreetMap:
        tables, stops = self.tables, self._stops()
        inside, junctions = self._junctions(stops)
        roads = {way.road: self._road(token, inside) for token, way in self.ways.items()}
        self._add_lights(roads, [tokens for kind, tokens in stops if kind == "TRAFFIC_LIGHT"])
        for road in dividers(tables, self.is_left_hand, self.findings):
            roads[road.id] = road
        junctions[MARKS] = Junction(0, MARKS, "default", ())
        areas = tuple(area for layer in _SURFACES for area in self._areas(*layer))
        name = tables.path.name.removesuffix(".json")
        return StreetMap(
            name, (1, 3), roads, junctions, {}, tuple(self.findings), None, areas, (), tuple(self._crossings()),
            "map expansion of nuScenes", "nuScenes, CC BY-NC-SA 4.0" if not tables.has(SHIFT) else "",
        )  # fmt: skip # a call

    def _ways(self, layer: str) -> Iterator[_Way]:
        for row in self.tables.rows(layer):
            token = row["token"]
            parts = self.tables.parts(token)
            pieces, s = [], 0.0
            for x, y, heading, length, curvature in parts:
                numbers = {"curvStart": curvature, "curvEnd": curvature} if curvature else {}
                kind = "arc" if curvature else "line"
                pieces.append(PlanPiece(0, s, x, y, heading, length, kind, numbers))
                s += length
            if s < _SHORTEST:
                self.findings.append(Finding(0, f"{layer} '{token[:8]}' has no path and is left out"))
                continue
            line = shapely.LineString(_points(pieces))
            outline = self.tables.outline(row, layer)
            width = float(np.clip(outline.area / s, *WIDTHS)) if outline.area > 0.0 else WIDTH
            width = float(row["scarl_width"]) if _is_positive(row.get("scarl_width")) else width
            yield _Way(str(row.get("scarl_name", token)), row, layer, tuple(pieces), s, line, width)

    def _stops(self) -> list[tuple[str, list[str]]]:
        """Return the stop lines that count: kind, and the lanes that end there."""
        tokens = [token for token, way in self.ways.items() if way.layer == "lane"]
        ends = shapely.points([shapely.get_coordinates(self.ways[one].line)[-1] for one in tokens])
        tree = shapely.STRtree(ends)
        found, unused = [], 0
        for row in self.tables.rows("stop_line"):
            kind = row.get("stop_line_type")
            if kind not in STOPS:
                unused += 1
                continue
            near = tree.query(self.tables.outline(row, "stop_line"), predicate="dwithin", distance=_AT_LINE)
            if len(near):
                found.append((str(kind), [tokens[k] for k in sorted(near)]))
        if unused:
            self.findings.append(Finding(0, f"{unused} stop lines before crossings and turns stop nobody"))
        return found

    def _junctions(self, stops: Sequence[tuple[str, list[str]]]) -> tuple[dict[str, str], dict[str, Junction]]:
        """Return the junction of each lane inside one, and the junctions.

        Inside are connectors, what follows a stop line or a fork, and what these cross.
        """
        waits = {token for _, own in stops for token in own}
        inner = {token for token, way in self.ways.items() if way.layer == "lane_connector"}
        inner |= {one for token, after in self.next.items() if len(after) > 1 or token in waits for one in after}
        tokens = list(self.ways)
        tree = shapely.STRtree([self.ways[one].line for one in tokens])
        group = {token: token for token in inner}

        def root(token: str) -> str:
            while group[token] != token:
                token = group[token]
            return token

        for token in sorted(inner):
            near = tree.query(self.ways[token].line, predicate="dwithin", distance=_CROSSING)
            for other in (tokens[k] for k in sorted(near)):
                if other != token and not self._follows(token, other) and not self._follows(other, token):
                    group.setdefault(other, other)
                    group[root(other)] = root(token)
        names: dict[str, str] = {}
        inside = {token: names.setdefault(root(token), f"junction_{len(names)}") for token in sorted(group)}
        junctions = {}
        for name in names.values():
            own = {token for token, one in inside.items() if one == name}
            links = tuple(
                Connection(0, self.ways[before].road, self.ways[token].road, "start", ((self.side, self.side),))
                for before, after in self.next.items()
                for token in after
                if token in own
            )
            minor = {one for kind, at in stops if kind != "TRAFFIC_LIGHT" for token in at for one in self.next[token]}
            pairs = tuple(
                (self.ways[other].road, self.ways[token].road)
                for token in sorted(own & minor)
                for other in sorted(own - minor)
            )
            junctions[name] = Junction(0, name, "default", links, pairs)
        return inside, junctions

    def _follows(self, token: str, other: str) -> bool:
        return other in self.next[token]

    def _road(self, token: str, inside: Mapping[str, str]) -> Road:
        """Return the road of a lane: its path is the reference line and the middle of the one lane."""
        way, side = self.ways[token], self.side
        kind = _KINDS.get(str(way.row.get("lane_type", "CAR")), "driving")
        speed: Any = way.row.get("scarl_speed")
        speeds = ((0.0, float(speed)),) if _is_positive(speed) else ()
        after = self.next[token]
        link: RoadLink | None = None
        if len(after) == 1:
            link = RoadLink("road", self.ways[after[0]].road, "start")
        elif after:
            link = RoadLink("junction", inside[after[0]], "")
        lane = MapLane(
            0, side, kind, False, constant(way.width), None, np.zeros((0, 3)), (), (), (side,) if after else (), speeds
        )
        return Road(
            0, way.road, "", way.length, inside.get(token, "-1"), self.is_left_hand, way.plan, Cubics(), Cubics(),
            (Cubics(), Cubics()), np.zeros((0, 6)), constant(-0.5 * side * way.width),
            (LaneSection(0, 0.0, way.length, {side: lane}),), None, link,
        )  # fmt: skip # a row of a table

    def _add_lights(self, roads: dict[str, Road], lines: Sequence[Sequence[str]]) -> None:
        """Add a light for each stop line: beside its outermost lane, and by reference for the others."""
        for number, tokens in enumerate(lines):
            ways = [self.ways[token] for token in tokens]
            before, end = shapely.get_coordinates(ways[0].line)[-2:]
            outward = self.side * np.array([before[1] - end[1], end[0] - before[0]])  # to where oncoming traffic is not
            outer = max(ways, key=lambda way: float(shapely.get_coordinates(way.line)[-1] @ outward))
            for way in ways:
                road, s = roads[way.road], max(way.length - _BEFORE, 0.5 * way.length)
                name = f"light_{number}"
                if way is outer:
                    signal = MapSignal(
                        0, name, s, self.side * (0.5 * way.width + _BESIDE), 0.0, 0.0, "+", True, "", "1000001", "-1",
                        None, "", 0.0, 0.0, (self.side,),
                    )  # fmt: skip # a row of a table
                    roads[way.road] = replace(road, signals=(*road.signals, signal))
                else:
                    roads[way.road] = replace(
                        road, references=(*road.references, SignalReference(0, name, s, "+", (self.side,)))
                    )

    def _areas(self, layer: str, material: str, semantic: str, rise: float) -> Iterator[Area]:
        for row in self.tables.rows(layer):
            for part in shapely.get_parts(self.tables.outline(row, layer)):
                if part.geom_type == "Polygon" and part.area > _SMALLEST:
                    rings = tuple(shapely.get_coordinates(ring)[:-1] for ring in (part.exterior, *part.interiors))
                    yield Area(0, rings, material, semantic, rise)

    def _crossings(self) -> Iterator[MapObject]:
        for row in self.tables.rows("ped_crossing"):
            for part in shapely.get_parts(self.tables.outline(row, "ped_crossing")):
                if part.geom_type != "Polygon" or part.area < _SMALLEST:
                    continue
                ring = shapely.get_coordinates(shapely.minimum_rotated_rectangle(part))[:4]
                outline = Outline(tuple(Corner(True, float(x), float(y), 0.0, 0.0) for x, y in ring))
                x, y = ring.mean(0).tolist()
                yield MapObject(
                    0, row["token"], "crosswalk", "", x, y, 0.0, 0.0, "none", (0.0, 0.0, 0.0, 0.0), (outline,)
                )


def _points(pieces: Sequence[PlanPiece]) -> Array:
    """Return points of a plan view, at most `_STEP` apart [m]."""
    rows = []
    for piece in pieces:
        frame = evaluate(piece, np.linspace(0.0, piece.length, max(int(np.ceil(piece.length / _STEP)), 1) + 1))
        rows.append(np.column_stack([frame.x, frame.y]))
    return np.concatenate(rows)


def _is_positive(value: object) -> bool:
    return isinstance(value, int | float) and 0.0 < value < 100.0
