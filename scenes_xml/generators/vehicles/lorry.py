"""A three-axle lorry with a box body: cab, ladder frame, twin rear axles, tank, under-run bars and mudguards."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..geometry.mesh import Mesh, box, grid, merge, outward, revolve
from . import lorry_cab
from .load_box import body, load_box
from .lorry_cab import FRONT_AXLE, both
from .number_plates import NumberPlates
from .vehicle_parts import bar, cross_bar, prism, skewed, tray
from .wheels import WheelShape, wheel_parts

LENGTH, WIDTH, HEIGHT = 9.60, 2.55, 3.75
REAR_AXLES = (-1.60, -2.95)
FRONT_WHEEL = WheelShape(radius=0.525, rim_radius=0.295, tyre_width=0.315, bolts=8, segments=16)
REAR_WHEEL = replace(FRONT_WHEEL, tyre_width=0.295, twin=0.345)
OUTER = WIDTH / 2 - 0.045
"""abs(y) of the outer walls of the tyres [m]."""
BOX = ((-4.76, 2.50), (1.16, 3.75))
"""The load's box: x and z, from and to [m]."""

WHEELS = {
    "front_left": (FRONT_AXLE, True),
    "front_right": (FRONT_AXLE, False),
    "middle_left": (REAR_AXLES[0], True),
    "middle_right": (REAR_AXLES[0], False),
    "rear_left": (REAR_AXLES[1], True),
    "rear_right": (REAR_AXLES[1], False),
}
"""Name of each wheel -> x of its axle [m], and whether it is on the left."""


def tread(x: float, radius: float, start: float, stop: float) -> Mesh:
    """Return a mudguard: a thick arc over a wheel on both sides, from angle `start` to `stop` [deg] above +x."""
    angle = np.radians(np.linspace(start, stop, 11))
    rows = []
    for r, y in (
        (radius, 0.62),
        (radius + 0.015, 0.62),
        (radius + 0.015, OUTER - 0.0),
        (radius - 0.05, OUTER + 0.01),
        (radius, OUTER - 0.03),
    ):
        rows.append(np.column_stack([x + r * np.cos(angle), np.full(11, y), FRONT_WHEEL.radius + r * np.sin(angle)]))
    shell = grid(np.stack([*rows, rows[0]]))
    return both(shell)


def _rails() -> Mesh:
    """Return both rails of the ladder frame."""
    return both(skewed(box((8.9, 0.08, 0.26), (0.02, 0.40, 0.965))))


def _under_run() -> Mesh:
    """Return the under-run bar at the rear: round, since a flat one makes corners with the wheels before it."""
    return bar((-4.66, -1.17, 0.50), (-4.66, 1.17, 0.50), 0.065, 12)


def _chassis() -> Mesh:
    """Return the ladder frame, axles, drive shaft, air tanks, battery box and under-run bars."""
    parts = [_rails()]
    parts += [box((0.10, 0.74, 0.18), (x, 0.0, 0.965)) for x in (-4.3, -3.6, -2.28, -0.8, 0.6, 2.0, 3.0)]
    parts += [cross_bar(x, 1.15, 1.155, 0.09, 0.09) for x in np.arange(-4.4, 2.3, 0.62)]
    ball = np.array([(0.0, -0.24), (0.17, -0.20), (0.24, 0.0), (0.17, 0.20), (0.0, 0.24)])
    for x in (FRONT_AXLE, *REAR_AXLES):
        parts.append(bar((x, -1.0, 0.525), (x, 1.0, 0.525), 0.085, 10))
    parts += [outward(revolve(ball, 12, "y")).moved((x, 0.0, 0.55)) for x in REAR_AXLES]
    parts.append(bar((REAR_AXLES[0], 0.0, 0.60), (2.6, 0.0, 0.80), 0.06, 8))
    parts.append(box((1.3, 0.85, 0.55), (3.5, 0.0, 0.80)))
    tank = np.array([(0.0, -0.40), (0.11, -0.40), (0.13, -0.36), (0.13, 0.36), (0.11, 0.40), (0.0, 0.40)])
    parts += [outward(revolve(tank, 10, "x")).moved((x, 0.60, 0.74)) for x in (-0.45, 0.45)]
    parts.append(tray((0.62, 0.50, 0.46), (1.55, 0.86, 0.72), 0.1))
    parts.append(_under_run())
    parts += [both(bar((-4.62, 0.40, 0.51), (-4.62, 0.40, 0.93), 0.04, 12))]
    parts.append(box((0.05, 2.40, 0.16), (-4.72, 0.0, 1.02)))
    for z in (0.52, 0.84):
        parts.append(both(skewed(box((2.42, 0.03, 0.11), (0.45, 1.22, z)))))
        parts.append(both(skewed(box((0.86, 0.03, 0.11), (-4.05, 1.22, z)))))
    parts += [both(box((0.05, 0.03, 0.62), (x, 1.19, 0.83))) for x in (-4.3, -3.8, -0.6, 0.45, 1.5)]
    return merge(parts)


def tank() -> Mesh:
    """Return the fuel tank on the right: a rounded aluminium prism with straps."""
    corner = 0.12
    turn = np.radians([0.0, 45.0, 90.0])
    centres = [(0.24, 0.24, 0.0), (-0.24, 0.24, 90.0), (-0.24, -0.24, 180.0), (0.24, -0.24, 270.0)]
    ring = [
        (y + corner * np.cos(t + np.radians(a)), z + corner * np.sin(t + np.radians(a)))
        for y, z, a in centres
        for t in turn
    ]
    outline = [(float(a), float(b)) for a, b in ring]
    body = prism(outline, -0.72, 0.72)  # its x-z outline lies in y-z once it is turned
    turned = [
        part.moved((0.62, -0.86, 0.76), yaw=np.pi / 2)
        for part in (
            body,
            *(prism([(1.04 * a, 1.04 * b) for a, b in outline], y - 0.03, y + 0.03) for y in (-0.4, 0.4)),
        )
    ]
    return merge(turned)


def wheels(light: bool = False) -> dict[str, tuple[Mesh, str]]:
    """Return the shapes of the wheels; twin tyres on both rear axles."""
    return wheel_parts(WHEELS, FRONT_WHEEL, REAR_WHEEL, OUTER, light)


def build(fine: bool = True) -> dict[str, tuple[Mesh, str]]:
    """Return the parts of the lorry: name -> (mesh, role)."""
    cab, floor = lorry_cab.build(fine, 3.66)
    panels, frame, marking = load_box(*BOX, WIDTH)
    parts: dict[str, tuple[Mesh, str]] = {
        **cab,
        "load_box": (panels, "box_panel"),
        "taillamps": (both(box((0.05, 0.40, 0.13), (-4.765, 0.94, 0.86))), "taillamp"),
        **NumberPlates(LENGTH / 2, 0.80, 0.62, 0.04, 9).parts(fine),
    }
    if not fine:
        rails = [
            _rails(),
            _under_run(),
            box((1.3, 0.85, 0.55), (3.5, 0.0, 0.80)),
            both(skewed(box((2.42, 0.03, 0.43), (0.45, 1.22, 0.68)))),
        ]
        return parts | {
            "load_box": (body(*BOX, WIDTH), "box_panel"),
            "chassis": (merge([floor, *rails]), "chassis"),
            **wheels(True),
        }
    guards = [tread(FRONT_AXLE, 0.60, 100.0, 200.0), *(tread(a, 0.60, 20.0, 160.0) for a in REAR_AXLES)]
    markers = [both(box((0.10, 0.012, 0.04), (x, 1.240, 0.84))) for x in (-0.4, 1.3, -4.0)]
    markers += [box((0.05, 0.12, 0.12), (-4.766, s * 1.208, 0.86)) for s in (1.0, -1.0)]
    return parts | {
        "frame": (frame, "frame_aluminium"),
        "marking": (marking, "contour_marking"),
        "chassis": (_chassis(), "chassis"),
        "tank": (tank(), "frame_aluminium"),
        "mudguards": (merge(guards), "trim"),
        "trim": (merge([cab["trim"][0], floor]), "trim"),
        "indicators": (merge(markers), "indicator"),
        **wheels(),
    }
