"""Vans, lorry, bus, coach and tram."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from ..generators.geometry.mesh import Mesh
from ..generators.vehicles import articulated, box_van, bus, lorry, tram, van
from ..generators.vehicles.vehicle_parts import one_side
from . import materials
from .cars import INSIDE, joints
from .materials import ROLES, VEHICLE, Color
from .model import Model, Part

WHITE: Color = (0.70, 0.70, 0.68)
LOADED = {
    "box_panel": replace(
        materials.paint(WHITE), radio="metal", lidar_reflectance=0.55, source="estimate, painted aluminium panel"
    ),
    "frame_aluminium": replace(
        VEHICLE["wheel_rim"], color=(0.50, 0.51, 0.52), source="estimate, bare aluminium profiles"
    ),
    "contour_marking": replace(
        VEHICLE["number_plate"],
        color=(0.68, 0.46, 0.02),
        source="estimate, retroreflective tape, UN Regulation 104 class C",
        retroreflection=300.0,
    ),
    "chassis_steel": replace(
        VEHICLE["underbody_steel"], color=(0.03, 0.03, 0.032), source="estimate, painted steel frame"
    ),
}
"""What vehicles with a load box have beside `VEHICLE`."""
OCCUPANTS = ["people_clothes", "people_skin", "people_hair"]
"""Shapes of who sits inside at the detailed level."""


def _parts(found: dict[str, tuple[Mesh, str]]) -> dict[str, Part]:
    parts = {}
    for name, (mesh, role) in found.items():
        sides = {"": mesh} if role != "indicator" else {"_left": one_side(mesh, 1.0), "_right": one_side(mesh, -1.0)}
        for side, own in sides.items():
            parts[name + side] = Part(replace(own, uv=None), ROLES.get(role, role), 45.0 if role == "paint" else 35.0)
    return parts


def _wheel_joints(centres: dict[str, tuple[float, float, float]]) -> list[dict[str, Any]]:
    return joints(centres, {name: [f"wheel_{name}_tyre", f"wheel_{name}_rim"] for name in centres})


def _head(
    name: str, title: str, semantic: str, size: tuple[float, float, float], axles: tuple[float, float]
) -> dict[str, Any]:
    return {
        "name": name,
        "title": title,
        "class": semantic,
        "motion": "vehicle",
        "length": size[0],
        "width": size[1],
        "height": size[2],
        "wheelbase": axles[0] - axles[1],
        "rear_axle": axles[1],
        "ego_mount": False,
    }


def make_van() -> Model:
    """Return the panel van."""
    colors: dict[str, Color] = {
        "white": WHITE, "silver": (0.42, 0.43, 0.44), "yellow": (0.66, 0.40, 0.01), "blue": (0.015, 0.07, 0.24),
        "red": (0.36, 0.014, 0.016),
    }  # fmt: skip # a table
    axles = (van.FRONT_AXLE, van.REAR_AXLE)
    y = van.OUTER - van.WHEEL.tyre_width / 2
    centres = {name: (x, y if left else -y, van.WHEEL.radius) for name, (x, left) in van.WHEELS.items()}
    return Model(
        _head("van", "Panel van", "Car", (van.LENGTH, van.WIDTH, van.HEIGHT), axles) | {"occupants": OCCUPANTS},
        _parts(van.build()),
        _parts(van.build(False)),
        {"paint": materials.paint(WHITE), **VEHICLE, **INSIDE},
        {name: {"paint": rgb} for name, rgb in colors.items()},
        _wheel_joints(centres),
    )


def make_box_van() -> Model:
    """Return the van with a load box."""
    boxes: dict[str, tuple[Color, Color]] = {
        "white": (WHITE, WHITE), "yellow": ((0.62, 0.38, 0.012), (0.62, 0.38, 0.012)), "blue": ((0.015, 0.07, 0.24),
        WHITE), "red": ((0.36, 0.014, 0.016), WHITE), "green": ((0.03, 0.13, 0.06), (0.03, 0.13, 0.06)),
    }  # fmt: skip # a table
    variants = {name: {"paint": cab, "box_panel": panel} for name, (cab, panel) in boxes.items()}
    centres = {}
    for name, (x, left) in box_van.WHEELS.items():
        kind = van.WHEEL if x > 0 else box_van.REAR_WHEEL
        y = box_van.OUTER - 0.5 * (kind.tyre_width + kind.twin)
        centres[name] = (x, y if left else -y, kind.radius)
    size = box_van.LENGTH, box_van.WIDTH, box_van.HEIGHT
    return Model(
        _head("box_van", "Van with a load box", "Truck", size, (box_van.FRONT_AXLE, box_van.REAR_AXLE))
        | {"occupants": OCCUPANTS},
        _parts(box_van.build()),
        _parts(box_van.build(False)),
        {"paint": materials.paint(WHITE), **VEHICLE, **LOADED, **INSIDE},
        variants,
        _wheel_joints(centres),
    )


def make_tram() -> Model:
    """Return the tram of one car on two bogies."""
    variants: dict[str, tuple[Color, Color]] = {
        "red": ((0.42, 0.016, 0.016), (0.66, 0.60, 0.45)), "yellow": ((0.66, 0.42, 0.015), (0.62, 0.62, 0.60)),
        "green": ((0.02, 0.14, 0.06), (0.66, 0.60, 0.45)), "blue": ((0.02, 0.10, 0.30), WHITE),
    }  # fmt: skip # a table
    shape = tram.SHAPE
    return replace(
        _bus("tram", "Tram of one car on two bogies", shape, variants),
        head=_head(
            "tram", "Tram of one car on two bogies", "Train", (shape.length, shape.width, shape.height),
            (tram.BOGIES[0], tram.BOGIES[1]),
        )
        | {"occupants": OCCUPANTS},
        detailed=_parts(tram.build()),
        light=_parts(tram.build(False)),
        joints=[
            {key: value for key, value in joint.items() if key != "steered"}
            for joint in joints(tram.WHEEL_CENTRES, {name: [f"wheel_{name}_tyre"] for name in tram.WHEEL_CENTRES})
        ],
    )  # fmt: skip # arguments of a table


def make_bus() -> Model:
    """Return the city bus."""
    variants: dict[str, tuple[Color, Color]] = {
        "red": ((0.42, 0.016, 0.016), WHITE), "blue": ((0.02, 0.10, 0.30), WHITE), "yellow": ((0.66, 0.42, 0.015),
        (0.03, 0.03, 0.035)), "green": ((0.03, 0.20, 0.07), WHITE), "white": (WHITE, (0.02, 0.10, 0.30)),
    }  # fmt: skip # a table
    return _bus("bus", "City bus", bus.CITY, variants)


def make_coach() -> Model:
    """Return the coach, with its floor above the luggage."""
    variants: dict[str, tuple[Color, Color]] = {
        "white": (WHITE, (0.02, 0.16, 0.32)), "silver": ((0.30, 0.31, 0.32), (0.30, 0.014, 0.016)), "green": ((0.04,
        0.26, 0.05), WHITE), "blue": ((0.015, 0.06, 0.20), (0.62, 0.36, 0.012)), "black": ((0.012, 0.012, 0.014), (0.30,
        0.31, 0.32)),
    }  # fmt: skip # a table
    return _bus("coach", "Coach", bus.COACH, variants)


def _bus(name: str, title: str, shape: bus.BusShape, looks: dict[str, tuple[Color, Color]]) -> Model:
    cover: Color = (0.55, 0.55, 0.54)
    variants = {
        key: {"paint": paint, "stripe_paint": stripe, "roof_cover": cover} for key, (paint, stripe) in looks.items()
    }
    bsdfs = {
        **{key: materials.paint(color) for key, color in next(iter(variants.values())).items()},
        **VEHICLE,
        **INSIDE,
        "roof_cover": replace(
            VEHICLE["black_plastic"], color=cover, lidar_reflectance=0.55, source="estimate, white glass-fibre plastic"
        ),
        "led_sign": replace(
            VEHICLE["indicator"], color=(0.75, 0.33, 0.02), source="estimate, clear pane over amber LEDs", lamp=None
        ),
    }
    centres = {}
    for wheel, (x, left) in shape.wheels.items():
        kind = shape.wheel if x > 0 else shape.rear_wheel
        y = shape.outer - 0.5 * (kind.tyre_width + kind.twin)
        centres[wheel] = (x, y if left else -y, kind.radius)
    return Model(
        _head(name, title, "Bus", (shape.length, shape.width, shape.height), (shape.front_axle, shape.rear_axle))
        | {"occupants": OCCUPANTS},
        _parts(bus.build(shape)),
        _parts(bus.build(shape, False)),
        bsdfs,
        variants,
        _wheel_joints(centres),
    )


BOXES: dict[str, tuple[Color, Color]] = {
    "white_box": ((0.03, 0.12, 0.32), WHITE), "red_white_box": ((0.36, 0.014, 0.016), WHITE),
    "yellow_box": ((0.62, 0.38, 0.012), (0.62, 0.38, 0.012)), "blue_tarpaulin": (WHITE, (0.018, 0.07, 0.22)),
    "green_tarpaulin": ((0.10, 0.11, 0.12), (0.025, 0.12, 0.06)), "orange_tarpaulin": ((0.55, 0.13, 0.012), (0.55,
    0.13, 0.012)),
}  # fmt: skip # a table
"""Colours of cab and box of a lorry."""


def make_lorry() -> Model:
    """Return the lorry with a box body; "tarpaulin" variants differ in colour, not in material."""
    variants = {name: {"paint": cab, "box_panel": panel} for name, (cab, panel) in BOXES.items()}
    bsdfs = {"paint": materials.paint(variants["white_box"]["paint"]), **VEHICLE, **LOADED, **INSIDE}
    centres = {}
    for name, (x, left) in lorry.WHEELS.items():
        kind = lorry.FRONT_WHEEL if x > 0 else lorry.REAR_WHEEL
        y = lorry.OUTER - 0.5 * (kind.tyre_width + kind.twin)
        centres[name] = (x, y if left else -y, kind.radius)
    rear = sum(lorry.REAR_AXLES) / 2
    return Model(
        _head(
            "lorry",
            "Lorry with a box body, three axles",
            "Truck",
            (lorry.LENGTH, lorry.WIDTH, lorry.HEIGHT),
            (lorry.FRONT_AXLE, rear),
        )
        | {"occupants": OCCUPANTS},
        _parts(lorry.build()),
        _parts(lorry.build(False)),
        bsdfs,
        variants,
        _wheel_joints(centres),
    )


def make_articulated_lorry() -> Model:
    """Return the tractor with its semitrailer; variants as those of the lorry."""
    variants = {name: {"paint": cab, "box_panel": panel} for name, (cab, panel) in BOXES.items()}
    detailed, light = _parts(articulated.build()), _parts(articulated.build(False))
    wheels = {shape for shape in {**detailed, **light} if shape.startswith("wheel_")}
    of_tractor = {*articulated.TRACTOR, "indicators_left", "indicators_right"}
    towed = [shape for shape in {**detailed, **light} if shape not in wheels | of_tractor]
    rows: list[dict[str, Any]] = [
        {
            "kind": "trailer",
            "shapes": towed,
            "hitch": articulated.KINGPIN,
            "length": round(articulated.REACH, 6),
            "span": (-articulated.LENGTH / 2, articulated.BOX[0][1]),
        }
    ]
    for name, (x, left) in articulated.WHEELS.items():
        kind = articulated.kind_of(name)
        y = articulated.OUTER - 0.5 * (kind.tyre_width + kind.twin)
        row = {
            "kind": "wheel", "shapes": [f"wheel_{name}_tyre", f"wheel_{name}_rim"],
            "center": (round(x, 6), y if left else -y, kind.radius), "radius": kind.radius,
        }  # fmt: skip # a table
        rows.append(row | ({"steered": True} if "front" in name else {"towed": True} if "trailer" in name else {}))
    return Model(
        _head(
            "articulated_lorry", "Tractor and semitrailer, five axles", "Truck",
            (articulated.LENGTH, articulated.WIDTH, articulated.HEIGHT),
            (round(articulated.FRONT_AXLE, 6), articulated.DRIVE_AXLE),
        )
        | {"occupants": OCCUPANTS},
        detailed,
        light,
        {"paint": materials.paint(variants["white_box"]["paint"]), **VEHICLE, **LOADED, **INSIDE},
        variants,
        rows,
    )  # fmt: skip # arguments of a table
