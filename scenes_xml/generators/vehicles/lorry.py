"""A three-axle lorry with a box body: cab, ladder frame, twin rear axles, tank, under-run bars and mudguards."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from ..geometry import decal
from ..geometry.decal import strips
from ..geometry.mesh import Mesh, box, grid, merge, outward, revolve
from .body_loft import BodyShape, loft, side_panel
from .load_box import load_box
from .number_plates import NumberPlates
from .vehicle_parts import bar, prism
from .wheels import WheelShape, wheel_parts

LENGTH, WIDTH, HEIGHT = 9.60, 2.55, 3.75
FRONT_AXLE, REAR_AXLES = 3.42, (-1.60, -2.95)
FRONT_WHEEL = WheelShape(radius=0.525, rim_radius=0.295, tyre_width=0.315)
REAR_WHEEL = replace(FRONT_WHEEL, tyre_width=0.295, twin=0.345)
OUTER = WIDTH / 2 - 0.045
"""abs(y) of the outer walls of the tyres [m]."""
BOX = ((-4.76, 2.50), (1.16, 3.75))
"""The load's box: x and z, from and to [m]."""

CAB = BodyShape(
    front=LENGTH / 2 - 0.03, rear=2.62, width=2.48, floor=0.62,
    top=((2.6, 2.98), (3.2, 3.0), (4.0, 2.98), (4.8, 2.92)),
    arches=((FRONT_AXLE, 0.525, 0.62),), tunnel=0.80, edge=0.12,
    lean=((0.6, 0.99), (1.2, 1.0), (1.6, 1.0), (3.0, 0.945)),
    front_shift=((0.0, 0.03), (0.9, 0.0), (1.7, 0.03), (3.0, 0.26)), rear_shift=((0.0, 0.0), (3.2, 0.0)),
    front_bow=0.22, rear_bow=0.0, bow_power=4.0, bow_reach=0.7, end_radius=0.06,
    more_stations=(4.6, 4.45, 4.3, 4.15),
)  # fmt: skip # a table
LIGHT_STATIONS = (4.2,)
panel = partial(decal.panel, reach=7.0)
FRONT, REAR = np.array([-1.0, 0.0, 0.0]), np.array([1.0, 0.0, 0.0])
WHEELS = {
    "front_left": (FRONT_AXLE, True),
    "front_right": (FRONT_AXLE, False),
    "middle_left": (REAR_AXLES[0], True),
    "middle_right": (REAR_AXLES[0], False),
    "rear_left": (REAR_AXLES[1], True),
    "rear_right": (REAR_AXLES[1], False),
}
"""Name of each wheel -> x of its axle [m], and whether it is on the left."""


def _both(part: Mesh) -> Mesh:
    return merge([part, part.mirrored_y()])


def _rectangle(a: tuple[float, float], z: tuple[float, float]) -> tuple[tuple[float, float], ...]:
    return ((a[0], z[0]), (a[1], z[0]), (a[1], z[1]), (a[0], z[1]))


def _deflector() -> Mesh:
    """Return the roof deflector: a wedge from the cab's roof to the height of the box."""
    outline = ((2.72, 2.96), (4.22, 2.96), (4.16, 3.08), (3.75, 3.36), (3.25, 3.58), (2.72, 3.66))
    return prism(outline, -0.98, 0.98)


def _glass(body: Mesh, fine: bool) -> Mesh:
    many = (8, 13) if fine else (3, 5)
    rise = 0.010 if fine else 0.025
    screen = panel(body, ((-1.12, 1.66), (1.12, 1.66), (1.07, 2.66), (-1.07, 2.66)), FRONT, 1.0, rise, cells=many)
    door = ((3.30, 1.66), (4.46, 1.62), (4.28, 2.58), (3.30, 2.58))
    return merge([screen, side_panel(body, door, 0.008 if fine else 0.015, (5, 5) if fine else (3, 2))])


def _cab_trim(body: Mesh, floor: Mesh) -> Mesh:
    """Return grille, bumper, sun visor, steps, door gaps, wipers and handles of the cab."""
    rows = np.arange(0.98, 1.50, 0.13)
    visor = np.array([(4.72, 2.80), (4.86, 2.74), (4.86, 2.77), (4.72, 2.84)])
    steps = [box((0.34, 0.10, 0.12), (4.23, 1.17, 0.50)), box((0.34, 0.06, 0.04), (4.23, 1.205, 0.82))]
    return merge(
        [
            floor,
            *(panel(body, _rectangle((-0.80, 0.80), (z, z + 0.09)), FRONT, 1.0, 0.012, cells=(2, 9)) for z in rows),
            panel(body, _rectangle((-1.20, 1.20), (0.66, 0.72)), FRONT, 1.0, 0.014, cells=(2, 15)),
            panel(body, ((-1.16, 1.60), (1.16, 1.60), (1.11, 2.72), (-1.11, 2.72)), FRONT, 1.0, 0.004, cells=(9, 15)),
            *(panel(body, _rectangle((0.74, 1.17), (0.76, 1.02)), FRONT, s, 0.006, cells=(3, 6)) for s in (1.0, -1.0)),
            prism([(float(x), float(z)) for x, z in visor - [0.14, 0.0]], -1.0, 1.0),
            *(_both(step) for step in steps),
            strips(
                body,
                [np.array([(3.22, 1.20), (3.22, 2.66), (4.30, 2.66), (4.54, 1.60), (4.56, 1.00), (4.10, 1.00)])],
                0.014,
                0.003,
            ),
            strips(body, [np.array([(3.30, 1.46), (3.50, 1.46)])], 0.045, 0.03),
            *(bar((4.76, y0, 1.62), (4.71, y1, 2.05), 0.012, 5) for y0, y1 in ((0.1, 0.62), (-0.7, -0.18), (0.9, 1.0))),
            box((0.10, 2.2, 1.9), (2.58, 0.0, 2.05)),
        ]
    )


def _mirrors() -> tuple[Mesh, Mesh]:
    """Return the mirrors with their arms, and the glass."""
    profile = np.array([(0.0, -0.42), (0.10, -0.42), (0.13, -0.34), (0.13, 0.34), (0.10, 0.42), (0.0, 0.42)])
    housing = outward(revolve(profile, 10, "z")).moved((4.46, 1.42, 2.12))
    left = merge([housing, *(bar((4.42, 1.16, z), (4.46, 1.40, z), 0.025) for z in (1.86, 2.44))])
    glass = [box((0.01, 0.19, size), (4.334, 1.42, z)) for size, z in ((0.42, 2.22), (0.22, 1.85))]
    return _both(left), _both(merge(glass))


def _tread(x: float, radius: float, start: float, stop: float) -> Mesh:
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
    return _both(shell)


def _chassis() -> Mesh:
    """Return the ladder frame, axles, drive shaft, air tanks, battery box and under-run bars."""
    parts = [_both(box((8.9, 0.08, 0.26), (0.02, 0.40, 0.965)))]
    parts += [box((0.10, 0.74, 0.18), (x, 0.0, 0.965)) for x in (-4.3, -3.6, -2.28, -0.8, 0.6, 2.0, 3.0)]
    parts += [box((0.09, 2.30, 0.09), (x, 0.0, 1.11)) for x in np.arange(-4.4, 2.3, 0.62)]
    ball = np.array([(0.0, -0.24), (0.17, -0.20), (0.24, 0.0), (0.17, 0.20), (0.0, 0.24)])
    for x in (FRONT_AXLE, *REAR_AXLES):
        parts.append(bar((x, -1.0, 0.525), (x, 1.0, 0.525), 0.085, 10))
    parts += [outward(revolve(ball, 12, "y")).moved((x, 0.0, 0.55)) for x in REAR_AXLES]
    parts.append(bar((REAR_AXLES[0], 0.0, 0.60), (2.6, 0.0, 0.80), 0.06, 8))
    parts.append(box((1.3, 0.85, 0.55), (3.5, 0.0, 0.80)))
    tank = np.array([(0.0, -0.40), (0.11, -0.40), (0.13, -0.36), (0.13, 0.36), (0.11, 0.40), (0.0, 0.40)])
    parts += [outward(revolve(tank, 10, "x")).moved((x, 0.60, 0.74)) for x in (-0.45, 0.45)]
    parts.append(box((0.62, 0.50, 0.46), (1.55, 0.86, 0.72)))
    parts.append(box((0.09, 2.34, 0.13), (-4.66, 0.0, 0.50)))
    parts += [_both(box((0.10, 0.07, 0.42), (-4.62, 0.40, 0.72)))]
    parts.append(box((0.05, 2.40, 0.16), (-4.72, 0.0, 1.02)))
    for z in (0.52, 0.84):
        parts.append(_both(box((2.42, 0.03, 0.11), (0.45, 1.22, z))))
        parts.append(_both(box((0.86, 0.03, 0.11), (-4.05, 1.22, z))))
    parts += [_both(box((0.05, 0.03, 0.62), (x, 1.19, 0.83))) for x in (-4.3, -3.8, -0.6, 0.45, 1.5)]
    return merge(parts)


def _tank() -> Mesh:
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
    return wheel_parts(WHEELS, replace(FRONT_WHEEL, segments=20), replace(REAR_WHEEL, segments=20), OUTER, light)


def _lamps(body: Mesh, fine: bool) -> dict[str, tuple[Mesh, str]]:
    cells = (3, 6) if fine else (2, 3)
    heads = [
        panel(body, _rectangle((0.78, 1.14), (0.79, 0.99)), FRONT, s, 0.012 if fine else 0.025, cells=cells)
        for s in (1.0, -1.0)
    ]
    tails = [box((0.05, 0.40, 0.13), (-4.765, s * 0.94, 0.86)) for s in (1.0, -1.0)]
    return {"headlamps": (merge(heads), "headlamp"), "taillamps": (merge(tails), "taillamp")}


def build(fine: bool = True) -> dict[str, tuple[Mesh, str]]:
    """Return the parts of the lorry: name -> (mesh, role)."""
    painted, floor = loft(CAB if fine else replace(CAB, more_stations=LIGHT_STATIONS), fine)
    body = merge([painted, floor])
    panels, frame, marking = load_box(*BOX, WIDTH)
    parts: dict[str, tuple[Mesh, str]] = {
        "cab": (merge([painted, _deflector()]), "paint"),
        "load_box": (panels, "box_panel"),
        "glass": (_glass(body, fine), "glass"),
        **_lamps(body, fine),
        **NumberPlates(LENGTH / 2, 0.80, 0.62, 0.04, 9).parts(fine),
    }
    if not fine:
        (x0, x1), (z0, z1) = BOX
        whole = box((x1 - x0, WIDTH, z1 - z0), (0.5 * (x0 + x1), 0.0, 0.5 * (z0 + z1)))
        rails = [
            _both(box((8.9, 0.08, 0.26), (0.02, 0.40, 0.965))),
            box((0.09, 2.34, 0.13), (-4.66, 0.0, 0.50)),
            box((1.3, 0.85, 0.55), (3.5, 0.0, 0.80)),
            _both(box((2.42, 0.03, 0.43), (0.45, 1.22, 0.68))),
        ]
        return parts | {
            "load_box": (whole, "box_panel"),
            "chassis": (merge([floor, *rails]), "chassis"),
            **wheels(True),
        }
    mirrors, mirror_glass = _mirrors()
    guards = [_tread(FRONT_AXLE, 0.60, 100.0, 200.0), *(_tread(a, 0.60, 20.0, 160.0) for a in REAR_AXLES)]
    markers = [_both(box((0.10, 0.012, 0.04), (x, 1.240, 0.84))) for x in (-0.4, 1.3, -4.0)]
    markers += [box((0.05, 0.12, 0.12), (-4.766, s * 1.208, 0.86)) for s in (1.0, -1.0)]
    return parts | {
        "frame": (frame, "frame_aluminium"),
        "marking": (marking, "contour_marking"),
        "chassis": (_chassis(), "chassis"),
        "tank": (_tank(), "frame_aluminium"),
        "mudguards": (merge(guards), "trim"),
        "trim": (_cab_trim(body, floor), "trim"),
        "indicators": (merge(markers), "indicator"),
        "mirrors": (mirrors, "trim"),
        "mirror_glass": (mirror_glass, "mirror_glass"),
        **wheels(),
    }
