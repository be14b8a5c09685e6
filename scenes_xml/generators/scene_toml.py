"""Writer of scene.toml."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .mesh import Array
from .xml import Bsdf


@dataclass(frozen=True)
class Instance:
    """A static instance: its semantic class, the patterns of its shapes, and whether it has a 3D box."""

    name: str
    semantic: str
    shapes: tuple[str, ...]
    is_object: bool


@dataclass(frozen=True)
class ActorEntry:
    """A moving instance: waypoints (times [s], positions [m], headings [deg] or None) and joints as tables."""

    name: str
    semantic: str
    times: Array
    positions: Array
    yaw_deg: Array | None = None
    joints: Sequence[Mapping[str, Any]] = field(default_factory=tuple)


def scene_toml(
    head: Mapping[str, Any],
    bsdfs: Mapping[str, Bsdf],
    instances: Sequence[Instance],
    actors: Sequence[ActorEntry],
    lighting: str = "day",
) -> str:
    """Return the text of a scene.toml: `head` is its table ``[scene]``, `lighting` the preset of its light."""
    lines = ["[scene]", *(f"{key} = {_value(value)}" for key, value in head.items()), ""]
    lines += ["[lighting]", f"preset = {_value(lighting)}", ""]
    for name, b in bsdfs.items():
        lines += [f"[materials.{name}]", *(f"{key} = {_value(value)}" for key, value in b.table().items()), ""]
    for item in instances:
        lines += ["[[instances]]", f'name = "{item.name}"', f'class = "{item.semantic}"']
        lines += [f"shapes = {_value(item.shapes)}", f"object = {_value(item.is_object)}", ""]
    for actor in actors:
        lines += ["[[actors]]", f'name = "{actor.name}"', f'class = "{actor.semantic}"', f'shapes = ["{actor.name}_*"]']
        lines += ["[actors.trajectory]", 'kind = "waypoints"', f"times = {_value(actor.times)}"]
        if actor.yaw_deg is not None:
            lines.append(f"yaw_deg = {_value(np.round(actor.yaw_deg, 6))}")
        lines.append("positions = [")
        lines += [f"    [{x + 0.0:.6f}, {y + 0.0:.6f}, {z + 0.0:.6f}]," for x, y, z in actor.positions.round(6)]
        lines += ["]", ""]
        for joint in actor.joints:
            lines += ["[[actors.joints]]", *(f"{key} = {_value(value)}" for key, value in joint.items()), ""]
    return "\n".join(lines)


def _value(value: Any) -> str:
    """Return a value as TOML."""
    if isinstance(value, bool | str):
        return json.dumps(value)
    if isinstance(value, tuple | list | np.ndarray):
        return "[" + ", ".join(_value(item) for item in value) + "]"
    return f"{value + 0.0:g}" if isinstance(value, float) else str(value)
