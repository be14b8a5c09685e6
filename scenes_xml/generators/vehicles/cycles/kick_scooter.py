"""An electric kick scooter: deck, steering column, small wheels, lamps.

Frame: origin on the ground below the middle, x forward, y left.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...geometry.mesh import Mesh, box, extrude, merge, tube
from .bicycle import Parts, disc, light_disc, mudguard, ring


@dataclass(frozen=True)
class KickScooterShape:
    """Measures of a kick scooter [m]; the wheels are of 10 inches."""

    wheelbase: float = 0.92
    wheel_radius: float = 0.127
    deck_top: float = 0.150
    grip: tuple[float, float, float] = (0.235, 0.215, 1.105)


def _wheel(shape: KickScooterShape, light: bool) -> tuple[Mesh, Mesh]:
    around = 14 if light else 32
    tyre = ring(shape.wheel_radius - 0.03, 0.03, 0.027, around, 4 if light else 9)
    hub = merge(
        [
            light_disc(0.075, 0.03, 8) if light else disc(0.075, 0.03, around),
            tube(np.array([[0.0, -0.05, 0.0], [0.0, 0.05, 0.0]]), 0.012, 4 if light else 6),
        ]
    )
    return tyre, hub


def build(shape: KickScooterShape, light: bool = False) -> Parts:
    """Return the parts of a kick scooter, name -> (mesh, role).

    ``paint``, ``trim``, ``chrome``, ``tyre``, ``rim``, ``headlamp``, ``taillamp``.
    """
    segments, half, radius = 4 if light else 12, shape.wheelbase / 2.0, shape.wheel_radius
    x, y, z = shape.grip
    base, top = np.array([half - 0.035, 0.0, 0.30]), np.array([x + 0.02, 0.0, z - 0.02])
    outline = np.array([(-0.36, 0.06), (-0.34, 0.08), (0.18, 0.085), (0.23, 0.06)])
    deck = extrude(
        np.concatenate([outline, outline[::-1] * [1.0, -1.0]]), shape.deck_top - 0.055, shape.deck_top - 0.004
    )
    neck = tube(np.array([[0.20, 0.0, 0.12], [0.31, 0.0, 0.16], base]), np.array([0.030, 0.028, 0.026]), segments)
    stays = [
        tube(np.array([[-0.33, s * 0.055, 0.115], [-half, s * 0.055, radius]]), 0.014, segments) for s in (-1.0, 1.0)
    ]
    fork = [
        tube(np.array([base + [0.0, s * 0.045, -0.02], [half, s * 0.045, radius]]), 0.014, segments)
        for s in (-1.0, 1.0)
    ]
    column = tube(np.array([base - 0.1 * (top - base), top]), 0.021, segments)
    bar = tube(
        np.array([(x, y + 0.06, z), (x + 0.02, 0.05, z), (x + 0.02, -0.05, z), (x, -y - 0.06, z)]), 0.012, segments
    )
    grips = [
        tube(np.array([(x, s * (y + 0.065), z), (x + 0.004, s * (y - 0.05), z)]), 0.017, segments) for s in (-1.0, 1.0)
    ]
    mat = extrude(
        np.concatenate([outline, outline[::-1] * [1.0, -1.0]]) * [0.94, 0.9], shape.deck_top - 0.005, shape.deck_top
    )
    parts: Parts = {
        "chassis": (merge([deck, neck, *stays, *fork]), "paint"),
        "column": (merge([column, bar]), "chrome"),
        "grips": (merge([*grips, mat]), "trim"),
        "lamp_front": (box((0.03, 0.045, 0.05), tuple(base + 0.80 * (top - base) + [0.032, 0.0, 0.0])), "headlamp"),
        "lamp_rear": (box((0.015, 0.06, 0.03), (-half - 0.135, 0.0, 0.215)), "taillamp"),
    }
    for name, place in (("front", half), ("rear", -half)):
        tyre, rim = (part.moved((place, 0.0, radius)) for part in _wheel(shape, light))
        parts |= {f"wheel_{name}_tyre": (tyre, "tyre"), f"wheel_{name}_rim": (rim, "rim")}
    if not light:
        guards = [
            mudguard(np.array([half, 0.0, radius]), radius + 0.02, 30.0, 170.0, 0.034, 14),
            mudguard(np.array([-half, 0.0, radius]), radius + 0.02, 10.0, 150.0, 0.034, 14),
        ]
        display = box((0.05, 0.07, 0.012), (x + 0.03, 0.0, z + 0.02))
        parts["mudguards"] = (merge([*guards, display]), "trim")
    return parts
