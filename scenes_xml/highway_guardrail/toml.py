"""Writer of scene.toml."""

from __future__ import annotations

from collections.abc import Mapping

from ..generators.mesh import Array
from ..generators.xml import Bsdf
from .layout import ACTORS, SEED, TIMES

INSTANCES: tuple[tuple[str, str, tuple[str, ...], bool], ...] = (
    ("road", "Roads", ("road_asphalt",), False),
    ("lane_markings", "RoadLine", ("marking_*",), False),
    ("gravel_verges", "Terrain", ("gravel_*",), False),
    ("terrain", "Terrain", ("terrain_*",), False),
    ("guardrail_right", "GuardRail", ("guardrail_*",), True),
)
"""Static instances: name, class, shape patterns, has a 3D box."""

DESCRIPTION = (
    "A two-lane road that bends to the left, a guardrail along its right side, a car ahead that drives away, an oncoming "
    "car, and things beside the road; after Figure 2 of the SCaRL paper."
)


def _quoted(values: tuple[str, ...]) -> str:
    return "[" + ", ".join(f'"{v}"' for v in values) + "]"


def scene_toml(name: str, bsdfs: Mapping[str, Bsdf], positions: Mapping[str, Array]) -> str:
    """Return the text of scene.toml."""
    lines = [
        "[scene]", f'name = "{name}"', 'title = "Bend with a guardrail"', f'description = "{DESCRIPTION}"',
        'license = "Apache-2.0"', f'source = "built by scenes_xml/{name}/build.py"', f"seed = {SEED}", 'ego = "ego"', "",
    ]  # fmt: skip
    for key, b in bsdfs.items():
        lines += [f"[materials.{key}]", f'radio = "{b.radio}"', f"lidar_reflectance = {b.lidar_reflectance:g}", f'source = "{b.source}"', ""]
    for instance, semantic, patterns, is_object in INSTANCES:
        lines += ["[[instances]]", f'name = "{instance}"', f'class = "{semantic}"', f"shapes = {_quoted(patterns)}"]
        lines += [f"object = {str(is_object).lower()}", ""]
    for actor in ACTORS:
        lines += ["[[actors]]", f'name = "{actor.name}"', 'class = "Car"', f'shapes = ["{actor.name}_*"]']
        lines += ["[actors.trajectory]", 'kind = "waypoints"', f"times = [{', '.join(f'{t:g}' for t in TIMES)}]", "positions = ["]
        lines += [f"    [{x + 0.0:.6f}, {y + 0.0:.6f}, {z + 0.0:.6f}]," for x, y, z in positions[actor.name].round(6)]
        lines += ["]", ""]
    return "\n".join(lines)
