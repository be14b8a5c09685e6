"""Build the scene: ``python -m scenes_xml.suburban_street.build`` writes XML, scene.toml, meshes and textures.

Everything follows from the numbers in this package and the variant; a second run gives the same bytes.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..generators.kit import SceneKit
from ..generators.roads.drive import drive
from ..generators.roads.ground import Ground
from ..generators.roads.walkways import walk_lanes
from ..packing import write_packed
from . import layout as at
from . import static, things

NAME = "suburban_street"
TIMES = np.arange(0.0, 8.0 + 1e-9, 0.2)
PARKED = (
    ("suv", "grey"),
    ("small_car", "red"),
    ("saloon", "silver"),
    ("van", "white"),
    ("small_car", "blue"),
    ("saloon", "black"),
)


def build(folder: Path, variant: int = 0, detail: str = "detailed") -> None:
    """Write the whole scene into `folder`."""
    p = at.plan(variant)
    generator = np.random.default_rng(8100 + variant)
    table = {
        "name": NAME,
        "title": "Suburban street",
        "description": (
            "A residential street with a slight bend between detached houses, behind hedges, fences and walls, "
            "with street trees and "
            "cars parked along the right kerb; the ego car follows a small car, others come towards it, "
            "people walk and one crosses."
        ),
        "license": "Apache-2.0",
        "source": f"built by scenes_xml/{NAME}/build.py",
        "seed": variant,
        "ego": "ego",
    }
    kit = SceneKit(folder, table, detail, seed=400, view=((-22.0, -1.4, 1.2), (0.0, -1.4, 1.2)))
    ground = static.add_ground(kit, p)
    things.add_things(kit, p, ground, generator)
    kit.lanes += at.lanes(p) + walk_lanes(static.walkways(p), ground)
    kit.parking += at.parking(p, at.KERB_HEIGHT + static.PAD)
    _actors(kit, p, ground, generator)
    kit.write()


def _actors(kit: SceneKit, p: at.Plan, ground: Ground, generator: np.random.Generator) -> None:
    """Add the default traffic, and parked cars in some of the bays."""
    lines, ways = at.drive_lines(p), static.walkways(p)
    east, west = at.START + 1.0, at.STOP - 1.0
    cross = ways["cross"][::-1]
    for name, model, way, start, speeds, sigma in (
        ("ego", "saloon", lines["east"], -25.0 - east, ((0.0, 8.2), (4.0, 7.4), (8.0, 5.0)), 1.5),
        ("car_ahead", "small_car", lines["east"], -5.0 - east, ((0.0, 8.4), (8.0, 8.0)), 1.5),
        ("oncoming", "suv", lines["west"], west - 62.0, ((0.0, 7.5), (8.0, 8.0)), 1.5),
        ("oncoming_scooter", "scooter", lines["west"], west - 76.0, ((0.0, 5.5), (8.0, 5.6)), 1.5),
        ("walker_crossing", "adult_woman", cross, 0.4, ((0.0, 0.0), (6.2, 0.0), (7.0, 1.3), (8.0, 1.3)), 0.5),
        ("walker_father", "adult_man", ways["walk_right_a"], 66.0, ((0.0, 1.2),), 0.5),
        ("child", "child", ways["walk_right_a"], 67.1, ((0.0, 1.2),), 0.5),
    ):
        positions, yaw = drive(way, TIMES, speeds, start, ground, sigma)
        kit.actor(name, model, TIMES, positions, None, yaw)
    near = [place for place, s in zip(kit.parking, p.bays, strict=False) if -15.0 < s < 75.0]
    for number, place in enumerate(near[:: 1 if len(near) < 6 else 2][:6]):
        model, colour = PARKED[(number + p.variant) % len(PARKED)]
        kit.parked(f"parked_{number}", model, place, colour)


if __name__ == "__main__":
    write_packed(Path(__file__).resolve().parent, build)
