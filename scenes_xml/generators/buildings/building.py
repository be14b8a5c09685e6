"""Buildings: walls with a gable roof, windows with frames, doors, a chimney."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..geometry.mesh import Mesh, box, grid, merge


@dataclass(frozen=True)
class House:
    """Measures [m]: ground plan (x, y), height of the eaves and of the ridge (which runs along x), and its openings.

    `windows` holds (side, along, sill, width, height) with side one of ``front`` (-y), ``back`` (+y), ``left`` (-x) and
    ``right`` (+x); `along` is the middle of the opening on its side.
    """

    length: float
    depth: float
    eaves: float
    ridge: float
    windows: Sequence[tuple[str, float, float, float, float]]
    doors: Sequence[tuple[str, float, float, float]]
    overhang: float = 0.45
    texture_size: float = 3.0
    chimney: bool = True


_SIDES = {"front": -np.pi / 2, "right": 0.0, "back": np.pi / 2, "left": np.pi}


def _on_side(house: House, part: Mesh, side: str) -> Mesh:
    """Return a part made for the side +x (wall plane x = 0, along y) at its place on a side of the house."""
    reach = house.length / 2 if side in ("left", "right") else house.depth / 2
    return part.moved((reach, 0.0, 0.0)).moved(yaw=_SIDES[side])


def _walls(house: House) -> Mesh:
    a, b, e = house.length / 2, house.depth / 2, house.eaves
    low, t = -1.0, house.texture_size
    corners = [(-a, -b), (a, -b), (a, b), (-a, b)]
    parts = []
    for (x0, y0), (x1, y1) in zip(corners, [*corners[1:], corners[0]], strict=True):
        width = np.hypot(x1 - x0, y1 - y0)
        points = np.array([[(x0, y0, low), (x0, y0, e)], [(x1, y1, low), (x1, y1, e)]])
        uv = np.array([[(0, low), (0, e)], [(width, low), (width, e)]]) / t
        parts.append(grid(points, uv))
    for x, order in ((a, 1), (-a, -1)):
        gable = np.array([(x, -b, e), (x, b, e), (x, 0.0, house.ridge - 0.03)])
        parts.append(Mesh(gable, np.array([[0, 1, 2][::order]]), gable[:, 1:] / t))
    return merge(parts)


def _roof(house: House) -> Mesh:
    o, thick = house.overhang, 0.16
    slope = (house.ridge - house.eaves) / (house.depth / 2)
    x = house.length / 2 + o
    y = house.depth / 2 + o
    low = house.eaves - slope * o
    outline = np.array([(-y, low), (0.0, house.ridge), (y, low)])
    along = np.r_[0.0, np.hypot(*(outline[1] - outline[0])), 2 * np.hypot(*(outline[1] - outline[0]))]
    parts = []
    for shift, flip in ((thick, False), (0.0, True)):
        points = np.array([[(px, oy, oz + shift) for oy, oz in outline] for px in (-x, x)])
        uv = np.array([[(px / 3.0, abs(d - along[1]) / 3.0) for d in along] for px in (-x, x)])
        plane = grid(points, uv)
        parts.append(plane.flipped() if flip else plane)
    ends = {}
    for px in (-x, x):
        ends[px] = np.array([[(px, oy, oz) for oy, oz in outline], [(px, oy, oz + thick) for oy, oz in outline]])
        fascia = grid(ends[px], np.zeros((2, 3, 2)))
        parts.append(fascia.flipped() if px < 0 else fascia)
    for k, flip in ((0, False), (2, True)):
        eave = np.array([[ends[px][row, k] for row in (0, 1)] for px in (-x, x)])
        edge = grid(eave, np.zeros((2, 2, 2)))
        parts.append(edge.flipped() if flip else edge)
    return merge(parts)


def _window(width: float, height: float) -> tuple[Mesh, Mesh]:
    """Return frame and pane of a window in the plane x = 0, bottom middle at the origin; the frame stands out 7 cm."""
    t = 0.08
    bars = [
        box((0.14, width, t), (0.0, 0.0, t / 2)),
        box((0.14, width, t), (0.0, 0.0, height - t / 2)),
        box((0.14, t, height - 2 * t), (0.0, -width / 2 + t / 2, height / 2)),
        box((0.14, t, height - 2 * t), (0.0, width / 2 - t / 2, height / 2)),
        box((0.20, width + 0.16, 0.06), (0.02, 0.0, -0.03)),
    ]
    if width > 0.9:
        bars.append(box((0.10, 0.06, height - 2 * t), (0.0, 0.0, height / 2)))
    return merge(bars), box((0.05, width - 2 * t, height - 2 * t), (0.0, 0.0, height / 2))


def house(shape: House) -> dict[str, Mesh]:
    """Return ``walls``, ``roof``, ``frames``, ``panes`` and ``doors``; the middle of the ground plan is the origin."""
    frames, panes, doors = [], [], []
    for side, along, sill, width, height in shape.windows:
        frame, pane = _window(width, height)
        frames.append(_on_side(shape, frame.moved((0.0, along, sill)), side))
        panes.append(_on_side(shape, pane.moved((0.0, along, sill)), side))
    for side, along, width, height in shape.doors:
        doors.append(_on_side(shape, box((0.10, width, height + 0.2), (0.0, along, height / 2 - 0.1)), side))
        frames.append(_on_side(shape, box((0.18, width + 0.24, 0.12), (0.0, along, height + 0.06)), side))
        for edge in (-1.0, 1.0):
            frames.append(
                _on_side(
                    shape,
                    box((0.18, 0.12, height + 0.2), (0.0, along + edge * (width / 2 + 0.06), height / 2 - 0.1)),
                    side,
                )
            )
    walls = [_walls(shape)]
    if shape.chimney:
        walls.append(box((0.6, 0.6, 1.8), (shape.length * 0.22, shape.depth * 0.12, shape.ridge + 0.1)))
    return {
        "walls": merge(walls),
        "roof": _roof(shape),
        "frames": merge(frames),
        "panes": merge(panes),
        "doors": merge(doors),
    }
