"""Paved places of no road, as junctions and squares: what roads leave of them, at the height of the roads around."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from scenes_xml.generators.geometry.mesh import Mesh
from scenes_xml.generators.geometry.polygon import resample

from ..model import Area, Array
from .heights import STEP, GroundHeight, border_points
from .surfaces import LAP, TILE, TILES, Piece, polygons, sheet, wall

_FOOT = 0.05
_UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, eq=False)
class Paved:
    """What is left of an area: surface, kerbs, ground plan, and points of its border (n, 3) [m]."""

    area: Area
    surface: Mesh
    kerbs: tuple[Mesh, ...]
    plan: shapely.Geometry
    border: Array


def paved_areas(pieces: Sequence[Piece], areas: Sequence[Area]) -> Iterator[Paved]:
    """Return what roads, and areas before it, leave of each paved area."""
    if not areas:
        return
    low = [piece for piece in pieces if piece.structure != "bridge"] or list(pieces)
    roads = [piece for piece in low if piece.height <= 0.0] or low
    height = GroundHeight(border_points(roads))
    index = shapely.STRtree([piece.footprint for piece in low])
    before: list[shapely.Geometry] = []
    for area in areas:
        plan = shapely.make_valid(shapely.Polygon(area.rings[0], area.rings[1:]))
        near = [low[k].footprint for k in index.query(plan)] + [one for one in before if shapely.intersects(one, plan)]
        free = shapely.difference(plan, shapely.union_all(near, grid_size=1e-4), grid_size=1e-4) if near else plan
        before.append(plan)
        inner = polygons(shapely.segmentize(free, 2.0))
        if not inner:
            continue
        wide = shapely.intersection(shapely.buffer(free, LAP, join_style="mitre"), shapely.buffer(plan, LAP))
        parts = inner if area.rise else polygons(shapely.segmentize(wide, 2.0))
        surface = sheet(shapely.MultiPolygon(parts), height, TILES.get(area.material, TILE)).moved(area.rise * _UP)
        rings = [shapely.get_coordinates(ring) for part in inner for ring in (part.exterior, *part.interiors)]
        tops = [np.column_stack([ring, height(ring) + area.rise]) for ring in rings]
        kerbs = tuple(wall(top - (area.rise + _FOOT) * _UP, top) for top in tops) if area.rise else ()
        border = np.concatenate([resample(top, STEP) for top in tops])
        yield Paved(area, surface, kerbs, shapely.MultiPolygon(inner), border)
