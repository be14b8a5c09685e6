"""The box of a lorry, a semitrailer or a box van: panels in a frame, rear doors with their bars, contour marking."""

from __future__ import annotations

import numpy as np

from ..geometry.mesh import Mesh, box, merge
from .vehicle_parts import bar

Span = tuple[float, float]
HINGES = (0.34, 1.04, 1.74, 2.34)
"""Of the doors, over the lower edge [m]."""


def load_box(x: Span, z: Span, width: float) -> tuple[Mesh, Mesh, Mesh]:
    """Return the panels, the aluminium frame with the rear doors' bars, and the contour marking.

    From and to `x` and `z`, and `width` [m], the frame included.
    """
    (x0, x1), (z0, z1) = x, z
    length, height, half = x1 - x0, z1 - z0, width / 2
    middle = (0.5 * (x0 + x1), 0.0, 0.5 * (z0 + z1))
    panels = box((length - 0.02, width - 0.04, height - 0.03), (middle[0], 0.0, middle[2]))
    rail = 0.09
    frame = [
        box((rail, rail, height - 0.004), (at, y, middle[2]))
        for at in (x0 + rail / 2, x1 - rail / 2)
        for y in (half - rail / 2, -half + rail / 2)
    ]
    frame += [
        box((length - 2 * rail, 0.07, 0.12), (middle[0], y, up))
        for y in (half - 0.038, -half + 0.038)
        for up in (z0 + 0.062, z1 - 0.062)
    ]
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
