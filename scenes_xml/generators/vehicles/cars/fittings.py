"""What is put onto a body: wheels, mirrors, door gaps, handles."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import PchipInterpolator

from ...geometry.mesh import Array, Mesh, box, grid, merge, outward, revolve, weld
from .measures import CarShape


def wheel(shape: CarShape, x: float, left: bool) -> tuple[Mesh, Mesh, Mesh]:
    """Return tyre, bright rim and dark wheel well of one wheel (left: outer side at +y)."""
    r, half = shape.wheel_radius, 0.105
    rim = r - 0.095
    tyre = np.array(
        [
            (rim, -half * 0.82),
            (0.5 * (rim + r), -half),
            (r - 0.03, -half * 0.95),
            (r - 0.008, -half * 0.82),
            (r, -half * 0.6),
            (r, half * 0.6),
            (r - 0.008, half * 0.82),
            (r - 0.03, half * 0.95),
            (0.5 * (rim + r), half),
            (rim, half * 0.82),
        ]
    )
    dark = np.array([(0.0005, -0.03), (rim, -0.078), (rim, 0.0), (0.0005, 0.035)])
    lip = np.array(
        [(rim - 0.022, 0.06), (rim - 0.006, 0.099), (rim + 0.006, 0.099), (rim + 0.004, 0.085), (rim - 0.022, 0.03)]
    )
    bright = [revolve(np.vstack([lip, lip[:1]])[::-1], 18, "y")]
    bright.append(
        revolve(np.array([(0.0005, 0.02), (0.055, 0.03), (0.055, 0.075), (0.035, 0.088), (0.0005, 0.09)]), 12, "y")
    )
    for k in range(shape.spokes):
        spoke = box((rim - 0.03, 0.03, 0.052), ((rim - 0.03) / 2 + 0.018, 0.068, 0.0))
        taper = np.where(spoke.vertices[:, 0] > 0.15, 0.72, 1.25)
        vertices = spoke.vertices * np.column_stack([np.ones_like(taper), np.ones_like(taper), taper])
        angle = 2 * np.pi * k / shape.spokes + 0.31
        c, s = np.cos(angle), np.sin(angle)
        turned = np.column_stack(
            [c * vertices[:, 0] - s * vertices[:, 2], vertices[:, 1], s * vertices[:, 0] + c * vertices[:, 2]]
        )
        bright.append(outward(Mesh(turned, spoke.faces)))
    bright = [outward(m) for m in bright]
    parts = [outward(revolve(np.vstack([tyre, tyre[:1]]), 24, "y")), merge(bright), outward(revolve(dark, 16, "y"))]
    y = shape.width / 2 - 0.022 - half
    placed = []
    for part in parts:
        part = Mesh(part.vertices, part.faces)
        part = part if left else part.mirrored_y()
        placed.append(part.moved((x, y if left else -y, r)))
    return placed[0], placed[1], placed[2]


def mirror(shape: CarShape) -> Mesh:
    """Return the left outside mirror: a rounded housing on a short foot."""
    x, z = shape.cabin_base[1] - 0.42, shape.extra.get("mirror_z", 1.0)
    angle = np.linspace(0, 2 * np.pi, 16, endpoint=False)
    rings = []
    limit = 0.95
    inner = shape.cabin_base_width - 0.02
    ys = np.linspace(inner, limit, 7)
    size = np.array([0.05, 0.35, 0.85, 1.0, 0.97, 0.75, 0.02])
    for y, k in zip(ys, size, strict=True):
        rings.append(np.column_stack([x + 0.055 * k * np.cos(angle), np.full(16, y), z + 0.075 * k * np.sin(angle)]))
    rings[0][:, 0] = x + 0.06 * np.cos(angle)
    rings[0][:, 2] = z - 0.05 + 0.03 * np.sin(angle)
    return outward(weld(grid(np.stack(rings), close_columns=True)))


def shut_lines(shape: CarShape) -> list[Array]:
    """Return the door gaps on the left side as lines in x-z, shape (n, 2) each [m]."""
    arch = shape.wheel_radius + 0.055
    rear, front = shape.cabin_base
    (a0, _), (b0, b1) = shape.glazing[0], shape.glazing[1]
    belt = float(PchipInterpolator(*np.array(shape.deck).T)(0.5 * (rear + front))) - 0.02
    length = front - 0.37 - rear
    b_pillar = front - 0.37 - length * 0.5 * (shape.glazing[0][1] + b0)
    c_pillar = max(front - 0.37 - length * b1, shape.rear_axle + 0.25)
    a_pillar = min(front - 0.40 - length * a0, shape.front_axle - arch - 0.08)
    sill = max(0.27, shape.floor + 0.03)
    lines = [np.array([(x, sill), (x, 0.5), (x - 0.01, belt)]) for x in (a_pillar, b_pillar)]
    top_rear = np.array(
        [
            (c_pillar + 0.16, sill),
            (c_pillar + 0.15, 0.45),
            (c_pillar, shape.wheel_radius + arch + 0.02),
            (c_pillar - 0.02, belt),
        ]
    )
    return [*lines, top_rear, np.array([(a_pillar, sill), (b_pillar, sill), (c_pillar + 0.16, sill)])]


def handles(shape: CarShape) -> list[Array]:
    """Return the door handles on the left side as lines in x-z, shape (n, 2) each [m]."""
    rear, front = shape.cabin_base
    length = front - 0.37 - rear
    z = shape.extra.get("handle_z", 0.80)
    b = front - 0.37 - length * 0.5 * (shape.glazing[0][1] + shape.glazing[1][0])
    c = max(front - 0.37 - length * shape.glazing[1][1], shape.rear_axle + 0.25)
    return [np.array([(x, z), (x + 0.18, z)]) for x in (b + 0.06, c + 0.10)]
