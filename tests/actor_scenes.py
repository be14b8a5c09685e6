"""Worlds of one actor model alone in free space, for tests of models and of what a radar sees of them."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from scarl_sionna.core.untrusted.toml_text import read_toml
from scarl_sionna.engine.load import load_scene
from scarl_sionna.engine.world import World
from scenes_xml import actor_path

NAMES = ("adult_man", "adult_woman", "child", "standing_adult", "bicycle", "scooter", "motorcycle")


def actor_table(model: str) -> dict[str, Any]:
    """Return the actor.toml of a model."""
    return read_toml(actor_path(model).parent / "actor.toml")


def actor_world(
    folder: Path,
    model: str,
    trajectory: Mapping[str, Any],
    detail: str = "detailed",
    radio: str | None = None,
    **joint: float,
) -> World:
    """Write a scene of one actor into a folder and load it.

    `radio` replaces all radio materials, `joint` sets keys of the walk or pedal joint (``phase=0.3``).
    """
    table = actor_table(model)
    root = ET.parse(actor_path(model).parent / f"{model}{'' if detail == 'detailed' else '_light'}.xml").getroot()
    for shape in root.findall("shape"):
        shape.set("id", f"it_{shape.get('id')}")
    for name in root.iter("string"):
        name.set("value", str(actor_path(model).parent / str(name.get("value"))))
    shapes = {str(shape.get("id")) for shape in root.findall("shape")}
    folder.mkdir(parents=True, exist_ok=True)
    ET.ElementTree(root).write(folder / f"{model}.xml")
    lines = ["[scene]", f'name = "{model}"', ""]
    bsdfs = {bsdf.get("id") for bsdf in root.iter("bsdf")}  # the light level has fewer
    for name, material in table["materials"].items():
        if name not in bsdfs:
            continue
        lines += [
            f"[materials.{name}]",
            f'radio = "{radio or material["radio"]}"',
            f"lidar_reflectance = {material['lidar_reflectance']}",
            "",
        ]
    lines += [
        "[[actors]]",
        'name = "it"',
        f'class = "{table["actor"]["class"]}"',
        'shapes = ["it_*"]',
        "[actors.trajectory]",
    ]
    lines += [f"{key} = {json.dumps(value)}" for key, value in trajectory.items()] + [""]
    for row in table.get("joints", []):
        row = {**row, **(joint if row["kind"] != "wheel" else {})}
        if "shapes" in row:
            row["shapes"] = [f"it_{shape}" for shape in row["shapes"] if f"it_{shape}" in shapes]
        lines += ["[[actors.joints]]", *(f"{key} = {json.dumps(value)}" for key, value in row.items()), ""]
    (folder / "scene.toml").write_text("\n".join(lines), encoding="utf-8")
    return load_scene(folder / f"{model}.xml")
