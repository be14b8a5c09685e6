"""Reads a road network of SUMO as plain data: edges with lanes, links between lanes, junctions, programs of lights."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from scarl_sionna.core.errors import MapError
from scarl_sionna.core.untrusted.xml_text import LinedElement

from ..model import Array, Finding
from ..source import LARGEST, Source, children, read_root

MOST_POINTS = 100_000
"""Points that one line may have."""
LANE_WIDTH = 3.2
"""Width of a lane for which the file states none (SUMO's own default) [m]."""
USED: dict[str, tuple[str, ...]] = {
    "net": ("location", "edge", "tlLogic", "junction", "connection", "type", "roundabout", "param"),
    "location": (), "type": ("restriction", "param"), "roundabout": (), "restriction": (), "param": (),
    "edge": ("lane", "param"),
    "lane": ("param",),
    "tlLogic": ("phase", "param"),
    "junction": ("request", "param"),
    "connection": ("param",),
}  # fmt: skip # a table
"""Children of each element that are used, or say nothing that a scene has."""


@dataclass(frozen=True, eq=False)
class NetLane:
    """A lane: centre line (n, 3), width [m], speed limit [m/s]; `allows` and `disallows` are classes of vehicles."""

    line: int
    id: str
    allows: frozenset[str]
    disallows: frozenset[str]
    speed: float
    width: float
    shape: Array
    origins: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class NetEdge:
    """An edge from one junction to another; its lanes from right to left (in left-hand networks from left to right)."""

    line: int
    id: str
    start: str
    stop: str
    kind: str
    name: str
    function: str
    lanes: tuple[NetLane, ...]


@dataclass(frozen=True)
class NetLink:
    """A way from a lane to a lane over an internal lane `via`; `light`: id of its lights and its place in them.

    `direction` is a letter: ``s`` straight on, ``l`` and ``r``, ``t`` back where it came from.
    """

    line: int
    source: str
    target: str
    from_lane: int
    to_lane: int
    via: str
    direction: str
    light: tuple[str, int] | None


@dataclass(frozen=True, eq=False)
class NetJunction:
    """A junction: its outline (n, 3), internal lanes in the order of its rules, and for each whom it gives way to."""

    line: int
    id: str
    kind: str
    shape: Array
    inside: tuple[str, ...]
    responses: tuple[frozenset[int], ...]


@dataclass(frozen=True)
class NetProgram:
    """A fixed program of lights: duration [s] and state of each phase, a letter a link."""

    line: int
    id: str
    offset: float
    phases: tuple[tuple[float, str], ...]


@dataclass(frozen=True, eq=False)
class Net:
    """A whole file; `crossings` are centre line and width, `walking` outlines of places for walkers."""

    name: str
    is_left_hand: bool
    edges: dict[str, NetEdge]
    inner: dict[str, NetLane]
    links: tuple[NetLink, ...]
    junctions: dict[str, NetJunction]
    programs: dict[str, NetProgram]
    crossings: tuple[NetLane, ...]
    walking: tuple[NetLane, ...]
    findings: tuple[Finding, ...]


def read_net(path: Path) -> Net:
    """Return what a network's file says.

    Parameters
    ----------
    path : Path

    Returns
    -------
    Net

    Raises
    ------
    MapError
        If the file cannot be read, is no network of SUMO, or a value is missing or not allowed; with its line.
    """
    root = read_root(path, "net", "a network of SUMO (.net.xml)", "a network of SUMO")
    source = Source(path)
    source.note_unused(root, USED)
    all_edges = [_edge(source, element) for element in children(root, "edge")]
    edges: dict[str, NetEdge] = {}
    for edge in all_edges:
        if edge.function in ("", "normal"):
            if edge.id in edges:
                raise MapError(f"<edge> id = '{edge.id}' stands twice", path, "give each edge its own", edge.line)
            edges[edge.id] = edge
        elif edge.function not in ("internal", "crossing", "walkingarea", "connector"):
            source.note(edge.line, f"<edge> of function '{edge.function}' is not used")
    if not edges:
        raise MapError("holds no edge to move on", path, "give a network with one or more")
    return Net(
        path.name.removesuffix(".net.xml"),
        source.text(root, "lefthand", "false") in ("true", "1"),
        edges,
        {lane.id: lane for edge in all_edges if edge.function == "internal" for lane in edge.lanes},
        tuple(_link(source, element) for element in children(root, "connection")),
        {j.id: j for j in (_junction(source, element) for element in children(root, "junction"))},
        _programs(source, children(root, "tlLogic")),
        tuple(lane for edge in all_edges if edge.function == "crossing" for lane in edge.lanes),
        tuple(lane for edge in all_edges if edge.function == "walkingarea" for lane in edge.lanes),
        source.findings(),
    )


def _edge(source: Source, element: LinedElement) -> NetEdge:
    function = source.text(element, "function", "")
    is_plain = function in ("", "normal")
    lanes = [(source.whole(one, "index"), _lane(source, one)) for one in children(element, "lane")]
    if not lanes:
        raise source.error(element, "has no <lane>")
    lanes.sort(key=lambda pair: pair[0])
    if [index for index, _ in lanes] != list(range(len(lanes))):
        raise source.error(element, f"has lanes {[k for k, _ in lanes][:9]}", "number them 0, 1, 2, ...")
    return NetEdge(
        element.line,
        source.text(element, "id"),
        source.text(element, "from", None if is_plain else ""),
        source.text(element, "to", None if is_plain else ""),
        source.text(element, "type", ""),
        source.text(element, "name", ""),
        function,
        tuple(lane for _, lane in lanes),
    )


def _lane(source: Source, element: LinedElement) -> NetLane:
    origins = [one.get("value", "") for one in children(element, "param") if one.get("key") == "origId"]
    return NetLane(
        element.line,
        source.text(element, "id"),
        frozenset(source.text(element, "allow", "").split()),
        frozenset(source.text(element, "disallow", "").split()),
        source.number(element, "speed", 13.9, 0.0, 1000.0),
        source.number(element, "width", LANE_WIDTH, 0.01, 100.0),
        points_of(source, element, "shape", 2),
        tuple(origins[0].split()) if origins else (),
    )


def points_of(source: Source, element: LinedElement, name: str, least: int) -> Array:
    """Return an attribute ``x,y[,z] x,y[,z] ...`` as points, shape (n, 3), n >= `least`."""
    words = source.text(element, name, "" if least == 0 else None).split()
    if not least <= len(words) <= MOST_POINTS:
        raise source.error(element, f"{name} has {len(words)} points", f"{least} to {MOST_POINTS} are read")
    points = np.zeros((len(words), 3))
    for row, word in zip(points, words, strict=True):
        try:
            values = [float(part) for part in word.split(",")]
        except ValueError:
            values = []
        if len(values) not in (2, 3) or not all(abs(value) <= LARGEST for value in values):
            raise source.error(element, f"{name} holds '{word[:40]}'", "give x,y or x,y,z in metres")
        row[: len(values)] = values
    return points


def _link(source: Source, element: LinedElement) -> NetLink:
    light = element.get("tl")
    return NetLink(
        element.line,
        source.text(element, "from"),
        source.text(element, "to"),
        source.whole(element, "fromLane"),
        source.whole(element, "toLane"),
        source.text(element, "via", ""),
        source.text(element, "dir", ""),
        (light, source.whole(element, "linkIndex")) if light else None,
    )


def _junction(source: Source, element: LinedElement) -> NetJunction:
    inside = tuple(source.text(element, "intLanes", "").split())
    responses: list[frozenset[int]] = []
    for one in children(element, "request"):
        if source.whole(one, "index") != len(responses):
            raise source.error(one, f"index = {one.get('index')}", f"{len(responses)} is next")
        bits = source.text(one, "response", "")
        if set(bits) - {"0", "1"} or len(bits) > 10_000:
            raise source.error(one, f"response = '{bits[:40]}' is no row of 0 and 1")
        responses.append(frozenset(k for k, bit in enumerate(reversed(bits)) if bit == "1"))
    return NetJunction(
        element.line,
        source.text(element, "id"),
        source.text(element, "type", "priority"),
        points_of(source, element, "shape", 0),
        inside,
        tuple(responses),
    )


def _programs(source: Source, elements: Sequence[LinedElement]) -> dict[str, NetProgram]:
    found: dict[str, NetProgram] = {}
    for element in elements:
        name = source.text(element, "id")
        if name in found:
            source.note(element.line, f"<tlLogic> '{name}' has another program, which is not used")
            continue
        phases = tuple(
            (source.number(one, "duration", low=0.0, high=3600.0), source.text(one, "state"))
            for one in children(element, "phase")
        )
        if not phases or sum(duration for duration, _ in phases) <= 0.0:
            source.note(element.line, f"<tlLogic> '{name}' has no phase of any length; it is not used")
            continue
        if len({len(state) for _, state in phases}) > 1:
            raise source.error(element, "has phases of different numbers of letters", "one letter a link")
        if source.text(element, "type", "static") != "static":
            source.note(element.line, "a <tlLogic> that follows the traffic runs its phases by their durations")
        found[name] = NetProgram(element.line, name, source.number(element, "offset", 0.0), phases)
    return found
