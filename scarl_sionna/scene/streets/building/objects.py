"""Objects of a map as bodies: buildings and islands by outline, rows along the road, poles, plants, crossings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import shapely

from scarl_sionna.core.semantics import SEMANTIC_CLASSES
from scenes_xml.generators.geometry.mesh import Mesh, merge
from scenes_xml.generators.kit import SceneKit
from scenes_xml.generators.scene_toml import Parking

from ..geometry.road import RoadShape
from ..model import Array, Finding, MapObject, StreetMap
from .bodies import Place, body, corners_of, over_outline, row_body, spots
from .ground import GroundFrame
from .marks import RAISED, crossing_bars

LOOKS: dict[str, tuple[str, str]] = {
    "building": ("wall_white", "Building"),
    "wall": ("concrete_grey", "Wall"),
    "soundBarrier": ("noise_panel", "Wall"),
    "barrier": ("concrete_grey", "GuardRail"),
    "guardRail": ("galvanized_steel", "GuardRail"),
    "railing": ("galvanized_steel", "GuardRail"),
    "fence": ("timber_grey", "Fence"),
    "pole": ("galvanized_steel", "Pole"),
    "gantry": ("galvanized_steel", "Pole"),
    "streetLamp": ("galvanized_steel", "Pole"),
    "vegetation": ("hedge", "Vegetation"),
    "trafficIsland": ("kerb_stone", "SideWalks"),
    "obstacle": ("concrete_grey", "Static"),
}
"""Kind -> material and class."""
_WORDS = (
    ("guardrail", "guardRail"), ("guard_rail", "guardRail"), ("rail-pole", "pole"), ("railing", "railing"),
    ("fence", "fence"), ("sound", "soundBarrier"), ("streetlamp", "streetLamp"), ("street_lamp", "streetLamp"),
    ("lamp", "streetLamp"), ("gantry", "gantry"), ("mastarm", "gantry"), ("guide-post", "pole"), ("post", "pole"),
    ("pole", "pole"), ("tree", "tree"), ("hedge", "vegetation"), ("bush", "vegetation"), ("vegetation", "vegetation"),
    ("building", "building"), ("house", "building"), ("wall", "wall"), ("barrier", "barrier"),
    ("crosswalk", "crosswalk"), ("island", "trafficIsland"), ("parking", "parkingSpace"),
)  # fmt: skip # a table
_FLAT = ("roadMark", "patch", "roadSurface", "bridge", "roadPainting")


def kind_of(thing: MapObject) -> str:
    """Return what an object is, by its type, else by words of its type and name."""
    if thing.kind in LOOKS or thing.kind in ("tree", "crosswalk", "parkingSpace", *_FLAT):
        return thing.kind
    text = f"{thing.kind} {thing.name}".lower()
    return next((kind for word, kind in _WORDS if word in text), "obstacle")


def add_objects(
    kit: SceneKit,
    street: StreetMap,
    shapes: Mapping[str, RoadShape],
    ground: GroundFrame,
    findings: list[Finding],
) -> list[Parking]:
    """Add all objects to a scene, those of no road on its `ground`, and return its parking places."""
    parking: list[Parking] = []
    count = 0
    places: list[tuple[Place, Sequence[MapObject]]] = [(shapes[k], road.objects) for k, road in street.roads.items()]
    for shape, things in [*places, (ground, street.objects)]:
        for thing in things:
            kind = kind_of(thing)
            if kind in _FLAT:
                findings.append(Finding(thing.line, f"<object> of type '{kind}' is not drawn"))
                continue
            if kind == "obstacle" != thing.kind and _is_flat(thing):
                findings.append(Finding(thing.line, "<object> of no known kind, flat on the ground, is not drawn"))
                continue
            if kind == "parkingSpace":
                parking.append(_parking(shape, thing))
                continue
            name = f"object_{count}_{kind.lower()}"
            count += 1
            make = _crosswalk if kind == "crosswalk" else _parts
            parts = make(shape, thing, kind, kit.is_light)
            semantic = "RoadLine" if kind == "crosswalk" else LOOKS.get(kind, ("", "Vegetation"))[1]
            assert semantic in SEMANTIC_CLASSES
            shown = {material: mesh for material, mesh in parts.items() if len(mesh.faces)}
            if not shown:
                findings.append(Finding(thing.line, f"<object> of type '{kind}' has no size and no outline"))
                continue
            for material, mesh in shown.items():
                kit.add(f"{name}_{material}", mesh, material, 40.0)
            kit.instance(name, semantic, [f"{name}_{m}" for m in shown], is_object=kind != "crosswalk")
    return parking


def _is_flat(thing: MapObject) -> bool:
    """Return whether an object has an outline and no height: a stain or another picture on the road."""
    heights = [corner.height for outline in thing.outlines for corner in outline.corners]
    return bool(heights) and max(*heights, thing.size[2]) <= 0.0


def _parts(shape: Place, thing: MapObject, kind: str, is_light: bool) -> dict[str, Mesh]:
    """Return the meshes of an object by material."""
    found: dict[str, list[Mesh]] = {}
    material = LOOKS.get(kind, ("hedge", ""))[0]
    for outline in thing.outlines:
        for own, mesh in over_outline(shape, thing, outline, kind):
            found.setdefault(own or material, []).append(mesh)
    if not thing.outlines:
        for row in thing.repeats:
            if isinstance(shape, RoadShape) and row.distance == 0.0 and kind not in ("tree", "pole", "streetLamp"):
                found.setdefault(material, []).extend(row_body(shape, thing, row, kind))
        for number, spot in enumerate(spots(thing, kind)):
            for own, mesh in body(shape, thing, spot, kind, number, is_light):
                found.setdefault(own or material, []).append(mesh)
    return {
        own: merge(meshes if all(m.uv is not None for m in meshes) else [Mesh(m.vertices, m.faces) for m in meshes])
        for own, meshes in found.items()
    }


def _rectangle(shape: Place, thing: MapObject) -> Array:
    """Return the four corners of an object on the ground: of its outline, or of its length and width."""
    for outline in thing.outlines:
        points = corners_of(shape, thing, outline)[0]
        if len(points) > 4 and np.linalg.norm(points[0] - points[-1]) < 0.01:
            points = points[:-1]
        if len(points) == 4:
            return points
        plane = shapely.get_coordinates(shapely.minimum_rotated_rectangle(shapely.MultiPoint(points[:, :2])))[:4]
        away = np.linalg.norm(plane[:, None] - points[None, :, :2], axis=2).argmin(1)
        return np.column_stack([plane, points[away, 2]])
    length, width = thing.size[0], thing.size[1]
    base, yaw = shape.point(thing.s, thing.t, thing.z), float(shape.heading(thing.s)) + thing.heading
    c, s = np.cos(yaw), np.sin(yaw)
    half = 0.5 * np.array([(-length, -width), (length, -width), (length, width), (-length, width)])
    return base + np.column_stack([c * half[:, 0] - s * half[:, 1], s * half[:, 0] + c * half[:, 1], np.zeros(4)])


def _crosswalk(shape: Place, thing: MapObject, kind: str, is_light: bool) -> dict[str, Mesh]:
    """Return the bars of a crossing."""
    corners = _rectangle(shape, thing)
    if np.linalg.norm(corners[1] - corners[0]) < 0.5 or np.linalg.norm(corners[3] - corners[0]) < 0.5:
        return {}
    lift = (2.5 if is_light else 1.25) * RAISED  # above the chords of the road
    bars = [
        Mesh(bar + [0.0, 0.0, lift], np.array([[0, 1, 2], [0, 2, 3]]), bar[:, :2]) for bar in crossing_bars(corners)
    ]
    return {"line_white": merge(bars)}


def _parking(shape: Place, thing: MapObject) -> Parking:
    """Return a parking place: the rectangle's middle, its longer side is its length."""
    corners = _rectangle(shape, thing)
    along, across = corners[1] - corners[0], corners[3] - corners[0]
    if np.linalg.norm(across) > np.linalg.norm(along):
        along, across = across, along
    middle = corners.mean(0)
    yaw = float(np.degrees(np.arctan2(along[1], along[0])))
    length, width = float(np.linalg.norm(along)), float(np.linalg.norm(across))
    place = (float(middle[0]), float(middle[1]), float(middle[2]))
    return Parking(place, yaw, min(length, 30.0) or 5.0, min(width, 10.0) or 2.2)
