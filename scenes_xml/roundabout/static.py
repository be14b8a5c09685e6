"""Ground of the roundabout: carriageway, kerbs, pavements, islands, markings and the land around."""

from __future__ import annotations

import numpy as np

from ..generators.geometry import polygon
from ..generators.geometry.mesh import Array, Mesh, box, grid, merge
from ..generators.kit import SceneKit
from ..generators.roads.ground import Ground, far_field
from ..generators.roads.walkways import split_near
from ..generators.roads.wear import LaneSurface, add_wear
from . import layout as at
from .layout import ARMS, Plan, turned

MARK = 0.004


def crossing_node(p: Plan, arm: int, side: int) -> Array:
    """Return where people wait at an arm's crossing: `side` +1 is where vehicles come in, -1 where they leave.

    Shape (2,).
    """
    middle = float(np.mean(p.zebra))
    return turned(
        np.array([middle, side * (float(at.arm_half_width(np.array(middle), p.outer)) + 1.2)]), p.directions[arm]
    )


def add_ground(kit: SceneKit, p: Plan) -> Ground:
    """Add everything flat, and return it as the ground that things stand on."""
    ground = Ground()
    kerbs = [at.block_kerb(p, number) for number in range(4)]
    kit.add("road_asphalt", ground.add(polygon.sheet(np.vstack(kerbs), 0.0, 4.0)), "asphalt_plain")
    kit.instance("road", "Roads", ["road_asphalt"])
    stones, slabs, lawns = [], [], []
    for number, line in enumerate(kerbs):
        drop = polygon.lowered(
            line, np.array([crossing_node(p, number, 1), crossing_node(p, (number + 1) % 4, -1)]), 2.6
        )
        kerb, pavement = polygon.kerb_and_pavement(line, -1, at.PAVEMENT, at.KERB_HEIGHT, drop)
        stones.append(ground.add(kerb))
        slabs.append(ground.add(pavement))
        inner = polygon.shifted(line, -at.PAVEMENT)
        first, second = (np.degrees(np.arctan2(*inner[k][::-1])) for k in (0, -1))
        second += 360.0 * np.ceil((first - second) / 360.0)
        angles = np.radians(np.linspace(second - 1.0, first + 1.0, 16))
        edge = 165.0 * np.column_stack([np.cos(angles), np.sin(angles)])
        lawns.append(ground.add(polygon.sheet(np.vstack([inner, edge]), at.KERB_HEIGHT, 11.0)))
    kit.add("kerbs_pavement", merge(stones), "kerb_stone")
    kit.add("pavements_slabs", merge(slabs), "paving_slabs")
    kit.add("lawns_blocks", merge(lawns), "lawn")
    kit.add("terrain_far", far_field(1500.0, p.variant + 6, -0.3), "lawn", 0.5)
    kit.instance("pavements", "SideWalks", ["kerbs_*", "pavements_*"])
    kit.instance("lawns", "Terrain", ["lawns_*"])
    kit.instance("ground_far", "Terrain", ["terrain_far"])
    _islands(kit, p, ground)
    _middle(kit, p, ground)
    _markings(kit, p)
    if p.variant:
        arms = [line for name, line in at.drive_lines(p).items() if name.endswith(("_in", "_out"))]
        lanes = [LaneSurface.level(line, 2.6) for line in arms]
        add_wear(kit, lanes, np.random.default_rng([p.variant, 20]), "town")
    return ground


def _islands(kit: SceneKit, p: Plan, ground: Ground) -> None:
    stones, tops = [], []
    for direction in p.directions:
        for outline in at.island_outlines(p):
            kerb, top = polygon.island(turned(outline, direction), at.KERB_HEIGHT, 0.12)
            stones.append(ground.add(kerb))
            tops.append(ground.add(top))
    kit.add("islands_kerbs", merge(stones), "kerb_stone")
    kit.add("islands_tops", merge(tops), "setts")
    kit.instance("islands", "SideWalks", ["islands_*"])


def mound_height(p: Plan, radius: Array) -> Array:
    """Return the height of the central island's lawn at a distance from the middle [m]."""
    edge = p.apron[0] - 0.25
    t = np.clip(1.0 - radius / edge, 0.0, 1.0)
    return 0.20 + 0.95 * t * t * (3 - 2 * t)


def _middle(kit: SceneKit, p: Plan, ground: Ground) -> None:
    """Add the paved apron, the kerb round the central island and its mound."""
    inner, outer = p.apron
    angle = np.linspace(0.0, 2 * np.pi, 97)

    def rings(profile: list[tuple[float, float]], tile: float) -> Mesh:
        r, z = np.array(profile).T
        points = np.stack(
            [r[:, None] * np.cos(angle), r[:, None] * np.sin(angle), np.tile(z[:, None], (1, len(angle)))], -1
        )
        points[:, -1] = points[:, 0]
        way = np.r_[0.0, np.cumsum(np.hypot(np.diff(r), np.diff(z)))]
        uv = np.stack(np.broadcast_arrays(outer * angle[None, :], way[:, None]), -1) / tile
        part = grid(points, uv)
        return part if _upward(part) else part.flipped()

    kit.add("apron_edge", rings([(outer, -0.08), (outer - 0.01, 0.03), (outer - 0.16, 0.045)], 1.0), "kerb_stone")
    kit.add("apron_setts", ground.add(rings([(outer - 0.16, 0.045), (inner, 0.075)], 1.2)), "setts")
    kit.add(
        "apron_kerb",
        rings([(inner, 0.0), (inner - 0.01, 0.17), (inner - 0.03, 0.20), (inner - 0.25, 0.20)], 1.0),
        "kerb_stone",
    )
    radii = np.linspace(0.0, 1.0, 12)[::-1] * (inner - 0.25)
    mound = [(float(max(r, 1e-3)), float(z)) for r, z in zip(radii, mound_height(p, radii), strict=True)]
    kit.add("mound_lawn", ground.add(_flat_uv(rings(mound, 1.0), 9.0)), "lawn", 60.0)
    kit.instance("apron", "SideWalks", ["apron_*"])
    kit.instance("mound", "Terrain", ["mound_lawn"])


def _upward(part: Mesh) -> bool:
    a, b, c = (part.vertices[part.faces[:, k]] for k in range(3))
    return bool(np.cross(b - a, c - a)[:, 2].sum() > 0.0)


def _flat_uv(part: Mesh, tile: float) -> Mesh:
    return Mesh(part.vertices, part.faces, part.vertices[:, :2] / tile)


def _markings(kit: SceneKit, p: Plan) -> None:
    near, far = p.zebra
    zebra, give_way, lines = [], [], []
    for direction in p.directions:
        width = float(at.arm_half_width(np.array(near), p.outer)) - 0.25
        for y in np.arange(-width + 0.25, width, 1.0):
            stripe = box((far - near - 0.3, 0.5, 2 * MARK), (0.5 * (near + far), float(y), 0.0))
            zebra.append(stripe.moved(yaw=np.radians(direction)))
        for angle in np.arange(6.0, 20.0, 700.0 / (np.pi * p.outer) / 10.0):
            give_way.append(_tooth(p.outer + 0.45, direction + angle))
        tip = far + 8.0
        x = np.linspace(tip + 0.8, at.REACH - 1.0, 60)
        lines.append(polygon.stripes(turned(np.column_stack([x, 0 * x]), direction), 3.0, 4.5, 0.12, MARK))
        for side in (-1.0, 1.0):
            x = np.linspace(tip - 0.4, tip + 12.0, 12)
            y = side * np.interp(x, [tip - 0.4, tip + 12.0], [0.55, 0.12])
            lines.append(polygon.stripe(turned(np.column_stack([x, y]), direction), 0.1, MARK))
        stripe = polygon.stripe(turned(np.array([(tip + 12.0, 0.0), (tip + 12.6, 0.0)]), direction), 0.3, MARK)
        lines.append(stripe)
    kit.add("marking_zebra", merge(zebra), "marking_worn")
    kit.add("marking_yield", merge(give_way), "marking_worn")
    kit.add("marking_lines", merge(lines), "marking_worn")
    kit.instance("road_markings", "RoadLine", ["marking_*"])


def _tooth(radius: float, angle_deg: float) -> Mesh:
    """Return a triangle of the give-way line: base towards the ring, tip towards who comes."""
    tooth = np.array([(radius, -0.25), (radius + 0.6, 0.0), (radius, 0.25)])
    return polygon.sheet(turned(tooth, angle_deg), MARK, 1.0)


def walkways(p: Plan) -> dict[str, Array]:
    """Return the ways of people on foot by name, in plan: along the pavements, and over each arm."""
    ways = {}
    for number, arm in enumerate(ARMS):
        following = (number + 1) % 4
        line = polygon.shifted(at.block_kerb(p, number), -1.2)[1:-1]
        nodes = np.array([crossing_node(p, number, 1), crossing_node(p, following, -1)])
        for name, piece in zip(("a", "b", "c"), split_near(line, nodes), strict=True):
            ways[f"walk_{arm}_{name}"] = piece
        ways[f"cross_{arm}"] = np.array([crossing_node(p, number, 1), crossing_node(p, number, -1)])
    return ways
