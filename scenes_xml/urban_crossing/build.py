"""Build the scene: ``python -m scenes_xml.urban_crossing.build`` writes XML, scene.toml, meshes and textures.

Those of variant 0. Everything follows from the numbers in this package and the variant; a second run gives the same
bytes.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..generators.kit import SceneKit
from ..generators.scene_toml import ActorEntry
from ..generators.surfaces import leaves, urban
from ..generators.vehicles.cars import detailed as car
from ..generators.vehicles.cars.measures import WHEELS, wheel_centre
from ..generators.vehicles.cars.shapes import CARS as SHAPES
from ..generators.vehicles.cars.shapes import ROLES
from ..generators.xml import Placement
from ..packing import write_packed
from . import images, static, things, years
from . import layout as at

NAME = "urban_crossing"
DESCRIPTION = (
    "A straight town street between houses, parked cars at its right kerb, a zebra crossing on which people walk, an "
    "oncoming car, a car ahead that drives away; the ego car brakes for people who step out from behind a parked car."
)


def build(folder: Path, variant: int = 0, detail: str = "detailed") -> None:
    """Write a variant of the scene into `folder`, ``detailed`` or ``light``."""
    plan = at.layout(variant)
    table = {
        "name": NAME,
        "title": "Zebra crossing in a town street",
        "description": DESCRIPTION,
        "license": "Apache-2.0",
        "source": f"built by scenes_xml/{NAME}/build.py",
        "seed": plan.seed,
        "ego": "ego",
    }
    kit = SceneKit(folder, table, detail, plan.seed)
    kit.materials |= urban.MATERIALS | leaves.MATERIALS
    kit.textures |= urban.IMAGES | leaves.IMAGES | images.IMAGES
    static.add_street(kit, plan)
    things.add_houses(kit, plan)
    things.add_furniture(kit, plan)
    things.add_trees(kit, plan)
    if variant:
        years.add_years(kit, plan)
    kit.lanes += at.lanes(plan)
    kit.parking += at.parking(plan)
    if variant == 0 and not kit.is_light:
        _own_parked(kit, plan)
        _own_cars(kit, plan)
    else:
        _cars(kit, plan)
    _walkers(kit, plan)
    kit.write()


def _cars(kit: SceneKit, plan: at.Layout) -> None:
    """Add cars by the names of their models."""
    for car_plan in plan.cars:
        x = car_plan.x
        positions = np.stack([x, np.full_like(x, car_plan.y), 0.0 * x], 1)
        yaw = np.full_like(x, car_plan.yaw_deg)
        kit.actor(car_plan.name, car_plan.model, at.TIMES, positions, car_plan.colours, yaw)
    for parked in plan.parked:
        place = np.array([(parked.x[0], parked.y, 0.0)])
        kit.actor(parked.name, parked.model, np.zeros(1), place, parked.colours, np.zeros(1))


def _walkers(kit: SceneKit, plan: at.Layout) -> None:
    """Add people by the names of their models; where the ground slopes below their feet with points close together."""
    close = np.linspace(at.TIMES[0], at.TIMES[-1], 10 * (len(at.TIMES) - 1) + 1)
    for walker in plan.walkers:
        times = at.TIMES if walker.velocity[0] else close
        yaw = np.full(len(times), np.degrees(np.arctan2(walker.velocity[1], walker.velocity[0])))
        positions = at.walker_positions(walker, times)
        kit.actors.append(
            ActorEntry(
                walker.name, "", times, positions, yaw, model=walker.model, variant=walker.colours, phase=walker.phase
            )
        )


def _car_files(kit: SceneKit, kind: str, turning: bool) -> dict[str, tuple[str, str]]:
    """Return file and role of each part of a car."""
    prefix = f"car_{kind}_{'turning' if turning else 'parked'}"
    parts = car.build(SHAPES[kind], turning_wheels=turning)
    return {
        part: (kit.writer.mesh(f"{prefix}_{part}", body, 50.0 if role == "paint" else 35.0), role)
        for part, (body, role) in parts.items()
    }


def _own_parked(kit: SceneKit, plan: at.Layout) -> None:
    """Add the cars at the kerb, of meshes of the scene's own: those that variant 0 has had from its beginning."""
    files = {kind: _car_files(kit, kind, False) for kind in sorted({parked.shape for parked in plan.parked})}
    for parked in plan.parked:
        half = SHAPES[parked.shape].width / 2
        where = (float(parked.x[0]), round(at.KERB_RIGHT + 0.15 + half, 3), 0.0)
        for part, (file, role) in files[parked.shape].items():
            bsdf = parked.paint if role == "paint" else ROLES[role]
            kit.writer.placements.append(Placement(f"{parked.name}_{part}", file, bsdf, 0.0, where))
        kit.instance(parked.name, "Car", is_object=True)


def _own_cars(kit: SceneKit, plan: at.Layout) -> None:
    for car_plan in plan.cars:
        shape, x = SHAPES[car_plan.shape], car_plan.x
        where = (float(x[0]), car_plan.y, 0.0)
        for part, (file, role) in _car_files(kit, car_plan.shape, True).items():
            bsdf = car_plan.paint if role == "paint" else ROLES[role]
            kit.writer.placements.append(Placement(f"{car_plan.name}_{part}", file, bsdf, car_plan.yaw_deg, where))
        joints = [
            {
                "kind": "wheel",
                "shapes": [f"{car_plan.name}_wheel_{wheel}_{part}" for part in ("tyre", "rim")],
                "center": wheel_centre(shape, wheel),
                "radius": shape.wheel_radius,
            }
            for wheel in WHEELS
        ]
        positions = np.stack([x, np.full_like(x, car_plan.y), 0.0 * x], 1)
        yaw = np.full_like(x, car_plan.yaw_deg)
        kit.actors.append(ActorEntry(car_plan.name, "Car", at.TIMES, positions, yaw, joints))


if __name__ == "__main__":
    write_packed(Path(__file__).resolve().parent, build)
