"""Where a sensor is and how it moves: at rest, with a motion of its own, or riding on an actor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from .errors import InputTypeError
from .pose import Pose, Twist
from .prompt.describe import Described


@dataclass(frozen=True, repr=False)
class Mount(Described):
    """Pose and velocity of a sensor at one instant.

    ``state.mount("ego", ss.Pose([4.0, 0.0, 0.7]))`` makes it for a sensor that rides on an actor.

    Parameters
    ----------
    pose : Pose
        world_from_sensor: x is the boresight, y left, z up [m].
    twist : Twist
        Velocity of the sensor itself, world axes [m/s, rad/s]; at rest if left out.
    actor : str, optional
        Name of the actor that it rides on: a frame whose paths are solved several times follows that actor's motion.
    actor_from_sensor : Pose, optional
        Where it sits on the actor; with `actor`.

    Raises
    ------
    InputTypeError
        If `pose` is no Pose or `twist` no Twist.
    """

    pose: Pose
    twist: Twist = field(default_factory=Twist)
    actor: str | None = None
    actor_from_sensor: Pose | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.pose, Pose):
            raise InputTypeError("Mount.pose", self.pose, "a Pose", "write ss.Pose([x, y, z])")
        if not isinstance(self.twist, Twist):
            raise InputTypeError("Mount.twist", self.twist, "a Twist", "write ss.Twist(linear=[vx, vy, vz])")

    def at(self, carrier_from_sensor: Pose) -> Mount:
        """Return the mount of what is fixed to this one, for instance of a sensor on a vehicle."""
        lever = self.pose.rotate(carrier_from_sensor.position)
        twist = Twist(self.twist.velocity_at(lever), self.twist.angular)
        if self.actor is None:
            return Mount(self.pose.compose(carrier_from_sensor), twist)
        own = (
            carrier_from_sensor
            if self.actor_from_sensor is None
            else self.actor_from_sensor.compose(carrier_from_sensor)
        )
        return Mount(self.pose.compose(carrier_from_sensor), twist, self.actor, own)

    @classmethod
    def passing(cls, start: Pose, velocity: Sequence[float], time: float) -> Mount:
        """Return the mount of what goes straight on, its axes as they are.

        Parameters
        ----------
        start : Pose
            world_from_sensor at time 0.
        velocity : sequence of float, shape (3,)
            [m/s], world axes.
        time : float
            [s]
        """
        moved = Pose(start.position + time * np.asarray(velocity, dtype=np.float64), start.quaternion)
        return cls(moved, Twist(np.array(velocity)))

    @classmethod
    def of(cls, place: Mount | Pose) -> Mount:
        """Return the mount itself, or a pose as one at rest.

        Raises
        ------
        InputTypeError
            If `place` is neither.
        """
        if isinstance(place, Mount):
            return place
        if isinstance(place, Pose):
            return cls(place)
        remedy = (
            "write ss.Pose([x, y, z]) for a sensor at rest, state.mount('ego', ss.Pose([x, y, "
            "z])) for one that rides on an actor"
        )
        raise InputTypeError("mount", place, "a Mount or a Pose", remedy)
