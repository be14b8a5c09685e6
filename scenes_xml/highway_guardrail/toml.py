"""Writer of scene.toml."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from ..generators.mesh import Array
from ..generators.xml import Bsdf
from .layout import ACTORS, SEED, TIMES


@dataclass(frozen=True)
class Instance:
    """A static instance: its semantic class, the patterns of its shapes, and whether it has a 3D box."""

    name: str
    semantic: str
    shapes: tuple[str, ...]
    is_object: bool


DESCRIPTION = (
    "A two-lane road that bends to the left, a guardrail along its right side, a car ahead that drives away, an oncoming "
    "car, and things beside the road; after Figure 2 of the SCaRL paper."
)


def _quoted(values: tuple[str, ...]) -> str:
    return "[" + ", ".join(f'"{v}"' for v in values) + "]"


def scene_toml(
    name: str, bsdfs: Mapping[str, Bsdf], instances: Sequence[Instance], positions: Mapping[str, Array]
) -> str:
    """Return the text of scene.toml."""
    lines = [
        "[scene]", f'name = "{name}"', 'title = "Bend with a guardrail"', f'description = "{DESCRIPTION}"',
        'license = "Apache-2.0"', f'source = "built by scenes_xml/{name}/build.py"', f"seed = {SEED}", 'ego = "ego"', "",
    ]  # fmt: skip
    for key, b in bsdfs.items():
        lines += [
            f"[materials.{key}]",
            f'radio = "{b.radio}"',
            f"lidar_reflectance = {b.lidar_reflectance:g}",
            f'source = "{b.source}"',
            *([f'lamp = "{b.lamp}"'] if b.lamp else []),
            *([f"wets = {b.wets:g}"] if b.wets else []),
            *([f'puddles = "textures/{b.puddles}"'] if b.puddles else []),
            "",
        ]
    for item in instances:
        lines += [
            "[[instances]]",
            f'name = "{item.name}"',
            f'class = "{item.semantic}"',
            f"shapes = {_quoted(item.shapes)}",
        ]
        lines += [f"object = {str(item.is_object).lower()}", ""]
    for actor in ACTORS:
        lines += ["[[actors]]", f'name = "{actor.name}"', 'class = "Car"', f'shapes = ["{actor.name}_*"]']
        lines += [
            "[actors.trajectory]",
            'kind = "waypoints"',
            f"times = [{', '.join(f'{t:g}' for t in TIMES)}]",
            "positions = [",
        ]
        lines += [f"    [{x + 0.0:.6f}, {y + 0.0:.6f}, {z + 0.0:.6f}]," for x, y, z in positions[actor.name].round(6)]
        lines += ["]", ""]
    return "\n".join(lines)
