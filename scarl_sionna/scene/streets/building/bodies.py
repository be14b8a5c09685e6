"""Bodies of a map's objects: rows along a road, walls over outlines, trees, lamps, poles and boxes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import shapely

from scenes_xml.generators.geometry.mesh import Mesh, box, grid, merge, tube
from scenes_xml.generators.plants import planting, vegetation
from scenes_xml.generators.roads.motorway import rail, rail_posts
from scenes_xml.generators.roadside import furniture

from ..geometry.road import RoadShape
from ..model import Array, MapObject, Outline, Repeat
from .ground import GroundFrame
from .surfaces import Heights, sheet

_SIZES = {
    "pole": (0.1, 0.1, 1.0),
    "tree": (3.5, 3.5, 7.0),
    "vegetation": (1.0, 1.0, 1.2),
    "streetLamp": (0.2, 0.2, 8.0),
}
_FOOT = 0.3
_STEP = 2.0
_TREES = 4


Place = RoadShape | GroundFrame
"""What objects stand on: a road by s and t, or the ground by x and y."""


@dataclass(frozen=True)
class Spot:
    """Where one body stands: along and beside the road, height, heading [rad], length, width, height [m]."""

    s: float
    t: float
    z: float
    heading: float
    size: tuple[float, float, float]


def spots(thing: MapObject, kind: str) -> Iterator[Spot]:
    """Return where the bodies of an object stand, those of its rows one by one."""
    base = _SIZES.get(kind, (0.0, 0.0, 0.0))
    length, width, height, radius = thing.size
    given = (length or 2.0 * radius or base[0], width or 2.0 * radius or base[1], height or base[2])
    if not thing.repeats:
        yield Spot(thing.s, thing.t, thing.z, thing.heading, given)
    for row in thing.repeats:
        if row.distance == 0.0 and kind not in ("tree", "pole", "streetLamp"):
            continue
        places = np.arange(0.0, row.length + 1e-9, row.distance or 10.0)
        for way in places:
            share = way / row.length if row.length > 0.0 else 0.0
            size = tuple(_between(row, key, share, own) for key, own in zip(_KEYS, given, strict=True))
            t, z = _between(row, "t", share, thing.t), _between(row, "zOffset", share, thing.z)
            yield Spot(row.s + float(way), t, z, thing.heading, (size[0], size[1], size[2]))


_KEYS = ("length", "width", "height")


def _between(row: Repeat, key: str, share: float, otherwise: float) -> float:
    first = row.numbers.get(f"{key}Start", otherwise)
    return float(first + share * (row.numbers.get(f"{key}End", first) - first))


def row_body(shape: RoadShape, thing: MapObject, row: Repeat, kind: str) -> list[Mesh]:
    """Return the body of a row without gaps along the road: a rail on posts, or a wall of its height and width."""
    s = np.linspace(row.s, row.s + row.length, max(2, int(np.ceil(row.length / _STEP)) + 1))
    s = s[s <= shape.road.length + 1e-6]
    if len(s) < 2:
        return []
    share = (s - row.s) / max(row.length, 1e-9)
    t, low, high, width = (
        np.array([_between(row, key, float(u), own) for u in share])
        for key, own in (("t", thing.t), ("zOffset", thing.z), ("height", thing.size[2] or 1.0), ("width", 0.0))
    )
    if kind == "guardRail" and np.ptp(t) < 0.01:
        side = 1 if t[0] < 0.0 else -1
        line = shape  # a road's surface is a curve to sweep along, as the generators' own
        return [
            rail(line, s, float(t[0]), side),  # type: ignore[arg-type]
            rail_posts(line, np.arange(s[0] + 1.0, s[-1], 4.0), float(t[0]), side),  # type: ignore[arg-type]
        ]
    width = np.maximum(width, thing.size[1] or (0.06 if kind in ("railing", "fence") else 0.25))
    corners = [
        shape.point(s, t + side * 0.5 * width, low + lift)
        for side, lift in ((1.0, 0.0 * high), (1.0, high), (-1.0, high), (-1.0, 0.0 * high))
    ]
    if low.max() < 0.05:
        corners[0][:, 2] -= _FOOT
        corners[3][:, 2] -= _FOOT
    body = grid(np.stack([*corners, corners[0]], 1), _tiles(s, [0.0, 1.0, 1.2, 2.2, 2.4]))
    caps = [
        Mesh(np.array([c[end] for c in corners]), np.array([[0, 1, 2], [0, 2, 3]]), np.zeros((4, 2))) for end in (0, -1)
    ]
    return [merge([body, *caps])]


def _tiles(s: Array, across: list[float]) -> Array:
    return np.stack(np.meshgrid(s, across, indexing="ij"), -1) / 2.0


def body(
    shape: Place, thing: MapObject, spot: Spot, kind: str, number: int, is_light: bool
) -> Iterator[tuple[str, Mesh]]:
    """Return the meshes of one body with materials, empty for that of its kind."""
    foot = shape.point(spot.s, spot.t)
    foot = foot + [0.0, 0.0, spot.z]
    yaw = float(shape.heading(spot.s)) + spot.heading
    length, width, height = spot.size
    if kind == "tree" or (kind == "vegetation" and "tree" in thing.name.lower()):
        radius = max(0.5 * max(length, width), 0.8)
        form = vegetation.TreeShape(7.0, 2.2, 2.2, leaves=400 if is_light else 1500)
        scale = height / 7.0
        for part, mesh in vegetation.tree(form, 100 + number % _TREES).items():
            wide = np.array([radius / 2.2, radius / 2.2, scale])
            turned = Mesh(mesh.vertices * wide, mesh.faces, mesh.uv).moved(foot, yaw + number)
            yield {"trunk": "bark_furrowed", "core": "leaves_crown", "leaves": "leaf_cards"}[part], turned
    elif kind == "streetLamp":
        inward = yaw + (0.0 if spot.t < 0.0 else np.pi)
        for part, mesh in furniture.lamp_post(max(height, 3.0)).items():
            yield (
                {"glass": "lamp_glass"}.get(part, "galvanized_steel"),
                Mesh(mesh.vertices, mesh.faces).moved(foot, inward),
            )
    elif height > 0.0 and max(length, width) > 0.0:
        if kind == "pole" or thing.size[3] > 0.0:
            radius = 0.5 * max(length, width)
            column = tube(np.array([[0.0, 0.0, -_FOOT], [0.0, 0.0, height]]), radius, 12 if is_light else 20)
            yield "", Mesh(column.vertices, column.faces).moved(foot, yaw)
        elif kind == "vegetation" and not is_light:
            ends = np.array([[-0.5 * length, 0.0, 0.0], [0.5 * length, 0.0, 0.0]])
            yield "", planting.hedge(ends, height, max(width, 0.3), number, 0.4).moved(foot, yaw)
        else:
            size = (length or width, width or length, height + _FOOT)
            yield "", box(size, (0.0, 0.0, 0.5 * (height - _FOOT))).moved(foot, yaw)


def corners_of(shape: Place, thing: MapObject, outline: Outline) -> tuple[Array, Array]:
    """Return the corners of an outline on the ground as world points (n, 3), and its heights there (n,)."""
    base, yaw = shape.point(thing.s, thing.t), float(shape.heading(thing.s)) + thing.heading
    points = []
    for corner in outline.corners:
        if corner.is_road:
            points.append(shape.point(corner.a, corner.b) + [0.0, 0.0, corner.z])
        else:
            c, s = np.cos(yaw), np.sin(yaw)
            shift = [c * corner.a - s * corner.b, s * corner.a + c * corner.b, corner.z + thing.z]
            points.append(base + shift)
    return np.array(points), np.array([corner.height for corner in outline.corners])


def over_outline(shape: Place, thing: MapObject, outline: Outline, kind: str) -> Iterator[tuple[str, Mesh]]:
    """Return walls and top of a body over an outline."""
    feet, heights = corners_of(shape, thing, outline)
    heights = np.where(heights > 0.0, heights, thing.size[2] or (0.12 if kind == "trafficIsland" else 1.0))
    low, high = feet - [0.0, 0.0, _FOOT], feet + heights[:, None] * [0.0, 0.0, 1.0]
    if outline.is_closed:
        low, high = np.vstack([low, low[:1]]), np.vstack([high, high[:1]])
    way = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(low[:, :2], axis=0), axis=1))]
    uv = np.stack([np.column_stack([way, end[:, 2]]) for end in (low, high)], 1) / 3.0
    yield "", grid(np.stack([low, high], 1), uv)
    plane = shapely.make_valid(shapely.Polygon(feet[:, :2])) if outline.is_closed and len(feet) > 2 else None
    if plane is not None and plane.area > 1e-4:
        tops = _nearest_height(feet[:, :2], high[: len(feet), 2])
        yield ("tiles_dark" if kind == "building" else ""), sheet(plane, tops, 3.0)


def _nearest_height(corners: Array, z: Array) -> Heights:
    """Return heights that are those of the nearest corner."""
    return lambda places: np.asarray(z[np.linalg.norm(places[:, None] - corners[None], axis=2).argmin(1)])
