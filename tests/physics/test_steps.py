"""Feet of walkers: who has a foot on the ground does not slide, on any way, and legs reach the feet."""

from __future__ import annotations

import numpy as np
import pytest

from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.scene.actors.model import read_actor_model
from scarl_sionna.scene.motion.articulation import joints_from_tables
from scarl_sionna.scene.motion.gait import SEGMENTS, SIDES, SOLE, WalkingGait
from scarl_sionna.scene.motion.trajectory import ConstantTwistTrajectory, WaypointTrajectory, forward_speeds

STILL, CONTACT = 0.02, 0.01
"""[m/s], [m]"""


def walk(trajectory, height=1.75, phase=0.0, **own):
    """The joint of a walker whose shapes have the names of the segments."""
    return joints_from_tables([{"kind": "walk", "height": height, "phase": phase, **own}], "it", SEGMENTS, trajectory)[
        0
    ]


def soles(joint, time):
    """By side: whether it is in stance, and heel, ball and toe in the world with their velocities [m, m/s]."""
    moved, pose, twist = joint.motions(time), joint.trajectory.pose(time), joint.trajectory.twist(time)
    speed = max(float(forward_speeds(joint.trajectory, np.array([time]))[0]), 0.0)
    support = joint.gait.support(speed)
    found = {}
    for side, shift in SIDES.items():
        foot = moved[f"{side}_foot"]
        points = foot.pose.apply(SOLE * joint.gait.lengths.foot)
        own = np.array([foot.twist.velocity_at(point - foot.pose.position) for point in points])
        world = pose.apply(points)
        moving = np.array([twist.velocity_at(point - pose.position) for point in world]) + pose.rotate(own)
        phase = (joint.phase.at(time) + joint.phase_offset + shift) % 1.0
        found[side] = phase < support, world, moving
    return found


def check_feet(joint, times, ground=lambda _: 0.0):
    """Assert that a foot in stance touches the ground and rests there, and return how many do at each time.

    Contact is the sole's lowest point; it passes from heel to toe while the whole sole stands.
    """
    down = []
    for time in times:
        found = soles(joint, time)
        down.append(sum(standing for standing, *_ in found.values()))
        for standing, points, velocity in found.values():
            lowest = points[:, 2].argmin()
            height = points[lowest, 2] - ground(points[lowest])
            assert height > -1e-3, time
            if standing:
                assert abs(height) < CONTACT, time
                assert np.linalg.norm(velocity[lowest]) < STILL, time
    return np.array(down)


def check_joints(joint, times):
    """Assert that thigh, shank and foot hang together within a millimetre."""
    lengths = joint.gait.lengths
    for time in times:
        moved = joint.motions(time)
        for side in SIDES:
            upper, lower = moved[f"{side}_upper_leg"].pose, moved[f"{side}_lower_leg"].pose
            foot = moved[f"{side}_foot"].pose
            np.testing.assert_allclose(upper.apply([0.0, 0.0, -lengths.upper_leg]), lower.position, atol=1e-9)
            np.testing.assert_allclose(lower.apply([0.0, 0.0, -lengths.lower_leg]), foot.position, atol=1e-3)


def turning():
    """Somebody who starts, walks a bend of 3 m, stops, waits and goes on."""
    times = np.linspace(0.0, 12.0, 121)
    speed = 1.3 * np.clip(np.minimum(times, np.abs(times - 7.0) - 1.0), 0.0, 1.0)
    smooth = np.convolve(np.pad(speed, 5, "edge"), np.full(11, 1 / 11), "valid")
    way = np.concatenate([[0.0], np.cumsum((smooth[1:] + smooth[:-1]) / 2.0 * 0.1)])
    angle = way / 3.0
    return WaypointTrajectory(
        times, np.stack([3.0 * np.sin(angle), 3.0 - 3.0 * np.cos(angle), 0.0 * way], 1), np.degrees(angle)
    )


@pytest.mark.some(2)
@pytest.mark.parametrize("height", [1.05, 1.78])
@pytest.mark.parametrize("relative", [0.1, 1.0, 1.7, 2.99])
def test_the_foot_on_the_ground_stands_still(height, relative):
    speed = relative * WalkingGait(height).lengths.leg
    joint = walk(ConstantTwistTrajectory(Pose(), Twist([speed, 0.0, 0.0])), height, 0.3)
    times = np.linspace(0.0, 1.0 / joint.gait.cadence(speed), 67)
    check_feet(joint, times)
    check_joints(joint, times)


def test_feet_rest_in_a_bend_while_somebody_starts_and_stops():
    joint, times = walk(turning()), np.linspace(0.01, 11.99, 200)
    down = check_feet(joint, times)
    check_joints(joint, times[::4])
    assert min(down) >= 1  # somebody who walks always stands on a foot
    still = np.array([[p[:2] for _, p, _ in soles(joint, time).values()] for time in (7.0, 7.4)])
    np.testing.assert_allclose(still[0], still[1], atol=2e-3)  # while waiting


@pytest.mark.parametrize("name", ["boy_8", "woman_52", "man_38"])
def test_feet_rest_whatever_the_lengths_of_a_body(name):
    """People of all ages, each with lengths of its own: in a bend, starting and stopping; joints hang together."""
    table = next(dict(row) for row in read_actor_model(name).joints if row["kind"] == "walk")
    table.pop("kind")
    joint, times = walk(turning(), **table), np.linspace(0.01, 11.99, 120)
    check_feet(joint, times)
    check_joints(joint, times[::4])
    arm = joint.gait.lengths.upper_arm
    for time in (1.0, 4.3):
        moved = joint.motions(time)
        below = moved["left_upper_arm"].pose.apply([0.0, 0.0, -arm])
        np.testing.assert_allclose(below, moved["left_lower_arm"].pose.position, atol=1e-9)
        step, point = 1e-5, np.array([0.1, 0.05, -0.2])
        later, earlier = joint.motions(time + step), joint.motions(time - step)
        for segment in SEGMENTS:
            slope = (later[segment].pose.apply(point) - earlier[segment].pose.apply(point)) / (2.0 * step)
            exact = moved[segment].twist.velocity_at(moved[segment].pose.rotate(point))
            np.testing.assert_allclose(exact, slope, atol=2e-3, err_msg=segment)


def test_prints_are_the_same_whatever_was_asked_before():
    one, other = walk(turning()), walk(turning())
    for time in (11.0, 0.5, 6.0):
        one.motions(time)
    for time in (6.3, 10.0):
        first, second = one.motions(time), other.motions(time)
        for name in SEGMENTS:
            np.testing.assert_allclose(first[name].pose.position, second[name].pose.position, atol=1e-7)


def test_velocities_are_derivatives_in_a_bend_with_changing_speed():
    """Of every segment, in the walker's frame, by differences of poses; from 5 cm/s on."""
    joint, step, point = walk(turning()), 1e-5, np.array([0.1, 0.05, -0.2])
    times = np.linspace(0.13, 11.7, 40)
    for time in times[forward_speeds(joint.trajectory, times) > 0.05].tolist():
        moved, later, earlier = (joint.motions(time + shift) for shift in (0.0, step, -step))
        for name in SEGMENTS:
            slope = (later[name].pose.apply(point) - earlier[name].pose.apply(point)) / (2.0 * step)
            exact = moved[name].twist.velocity_at(moved[name].pose.rotate(point))
            np.testing.assert_allclose(exact, slope, atol=2e-3, err_msg=f"{name} at {time}")


def test_hips_sink_at_the_strike_by_some_centimetres():
    """A man at 1.4 m/s: 4 to 6 cm less than on straight legs, and at most 4 cm between highest and lowest."""
    gait = WalkingGait(1.75)
    heights = [gait.motions(phase, 1.4)["pelvis"].pose.position[2] for phase in np.linspace(0.0, 1.0, 60)]
    straight = gait.motions(0.0, 0.0)["pelvis"].pose.position[2]
    assert 0.03 < straight - min(heights) < 0.06
    assert max(heights) - min(heights) < 0.04


def test_who_is_carried_backward_keeps_the_feet_below():
    joint = walk(ConstantTwistTrajectory(Pose(), Twist([-1.0, 0.0, 0.0])))
    assert joint.prints is None
    for time in (0.0, 30.0):
        assert np.abs(joint.motions(time)["left_foot"].pose.position[:2]).max() < 0.5
