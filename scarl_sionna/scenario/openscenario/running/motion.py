"""What is known of an entity at one instant, and the world that it is in."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

from scarl_sionna.scenario.openscenario.reading.entities import Entity
from scarl_sionna.scenario.openscenario.reading.source import Node
from scarl_sionna.scenario.openscenario.roads.network import Roads, Spot


@dataclass(frozen=True)
class Motion:
    """An entity at one instant.

    Attributes
    ----------
    time : float
        [s]
    x, y : float
        Of its reference point: the rear axle of a vehicle [m].
    heading : float
        [rad]
    speed, acceleration : float
        Along its way [m/s, m/s2].
    travelled : float
        Way since the start [m].
    spot : Spot or None
        Where it is on the roads; None where there are no roads.
    left : float
        Offset to the left of the middle of the spot's lane, in the direction of its way [m].
    beyond : float
        How far it is beyond the end of the roads [m].
    along : float
        Way along the trajectory that it follows [m].
    drift : float
        Speed to the left [m/s].
    z : float or None
        Height that a position states [m].
    is_present : bool
        Whether it is in the scene.
    leap : int
        How often it was carried elsewhere during the run.
    """

    time: float
    x: float
    y: float
    heading: float
    speed: float = 0.0
    acceleration: float = 0.0
    travelled: float = 0.0
    spot: Spot | None = None
    left: float = 0.0
    beyond: float = 0.0
    along: float = 0.0
    drift: float = 0.0
    z: float | None = None
    is_present: bool = True
    leap: int = 0

    @property
    def velocity(self) -> tuple[float, float]:
        """Velocity in plan [m/s]."""
        return self.speed * math.cos(self.heading), self.speed * math.sin(self.heading)

    def t(self, roads: Roads) -> float:
        """Return t of its place on its road [m]."""
        assert self.spot is not None
        return roads.middle(self.spot) + self.spot.way * self.left

    def lane(self, roads: Roads) -> int:
        """Return the lane that holds it."""
        assert self.spot is not None
        return roads.lanes(self.spot.road, self.spot.section).lane_at(self.spot.s, self.t(roads))[0]


class World(Protocol):
    """What conditions, positions and actions see of the run."""

    roads: Roads | None
    entities: dict[str, Entity]
    parameters: dict[str, str]
    motions: dict[str, Motion]
    routes: dict[str, tuple[str, ...]]

    def ahead_on_line(self, name: str, x: float, y: float) -> float | None:
        """Return the way along the trajectory that an entity follows to a point [m]; None where it follows none."""

    def motion(self, name: str, node: Node) -> Motion:
        """Return the present motion of an entity that an element names."""


def wrapped(angle: float) -> float:
    """Return an angle from -pi to pi [rad]."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi
