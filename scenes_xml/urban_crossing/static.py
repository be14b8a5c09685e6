"""The street, its pavements and markings, and the rows of houses."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..generators.buildings import building
from ..generators.geometry.mesh import Mesh, box, grid, merge
from ..generators.kit import SceneKit
from ..generators.roads import road
from . import layout as at
from .layout import STREET, Layout

MARKING_HEIGHT = 0.004
PLAIN = ("frames", "panes", "doors")
"""Parts of a house without a texture."""


def add_street(kit: SceneKit, plan: Layout) -> None:
    """Add carriageway, kerbs, pavements, markings and the ground under the houses."""
    zebra, shift = plan.zebra, plan.shift
    s = np.arange(at.START, at.STOP + 1e-9, 2.0)
    d = np.array([at.KERB_RIGHT, at.PARKING, 0.0, 1.625, at.LANE_LEFT, at.KERB_LEFT])
    street = road.strip(STREET, s, d, np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0]))
    span = at.KERB_LEFT - at.KERB_RIGHT
    u = np.broadcast_to((d - at.KERB_RIGHT) / span, (len(s), len(d)))
    v = np.broadcast_to(s[:, None] / span, (len(s), len(d)))
    kit.add("road_asphalt", Mesh(street.vertices, street.faces, np.stack([u, v], -1).reshape(-1, 2)), "asphalt_street")
    left, right = plan.walls
    for side, kerb, wall in (("left", at.KERB_LEFT, left + 0.6), ("right", at.KERB_RIGHT, right - 0.6)):
        _add_pavement(kit, plan, side, s, kerb, wall)
    stripes = [
        box((zebra[1] - zebra[0], 0.5, 2 * MARKING_HEIGHT), (np.mean(zebra), y, 0.0))
        for y in np.arange(at.KERB_RIGHT + 0.55, at.KERB_LEFT - 0.2, 1.0)
    ]
    lines = [box((0.4, 3.1, 2 * MARKING_HEIGHT), (zebra[0] - 1.2, -0.1, 0.0))]
    lines.append(box((0.4, 3.0, 2 * MARKING_HEIGHT), (zebra[1] + 1.2, at.LANE_LEFT, 0.0)))
    kit.add("marking_zebra", merge(stripes), "road_marking")
    kit.add("marking_stop", merge(lines), "road_marking")
    starts = np.concatenate([np.arange(at.START + 2.0, 14.0 + shift, 6.0), np.arange(28.0 + shift, at.STOP - 4.0, 6.0)])
    kit.add("marking_centre", road.dashes(STREET, starts, 3.0, 1.625, 0.12, MARKING_HEIGHT), "road_marking")
    bays = [
        box((0.1, 2.0, 2 * MARKING_HEIGHT), (x + shift, -2.85, 0.0))
        for x in (*np.arange(-17.0, 17.0, 6.6), *np.arange(28.6, 62.0, 6.4))
    ]
    kit.add("marking_parking", merge(bays), "road_marking")
    corners = np.array(
        [
            [(at.START - 60.0, -60.0, -0.3), (at.START - 60.0, 60.0, -0.3)],
            [(at.STOP + 60.0, -60.0, -0.3), (at.STOP + 60.0, 60.0, -0.3)],
        ]
    )
    kit.add("ground_far", grid(corners, corners[..., :2] / 3.0), "paving")
    kit.instance("road", "Roads", ["road_asphalt"])
    kit.instance("road_markings", "RoadLine", ["marking_*"])
    kit.instance("pavements", "SideWalks", ["pavement_*", "kerb_*"])
    kit.instance("ground_far", "Ground", ["ground_far"])


def _add_pavement(kit: SceneKit, plan: Layout, side: str, s: np.ndarray, kerb: float, wall: float) -> None:
    """Add kerb stones, dropped at the crossing, and the slabs up to the houses."""
    zebra = plan.zebra
    sign = np.sign(kerb)
    near = np.linspace(zebra[0] - 2.0, zebra[1] + 2.0, 33)
    fine = np.unique(np.round(np.concatenate([s, near]), 6))  # no slivers, which would leave a gap
    middle, half = np.mean(zebra), (zebra[1] - zebra[0]) / 2 + 0.3
    drop = 1.0 - np.clip((half + 1.0 - np.abs(fine - middle)) / 1.0, 0.0, 1.0) * (1.0 - at.DROPPED)
    across = kerb + sign * np.array([0.0, 0.004, 0.02, at.RAMP[0]])
    heights = at.KERB_HEIGHT * drop[:, None] * np.array([0.0, 0.75, 1.0, 1.0])
    heights[:, 0] = -0.1
    order = np.argsort(across)
    kit.add(f"kerb_{side}", road.strip(STREET, fine, across[order], heights[:, order], (1.0, 1.0)), "concrete_grey")
    across = np.array([kerb + sign * at.RAMP[0], kerb + sign * at.RAMP[1], wall])
    heights = np.stack(
        [at.KERB_HEIGHT * drop, np.full(len(fine), at.KERB_HEIGHT), np.full(len(fine), at.KERB_HEIGHT)], 1
    )
    order = np.argsort(across)
    kit.add(f"pavement_{side}", road.strip(STREET, fine, across[order], heights[:, order], (1.2, 1.2)), "paving")


def houses(plan: Layout) -> Iterator[tuple[str, building.House, str, float, tuple[float, float, float]]]:
    """Yield name, measures, material of the walls, turn [deg] and place of the houses on both sides and at the end."""
    generator = np.random.default_rng(plan.seed)
    gap = 0.02 if plan.variant else 0.0  # between houses, so that no two walls lie in one plane
    number = 0
    for side, wall, turn in (("left", plan.walls[0], 0.0), ("right", plan.walls[1], 180.0)):
        x = at.START + (0.0 if side == "left" else -5.0)
        while x < at.STOP:
            width = float(np.round(generator.uniform(9.0, 14.0), 1))
            storeys = int(generator.integers(2, 5))
            surface = plan.surfaces[number % len(plan.surfaces)]
            shape = _town_house(width, storeys, generator, _tile(surface))
            offset = (round(x + width / 2, 3), round(wall + np.sign(wall) * 5.0, 3), at.KERB_HEIGHT)
            yield f"house_{side}_{number:02d}", shape, surface, turn, offset
            x += width + gap + (0.0 if generator.uniform() < 0.85 else 3.0)
            number += 1
    surface = plan.surfaces[1]
    shape = _town_house(15.0, 4, generator, _tile(surface))
    yield "house_end", shape, surface, -90.0, (at.STOP + 6.0, 0.5, 0.0)


def _tile(surface: str) -> float:
    """Return the size of a tile of a wall's texture [m]."""
    return 1.5 if surface == "brick_wall" else 3.0


def house_parts(plan: Layout, shape: building.House) -> dict[str, Mesh]:
    """Return the parts of a house; where it is not of variant 0 no pane ends in the plane of a bar."""
    parts = building.house(shape)
    if plan.variant:
        for name in PLAIN:
            lift = 0.001 if name == "panes" else 0.0
            parts[name] = Mesh(parts[name].vertices + [0.0, 0.0, lift], parts[name].faces)
    return parts


def _town_house(width: float, storeys: int, generator: np.random.Generator, texture_size: float) -> building.House:
    """Return a terraced house with regular windows to the street and the yard and a door to the street."""
    eaves = 0.6 + 3.1 * storeys + float(np.round(generator.uniform(-0.2, 0.2), 2))
    overhang = float(np.round(generator.uniform(0.24, 0.36), 3))  # so that no two roofs have a face in one plane
    columns = max(3, int(width // 2.6))
    along = (np.arange(columns) - (columns - 1) / 2) * (width - 1.2) / columns
    door = int(generator.integers(0, columns))
    windows = []
    for storey in range(storeys):
        for column, y in enumerate(along):
            if storey > 0 or column != door:
                windows.append(("front", float(round(y, 3)), 1.0 + 3.1 * storey, 1.15, 1.6))
            if storey % 2 == 0 and column % 2 == 0:
                windows.append(("back", float(round(y, 3)), 1.0 + 3.1 * storey, 1.1, 1.4))
    ridge = eaves + float(np.round(generator.uniform(2.6, 3.8), 1))
    return building.House(
        width,
        10.0,
        eaves,
        ridge,
        windows,
        [("front", float(round(along[door], 3)), 1.15, 2.3)],
        overhang,
        texture_size,
        bool(generator.uniform() < 0.7),
    )
