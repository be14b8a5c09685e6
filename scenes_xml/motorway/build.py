"""Build the scene: ``python -m scenes_xml.motorway.build`` writes XML, scene.toml, meshes and textures of variant 0.

Everything follows from the numbers in this package and the variant's number; a second run gives the same bytes.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..generators.geometry.mesh import Array
from ..generators.kit import SceneKit
from ..generators.roads.bridge import surface
from ..generators.roads.sweep import lane_line
from ..generators.scene_toml import Lane
from ..generators.surfaces import interior, urban
from ..packing import write_packed
from . import layout as at
from . import static

NAME = "motorway"
DESCRIPTION = (
    "A motorway in a wide bend: lanes in both directions with emergency lanes, "
    "a concrete barrier in the median, guardrails with posts, a "
    "bridge over it, a sign gantry, a noise wall, lorries, cars and a motorcycle."
)


def build(folder: Path, variant: int = 0, detail: str = "detailed") -> None:
    """Write a variant of the scene into `folder`, ``detailed`` or ``light``."""
    plan = at.layout(variant)
    table = {
        "name": NAME,
        "title": "Motorway with bridge and guardrails",
        "description": DESCRIPTION,
        "license": "Apache-2.0",
        "source": f"built by scenes_xml/{NAME}/build.py",
        "seed": at.SEED,
        "ego": "ego",
        "variant": variant,
        "detail": detail,
    }
    kit = SceneKit(folder, table, detail, at.SEED + variant)
    kit.materials |= interior.MATERIALS | urban.MATERIALS
    kit.textures |= interior.IMAGES | urban.IMAGES
    static.add_road(kit, plan)
    static.add_barriers(kit, plan)
    static.add_structures(kit, plan)
    static.add_furniture(kit, plan)
    _lanes(kit, plan)
    for t in plan.traffic:
        speed = t.speed if t.lane >= 0 else -t.speed
        kit.actor(
            t.name,
            t.model,
            at.TIMES,
            plan.curve.lane_positions(t.start, plan.offset(t.lane), speed, at.TIMES),
            t.variant,
        )
    kit.write()


def _lanes(kit: SceneKit, plan: at.Layout) -> None:
    """Add the lanes of both carriageways, the rightmost being number 0, and those on the bridge."""
    a, b = at.START + 3.0, at.STOP - 3.0
    for k in range(plan.lanes):
        limit = 25.0 if k == 0 else 33.3
        left = k + 1 if k + 1 < plan.lanes else None
        kit.lanes.append(
            _lane(
                f"east_{k}",
                lane_line(plan.curve, a, b, plan.offset(k), step=4.0),
                limit,
                None if left is None else f"east_{left}",
            )
        )
        kit.lanes.append(
            _lane(
                f"west_{k}",
                lane_line(plan.curve, b, a, plan.offset(-1 - k), step=4.0),
                limit,
                None if left is None else f"west_{left}",
            )
        )
    x, y, _ = plan.curve.point(np.array(plan.bridge), 0.0)
    heading = float(plan.curve.heading(np.array(plan.bridge)))
    along, across = np.array([np.cos(heading), np.sin(heading)]), np.array([-np.sin(heading), np.cos(heading)])
    for name, sign in (("bridge_north", 1.0), ("bridge_south", -1.0)):
        way = np.linspace(-sign * 76.0, sign * 76.0, 39)[:, None]
        points = np.array([x, y]) + sign * 1.8 * along + way * across
        kit.lanes.append(
            _lane(name, np.column_stack([points, np.full(len(points), surface(plan.clearance))]), 13.9, None)
        )


def _lane(name: str, points: Array, speed: float, left: str | None) -> Lane:
    return Lane(name, points, "drive", at.LANE, speed, (), left)


if __name__ == "__main__":
    write_packed(Path(__file__).resolve().parent, build)
