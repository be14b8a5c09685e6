"""What years bring to the streets of a variant.

Patches, the rails of a tram below its wires, scaffolding, parked bicycles.
"""

from __future__ import annotations

import numpy as np

from ..generators.buildings.cityblock import Block
from ..generators.geometry.mesh import merge
from ..generators.kit import SceneKit
from ..generators.roads.sweep import STRAIGHT
from ..generators.roads.wear import LaneSurface, add_rails, add_wear
from ..generators.roadside import construction, tramway
from ..generators.roadside.bicycle_stand import place_bicycles
from . import layout as at
from . import static
from .lanes import offsets

TRAMS, SCAFFOLDS = 0.4, 0.6
"""Shares of the variants that have a tram, and scaffolding before a house."""
WIRE, ANCHOR = 5.25, 7.0
"""Heights of contact wires, below the heads of the lights, and of where the wires across are fixed [m]."""
SPANS = (-88.0, -61.0, -36.0, 34.0, 59.0, 84.0)
"""Where wires hang across the main street [m]."""
BESIDE = 1.5
"""How far the middle of a parked bicycle is from the kerb [m]: between the trees and the people who walk."""
ROOM = 4.4
"""Narrowest pavement that has room for scaffolding beside the people who walk [m]."""


def add_years(kit: SceneKit, plan: at.Layout) -> None:
    """Add what the variant's seed draws."""
    g = np.random.default_rng([at.SEED, plan.variant, 20])
    add_wear(kit, list(_lanes(plan)), g, "town")
    if g.uniform() < TRAMS:
        _tram(kit, plan)
    if g.uniform() < SCAFFOLDS and plan.pavement[0] > ROOM:
        _scaffolding(kit, plan, g)
    _bicycles(kit, plan, g)


def _lanes(plan: at.Layout) -> list[LaneSurface]:
    """Return the surfaces of the arms' lanes, from behind the crossings to the end of the street."""
    found = []
    for heading, is_main in at.ARMS.values():
        stop, reach = (plan.stop[0], at.REACH[0]) if is_main else (plan.stop[1], at.REACH[1])
        for middle in (sign * d for d in offsets(is_main) for sign in (-1.0, 1.0)):
            line = at.turned(np.array([(-reach + 2.0, middle), (-stop - 1.0, middle)]), heading)
            found.append(LaneSurface.level(line, at.LANE))
    return found


def _tram(kit: SceneKit, plan: at.Layout) -> None:
    """Lay rails in the inner lanes of the main street, straight over the crossing, and hang their wires."""
    reach, inner = at.REACH[0] - 2.0, 0.5 * at.LANE
    ends = np.array([-reach, reach])
    add_rails(kit, [LaneSurface.along(STRAIGHT, ends, y, at.LANE) for y in (-inner, inner)])
    parts = [tramway.contact_wire(np.column_stack([ends, np.full(2, y)]), WIRE) for y in (-inner, inner)]
    wall = at.MAIN + plan.pavement[0]
    for x in SPANS:
        walls = [np.array([x, y, ANCHOR]) for y in (-wall, wall)]
        parts.append(tramway.span_wire(walls, [np.array([x, y]) for y in (-inner, inner)], WIRE, 0.5))
    kit.add("wires_tram", merge(parts), "galvanized_steel")
    kit.instance("tram_wires", "Other", ["wires_tram"])


def _scaffolding(kit: SceneKit, plan: at.Layout, g: np.random.Generator) -> None:
    """Place scaffolding before a house of the main street without balconies, away from the bus stop."""
    near = [h for h in plan.houses if abs(h.x) < 75.0 and h.turn in (0.0, 180.0) and not plan.kinds[h.kind][4]]
    near = [h for h in near if not (h.y < 0.0 and abs(h.x - plan.stop_x) < 18.0)]
    if near:
        house = near[int(g.integers(len(near)))]
        width, storeys = plan.kinds[house.kind][:2]
        wall = float(np.sign(house.y)) * (at.MAIN + plan.pavement[0])
        size = width - 0.6, Block(width, at.DEPTH, storeys).height - 1.6
        construction.place_scaffolding(kit, size, (house.x, wall, at.KERB), house.turn)


def _bicycles(kit: SceneKit, plan: at.Layout, g: np.random.Generator) -> None:
    """Park bicycles along the kerbs of the main street, off trees, benches, bins and the bus stop."""
    taken = np.array([*(x for x, _ in static.TREES), *static.BENCHES, -22.2])
    places = []
    for x in (*np.arange(-75.0, -18.0, 2.4), *np.arange(18.0, 75.0, 2.4)):
        side, turn = (1.0, -1.0)[int(g.integers(2))], float(g.choice((0.0, 180.0)))
        at_stop = side < 0.0 and abs(x - plan.stop_x) < 6.0
        if g.uniform() < 0.35 and np.abs(taken - x).min() > 2.0 and not at_stop:
            places.append(((float(x), side * (at.MAIN + BESIDE), at.KERB), turn))
    place_bicycles(kit, places, g)
