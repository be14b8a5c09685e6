"""What stands in the street: the houses, lamps, signs, bollards, benches and trees."""

from __future__ import annotations

import numpy as np

from ..generators.geometry.mesh import Mesh, merge
from ..generators.kit import SceneKit
from ..generators.plants import species, vegetation
from ..generators.roadside import furniture
from . import layout as at
from . import static
from .layout import Layout

FIRST_TREE = vegetation.TreeShape(6.6, 1.9, 2.7, 0.11, 12, 2600)
"""That of variant 0."""


def add_houses(kit: SceneKit, plan: Layout) -> None:
    """Add the houses; at the light level walls and panes of each, and the roofs of all as one."""
    roofs: dict[str, list[Mesh]] = {}
    for number, (name, shape, walls, turn, where) in enumerate(static.houses(plan)):
        roof, door = plan.roofs[number % len(plan.roofs)], plan.doors[number % len(plan.doors)]
        bsdfs = {"walls": walls, "roof": roof, "frames": "painted_wood", "panes": "window_pane", "doors": door}
        parts = static.house_parts(plan, shape)
        if kit.is_light:
            roofs.setdefault(roof, []).append(parts["roof"].moved(where, np.radians(turn)))
            parts = {part: parts[part] for part in ("walls", "panes")}
        kit.place(kit.prefab(name, parts, bsdfs), name, "Building", where, turn)
    for roof, placed in roofs.items():
        kit.add(f"roofs_{roof}", merge(placed), roof, 40.0)
    if roofs:
        kit.instance("roofs", "Building")


def add_furniture(kit: SceneKit, plan: Layout) -> None:
    """Add lamps, signs and bollards at the crossing, and benches."""
    _lamps(kit, plan)
    pavement, shift = at.KERB_HEIGHT, plan.shift
    metal = {"back": "sign_back", "pole": "galvanized_steel"}
    parts = kit.slim(furniture.sign("square", 2.3), "back", "pole")
    sign = kit.prefab("sign_square", parts, {"face": "sign_crossing", **metal})
    for name, x, y, yaw in (("sign_crossing_right", 18.4, -4.5, 0.0), ("sign_crossing_left", 25.6, 5.5, 180.0)):
        kit.place(sign, name, "TrafficSign", (x + shift, y, pavement), yaw)
    post = {"steel": furniture.bollard()}
    steel = {"steel": "galvanized_steel"}
    places = [(x + shift, y) for x in (17.6, 19.0, 25.0, 26.4) for y in (at.KERB_LEFT + 0.4, at.KERB_RIGHT - 0.4)]
    if kit.is_light:
        kit.copies("bollards", "Pole", post, steel, [((x, y, pavement), 0.0, 1.0) for x, y in places])
    else:
        bollard = kit.prefab("bollard", post, steel)
        for number, (x, y) in enumerate(places):
            kit.place(bollard, f"bollard_{number}", "Pole", (x, y, pavement))
    if kit.is_light:
        return
    bench = kit.prefab("bench", furniture.bench(), {"wood": "door_wood", "frame": "black_plastic"})
    for number, (x, y, yaw) in enumerate(plan.benches):
        kit.place(bench, f"bench_{number}", "Static", (x, y, pavement), yaw)


def _lamps(kit: SceneKit, plan: Layout) -> None:
    parts = kit.slim(furniture.street_lamp(), "head", "pole")
    if plan.variant or kit.is_light:
        parts["glass"] = parts["glass"].moved((0.0, 0.0, 0.001))  # its foot is not in the plane of the pole's top
    glass = {"pole": "black_plastic", "head": "black_plastic", "glass": "lamp_glass"}
    rows = {"left": (at.KERB_LEFT + 0.55, 0.0), "right": (at.KERB_RIGHT - 0.55, 11.0)}
    along = np.arange(-40.0, 121.0, plan.lamps)
    if kit.is_light:
        for side, (y, shift) in rows.items():
            places = [((float(x + shift), y, at.KERB_HEIGHT), 0.0, 1.0) for x in along]
            kit.copies(f"lamps_{side}", "Pole", parts, glass, places)
        return
    lamp = kit.prefab("lamp", parts, glass)
    for number, x in enumerate(along):
        for side, (y, shift) in rows.items():
            kit.place(lamp, f"lamp_{side}_{number}", "Pole", (float(x + shift), y, at.KERB_HEIGHT))


def _tree(kit: SceneKit, plan: Layout, kind: str) -> tuple[dict[str, Mesh], dict[str, str]]:
    """Return the parts of a kind of tree and their materials."""
    if kind in species.KINDS:
        return species.tree(kind, plan.seed + 3, kit.is_light)
    parts = vegetation.tree(FIRST_TREE, plan.seed + 3, kit.is_light)
    return parts, {"trunk": "bark", "core": "leaves_shade", "leaves": "leaves"}


def add_trees(kit: SceneKit, plan: Layout) -> None:
    """Add the street trees on the left."""
    ready = {}
    for kind in dict.fromkeys(tree.kind for tree in plan.trees):
        parts, bsdfs = _tree(kit, plan, kind)
        if kit.is_light:
            same = [tree for tree in plan.trees if tree.kind == kind]
            copies = [((tree.x, tree.y, at.KERB_HEIGHT), tree.turn, tree.scale) for tree in same]
            kit.copies(f"trees_{kind}", "Vegetation", parts, bsdfs, copies)
        else:
            ready[kind] = kit.prefab(kind if kind == "tree" else f"tree_{kind}", parts, bsdfs, 60.0)
    for number, tree in enumerate(plan.trees):
        if tree.kind in ready:
            where = (tree.x, tree.y, at.KERB_HEIGHT)
            kit.place(ready[tree.kind], f"tree_{number}", "Vegetation", where, tree.turn, tree.scale)
