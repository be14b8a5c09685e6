"""Motion that is told step by step: known up to now, carried on with the last velocity beyond."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.prompt.arguments import HOW_TO_POSE, expect
from scarl_sionna.core.prompt.describe import Described, Row, quantity

REMEMBERED = 1.0
"""Motion of so long before the last frame is kept [s]: joints sum the way over panels of 0.25 s."""


@dataclass(frozen=True, eq=False, repr=False)
class ActorPose(Described):
    """Where an actor is and how it moves, as another simulator says.

    Parameters
    ----------
    pose : Pose
        world_from_actor: origin on the ground below the middle of the body, x forward, y left, z up [m].
    twist : Twist, optional
        Velocity of that origin and angular velocity, world axes [m/s, rad/s]; None: the mean since the last step.
    body : str, optional
        Name of its model, one of `SessionSettings.bodies`: needed when it comes, for what is no actor of the scene.

    Raises
    ------
    InputTypeError
        If a value is of another type.
    """

    pose: Pose
    twist: Twist | None = None
    body: str | None = None

    def __post_init__(self) -> None:
        expect("ActorPose.pose", self.pose, Pose, HOW_TO_POSE)
        if self.twist is not None:
            expect("ActorPose.twist", self.twist, Twist, "give ss.Twist(linear=[vx, vy, vz])")
        if self.body is not None:
            expect("ActorPose.body", self.body, str, "give the name of a model of SessionSettings.bodies")


class ToldTrajectory(Described):
    """Motion of one body as a session was told it, and away where no actor has the body.

    Between two steps the body goes on with the velocity of the earlier one, so that no time depends on a later step.

    Parameters
    ----------
    start : float
        Earliest time that may be asked for [s].
    away : Pose
        Where the body is while it is away.
    """

    def __init__(self, start: float, away: Pose) -> None:
        self.start, self.stop = start, np.inf
        self.known_until = start
        self._away = away
        self._times: list[float] = []
        self._told: list[tuple[Pose, Twist] | None] = []

    def _facts(self) -> Iterable[Row]:
        yield "steps", str(len(self._times))
        yield "known_until", quantity(self.known_until, "s")

    def tell(self, time: float, pose: Pose | None, twist: Twist) -> None:
        """Say where the body is from a time on [s]; None: away. The time must be later than all before."""
        self.known_until = time
        if pose is None and (not self._told or self._told[-1] is None):
            return  # still away
        self._times.append(time)
        self._told.append(None if pose is None else (pose, twist))

    def forget(self, before: float) -> None:
        """Drop what was told before a time [s], but the last of it, from which the motion goes on."""
        count = bisect_right(self._times, before) - 1
        if count > 0:
            del self._times[:count], self._told[:count]

    def _at(self, time: float) -> tuple[float, tuple[Pose, Twist] | None]:
        """Return when the motion at a time was told, and what."""
        row = bisect_right(self._times, time) - 1
        return (time, None) if row < 0 else (self._times[row], self._told[row])

    def pose(self, time: float) -> Pose:
        """Return world_from_actor at a time [s]."""
        since, told = self._at(time)
        if told is None:
            return self._away
        pose, twist = told
        after = time - since
        if after == 0.0:
            return pose
        turn = Rotation.from_rotvec(twist.angular * after).as_matrix()
        return Pose.from_rotation(pose.position + twist.linear * after, turn @ pose.rotation)

    def twist(self, time: float) -> Twist:
        """Return the velocity at a time [s]."""
        told = self._at(time)[1]
        return _REST if told is None else told[1]

    def is_present(self, time: float) -> bool:
        """Return whether an actor has the body at a time [s]."""
        return self._at(time)[1] is not None


_REST = Twist()


def twist_between(before: Pose, after: Pose, seconds: float) -> Twist:
    """Return the mean velocity and angular velocity from one pose to another in a time [s]."""
    turn = Rotation.from_matrix(after.rotation @ before.rotation.T).as_rotvec()
    return Twist((after.position - before.position) / seconds, turn / seconds)
