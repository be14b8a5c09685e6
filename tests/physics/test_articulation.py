"""Parts that move on their own: wheels without slip, limbs of a walker, and what a radar sees of them."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

import scarl_sionna as ss
from scarl_sionna.core.errors import ParameterRangeError, UnknownNameError
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.scene.motion.articulation import Accumulated, Rolling, joints_from_tables
from scarl_sionna.scene.motion.gait import SEGMENTS, SOLE, WalkingGait
from scarl_sionna.scene.motion.trajectory import ConstantTwistTrajectory, Motion, StaticTrajectory, WaypointTrajectory
from tests.scenes import Thing, write_scene

SPEED, RADIUS = 15.0, 0.32


def _roller(folder, **joint):
    """A disc of radius 0.32 m that rolls along x on the ground, as an actor of one shape."""
    disc = trimesh.creation.cylinder(RADIUS, 0.2, sections=64)
    disc.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [1, 0, 0]))
    disc.apply_translation([0, 0, RADIUS])
    table = {"kind": "wheel", "shapes": ["shape-disc"], "center": [0.0, 0.0, RADIUS], "radius": RADIUS, **joint}
    motion = {"kind": "constant_twist", "position": [10.0, 0.0, 0.0], "velocity": [SPEED, 0.0, 0.0]}
    return ss.load_scene(write_scene(folder, actors=[Thing("disc", disc, "Car", trajectory=motion, joints=[table])]))


def test_a_wheel_rolls_without_slip(tmp_path):
    world = _roller(tmp_path)
    for time in (0.0, 0.1, 3.7):
        state = world.at(time)
        contact = np.array([10.0 + SPEED * time, 0.0, 0.0])
        points = contact + np.array([[0, 0, 0], [0, 0, RADIUS], [0, 0, 2 * RADIUS]])
        velocity = state.point_velocity(np.zeros(3, np.int32), points)
        np.testing.assert_allclose(velocity, [[0, 0, 0], [SPEED, 0, 0], [2 * SPEED, 0, 0]], atol=1e-12)


def test_wheel_doppler_span(tmp_path):
    """micro_doppler.rolling_wheel of the vectors: 15 m/s, 76.5 GHz: 0 to 15310.59 Hz about 7655.30 Hz, 7.4604 rev/s."""
    world = _roller(tmp_path)
    state = world.at(1.0)
    angle = np.linspace(-np.pi, np.pi, 721)
    rim = np.array([10.0 + SPEED, 0.0, RADIUS]) + RADIUS * np.stack([np.sin(angle), 0 * angle, np.cos(angle)], axis=1)
    doppler = 2 * state.point_velocity(np.zeros(721, np.int32), rim)[:, 0] * 76.5e9 / 299792458.0
    np.testing.assert_allclose([doppler.min(), doppler.max()], [0.0, 15310.59], atol=0.01)
    turns = Pose(np.zeros(3), state.part_pose(0).quaternion).rotate([0.0, 0.0, 1.0])
    expected = 2 * np.pi * 7.4604 * 1.0
    np.testing.assert_allclose(np.arctan2(turns[0], turns[2]), np.angle(np.exp(1j * expected)), atol=1e-3)


def test_the_meshes_of_a_wheel_turn(tmp_path):
    world = _roller(tmp_path)
    quarter = np.pi / 2 * RADIUS / SPEED
    before, after = world.at(0.0)._triangles.corners, world.at(quarter)._triangles.corners
    middle = np.array([10.0, 0.0, RADIUS])
    turned = before - middle
    turned = np.stack([turned[..., 2], turned[..., 1], -turned[..., 0]], axis=-1) + middle + [SPEED * quarter, 0, 0]
    np.testing.assert_allclose(after, turned, atol=1e-6)
    hit = world.at(quarter).cast([[0.0, 0.0, 0.5]], [[1.0, 0.0, 0.0]])
    assert hit.num_hits == 1
    expected = world.at(quarter).point_velocity(hit.part, hit.point)
    np.testing.assert_array_equal(hit.velocity, expected)
    assert abs(hit.velocity[0, 2]) > 5.0  # the front of the rim rises


@pytest.mark.parametrize("side", [0.8, 0.0, -0.8])
def test_in_a_bend_each_wheel_rolls_its_own_way(side):
    """On a circle of 10 m to the left: the contact stands still along the wheel, the angle is that of its own radius.

    Without it (both by the way of the car's middle) the inner and the outer wheel slip by 8 % of the speed.
    """
    speed, radius_of_bend = 5.0, 10.0
    turn = speed / radius_of_bend
    times = np.linspace(0.0, 8.0, 161)
    way = np.stack([np.sin(turn * times), 1.0 - np.cos(turn * times), 0.0 * times], axis=1) * radius_of_bend
    track = WaypointTrajectory(times, way, np.degrees(turn * times))
    table = {"kind": "wheel", "shapes": ["wheel"], "center": [1.3, side, RADIUS], "radius": RADIUS}
    wheel = joints_from_tables([table], "car", ["wheel"], track)[0]
    for time in (2.0, 3.3, 7.5):  # more than half a turn
        motion = wheel.motions(time)["wheel"]
        below = np.array([1.3, side, 0.0])
        rolling = motion.twist.velocity_at(below - motion.pose.position)
        moving = track.pose(time).inverse().rotate(track.twist(time).velocity_at(track.pose(time).rotate(below)))
        np.testing.assert_allclose((rolling + moving)[0], 0.0, atol=1e-4)
        spoke = motion.pose.rotate([0.0, 0.0, 1.0])
        angle = (radius_of_bend - side) * turn * time / RADIUS
        np.testing.assert_allclose(spoke[[0, 2]], [np.sin(angle), np.cos(angle)], atol=2e-4)


def test_way_travelled_by_a_car_that_brakes_turns_and_reverses():
    times = np.linspace(0, 8, 17)
    angle = 0.8 * np.sin(times / 3)
    track = WaypointTrajectory(times, np.stack([20 * np.sin(angle), 20 - 20 * np.cos(angle), 0 * times], axis=1))
    fine = np.linspace(0, 8, 80001)
    steps = np.diff([track.pose(t).position for t in fine[::100]], axis=0)
    way = Accumulated(track, lambda speed: speed)
    np.testing.assert_allclose(way.at(8.0), np.linalg.norm(steps, axis=1).sum(), rtol=1e-4)
    assert way.at(3.1) == Accumulated(track, lambda speed: speed).at(3.1)  # whatever was asked before


def test_way_before_time_zero():
    back = ConstantTwistTrajectory(Pose(), Twist([3.0, 0.0, 0.0]))
    np.testing.assert_allclose(Accumulated(back, lambda speed: speed).at(-2.1), -6.3, rtol=1e-12)


class Unsaid:
    """A motion that does not say whether it is steady."""

    start, stop = -np.inf, np.inf

    def __init__(self, motion: ConstantTwistTrajectory) -> None:
        self.pose, self.twist = motion.pose, motion.twist


STEADY = {
    "straight on": ConstantTwistTrajectory(Pose.from_euler([1.0, 2.0, 0.0], yaw=0.5), Twist([3.0, 0.4, 0.0])),
    "on the spot": ConstantTwistTrajectory(Pose(), Twist(angular=[0.0, 0.0, -0.3])),
}


@pytest.mark.parametrize("name", STEADY)
def test_a_steady_motion_is_known_at_once_at_the_clock_of_unix(name):
    motion, now = STEADY[name], 1.7e9 + 0.25
    rolling, summed = Rolling(motion), Rolling(Unsaid(motion))
    assert motion.is_steady
    for time in (-3.7, 0.0, 8.3):
        np.testing.assert_allclose(rolling.at(time), summed.at(time), rtol=1e-12, atol=1e-12)
    before, after = np.array(rolling.at(now)), np.array(rolling.at(now + 0.5))
    np.testing.assert_allclose(after[:2] - before[:2], 0.5 * before[2:], atol=2e-6)
    np.testing.assert_allclose(after[2:], before[2:], rtol=1e-12)
    with pytest.raises(ParameterRangeError, match="within 250000 s of 0 s, where wheels and limbs of the motion begin"):
        summed.at(now)


def test_a_turn_while_it_drives_is_not_steady():
    assert not ConstantTwistTrajectory(Pose(), Twist([3.0, 0.0, 0.0], [0.0, 0.0, 0.1])).is_steady
    assert not ConstantTwistTrajectory(Pose(), Twist(angular=[0.2, 0.0, 0.1])).is_steady
    assert StaticTrajectory(Pose()).is_steady


@pytest.mark.parametrize("speed", [0.4, 1.3, 2.15, 2.4, 5.5])
def test_velocities_of_limbs_are_the_derivatives_of_their_poses(speed):
    gait, step, point = WalkingGait(1.75), 1e-6, np.array([0.1, 0.05, -0.2])
    for phase in np.linspace(0.003, 1.0, 41):
        moved = gait.motions(phase, speed)
        later, earlier = (gait.motions(phase + sign * step * gait.cadence(speed), speed) for sign in (1, -1))
        for segment in SEGMENTS:
            slope = (later[segment].pose.apply(point) - earlier[segment].pose.apply(point)) / (2 * step)
            exact = moved[segment].twist.velocity_at(moved[segment].pose.rotate(point))
            np.testing.assert_allclose(exact, slope, atol=1e-4)


@pytest.mark.parametrize("speed", [1.0, 2.15, 3.5])
def test_velocities_of_limbs_while_the_walker_speeds_up(speed):
    gait, step, point = WalkingGait(1.75), 1e-5, np.array([0.1, 0.05, -0.2])
    moved = gait.motions(0.3, speed, acceleration=0.5)
    poses = [gait.motions(0.3 + s * step * gait.cadence(speed), speed + s * 0.5 * step) for s in (1, -1)]
    for name in ("right_foot", "pelvis", "left_lower_arm"):
        slope = (poses[0][name].pose.apply(point) - poses[1][name].pose.apply(point)) / (2 * step)
        exact = moved[name].twist.velocity_at(moved[name].pose.rotate(point))
        np.testing.assert_allclose(exact, slope, atol=1e-3, err_msg=name)


@pytest.mark.some(1)
@pytest.mark.parametrize("speed", [0.9, 1.3, 2.0])
def test_feet_stand_on_the_ground_and_hardly_slide(speed):
    gait = WalkingGait(1.75)
    phases = np.linspace(0, 1, 200, endpoint=False)
    lowest, slide, peak = [], [], []
    for phase in phases:
        moved = gait.motions(phase, speed)
        soles = {side: moved[f"{side}_foot"].pose.apply(SOLE * gait.lengths.foot) for side in ("left", "right")}
        side = min(soles, key=lambda name: soles[name][:, 2].min())
        lowest.append(soles[side][:, 2].min())
        foot = moved[f"{side}_foot"]
        corner = soles[side][soles[side][:, 2].argmin()]
        slide.append(foot.twist.velocity_at(corner - foot.pose.position)[0] + speed)
        peak.append(moved["right_foot"].twist.linear[0] + speed)
    assert min(lowest) > -1e-3 and max(lowest) < 0.1
    assert np.median(np.abs(slide)) < 0.35 * speed  # the published angles leave a residue: it is not a contact solver
    assert 2.5 * speed < max(peak) < 6.0 * speed  # the swinging foot, Chen section 4.1


def test_left_and_right_are_half_a_cycle_apart():
    gait = WalkingGait(1.75)
    right, left = gait.motions(0.2, 1.3), gait.motions(0.7, 1.3)
    mirror = np.array([1.0, -1.0, 1.0])
    for name in ("upper_leg", "lower_leg", "foot", "upper_arm", "lower_arm"):
        np.testing.assert_allclose(
            left[f"left_{name}"].pose.position, mirror * right[f"right_{name}"].pose.position, atol=1e-9
        )


def test_who_stands_does_not_move_and_stands_upright():
    moved = WalkingGait(1.8).motions(0.37, 0.0)
    assert all(not m.twist.linear.any() and not m.twist.angular.any() for m in moved.values())
    np.testing.assert_allclose(
        moved["head"].pose.position[2], 1.8 * (0.245 + 0.246 + 0.288) + 0.25 * 0.143 * 1.8, atol=0.03
    )


def test_motions_chain_like_poses():
    outer = Motion(Pose([1, 2, 3], [0.9, 0.1, -0.3, 0.2]), Twist([0.3, -1, 2], [0.2, 0.5, -0.1]))
    inner = Motion(Pose([-1, 0.5, 2], [0.5, 0.6, 0.1, 0.2]), Twist([1, 1, -2], [-0.2, 0.1, 0.7]))
    both, point, step = outer.then(inner), np.array([0.3, 0.2, -0.4]), 1e-6

    def after(motion, dt):
        turned = Motion.about(
            motion.twist.angular / np.linalg.norm(motion.twist.angular), np.linalg.norm(motion.twist.angular) * dt, 0.0
        )
        return Pose.from_rotation(
            motion.pose.position + motion.twist.linear * dt, turned.pose.rotation @ motion.pose.rotation
        )

    slope = (
        after(outer, step).apply(after(inner, step).apply(point))
        - after(outer, -step).apply(after(inner, -step).apply(point))
    ) / (2 * step)
    np.testing.assert_allclose(both.twist.velocity_at(both.pose.rotate(point)), slope, atol=1e-7)


def test_bad_joints_are_refused(tmp_path):
    rest = StaticTrajectory(Pose())
    with pytest.raises(ParameterRangeError, match="radius"):
        joints_from_tables([{"shapes": ["a"], "center": [0, 0, 0], "radius": -1}], "car", ["a"], rest)
    with pytest.raises(UnknownNameError, match="wheel_left"):
        joints_from_tables([{"shapes": ["wheel_left"], "center": [0, 0, 0], "radius": 1}], "car", ["a"], rest)
    with pytest.raises(UnknownNameError, match="hinge"):
        joints_from_tables([{"kind": "hinge"}], "car", ["a"], rest)
    with pytest.raises(ParameterRangeError, match="without another joint"):
        joints_from_tables([{"shapes": ["a"], "center": [0, 0, 0], "radius": 1}] * 2, "car", ["a"], rest)
    with pytest.raises(ParameterRangeError, match="_head"):
        joints_from_tables([{"kind": "walk", "height": 1.7}], "walker", ["walker_torso"], rest)
    with pytest.raises(ParameterRangeError, match=r"speed on foot.*9\.00 m/s"):
        WalkingGait(1.75).motions(0.0, 9.0)
    with pytest.raises(ParameterRangeError, match="height"):
        WalkingGait(17.5)
