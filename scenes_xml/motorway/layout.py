"""Where things are on the motorway, for each variant. Offsets are to the left of the middle of the median [m]."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..generators.roads.road import RoadCurve

SEED = 600
START, STOP = -170.0, 350.0
LANE = 3.75
FIRST = 2.0
"""Where the innermost lane begins, from the middle of the median [m]."""
EMERGENCY = 3.0
TIMES = np.arange(0.0, 9.0 + 1e-9, 0.5)


@dataclass(frozen=True)
class Traffic:
    """A vehicle: model, lane, place [m], speed [m/s].

    Lane 0 is the rightmost; -1, -2, -3 are those of the other carriageway.
    """

    name: str
    model: str
    lane: int
    start: float
    speed: float
    variant: str | None = None


@dataclass(frozen=True)
class Layout:
    """All that a variant changes."""

    curve: RoadCurve
    lanes: int
    bridge: float
    clearance: float
    gantry: float
    noise_wall: tuple[float, float, float]
    post_spacing: float
    traffic: tuple[Traffic, ...]
    trees: int
    variant: int = 0

    @property
    def edge(self) -> float:
        """Return the distance of the edge line beside the emergency lane from the middle [m]."""
        return FIRST + self.lanes * LANE

    @property
    def pavement(self) -> float:
        """Return the distance of the pavement's edge [m]."""
        return self.edge + EMERGENCY + 0.2

    def offset(self, lane: int) -> float:
        """Return the offset of a lane's middle, see `Traffic.lane` [m]."""
        if lane >= 0:
            return -(FIRST + (self.lanes - lane - 0.5) * LANE)
        return FIRST + (self.lanes + lane + 0.5) * LANE


TRAFFIC = (
    Traffic("ego", "saloon", 1, -62.0, 30.0),
    Traffic("car_ahead", "suv", 1, -12.0, 28.5, "white"),
    Traffic("lorry", "lorry", 0, -2.0, 22.5),
    Traffic("van", "van", 0, 52.0, 24.5),
    Traffic("fast_car", "saloon", 2, -104.0, 36.0, "red"),
    Traffic("motorcycle", "motorcycle", 2, -30.0, 34.0),
    Traffic("oncoming_car", "small_car", -2, 190.0, 31.0),
    Traffic("oncoming_lorry", "lorry", -1, 150.0, 22.5),
    Traffic("oncoming_suv", "suv", -3, 240.0, 35.0),
)


def layout(variant: int = 0) -> Layout:
    """Return the layout of a variant; 0 has three lanes in each direction and a wide bend to the left."""
    if variant == 0:
        return Layout(RoadCurve(20.0, 900.0, 1400.0, 80.0), 3, 92.0, 5.0, 30.0, (-70.0, 62.0, 3.6), 4.0, TRAFFIC, 9)
    g = np.random.default_rng([SEED, variant])
    lanes = int(g.integers(2, 4))
    curve = RoadCurve(
        float(g.uniform(0.0, 40.0)), 900.0, float(g.choice([-1.0, 1.0])) * float(g.uniform(900.0, 2500.0)), 80.0
    )
    traffic = []
    for t in TRAFFIC:
        if lanes == 2 and t.lane in (2, -3):
            continue
        start = t.start if t.name == "ego" else t.start + float(g.uniform(-4.0, 4.0))
        traffic.append(Traffic(t.name, t.model, t.lane, start, t.speed * float(g.uniform(0.98, 1.02)), t.variant))
    bridge = float(g.uniform(70.0, 150.0))
    low = float(g.uniform(-110.0, -60.0))
    wall = (low, low + 4.0 * int(g.integers(20, 32)), float(np.round(g.uniform(2.8, 4.8), 1)))
    return Layout(
        curve,
        lanes,
        bridge,
        float(np.round(g.uniform(4.8, 5.6), 2)),
        float(g.uniform(10.0, bridge - 35.0)),
        wall,
        float(g.choice([2.0, 4.0])),
        tuple(traffic),
        int(g.integers(5, 13)),
        variant,
    )
