"""A van with a load box: the cab of the panel van before a box on a frame, twin rear wheels."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..geometry.decal import strips
from ..geometry.mesh import Mesh, box, merge
from . import load_box, van
from .body_loft import loft
from .number_plates import NumberPlates
from .vehicle_parts import bar, car_underbody, cross_bar, deflector, prism, skewed
from .wheels import WheelShape, wheel_parts

LENGTH, WIDTH, HEIGHT = 6.60, 2.16, 3.05
SHIFT = LENGTH / 2 - van.LENGTH / 2
"""How far the cab stands before that of the panel van, about the middle of the vehicle [m]."""
FRONT_AXLE, REAR_AXLE = van.FRONT_AXLE + SHIFT, -1.75
REAR_WHEEL = WheelShape(radius=0.345, rim_radius=0.215, tyre_width=0.195, twin=0.225, bolts=5, segments=24)
OUTER = van.OUTER
BOX = ((-LENGTH / 2 + 0.03, 0.92), (0.86, HEIGHT))
"""x and z of the load box, from and to [m]."""
_START = 0.62
"""x of the cab's rear wall about the middle of the panel van [m]."""
CAB = replace(
    van.BODY, rear=_START - 0.02, arches=van.BODY.arches[:1], rear_shift=((0.0, 0.0), (2.6, 0.0)), rear_bow=0.0,
    top=((0.5, 2.28), (0.85, 2.30), (1.12, 2.22), (1.95, 1.33), (2.1, 1.255), (2.55, 1.13), (2.95, 0.98)),
    more_stations=tuple(x for x in van.BODY.more_stations if x > 0.7),
)  # fmt: skip # a table
WHEELS = {
    "front_left": (FRONT_AXLE, True), "front_right": (FRONT_AXLE, False), "rear_left": (REAR_AXLE, True),
    "rear_right": (REAR_AXLE, False),
}  # fmt: skip # a table
"""Name of each wheel -> x of its axle [m], and whether it is on the left."""


def _both(part: Mesh) -> Mesh:
    return merge([part, part.mirrored_y()])


def _rails() -> Mesh:
    """Return both rails of the ladder frame."""
    (rear, front), (floor, _) = BOX
    return _both(skewed(box((front - rear + 0.3, 0.07, 0.20), (0.5 * (front + rear) + 0.1, 0.42, floor - 0.18))))


def _under_run() -> Mesh:
    """Return the bar below the rear doors: round, since a flat one makes corners with the wheels before it."""
    x, half = BOX[0][0] + 0.1, WIDTH / 2 - 0.1
    return bar((x, -half, 0.46), (x, half, 0.46), 0.055, 12)


def _frame() -> Mesh:
    """Return the ladder frame behind the cab with its cross members, and the bar below the rear doors."""
    (rear, front), (floor, _) = BOX
    parts = [_rails()]
    parts += [cross_bar(x, WIDTH / 2 - 0.08, floor - 0.005, 0.07, 0.07) for x in np.arange(rear + 0.2, front, 0.7)]
    parts += [bar((REAR_AXLE, -0.75, 0.345), (REAR_AXLE, 0.75, 0.345), 0.05, 8)]
    parts += [
        _under_run(),
        _both(bar((rear + 0.12, 0.5, 0.45), (rear + 0.12, 0.5, 0.75), 0.03, 12)),
    ]
    return merge(parts)


def _deflector() -> Mesh:
    """Return the wedge over the cab that reaches up to the box."""
    x = BOX[0][1]
    return deflector(((x, 2.26), (x + 0.78, 2.29), (x + 0.70, 2.42), (x + 0.42, 2.72), (x, 2.94)), 0.86)


def build(fine: bool = True) -> dict[str, tuple[Mesh, str]]:
    """Return the parts of the van: name -> (mesh, role)."""
    painted, floor = loft(CAB if fine else replace(CAB, more_stations=(2.1, 1.95, 1.12, 0.75)), fine)
    body = merge([painted, floor])

    def ahead(mesh: Mesh) -> Mesh:
        return mesh.moved((SHIFT, 0.0, 0.0))

    panels, frame, marking = load_box.load_box(*BOX, WIDTH)
    rear, low = BOX[0][0], BOX[1][0]
    tail = _both(box((0.05, 0.26, 0.11), (rear + 0.03, 0.82, 0.72)))
    parts: dict[str, tuple[Mesh, str]] = {
        "cab": (merge([ahead(van.opened(painted) if fine else painted), _deflector()]), "paint"),
        "load_box": (panels, "box_panel"),
        "glass": (ahead(van.cab_glass(body, fine)), "pane" if fine else "glass"),
        "headlamps": (ahead(van.headlamps(body, fine)), "headlamp"),
        "taillamps": (tail, "taillamp"),
        **NumberPlates(LENGTH / 2, 0.45, 0.60, 0.06, 11).parts(fine),
    }
    if not fine:
        return parts | {
            "load_box": (load_box.body(*BOX, WIDTH), "box_panel"),
            "chassis": (merge([ahead(floor), _rails(), _under_run()]), "chassis"),
            **wheel_parts(WHEELS, van.WHEEL, REAR_WHEEL, OUTER, True),
        }
    mirrors, mirror_glass = van.mirrors()
    under = car_underbody(van.FRONT_AXLE, van.REAR_AXLE, van.WIDTH, van.LENGTH, van.BODY.floor, van.WHEEL.radius)
    gaps = [np.array([(0.68, 0.40), (0.68, 2.2)]), van.DOOR_GAP]
    trim = [van.front_trim(body), strips(body, gaps, 0.010, 0.002)]
    guards = [_both(prism(_guard(REAR_AXLE), 0.52, OUTER + 0.02))]
    markers = [_both(box((0.10, 0.012, 0.04), (x, WIDTH / 2 - 0.015, low + 0.06))) for x in (-2.6, -1.0, 0.5)]
    return parts | {
        "frame": (frame, "frame_aluminium"),
        "marking": (marking, "contour_marking"),
        "chassis": (_frame(), "chassis"),
        "underbody": (ahead(merge([under[name] for name in ("subframe", "arm_+1", "arm_-1")])), "underbody"),
        "trim": (merge([ahead(merge([floor, *trim])), *guards]), "trim"),
        "indicators": (merge(markers), "indicator"),
        "mirrors": (ahead(mirrors), "trim"),
        "mirror_glass": (ahead(mirror_glass), "mirror_glass"),
        **{name: (ahead(mesh), role) for name, (mesh, role) in van.inside(0.63, 2.0, 1.13).items()},
        **wheel_parts(WHEELS, van.WHEEL, REAR_WHEEL, OUTER, False),
    }


def _guard(x: float) -> list[tuple[float, float]]:
    """Return the outline of a mudguard over a wheel: an arc of a thin sheet, star-shaped about no point of its own."""
    angle = np.radians(np.linspace(25.0, 155.0, 9))
    outer = np.column_stack([x + 0.44 * np.cos(angle), 0.345 + 0.44 * np.sin(angle)])
    return [(float(a), float(b)) for a, b in [*outer, (x - 0.40, 0.56), (x + 0.40, 0.56)]]
