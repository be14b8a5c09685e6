"""Clouds of spray behind vehicles that move on a wet road: where they are and how dense."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.boxes import through_box
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.semantics import semantic_id

if TYPE_CHECKING:
    from .world import WorldState

Array = npt.NDArray[np.float64]

VEHICLES = ("Car", "Truck", "Bus", "Motorcycle")
"""Classes whose tyres throw up spray; a bicycle is too slow."""
DECAYS = 3.0
"""Length of a cloud in lengths of its decay; 5 % of the water is beyond and is left out."""


@dataclass(frozen=True, eq=False)
class SprayCloud:
    """Water behind one vehicle: densest at its rear end, thinner by 1/e over each decay length.

    Attributes
    ----------
    actor : str
    instance : int
        Of the vehicle.
    world_from_cloud : Pose
        Origin on the ground below the middle of the rear end; x forward, so that the cloud lies at x < 0.
    decay_length, width, height : float
        [m].
    water_content : float
        At the rear end [g/m3].
    drop_diameter : float
        Median volume diameter [m].
    speed : float
        Of the vehicle [m/s]; the drops right behind it move with it and slow down as the cloud thins.
    """

    actor: str
    instance: int
    world_from_cloud: Pose
    decay_length: float
    width: float
    height: float
    water_content: float
    drop_diameter: float
    speed: float

    @property
    def length(self) -> float:
        """Length of the cloud [m]."""
        return DECAYS * self.decay_length

    def chord(self, origins: Array, directions: Array, longest: npt.ArrayLike) -> tuple[Array, Array]:
        """Return where rays enter and leave the cloud [m], shapes (num_rays,).

        A ray that misses it has an empty interval.

        Parameters
        ----------
        origins : ndarray of float64, shape (3,) or (num_rays, 3)
            [m, world].
        directions : ndarray of float64, shape (num_rays, 3)
            Unit vectors [world].
        longest : array_like of float
            Where each ray ends [m].
        """
        start = np.broadcast_to(self.world_from_cloud.inverse().apply(origins), directions.shape)
        along = directions @ self.world_from_cloud.rotation
        lower = np.array([-self.length, -self.width / 2.0, 0.0])
        upper = np.array([0.0, self.width / 2.0, self.height])
        enter, leave = through_box(start, along, lower, upper)
        enter, leave = np.maximum(enter, 0.0), np.minimum(leave, longest)
        return enter, np.maximum(leave, enter)

    def mean_density(self, origins: Array, directions: Array, enter: Array, leave: Array) -> Array:
        r"""Return the mean water content along rays over that at the rear end, 0 to 1, shape (num_rays,).

        The mean is between two distances.

        .. math:: \frac{1}{t_2 - t_1} \int_{t_1}^{t_2} e^{x(t) / L} dt, \quad x(t) = x_0 + u_x t
        """
        start = np.broadcast_to(self.world_from_cloud.inverse().apply(origins), directions.shape)[:, 0]
        slope = (directions @ self.world_from_cloud.rotation)[:, 0] / self.decay_length
        middle = np.exp(start / self.decay_length + slope * (enter + leave) / 2.0)
        half = slope * (leave - enter) / 2.0
        ratio = np.where(np.abs(half) < 1e-6, 1.0, np.sinh(half) / np.where(half == 0.0, 1.0, half))
        return np.where(leave > enter, middle * ratio, 0.0)


def spray_clouds(state: WorldState) -> tuple[SprayCloud, ...]:
    """Return the clouds of spray of a state, by actor; none in a weather without spray or on dry roads."""
    weather = state.world.weather
    wetness = weather.surface_wetness
    if weather.spray is None or wetness == 0.0:
        return ()
    model, clouds = weather.spray, []
    classes = {semantic_id(name) for name in VEHICLES}
    for info in state.world.instances.values():
        if info.actor is None or info.semantic not in classes:
            continue
        pose, twist = state.actor_pose(info.actor), state.actor_twist(info.actor)
        speed = float(twist.linear @ pose.rotation[:, 0])
        if speed < model.min_speed:
            continue
        box, (length, width, _) = info.frame_from_box, info.size
        rear = pose.compose(Pose(np.array([box.position[0] - length / 2.0, box.position[1], 0.0])))
        clouds.append(
            SprayCloud(
                actor=info.actor,
                instance=info.instance,
                world_from_cloud=rear,
                decay_length=speed * model.lifetime,
                width=float(width),
                height=model.height,
                water_content=model.water_content(wetness, float(width)),
                drop_diameter=model.drop_diameter,
                speed=speed,
            )
        )
    return tuple(clouds)
