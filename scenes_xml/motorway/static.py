"""What stands on the motorway: pavement, markings, barriers, bridge, gantry, noise wall, signs, ground and trees."""

from __future__ import annotations

import numpy as np

from ..generators.geometry.mesh import Mesh, merge
from ..generators.kit import SceneKit
from ..generators.plants import species, vegetation
from ..generators.roads import bridge, motorway, road
from ..generators.roads.sweep import row, stations, sweep
from ..generators.roads.wear import LaneSurface, add_wear
from ..generators.roadside import furniture, gantry, traffic_light
from ..generators.surfaces import leaves
from . import layout as at

MARK = 0.004


def _pose(
    plan: at.Layout, s: float, offset: float, z: float = 0.0, turn: float = 0.0
) -> tuple[tuple[float, float, float], float]:
    x, y, _ = plan.curve.point(np.array(s), offset)
    return (float(x), float(y), z), float(np.degrees(plan.curve.heading(np.array(s)))) + turn


def add_road(kit: SceneKit, plan: at.Layout) -> None:
    """Add both carriageways, markings and the ground."""
    curve = plan.curve
    s = stations(curve, at.START, at.STOP, 4.0)
    coarse = stations(curve, at.START, at.STOP, 8.0)
    kit.add(
        "road_asphalt",
        sweep(curve, coarse, np.array([(-plan.pavement, 0.0), (0.0, 0.0), (plan.pavement, 0.0)]), (4.0, 4.0)),
        "asphalt_worn",
    )
    kit.instance("road", "Roads", ["road_asphalt"])
    edges = [sign * d for sign in (-1.0, 1.0) for d in (at.FIRST - 0.1, plan.edge + 0.1)]
    kit.add(
        "marking_edges",
        merge([sweep(curve, s, np.array([(d - 0.1, MARK), (d + 0.1, MARK)]), (2.0, 2.0)) for d in edges]),
        "line_white",
    )
    starts = np.arange(at.START, at.STOP - 7.0, 18.0)
    dashes = [
        road.dashes(curve, starts, 6.0, sign * (at.FIRST + k * at.LANE), 0.15, MARK)
        for sign in (-1.0, 1.0)
        for k in range(1, plan.lanes)
    ]
    kit.add("marking_dashes", merge(dashes), "line_white")
    kit.instance("lane_markings", "RoadLine", ["marking_*"])
    if plan.variant:
        lanes = [LaneSurface.along(curve, coarse, plan.offset(k), at.LANE) for k in range(-plan.lanes, plan.lanes)]
        add_wear(kit, lanes, np.random.default_rng([at.SEED, plan.variant, 20]), "motorway")
    across = np.array([-0.01, 1.4, 3.5, 6.0, 14.0, 30.0, 75.0])
    heights = np.array([-0.03, -0.10, -0.45, -0.35, 0.1, 0.5, -1.7])
    for side, sign in (("left", 1.0), ("right", -1.0)):
        profile = np.column_stack([sign * (plan.pavement + across), heights])
        strip = sweep(
            curve, stations(curve, at.START, at.STOP, 8.0), profile if sign < 0 else profile[::-1], (8.0, 8.0)
        )
        kit.add(f"terrain_{side}", strip, "grass_meadow", 60.0)
    kit.add("terrain_far", road.far_ground(1100.0, at.SEED + 6), "grass_meadow", 60.0)
    kit.instance("terrain", "Terrain", ["terrain_*"])


def add_barriers(kit: SceneKit, plan: at.Layout) -> None:
    """Add the median barrier and the guardrails on both sides.

    Along the bend their boxes would hold the road, so they have none.
    """
    curve = plan.curve
    s = stations(curve, at.START + 4.0, at.STOP - 4.0, 4.0)
    kit.add("median_barrier", motorway.barrier(curve, s), "concrete_grey", 30.0)
    kit.instance("median", "Wall", ["median_barrier"])
    spacing = 8.0 if kit.is_light else plan.post_spacing
    for side, sign in (("right", -1), ("left", 1)):
        offset = sign * (plan.pavement + 0.75)
        kit.add(f"guardrail_{side}_beam", motorway.rail(curve, s, offset, -sign), "galvanized_steel", 25.0)
        places = np.arange(at.START + 5.0, at.STOP - 4.0, spacing)
        kit.add(f"guardrail_{side}_posts", motorway.rail_posts(curve, places, offset, -sign), "galvanized_steel")
        kit.instance(f"guardrail_{side}", "GuardRail", [f"guardrail_{side}_*"])


def add_structures(kit: SceneKit, plan: at.Layout) -> None:
    """Add the bridge, the gantry and the noise wall."""
    outer = plan.pavement + 2.3
    parts = bridge.overpass((-outer, 0.0, outer), plan.pavement + 8.0, plan.clearance, is_light=kit.is_light)
    bsdfs = {
        "road": "asphalt_worn",
        "deck": "concrete_grey",
        "girders": "concrete_grey",
        "piers": "concrete_grey",
        "railing": "galvanized_steel",
        "bank": "grass_meadow",
    }
    where, yaw = _pose(plan, plan.bridge, 0.0)
    kit.place(kit.prefab("bridge", parts, bsdfs), "bridge", "Bridge", where, yaw)
    frame = gantry.gantry(-plan.pavement - 1.9, 0.0, is_light=kit.is_light)
    where, yaw = _pose(plan, plan.gantry, 0.0)
    kit.place(kit.prefab("gantry", frame, {"frame": "galvanized_steel"}), "gantry", "Pole", where, yaw)
    bsdfs = {"face": "sign_ahead", "back": "sign_back"}
    big = kit.prefab("gantry_sign", traffic_light.plate(3.6, 2.4), bsdfs)
    for k in range(plan.lanes):
        x, y = plan.curve.point(np.array(plan.gantry - 0.55), plan.offset(k))[:2]
        face = "sign_exit_way" if k == 0 else "sign_ahead" if k == 1 else "sign_limit_120"
        if k == 2:
            small = kit.prefab("gantry_limit", traffic_light.plate(1.7, 1.7), bsdfs)
            kit.place(small, "gantry_sign_2", "TrafficSign", (x, y, 7.2), yaw, face=face)
        else:
            kit.place(big, f"gantry_sign_{k}", "TrafficSign", (x, y, 7.3), yaw, face=face)
    low, high, height = plan.noise_wall
    wall = motorway.noise_wall(plan.curve, low, high, -plan.pavement - 3.4, height)
    kit.add("noise_wall_panels", wall["panels"], "noise_panel")
    kit.add("noise_wall_posts", wall["posts"], "galvanized_steel")
    kit.instance("noise_wall", "Wall", ["noise_wall_*"], True)


def add_furniture(kit: SceneKit, plan: at.Layout) -> None:
    """Add delineators, signs, telephones and trees."""
    curve = plan.curve
    if not kit.is_light:
        parts = furniture.delineator()
        places = np.arange(at.START + 20.0, at.STOP - 10.0, 50.0)
        for part, bsdf in (("post", "white_plastic"), ("band", "black_plastic"), ("reflector", "reflector")):
            copies = [row(curve, places, parts[part], sign * (plan.pavement + 1.2), -0.05) for sign in (-1.0, 1.0)]
            kit.add(f"delineators_{part}", merge(copies), bsdf)
        kit.instance("delineators", "Pole", ["delineators_*"])
        phone = kit.prefab("telephone", motorway.telephone(), {"case": "paint_orange", "door": "sign_sos"})
        for number, s in enumerate((-40.0, 160.0)):
            where, yaw = _pose(plan, s, -plan.pavement - 1.6, -0.15, 180.0)
            kit.place(phone, f"telephone_{number}", "Static", where, yaw)
        speed = kit.prefab(
            "sign_speed",
            furniture.sign("round", 2.4),
            {"face": "sign_limit_120", "back": "sign_back", "pole": "galvanized_steel"},
        )
        for name, s, offset, turn in (
            ("right", -20.0, -plan.pavement - 1.7, 0.0),
            ("left", 130.0, plan.pavement + 1.7, 180.0),
        ):
            where, yaw = _pose(plan, s, offset, -0.1, turn)
            kit.place(speed, f"sign_speed_{name}", "TrafficSign", where, yaw, scale=1.25)
        board = kit.prefab("sign_exit", traffic_light.plate(3.6, 2.2), {"face": "sign_exit_way", "back": "sign_back"})
        posts = kit.prefab(
            "sign_exit_posts",
            {"posts": merge([furniture.bollard().moved((0.05, y, 0.0), scale=3.6) for y in (-1.2, 1.2)])},
            {"posts": "galvanized_steel"},
        )
        where, yaw = _pose(plan, -88.0, plan.pavement + 4.0, -0.3, 180.0)
        kit.place(posts, "sign_exit_posts", "Pole", where, yaw)
        kit.place(board, "sign_exit", "TrafficSign", (where[0], where[1], 3.2), yaw)
    _trees(kit, plan)


def _tree_kinds(plan: at.Layout, is_light: bool) -> dict[str, tuple[dict[str, Mesh], dict[str, str]]]:
    """Return the parts of the kinds of trees and their materials: that of variant 0, or three that it draws."""
    if plan.variant:
        drawn = np.random.default_rng([at.SEED, plan.variant, 41]).permutation(species.COUNTRY)[:3]
        return {f"tree_{kind}": species.tree(str(kind), at.SEED + 3, is_light) for kind in drawn}
    parts = vegetation.tree(vegetation.TreeShape(9.0, 3.2, 2.2, 0.15, 12, 1700), at.SEED + 3, is_light)
    return {"tree": (parts, {"trunk": "bark", "core": "leaves_shade", "leaves": "leaves"})}


def _trees(kit: SceneKit, plan: at.Layout) -> None:
    """Add trees beside the road and the woods behind them."""
    curve, kinds = plan.curve, _tree_kinds(plan, kit.is_light)
    if plan.variant:
        kit.materials |= leaves.MATERIALS
        kit.textures |= leaves.IMAGES
    ready = {} if kit.is_light else {name: kit.prefab(name, *kind, 60.0) for name, kind in kinds.items()}
    copies: dict[str, list[tuple[tuple[float, float, float], float, float]]] = {name: [] for name in kinds}
    g = np.random.default_rng(at.SEED + 40)
    count = 0
    while count < plan.trees:
        s, side = float(g.uniform(at.START + 20.0, at.STOP - 40.0)), float(g.choice([-1.0, 1.0]))
        offset, turn, scale = (
            side * (plan.pavement + float(g.uniform(9.0, 24.0))),
            float(g.uniform(0.0, 360.0)),
            float(g.uniform(0.85, 1.2)),
        )
        if abs(s - plan.bridge) < 22.0:
            continue
        name, where = list(kinds)[count % len(kinds)], _pose(plan, s, offset, -0.3)[0]
        if kit.is_light:
            copies[name].append((where, turn, scale))
        else:
            kit.place(ready[name], f"tree_{count:02d}", "Vegetation", where, turn, scale)
        count += 1
    for name, places in copies.items():
        if places:
            kit.copies(f"{name}s", "Vegetation", *kinds[name], places)
    where_wood = [
        curve.point(np.array(s), o)
        for s in np.arange(at.START, at.STOP, 14.0)
        for o in (-68.0 - 9 * np.sin(s), 66.0 + 8 * np.cos(s))
        if abs(s - plan.bridge) > 24.0
    ]
    feet = np.array(where_wood) - [0.0, 0.0, 1.2]
    forest = vegetation.woods(feet, g.uniform(8.0, 14.0, len(feet)), at.SEED + 10, 40)
    for part, body in forest.items():
        if part == "core" or not kit.is_light:
            kit.add(f"woods_{part}", body, "leaves_shade" if part == "core" else "leaves", 80.0)
    kit.instance("woods", "Vegetation", ["woods_*"])
