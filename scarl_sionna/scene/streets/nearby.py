"""The part of a map that lies beside a way: whole roads, areas cut."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import shapely

from scarl_sionna.core.errors import MapError

from .geometry.road import RoadShape
from .model import Area, Array, Road, StreetMap

REACH = 150.0
"""How far from the way a road comes that is kept [m]."""
_APART, _BESIDE = 5.0, 10.0
"""Distance of the points at which roads are looked at, and how far areas reach beside kept roads [m]."""
_SMALLEST = 1.0


def nearby(street: StreetMap, way: Array | None) -> StreetMap:
    """Return what of a map comes within `REACH` of the points of a way, (N, 2) [m]; of None, all of it.

    Raises
    ------
    MapError
        If no road does.
    """
    if way is None:
        return street
    region = shapely.buffer(shapely.simplify(_line(np.asarray(way, dtype=np.float64)), 1.0), REACH)
    shapely.prepare(region)
    lines = {name: _line(_points(road)) for name, road in street.roads.items()}
    roads = {name: road for name, road in street.roads.items() if shapely.intersects(region, lines[name])}
    if not any(section.lanes for road in roads.values() for section in road.sections):
        x, y = np.asarray(way)[0].tolist()
        raise MapError(
            f"has no lane within {REACH:g} m of the drive, which begins at ({x:.0f}, {y:.0f}) m", street.name
        )
    kept = shapely.union_all([region, *(shapely.buffer(lines[name], _BESIDE, quad_segs=2) for name in roads)])
    areas = tuple(part for area in street.areas for part in _cut(area, kept))
    buildings = tuple(one for one in street.buildings if shapely.intersects(region, shapely.Polygon(one.rings[0])))
    objects = tuple(one for one in street.objects if shapely.intersects_xy(region, one.s, one.t))
    return replace(street, roads=roads, areas=areas, buildings=buildings, objects=objects)


def _line(points: Array) -> shapely.Geometry:
    return shapely.LineString(points) if len(points) > 1 else shapely.Point(points[0])


def _points(road: Road) -> Array:
    s = np.linspace(0.0, road.length, max(int(road.length / _APART), 1) + 1)
    return np.asarray(RoadShape(road).point(s)[:, :2])


def _cut(area: Area, region: shapely.Geometry) -> Iterator[Area]:
    """Return the parts of an area within a region."""
    common = shapely.intersection(shapely.make_valid(shapely.Polygon(area.rings[0], area.rings[1:])), region)
    for part in shapely.get_parts(common):
        if part.geom_type == "Polygon" and part.area > _SMALLEST:
            rings = tuple(shapely.get_coordinates(ring)[:-1] for ring in (part.exterior, *part.interiors))
            yield replace(area, rings=rings)
