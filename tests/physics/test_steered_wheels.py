"""Front wheels in bends: they point where their middles go, roll without slip, and their velocities are derivatives."""

from __future__ import annotations

import numpy as np
import pytest

from scarl_sionna.scenario.motion.bodies import ActorBody
from scarl_sionna.scenario.motion.paths import PathTrajectory
from scarl_sionna.scenario.motion.profiles import SpeedProfile
from scarl_sionna.scenario.motion.routes import timed_trajectory, vehicle_trajectory
from scarl_sionna.scenario.traffic.planned import PresentTrajectory
from scarl_sionna.scene.actors.model import read_actor_model
from scarl_sionna.scene.motion.articulation import Wheel, joints_from_tables, joints_on
from scarl_sionna.scene.motion.trajectory import StaticTrajectory, Trajectory, WaypointTrajectory

CAR = ActorBody()
RADIUS, BEND, AXLE = 0.32, 12.0, 1.35
PLACES = [(AXLE, 0.8), (AXLE, -0.8), (-AXLE, 0.8)]


def wheels(trajectory: Trajectory, steered: bool = True) -> list[Wheel]:
    tables = [
        {"kind": "wheel", "shapes": [f"w{number}"], "center": [x, y, RADIUS], "radius": RADIUS, "steered": steered}
        for number, (x, y) in enumerate(PLACES)
    ]
    shapes = [f"w{number}" for number in range(len(PLACES))]
    return [joint for joint in joints_from_tables(tables, "car", shapes, trajectory) if isinstance(joint, Wheel)]


def circle() -> PathTrajectory:
    angle = np.linspace(0.0, 4.5, 90)
    points = np.column_stack([BEND * np.sin(angle), BEND - BEND * np.cos(angle), 0.0 * angle])
    return vehicle_trajectory(points, speed=4.0, model=CAR)


def slalom() -> PathTrajectory:
    x = np.arange(0.0, 81.0, 4.0)
    points = np.column_stack([x, 2.0 * np.sin(x / 9.0), 0.0 * x])
    return vehicle_trajectory(points, speed=SpeedProfile(6.0).hold(1.0).reach(3.0, 2.0, 4.0), model=CAR)


def backing() -> PathTrajectory:
    points = [[0.0, 0.0, 0.0], [-4.0, 0.0, 0.0], [-8.0, 1.0, 0.0], [-11.0, 4.0, 0.0], [-12.0, 8.0, 0.0]]
    return timed_trajectory(points, [0.0, 2.0, 4.0, 6.0, 8.0], CAR, reverse=True)


def test_on_a_circle_the_angles_are_ackermann_s() -> None:
    motion = circle()
    axes = [joint.motions(8.0)[joint.shapes[0]].pose.rotate([0.0, 1.0, 0.0]) for joint in wheels(motion)]
    for (x, y), axis in zip(PLACES, axes, strict=True):
        steering = np.degrees(np.arctan2(-axis[0], axis[1]))
        assert steering == pytest.approx(np.degrees(np.arctan2(x + AXLE, BEND - y)), abs=0.1)


@pytest.mark.parametrize("motion", [circle(), slalom(), backing()], ids=["circle", "slalom", "backing"])
def test_what_touches_the_road_rests(motion) -> None:
    """To the side, too: a wheel that does not steer slips by speed times wheelbase over radius, 0.9 m/s here."""
    slips = {True: 0.0, False: 0.0}
    for time in np.linspace(motion.start + 0.05, motion.stop - 0.05, 41).tolist():
        pose, twist = motion.pose(time), motion.twist(time)
        for steered in slips:
            for (x, y), joint in zip(PLACES, wheels(motion, steered), strict=True):
                below = np.array([x, y, 0.0])
                moved = joint.motions(time)[joint.shapes[0]]
                rolling = pose.rotate(moved.twist.velocity_at(below - moved.pose.position))
                contact = rolling + twist.velocity_at(pose.rotate(below))
                slips[steered] = max(slips[steered], float(np.linalg.norm(contact)))
    assert slips[True] < 1e-3 < 0.1 < slips[False]


@pytest.mark.parametrize("motion", [circle(), slalom(), backing()], ids=["circle", "slalom", "backing"])
def test_velocities_of_steered_wheels_are_derivatives(motion) -> None:
    step, points = 1e-5, np.array([[0.1, 0.2, 0.3], [AXLE + RADIUS, 0.8, RADIUS]])
    for time in np.linspace(motion.start + 0.05, motion.stop - 0.05, 31).tolist():
        for joint in wheels(motion):
            now, later, earlier = (joint.motions(time + shift)[joint.shapes[0]] for shift in (0.0, step, -step))
            slope = (later.pose.apply(points) - earlier.pose.apply(points)) / (2.0 * step)
            places = now.pose.apply(points)
            exact = np.array([now.twist.velocity_at(place - now.pose.position) for place in places])
            np.testing.assert_allclose(exact, slope, atol=1e-5)


def test_who_stands_in_a_bend_keeps_the_wheels_turned() -> None:
    angle = np.linspace(0.0, 3.0, 60)
    points = np.column_stack([BEND * np.sin(angle), BEND - BEND * np.cos(angle), 0.0 * angle])
    motion = vehicle_trajectory(points, speed=SpeedProfile(4.0).stop_at(20.0), model=CAR)
    front = wheels(motion)[0]
    stop = motion.stop - 0.1
    assert motion.speed(stop) == pytest.approx(0.0, abs=1e-6)
    axis = front.motions(stop)[front.shapes[0]].pose.rotate([0.0, 1.0, 0.0])
    assert np.degrees(np.arctan2(-axis[0], axis[1])) == pytest.approx(13.5, abs=0.3)
    np.testing.assert_allclose(front.motions(stop)[front.shapes[0]].twist.angular, 0.0, atol=1e-6)


def test_it_follows_another_way_and_one_that_is_away_and_stays_straight_where_nobody_knows() -> None:
    motion = circle()
    joints = joints_on(wheels(StaticTrajectory(motion.pose(0.0))), PresentTrajectory(motion, (2.0, 5.0)))
    turned = joints[0].motions(4.0)["w0"].pose.rotate([0.0, 1.0, 0.0])
    np.testing.assert_allclose(turned, wheels(motion)[0].motions(4.0)["w0"].pose.rotate([0.0, 1.0, 0.0]), atol=1e-12)
    times = np.linspace(0.0, 4.0, 9)
    plain = WaypointTrajectory(
        times, np.column_stack([5.0 * np.sin(times / 2), 5.0 - 5.0 * np.cos(times / 2), 0 * times])
    )
    np.testing.assert_allclose(
        wheels(plain)[0].motions(2.0)["w0"].pose.rotate([0.0, 1.0, 0.0]), [0.0, 1.0, 0.0], atol=1e-12
    )


@pytest.mark.parametrize(
    "name", ["small_car", "saloon", "estate", "suv", "pickup", "van", "box_van", "lorry", "bus", "coach"]
)
def test_the_front_wheels_of_all_models_steer(name) -> None:
    joints = [joint for joint in read_actor_model(name).joints if joint["kind"] == "wheel"]
    assert [joint["center"][0] > 0.0 for joint in joints] == [bool(joint.get("steered", False)) for joint in joints]
    assert sum(bool(joint.get("steered", False)) for joint in joints) == 2
