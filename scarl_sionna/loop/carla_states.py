"""Recorded states of actors of CARLA as poses of a session: its left-handed axes made right-handed."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from fnmatch import fnmatchcase

import numpy as np

from scarl_sionna.core.errors import ParameterRangeError, UnknownNameError
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.prompt.arguments import numbers

from .motion import ActorPose

Triple = tuple[float, float, float]
_MIRROR = np.array([1.0, -1.0, 1.0])
"""CARLA's axes are x forward, y right, z up."""


@dataclass(frozen=True)
class CarlaState:
    """One actor at one time, in the axes and units of CARLA's Python interface [1]_.

    Parameters
    ----------
    actor_id : int
    type_id : str
        Blueprint, for instance ``"vehicle.tesla.model3"``.
    location : (float, float, float)
        ``get_transform().location`` [m].
    rotation : (float, float, float)
        Pitch, yaw, roll of ``get_transform().rotation`` [deg].
    velocity : (float, float, float), optional
        ``get_velocity()`` [m/s]; None: derived by the session from the poses.
    yaw_rate_deg : float
        ``get_angular_velocity().z`` [deg/s]; rates of pitch and roll are taken for zero where a velocity is given.
    box_location, box_extent : (float, float, float)
        ``bounding_box.location`` and half sizes ``bounding_box.extent`` [m]: the body stands on the ground below the
        middle of this box. Zeros: the actor's origin is that point, which holds for vehicles and not for walkers.

    Raises
    ------
    ParameterRangeError
        If a value is not finite or has not three numbers.

    References
    ----------
    .. [1] CARLA documentation, *Python API reference*: carla.Location, carla.Rotation, carla.BoundingBox.
    """

    actor_id: int
    type_id: str
    location: Triple
    rotation: Triple
    velocity: Triple | None = None
    yaw_rate_deg: float = 0.0
    box_location: Triple = (0.0, 0.0, 0.0)
    box_extent: Triple = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        for name in ("location", "rotation", "velocity", "box_location", "box_extent"):
            if getattr(self, name) is not None:
                numbers(f"CarlaState.{name}", getattr(self, name), 3, "three finite numbers")
        if not np.isfinite(self.yaw_rate_deg):
            raise ParameterRangeError("CarlaState.yaw_rate_deg", f"{self.yaw_rate_deg} deg/s", "a finite number")

    @property
    def pose(self) -> Pose:
        """Return world_from_actor in right-handed axes: the ground below the middle of the box, y to the left [m]."""
        pitch, yaw, roll = np.remainder(np.radians(self.rotation) + np.pi, 2.0 * np.pi) - np.pi
        turned = Pose.from_euler(_MIRROR * self.location, yaw=-float(yaw), pitch=-float(pitch), roll=float(roll))
        below = np.array(self.box_location) - [0.0, 0.0, self.box_extent[2]]
        return Pose(turned.apply(_MIRROR * below), turned.quaternion)

    @property
    def twist(self) -> Twist | None:
        """Return the velocity of that point, and the yaw rate, in right-handed axes; None without a velocity."""
        if self.velocity is None:
            return None
        angular = np.array([0.0, 0.0, -np.radians(self.yaw_rate_deg)])
        own = Twist(_MIRROR * self.velocity, angular)
        return Twist(own.velocity_at(self.pose.position - _MIRROR * self.location), angular)


def carla_poses(
    states: Iterable[CarlaState], bodies: Mapping[str, str], ego: int | None = None, ego_name: str = "ego"
) -> dict[str, ActorPose]:
    """Return what :meth:`Session.step` takes from the states of one time.

    Parameters
    ----------
    states : iterable of CarlaState
    bodies : mapping of str to str
        Actor model by a shell pattern of the blueprint, the first that fits: ``{"vehicle.*": "saloon"}``.
    ego : int, optional
        Actor that is the scene's own `ego_name`; the others are called by their numbers.
    ego_name : str

    Returns
    -------
    dict of str to ActorPose

    Raises
    ------
    UnknownNameError
        If no pattern fits a blueprint.
    ParameterRangeError
        If two states have one number.
    """
    found: dict[str, ActorPose] = {}
    for state in states:
        is_ego = ego is not None and state.actor_id == ego
        name = ego_name if is_ego else str(state.actor_id)
        if name in found:
            raise ParameterRangeError("states", f"two of actor {state.actor_id}", "one state of each actor at a time")
        body = None if is_ego else next((to for like, to in bodies.items() if fnmatchcase(state.type_id, like)), None)
        if body is None and not is_ego:
            raise UnknownNameError("blueprint", state.type_id, bodies, "add a pattern for it, or leave its states out")
        found[name] = ActorPose(state.pose, state.twist, body)
    return found
