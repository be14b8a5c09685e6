"""Ground plans of what is tagged as an area: closed ways, and multipolygons put together from pieces of rings."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import shapely

from ..model import Array
from ..source import Source
from .data import Extract, Relation, Tags, Way

_SMALLEST = 0.5


@dataclass(frozen=True, eq=False)
class Plan:
    """An area: line and id of the file's element, tags, and rings (n, 2), the outer one first [m]."""

    line: int
    id: str
    tags: Tags
    rings: tuple[Array, ...]

    @property
    def polygon(self) -> shapely.Polygon:
        """The area as a polygon."""
        return shapely.Polygon(self.rings[0], self.rings[1:])


def plans(extract: Extract, source: Source, *keys: str) -> Iterator[Plan]:
    """Return the areas that have one of some tags, closed ways before multipolygons; what is no area is noted."""
    for way in extract.ways.values():
        if any(way.tags.get(key, "no") != "no" for key in keys):
            if not way.is_closed:
                source.note(way.line, f"a <way> tagged {_named(way.tags, keys)} is not closed; it is not drawn")
                continue
            yield from _plan(way.line, f"way/{way.id}", way.tags, way.points[:-1], [], source)
    for relation in extract.relations:
        tags = relation.tags
        if tags.get("type") != "multipolygon" or not any(tags.get(key, "no") != "no" for key in keys):
            continue
        rings = _rings(extract, relation, source)
        for outer in rings["outer"]:
            hull = shapely.make_valid(shapely.Polygon(outer))
            inner = [
                ring for ring in rings["inner"] if shapely.contains(hull, shapely.Polygon(ring).representative_point())
            ]
            yield from _plan(relation.line, f"relation/{relation.id}", tags, outer, inner, source)


def _named(tags: Tags, keys: tuple[str, ...]) -> str:
    return next(f"{key}={tags[key]}" for key in keys if key in tags)


def _plan(line: int, name: str, tags: Tags, outer: Array, inner: list[Array], source: Source) -> Iterator[Plan]:
    """Return the plan of an outline as it is; where it crosses itself, its sound parts."""
    try:
        whole = shapely.Polygon(outer, inner)
    except (ValueError, shapely.errors.GEOSException):
        whole = shapely.Polygon()
    if shapely.make_valid(whole).area < _SMALLEST:
        source.note(line, "an outline of less than 0.5 m2 is not drawn")
        return
    if whole.is_valid:
        yield Plan(line, name, tags, (outer, *inner))
        return
    source.note(line, "an outline crosses itself; its sound parts are drawn")
    for part in shapely.get_parts(shapely.make_valid(whole)):
        if part.geom_type == "Polygon" and part.area > _SMALLEST:
            rings = tuple(shapely.get_coordinates(ring)[:-1] for ring in (part.exterior, *part.interiors))
            yield Plan(line, name, tags, rings)


def _rings(extract: Extract, relation: Relation, source: Source) -> dict[str, list[Array]]:
    """Return the rings of a multipolygon by role, joined at the nodes where their ways end."""
    found: dict[str, list[Array]] = {"outer": [], "inner": []}
    for role, rings in found.items():
        members = [extract.ways.get(name) for name, own in relation.members if own == role]
        waiting = [way for way in members if way is not None and way.is_whole and len(way.nodes) > 1]
        if len(waiting) < len(members):
            source.note(relation.line, "a multipolygon has ways that the extract does not hold in full")
        while waiting:
            way = waiting.pop()
            nodes, points = list(way.nodes), list(way.points)
            while nodes[0] != nodes[-1]:
                following = _from(waiting, nodes[-1])
                if following is None:
                    break
                names, places = following
                nodes += names[1:]
                points += places[1:]
            if nodes[0] == nodes[-1] and len(nodes) > 3:
                rings.append(np.array(points[:-1]))
            else:
                source.note(relation.line, f"a ring of a multipolygon ({role}) is not closed; it is not drawn")
    return found


def _from(waiting: list[Way], node: str) -> tuple[list[str], list[Array]] | None:
    """Take a way that begins or ends at a node; its nodes and points from there on."""
    for way in waiting:
        if node in (way.nodes[0], way.nodes[-1]):
            waiting.remove(way)
            turn = 1 if way.nodes[0] == node else -1
            return list(way.nodes)[::turn], list(way.points)[::turn]
    return None
