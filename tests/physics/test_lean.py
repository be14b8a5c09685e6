"""Two-wheelers lean into bends by atan(v^2 / (g r)), about the feet of their wheels; velocities are derivatives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scarl_sionna.scenario.checks.motion import contacts
from scarl_sionna.scenario.motion.bodies import ActorBody, body_of
from scarl_sionna.scenario.motion.paths import PathTrajectory
from scarl_sionna.scenario.motion.profiles import SpeedProfile
from scarl_sionna.scenario.motion.routes import vehicle_trajectory
from scarl_sionna.scenario.motion.tilt import LEAN

BIKE = ActorBody(2.05, 0.95, 1.68, 1.43, -0.715, "cycle")


def circle(radius: float, speed: float, body: ActorBody = BIKE) -> PathTrajectory:
    """Return a bend to the left, to the right where the radius is negative."""
    angle = np.linspace(0.0, 4.0, 160)
    points = np.column_stack([abs(radius) * np.sin(angle), radius * (1.0 - np.cos(angle)), 0.0 * angle])
    return vehicle_trajectory(points, speed=speed, model=body)


def slalom() -> PathTrajectory:
    """Return a way with bends to both sides over a hill, ever slower."""
    x = np.arange(0.0, 101.0, 2.0)
    points = np.column_stack([x, 2.0 * np.sin(x / 9.0), 0.8 * np.sin(x / 25.0)])
    return vehicle_trajectory(points, speed=SpeedProfile(9.0).hold(2.0).reach(4.0, 2.0, 4.0), model=BIKE)


@pytest.mark.parametrize(("radius", "speed"), [(30.0, 10.0), (-30.0, 10.0), (12.0, 4.0), (200.0, 30.0)])
def test_on_a_circle_it_is_the_angle_at_which_weight_and_centrifugal_force_pass_the_feet(radius, speed) -> None:
    motion = circle(radius, speed)
    time = 0.6 * motion.stop
    pose = motion.pose(time)
    up, left = pose.rotation[:, 2], np.array([-np.sin(pose.yaw), np.cos(pose.yaw), 0.0])
    leaning = np.arctan2(up @ left, up[2])
    assert np.degrees(leaning) == pytest.approx(np.degrees(np.arctan(speed**2 / (9.80665 * radius))), abs=0.05)
    np.testing.assert_allclose(motion.twist(time).angular, [0.0, 0.0, speed / radius], atol=2e-3)
    for body in (replace(BIKE, motion="vehicle"), ActorBody()):
        assert circle(radius, speed, body).pose(time).rotation[2, 2] == pytest.approx(1.0, abs=1e-12)


def test_it_leans_no_further_than_tyres_hold() -> None:
    motion = circle(10.0, 14.0)  # 63 deg by the formula
    assert np.arccos(motion.pose(0.6 * motion.stop).rotation[2, 2]) == pytest.approx(LEAN, abs=1e-9)
    np.testing.assert_allclose(motion.twist(0.6 * motion.stop).angular[:2], 0.0, atol=1e-6)


@pytest.mark.parametrize("motion", [slalom(), circle(25.0, 9.0)], ids=["slalom", "circle"])
def test_velocities_are_derivatives_and_the_feet_stay(motion) -> None:
    step, points = 1e-5, np.array([[0.0, 0.0, 1.7], [0.9, -0.4, 1.0], [-0.715, 0.0, 0.0], [0.715, 0.0, 0.0]])
    upright = PathTrajectory(motion.path, motion.way, replace(BIKE, motion="vehicle"), motion.start, motion.stop)
    most = 0.0
    for time in np.linspace(motion.start + 0.05, motion.stop - 0.05, 41).tolist():
        pose, twist = motion.pose(time), motion.twist(time)
        slope = (motion.pose(time + step).apply(points) - motion.pose(time - step).apply(points)) / (2.0 * step)
        places = pose.apply(points)
        exact = np.array([twist.velocity_at(place - pose.position) for place in places])
        np.testing.assert_allclose(exact, slope, atol=2e-5)
        np.testing.assert_allclose(places[2:], upright.pose(time).apply(points)[2:], atol=1e-12)
        most = max(most, float(np.linalg.norm(twist.angular[:2])))
    assert most > 0.2 or motion.path.length > 90.0  # the slalom leans to and fro


@pytest.mark.parametrize("name", ["bicycle", "cargo_bike", "scooter", "motorcycle"])
def test_models_of_two_wheelers_lean(name) -> None:
    body = body_of(name)
    assert (contacts(body)[:, 1] == 0.0).all() and len(contacts(body)) == 2  # two wheels, which stay where they are
    assert -circle(20.0, 6.0, body).tilt(3.0).roll[0] == pytest.approx(np.arctan(36.0 / (9.80665 * 20.0)), abs=1e-3)
