"""Build the scene: ``python -m scenes_xml.highway_guardrail.build`` writes XML, scene.toml, meshes and textures.

Everything follows from the numbers in this package and `SEED`; a second run gives the same bytes.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..generators import kit
from ..generators.kit import Writer
from ..generators.scene_toml import ActorEntry, Instance, scene_toml
from ..generators.surfaces.images import save
from ..generators.surfaces.palette import PALETTE
from ..generators.vehicles.cars import detailed as car
from ..generators.vehicles.cars.shapes import CARS, ROLES
from ..generators.xml import Placement, scene_xml
from ..packing import write_packed
from . import images, roadside, static
from .layout import ACTORS, CURVE, SEED, TIMES, lanes

NAME = "highway_guardrail"
TABLE = {
    "name": NAME,
    "title": "Bend with a guardrail",
    "description": (
        "A two-lane road that bends to the left, a guardrail along its right side, a car ahead that drives away, "
        "an oncoming "
        "car, and things beside the road; after Figure 2 of the SCaRL paper."
    ),
    "license": "Apache-2.0",
    "source": f"built by scenes_xml/{NAME}/build.py",
    "seed": SEED,
    "ego": "ego",
}

GROUND = (
    Instance("road", "Roads", ("road_asphalt",), False),
    Instance("lane_markings", "RoadLine", ("marking_*",), False),
    Instance("gravel_verges", "Terrain", ("gravel_*",), False),
    Instance("terrain", "Terrain", ("terrain_*",), False),
    Instance("guardrail_right", "GuardRail", ("guardrail_*",), True),
)


def _add_actors(writer: Writer) -> list[ActorEntry]:
    actors = []
    for actor in ACTORS:
        path = CURVE.lane_positions(actor.start, actor.offset, actor.speed, TIMES)
        actors.append(ActorEntry(actor.name, "Car", TIMES, path))
        heading = float(CURVE.heading(np.array(actor.start))) + (np.pi if actor.speed < 0 else 0.0)
        x, y, z = (float(np.round(v, 6)) for v in path[0])
        yaw = float(np.round(np.degrees(heading), 6))
        for part, (body, role) in car.build(CARS[actor.name]).items():
            shape = f"{actor.name}_{part}"
            crease = 50.0 if role == "paint" else 35.0
            file = writer.mesh(shape, body, crease)
            bsdf = actor.paint if role == "paint" else ROLES[role]
            writer.placements.append(Placement(shape, file, bsdf, yaw, (x, y, z)))
    return actors


def build(folder: Path, variant: int = 0, detail: str = "detailed") -> None:
    """Write the whole scene into `folder`; it comes in one variant and one level of geometry."""
    kit.only_one(NAME, variant, detail)
    writer = Writer(folder)
    instances = list(GROUND)
    static.add_road(writer.add)
    static.add_guardrail(writer.add)
    for shapes, found in roadside.everything(writer.mesh):
        writer.placements += shapes
        instances.append(found)
    actors = _add_actors(writer)
    used = {p.bsdf for p in writer.placements}
    bsdfs = {name: bsdf for name, bsdf in PALETTE.items() if name in used}
    for file in {name for b in bsdfs.values() for name in (b.texture, b.puddles) if name}:
        save(folder / "textures" / file, images.IMAGES[file](SEED))
    comment = f"{NAME}: written by scenes_xml/{NAME}/build.py; do not edit"
    (folder / f"{NAME}.xml").write_text(scene_xml(comment, kit.head(), bsdfs, writer.placements), encoding="utf-8")
    (folder / "scene.toml").write_text(scene_toml(TABLE, bsdfs, instances, actors, lanes=lanes()), encoding="utf-8")


if __name__ == "__main__":
    write_packed(Path(__file__).resolve().parent, build)
