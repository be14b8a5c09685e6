"""What years bring to the street of a variant.

Patches and covers, the rails of a tram below its wires, scaffolding, works in a parking place, parked bicycles.
"""

from __future__ import annotations

import numpy as np

from ..generators.geometry.mesh import merge
from ..generators.kit import SceneKit
from ..generators.roads.wear import LaneSurface, add_rails, add_wear
from ..generators.roadside import construction, tramway
from ..generators.roadside.bicycle_stand import place_bicycles
from ..generators.surfaces import interior
from . import layout as at
from . import static
from .layout import STREET, Layout

TRAMS, SCAFFOLDS = 0.4, 0.5
"""Shares of the variants that have a tram, and scaffolding before a house."""
WIRE, ANCHOR = 5.5, 6.6
"""Heights of contact wires and of where the wires across are fixed [m]."""
BEHIND = 0.45
"""How far the middle of a parked bicycle is from the wall [m]."""


def add_years(kit: SceneKit, plan: Layout) -> None:
    """Add what the variant's seed draws."""
    g = np.random.default_rng([plan.seed, 20])
    s = np.arange(at.START + 4.0, at.STOP - 4.0 + 1e-9, 2.0)
    lanes = [LaneSurface.along(STREET, s, y, at.LANE_LEFT) for y in (0.0, at.LANE_LEFT)]
    kit.materials["grey_steel"] = interior.MATERIALS["grey_steel"]
    add_wear(kit, lanes, g, "town", with_covers=True)
    if g.uniform() < TRAMS:
        add_rails(kit, lanes)
        _wires(kit, plan, s)
    busy = _scaffolding(kit, plan, g) if g.uniform() < SCAFFOLDS else None
    if plan.works is not None:
        width = at.PARKING - at.KERB_RIGHT
        construction.place_trench_works(kit, (plan.works, at.BAY, 0.0), 6.0, width)
    _bicycles(kit, plan, g, busy)


def _wires(kit: SceneKit, plan: Layout, s: np.ndarray) -> None:
    """Hang contact wires over both tracks from wires between the houses; none of those is in a tree."""
    tracks = (0.0, at.LANE_LEFT)
    parts = [tramway.contact_wire(STREET.point(s[[0, -1]], y), WIRE) for y in tracks]
    stems = np.array([tree.x for tree in plan.trees])
    for x in np.arange(at.START + 8.0, at.STOP - 6.0, 27.0):
        free = [x + d for d in (0.0, 2.0, -2.0, 4.0, -4.0) if np.abs(stems - x - d).min(initial=9.0) > 2.6] or [x]
        ends = [np.array([free[0], wall, ANCHOR]) for wall in plan.walls]
        parts.append(tramway.span_wire(ends, [np.array([free[0], y]) for y in tracks], WIRE))
    kit.add("wires_tram", merge(parts), "galvanized_steel")
    kit.instance("tram_wires", "Other", ["wires_tram"])


def _scaffolding(kit: SceneKit, plan: Layout, g: np.random.Generator) -> tuple[float, float, float] | None:
    """Place scaffolding before one of the houses near by, and return its side and from where to where it stands."""
    near = [one for one in static.houses(plan) if one[0] != "house_end" and -15.0 < one[4][0] < 70.0]
    _, shape, _, turn, where = near[int(g.integers(len(near)))]
    side = float(np.sign(where[1]))
    width = shape.length - 0.6
    wall = plan.walls[0] if side > 0 else plan.walls[1]
    size = width, shape.eaves - 1.2
    construction.place_scaffolding(kit, size, (where[0], wall, at.KERB_HEIGHT), turn)
    return side, where[0] - 0.5 * width - 1.2, where[0] + 0.5 * width + 1.2


def _bicycles(kit: SceneKit, plan: Layout, g: np.random.Generator, busy: tuple[float, float, float] | None) -> None:
    """Park bicycles along the walls, off benches and scaffolding."""
    places = []
    for x in np.arange(-30.0, 90.0, 2.4):
        side, turn = (1.0, -1.0)[int(g.integers(2))], float(g.choice((0.0, 180.0)))
        taken = busy is not None and side == busy[0] and busy[1] < x < busy[2]
        taken |= any(np.sign(y) == side and abs(x - other) < 2.2 for other, y, _ in plan.benches)
        if g.uniform() < 0.25 and not taken:
            wall = plan.walls[0] if side > 0 else plan.walls[1]
            places.append(((float(x), wall - side * BEHIND, at.KERB_HEIGHT), turn))
    place_bicycles(kit, places, g)
