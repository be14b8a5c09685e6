"""Marked crossings of an extract: zebras across the carriageway, square to the way, from kerb to kerb."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import shapely

from ..model import Array, Corner, MapObject, Outline
from .data import Extract, Tags, Way
from .things import PATHS

WIDTH, FARTHEST = 4.0, 20.0
"""Width of a crossing, and how far its ends are looked for on both sides [m]."""
_MARKED = ("zebra", "marked", "uncontrolled")
_CLEAR = 0.3


def is_marked(tags: Tags) -> bool:
    """Return whether a node is a crossing with markings."""
    markings = tags.get("crossing:markings", "")
    stated = tags.get("crossing") in _MARKED or tags.get("crossing_ref") == "zebra"
    return tags.get("highway") == "crossing" and (markings not in ("", "no") or (not markings and stated))


def crossings(extract: Extract, roads: shapely.Geometry) -> Iterator[MapObject]:
    """Return the marked crossings on the carriageways of `roads`."""
    way_of = {
        node: way
        for way in extract.ways.values()
        if way.is_whole and way.tags.get("highway", "no") not in ("no", *PATHS)
        for node in way.nodes
    }
    for node in extract.nodes:
        if not is_marked(node.tags) or node.id not in way_of:
            continue
        along = _direction(way_of[node.id], node.id)
        across = np.array([-along[1], along[0]])
        probe = shapely.LineString([node.place - FARTHEST * across, node.place + FARTHEST * across])
        parts = shapely.get_parts(shapely.intersection(roads, probe))
        near = [
            part
            for part in parts
            if part.geom_type == "LineString" and shapely.distance(part, shapely.Point(node.place)) < 1.0
        ]
        if not near or near[0].length > 1.9 * FARTHEST or near[0].length < 2.0:
            continue
        ends = shapely.get_coordinates(near[0])[[0, -1]]
        way = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
        ends = ends + _CLEAR * np.array([way, -way])
        half = 0.5 * WIDTH * along
        ring = [ends[0] - half, ends[1] - half, ends[1] + half, ends[0] + half]
        corners = tuple(Corner(True, float(x), float(y), 0.0, 0.0) for x, y in ring)
        x, y = (float(value) for value in node.place)
        yield MapObject(
            node.line, node.id, "crosswalk", "", x, y, 0.0, 0.0, "none", (0.0, 0.0, 0.0, 0.0), (Outline(corners),)
        )


def _direction(way: Way, node: str) -> Array:
    """Return the direction of a way at one of its nodes, of length 1."""
    k = way.nodes.index(node)
    step = way.points[min(k + 1, len(way.points) - 1)] - way.points[max(k - 1, 0)]
    return np.asarray(step / max(float(np.linalg.norm(step)), 1e-9))
