"""A panel van with a high roof: bonnet, cab doors, sliding door, two rear doors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..geometry.decal import panel, strips
from ..geometry.holes import cut_out, shrunk
from ..geometry.mesh import Mesh, box, merge, outward, revolve
from .body_loft import BodyShape, loft, side_panel
from .cars.interior import Seat
from .driving_place import Parts, driving_place
from .number_plates import NumberPlates
from .vehicle_parts import bar, car_underbody
from .wheels import WheelShape, wheel_parts

LENGTH, WIDTH, HEIGHT = 5.93, 2.02, 2.60
FRONT_AXLE, REAR_AXLE = 1.96, -1.70
WHEEL = WheelShape(radius=0.345, rim_radius=0.215, tyre_width=0.225, bolts=5, segments=24)
OUTER = WIDTH / 2 - 0.035
"""abs(y) of the outer walls of the tyres [m]."""

BODY = BodyShape(
    front=LENGTH / 2 - 0.03, rear=-LENGTH / 2 + 0.02, width=WIDTH - 0.02, floor=0.27,
    top=((-2.95, 2.52), (-2.5, 2.585), (-1.0, 2.60), (0.3, 2.60), (0.85, 2.545), (1.12, 2.36), (1.95, 1.33), (2.1,
    1.255), (2.55, 1.13), (2.95, 0.98)),
    arches=((FRONT_AXLE, 0.345, 0.42), (REAR_AXLE, 0.345, 0.42)), tunnel=0.70, edge=0.13,
    lean=((0.0, 0.93), (0.45, 0.985), (0.9, 1.0), (1.3, 0.995), (2.0, 0.955), (2.6, 0.915)),
    front_shift=((0.0, 0.10), (0.45, 0.0), (0.75, 0.02), (1.2, 0.16), (2.6, 0.3)), rear_shift=((0.0, 0.04), (0.5, 0.0),
    (1.2, 0.0), (2.6, 0.07)),
    front_bow=0.27, rear_bow=0.03, bow_power=2.4, bow_reach=0.9, end_radius=0.08,
    more_stations=(2.25, 2.1, 1.95, 1.8, 1.6, 1.4, 1.25, 1.12, 1.0, 0.85, 0.65),
)  # fmt: skip # a table
LIGHT = (2.1, 1.95, 1.12, 0.75)
"""Stations of the light level."""
WINDSCREEN = ((-0.80, 1.33), (0.80, 1.33), (0.70, 2.28), (-0.70, 2.28))
DOOR_WINDOW = ((0.62, 1.32), (1.66, 1.36), (1.10, 2.06), (0.62, 2.06))
TURN = 0.17
"""Of mirrors towards the driver [rad]."""
FRONT, REAR = np.array([-1.0, 0.0, 0.0]), np.array([1.0, 0.0, 0.0])


def _across(
    body: Mesh,
    outline: tuple[tuple[float, float], ...],
    direction: np.ndarray,
    cells: tuple[int, int],
    rise: float = 0.006,
) -> Mesh:
    return panel(body, outline, direction, 1.0, rise, cells=cells)


def _pair(
    body: Mesh,
    outline: tuple[tuple[float, float], ...],
    direction: np.ndarray,
    cells: tuple[int, int],
    rise: float = 0.006,
) -> Mesh:
    return merge([panel(body, outline, direction, side, rise, cells=cells) for side in (1.0, -1.0)])


def cab_glass(body: Mesh, fine: bool) -> Mesh:
    """Return the wind screen and the windows of the cab's doors."""
    many, few = ((14, 10), (4, 6)) if fine else ((5, 3), (2, 3))
    screen = _across(body, WINDSCREEN, FRONT, many, 0.007 if fine else 0.02)
    return merge([screen, side_panel(body, DOOR_WINDOW, 0.006 if fine else 0.012, few)])


def opened(mesh: Mesh) -> Mesh:
    """Return a part of the body without what the panes of the cab stand before."""
    found = cut_out(mesh, shrunk(WINDSCREEN, 0.02), "x", 1.0, 0.9)
    for side in (1.0, -1.0):
        found = cut_out(found, shrunk(DOOR_WINDOW, 0.02), "y", side, 0.6)
    return found


def inside(wall: float, height: float, hips: float) -> Parts:
    """Return dashboard, seats and driver, whose hips are at x, before a wall at x, of a height [m]."""
    partition = box((0.03, 1.72, height - 0.50), (wall, 0.0, 0.5 * height + 0.20))
    return driving_place(Seat(hips, 0.46, 1.04), 0.78, 1.26, [partition])


def _rear_glass(body: Mesh, fine: bool) -> Mesh:
    rear = ((0.06, 1.32), (0.78, 1.32), (0.72, 1.98), (0.06, 1.98))
    return _pair(body, rear, REAR, (4, 6) if fine else (2, 3))


def headlamps(body: Mesh, fine: bool) -> Mesh:
    """Return both head lamps."""
    head = ((0.54, 0.80), (0.90, 0.84), (0.86, 1.10), (0.60, 0.96))
    return _pair(body, head, FRONT, (4, 6) if fine else (2, 3), 0.008 if fine else 0.02)


def _lamps(body: Mesh, fine: bool) -> dict[str, tuple[Mesh, str]]:
    tail = ((0.87, 0.72), (0.985, 0.72), (0.975, 1.20), (0.87, 1.20))
    tails = _pair(body, tail, REAR, (4, 6) if fine else (2, 3), 0.008 if fine else 0.02)
    return {"headlamps": (headlamps(body, fine), "headlamp"), "taillamps": (tails, "taillamp")}


DOOR_GAP = np.array([(1.48, 0.80), (1.50, 1.05), (1.72, 1.30), (1.72, 1.36), (1.06, 2.16), (0.50, 2.16)])
"""Front and upper gap of a cab's door: x and z [m]."""


def front_trim(body: Mesh) -> Mesh:
    """Return bumper, lamp frames, grille and wipers."""
    return merge(
        [
            _across(body, ((-0.93, 0.30), (0.93, 0.30), (0.95, 0.56), (-0.95, 0.56)), FRONT, (4, 15), 0.014),
            _pair(body, ((0.50, 0.77), (0.925, 0.82), (0.885, 1.14), (0.57, 0.99)), FRONT, (4, 6), 0.004),
            *(
                _across(body, ((-0.50, z), (0.50, z), (0.50, z + 0.045), (-0.50, z + 0.045)), FRONT, (2, 9), 0.012)
                for z in (0.70, 0.765, 0.83)
            ),
            *(
                bar((x0, y0, 1.31), (x1, y1, 1.37), 0.010, 5)
                for x0, y0, x1, y1 in ((2.06, -0.10, 1.945, -0.68), (2.06, 0.62, 1.945, 0.06))
            ),
        ]
    )


def _trim(body: Mesh) -> Mesh:
    """Return bumpers, grille, rubbing strips, door gaps, wipers and the rear step."""
    return merge(
        [
            front_trim(body),
            _across(body, ((-0.97, 0.33), (0.97, 0.33), (0.97, 0.55), (-0.97, 0.55)), REAR, (2, 9), 0.012),
            side_panel(body, ((-1.20, 0.66), (1.46, 0.66), (1.46, 0.76), (-1.20, 0.76)), 0.010, (2, 8)),
            side_panel(body, ((-2.86, 0.66), (-2.16, 0.66), (-2.16, 0.76), (-2.86, 0.76)), 0.010, (2, 4)),
            side_panel(body, ((-1.24, 0.30), (1.50, 0.30), (1.50, 0.38), (-1.24, 0.38)), 0.006, (2, 6)),
            strips(
                body,
                [
                    np.array([(0.50, 0.40), (0.50, 2.28)]),
                    DOOR_GAP,
                    np.array([(-0.85, 0.80), (-0.85, 2.28)]),
                    np.array([(-0.85, 2.28), (0.50, 2.28)]),
                    np.array([(-2.75, 1.35), (-0.85, 1.35)]),
                ],
                0.010,
                0.002,
            ),
            panel(
                body, ((-0.008, 0.58), (0.008, 0.58), (0.008, 2.42), (-0.008, 2.42)), REAR, 1.0, 0.002, cells=(10, 2)
            ),
            strips(
                body, [np.array([(0.56, 1.12), (0.74, 1.12)]), np.array([(0.30, 1.12), (0.46, 1.12)])], 0.035, 0.025
            ),
        ]
    )


def mirrors() -> tuple[Mesh, Mesh]:
    """Return housings with their arms, and mirror glass."""
    profile = np.array([(0.0, -0.20), (0.06, -0.20), (0.09, -0.16), (0.095, 0.15), (0.06, 0.20), (0.0, 0.20)])
    housing = outward(revolve(profile, 10, "z")).moved((1.50, 1.15, 1.42))
    arms = [bar((1.52, 0.92, z), (1.52, 1.10, z), 0.022) for z in (1.30, 1.52)]
    left = merge([housing, *arms])
    glass = box((0.01, 0.16, 0.32)).moved((1.408, 1.15, 1.42), yaw=TURN)
    return merge([left, left.mirrored_y()]), merge([glass, glass.mirrored_y()])


WHEELS = {
    "front_left": (FRONT_AXLE, True),
    "front_right": (FRONT_AXLE, False),
    "rear_left": (REAR_AXLE, True),
    "rear_right": (REAR_AXLE, False),
}
"""Name of each wheel -> x of its axle [m], and whether it is on the left."""


def wheels(light: bool = False) -> dict[str, tuple[Mesh, str]]:
    """Return the shapes of the wheels."""
    return wheel_parts(WHEELS, WHEEL, WHEEL, OUTER, light)


def build(fine: bool = True) -> dict[str, tuple[Mesh, str]]:
    """Return the parts of the van: name -> (mesh, role)."""
    painted, floor = loft(BODY if fine else replace(BODY, more_stations=LIGHT), fine)
    body = merge([painted, floor])
    under = car_underbody(FRONT_AXLE, REAR_AXLE, WIDTH, LENGTH, BODY.floor, WHEEL.radius)
    parts: dict[str, tuple[Mesh, str]] = {
        "body": (opened(painted) if fine else painted, "paint"),
        **_lamps(body, fine),
        **NumberPlates(LENGTH / 2, 0.45, 0.66, 0.06, 5).parts(fine),
    }
    rear = _rear_glass(body, fine)
    if not fine:
        parts["glass"] = (merge([cab_glass(body, fine), rear]), "glass")
        return parts | {"trim": (floor, "trim"), "underbody": (under["floor"], "underbody"), **wheels(True)}
    parts |= {"glass": (cab_glass(body, fine), "pane"), "rear_glass": (rear, "glass"), **inside(0.36, 2.2, 1.02)}
    mirror_parts, mirror_glass = mirrors()
    return parts | {
        "trim": (merge([floor, _trim(body)]), "trim"),
        "indicators": (side_panel(body, ((1.42, 0.90), (1.50, 0.90), (1.50, 0.94), (1.42, 0.94)), 0.008), "indicator"),
        "mirrors": (mirror_parts, "trim"),
        "mirror_glass": (mirror_glass, "mirror_glass"),
        "underbody": (merge(list(under.values())), "underbody"),
        **wheels(),
    }
