"""Build the scene: ``python -m scenes_xml.country_road.build`` writes XML, scene.toml, packed meshes and textures.

Everything follows from the numbers in this package and the variant; a second run gives the same bytes.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..generators.kit import SceneKit
from ..generators.roads.drive import drive
from ..generators.roads.ground import Ground
from ..packing import write_packed
from . import layout as at
from . import static, things

NAME = "country_road"
TIMES = np.arange(0.0, 8.0 + 1e-9, 0.2)


def build(folder: Path, variant: int = 0, detail: str = "detailed") -> None:
    """Write the whole scene into `folder`."""
    p = at.plan(variant)
    generator = np.random.default_rng(9100 + variant)
    table = {
        "name": NAME,
        "title": "Country road",
        "description": (
            "A road of two lanes with bends and low hills between ditches, fields, fences and hedgerows, "
            "a guardrail in one bend, a farm, "
            "power poles and a path for bicycles; the ego car comes up behind a lorry, "
            "a car and a motorcycle come towards it."
        ),
        "license": "Apache-2.0",
        "source": f"built by scenes_xml/{NAME}/build.py",
        "seed": variant,
        "ego": "ego",
    }
    kit = SceneKit(folder, table, detail, seed=500, view=((-27.0, -1.45, 1.4), (10.0, -1.45, 1.4)))
    ground = static.add_ground(kit, p)
    things.add_things(kit, p, ground, generator)
    cycle = static.cycle_lines(p, ground)
    kit.lanes += at.lanes(p, cycle)
    _actors(kit, p, ground, cycle)
    kit.write()


def _actors(kit: SceneKit, p: at.Plan, ground: Ground, cycle: dict[str, np.ndarray]) -> None:
    """Add the default traffic: everything keeps to its lane."""
    lines = at.drive_lines(p)
    east, west = at.START + 2.0, at.STOP - 2.0
    for name, model, way, start, speeds in (
        ("ego", "saloon", lines["east"], -30.0 - east, ((0.0, 17.0), (8.0, 12.5))),
        ("lorry_ahead", "lorry", lines["east"], 12.0 - east, ((0.0, 12.0), (8.0, 12.5))),
        ("oncoming", "small_car", lines["west"], west - 70.0, ((0.0, 16.0), (8.0, 16.5))),
        ("motorcycle", "motorcycle", lines["west"], west - 118.0, ((0.0, 18.0), (8.0, 17.0))),
        ("bicycle", "bicycle", cycle["path_east"], 2.0 - east, ((0.0, 5.5), (8.0, 5.2))),
    ):
        positions, yaw = drive(way, TIMES, speeds, start, ground, 2.0)
        kit.actor(name, model, TIMES, positions, None, yaw)


if __name__ == "__main__":
    write_packed(Path(__file__).resolve().parent, build)
