"""Build the scene: ``python -m scenes_xml.parking_garage.build`` writes the XML, scene.toml and packed files.

Those of variant 0.

Everything follows from the numbers in this package and the variant's number; a second run gives the same bytes.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from ..generators.geometry.mesh import Array
from ..generators.kit import SceneKit
from ..generators.scene_toml import Lane, Parking
from ..generators.surfaces import interior
from ..packing import write_packed
from . import layout as at
from . import static

NAME = "parking_garage"
DESCRIPTION = (
    "A level of an underground car park: columns, beams, ducts and pipes under a low ceiling, "
    "bays with parked cars, a one-way loop, "
    "ramps to the street, people on foot and a car that backs out. Floor, ceiling, "
    "walls and columns make strong multipath."
)
BEND = 4.0
"""Radius of the loop's corners [m]."""


def build(folder: Path, variant: int = 0, detail: str = "detailed") -> None:
    """Write a variant of the scene into `folder`, ``detailed`` or ``light``."""
    plan = at.layout(variant)
    table = {
        "name": NAME,
        "title": "Underground car park",
        "description": DESCRIPTION,
        "license": "Apache-2.0",
        "source": f"built by scenes_xml/{NAME}/build.py",
        "seed": at.SEED,
        "ego": "ego",
        "variant": variant,
        "detail": detail,
        "enclosed": True,
        "exposure": 600.0,
    }
    kit = SceneKit(folder, table, detail, at.SEED + variant)
    kit.materials |= interior.MATERIALS
    for name in ("line_white", "line_yellow"):  # floors are painted without beads
        kit.materials[name] = replace(interior.MATERIALS[name], retroreflected_luminance=0.0)
    kit.textures |= interior.IMAGES
    tint = np.array(plan.tint)
    kit.textures["garage_concrete.png"] = lambda seed: interior.garage_concrete(seed) * tint
    static.add_hall(kit, plan)
    static.add_markings(kit, plan)
    static.add_ramps(kit, plan)
    static.add_core(kit, plan)
    static.add_services(kit, plan)
    _lanes(kit, plan)
    _parked(kit, plan)
    _moving(kit, plan)
    kit.write()


def _arc(centre: tuple[float, float], start_deg: float) -> Array:
    """Return a quarter of a turn to the left, points about 0.5 m apart."""
    angle = np.radians(start_deg + np.linspace(0.0, 90.0, 13))
    return np.column_stack([centre[0] + BEND * np.cos(angle), centre[1] + BEND * np.sin(angle), np.zeros(13)])


def _line(a: tuple[float, float], b: tuple[float, float]) -> Array:
    n = max(2, int(np.hypot(b[0] - a[0], b[1] - a[1]) / 2.0) + 1)
    return np.column_stack([np.linspace(a[0], b[0], n), np.linspace(a[1], b[1], n), np.zeros(n)])


def _lanes(kit: SceneKit, plan: at.Layout) -> None:
    """Add the loop, the ramps and the ways on foot."""
    x = plan.wall_x - at.CROSS / 2  # middle of the cross aisles
    a, y, c = x - BEND, at.AISLE, at.AISLE - BEND
    speed = 2.8
    u = np.linspace(0.0, at.RAMP_LENGTH, 31)
    heights = at.ramp_height(u, plan.level)
    level = np.linspace(0.0, 20.0, 11)[1:]
    out = np.concatenate(
        [
            _line((a, -y), (plan.wall_x, -y))[:-1],
            np.column_stack([plan.wall_x + u, np.full(31, -y), heights]),
            np.column_stack([plan.wall_x + at.RAMP_LENGTH + level, np.full(10, -y), np.full(10, plan.level)]),
        ]
    )
    kit.lanes += [
        Lane("aisle_right", _line((-a, -y), (a, -y)), "drive", 3.5, speed, ("corner_east_right", "ramp_out")),
        Lane("corner_east_right", _arc((a, -c), -90.0), "drive", 3.5, speed, ("cross_east",)),
        Lane("cross_east", _line((x, -c), (x, c)), "drive", 3.5, speed, ("corner_east_left",)),
        Lane("corner_east_left", _arc((a, c), 0.0), "drive", 3.5, speed, ("aisle_left",), yield_to=("ramp_in",)),
        Lane("aisle_left", _line((a, y), (-a, y)), "drive", 3.5, speed, ("corner_west_left",)),
        Lane("corner_west_left", _arc((-a, c), 90.0), "drive", 3.5, speed, ("cross_west",)),
        Lane("cross_west", _line((-x, c), (-x, -c)), "drive", 3.5, speed, ("corner_west_right",)),
        Lane("corner_west_right", _arc((-a, -c), 180.0), "drive", 3.5, speed, ("aisle_right",)),
        Lane("ramp_out", out, "drive", 3.0, speed),
        Lane("ramp_in", (out * [1.0, -1.0, 1.0])[::-1], "drive", 3.0, speed, ("aisle_left",)),
        Lane("walk_right", _line((plan.core[1] + 1.0, -5.5), (a, -5.5)), "walk", 1.0, 1.4),
        Lane("walk_left", _line((a, 5.5), (plan.core[1] + 1.0, 5.5)), "walk", 1.0, 1.4),
    ]
    kit.parking += [Parking((bay.x, bay.y, 0.0), bay.yaw_deg, at.BAY_DEPTH, at.BAY - 0.2) for bay in plan.free]


def _parked(kit: SceneKit, plan: at.Layout) -> None:
    for number, (bay, model, colour, nose) in enumerate(plan.parked):
        yaw = bay.yaw_deg if nose else bay.yaw_deg + 180.0
        colour_name = COLOURS[model][colour]
        there = np.array([(bay.x, bay.y, 0.0)])
        kit.actor(f"parked_{number:02d}", model, np.zeros(1), there, colour_name, np.array([yaw]), detail="light")


COLOURS = {
    "small_car": ("yellow", "white", "blue", "red"), "saloon": ("silver", "white", "black", "red"), "suv": ("grey",
    "white", "green", "black"),
}  # fmt: skip # a table
"""Colour variants of the actor models by their name."""


def _moving(kit: SceneKit, plan: at.Layout) -> None:
    """Add the ego, two cars in the aisles, one that backs out of its bay, and people."""
    t, y = at.TIMES, -at.AISLE
    n, flat = len(t), np.zeros(len(at.TIMES))

    def along(x: float, speed: float, where: float) -> Array:
        return np.column_stack([x + speed * t, np.full(n, where), flat])

    kit.actor("ego", "saloon", t, along(-24.0, plan.ego_speed, y))
    kit.actor("car_ahead", "suv", t, along(-8.0 + plan.shift, 2.5, y))
    kit.actor("car_opposite", "saloon", t, along(19.0 + plan.shift, -2.4, -y), "red")
    v = np.clip((t - 1.0) / 7.0, 0.0, 1.0)
    back = 3.0 * v**3 * (10.0 - 15.0 * v + 6.0 * v * v)
    kit.actor(
        "backing_car",
        "small_car",
        t,
        np.column_stack([np.full(n, 8.85), -13.4 + 0.5 * back, flat]),
        None,
        np.full(n, -90.0),
    )
    kit.actor("woman", "adult_woman", t, np.column_stack([np.full(n, 17.2), -3.6 - 1.15 * t, flat]))
    kit.actor("man", "adult_man", t, along(7.0 + plan.shift, -1.25, -5.75))
    kit.actor("child", "child", t, along(7.3 + plan.shift, -1.25, -5.2))
    where = (0.5 * sum(plan.core) - 1.6, -5.25, 0.0)
    kit.actor("standing", "standing_adult", t[[0, -1]], np.tile([where], (2, 1)), None, np.full(2, 90.0))


if __name__ == "__main__":
    write_packed(Path(__file__).resolve().parent, build)
