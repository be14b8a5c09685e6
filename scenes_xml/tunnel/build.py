"""Build the scene: ``python -m scenes_xml.tunnel.build`` writes XML, scene.toml, meshes and textures of variant 0.

Everything follows from the numbers in this package and the variant's number; a second run gives the same bytes.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from ..generators.geometry.mesh import box, merge
from ..generators.kit import SceneKit
from ..generators.roads import road, tunnel
from ..generators.roads.sweep import bar, lane_line, row, stations, sweep
from ..generators.roads.wear import LaneSurface, add_wear
from ..generators.roadside import furniture
from ..generators.scene_toml import Lane
from ..generators.surfaces import interior, textures
from ..packing import write_packed
from . import layout as at

NAME = "tunnel"
DESCRIPTION = (
    "A two-lane road tunnel between two portals: lining, walkways, emergency niches, jet fans, lamps, signs; "
    "a lorry ahead, a car "
    "behind, oncoming traffic and a person on the walkway. Walls, ceiling and vehicles make strong multipath."
)
MARK = 0.004
"""Height of markings over the carriageway [m]."""


def build(folder: Path, variant: int = 0, detail: str = "detailed") -> None:
    """Write a variant of the scene into `folder`, ``detailed`` or ``light``."""
    plan = at.layout(variant)
    table = {
        "name": NAME,
        "title": "Road tunnel",
        "description": DESCRIPTION,
        "license": "Apache-2.0",
        "source": f"built by scenes_xml/{NAME}/build.py",
        "seed": at.SEED,
        "ego": "ego",
        "variant": variant,
        "detail": detail,
        "enclosed": True,
        "exposure": 260.0,
    }
    kit = SceneKit(folder, table, detail, at.SEED + variant)
    kit.materials |= interior.MATERIALS
    kit.materials["lining_coated"] = replace(kit.materials["lining_coated"], floats={"roughness": 0.4, "specular": 0.5})
    kit.textures |= interior.IMAGES | {
        "asphalt.png": lambda seed: textures.asphalt(512, seed + 1, (1.2, 2.76, 4.74, 6.3), 7.5)
    }
    tint = np.array(plan.coating)
    kit.textures["lining_coated.png"] = lambda seed: interior.lining_coated(seed) * tint
    _road(kit, plan)
    _outside(kit, plan)
    _lining(kit, plan)
    _ceiling(kit, plan)
    if not kit.is_light:
        _equipment(kit, plan)
    _lanes(kit, plan)
    _traffic(kit, plan)
    kit.write()


def _road(kit: SceneKit, plan: at.Layout) -> None:
    """Add the carriageway, kerbs, walkways and markings."""
    curve, half = plan.curve, plan.bore.half
    s = stations(curve, *at.ROAD, step=3.0)
    kit.add(
        "road_asphalt",
        sweep(curve, s, np.array([(-at.EDGE - 0.3, 0.0), (at.EDGE + 0.3, 0.0)]), (7.5, 7.5)),
        "asphalt_worn",
    )
    inside = stations(curve, plan.start, plan.stop, step=3.0)
    for side, sign in (("left", 1.0), ("right", -1.0)):
        profile = np.array([(sign * at.EDGE, 0.0), (sign * at.EDGE, 0.15), (sign * half, 0.15)])
        kit.add(
            f"walkway_{side}", sweep(curve, inside, profile if sign < 0 else profile[::-1], (2.0, 2.0)), "concrete_grey"
        )
    starts = np.arange(at.ROAD[0], at.ROAD[1] - 4.0, 6.0)
    lines = [
        sweep(curve, s, np.array([(d - 0.075, MARK), (d + 0.075, MARK)]), (2.0, 2.0))
        for d in (-at.EDGE + 0.25, at.EDGE - 0.25)
    ]
    twice = [sweep(curve, inside, np.array([(d - 0.06, MARK), (d + 0.06, MARK)]), (2.0, 2.0)) for d in (-0.14, 0.14)]
    outside = [a for a in starts if a + 3.0 < plan.start or a > plan.stop]
    kit.add("marking_edges", merge(lines), "line_white")
    kit.add(
        "marking_centre", merge([*twice, road.dashes(curve, np.array(outside), 3.0, 0.0, 0.12, MARK)]), "line_white"
    )
    kit.instance("road", "Roads", ["road_asphalt"])
    if plan.variant:
        lanes = [LaneSurface.along(curve, s, side * at.LANE, 3.5) for side in (-1.0, 1.0)]
        add_wear(kit, lanes, np.random.default_rng([at.SEED, plan.variant, 20]), "country")
    kit.instance("markings", "RoadLine", ["marking_*"])
    kit.instance("walkways", "SideWalks", ["walkway_*"])


def _outside(kit: SceneKit, plan: at.Layout) -> None:
    """Add the cuttings before the portals, the hill over the tunnel and the portals."""
    curve = plan.curve
    across = np.array([4.0, 5.2, 7.0, 14.0, 22.0, 40.0, 75.0])
    cutting = np.array([-0.02, -0.05, 0.0, 4.2, 8.9, 9.4, 11.0])
    offsets, heights = np.r_[-across[::-1], across], np.r_[cutting[::-1], cutting]
    for name, a, b in (("entry", at.ROAD[0], plan.start), ("exit", plan.stop, at.ROAD[1])):
        profile = np.column_stack([offsets, heights])
        kit.add(f"terrain_{name}", sweep(curve, stations(curve, a, b, 5.0), profile, (8.0, 8.0)), "grass_meadow", 60.0)
        ends = curve.point(np.array(a if name == "entry" else b), 0.0)
        kit.add(
            f"terrain_end_{name}",
            box((0.5, 150.0, 16.0), (float(ends[0]) + (-0.5 if name == "entry" else 0.5), float(ends[1]), 3.0)),
            "grass_meadow",
        )
    hill = np.array([(-75.0, 11.0), (-40.0, 9.4), (-22.0, 8.9), (22.0, 8.9), (40.0, 9.4), (75.0, 11.0)])
    kit.add(
        "terrain_hill",
        sweep(curve, stations(curve, plan.start, plan.stop, 6.0), hill, (8.0, 8.0)),
        "grass_meadow",
        60.0,
    )
    kit.add("portal_entry", tunnel.portal(curve, plan.start, plan.bore, -1), "concrete_grey")
    kit.add("portal_exit", tunnel.portal(curve, plan.stop, plan.bore, 1), "concrete_grey")
    kit.instance("terrain", "Terrain", ["terrain_*"])
    kit.instance("portals", "Wall", ["portal_*"])


def _lining(kit: SceneKit, plan: at.Layout) -> None:
    """Add the walls with their niches and the vault or ceiling."""
    curve, bore = plan.curve, plan.bore
    openings = () if kit.is_light else plan.openings
    for side, sign in (("left", 1), ("right", -1)):
        wall, niches = tunnel.lower_wall(curve, plan.start, plan.stop, bore, sign, openings)
        kit.add(f"lining_wall_{side}", wall, "lining_coated", 5.0)
        if niches is not None:
            kit.add(f"lining_niches_{side}", niches, "lining_coated", 5.0)
    s = stations(curve, plan.start, plan.stop, 3.0)
    kit.add("lining_upper", sweep(curve, s, bore.upper(8 if kit.is_light else 16), (5.0, 5.0)), "lining_concrete", 30.0)
    kit.instance("lining", "Wall", ["lining_*"])


def _ceiling(kit: SceneKit, plan: at.Layout) -> None:
    """Add lamps, jet fans and lane signals under the ceiling."""
    curve, bore = plan.curve, plan.bore
    places = np.arange(plan.start + 4.0, plan.stop - 3.0, plan.lamps)
    parts = tunnel.luminaire()
    for number, offset in enumerate(plan.rows):
        height = min(bore.ceiling(abs(offset) + 0.2), 6.2) - 0.05
        kit.add(f"lamps_{number}_glass", row(curve, places, parts["glass"], offset, height), "lamp_indoor")
        kit.add(f"lamps_{number}_case", row(curve, places, parts["case"], offset, height), "grey_steel")
        if not kit.is_light:
            ends = stations(curve, plan.start + 1.0, plan.stop - 1.0, 3.0)
            kit.add(
                f"lamps_{number}_tray",
                bar(curve, ends, (offset - 0.1, height), (offset + 0.1, height + 0.06)),
                "galvanized_steel",
            )
    kit.instance("lamps", "Other", ["lamps_*"])
    fan = tunnel.jet_fan(8 if kit.is_light else 24)
    ready = kit.prefab("jet_fan", fan, {"case": "duct_steel", "core": "black_gloss"})
    for number, s in enumerate(plan.fans):
        yaw = np.degrees(float(curve.heading(np.array(s))))
        for side, offset in (("left", 0.55), ("right", -0.55)):
            x, y, _ = curve.point(np.array(s), offset)
            kit.place(ready, f"jet_fan_{number}_{side}", "Static", (x, y, bore.ceiling(0.55) - 0.85), yaw)
    signal = tunnel.lane_signal()
    if kit.is_light:
        signal.pop("hanger")
    ready = kit.prefab(
        "lane_signal", signal, {"case": "black_plastic", "front": "black_gloss", "hanger": "galvanized_steel"}
    )
    arrow = kit.prefab("lane_arrow", tunnel.lane_arrow(), {"green": "lane_green_on"})
    cross = kit.prefab("lane_cross", tunnel.lane_cross(), {"red": "lane_red_on"})
    for number, s in enumerate(plan.signals):
        yaw = np.degrees(float(curve.heading(np.array(s))))
        for lane, offset in (("right", -at.LANE), ("left", at.LANE)):
            x, y, _ = curve.point(np.array(s), offset)
            where = (x, y, min(bore.ceiling(at.LANE + 0.45) - 0.98, 5.3))
            name = f"lane_signal_{number}_{lane}"
            kit.place(ready, name, "TrafficLight", where, yaw)
            kit.place(
                arrow,
                f"{name}_ahead",
                "TrafficLight",
                where,
                yaw + (0.0 if lane == "right" else 180.0),
                is_object=False,
            )
            kit.place(
                cross, f"{name}_back", "TrafficLight", where, yaw + (180.0 if lane == "right" else 0.0), is_object=False
            )


def _equipment(kit: SceneKit, plan: at.Layout) -> None:
    """Add emergency cabinets, doors, signs, cable trays, handrails, gullies and kerb reflectors."""
    curve, bore = plan.curve, plan.bore
    cabinet = kit.prefab("cabinet", tunnel.cabinet(), {"box": "paint_orange", "door": "sign_sos", "sign": "paint_red"})
    sos = kit.prefab("sign_sos", tunnel.box_sign(), {"case": "black_plastic", "faces": "sign_sos"})
    exit_sign = kit.prefab("sign_exit", tunnel.box_sign(), {"case": "black_plastic", "faces": "sign_exit"})
    door = kit.prefab(
        "exit_door", tunnel.exit_door(), {"leaf": "paint_green", "frame": "white_plastic", "handle": "galvanized_steel"}
    )
    for number, o in enumerate(plan.openings):
        middle = 0.5 * (o.start + o.stop)
        yaw = np.degrees(float(curve.heading(np.array(middle)))) - 90.0 * o.side
        x, y, _ = curve.point(np.array(middle - 0.3), o.side * (bore.half + o.depth))
        kit.place(cabinet, f"cabinet_{number}", "Static", (x, y, bore.kerb), yaw)
        x, y, _ = curve.point(np.array(o.start - 0.5), o.side * bore.half)
        kit.place(
            sos, f"sign_sos_{number}", "TrafficSign", (x, y, 2.75), yaw + 90.0 * o.side + (180.0 if o.side > 0 else 0.0)
        )
    for number, s in enumerate(plan.doors):
        yaw = np.degrees(float(curve.heading(np.array(s))))
        x, y, _ = curve.point(np.array(s), -bore.half)
        kit.place(door, f"exit_door_{number}", "Static", (x, y, bore.kerb + 0.01), yaw + 90.0)
        x, y, _ = curve.point(np.array(s - 0.9), -bore.half)
        kit.place(exit_sign, f"sign_exit_{number}", "TrafficSign", (x, y, 2.6), yaw)
    speed = kit.prefab(
        "sign_speed", furniture.sign("round", 2.6), {"face": "sign_70", "back": "sign_back", "pole": "galvanized_steel"}
    )
    for name, s, offset, turn in (("right", plan.start - 12.0, -5.6, 0.0), ("left", plan.stop + 12.0, 5.6, 180.0)):
        x, y, _ = curve.point(np.array(s), offset)
        kit.place(
            speed,
            f"sign_speed_{name}",
            "TrafficSign",
            (x, y, 0.0),
            np.degrees(float(curve.heading(np.array(s)))) + turn,
        )
    ends = stations(curve, plan.start + 0.5, plan.stop - 0.5, 3.0)
    trays = []
    for sign in (1.0, -1.0):
        wall = sign * (bore.half - 0.02)
        trays.append(
            bar(
                curve,
                ends,
                sorted((wall, wall - sign * 0.35))[:1] + [3.35],
                sorted((wall, wall - sign * 0.35))[1:] + [3.47],
            )
        )
    if not bore.is_arch:
        kit.add("tray_cables", merge(trays), "galvanized_steel")
        kit.instance("cable_trays", "Other", ["tray_cables"])
    rails = [
        bar(curve, ends, (sign * (bore.half - 0.1) - 0.025, 1.1), (sign * (bore.half - 0.1) + 0.025, 1.15))
        for sign in (-1.0, 1.0)
    ]
    clear = [o for o in plan.openings]
    if not clear:
        kit.add("rail_hand", merge(rails), "galvanized_steel")
        kit.instance("handrails", "Fence", ["rail_hand"])
    gullies = row(curve, np.arange(plan.start + 10.0, plan.stop, 20.0), box((0.5, 0.35, 0.02)), -at.EDGE + 0.45)
    gullies = merge(
        [gullies, row(curve, np.arange(plan.start + 10.0, plan.stop, 20.0), box((0.5, 0.35, 0.02)), at.EDGE - 0.45)]
    )
    kit.add("gully_grates", gullies, "cast_iron")
    kit.instance("gullies", "Static", ["gully_grates"])
    studs = [
        row(curve, np.arange(plan.start + 2.0, plan.stop, 8.0), box((0.03, 0.1, 0.09)), d, 0.19)
        for d in (-at.EDGE - 0.1, at.EDGE + 0.1)
    ]
    kit.add("reflectors_kerb", merge(studs), "reflector")
    kit.instance("reflectors", "Static", ["reflectors_kerb"])


def _lanes(kit: SceneKit, plan: at.Layout) -> None:
    a, b = at.ROAD[0] + 2.0, at.ROAD[1] - 2.0
    walk = 0.5 * (at.EDGE + plan.bore.half)
    kit.lanes += [
        Lane("right", lane_line(plan.curve, a, b, -at.LANE), "drive", 3.5, 19.4),
        Lane("left", lane_line(plan.curve, b, a, at.LANE), "drive", 3.5, 19.4),
        Lane("walk_right", lane_line(plan.curve, plan.start + 1.0, plan.stop - 1.0, -walk, 0.15), "walk", 1.0, 1.6),
        Lane("walk_left", lane_line(plan.curve, plan.stop - 1.0, plan.start + 1.0, walk, 0.15), "walk", 1.0, 1.6),
    ]


def _traffic(kit: SceneKit, plan: at.Layout) -> None:
    for t in plan.traffic:
        offset = -at.LANE if t.speed > 0 else at.LANE
        kit.actor(
            t.name, t.model, at.TIMES, plan.curve.lane_positions(t.start, offset, t.speed, at.TIMES), variant=_colour(t)
        )
    walk = -0.5 * (at.EDGE + plan.bore.half)
    kit.actor(
        "walker", "adult_man", at.TIMES, plan.curve.lane_positions(plan.walker, walk, 1.3, at.TIMES) + [0.0, 0.0, 0.15]
    )


def _colour(t: at.Traffic) -> str | None:
    """Return the colour variant of a vehicle; None is the first one of its model."""
    colours = {
        "saloon": ("blue", "red", "white"),
        "suv": ("grey", "white", "green"),
        "small_car": ("yellow", "red", "white"),
    }.get(t.model, ())
    return colours[t.variant % len(colours)] if colours and t.variant else None


if __name__ == "__main__":
    write_packed(Path(__file__).resolve().parent, build)
