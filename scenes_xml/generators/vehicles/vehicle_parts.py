"""Parts that vehicles of all kinds share: underbodies, lamps, and prisms to make them of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..geometry.mesh import Array, Mesh, box, merge, outward, revolve, tube

Point = tuple[float, float, float]
TOE, LEAN = 0.012, 0.04
"""Slopes of frames and side guards along a vehicle, in plan and upright.

Frames narrow to the rear, and what is welded or hung on is some 0.5 deg off its right angle (ISO 13920, class B); faces
that meet at 90.0 deg would send every wave back.
"""


def one_side(mesh: Mesh, side: float) -> Mesh:
    """Return the faces of a mesh on the left (`side` 1) or on the right (-1)."""
    return replace(mesh, faces=mesh.faces[mesh.vertices[mesh.faces, 1].mean(axis=1) * side > 0.0])


def bar(start: Point, stop: Point, radius: float, segments: int = 6) -> Mesh:
    """Return a round bar between two points [m]."""
    return tube(np.array([start, stop], float), radius, segments)


def lens(
    radius: float, centre: Point, depth: float = 0.02, segments: int = 16, axis: str = "x", forward: bool = True
) -> Mesh:
    """Return a flat round lamp: a disk of `depth` [m] along `axis`, its outer face at `centre`, rounded at the edge."""
    profile = np.array([(0.0, -depth), (radius, -depth), (radius, -0.3 * depth), (0.86 * radius, 0.0), (0.0, 0.0)])
    if not forward:
        profile = profile * [1.0, -1.0]
    return outward(revolve(profile, segments, axis)).moved(centre)


def prism(outline: Sequence[tuple[float, float]], low: float, high: float) -> Mesh:
    """Return the prism of an x-z `outline` [m] between y = `low` and `high`.

    The outline is star-shaped about its mean.
    """
    points = np.array(outline, float)
    n = len(points)
    k = np.arange(n)
    rings = [np.column_stack([points[:, 0], np.full(n, y), points[:, 1]]) for y in (low, high)]
    sides = np.concatenate([np.stack([k, n + k, n + (k + 1) % n], 1), np.stack([k, n + (k + 1) % n, (k + 1) % n], 1)])
    parts = [Mesh(np.concatenate(rings), sides.astype(np.int64))]
    for ring, order in zip(rings, (1, -1), strict=True):
        fan = np.stack([k, (k + 1) % n, np.full(n, n)], 1)[:, ::order]
        parts.append(Mesh(np.concatenate([ring, ring.mean(0)[None]]), fan.astype(np.int64)))
    return outward(merge(parts))


def skewed(part: Mesh, toe: float = TOE, lean: float = LEAN) -> Mesh:
    """Return a part on the left that is wider at the front by the slope `toe`, and leans in upwards by `lean`.

    Slopes are those of what runs along x; faces across stay where they are.
    """
    off = part.vertices - 0.5 * (part.vertices.min(0) + part.vertices.max(0))
    aside = toe * off[:, 0] - lean * off[:, 2]
    return replace(part, vertices=part.vertices + aside[:, None] * [0.0, 1.0, 0.0])


def deflector(outline: Sequence[tuple[float, float]], half: float) -> Mesh:
    """Return the wedge over a cab: the prism of an x-z outline [m], narrower upwards and to the front."""
    wedge = prism(outline, -half, half)
    off = wedge.vertices - wedge.vertices.min(0)
    share = 1.0 - 0.10 * (off[:, 0] + off[:, 2]) / half
    return replace(wedge, vertices=wedge.vertices * np.column_stack([np.ones(len(off)), share, np.ones(len(off))]))


def cross_bar(x: float, half: float, top: float, height: float, width: float) -> Mesh:
    """Return a bar across a vehicle below a floor at `top` [m]: a hat profile, narrower below by a third."""
    low = top - height
    return prism(((x - width / 2, top), (x + width / 2, top), (x + width / 3, low), (x - width / 3, low)), -half, half)


def tray(size: Sequence[float], centre: Sequence[float], slope: float = 1.0) -> Mesh:
    """Return a box [m] whose sides lean in downwards, by 45 deg as those of pressed sheets do, or by a `slope`."""
    whole = box(size, centre)
    low = whole.vertices[:, 2] < centre[2]
    inset = np.where(low[:, None], np.sign(whole.vertices - centre) * [1.0, 1.0, 0.0] * slope * size[2], 0.0)
    return replace(whole, vertices=whole.vertices - inset)


def car_underbody(
    front_axle: float, rear_axle: float, width: float, length: float, floor: float, radius: float
) -> dict[str, Mesh]:
    """Return the floor plate, subframes, axles, silencer and exhaust of a car.

    Floor = height of the bodywork's lower edge [m].
    """
    low, half = floor - 0.008, 0.42 * width
    parts = {
        "floor": tray(
            (front_axle - rear_axle - 2 * radius - 0.24, 2 * half, 0.012),
            (0.5 * (front_axle + rear_axle), 0.0, low - 0.006),
        ),
        "tunnel": tray((front_axle - rear_axle + 0.1, 0.20, 0.03), (0.5 * (front_axle + rear_axle), 0.0, low - 0.03)),
        "subframe": tray((0.62, 0.82, 0.05), (front_axle, 0.0, low - 0.026)),
        "silencer": outward(
            revolve(
                np.array(
                    [(0.0, -0.26), (0.04, -0.245), (0.07, -0.19), (0.08, 0.0), (0.07, 0.19), (0.04, 0.245), (0.0, 0.26)]
                ),
                12,
                "y",
            )
        ).moved((-length / 2 + 0.42, 0.1, floor + 0.05)),
        "exhaust": bar((front_axle - 0.1, 0.16, low - 0.03), (-length / 2 + 0.42, 0.16, low - 0.02), 0.025),
        "tail_pipe": bar((-length / 2 + 0.40, 0.34, floor + 0.01), (-length / 2 + 0.14, 0.52, floor + 0.035), 0.028, 8),
        "beam": bar((rear_axle, -width / 2 + 0.24, radius - 0.06), (rear_axle, width / 2 - 0.24, radius - 0.06), 0.035),
    }
    for side in (1.0, -1.0):
        inner, outer = 0.30 * side, (width / 2 - 0.20) * side
        parts[f"arm_{side:+.0f}"] = bar((front_axle + 0.03, inner, floor), (front_axle, outer, radius - 0.10), 0.022)
        parts[f"shaft_{side:+.0f}"] = bar((front_axle, inner, radius - 0.04), (front_axle, outer, radius), 0.018)
    return parts


def silhouette(points: Array) -> list[tuple[float, float]]:
    """Return an array of (x, z) as the list that `prism` takes."""
    return [(float(x), float(z)) for x, z in points]
