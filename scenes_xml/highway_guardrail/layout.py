"""Where things are: the road's cross-section, the actors and the times of their waypoints.

Offsets are measured from the middle of the ego's lane, positive to the left [m].
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..generators.roads.road import RoadCurve
from ..generators.scene_toml import Lane

SEED = 0
CURVE = RoadCurve()
LANE_WIDTH = 3.5
LANE_RIGHT = 0.0
LANE_LEFT = 3.5
EDGE_RIGHT, EDGE_LEFT = -1.75, 5.25
PAVEMENT_RIGHT, PAVEMENT_LEFT = -2.85, 6.35
GRAVEL = 1.3
RAIL_OFFSET = -4.0
RAIL_START, RAIL_STOP = 6.2, 84.5
ROAD_START, ROAD_STOP = -120.0, 330.0
TIMES = np.arange(0.0, 8.0 + 1e-9, 0.25)


@dataclass(frozen=True)
class ActorPlan:
    """A car in a lane: arc length at time 0 [m], lateral offset [m], speed [m/s] (negative = oncoming), paint."""

    name: str
    start: float
    offset: float
    speed: float
    paint: str


ACTORS = (
    ActorPlan("ego", 0.0, LANE_RIGHT, 11.0, "car_paint_blue"),
    ActorPlan("car_ahead", 21.0, LANE_RIGHT, 19.0, "car_paint_silver"),
    ActorPlan("oncoming", 38.0, LANE_LEFT, -12.0, "car_paint_red"),
)


def lanes() -> list[Lane]:
    """Return both lanes; the road's ends stay 5 m away."""
    way = np.arange(ROAD_START + 5.0, ROAD_STOP - 5.0 + 1e-9, 2.0)
    return [
        Lane("right", CURVE.point(way, LANE_RIGHT), "drive", LANE_WIDTH, 19.4),
        Lane("left", CURVE.point(way[::-1], LANE_LEFT), "drive", LANE_WIDTH, 19.4),
    ]
