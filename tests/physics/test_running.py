"""People who run: a foot on the ground stands still, between steps there is none, and the body falls freely."""

from __future__ import annotations

import numpy as np
import pytest

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.scene.motion.gait import SEGMENTS, WalkingGait
from scarl_sionna.scene.motion.running import LEG
from scarl_sionna.scene.motion.trajectory import ConstantTwistTrajectory, WaypointTrajectory, forward_speeds
from scenes_xml.actors.bodies.family import packed_bodies
from scenes_xml.actors.bodies.table import PEOPLE
from tests.physics.test_steps import check_feet, check_joints, soles, walk

ADULT = 1.75


def straight(speed: float) -> ConstantTwistTrajectory:
    return ConstantTwistTrajectory(Pose(), Twist([speed, 0.0, 0.0]))


def body(name: str) -> dict[str, float]:
    """Height and own lengths of one of the people [m]."""
    bodies = packed_bodies()
    height = next(person.height for person in PEOPLE if person.name == name)
    return {"height": height, **bodies.lengths[bodies.names.index(name)]}


def sprint() -> WaypointTrajectory:
    """Somebody who walks a bend of 12 m, runs up to 5 m/s, and walks again."""
    times = np.linspace(0.0, 9.0, 91)
    speed = 1.2 + 3.8 * np.clip(np.minimum(times - 1.0, 8.0 - times) / 2.5, 0.0, 1.0)
    smooth = np.convolve(np.pad(speed, 7, "edge"), np.full(15, 1 / 15), "valid")
    angle = np.concatenate([[0.0], np.cumsum((smooth[1:] + smooth[:-1]) / 2.0 * 0.1)]) / 12.0
    points = np.stack([12.0 * np.sin(angle), 12.0 - 12.0 * np.cos(angle), 0.0 * angle], 1)
    return WaypointTrajectory(times, points, np.degrees(angle))


@pytest.mark.some(10)
@pytest.mark.parametrize("name", [person.name for person in PEOPLE])
def test_everybody_runs_on_feet_that_stand_still(name) -> None:
    """From the first speed that is a run to the fastest: contact, joints, and a share of the cycle in the air."""
    joint = walk(straight(1.0), **body(name))
    gait = joint.gait
    for speed in (gait._changeover[1] * gait.lengths.leg, 0.9 * gait.fastest):
        joint = walk(straight(speed), phase=0.3, **body(name))
        times = np.linspace(0.0, 1.0 / gait.cadence(speed), 25)[:-1]
        down = check_feet(joint, times)
        check_joints(joint, times[::4])
        assert down.max() == 1
        assert abs((down == 0).mean() - (1.0 - 2.0 * gait.support(speed))) <= 2.0 / len(times)
        assert (down == 0).mean() > 0.09


@pytest.mark.parametrize("speed", [2.5, 4.0, 6.0])
def test_nobody_touches_the_ground_in_flight_and_bodies_fall_freely(speed) -> None:
    gait, step = WalkingGait(ADULT), 2e-3
    joint, middle = walk(straight(speed)), (0.5 + gait.support(speed)) / 2.0 / gait.cadence(speed)
    for time in (middle, middle + 0.5 / gait.cadence(speed)):
        assert not any(standing for standing, *_ in soles(joint, time).values())
        assert min(points[:, 2].min() for _, points, _ in soles(joint, time).values()) > 0.005
        hips = [joint.motions(time + shift)["pelvis"].pose.position[2] for shift in (-step, 0.0, step)]
        assert (hips[0] - 2.0 * hips[1] + hips[2]) / step**2 == pytest.approx(-9.81, abs=0.4)


def test_strides_are_those_of_runners() -> None:
    """Strides a minute of van Oeveren et al. (2017), mean of 12: an adult, and a child of the same Froude number."""
    legs = WalkingGait(ADULT).lengths.leg
    for height in (ADULT, 1.2):
        gait = WalkingGait(height)
        scale = np.sqrt(gait.lengths.leg / LEG)
        for speed, strides in ((2.4, 77.0), (2.6, 79.0), (2.9, 80.0)):
            assert 60.0 * gait.cadence(speed * scale) * scale == pytest.approx(strides, abs=0.9)
    assert legs == pytest.approx(LEG, rel=0.02)


def test_speed_alone_decides_between_walk_and_run() -> None:
    gait = WalkingGait(ADULT)
    speeds = np.linspace(0.1, gait.fastest, 200)
    for speed in speeds:
        walks = speed**2 / (9.81 * gait.lengths.leg) < 0.48
        if walks:  # the model of walking as it was
            assert gait.cadence(speed) == np.sqrt(speed / gait.lengths.leg) / 1.346
            assert gait.print_ahead(speed) == 0.0 and gait.support(speed) > 0.5
        elif speed > 2.3:
            assert gait.support(speed) < 0.42
    over = speeds[speeds > 1.5]  # no jump where one becomes the other, 3 cm/s a step
    assert np.abs(np.diff([gait.cadence(speed) for speed in over])).max() < 0.03
    assert np.abs(np.diff([gait.support(speed) for speed in over])).max() < 0.04
    with pytest.raises(ParameterRangeError, match="speed on foot"):
        gait.cadence(1.01 * gait.fastest)


def test_feet_rest_while_a_walker_begins_to_run_in_a_bend() -> None:
    joint, times = walk(sprint()), np.linspace(0.01, 8.99, 300)
    down = check_feet(joint, times)
    speeds = forward_speeds(joint.trajectory, times)
    assert {2} <= set(down[speeds < 1.9]) <= {1, 2}
    assert {0} <= set(down[speeds > 2.4]) <= {0, 1}


def test_velocities_are_derivatives_from_walk_to_run() -> None:
    """Of every segment, by differences of poses, while the gait changes over, in a bend."""
    joint, step, point = walk(sprint()), 1e-5, np.array([0.1, 0.05, -0.2])
    for time in np.linspace(0.2, 8.8, 40):
        moved, later, earlier = (joint.motions(time + shift) for shift in (0.0, step, -step))
        for name in SEGMENTS:
            slope = (later[name].pose.apply(point) - earlier[name].pose.apply(point)) / (2.0 * step)
            exact = moved[name].twist.velocity_at(moved[name].pose.rotate(point))
            np.testing.assert_allclose(exact, slope, atol=5e-3, err_msg=f"{name} at {time}")


def test_left_and_right_are_half_a_cycle_apart() -> None:
    gait = WalkingGait(ADULT)
    right, left = gait.motions(0.2, 3.5), gait.motions(0.7, 3.5)
    mirror = np.array([1.0, -1.0, 1.0])
    for name in ("upper_leg", "foot", "lower_arm"):
        np.testing.assert_allclose(
            left[f"left_{name}"].pose.position, mirror * right[f"right_{name}"].pose.position, atol=1e-9
        )
