"""What stands along the street: houses, fences, hedges, street trees, lamps, bins, signs and garden plants."""

from __future__ import annotations

import numpy as np

from ..generators.buildings.houses import house_parts
from ..generators.geometry.mesh import Array, Mesh, merge
from ..generators.kit import Prefab, SceneKit
from ..generators.plants import planting, species, vegetation
from ..generators.roads.ground import Ground
from ..generators.roadside import furniture, garden
from ..generators.roadside.bicycle_stand import place_bicycles
from . import layout as at
from .layout import Lot, Plan

METAL = {"back": "sign_back", "pole": "galvanized_steel"}
TREE = {"trunk": "bark_furrowed", "core": "leaves_shade", "leaves": "leaf_cards"}
BINS = ("bin_black", "bin_blue", "bin_yellow", "bin_green")


def add_things(kit: SceneKit, p: Plan, ground: Ground, generator: np.random.Generator) -> None:
    """Add every object; `generator` decides where the variant leaves a choice."""
    _houses(kit, p)
    _fronts(kit, p)
    _street(kit, p, ground)
    _trees(kit, p, ground, generator)
    _bins(kit, p, generator)
    if p.variant:
        _bicycles(kit, p)
    _woods(kit, p, generator)


def _houses(kit: SceneKit, p: Plan) -> None:
    """Place the houses; those far from the default drive have no window frames."""
    kinds: dict[tuple[int, bool], Prefab] = {}
    for lot in p.lots:
        if kit.is_light and not lot.is_near:
            continue
        key, plan = (lot.kind, lot.is_near), lot.house
        if key not in kinds:
            bsdfs = {**plan.bsdfs, "gate": "garage_door", "steps": "kerb_stone"}
            kinds[key] = kit.prefab(
                f"home_{'near' if lot.is_near else 'far'}_{lot.kind}",
                house_parts(plan, kit.is_light or not lot.is_near),
                bsdfs,
            )
        where, yaw = p.way.place(
            lot.middle, p.pavement(lot.side) + lot.side * (lot.setback + plan.half_depth), at.KERB_HEIGHT
        )
        kit.place(kinds[key], f"house_{lot.name}", "Building", where, yaw + (0.0 if lot.side > 0 else 180.0))


def _front_line(p: Plan, lot: Lot, start: float, stop: float, away: float) -> Array:
    s = np.linspace(start, stop, max(2, int(abs(stop - start) / 2.0) + 1))
    return p.way.point(s, p.pavement(lot.side) + lot.side * away, at.KERB_HEIGHT)


def _fronts(kit: SceneKit, p: Plan) -> None:
    """Close the front gardens with hedges, fences or walls, open at drive and path, with hedges between lots."""
    hedges, pickets, walls, copings, panels, posts = [], [], [], [], [], []
    for number, lot in enumerate(p.lots):
        if not lot.is_near:
            continue
        gaps = sorted(
            [(lot.drive - at.DRIVE_HALF - 0.35, lot.drive + at.DRIVE_HALF + 0.35), (lot.door - 0.95, lot.door + 0.95)]
        )
        pieces = [(lot.ends[0] + 0.3, gaps[0][0]), (gaps[0][1], gaps[1][0]), (gaps[1][1], lot.ends[1] - 0.3)]
        for k, (a, b) in enumerate(pieces):
            if b - a < 0.9 or lot.front == "none":
                continue
            line = _front_line(p, lot, a, b, 0.5)
            if lot.front == "hedge" or kit.is_light:
                step, rough = (0.8, 0.02) if kit.is_light else (0.32, 0.045)
                hedges.append(planting.hedge(line, 1.0 + 0.12 * (number % 4), 0.65, 10 * number + k, step, rough))
            elif lot.front == "picket":
                pickets.append(garden.picket_fence(line if lot.side < 0 else line[::-1], 0.95, 0.17))
            else:
                wall, coping = garden.garden_wall(line, 0.65)
                walls.append(wall)
                copings.append(coping)
        back = p.pavement(lot.side) + lot.side * (lot.setback + 1.0)
        reach = lot.side * np.linspace(0.0, 9.0, 5)
        side_line = p.way.point(np.full(5, lot.ends[1]), back + reach, at.KERB_HEIGHT)
        if number % 3 == 0 and not kit.is_light:
            boards, stakes = garden.panel_fence(side_line, 1.7)
            panels.append(boards)
            posts.append(stakes)
        elif not kit.is_light:
            hedges.append(planting.hedge(side_line, 1.6, 0.7, 999 + number, 0.4, 0.05))
    for shape, parts, bsdf, name, semantic in (
        ("hedges_clipped", hedges, "hedge", "hedges", "Vegetation"),
        ("fence_picket", pickets, "fence_white", "fence_pickets", "Fence"),
        ("wall_garden", walls, "wall_brick", "", ""),
        ("wall_coping", copings, "kerb_stone", "", ""),
        ("fence_boards", panels, "boards", "", ""),
        ("fence_stakes", posts, "timber_grey", "", ""),
    ):
        if parts:
            kit.add(shape, merge(parts), bsdf, 50.0 if shape == "hedges_clipped" else 35.0)
            if name:
                kit.instance(name, semantic, [shape])
    if walls:
        kit.instance("garden_walls", "Wall", ["wall_garden", "wall_coping"])
    if panels:
        kit.instance("fence_panels", "Fence", ["fence_boards", "fence_stakes"])


def _free(p: Plan, side: int, s: float, least: float) -> bool:
    """Return whether no drive, path or crossing is near an arc length on a side."""
    marks = [lot.drive for lot in p.lots if lot.side == side] + [at.CROSSING]
    return bool(np.all(np.abs(np.array(marks) - s) > least))


def _street(kit: SceneKit, p: Plan, ground: Ground) -> None:
    """Add lamps, signs, letter boxes and a bench in the verges."""
    parts = furniture.street_lamp(4.8)
    parts["glass"] = parts["glass"].moved(
        (0.0, 0.0, 0.004)
    )  # off the top of the pole, which lies in the plane of its foot
    bsdfs = {"pole": "black_plastic", "head": "black_plastic", "glass": "lamp_glass"}
    lamp = kit.prefab("lamp", kit.slim(parts, "head", "pole"), bsdfs)
    for number, s in enumerate(np.arange(at.START + 14.0, at.STOP - 6.0, 40.0 if kit.is_light else 27.0)):
        side = (1, -1)[number % 2]
        place = next(
            float(s) + d for d in (0.0, 1.5, -1.5, 3.0, -3.0, 4.5, -4.5, 6.0, -6.0) if _free(p, side, float(s) + d, 2.6)
        )
        where, _ = p.way.place(place, p.kerb(side) + side * 0.7)
        kit.place(lamp, f"lamp_{number}", "Pole", ground.on(where[None])[0])
    zone = kit.prefab(
        "sign_zone", kit.slim(furniture.sign("round", 2.3), "back", "pole"), {"face": "sign_zone", **METAL}
    )
    for name, s, side, turn in (("right", at.CROSSING - 34.0, -1, 0.0), ("left", at.CROSSING + 44.0, 1, 180.0)):
        place = next(s + d for d in np.arange(0.0, 12.0, 0.8) if _free(p, side, s + d, 2.4))
        where, yaw = p.way.place(place, p.kerb(side) + side * 0.6)
        kit.place(zone, f"sign_zone_{name}", "TrafficSign", ground.on(where[None])[0], yaw + turn)
    if kit.is_light:
        return
    box = kit.prefab("letter_box", garden.letter_box(), {"box": "door_green", "post": "timber_grey"})
    for lot in p.lots:
        if lot.is_near and int(lot.name[-2:]) % 2:
            s = lot.drive + (at.DRIVE_HALF + 0.5) * (-1.0 if lot.drive > lot.middle else 1.0)
            where, yaw = p.way.place(s, p.pavement(lot.side) + lot.side * 0.06, at.KERB_HEIGHT)
            kit.place(
                box, f"letter_box_{lot.name}", "Static", where, yaw - 90.0 + (180.0 if lot.side > 0 else 0.0) + 180.0
            )


def _tree_kinds(kit: SceneKit, p: Plan) -> tuple[list[Prefab], Prefab]:
    """Return the trees of the street, one kind or two, and that of the gardens: those of variant 0, or drawn."""
    if p.variant:
        g = np.random.default_rng([21, p.variant])
        street = [str(kind) for kind in g.permutation(species.TOWN)[: int(g.integers(1, 3))]]
        garden_kind = str(g.choice(species.GARDEN))
        trees = [species.prefab(kit, kind, p.variant + 21, species.pruned(kind, 8.0, 2.1, 2.6)) for kind in street]
        own = species.pruned(garden_kind, 5.5, 1.9, 1.4)
        return trees, species.prefab(kit, garden_kind, p.variant + 22, own, "tree_garden")
    lime = vegetation.TreeShape(7.4, 2.1, 2.6, 0.12, 11, 1000, 0.36)
    fruit = vegetation.TreeShape(4.6, 1.7, 1.4, 0.09, 9, 650, 0.32)
    kinds = [
        kit.prefab(f"tree_{k}", vegetation.tree(shape, p.variant * 3 + 21 + k, kit.is_light), TREE, 60.0)
        for k, shape in enumerate((lime, fruit))
    ]
    return kinds[:1], kinds[1]


def _trees(kit: SceneKit, p: Plan, ground: Ground, generator: np.random.Generator) -> None:
    street, garden_tree = _tree_kinds(kit, p)
    step = 22.0 if kit.is_light else 13.0
    number = 0
    for side in (1, -1):
        for s in np.arange(at.START + 10.0 + 4.0 * (side > 0), at.STOP - 8.0, step):
            places = [float(s) + d for d in (0.0, 1.5, -1.5, 3.0, -3.0) if _free(p, side, float(s) + d, 3.0)]
            if not places:
                continue
            where, _ = p.way.place(places[0], p.kerb(side) + side * 1.05)
            scale = float(np.round(generator.uniform(0.8, 1.1), 2))
            kit.place(
                street[number % len(street)],
                f"tree_street_{number:02d}",
                "Vegetation",
                ground.on(where[None])[0],
                53.0 * number,
                scale,
            )
            number += 1
    shrub = (
        None
        if kit.is_light
        else kit.prefab("shrub", {"bush": planting.shrub(0.6, 0.85, p.variant + 3)}, {"bush": "hedge"}, 70.0)
    )
    for lot in p.lots:
        if not lot.is_near:
            continue
        for k, s in enumerate(np.linspace(lot.ends[0] + 2.0, lot.ends[1] - 2.0, 4)):
            if abs(s - lot.door) < 1.7 or abs(s - lot.drive) < at.DRIVE_HALF + 1.3:
                continue
            if shrub is not None and k == 1:
                where, _ = p.way.place(float(s), p.pavement(lot.side) + lot.side * (lot.setback - 1.0), at.KERB_HEIGHT)
                kit.place(
                    shrub,
                    f"shrub_{lot.name}_{k}",
                    "Vegetation",
                    where,
                    70.0 * k,
                    float(np.round(generator.uniform(0.75, 1.15), 2)),
                )
        if int(lot.name[-2:]) % (4 if kit.is_light else 2) == 0:
            where, _ = p.way.place(
                lot.ends[0] + 1.0, p.pavement(lot.side) + lot.side * (lot.setback + 14.0), at.KERB_HEIGHT
            )
            kit.place(
                garden_tree,
                f"tree_{lot.name}",
                "Vegetation",
                where,
                31.0 * number,
                float(np.round(generator.uniform(0.9, 1.3), 2)),
            )


def _bins(kit: SceneKit, p: Plan, generator: np.random.Generator) -> None:
    """Put bins out beside some drives, on the edge of the verge."""
    if kit.is_light:
        return
    parts = garden.bin_on_wheels()
    body = merge([Mesh(part.vertices, part.faces) for part in (parts["tub"], parts["wheels"])])
    thing = kit.prefab("bin", {"tub": body, "lid": parts["lid"]}, {"tub": "bin_black", "lid": "bin_black"})
    number = 0
    for lot in p.lots:
        if lot.is_near and generator.uniform() < 0.5:
            for k in range(int(generator.integers(1, 3))):
                s = lot.drive + (at.DRIVE_HALF + 0.8 + 0.75 * k) * (1.0 if lot.drive > lot.middle else -1.0)
                where, yaw = p.way.place(s, p.pavement(lot.side) - lot.side * 0.45, at.KERB_HEIGHT)
                kit.place(
                    thing,
                    f"bin_{number}",
                    "Static",
                    where,
                    yaw + (90.0 if lot.side > 0 else -90.0),
                    lid=str(generator.choice(BINS)),
                )
                number += 1


def _bicycles(kit: SceneKit, p: Plan) -> None:
    """Park a bicycle beside the path of some houses, before the door."""
    g = np.random.default_rng([p.variant, 23])
    places = []
    for lot in p.lots:
        if g.uniform() < 0.35 and lot.is_near:
            away = p.pavement(lot.side) + lot.side * (lot.setback - 2.0)
            where, yaw = p.way.place(lot.door + 1.0, away, at.KERB_HEIGHT)
            places.append((where, yaw + 90.0 * float(g.choice((1.0, -1.0)))))
    place_bicycles(kit, places, g)


def _woods(kit: SceneKit, p: Plan, generator: np.random.Generator) -> None:
    """Add the trees behind the gardens and at both ends of the street."""
    count = 60 if kit.is_light else 120
    s, side = generator.uniform(at.START - 20.0, at.STOP + 20.0, count), generator.choice((-1.0, 1.0), count)
    away = generator.uniform(30.0, 75.0, count)
    places = p.way.point(s, side * away)
    places[:, 2] = np.where(away < 44.0, 0.1, -0.5)
    ends = []
    for along, count_end in ((at.STOP + 12.0, 18), (at.START - 12.0, 12)):
        s_end = along + generator.uniform(0.0, 10.0, count_end) * np.sign(along)
        ends.append(p.way.point(s_end, np.linspace(-30.0, 30.0, count_end)) - [0.0, 0.0, 0.5])
    places = np.vstack([places, *ends])
    far = vegetation.woods(places, generator.uniform(6.0, 11.0, len(places)), p.variant + 30, 4 if kit.is_light else 11)
    for part, body in far.items():
        kit.add(f"woods_{part}", body, "leaves_shade" if part == "core" else "leaf_cards", 80.0)
    kit.instance("woods", "Vegetation", ["woods_*"])
