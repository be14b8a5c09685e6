"""An articulated lorry: a tractor of two axles and a semitrailer with a load box on three."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..geometry.mesh import Mesh, box, merge, outward, revolve
from . import lorry, lorry_cab
from .load_box import body, load_box
from .lorry_cab import both
from .number_plates import NumberPlates
from .vehicle_parts import bar, cross_bar, prism, skewed, tray
from .wheels import wheel_parts

Parts = dict[str, tuple[Mesh, str]]
LENGTH, WIDTH, HEIGHT = 16.50, 2.55, 4.00
SHIFT = LENGTH / 2 - lorry_cab.NOSE
"""How far the cab stands before that of the three-axle lorry, about the middle of the vehicle [m]."""
FRONT_AXLE, DRIVE_AXLE = lorry_cab.FRONT_AXLE + SHIFT, 3.15
KINGPIN = (3.75, 0.0, 1.15)
"""The coupling: 4.5 m behind the tractor's front, 12.0 m before the trailer's rear [m]."""
TRAILER_AXLES = (-2.64, -3.95, -5.26)
REACH = KINGPIN[0] - TRAILER_AXLES[1]
"""From the coupling to the middle of the trailer's axles [m]."""
BOX = ((-LENGTH / 2 + 0.04, 5.34), (1.18, HEIGHT))
"""The trailer's box: x and z, from and to [m]."""
FRONT_WHEEL = lorry.FRONT_WHEEL
DRIVE_WHEEL = replace(lorry.REAR_WHEEL, bolts=0)
TRAILER_WHEEL = replace(FRONT_WHEEL, tyre_width=0.385, segments=14, bolts=0)
OUTER = lorry.OUTER
AIR_TANK = np.array([(0.0, -0.4), (0.11, -0.4), (0.13, 0.0), (0.11, 0.4), (0.0, 0.4)])
WHEELS = {
    f"{name}_{side}": (x, side == "left")
    for name, x in (
        ("front", FRONT_AXLE), ("drive", DRIVE_AXLE), ("trailer_first", TRAILER_AXLES[0]),
        ("trailer_second", TRAILER_AXLES[1]), ("trailer_third", TRAILER_AXLES[2]),
    )
    for side in ("left", "right")
}  # fmt: skip # a table
"""Name of each wheel -> x of its axle [m], and whether it is on the left."""
TRACTOR = (
    "cab", "glass", "headlamps", "chassis", "tank", "mudguards", "trim", "indicators", "mirrors", "mirror_glass",
    "plates", "plate_text", "interior", "seats", "people_clothes", "people_skin", "people_hair",
)  # fmt: skip # a table
"""Shapes of the tractor; all others but wheels are the trailer's."""


def kind_of(wheel: str) -> lorry.WheelShape:
    """Return the shape of a wheel."""
    return FRONT_WHEEL if wheel.startswith("front") else DRIVE_WHEEL if wheel.startswith("drive") else TRAILER_WHEEL


def wheels(light: bool) -> Parts:
    """Return the shapes of all wheels; twin tyres on the drive axle."""
    found: Parts = {}
    for name, place in WHEELS.items():
        found |= wheel_parts({name: place}, kind_of(name), kind_of(name), OUTER, light)
    return found


def _chassis(fine: bool) -> Mesh:
    """Return the tractor's frame, axles, fifth wheel and batteries."""
    rear, front = 2.35, 7.9
    parts = [both(skewed(box((front - rear, 0.08, 0.24), (0.5 * (front + rear), 0.40, 0.93))))]
    plate = prism(((3.25, 1.06), (4.15, 1.06), (4.15, 1.12), (3.75, 1.16), (3.25, 1.12)), -0.45, 0.45)
    parts += [plate, box((1.3, 0.85, 0.55), (3.5 + SHIFT, 0.0, 0.80))]
    if not fine:
        return merge(parts)
    parts += [box((0.10, 0.74, 0.18), (x, 0.0, 0.93)) for x in (2.4, 3.2, 4.4, 5.6, 6.5)]
    parts += [bar((x, -1.0, 0.525), (x, 1.0, 0.525), 0.085, 8) for x in (FRONT_AXLE, DRIVE_AXLE)]
    ball = np.array([(0.0, -0.24), (0.17, -0.20), (0.24, 0.0), (0.17, 0.20), (0.0, 0.24)])
    parts.append(outward(revolve(ball, 10, "y")).moved((DRIVE_AXLE, 0.0, 0.55)))
    parts.append(bar((DRIVE_AXLE, 0.0, 0.60), (6.2, 0.0, 0.80), 0.06, 8))
    parts.append(tray((1.2, 0.50, 0.50), (4.95, 0.92, 0.72), 0.1))
    return merge(parts)


def _trailer_frame(fine: bool) -> Mesh:
    """Return the trailer's beams, axles, under-run bars, side guards and landing legs."""
    (rear, front), (floor, _) = BOX
    bumper = bar((rear + 0.14, -1.17, 0.50), (rear + 0.14, 1.17, 0.50), 0.065, 12)
    guard = (-1.7, 2.0)
    length, middle = guard[1] - guard[0], 0.5 * (guard[0] + guard[1])
    if not fine:
        beams = both(skewed(box((front - rear - 0.3, 0.08, 0.20), (0.5 * (front + rear), 0.45, floor - 0.10))))
        return merge([beams, bumper, both(skewed(box((length, 0.03, 0.43), (middle, 1.22, 0.70))))])
    parts = [
        both(skewed(box((8.6, 0.08, 0.34), (rear + 4.4, 0.45, floor - 0.17)))),
        both(skewed(box((4.6, 0.08, 0.09), (front - 2.4, 0.45, floor - 0.045)))),
        *(cross_bar(x, 1.18, floor, 0.09, 0.09) for x in np.arange(rear + 0.3, 2.2, 0.9)),
        *(bar((x, -0.95, 0.525), (x, 0.95, 0.525), 0.075, 8) for x in TRAILER_AXLES),
        bumper,
        both(bar((rear + 0.18, 0.45, 0.51), (rear + 0.18, 0.45, 0.93), 0.04, 12)),
        *(both(skewed(box((length, 0.03, 0.11), (middle, 1.22, z)))) for z in (0.56, 0.86)),
        *(both(box((0.05, 0.03, 0.62), (x, 1.19, 0.86))) for x in (-1.5, -0.3, 0.9, 1.9)),
        both(bar((2.25, 0.62, 1.10), (2.25, 0.62, 0.42), 0.055, 8)),
        both(box((0.22, 0.22, 0.03), (2.25, 0.62, 0.405))),
        bar((2.25, -0.62, 0.95), (2.25, 0.62, 0.95), 0.03, 6),
        both(outward(revolve(AIR_TANK, 10, "x")).moved((0.2, 0.62, 0.85))),
    ]  # fmt: skip # a table
    return merge(parts)


def build(fine: bool = True) -> Parts:
    """Return the parts of tractor and trailer, in line: name -> (mesh, role)."""
    cab, floor = lorry_cab.build(fine, HEIGHT - 0.08, SHIFT)
    rear = BOX[0][0]
    panels, frame, marking = load_box(*BOX, WIDTH)
    ahead, behind = (_plates(sign, fine) for sign in (1.0, -1.0))
    parts: Parts = {
        **cab,
        **ahead,
        **{f"trailer_{name}": part for name, part in behind.items()},
        "trailer_lamp_bar": (box((0.03, 2.36, 0.14), (rear + 0.03, 0.0, 0.86)), "chassis"),
        "taillamps": (both(box((0.05, 0.40, 0.13), (rear - 0.005, 0.94, 0.86))), "taillamp"),
        **wheels(not fine),
    }
    if not fine:
        return parts | {
            "load_box": (body(*BOX, WIDTH), "box_panel"),
            "chassis": (merge([floor, _chassis(False)]), "chassis"),
            "trailer_frame": (_trailer_frame(False), "chassis"),
        }
    guards = [lorry.tread(FRONT_AXLE, 0.60, 100.0, 200.0), lorry.tread(DRIVE_AXLE, 0.60, 35.0, 160.0)]
    markers = [both(box((0.10, 0.012, 0.04), (FRONT_AXLE - 0.75, 1.243, 1.28)))]
    trailer_markers = [both(box((0.10, 0.012, 0.04), (x, 1.240, 1.20))) for x in (-6.4, -3.3, -0.2, 2.9)]
    trailer_markers += [both(box((0.05, 0.12, 0.12), (rear - 0.006, 1.208, 0.86)))]
    return parts | {
        "trim": (merge([cab["trim"][0], floor]), "trim"),
        "chassis": (_chassis(True), "chassis"),
        "tank": (lorry.tank().moved((4.3, 0.0, 0.0)), "frame_aluminium"),
        "mudguards": (merge(guards), "trim"),
        "indicators": (merge(markers), "indicator"),
        "load_box": (panels, "box_panel"),
        "trailer_edges": (frame, "frame_aluminium"),
        "marking": (marking, "contour_marking"),
        "trailer_frame": (_trailer_frame(True), "chassis"),
        "trailer_indicators": (merge(trailer_markers), "indicator"),
    }


def _plates(sign: float, fine: bool) -> Parts:
    """Return the plate at the front (1) or the rear (-1); the trailer has its own letters."""
    plates = NumberPlates(LENGTH / 2, 0.80, 0.62, 0.04, 9 if sign > 0.0 else 13).parts(fine)
    found = {}
    for name, (mesh, role) in plates.items():
        chosen = sign * mesh.vertices[mesh.faces, 0].mean(axis=1) > 0.0
        found[name] = (replace(mesh, faces=mesh.faces[chosen]), role)
    return found
