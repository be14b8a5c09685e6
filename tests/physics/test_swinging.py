"""Shapes that swing: velocities are derivatives, a dog's paw rests below its leg, companions stand on the ground."""

from __future__ import annotations

import numpy as np
import pytest

from scarl_sionna.core.errors import ParameterRangeError, UnknownNameError
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.scene.motion.articulation import joints_from_tables, joints_on
from scarl_sionna.scene.motion.trajectory import ConstantTwistTrajectory, StaticTrajectory, WaypointTrajectory
from scenes_xml.actors.bodies.companions import MODELS
from tests.actor_scenes import actor_world

TABLE = {"kind": "swing", "shapes": ["it_arm"], "center": [0.1, -0.2, 1.3], "axis": [2.0, 0.0, 0.0], "mean_deg": 5.0}
BY_TIME = {**TABLE, "amplitude_deg": 24.0, "frequency": 1.5, "phase": 0.1}
BY_WAY = {**TABLE, "amplitude_deg": 16.0, "stride": 0.7}
PATH = WaypointTrajectory([0.0, 1.0, 2.0, 3.0], [[0.0, 0, 0], [0.6, 0.0, 0.0], [1.9, 0.2, 0.0], [3.2, 0.8, 0.0]])


@pytest.mark.parametrize("table", [BY_TIME, BY_WAY])
def test_velocities_are_derivatives_and_the_axis_rests(table):
    joint = joints_from_tables([table], "it", ["it_arm"], PATH)[0]
    step, point = 1e-6, np.array([0.3, -0.1, 1.0])
    for time in (0.4, 1.3, 2.2):
        moved, later, earlier = (joint.motions(time + shift)["it_arm"] for shift in (0.0, step, -step))
        slope = (later.pose.apply(point) - earlier.pose.apply(point)) / (2.0 * step)
        exact = moved.twist.velocity_at(moved.pose.apply(point) - moved.pose.position)
        np.testing.assert_allclose(exact, slope, atol=1e-6)
        np.testing.assert_allclose(moved.pose.apply(TABLE["center"]), TABLE["center"], atol=1e-12)
        assert np.linalg.norm(moved.twist.angular) > 0.0


def test_angles_are_those_of_the_closed_form():
    joint = joints_from_tables([BY_TIME], "it", ["it_arm"], StaticTrajectory(Pose()))[0]
    for time in (0.0, 0.2, 7.1):
        angle = np.radians(5.0 + 24.0 * np.sin(2.0 * np.pi * (1.5 * time + 0.1)))
        turned = joint.motions(time)["it_arm"].pose.rotate([0.0, 0.0, -1.0])
        np.testing.assert_allclose(turned, [0.0, np.sin(angle), -np.cos(angle)], atol=1e-12)


def test_a_swing_by_the_way_follows_another_trajectory():
    joint = joints_from_tables([BY_WAY], "it", ["it_arm"], PATH)[0]
    slow = ConstantTwistTrajectory(Pose(), Twist([0.35, 0.0, 0.0]))
    again = joints_on([joint], slow)[0].motions(1.0)["it_arm"]  # half a cycle
    np.testing.assert_allclose(again.pose.rotate([0.0, 0.0, -1.0])[1], np.sin(np.radians(5.0)), atol=1e-9)


@pytest.mark.parametrize(
    ("change", "error", "word"),
    [
        ({"frequency": None}, ParameterRangeError, "one of frequency and stride"),
        ({"stride": 0.5}, ParameterRangeError, "one of frequency and stride"),
        ({"amplitude_deg": 200.0}, ParameterRangeError, "180 deg"),
        ({"axis": [0.0, 0.0, 0.0]}, ParameterRangeError, "axis"),
        ({"center": [0.0, 0.0]}, ParameterRangeError, "center"),
        ({"shapes": ["it_leg"]}, UnknownNameError, "it_leg"),
        ({"tempo": 1.0}, UnknownNameError, "tempo"),
        ({"frequency": -1.0}, ParameterRangeError, "above 0"),
        ({"amplitude_deg": None}, ParameterRangeError, "missing"),
    ],
)
def test_what_is_not_allowed_is_told(change, error, word):
    table = {key: value for key, value in {**BY_TIME, **change}.items() if value is not None}
    with pytest.raises(error, match=word):
        joints_from_tables([table], "it", ["it_arm"], PATH)


@pytest.mark.parametrize("name", MODELS)
def test_companions_stand_on_the_ground_in_the_middle_of_their_frames(name):
    model = MODELS[name]()
    for parts in (model.detailed, model.light):
        points = np.concatenate([part.mesh.vertices for part in parts.values()])
        assert points[:, 2].min() == pytest.approx(0.0, abs=6e-3)
        assert np.abs(points[:, :2].min(axis=0) + points[:, :2].max(axis=0)).max() < 0.4
    assert sum(len(part.mesh.faces) for part in model.detailed.values()) < 15_000
    assert sum(len(part.mesh.faces) for part in model.light.values()) < 3_800
    for joint in model.joints:
        if joint["kind"] == "wheel":
            assert joint["center"][2] == joint["radius"]


def test_a_paw_rests_on_the_ground_as_its_leg_passes_the_middle(tmp_path):
    """At any speed: amplitude, stride and length of the leg make the paw go back as fast as the dog goes ahead."""
    world = actor_world(
        tmp_path, "dog", {"kind": "constant_twist", "position": [0.0, 0.0, 0.0], "velocity": [1.4, 0.0, 0.0]}
    )
    part = list(world.parts.name).index("it_leg_front_left")
    period, slowest = 0.72 / 1.4, []
    for time in period * (1.0 + np.linspace(0.0, 1.0, 41)):
        state = world.at(float(time))
        paw = state.part_pose(part).apply(np.array([0.255, 0.075, 0.0]))
        later = world.at(float(time) + 1e-5).part_pose(part).apply(np.array([0.255, 0.075, 0.0]))
        slowest.append(np.linalg.norm(later - paw)[()] / 1e-5)
    assert min(slowest) < 0.1 and max(slowest) == pytest.approx(2.8, rel=0.05)


def test_a_hand_waves_beside_the_head(tmp_path):
    world = actor_world(tmp_path, "waving_woman", {"kind": "static", "position": [0.0, 0.0, 0.0]}, "light")
    part = next(k for k, name in enumerate(world.parts.name) if "right_lower_arm_skin" in name)
    tips = []
    for time in np.linspace(0.0, 0.6, 13):
        hand = world.at(float(time)).part_pose(part).apply(world.mesh(part).vertices)
        tips.append(hand[hand[:, 2].argmax()])
    tips = np.array(tips)
    assert np.ptp(tips[:, 1]) > 0.2 and tips[:, 2].min() > 1.4 and tips[:, 1].max() < -0.1
