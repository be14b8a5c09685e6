"""What stands at the crossing: ground, markings, houses, traffic lights, bus stop, lamps, signs and trees."""

from __future__ import annotations

import numpy as np

from ..generators.buildings import cityblock
from ..generators.geometry import polygon
from ..generators.geometry.mesh import Mesh, box, grid, merge
from ..generators.kit import Prefab, SceneKit
from ..generators.plants import species, vegetation
from ..generators.roads.ground import Ground
from ..generators.roadside import bus_stop, furniture, traffic_light
from ..generators.roadside.garden import gully_grate, manhole_cover
from . import layout as at

MARK = 0.004
TREES = ((-34.0, 1.0), (-56.0, 1.0), (-50.0, -1.0), (44.0, 1.0), (57.0, -1.0), (70.0, 1.0))
BENCHES = (-24.0, -40.0)
"""Where trees, by x and side, and benches stand along the main street [m]."""


def _rectangle(x: tuple[float, float], y: tuple[float, float], z: float, tile: float = 1.0) -> Mesh:
    corners = np.array([[(x[0], y[0], z), (x[0], y[1], z)], [(x[1], y[0], z), (x[1], y[1], z)]])
    return grid(corners, corners[..., :2] / tile)


def add_ground(kit: SceneKit, plan: at.Layout) -> Ground:
    """Add carriageways, pavements with kerbs, and the ground behind the houses; return what one walks on."""
    rx, ry = at.REACH
    ground = Ground()
    main = ground.add(_rectangle((-rx, rx), (-at.MAIN - 0.1, at.MAIN + 0.1), 0.0, 4.0))
    kit.add("road_main", main, "asphalt_street")
    sides = [
        _rectangle((-at.SIDE - at.CORNER, at.SIDE + at.CORNER), span, 0.0, 4.0)
        for span in ((-ry, -at.MAIN - 0.1), (at.MAIN + 0.1, ry))
    ]
    kit.add("road_side", ground.add(merge(sides)), "asphalt_street")
    kit.instance("road", "Roads", ["road_*"])
    kerbs, tops = [], []
    dropped = np.array([(float(np.mean(at.CROSS_X)), at.MAIN), (at.SIDE, float(np.mean(at.CROSS_Y)))])
    for sx in (-1.0, 1.0):
        for sy in (-1.0, 1.0):
            line = _refined(polygon.fillet([(rx, at.MAIN), (at.SIDE, at.MAIN), (at.SIDE, ry)], at.CORNER, 0.9), dropped)
            drop = polygon.lowered(line, dropped, at.DROPPED, 1.0)
            side = int(-sx * sy)
            turned = line * [sx, sy]
            kerb, edge = polygon.kerb_and_pavement(turned, side, at.RAMP, at.KERB, drop)
            outline = np.vstack([polygon.shifted(turned, side * at.RAMP), [(sx * rx, sy * ry)]])
            kerbs.append(kerb)
            tops += [edge, polygon.sheet(outline, at.KERB, 1.2)]
    kit.add("kerb_stones", ground.add(merge(kerbs)), "concrete_grey")
    kit.add("pavement_slabs", ground.add(merge(tops)), "paving")
    kit.instance("pavements", "SideWalks", ["kerb_stones", "pavement_slabs"])
    far = 60.0
    kit.add("ground_far", _rectangle((-rx - far, rx + far), (-ry - far, ry + far), -0.3, 4.0), "asphalt_street")
    kit.instance("ground_far", "Ground", ["ground_far"])
    return ground


def _refined(line: np.ndarray, places: np.ndarray, reach: float = 4.5, step: float = 0.5) -> np.ndarray:
    """Return a plane polyline with points `step` apart where it is near one of the places [m]."""
    fine = polygon.resample(line, step)
    along, own = polygon.length_along(fine), polygon.length_along(line)
    near = np.linalg.norm(fine[:, None] - places[None], axis=2).min(1) < reach
    s = np.unique(np.round(np.r_[own, along[near]], 3))
    s = s[np.r_[True, np.diff(s) > 0.02]]
    return np.column_stack([np.interp(s, own, line[:, k]) for k in (0, 1)])


def _bars(along_y: bool, centre: float, half: float, width: float) -> list[Mesh]:
    """Return the bars of a zebra crossing across the main street (`along_y`) or the side street."""
    places = np.arange(-half + 0.55, half - 0.2, 1.0)
    span = (centre - width / 2, centre + width / 2)
    return [
        _rectangle(span, (p - 0.25, p + 0.25), MARK) if along_y else _rectangle((p - 0.25, p + 0.25), span, MARK)
        for p in places
    ]


def _arrow(kinds: str) -> Mesh:
    """Return a lane arrow along +x, 3 m long: any of ``a`` (ahead), ``l`` and ``r``."""
    parts = [_rectangle((-1.5, 0.6 if "a" in kinds else 0.2), (-0.07, 0.07), MARK)]

    def head(tip: tuple[float, float], left: tuple[float, float], right: tuple[float, float]) -> Mesh:
        return Mesh(
            np.array([(*tip, MARK), (*left, MARK), (*right, MARK)]), np.array([[0, 1, 2]]), np.array([tip, left, right])
        )

    if "a" in kinds:
        parts.append(head((1.5, 0.0), (0.5, 0.35), (0.5, -0.35)))
    for letter, sign in (("l", 1.0), ("r", -1.0)):
        if letter in kinds:
            parts.append(_rectangle((0.05, 0.25), sorted((0.0, sign * 0.55)), MARK))
            tip = head((0.15, sign * 1.2), (0.15 - 0.4, sign * 0.5), (0.15 + 0.4, sign * 0.5))
            parts.append(tip if sign < 0 else tip.flipped())
    return merge(parts)


def add_markings(kit: SceneKit, plan: at.Layout) -> None:
    """Add lines, arrows, stop lines and zebra crossings."""
    zebra, lines, arrows = [], [], []
    for sign in (-1.0, 1.0):
        zebra += _bars(True, sign * float(np.mean(at.CROSS_X)), at.MAIN, at.CROSS_X[1] - at.CROSS_X[0])
        zebra += _bars(False, sign * float(np.mean(at.CROSS_Y)), at.SIDE, at.CROSS_Y[1] - at.CROSS_Y[0])
    for _, (heading, is_main) in at.ARMS.items():
        stop, reach, half = (plan.stop[0], at.REACH[0], at.MAIN) if is_main else (plan.stop[1], at.REACH[1], at.SIDE)
        yaw = np.radians(heading)
        own = [
            _rectangle((-stop + 0.3, -stop + 0.8), (-half + 0.15, -0.1), MARK),
            _rectangle((-reach, -stop), (-0.06, 0.06), MARK),
        ]
        if is_main:
            own.append(_rectangle((-stop - 24.0, -stop), (-at.LANE - 0.06, -at.LANE + 0.06), MARK))
            own += [
                _rectangle((x, x + 3.0), (d - 0.06, d + 0.06), MARK)
                for x in np.arange(-reach, -stop - 4.0, 9.0)
                for d in (at.LANE, -at.LANE)
                if d > 0 or x + 3 < -stop - 24
            ]
        lines += [m.moved(yaw=yaw) for m in own]
        for x in (-stop - 6.0, -stop - 22.0):
            kinds = (("al", -0.5 * at.LANE), ("ar", -1.5 * at.LANE)) if is_main else (("alr", -0.5 * at.LANE),)
            arrows += [_arrow(kind).moved((x, d, 0.0)).moved(yaw=yaw) for kind, d in kinds]
    kit.add("marking_zebra", merge(zebra), "line_white")
    kit.add("marking_lines", merge(lines), "line_white")
    kit.add("marking_arrows", merge(arrows), "line_white")
    kit.instance("road_markings", "RoadLine", ["marking_*"])


def add_houses(kit: SceneKit, plan: at.Layout) -> None:
    """Add the houses at the four corners and along the streets."""
    bsdfs = {"walls": "facade_white", "panes": "window_pane", "trim": "facade_trim"}
    used = sorted({h.kind for h in plan.houses})
    ready = {}
    for kind in used:
        width, storeys, axis, window, balconies = plan.kinds[kind]
        b = cityblock.Block(width, at.DEPTH, storeys, axis=axis, window=window, balconies=balconies)
        ready[kind] = kit.prefab(f"house_{kind}", _with_trim(cityblock.block(b, kit.is_light), kit.is_light), bsdfs)
    for number, h in enumerate(plan.houses):
        kit.place(ready[h.kind], f"house_{number:02d}", "Building", (h.x, h.y, at.KERB - 0.02), h.turn, walls=h.walls)
    places = ((1.0, 1.0, 0.0), (-1.0, 1.0, 90.0), (-1.0, -1.0, 180.0), (1.0, -1.0, -90.0))
    for number, (sx, sy, turn) in enumerate(places):
        b = cityblock.Block(
            at.CORNER_SIZE,
            at.CORNER_SIZE,
            plan.corner_storeys[number],
            axis=2.8,
            window=1.5,
            pane=1.9,
            sides=("front", "left"),
        )
        thing = kit.prefab(f"corner_{number}", _with_trim(cityblock.block(b, kit.is_light), kit.is_light), bsdfs)
        x, y = (
            sx * (at.SIDE + plan.pavement[1] + at.CORNER_SIZE / 2),
            sy * (at.MAIN + plan.pavement[0] + at.CORNER_SIZE / 2),
        )
        kit.place(
            thing, f"corner_house_{number}", "Building", (x, y, at.KERB - 0.02), turn, walls=plan.corner_walls[number]
        )


def _with_trim(parts: dict[str, Mesh], is_light: bool) -> dict[str, Mesh]:
    """Return the parts; at the light level cornices belong to the walls."""
    if not is_light:
        return parts
    return {"walls": merge([parts["walls"], parts["trim"]]), "panes": parts["panes"]}


def _one(parts: dict[str, Mesh], name: str) -> dict[str, Mesh]:
    """Return all parts as one."""
    return {name: merge([Mesh(m.vertices, m.faces) for m in parts.values()])}


def add_signals(kit: SceneKit, plan: at.Layout) -> None:
    """Add masts, cantilevers, heads and heads for people on foot."""
    colours = {"case": "black_plastic", "red": "signal_red", "amber": "signal_amber", "green": "signal_green"}
    head = kit.prefab("signal_head", traffic_light.head(kit.is_light), colours)
    walker = (
        None
        if kit.is_light
        else kit.prefab("walker_head", traffic_light.walker_head(), {k: colours[k] for k in ("case", "red", "green")})
    )
    post = kit.prefab("signal_post", _one(traffic_light.mast(), "pole"), {"pole": "grey_steel"})
    arm = kit.prefab("signal_arm", traffic_light.cantilever(6.2), {"pole": "galvanized_steel"})
    street = kit.prefab("street_sign", traffic_light.plate(2.2, 0.7), {"face": "sign_directions", "back": "sign_back"})
    for name, (heading, is_main) in at.ARMS.items():
        group = "main" if is_main else "side"
        stop, half = (plan.stop[0], at.MAIN) if is_main else (plan.stop[1], at.SIDE)

        def where(x: float, y: float, z: float = at.KERB, heading: float = heading) -> tuple[float, float, float]:
            px, py = at.turned(np.array([[x, y]]), heading)[0]
            return float(px), float(py), z

        foot = (-stop + 0.6, -half - 0.6)
        if is_main:
            kit.place(arm, f"signal_arm_{name}", "Pole", where(*foot), heading)
            for k, d in enumerate((-1.5 * at.LANE, -0.5 * at.LANE)):
                kit.place(
                    head, f"signal_{name}_{k}", "TrafficLight", where(foot[0] - 0.1, d, 5.55), heading, signal=group
                )
            if not kit.is_light:
                kit.place(street, f"street_sign_{name}", "TrafficSign", where(foot[0] - 0.1, -3.5, 6.25), heading)
        else:
            kit.place(post, f"signal_post_{name}", "Pole", where(*foot), heading)
        kit.place(
            head,
            f"signal_{name}_low",
            "TrafficLight",
            where(foot[0] - 0.12, foot[1], 2.3 + at.KERB),
            heading,
            signal=group,
        )
        if walker is None:
            continue
        cross = np.mean(at.CROSS_X if is_main else at.CROSS_Y) - 0.3
        for side, y, turn in (("right", -half - 0.5, 90.0), ("left", half + 0.5, -90.0)):
            x = -float(cross) - 1.4
            kit.place(
                walker,
                f"walker_signal_{name}_{side}",
                "TrafficLight",
                where(x, y, 2.2 + at.KERB),
                heading - turn,
                signal=f"walk_{group}",
            )
            kit.place(post, f"walker_post_{name}_{side}", "Pole", where(x, y), heading - turn, scale=0.85)


def add_furniture(kit: SceneKit, plan: at.Layout) -> None:
    """Add bus stop, lamps, signs, bollards, benches, trees, manhole covers and gullies."""
    y = -at.MAIN - 2.3
    frame = {
        "frame": "grey_steel",
        "glass": "shelter_glass",
        "roof": "grey_steel",
        "bench": "door_wood",
        "poster": "poster",
    }
    shelter = kit.prefab("shelter", bus_stop.shelter(), frame)
    kit.place(shelter, "bus_shelter", "Static", (plan.stop_x, y, at.KERB), 180.0)
    post = bus_stop.post()
    if kit.is_light:
        post = _one(post, "pole")
    stop = kit.prefab(
        "stop_post", post, {"pole": "galvanized_steel", "flag": "sign_bus_stop", "board": "white_plastic"}
    )
    kit.place(stop, "bus_stop_sign", "TrafficSign", (plan.stop_x + 3.6, -at.MAIN - 0.6, at.KERB), 180.0)
    glass = {"pole": "black_plastic", "glass": "lamp_glass"}
    lamp_parts = furniture.lamp_post(7.5, 1.6)
    lamp_parts["pole"] = merge([Mesh(m.vertices, m.faces) for m in (lamp_parts["pole"], lamp_parts.pop("head"))])
    lamp = kit.prefab("lamp", lamp_parts, glass)
    places = np.r_[
        -np.arange(27.0, at.REACH[0] - 5.0, plan.lamp_spacing), np.arange(22.0, at.REACH[0] - 5.0, plan.lamp_spacing)
    ]
    for side, sign in (("left", 1.0), ("right", -1.0)):
        turn = 180.0 if sign > 0 else 0.0
        if kit.is_light:
            for part, body in lamp_parts.items():
                copies = [body.moved((float(x), sign * (at.MAIN + 0.5), at.KERB), np.radians(turn)) for x in places]
                kit.add(f"lamps_{side}_{part}", merge(copies), glass[part])
            kit.instance(f"lamps_{side}", "Pole")
            continue
        for number, x in enumerate(places):
            kit.place(lamp, f"lamp_{side}_{number}", "Pole", (float(x), sign * (at.MAIN + 0.5), at.KERB), turn)
    covers = [
        (-31.0, -5.2),
        (-9.0, -1.2),
        (-4.0, 4.2),
        (6.5, -4.6),
        (24.0, 1.9),
        (41.0, -2.3),
        (-52.0, 2.5),
        (2.2, 28.0),
        (-1.1, -34.0),
    ]
    kit.add("manhole_covers", merge([manhole_cover().moved((x, y, 0.0)) for x, y in covers]), "manhole_iron")
    kit.instance("manholes", "Static", ["manhole_covers"])
    if kit.is_light:
        return
    grates = [
        gully_grate().moved((float(x), sign * (at.MAIN - 0.22), 0.0))
        for x in np.arange(-90.0, 91.0, 18.0)
        for sign in (-1.0, 1.0)
        if abs(x) > 12
    ]
    kit.add("gully_grates", merge(grates), "cast_iron")
    kit.instance("gullies", "Static", ["gully_grates"])
    bollards = []
    for sx in (-1.0, 1.0):
        for sy in (-1.0, 1.0):
            for angle in np.radians((25.0, 45.0, 65.0)):
                reach = at.CORNER - 0.6  # behind the kerb
                cx, cy = at.SIDE + at.CORNER - reach * np.cos(angle), at.MAIN + at.CORNER - reach * np.sin(angle)
                bollards.append(furniture.bollard().moved((sx * cx, sy * cy, at.KERB)))
    kit.add("bollards_corners", merge(bollards), "galvanized_steel")
    kit.instance("bollards", "Pole", ["bollards_corners"])
    speed = kit.prefab(
        "sign_speed", furniture.sign("round"), {"face": "sign_50", "back": "sign_back", "pole": "galvanized_steel"}
    )
    kit.place(speed, "sign_speed_west", "TrafficSign", (-62.0, -at.MAIN - 0.5, at.KERB), 0.0)
    kit.place(speed, "sign_speed_east", "TrafficSign", (64.0, at.MAIN + 0.5, at.KERB), 180.0)
    bench = kit.prefab("bench", furniture.bench(), {"wood": "door_wood", "frame": "black_plastic"})
    kit.place(bench, "bench_0", "Static", (BENCHES[0], -at.MAIN - 1.2, at.KERB), 0.0)
    kit.place(bench, "bench_1", "Static", (BENCHES[1], at.MAIN + 1.2, at.KERB), 180.0)
    bin_parts = {
        "can": merge(
            [
                Mesh(m.vertices, m.faces)
                for m in (box((0.4, 0.4, 0.75), (0.0, 0.0, 0.55)), box((0.08, 0.08, 0.4), (0.0, 0.0, 0.1)))
            ]
        )
    }
    litter = kit.prefab("litter_bin", bin_parts, {"can": "paint_green"})
    for number, (x, py) in enumerate(
        ((plan.stop_x - 3.2, -at.MAIN - 1.6), (-22.2, -at.MAIN - 1.2), (14.0, at.MAIN + 1.2))
    ):
        kit.place(litter, f"litter_bin_{number}", "Static", (x, py, at.KERB))
    _trees(kit, plan)


def _tree_kinds(kit: SceneKit, plan: at.Layout) -> list[Prefab]:
    """Return the kinds of trees: that of variant 0, or two that the variant draws."""
    if plan.variant:
        drawn = np.random.default_rng([at.SEED, plan.variant, 3]).permutation(species.TOWN)[:2]
        return [species.prefab(kit, str(kind), at.SEED + 3, species.pruned(str(kind), 8.0, 2.0, 2.8)) for kind in drawn]
    shape = vegetation.TreeShape(7.2, 2.0, 2.8, 0.12, 10, 1500)
    bsdfs = {"trunk": "bark", "core": "leaves_shade", "leaves": "leaves"}
    return [kit.prefab("tree", vegetation.tree(shape, at.SEED + 3), bsdfs, 60.0)]


def _trees(kit: SceneKit, plan: at.Layout) -> None:
    kinds = _tree_kinds(kit, plan)
    for number, (x, sign) in enumerate(TREES):
        kit.place(
            kinds[number % len(kinds)],
            f"tree_{number}",
            "Vegetation",
            (x, sign * (at.MAIN + 1.3), at.KERB),
            47.0 * number,
            0.9 + 0.04 * (number % 4),
        )
