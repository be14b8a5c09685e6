"""Where things are: the street's cross-section and how cars and people move.

x runs along the street, y to the left, from the middle of the ego's lane [m].
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..generators.geometry.mesh import Array
from ..generators.people.pedestrian import BodyShape
from ..generators.roads.road import RoadCurve
from ..generators.scene_toml import Lane

SEED = 100
STREET = RoadCurve(bend_start=1e6, bend_stop=1e6 + 1.0)
"""A straight one."""
START, STOP = -70.0, 150.0
LANE_LEFT = 3.25
KERB_LEFT, KERB_RIGHT = 4.9, -3.9
PARKING = -1.75
"""Right edge of the ego's lane; parked cars stand from here to the kerb."""
WALL_LEFT, WALL_RIGHT = 8.4, -7.4
KERB_HEIGHT = 0.12
ZEBRA = (20.0, 24.0)
TIMES = np.arange(0.0, 8.0 + 1e-9, 0.25)


@dataclass(frozen=True)
class CarPlan:
    """A car: x over time, its lane, heading [deg] and paint."""

    name: str
    shape: str
    x: Array
    y: float
    yaw_deg: float
    paint: str


@dataclass(frozen=True)
class WalkerPlan:
    """A person who walks straight on: body, where it is at time 0, velocity [m/s], phase of the gait and clothes."""

    name: str
    body: BodyShape
    start: tuple[float, float]
    velocity: tuple[float, float]
    phase: float
    clothes: tuple[str, str, str]


def _stopping(speed: float, distance: float, begin: float) -> Array:
    """Return the way of a car that brakes from `speed` to rest over `distance`, beginning at `begin` [s], smoothly."""
    duration = 2.0 * (distance - speed * begin) / speed
    u = np.clip((TIMES - begin) / duration, 0.0, 1.0)
    return speed * np.minimum(TIMES, begin) + speed * duration * (u - u**3 + 0.5 * u**4)


CARS = (
    CarPlan("ego", "ego", _stopping(8.0, 16.2, 0.25), 0.0, 0.0, "car_paint_blue"),
    CarPlan("car_ahead", "car_ahead", 33.0 + 8.5 * TIMES, 0.0, 0.0, "car_paint_silver"),
    CarPlan("oncoming", "oncoming", 50.0 - _stopping(7.0, 21.5, 1.0), LANE_LEFT, 180.0, "car_paint_red"),
)
PARKED = (
    ("parked_0", "oncoming", -14.0, "car_paint_silver"), ("parked_1", "ego", -7.5, "car_paint_white"), ("parked_2",
    "car_ahead", 6.5, "car_paint_red"),
    ("parked_3", "oncoming", 13.2, "car_paint_green"), ("parked_4", "ego", 32.0, "car_paint_silver"), ("parked_5",
    "car_ahead", 38.4, "car_paint_blue"),
    ("parked_6", "oncoming", 51.0, "car_paint_white"),
)  # fmt: skip # a table
"""Cars at the right kerb: name, shape, x and paint."""

WALKERS = (
    WalkerPlan(
        "walker_0", BodyShape(1.78, 1.05), (21.1, -3.4), (0.0, 1.35), 0.10, ("top_red", "trousers_blue", "shoes_dark")
    ),
    WalkerPlan(
        "walker_1",
        BodyShape(1.24, 0.92, 1.15),
        (22.0, -3.7),
        (0.0, 1.35),
        0.55,
        ("top_yellow", "trousers_blue", "shoes_white"),
    ),
    WalkerPlan(
        "walker_2", BodyShape(1.66, 0.95), (23.1, 8.0), (0.0, -1.20), 0.30, ("top_grey", "trousers_dark", "shoes_dark")
    ),
    WalkerPlan(
        "walker_3", BodyShape(1.84, 1.08), (5.0, -5.9), (1.45, 0.0), 0.80, ("top_green", "trousers_dark", "shoes_dark")
    ),
    WalkerPlan(
        "walker_4", BodyShape(1.70, 1.0), (36.0, 6.3), (-1.30, 0.0), 0.20, ("top_blue", "trousers_khaki", "shoes_white")
    ),
)


def ground(y: float) -> float:
    """Return the height of the street at y: carriageway or pavement [m]."""
    return KERB_HEIGHT if y > KERB_LEFT or y < KERB_RIGHT else 0.0


def walker_positions(plan: WalkerPlan) -> Array:
    """Return positions over `TIMES`, shape (n, 3); the kerb is dropped, a ramp of 0.8 m wide."""
    x, y = (np.array(plan.start)[:, None] + np.array(plan.velocity)[:, None] * TIMES)[:2]
    over = np.maximum(y - KERB_LEFT, KERB_RIGHT - y)
    return np.stack([x, y, KERB_HEIGHT * np.clip(over / 0.8 + 0.5, 0.0, 1.0)], 1)


def lanes() -> list[Lane]:
    """Return the lanes of vehicles, those of both pavements, and the way across the street."""
    x = np.arange(START + 4.0, STOP - 4.0 + 1e-9, 2.0)
    y = np.arange(-5.7, 6.9 + 1e-9, 0.6)
    kerb = KERB_HEIGHT * np.clip(np.maximum(y - KERB_LEFT, KERB_RIGHT - y) / 0.8 + 0.5, 0.0, 1.0)
    right, left = (np.stack([x, np.full_like(x, side), np.full_like(x, KERB_HEIGHT)], 1) for side in (-5.7, 6.9))
    across = np.stack([np.full_like(y, 0.5 * sum(ZEBRA)), y, kerb], 1)
    road = np.stack([x, 0.0 * x, 0.0 * x], 1)
    return [
        Lane("right", road, "drive", LANE_LEFT),
        Lane("left", road[::-1] + [0.0, LANE_LEFT, 0.0], "drive", LANE_LEFT),
        Lane("walk_right", right, "walk", 1.6, 1.4),
        Lane("walk_left", left[::-1], "walk", 1.6, 1.4),
        Lane("zebra", across, "walk", ZEBRA[1] - ZEBRA[0], 1.4),
    ]
