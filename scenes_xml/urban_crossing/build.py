"""Build the scene: ``python -m scenes_xml.urban_crossing.build`` writes XML, scene.toml, meshes and textures.

Everything follows from the numbers in this package and `SEED`; a second run gives the same bytes.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ..generators import kit
from ..generators.geometry.mesh import Mesh
from ..generators.kit import Writer
from ..generators.people import pedestrian
from ..generators.plants import vegetation
from ..generators.roadside import furniture
from ..generators.scene_toml import ActorEntry, Instance, scene_toml
from ..generators.surfaces.images import save
from ..generators.surfaces.palette import PALETTE
from ..generators.vehicles.cars import detailed as car
from ..generators.vehicles.cars.measures import WHEELS, wheel_centre
from ..generators.vehicles.cars.shapes import CARS as SHAPES
from ..generators.vehicles.cars.shapes import ROLES
from ..generators.xml import Placement, scene_xml
from ..packing import write_packed
from . import images, static
from . import layout as at

NAME = "urban_crossing"
TABLE = {
    "name": NAME,
    "title": "Zebra crossing in a town street",
    "description": (
        "A straight town street between houses, parked cars at its right kerb, "
        "a zebra crossing on which people walk, an "
        "oncoming car, a car ahead that drives away; "
        "the ego car brakes for people who step out from behind a parked car."
    ),
    "license": "Apache-2.0",
    "source": f"built by scenes_xml/{NAME}/build.py",
    "seed": at.SEED,
    "ego": "ego",
}
GROUND = (
    Instance("road", "Roads", ("road_asphalt",), False),
    Instance("road_markings", "RoadLine", ("marking_*",), False),
    Instance("pavements", "SideWalks", ("pavement_*", "kerb_*"), False),
    Instance("ground_far", "Ground", ("ground_far",), False),
)


def build(folder: Path, variant: int = 0, detail: str = "detailed") -> None:
    """Write the whole scene into `folder`; it comes in one variant and one level of geometry."""
    kit.only_one(NAME, variant, detail)
    writer = Writer(folder)
    static.add_street(writer.add)
    instances = [*GROUND]
    for group in (_houses(writer), _furniture(writer), _trees(writer), _parked(writer)):
        instances += list(group)
    actors = [*_cars(writer), *_walkers(writer)]
    used = {placement.bsdf for placement in writer.placements}
    bsdfs = {name: bsdf for name, bsdf in PALETTE.items() if name in used}
    for file in {name for b in bsdfs.values() for name in (b.texture, b.puddles) if name}:
        save(folder / "textures" / file, images.IMAGES[file](at.SEED))
    comment = f"{NAME}: written by scenes_xml/{NAME}/build.py; do not edit"
    (folder / f"{NAME}.xml").write_text(scene_xml(comment, kit.head(), bsdfs, writer.placements), encoding="utf-8")
    (folder / "scene.toml").write_text(scene_toml(TABLE, bsdfs, instances, actors, lanes=at.lanes()), encoding="utf-8")


def _place(
    writer: Writer,
    files: dict[str, str],
    bsdfs: dict[str, str],
    name: str,
    semantic: str,
    yaw: float,
    where: tuple[float, float, float],
    scale: float = 1.0,
) -> Instance:
    writer.placements += [
        Placement(f"{name}_{part}", file, bsdfs[part], yaw, where, scale) for part, file in files.items()
    ]
    return Instance(name, semantic, (f"{name}_*",), True)


def _files(writer: Writer, prefix: str, parts: dict[str, Mesh], crease: float = 40.0) -> dict[str, str]:
    return {part: writer.mesh(f"{prefix}_{part}", body, crease) for part, body in parts.items()}


def _houses(writer: Writer) -> Iterator[Instance]:
    bsdfs = {"roof": "roof_tile", "frames": "painted_wood", "panes": "window_pane", "doors": "door_wood"}
    for name, parts, walls, turn, where in static.houses():
        yield _place(writer, _files(writer, name, parts), {**bsdfs, "walls": walls}, name, "Building", turn, where)


def _furniture(writer: Writer) -> Iterator[Instance]:
    metal = {"back": "sign_back", "pole": "galvanized_steel"}
    pavement = at.KERB_HEIGHT
    lamp = _files(writer, "lamp", furniture.street_lamp())
    glass = {"pole": "black_plastic", "head": "black_plastic", "glass": "lamp_glass"}
    for number, x in enumerate(np.arange(-40.0, 121.0, 26.0)):
        for side, y in (("left", at.KERB_LEFT + 0.55), ("right", at.KERB_RIGHT - 0.55)):
            shift = 0.0 if side == "left" else 11.0
            yield _place(writer, lamp, glass, f"lamp_{side}_{number}", "Pole", 0.0, (float(x + shift), y, pavement))
    sign = _files(writer, "sign_square", furniture.sign("square", 2.3))
    for name, x, y, yaw in (("sign_crossing_right", 18.4, -4.5, 0.0), ("sign_crossing_left", 25.6, 5.5, 180.0)):
        yield _place(writer, sign, {"face": "sign_crossing", **metal}, name, "TrafficSign", yaw, (x, y, pavement))
    bollard = _files(writer, "bollard", {"steel": furniture.bollard()})
    places = [(x, y) for x in (17.6, 19.0, 25.0, 26.4) for y in (at.KERB_LEFT + 0.4, at.KERB_RIGHT - 0.4)]
    for number, (x, y) in enumerate(places):
        yield _place(writer, bollard, {"steel": "galvanized_steel"}, f"bollard_{number}", "Pole", 0.0, (x, y, pavement))
    bench = _files(writer, "bench", furniture.bench())
    for number, (x, y, yaw) in enumerate(((10.0, -6.9, 0.0), (31.0, 7.9, 180.0), (44.0, -6.9, 0.0))):
        bsdfs = {"wood": "door_wood", "frame": "black_plastic"}
        yield _place(writer, bench, bsdfs, f"bench_{number}", "Static", yaw, (x, y, pavement))


def _trees(writer: Writer) -> Iterator[Instance]:
    bsdfs = {"trunk": "bark", "core": "leaves_shade", "leaves": "leaves"}
    shape = vegetation.TreeShape(6.6, 1.9, 2.7, 0.11, 12, 2600)
    files = _files(writer, "tree", vegetation.tree(shape, at.SEED + 3), 60.0)
    for number, x in enumerate((-25.0, -8.0, 8.0, 33.5, 48.0, 63.0, 78.0, 93.0)):
        where = (x, at.KERB_LEFT + 0.9, at.KERB_HEIGHT)
        yield _place(
            writer, files, bsdfs, f"tree_{number}", "Vegetation", 37.0 * number, where, 0.9 + 0.05 * (number % 4)
        )


def _car_files(writer: Writer, kind: str, turning: bool) -> dict[str, tuple[str, str]]:
    """Return file and role of each part of a car."""
    prefix = f"car_{kind}_{'turning' if turning else 'parked'}"
    parts = car.build(SHAPES[kind], turning_wheels=turning)
    return {
        part: (writer.mesh(f"{prefix}_{part}", body, 50.0 if role == "paint" else 35.0), role)
        for part, (body, role) in parts.items()
    }


def _parked(writer: Writer) -> Iterator[Instance]:
    files = {kind: _car_files(writer, kind, False) for kind in sorted({kind for _, kind, _, _ in at.PARKED})}
    for name, kind, x, paint in at.PARKED:
        half = SHAPES[kind].width / 2
        where = (x, round(at.KERB_RIGHT + 0.15 + half, 3), 0.0)
        for part, (file, role) in files[kind].items():
            writer.placements.append(
                Placement(f"{name}_{part}", file, paint if role == "paint" else ROLES[role], 0.0, where)
            )
        yield Instance(name, "Car", (f"{name}_*",), True)


def _cars(writer: Writer) -> Iterator[ActorEntry]:
    for plan in at.CARS:
        shape = SHAPES[plan.shape]
        where = (float(plan.x[0]), plan.y, 0.0)
        for part, (file, role) in _car_files(writer, plan.shape, True).items():
            bsdf = plan.paint if role == "paint" else ROLES[role]
            writer.placements.append(Placement(f"{plan.name}_{part}", file, bsdf, plan.yaw_deg, where))
        joints = [
            {
                "kind": "wheel",
                "shapes": [f"{plan.name}_wheel_{wheel}_{part}" for part in ("tyre", "rim")],
                "center": wheel_centre(shape, wheel),
                "radius": shape.wheel_radius,
            }
            for wheel in WHEELS
        ]
        positions = np.stack([plan.x, np.full_like(plan.x, plan.y), 0.0 * plan.x], 1)
        yield ActorEntry(plan.name, "Car", at.TIMES, positions, np.full_like(plan.x, plan.yaw_deg), joints)


def _walkers(writer: Writer) -> Iterator[ActorEntry]:
    for plan in at.WALKERS:
        positions = at.walker_positions(plan)
        yaw = float(np.degrees(np.arctan2(plan.velocity[1], plan.velocity[0])))
        where = (float(positions[0, 0]), float(positions[0, 1]), float(positions[0, 2]))
        roles = dict(zip(("top", "trousers", "shoes"), plan.clothes, strict=True)) | {"skin": "skin", "hair": "hair"}
        for part, (body, role) in pedestrian.body(plan.body).items():
            shape = f"{plan.name}_{part}"
            writer.placements.append(Placement(shape, writer.mesh(shape, body, 70.0), roles[role], yaw, where))
        joint = {"kind": "walk", "height": plan.body.height, "phase": plan.phase}
        yield ActorEntry(plan.name, "Pedestrian", at.TIMES, positions, np.full(len(at.TIMES), yaw), [joint])


if __name__ == "__main__":
    write_packed(Path(__file__).resolve().parent, build)
