"""States of CARLA's actors: its left-handed axes by its own matrix, the foot of a body, and refused input."""

from __future__ import annotations

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.core.errors import ParameterRangeError, UnknownNameError
from scarl_sionna.loop.carla_states import CarlaState, carla_poses

MIRROR = np.diag([1.0, -1.0, 1.0])


def engine_matrix(pitch: float, yaw: float, roll: float) -> np.ndarray:
    """Return the rotation matrix of carla.Transform.get_matrix (LibCarla, geom/Transform.h) for angles [deg]."""
    cp, cy, cr = np.cos(np.radians([pitch, yaw, roll]))
    sp, sy, sr = np.sin(np.radians([pitch, yaw, roll]))
    return np.array(
        [
            [cp * cy, cy * sp * sr - sy * cr, -cy * sp * cr - sy * sr],
            [cp * sy, sy * sp * sr + cy * cr, -sy * sp * cr + cy * sr],
            [sp, -cp * sr, cp * cr],
        ]
    )


@pytest.mark.parametrize("rotation", [(0, 0, 0), (5, 30, 0), (-8, -170, 3), (2, 359, -12), (0, 720, 0)])
def test_points_of_a_body_stand_where_the_engine_has_them(rotation: tuple[float, float, float]) -> None:
    """The engine's matrix maps a body's points in its own axes; mirrored, they are where our pose maps them."""
    own = np.random.default_rng(0).normal(size=(20, 3))  # x forward, y right, z up [m]
    location = np.array([12.0, 7.0, 0.5])
    theirs = own @ engine_matrix(*rotation).T + location
    state = CarlaState(1, "vehicle.x", tuple(location), rotation)
    np.testing.assert_allclose(state.pose.apply(own @ MIRROR), theirs @ MIRROR, atol=1e-12)


def test_a_right_turn_is_to_the_right() -> None:
    """Yaw of 90 deg faces CARLA's +y, its right: our -y; turning on to the right is a negative rate about our z."""
    state = CarlaState(1, "vehicle.x", (0, 0, 0), (0, 90, 0), velocity=(0, 10, 0), yaw_rate_deg=20.0)
    np.testing.assert_allclose(state.pose.rotation[:, 0], [0, -1, 0], atol=1e-15)
    assert state.twist is not None
    np.testing.assert_allclose(state.twist.linear, [0, -10, 0])
    np.testing.assert_allclose(state.twist.angular, [0, 0, -np.radians(20.0)])


def test_a_body_stands_below_the_middle_of_its_box() -> None:
    walker = CarlaState(2, "walker.x", (3, 4, 0.93), (0, 0, 0), box_extent=(0.2, 0.2, 0.93))
    np.testing.assert_allclose(walker.pose.position, [3, -4, 0], atol=1e-15)
    long = CarlaState(
        3, "vehicle.x", (0, 0, 0), (0, 90, 0), (0, 5, 0), 30.0, box_location=(1.0, 0, 0.7), box_extent=(2, 1, 0.7)
    )
    np.testing.assert_allclose(long.pose.position, [0, -1, 0], atol=1e-15)  # the middle is 1 m ahead, which is right
    assert long.twist is not None  # turning right (to -x) by 30 deg/s moves a point 1 m ahead at 0.52 m/s to -x
    np.testing.assert_allclose(long.twist.linear, [-np.radians(30.0), -5.0, 0.0], atol=1e-12)


def test_states_become_the_poses_of_a_step() -> None:
    states = [CarlaState(7, "vehicle.a", (0, 0, 0), (0, 0, 0)), CarlaState(9, "walker.b", (5, 1, 0), (0, 0, 0))]
    found = carla_poses(states, {"walker.*": "adult_man"}, ego=7)
    assert list(found) == ["ego", "9"] and found["ego"].body is None and found["9"].body == "adult_man"
    assert found["9"].twist is None and isinstance(found["9"].pose, ss.Pose)
    with pytest.raises(UnknownNameError, match="unknown blueprint 'vehicle.a'"):
        carla_poses(states, {"walker.*": "adult_man"})
    with pytest.raises(ParameterRangeError, match="two of actor 7"):
        carla_poses([states[0]] * 2, {"*": "saloon"})
    with pytest.raises(ParameterRangeError, match=r"CarlaState\.location"):
        CarlaState(1, "vehicle.a", (np.nan, 0, 0), (0, 0, 0))
