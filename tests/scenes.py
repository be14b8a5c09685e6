"""Small synthetic scenes on disk, for tests of everything that looks at a World.

path = write_scene(tmp_path, instances=[Thing("wall", plane(10.0, 4.0), "Wall")], actors=[...])
world = load_scene(path)
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import trimesh


@dataclass(frozen=True)
class Material:
    """Matt look (linear RGB reflectance), radio material and diffuse reflectance at the lidar's wavelength."""

    color: tuple[float, float, float] = (0.5, 0.5, 0.5)
    radio: str = "concrete"
    lidar_reflectance: float = 0.5


@dataclass(frozen=True)
class Thing:
    """One instance with one shape.

    A mesh with a `trajectory` (a table as in scene.toml) is an actor, in its own frame.
    """

    name: str
    mesh: trimesh.Trimesh
    semantic: str = "Static"
    material: str = "grey"
    trajectory: Mapping[str, Any] | None = None
    emission: float | None = None  # radiance, for a shape that shines
    is_object: bool = True
    joints: Sequence[Mapping[str, Any]] = ()  # of an actor, tables as in scene.toml


@dataclass(frozen=True)
class Light:
    """An emitter: ``"constant"`` with its radiance, or ``"sunsky"``."""

    kind: str = "constant"
    radiance: float = 1.0
    properties: Mapping[str, float] = field(default_factory=dict)
    vectors: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)


DEFAULT_MATERIALS: Mapping[str, Material] = {
    "grey": Material(),
    "white": Material((0.9, 0.9, 0.9), "plastic", 1.0),
    "steel": Material((0.6, 0.6, 0.6), "metal", 0.4),
}


def plane(
    width: float, height: float, centre: npt.ArrayLike = (0, 0, 0), normal: npt.ArrayLike = (0, 0, 1)
) -> trimesh.Trimesh:
    """Return a rectangle of two triangles around a centre, facing `normal` [m]."""
    half = np.array([width, height]) / 2.0
    corners = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], dtype=np.float64) * [*half, 1.0]
    mesh = trimesh.Trimesh(corners, [(0, 1, 2), (0, 2, 3)], process=False)
    mesh.apply_transform(trimesh.geometry.align_vectors((0, 0, 1), np.asarray(normal, dtype=np.float64)))
    mesh.apply_translation(np.asarray(centre, dtype=np.float64))
    return mesh


def box(size: npt.ArrayLike, centre: npt.ArrayLike = (0, 0, 0)) -> trimesh.Trimesh:
    """Return a closed box with edges along the axes [m]."""
    mesh = trimesh.creation.box(extents=np.asarray(size, dtype=np.float64))
    mesh.apply_translation(np.asarray(centre, dtype=np.float64))
    return mesh


def ball(radius: float, centre: npt.ArrayLike = (0, 0, 0), subdivisions: int = 4) -> trimesh.Trimesh:
    """Return a closed sphere of 20 * 4**subdivisions triangles, corners on the sphere [m]."""
    mesh = trimesh.creation.icosphere(subdivisions=subdivisions, radius=radius)
    mesh.apply_translation(np.asarray(centre, dtype=np.float64))
    return mesh


def write_scene(
    folder: Path,
    instances: Sequence[Thing] = (),
    actors: Sequence[Thing] = (),
    materials: Mapping[str, Material] | None = None,
    light: Light | None = None,
    name: str = "synthetic",
    ego: str | None = None,
) -> Path:
    """Write XML, PLY meshes and scene.toml of a scene into a folder and return the path of the XML.

    Every thing is a shape ``shape-<name>`` with BSDF id ``<material>``. Instance ids follow the order: instances, then
    actors.
    """
    folder.mkdir(parents=True, exist_ok=True)
    materials = {**DEFAULT_MATERIALS, **(materials or {})}
    light = light or Light()
    root = ET.Element("scene", {"version": "3.0.0"})
    for bsdf_id, material in materials.items():
        outer = ET.SubElement(root, "bsdf", {"type": "twosided", "id": bsdf_id})
        inner = ET.SubElement(outer, "bsdf", {"type": "diffuse"})
        ET.SubElement(inner, "rgb", {"name": "reflectance", "value": ", ".join(map(repr, material.color))})
    for thing in (*instances, *actors):
        thing.mesh.export(folder / f"{thing.name}.ply")
        shape = ET.SubElement(root, "shape", {"type": "ply", "id": f"shape-{thing.name}"})
        ET.SubElement(shape, "string", {"name": "filename", "value": f"{thing.name}.ply"})
        ET.SubElement(shape, "boolean", {"name": "face_normals", "value": "true"})
        ET.SubElement(shape, "ref", {"id": thing.material, "name": "bsdf"})
        if thing.emission is not None:
            emitter = ET.SubElement(shape, "emitter", {"type": "area"})
            ET.SubElement(emitter, "rgb", {"name": "radiance", "value": repr(thing.emission)})
    emitter = ET.SubElement(root, "emitter", {"type": light.kind})
    if light.kind == "constant":
        ET.SubElement(emitter, "rgb", {"name": "radiance", "value": repr(light.radiance)})
    for key, value in light.properties.items():
        ET.SubElement(emitter, "float", {"name": key, "value": repr(value)})
    for key, vector in light.vectors.items():
        ET.SubElement(emitter, "vector", {"name": key, "value": ", ".join(map(repr, vector))})
    path = folder / f"{name}.xml"
    ET.ElementTree(root).write(path)
    (folder / "scene.toml").write_text(_toml(instances, actors, materials, name, ego))
    return path


def _toml(
    instances: Sequence[Thing], actors: Sequence[Thing], materials: Mapping[str, Material], name: str, ego: str | None
) -> str:
    lines = ["[scene]", f'name = "{name}"', *([f'ego = "{ego}"'] if ego else []), ""]
    for bsdf_id, material in materials.items():
        lines += [f"[materials.{bsdf_id}]", f'radio = "{material.radio}"']
        lines += [f"lidar_reflectance = {material.lidar_reflectance!r}", ""]
    for thing in instances:
        lines += ["[[instances]]", *_head(thing), f"object = {str(thing.is_object).lower()}", ""]
    for thing in actors:
        lines += ["[[actors]]", *_head(thing), "[actors.trajectory]"]
        lines += [f"{key} = {_value(value)}" for key, value in (thing.trajectory or {}).items()] + [""]
        for joint in thing.joints:
            lines += ["[[actors.joints]]", *(f"{key} = {_value(value)}" for key, value in joint.items()), ""]
    return "\n".join(lines)


def _head(thing: Thing) -> list[str]:
    return [f'name = "{thing.name}"', f'class = "{thing.semantic}"', f'shapes = ["shape-{thing.name}"]']


def _value(value: Any) -> str:
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, (list, tuple, np.ndarray)):
        return "[" + ", ".join(_value(entry) for entry in value) + "]"
    return repr(float(value))
