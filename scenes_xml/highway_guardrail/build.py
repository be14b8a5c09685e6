"""Build the scene: ``python -m scenes_xml.highway_guardrail.build`` writes XML, scene.toml, meshes and textures.

Those of variant 0. Everything follows from the numbers in this package and the variant; a second run gives the same
bytes.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..generators.kit import SceneKit
from ..generators.scene_toml import ActorEntry
from ..generators.surfaces import leaves
from ..generators.vehicles.cars import detailed as car
from ..generators.vehicles.cars.shapes import CARS, ROLES
from ..generators.xml import Placement
from ..packing import write_packed
from . import images, roadside, static
from . import layout as at

NAME = "highway_guardrail"
DESCRIPTION = (
    "A two-lane road that bends to the left, a guardrail along its right side, a car ahead that drives away, "
    "an oncoming car, and things beside the road; after Figure 2 of the SCaRL paper."
)
OTHERS = (
    "A two-lane road with a bend, a guardrail along its outside, a vehicle ahead that drives away, an oncoming one, "
    "and things beside the road."
)


def build(folder: Path, variant: int = 0, detail: str = "detailed") -> None:
    """Write a variant of the scene into `folder`, ``detailed`` or ``light``."""
    plan = at.layout(variant)
    table = {
        "name": NAME,
        "title": "Bend with a guardrail",
        "description": OTHERS if variant else DESCRIPTION,
        "license": "Apache-2.0",
        "source": f"built by scenes_xml/{NAME}/build.py",
        "seed": at.SEED + variant,
        "ego": "ego",
    }
    kit = SceneKit(folder, table, detail, at.SEED + variant)
    kit.materials |= leaves.MATERIALS | images.MATERIALS
    kit.textures |= leaves.IMAGES | images.IMAGES
    static.add_road(kit, plan)
    static.add_guardrail(kit, plan)
    roadside.add_everything(kit, plan)
    kit.lanes += at.lanes(plan)
    for actor in plan.actors:
        positions = plan.curve.lane_positions(actor.start, actor.offset, actor.speed, at.TIMES)
        if variant == 0 and not kit.is_light:
            _own_car(kit, plan, actor, positions)
        else:
            kit.actor(actor.name, actor.model, at.TIMES, positions, actor.colours)
    kit.write()


def _own_car(kit: SceneKit, plan: at.Layout, actor: at.ActorPlan, positions: np.ndarray) -> None:
    """Add a car of meshes of the scene's own: the cars that variant 0 has had from its beginning."""
    heading = float(plan.curve.heading(np.array(actor.start))) + (np.pi if actor.speed < 0 else 0.0)
    x, y, z = (float(np.round(v, 6)) for v in positions[0])
    yaw = float(np.round(np.degrees(heading), 6))
    for part, (body, role) in car.build(CARS[actor.name]).items():
        shape = f"{actor.name}_{part}"
        file = kit.writer.mesh(shape, body, 50.0 if role == "paint" else 35.0)
        bsdf = actor.paint if role == "paint" else ROLES[role]
        kit.writer.placements.append(Placement(shape, file, bsdf, yaw, (x, y, z)))
    kit.actors.append(ActorEntry(actor.name, "Car", at.TIMES, positions))


if __name__ == "__main__":
    write_packed(Path(__file__).resolve().parent, build)
