"""Bodies pitch and roll on their springs: steady angles, the answer to a ramp, velocities of vertices, wheels."""

from __future__ import annotations

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.pose import Pose
from scarl_sionna.scenario.motion.bodies import ActorBody
from scarl_sionna.scenario.motion.parking import JoinedTrajectory
from scarl_sionna.scenario.motion.paths import PathTrajectory
from scarl_sionna.scenario.motion.profiles import SpeedProfile
from scarl_sionna.scenario.motion.routes import vehicle_trajectory
from scarl_sionna.scenario.motion.tilt import GRAVITY, Springs, on_springs
from scarl_sionna.scene.motion.trajectory import StaticTrajectory, road_pose

CAR = Springs.of(ss.read_actor_model("saloon"))
STEP = 1e-5


def straight(profile: SpeedProfile) -> PathTrajectory:
    return vehicle_trajectory([[x, 0.0, 0.0] for x in np.arange(0.0, 200.0, 5.0)], speed=profile).on_springs(CAR)


def circle(radius: float, speed: float) -> PathTrajectory:
    """Return a bend to the left, to the right where the radius is negative."""
    angle = np.linspace(0.0, 4.0, 160)
    points = np.column_stack([abs(radius) * np.sin(angle), radius * (1.0 - np.cos(angle)), 0.0 * angle])
    return vehicle_trajectory(points, speed=speed).on_springs(CAR)


def slalom(model: str = "saloon") -> PathTrajectory:
    """Return a way with bends to both sides over a hill, and the brakes."""
    x = np.arange(0.0, 101.0, 2.0)
    points = np.column_stack([x, 2.0 * np.sin(x / 9.0), 0.8 * np.sin(x / 25.0)])
    found = vehicle_trajectory(points, speed=SpeedProfile(9.0).hold(2.0).reach(4.0, 3.0, 8.0), model=model)
    return on_springs(found, Springs.of(ss.read_actor_model(model)))


def nose_up(pose: Pose) -> float:
    return float(np.degrees(np.arcsin(pose.rotation[2, 0])))


def left_up(pose: Pose) -> float:
    return float(np.degrees(np.arcsin(pose.rotation[2, 1])))


@pytest.mark.parametrize(("first", "last", "pull"), [(30.0, 2.0, -3.0), (2.0, 30.0, 2.0), (30.0, 2.0, -8.0)])
def test_steady_brakes_and_steady_throttle_pitch_by_the_gradient(first, last, pull) -> None:
    motion = straight(SpeedProfile(first).reach(last, abs(pull), 50.0))
    time = 0.8 * abs(last - first) / abs(pull)
    assert motion.acceleration(time)[()] == pytest.approx(pull, abs=1e-9)
    assert nose_up(motion.pose(time)) == pytest.approx(CAR.pitch * pull / GRAVITY, abs=0.02)
    assert left_up(motion.pose(time)) == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize(("radius", "speed"), [(30.0, 7.0), (-30.0, 7.0), (200.0, 20.0)])
def test_a_steady_bend_rolls_outwards_by_the_gradient(radius, speed) -> None:
    motion = circle(radius, speed)
    time = 0.6 * motion.stop
    assert left_up(motion.pose(time)) == pytest.approx(CAR.roll * speed**2 / (GRAVITY * radius), abs=2e-3)
    np.testing.assert_allclose(motion.twist(time).angular, [0.0, 0.0, speed / radius], atol=2e-3)


def test_a_body_tilts_no_further_than_tyres_pull_it() -> None:
    motion = circle(10.0, 14.0)  # twice of what they hold
    assert left_up(motion.pose(0.9 * motion.stop)) == pytest.approx(CAR.roll, abs=2e-3)


def test_the_answer_to_a_ramp_is_that_of_a_damped_oscillator() -> None:
    omega, zeta, rise = 2.0 * np.pi * CAR.frequency, CAR.damping, 4.0  # [m/s^3]
    times = np.linspace(0.0, 1.5, 31)
    curve = CAR.response(times, np.stack([rise * times, -rise * times], axis=1))
    own = omega * np.sqrt(1.0 - zeta**2)
    phase = own * times
    fade = np.exp(-zeta * omega * times)
    lag = 2.0 * zeta / omega
    shape = times - lag + fade * (lag * np.cos(phase) + (2.0 * zeta**2 - 1.0) / own * np.sin(phase))
    np.testing.assert_allclose(curve(times)[:, 0], np.radians(CAR.pitch) * rise / GRAVITY * shape, atol=1e-12)
    np.testing.assert_allclose(curve(times)[:, 1], -np.radians(CAR.roll) * rise / GRAVITY * shape, atol=1e-12)
    slopes = np.gradient(shape, times, edge_order=2)[1:-1]
    np.testing.assert_allclose(curve(times, 1)[1:-1, 0], np.radians(CAR.pitch) * rise / GRAVITY * slopes, atol=2e-3)


def test_pulls_are_those_of_the_middle_between_the_axles() -> None:
    motion, step = slalom(), 1e-3
    middle = [[motion.body.rear_axle + motion.body.wheelbase / 2.0, 0.0, 0.0]]
    for time in np.linspace(0.5, motion.stop - 0.5, 17).tolist():
        before, now, after = (road_pose(motion, time + shift) for shift in (-step, 0.0, step))
        pull = (after.apply(middle) - 2.0 * now.apply(middle) + before.apply(middle))[0] / step**2
        heading = np.array([np.cos(now.yaw), np.sin(now.yaw)])
        here = [heading @ pull[:2], heading[0] * pull[1] - heading[1] * pull[0]]
        np.testing.assert_allclose(motion.pulls(time)[0], here, atol=0.05)  # level measures on a hill


@pytest.mark.parametrize("motion", [slalom(), circle(25.0, 9.0)], ids=["slalom", "circle"])
def test_velocities_are_derivatives_and_the_origin_stays(motion) -> None:
    points = np.array([[2.3, 0.9, 0.4], [-2.3, -0.9, 1.4], [0.0, 0.0, 0.0]])
    rigid = PathTrajectory(motion.path, motion.way, motion.body, motion.start, motion.stop)
    most = 0.0
    for time in np.linspace(motion.start + 0.051, motion.stop - 0.051, 41).tolist():
        pose, twist = motion.pose(time), motion.twist(time)
        slope = (motion.pose(time + STEP).apply(points) - motion.pose(time - STEP).apply(points)) / (2.0 * STEP)
        exact = np.array([twist.velocity_at(place - pose.position) for place in pose.apply(points)])
        np.testing.assert_allclose(exact, slope, atol=1e-4)
        np.testing.assert_array_equal(pose.position, rigid.pose(time).position)
        np.testing.assert_allclose(road_pose(motion, time).rotation, rigid.pose(time).rotation, atol=1e-12)
        assert pose.yaw == pytest.approx(rigid.pose(time).yaw, abs=1e-12)
        most = max(most, float(np.linalg.norm(twist.angular - rigid.twist(time).angular)))
    assert most > 0.01 or motion.path.length > 90.0


def test_wheels_stay_on_the_road_below_a_body_that_tilts() -> None:
    """Wheels are where those of a rigid body are; vertices and boxes move as their velocities say."""
    motion = slalom()
    rigid = PathTrajectory(motion.path, motion.way, motion.body, motion.start, motion.stop)
    cars = [ss.StagedActor("sprung", "saloon", motion, detail="light")]
    world = ss.stage("highway_guardrail", [*cars, ss.StagedActor("rigid", "saloon", rigid, detail="light")])
    parts = {name: row for row, name in enumerate(world.parts.name)}
    own = [row for name, row in parts.items() if name.startswith("sprung_")]
    wheels = [row for row in own if "wheel" in world.parts.name[row]]
    assert len(wheels) == 4
    for time in (1.0, 2.4, 3.1, 5.0):
        now, before, after = (world.at(time + shift) for shift in (0.0, -STEP, STEP))
        for part in own:
            vertices = world.mesh(part).vertices[::7]
            ends, places = (state.part_pose(part).apply(vertices) for state in (before, after)), now.part_pose(part)
            slope = -np.subtract(*ends) / (2.0 * STEP)
            found = now.point_velocity(np.full(len(vertices), part), places.apply(vertices))
            np.testing.assert_allclose(found, slope, atol=1e-3)
        for part in wheels:
            twin = now.part_pose(parts[world.parts.name[part].replace("sprung", "rigid")])
            np.testing.assert_allclose(now.part_pose(part).matrix, twin.matrix, atol=1e-9)
        assert world.instances[world.actor("sprung").instance].size.tolist() == pytest.approx(
            world.instances[world.actor("rigid").instance].size.tolist(), abs=1e-9
        )
        first, box, last = (next(one for one in at.boxes() if one.name == "sprung") for at in (before, now, after))
        np.testing.assert_allclose(box.world_from_box.rotation, now.actor_pose("sprung").rotation, atol=1e-12)
        way = last.world_from_box.position - first.world_from_box.position
        np.testing.assert_allclose(box.twist.linear, way / (2.0 * STEP), atol=1e-4)
        assert np.degrees(np.linalg.norm(now.actor_pose("sprung").rotation - now.actor_pose("rigid").rotation)) > 0.1


def test_a_joined_motion_goes_on_with_the_tilt_that_it_has() -> None:
    first = straight(SpeedProfile(10.0).hold(1.0).reach(4.0, 3.0, 30.0))
    ends = first.stop
    cut = 2.0
    pieces = JoinedTrajectory(
        tuple(PathTrajectory(first.path, first.way, first.body, *span) for span in ((0.0, cut), (cut, ends)))
    )
    joined = on_springs(pieces, CAR)
    for time in (cut - 1e-9, cut, cut + 0.3):
        assert nose_up(joined.pose(time)) == pytest.approx(nose_up(first.pose(time)), abs=2e-3)


def test_who_has_springs() -> None:
    rigid = {"articulated_lorry", "tram", "bicycle", "adult_man", "pram"}
    for name in ("small_car", "van", "lorry", "bus", *rigid):
        assert (Springs.of(ss.read_actor_model(name)) is None) == (name in rigid), name
    parked = StaticTrajectory(Pose())
    assert on_springs(parked, CAR) is parked
    with pytest.raises(ParameterRangeError, match="none for this body"):
        vehicle_trajectory([[0, 0, 0], [50, 0, 0]], speed=5.0, model=ActorBody(motion="cycle")).on_springs(CAR)
    with pytest.raises(ParameterRangeError, match=r"0 to 15 deg/g"):
        Springs(roll=20.0)
