"""Other radars of a scene, whose signals reach a radar."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import BeforeValidator, Field, model_validator

from scarl_sionna.core.pose import Pose
from scarl_sionna.core.spec import FieldValue, Spec
from scarl_sionna.core.specs.place import fields_of_pose
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.units import Hertz, Metres, MetresPerSecond, Seconds


def _by_name(value: FieldValue) -> FieldValue:
    """Return the radar of a preset's name."""
    return RadarSpec.preset(value) if isinstance(value, str) else value


class Interferer(Spec):
    """Another radar that sends while a radar listens: what it is, where it is, and when it sends.

    Either `radar` with its place, or `sensor`: the name of another radar of the same rig. The place is on an actor, or
    in the world with a velocity, straight on from its position at time 0. It sends frame after frame, also before and
    after the frame of the radar that listens.

    The short form ``pose=ss.Pose(...)`` stands for `position` and `quaternion`.

    Raises
    ------
    ParameterRangeError
        If neither or both of `radar` and `sensor` are given, a place stands beside `sensor`, or frames overlap.

    Examples
    --------
    >>> other = Interferer(radar="awr1843boost_3d", position=(40.0, 0.0, 0.5), quaternion=(0.0, 0.0, 0.0, 1.0))
    """

    radar: Annotated[RadarSpec, BeforeValidator(_by_name)] | None = Field(
        None, description="what it is: a radar, or the name of a preset"
    )
    sensor: str | None = Field(None, description="name of another radar of the rig, instead of radar and place")
    actor: str | None = Field(None, description="that it rides on; None: it has a place in the world")
    position: tuple[Metres, Metres, Metres] = Field(
        (0.0, 0.0, 0.0), description="on the actor, or in the world at time 0 [m]"
    )
    quaternion: tuple[float, float, float, float] = Field(
        (1.0, 0.0, 0.0, 0.0), description="of its axes on the actor, or in the world: w, x, y, z"
    )
    velocity: tuple[MetresPerSecond, MetresPerSecond, MetresPerSecond] = Field(
        (0.0, 0.0, 0.0),
        description="of one that rides on no actor, world axes [m/s]; straight on from its position at time 0",
    )
    start_time: Seconds | None = Field(
        None,
        description="start of one of its frames after that of the listening radar's frame [s]; None: drawn for each "
        "frame of a rig, evenly over frame_interval, one draw for all radars that hear it; where radars of the rig "
        "hear each other, less the draw of the one that listens",
    )
    frame_interval: Seconds | None = Field(
        None, gt=0.0, description="from the start of a frame to that of the next [s]; None: without pause"
    )
    frequency_offset: Hertz = Field(0.0, description="of its carrier from what its waveform says [Hz]")

    @model_validator(mode="before")
    @classmethod
    def _of_pose(cls, data: FieldValue) -> FieldValue:
        return fields_of_pose(data)

    @model_validator(mode="after")
    def _check(self) -> Interferer:
        if (self.radar is None) == (self.sensor is None):
            raise ValueError("either radar or sensor; give one of them")
        place = ("actor", "position", "quaternion", "velocity")
        given = {name for name in place if getattr(self, name) != type(self).model_fields[name].default}
        if self.sensor is not None and given:
            raise ValueError("no place beside sensor: the rig says where that radar is")
        if self.actor is not None and "velocity" in given:
            raise ValueError("no velocity beside actor: the radar moves with it")
        if sum(value * value for value in self.quaternion) < 1e-12:
            raise ValueError("quaternion that is not all zero")
        lasts = 0.0 if self.radar is None else self.radar.frame_time
        if self.frame_interval is not None and self.frame_interval < lasts * (1.0 - 1e-9):
            raise ValueError(
                f"frame_interval >= the frame time of its radar, {lasts * 1e3:g} ms; it is "
                f"{self.frame_interval * 1e3:g} ms"
            )
        return self

    @property
    def pose(self) -> Pose:
        """Where it is: actor_from_radar, or world_from_radar."""
        return Pose(np.array(self.position), np.array(self.quaternion))
