"""Reads an OpenDRIVE file: header, roads, junctions and controllers; lanes and objects have files of their own."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from scarl_sionna.core.errors import MapError
from scarl_sionna.core.untrusted.xml_text import LinedElement

from ..model import Array, Connection, Cubics, Junction, PlanPiece, Road, RoadLink, StreetMap
from ..source import Source, child, children, read_root
from .lanes import read_sections
from .objects import read_objects, read_references, read_signals, read_structures

LONGEST_ROAD = 200_000.0
_MOST_TURN = 200.0
"""Largest turn of one piece [rad]: what turns more is no street."""
_KINDS: dict[str, tuple[str, ...]] = {
    "line": (),
    "arc": ("curvature",),
    "spiral": ("curvStart", "curvEnd"),
    "poly3": ("a", "b", "c", "d"),
    "paramPoly3": ("aU", "bU", "cU", "dU", "aV", "bV", "cV", "dV"),
}


USED: dict[str, tuple[str, ...]] = {
    "OpenDRIVE": ("header", "road", "junction", "controller"),
    "header": (),
    "road": ("link", "type", "planView", "elevationProfile", "lateralProfile", "lanes", "objects", "signals"),
    "link": ("predecessor", "successor"),
    "type": ("speed", "line"),
    "planView": ("geometry",),
    "geometry": ("line", "arc", "spiral", "poly3", "paramPoly3"),
    "elevationProfile": ("elevation",),
    "lateralProfile": ("superelevation", "crossfall", "shape"),
    "lanes": ("laneOffset", "laneSection"),
    "laneSection": ("left", "center", "right"),
    "left": ("lane",),
    "center": ("lane",),
    "right": ("lane",),
    "lane": ("link", "width", "border", "height", "roadMark", "speed"),
    "roadMark": ("type", "explicit"),
    "explicit": ("line",),
    "objects": ("object", "bridge", "tunnel"),
    "object": ("outlines", "outline", "repeat"),
    "outlines": ("outline",),
    "outline": ("cornerRoad", "cornerLocal"),
    "signals": ("signal", "signalReference"),
    "signalReference": ("validity",),
    "signal": ("validity",),
    "junction": ("connection", "priority", "controller"),
    "connection": ("laneLink",),
    "controller": ("control",),
}
"""Children of each element that are used; others are findings."""


def read_map(path: Path) -> StreetMap:
    """Return what an OpenDRIVE file says.

    Parameters
    ----------
    path : Path

    Returns
    -------
    StreetMap
        Its `findings` list what is not used.

    Raises
    ------
    MapError
        If the file cannot be read, is no OpenDRIVE of version 1, or a value is missing or not allowed.
    """
    root = read_root(path, "OpenDRIVE", "an OpenDRIVE file (.xodr)", "an OpenDRIVE file")
    source = Source(path)
    version = _version(source, root)
    source.note_unused(root, USED)
    roads: dict[str, Road] = {}
    for element in children(root, "road"):
        road = _road(source, element)
        if road.id in roads:
            raise source.error(element, f"id = '{road.id}' stands twice")
        roads[road.id] = road
    if not roads:
        raise MapError("holds no road", path, "give a map with one road or more")
    junctions = {j.id: j for j in (_junction(source, element) for element in children(root, "junction"))}
    controllers = {
        source.text(element, "id"): tuple(source.text(one, "signalId") for one in children(element, "control"))
        for element in children(root, "controller")
    }
    return StreetMap(
        path.stem,
        version,
        roads,
        junctions,
        controllers,
        source.findings(),
        source=f"OpenDRIVE {version[0]}.{version[1]}",
    )


def _version(source: Source, root: LinedElement) -> tuple[int, int]:
    header = child(root, "header")
    if header is None:
        source.note(root.line, "<OpenDRIVE> has no <header>; it is read as version 1.4")
        return 1, 4
    version = source.whole(header, "revMajor", 1), source.whole(header, "revMinor", 4)
    if version[0] != 1:
        raise source.error(header, f"revMajor = {version[0]}: versions 1.4 to 1.8 are read")
    if not 4 <= version[1] <= 8:
        source.note(header.line, f"version 1.{version[1]} is read as one of 1.4 to 1.8")
    return version


def _road(source: Source, element: LinedElement) -> Road:
    length = source.number(element, "length", low=1e-6, high=LONGEST_ROAD)
    lateral, lanes = child(element, "lateralProfile"), child(element, "lanes")
    objects, link = child(element, "objects"), child(element, "link")
    if lanes is None:
        raise source.error(element, "has no <lanes>")
    rule = source.text(element, "rule", "RHT")
    if rule not in ("RHT", "LHT"):
        raise source.error(element, f"rule = '{rule}'", "RHT and LHT are allowed")
    return Road(
        element.line,
        source.text(element, "id"),
        source.text(element, "name", ""),
        length,
        source.text(element, "junction", "-1"),
        rule == "LHT",
        _plan(source, element, length),
        source.cubics(children(child(element, "elevationProfile"), "elevation")),
        source.cubics(children(lateral, "superelevation")),
        _crossfalls(source, children(lateral, "crossfall")),
        _shapes(source, children(lateral, "shape")),
        source.cubics(children(lanes, "laneOffset")),
        read_sections(source, lanes, length),
        _road_link(source, child(link, "predecessor")),
        _road_link(source, child(link, "successor")),
        tuple(_type(source, one) for one in children(element, "type")),
        read_objects(source, objects),
        read_signals(source, child(element, "signals")),
        read_structures(source, objects),
        read_references(source, child(element, "signals")),
    )


def _plan(source: Source, element: LinedElement, length: float) -> tuple[PlanPiece, ...]:
    pieces: list[PlanPiece] = []
    for geometry in children(child(element, "planView"), "geometry"):
        kinds = [one for one in geometry if one.tag in _KINDS]
        own = source.number(geometry, "length", low=0.0, high=LONGEST_ROAD)
        if len(kinds) != 1:
            raise source.error(geometry, f"holds {len(kinds)} of {', '.join(_KINDS)}", "give one of them")
        if own < 1e-9:
            source.note(geometry.line, "<geometry> of no length is passed over")
            continue
        shape = kinds[0]
        assert isinstance(shape, LinedElement)
        numbers = source.numbers(shape, _KINDS[shape.tag])
        if shape.tag == "arc":
            numbers = {"curvStart": numbers["curvature"], "curvEnd": numbers["curvature"]}
        if max(abs(numbers.get(key, 0.0)) for key in ("curvStart", "curvEnd")) * own > _MOST_TURN:
            raise source.error(shape, f"turns by more than {_MOST_TURN:g} rad", "correct its curvature or length")
        x, y, heading = (source.number(geometry, key) for key in ("x", "y", "hdg"))
        normalized = shape.tag == "paramPoly3" and source.text(shape, "pRange", "normalized") == "normalized"
        piece = PlanPiece(
            geometry.line, source.number(geometry, "s"), x, y, heading, own, shape.tag, numbers, normalized
        )
        if pieces and piece.s < pieces[-1].s:
            raise source.error(geometry, f"s = {piece.s:g} comes after {pieces[-1].s:g}", "put them in order")
        pieces.append(piece)
    if not pieces:
        raise source.error(element, "has no <geometry> in its <planView>")
    reach = pieces[-1].s + pieces[-1].length
    if abs(reach - length) > 0.01 + 1e-4 * length:
        source.note(element.line, f"<road> of length {length:.6g} m has a plan view of {reach:.6g} m")
    return tuple(pieces)


def _crossfalls(source: Source, elements: list[LinedElement]) -> tuple[Cubics, Cubics]:
    sides = []
    for side in ("left", "right"):
        sides.append(source.cubics([e for e in elements if source.text(e, "side", "both") in (side, "both")]))
    return sides[0], sides[1]


def _shapes(source: Source, elements: list[LinedElement]) -> Array:
    rows = [[source.number(e, key) for key in ("s", "t", "a", "b", "c", "d")] for e in elements]
    return np.array(sorted(rows)).reshape(-1, 6)


def _road_link(source: Source, element: LinedElement | None) -> RoadLink | None:
    if element is None:
        return None
    kind = source.text(element, "elementType", "road")
    if kind not in ("road", "junction"):
        raise source.error(element, f"elementType = '{kind}'", "road and junction are allowed")
    contact = source.text(element, "contactPoint", "" if kind == "junction" else "start")
    if kind == "road" and contact not in ("start", "end"):
        raise source.error(element, f"contactPoint = '{contact}'", "start and end are allowed")
    return RoadLink(kind, source.text(element, "elementId"), contact)


def _type(source: Source, element: LinedElement) -> tuple[float, str, float | None]:
    limit = child(element, "speed")
    return (
        source.number(element, "s", 0.0),
        source.text(element, "type"),
        None if limit is None else source.speed(limit),
    )


def _junction(source: Source, element: LinedElement) -> Junction:
    kind, identity = source.text(element, "type", "default"), source.text(element, "id")
    if kind not in ("default", "direct"):
        source.note(element.line, f"<junction> of type '{kind}' has no ways")
        return Junction(element.line, identity, kind, ())
    ways = []
    for one in children(element, "connection"):
        target = one.get("linkedRoad") if kind == "direct" else one.get("connectingRoad")
        if target is None or one.get("incomingRoad") is None:
            source.note(one.line, "<connection> without its roads has no ways")
            continue
        links = tuple((source.whole(pair, "from"), source.whole(pair, "to")) for pair in children(one, "laneLink"))
        contact = source.text(one, "contactPoint", "start")
        ways.append(Connection(one.line, source.text(one, "incomingRoad"), target, contact, links))
    priorities = tuple(
        (str(one.get("high")), str(one.get("low")))
        for one in children(element, "priority")
        if one.get("high") and one.get("low")
    )
    controllers = tuple(source.text(one, "id") for one in children(element, "controller"))
    return Junction(element.line, identity, kind, tuple(ways), priorities, controllers)
