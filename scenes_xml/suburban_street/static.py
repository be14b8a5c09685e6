"""Ground of the street: carriageway, kerbs, verges, footways, drives, gardens and the land around."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ..generators.geometry import polygon
from ..generators.geometry.mesh import Array, Mesh, merge
from ..generators.kit import SceneKit
from ..generators.roads.ground import Ground, far_field
from ..generators.roads.walkways import split_near
from ..generators.roads.wear import LaneSurface, add_wear
from ..generators.roadside import garden
from . import layout as at
from .layout import Plan

MARK = 0.004
PAD = 0.012
GARDEN = 42.0


def add_ground(kit: SceneKit, p: Plan) -> Ground:
    """Add everything flat, and return it as the ground that things stand on."""
    ground = Ground()
    s = _stations(p)
    line = p.way.point(s)[:, :2]
    road = polygon.band(line, [at.KERB_RIGHT, at.PARKING_EDGE, 0.0, at.KERB_LEFT], np.zeros(4), 4.0)
    kit.add("road_asphalt", ground.add(road), "asphalt_plain")
    kit.instance("road", "Roads", ["road_asphalt"])
    kerbs, verges, walks, gardens, pads = [], [], [], [], []
    for side in (1, -1):
        kerb_line = p.way.point(s, p.kerb(side))[:, :2]
        drives = [lot.drive for lot in p.lots if lot.side == side]
        low = np.array([p.way.point(np.array(d), p.kerb(side))[:2] for d in [*drives, at.CROSSING]])
        drop = polygon.lowered(kerb_line, low, at.DRIVE_HALF + 0.2, 0.7)
        kerb, verge = polygon.kerb_and_pavement(kerb_line, side, at.VERGE, at.KERB_HEIGHT, drop, 5.0)
        kerbs.append(ground.add(kerb))
        verges.append(ground.add(verge))
        walks.append(
            ground.add(polygon.band(kerb_line, [side * at.VERGE, side * at.WALK], np.full(2, at.KERB_HEIGHT), 1.2))
        )
        across = [side * d for d in (at.WALK, 12.0, GARDEN)]
        gardens.append(
            ground.add(polygon.band(kerb_line, across, np.array([at.KERB_HEIGHT, at.KERB_HEIGHT, at.KERB_HEIGHT]), 7.0))
        )
        for d in [*drives, at.CROSSING]:
            pads.append(ground.add(_apron(kerb_line, drop, s, d, side)))
    for lot in p.lots:
        pads.append(ground.add(_drive(p, lot)))
        pads.append(ground.add(_path(p, lot)))
    kit.add("kerbs_street", merge(kerbs), "kerb_stone")
    kit.add("verges_grass", merge(verges), "lawn")
    kit.add("walks_slabs", merge(walks), "paving_slabs")
    kit.add("gardens_lawn", merge(gardens), "lawn")
    kit.add("pads_paved", merge(pads), "setts" if p.variant % 2 else "paving_slabs")
    kit.add("terrain_far", far_field(1500.0, p.variant + 16, -0.5, 20.0), "lawn", 0.5)
    kit.instance("pavements", "SideWalks", ["kerbs_street", "walks_slabs", "pads_paved"])
    kit.instance("gardens", "Terrain", ["verges_grass", "gardens_lawn", "terrain_far"])
    _details(kit, p)
    return ground


def _stations(p: Plan) -> Array:
    """Return arc lengths 2 m apart, with closer ones where a kerb is lowered."""
    marks = [at.CROSSING, *(lot.drive for lot in p.lots)]
    fine = [m + d for m in marks for d in (-2.5, -1.9, -at.DRIVE_HALF, 0.0, at.DRIVE_HALF, 1.9, 2.5)]
    s = np.unique(np.round(np.concatenate([np.arange(at.START, at.STOP + 1e-9, 2.0), fine]), 3))
    return s[np.r_[True, np.diff(s) > 0.05]]


def _apron(line: Array, drop: Array, s: Array, middle: float, side: int) -> Mesh:
    """Return the paved way over the verge, `PAD` above it at the same points."""
    near = np.abs(s - middle) <= at.DRIVE_HALF + 0.06
    part, left = line[near], drop[near]
    ramp = min(1.0, 0.5 * (0.15 + at.VERGE))
    level = np.full(len(part), at.KERB_HEIGHT)
    heights = np.stack([at.KERB_HEIGHT * left, level, level], 1) + PAD
    return _cut(polygon.band(line, [side * d for d in (0.16, ramp, at.VERGE)], _spread(heights, near), 1.2), near)


def _spread(heights: Array, chosen: npt.NDArray[np.bool_]) -> Array:
    full = np.zeros((len(chosen), heights.shape[1]))
    full[chosen] = heights
    return full


def _cut(part: Mesh, rows: npt.NDArray[np.bool_]) -> Mesh:
    """Return the faces of a strip of three columns whose corners all lie in the chosen rows."""
    row = np.arange(len(part.vertices)) // 3
    faces = part.faces[np.all(rows[row[part.faces]], axis=1)]
    used, index = np.unique(faces, return_inverse=True)
    assert part.uv is not None
    return Mesh(part.vertices[used], index.reshape(-1, 3), part.uv[used])


def _patch(p: Plan, s: tuple[float, float], offsets: tuple[float, float], tile: float = 1.2) -> Mesh:
    """Return a paved patch between two arc lengths and two offsets, `PAD` above the gardens."""
    points = p.way.point(
        np.array([s[0], s[1], s[1], s[0]]), np.array([offsets[0], offsets[0], offsets[1], offsets[1]])
    )[:, :2]
    return polygon.sheet(points, at.KERB_HEIGHT + PAD, tile)


def _drive(p: Plan, lot: at.Lot) -> Mesh:
    inner = p.pavement(lot.side)
    stop = inner + lot.side * (lot.setback + 1.3)
    return _patch(p, (lot.drive - at.DRIVE_HALF, lot.drive + at.DRIVE_HALF), (inner, stop))


def _path(p: Plan, lot: at.Lot) -> Mesh:
    """Return the path from the footway to the door."""
    inner = p.pavement(lot.side)
    return _patch(p, (lot.door - 0.6, lot.door + 0.6), (inner, inner + lot.side * (lot.setback - 0.9)))


def _details(kit: SceneKit, p: Plan) -> None:
    """Add the line of the parking lane, manhole covers and gully grates."""
    s = _stations(p)
    edge = p.way.point(s, at.PARKING_EDGE)[:, :2]
    kit.add("marking_parking", polygon.stripes(edge, 1.0, 1.0, 0.1, MARK), "marking_worn")
    kit.instance("road_markings", "RoadLine", ["marking_parking"])
    if p.variant:
        surfaces = [LaneSurface.along(p.way, s, side * at.LANE, 2.7) for side in (-1.0, 1.0)]
        add_wear(kit, surfaces, np.random.default_rng([p.variant, 20]), "town")
    if kit.is_light:
        return
    covers, grates = [], []
    for number, along in enumerate(np.arange(at.START + 9.0, at.STOP - 5.0, 23.0)):
        place, yaw = p.way.place(float(along), (0.4, -1.9)[number % 2])
        covers.append(garden.manhole_cover().moved(place))
        for offset in (at.KERB_RIGHT + 0.24, at.KERB_LEFT - 0.24):
            place, yaw = p.way.place(float(along) + 7.0, offset)
            grates.append(garden.gully_grate().moved(place, np.radians(yaw)))
    kit.add("manholes_covers", merge(covers), "manhole")
    kit.add("manholes_grates", merge(grates), "iron_dark")
    kit.instance("manhole_covers", "Static", ["manholes_*"])


def walkways(p: Plan) -> dict[str, Array]:
    """Return the ways of people on foot by name, in plan: both footways, and where they cross."""
    ways, nodes = {}, {}
    for side, name in ((1, "left"), (-1, "right")):
        offset = p.kerb(side) + side * 0.5 * (at.VERGE + at.WALK)
        nodes[name] = p.way.point(np.array(at.CROSSING), offset)[:2]
        pieces = split_near(p.way.line(at.START + 2.0, at.STOP - 2.0, offset, 1.0), nodes[name][None])
        ways[f"walk_{name}_a"], ways[f"walk_{name}_b"] = pieces
    ways["cross"] = np.array([nodes["right"], nodes["left"]])
    return ways
