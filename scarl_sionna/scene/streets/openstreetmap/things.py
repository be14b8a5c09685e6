"""What stands beside the roads of an extract: trees, hedges, walls, fences, bollards, lamps; and paved places."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import shapely
import shapely.ops

from ..model import Area, Array, Corner, MapObject, Outline
from ..source import Source
from .buildings import length
from .data import Extract, Tags, Way
from .outlines import plans

Looks = tuple[str, float, float]
"""Kind of an object, its height and width [m]."""
BARRIERS: dict[str, Looks] = {
    "wall": ("wall", 2.0, 0.3), "city_wall": ("wall", 6.0, 1.5), "retaining_wall": ("wall", 1.0, 0.4),
    "fence": ("fence", 1.2, 0.06), "hedge": ("vegetation", 1.5, 0.8), "guard_rail": ("guardRail", 0.75, 0.12),
    "jersey_barrier": ("barrier", 0.8, 0.6), "handrail": ("railing", 1.0, 0.06),
}  # fmt: skip # a table
"""Value of `barrier` of a way -> kind, height and width where they are not stated [m]."""
POINTS: dict[tuple[str, str], Looks] = {
    ("natural", "tree"): ("tree", 8.0, 5.0), ("highway", "street_lamp"): ("streetLamp", 6.0, 0.2),
    ("barrier", "bollard"): ("pole", 1.0, 0.2), ("power", "pole"): ("pole", 9.0, 0.3),
    ("man_made", "flagpole"): ("pole", 8.0, 0.12), ("man_made", "street_cabinet"): ("obstacle", 1.3, 0.8),
    ("amenity", "waste_basket"): ("obstacle", 0.9, 0.4), ("emergency", "fire_hydrant"): ("pole", 0.9, 0.25),
    ("amenity", "post_box"): ("obstacle", 1.2, 0.5),
}  # fmt: skip # a table
"""Tag of a node -> kind, height and width where they are not stated [m]."""
PATHS = {"footway": 2.0, "path": 1.5, "cycleway": 2.0, "pedestrian": 4.0, "steps": 2.0, "bridleway": 2.0}
"""Value of `highway` of ways that are no roads for cars -> width where none is stated [m]."""
OPEN_FENCES = ("chain_link", "wire", "barbed_wire", "electric", "split_rail", "rail", "post_and_rail", "bars")
"""Types of fence of which only the posts are drawn."""
_ROW, _POSTS, _STEP = 8.0, 2.5, 4.0


def tagged(tags: Tags, known: dict[tuple[str, str], Looks]) -> Looks | None:
    """Return what a table says of the first tag that it knows."""
    return next((found for (key, value), found in known.items() if tags.get(key) == value), None)


def things(extract: Extract, source: Source, roads: shapely.Geometry) -> Iterator[MapObject]:
    """Return the objects of an extract; those on the carriageways of `roads` are left out, and noted."""
    shapely.prepare(roads)
    for node in extract.nodes:
        found = tagged(node.tags, POINTS)
        if found is None:
            continue
        if shapely.contains(roads, shapely.Point(node.place)):
            source.note(node.line, f"a {found[0]} on a carriageway is left out")
            continue
        kind, high, wide = found
        high = length(node.tags, "height", node.line, source) or high
        wide = length(node.tags, "diameter_crown", node.line, source) or wide
        yield _post(node.line, node.id, (kind, high, wide), node.place, roads)
    for way in extract.ways.values():
        if way.tags.get("natural") == "tree_row" and len(way.points) > 1:
            row = shapely.LineString(way.points)
            for number, at in enumerate(np.arange(0.0, row.length + 1e-6, _ROW)):
                place = shapely.get_coordinates(shapely.line_interpolate_point(row, at))[0]
                if not shapely.contains(roads, shapely.Point(place)):
                    yield _post(way.line, f"{way.id}_{number}", ("tree", 8.0, 5.0), place, roads)
        barrier = BARRIERS.get(way.tags.get("barrier", ""))
        if barrier is not None and len(way.points) > 1:
            yield from _barrier(way, barrier, source, roads)


def _post(line: int, name: str, looks: Looks, place: Array, roads: shapely.Geometry) -> MapObject:
    """Return something that stands at one place; a lamp leans towards the road next to it."""
    kind, high, wide = looks
    heading = 0.0
    if kind == "streetLamp" and not shapely.is_empty(roads):
        near = shapely.get_coordinates(shapely.ops.nearest_points(roads, shapely.Point(place))[0])[0]
        away = near - place
        heading = float(np.arctan2(away[1], away[0]) - 0.5 * np.pi) - (0.0 if place[1] < 0.0 else np.pi)
    radius = 0.5 * wide if kind == "pole" else 0.0
    return MapObject(
        line, name, kind, "", float(place[0]), float(place[1]), 0.0, heading, "none", (wide, wide, high, radius)
    )


def _barrier(way: Way, looks: Looks, source: Source, roads: shapely.Geometry) -> Iterator[MapObject]:
    """Return a barrier along a way as bodies over its ground plan, open where a road passes."""
    kind, high, wide = looks
    high = length(way.tags, "height", way.line, source) or high
    wide = max(length(way.tags, "width", way.line, source) or wide, 0.03)
    line = shapely.difference(shapely.LineString(way.points), roads)
    if line.length < shapely.LineString(way.points).length - 0.01:
        source.note(way.line, f"barrier={way.tags['barrier']} is open where a road passes")
    number = 0
    for part in shapely.get_parts(line):
        if part.length < 0.2:
            continue
        points = shapely.get_coordinates(shapely.segmentize(shapely.remove_repeated_points(part, 0.02), _STEP))
        if kind == "fence" and way.tags.get("fence_type") in OPEN_FENCES:
            for at in np.arange(0.0, part.length + 1e-6, _POSTS):
                place = shapely.get_coordinates(shapely.line_interpolate_point(part, at))[0]
                yield _post(way.line, f"{way.id}_{number}", ("pole", high, 0.1), place, roads)
                number += 1
            continue
        halves = [points[: len(points) // 2 + 1], points[len(points) // 2 :]] if way.is_closed else [points]
        for half in halves:
            if len(half) < 2:
                continue
            plan = shapely.LineString(half).buffer(0.5 * wide, cap_style="flat", join_style="mitre", mitre_limit=2.0)
            for body in shapely.get_parts(plan):
                if body.geom_type == "Polygon" and body.area > 1e-3:
                    yield _body(way.line, f"{way.id}_{number}", kind, shapely.get_coordinates(body.exterior)[:-1], high)
                    number += 1


def _body(line: int, name: str, kind: str, ring: Array, high: float) -> MapObject:
    outline = Outline(tuple(Corner(True, float(x), float(y), 0.0, high) for x, y in ring))
    x, y = (float(value) for value in ring[0])
    return MapObject(line, name, kind, "", x, y, 0.0, 0.0, "none", (0.0, 0.0, high, 0.0), (outline,))


def paved(extract: Extract, source: Source) -> Iterator[Area]:
    """Return paths, squares and car parks as paved areas."""
    for plan in plans(extract, source, "area:highway"):
        yield Area(plan.line, plan.rings, "asphalt_plain", "Roads")
    for plan in plans(extract, source, "amenity"):
        if plan.tags.get("amenity") == "parking" and plan.tags.get("parking", "surface") == "surface":
            yield Area(plan.line, plan.rings, "asphalt_plain", "Roads")
    for way in extract.ways.values():
        kind = way.tags.get("highway", "")
        if kind not in PATHS or len(way.points) < 2:
            continue
        if way.tags.get("bridge", "no") != "no" or way.tags.get("tunnel", "no") != "no":
            source.note(way.line, "a path on a bridge or in a tunnel is not drawn")
            continue
        if way.is_closed and way.tags.get("area") == "yes":
            yield Area(way.line, (way.points[:-1],), "paving_slabs", "SideWalks")
            continue
        wide = min(max(length(way.tags, "width", way.line, source) or PATHS[kind], 0.5), 30.0)
        strip = shapely.LineString(way.points).buffer(0.5 * wide, cap_style="flat", join_style="round", quad_segs=4)
        loose = way.tags.get("surface", "") in _LOOSE or (kind == "path" and "surface" not in way.tags)
        material = "gravel_fine" if loose else "asphalt_plain" if kind == "cycleway" else "paving_slabs"
        for part in shapely.get_parts(strip):
            if part.geom_type == "Polygon":
                rings = [shapely.get_coordinates(ring)[:-1] for ring in (part.exterior, *part.interiors)]
                yield Area(way.line, tuple(rings), material, "SideWalks")


_LOOSE: Sequence[str] = ("gravel", "fine_gravel", "compacted", "unpaved", "ground", "dirt", "earth", "pebblestone")
