"""What is seen through the panes of a car: foot well, seats, dashboard, steering wheel, and who sits there.

The deck of the body lies lower between the axles (`well`), and a ledge joins it to the panes. Places follow from the
front axle and the height, as a driver's hip and head room do.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.interpolate import PchipInterpolator

from ...geometry.mesh import Array, Mesh, box, grid, merge, outward, revolve, tube
from ..vehicle_parts import prism
from .cabin import cabin_points
from .measures import CarShape
from .shell import Well

HEAD_ROOM = 0.90
"""Height of a roof over the hips of who sits below [m]."""
HIP_BEHIND_AXLE = 1.43
"""How far the driver's hips are behind the front axle [m]."""
ROW = 0.82
"""Distance of two rows of seats [m]."""
BACK = 0.57
"""Height of a front seat's back over the hips [m]."""
RECLINE = np.radians(22.0)
"""Of backs against the vertical."""


class Seat(NamedTuple):
    """Where the hips of somebody are [m]."""

    x: float
    y: float
    z: float


def seats(shape: CarShape) -> dict[str, Seat]:
    """Return the places of a car by name: ``driver`` (left), ``beside``, and behind them ``left`` and ``right``."""
    x, y, z = shape.front_axle - HIP_BEHIND_AXLE, 0.44 * shape.cabin_base_width, shape.height - HEAD_ROOM
    found = {"driver": Seat(x, y, z), "beside": Seat(x, -y, z)}
    if shape.rows > 1:
        row = shape.extra.get("row", ROW)
        found |= {"left": Seat(x - row, y, z + 0.03), "right": Seat(x - row, -y, z + 0.03)}
    return found


def well(shape: CarShape) -> Well:
    """Return where the deck lies lower: between the wheel houses, as far as the last row of seats needs."""
    reach = shape.wheel_radius + 0.055 + 0.115
    rear_end, front_end = shape.cabin_base
    rear = max(shape.rear_axle + reach, rear_end + 0.25)
    corner = front_end - 0.20 - 0.17 * (front_end - rear_end) / 2.6  # where the pane bends to the side
    return Well(rear, min(shape.front_axle - reach, corner - 0.21), shape.floor + 0.14)


def trim(shape: CarShape) -> Mesh:
    """Return ledge, dashboard and steering wheel."""
    driver = seats(shape)["driver"]
    line = np.array(shape.deck)
    deck = PchipInterpolator(line[:, 0], line[:, 1])
    x = driver.x + 0.60
    top = float(deck(x)) + 0.055
    outline = [
        (x - 0.02, top - 0.11), (x + 0.05, top), (x + 0.22, top - 0.005), (x + 0.34, top - 0.05),
        (x + 0.34, top - 0.3), (x + 0.03, top - 0.3),
    ]  # fmt: skip # a table
    half = 0.76 * shape.cabin_base_width
    hood = box((0.12, 0.30, 0.05), (x + 0.07, driver.y, top + 0.015))
    return merge([_ledge(shape, deck), prism(outline, -half, half), hood, steering_wheel(driver)])


def _ledge(shape: CarShape, deck: PchipInterpolator) -> Mesh:
    """Return what covers the deck between the lower edge of the panes and the well."""
    low = well(shape)
    outer = cabin_points(shape)[0][1]
    inner = outer.copy()
    inner[:, 0] = np.clip(outer[:, 0], low.rear - 0.03, low.front + 0.03)
    inner[:, 1] = np.clip(outer[:, 1], -0.88 * shape.cabin_base_width, 0.88 * shape.cabin_base_width)
    crown = 1.0 - (inner[:, 1] / (0.9 * shape.width / 2)) ** 2
    inner[:, 2] = np.maximum(deck(inner[:, 0]) + 0.045 * crown + 0.008, outer[:, 2])
    ledge = grid(np.stack([outer, inner]), close_columns=True)
    a, b, c = (ledge.vertices[ledge.faces[:, k]] for k in range(3))
    return ledge if np.cross(b - a, c - a)[:, 2].sum() > 0.0 else ledge.flipped()


def steering_wheel(driver: Seat) -> Mesh:
    """Return the wheel before a driver with its column."""
    turn = np.radians(np.linspace(0.0, 360.0, 17))[:-1]
    slant = np.radians(27.0)
    centre = np.array([driver.x + 0.42, driver.y, driver.z + 0.30])
    ring = centre + 0.185 * np.stack(
        [np.sin(turn) * np.sin(slant), np.cos(turn), np.sin(turn) * np.cos(slant)], axis=-1
    )
    rim = _closed_tube(ring, 0.016, 5)
    column = tube(np.array([centre, centre + [0.22, 0.0, -0.22 * np.tan(slant)]]), 0.035, 6)
    spoke = box((0.03, 0.35, 0.05), centre)
    return merge([rim, column, spoke])


def _closed_tube(ring: Array, radius: float, segments: int) -> Mesh:
    """Return the tube around a flat closed line."""
    middle = ring.mean(axis=0)
    out = (ring - middle) / np.linalg.norm(ring - middle, axis=1)[:, None]
    axis = np.cross(out[0], out[len(out) // 4])
    turn = 2.0 * np.pi * np.arange(segments) / segments
    around = np.cos(turn)[None, :, None] * out[:, None] + np.sin(turn)[None, :, None] * axis
    return outward(grid(ring[:, None] + radius * around, close_rows=True, close_columns=True))


def upholstery(shape: CarShape) -> Mesh:
    """Return the seats: single ones in front, a bench behind."""
    found = seats(shape)
    parts = []
    for name in ("driver", "beside"):
        parts += [*chair(found[name], (0.25, 0.235)), head_rest(found[name])]
    if "left" in found:
        left = found["left"]
        bench = Seat(left.x, 0.0, left.z)
        halves = 0.22 * shape.width, left.y + 0.24  # the cushion lies between the wheel houses, the back above them
        parts += [*chair(bench, halves, 0.46, 0.26), *(head_rest(found[name], 0.46) for name in ("left", "right"))]
    return merge(parts)


def _along_back(seat: Seat, up: float, behind: float) -> tuple[float, float]:
    """Return x and z of a point `up` along the back from the hips, `behind` it [m]."""
    s, c = np.sin(RECLINE), np.cos(RECLINE)
    return seat.x - up * s - behind * c, seat.z + up * c - behind * s


def chair(seat: Seat, halves: tuple[float, float], height: float = BACK, start: float = -0.12) -> list[Mesh]:
    """Return cushion and back, of two half widths; the back from `start` to `height` over the hips."""
    low = seat.z - 0.10
    cushion = [
        (seat.x - 0.12, low - 0.16), (seat.x - 0.12, low - 0.02), (seat.x + 0.05, low - 0.01),
        (seat.x + 0.36, low + 0.03), (seat.x + 0.40, low - 0.02), (seat.x + 0.38, low - 0.14),
    ]  # fmt: skip # a table
    front = (start, 0.12), (start + 0.07, 0.11), (height - 0.07, 0.13), (height, 0.17)
    back = [_along_back(seat, up, behind) for up, behind in (*front, (height - 0.02, 0.22), (start + 0.02, 0.26))]
    outlines = zip((cushion, back), halves, strict=True)
    return [prism(outline, seat.y - half, seat.y + half) for outline, half in outlines]


def head_rest(seat: Seat, height: float = BACK) -> Mesh:
    """Return the head rest over a back of a height [m]."""
    outline = [
        _along_back(seat, height + up, behind)
        for up, behind in ((0.01, 0.15), (0.16, 0.14), (0.19, 0.17), (0.17, 0.22), (0.01, 0.21))
    ]
    return prism(outline, seat.y - 0.12, seat.y + 0.12)


def occupants(shape: CarShape, names: Sequence[str] = ("driver",)) -> dict[str, Mesh]:
    """Return people on some places, as one mesh of clothes, one of skin and one of hair."""
    found = seats(shape)
    return merged([person(found[name], drives=name == "driver") for name in names])


def merged(people: Sequence[dict[str, Mesh]]) -> dict[str, Mesh]:
    """Return some people as one mesh of clothes, one of skin and one of hair."""
    return {kind: merge([one[kind] for one in people]) for kind in ("clothes", "skin", "hair")}


def person(seat: Seat, drives: bool) -> dict[str, Mesh]:
    """Return somebody who sits: trunk, arms and thighs; hands, neck and face; hair."""
    rows = np.array(
        [(-0.10, 0.14, 0.10), (0.0, 0.175, 0.12), (0.20, 0.15, 0.11), (0.38, 0.185, 0.12), (0.46, 0.20, 0.10),
         (0.51, 0.12, 0.07), (0.53, 0.02, 0.015)]
    )  # fmt: skip # a table: up along the back, half width, half depth
    turn = 2.0 * np.pi * np.arange(10) / 10
    lean = np.array([np.cos(RECLINE), 0.0, np.sin(RECLINE)])
    rings = []
    for up, half, depth in rows:
        x, z = _along_back(seat, float(up), 0.0)
        rings.append(
            np.array([x, seat.y, z])
            + depth * np.cos(turn)[:, None] * lean
            + half * np.sin(turn)[:, None] * [0.0, 1.0, 0.0]
        )
    clothes = [outward(grid(np.stack(rings), close_columns=True))]
    skin, hip = [], np.array(seat)
    x, z = _along_back(seat, 0.45, 0.0)
    for side in (1.0, -1.0):
        shoulder = np.array([x, seat.y + 0.20 * side, z])
        elbow = shoulder + [0.14, 0.05 * side, -0.24]
        hand = hip + ([0.39, 0.16 * side, 0.36] if drives else [0.28, 0.09 * side, 0.04])
        clothes.append(tube(np.array([shoulder, elbow, 0.2 * elbow + 0.8 * hand]), np.array([0.055, 0.045, 0.035]), 6))
        skin.append(_ball(hand, (0.05, 0.04, 0.05), 6))
        knee = hip + [0.44, 0.13 * side, 0.10]
        thigh = np.array([hip + [0.0, 0.10 * side, -0.02], knee, knee + [0.14, 0.0, -0.28]])
        clothes.append(tube(thigh, np.array([0.085, 0.065, 0.05]), 6))
    top = np.array([x - 0.02, seat.y, z + 0.20])
    skin += [
        tube(np.array([[x - 0.03, seat.y, z], top]), 0.055, 8),
        _ball(top + [0.02, 0.0, 0.03], (0.095, 0.075, 0.12)),
    ]
    return {
        "clothes": merge(clothes),
        "skin": merge(skin),
        "hair": _ball(top + [-0.005, 0.0, 0.065], (0.10, 0.083, 0.10)),
    }


def _ball(centre: Array, radii: Sequence[float], segments: int = 10) -> Mesh:
    up = np.linspace(-0.5 * np.pi, 0.5 * np.pi, max(5, segments // 2 + 2))
    unit = revolve(np.column_stack([np.cos(up), np.sin(up)]), segments, "z")
    return outward(Mesh(unit.vertices * np.array(radii) + centre, unit.faces))
