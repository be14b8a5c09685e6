"""What stands at the roundabout: signs, lamps, planting and sculpture in the middle, houses, gardens and trees."""

from __future__ import annotations

import numpy as np

from ..generators.buildings.houses import build_house, family_house, house_parts
from ..generators.geometry import polygon
from ..generators.geometry.mesh import Array, Mesh, grid, merge, outward, tube
from ..generators.kit import Prefab, SceneKit
from ..generators.plants import planting, species, vegetation
from ..generators.roads.ground import Ground
from ..generators.roadside import furniture, garden
from ..generators.roadside.furniture import sign_stack
from ..generators.scene_toml import Parking
from . import layout as at
from .layout import ARMS, Plan, turned
from .static import mound_height

METAL = {"back": "sign_back", "pole": "galvanized_steel"}
TREE = {"trunk": "bark_furrowed", "core": "leaves_shade", "leaves": "leaf_cards"}


def add_things(kit: SceneKit, p: Plan, ground: Ground, generator: np.random.Generator) -> None:
    """Add every object; `generator` decides where the variant leaves a choice."""
    _signs(kit, p, ground)
    _lamps(kit, p, ground)
    _covers(kit, p)
    _middle(kit, p, generator)
    _homes(kit, p, ground, generator)
    _trees(kit, p, ground, generator)
    _woods(kit, p, generator)


def _signs(kit: SceneKit, p: Plan, ground: Ground) -> None:
    give_way = kit.prefab(
        "sign_yield",
        kit.slim(sign_stack(("yield", 2.75), ("round", 2.05)), "back", "pole"),
        {"face_0": "sign_yield", "face_1": "sign_roundabout", **METAL},
    )
    walkers = kit.prefab(
        "sign_walkers", kit.slim(furniture.sign("square", 2.3), "back", "pole"), {"face": "sign_walkers", **METAL}
    )
    keep = kit.prefab(
        "sign_keep", kit.slim(furniture.sign("round", 1.2), "back", "pole"), {"face": "sign_keep_right", **METAL}
    )
    board = kit.prefab(
        "sign_board", kit.slim(furniture.sign("board", 0.85), "back", "pole"), {"face": "sign_arrows_right", **METAL}
    )
    near, far = p.zebra
    for arm, direction in zip(ARMS, p.directions, strict=True):
        inward = direction + 180.0
        half = float(at.arm_half_width(np.array(near), p.outer))
        for thing, name, x, y, turn in (
            (give_way, "yield", near - 2.2, half + 0.75, inward),
            (walkers, "walkers_in", far + 0.8, half + 0.6, inward),
            (walkers, "walkers_out", near - 0.8, -half - 0.6, direction),
            (keep, "keep", far + 7.2, 0.0, inward),
        ):
            if kit.is_light and name.startswith("walkers"):
                continue
            place = ground.on(turned(np.array([(x, y)]), direction), at.KERB_HEIGHT)[0]
            kit.place(thing, f"sign_{name}_{arm}", "TrafficSign", place, turn)
        radius = p.apron[0] - 1.1
        place = turned(np.array([radius * np.cos(0.12), radius * np.sin(0.12)]), direction)
        kit.place(board, f"sign_board_{arm}", "TrafficSign", (*place, float(mound_height(p, np.array(radius)))), inward)


def _lamps(kit: SceneKit, p: Plan, ground: Ground) -> None:
    lamp = kit.prefab(
        "lamp",
        kit.slim(furniture.lamp_post(8.5, 2.2), "head", "pole"),
        {"pole": "galvanized_steel", "head": "sign_back", "glass": "lamp_glass"},
    )
    for arm, direction in zip(ARMS, p.directions, strict=True):
        for number, (x, side) in enumerate(
            ((p.outer + 13.0, 1.0), (p.outer + 40.0, -1.0), (p.outer + 70.0, 1.0))[: 2 if kit.is_light else 3]
        ):
            half = float(at.arm_half_width(np.array(x), p.outer))
            place = ground.on(turned(np.array([(x, side * (half + 0.7))]), direction))[0]
            kit.place(lamp, f"lamp_{arm}_{number}", "Pole", place, direction + (180.0 if side > 0 else 0.0))
    if kit.is_light:
        return
    bollard = kit.prefab("bollard", {"steel": furniture.bollard()}, {"steel": "galvanized_steel"})
    for arm, direction in zip(ARMS, p.directions, strict=True):
        for number, side in enumerate((-1.0, 1.0)):
            place = ground.on(turned(np.array([(p.zebra[0] - 0.5, side * 0.75)]), direction))[0]
            kit.place(bollard, f"bollard_{arm}_{number}", "Pole", place)


def _covers(kit: SceneKit, p: Plan) -> None:
    """Add manhole covers and gully grates."""
    if kit.is_light:
        return
    covers, grates = [], []
    for direction in p.directions:
        for x, y in ((p.outer + 20.0, -2.4), (p.outer + 52.0, 0.9), (p.outer - 3.0, 3.0)):
            place = turned(np.array((x, y)), direction)
            covers.append(garden.manhole_cover().moved((*place, 0.0)))
        for x in (p.outer + 15.0, p.outer + 48.0):
            half = float(at.arm_half_width(np.array(x), p.outer))
            for side in (-1.0, 1.0):
                place = turned(np.array((x, side * (half - 0.22))), direction)
                grates.append(garden.gully_grate().moved((*place, 0.0), np.radians(direction)))
    kit.add("manholes_covers", merge(covers), "manhole")
    kit.add("manholes_grates", merge(grates), "iron_dark")
    kit.instance("manhole_covers", "Static", ["manholes_*"])


def _middle(kit: SceneKit, p: Plan, generator: np.random.Generator) -> None:
    """Plant the central island: a ring of flowers and shrubs round what stands in the middle."""
    inner = p.apron[0]

    def on_mound(radius: float, angle: float) -> tuple[float, float, float]:
        return radius * np.cos(angle), radius * np.sin(angle), float(mound_height(p, np.array(radius))) - 0.02

    shrub = kit.prefab("shrub", {"bush": planting.shrub(0.75, 0.8, p.variant + 3)}, {"bush": "hedge"}, 70.0)
    count = 2 if kit.is_light else 9
    for number in range(count):
        angle = 2 * np.pi * (number + 0.3) / count
        kit.place(
            shrub,
            f"shrub_{number}",
            "Vegetation",
            on_mound(0.62 * inner, angle),
            40.0 * number,
            float(np.round(generator.uniform(0.8, 1.15), 2)),
        )
    if not kit.is_light:
        for number, colour in enumerate(("petals_red", "petals_yellow", "petals_violet")):
            turns = 2 * np.pi * (np.arange(54) + 0.33 * number) / 54 + generator.normal(0.0, 0.01, 54)
            reach = 0.40 * inner + 0.35 * number + generator.normal(0.0, 0.08, 54)
            feet = np.array([on_mound(float(r), float(a)) for r, a in zip(reach, turns, strict=True)])
            green, petals = planting.flowers(feet, p.variant * 5 + number)
            kit.add(f"flowers_{number}_green", green, "grass_blades")
            kit.add(f"flowers_{number}_petals", petals, colour, 80.0)
            kit.instance(f"flowers_{number}", "Vegetation")
    top = float(mound_height(p, np.array(0.0)))
    if p.middle == "sculpture":
        rings = [_hoop(1.75, 0.11, 0.0), _hoop(1.28, 0.10, 62.0), _hoop(0.85, 0.09, 118.0)]
        kit.add("sculpture_rings", merge(rings).moved((0.0, 0.0, top + 2.35)), "corten", 60.0)
        plinth = tube(np.array([(0, 0, -0.3), (0, 0, 0.45), (0, 0, 0.6)]), np.array([0.55, 0.5, 0.2]), 24)
        kit.add("sculpture_plinth", plinth.moved((0.0, 0.0, top)), "kerb_stone")
        kit.instance("sculpture", "Static", ["sculpture_*"], True)
    elif p.middle == "stones":
        stones = []
        for number in range(5):
            angle, size = 2 * np.pi * number / 5, generator.uniform(0.55, 0.95)
            middle = np.array([1.5 * np.cos(angle), 1.5 * np.sin(angle), top + 0.55 * size])
            stones.append(
                vegetation.blob(middle, np.array([0.6, 0.5, 1.1]) * size, p.variant * 17 + number, 6, 9, 0.14)
            )
        body = merge(stones)
        kit.add("sculpture_stones", Mesh(body.vertices, body.faces, body.vertices[:, [0, 2]]), "kerb_stone", 20.0)
        kit.instance("sculpture", "Static", ["sculpture_*"], True)
    else:
        shape = vegetation.TreeShape(5.6, 1.7, 2.0, 0.1, 11, 1100, 0.3)
        tree = kit.prefab("tree_middle", vegetation.tree(shape, p.variant + 40, kit.is_light), TREE, 60.0)
        for number in range(3):
            kit.place(tree, f"tree_middle_{number}", "Vegetation", on_mound(1.9, 2.1 * number + 0.4), 120.0 * number)


def _hoop(radius: float, thick: float, tilt_deg: float) -> Mesh:
    """Return a ring of round bar, upright in the y-z plane and then turned about z."""
    angle = np.linspace(0.0, 2 * np.pi, 41)[:-1, None]
    around = np.linspace(0.0, 2 * np.pi, 13)[None, :-1]
    reach = radius + thick * np.cos(around)
    points = np.stack(np.broadcast_arrays(thick * np.sin(around), reach * np.cos(angle), reach * np.sin(angle)), -1)
    return outward(grid(points, close_rows=True, close_columns=True)).moved(yaw=np.radians(tilt_deg))


def _homes(kit: SceneKit, p: Plan, ground: Ground, generator: np.random.Generator) -> None:
    """Place two houses a block behind hedges, a drive with a parking place beside each, and a wall or a fence."""
    hedges, pads, fences = [], [], []
    plans = [family_house(generator, has_garage=False) for _ in range(3 if kit.is_light else 5)]
    kinds = [build_house(kit, f"home_{k}", plan) for k, plan in enumerate(plans)]
    far_kinds = (
        []
        if kit.is_light
        else [kit.prefab(f"far_home_{k}", house_parts(plan, True), plan.bsdfs) for k, plan in enumerate(plans[:3])]
    )
    order = [*generator.permutation(len(kinds)), *generator.permutation(len(kinds)), *generator.permutation(len(kinds))]
    for number, direction in enumerate(p.directions):
        following = p.directions[(number + 1) % 4]
        places = ((direction, 1.0), (following + (360.0 if following < direction else 0.0), -1.0))
        for k, (along, side) in enumerate(places):
            x = p.outer + float(generator.uniform(30.0, 34.0))
            half = float(at.arm_half_width(np.array(x), p.outer))
            kind = int(order[2 * number + k])
            plan, name = plans[kind], f"house_{2 * number + k}"
            y = side * (half + at.PAVEMENT + 5.5 + plan.half_depth)
            where = turned(np.array((x, y)), along)
            kit.place(kinds[kind], name, "Building", (*where, at.KERB_HEIGHT), along + (0.0 if side > 0 else 180.0))
            reach = half + at.PAVEMENT
            gate = x + side * 0.0 + plan.shape.length / 2 + 2.8
            pad = polygon.sheet(
                turned(
                    np.array(
                        [
                            (gate - 1.6, side * (reach + 0.05)),
                            (gate + 1.6, side * (reach + 0.05)),
                            (gate + 1.6, side * (reach + 7.0)),
                            (gate - 1.6, side * (reach + 7.0)),
                        ]
                    ),
                    along,
                ),
                at.KERB_HEIGHT + 0.015,
                1.2,
            )
            pads.append(ground.add(pad))
            spot = turned(np.array((gate, side * (reach + 3.6))), along)
            kit.parking.append(
                Parking(
                    (*spot, at.KERB_HEIGHT + 0.015), round((along + (90.0 if side > 0 else -90.0)) % 360.0, 3), 5.2, 2.6
                )
            )
            for a, b in ((x - plan.shape.length / 2 - 3.5, gate - 2.3), (gate + 2.3, gate + 14.0)):
                line = turned(np.array([(a, side * (reach + 0.65)), (b, side * (reach + 0.65))]), along)
                line = np.column_stack([line, np.full(2, at.KERB_HEIGHT)])
                if a > x or generator.uniform() < 0.5:
                    hedges.append(
                        planting.hedge(
                            line,
                            1.25,
                            0.7,
                            10 * number + k,
                            0.7 if kit.is_light else 0.34,
                            0.02 if kit.is_light else 0.05,
                        )
                    )
                elif not kit.is_light:
                    fences.append(garden.picket_fence(line, 1.0, 0.17))
    for number, direction in enumerate(p.directions):
        for k, side in enumerate((1.0, -1.0)):
            for row in range(0 if kit.is_light else 2):
                x = p.outer + 63.0 + 27.0 * row + float(generator.uniform(0.0, 6.0))
                where = turned(
                    np.array((x, side * (at.NARROW + at.PAVEMENT + 10.0 + float(generator.uniform(0.0, 4.0))))),
                    direction,
                )
                far = far_kinds[int(generator.integers(0, len(far_kinds)))]
                turn = direction + (0.0 if side > 0 else 180.0)
                kit.place(far, f"house_far_{number}{k}{row}", "Building", (*where, at.KERB_HEIGHT), turn)
    kit.add("hedges_clipped", merge(hedges), "hedge", 50.0)
    kit.instance("hedges", "Vegetation", ["hedges_clipped"])
    if fences:
        kit.add("fences_picket", merge(fences), "fence_white")
        kit.instance("fences", "Fence", ["fences_picket"])
    kit.add("pads_paved", merge(pads), "paving_slabs")
    kit.instance("drives", "SideWalks", ["pads_paved"])


def _clear(p: Plan, place: Array, least: float) -> bool:
    """Return whether a place is away from every arm's axis and the ring."""
    if np.hypot(*place) < p.outer + at.PAVEMENT + least:
        return False
    for direction in p.directions:
        x, y = turned(place, -direction)
        if x > 0.0 and abs(y) < at.WIDE + at.PAVEMENT + least:
            return False
    return True


def _tree_kinds(kit: SceneKit, p: Plan) -> list[Prefab]:
    """Return three kinds of trees, those of variant 0, or four that the variant draws."""
    if p.variant:
        drawn = np.random.default_rng([11, p.variant]).permutation(species.COUNTRY)[:4]
        shapes = {str(kind): species.pruned(str(kind), 11.0, 3.0, 1.4) for kind in drawn}
        return [species.prefab(kit, kind, p.variant + 11, shape) for kind, shape in shapes.items()]
    wide = vegetation.TreeShape(8.4, 2.9, 2.5, 0.15, 13, 1200, 0.40)
    slim = vegetation.TreeShape(6.8, 1.8, 2.3, 0.11, 10, 800, 0.36)
    kinds = [
        kit.prefab(f"tree_{k}", vegetation.tree(s, p.variant * 3 + 11 + k, kit.is_light), TREE, 60.0)
        for k, s in enumerate((wide, slim))
    ]
    spruce = kit.prefab(
        "spruce",
        planting.conifer(9.5, 2.3, p.variant + 5, is_light=kit.is_light),
        {"trunk": "bark_furrowed", "core": "needles"},
        40.0,
    )
    return [*kinds, spruce]


def _trees(kit: SceneKit, p: Plan, ground: Ground, generator: np.random.Generator) -> None:
    kinds = _tree_kinds(kit, p)
    placed: list[Array] = []
    houses = [
        np.array(item.offset[:2])
        for item in kit.writer.placements
        if item.shape.startswith("house") and item.shape.endswith("walls")
    ]
    drives = [np.array(place.position[:2]) for place in kit.parking]
    wanted = 9 if kit.is_light else 30
    for _ in range(4000):
        if len(placed) == wanted:
            break
        angle, reach = generator.uniform(0, 2 * np.pi), generator.uniform(p.outer + 5.0, 105.0)
        place = reach * np.array([np.cos(angle), np.sin(angle)])
        near_house = any(np.hypot(*(place - h)) < 10.5 for h in houses) or any(
            np.hypot(*(place - d)) < 5.5 for d in drives
        )
        if near_house or not _clear(p, place, 2.6) or any(np.hypot(*(place - other)) < 7.5 for other in placed):
            continue
        kind = int(generator.choice(3, p=(0.45, 0.35, 0.2)))
        scale = float(np.round(generator.uniform(0.85, 1.15), 2))
        number = len(placed)
        thing = kinds[number % len(kinds) if p.variant else kind]
        kit.place(
            thing,
            f"tree_{number:02d}",
            "Vegetation",
            ground.on(place[None])[0],
            float(np.round(generator.uniform(0, 360), 1)),
            scale,
        )
        placed.append(place)


def _woods(kit: SceneKit, p: Plan, generator: np.random.Generator) -> None:
    """Add far trees as two shapes."""
    count = 70 if kit.is_light else 130
    angle, reach = generator.uniform(0, 2 * np.pi, 3 * count), generator.uniform(120.0, 290.0, 3 * count)
    places = np.column_stack([reach * np.cos(angle), reach * np.sin(angle), np.where(reach < 160.0, 0.1, -0.5)])
    free = np.array([_clear(p, place[:2], 14.0 if np.hypot(*place[:2]) < 152.0 else -5.0) for place in places])
    places = places[free][:count]
    far = vegetation.woods(places, generator.uniform(8.0, 15.0, len(places)), p.variant + 10, 4 if kit.is_light else 11)
    for part, body in far.items():
        kit.add(f"woods_{part}", body, "leaves_shade" if part == "core" else "leaf_cards", 80.0)
    kit.instance("woods", "Vegetation", ["woods_*"])
