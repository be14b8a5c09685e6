"""A network of SUMO as a street map: roads of its edges, ways through junctions, right of way, lights, crossings."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import shapely

from ..geometry.road import RoadShape
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
    Outline,
    Road,
    RoadLink,
    StreetMap,
)
from ..network.ways import KINDS
from .lights import junction_lights
from .lines import End, connecting, wrapped
from .net import Net, NetLink, read_net
from .roads import KERB, NetRoads, Place, kind_of, lane_end, net_roads
from .stubs import without_stubs

_NEAR, _KINK = 0.05, np.radians(4.0)
"""Lanes whose ends are closer and whose headings differ by less continue each other without a way between."""
_TURNING = 10.0
"""Between the ends of a way back [m]: a car turns in no less."""
_SMALLEST = 1.0
"""Junctions of less ground plan have no surface of their own [m2]."""


@dataclass(frozen=True)
class Streets:
    """A map, and which edges of the file each of its roads is made of (empty for ways through junctions)."""

    street: StreetMap
    origins: dict[str, tuple[str, ...]]


def read_network(path: Path) -> StreetMap:
    """Return a network's file (``.net.xml``) as a street map.

    Raises
    ------
    MapError
        If the file cannot be read, is no network of SUMO, or a value is missing or not allowed; with its line.
    """
    return net_street(read_net(path)).street


def net_street(net: Net) -> Streets:
    """Return a network as a street map.

    Notes
    -----
    Lanes keep the file's shapes, but that corners are arcs (`lines.rounded`). Edges of both directions become one road
    where they share their border. Ways through junctions are cubics along the file's internal lanes. Marks follow from
    the lanes, since the file has none.
    """
    net = without_stubs(net)
    findings = list(net.findings)
    found = net_roads(net)
    roads, ways = _with_ways(net, found, findings)
    lights = junction_lights(net, found, findings)
    roads = {
        name: replace(road, signals=lights.signals.get(name, ())) if name in lights.signals else road
        for name, road in roads.items()
    }
    street = StreetMap(
        net.name,
        (1, 8),
        roads,
        _junctions(net, ways),
        lights.controllers,
        tuple(findings),
        lights.program,
        tuple(_areas(net)),
        (),
        tuple(_crossings(net)),
        "road network of SUMO",
    )
    return Streets(street, {name: _origins(found, name) for name in found.roads})


def _origins(found: NetRoads, name: str) -> tuple[str, ...]:
    return tuple(dict.fromkeys(one for edge in found.edges[name] for lane in edge.lanes for one in lane.origins))


@dataclass(frozen=True)
class _Way:
    """A link as a way: its junction, roads and lanes; `inside` are the internal lanes that it passes."""

    link: NetLink
    junction: str
    source: Place
    target: Place
    road: str
    contact: str
    lane: int
    inside: tuple[str, ...]


def _with_ways(net: Net, found: NetRoads, findings: list[Finding]) -> tuple[dict[str, Road], list[_Way]]:
    """Return all roads, with those through junctions, and the ways."""
    shapes = {name: RoadShape(road) for name, road in found.roads.items()}
    further = {f"{link.source}_{link.from_lane}": link.via for link in net.links if link.source not in net.edges}
    roads = dict(found.roads)
    ways: list[_Way] = []
    for link in net.links:
        source, target = (link.source, link.from_lane), (link.target, link.to_lane)
        if source not in found.places or target not in found.places:
            continue
        first, last = found.places[source], found.places[target]
        kinds = [roads[one.road].sections[0].lanes[one.lane].kind for one in (first, last)]
        if kinds[0] not in KINDS or kinds[1] not in KINDS:
            continue
        if KINDS[kinds[0]] != KINDS[kinds[1]]:
            findings.append(
                Finding(
                    link.line,
                    f"a way from a lane of kind '{KINDS[kinds[0]]}' to one of '{KINDS[kinds[1]]}' is not used",
                )
            )
            continue
        inside = tuple(_inside(link.via, further))
        guide = [net.inner[one].shape for one in inside if one in net.inner]
        ends = lane_end(shapes[first.road], first, True), lane_end(shapes[last.road], last, False)
        gap = float(np.linalg.norm((ends[1].point - ends[0].point)[:2]))
        if link.direction == "t" and gap < _TURNING:
            findings.append(Finding(link.line, "a way back that is narrower than 10 m is not used"))
            continue
        junction, contact = net.edges[link.source].stop, "start" if last.is_forward else "end"
        if gap < _NEAR:
            if abs(float(wrapped(np.array(ends[1].heading - ends[0].heading)))) > _KINK:
                findings.append(Finding(link.line, "a way with a kink of more than 4 deg and no length is not used"))
                continue
            ways.append(_Way(link, junction, first, last, last.road, contact, last.lane, inside))
            continue
        name = f"{junction}:{link.source}_{link.from_lane}:{link.target}_{link.to_lane}"
        side = 1 if net.is_left_hand else -1
        speed = net.inner[inside[0]].speed if inside and inside[0] in net.inner else 0.0
        speed = speed or net.edges[link.target].lanes[link.to_lane].speed
        ways.append(_Way(link, junction, first, last, name, "start", side, inside))
        roads[name] = _connecting(ways[-1], ends, kinds[0], guide, speed)
    return roads, ways


def _inside(via: str, further: dict[str, str]) -> Iterator[str]:
    """Return the internal lanes that a way passes, one after the other."""
    seen: set[str] = set()
    while via and via not in seen:
        seen.add(via)
        yield via
        via = further.get(via, "")


def _connecting(way: _Way, ends: tuple[End, End], kind: str, guide: list[Array], speed: float) -> Road:
    """Return the road of a way through a junction: one lane, as wide at its ends as the lanes that it joins."""
    link, name, junction, first, last, side = way.link, way.road, way.junction, way.source, way.target, way.lane
    points = (
        np.concatenate([shape[1:-1] if len(guide) == 1 else shape for shape in guide]) if guide else np.zeros((0, 3))
    )
    line = connecting(ends[0], ends[1], points, link.line)
    grown = ends[1].width - ends[0].width
    width = np.array([[ends[0].width, 0.0, 3.0 * grown / line.length**2, -2.0 * grown / line.length**3]])
    lane = MapLane(
        link.line, side, kind, False, Cubics(np.zeros(1), width), None, np.zeros((0, 3)), (), (first.lane,),
        (last.lane,), ((0.0, max(speed, 1.0)),),
    )  # fmt: skip # a row of a table
    return Road(
        link.line, name, "", line.length, junction, side > 0, line.plan, line.elevation, Cubics(),
        (Cubics(), Cubics()), np.zeros((0, 6)), Cubics(np.zeros(1), -0.5 * side * width),
        (LaneSection(link.line, 0.0, line.length, {side: lane}),),
        RoadLink("road", first.road, "end" if first.is_forward else "start"),
        RoadLink("road", last.road, "start" if last.is_forward else "end"),
    )  # fmt: skip # a row of a table


def _junctions(net: Net, ways: list[_Way]) -> dict[str, Junction]:
    """Return the junctions with their ways, and which of them go first."""
    by_junction: dict[str, list[_Way]] = {name: [] for name in net.junctions}
    for way in ways:
        by_junction.setdefault(way.junction, []).append(way)
    found = {}
    for name, own in by_junction.items():
        junction = net.junctions.get(name)
        line = junction.line if junction else own[0].link.line
        links = tuple(
            Connection(way.link.line, way.source.road, way.road, way.contact, ((way.source.lane, way.lane),))
            for way in own
        )
        pairs: set[tuple[str, str]] = set()
        if junction is not None and len(junction.responses) == len(junction.inside):
            number = {lane: index for index, lane in enumerate(junction.inside)}
            road_of = {number[lane]: way.road for way in own for lane in way.inside if lane in number}
            for index, others in enumerate(junction.responses):
                pairs |= {(road_of[k], road_of[index]) for k in others if k in road_of and index in road_of}
        one_way = tuple(sorted(pair for pair in pairs if pair[::-1] not in pairs and pair[0] != pair[1]))
        found[name] = Junction(line, name, "default", links, one_way)
    return found


def _areas(net: Net) -> Iterator[Area]:
    """Return the paved places of junctions and of walkers at their corners."""
    raised = _beside_pavements(net)
    for lane in net.walking:
        if lane.id.rpartition("_")[0] in raised:
            yield from _area(lane.line, lane.shape, "paving", "SideWalks", KERB)
    for junction in net.junctions.values():
        if junction.kind not in ("dead_end", "internal", "rail_crossing", "rail_signal"):
            yield from _area(junction.line, junction.shape, "asphalt_street", "Roads", 0.0)


def _beside_pavements(net: Net) -> set[str]:
    """Return the edges for walkers at junctions that continue a pavement."""
    found = set()
    for link in net.links:
        ends = ((link.source, link.from_lane, link.target), (link.target, link.to_lane, link.source))
        for edge, lane, other in ends:
            own = net.edges.get(edge)
            if own is not None and 0 <= lane < len(own.lanes) and kind_of(own.lanes[lane]) == "sidewalk":
                found.add(other)
    return found


def _area(line: int, shape: Array, material: str, semantic: str, rise: float) -> Iterator[Area]:
    if len(shape) < 3:
        return
    for part in shapely.get_parts(shapely.make_valid(shapely.Polygon(shape[:, :2]))):
        if part.geom_type == "Polygon" and part.area > _SMALLEST:
            rings = tuple(shapely.get_coordinates(ring)[:-1] for ring in (part.exterior, *part.interiors))
            yield Area(line, rings, material, semantic, rise)


def _crossings(net: Net) -> Iterator[MapObject]:
    """Return the crossings of walkers: as long as their lines, as wide as their lanes."""
    for lane in net.crossings:
        first, last = lane.shape[0, :2], lane.shape[-1, :2]
        along = last - first
        if np.linalg.norm(along) < 0.5:
            continue
        across = 0.5 * lane.width * np.array([-along[1], along[0]]) / np.linalg.norm(along)
        corners = [first - across, last - across, last + across, first + across]
        outline = Outline(tuple(Corner(True, float(x), float(y), 0.0, 0.0) for x, y in corners))
        yield MapObject(
            lane.line, lane.id, "crosswalk", "", float(first[0]), float(first[1]), 0.0, 0.0, "none",
            (0.0, 0.0, 0.0, 0.0), (outline,),
        )  # fmt: skip # a row of a table
