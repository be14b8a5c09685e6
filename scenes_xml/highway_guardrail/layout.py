"""Where things are, for each variant: the road's cross-section, its bend, what stands beside it, the actors.

Offsets are measured from the middle of the ego's lane, positive to the left [m].
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..generators.plants.species import COUNTRY, KINDS
from ..generators.roads.road import RoadCurve
from ..generators.scene_toml import Lane

SEED = 0
CURVE = RoadCurve()
"""That of variant 0."""
LANE_WIDTH = 3.5
LANE_RIGHT = 0.0
LANE_LEFT = 3.5
EDGE_RIGHT, EDGE_LEFT = -1.75, 5.25
PAVEMENT_RIGHT, PAVEMENT_LEFT = -2.85, 6.35
GRAVEL = 1.3
ROAD_START, ROAD_STOP = -120.0, 330.0
TIMES = np.arange(0.0, 8.0 + 1e-9, 0.25)
LATERAL_ACCELERATION = 2.4
"""Largest of a car in a bend that is drawn [m/s2]; that of the car ahead in variant 0."""

Place = tuple[float, float, float]
"""Arc length [m], offset [m] and turn [deg]."""


@dataclass(frozen=True)
class ActorPlan:
    """A car in a lane: arc length at time 0 [m], lateral offset [m], speed [m/s] (negative = oncoming), paint.

    `model` and its colours are those of scenes_xml/actors, where the car is not of meshes of its own.
    """

    name: str
    start: float
    offset: float
    speed: float
    paint: str
    model: str
    colours: str | None = None


@dataclass(frozen=True)
class TreePlan:
    """A tree: its kind, arc length [m], offset [m], turn [deg] and scale."""

    kind: str
    s: float
    offset: float
    turn: float
    scale: float


@dataclass(frozen=True)
class Layout:
    """All that a variant changes. The guardrail is on the outside of the bend, with chevrons and lamps behind it."""

    variant: int
    curve: RoadCurve
    rail: tuple[float, float]
    chevrons: tuple[float, ...]
    lamps: tuple[float, ...]
    barriers: tuple[float, int]
    house: Place
    barn: Place
    trees: tuple[TreePlan, ...]
    actors: tuple[ActorPlan, ...]

    @property
    def seed(self) -> int:
        """Return the seed of ground and plants."""
        return SEED + 100 * self.variant

    @property
    def outside(self) -> int:
        """Return -1 if the outside of the bend is to the right, 1 if to the left."""
        return -1 if self.curve.radius > 0 else 1

    def beside(self, side: int, distance: float) -> float:
        """Return the offset of what is `distance` [m] away from the pavement, on the right (-1) or on the left."""
        return round((PAVEMENT_RIGHT if side < 0 else PAVEMENT_LEFT) + side * distance, 6)


ACTORS = (
    ActorPlan("ego", 0.0, LANE_RIGHT, 11.0, "car_paint_blue", "saloon", "blue"),
    ActorPlan("car_ahead", 21.0, LANE_RIGHT, 19.0, "car_paint_silver", "suv", "grey"),
    ActorPlan("oncoming", 38.0, LANE_LEFT, -12.0, "car_paint_red", "estate", "white"),
)
FIRST = Layout(
    0,
    CURVE,
    (6.2, 84.5),
    (50.0, 64.0, 78.0, 94.0),
    (-30.0, 34.0, 72.0, 112.0),
    (60.0, 3),
    (47.0, -23.0, 12.0),
    (42.0, 34.0, 28.0),
    tuple(
        TreePlan(*tree)
        for tree in (
            ("tall", 30.0, -12.5, 10.0, 1.0),
            ("broad", 39.5, -14.5, 75.0, 0.9),
            ("tall", 66.0, -15.0, 200.0, 1.1),
            ("broad", 84.0, -12.0, 140.0, 1.0),
            ("broad", 22.0, 16.5, 30.0, 1.0),
            ("tall", 33.0, 19.5, 260.0, 1.05),
            ("tall", 60.0, 17.0, 120.0, 0.95),
            ("broad", -18.0, -13.0, 300.0, 1.1),
            ("tall", -28.0, 14.0, 80.0, 1.0),
        )
    ),
    ACTORS,
)
VEHICLES = (
    ("suv", "white"), ("suv", "green"), ("estate", "green"), ("small_car", "yellow"), ("small_car", "red"),
    ("pickup", "orange"), ("van", None), ("box_van", None), ("lorry", None), ("coach", None), ("motorcycle", None),
)  # fmt: skip # a table
"""Models and colours of the cars that a variant draws."""


PAINTS = ("blue", "silver", "red", "white", "black")
"""Of the ego's car."""


def layout(variant: int = 0) -> Layout:
    """Return the layout of a variant; 0 bends to the left, after Figure 2 of the SCaRL paper."""
    if variant == 0:
        return FIRST
    g = np.random.default_rng([SEED + 1100, variant])
    radius = float(np.round(g.uniform(120.0, 320.0), 0))
    side = float(g.choice([-1.0, 1.0]))
    begin = float(np.round(g.uniform(0.0, 22.0), 1))
    curve = RoadCurve(begin, begin + float(np.round(g.uniform(140.0, 240.0), 0)), side * radius)
    first = float(np.round(begin + g.uniform(0.0, 14.0), 1))
    rail = (first, float(np.round(first + g.uniform(60.0, 110.0), 1)))
    step = float(g.uniform(12.0, 18.0))
    chevrons = tuple(round(begin + 40.0 + step * k, 1) for k in range(int(g.integers(3, 6))))
    spacing, phase = float(np.round(g.uniform(34.0, 52.0), 0)), float(np.round(g.uniform(0.0, 12.0), 1))
    lamps = tuple(float(s) for s in np.arange(-36.0 + phase, 130.0, spacing))
    home = -1.0 if g.uniform() < 0.5 else 1.0
    house = _place(g, (34.0, 66.0), home, (17.0, 24.0), 20.0)
    barn = _place(g, (30.0, 80.0), -home, (26.0, 34.0), 35.0)
    limit = float(np.sqrt(LATERAL_ACCELERATION * radius))
    chosen = g.permutation(len(VEHICLES))[:2]
    (ahead, ahead_colours), (other, other_colours) = (VEHICLES[k] for k in chosen)
    slow = 17.0 if "lorry" in (ahead, other) or "coach" in (ahead, other) else 20.0
    ego = float(g.uniform(9.0, 12.5))
    actors = (
        ActorPlan("ego", 0.0, LANE_RIGHT, ego, "", "saloon", str(g.choice(PAINTS))),
        ActorPlan(
            "car_ahead", float(g.uniform(20.0, 30.0)), LANE_RIGHT, float(g.uniform(13.0, min(slow, limit))), "",
            ahead, ahead_colours,
        ),
        ActorPlan(
            "oncoming", float(g.uniform(40.0, 70.0)), LANE_LEFT, -float(g.uniform(9.0, 14.0)), "", other, other_colours
        ),
    )  # fmt: skip # a table
    barriers = (round(float(g.uniform(begin + 45.0, begin + 75.0)), 1), int(g.integers(0, 6)))
    return Layout(variant, curve, rail, chevrons, lamps, barriers, house, barn, _trees(g, house, barn), actors)


def _place(
    g: np.random.Generator, along: tuple[float, float], side: float, beside: tuple[float, float], turn: float
) -> Place:
    """Return a place on a side of the road within bounds; turned by at most `turn` [deg]."""
    s, offset = float(np.round(g.uniform(*along), 1)), _off(side, float(g.uniform(*beside)))
    return s, offset, float(np.round(g.uniform(-turn, turn), 0))


def _off(side: float, distance: float) -> float:
    """Return the offset of what is `distance` [m] beside the pavement."""
    return float(np.round(distance + PAVEMENT_LEFT if side > 0 else PAVEMENT_RIGHT - distance, 1))


def _trees(g: np.random.Generator, house: Place, barn: Place) -> tuple[TreePlan, ...]:
    """Return trees of a few kinds that reach neither the road, nor a building, nor each other's stem."""
    kinds = [str(kind) for kind in g.permutation(COUNTRY)[: int(g.integers(2, 5))]]
    taken = [(house[0], house[1], 9.0), (barn[0], barn[1], 14.0)]
    trees: list[TreePlan] = []
    for _ in range(200):
        kind, scale = str(g.choice(kinds)), float(np.round(g.uniform(0.8, 1.15), 2))
        reach = scale * KINDS[kind].reach
        s = float(np.round(g.uniform(-40.0, 120.0), 1))
        offset = _off(float(g.choice([-1.0, 1.0])), reach + g.uniform(3.5, 16.0))
        turn = float(np.round(g.uniform(0.0, 360.0), 0))
        if len(trees) < 12 and all(np.hypot(s - x, offset - y) > away + 0.6 * reach for x, y, away in taken):
            trees.append(TreePlan(kind, s, offset, turn, scale))
            taken.append((s, offset, 0.6 * reach + 1.0))
    return tuple(trees)


def lanes(plan: Layout) -> list[Lane]:
    """Return both lanes; the road's ends stay 5 m away."""
    way = np.arange(ROAD_START + 5.0, ROAD_STOP - 5.0 + 1e-9, 2.0)
    return [
        Lane("right", plan.curve.point(way, LANE_RIGHT), "drive", LANE_WIDTH, 19.4),
        Lane("left", plan.curve.point(way[::-1], LANE_LEFT), "drive", LANE_WIDTH, 19.4),
    ]
