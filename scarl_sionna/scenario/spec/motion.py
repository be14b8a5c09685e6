"""How an actor of a scenario moves, as plain data.

Routes along lanes with events, waypoints, tables, and what stands.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Literal

from pydantic import Field, model_validator

from scarl_sionna.core.spec import Spec
from scarl_sionna.core.units import Degrees, Metres, MetresPerSecond, MetresPerSecond2, MetresPerSecond3, Seconds, Unit

Vector = tuple[MetresPerSecond, MetresPerSecond, MetresPerSecond]
Point = Annotated[tuple[Metres, ...], Field(min_length=2, max_length=3)]
Speed = Annotated[MetresPerSecond, Field(ge=0.0, le=70.0)]


class BrakeSpec(Spec):
    """Braking down to a speed."""

    kind: Literal["brake"] = "brake"
    time: Seconds = Field(description="when it begins [s]")
    deceleration: MetresPerSecond2 = Field(6.0, gt=0.0, le=12.0, description="at most [m/s2]")
    jerk: MetresPerSecond3 = Field(15.0, gt=0.0, le=100.0, description="at most [m/s3]")
    speed: Speed = Field(0.0, description="at its end [m/s]")


class AccelerateSpec(Spec):
    """Speeding up to a speed."""

    kind: Literal["accelerate"] = "accelerate"
    time: Seconds = Field(description="when it begins [s]")
    acceleration: MetresPerSecond2 = Field(2.0, gt=0.0, le=10.0, description="at most [m/s2]")
    jerk: MetresPerSecond3 = Field(2.0, gt=0.0, le=100.0, description="at most [m/s3]")
    speed: Speed = Field(description="at its end [m/s]")


class StopSpec(Spec):
    """Keeping the speed and braking in time to stand at a place: a stop line, the end of a queue."""

    kind: Literal["stop"] = "stop"
    at: Metres = Field(ge=0.0, description="way along the lanes from the start of the first one [m]")
    deceleration: MetresPerSecond2 = Field(3.0, gt=0.0, le=12.0, description="at most [m/s2]")
    jerk: MetresPerSecond3 = Field(5.0, gt=0.0, le=100.0, description="at most [m/s3]")


class ShiftSpec(Spec):
    """A smooth move to the side while driving on: a lane change, a cut-in, or passing an obstacle.

    What is driven meanwhile has to be long enough for steering and grip; standing bodies do not shift.
    """

    kind: Literal["shift"] = "shift"
    time: Seconds = Field(description="when it begins [s]")
    duration: Seconds = Field(3.0, gt=0.0, le=60.0, description="how long it takes [s]")
    by: Metres = Field(ge=-15.0, le=15.0, description="how far, positive to the left [m]")


Event = Annotated[BrakeSpec | AccelerateSpec | StopSpec | ShiftSpec, Field(discriminator="kind")]


class RouteSpec(Spec):
    """Driving, cycling or walking along lanes of the scene.

    `start` and `speed` hold at time `since`, before the first event.
    """

    kind: Literal["route"] = "route"
    lanes: tuple[str, ...] = Field(min_length=1, description="names of lanes, each one continues the one before")
    start: Metres = Field(0.0, ge=0.0, description="way along the first lane at `since` [m]")
    speed: Speed | None = Field(
        None, description="at `since`, kept until an event [m/s]; default: the first lane's limit"
    )
    since: Seconds | None = Field(
        None, description="when the motion begins [s]; default: 0, or the first frame where that is earlier"
    )
    offset: Metres = Field(
        0.0, ge=-15.0, le=15.0, description="from the lane's middle before any event, positive to the left [m]"
    )
    events: tuple[Event, ...] = Field((), description="in the order of their times")

    @model_validator(mode="after")
    def _check(self) -> RouteSpec:
        times = [event.time for event in self.events if not isinstance(event, StopSpec)]
        if times != sorted(times):
            raise ValueError("events in the order of their times")
        return self


class WaypointsSpec(Spec):
    """A smooth way through points, at given times or at one speed."""

    kind: Literal["waypoints"] = "waypoints"
    positions: tuple[Point, ...] = Field(min_length=2, description="[x, y] on the ground, or [x, y, z] [m, world]")
    times: tuple[Seconds, ...] | None = Field(None, description="one for each position [s]")
    speed: Annotated[MetresPerSecond, Field(gt=0.0, le=70.0)] | None = Field(
        None, description="instead of `times` [m/s]"
    )
    depart: Seconds = Field(0.0, description="when it sets off, with `speed`; before, it waits [s]")
    yaw_deg: tuple[float, ...] | None = Field(
        None, description="headings, one for each position; default: along the way"
    )
    reverse: bool = Field(False, description="drives backwards along the way; with `times`")
    ground: tuple[tuple[Metres, Metres, Metres], ...] | None = Field(
        None,
        min_length=2,
        description="[x, y, z] of the ground along the way, straight between them, on which both axles stand, where it "
        "has kerbs or ramps; with `times`; default: smooth through the positions [m, world]",
    )

    @model_validator(mode="after")
    def _check(self) -> WaypointsSpec:
        if (self.times is None) == (self.speed is None):
            raise ValueError("either `times` or `speed`")
        for name, values in (("times", self.times), ("yaw_deg", self.yaw_deg)):
            if values is not None and len(values) != len(self.positions):
                raise ValueError(f"as many {name} as positions: {len(values)} and {len(self.positions)} are given")
        if self.times is not None and any(b <= a for a, b in pairwise(self.times)):
            raise ValueError("times that rise")
        if (self.reverse or self.ground is not None) and (self.times is None or self.yaw_deg is not None):
            raise ValueError("`reverse` and `ground` with `times` and without `yaw_deg`")
        return self


class ConstantTwistSpec(Spec):
    """Constant velocity and rate of turn; `position` and `yaw_deg` hold at time 0."""

    kind: Literal["constant_twist"] = "constant_twist"
    position: Point = Field(description="[m, world]")
    velocity: Vector = Field(description="[m/s, world]")
    yaw_deg: Degrees | None = Field(None, description="heading; default: along the velocity [deg]")
    angular_velocity_z: Annotated[float, Unit("rad/s")] = Field(0.0, ge=-10.0, le=10.0, description="[rad/s]")


class StaticSpec(Spec):
    """Something that stands: at a position, in a parking place, or on a lane."""

    kind: Literal["static"] = "static"
    position: Point | None = Field(None, description="[m, world]")
    parking: int | None = Field(None, ge=0, description="number of a parking place of the scene, from 0")
    lane: str | None = Field(None, description="name of a lane, with `start` and `offset`")
    start: Metres = Field(0.0, ge=0.0, description="way along the lane [m]")
    offset: Metres = Field(0.0, ge=-15.0, le=15.0, description="from the lane's middle, positive to the left [m]")
    yaw_deg: Degrees = Field(0.0, description="in the world, or from the direction of the place or lane [deg]")

    @model_validator(mode="after")
    def _check(self) -> StaticSpec:
        if sum(value is not None for value in (self.position, self.parking, self.lane)) != 1:
            raise ValueError("one of `position`, `parking`, `lane`")
        return self


class ParkSpec(Spec):
    """Parking in a place beside a lane, or leaving it, within the steering limit; see docs/traffic.md."""

    kind: Literal["park"] = "park"
    way: Literal["in", "out"] = Field("in", description="into the place, or out of it")
    parking: int | None = Field(None, ge=0, description="number of a parking place of the scene, from 0")
    position: Point | None = Field(None, description="of the middle of the place, instead of a number [m, world]")
    yaw_deg: Degrees = Field(0.0, description="of the axis of a place that is given by its position [deg]")
    lane: str = Field(min_length=1, description="from which, or on which, it drives")
    nose: Literal["out", "in"] = Field(
        "out", description="of a place across the lane: out, so that it reverses in; in, so that it reverses out"
    )
    since: Seconds = Field(0.0, description="when the motion begins; standing before, on its way out [s]")
    approach: Metres = Field(20.0, gt=2.0, le=200.0, description="on the lane before the manoeuvre [m]")
    speed: MetresPerSecond = Field(1.5, ge=0.2, le=3.0, description="of the manoeuvre [m/s]")
    street_speed: MetresPerSecond = Field(5.0, ge=0.5, le=20.0, description="on the lane [m/s]")

    @model_validator(mode="after")
    def _check(self) -> ParkSpec:
        if (self.parking is None) == (self.position is None):
            raise ValueError("one of `parking`, `position`")
        return self


class TableSpec(Spec):
    """The motion that a file holds: CSV or Parquet, SUMO's data, OSI, CommonRoad, OpenSCENARIO, or nuScenes' tables.

    The host vehicle of a trace of OSI and the ego vehicles of OpenSCENARIO and nuScenes are also called ``ego``.
    """

    kind: Literal["table"] = "table"
    file: str = Field(min_length=1, description="path, relative to the scenario's file")
    id: str | None = Field(None, description="whose rows; default: the actor's name")
    sequence: str | None = Field(None, min_length=1, description="scene of nuScenes' tables; default: the only one")


TrajectorySpec = Annotated[
    RouteSpec | WaypointsSpec | ConstantTwistSpec | StaticSpec | ParkSpec | TableSpec, Field(discriminator="kind")
]
