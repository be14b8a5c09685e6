"""Houses and gardens: blocks with shops where the town is dense, detached houses beyond, farms in the country."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from scenes_xml.generators.buildings import cityblock
from scenes_xml.generators.buildings.houses import WALLS, HousePlan, build_house, family_house
from scenes_xml.generators.geometry import polygon
from scenes_xml.generators.geometry.mesh import Mesh, box, merge
from scenes_xml.generators.kit import Prefab, SceneKit
from scenes_xml.generators.plants import planting
from scenes_xml.generators.roadside import garden

from ..model import Array
from .building_sites import LOT, SITES, add_lot, add_scaffolding
from .room import rectangle
from .sides import Side
from .site import Site, Stand

_BLOCKS, _HOUSES = 6, 7
_FACADES = ("facade_white", "facade_cream", "facade_rose", "facade_grey", "facade_brick", "facade_stone")
_WALLS = tuple(name for name in WALLS if name != "wall_brick")
_STEEPEST = {"block": 2.0, "house": 0.8}
"""Largest difference of the ground's height below a building [m]."""
_PLINTH = 3.0
_GARDEN = ("hedge", "wall", "picket", "open")
_NEXT = 3.0
"""Way to the next place that is tried [m]."""


@dataclass(frozen=True)
class _Building:
    """A building in the frame of its front's middle: from `x[0]` to `x[1]` along it, `depth` behind it [m]."""

    kind: str
    plan: cityblock.Block | HousePlan
    x: tuple[float, float]
    depth: float

    @property
    def width(self) -> float:
        return self.x[1] - self.x[0]


def add_houses(site: Site) -> None:
    """Add houses along all sides."""
    blocks, houses = _blocks(site), _houses(site)
    for number, side in enumerate(site.sides):
        if side.character == "motorway":
            continue
        generator = site.generator(1, number)
        way = float(generator.uniform(0.0, 6.0))
        while way < side.length:
            place = side.at(way)
            is_dense = site.is_dense(side, place)
            if is_dense and side.character == "town":
                building = blocks[generator.integers(len(blocks))]
                back, gap = float(generator.choice((0.3, 0.3, 2.5))), float(generator.choice((0.0, 0.0, 0.0, 4.0)))
            elif is_dense or side.character == "town":
                building = houses[generator.integers(len(houses))]
                back, gap = float(generator.uniform(3.5, 7.5)), float(generator.uniform(4.0, 9.0))
            else:
                building = houses[generator.integers(len(houses))]
                back, gap = float(generator.uniform(7.0, 16.0)), float(generator.uniform(45.0, 150.0))
            walls = str(generator.choice(_FACADES if building.kind.startswith("block") else _WALLS))
            fence = _GARDEN[generator.integers(len(_GARDEN))]
            middle = side.at(way + 0.5 * building.width)
            is_scaffolded = back > 2.0 and generator.uniform() < 0.4
            if (
                generator.uniform() < SITES
                and way + LOT[0] <= side.length
                and add_lot(site, side, side.at(way + 0.5 * LOT[0]))
            ):
                way += LOT[0] + 2.0
            elif way + building.width <= side.length and _add(site, side, middle, building, back, walls):
                if is_scaffolded and isinstance(building.plan, cityblock.Block):
                    add_scaffolding(site, side, middle, building.plan, back)
                if not building.kind.startswith("block"):
                    _add_garden(site, side, middle, 0.5 * (building.width + min(gap, 8.0)), fence)
                way += building.width + gap
            else:
                way += _NEXT


def _blocks(site: Site) -> list[_Building]:
    found = []
    for k in range(_BLOCKS):
        generator = site.generator(2, k)
        block = cityblock.Block(
            float(np.round(generator.uniform(9.0, 19.0), 1)),
            float(np.round(generator.uniform(9.5, 12.5), 1)),
            int(generator.integers(2, 5)),
            axis=float(np.round(generator.uniform(2.3, 3.1), 2)),
            window=float(np.round(generator.uniform(1.0, 1.5), 2)),
            sides=("front", "back"),
            balconies=bool(generator.uniform() < 0.5),
        )
        found.append(_Building(f"block_{k}", block, (-block.width / 2, block.width / 2), block.depth))
    return found


def _houses(site: Site) -> list[_Building]:
    found = []
    for k in range(_HOUSES):
        plan = family_house(site.generator(3, k))
        half = 0.5 * plan.shape.length + 0.5
        found.append(_Building(f"house_{k}", plan, (-half, half + plan.garage), plan.shape.depth))
    return found


def _add(site: Site, side: Side, middle: int, building: _Building, back: float, walls: str) -> bool:
    """Add a building `back` [m] behind the front of a side, if there is room."""
    if not side.is_open[middle]:
        return False
    yaw = side.yaw(middle) - 0.5 * np.pi
    foot = side.front[middle, :2] + (back + 0.5 * building.depth) * side.out[middle]
    foot = foot - 0.5 * (building.x[0] + building.x[1]) * np.array([np.cos(yaw), np.sin(yaw)])
    is_block = isinstance(building.plan, cityblock.Block)
    front = 0.2 if is_block else 1.1
    plan = rectangle(foot, yaw, building.x, (-0.5 * building.depth - front, 0.5 * building.depth + 0.5))
    z = site.ground(shapely.get_coordinates(plan)[:4])
    if np.ptp(z) > _STEEPEST["block" if is_block else "house"]:
        return False
    neighbour = shapely.buffer(plan, -0.15) if is_block else plan  # blocks stand wall to wall
    if not site.room.taken(neighbour):
        return False
    where = np.array([*foot, float(z.max()) + 0.02])
    is_brick = isinstance(building.plan, HousePlan) and building.plan.bsdfs["walls"] == "wall_brick"
    material = {} if is_brick else {"walls": walls}  # bricks have a tile of their own
    site.put(building.kind, lambda: _prefab(site.kit, building), "Building", Stand(where, yaw, 1.0, material))
    return True


def _prefab(kit: SceneKit, building: _Building) -> Prefab:
    if isinstance(building.plan, HousePlan):
        return build_house(kit, f"beside_{building.kind}", building.plan)
    parts = cityblock.block(building.plan, kit.is_light)
    plinth = box((building.plan.width - 0.04, building.plan.depth - 0.04, _PLINTH), (0.0, 0.0, -0.5 * _PLINTH))
    if kit.is_light:
        parts = {"walls": merge([parts["walls"], parts["trim"], plinth]), "panes": parts["panes"]}
    else:
        parts["walls"] = merge([parts["walls"], plinth])
    half = 0.5 * np.array([building.plan.width, building.plan.depth]) - 0.05
    parts["roof"] = polygon.sheet(half * [(-1, -1), (1, -1), (1, 1), (-1, 1)], building.plan.height + 0.03, 2.0)
    bsdfs = {"walls": "facade_white", "panes": "window_pane", "trim": "facade_trim", "roof": "gravel_fine"}
    return kit.prefab(f"beside_{building.kind}", parts, bsdfs)


def _add_garden(site: Site, side: Side, middle: int, half: float, kind: str) -> None:
    """Add what closes a garden off from the street, on both sides of its gate."""
    gate = 1.8
    for low, high in ((middle - half, middle - gate), (middle + gate, middle + half)):
        places = np.arange(max(0, int(low)), min(len(side.s) - 1, int(high)) + 1)
        if kind == "open" or len(places) < 3:
            continue
        line = side.front[places, :2] + 0.55 * side.out[places]
        plan = shapely.buffer(shapely.LineString(line), 0.42, cap_style="flat")
        if side.is_open[places].all() and site.room.taken(plan):
            for material, mesh in _edge(site.on_ground(line), kind, site.kit.is_light, int(middle)):
                semantic = {"hedge": "Vegetation", "wall": "Wall"}.get(kind, "Fence")
                site.rows[semantic, material].append(mesh)


def _edge(line: Array, kind: str, is_light: bool, seed: int) -> list[tuple[str, Mesh]]:
    if kind == "hedge":
        return [("hedge", planting.hedge(line, 1.2, 0.6, seed, 0.8 if is_light else 0.35))]
    if kind == "wall":
        wall, coping = garden.garden_wall(line, 0.7)
        return [("wall_brick", wall), ("kerb_stone", coping)]
    return [("fence_white", garden.picket_fence(line, gap=0.5 if is_light else 0.16))]
