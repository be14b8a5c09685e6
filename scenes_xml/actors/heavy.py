"""Van, lorry and bus."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from ..generators.geometry.mesh import Mesh
from ..generators.vehicles import bus, lorry, van
from . import materials
from .cars import joints
from .materials import ROLES, VEHICLE, Color
from .model import Model, Part

WHITE: Color = (0.70, 0.70, 0.68)


def _parts(found: dict[str, tuple[Mesh, str]]) -> dict[str, Part]:
    return {
        name: Part(replace(mesh, uv=None), ROLES.get(role, role), 45.0 if role == "paint" else 35.0)
        for name, (mesh, role) in found.items()
    }


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
        _head("van", "Panel van", "Car", (van.LENGTH, van.WIDTH, van.HEIGHT), axles),
        _parts(van.build()),
        _parts(van.build(False)),
        {"paint": materials.paint(WHITE), **VEHICLE},
        {name: {"paint": rgb} for name, rgb in colors.items()},
        _wheel_joints(centres),
    )


def make_bus() -> Model:
    """Return the city bus."""
    cover: Color = (0.55, 0.55, 0.54)
    variants: dict[str, dict[str, Color]] = {
        "red": {"paint": (0.42, 0.016, 0.016), "stripe_paint": WHITE, "roof_cover": cover},
        "blue": {"paint": (0.02, 0.10, 0.30), "stripe_paint": WHITE, "roof_cover": cover},
        "yellow": {"paint": (0.66, 0.42, 0.015), "stripe_paint": (0.03, 0.03, 0.035), "roof_cover": cover},
        "green": {"paint": (0.03, 0.20, 0.07), "stripe_paint": WHITE, "roof_cover": cover},
        "white": {"paint": WHITE, "stripe_paint": (0.02, 0.10, 0.30), "roof_cover": cover},
    }
    bsdfs = {
        **{name: materials.paint(color) for name, color in variants["red"].items()},
        **VEHICLE,
        "roof_cover": replace(
            VEHICLE["black_plastic"], color=cover, lidar_reflectance=0.55, source="estimate, white glass-fibre plastic"
        ),
        "led_sign": replace(
            VEHICLE["indicator"], color=(0.75, 0.33, 0.02), source="estimate, clear pane over amber LEDs"
        ),
    }
    centres = {}
    for name, (x, left) in bus.WHEELS.items():
        kind = bus.FRONT_WHEEL if x > 0 else bus.REAR_WHEEL
        y = bus.OUTER - 0.5 * (kind.tyre_width + kind.twin)
        centres[name] = (x, y if left else -y, kind.radius)
    return Model(
        _head("bus", "City bus", "Bus", (bus.LENGTH, bus.WIDTH, bus.HEIGHT), (bus.FRONT_AXLE, bus.REAR_AXLE)),
        _parts(bus.build()),
        _parts(bus.build(False)),
        bsdfs,
        variants,
        _wheel_joints(centres),
    )


def make_lorry() -> Model:
    """Return the lorry with a box body; "tarpaulin" variants differ in colour, not in material."""
    boxes: dict[str, tuple[Color, Color]] = {
        "white_box": ((0.03, 0.12, 0.32), WHITE), "red_white_box": ((0.36, 0.014, 0.016), WHITE),
        "yellow_box": ((0.62, 0.38, 0.012), (0.62, 0.38, 0.012)), "blue_tarpaulin": (WHITE, (0.018, 0.07, 0.22)),
        "green_tarpaulin": ((0.10, 0.11, 0.12), (0.025, 0.12, 0.06)), "orange_tarpaulin": ((0.55, 0.13, 0.012), (0.55,
        0.13, 0.012)),
    }  # fmt: skip # a table
    variants = {name: {"paint": cab, "box_panel": panel} for name, (cab, panel) in boxes.items()}
    bsdfs = {
        "paint": materials.paint(variants["white_box"]["paint"]),
        **VEHICLE,
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
        ),
        _parts(lorry.build()),
        _parts(lorry.build(False)),
        bsdfs,
        variants,
        _wheel_joints(centres),
    )
