"""Everything beside the road that is an object of its own: signs, posts, lamps, buildings, plants."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

import numpy as np

from ..generators.buildings import building
from ..generators.geometry.mesh import Array, Mesh
from ..generators.plants import vegetation
from ..generators.roads import road
from ..generators.roadside import furniture
from ..generators.scene_toml import Instance
from ..generators.xml import Placement
from . import layout as at
from .layout import CURVE, SEED

WriteMesh = Callable[..., str]
Group = tuple[list[Placement], Instance]


def ground_height(s: float, offset: float) -> float:
    """Return the height of the ground [m] beside the pavement."""
    edge = at.PAVEMENT_RIGHT if offset < 0 else at.PAVEMENT_LEFT
    return float(road.verge_heights(CURVE, np.array([s]), np.array([offset]), edge, SEED + 5)[0, 0])


def _pose(s: float, offset: float, turn_deg: float = 0.0) -> tuple[float, tuple[float, float, float]]:
    """Return yaw [deg] and place of a thing that looks along the road at arc length `s`."""
    x, y, _ = CURVE.point(np.array(s), offset)
    yaw = float(np.degrees(CURVE.heading(np.array(s)))) + turn_deg
    return round(yaw, 4), (round(float(x), 4), round(float(y), 4), round(ground_height(s, offset), 4))


class Kit:
    """Meshes written once, to be placed many times."""

    def __init__(
        self, write: WriteMesh, prefix: str, parts: Mapping[str, Mesh], bsdfs: Mapping[str, str], crease: float = 40.0
    ) -> None:
        self.files = {part: write(f"{prefix}_{part}", mesh, crease) for part, mesh in parts.items()}
        self.bsdfs = bsdfs

    def place(
        self, name: str, semantic: str, s: float, offset: float, turn_deg: float = 0.0, scale: float = 1.0, **bsdfs: str
    ) -> Group:
        """Return the shapes and the instance of one copy; `bsdfs` replaces the material of a part."""
        yaw, where = _pose(s, offset, turn_deg)
        shapes = [
            Placement(f"{name}_{part}", file, bsdfs.get(part, self.bsdfs[part]), yaw, where, scale)
            for part, file in self.files.items()
        ]
        return shapes, Instance(name, semantic, tuple(p.shape for p in shapes), True)


def everything(write: WriteMesh) -> Iterator[Group]:
    """Yield the shapes and the instance of every object beside the road."""
    yield from _posts(write)
    yield from _signs(write)
    yield from _lamps_and_barriers(write)
    yield from _buildings(write)
    yield from _trees(write)
    yield from _fields(write)


def _posts(write: WriteMesh) -> Iterator[Group]:
    bsdfs = {"post": "white_plastic", "band": "black_plastic", "reflector": "reflector"}
    kit = Kit(write, "delineator", furniture.delineator(), bsdfs)
    for k, s in enumerate(np.arange(-50.0, 151.0, 25.0)):
        right = -4.45 if at.RAIL_START - 2 < s < at.RAIL_STOP + 2 else at.PAVEMENT_RIGHT - 0.6
        yield kit.place(f"delineator_right_{k:02d}", "Pole", float(s), right)
        yield kit.place(f"delineator_left_{k:02d}", "Pole", float(s), at.PAVEMENT_LEFT + 0.6, 180.0)


def _signs(write: WriteMesh) -> Iterator[Group]:
    metal = {"back": "sign_back", "pole": "galvanized_steel"}
    bend = Kit(write, "sign_triangle", furniture.sign("triangle"), {"face": "sign_bend", **metal})
    speed = Kit(write, "sign_round", furniture.sign("round"), {"face": "sign_speed", **metal})
    board = Kit(write, "sign_board", furniture.sign("board", 1.45), {"face": "sign_chevron", **metal})
    yield bend.place("sign_bend", "TrafficSign", 15.0, -5.0, 4.0)
    yield speed.place("sign_speed", "TrafficSign", 24.0, -5.0, 4.0)
    yield speed.place("sign_speed_left", "TrafficSign", 27.0, 8.2, 184.0)
    for k, s in enumerate((50.0, 64.0, 78.0, 94.0)):
        yield board.place(f"sign_chevron_{k}", "TrafficSign", s, -5.3, 14.0)


def _lamps_and_barriers(write: WriteMesh) -> Iterator[Group]:
    bsdfs = {"pole": "galvanized_steel", "head": "sign_back", "glass": "lamp_glass"}
    lamp = Kit(write, "lamp", furniture.lamp_post(), bsdfs)
    for k, s in enumerate((-30.0, 34.0, 72.0, 112.0)):
        yield lamp.place(f"lamp_{k}", "Pole", s, -5.6)
    barrier = Kit(write, "barrier", {"concrete": furniture.barrier()}, {"concrete": "concrete_grey"})
    for k in range(3):
        yield barrier.place(f"barrier_{k}", "Wall", 60.0 + 6.6 * k, at.PAVEMENT_LEFT + 1.0)


def _buildings(write: WriteMesh) -> Iterator[Group]:
    bsdfs = {
        "walls": "plaster_wall",
        "roof": "roof_tile",
        "frames": "painted_wood",
        "panes": "window_pane",
        "doors": "door_wood",
    }
    openings = [
        (side, y, z, 1.1, 1.35) for side in ("front", "back") for y in (-4.6, -2.3, 2.3, 4.6) for z in (1.0, 3.75)
    ]
    openings += [(side, y, z, 1.0, 1.35) for side in ("left", "right") for y in (-2.0, 2.0) for z in (1.0, 3.75)]
    openings += [(side, 0.0, 6.1, 0.9, 1.0) for side in ("left", "right")]
    openings += [(side, 0.0, 3.75, 1.1, 1.35) for side in ("front", "back")]
    house = building.House(12.0, 8.5, 5.6, 9.2, openings, [("front", 0.0, 1.1, 2.2), ("back", 0.0, 1.1, 2.2)])
    yield Kit(write, "house", building.house(house), bsdfs).place("house", "Building", 47.0, -23.0, 12.0)
    high = [(side, y, 3.2, 1.6, 0.8) for side in ("front", "back") for y in (-8.0, -4.8, 4.8, 8.0)]
    barn = building.House(
        22.0, 11.0, 4.8, 8.6, high, [("front", 0.0, 3.6, 3.6), ("left", 0.0, 3.2, 3.4)], 0.6, 2.0, chimney=False
    )
    yield Kit(write, "barn", building.house(barn), {**bsdfs, "walls": "brick_wall"}).place(
        "barn", "Building", 42.0, 34.0, 28.0
    )


def _trees(write: WriteMesh) -> Iterator[Group]:
    bsdfs = {"trunk": "bark", "core": "leaves_shade", "leaves": "leaves"}
    tall = Kit(write, "tree_a", vegetation.tree(vegetation.TreeShape(9.5, 3.3, 2.4), SEED + 3), bsdfs, 60.0)
    broad = Kit(
        write, "tree_b", vegetation.tree(vegetation.TreeShape(7.0, 3.0, 1.9, 0.14, 14, 3600), SEED + 4), bsdfs, 60.0
    )
    places = (
        (tall, 30.0, -12.5, 10.0, 1.0),
        (broad, 39.5, -14.5, 75.0, 0.9),
        (tall, 66.0, -15.0, 200.0, 1.1),
        (broad, 84.0, -12.0, 140.0, 1.0),
        (broad, 22.0, 16.5, 30.0, 1.0),
        (tall, 33.0, 19.5, 260.0, 1.05),
        (tall, 60.0, 17.0, 120.0, 0.95),
        (broad, -18.0, -13.0, 300.0, 1.1),
        (tall, -28.0, 14.0, 80.0, 1.0),
    )
    for k, (kit, s, offset, turn, scale) in enumerate(places):
        yield kit.place(f"tree_{k:02d}", "Vegetation", s, offset, turn, scale)


def _road_distance(x: Array, y: Array) -> Array:
    line = CURVE.point(np.arange(-180.0, 390.0, 6.0))
    return np.min(np.hypot(x[:, None] - line[:, 0], y[:, None] - line[:, 1]), axis=1)


def _fields(write: WriteMesh) -> Iterator[Group]:
    """Yield far woods and the grass tufts of the verges."""
    generator = np.random.default_rng(SEED + 8)
    angle, r = generator.uniform(0, 2 * np.pi, 700), generator.uniform(150.0, 330.0, 700)
    x, y = r * np.cos(angle), r * np.sin(angle)
    clumps = road.smooth_noise(x, y, SEED + 9, wavelength=90.0)
    clumps[_road_distance(x, y) < 84.0] = -np.inf
    keep = np.sort(np.argsort(-clumps, kind="stable")[:120])
    feet = np.column_stack([x, y, road.far_height(x, y, SEED + 6) - 0.6])[keep]
    forest = vegetation.woods(feet, generator.uniform(9.0, 16.0, len(keep)), SEED + 10)
    shapes = [
        Placement(f"woods_{p}", write(f"woods_{p}", m, 80.0), "leaves_shade" if p == "core" else "leaves")
        for p, m in forest.items()
    ]
    yield shapes, Instance("woods", "Vegetation", ("woods_*",), False)
    count = 1350
    s = generator.uniform(-12.0, 85.0, count)
    distance = at.GRAVEL + 0.05 + 7.0 * generator.uniform(0, 1, count) ** 1.7
    right = generator.uniform(0, 1, count) < 0.6
    offset = np.where(right, at.PAVEMENT_RIGHT - distance, at.PAVEMENT_LEFT + distance)
    height = np.array([ground_height(float(a), float(b)) for a, b in zip(s, offset, strict=True)])
    points = CURVE.point(s, offset, height)
    dry = generator.uniform(0, 1, count) < 0.3
    for name, chosen, bsdf in (("green", ~dry, "grass_blades"), ("dry", dry, "grass_dry")):
        file = write(f"tufts_{name}", vegetation.tufts(points[chosen], SEED + 12 + int(name == "dry")))
        yield (
            [Placement(f"tufts_{name}", file, bsdf)],
            Instance(f"grass_tufts_{name}", "Vegetation", (f"tufts_{name}",), False),
        )
