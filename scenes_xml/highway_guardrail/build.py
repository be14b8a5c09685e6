"""Build the scene: ``python -m scenes_xml.highway_guardrail.build`` writes the XML, meshes, textures and scene.toml.

Everything follows from the numbers in this package and `SEED`; a second run gives the same bytes.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..generators import car, mesh
from ..generators.mesh import Mesh
from ..generators.scene_toml import ActorEntry, Instance, scene_toml
from ..generators.xml import Placement, scene_xml
from . import images, roadside, static
from .cars import CARS
from .layout import ACTORS, CURVE, SEED, TIMES
from .materials import MATERIALS

NAME = "highway_guardrail"
TABLE = {
    "name": NAME,
    "title": "Bend with a guardrail",
    "description": (
        "A two-lane road that bends to the left, a guardrail along its right side, a car ahead that drives away, an oncoming "
        "car, and things beside the road; after Figure 2 of the SCaRL paper."
    ),
    "license": "Apache-2.0",
    "source": f"built by scenes_xml/{NAME}/build.py",
    "seed": SEED,
    "ego": "ego",
}

HEAD = (
    '\t<integrator type="path">\n\t\t<integer name="max_depth" value="6"/>\n\t</integrator>',
    '\t<sensor type="perspective" id="front_view">\n'
    '\t\t<float name="fov" value="90"/>\n\t\t<string name="fov_axis" value="x"/>\n'
    '\t\t<float name="near_clip" value="0.05"/>\n\t\t<float name="far_clip" value="10000"/>\n'
    '\t\t<transform name="to_world">\n\t\t\t<lookat origin="2.35, 0, 0.8" target="12.35, 0, 0.8" up="0, 0, 1"/>\n'
    "\t\t</transform>\n"
    '\t\t<sampler type="independent">\n\t\t\t<integer name="sample_count" value="64"/>\n\t\t</sampler>\n'
    '\t\t<film type="hdrfilm">\n\t\t\t<integer name="width" value="960"/>\n\t\t\t<integer name="height" value="540"/>\n'
    '\t\t\t<rfilter type="gaussian"/>\n\t\t</film>\n\t</sensor>',
    '\t<emitter type="sunsky" id="sky">\n\t\t<vector name="sun_direction" x="-0.42" y="0.70" z="0.58"/>\n'
    '\t\t<float name="turbidity" value="3.2"/>\n\t\t<float name="albedo" value="0.2"/>\n'
    '\t\t<float name="sun_scale" value="2"/>\n\t\t<float name="sky_scale" value="2"/>\n\t</emitter>',
)
"""Integrator, default view (front sensor of the ego car at t = 0) and sky."""

ROLES = {
    "glass": "car_glass", "trim": "car_trim", "tyre": "tyre_rubber", "rim": "wheel_rim", "headlamp": "headlamp",
    "taillamp": "taillamp", "chrome": "chrome", "plate": "number_plate",
}  # fmt: skip

GROUND = (
    Instance("road", "Roads", ("road_asphalt",), False),
    Instance("lane_markings", "RoadLine", ("marking_*",), False),
    Instance("gravel_verges", "Terrain", ("gravel_*",), False),
    Instance("terrain", "Terrain", ("terrain_*",), False),
    Instance("guardrail_right", "GuardRail", ("guardrail_*",), True),
)


class Writer:
    """Collects shapes and writes each mesh once."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.placements: list[Placement] = []
        (folder / "meshes").mkdir(parents=True, exist_ok=True)
        (folder / "textures").mkdir(exist_ok=True)

    def mesh(self, name: str, part: Mesh, crease_deg: float = 35.0) -> str:
        """Write a mesh and return its file name."""
        mesh.write_ply(mesh.finish(part, crease_deg), self.folder / "meshes" / f"{name}.ply")
        return f"{name}.ply"

    def add(self, shape: str, part: Mesh, bsdf: str, crease_deg: float = 35.0) -> None:
        """Write a mesh in world coordinates and add it as a shape."""
        self.placements.append(Placement(shape, self.mesh(shape, part, crease_deg), bsdf))


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


def build(folder: Path) -> None:
    """Write the whole scene into `folder`."""
    writer = Writer(folder)
    for old in (folder / "meshes").glob("*.ply"):
        old.unlink()
    images.write(folder / "textures", SEED)
    instances = list(GROUND)
    static.add_road(writer.add)
    static.add_guardrail(writer.add)
    for shapes, found in roadside.everything(writer.mesh):
        writer.placements += shapes
        instances.append(found)
    actors = _add_actors(writer)
    used = {p.bsdf for p in writer.placements}
    bsdfs = {name: bsdf for name, bsdf in MATERIALS.items() if name in used}
    comment = f"{NAME}: written by scenes_xml/{NAME}/build.py; do not edit"
    (folder / f"{NAME}.xml").write_text(scene_xml(comment, HEAD, bsdfs, writer.placements), encoding="utf-8")
    (folder / "scene.toml").write_text(scene_toml(TABLE, bsdfs, instances, actors), encoding="utf-8")


if __name__ == "__main__":
    build(Path(__file__).resolve().parent)
