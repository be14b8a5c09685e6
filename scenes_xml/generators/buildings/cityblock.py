"""Town buildings with flat roofs.

Street fronts with windows set into the wall, shops at the foot, cornices and parapets.

Local frame: the middle of the ground plan at the origin, the street front looks to -y.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..geometry.mesh import Mesh, box, grid, merge

REVEAL = 0.16
"""How deep windows stand in the wall [m]."""


@dataclass(frozen=True)
class Block:
    """Measures of a house front [m].

    Width along the street, depth, storeys above the shops, their height, width of a window, and its height.
    """

    width: float
    depth: float
    storeys: int
    shop: float = 3.9
    storey: float = 3.1
    window: float = 1.25
    pane: float = 1.75
    axis: float = 2.6
    tile: float = 3.0
    sides: tuple[str, ...] = ("front",)
    balconies: bool = False

    @property
    def height(self) -> float:
        """Return the height of the roof [m]."""
        return self.shop + self.storeys * self.storey + 0.5


def _quad(x0: float, x1: float, z0: float, z1: float, y: float, tile: float) -> Mesh:
    """Return an upright rectangle in the plane y that looks to -y."""
    corners = np.array([[(x0, y, z0), (x0, y, z1)], [(x1, y, z0), (x1, y, z1)]])
    return grid(corners, corners[..., [0, 2]] / tile)


def _front(b: Block, width: float, is_light: bool) -> dict[str, list[Mesh]]:
    """Return walls, panes and trim of a front of `width` in the plane y = 0."""
    half, top = width / 2, b.height
    walls, panes, trim = [], [], []
    count = max(1, int((width - 0.8) // b.axis))
    centres = (np.arange(count) - (count - 1) / 2) * (width - 0.8) / count
    # the foot: shop windows between pillars, a band for signs above
    pillar = 0.45
    walls.append(_quad(-half, half, b.shop - 0.35, b.shop + 0.45, 0.0, b.tile))
    bays = max(1, count // 2)
    edges = np.linspace(-half, half, bays + 1)
    for k in range(bays):
        a, c = edges[k] + pillar / 2, edges[k + 1] - pillar / 2
        panes.append(_quad(a, c, 0.35, b.shop - 0.35 if is_light else b.shop - 0.75, REVEAL, 1.0))
        walls.append(_quad(a, c, -0.2, 0.35, 0.06, b.tile))
        if is_light:
            continue
        trim.append(box((c - a, 0.10, 0.42), (0.5 * (a + c), -0.06, b.shop - 0.56)))
        trim.append(box((0.07, 0.08, b.shop - 1.1), (0.5 * (a + c), REVEAL - 0.03, 0.5 * (b.shop - 0.4))))
    # rooms end behind the windows: nothing is seen through a house
    walls.append(_quad(-half + 0.5, half - 0.5, -0.2, top, 0.5, b.tile))
    for x in edges:
        low, high = max(-half, x - pillar / 2), min(half, x + pillar / 2)
        if is_light:
            walls.append(_quad(low, high, -0.2, b.shop - 0.35, 0.0, b.tile))
        else:
            walls.append(box((high - low, 0.42, b.shop - 0.15), (0.5 * (low + high), 0.21, 0.5 * (b.shop - 0.55))))
    for storey in range(b.storeys):
        foot = b.shop + 0.45 + storey * b.storey
        sill, lintel, roof = foot + 0.45, foot + 0.45 + b.pane, foot + b.storey
        walls += [_quad(-half, half, foot, sill, 0.0, b.tile), _quad(-half, half, lintel, roof, 0.0, b.tile)]
        borders = [-half, *(v for x in centres for v in (x - b.window / 2, x + b.window / 2)), half]
        walls += [_quad(borders[k], borders[k + 1], sill, lintel, 0.0, b.tile) for k in range(0, len(borders), 2)]
        if is_light:
            panes.append(_quad(-half + 0.2, half - 0.2, sill, lintel, REVEAL, 1.0))
            continue
        for k, x in enumerate(centres):
            a, c = x - b.window / 2, x + b.window / 2
            ring = np.array([(a, sill), (a, lintel), (c, lintel), (c, sill), (a, sill)])
            rows = np.stack([np.column_stack([ring[:, 0], np.full(5, y), ring[:, 1]]) for y in (0.0, REVEAL)])
            walls.append(grid(rows, rows[..., [0, 2]] / b.tile))
            panes.append(_quad(a, c, sill, lintel, REVEAL, 1.0))
            trim.append(box((b.window + 0.2, 0.16, 0.06), (x, -0.05, sill - 0.035)))
            trim.append(box((0.05, 0.05, b.pane - 0.02), (x, REVEAL - 0.03, 0.5 * (sill + lintel))))
            if b.balconies and storey % 2 == 1 and k % 2 == 0:
                trim.append(box((b.window + 0.5, 0.7, 0.1), (x, -0.35, sill - 0.1)))
                trim.append(box((b.window + 0.5, 0.03, 0.9), (x, -0.68, sill + 0.4)))
    walls.append(_quad(-half, half, b.shop + 0.45 + b.storeys * b.storey, top + 0.7, 0.0, b.tile))
    trim.append(box((width - 0.02, 0.30, 0.24), (0.0, -0.12, b.height - 0.05)))
    if not is_light:
        trim.append(box((width - 0.02, 0.16, 0.12), (0.0, -0.06, b.shop + 0.45)))
    return {"walls": walls, "panes": panes, "trim": trim}


def block(b: Block, is_light: bool = False) -> dict[str, Mesh]:
    """Return ``walls``, ``panes`` and ``trim`` of a building.

    `sides` are the fronts that have windows (front, right, back, left).
    """
    parts: dict[str, list[Mesh]] = {"walls": [], "panes": [], "trim": []}
    for k, side in enumerate(("front", "right", "back", "left")):
        width, reach = (b.width, b.depth / 2) if k % 2 == 0 else (b.depth, b.width / 2)
        if side in b.sides:
            found = _front(b, width, is_light)
        else:
            found = {"walls": [_quad(-width / 2, width / 2, -0.2, b.height + 0.7, 0.0, b.tile)]}
        for key, meshes in found.items():
            parts[key] += [m.moved((0.0, -reach, 0.0)).moved(yaw=k * np.pi / 2) for m in meshes]
    half_x, half_y = b.width / 2, b.depth / 2
    corners = np.array(
        [
            [(-half_x, -half_y, b.height), (-half_x, half_y, b.height)],
            [(half_x, -half_y, b.height), (half_x, half_y, b.height)],
        ]
    )
    parts["walls"].append(grid(corners, corners[..., :2] / b.tile).flipped())
    if not is_light:
        parts["trim"] += [
            box((2.4, 2.0, 1.6), (-0.2 * b.width, 0.1 * b.depth, b.height + 0.7)),
            box((0.7, 0.7, 2.2), (0.3 * b.width, -0.1 * b.depth, b.height + 1.0)),
        ]
    return {key: merge(meshes) for key, meshes in parts.items()}
