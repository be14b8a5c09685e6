"""A car at the detailed level: lofted body, cabin, wheels, lamps and trim."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...geometry.decal import panel, strips
from ...geometry.mesh import Mesh, merge
from . import interior
from .cabin import cabin
from .fittings import handles, mirror, shut_lines, wheel
from .measures import WHEELS, CarShape
from .shell import shell

SIDES = {"left": 1.0, "right": -1.0}


def _indicators(shape: CarShape, whole: Mesh, side: float) -> Mesh:
    """Return the indicators of a side: at the outer end of the head lamp, and below the tail lamp."""
    w, lamp, low = shape.width / 2, shape.lamp_height, shape.tail_lamp[0]
    ahead = [(0.84 * w, lamp - 0.025), (0.92 * w, lamp - 0.015), (0.93 * w, lamp + 0.055), (0.85 * w, lamp + 0.045)]
    inner = shape.extra.get("tail_lamp_inner", 0.58)
    behind = [(inner * w, low - 0.045), (0.91 * w, low - 0.04), (0.915 * w, low - 0.005), (inner * w, low - 0.008)]
    front, rear = np.array([-1.0, 0.0, 0.0]), np.array([1.0, 0.0, 0.0])
    return merge(
        [panel(whole, ahead, front, side, 0.012, cells=(3, 3)), panel(whole, behind, rear, side, 0.007, cells=(2, 5))]
    )


def build(
    shape: CarShape, turning_wheels: bool = False, mirrors_apart: bool = False, occupants: Sequence[str] | None = None
) -> dict[str, tuple[Mesh, str]]:
    """Return the parts of a car: name -> (mesh, role); the role names the kind of material.

    Roles: ``paint``, ``glass`` (``pane`` where there is an inside), ``trim``, ``tyre``, ``rim``, ``headlamp``,
    ``taillamp``, ``chrome``, ``plate``. With `turning_wheels` each tyre and rim is a part of its own
    (``wheel_front_left_tyre``), about the centre of `wheel_centre`; else all tyres are one part and all rims another.
    With `mirrors_apart` the outside mirrors are a part of their own, not of the body. With `occupants`, the places that
    are taken (`interior.seats`), there is an inside (roles ``interior``, ``seat``, ``clothes``, ``skin``, ``hair``);
    without, the deck goes on below the panes.
    """
    lower, dark = shell(shape, () if occupants is None else [interior.well(shape)])
    painted, glazed, black = cabin(shape)
    body = merge([lower, painted])
    whole = merge([lower, dark, painted, glazed, black])
    wheels = {
        name: wheel(shape, shape.front_axle if front else shape.rear_axle, left)
        for name, (front, left) in WHEELS.items()
    }
    tyres, rims, wells = (merge([w[k] for w in wheels.values()]) for k in range(3))
    left_mirror = mirror(shape)
    mirrors = [left_mirror, left_mirror.mirrored_y()]
    w, lamp = shape.width / 2, shape.lamp_height
    front, rear = np.array([-1.0, 0.0, 0.0]), np.array([1.0, 0.0, 0.0])
    heads, tails, trims, chromes, plates = [], [], [], [], []
    lo, hi = shape.tail_lamp
    for side in (1.0, -1.0):
        outline = [
            (0.52 * w, lamp - 0.035),
            (0.93 * w, lamp - 0.005),
            (0.95 * w, lamp + 0.075),
            (0.55 * w, lamp + 0.03),
        ]
        heads.append(panel(whole, outline, front, side, rise=0.006, with_uv=True))
        inner = shape.extra.get("tail_lamp_inner", 0.58)
        outline = [(inner * w, lo), (0.92 * w, lo + 0.01), (0.915 * w, hi), ((inner - 0.03) * w, hi - 0.03)]
        tails.append(panel(whole, outline, rear, side, rise=0.006, with_uv=True))
        trims.append(
            panel(
                whole, [(0.62 * w, 0.31), (0.88 * w, 0.33), (0.89 * w, 0.42), (0.66 * w, 0.40)], front, side, rise=0.004
            )
        )
    trims.append(
        panel(
            whole,
            [(-0.46 * w, lamp - 0.10), (0.46 * w, lamp - 0.10), (0.50 * w, lamp + 0.015), (-0.50 * w, lamp + 0.015)],
            front,
            1.0,
            0.004,
        )
    )
    trims.append(
        panel(whole, [(-0.50 * w, 0.27), (0.50 * w, 0.27), (0.56 * w, 0.40), (-0.56 * w, 0.40)], front, 1.0, rise=0.004)
    )
    top, reach = (0.46, 0.80) if shape.cladding else (0.40, 0.72)
    trims.append(
        panel(
            whole, [(-reach * w, 0.335), (reach * w, 0.335), (reach * w, top), (-reach * w, top)], rear, 1.0, rise=0.008
        )
    )
    chromes.append(
        panel(
            whole,
            [(-0.07, lamp - 0.06), (0.07, lamp - 0.06), (0.07, lamp - 0.02), (-0.07, lamp - 0.02)],
            front,
            1.0,
            rise=0.010,
        )
    )
    for direction, z in ((front, 0.475), (rear, shape.extra.get("plate_z", 0.56))):
        plates.append(
            panel(
                whole,
                [(-0.26, z - 0.055), (0.26, z - 0.055), (0.26, z + 0.055), (-0.26, z + 0.055)],
                direction,
                1.0,
                rise=0.005,
                with_uv=True,
            )
        )
    for z in (0.49, hi + 0.012):
        trims.append(
            panel(
                whole, [(-0.72 * w, z), (0.72 * w, z), (0.72 * w, z + 0.008), (-0.72 * w, z + 0.008)], rear, 1.0, 0.002
            )
        )
    trims.append(strips(whole, shut_lines(shape), 0.007, 0.0015))
    chromes.append(strips(whole, handles(shape), 0.026, 0.016))
    parts = {
        "body": (merge([body, *mirrors]), "paint"),
        "glass": (glazed, "glass" if occupants is None else "pane"),
        "trim": (merge([dark, black, wells, *trims]), "trim"),
        "tyres": (tyres, "tyre"),
        "rims": (rims, "rim"),
        "headlamps": (merge(heads), "headlamp"),
        "taillamps": (merge(tails), "taillamp"),
        "chrome": (merge(chromes), "chrome"),
        "plates": (merge(plates), "plate"),
    }
    if mirrors_apart:
        parts |= {"body": (body, "paint"), "mirrors": (merge(mirrors), "paint")}
    if turning_wheels:
        del parts["tyres"], parts["rims"]
        for name, (tyre, rim, _) in wheels.items():
            parts |= {f"wheel_{name}_tyre": (tyre, "tyre"), f"wheel_{name}_rim": (rim, "rim")}
    if occupants is not None:
        people = interior.occupants(shape, occupants) if occupants else {}
        parts |= {"interior": (interior.trim(shape), "interior"), "seats": (interior.upholstery(shape), "seat")}
        parts |= {f"indicators_{name}": (_indicators(shape, whole, side), "indicator") for name, side in SIDES.items()}
        parts |= {f"people_{kind}": (mesh, kind) for kind, mesh in people.items()}
    return parts
