"""The box of a lorry, a semitrailer or a box van: panels in a frame, rear doors with their bars, contour marking."""

from __future__ import annotations

import numpy as np

from ..geometry.mesh import Mesh, box, extrude, merge
from .vehicle_parts import bar, skewed

Span = tuple[float, float]
HINGES = (0.34, 1.04, 1.74, 2.34)
"""Of the doors, over the lower edge [m]."""
CORNER = 0.08
"""Of the rounded front corners [m]."""


def _round(front: float, half: float) -> list[tuple[float, float]]:
    """Return x and y of the round corner on the left, in steps of 30 deg."""
    turn = CORNER / (1.0 + np.tan(np.radians(30.0)))
    back = front - CORNER, half - CORNER
    return [(front, back[1]), (back[0] + turn, back[1] + turn), (back[0], half)]


def body(x: Span, z: Span, width: float) -> Mesh:
    """Return the closed box from and to `x` and `z` [m]; its upright corners at the front are round."""
    left = [*_round(x[1], width / 2), (x[0], width / 2)]
    return extrude(np.array([*left, *((a, -b) for a, b in left[::-1])]), *z)


def load_box(x: Span, z: Span, width: float) -> tuple[Mesh, Mesh, Mesh]:
    """Return the panels, the aluminium frame with the rear doors' bars, and the contour marking.

    From and to `x` and `z`, and `width` [m], the frame included.
    """
    (x0, x1), (z0, z1) = x, z
    length, height, half = x1 - x0, z1 - z0, width / 2
    middle = (0.5 * (x0 + x1), 0.0, 0.5 * (z0 + z1))
    panels = body((x0 + 0.01, x1 - 0.01), (z0 + 0.015, z1 - 0.015), width - 0.04)
    rail = 0.09
    frame = [
        box((rail, rail, height - 0.004), (x0 + rail / 2, y, middle[2])) for y in (half - rail / 2, -half + rail / 2)
    ]
    corner = [*_round(x1, half), (x1 - rail, half), (x1 - rail, half - rail), (x1, half - rail)]
    post = extrude(np.array(corner), z0 + 0.002, z1 - 0.002)
    frame += [post, post.mirrored_y()]
    for up in (z0 + 0.062, z1 - 0.062):
        edge = skewed(box((length - 2 * rail, 0.07, 0.12), (middle[0], half - 0.038, up)), 0.0)
        frame += [edge, edge.mirrored_y()]
    frame += [
        box((0.07, width - 2 * rail, 0.12), (at, 0.0, up))
        for at in (x0 + 0.038, x1 - 0.038)
        for up in (z0 + 0.062, z1 - 0.062)
    ]
    frame += [box((0.03, 0.05, height - 0.24), (x0 + 0.01, 0.0, middle[2]))]
    for y in (0.495 - half, 0.935 - half, half - 0.935, half - 0.495):
        frame.append(bar((x0 - 0.018, y, z0 + 0.05), (x0 - 0.018, y, z1 - 0.05), 0.014, 6))
        frame += [box((0.02, 0.10, 0.05), (x0 + 0.003, y, up)) for up in (z0 + 0.3, z0 + 0.62)]
    frame += [
        box((0.03, 0.03, 0.16), (x0 + 0.002, s * (half - 0.12), z0 + up))
        for s in (1.0, -1.0)
        for up in HINGES
        if up < height
    ]
    marking = [
        box((0.75, 0.006, 0.055), (at, s * (half - 0.021), z0 + 0.17))
        for at in np.arange(x0 + 0.6, x1 - 0.4, 0.95)
        for s in (1.0, -1.0)
    ]
    marking += [
        box((0.006, 0.52, 0.055), (x0 + 0.009, y, up))
        for y in (0.355 - half, half - 0.355)
        for up in (z0 + 0.18, z1 - 0.18)
    ]
    return panels, merge(frame), merge(marking)
