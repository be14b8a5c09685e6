"""Places on the roads of a map, and what follows on what: the ground that entities of OpenSCENARIO drive on."""

from __future__ import annotations

import heapq
import math
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from scarl_sionna.scene.streets.building.scene import centred
from scarl_sionna.scene.streets.geometry.road import RoadShape
from scarl_sionna.scene.streets.model import LaneSection, StreetMap
from scarl_sionna.scene.streets.network.ways import runs_forward
from scarl_sionna.scene.streets.opendrive.street import read_map

from .tables import LaneTable, RoadTable

Array = npt.NDArray[np.float64]
FARTHEST = 5000.0
"""How far one place is looked for from another along the roads [m]."""
_MOST_ROADS, _MOST_PIECES = 20_000, 2000
_CANDIDATES = 24


@dataclass(frozen=True)
class Spot:
    """Where an entity is on the roads: `lane` of section `section` of `road` at `s` [m].

    `way` is 1 along the reference line and -1 against it.
    """

    road: str
    section: int
    lane: int
    s: float
    way: int = 1


class Roads:
    """The roads of a map.

    Parameters
    ----------
    street : StreetMap
        As its scene has it: moved near the origin where it is far from it.
    """

    def __init__(self, street: StreetMap) -> None:
        self.street, shift = centred(street)
        self.shift = (float(shift[0]), float(shift[1]))
        self.shapes = {name: RoadShape(road) for name, road in self.street.roads.items()}
        self._tables: dict[str, RoadTable] = {}
        self._lanes: dict[tuple[str, int], LaneTable] = {}
        self._tree: tuple[cKDTree, list[tuple[str, float]]] | None = None

    @property
    def name(self) -> str:
        """Name of the map."""
        return self.street.name

    def table(self, road: str) -> RoadTable:
        """Return the reference line of a road."""
        if road not in self._tables:
            self._tables[road] = RoadTable(self.shapes[road])
        return self._tables[road]

    def lanes(self, road: str, section: int) -> LaneTable:
        """Return the lanes of a section."""
        key = (road, section)
        if key not in self._lanes:
            self._lanes[key] = LaneTable(self.shapes[road], self.street.roads[road].sections[section])
        return self._lanes[key]

    def section_at(self, road: str, s: float) -> int:
        """Return the number of the section at `s`."""
        sections = self.street.roads[road].sections
        return max((k for k, one in enumerate(sections) if one.s <= s + 1e-9), default=0)

    def section(self, spot: Spot) -> LaneSection:
        """Return the section of a spot."""
        return self.street.roads[spot.road].sections[spot.section]

    def middle(self, spot: Spot) -> float:
        """Return t of the middle of a spot's lane [m]."""
        return self.lanes(spot.road, spot.section).middle(spot.lane, spot.s)

    def direction(self, road: str, section: int, lane: int) -> int:
        """Return in which way traffic runs on a lane: 1 along the reference line, -1 against it."""
        own = self.street.roads[road].sections[section].lanes.get(lane)
        forward = runs_forward(self.street.roads[road], lane, "standard" if own is None else own.direction)
        return 1 if forward else -1

    def point(self, road: str, s: float, t: float) -> tuple[float, float, float]:
        """Return x, y [m] of a place in plan, and the heading of the reference line [rad]."""
        x, y, heading, _ = self.table(road).at(s)
        roll = float(self.street.roads[road].superelevation(np.asarray(s)))
        across = t * math.cos(roll)
        return x - across * math.sin(heading), y + across * math.cos(heading), heading

    def locate(self, x: float, y: float, near: str | None = None) -> tuple[str, float, float]:
        """Return road, s and t [m] of a point; a road that holds it before one that is near, `near` before others."""
        tree, owners = self._points()
        count = min(_CANDIDATES, len(owners))
        rows = np.atleast_1d(tree.query((x, y), count)[1]).tolist()
        best: tuple[float, str, float, float] | None = None
        seen: set[str] = set()
        for row in rows:
            road, start = owners[row]
            if road in seen:
                continue
            seen.add(road)
            s, t = self.table(road).project(x, y, start)
            px, py, _ = self.point(road, s, t)
            away = math.hypot(x - px, y - py) + self.lanes(road, self.section_at(road, s)).lane_at(s, t)[1]
            score = away - (0.05 if road == near else 0.0)
            if best is None or score < best[0] - 1e-9:
                best = (score, road, s, t)
        assert best is not None
        return best[1:]

    def _points(self) -> tuple[cKDTree, list[tuple[str, float]]]:
        if self._tree is None:
            parts, owners = [], []
            for road in self.street.roads:
                table = self.table(road)
                every = max(1, len(table.places) // max(int(table.length), 1))
                parts.append(np.column_stack([table.x[::every], table.y[::every]]))
                owners += [(road, s) for s in table.places[::every].tolist()]
            self._tree = (cKDTree(np.concatenate(parts)), owners)
        return self._tree

    def spot_at(self, road: str, s: float, t: float, way: int | None = None) -> tuple[Spot, float]:
        """Return the spot whose lane holds a place, and the place's offset to the left of the lane's middle [m]."""
        section = self.section_at(road, s)
        lane, _ = self.lanes(road, section).lane_at(s, t)
        spot = Spot(road, section, lane, s, way or self.direction(road, section, lane))
        return spot, spot.way * (t - self.middle(spot))

    def next_roads(self, road: str, way: int) -> list[tuple[str, int]]:
        """Return the roads, each with a way, that follow at the end of a road."""
        own = self.street.roads[road]
        link = own.successor if way > 0 else own.predecessor
        if link is None:
            return []
        if link.kind == "road":
            found = [(link.id, 1 if link.contact == "start" else -1)]
        else:
            junction = self.street.junctions.get(link.id)
            found = [
                (one.connecting, 1 if one.contact == "start" else -1)
                for one in (() if junction is None else junction.connections)
                if one.incoming == road
            ]
        return [one for one in dict.fromkeys(found) if one[0] in self.street.roads]

    def onward(self, spot: Spot, route: Collection[str] = ()) -> Spot | None:
        """Return where a lane goes on at the end of its section; None where the road ends.

        Through a junction it is along the route, else with the least turn.
        """
        road = self.street.roads[spot.road]
        lane = road.sections[spot.section].lanes.get(spot.lane)
        targets = () if lane is None else (lane.successors if spot.way > 0 else lane.predecessors)
        number = spot.section + spot.way
        if 0 <= number < len(road.sections):
            section = road.sections[number]
            s = section.s if spot.way > 0 else section.stop
            return self._on_lane(spot, spot.road, number, s, spot.way, (*targets, spot.lane))
        link = road.successor if spot.way > 0 else road.predecessor
        if link is None:
            return None
        if link.kind == "road":
            return self._entered(spot, link.id, link.contact, targets)
        choices = list(self._through(spot, link.id))
        on_route = [one for one in choices if one[0].road in route]
        with_lane = [one for one in on_route or choices if one[1]] or on_route or choices
        if not with_lane:
            return None
        return min(with_lane, key=lambda one: (abs(self._turn(one[0])), one[0].road))[0]

    def _through(self, spot: Spot, junction: str) -> Iterator[tuple[Spot, bool]]:
        """Yield the spots behind the end of a road at a junction, and whether the file links the lane to them."""
        known = self.street.junctions.get(junction)
        for one in () if known is None else known.connections:
            if one.incoming != spot.road or one.connecting not in self.street.roads:
                continue
            targets = tuple(target for start, target in one.lanes if start == spot.lane)
            entered = self._entered(spot, one.connecting, one.contact, targets)
            if entered is not None:
                yield entered, bool(targets) or not one.lanes

    def _entered(self, spot: Spot, road: str, contact: str, targets: tuple[int, ...]) -> Spot | None:
        if road not in self.street.roads:
            return None
        sections = self.street.roads[road].sections
        if contact == "start":
            return self._on_lane(spot, road, 0, 0.0, 1, targets)
        return self._on_lane(spot, road, len(sections) - 1, self.street.roads[road].length, -1, targets)

    def _on_lane(
        self, spot: Spot, road: str, section: int, s: float, way: int, targets: tuple[int, ...]
    ) -> Spot | None:
        """Return the spot on the first of some lanes that is there, else on the nearest to the end of the old one."""
        lanes = self.street.roads[road].sections[section].lanes
        found = next((lane for lane in targets if lane in lanes), None)
        if found is None:
            if not lanes:
                return None
            x, y, _ = self.point(spot.road, spot.s, self.middle(spot))
            _, t = self.table(road).project(x, y, s)
            table = self.lanes(road, section)
            found = min(lanes, key=lambda lane: abs(table.middle(lane, s) - t))
        return Spot(road, section, found, s, way)

    def _turn(self, spot: Spot) -> float:
        """Return by how much the road of a spot turns to its end [rad]."""
        table = self.table(spot.road)
        return abs(table.at(table.length)[2] - table.at(0.0)[2])

    def ahead(self, spot: Spot, road: str, s: float, route: Collection[str] = ()) -> float | None:
        """Return the way along the middle of a spot's lane to a place ahead [m]; None where it leads elsewhere."""
        total = 0.0
        for _ in range(_MOST_PIECES):
            section, table = self.section(spot), self.lanes(spot.road, spot.section)
            is_here = spot.road == road and section.s - 1e-6 <= s <= section.stop + 1e-6
            if is_here and (s - spot.s) * spot.way >= 0.0:
                return total + abs(table.length(spot.lane, s) - table.length(spot.lane, spot.s))
            stop = section.stop if spot.way > 0 else section.s
            total += abs(table.length(spot.lane, stop) - table.length(spot.lane, spot.s))
            if total > FARTHEST:
                return None
            following = self.onward(Spot(spot.road, spot.section, spot.lane, stop, spot.way), route)
            if following is None:
                return None
            spot = following
        return None

    def move(
        self, spot: Spot, way: float, left: float | None, route: Collection[str] = ()
    ) -> tuple[Spot, float, float]:
        """Return where a body comes to that goes along its lane, beside its middle.

        Parameters
        ----------
        spot : Spot
        way : float
            How far it goes, >= 0 [m].
        left : float or None
            How far it is to the left of the lane's middle [m]; None: the way is one along the reference line.
        route : collection of str
            Roads that it prefers.

        Returns
        -------
        Spot
        float
            Offset to the left [m]: another one where the file links no lane, so that the place is the same.
        float
            What is left of the way beyond the end of the roads [m].
        """
        for _ in range(1000):
            section = self.section(spot)
            t = 0.0 if left is None else self.middle(spot) + spot.way * left
            curvature = self.table(spot.road).at(spot.s)[3]
            guess = spot.s + 0.5 * spot.way * way
            curvature = 0.5 * (curvature + self.table(spot.road).at(guess + 0.5 * spot.way * way)[3])
            stretch = max(1.0 - curvature * t, 0.2)
            room = (section.stop - spot.s if spot.way > 0 else spot.s - section.s) * stretch
            if way <= room:
                return (
                    Spot(spot.road, spot.section, spot.lane, spot.s + spot.way * way / stretch, spot.way),
                    left or 0.0,
                    0.0,
                )
            end = Spot(spot.road, spot.section, spot.lane, section.stop if spot.way > 0 else section.s, spot.way)
            following = self.onward(end, route)
            if following is None:
                return end, left or 0.0, way - room
            left = None if left is None else self._kept(end, following, left)
            spot, way = following, way - max(room, 0.0)
        return spot, left or 0.0, way

    def _kept(self, end: Spot, following: Spot, left: float) -> float:
        """Return the offset behind a joint: the same, unless the lanes do not meet there."""
        x, y, _ = self.point(end.road, end.s, self.middle(end))
        u, v, heading = self.point(following.road, following.s, self.middle(following))
        away = following.way * ((y - v) * math.cos(heading) - (x - u) * math.sin(heading))
        return left + away if abs(away) > 0.05 else left

    def distance(self, spot: Spot, road: str, s: float, route: Collection[str] = ()) -> float | None:
        """Return the way along reference lines from a spot ahead to a place [m]; None where it leads to none.

        Along the route where it leads there, else by the shortest way.
        """
        if spot.road == road and (s - spot.s) * spot.way >= 0.0:
            return abs(s - spot.s)
        ways = self._ways(spot, {road}, frozenset(route))
        found = ways.get(road)
        if found is None and route:
            found = self._ways(spot, {road}, frozenset()).get(road)
        if found is None:
            return None
        before, way, _ = found
        length = self.street.roads[road].length
        return before + (s if way > 0 else length - s)

    def roads_between(self, spot: Spot, road: str) -> list[str] | None:
        """Return the roads of the shortest way from a spot to another road, both included; None where there is none."""
        if spot.road == road:
            return [road]
        found = self._ways(spot, {road}, frozenset()).get(road)
        return None if found is None else found[2]

    def _ways(
        self, spot: Spot, wanted: Collection[str], route: frozenset[str]
    ) -> dict[str, tuple[float, int, list[str]]]:
        """Return for roads ahead the distance to where they begin, in which way, and the roads on the way."""
        length = self.street.roads[spot.road].length
        first = length - spot.s if spot.way > 0 else spot.s
        waiting: list[tuple[float, int, str, int, tuple[str, ...]]] = []
        count = 0
        for name, way in self.next_roads(spot.road, spot.way):
            heapq.heappush(waiting, (first, count, name, way, (spot.road, name)))
            count += 1
        done: set[tuple[str, int]] = set()
        found: dict[str, tuple[float, int, list[str]]] = {}
        while waiting and len(done) < _MOST_ROADS:
            before, _, name, way, path = heapq.heappop(waiting)
            if (name, way) in done or before > FARTHEST:
                continue
            if route and name not in route:
                continue
            done.add((name, way))
            found.setdefault(name, (before, way, list(path)))
            if name in wanted:
                break
            for other, turn in self.next_roads(name, way):
                count += 1
                reach = before + self.street.roads[name].length
                heapq.heappush(waiting, (reach, count, other, turn, (*path, other)))
        return found

    def heights(self, roads: list[str], s: Array, t: Array) -> Array:
        """Return the heights of the ground (n,) [m] at places of roads; beside the lanes that of the outer border."""
        found = np.zeros(len(roads))
        keys = [(road, self.section_at(road, place)) for road, place in zip(roads, s.tolist(), strict=True)]
        groups: dict[tuple[str, int], list[int]] = {}
        for index, key in enumerate(keys):
            groups.setdefault(key, []).append(index)
        for (road, number), rows in groups.items():
            found[rows] = self._heights(self.shapes[road], self.street.roads[road].sections[number], s[rows], t[rows])
        return found

    @staticmethod
    def _heights(shape: RoadShape, section: LaneSection, s: Array, t: Array) -> Array:
        place = np.clip(s, section.s, section.stop)
        heights, away = shape.point(place, np.zeros_like(place))[:, 2], np.full(len(place), np.inf)
        for lane in section.lanes:
            inner, outer = shape.borders(section, lane, place)
            low, high = shape.edges(section, lane, place)
            span = outer - inner
            share = np.clip(
                np.where(np.abs(span) > 1e-6, (t - inner) / np.where(span == 0.0, 1.0, span), 0.0), 0.0, 1.0
            )
            outside = np.abs(t - (inner + share * span))
            better = (outside < away - 1e-9) & (np.abs(span) > 0.01)
            heights = np.where(better, low[:, 2] + share * (high[:, 2] - low[:, 2]), heights)
            away = np.where(better, outside, away)
        return np.asarray(heights)


def read_roads(path: Path) -> Roads:
    """Return the roads of an OpenDRIVE file; errors as of :func:`read_map`."""
    return _read_roads(path.resolve(), path.stat().st_mtime_ns if path.exists() else 0)


@lru_cache(maxsize=4)
def _read_roads(path: Path, changed: int) -> Roads:
    """Return the roads of a file; `changed` tells when it was, so that a new one is read."""
    return Roads(read_map(path))
