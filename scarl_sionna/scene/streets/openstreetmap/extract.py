"""An extract of OpenStreetMap as a street map: roads by SUMO's netconvert, the rest from the file itself."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import shapely

from scarl_sionna.core.errors import MapError, SimulatorError

from ..geometry.road import RoadShape
from ..model import Building, Finding, Road, StreetMap, Structure
from ..network.ways import KINDS
from ..source import Source
from ..sumo.net import read_net
from ..sumo.netconvert import run_netconvert, sumo_home
from ..sumo.roads import CARS
from ..sumo.street import Streets, net_street
from .buildings import buildings
from .crossings import crossings
from .data import Extract, Tags, Way, read_osm
from .side import is_driven_on_the_left
from .things import BARRIERS, PATHS, POINTS, paved, tagged, things

LAYER = 6.0
"""Height of one layer of crossing roads above the next where the file has no heights [m]."""
PASSAGE = 4.5
"""Height of a road's passage through a building [m]."""
_TYPES = ("osmNetconvert.typ.xml", "osmNetconvertBicycle.typ.xml")
_DRAWN = {
    "highway", "building", "building:part", "barrier", "natural", "railway", "waterway", "landuse", "leisure",
    "man_made", "power", "aeroway", "amenity", "area:highway", "traffic_sign", "emergency", "public_transport",
}  # fmt: skip # a table
_MARGIN = 0.001
"""How far beyond the bounds of an extract roads are kept [deg]: about 100 m."""
_CURVED = 1.0


def read_extract(path: Path) -> StreetMap:
    """Return an extract of OpenStreetMap (``.osm``) as a street map.

    Raises
    ------
    MapError
        If the file cannot be read, is no extract, holds no road for cars, or a value is missing or not allowed.
    MissingPackageError
        If netconvert (package ``eclipse-sumo``) is not installed.
    SimulatorError
        If netconvert refuses the file, or takes longer than its time limit.
    """
    source = Source(path)
    extract = read_osm(path, source)
    if not any(way.tags.get("highway", "no") not in ("no", *PATHS) for way in extract.ways.values()):
        raise MapError("holds no road for cars", path, "give an extract with ways tagged 'highway'")
    made = _roads(path, extract, is_driven_on_the_left(extract, source))
    roads = dict(made.street.roads)
    for name, road in roads.items():
        ways = [extract.ways[one] for one in made.origins.get(name, ()) if one in extract.ways]
        if ways:
            roads[name] = replace(_of_line(road, ways[0].line), structures=tuple(_structures(road, ways)))
    for name, road in roads.items():
        if name not in made.origins and road.predecessor is not None:  # a way through a junction
            roads[name] = _of_line(road, roads[road.predecessor.id].line)
    carriageways = _carriageways(roads)
    found = [part for one in buildings(extract, source) for part in _with_passages(one, carriageways, source)]
    objects = (*made.street.objects, *crossings(extract, carriageways), *things(extract, source, carriageways))
    areas = (*made.street.areas, *paved(extract, source))
    _note_unused(extract, source)
    findings = (*source.findings(), *(Finding(0, f"in the network: {one.text}") for one in made.street.findings))
    return replace(
        made.street, name=extract.name, roads=roads, areas=areas, buildings=tuple(found), objects=objects,
        findings=findings, source="OpenStreetMap", licence=extract.licence,
    )  # fmt: skip # a call


def _of_line(road: Road, line: int) -> Road:
    """Return a road that stands at a line of the extract, with its lanes."""
    sections = tuple(
        replace(one, line=line, lanes={k: replace(lane, line=line) for k, lane in one.lanes.items()})
        for one in road.sections
    )
    return replace(road, line=line, sections=sections)


def netconvert_options(path: Path, extract: Extract, is_left_hand: bool, result: Path) -> list[str]:
    """Return what netconvert is asked for: the roads of an extract in its own metres, written to `result`."""
    options = [
        "--osm-files", str(path.resolve()), "--proj", extract.projection.definition,
        "--offset.disable-normalization", "true", "--osm.sidewalks", "true", "--osm.bike-access", "true",
        "--osm.turn-lanes", "true", "--osm.elevation", "true", "--lefthand", str(is_left_hand).lower(),
        "--osm.layer-elevation", f"{LAYER:g}", "--geometry.remove", "true", "--roundabouts.guess", "true",
        "--junctions.join", "true", "--walkingareas", "true", "--output.original-names", "true",
        "--output.street-names", "true", "--junctions.internal-link-detail", "20", "--no-turnarounds", "true",
        "--rectangular-lane-cut", "true", "--tls.default-type", "static", "--precision", "4",
        "--keep-edges.by-vclass", ",".join(sorted(CARS | {"bus", "coach"})), "--output-file", str(result),
    ]  # fmt: skip # a table
    home = sumo_home()
    types = [] if home is None else [home / "data" / "typemap" / name for name in _TYPES]
    if types and all(one.is_file() for one in types):
        options += ["--type-files", ",".join(map(str, types))]
    if extract.bounds is not None:
        west, south, east, north = extract.bounds
        around = (west - _MARGIN, south - _MARGIN, east + _MARGIN, north + _MARGIN)
        options += ["--keep-edges.in-geo-boundary", ",".join(f"{value:.7f}" for value in around)]
    return options


def _roads(path: Path, extract: Extract, is_left_hand: bool) -> Streets:
    """Return the roads for cars by netconvert, in the extract's own metres."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        result = folder / "extract.net.xml"
        options = netconvert_options(path, extract, is_left_hand, result)
        try:
            run_netconvert(options, folder, result, f"the roads of {path.name}")
        except SimulatorError as error:
            raise MapError(str(error), path, "correct or cut the extract") from error
        return net_street(read_net(result))


def _structures(road: Road, ways: Sequence[Way]) -> Iterator[Structure]:
    """Return the bridges and tunnels of a road: between the ends of the ways that say so."""
    spans = [
        (way, kind)
        for way in ways
        for kind in ("bridge", "tunnel")
        if way.tags.get(kind, "no") not in ("no", "building_passage") and len(way.points) > 1
    ]
    if not spans:
        return
    s = np.linspace(0.0, road.length, max(2, int(road.length / _CURVED) + 1))
    line = shapely.LineString(RoadShape(road).point(s)[:, :2])
    for way, kind in spans:
        ends = shapely.line_locate_point(line, shapely.points(way.points[[0, -1]]))
        low, high = np.sort(ends) * road.length / line.length
        if high - low > 1.0:
            yield Structure(road.line, kind, float(low), float(high - low))


def _carriageways(roads: dict[str, Road]) -> shapely.Geometry:
    """Return the ground plan of all lanes for cars and cycles that are on the ground."""
    found = []
    for road in roads.values():
        shape, section = RoadShape(road), road.sections[0]
        s = shape.stations(section, 0.05)
        for number, lane in section.lanes.items():
            if KINDS.get(lane.kind) in ("drive", "cycle") and not any(one.kind == "tunnel" for one in road.structures):
                inner, outer = shape.edges(section, number, s)
                found.append(shapely.make_valid(shapely.Polygon(np.concatenate([inner, outer[::-1]])[:, :2])))
    return shapely.union_all(found, grid_size=1e-3)


def _with_passages(building: Building, roads: shapely.Geometry, source: Source) -> Iterator[Building]:
    """Return a building; where a road passes below it, with a passage: low parts beside it and one above."""
    plan = shapely.make_valid(shapely.Polygon(building.rings[0], building.rings[1:]))
    if building.foot >= PASSAGE or building.is_open or shapely.intersection(plan, roads).area < 0.05:
        yield building
        return
    high = building.eaves > PASSAGE + 1.0
    what = f"it has a passage of {PASSAGE:g} m" if high else "it is cut"
    source.note(building.line, f"a road passes through a building: {what}")
    free = shapely.difference(plan, shapely.buffer(roads, 0.3))
    low = replace(building, eaves=PASSAGE, top=PASSAGE, roof="flat", storeys=1) if high else building
    for part in shapely.get_parts(free):
        if part.geom_type == "Polygon" and part.area > 1.0:
            rings = tuple(shapely.get_coordinates(ring)[:-1] for ring in (part.exterior, *part.interiors))
            yield replace(low, rings=rings)
    if high:
        yield replace(building, foot=PASSAGE, storeys=max(building.storeys - 1, 0))


def _note_unused(extract: Extract, source: Source) -> None:
    """Note what the extract has and the scene has not, by tag."""
    ways = [(way.line, way.tags, False) for way in extract.ways.values()]
    nodes = [(node.line, node.tags, True) for node in extract.nodes]
    for line, tags, is_node in [*ways, *nodes, *((one.line, one.tags, False) for one in extract.relations)]:
        key = next((key for key in sorted(_DRAWN) if key in tags), None)
        if key is None or _is_used(tags, is_node):
            continue
        source.note(line, f"{key}={tags[key][:40]} is not drawn")


def _is_used(tags: Tags, is_node: bool) -> bool:
    if is_node:
        return tagged(tags, POINTS) is not None or tags.get("highway") in ("traffic_signals", "crossing")
    if tags.get("building", "no") != "no" or tags.get("building:part", "no") != "no" or "area:highway" in tags:
        return True
    if tags.get("highway", "no") not in ("no", "construction", "proposed", "elevator", "platform", "corridor"):
        return True
    is_parking = tags.get("amenity") == "parking" and tags.get("parking", "surface") == "surface"
    return is_parking or tags.get("barrier") in BARRIERS or tags.get("natural") == "tree_row"
