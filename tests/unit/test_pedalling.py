"""Pedalling legs: a closed linkage of rigid parts, velocities that are derivatives, cadence from the way."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from scarl_sionna.core.errors import ParameterRangeError, UnknownNameError
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.scene.motion.articulation import Accumulated, joints_from_tables
from scarl_sionna.scene.motion.pedalling import PEDALLING_SEGMENTS, Cadence, PedallingLegs
from scarl_sionna.scene.motion.trajectory import ConstantTwistTrajectory, WaypointTrajectory

LEGS = PedallingLegs(
    axle=(-0.10, 0.28),
    crank=0.17,
    hip=(-0.33, 1.015),
    foot_y=0.125,
    upper_leg=0.43,
    lower_leg=0.43,
    pedal_from_ankle=(0.11, -0.075),
    foot_pitch=np.radians(15.0),
    foot_swing=np.radians(15.0),
    foot_lag=np.radians(190.0),
)
ANGLES = np.linspace(-1.0, 7.0, 41)
TABLE = {
    "kind": "pedal", "axle": [-0.10, 0.28], "crank": 0.17, "hip": [-0.33, 1.015], "foot_y": 0.125, "upper_leg": 0.43,
    "lower_leg": 0.43,
    "pedal_from_ankle": [0.11, -0.075], "wheel_radius": 0.345, "gear": 2.3,
}  # fmt: skip # a table
SHAPES = [f"rider_{name}" for name in PEDALLING_SEGMENTS]


def end(motion, point):
    """Position and velocity of a point of a part."""
    pose, twist = motion.pose, motion.twist
    return pose.apply(np.array(point)), twist.velocity_at(pose.rotate(np.array(point)))


@pytest.mark.parametrize("side", ["left", "right"])
def test_the_linkage_is_closed(side):
    """Hip, knee, ankle, pedal and axle.

    Every joint is one point with one velocity, seen from both parts that it holds.
    """
    sign = 1.0 if side == "left" else -1.0
    for angle in ANGLES:
        moved = LEGS.motions(angle, 7.3)
        part = {name.removeprefix(f"{side}_"): motion for name, motion in moved.items()}
        hip = (np.array([-0.33, sign * 0.125, 1.015]), np.zeros(3))
        pairs = [
            (end(part["upper_leg"], [0, 0, 0]), hip),
            (end(part["upper_leg"], [0, 0, -0.43]), end(part["lower_leg"], [0, 0, 0])),
            (end(part["lower_leg"], [0, 0, -0.43]), end(part["foot"], [0, 0, 0])),
            (end(part["foot"], [0.11, 0, -0.075]), end(part["pedal"], [0, 0, 0])),
            (end(part["pedal"], [0, 0, 0]), end(part["cranks"], [sign * 0.17, sign * 0.125, 0])),
        ]
        for (one, its_speed), (other, other_speed) in pairs:
            np.testing.assert_allclose(one, other, atol=1e-12)
            np.testing.assert_allclose(
                its_speed, other_speed, atol=1e-12
            )  # a few eps over sin(knee) > 0.4, speeds of 3 m/s
        np.testing.assert_allclose(part["pedal"].pose.rotation, part["foot"].pose.rotation, atol=1e-15)


def test_velocities_are_the_derivatives_of_the_poses():
    """Richardson's extrapolation of central differences; its error is some eps / step = 1e-12 plus step^4."""
    rate, step, point = 7.3, 1e-3, np.array([0.05, 0.02, -0.2])
    for angle in ANGLES:
        moved = LEGS.motions(angle, rate)
        for name in PEDALLING_SEGMENTS:
            where = {k: LEGS.motions(angle + k * step * rate, rate)[name].pose.apply(point) for k in (-2, -1, 1, 2)}
            slope = (8.0 * (where[1] - where[-1]) - (where[2] - where[-2])) / (12.0 * step)
            exact = end(moved[name], point)[1]
            np.testing.assert_allclose(exact, slope, atol=1e-8)


def test_the_knee_points_forward_and_the_leg_is_nearly_straight_at_the_bottom():
    flexion = []
    for angle in ANGLES:
        moved = LEGS.motions(angle, 0.0)
        thigh, shank = (moved[f"left_{name}_leg"].pose.rotation @ [0.0, 0.0, -1.0] for name in ("upper", "lower"))
        flexion.append(np.degrees(np.arccos(thigh @ shank)))
        assert thigh[0] > shank[0]
    assert 20.0 < min(flexion) < 45.0 < 95.0 < max(flexion) < 125.0  # what cyclists are measured to have


def test_right_is_half_a_turn_behind_left():
    left, right = LEGS.motions(0.4, 7.3), LEGS.motions(0.4 + np.pi, 7.3)
    for name in ("pedal", "foot", "lower_leg", "upper_leg"):
        a, b = left[f"left_{name}"], right[f"right_{name}"]
        np.testing.assert_allclose(a.pose.position, b.pose.position * [1, -1, 1], atol=1e-12)
        np.testing.assert_allclose(a.twist.linear, b.twist.linear * [1, -1, 1], atol=1e-12)


def test_cranks_turn_by_the_way():
    speed = 5.0
    rest = ConstantTwistTrajectory(Pose(), Twist([speed, 0.0, 0.0]))
    (joint,) = joints_from_tables([TABLE], "rider", SHAPES, rest)
    way_of_a_turn = 2.0 * np.pi * 0.345 * 2.3
    assert way_of_a_turn == pytest.approx(4.99, abs=0.01)  # development of a middle gear; 5 m/s are 60 turns a minute
    for turns in (0.25, 1.0, 3.5):
        cranks = joint.motions(turns * way_of_a_turn / speed)["rider_cranks"]
        np.testing.assert_allclose(
            cranks.pose.rotation[:, 0], [np.cos(2 * np.pi * turns), 0, -np.sin(2 * np.pi * turns)], atol=1e-9
        )
        np.testing.assert_allclose(cranks.twist.angular, [0, 2 * np.pi * speed / way_of_a_turn, 0], rtol=1e-12)


def test_joint_velocities_while_the_cyclist_speeds_up():
    times = np.linspace(0.0, 6.0, 13)
    ride = WaypointTrajectory(times, np.stack([2.0 * times + 0.3 * times**2, 0 * times, 0 * times], axis=1))
    (joint,) = joints_from_tables([{**TABLE, "cadence_limit": 55.0}], "rider", SHAPES, ride)
    step, point = 1e-4, np.array([0.05, 0.0, -0.2])
    for time in (0.7, 2.2, 5.0):  # 55 turns a minute are reached at 4.6 m/s, after 4.3 s
        moved = joint.motions(time)
        where = {k: joint.motions(time + k * step) for k in (-2, -1, 1, 2)}
        for shape in SHAPES:
            place = {k: motions[shape].pose.apply(point) for k, motions in where.items()}
            slope = (8.0 * (place[1] - place[-1]) - (place[2] - place[-2])) / (12.0 * step)
            np.testing.assert_allclose(end(moved[shape], point)[1], slope, atol=1e-8)


def test_cadence_has_its_limit_and_rests():
    free = Cadence(0.345, 2.3)
    assert free.rate(5.0) == pytest.approx(5.0 / (0.345 * 2.3), rel=1e-15)
    assert free.rate(-1.0) == 0.0 and free.rate(0.0) == 0.0
    limited = Cadence(0.345, 2.3, limit=1.5)
    assert limited.rate(30.0) == pytest.approx(3.0 * np.pi)
    coasting = Cadence(0.345, 2.3, coast_above=10.0)
    assert coasting.rate(9.0) == free.rate(9.0) and coasting.rate(10.0) == 0.0 and coasting.rate(20.0) == 0.0
    speeds = np.linspace(8.5, 10.5, 2001)
    steps = np.diff([coasting.rate(v) for v in speeds])
    assert (
        np.abs(steps).max() < 0.001 * 1.5 * 12.6 / 1.0 * 1.05
    )  # no jump: smoothstep's slope is 1.5 over 1 m/s, the rate 12.6 rad/s


def test_the_joint_stands_still_where_the_cyclist_coasts():
    fast = ConstantTwistTrajectory(Pose(), Twist([12.0, 0.0, 0.0]))
    (joint,) = joints_from_tables([{**TABLE, "coast_above": 8.0, "phase": 0.25}], "rider", SHAPES, fast)
    early, late = joint.motions(0.0), joint.motions(2.0)
    for shape in SHAPES:
        assert not late[shape].twist.linear.any() and not late[shape].twist.angular.any()
        np.testing.assert_array_equal(early[shape].pose.position, late[shape].pose.position)
    assert early["rider_left_pedal"].pose.position[2] == pytest.approx(0.28 - 0.17)
    assert Accumulated(fast, Cadence(0.345, 2.3, coast_above=8.0).rate).at(5.0) == 0.0


def test_bad_pedals_are_refused():
    ride = ConstantTwistTrajectory(Pose(), Twist([5.0, 0.0, 0.0]))
    with pytest.raises(ParameterRangeError, match=r"hip and ankle.*m.*move the hip"):
        dataclasses.replace(LEGS, hip=(-0.33, 1.2))
    with pytest.raises(ParameterRangeError, match="crank"):
        dataclasses.replace(LEGS, crank=-0.17)
    with pytest.raises(ParameterRangeError, match="gear"):
        joints_from_tables([{**TABLE, "gear": 0.0}], "rider", SHAPES, ride)
    with pytest.raises(ParameterRangeError, match="hip"):
        joints_from_tables([{**TABLE, "hip": [0.0, 0.1, 0.9]}], "rider", SHAPES, ride)
    with pytest.raises(ParameterRangeError, match="_left_pedal"):
        joints_from_tables([TABLE], "rider", [name for name in SHAPES if "left_pedal" not in name], ride)
    with pytest.raises(UnknownNameError, match="cadence"):
        joints_from_tables([{**TABLE, "cadence": 70}], "rider", SHAPES, ride)
    with pytest.raises(ParameterRangeError, match="gear"):
        joints_from_tables([{key: value for key, value in TABLE.items() if key != "gear"}], "rider", SHAPES, ride)
