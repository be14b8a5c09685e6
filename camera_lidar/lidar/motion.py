"""Rigid motion during a scan, for many times at once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.results import LidarScan

if TYPE_CHECKING:
    from scarl_sionna.engine.world import WorldState
    from scarl_sionna.scene.motion.trajectory import Trajectory

Array = npt.NDArray[np.float64]

KNOT_INTERVAL = 2e-3
"""Time between the poses that a motion is interpolated from [s].

Positions are cubic between them (error h^4 / 384 of the fourth derivative),
rotations turn evenly (h^2 / 8 of the angular acceleration, 5e-7 rad at 1 rad/s2), velocities are linear (h^2 / 8 of the
jerk, 5e-6 m/s at 10 m/s3). A wheel is followed by its centre.
"""
_SAME_VELOCITY = 1e-6
"""A sensor whose velocity is the ego vehicle's within this [m/s, rad/s] is carried by it, if it is on board."""
_ON_BOARD = 1.0
"""Farthest place of a carried sensor beyond the sphere around its vehicle's box [m]."""


def knots(duration: float) -> Array:
    """Return the times [s] at which motion during a scan is sampled: one for a flash."""
    return np.linspace(0.0, duration, max(int(np.ceil(duration / KNOT_INTERVAL)), 1) + 1 if duration > 0.0 else 1)


@dataclass(frozen=True, eq=False)
class Motion:
    """Poses and velocities at knots, interpolated between.

    Attributes
    ----------
    times : ndarray of float64, shape (num_knots,)
        After the frame's timestamp [s], rising.
    position, linear, angular : ndarray of float64, shape (num_knots, 3)
        Of the body's origin [m], its velocity [m/s] and the angular velocity [rad/s], world axes.
    rotation : ndarray of float64, shape (num_knots, 3, 3)
        world_from_body.
    """

    times: Array
    position: Array
    rotation: Array
    linear: Array
    angular: Array

    @classmethod
    def through(cls, times: Array, at_times: Sequence[tuple[Pose, Twist]]) -> Motion:
        """Return the motion through poses and velocities at knots."""
        poses, twists = zip(*at_times, strict=True)
        return cls(
            times,
            np.array([pose.position for pose in poses]),
            np.array([pose.rotation for pose in poses]),
            np.array([twist.linear for twist in twists]),
            np.array([twist.angular for twist in twists]),
        )

    @classmethod
    def sampled(cls, at: Callable[[float], tuple[Pose, Twist]], duration: float) -> Motion:
        """Return the motion whose pose and velocity at a time after the timestamp are `at(time)`."""
        times = knots(duration)
        return cls.through(times, [at(float(time)) for time in times])

    @cached_property
    def _turn(self) -> Array:
        """Rotation vector from each knot to the next, world axes, shape (num_knots - 1, 3) [rad]."""
        steps = self.rotation[1:] @ np.swapaxes(self.rotation[:-1], 1, 2)
        return Rotation.from_matrix(steps).as_rotvec() if len(steps) else np.zeros((0, 3))

    @cached_property
    def _turns(self) -> bool:
        return bool(np.abs(self._turn).max(initial=0.0) > 1e-14)

    def _interval(self, times: Array) -> tuple[npt.NDArray[np.int64], Array]:
        """Return the interval that each time lies in, and where in it, 0 to 1."""
        if len(self.times) == 1:
            return np.zeros(times.shape, dtype=np.int64), np.zeros(times.shape)
        step = self.times[1] - self.times[0]
        index = np.clip((times / step).astype(np.int64), 0, len(self.times) - 2)
        return index, times / step - index

    def position_at(self, times: Array) -> Array:
        """Return the origin at times [s], shape (num_times, 3) [m]: cubic Hermite."""
        if len(self.times) == 1:
            return np.broadcast_to(self.position[0], (*times.shape, 3))
        index, s = self._interval(times)
        step = self.times[1] - self.times[0]
        s = s[:, None]
        first, last = self.position[index], self.position[index + 1]
        out = first + (last - first) * (s * s * (3.0 - 2.0 * s))
        out += self.linear[index] * (step * s * (1.0 - s) ** 2)
        out -= self.linear[index + 1] * (step * s * s * (1.0 - s))
        return out

    def linear_at(self, times: Array) -> Array:
        """Return the velocity of the origin at times [s], shape (num_times, 3) [m/s]."""
        return self._between(self.linear, times)

    def angular_at(self, times: Array) -> Array:
        """Return the angular velocity at times [s], shape (num_times, 3) [rad/s]."""
        return self._between(self.angular, times)

    def _between(self, values: Array, times: Array) -> Array:
        if len(self.times) == 1 or np.all(values == values[0]):
            return np.broadcast_to(values[0], (*times.shape, 3))
        index, s = self._interval(times)
        return values[index] + s[:, None] * (values[index + 1] - values[index])

    def rotate(self, times: Array, vectors: Array) -> Array:
        """Turn vectors from the body's axes at times into world axes; shapes (num_times,) and (num_times, 3)."""
        if not self._turns:
            return vectors @ self.rotation[0].T
        index, s = self._interval(times)
        turned = np.einsum("nij,nj->ni", self.rotation[index], vectors)
        return _rodrigues(self._turn[index] * s[:, None], turned)

    def rotate_back(self, times: Array, vectors: Array) -> Array:
        """Turn vectors from world axes into the body's axes at times; shapes (num_times,) and (num_times, 3)."""
        if not self._turns:
            return vectors @ self.rotation[0]
        index, s = self._interval(times)
        turned = _rodrigues(self._turn[index] * -s[:, None], vectors)
        return np.einsum("nji,nj->ni", self.rotation[index], turned)


def _rodrigues(rotation_vector: Array, vectors: Array) -> Array:
    """Turn each vector by a rotation vector below 0.5 rad.

    Series of the angle, left out is at most angle^7 / 5040, 2e-6.
    """
    once = np.cross(rotation_vector, vectors)
    twice = np.cross(rotation_vector, once)
    angle2 = np.einsum("ij,ij->i", rotation_vector, rotation_vector)[:, None]
    return (
        vectors
        + once * (1.0 - angle2 / 6.0 + angle2 * angle2 / 120.0)
        + twice * (0.5 - angle2 / 24.0 + angle2 * angle2 / 720.0)
    )


def constant_twist(world_from_body: Pose, twist: Twist, duration: float) -> Motion:
    """Return the motion with constant velocity of the origin and constant angular velocity, in world axes."""

    def at(time: float) -> tuple[Pose, Twist]:
        return _moved(world_from_body, twist, time), twist

    return Motion.sampled(at, duration)


def _moved(pose: Pose, twist: Twist, time: float) -> Pose:
    turn = Rotation.from_rotvec(twist.angular * time).as_matrix()
    return Pose.from_rotation(pose.position + twist.linear * time, turn @ pose.rotation)


def actor_motion(trajectory: Trajectory, timestamp: float, duration: float) -> Motion:
    """Return the motion of an actor from a timestamp on [s].

    Past the end of its trajectory it keeps its last velocity.
    """

    def at(time: float) -> tuple[Pose, Twist]:
        known = min(timestamp + time, trajectory.stop)
        twist = trajectory.twist(known)
        return _moved(trajectory.pose(known), twist, timestamp + time - known), twist

    return Motion.sampled(at, duration)


def sensor_motion(state: WorldState, world_from_sensor: Pose, twist: Twist, duration: float) -> Motion:
    """Return the motion of a sensor during a scan.

    A sensor that moves with the world's ego actor at the state's time and is on it is taken to be carried by it and
    follows its trajectory; any other keeps its velocity and angular velocity.
    """
    ego = state.world.ego
    if ego is not None:
        world_from_ego, ego_twist = state.actor_pose(ego), state.actor_twist(ego)
        velocity = ego_twist.velocity_at(world_from_sensor.position - world_from_ego.position)
        moved = np.abs(velocity - twist.linear).max(), np.abs(ego_twist.angular - twist.angular).max()
        actor = state.world.actor(ego)
        box = state.world.instances[actor.instance]
        away = np.linalg.norm(world_from_sensor.position - world_from_ego.apply(box.frame_from_box.position))
        if max(moved) < _SAME_VELOCITY and away < np.linalg.norm(box.size) / 2.0 + _ON_BOARD:
            carrier = actor_motion(actor.trajectory, state.time, duration)
            return _carried(carrier, world_from_ego.inverse().compose(world_from_sensor))
    return constant_twist(world_from_sensor, twist, duration)


def _carried(carrier: Motion, carrier_from_body: Pose) -> Motion:
    """Return the motion of a body that is fixed to another one."""
    lever = carrier.rotation @ carrier_from_body.position
    return Motion(
        carrier.times,
        carrier.position + lever,
        carrier.rotation @ carrier_from_body.rotation,
        carrier.linear + np.cross(carrier.angular, lever),
        carrier.angular,
    )


def deskew(scan: LidarScan, sensor_twist: Twist) -> LidarScan:
    """Return a rolling scan with all positions in the sensor's frame at the timestamp.

    The sensor's own motion is taken out; what an object moved during the scan stays in. A scan that was made with
    ``spec.deskew`` is so already, by the sensor's exact motion.

    Parameters
    ----------
    scan : LidarScan
        With the time of every return.
    sensor_twist : Twist
        Velocity of the sensor at the timestamp, world axes; taken as constant over the scan.

    Raises
    ------
    ParameterRangeError
        If the scan holds no times, or is de-skewed.
    """
    if scan.time is None or scan.spec.deskew:
        found = "without times" if scan.time is None else "de-skewed"
        raise ParameterRangeError("scan", found, "a scan with times in the frames of its shots")
    times = scan.time.astype(np.float64)
    motion = constant_twist(scan.world_from_sensor, sensor_twist, float(scan.spec.scan.scan_time))
    position, normal = to_timestamp(motion, times, scan.position.astype(np.float64), scan.normal.astype(np.float64))
    return replace(
        scan,
        spec=scan.spec.with_(deskew=True),
        position=position.astype(np.float32),
        normal=normal.astype(np.float32),
    )


def to_timestamp(motion: Motion, times: Array, position: Array, normal: Array) -> tuple[Array, Array]:
    """Return positions and normals, given in the sensor's frame at their times, in its frame at the timestamp."""
    world = motion.rotate(times, position) + motion.position_at(times)
    return (world - motion.position[0]) @ motion.rotation[0], motion.rotate(times, normal) @ motion.rotation[0]


def shot_rays(motion: Motion, spec_directions: Array, times: Array) -> tuple[Array, Array]:
    """Return origin and direction of every shot at its own time, world axes.

    One origin of shape (3,) for a sensor at rest.
    """
    directions = motion.rotate(times, spec_directions)
    still = len(motion.times) == 1 or not (np.ptp(motion.position, axis=0).any() or motion.linear.any())
    return (motion.position[0] if still else motion.position_at(times)), directions
