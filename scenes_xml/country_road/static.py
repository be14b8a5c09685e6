"""The road, its shoulders, ditches, the path for bicycles, fields, the farm's yard, markings and the guardrail."""

from __future__ import annotations

import numpy as np

from ..generators.geometry.mesh import Array, levelled, merge
from ..generators.kit import SceneKit
from ..generators.roads import guardrail, road
from ..generators.roads.ground import Ground, far_field
from ..generators.roads.wear import LaneSurface, add_wear
from ..generators.roadside.rural import cells
from . import layout as at
from .layout import Plan

MARK = 0.004
SURFACES = ("gravel_fine", "lawn", "asphalt_dark", "crop", "soil", "yard")
TILES = {"gravel_fine": 2.0, "lawn": 8.0, "asphalt_dark": 4.0, "crop": 4.0, "soil": 3.0, "yard": 2.0}
CLASSES = {
    "gravel_fine": "Terrain",
    "lawn": "Terrain",
    "asphalt_dark": "SideWalks",
    "crop": "Vegetation",
    "soil": "Terrain",
    "yard": "Ground",
}
YARD = 16.0
"""Half length of the farm's yard along the road [m]."""


def add_ground(kit: SceneKit, p: Plan) -> Ground:
    """Add everything that is ground, and return it."""
    ground = Ground()
    s = np.arange(at.START, at.STOP + 1e-9, 2.0)
    half = at.HALF
    across, heights = np.array([-half, -half, 0.0, half, half]), np.array([-0.25, 0.0, 0.0, 0.0, -0.25])
    kit.add("road_asphalt", ground.add(road.strip(p.way, s, across, heights, (4.0, 4.0))), "asphalt_plain", 60.0)
    kit.instance("road", "Roads", ["road_asphalt"])
    if p.variant:
        lanes = [LaneSurface.along(p.way, s, side * 0.5 * half, half) for side in (-1.0, 1.0)]
        add_wear(kit, lanes, np.random.default_rng([p.variant, 20]), "country")
    for side in (1, -1):
        _land(kit, p, side, ground)
    kit.add("terrain_far", far_field(1800.0, p.variant + 26, at.BASE, 25.0), "lawn", 0.5)
    kit.instance("ground_far", "Terrain", ["terrain_far"])
    _markings(kit, p, s)
    _guardrail(kit, p)
    return ground


def _stations(p: Plan) -> Array:
    near = p.farm + np.array([-YARD, -6.5, -4.5, -3.0, -1.7, 1.7, 3.0, 4.5, 6.5, YARD])
    s = np.unique(np.concatenate([np.arange(at.START, at.STOP + 1e-9, 4.0), near]))
    return s[np.r_[True, np.diff(s) > 0.3]]


def _land(kit: SceneKit, p: Plan, side: int, ground: Ground) -> None:
    """Add the land of one side: each cell of a grid has its surface."""
    s, offsets = _stations(p), side * at.OFFSETS
    heights = at.land_height(p, s[:, None], np.broadcast_to(offsets, (len(s), len(offsets))))
    points = p.way.point(s[:, None], offsets[None, :], heights + p.way.crown * np.minimum(np.abs(offsets), at.HALF))
    middle_s, middle_d = 0.5 * (s[1:] + s[:-1])[:, None], 0.5 * (at.OFFSETS[1:] + at.OFFSETS[:-1])[None, :]
    kinds = np.full((len(s) - 1, len(offsets) - 1), SURFACES.index("lawn"))
    kinds[:, 0] = SURFACES.index("gravel_fine")
    crop = SURFACES.index(p.crops[0] if side < 0 else p.crops[1])
    kinds[(middle_d > 16.0) & (middle_d < 66.0) & ((middle_s > 30.0) if side < 0 else (middle_s < 30.0))] = crop
    if side > 0:
        kinds[:, (middle_d[0] > at.PATH[0]) & (middle_d[0] < at.PATH[1])] = SURFACES.index("asphalt_dark")
        on_drive = (
            (np.abs(middle_s - p.farm) < 1.75)
            & (middle_d < 16.0)
            & ~((middle_d > at.PATH[0]) & (middle_d < at.PATH[1]))
        )
        in_yard = (np.abs(middle_s - p.farm) < YARD) & (middle_d > 16.0) & (middle_d < 30.0)
        kinds[on_drive | in_yard] = SURFACES.index("yard")
    name = "left" if side > 0 else "right"
    for surface, part in cells(points, kinds, TILES, SURFACES).items():
        shape = f"land_{name}_{surface}"
        kit.add(shape, levelled(ground.add(part), 0.5), "gravel_fine" if surface == "yard" else surface)
        kit.instance(shape, CLASSES[surface], [shape])


def _markings(kit: SceneKit, p: Plan, s: Array) -> None:
    lines = []
    for offset in (-at.HALF + 0.2, at.HALF - 0.2):
        lines.append(road.strip(p.way, s, np.array([offset - 0.06, offset + 0.06]), np.full(2, MARK)))
    kit.add("marking_edges", merge(lines), "marking_worn", 60.0)
    starts = np.arange(at.START + 1.0, at.STOP - 4.0, 7.5 if p.variant % 2 else 9.0)
    in_bend = (starts > p.rail[0] - 8.0) & (starts < p.rail[1] + 4.0)
    dashes = [road.dashes(p.way, starts[~in_bend], 3.0, 0.0, 0.12, MARK)]
    bend = np.arange(p.rail[0] - 8.0, p.rail[1] + 6.0, 2.0)
    dashes.append(road.strip(p.way, bend, np.array([-0.06, 0.0, 0.06]), np.full(3, MARK)))
    kit.add("marking_centre", merge(dashes), "marking_worn", 60.0)
    kit.instance("road_markings", "RoadLine", ["marking_*"])


def _guardrail(kit: SceneKit, p: Plan) -> None:
    """Add the guardrail along the outside of the bend."""
    (start, stop), side = p.rail, -p.rail_side
    offset = p.rail_side * (at.HALF + 0.95)
    kit.add("guardrail_beam", guardrail.beam(p.way, start, stop, offset, 0.56, side), "galvanized_steel", 50.0)
    posts = np.arange(start + 1.3, stop - 1.0, 8.0 if kit.is_light else 4.0)
    kit.add("guardrail_posts", guardrail.posts(p.way, posts, offset, 0.68, side), "galvanized_steel")
    kit.instance("guardrail", "GuardRail", ["guardrail_*"], True)


def cycle_lines(p: Plan, ground: Ground) -> dict[str, Array]:
    """Return the centre lines of the path's two directions on the ground, shape (n, 3)."""
    quarter = 0.25 * (at.PATH[1] - at.PATH[0])
    east = p.way.line(at.START + 2.0, at.STOP - 2.0, at.PATH[0] + quarter)
    west = p.way.line(at.STOP - 2.0, at.START + 2.0, at.PATH[1] - quarter)
    return {"path_east": ground.on(east), "path_west": ground.on(west)}
