"""Wheels of vans, lorries and buses: tyres, disks and twin tyres, about an axle along y."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..geometry.mesh import Array, Mesh, merge, outward, revolve

DISH = 0.12
"""Slope of the sides of a light wheel."""


@dataclass(frozen=True)
class WheelShape:
    """Measures of a wheel [m].

    Outer radius, radius of the rim, width of a tyre, distance of the middles of twin tyres (0: one).
    """

    radius: float
    rim_radius: float
    tyre_width: float
    twin: float = 0.0
    bolts: int = 10
    segments: int = 28


def _tyre(shape: WheelShape) -> Mesh:
    r, rim, half = shape.radius, shape.rim_radius, shape.tyre_width / 2
    wall = r - rim
    profile = np.array(
        [
            (rim, -0.80 * half),
            (rim + 0.25 * wall, -half),
            (r - 0.28 * wall, -half),
            (r - 0.05 * wall, -0.86 * half),
            (r, -0.70 * half),
            (r, 0.70 * half),
            (r - 0.05 * wall, 0.86 * half),
            (r - 0.28 * wall, half),
            (rim + 0.25 * wall, half),
            (rim, 0.80 * half),
        ]
    )
    return outward(revolve(np.vstack([profile, profile[:1]]), shape.segments, "y"))


def _disk(shape: WheelShape) -> Mesh:
    """Return rim, disk, hub and bolts; the outside looks along +y.

    The disk of twin wheels lies deep, with a hub that stands out.
    """
    rim, half, s = shape.rim_radius, shape.tyre_width / 2, shape.segments // 2
    deep = 0.15 * half if shape.twin else 0.72 * half
    hub = 0.92 * half if shape.twin else 1.0 * half
    profile = np.array(
        [
            (0.0, -0.7 * half),
            (rim * 0.97, -0.8 * half),
            (rim * 0.99, 0.84 * half),
            (rim * 0.93, 0.86 * half),
            (rim * 0.88, deep * 0.75),
            (rim * 0.62, deep),
            (rim * 0.46, deep * 1.02),
            (rim * 0.40, hub * 0.9),
            (rim * 0.30, hub),
            (0.0, hub),
        ]
    )
    parts = [outward(revolve(profile, s * 2, "y"))]
    for k in range(shape.bolts):
        angle = 2 * np.pi * k / shape.bolts
        centre = (0.54 * rim * np.cos(angle), deep * 1.01 - 0.004, 0.54 * rim * np.sin(angle))
        nut = np.array([(0.0, 0.0), (0.055 * rim, 0.0), (0.045 * rim, 0.07 * rim), (0.0, 0.07 * rim)])
        parts.append(outward(revolve(nut, 5, "y")).moved(centre))
    return merge(parts)


def wheel(shape: WheelShape, x: float, outer: float, left: bool) -> tuple[Mesh, Mesh]:
    """Return tyre (both tyres of a twin wheel) and rim of a wheel whose outer wall is at abs(y) = `outer` [m]."""
    tyre, rim = _tyre(shape), _disk(shape)
    middle = outer - shape.tyre_width / 2
    tyres, rims = [tyre.moved((0.0, middle, 0.0))], [rim.moved((0.0, middle, 0.0))]
    if shape.twin:
        inner = np.array([(0.0, -0.7), (0.97, -0.8), (0.99, 0.8), (0.0, 0.7)]) * [
            shape.rim_radius,
            shape.tyre_width / 2,
        ]
        tyres.append(tyre.moved((0.0, middle - shape.twin, 0.0)))
        rims.append(outward(revolve(inner, shape.segments, "y")).moved((0.0, middle - shape.twin, 0.0)))
    both = [merge(tyres), merge(rims)]
    placed = [part if left else part.mirrored_y() for part in both]
    return placed[0].moved((x, 0.0, shape.radius)), placed[1].moved((x, 0.0, shape.radius))


def light_wheel(shape: WheelShape, x: float, outer: float, left: bool, segments: int = 12) -> Mesh:
    """Return a wheel (twin: both tyres) as one closed disk, dished on both sides.

    A flat one would make a corner reflector with every face across the vehicle.
    """
    width = shape.tyre_width + shape.twin
    middle = width / 2 - DISH * shape.radius
    profile: Array = np.array([(0.0, -middle), (shape.radius, -width / 2), (shape.radius, width / 2), (0.0, middle)])
    y = (outer - width / 2) * (1.0 if left else -1.0)
    return outward(revolve(profile, segments, "y")).moved((x, y, shape.radius))


def wheel_parts(
    places: Mapping[str, tuple[float, bool]],
    front: WheelShape,
    rear: WheelShape,
    outer: float,
    light: bool,
    light_role: str = "wheel",
) -> dict[str, tuple[Mesh, str]]:
    """Return the shapes of a vehicle's wheels with their roles.

    `places`: name -> x of the axle [m], and whether it is on the left.

    Axles with x > 0 have `front` wheels, the others `rear` ones; outer walls are at abs(y) = `outer` [m].
    At the light level a wheel is one closed disk of the role `light_role`.
    """
    found: dict[str, tuple[Mesh, str]] = {}
    for name, (x, left) in places.items():
        shape = front if x > 0 else rear
        if light:
            found[f"wheel_{name}_tyre"] = (light_wheel(shape, x, outer, left), light_role)
            continue
        tyre, rim = wheel(shape, x, outer, left)
        found |= {f"wheel_{name}_tyre": (tyre, "tyre"), f"wheel_{name}_rim": (rim, "rim")}
    return found
