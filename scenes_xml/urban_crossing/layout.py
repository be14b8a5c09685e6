"""Where things are, for each variant: the street's cross-section, its crossing, and how cars and people move.

x runs along the street, y to the left, from the middle of the ego's lane [m].
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..generators.geometry.mesh import Array
from ..generators.roads.road import RoadCurve
from ..generators.scene_toml import Lane, Parking

SEED = 100
STREET = RoadCurve(bend_start=1e6, bend_stop=1e6 + 1.0)
"""A straight one."""
START, STOP = -70.0, 150.0
LANE_LEFT = 3.25
KERB_LEFT, KERB_RIGHT = 4.9, -3.9
PARKING = -1.75
"""Right edge of the ego's lane; parked cars stand from here to the kerb."""
BAY = 0.5 * (KERB_RIGHT + PARKING)
"""Middle of a parking place."""
WALL_LEFT, WALL_RIGHT = 8.4, -7.4
KERB_HEIGHT = 0.12
DROPPED = 0.15
"""Share of the kerb's height that is left at the crossing; the ramp behind it is `RAMP` [m] long."""
RAMP = 0.15, 0.95
ZEBRA = (20.0, 24.0)
"""The crossing of variant 0; in the others everything about it is moved along the street by `Layout.shift`."""
TIMES = np.arange(0.0, 8.0 + 1e-9, 0.25)


@dataclass(frozen=True)
class CarPlan:
    """A car: x over time, its lane, heading [deg] and paint.

    `model` and its colours are those of scenes_xml/actors, where the car is not of meshes of its own (`shape`).
    """

    name: str
    shape: str
    x: Array
    y: float
    yaw_deg: float
    paint: str
    model: str = ""
    colours: str | None = None


@dataclass(frozen=True)
class WalkerPlan:
    """A person who walks straight on: where it is at time 0, velocity [m/s], phase of the gait [cycles].

    `model` and its colours are those of scenes_xml/actors.
    """

    name: str
    start: tuple[float, float]
    velocity: tuple[float, float]
    phase: float
    model: str
    colours: str


@dataclass(frozen=True)
class TreePlan:
    """A street tree: its kind, place [m], turn [deg] and scale."""

    kind: str
    x: float
    y: float
    turn: float
    scale: float


@dataclass(frozen=True)
class Layout:
    """All that a variant changes."""

    variant: int
    shift: float
    walls: tuple[float, float]
    surfaces: tuple[str, ...]
    roofs: tuple[str, ...]
    doors: tuple[str, ...]
    lamps: float
    benches: tuple[tuple[float, float, float], ...]
    trees: tuple[TreePlan, ...]
    cars: tuple[CarPlan, ...]
    parked: tuple[CarPlan, ...]
    walkers: tuple[WalkerPlan, ...]
    works: float | None = None
    """Middle of the parking place that works close [m]."""

    @property
    def seed(self) -> int:
        """Return the seed of houses and trees."""
        return SEED + self.variant

    @property
    def zebra(self) -> tuple[float, float]:
        """Return where the crossing begins and ends [m]."""
        return ZEBRA[0] + self.shift, ZEBRA[1] + self.shift

    @property
    def bays(self) -> Array:
        """Return the middles of the parking places at the right kerb [m]."""
        return _bays(self.shift)


def _bays(shift: float) -> Array:
    return np.round(np.concatenate([np.arange(-13.7, 13.0, 6.6), np.arange(31.8, 60.0, 6.4)]) + shift, 3)


def _stopping(speed: float, distance: float, begin: float) -> Array:
    """Return the way of a car that brakes from `speed` to rest over `distance`, beginning at `begin` [s], smoothly."""
    duration = 2.0 * (distance - speed * begin) / speed
    u = np.clip((TIMES - begin) / duration, 0.0, 1.0)
    return speed * np.minimum(TIMES, begin) + speed * duration * (u - u**3 + 0.5 * u**4)


CARS = (
    CarPlan("ego", "ego", _stopping(8.0, 16.2, 0.25), 0.0, 0.0, "car_paint_blue", "saloon", "blue"),
    CarPlan("car_ahead", "car_ahead", 33.0 + 8.5 * TIMES, 0.0, 0.0, "car_paint_silver", "suv", "grey"),
    CarPlan("oncoming", "oncoming", 50.0 - _stopping(7.0, 21.5, 1.0), LANE_LEFT, 180.0, "car_paint_red", "estate",
            "white"),
)  # fmt: skip # a table


def _parked(number: int, shape: str, x: float, paint: str, model: str, colours: str | None) -> CarPlan:
    """Return a car that stands in a parking place at the right kerb."""
    return CarPlan(f"parked_{number}", shape, np.array([x]), BAY, 0.0, paint, model, colours)


PARKED = (
    _parked(0, "oncoming", -14.0, "car_paint_silver", "estate", "grey"),
    _parked(1, "ego", -7.5, "car_paint_white", "saloon", "white"),
    _parked(2, "car_ahead", 6.5, "car_paint_red", "suv", "red"),
    _parked(3, "oncoming", 13.2, "car_paint_green", "estate", "green"),
    _parked(4, "ego", 32.0, "car_paint_silver", "saloon", "silver"),
    _parked(5, "car_ahead", 38.4, "car_paint_blue", "suv", "black"),
    _parked(6, "oncoming", 51.0, "car_paint_white", "estate", "white"),
)
"""Cars at the right kerb of variant 0."""

WALKERS = (
    WalkerPlan("walker_0", (21.1, -3.4), (0.0, 1.35), 0.10, "adult_man", "red"),
    WalkerPlan("walker_1", (22.0, -3.7), (0.0, 1.35), 0.55, "child", "yellow"),
    WalkerPlan("walker_2", (23.1, 8.0), (0.0, -1.20), 0.30, "adult_woman", "plum"),
    WalkerPlan("walker_3", (5.0, -5.9), (1.45, 0.0), 0.80, "adult_man", "olive"),
    WalkerPlan("walker_4", (36.0, 6.3), (-1.30, 0.0), 0.20, "adult_woman", "teal"),
)
FIRST = Layout(
    0,
    0.0,
    (WALL_LEFT, WALL_RIGHT),
    ("plaster_wall", "brick_wall", "plaster_yellow", "plaster_red", "plaster_wall", "plaster_grey"),
    ("roof_tile",),
    ("door_wood",),
    26.0,
    ((10.0, -6.9, 0.0), (31.0, 7.9, 180.0), (44.0, -6.9, 0.0)),
    tuple(
        TreePlan("tree", x, KERB_LEFT + 0.9, 37.0 * k, 0.9 + 0.05 * (k % 4))
        for k, x in enumerate((-25.0, -8.0, 8.0, 33.5, 48.0, 63.0, 78.0, 93.0))
    ),
    CARS,
    PARKED,
    WALKERS,
)
SURFACES = (
    "plaster_wall", "brick_wall", "plaster_yellow", "plaster_red", "plaster_grey", "facade_white", "facade_cream",
    "facade_rose", "facade_grey", "facade_brick", "facade_stone",
)  # fmt: skip # a table
VEHICLES = (
    ("suv", "white"), ("suv", "green"), ("estate", "green"), ("small_car", "yellow"), ("small_car", "red"),
    ("pickup", "orange"), ("van", None), ("saloon", "silver"), ("saloon", "red"), ("small_car", "blue"),
)  # fmt: skip # a table
"""Models and colours of the cars that a variant draws, those on their way and those at the kerb."""
STREET_TREES = {"tree": 0.97, "lime": 0.8, "plane": 0.58, "birch": 0.95}
"""Kinds with their scale: crowns between a head and the house behind."""
PEOPLE = (
    ("adult_man", "red"), ("adult_man", "grey"), ("adult_man", "olive"), ("adult_woman", "plum"),
    ("adult_woman", "camel"), ("adult_woman", "teal"), ("child", "yellow"), ("child", "pink"),
)  # fmt: skip # a table


def layout(variant: int = 0) -> Layout:
    """Return the layout of a variant."""
    if variant == 0:
        return FIRST
    g = np.random.default_rng([SEED, variant])
    shift = float(np.round(g.uniform(-4.0, 9.0), 1))
    walls = (float(np.round(g.uniform(8.4, 10.2), 1)), float(np.round(g.uniform(-9.2, -7.4), 1)))
    first = int(g.integers(0, len(VEHICLES)))
    (ahead, ahead_colours), (other, other_colours) = (VEHICLES[(first + k) % len(VEHICLES)] for k in (0, 3))
    speed, back = float(g.uniform(7.0, 8.5)), float(g.uniform(6.0, 7.5))
    gap, far = float(g.uniform(30.0, 38.0)) + shift, float(g.uniform(46.0, 58.0)) + shift
    away = far - (28.5 + shift)
    cars = (
        CarPlan("ego", "", _stopping(speed, 16.2 + shift, 0.25), 0.0, 0.0, "", "saloon",
                str(g.choice(("blue", "silver", "red", "white", "black")))),
        CarPlan("car_ahead", "", gap + float(g.uniform(7.5, 9.5)) * TIMES, 0.0, 0.0, "", ahead, ahead_colours),
        CarPlan("oncoming", "", far - _stopping(back, away, 0.5), LANE_LEFT, 180.0, "", other, other_colours),
    )  # fmt: skip # a table
    taken = [float(bay) for bay in _bays(shift) if g.uniform() < 0.65]
    return Layout(
        variant,
        shift,
        walls,
        tuple(str(name) for name in g.permutation(SURFACES)[: int(g.integers(4, 8))]),
        tuple(str(name) for name in g.permutation(("roof_tile", "tiles_red", "tiles_dark"))[: int(g.integers(1, 4))]),
        tuple(str(name) for name in g.permutation(("door_wood", "door_green", "door_red"))[: int(g.integers(1, 4))]),
        float(np.round(g.uniform(20.0, 32.0), 0)),
        tuple((float(np.round(x + shift + g.uniform(-2.0, 2.0), 1)), y, yaw) for x, y, yaw in FIRST.benches),
        _trees(g, shift),
        cars,
        tuple(_parked(k, "", x, "", *VEHICLES[(first + 1 + k) % len(VEHICLES)]) for k, x in enumerate(taken)),
        _walkers(g, shift),
        _works(variant, [float(bay) for bay in _bays(shift) if float(bay) not in taken]),
    )


def _works(variant: int, free: list[float]) -> float | None:
    """Return the parking place that works close, one of the free ones, in every second variant or so."""
    g = np.random.default_rng([SEED, variant, 5])
    return float(g.choice(free)) if free and g.uniform() < 0.5 else None


def _trees(g: np.random.Generator, shift: float) -> tuple[TreePlan, ...]:
    """Return street trees of one or two kinds on the left; none where people cross."""
    kinds = [str(kind) for kind in g.permutation(sorted(STREET_TREES))[: int(g.integers(1, 3))]]
    step = float(np.round(g.uniform(13.0, 19.0), 1))
    places = np.arange(-60.0 + float(np.round(g.uniform(0.0, 8.0), 1)), 130.0, step)
    low, high = ZEBRA[0] + shift - 4.5, ZEBRA[1] + shift + 4.5
    trees = []
    for x in places:
        kind, scale = str(g.choice(kinds)), float(g.uniform(0.94, 1.08))
        turn = float(np.round(g.uniform(0.0, 360.0), 0))
        if not low < x < high:
            scale = float(np.round(scale * STREET_TREES[kind], 2))
            trees.append(TreePlan(kind, round(float(x), 2), KERB_LEFT + 0.9, turn, scale))
    return tuple(trees)


def _walkers(g: np.random.Generator, shift: float) -> tuple[WalkerPlan, ...]:
    """Return three people on the crossing and two on the pavements."""
    chosen = [PEOPLE[k] for k in g.permutation(len(PEOPLE))[:5]]
    right, left = float(g.uniform(-5.6, -3.2)), float(g.uniform(6.6, 8.0))
    fast, slow = float(g.uniform(1.15, 1.45)), -float(g.uniform(1.0, 1.3))
    ways = (
        ((21.1, right), (0.0, fast)),
        ((22.0, right - float(g.uniform(0.2, 0.9))), (0.0, fast)),
        ((23.1, left), (0.0, slow)),
        ((float(g.uniform(0.0, 8.0)), -5.9), (float(g.uniform(1.2, 1.5)), 0.0)),
        ((float(g.uniform(37.0, 46.0)), 6.3), (-float(g.uniform(1.1, 1.4)), 0.0)),  # late for those who cross
    )
    return tuple(
        WalkerPlan(f"walker_{k}", (x + shift, y), velocity, 0.0, *person)
        for k, (((x, y), velocity), person) in enumerate(zip(ways, chosen, strict=True))
    )


def ground(y: float) -> float:
    """Return the height of the street at y: carriageway or pavement [m]."""
    return KERB_HEIGHT if y > KERB_LEFT or y < KERB_RIGHT else 0.0


def _smooth(share: Array) -> Array:
    u = np.clip(share, 0.0, 1.0)
    return u * u * (3.0 - 2.0 * u)


def crossing_height(y: Array) -> Array:
    """Return the height of a foot on its way over the dropped kerbs [m]: a low step, then a ramp."""
    over = np.maximum(y - KERB_LEFT, KERB_RIGHT - y)
    low = DROPPED * KERB_HEIGHT
    return low * _smooth(over / 0.4 + 0.5) + (KERB_HEIGHT - low) * _smooth((over - RAMP[0]) / (RAMP[1] - RAMP[0]))


def walker_positions(plan: WalkerPlan, times: Array) -> Array:
    """Return positions over `times` on the ground, shape (n, 3) [m]."""
    x, y = (np.array(plan.start)[:, None] + np.array(plan.velocity)[:, None] * times)[:2]
    return np.stack([x, y, np.full_like(y, KERB_HEIGHT) if plan.velocity[0] else crossing_height(y)], 1)


def lanes(plan: Layout) -> list[Lane]:
    """Return the lanes of vehicles, those of both pavements, and the way across the street."""
    x = np.arange(START + 4.0, STOP - 4.0 + 1e-9, 2.0)
    y = np.arange(-5.7, 6.9 + 1e-9, 0.2)
    right, left = (np.stack([x, np.full_like(x, side), np.full_like(x, KERB_HEIGHT)], 1) for side in (-5.7, 6.9))
    across = np.stack([np.full_like(y, 0.5 * sum(plan.zebra)), y, crossing_height(y)], 1)
    road = np.stack([x, 0.0 * x, 0.0 * x], 1)
    return [
        Lane("right", road, "drive", LANE_LEFT),
        Lane("left", road[::-1] + [0.0, LANE_LEFT, 0.0], "drive", LANE_LEFT),
        Lane("walk_right", right, "walk", 1.6, 1.4),
        Lane("walk_left", left[::-1], "walk", 1.6, 1.4),
        Lane("zebra", across, "walk", ZEBRA[1] - ZEBRA[0], 1.4),
    ]


def parking(plan: Layout) -> list[Parking]:
    """Return the parking places at the right kerb; variant 0 has none, its cars stand there for good."""
    if plan.variant == 0:
        return []
    free = plan.bays if plan.works is None else plan.bays[plan.bays != plan.works]
    return [Parking((float(x), BAY, 0.0), 0.0, 6.0, PARKING - KERB_RIGHT) for x in free]
