"""One actor model on disk: two Mitsuba files, their meshes, and ``actor.toml``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..generators.geometry import mesh
from ..generators.geometry.mesh import Mesh
from ..generators.scene_toml import toml_value
from ..generators.xml import Bsdf, Placement, scene_xml

Color = tuple[float, float, float]


@dataclass(frozen=True)
class Part:
    """A shape of an actor.

    Its mesh in the actor's frame (or its segment's), its BSDF, and the edge angle above which it is not smooth [deg].
    """

    mesh: Mesh
    bsdf: str
    crease_deg: float = 35.0


@dataclass(frozen=True)
class Model:
    """All that is written of an actor model.

    Attributes
    ----------
    head : mapping
        Table ``[actor]`` of actor.toml: ``name``, ``title``, ``class``, ``motion``, measures [m] and what else it
        states.
    detailed, light : mapping
        Id of each shape -> its part, at the two levels of geometry.
    bsdfs : mapping
        Optical, radio and lidar properties by BSDF id; those that no shape uses are left out.
    variants : mapping
        Name -> linear RGB colours of BSDFs; the first one is what the XML holds.
    joints : sequence of mappings
        Rows of ``[[joints]]``; at the light level, shapes that it does not have are missing there.
    """

    head: Mapping[str, Any]
    detailed: Mapping[str, Part]
    light: Mapping[str, Part]
    bsdfs: Mapping[str, Bsdf]
    variants: Mapping[str, Mapping[str, Color]]
    joints: Sequence[Mapping[str, Any]] = field(default_factory=tuple)


def write_model(model: Model, folder: Path) -> None:
    """Write a model into `folder`: ``<name>.xml``, ``<name>_light.xml``, ``meshes/`` and ``actor.toml``."""
    (folder / "meshes").mkdir(parents=True, exist_ok=True)
    for old in (folder / "meshes").glob("*.ply"):
        old.unlink()
    name = str(model.head["name"])
    used = {part.bsdf for parts in (model.detailed, model.light) for part in parts.values()}
    bsdfs = {key: bsdf for key, bsdf in model.bsdfs.items() if key in used}
    for suffix, parts in (("", model.detailed), ("_light", model.light)):
        placements = [_write_part(folder, shape, part, suffix) for shape, part in parts.items()]
        own = {key: bsdf for key, bsdf in bsdfs.items() if any(part.bsdf == key for part in parts.values())}
        comment = f"{name}{suffix}: written by scenes_xml/actors/build.py; do not edit"
        (folder / f"{name}{suffix}.xml").write_text(scene_xml(comment, (), own, placements), encoding="utf-8")
    (folder / "actor.toml").write_text(_toml(model, bsdfs), encoding="utf-8")


def _write_part(folder: Path, shape: str, part: Part, suffix: str) -> Placement:
    file = f"{shape}{suffix}.ply"
    mesh.write_ply(mesh.finish(part.mesh, part.crease_deg), folder / "meshes" / file)
    return Placement(shape, file, part.bsdf)


def _toml(model: Model, bsdfs: Mapping[str, Bsdf]) -> str:
    head = {**model.head}
    head.setdefault("license", "Apache-2.0")
    head.setdefault("source", "built by scenes_xml/actors/build.py")
    lines = ["[actor]", *(f"{key} = {toml_value(value)}" for key, value in head.items()), ""]
    for name, colors in model.variants.items():
        lines += [f"[variants.{name}]", *(f"{bsdf} = {toml_value(rgb)}" for bsdf, rgb in colors.items()), ""]
    for name, bsdf in bsdfs.items():
        lines += [f"[materials.{name}]", *(f"{key} = {toml_value(value)}" for key, value in bsdf.table().items()), ""]
    for joint in model.joints:
        lines += ["[[joints]]", *(f"{key} = {toml_value(value)}" for key, value in joint.items()), ""]
    return "\n".join(lines)


def bounds(parts: Mapping[str, Part], leave_out: Sequence[str] = ()) -> tuple[np.ndarray, np.ndarray]:
    """Return the lowest and the highest corner of all parts but those in `leave_out`, shape (3,) each [m]."""
    points = np.concatenate([part.mesh.vertices for shape, part in parts.items() if shape not in leave_out])
    return points.min(0), points.max(0)
