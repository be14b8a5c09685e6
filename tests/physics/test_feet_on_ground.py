"""Feet of walkers on kerbs and ramps: they stand on the ground that is there, do not slide, and do not cut it."""

from __future__ import annotations

import numpy as np
import pytest

from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.engine.rays.footing import BLOCK, Footing
from scarl_sionna.engine.rays.geometry import Triangles
from scarl_sionna.scenario.checks.motion import ground_heights
from scarl_sionna.scenario.compose import build_world
from scarl_sionna.scenario.spec.scenario import ScenarioSpec, scenario_names
from scarl_sionna.scene.motion.articulation import Walk, joints_from_tables, joints_on, joints_on_ground
from scarl_sionna.scene.motion.gait import SEGMENTS, SIDES, SOLE
from scarl_sionna.scene.motion.trajectory import ConstantTwistTrajectory, forward_speeds, is_present

CONTACT, STILL, DEPTH = 0.01, 0.02, 0.01
"""Of a point of a sole that stands: height [m] and speed [m/s]; how deep any may be in the ground [m]."""
SPEED = 1.3


def soles(joint: Walk, time: float) -> list[tuple[np.ndarray, np.ndarray]]:
    """Heel, ball and toe in the world, and their velocities [m, m/s], of the feet that stand."""
    moved = {joint.shapes[shape]: motion for shape, motion in joint.motions(time).items()}
    pose, twist = joint.trajectory.pose(time), joint.trajectory.twist(time)
    speed = max(float(forward_speeds(joint.trajectory, np.array([time]))[0]), 0.0)
    found = []
    for side, shift in SIDES.items():
        if (joint.phase.at(time) + joint.phase_offset + shift) % 1.0 >= joint.gait.support(speed):
            continue
        foot = moved[f"{side}_foot"]
        points = foot.pose.apply(SOLE * joint.gait.lengths.foot)
        own = np.array([foot.twist.velocity_at(point - foot.pose.position) for point in points])
        world = pose.apply(points)
        found.append(
            (world, np.array([twist.velocity_at(point - pose.position) for point in world]) + pose.rotate(own))
        )
    return found


def check(gaps: np.ndarray, speeds: np.ndarray) -> None:
    """Assert that of each row of heel, ball and toe one rests on the ground, and none is in it."""
    assert gaps.min() > -DEPTH
    assert np.all(((np.abs(gaps) < CONTACT) & (speeds < STILL)).any(axis=1))


@pytest.mark.parametrize("name", ["child_between_parked_cars", "roundabout_entry"])
def test_who_crosses_a_kerb_or_a_ramp_stands_on_it(name) -> None:
    check_scenario(name)


@pytest.mark.some(6)
@pytest.mark.slow
@pytest.mark.parametrize("name", scenario_names())
def test_feet_of_all_scenarios_stand_on_the_ground(name) -> None:
    check_scenario(name)


def check_scenario(name: str) -> None:
    spec = ScenarioSpec.preset(name)
    world = build_world(spec)
    for actor in world.actors:
        for joint in actor.joints:
            if isinstance(joint, Walk):
                times = np.arange(spec.times[0], spec.times[-1], 0.03).tolist()
                feet = [pair for time in times if is_present(joint.trajectory, time) for pair in soles(joint, time)]
                points = np.array([points for points, _ in feet])
                ground = ground_heights(world, points.reshape(-1, 3)).reshape(points.shape[:2])  # by rays
                check(points[:, :, 2] - ground, np.linalg.norm([velocity for _, velocity in feet], axis=2))


class Street:
    """A ground that is a function of x, with its step or ramp."""

    def __init__(self, *xz: tuple[float, float]) -> None:
        self.x, self.z = np.array(xz).T

    def heights(self, points: np.ndarray, reach: float) -> np.ndarray:
        found = np.interp(points[:, 0], self.x, self.z)
        return np.where(np.abs(found - points[:, 2]) <= reach, found, np.nan)


KERB = Street((-50.0, 0.0), (4.0, 0.0), (4.001, 0.12), (50.0, 0.12))
DOWN = Street((-50.0, 0.12), (4.0, 0.12), (4.001, 0.0), (50.0, 0.0))
RAMP = Street((-50.0, 0.0), (4.0, 0.0), (6.0, 0.2), (50.0, 0.2))


def walker(street: Street, phase: float, climb: float = 0.0, height: float = 1.75) -> Walk:
    motion = ConstantTwistTrajectory(Pose(), Twist([SPEED, 0.0, climb]))
    joints = joints_from_tables([{"kind": "walk", "height": height, "phase": phase}], "it", SEGMENTS, motion)
    (joint,) = joints_on_ground(joints, street)
    assert isinstance(joint, Walk)
    return joint


@pytest.mark.parametrize("street", [KERB, DOWN, RAMP])
@pytest.mark.parametrize("phase", np.linspace(0.0, 0.9, 7).tolist())
def test_a_step_is_longer_or_shorter_so_that_the_sole_stands_flat(street, phase) -> None:
    joint = walker(street, phase, 0.02)  # the origin climbs evenly, whatever the ground does
    feet = [pair for time in np.arange(2.0, 6.0, 0.04).tolist() for pair in soles(joint, time)]
    points = np.array([points for points, _ in feet])
    gaps = points[:, :, 2] - np.interp(points[:, :, 0], street.x, street.z)
    check(gaps, np.linalg.norm([velocity for _, velocity in feet], axis=2))
    apart = joint.prints and sorted({pose.position[0] for pose, _ in joint.prints._known.values()})
    assert apart and np.all(np.abs(np.diff(apart) - np.median(np.diff(apart))) < 0.45)


@pytest.mark.parametrize("street", [KERB, DOWN])
def test_a_foot_swings_over_the_edge_of_a_kerb(street) -> None:
    for phase in np.linspace(0.0, 0.9, 7).tolist():
        joint = walker(street, phase)
        for time in np.arange(2.5, 3.65, 0.01).tolist():  # the edge is at most 0.75 m ahead or behind
            moved = joint.motions(time)
            for side in SIDES:
                points = joint.trajectory.pose(time).apply(
                    moved[f"{side}_foot"].pose.apply(SOLE * joint.gait.lengths.foot)
                )
                inside = np.interp(points[:, 0], street.x, street.z) - points[:, 2]
                assert inside.max() < 0.065, (phase, time, side)  # half of the kerb: a toe may graze it


def test_velocities_on_a_kerb_are_derivatives() -> None:
    joint, step, point = walker(KERB, 0.3, 0.02), 1e-5, np.array([0.1, 0.05, -0.2])
    for time in np.linspace(2.0, 5.0, 31).tolist():
        moved, later, earlier = (joint.motions(time + shift) for shift in (0.0, step, -step))
        for name in SEGMENTS:
            slope = (later[name].pose.apply(point) - earlier[name].pose.apply(point)) / (2.0 * step)
            exact = moved[name].twist.velocity_at(moved[name].pose.rotate(point))
            np.testing.assert_allclose(exact, slope, atol=2e-3, err_msg=f"{name} at {time}")


def test_on_even_ground_nothing_changes() -> None:
    even, plain = walker(Street((-50.0, 2e-4), (50.0, 2e-4)), 0.2), walker(KERB, 0.2)
    alone = joints_from_tables([{"kind": "walk", "height": 1.75, "phase": 0.2}], "it", SEGMENTS, even.trajectory)[0]
    for time in (0.3, 1.7):
        for name, motion in alone.motions(time).items():
            assert motion.pose.position.tobytes() == even.motions(time)[name].pose.position.tobytes()
    on_other = joints_on([plain], ConstantTwistTrajectory(Pose([3.0, 0.0, 0.0]), Twist([1.0, 0.0, 0.0])))[0]
    assert isinstance(on_other, Walk) and on_other.ground is KERB  # on another way, the same ground


def test_footing_is_the_highest_face_within_reach() -> None:
    square = np.array([[0.0, 0.0, 0.0], [4.0, 0.0, 1.0], [4.0, 4.0, 1.0], [0.0, 4.0, 0.0]])
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    shift = np.array([0.0, 0.0, 0.2])
    triangles = Triangles.from_meshes([square, square + shift, square + 2.0 * shift], [faces] * 3)
    footing = Footing(triangles, np.array([True, True, False]))  # the third part moves
    places = np.array([[1.0, 1.0, 0.3], [2.0, 3.0, 0.3], [9.0, 1.0, 0.3], [3.0, 1.0, 0.3]])
    np.testing.assert_allclose(footing.heights(places, 0.3), [0.45, 0.5, np.nan, np.nan], atol=1e-12)
    np.testing.assert_allclose(footing.heights(places, 0.5), [0.45, 0.7, np.nan, 0.75], atol=1e-12)


def test_footing_of_many_faces_is_that_of_every_face_looked_at() -> None:
    step, count = 0.5, 2 * BLOCK
    lift = np.random.default_rng(3).uniform(0.0, 0.2, count)
    square = step * np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    tiles = [square + [step * (row % 16), step * (row // 16), lift[row]] for row in range(count)]
    triangles = Triangles.from_meshes(tiles, [np.array([[0, 1, 2]])] * count)
    footing = Footing(triangles, np.ones(count, dtype=np.bool_))
    rng = np.random.default_rng(4)
    for _ in range(50):  # a triangle holds who is below the diagonal of its cell
        places = np.column_stack([rng.uniform(-0.5, 8.5, 5), rng.uniform(-0.5, 4.5, 5), np.zeros(5)])
        cell, within = np.divmod(places[:, :2] / step, 1.0)
        known = (cell >= 0).all(axis=1) & (cell[:, 0] < 16) & (cell[:, 1] < count // 16) & (within.sum(axis=1) < 1.0)
        level = lift[np.where(known, cell @ [1, 16], 0).astype(int)]
        np.testing.assert_allclose(footing.heights(places, 0.3), np.where(known, level, np.nan), atol=1e-12)
