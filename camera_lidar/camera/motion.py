"""Where scene and camera are shortly before and after a frame: for optical flow and for motion blur."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.engine.world import WorldState

_SAME_MOTION = 1e-9
"""Velocities that differ by less than this [m/s, rad/s] are the same rigid motion."""


def extrapolate(pose: Pose, twist: Twist, interval: float) -> Pose:
    """Return a pose after `interval` seconds of constant linear velocity of its origin and angular velocity."""
    turn = Rotation.from_rotvec(twist.angular * interval).as_matrix()
    return Pose.from_rotation(pose.position + twist.linear * interval, turn @ pose.rotation)


def shifted_state(state: WorldState, interval: float) -> WorldState:
    """Return the state `interval` seconds later (or earlier, if negative).

    Actors follow their trajectories; beyond the time at which one is known they go on with their present velocity.
    """
    if interval == 0.0:
        return state
    time = state.time + interval
    poses, twists = {}, {}
    for actor in state.world.actors:
        path = actor.trajectory
        if path.start <= time <= path.stop:
            poses[actor.name], twists[actor.name] = path.pose(time), path.twist(time)
        else:
            twists[actor.name] = state.actor_twist(actor.name)
            poses[actor.name] = extrapolate(state.actor_pose(actor.name), twists[actor.name], interval)
    return WorldState(state.world, time, poses, twists)


def shifted_sensor(state: WorldState, later: WorldState, world_from_sensor: Pose, sensor_twist: Twist) -> Pose:
    """Return the sensor's pose in another state of the same world.

    A sensor that moves like a part of the ego vehicle is carried along its trajectory; any other one goes on with its
    twist.
    """
    ego = state.world.ego
    if ego is not None:
        carrier, motion = state.actor_pose(ego), state.actor_twist(ego)
        expected = motion.velocity_at(world_from_sensor.position - carrier.position)
        miss = np.concatenate([expected - sensor_twist.linear, motion.angular - sensor_twist.angular])
        if np.abs(miss).max() < _SAME_MOTION:
            return later.actor_pose(ego).compose(carrier.inverse()).compose(world_from_sensor)
    return extrapolate(world_from_sensor, sensor_twist, later.time - state.time)
