"""A city bus of 12 m: low floor, three double doors on the right, large panes, roof units, two axles."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from ..geometry import decal
from ..geometry.decal import strips
from ..geometry.mesh import Mesh, box, merge, outward, revolve
from .body_loft import BodyShape, loft, side_panel
from .number_plates import NumberPlates
from .vehicle_parts import bar, prism
from .wheels import WheelShape, wheel_parts

LENGTH, WIDTH, HEIGHT = 12.0, 2.55, 3.12
FRONT_AXLE, REAR_AXLE = 3.28, -2.62
FRONT_WHEEL = WheelShape(radius=0.478, rim_radius=0.29, tyre_width=0.275)
REAR_WHEEL = replace(FRONT_WHEEL, twin=0.32)
OUTER = WIDTH / 2 - 0.04
"""abs(y) of the outer walls of the tyres [m]."""
SKIN = WIDTH / 2 - 0.012
"""abs(y) of the body's sides: lamps, panes and frames stand out from them."""

BODY = BodyShape(
    front=LENGTH / 2 - 0.03, rear=-LENGTH / 2 + 0.03, width=2 * SKIN, floor=0.30,
    top=((-6.0, 2.90), (-5.6, 2.90), (5.3, 2.90), (6.0, 2.88)),
    arches=((FRONT_AXLE, 0.478, 0.56), (REAR_AXLE, 0.478, 0.56)), tunnel=0.55, edge=0.12,
    lean=((0.0, 1.0), (1.2, 1.0), (2.9, 0.975)),
    front_shift=((0.0, 0.05), (0.45, 0.0), (1.0, 0.01), (2.9, 0.20)), rear_shift=((0.0, 0.10), (0.5, 0.0), (1.6, 0.0),
    (2.9, 0.06)),
    front_bow=0.22, rear_bow=0.07, bow_power=4.0, bow_reach=0.75, end_radius=0.07,
    more_stations=(5.8, 5.65, 5.5, 5.35, -5.8, -5.6, -5.4),
)  # fmt: skip # a table
LIGHT_BODY = replace(
    BODY,
    more_stations=(5.3, -5.4, *(x + sign * (radius + 0.004) for x, _, radius in BODY.arches for sign in (-1.0, 1.0))),
)
"""Body of the light level. It keeps the upright end walls of the wheel houses."""
DOORS = ((4.22, 5.46), (-0.35, 0.95), (-4.62, -3.36))
"""Doors on the right side, from and to x [m]."""
PANES = (
    (-5.45, -4.66),
    (-4.58, -3.40),
    (-3.32, -1.92),
    (-1.84, -0.40),
    (-0.32, 0.92),
    (1.0, 2.42),
    (2.50, 4.14),
    (4.22, 5.44),
)
"""Side panes, from and to x [m]."""
panel = partial(decal.panel, reach=7.0)
FRONT, REAR = np.array([-1.0, 0.0, 0.0]), np.array([1.0, 0.0, 0.0])


def _is_door(pane: tuple[float, float]) -> bool:
    return any(a - 0.1 < 0.5 * (pane[0] + pane[1]) < b + 0.1 for a, b in DOORS)


def _rectangle(a: tuple[float, float], z: tuple[float, float]) -> tuple[tuple[float, float], ...]:
    return ((a[0], z[0]), (a[1], z[0]), (a[1], z[1]), (a[0], z[1]))


def _glass(body: Mesh, fine: bool) -> Mesh:
    many = (9, 15) if fine else (3, 9)
    rise = 0.008 if fine else 0.035
    parts = [
        panel(body, _rectangle((-1.14, 1.14), (1.02, 2.44)), FRONT, 1.0, rise, cells=many),
        panel(body, _rectangle((-0.98, 0.98), (1.62, 2.40)), REAR, 1.0, rise, cells=(2, 7)),
    ]
    if not fine:
        return merge([*parts, side_panel(body, _rectangle((-5.45, 5.44), (1.22, 2.46)), 0.011, (4, 2))])
    for pane in PANES:
        if _is_door(pane):
            middle = 0.5 * (pane[0] + pane[1])
            parts += [
                side_panel(body, _rectangle(half, (0.50, 2.40)), 0.012, (7, 2), "right")
                for half in ((pane[0] + 0.05, middle - 0.04), (middle + 0.04, pane[1] - 0.05))
            ]
            parts.append(side_panel(body, _rectangle(pane, (1.22, 2.42)), 0.010, (6, 2), "left"))
        else:
            parts.append(side_panel(body, _rectangle(pane, (1.22, 2.42)), 0.010, (6, 2)))
    return merge(parts)


def _lamps(body: Mesh, fine: bool) -> dict[str, tuple[Mesh, str]]:
    cells = (3, 5) if fine else (2, 3)
    rise = 0.012 if fine else 0.02
    heads = [panel(body, _rectangle((0.74, 1.12), (0.56, 0.78)), FRONT, s, rise, cells=cells) for s in (1.0, -1.0)]
    tails = [panel(body, _rectangle((1.0, 1.14), (0.80, 1.36)), REAR, s, rise, cells=cells) for s in (1.0, -1.0)]
    return {"headlamps": (merge(heads), "headlamp"), "taillamps": (merge(tails), "taillamp")}


def _trim(body: Mesh) -> Mesh:
    """Return the black band of the windows, door frames, bumper edge, grille of the engine, wipers and gaps."""
    parts = [
        side_panel(body, _rectangle((-5.52, 5.50), (1.16, 2.50)), 0.005, (6, 12)),
        panel(body, _rectangle((-1.19, 1.19), (0.94, 2.80)), FRONT, 1.0, 0.004, cells=(11, 17)),
        panel(body, _rectangle((-1.04, 1.04), (1.56, 2.46)), REAR, 1.0, 0.004, cells=(2, 9)),
        panel(body, _rectangle((-1.18, 1.18), (0.36, 0.46)), FRONT, 1.0, 0.006, cells=(2, 13)),
        *(
            panel(body, _rectangle((-0.70, 0.70), (z, z + 0.045)), REAR, 1.0, 0.006, cells=(2, 5))
            for z in np.arange(0.92, 1.36, 0.075)
        ),
        *(panel(body, _rectangle((0.70, 1.15), (0.52, 0.82)), FRONT, s, 0.006, cells=(3, 5)) for s in (1.0, -1.0)),
        *(panel(body, _rectangle((0.97, 1.17), (0.76, 1.60)), REAR, s, 0.006, cells=(3, 4)) for s in (1.0, -1.0)),
    ]
    for a, b in DOORS:
        parts.append(side_panel(body, _rectangle((a, b), (0.34, 1.18)), 0.009, (4, 2), "right"))
    lines = [np.array([(x, 0.36), (x, 1.14)]) for x in (-5.0, -3.35, -1.7, -0.4, 1.0, 2.3, 4.2)]
    parts.append(strips(body, lines, 0.008, 0.002))
    parts += [bar((5.985, y0, 1.00), (5.90, y1, 1.75), 0.014, 5) for y0, y1 in ((0.12, 0.75), (-0.95, -0.32))]
    return merge(parts)


def _sign(body: Mesh) -> Mesh:
    """Return the lit destination signs at the front and above the first door."""
    digits = [
        panel(body, _rectangle(a, (2.54, 2.74)), FRONT, 1.0, 0.009, cells=(3, 5))
        for a in ((-0.95, -0.62), (-0.50, 0.95))
    ]
    return merge([*digits, side_panel(body, _rectangle((2.60, 3.60), (2.20, 2.36)), 0.014, (2, 2), "right")])


def _mirrors() -> tuple[Mesh, Mesh]:
    """Return both mirrors on arms ahead of the corners, and their glass."""
    profile = np.array([(0.0, -0.22), (0.07, -0.22), (0.10, -0.17), (0.10, 0.17), (0.07, 0.22), (0.0, 0.22)])
    housing = outward(revolve(profile, 10, "z")).moved((6.05, 1.36, 2.02))
    arm = [bar((5.80, 1.10, 2.62), (6.05, 1.30, 2.58), 0.028), bar((6.05, 1.30, 2.58), (6.05, 1.36, 2.22), 0.028)]
    left = merge([housing, *arm])
    glass = box((0.01, 0.17, 0.36), (5.948, 1.36, 2.02))
    return merge([left, left.mirrored_y()]), merge([glass, glass.mirrored_y()])


def _roof_units(fine: bool) -> Mesh:
    """Return the covers of air conditioning and batteries; they reach the outer height."""
    parts = []
    for x0, x1 in ((2.2, 4.6), (-4.9, -1.2)):
        outline = ((x0, 2.86), (x1, 2.86), (x1, 2.98), (x1 - 0.16, HEIGHT), (x0 + 0.16, HEIGHT), (x0, 2.98))
        parts.append(prism(outline, -0.86, 0.86))
    if fine:
        parts.append(box((0.8, 0.8, 0.06), (0.4, 0.0, 2.92)))
    return merge(parts)


def underbody(fine: bool) -> Mesh:
    """Return floor plate, axles, gearbox and frame of the bus; at the light level without differential and drive shaft.

    The axles stay at the light level: with the inner walls of the wheel houses they are corners that carry most of a
    bus's echo.
    """
    floor = box((9.0, 1.06, 0.03), (0.3, 0.0, 0.278))
    parts = [floor, box((1.4, 1.6, 0.10), (-4.6, 0.0, 0.255)), box((1.0, 0.9, 0.12), (-3.9, 0.0, 0.245))]
    for x in (FRONT_AXLE, REAR_AXLE):
        parts.append(bar((x, -0.86, 0.40), (x, 0.86, 0.40), 0.09, 10))
    if not fine:
        return merge(parts)
    ball = np.array([(0.0, -0.20), (0.14, -0.16), (0.20, 0.0), (0.14, 0.16), (0.0, 0.20)])
    parts.append(outward(revolve(ball, 12, "y")).moved((REAR_AXLE, 0.15, 0.42)))
    parts.append(bar((REAR_AXLE - 0.15, 0.15, 0.40), (-3.5, 0.0, 0.36), 0.05, 8))
    return merge(parts)


WHEELS = {
    "front_left": (FRONT_AXLE, True),
    "front_right": (FRONT_AXLE, False),
    "rear_left": (REAR_AXLE, True),
    "rear_right": (REAR_AXLE, False),
}
"""Name of each wheel -> x of its axle [m], and whether it is on the left."""


def wheels(light: bool = False) -> dict[str, tuple[Mesh, str]]:
    """Return the shapes of the wheels; twin tyres at the rear."""
    return wheel_parts(WHEELS, FRONT_WHEEL, REAR_WHEEL, OUTER, light, light_role="tyre")


def build(fine: bool = True) -> dict[str, tuple[Mesh, str]]:
    """Return the parts of the bus: name -> (mesh, role)."""
    painted, floor = loft(BODY if fine else LIGHT_BODY, fine)
    body = merge([painted, floor])
    parts: dict[str, tuple[Mesh, str]] = {
        "body": (painted, "paint"),
        "glass": (_glass(body, fine), "glass"),
        "roof_units": (_roof_units(fine), "roof_cover"),
        **_lamps(body, fine),
        **NumberPlates(LENGTH / 2, 0.55, 0.66, 0.06, 7).parts(fine),
        "underbody": (merge([floor, underbody(fine)]), "underbody"),
    }
    if not fine:
        return parts | wheels(True)
    mirrors, mirror_glass = _mirrors()
    markers = [side_panel(body, _rectangle((x0, x0 + 0.10), (0.88, 0.92)), 0.010) for x0 in (-4.3, -1.6, 1.2, 4.0)]
    ends = [panel(body, _rectangle((1.0, 1.14), (1.40, 1.56)), REAR, s, 0.010, cells=(2, 3)) for s in (1.0, -1.0)]
    stripe = [side_panel(body, _rectangle(a, (0.62, 0.74)), 0.006, (2, 3)) for a in ((-5.3, -3.24), (-2.0, 2.66))]
    return parts | {
        "trim": (_trim(body), "trim"),
        "indicators": (merge([*markers, *ends]), "indicator"),
        "signs": (_sign(body), "led_sign"),
        "stripe": (merge(stripe), "stripe_paint"),
        "mirrors": (mirrors, "trim"),
        "mirror_glass": (mirror_glass, "mirror_glass"),
        **wheels(),
    }
