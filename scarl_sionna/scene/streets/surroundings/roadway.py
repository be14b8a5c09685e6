"""What years leave in a carriageway: patches, covers of manholes, and the rails of a tram, all flush with it."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from scarl_sionna.scene.lanes import LaneNetwork
from scenes_xml.generators.geometry.mesh import Mesh
from scenes_xml.generators.roadside.garden import manhole_cover

from ..building.marks import stripe
from ..building.surfaces import TILE
from ..geometry.road import RoadShape
from ..model import Array, LaneSection, Road, StreetMap
from ..network.lanes import lane_name
from ..network.ways import KINDS, Key, keys
from .character import character, is_in_town

RAISED = {"patch": 0.002, "cover": 0.006, "rail": 0.008}
"""Heights above the lane [m]: below and above its marks, which are painted over patches."""
TRAMS = 0.4
"""Share of maps with streets of a town that have a tram."""
GAUGE, HEAD = 1.435, 0.06
"""Distance between the inner edges of rails, and width of the head of a rail [m]."""
_TRACK = 2.6
"""Narrowest lane in which a tram runs [m]."""
_SHARPEST = np.radians(60.0)
_COVERS, _PATCHES = 38.0, {"town": 45.0, "country": 110.0}
"""Mean way from one to the next along a lane [m]."""

Rows = defaultdict[tuple[str, str], list[Mesh]]


def add_roadway(
    street: StreetMap, shapes: Mapping[str, RoadShape], network: LaneNetwork, tolerance: float, seed: int
) -> Rows:
    """Return what lies in the carriageways: meshes by class and material.

    Parameters
    ----------
    street : StreetMap
    shapes : mapping
        Geometry of each road by its id.
    network : LaneNetwork
        Of the map; a tram follows it as straight as it goes.
    tolerance : float
        Of the chords of surfaces, on which all of it lies [m].
    seed : int
        Same seed, same things.
    """
    rows: Rows = defaultdict(list)
    roads = [one for one in street.roads.values() if one.junction not in street.junctions]
    for number, road in enumerate(roads):
        generator = np.random.default_rng([seed, 20, number])
        for section in road.sections:
            kind = character(road, section)
            for lane in section.lanes.values():
                if KINDS.get(lane.kind) == "drive" and kind != "motorway":
                    surface = _Surface(shapes[road.id], section, lane.id, tolerance)
                    if kind == "town":
                        rows["Roads", "manhole_iron"] += _covers(surface, road, generator)
                    rows["Roads", "asphalt_dark"] += _patches(surface, _PATCHES[kind], generator)
    for key in tram_lanes(street, network, np.random.default_rng([seed, 21])):
        surface = _Surface(shapes[key[0]], street.roads[key[0]].sections[key[1]], key[2], tolerance)
        rows["RailTrack", "grey_steel"] += surface.rails()
    return defaultdict(list, {key: meshes for key, meshes in rows.items() if meshes})


class _Surface:
    """The surface of a lane as it is meshed: its borders at stations, and straight lines between."""

    def __init__(self, shape: RoadShape, section: LaneSection, lane: int, tolerance: float) -> None:
        self.s = shape.stations(section, tolerance)
        self.inner, self.outer = shape.edges(section, lane, self.s)
        self.width = np.linalg.norm((self.outer - self.inner)[:, :2], axis=1)

    @property
    def length(self) -> float:
        return float(self.s[-1] - self.s[0])

    def at(self, s: Array, share: Array) -> Array:
        """Return points at stations and shares of the width from the inner border, shape (n, 3)."""
        ends = [np.column_stack([np.interp(s, self.s, line[:, k]) for k in range(3)]) for line in self._lines]
        return np.asarray(ends[0] + share[:, None] * (ends[1] - ends[0]))

    @property
    def _lines(self) -> tuple[Array, Array]:
        return self.inner, self.outer

    def strip(self, shares: Sequence[Array], span: tuple[float, float], raised: float) -> Mesh:
        """Return a strip between two lines, each by its share of the width at all stations."""
        lines = [self.inner + share[:, None] * (self.outer - self.inner) for share in shares]
        mesh = stripe(self.s, lines, span, raised)
        return Mesh(mesh.vertices, mesh.faces, mesh.vertices[:, :2] / TILE)

    def rails(self) -> list[Mesh]:
        """Return both rails along the middle of the lane."""
        width = np.maximum(self.width, 1e-3)
        span = float(self.s[0]), float(self.s[-1])
        found = []
        for side in (-1.0, 1.0):
            edges = [0.5 + side * (0.5 * GAUGE + away) / width for away in (0.0, HEAD)]
            found.append(self.strip([np.minimum(*edges), np.maximum(*edges)], span, RAISED["rail"]))
        return found


def _covers(surface: _Surface, road: Road, generator: np.random.Generator) -> Iterator[Mesh]:
    cover = manhole_cover(height=RAISED["cover"])
    for s in np.arange(surface.s[0] + generator.uniform(0.0, _COVERS), surface.s[-1] - 1.0, _COVERS):
        place = s + generator.uniform(-6.0, 6.0)
        middle = float(generator.choice((0.35, 0.5, 0.65)))
        width = float(np.interp(place, surface.s, surface.width))
        on_ground = not any(one.s - 2.0 < place < one.s + one.length + 2.0 for one in road.structures)
        if on_ground and width > 2.0 and surface.s[0] + 1.0 < place < surface.s[-1] - 1.0:
            points = surface.at(place + cover.vertices[:, 0], middle + cover.vertices[:, 1] / width)
            mesh = Mesh(points + [0.0, 0.0, 1.0] * cover.vertices, cover.faces, cover.uv)
            yield mesh if _faces_up(mesh) else mesh.flipped()


def _faces_up(mesh: Mesh) -> bool:
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    return bool(np.cross(b - a, c - a)[:, 2].sum() > 0.0)


def _patches(surface: _Surface, away: float, generator: np.random.Generator) -> Iterator[Mesh]:
    """Return patches where the surface was mended, and trenches across for pipes."""
    for _ in range(generator.poisson(surface.length / away)):
        is_trench = generator.uniform() < 0.35
        long = generator.uniform(0.5, 0.9) if is_trench else generator.uniform(1.0, 5.0)
        wide = 0.94 if is_trench else generator.uniform(0.25, 0.6)
        start, share = generator.uniform(size=2)
        if surface.length > long + 2.0 and surface.width.min() > 2.0:
            low = surface.s[0] + 1.0 + start * (surface.length - long - 2.0)
            first = 0.03 + share * (0.94 - wide)
            shares = [np.full(len(surface.s), value) for value in (first, first + wide)]
            yield surface.strip(shares, (float(low), float(low + long)), RAISED["patch"])


def tram_lanes(street: StreetMap, network: LaneNetwork, generator: np.random.Generator) -> list[Key]:
    """Return the lanes that a tram runs in, in both directions; none in most maps."""
    by_name = {lane_name(key): key for key in keys(street)}
    lanes = {lane.name: lane for lane in network.lanes if lane.kind == "drive" and lane.width >= _TRACK}
    starts = [name for name in lanes if _is_street(street, by_name[name])]
    if not starts or generator.uniform() > TRAMS:
        return []
    first = by_name[starts[int(generator.integers(len(starts)))]]
    back = first[0], first[1], -first[2]
    before: defaultdict[str, list[str]] = defaultdict(list)
    for lane in lanes.values():
        for name in lane.next:
            before[name].append(lane.name)
    found: dict[str, None] = {}
    for key in (first, back):
        name = lane_name(key)
        if name not in lanes:
            continue
        for goes_on in (True, False):
            here: str | None = name
            while here is not None and (here == name or here not in found):
                found[here] = None
                ways = [one for one in (lanes[here].next if goes_on else before[here]) if one in lanes]
                ways = [one for one in ways if is_track(street, by_name[one])]
                turns = {one: _turn(lanes[one].end_headings) for one in ways}
                here = min(turns, key=lambda one: turns[one], default=None)
                here = None if here is None or turns[here] > _SHARPEST else here
    return [by_name[name] for name in found]


def _turn(headings: tuple[float, float]) -> float:
    return abs(float((headings[1] - headings[0] + np.pi) % (2.0 * np.pi) - np.pi))


def _is_street(street: StreetMap, key: Key) -> bool:
    road = street.roads[key[0]]
    return road.junction not in street.junctions and is_in_town(road, road.sections[key[1]])


def is_track(street: StreetMap, key: Key) -> bool:
    """Return whether a tram may run in a lane: in a street of a town, or over a junction."""
    return street.roads[key[0]].junction in street.junctions or _is_street(street, key)
