"""What stands along the road: delineators, signs, power poles, fences, hedgerows, trees, bales, and the farm."""

from __future__ import annotations

import numpy as np

from ..generators.buildings import building
from ..generators.buildings.houses import HousePlan, family_house, house_parts
from ..generators.geometry.mesh import Array, merge
from ..generators.kit import Prefab, SceneKit
from ..generators.plants import planting, species, vegetation
from ..generators.roads.ground import Ground
from ..generators.roadside import furniture, garden, rural
from ..generators.scene_toml import Parking
from . import layout as at
from .layout import Plan
from .static import YARD

METAL = {"back": "sign_back", "pole": "galvanized_steel"}
TREE = {"trunk": "bark_furrowed", "core": "leaves_shade", "leaves": "leaf_cards"}
REACH = 3.4
"""Largest radius of a crown [m]: it keeps off the road and off the wires."""


def add_things(kit: SceneKit, p: Plan, ground: Ground, generator: np.random.Generator) -> None:
    """Add every object; `generator` decides where the variant leaves a choice."""
    _roadside(kit, p, ground)
    _poles(kit, p, ground)
    _fences(kit, p, ground)
    _farm(kit, p, ground, generator)
    _trees(kit, p, ground, generator)
    _fields(kit, p, ground, generator)


def _on(p: Plan, ground: Ground, s: float, offset: float) -> tuple[Array, float]:
    """Return a place on the ground, shape (3,) [m], and the direction of the road there [deg]."""
    where, yaw = p.way.place(s, offset)
    return ground.on(where[None])[0], yaw


def _line(p: Plan, ground: Ground, start: float, stop: float, offset: float, step: float = 3.0) -> Array:
    """Return a line on the ground beside the road, shape (n, 3) [m]."""
    return ground.on(p.way.line(start, stop, offset, step))


def _roadside(kit: SceneKit, p: Plan, ground: Ground) -> None:
    post = kit.prefab(
        "delineator",
        kit.slim(furniture.delineator(), "reflector", "band", "post"),
        {"post": "white_plastic", "band": "black_plastic", "reflector": "reflector"},
    )
    step = 50.0 if kit.is_light else 25.0
    for number, s in enumerate(np.arange(at.START + 15.0, 185.0, step)):
        for side, name, turn in ((-1, "right", 0.0), (1, "left", 180.0)):
            railed = p.rail_side == side and p.rail[0] - 2.0 < s < p.rail[1] + 2.0
            if side > 0 and abs(s - p.farm) < 4.0:
                continue
            where, yaw = _on(p, ground, float(s), side * (at.HALF + (1.55 if railed else 0.62)))
            kit.place(post, f"delineator_{name}_{number:02d}", "Pole", where, yaw + turn)
    bend = "sign_bend_left" if p.rail_side < 0 else "sign_arrows_right"
    warning = kit.prefab(
        "sign_bend", kit.slim(furniture.sign("triangle"), "back", "pole"), {"face": "sign_bend_left", **METAL}
    )
    board = kit.prefab(
        "sign_board",
        kit.slim(furniture.sign("board", 1.35), "back", "pole"),
        {"face": "sign_arrows" if p.rail_side < 0 else "sign_arrows_right", **METAL},
    )
    if bend == "sign_bend_left":
        where, yaw = _on(p, ground, -22.0, -(at.HALF + 1.5))
        kit.place(warning, "sign_bend", "TrafficSign", where, yaw)
    for number, s in enumerate((52.0, 68.0, 84.0)):
        where, yaw = _on(p, ground, s, p.rail_side * (at.HALF + 1.9))
        kit.place(board, f"sign_board_{number}", "TrafficSign", where, yaw - 14.0 * p.rail_side * -1.0)
    stone = kit.prefab("milestone", {"stone": rural.milestone()}, {"stone": "kerb_stone"})
    where, yaw = _on(p, ground, 14.0, -(at.HALF + 1.3))
    kit.place(stone, "milestone", "Static", where, yaw)


def _poles(kit: SceneKit, p: Plan, ground: Ground) -> None:
    parts = rural.power_pole()
    thing = kit.prefab(
        "power_pole",
        kit.slim(parts, "insulators", "arm", "pole"),
        {"pole": "timber_grey", "arm": "galvanized_steel", "insulators": "white_plastic"},
    )
    feet, headings = [], []
    for number, s in enumerate(np.arange(-125.0, 240.0, 44.0)):
        where, yaw = _on(p, ground, float(s), -14.0)
        kit.place(thing, f"power_pole_{number}", "Pole", where, yaw)
        feet.append(where)
        headings.append(np.radians(yaw))
    kit.add(
        "wires_power", rural.wires(np.array(feet), np.array(headings), pieces=4 if kit.is_light else 8), "iron_dark"
    )
    kit.instance("wires", "Other", ["wires_power"])


def _fences(kit: SceneKit, p: Plan, ground: Ground) -> None:
    if kit.is_light:
        rails = [garden.rail_fence(_line(p, ground, -40.0, p.farm - YARD - 2.0, 12.6, 4.0))]
        kit.add("fence_rails", merge(rails), "timber_grey")
        kit.instance("paddock_fence", "Fence", ["fence_rails"])
        return
    posts, threads = garden.wire_fence(_line(p, ground, -70.0, 58.0, -10.8), 1.1, 3.2)
    kit.add("fence_wire_posts", posts, "timber_grey")
    kit.add("fence_wire_threads", threads, "galvanized_steel")
    kit.instance("field_fence", "Fence", ["fence_wire_*"])
    kit.add("fence_rails", garden.rail_fence(_line(p, ground, -40.0, p.farm - YARD - 2.0, 12.6)), "timber_grey")
    kit.instance("paddock_fence", "Fence", ["fence_rails"])


def _farm(kit: SceneKit, p: Plan, ground: Ground, generator: np.random.Generator) -> None:
    """Place the farmhouse and the barn round the yard, with parking places in it."""
    home = family_house(generator, "wall_brick" if p.variant % 2 else "wall_white", False)
    barn_windows = [(side, y, 3.0, 1.6, 0.8) for side in ("front", "back") for y in (-6.4, -3.2, 3.2, 6.4)]
    shape = building.House(17.0, 9.5, 4.4, 8.2, barn_windows, [("front", 0.0, 3.6, 3.4)], 0.55, 1.6, False)
    barn = HousePlan(
        shape,
        {"walls": "boards", "roof": "tiles_dark", "frames": "timber_grey", "panes": "window_pane", "doors": "door_red"},
    )
    for name, plan, s, offset, turn in (
        ("farmhouse", home, p.farm - 9.0, 37.0, 0.0),
        ("barn", barn, p.farm + 11.5, 37.0, 0.0),
    ):
        where, yaw = _on(p, ground, s, offset)
        thing = kit.prefab(name, house_parts(plan, kit.is_light), {**plan.bsdfs, "steps": "kerb_stone"})
        kit.place(thing, name, "Building", (where[0], where[1], where[2] + 0.02), yaw + turn)
    for s in (p.farm - 12.0, p.farm - 8.5, p.farm + 8.0):
        where, yaw = _on(p, ground, s, 26.0)
        x, y, z = (float(v) for v in where)
        kit.parking.append(Parking((x, y, z), round((yaw + 90.0) % 360.0, 3), 5.2, 2.8))
    hedges = [
        planting.hedge(_line(p, ground, *ends, 14.2), 1.5, 0.8, 7 + k, 0.8 if kit.is_light else 0.4)
        for k, ends in enumerate(((p.farm - YARD, p.farm - 3.2), (p.farm + 3.2, p.farm + YARD)))
    ]
    rows = [
        planting.hedge(_line(p, ground, *ends, -11.5), 1.9, 1.3, 17 + k, 1.0 if kit.is_light else 0.5, 0.14)
        for k, ends in enumerate(((62.0, 118.0), (128.0, 190.0)))
    ]
    kit.add("hedges_farm", merge([*hedges, *rows]), "hedge", 50.0)
    kit.instance("hedges", "Vegetation", ["hedges_farm"])


def _tree_kinds(kit: SceneKit, p: Plan) -> list[Prefab]:
    """Return three kinds of trees, those of variant 0, or four that the variant draws."""
    if p.variant:
        drawn = np.random.default_rng([31, p.variant]).permutation(species.COUNTRY)[:4]
        shapes = {str(kind): species.pruned(str(kind), 14.0, REACH, 0.0) for kind in drawn}
        return [species.prefab(kit, kind, p.variant + 31, shape) for kind, shape in shapes.items()]
    tall = vegetation.TreeShape(10.0, 3.2, 2.8, 0.18, 13, 1500, 0.42)
    round_ = vegetation.TreeShape(7.2, 2.8, 2.0, 0.14, 11, 1100, 0.40)
    kinds = [
        kit.prefab(f"tree_{k}", vegetation.tree(shape, p.variant * 3 + 31 + k, kit.is_light), TREE, 60.0)
        for k, shape in enumerate((tall, round_))
    ]
    spruce = kit.prefab(
        "spruce",
        planting.conifer(11.0, 2.6, p.variant + 5, is_light=kit.is_light),
        {"trunk": "bark_furrowed", "core": "needles"},
        40.0,
    )
    return [*kinds, spruce]


def _trees(kit: SceneKit, p: Plan, ground: Ground, generator: np.random.Generator) -> None:
    kinds = _tree_kinds(kit, p)
    spots = [
        (float(s), 12.4 if not -44.0 < s < 62.0 else 15.4, k % 2)
        for k, s in enumerate(np.arange(-118.0, 200.0, 36.0 if kit.is_light else 18.0))
        if abs(s - p.farm) > YARD + 6.0
    ]
    spots += [(p.farm - 22.0, 31.0, 0), (p.farm + 25.0, 30.0, 1), (p.farm + 2.0, 44.0, 0)]
    if not kit.is_light:
        spots += [(-60.0 + 3.0 * k, -24.0 - 5.0 * (k % 3), 2) for k in range(7)] + [
            (140.0, -17.0, 1),
            (158.0, -19.0, 0),
            (30.0, -25.0, 1),
            (4.0, -19.5, 0),
        ]
    for number, (s, offset, kind) in enumerate(spots):
        where, _ = _on(p, ground, s + float(generator.uniform(-2.0, 2.0)), offset)
        scale = float(np.round(generator.uniform(0.8, 1.2), 2))
        thing = kinds[number % len(kinds) if p.variant else kind]
        kit.place(thing, f"tree_{number:02d}", "Vegetation", where, 47.0 * number, scale)


def _fields(kit: SceneKit, p: Plan, ground: Ground, generator: np.random.Generator) -> None:
    """Add bales, grass tufts along the verges, and far woods."""
    if not kit.is_light:
        bale = kit.prefab("bale", {"straw": rural.straw_bale()}, {"straw": "straw"}, 40.0)
        for number in range(7):
            where, _ = _on(p, ground, float(generator.uniform(-30.0, 24.0)), -float(generator.uniform(30.0, 52.0)))
            kit.place(bale, f"bale_{number}", "Static", where, float(np.round(generator.uniform(0.0, 360.0), 1)))
        count = 260
        s, side = generator.uniform(-30.0, 100.0, count), generator.choice((-1.0, 1.0), count)
        s = np.where((side > 0) & (np.abs(s - p.farm) < 4.0), s - 9.0, s)
        feet = ground.on(p.way.point(s, side * generator.uniform(at.HALF + 0.9, 7.0, count)))
        dry = generator.uniform(0, 1, count) < 0.35
        for name, chosen, bsdf in (("green", ~dry, "grass_blades"), ("dry", dry, "grass_dry")):
            kit.add(f"tufts_{name}", vegetation.tufts(feet[chosen], p.variant + 12, 6, 0.3), bsdf)
        kit.instance("grass_tufts", "Vegetation", ["tufts_*"])
    count = 70 if kit.is_light else 140
    s, side = generator.uniform(at.START - 60.0, at.STOP + 60.0, count), generator.choice((-1.0, 1.0), count)
    places = p.way.point(np.clip(s, -220.0, 320.0), side * generator.uniform(92.0, 150.0, count))
    places[:, 2] = at.BASE - 0.3
    ends = [
        p.way.point(np.full(16, along), np.linspace(-60.0, 60.0, 16)) for along in (at.STOP + 25.0, at.START - 25.0)
    ]
    for end in ends:
        end[:, 2] = at.BASE - 0.3
        end[:, :2] += generator.normal(0.0, 3.0, (16, 2))
    places = np.vstack([places, *ends])
    far = vegetation.woods(places, generator.uniform(9.0, 16.0, len(places)), p.variant + 40, 4 if kit.is_light else 11)
    for part, body in far.items():
        kit.add(f"woods_{part}", body, "leaves_shade" if part == "core" else "leaf_cards", 80.0)
    kit.instance("woods", "Vegetation", ["woods_*"])
