"""The lidar as a sensor of the rig."""

from __future__ import annotations

from typing import Any

import numpy as np

from scarl_sionna.core.lidar_spec import LidarSpec
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.results import LidarScan
from scarl_sionna.world.placement import check_placement

from .pattern import shot_directions
from .receiver import receive
from .scan import radial_velocity, return_intensity


class Lidar:
    """A scanning coherent lidar that takes its whole scan at one instant (a flash of all shots, as in SCaRL).

    Parameters
    ----------
    spec : LidarSpec
    """

    def __init__(self, spec: LidarSpec) -> None:
        self.spec = spec

    def observe(
        self, state: Any, world_from_sensor: Pose, sensor_twist: Twist, seed_generator: np.random.Generator
    ) -> LidarScan:
        """Return the scan at the state's time: one row a detected return, first surface only.

        Parameters
        ----------
        state : scarl_sionna.world.WorldState
        world_from_sensor : Pose
            Sensor frame (x forward, y left, z up).
        sensor_twist : Twist
            Velocity of the sensor itself, world axes; enters the radial velocity.
        seed_generator : numpy.random.Generator
            Drop-out and noise; see :func:`camera_lidar.lidar.receiver.receive` for the moments.

        Raises
        ------
        PlacementError
            If the lidar is inside a closed mesh.
        """
        check_placement(state, world_from_sensor.position, "lidar")
        spec, parts = self.spec, state.world.parts
        sensor_directions = shot_directions(spec)
        directions = world_from_sensor.rotate(sensor_directions)
        hits = state.cast(world_from_sensor.position, directions, max_distance=spec.max_distance)
        velocity = radial_velocity(hits.velocity, sensor_twist.linear, directions[hits.ray])
        reflectance = parts.lidar_reflectance[hits.part]
        intensity = return_intensity(reflectance, hits.cos_incidence, hits.distance, spec.extinction)
        received = receive(spec.receiver, spec.num_shots, hits.ray, hits.distance, velocity, intensity, seed_generator)
        kept = received.kept
        shot, part = hits.ray[kept], hits.part[kept]
        normal = hits.normal[kept] @ world_from_sensor.rotation  # world -> sensor
        return LidarScan(
            spec=spec,
            world_from_sensor=world_from_sensor,
            shot=shot.astype(np.int32),
            position=(sensor_directions[shot] * received.distance[:, None]).astype(np.float32),
            distance=received.distance.astype(np.float32),
            radial_velocity=received.radial_velocity.astype(np.float32),
            intensity=intensity[kept].astype(np.float32),
            cos_incidence=hits.cos_incidence[kept].astype(np.float32),
            normal=normal.astype(np.float32),
            semantic=parts.semantic[part].astype(np.uint8),
            instance=parts.instance[part].astype(np.uint16),
        )
