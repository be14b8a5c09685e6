"""Detached houses from a random generator.

Ground plan, storeys, windows, walls, roof, doors, and whether there is a garage.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..geometry.mesh import Mesh, box, merge
from ..kit import Prefab, SceneKit
from .building import House, house

WALLS = ("wall_white", "wall_ochre", "wall_brick", "wall_cool", "wall_rose")
DOORS = ("door_wood", "door_green", "door_red")


@dataclass(frozen=True)
class HousePlan:
    """A house to build: its measures, its materials by part, and the garage's width [m] (0 = none) at its right end."""

    shape: House
    bsdfs: dict[str, str]
    garage: float = 0.0

    @property
    def half_depth(self) -> float:
        """Half the depth of the ground plan [m]."""
        return self.shape.depth / 2


def family_house(generator: np.random.Generator, walls: str | None = None, has_garage: bool | None = None) -> HousePlan:
    """Return a detached house of one or two storeys whose front (-y) has the door; front windows in even columns."""
    length, depth = (float(np.round(generator.uniform(*span), 1)) for span in ((8.5, 12.0), (7.2, 9.0)))
    storeys = int(generator.integers(1, 3))
    eaves = float(np.round(0.45 + 2.65 * storeys + generator.uniform(0.0, 0.3), 2))
    ridge = float(np.round(eaves + generator.uniform(0.42, 0.52) * depth, 2))
    columns = 3 if length < 10.3 else 4
    along = np.round((np.arange(columns) - (columns - 1) / 2) * (length - 1.4) / columns, 2)
    door = int(generator.integers(0, columns))
    windows = []
    for storey in range(storeys):
        sill = 1.0 + 2.65 * storey
        for column, y in enumerate(along):
            if storey > 0 or column != door:
                windows.append(("front", float(y), sill, 1.25, 1.3))
            windows.append(("back", float(y), sill, 1.25, 1.3))
        windows += [(side, float(y), sill, 1.0, 1.3) for side in ("left", "right") for y in (-1.7, 1.7)]
    windows += [(side, 0.0, eaves + 0.5, 0.9, 1.0) for side in ("left", "right")]
    surface = walls or str(generator.choice(WALLS))
    bsdfs = {
        "walls": surface,
        "roof": str(generator.choice(("tiles_red", "tiles_red", "tiles_dark"))),
        "frames": "painted_wood",
        "panes": "window_pane",
        "doors": str(generator.choice(DOORS)),
    }
    garage = 3.4 if (generator.uniform() < 0.6 if has_garage is None else has_garage) else 0.0
    overhang = float(np.round(generator.uniform(0.35, 0.5), 3))
    tile = 1.3 if surface == "wall_brick" else 3.0
    shape = House(
        length,
        depth,
        eaves,
        ridge,
        windows,
        [("front", float(along[door]), 1.1, 2.15)],
        overhang,
        tile,
        bool(generator.uniform() < 0.8),
    )
    return HousePlan(shape, bsdfs, garage)


def _scaled_uv(part: Mesh, tile: float) -> Mesh:
    """Return a part whose texture coordinates, now in metres, count tiles of `tile` [m]."""
    return Mesh(part.vertices, part.faces, None if part.uv is None else part.uv / tile)


def house_parts(plan: HousePlan, is_light: bool) -> dict[str, Mesh]:
    """Return the parts of a house; at the light level walls, roof and panes alone."""
    parts = house(plan.shape)
    for plain in ("frames", "panes", "doors"):  # of one colour: no texture coordinates
        lift = 0.001 if plain == "panes" else 0.0  # so that a pane and the bar before it end in two planes
        parts[plain] = Mesh(parts[plain].vertices + [0.0, 0.0, lift], parts[plain].faces)
    if plan.garage:
        x = plan.shape.length / 2 + plan.garage / 2
        front = -plan.half_depth + 1.2
        body = box((plan.garage - 0.02, 6.0, 3.6), (x, front + 3.0, 0.8))
        parts["walls"] = merge([parts["walls"], _scaled_uv(body, plan.shape.texture_size)])
        cover = box((plan.garage + 0.24, 6.3, 0.14), (x + 0.13, front + 3.0, 2.67))
        parts["roof"] = merge([parts["roof"], _scaled_uv(cover, 3.0)])
        if not is_light:
            gate = merge([box((2.6, 0.05, 0.42), (x, front - 0.01, 0.22 + 0.44 * k)) for k in range(5)])
            parts["gate"] = Mesh(gate.vertices, gate.faces)
    if is_light:
        return {name: parts[name] for name in ("walls", "roof", "panes")}
    step = box((1.7, 1.0, 0.5), (plan.shape.doors[0][1], -plan.half_depth - 0.5, -0.12))
    parts["steps"] = step
    return parts


def build_house(kit: SceneKit, name: str, plan: HousePlan) -> Prefab:
    """Write the parts of a house and return what `SceneKit.place` needs."""
    bsdfs = {**plan.bsdfs, "gate": "garage_door", "steps": "kerb_stone"}
    return kit.prefab(name, house_parts(plan, kit.is_light), bsdfs)
