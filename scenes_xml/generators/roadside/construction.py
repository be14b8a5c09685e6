"""Construction sites: mesh fence on feet, barrier boards with lamps, scaffolding, a site hut, a heap of soil.

Foot at the origin; fences and scaffolding along x, their front at -y.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..geometry.mesh import Mesh, box, grid, merge, tube
from ..kit import SceneKit

PANEL = 3.5
"""Length of a panel of the fence [m]."""
FENCE = {"steel": "galvanized_steel", "feet": "concrete_grey"}
BOARD = {"face": "barrier_board", "back": "white_plastic", "feet": "black_plastic", "lamp": "reflector"}
SCAFFOLDING = {"tubes": "galvanized_steel", "decks": "boards"}
"""Materials of the parts of `fence_panel`, `barrier_board` and `scaffolding`."""


def _plain(part: Mesh) -> Mesh:
    return Mesh(part.vertices, part.faces)


def fence_panel(is_light: bool = False) -> dict[str, Mesh]:
    """Return ``steel`` (frame, and wires 0.1 m by 0.3 m apart) and ``feet`` of a panel of 2 m about the origin."""
    half, low, high = 0.5 * PANEL - 0.03, 0.12, 2.0
    bars = [tube(np.array([(x, 0.0, 0.02), (x, 0.0, high)]), 0.02, 8) for x in (-half, half)]
    bars += [tube(np.array([(-half, 0.0, z), (half, 0.0, z)]), 0.016, 6) for z in (low, high)]
    if not is_light:
        bars += [tube(np.array([(x, 0.0, low), (x, 0.0, high)]), 0.003, 3) for x in np.arange(-half + 0.1, half, 0.1)]
        bars += [tube(np.array([(-half, 0.0, z), (half, 0.0, z)]), 0.003, 3) for z in np.arange(low + 0.3, high, 0.3)]
    feet = [box((0.24, 0.7, 0.13), (x, 0.0, 0.065)) for x in (-0.5 * PANEL, 0.5 * PANEL)]
    return {"steel": merge([_plain(bar) for bar in bars]), "feet": merge([_plain(foot) for foot in feet])}


def barrier_board(width: float = 2.0) -> dict[str, Mesh]:
    """Return ``face``, ``back``, ``feet`` and ``lamp`` of a red and white board 1 m above the ground that faces -y."""
    low, high = 0.75, 1.0
    corners = np.array([[(x, -0.016, low), (x, -0.016, high)] for x in (-width / 2, width / 2)])
    face = grid(corners, np.array([[(0.0, 1.0), (0.0, 0.0)], [(width, 1.0), (width, 0.0)]]))
    posts = [box((0.05, 0.05, 1.05), (x, 0.03, 0.53)) for x in (-0.4 * width, 0.4 * width)]
    back = [box((width, 0.03, high - low), (0.0, 0.0, 0.5 * (low + high))), *posts]
    feet = [box((0.3, 0.8, 0.1), (x, 0.0, 0.05)) for x in (-0.4 * width, 0.4 * width)]
    lamp = tube(np.array([(0.4 * width, -0.04, 1.17), (0.4 * width, 0.04, 1.17)]), 0.09, 14)
    parts = {"back": merge(back), "feet": merge(feet), "lamp": lamp}
    return {"face": face, **{name: _plain(part) for name, part in parts.items()}}


def scaffolding(width: float, height: float, depth: float = 0.75, is_light: bool = False) -> dict[str, Mesh]:
    """Return ``tubes`` and ``decks`` of scaffolding that stands before a wall in the plane y = 0.

    Bays of 2.5 m, decks every 2 m with two rails and diagonals.
    """
    bays = max(1, round(width / 2.5))
    x = np.linspace(-0.5 * width, 0.5 * width, bays + 1)
    levels = np.arange(2.0, height, 2.0)
    front, rear, sides = -depth - 0.2, -0.2, 4 if is_light else 8
    foot = -0.01  # below what it stands on, in whose plane its ends would lie
    bars = [tube(np.array([(px, y, foot), (px, y, height + 0.6)]), 0.024, sides) for px in x for y in (front, rear)]
    decks = []
    for number, z in enumerate(levels):
        decks.append(box((width, depth - 0.06, 0.05), (0.0, 0.5 * (front + rear), z)))
        rails = (0.5, 1.0) if not is_light else (1.0,)
        bars += [tube(np.array([(x[0], front, z + r), (x[-1], front, z + r)]), 0.02, sides) for r in rails]
        if not is_light:
            bay = number % bays
            bars.append(tube(np.array([(x[bay], front, z - 2.0), (x[bay + 1], front, z)]), 0.02, sides))
    return {"tubes": merge([_plain(bar) for bar in bars]), "decks": merge(decks)}


def place_scaffolding(
    kit: SceneKit, size: tuple[float, float], where: Sequence[float], yaw_deg: float, name: str = "scaffolding"
) -> None:
    """Place scaffolding of a width and a height [m] before a wall: `where` is its foot, to -y of it the street."""
    thing = kit.prefab(name, scaffolding(*size, is_light=kit.is_light), SCAFFOLDING)
    kit.place(thing, name, "Static", where, yaw_deg)


def place_trench_works(kit: SceneKit, middle: Sequence[float], length: float, width: float) -> None:
    """Close a parking place along x for works: boards at its ends, a fence towards the road at +y, and a heap of soil.

    `middle` (3,), `length` and `width` are those of the place [m].
    """
    x, y, z = middle
    board, fence = (
        kit.prefab("works_board", barrier_board(), BOARD),
        kit.prefab("works_fence", fence_panel(True), FENCE),
    )
    soil = kit.prefab("works_heap", {"soil": heap()}, {"soil": "soil"}, 60.0)
    for number, (at, yaw) in enumerate(((x - 0.5 * length + 0.5, -90.0), (x + 0.5 * length - 0.5, 90.0))):
        kit.place(board, f"works_board_{number}", "Static", (at, y, z), yaw)
    kit.place(fence, "works_fence", "Fence", (x, y + 0.5 * width - 0.4, z), 180.0)
    kit.place(soil, "works_heap", "Terrain", (x + 0.2, y - 0.3, z), 20.0, 0.28)


def site_hut() -> dict[str, Mesh]:
    """Return ``shell``, ``frame``, ``pane`` and ``door`` of a container of 6.06 x 2.44 x 2.6 m whose front is -y."""
    long, deep, high = 6.06, 2.44, 2.6
    ribs = [box((0.04, 0.03, high - 0.3), (x, -deep / 2 - 0.012, high / 2)) for x in np.arange(-2.8, 2.9, 0.4)]
    corners = [(sx * (long / 2 - 0.03), sy * (deep / 2 - 0.03)) for sx in (-1, 1) for sy in (-1, 1)]
    edge = [box((0.12, 0.12, high), (*corner, high / 2)) for corner in corners]
    edge += [box((long, 0.12, 0.14), (0.0, sy * (deep / 2 - 0.03), z)) for sy in (-1, 1) for z in (0.08, high - 0.07)]
    parts = {
        "shell": merge([box((long - 0.04, deep - 0.04, high - 0.06), (0.0, 0.0, high / 2)), *ribs]),
        "frame": merge(edge),
        "pane": box((1.3, 0.05, 1.0), (1.3, -deep / 2 - 0.02, 1.5)),
        "door": box((0.95, 0.05, 2.0), (-1.4, -deep / 2 - 0.02, 1.1)),
    }
    return {name: _plain(part) for name, part in parts.items()}


def heap(radius: float = 2.4, height: float = 1.5, seed: int = 0) -> Mesh:
    """Return an uneven heap of soil; uv in 3 m."""
    generator = np.random.default_rng(seed)
    rings, segments = 6, 18
    angle = 2.0 * np.pi * np.arange(segments) / segments
    rows = []
    for k in range(rings):
        share = k / (rings - 1)
        r = radius * (1.0 - share) * generator.uniform(0.9, 1.1, segments) + 0.02
        z = height * share**0.8 * generator.uniform(0.92, 1.05, segments) - 0.05
        rows.append(np.column_stack([r * np.cos(angle), r * np.sin(angle), z]))
    points = np.stack(rows)
    body = grid(points, points[..., :2] / 3.0, close_columns=True)
    return body if _looks_up(body) else body.flipped()


def _looks_up(mesh: Mesh) -> bool:
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    return bool(np.cross(b - a, c - a)[:, 2].sum() > 0.0)
