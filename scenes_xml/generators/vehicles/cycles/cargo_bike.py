"""A cargo bike with its box before the rider: the rear half of a city bicycle, a low beam, a small front wheel.

Frame: that of the city bicycle, origin on the ground below its middle; `SHIFT` brings it below the middle of the whole.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from ...geometry.mesh import Mesh, box, merge, tube
from . import bicycle
from .bicycle import BicycleShape, Parts, bar


@dataclass(frozen=True)
class CargoBikeShape:
    """Measures of a cargo bike [m]; the front wheel has 20 inches (47-406)."""

    rear: BicycleShape = field(default_factory=BicycleShape)
    front_x: float = 1.32
    front_radius: float = 0.252
    box_x: tuple[float, float] = (0.40, 1.06)
    box_z: tuple[float, float] = (0.30, 0.78)
    box_half: float = 0.30

    @property
    def shift(self) -> float:
        """How far the middle is before that of the city bicycle [m]."""
        ahead, behind = self.front_x + self.front_radius, -self.rear.wheelbase / 2.0 - self.rear.wheel_radius
        return round(0.5 * (ahead + behind), 4)


def _crate(shape: CargoBikeShape, light: bool) -> Mesh:
    """Return the open box: four walls and a floor of 15 mm boards; closed at the light level."""
    (x0, x1), (z0, z1), half = shape.box_x, shape.box_z, shape.box_half
    middle = 0.5 * (x0 + x1), 0.0, 0.5 * (z0 + z1)
    if light:
        return box((x1 - x0, 2.0 * half, z1 - z0), middle)
    board = 0.015
    walls = [box((board, 2.0 * half, z1 - z0), (x, 0.0, middle[2])) for x in (x0 + board / 2, x1 - board / 2)]
    side = (x1 - x0 - 2.0 * board, board, z1 - z0)
    walls += [box(side, (middle[0], s * (half - board / 2), middle[2])) for s in (1.0, -1.0)]
    inner = (x1 - x0 - 2.0 * board, 2.0 * (half - board), board)
    return merge([*walls, box(inner, (middle[0], 0.0, z0 + board / 2))])


def _beam(shape: CargoBikeShape, segments: int) -> Mesh:
    """Return the frame before the rider: beam below the box, head tube and fork of the front wheel, steering rod."""
    rear, x, radius = shape.rear, shape.front_x, shape.front_radius
    low = rear.steering(0.44)
    head = np.array([shape.box_x[1] + 0.05, 0.0, 0.66])
    foot = np.array([shape.box_x[1] + 0.09, 0.0, 0.52])
    way = np.array([low, [low[0] + 0.02, 0.0, 0.30], [0.46, 0.0, 0.24], [shape.box_x[1] - 0.05, 0.0, 0.24], foot])
    light = segments == 4
    thin = 3 if light else segments
    tubes = [bar(way, 0.024, thin), tube(np.array([foot, head]), 0.021, thin)]
    bracket = rear.seat_tube(0.0)
    tubes.append(bar(np.array([bracket, [0.30, 0.0, 0.255]]), 0.02, thin))
    if not light:
        tubes += [box((0.04, 0.5, 0.03), (at, 0.0, shape.box_z[0] - 0.015)) for at in (0.50, 0.95)]
    for side in (1.0, -1.0):
        out = np.array([0.0, side * 0.055, 0.0])
        crown = foot + [0.03, 0.0, -0.01]
        tubes.append(bar(np.array([crown + 0.3 * out, crown + out, [x, out[1], radius]]), 0.011, thin))
    rod = [[low[0] + 0.03, 0.05, 0.33], [0.46, 0.05, 0.205], [foot[0] + 0.08, 0.07, 0.42]]
    tubes.append(bar(np.array(rod), 0.007, min(thin, 5)))
    return merge(tubes)


def build(shape: CargoBikeShape, light: bool = False) -> Parts:
    """Return the parts of a cargo bike as :func:`.bicycle.build`, with ``crate`` (role ``board``)."""
    parts = bicycle.build(shape.rear, light)
    segments = 4 if light else 9
    frame, fork = bicycle.frame(shape.rear, segments), _beam(shape, segments)
    parts["frame"] = (merge([frame, fork]), "paint")
    parts["crate"] = (_crate(shape, light), "board")
    small = replace(shape.rear, wheel_radius=shape.front_radius, tyre=0.023)
    place = np.array([shape.front_x, 0.0, shape.front_radius])
    tyre, rim = (part.moved(place) for part in bicycle.wheel(small, light))
    parts |= {"wheel_front_tyre": (tyre, "tyre"), "wheel_front_rim": (rim, "rim")}
    lamp = (shape.box_x[1] + 0.03, 0.0, 0.70)
    parts["lamp_front"] = (box((0.05, 0.06, 0.05), lamp), "headlamp")
    if not light:
        guards = [
            bicycle.mudguard(place, shape.front_radius + 0.025, 20.0, 150.0, 0.032, 14),
            bicycle.mudguard(shape.rear.rear, shape.rear.wheel_radius + 0.025, 20.0, 190.0, 0.026, 18),
        ]
        parts["mudguards"] = (merge(guards), "trim")
    return parts
