"""Building sites: fenced lots with hut, heap and barrier boards, and scaffolding before some fronts."""

from __future__ import annotations

import numpy as np

from scenes_xml.generators.buildings.cityblock import Block
from scenes_xml.generators.kit import Prefab, SceneKit
from scenes_xml.generators.roadside import construction

from .room import rectangle
from .sides import Side
from .site import Site, Stand

SITES = 0.05
"""Share of the lots that are building sites."""
LOT = (5 * construction.PANEL, 4 * construction.PANEL)
"""Length along the street and depth of a site [m]."""
_BACK = 0.8
_STEEPEST = 0.8
_BOARDS = (-5.0, 0.0, 5.0)


def add_lot(site: Site, side: Side, middle: int) -> bool:
    """Add a fenced site behind the front of a side, if there is room, and return whether there was."""
    long, deep = LOT
    yaw = side.yaw(middle) - 0.5 * np.pi
    across = np.array([np.cos(yaw), np.sin(yaw)])
    origin = side.front[middle, :2] + _BACK * side.out[middle]
    plan = rectangle(origin, yaw, (-0.5 * long - 0.4, 0.5 * long + 0.4), (-0.5, deep + 0.5))
    heights = site.ground(np.array(plan.exterior.coords)[:4])
    if not side.is_open[middle] or np.ptp(heights) > _STEEPEST or not site.room.taken(plan):
        return False

    def stand(x: float, y: float, turn: float = 0.0) -> Stand:
        return Stand(site.on_ground(origin + x * across + y * side.out[middle]), yaw + turn)

    step, panels = construction.PANEL, [round(one / construction.PANEL) for one in LOT]
    along = (np.arange(panels[0]) - 0.5 * (panels[0] - 1)) * step
    behind = (np.arange(panels[1]) + 0.5) * step
    fence = [stand(float(x), y) for x in along for y in (0.0, deep)]
    fence += [stand(x, float(y), 0.5 * np.pi) for y in behind for x in (-0.5 * long, 0.5 * long)]
    for one in fence:
        site.put("site_fence", lambda: _fence(site.kit), "Fence", one)
    for x in _BOARDS:
        site.put("barrier_board", lambda: _board(site.kit), "Static", stand(x, 0.45 - _BACK * 0.2))
    site.put("site_hut", lambda: _hut(site.kit), "Building", stand(-3.5, deep - 3.0))
    soil = {"soil": construction.heap()}
    site.put(
        "soil_heap", lambda: site.kit.prefab("beside_heap", soil, {"soil": "soil"}, 60.0), "Terrain", stand(4.5, 7.0)
    )
    return True


def add_scaffolding(site: Site, side: Side, middle: int, block: Block, back: float) -> None:
    """Add scaffolding before the front of a block that stands `back` [m] behind the front of its side."""
    yaw = side.yaw(middle) - 0.5 * np.pi
    foot = side.front[middle, :2] + (back - 0.75) * side.out[middle]
    plan = rectangle(foot, yaw, (-0.5 * block.width, 0.5 * block.width), (-1.1, 0.4))
    if not site.room.is_free(plan):
        return
    name = f"scaffold_{block.width:.1f}_{block.storeys}".replace(".", "_")
    site.put(name, lambda: _scaffold(site.kit, name, block), "Static", Stand(site.on_ground(foot), yaw))


def _fence(kit: SceneKit) -> Prefab:
    return kit.prefab("beside_site_fence", construction.fence_panel(kit.is_light), construction.FENCE)


def _board(kit: SceneKit) -> Prefab:
    return kit.prefab("beside_barrier_board", construction.barrier_board(), construction.BOARD)


def _hut(kit: SceneKit) -> Prefab:
    bsdfs = {"shell": "garage_door", "frame": "iron_dark", "pane": "window_pane", "door": "sign_back"}
    return kit.prefab("beside_site_hut", construction.site_hut(), bsdfs)


def _scaffold(kit: SceneKit, name: str, block: Block) -> Prefab:
    parts = construction.scaffolding(block.width - 0.6, block.height, is_light=kit.is_light)
    return kit.prefab(f"beside_{name}", parts, construction.SCAFFOLDING)
