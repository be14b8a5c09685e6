"""Writes the lanes of a scene as a road network of SUMO, by its program netconvert."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.scene.lanes import Lane, LaneNetwork, Signals
from scarl_sionna.scene.streets.sumo.netconvert import run_netconvert

from .tracks import curve_speed, track_graph

Array = npt.NDArray[np.float64]

_LONGEST_CONNECTOR = 80.0
"""A lane that crosses others and is longer than this is a road and not a way across a junction [m]."""
_SHORTEST_EDGE = 5.0
"""A lane that is shorter belongs to the junction at its ends [m]."""
_PIECE = 12.0
"""Shortest piece of a lane with a speed of its own [m]."""
_AMBER = 3.0
"""Amber at the end of green [s]."""


@dataclass(frozen=True)
class SumoNetwork:
    """A network file of SUMO: `path`; for each edge its length [m], speed [m/s] and following edges.

    And where vehicles enter.
    """

    path: Path
    length: dict[str, float]
    speed: dict[str, float]
    next: dict[str, tuple[str, ...]]
    entries: tuple[str, ...]


class _Sets:
    """Sets that are joined (union-find); the first element names a set."""

    def __init__(self) -> None:
        self._parent: dict[str, str] = {}

    def of(self, item: str) -> str:
        self._parent.setdefault(item, item)
        while self._parent[item] != item:
            item = self._parent[item]
        return item

    def join(self, first: str, second: str) -> None:
        one, other = sorted((self.of(first), self.of(second)))
        self._parent[other] = one


def write_sumo_network(network: LaneNetwork, folder: str | Path) -> SumoNetwork:
    """Write the drive lanes of a network as ``lanes.net.xml``.

    Parameters
    ----------
    network : LaneNetwork
    folder : str or Path
        Existing folder for the network and the plain files that it is made from.

    Returns
    -------
    SumoNetwork

    Raises
    ------
    ParameterRangeError
        If there is no lane to drive on.
    MissingPackageError
        If netconvert (package ``eclipse-sumo``) is not installed.
    SimulatorError
        If netconvert refuses the network.

    Notes
    -----
    A lane becomes an edge, lanes side by side become the lanes of one edge, and lanes that cross others become the ways
    across one junction, with the shape of their centre line. Lanes that yield get a lower priority; signals become
    fixed-time programs with 3 s of amber at the end of green. Names of edges are those of (rightmost) lanes. *Not
    written*: walkways, cycle lanes.
    """
    lanes = {lane.name: lane for lane in network.of_kind("drive")}
    if not lanes:
        raise ParameterRangeError("network", "no lanes of kind 'drive'", "one or more")
    folder = Path(folder)
    across, crossing, shared = _ways_across(network, lanes)
    lanes, across = _cut(lanes, across, shared)
    lanes = _split(lanes, across)
    nodes = _nodes(lanes, across, crossing)
    roads = _roads({name: lane for name, lane in lanes.items() if name not in across}, nodes)
    edge_of = {name: (road[0], index) for road in roads for index, name in enumerate(road)}
    links = _links(lanes, across, edge_of)
    signalled = {nodes.of(f"{name} end") for name in edge_of if lanes[name].signal is not None}
    plan = _Plan(lanes, roads, nodes, signalled)
    _write_nodes(folder, plan)
    _write_edges(folder, plan)
    _write_links(folder, plan, links, edge_of, network.signals)
    path = folder / "lanes.net.xml"
    _netconvert(folder, path, bool(signalled))
    following: dict[str, list[str]] = {road[0]: [] for road in roads}
    for link in links:
        source, target = edge_of[link.source][0], edge_of[link.target][0]
        if target not in following[source]:
            following[source].append(target)
    entered = {name for names in following.values() for name in names}
    return SumoNetwork(
        path,
        {road[0]: lanes[road[0]].length for road in roads},
        {road[0]: lanes[road[0]].speed for road in roads},
        {name: tuple(names) for name, names in following.items()},
        tuple(road[0] for road in roads if road[0] not in entered),
    )


def _ways_across(
    network: LaneNetwork, lanes: dict[str, Lane]
) -> tuple[set[str], list[list[str]], dict[str, tuple[float, float]]]:
    """Return the lanes across junctions, the pairs of lanes that cross, and what others share of each.

    The last: of each lane's start and end [m].
    """
    graph = track_graph(LaneNetwork(tuple(network.lanes), (), network.signals), 0.0, 0.9, 4.6, on_foot=False)
    before: dict[str, list[str]] = {name: [] for name in lanes}
    for name, lane in lanes.items():
        for following in lane.next:
            if following in before:
                before[following].append(name)
    sides: dict[int, list[tuple[str, float, float, bool]]] = {}
    for track in graph.tracks:
        for zone, first, last, merges in track.zones:
            if track.lane in lanes:
                sides.setdefault(zone, []).append((str(track.lane), first, last, merges))
    crossing: list[list[str]] = []
    shared = {name: (0.0, 0.0) for name in lanes}
    for rows in sides.values():
        if len(rows) != 2:
            continue
        names = [row[0] for row in rows]
        if rows[0][3]:  # both end in the same lane
            for name, first, _, _ in rows:
                shared[name] = (shared[name][0], max(shared[name][1], lanes[name].length - first))
        elif set(before[names[0]]) & set(before[names[1]]) and max(row[1] for row in rows) < 1.0:
            for name, _, last, _ in rows:
                shared[name] = (max(shared[name][0], last), shared[name][1])
        else:
            crossing.append(names)

    def is_short(name: str) -> bool:
        return bool(before[name]) and bool(lanes[name].next) and lanes[name].length < _LONGEST_CONNECTOR

    across = {name for pair in crossing for name in pair if all(map(is_short, pair))}
    while True:  # those that begin beside one of them go across the same junction
        beside = {
            other
            for name in across
            for source in before[name]
            for other in lanes[source].next
            if other in lanes and is_short(other) and source not in across
        }
        if beside <= across:
            return across, crossing, shared
        across |= beside


def _cut(
    lanes: dict[str, Lane], across: set[str], shared: dict[str, tuple[float, float]]
) -> tuple[dict[str, Lane], set[str]]:
    """Return lanes without what they share with others where they fork or merge.

    Those pieces become ways across the junction there.
    """
    neighbours = {lane.left for lane in lanes.values() if lane.left} | {
        name for name, lane in lanes.items() if lane.left
    }
    entered = {following for lane in lanes.values() for following in lane.next}
    found: dict[str, Lane] = {}
    pieces, first_of = set(across), {}
    for name, lane in lanes.items():
        head, tail = shared[name] if name not in across and name not in neighbours else (0.0, 0.0)
        head, tail = head if name in entered else 0.0, tail if lane.next else 0.0
        if name in entered and lane.next and (lane.length < _SHORTEST_EDGE or lane.length - head - tail < 1.5):
            found[name], first_of[name] = lane, name
            if name not in neighbours:
                pieces.add(name)
            continue
        low = int(np.searchsorted(lane.distances, head)) if head > 0.0 else 0
        high = (
            int(np.searchsorted(lane.distances, lane.length - tail, side="right")) - 1
            if tail > 0.0
            else len(lane.points) - 1
        )
        if high <= low:
            low, high, head, tail = 0, len(lane.points) - 1, 0.0, 0.0
        start, end = f"{name}.start", f"{name}.end"
        first_of[name] = start if low > 0 else name
        is_cut = high < len(lane.points) - 1
        found[name] = replace(lane, points=lane.points[low : high + 1], next=(end,) if is_cut else lane.next)
        if low > 0:
            found[start] = Lane(start, lane.points[: low + 1], "drive", lane.width, lane.speed, (name,))
            pieces.add(start)
        if is_cut:
            found[end] = Lane(end, lane.points[high:], "drive", lane.width, lane.speed, lane.next)
            pieces.add(end)
    return {
        name: replace(lane, next=tuple(one if name == f"{one}.start" else first_of.get(one, one) for one in lane.next))
        for name, lane in found.items()
    }, pieces


def _split(lanes: dict[str, Lane], across: set[str]) -> dict[str, Lane]:
    """Return lanes cut where bends ask for another speed, as SUMO keeps one speed along an edge.

    The first piece keeps the name.
    """
    neighbours = {lane.left for lane in lanes.values() if lane.left} | {
        name for name, lane in lanes.items() if lane.left
    }
    found, last_of = {}, {}
    for name, lane in lanes.items():
        ways = np.linspace(0.0, lane.length, max(int(lane.length), 4) + 1)
        limits = np.minimum(curve_speed(lane.points, lane.distances, ways), lane.speed)
        if name in across or name in neighbours:
            slow = float(np.clip(limits.min(), 2.0, lane.speed)) if name in across else lane.speed
            found[name], last_of[name] = replace(lane, speed=slow), name
            continue
        cuts = [0]
        for index in range(1, len(lane.points) - 1):
            if min(lane.distances[index] - lane.distances[cuts[-1]], lane.length - lane.distances[index]) >= _PIECE:
                cuts.append(index)
        edges = [*cuts, len(lane.points) - 1]
        pieces: list[tuple[int, int, float]] = []
        for first, last in pairwise(edges):
            start, stop = lane.distances[first] + 3.0, lane.distances[last] - 3.0
            inside = (ways >= min(start, stop - 1.0)) & (
                ways <= max(stop, start + 1.0)
            )  # what is beyond 3 m bends for its neighbours
            speed = float(np.clip(limits[inside].min(), 2.0, lane.speed))
            if pieces and abs(pieces[-1][2] - speed) < 0.1 * speed:
                pieces[-1] = (pieces[-1][0], last, min(speed, pieces[-1][2]))
            else:
                pieces.append((first, last, speed))
        names = [name if index == 0 else f"{name}.{index}" for index in range(len(pieces))]
        last_of[name] = names[-1]
        for index, (first, last, speed) in enumerate(pieces):
            is_last = index == len(pieces) - 1
            found[names[index]] = Lane(
                names[index],
                lane.points[first : last + 1],
                "drive",
                lane.width,
                speed,
                lane.next if is_last else (names[index + 1],),
                None,
                lane.yield_to if is_last else (),
                lane.signal if is_last else None,
            )
    return {
        name: replace(lane, yield_to=tuple(last_of[one] for one in lane.yield_to if one in last_of))
        for name, lane in found.items()
    }


def _nodes(lanes: dict[str, Lane], across: set[str], crossing: list[list[str]]) -> _Sets:
    """Return the ends of lanes, joined where they are one node."""
    nodes = _Sets()
    for name, lane in lanes.items():
        for following in lane.next:
            if following in lanes:
                nodes.join(f"{name} end", f"{following} start")
        if name in across:
            nodes.join(f"{name} start", f"{name} end")
    for pair in crossing:
        if across.issuperset(pair):
            nodes.join(f"{pair[0]} start", f"{pair[1]} start")
    return nodes


def _roads(lanes: dict[str, Lane], nodes: _Sets) -> list[list[str]]:
    """Return the lanes of each edge, from right to left."""
    right_of = {lane.left: name for name, lane in lanes.items() if lane.left in lanes}
    roads = []
    for name in lanes:
        if name in right_of:
            continue
        road = [name]
        while (left := lanes[road[-1]].left) in lanes and left not in road:
            ends = [np.linalg.norm(lanes[str(left)].points[index] - lanes[name].points[index]) for index in (0, -1)]
            if max(ends) > 1.6 * len(road) * (lanes[name].width + lanes[str(left)].width) / 2.0:
                break
            road.append(str(left))
            for end in ("start", "end"):
                nodes.join(f"{name} {end}", f"{left} {end}")
        roads.append(road)
    listed = {name for road in roads for name in road}
    return roads + [[name] for name in lanes if name not in listed]


@dataclass(frozen=True, eq=False)
class _Link:
    """A way from a lane to a lane of another edge; across a junction by a curve, slower than its lanes."""

    source: str
    target: str
    across: tuple[Lane, ...] = ()


@dataclass(frozen=True, eq=False)
class _Plan:
    """What netconvert is given.

    Lanes by name, the lanes of each edge from right to left, ends joined to nodes, and the nodes with signals.
    """

    lanes: dict[str, Lane]
    roads: list[list[str]]
    nodes: _Sets
    signalled: set[str]


def _links(lanes: dict[str, Lane], across: set[str], edge_of: dict[str, tuple[str, int]]) -> list[_Link]:
    """Return all ways from one edge to the next."""

    def ways(name: str, passed: tuple[Lane, ...]) -> Iterator[tuple[str, tuple[Lane, ...]]]:
        for following in lanes[name].next:
            if following in across and lanes[following] not in passed:
                yield from ways(following, (*passed, lanes[following]))
            elif following in edge_of:
                yield following, passed

    return [
        _Link(name, target, passed)
        for name in edge_of
        for target, passed in ways(name, ())
        if edge_of[target][0] != edge_of[name][0]
    ]


def _number(name: str) -> str:
    return f"{name.replace(' ', '_')}"


def _shape(points: Array) -> str:
    return " ".join(f"{x:.3f},{y:.3f},{z:.3f}" for x, y, z in points)


def _save(root: ET.Element, path: Path) -> None:
    ET.indent(root)
    path.write_text(ET.tostring(root, encoding="unicode") + "\n", encoding="utf-8")


def _write_nodes(folder: Path, plan: _Plan) -> None:
    lanes, nodes, signalled = plan.lanes, plan.nodes, plan.signalled
    places: dict[str, list[Array]] = {}
    for road in plan.roads:
        for name in road:
            places.setdefault(nodes.of(f"{name} start"), []).append(lanes[name].points[0])
            places.setdefault(nodes.of(f"{name} end"), []).append(lanes[name].points[-1])
    root = ET.Element("nodes")
    for node in sorted(places):
        x, y, z = np.mean(places[node], axis=0)
        kind = "traffic_light" if node in signalled else "priority"
        values = {"id": _number(node), "x": f"{x:.3f}", "y": f"{y:.3f}", "z": f"{z:.3f}", "type": kind}
        element = ET.SubElement(root, "node", values | ({"tl": _number(node)} if node in signalled else {}))
        if (
            np.ptp(places[node], axis=0).max() < 0.5
        ):  # lanes go on: netconvert shall not cut them back to round the node off
            element.set(
                "shape",
                f"{x - 0.1:.3f},{y - 0.1:.3f} {x + 0.1:.3f},{y - 0.1:.3f} "
                f"{x + 0.1:.3f},{y + 0.1:.3f} {x - 0.1:.3f},{y + 0.1:.3f}",
            )
    _save(root, folder / "lanes.nod.xml")


def _yields(lanes: dict[str, Lane], name: str) -> bool:
    """Return whether vehicles at the end of a lane give way: the lane says so, or all lanes that lead to it do."""
    leading = [lane for lane in lanes.values() if name in lane.next]
    return bool(lanes[name].yield_to) or (bool(leading) and all(lane.yield_to for lane in leading))


def _write_edges(folder: Path, plan: _Plan) -> None:
    lanes, nodes = plan.lanes, plan.nodes
    root = ET.Element("edges")
    for road in plan.roads:
        first = lanes[road[0]]
        values = {
            "id": first.name,
            "from": _number(nodes.of(f"{first.name} start")),
            "to": _number(nodes.of(f"{first.name} end")),
            "numLanes": str(len(road)),
            "speed": f"{first.speed:.3f}",
            "spreadType": "center",
            "priority": "1" if any(_yields(lanes, name) for name in road) else "5",
            "shape": _shape(first.points),
        }
        edge = ET.SubElement(root, "edge", values)
        for index, name in enumerate(road):
            lane = lanes[name]
            shape = {"shape": _shape(lane.points)} if len(road) > 1 else {}
            ET.SubElement(
                edge, "lane", {"index": str(index), "speed": f"{lane.speed:.3f}", "width": f"{lane.width:.2f}", **shape}
            )
    _save(root, folder / "lanes.edg.xml")


def _write_links(
    folder: Path, plan: _Plan, links: list[_Link], edge_of: dict[str, tuple[str, int]], signals: Signals | None
) -> None:
    root, lights = ET.Element("connections"), ET.Element("tlLogics")
    controlled: dict[str, list[str | None]] = {}
    for link in links:
        source, target = link.source, link.target
        ends = {
            "from": edge_of[source][0],
            "to": edge_of[target][0],
            "fromLane": str(edge_of[source][1]),
            "toLane": str(edge_of[target][1]),
        }
        curve = {}
        if link.across:
            curve = {
                "shape": _shape(np.concatenate([lane.points for lane in link.across])),
                "speed": f"{min(lane.speed for lane in link.across):.3f}",
            }
        ET.SubElement(root, "connection", ends | curve)
        node = plan.nodes.of(f"{source} end")
        if node in plan.signalled:
            groups = controlled.setdefault(node, [])
            ET.SubElement(lights, "connection", ends | {"tl": _number(node), "linkIndex": str(len(groups))})
            groups.append(plan.lanes[source].signal)
    for node, groups in controlled.items():
        assert signals is not None
        program = ET.Element("tlLogic", {"id": _number(node), "type": "static", "programID": "0", "offset": "0"})
        for duration, state in _phases(groups, signals):
            ET.SubElement(program, "phase", {"duration": f"{duration:.3f}", "state": state})
        lights.insert(0, program)
    _save(root, folder / "lanes.con.xml")
    _save(lights, folder / "lanes.tll.xml")


def _phases(groups: list[str | None], signals: Signals) -> list[tuple[float, str]]:
    """Return duration [s] and state of each phase of one cycle."""
    edges = {0.0, signals.cycle}
    for start, stop in signals.green.values():
        edges |= {start, stop, max(stop - _AMBER, start)}
    times = sorted(edges)
    phases = []
    for first, last in pairwise(times):
        state = ""
        for group in groups:
            left = float("inf") if group is None else signals.green_left(group, (first + last) / 2.0)
            state += "r" if left <= 0.0 else "y" if left < _AMBER else "g"
        phases.append((last - first, state))
    return phases


def _netconvert(folder: Path, path: Path, with_signals: bool) -> None:
    options = ["--node-files", "lanes.nod.xml", "--edge-files", "lanes.edg.xml", "--connection-files", "lanes.con.xml"]
    if with_signals:
        options += ["--tllogic-files", "lanes.tll.xml"]
    options += ["--offset.disable-normalization", "true", "--no-turnarounds", "true", "--junctions.corner-detail", "0"]
    options += ["--geometry.max-grade.fix", "false", "--output-file", str(path.resolve())]
    run_netconvert(options, folder, path, "the lanes")
