"""Reads an extract of OpenStreetMap as plain data: nodes in metres, ways and multipolygons with their tags."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from scarl_sionna.core.errors import MapError
from scarl_sionna.core.untrusted.xml_text import LinedElement

from ..model import Array
from ..source import Source, child, children, read_root
from .projection import Projection

LARGEST = 20_000.0
"""Largest distance from the middle of an extract [m]: beyond, a plane and single precision are not what it is."""
NORTHMOST = 84.0
SIDE, SIDES = "driving_side", ("left", "right")
"""Tag, and attribute of the root, that say on which side is driven; its values."""
_LICENCE = "(c) OpenStreetMap contributors, ODbL 1.0"
USED: dict[str, tuple[str, ...]] = {
    "osm": ("bounds", "node", "way", "relation", "note", "meta"),
    "bounds": (), "note": (), "meta": (), "tag": (), "nd": (), "member": (),
    "node": ("tag",), "way": ("nd", "tag"), "relation": ("member", "tag"),
}  # fmt: skip # a table

Tags = Mapping[str, str]


@dataclass(frozen=True, eq=False)
class Node:
    """A node with tags: `place` (2,) [m]."""

    line: int
    id: str
    place: Array
    tags: Tags


@dataclass(frozen=True, eq=False)
class Way:
    """A way: `points` (n, 2) [m], those of its nodes that the extract holds; `is_whole` if it holds all."""

    line: int
    id: str
    nodes: tuple[str, ...]
    points: Array
    tags: Tags
    is_whole: bool = True

    @property
    def is_closed(self) -> bool:
        """Whether it ends where it begins."""
        return self.is_whole and len(self.nodes) > 3 and self.nodes[0] == self.nodes[-1]


@dataclass(frozen=True)
class Relation:
    """A multipolygon: ways by their role, ``outer`` or ``inner``."""

    line: int
    id: str
    members: tuple[tuple[str, str], ...]
    tags: Tags


@dataclass(frozen=True, eq=False)
class Extract:
    """A whole file; `bounds`: least longitude and latitude, largest ones [deg]; `nodes` are those with tags.

    `driving_side` is what the file's root says of it: ``left``, ``right``, or empty.
    """

    name: str
    projection: Projection
    bounds: tuple[float, float, float, float] | None
    nodes: tuple[Node, ...]
    ways: Mapping[str, Way]
    relations: tuple[Relation, ...]
    licence: str
    driving_side: str = ""


def read_osm(path: Path, source: Source) -> Extract:
    """Return what an extract of OpenStreetMap holds; what is not used is noted in `source`.

    Raises
    ------
    MapError
        If the file cannot be read, is no extract, reaches too far, or a value is missing or not allowed.
    """
    root = read_root(path, "osm", "an extract of OpenStreetMap (.osm)", "an OSM XML file")
    source.note_unused(root, USED)
    elements = [one for one in children(root, "node") if one.get("action") != "delete"]
    if not elements:
        raise MapError("holds no node", path, "give an extract with roads")
    row = {source.text(one, "id"): k for k, one in enumerate(elements)}
    if len(row) < len(elements):
        raise source.error(elements[_twice(elements)], "stands twice", "give each node its own id")
    degrees = np.array([
        (source.number(one, "lon", low=-180.0, high=180.0), source.number(one, "lat", low=-NORTHMOST, high=NORTHMOST))
        for one in elements
    ])  # fmt: skip # a table
    bounds = _bounds(source, child(root, "bounds"))
    low, high = (np.array(bounds[:2]), np.array(bounds[2:])) if bounds else (degrees.min(0), degrees.max(0))
    projection = Projection(*(float(value) for value in np.round(0.5 * (low + high), 6)))
    plane = projection(degrees[:, 0], degrees[:, 1])
    far = np.abs(plane).max(1)
    if far.min() > LARGEST:
        raise source.error(
            elements[int(far.argmin())], f"is {far.min() / 1000.0:.0f} km from the middle of the extract",
            f"one node within {LARGEST / 1000.0:g} km, or correct <bounds>",
        )  # fmt: skip # a call
    for k in np.flatnonzero(far > LARGEST):
        source.note(elements[k].line, f"a <node> is more than {LARGEST / 1000.0:g} km from the middle; it is left out")
        del row[elements[k].get("id", "")]
    nodes = tuple(
        Node(one.line, source.text(one, "id"), place, tags)
        for one, place, away in zip(elements, plane, far, strict=True)
        if away <= LARGEST and (tags := _tags(source, one))
    )
    ways = {}
    for one in children(root, "way"):
        if one.get("action") != "delete":
            way = _way(source, one, row, plane)
            if way.id in ways:
                raise source.error(one, f"id = '{way.id}' stands twice")
            ways[way.id] = way
    relations = tuple(_relation(source, one) for one in children(root, "relation") if one.get("action") != "delete")
    side = source.text(root, SIDE, "")
    if side not in ("", *SIDES):
        raise source.error(root, f"{SIDE} = '{side[:40]}' is no side", f"give {SIDE}='left' or {SIDE}='right'")
    return Extract(
        path.name.removesuffix(".xml").removesuffix(".osm"), projection, bounds, nodes, ways, relations, _LICENCE, side
    )  # fmt: skip # a call


def _twice(elements: Sequence[LinedElement]) -> int:
    seen: set[str] = set()
    for k, one in enumerate(elements):
        if one.get("id", "") in seen:
            return k
        seen.add(one.get("id", ""))
    return 0


def _bounds(source: Source, element: LinedElement | None) -> tuple[float, float, float, float] | None:
    """Return what an extract says that it covers."""
    if element is None:
        return None
    keys = (("minlon", 180.0), ("minlat", 90.0), ("maxlon", 180.0), ("maxlat", 90.0))
    west, south, east, north = (source.number(element, key, low=-limit, high=limit) for key, limit in keys)
    return west, south, east, north


def _tags(source: Source, element: LinedElement) -> dict[str, str]:
    return {source.text(one, "k"): source.text(one, "v") for one in children(element, "tag")}


def _way(source: Source, element: LinedElement, row: Mapping[str, int], plane: Array) -> Way:
    names = tuple(source.text(one, "ref") for one in children(element, "nd"))
    known = [row[name] for name in names if name in row]
    if len(known) < len(names):
        source.note(element.line, "a <way> has nodes that the extract does not hold; it is cut there")
    return Way(
        element.line, source.text(element, "id"), names, plane[known].reshape(-1, 2), _tags(source, element),
        len(known) == len(names),
    )  # fmt: skip # a row of a table


def _relation(source: Source, element: LinedElement) -> Relation:
    members = tuple(
        (source.text(one, "ref"), source.text(one, "role", "") or "outer")
        for one in children(element, "member")
        if one.get("type") == "way"
    )
    return Relation(element.line, source.text(element, "id"), members, _tags(source, element))
