"""A tram of one car on two bogies: a single-ended body with three doors on the right, wheels of steel, a pantograph."""

from __future__ import annotations

import numpy as np

from ..geometry.mesh import Mesh, box, merge, outward, revolve
from . import bus
from .body_loft import BodyShape, loft, side_panel
from .bus import BusShape
from .bus_inside import Saloon, inside, opened
from .cars.interior import Seat
from .vehicle_parts import bar
from .wheels import WheelShape

BOGIES = (3.2, -3.2)
"""x of the middles of the bogies [m]."""
AXLES = (0.95, -0.95)
"""x of the axles about the middle of their bogie [m]."""
RADIUS, TRACK = 0.35, 1.435
"""Of the wheels, and distance of the rails' inner edges [m]."""
_BODY = BodyShape(
    front=7.0, rear=-7.0, width=2.38, floor=0.36,
    top=((-7.0, 3.02), (-6.4, 3.12), (5.6, 3.12), (6.4, 3.06), (7.0, 2.92)), arches=(), tunnel=0.6, edge=0.22,
    lean=((0.0, 0.96), (0.6, 1.0), (1.3, 1.0), (3.1, 0.93)),
    front_shift=((0.0, 0.10), (0.6, 0.0), (1.2, 0.02), (3.1, 0.45)), rear_shift=((0.0, 0.10), (0.6, 0.0), (1.3, 0.02),
    (3.1, 0.25)),
    front_bow=0.30, rear_bow=0.20, bow_power=3.2, bow_reach=1.2, end_radius=0.12,
    more_stations=(6.8, 6.6, 6.3, 6.0, 5.7, -6.8, -6.6, -6.3, -6.0, -5.7),
)  # fmt: skip # a table
SHAPE = BusShape(
    length=14.0, width=2.40, height=3.25, front_axle=BOGIES[0], rear_axle=BOGIES[1],
    wheel=WheelShape(radius=RADIUS, rim_radius=0.30, tyre_width=0.11, bolts=0), body=_BODY, light_body=_BODY,
    doors=((4.35, 5.55), (-0.65, 0.65), (-5.55, -4.35)),
    panes=((-5.55, -4.35), (-4.27, -2.52), (-2.44, -0.72), (-0.65, 0.65), (0.72, 2.44), (2.52, 4.27), (4.35, 5.55)),
    windows=(1.45, 2.45), door_windows=(0.70, 2.45), screen=(0.84, 1.32, 2.42), back=(0.80, 1.45, 2.42),
    display=(2.52, 2.72), beside_door=None, roof=((-1.6, 1.0),), lines=(-3.9, -2.4, -0.7, 0.7, 2.4, 3.9),
    stripe=(((-5.3, 5.3),), (0.98, 1.22)), tail=(0.86, 1.10), back_rows=6, lamp_rise=0.03,
    saloon=Saloon(
        0.86, Seat(5.62, 0.0, 1.40), (-5.1, 3.9), 0.9, ((4.35, 5.55), (-0.65, 0.65), (-5.55, -4.35)), 1.08, True
    ),
)  # fmt: skip # a table


def _wheel_centres() -> dict[str, tuple[float, float, float]]:
    found = {}
    for bogie, name in zip(BOGIES, ("front", "rear"), strict=True):
        for axle, which in zip(AXLES, ("first", "second"), strict=True):
            for side, sign in (("left", 1.0), ("right", -1.0)):
                found[f"{name}_{which}_{side}"] = (bogie + axle, sign * (TRACK / 2 + 0.03), RADIUS)
    return found


WHEEL_CENTRES = _wheel_centres()
"""Name of each wheel -> its middle [m]."""


def _wheels(fine: bool) -> dict[str, tuple[Mesh, str]]:
    """Return dished disks with a tyre of steel; flanges run in the grooves of the rails and are not drawn.

    A flat disk would make a corner reflector with every face across the car, of 30 dBsm at all azimuths between.
    """
    profile = [(0.0, -0.08), (0.11, -0.08), (0.13, -0.05), (0.285, -0.02), (0.295, -0.06), (RADIUS, -0.06)]
    profile += [(RADIUS, 0.07), (0.295, 0.07), (0.285, 0.05), (0.13, 0.02), (0.11, 0.08), (0.0, 0.08)]
    plain = [(0.0, -0.08), (RADIUS, -0.02), (RADIUS, 0.05), (0.0, 0.0)]
    found: dict[str, tuple[Mesh, str]] = {}
    for name, (x, y, z) in WHEEL_CENTRES.items():
        disk = outward(revolve(np.array(profile if fine else plain), 20 if fine else 12, "y"))
        disk = (disk if y > 0.0 else disk.mirrored_y()).moved((x, y, z))
        found[f"wheel_{name}_tyre"] = (disk, "chrome")
    return found


def _bogies(fine: bool) -> Mesh:
    """Return frames, axles and motors of the bogies, and the floor between them.

    Frames are round, as cast ones are: boxes at right angles would be corner reflectors.
    """
    parts = [box((3.4, 1.6, 0.16), (0.0, 0.0, 0.34))]
    for x in BOGIES:
        parts += [bar((x - 1.25, s * 0.92, 0.42), (x + 1.25, s * 0.92, 0.42), 0.08, 12) for s in (1.0, -1.0)]
        parts.append(bar((x, -0.85, 0.46), (x, 0.85, 0.46), 0.08, 12))
        if fine:
            parts += [bar((x + a, -0.74, RADIUS), (x + a, 0.74, RADIUS), 0.07, 8) for a in AXLES]
            parts += [bar((x + 0.55 * a, -0.35, 0.40), (x + 0.55 * a, 0.35, 0.40), 0.17, 14) for a in AXLES]
    return merge(parts)


def _pantograph() -> Mesh:
    """Return the lowered pantograph on the roof."""
    z = SHAPE.height
    foot = [bar((x, -0.55, z - 0.10), (x, 0.55, z - 0.10), 0.03, 6) for x in (1.6, 2.6)]
    arms = [bar((1.6, s * 0.45, z - 0.10), (3.0, s * 0.35, z - 0.04), 0.025, 6) for s in (1.0, -1.0)]
    arms += [bar((3.0, s * 0.35, z - 0.04), (1.9, s * 0.25, z - 0.03), 0.02, 6) for s in (1.0, -1.0)]
    bow = box((0.28, 1.6, 0.03), (1.95, 0.0, z - 0.015))
    return merge([*foot, *arms, bow])


def build(fine: bool = True) -> dict[str, tuple[Mesh, str]]:
    """Return the parts of the tram: name -> (mesh, role)."""
    painted, floor = loft(_BODY, fine)
    body = merge([painted, floor])
    parts: dict[str, tuple[Mesh, str]] = {
        "body": (opened(painted, SHAPE.openings, SHAPE.width / 2, SHAPE.length / 2) if fine else painted, "paint"),
        "glass": (bus.glass(SHAPE, body, fine), "pane" if fine else "glass"),
        "roof_units": (_roof(), "roof_cover"),
        **bus.lamps(SHAPE, body, fine),
        "underbody": (merge([floor, _bogies(fine)]), "underbody"),
        **_wheels(fine),
    }
    if not fine:
        return parts
    stripe = [side_panel(body, bus.rectangle(a, SHAPE.stripe[1]), 0.006, (2, 3)) for a in SHAPE.stripe[0]]
    return parts | {
        "pantograph": (_pantograph(), "chrome"),
        "trim": (bus.trim(SHAPE, body), "trim"),
        "signs": (bus.sign(SHAPE, body), "led_sign"),
        "stripe": (merge(stripe), "stripe_paint"),
        **inside(SHAPE.saloon),
    }


def _roof() -> Mesh:
    return bus.roof_units(SHAPE, False)
