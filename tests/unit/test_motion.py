"""Trajectories: velocities are the derivatives of the poses, and times outside are refused."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from scarl_sionna.core.errors import ParameterRangeError, TimeRangeError, UnknownNameError
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.scene.motion.trajectory import (
    ConstantTwistTrajectory,
    StaticTrajectory,
    WaypointTrajectory,
    trajectory_from_table,
)

RADIUS, SPEED = 150.0, 11.0


def arc(step: float) -> WaypointTrajectory:
    times = np.arange(0.0, 6.0 + step / 2, step)
    angle = SPEED / RADIUS * times
    points = np.stack([RADIUS * np.sin(angle), RADIUS * (1 - np.cos(angle)), np.zeros_like(angle)], axis=1)
    return WaypointTrajectory(times, points, name="car")


def test_waypoints_are_met() -> None:
    trajectory = arc(0.5)
    for time in (0.0, 0.5, 3.0, 6.0):
        expected = [RADIUS * np.sin(SPEED / RADIUS * time), RADIUS * (1 - np.cos(SPEED / RADIUS * time)), 0.0]
        np.testing.assert_allclose(trajectory.pose(time).position, expected, atol=1e-12)


def test_twist_is_the_derivative_of_the_pose() -> None:
    trajectory, h = arc(0.5), 1e-5
    for time in (0.3, 2.71, 5.5):
        before, after = trajectory.pose(time - h), trajectory.pose(time + h)
        twist = trajectory.twist(time)
        # central difference: error h^2/6 * third derivative (< 1e-8) plus rounding 1e-15*100/h (1e-8)
        np.testing.assert_allclose((after.position - before.position) / (2 * h), twist.linear, atol=1e-7)
        assert (after.yaw - before.yaw) / (2 * h) == pytest.approx(twist.angular[2], abs=1e-7)


def test_circle_has_its_yaw_rate_and_the_heading_of_the_tangent() -> None:
    trajectory = arc(0.25)
    # spline error of the second derivative: h^2/12 * |x''''| = 0.25^2/12 * R w^4 = 2e-5 m/s^2, over the speed 2e-6
    # rad/s
    assert trajectory.twist(3.1).angular[2] == pytest.approx(SPEED / RADIUS, abs=1e-5)
    assert trajectory.pose(3.1).yaw == pytest.approx(SPEED / RADIUS * 3.1, abs=1e-6)


def test_velocity_is_continuous_over_a_waypoint() -> None:
    trajectory = WaypointTrajectory([0, 1, 2, 3], [[0, 0, 0], [5, 0, 0], [11, 1, 0], [15, 4, 0]])
    before, after = trajectory.twist(1.0 - 1e-9), trajectory.twist(1.0 + 1e-9)
    np.testing.assert_allclose(before.linear, after.linear, atol=1e-6)
    np.testing.assert_allclose(before.angular, after.angular, atol=1e-6)


def test_a_body_stands_between_equal_waypoints_and_sets_off_forwards() -> None:
    trajectory = WaypointTrajectory([0, 1, 2, 3], [[0, 0, 0], [0, 0, 0], [10, 0, 0], [20, 0, 0]])
    times = np.linspace(0.0, 3.0, 301)
    along = np.array([trajectory.pose(time).position[0] for time in times])
    assert np.abs(along[times <= 1.0]).max() < 1e-12 and np.diff(along).min() > -1e-12
    assert all(trajectory.pose(time).yaw == 0.0 for time in times)
    assert trajectory.forward_speeds(times).min() > -1e-12


@pytest.mark.parametrize("along", [[0, 1, 10, 20], [0, 10, 10.2, 20, 30], [0, 10, 20, 20, 20, 21], [0, 5, 5, 5.1, 30]])
def test_no_sudden_change_of_speed_makes_a_body_swing(along: list[float]) -> None:
    """Along a slanted line: never back, never beyond a stop, whatever the pace; the velocity stays continuous."""
    points = np.outer(along, [0.6, 0.8, 0.0])
    trajectory = WaypointTrajectory(np.arange(len(along)), points)
    times = np.linspace(0.0, len(along) - 1.0, 2001)
    way = np.array([trajectory.pose(time).position for time in times]) @ [0.6, 0.8, 0.0]
    assert np.diff(way).min() > -1e-9
    speeds = np.array([trajectory.twist(time).linear for time in times])
    assert np.abs(np.diff(speeds, axis=0)).max() < 0.2  # of 2001 steps; a jump would be of metres a second
    assert [trajectory.pose(time).position for time in range(len(along))] == pytest.approx(points, abs=1e-9)


def test_a_stop_at_a_corner_turns_the_body_while_it_stands() -> None:
    trajectory = WaypointTrajectory(
        [0, 1, 2, 4, 5, 6], [[0, 0, 0], [2, 0, 0], [4, 0, 0], [4, 0, 0], [4, 2, 0], [4, 4, 0]]
    )
    assert trajectory.pose(2.0).yaw == pytest.approx(0.0, abs=1e-6)
    assert trajectory.pose(3.0).yaw == pytest.approx(np.pi / 4, abs=1e-6)
    assert trajectory.pose(4.0).yaw == pytest.approx(np.pi / 2, abs=1e-6)
    for time in (1.999, 2.001, 2.7, 3.5, 3.999, 4.001):
        rate = (trajectory.pose(time + 1e-6).yaw - trajectory.pose(time - 1e-6).yaw) / 2e-6
        assert trajectory.twist(time).angular[2] == pytest.approx(rate, abs=1e-4)


def test_a_smooth_way_is_the_cubic_spline_itself() -> None:
    """From 1 to 9 m/s and back on a bend: nothing there asks for less, so nothing is changed."""
    times = np.arange(0.0, 8.1, 0.5)
    way = times + np.where(times < 4.0, times**2, 32.0 - (8.0 - times) ** 2)
    points = np.stack([20.0 * np.sin(way / 20.0), 20.0 - 20.0 * np.cos(way / 20.0), 0.02 * way], axis=1)
    trajectory, spline = WaypointTrajectory(times, points), CubicSpline(times, points)
    for time in np.linspace(0.0, 8.0, 33):
        assert trajectory.pose(time).position.tolist() == spline(time).tolist()


def test_body_at_rest_looks_along_its_way() -> None:
    trajectory = WaypointTrajectory([0, 1, 2], [[0, 0, 0], [0, 0, 0], [0, 0, 0]], yaw_deg=[90, 90, 90])
    assert trajectory.pose(1.5).yaw == pytest.approx(np.pi / 2)
    parked = WaypointTrajectory([0, 1], [[1, 1, 0], [1, 1, 0]])
    assert parked.pose(0.5).yaw == 0.0
    np.testing.assert_array_equal(parked.twist(0.5).linear, np.zeros(3))


def test_given_heading_may_pass_180_degrees() -> None:
    trajectory = WaypointTrajectory([0, 1, 2], [[0, 0, 0]] * 3, yaw_deg=[170, 180, -170])
    assert trajectory.twist(1.0).angular[2] == pytest.approx(np.radians(10))


@pytest.mark.parametrize("time", [-1e-6, 6.0001, np.inf])
def test_time_outside_is_refused(time: float) -> None:
    with pytest.raises(TimeRangeError, match=r"outside the motion of 'car' \(0 to 6 s\)"):
        arc(0.5).pose(time)


@pytest.mark.parametrize(
    ("times", "positions"),
    [
        ([0.0], [[0, 0, 0]]),
        ([0.0, 0.0], [[0, 0, 0], [1, 0, 0]]),
        ([0.0, 1.0], [[0, 0, 0]]),
        ([0.0, 1.0], [[0, 0, 0], [np.nan, 0, 0]]),
    ],
)
def test_bad_waypoints_are_refused(times: list[float], positions: list[list[float]]) -> None:
    with pytest.raises(ParameterRangeError):
        WaypointTrajectory(times, positions)


def test_constant_twist_turns_and_moves() -> None:
    trajectory = ConstantTwistTrajectory(Pose([1, 2, 0]), Twist([3, 0, 0], [0, 0, 0.5]))
    pose = trajectory.pose(2.0)
    np.testing.assert_allclose(pose.position, [7, 2, 0])
    assert pose.yaw == pytest.approx(1.0)


@pytest.mark.parametrize("size", [0.0, 1e-9, 0.3, 5.0])
def test_a_constant_twist_turns_about_its_axis_in_the_world(size: float) -> None:
    from scipy.spatial.transform import Rotation

    start, angular = Pose([1.0, 2.0, 0.0], [0.3, -0.5, 0.2, 0.7]), size * np.array([0.6, -0.48, 0.64])
    for time in (-7.0, 0.0, 2.5):
        pose = ConstantTwistTrajectory(start, Twist([3.0, 0.0, 0.5], angular)).pose(time)
        expected = Rotation.from_rotvec(angular * time).as_matrix() @ start.rotation
        np.testing.assert_allclose(pose.rotation, expected, atol=1e-14)
        np.testing.assert_allclose(pose.position, np.array([1.0, 2.0, 0.0]) + np.array([3.0, 0.0, 0.5]) * time)


def test_tables() -> None:
    assert isinstance(trajectory_from_table({"kind": "static", "position": [0, 0, 1]}, "a"), StaticTrajectory)
    with pytest.raises(UnknownNameError, match="teleport"):
        trajectory_from_table({"kind": "teleport"}, "a")
    with pytest.raises(ParameterRangeError, match=r"a\.trajectory\.times"):
        trajectory_from_table({"kind": "waypoints", "positions": [[0, 0, 0]]}, "a")
    with pytest.raises(UnknownNameError, match="speed"):
        trajectory_from_table({"kind": "static", "position": [0, 0, 0], "speed": 3}, "a")
