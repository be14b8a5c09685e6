"""Small car, saloon, estate, SUV and pickup."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ..generators.geometry.mesh import Mesh, box, merge
from ..generators.vehicles.cars import detailed, light
from ..generators.vehicles.cars.measures import WHEELS, CarShape, wheel_centre
from ..generators.vehicles.cars.shapes import CARS
from ..generators.vehicles.number_plates import NumberPlates
from ..generators.vehicles.vehicle_parts import bar, car_underbody
from . import materials
from .materials import ROLES, VEHICLE, Color
from .model import Model, Part
from .people import bare, cloth, hair

SHAPES: dict[str, CarShape] = {
    "small_car": CarShape(
        length=3.70, width=1.66, height=1.50, front_axle=1.17, rear_axle=-1.17,
        deck=((-1.85, 0.94), (-1.72, 0.98), (-1.0, 0.98), (0.0, 0.96), (0.75, 0.94), (1.15, 0.88), (1.55, 0.80), (1.85,
        0.72)),
        cabin_base=(-1.77, 1.00), cabin_top=(-1.42, 0.18), cabin_base_width=0.75, cabin_top_width=0.60,
        glazing=((0.05, 0.44), (0.48, 0.86)),
        wheel_radius=0.29, floor=0.17, front_bow=0.22, rear_bow=0.17, tail_slope=0.0, nose_slope=0.11,
        lamp_height=0.69, tail_lamp=(0.70, 0.95),
        extra={"plate_z": 0.60, "tail_lamp_inner": 0.72, "mirror_z": 1.01, "handle_z": 0.83, "roof_sag": 0.06},
    ),
    "saloon": CARS["ego"],
    "estate": CARS["oncoming"],
    "suv": CarShape(
        length=4.60, width=1.88, height=1.69, front_axle=1.38, rear_axle=-1.36,
        deck=((-2.3, 1.06), (-2.15, 1.09), (-1.2, 1.09), (0.0, 1.07), (0.95, 1.05), (1.45, 1.00), (2.0, 0.92), (2.3,
        0.84)),
        cabin_base=(-2.22, 1.16), cabin_top=(-1.92, 0.36), cabin_base_width=0.865, cabin_top_width=0.70,
        glazing=((0.05, 0.34), (0.37, 0.66), (0.70, 0.91)),
        wheel_radius=0.36, floor=0.24, spokes=6, rear_bow=0.17, tail_slope=0.0, lamp_height=0.80, tail_lamp=(0.74,
        1.03), cladding=True,
        extra={"plate_z": 0.76, "tail_lamp_inner": 0.76, "mirror_z": 1.13, "handle_z": 0.92, "roof_sag": 0.045},
    ),
    "pickup": CarShape(
        length=5.33, width=1.90, height=1.80, front_axle=1.66, rear_axle=-1.55,
        deck=((-2.665, 1.10), (-2.5, 1.12), (-1.0, 1.12), (0.3, 1.11), (1.25, 1.09), (1.75, 1.05), (2.3, 0.97), (2.665,
        0.88)),
        cabin_base=(-0.98, 1.40), cabin_top=(-0.86, 0.58), cabin_base_width=0.865, cabin_top_width=0.71,
        glazing=((0.06, 0.46), (0.50, 0.90)),
        wheel_radius=0.385, floor=0.30, spokes=6, front_bow=0.20, rear_bow=0.06, tail_slope=0.0, nose_slope=0.09,
        lamp_height=0.86, tail_lamp=(0.80, 1.06), cladding=True,
        bed=(-2.56, -1.09, 0.84), stations=(-2.56, -1.09, -1.02),
        extra={"plate_z": 0.66, "tail_lamp_inner": 0.83, "mirror_z": 1.17, "handle_z": 0.97, "roof_sag": 0.05,
        "row": 0.60},
    ),
}  # fmt: skip # a table
"""Measures; widths without mirrors."""

INSIDE = {
    "top": cloth((0.03, 0.06, 0.16)), "skin": bare((0.50, 0.31, 0.22)), "hair": hair((0.045, 0.028, 0.018)),
}  # fmt: skip # a table
"""What people inside wear, and their skin and hair."""
OCCUPANTS: dict[str, tuple[str, ...]] = {
    "small_car": ("driver",), "saloon": ("driver",), "suv": ("driver", "beside"),
    "estate": ("driver", "right"), "pickup": ("driver",),
}  # fmt: skip # a table
"""The places that are taken, see `interior.seats`."""
TITLES = {
    "small_car": "Small car", "saloon": "Saloon car", "suv": "Sport utility vehicle", "estate": "Estate car",
    "pickup": "Pickup with two rows of seats and an open bed",
}  # fmt: skip # a table
PAINTS: dict[str, dict[str, Color]] = {
    "small_car": {"yellow": (0.62, 0.36, 0.015), "red": (0.40, 0.014, 0.016), "white": (0.70, 0.70, 0.68),
    "blue": (0.02, 0.12, 0.34), "black": (0.012, 0.012, 0.014)},
    "saloon": {"blue": (0.012, 0.045, 0.16), "silver": (0.27, 0.28, 0.29), "red": (0.36, 0.012, 0.014), "white": (0.70,
    0.70, 0.68), "black": (0.012, 0.012, 0.014)},
    "estate": {"grey": (0.13, 0.14, 0.15), "blue": (0.015, 0.06, 0.20), "green": (0.03, 0.09, 0.055), "white": (0.70,
    0.70, 0.68), "black": (0.012, 0.012, 0.014)},
    "pickup": {"white": (0.70, 0.70, 0.68), "orange": (0.50, 0.12, 0.012), "silver": (0.27, 0.28, 0.29), "green": (0.05,
    0.075, 0.03), "black": (0.012, 0.012, 0.014)},
    "suv": {"grey": (0.13, 0.14, 0.15), "white": (0.70, 0.70, 0.68), "green": (0.02, 0.075, 0.045), "red": (0.30,
    0.012, 0.016), "black": (0.012, 0.012, 0.014)},
}  # fmt: skip # a table
"""The first one is the default."""


def joints(centres: dict[str, tuple[float, float, float]], wheels: dict[str, list[str]]) -> list[dict[str, Any]]:
    """Return wheel joints: name of each wheel -> its centre (the height is the radius) [m] and its shapes.

    Those before the middle steer.
    """
    return [
        {"kind": "wheel", "shapes": wheels[name], "center": centre, "radius": centre[2]}
        | ({"steered": True} if centre[0] > 0.0 else {})
        for name, centre in centres.items()
    ]


def build(name: str) -> Model:
    """Return the model of a car."""
    shape = SHAPES[name]
    under = car_underbody(shape.front_axle, shape.rear_axle, shape.width, shape.length, shape.floor, shape.wheel_radius)
    fine = {
        part: Part(replace(mesh, uv=None), ROLES[role], 50.0 if role == "paint" else 35.0)
        for part, (mesh, role) in detailed.build(shape, True, True, OCCUPANTS[name]).items()
    }
    plates = NumberPlates(shape.length / 2, 0.475, shape.extra["plate_z"], 0.04, 3)
    fine |= {part: Part(mesh, ROLES[role]) for part, (mesh, role) in plates.parts().items()}
    fine["underbody"] = Part(merge(list(under.values())), "underbody_steel")
    fine |= _extras(shape, name, fine)
    coarse = {part: Part(mesh, ROLES[role], 40.0) for part, (mesh, role) in light.build(shape).items()}
    coarse |= {part: Part(mesh, ROLES[role]) for part, (mesh, role) in plates.parts(fine=False).items()}
    coarse["underbody"] = Part(under["floor"], "underbody_steel")
    centres = {wheel: wheel_centre(shape, wheel) for wheel in WHEELS}
    wheels = {wheel: [f"wheel_{wheel}_tyre", f"wheel_{wheel}_rim"] for wheel in WHEELS}
    head = {
        "name": name,
        "title": TITLES[name],
        "class": "Car",
        "motion": "vehicle",
        "length": shape.length,
        "width": shape.width,
        "height": shape.height,
        "wheelbase": shape.front_axle - shape.rear_axle,
        "rear_axle": shape.rear_axle,
        "ego_mount": shape.length <= 4.6,
        "occupants": [part for part in fine if part.startswith("people_")],
    }
    default = next(iter(PAINTS[name].values()))
    bsdfs = {"paint": materials.paint(default), **VEHICLE, **INSIDE}
    variants = {variant: {"paint": color} for variant, color in PAINTS[name].items()}
    return Model(head, fine, coarse, bsdfs, variants, joints(centres, wheels))


def _extras(shape: CarShape, name: str, parts: dict[str, Part]) -> dict[str, Part]:
    """Return mirror glass, and the roof rails of the SUV."""
    mirrors = parts["mirrors"].mesh.vertices
    reach, rear = np.abs(mirrors[:, 1]).max(), mirrors[:, 0].min()
    low = np.abs(mirrors[:, 1]) > shape.cabin_base_width + 0.02
    z = 0.5 * (mirrors[low, 2].min() + mirrors[low, 2].max())
    y = 0.5 * (reach + shape.cabin_base_width + 0.02)
    glass = box((0.008, reach - shape.cabin_base_width - 0.07, 0.10), (rear + 0.004, y, z))
    found = {"mirror_glass": Part(merge([glass, glass.mirrored_y()]), "mirror_silver")}
    if name == "suv":
        found["rails"] = Part(_rails(shape), "bright_metal")
    return found


def _rails(shape: CarShape) -> Mesh:
    rear, front = shape.cabin_top
    y, z = 0.86 * shape.cabin_top_width, shape.height - 0.028
    middle = 0.5 * (rear + front)
    ends = (rear + 0.30, front - 0.30)
    parts = [bar((ends[0], y, z), (ends[1], y, z), 0.018, 8)]
    parts += [bar((x, y, z), (x + (0.05 if x < middle else -0.05), y, z - 0.10), 0.02, 6) for x in ends]
    left = merge(parts)
    return merge([left, left.mirrored_y()])
