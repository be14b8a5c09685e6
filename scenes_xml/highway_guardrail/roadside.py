"""Everything beside the road that is an object of its own: signs, posts, lamps, buildings, plants."""

from __future__ import annotations

import numpy as np

from ..generators.buildings import building, houses
from ..generators.geometry.mesh import Array, Mesh
from ..generators.kit import Prefab, SceneKit
from ..generators.plants import species, vegetation
from ..generators.roads import road
from ..generators.roadside import furniture
from . import layout as at
from .layout import Layout

FIRST_TREES = {
    "tall": (vegetation.TreeShape(9.5, 3.3, 2.4), 3),
    "broad": (vegetation.TreeShape(7.0, 3.0, 1.9, 0.14, 14, 3600), 4),
}
"""The two trees of variant 0: measures and seed."""


def ground_height(plan: Layout, s: float, offset: float) -> float:
    """Return the height of the ground [m] beside the pavement."""
    edge = at.PAVEMENT_RIGHT if offset < 0 else at.PAVEMENT_LEFT
    return float(road.verge_heights(plan.curve, np.array([s]), np.array([offset]), edge, plan.seed + 5)[0, 0])


def _pose(plan: Layout, s: float, offset: float, turn_deg: float = 0.0) -> tuple[tuple[float, float, float], float]:
    """Return place and yaw [deg] of a thing that looks along the road at arc length `s`."""
    x, y, _ = plan.curve.point(np.array(s), offset)
    yaw = float(np.degrees(plan.curve.heading(np.array(s)))) + turn_deg
    return (float(x), float(y), ground_height(plan, s, offset)), yaw


def add_everything(kit: SceneKit, plan: Layout) -> None:
    """Add every object beside the road."""
    _posts(kit, plan)
    _signs(kit, plan)
    _lamps_and_barriers(kit, plan)
    _buildings(kit, plan)
    _trees(kit, plan)
    _fields(kit, plan)


def _posts(kit: SceneKit, plan: Layout) -> None:
    bsdfs = {"post": "white_plastic", "band": "black_plastic", "reflector": "reflector"}
    places = []
    for k, s in enumerate(np.arange(-50.0, 151.0, 25.0)):
        for side, name, turn in ((-1, "right", 0.0), (1, "left", 180.0)):
            is_behind = side == plan.outside and plan.rail[0] - 2 < s < plan.rail[1] + 2
            offset = plan.beside(side, 1.6 if is_behind else 0.6)
            places.append((f"delineator_{name}_{k:02d}", _pose(plan, float(s), offset, turn)))
    if kit.is_light:
        copies = [(where, yaw, 1.0) for _, (where, yaw) in places]
        kit.copies("delineators", "Pole", furniture.delineator(), bsdfs, copies)
        return
    thing = kit.prefab("delineator", furniture.delineator(), bsdfs)
    for name, (where, yaw) in places:
        kit.place(thing, name, "Pole", where, yaw)


def _signs(kit: SceneKit, plan: Layout) -> None:
    metal = {"back": "sign_back", "pole": "galvanized_steel"}

    def sign(name: str, kind: str, face: str, *height: float) -> Prefab:
        return kit.prefab(name, kit.slim(furniture.sign(kind, *height), "back", "pole"), {"face": face, **metal})

    is_left = plan.outside < 0
    bend = sign("sign_triangle", "triangle", "sign_bend" if is_left else "sign_bend_right")
    speed = sign("sign_round", "round", "sign_speed")
    board = sign("sign_board", "board", "sign_chevron" if is_left else "sign_arrows_right", 1.45)
    for thing, name, s, offset, turn in (
        (bend, "sign_bend", 15.0, plan.beside(-1, 2.15), 4.0),
        (speed, "sign_speed", 24.0, plan.beside(-1, 2.15), 4.0),
        (speed, "sign_speed_left", 27.0, plan.beside(1, 1.85), 184.0),
        *(
            (board, f"sign_chevron_{k}", s, plan.beside(plan.outside, 2.45), -14.0 * plan.outside)
            for k, s in enumerate(plan.chevrons)
        ),
    ):
        where, yaw = _pose(plan, s, offset, turn)
        kit.place(thing, name, "TrafficSign", where, yaw)


def _lamps_and_barriers(kit: SceneKit, plan: Layout) -> None:
    bsdfs = {"pole": "galvanized_steel", "head": "sign_back", "glass": "lamp_glass"}
    lamp = kit.prefab("lamp", kit.slim(furniture.lamp_post(), "head", "pole"), bsdfs)
    turn = 0.0 if plan.outside < 0 else 180.0
    for k, s in enumerate(plan.lamps):
        where, yaw = _pose(plan, s, plan.beside(plan.outside, 2.75), turn)
        kit.place(lamp, f"lamp_{k}", "Pole", where, yaw)
    start, count = plan.barriers
    if not count:
        return
    barrier = kit.prefab("barrier", {"concrete": furniture.barrier()}, {"concrete": "concrete_grey"})
    for k in range(count):
        where, yaw = _pose(plan, start + 6.6 * k, plan.beside(-plan.outside, 1.0))
        kit.place(barrier, f"barrier_{k}", "Wall", where, yaw)


def _barn() -> building.House:
    high = [(side, y, 3.2, 1.6, 0.8) for side in ("front", "back") for y in (-8.0, -4.8, 4.8, 8.0)]
    doors = [("front", 0.0, 3.6, 3.6), ("left", 0.0, 3.2, 3.4)]
    return building.House(22.0, 11.0, 4.8, 8.6, high, doors, 0.6, 2.0, chimney=False)


def _buildings(kit: SceneKit, plan: Layout) -> None:
    bsdfs = {
        "walls": "plaster_wall",
        "roof": "roof_tile",
        "frames": "painted_wood",
        "panes": "window_pane",
        "doors": "door_wood",
    }
    barn_bsdfs = {**bsdfs, "walls": "brick_wall"}
    if plan.variant == 0 and not kit.is_light:
        house = kit.prefab("house", building.house(_first_house()), bsdfs)
        barn = kit.prefab("barn", building.house(_barn()), barn_bsdfs)
    else:
        generator = np.random.default_rng([plan.seed, 7])
        own = houses.HousePlan(_first_house(), bsdfs) if plan.variant == 0 else houses.family_house(generator)
        barn_walls = {"walls": str(generator.choice(("brick_wall", "boards", "plaster_grey")))} if plan.variant else {}
        house = houses.build_house(kit, "house", own)
        barn = houses.build_house(kit, "barn", houses.HousePlan(_barn(), {**barn_bsdfs, **barn_walls}))
    for thing, name, place in ((house, "house", plan.house), (barn, "barn", plan.barn)):
        where, yaw = _pose(plan, *place)
        kit.place(thing, name, "Building", where, yaw)


def _first_house() -> building.House:
    openings = [
        (side, y, z, 1.1, 1.35) for side in ("front", "back") for y in (-4.6, -2.3, 2.3, 4.6) for z in (1.0, 3.75)
    ]
    openings += [(side, y, z, 1.0, 1.35) for side in ("left", "right") for y in (-2.0, 2.0) for z in (1.0, 3.75)]
    openings += [(side, 0.0, 6.1, 0.9, 1.0) for side in ("left", "right")]
    openings += [(side, 0.0, 3.75, 1.1, 1.35) for side in ("front", "back")]
    return building.House(12.0, 8.5, 5.6, 9.2, openings, [("front", 0.0, 1.1, 2.2), ("back", 0.0, 1.1, 2.2)])


def _tree(kit: SceneKit, plan: Layout, kind: str) -> tuple[dict[str, Mesh], dict[str, str]]:
    """Return the parts of a kind of tree and their materials."""
    if kind not in FIRST_TREES:
        return species.tree(kind, plan.seed + 3, kit.is_light)
    shape, seed = FIRST_TREES[kind]
    bsdfs = {"trunk": "bark", "core": "leaves_shade", "leaves": "leaves"}
    return vegetation.tree(shape, plan.seed + seed, kit.is_light), bsdfs


def _trees(kit: SceneKit, plan: Layout) -> None:
    ready = {}
    for kind in dict.fromkeys(tree.kind for tree in plan.trees):
        parts, bsdfs = _tree(kit, plan, kind)
        prefix = {"tall": "tree_a", "broad": "tree_b"}.get(kind, f"tree_{kind}")
        if kit.is_light:
            same = [tree for tree in plan.trees if tree.kind == kind]
            copies = [(*_pose(plan, tree.s, tree.offset, tree.turn), tree.scale) for tree in same]
            kit.copies(prefix, "Vegetation", parts, bsdfs, copies)
        else:
            ready[kind] = kit.prefab(prefix, parts, bsdfs, 60.0)
    for k, tree in enumerate(plan.trees):
        if tree.kind in ready:
            where, yaw = _pose(plan, tree.s, tree.offset, tree.turn)
            kit.place(ready[tree.kind], f"tree_{k:02d}", "Vegetation", where, yaw, tree.scale)


def _road_distance(plan: Layout, x: Array, y: Array) -> Array:
    line = plan.curve.point(np.arange(-180.0, 390.0, 6.0))
    return np.min(np.hypot(x[:, None] - line[:, 0], y[:, None] - line[:, 1]), axis=1)


def _fields(kit: SceneKit, plan: Layout) -> None:
    """Add far woods and, at the detailed level, the grass tufts of the verges."""
    seed = plan.seed
    generator = np.random.default_rng(seed + 8)
    angle, r = generator.uniform(0, 2 * np.pi, 700), generator.uniform(150.0, 330.0, 700)
    x, y = r * np.cos(angle), r * np.sin(angle)
    clumps = road.smooth_noise(x, y, seed + 9, wavelength=90.0)
    clumps[_road_distance(plan, x, y) < 84.0] = -np.inf
    keep = np.sort(np.argsort(-clumps, kind="stable")[:120])
    feet = np.column_stack([x, y, road.far_height(x, y, seed + 6) - 0.6])[keep]
    forest = vegetation.woods(feet, generator.uniform(9.0, 16.0, len(keep)), seed + 10)
    for part, body in forest.items():
        if part == "core" or not kit.is_light:
            kit.add(f"woods_{part}", body, "leaves_shade" if part == "core" else "leaves", 80.0)
    kit.instance("woods", "Vegetation", ["woods_*"])
    if kit.is_light:
        return
    count = 1350
    s = generator.uniform(-12.0, 85.0, count)
    distance = at.GRAVEL + 0.05 + 7.0 * generator.uniform(0, 1, count) ** 1.7
    right = generator.uniform(0, 1, count) < 0.6
    offset = np.where(right, at.PAVEMENT_RIGHT - distance, at.PAVEMENT_LEFT + distance)
    height = np.array([ground_height(plan, float(a), float(b)) for a, b in zip(s, offset, strict=True)])
    points = plan.curve.point(s, offset, height)
    dry = generator.uniform(0, 1, count) < 0.3
    for name, chosen, bsdf in (("green", ~dry, "grass_blades"), ("dry", dry, "grass_dry")):
        kit.add(f"tufts_{name}", vegetation.tufts(points[chosen], seed + 12 + int(name == "dry")), bsdf)
        kit.instance(f"grass_tufts_{name}", "Vegetation", [f"tufts_{name}"])
