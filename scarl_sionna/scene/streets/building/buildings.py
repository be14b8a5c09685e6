"""Buildings over their ground plans: walls, courts, simple roofs, windows by storeys."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise

import numpy as np
import shapely

from scenes_xml.generators.geometry.mesh import Mesh, box

from ..model import Array, Building
from .heights import GroundHeight
from .surfaces import polygons, sheet, wall

ROOFS = ("flat", "gabled", "hipped", "pyramidal", "skillion")
"""Shapes of roofs that are built."""
WINDOW = (1.2, 1.4, 0.9, 2.7)
"""Width and height of a window, its sill above the floor, and distance from one to the next [m]."""
_FOOT, _SLAB, _POST = 0.3, 0.25, 0.12
_TILE = 3.0
_OUT = 0.01
_LOWEST = 2.2
"""Storeys of less have no windows [m]."""

Plane = Callable[[Array], Array]
"""Heights (n,) of points of the plane (n, 2) [m]."""


def building_plan(building: Building) -> shapely.Geometry:
    """Return the ground plan of a building."""
    return shapely.make_valid(shapely.Polygon(building.rings[0], building.rings[1:]))


def building_meshes(
    buildings: Sequence[Building], height: GroundHeight, is_light: bool
) -> Iterator[tuple[str, str, Mesh]]:
    """Return the meshes of buildings: class, material, mesh.

    A building stands on the lowest ground at its corners, and goes a little below it.
    """
    for building in buildings:
        plan = building_plan(building)
        base = float(height(building.rings[0]).min())
        faces = list(roof_faces(building, base))
        for part in polygons(plan):
            for region, plane in faces:
                own = polygons(shapely.intersection(part, region))
                if own:
                    yield "Building", building.cover, sheet(shapely.MultiPolygon(own), plane, _TILE)
                    if building.is_open:
                        yield "Building", building.cover, _lowered(sheet(shapely.MultiPolygon(own), plane, _TILE))
            if building.is_open:
                yield from _posts(building, part, faces, base)
                continue
            low = base + building.foot - (_FOOT if building.foot <= 0.0 else 0.0)
            for ring in (part.exterior, *part.interiors):
                for line, plane in _top_lines(ring, faces):
                    top = np.column_stack([line, plane(line)])
                    mesh = wall(np.column_stack([line, np.full(len(line), low)]), top)
                    uv = None if mesh.uv is None else mesh.uv / _TILE
                    yield "Building", building.walls, Mesh(mesh.vertices, mesh.faces, uv)
                if not is_light and building.storeys:
                    yield from _windows(building, ring, base)
            if building.foot > 0.0:
                yield "Building", building.walls, sheet(part, lambda places: np.full(len(places), low), _TILE)  # noqa: B023


def _lowered(mesh: Mesh) -> Mesh:
    return Mesh(mesh.vertices - [0.0, 0.0, _SLAB], mesh.faces[:, ::-1], mesh.uv)


def _posts(
    building: Building, part: shapely.Polygon, faces: Sequence[tuple[shapely.Geometry, Plane]], base: float
) -> Iterator[tuple[str, str, Mesh]]:
    """Return the edge of an open roof and posts below its corners."""
    for line, plane in _top_lines(part.exterior, faces):
        top = np.column_stack([line, plane(line)])
        yield "Building", building.cover, wall(top - [0.0, 0.0, _SLAB], top)
    inside = shapely.buffer(part, -_POST, join_style="mitre")
    for place in shapely.get_coordinates(inside)[:40]:
        tall = building.eaves - _SLAB + _FOOT
        post = box((_POST, _POST, tall), (*place, base - _FOOT + 0.5 * tall))
        yield "Building", "galvanized_steel", Mesh(post.vertices, post.faces, np.zeros((len(post.vertices), 2)))


def roof_faces(building: Building, base: float) -> Iterator[tuple[shapely.Geometry, Plane]]:
    """Return the faces of a roof: ground plan, beyond the building's own, and heights.

    Roofs follow the smallest rectangle around the ground plan: a ridge lies along its longer side, or across it.
    """
    ring = building.rings[0]
    low, top = base + building.eaves, base + building.top
    box_plan = shapely.minimum_rotated_rectangle(shapely.Polygon(ring))
    corners = shapely.get_coordinates(box_plan)[:4]
    if building.roof not in ROOFS[1:] or len(corners) < 4 or top - low < 0.05:
        yield shapely.box(*(shapely.Polygon(ring).bounds)).buffer(1.0), lambda places: np.full(len(places), top)
        return
    along, across = corners[1] - corners[0], corners[3] - corners[0]
    if (np.linalg.norm(across) > np.linalg.norm(along)) != building.is_across:
        along, across = across, along
    a, b = 0.5 * float(np.linalg.norm(along)), 0.5 * float(np.linalg.norm(across))
    middle, u, v = corners.mean(0), along / (2.0 * a), across / (2.0 * b)

    def world(points: Sequence[tuple[float, float]]) -> shapely.Polygon:
        return shapely.Polygon([middle + p * u + q * v for p, q in points])

    def plane(slope_u: float, slope_v: float, at_middle: float) -> Plane:
        return lambda places: at_middle + (places - middle) @ (slope_u * u + slope_v * v)

    rise, far = top - low, a + b + 1.0
    if building.roof == "skillion":
        yield world([(-far, -far), (far, -far), (far, far), (-far, far)]), plane(0.0, 0.5 * rise / b, low + 0.5 * rise)
    elif building.roof == "gabled":
        for side in (1.0, -1.0):
            yield (
                world([(-far, 0.0), (far, 0.0), (far, side * far), (-far, side * far)]),
                plane(0.0, -side * rise / b, top),
            )
    elif building.roof == "pyramidal":
        grown = far / min(a, b)
        for side in (1.0, -1.0):
            p, q = grown * a * side, grown * b * side
            yield world([(0.0, 0.0), (p, q), (p, -q)]), plane(-side * rise / a, 0.0, top)
            yield world([(0.0, 0.0), (p, q), (-p, q)]), plane(0.0, -side * rise / b, top)
    else:  # hipped: all four planes are as steep
        if a < b:
            a, b, u, v = b, a, v, u
        ridge = a - b
        for side in (1.0, -1.0):
            end = (side * (ridge + far), far)
            yield (
                world([(side * ridge, 0.0), end, (end[0], -far)]),
                plane(-side * rise / b, 0.0, top + rise * ridge / b),
            )
            yield (
                world([(-ridge, 0.0), (ridge, 0.0), (ridge + far, side * far), (-ridge - far, side * far)]),
                plane(0.0, -side * rise / b, top),
            )


def _top_lines(
    ring: shapely.Geometry, faces: Sequence[tuple[shapely.Geometry, Plane]]
) -> Iterator[tuple[Array, Plane]]:
    """Return the lines of a ring below each face of the roof."""
    line = shapely.LineString(ring)
    for region, plane in faces:
        found = shapely.intersection(line, region)
        for part in shapely.get_parts(shapely.line_merge(found) if found.geom_type == "MultiLineString" else found):
            if part.geom_type == "LineString" and part.length > 1e-6:
                yield shapely.get_coordinates(part), plane


def _windows(building: Building, ring: shapely.Geometry, base: float) -> Iterator[tuple[str, str, Mesh]]:
    """Return panes a little before the walls, below the eaves."""
    wide, high, sill, step = WINDOW
    storey = (building.eaves - building.foot) / building.storeys
    if storey < _LOWEST:
        return
    points = shapely.get_coordinates(ring)
    outward = -1.0 if shapely.is_ccw(ring) else 1.0
    quads = []
    for start, stop in pairwise(points):
        length = float(np.linalg.norm(stop - start))
        count = int((length - 0.8) // step)
        if count < 1:
            continue
        along = (stop - start) / length
        out = outward * np.array([-along[1], along[0]]) * _OUT
        for k in range(count):
            middle = start + along * (length * (k + 0.5) / count) + out
            ends = middle - 0.5 * wide * along, middle + 0.5 * wide * along
            for floor in range(building.storeys):
                z = base + building.foot + floor * storey + sill * storey / 3.0
                tall = min(high * storey / 3.0, 2.2)
                quads.append([[[*end, z], [*end, z + tall]] for end in ends])
    if quads:
        corners = np.array(quads)  # (n, 2, 2, 3)
        faces = np.array([[0, 2, 3], [0, 3, 1]])
        index = (4 * np.arange(len(quads))[:, None, None] + faces).reshape(-1, 3)
        yield "Building", "window_pane", Mesh(corners.reshape(-1, 3), index, np.zeros((4 * len(quads), 2)))
