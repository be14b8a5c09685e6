"""Parking: in and out, along and across a lane, by clothoids and arcs within the steering limit, also in reverse."""

from __future__ import annotations

import numpy as np
import pytest

from scarl_sionna.core.errors import ParameterRangeError, ScenarioError
from scarl_sionna.core.pose import Pose
from scarl_sionna.scenario.checks.motion import check_motion
from scarl_sionna.scenario.motion.bodies import ActorBody, body_of
from scarl_sionna.scenario.motion.parking import STEERING, STEERING_WAY, JoinedTrajectory, Manoeuvre, park
from scarl_sionna.scenario.spec.scenario import ScenarioSpec
from scarl_sionna.scene.lanes import Lane
from scarl_sionna.scene.motion.trajectory import Trajectory
from scarl_sionna.simulation import load_world

X = np.linspace(-60.0, 100.0, 81)
LANE = Lane("east", np.column_stack([X, np.zeros(81), np.zeros(81)]))
SALOON = body_of("saloon")
STOP = 30.0


def motion(
    y: float, yaw_deg: float, way: str, nose: str = "out", body: ActorBody = SALOON, turn: float = 0.0
) -> Trajectory:
    """Return a manoeuvre at a place beside (0, 0); the world is turned by `turn` [rad]."""
    pose = Pose.from_euler(np.zeros(3), yaw=turn)
    place = pose.compose(Pose.from_euler([0.0, y, 0.0], yaw=np.radians(yaw_deg)))
    lane = Lane("east", pose.apply(LANE.points))
    return park(place, lane, Manoeuvre(way, nose, 1.5, 5.0, 0.0 if way == "in" else 1.0, 20.0), body, (0.0, STOP))


CASES = [
    (y, yaw, way, nose)
    for y, yaw in ((-8.5, 90.0), (8.5, 90.0), (-2.6, 0.0), (2.6, 180.0))
    for way in ("in", "out")
    for nose in (("out", "in") if abs(yaw) == 90.0 else ("out",))
] + [(-8.0, 60.0, "in", "out")]


def times_of(moved: Trajectory, step: float = 0.05) -> np.ndarray:
    return np.arange(moved.start, min(moved.stop, STOP), step)


@pytest.mark.parametrize(
    ("y", "yaw", "way", "nose", "model"),
    [
        pytest.param(*case, model, marks=[pytest.mark.slow] if (index + shift) % 2 else [])
        for index, case in enumerate(CASES)
        for shift, model in enumerate(("saloon", "small_car"))
    ],
)
def test_it_ends_in_the_place_or_on_the_lane_and_steers_within_the_limit(y, yaw, way, nose, model) -> None:
    body = body_of(model)
    moved = motion(y, yaw, way, nose, body)
    parked = moved.pose(min(moved.stop, STOP) if way == "in" else moved.start)
    np.testing.assert_allclose(parked.position, [0.0, y, 0.0], atol=0.01)
    across = abs(np.sin(np.radians(yaw))) > 0.5
    towards = parked.rotation[1, 0] * -np.sign(y)
    assert abs(np.degrees(parked.yaw - np.radians(yaw)) % 180.0 % 179.9) < 0.2
    assert towards > 0.8 if across and nose == "out" else towards < -0.8 if across else parked.rotation[0, 0] > 0.999
    times = times_of(moved)
    steering = np.array([moved.wheel_way(t, (body.rear_axle + body.wheelbase, 0.0)).angle for t in times])
    assert 0.75 * STEERING < np.abs(steering).max() < STEERING + np.radians(0.5)
    far = moved.pose(moved.start if way == "in" else min(moved.stop, STOP))
    assert abs(far.position[1]) < 0.02 and abs(far.yaw) < 1e-3  # on the lane, along it
    speeds = moved.forward_speeds(times)
    assert (speeds.min() < -0.5) == ((way == "in") == (nose == "out" or not across))
    assert speeds.min() > -1.51 and speeds.max() < 5.01
    assert check_motion([("car", moved, None)], times[::4], 6.0, 2.5) == []


def test_across_a_lane_the_arc_has_the_radius_of_the_steering_limit() -> None:
    """Rear axle: R = wheelbase / tan(32 deg); a turn of 90 deg with clothoids of 3 m turns the rest on the arc."""
    moved = motion(-8.5, 90.0, "out")
    radius = SALOON.wheelbase / np.tan(STEERING)
    times = times_of(moved, 0.01)
    bends = np.array([moved.path.bend(float(moved.way(t)))[0] for t in times])
    assert np.median(np.abs(bends)[np.abs(bends) > 0.98 / radius]) == pytest.approx(1.0 / radius, rel=0.005)
    way = np.array([float(moved.way(t)) for t in times])
    arc = np.ptp(way[np.abs(bends) > 0.98 / radius])
    assert arc == pytest.approx(
        radius * np.pi / 2.0 - STEERING_WAY, abs=0.25
    )  # each clothoid turns half its length / R


def test_in_and_out_follow_the_same_ground() -> None:
    for y, yaw, nose in ((-8.5, 90.0, "out"), (8.5, 90.0, "in"), (-2.6, 0.0, "out")):
        into, out = (motion(y, yaw, way, nose) for way in ("in", "out"))
        steps = ((into, 0.2), (out, 0.04))
        ways = [np.array([one.pose(t).position[:2] for t in times_of(one, step)]) for one, step in steps]
        inside = ways[0][np.abs(ways[0][:, 1]) > 0.3]
        away = np.linalg.norm(inside[:, None] - ways[1][None], axis=2).min(1)
        assert away.max() < 0.05, (y, yaw, nose)  # 0.03 m: half a step of 0.04 s at 1.5 m/s


def test_a_change_of_direction_is_smooth_and_wheels_roll_on() -> None:
    moved = motion(-8.5, 90.0, "in")
    assert isinstance(moved, JoinedTrajectory) and len(moved.pieces) == 2
    turning = moved.pieces[1].start
    before, after = moved.pose(turning - 1e-9), moved.pose(turning)
    assert np.linalg.norm(before.position - after.position) < 2e-3 and abs(before.yaw - after.yaw) < 1e-3
    assert np.linalg.norm(moved.twist(turning).linear) < 1e-6
    rolled = np.array([moved.wheel_way(t, (SALOON.rear_axle, 0.0)).rolled for t in times_of(moved, 0.01)])
    speeds = moved.forward_speeds(times_of(moved, 0.01))
    assert np.abs(np.diff(rolled)).max() < 0.051  # 5 m/s
    np.testing.assert_allclose(rolled[-1], np.sum(speeds) * 0.01, atol=0.1)


def test_another_direction_of_the_world_turns_the_motion() -> None:
    one, other = motion(-8.5, 90.0, "in"), motion(-8.5, 90.0, "in", turn=2.0)
    spin = Pose.from_euler(np.zeros(3), yaw=2.0)
    for time in (0.0, 6.0, 14.0, 25.0):
        np.testing.assert_allclose(spin.apply(one.pose(time).position[None])[0], other.pose(time).position, atol=1e-3)


@pytest.mark.parametrize(
    ("y", "yaw", "nose", "said"),
    [
        (-5.0, 90.0, "in", "distance of the parked rear axle.*park with the nose out"),
        (-40.0, 0.0, "out", "two turns of up to 75 deg"),
    ],
)
def test_a_place_that_cannot_be_reached_is_refused(y: float, yaw: float, nose: str, said: str) -> None:
    with pytest.raises(ParameterRangeError, match=said):
        motion(y, yaw, "in", nose)


def test_what_else_cannot_be_is_refused() -> None:
    with pytest.raises(ParameterRangeError, match="without axles"):
        motion(-8.5, 90.0, "in", body=body_of("adult_man"))
    place = Pose.from_euler([0.0, -8.5, 0.0], yaw=np.pi / 2.0)
    with pytest.raises(ParameterRangeError, match="approach"):
        park(place, LANE, Manoeuvre("in", "out", 1.5, 5.0, 0.0, 90.0), SALOON, (0.0, STOP))
    turn = np.linspace(-1.0, 1.5, 40)
    bend = Lane("bend", np.column_stack([30.0 * np.sin(turn), 30.0 * (1.0 - np.cos(turn)), 0.0 * turn]))
    with pytest.raises(ParameterRangeError, match="bend of lane 'bend'"):
        park(place, bend, Manoeuvre("in", "out", 1.5, 5.0, 0.0, 10.0), SALOON, (0.0, STOP))


TEXT = """
scene: parking_garage
duration: 24.0
frame_rate: 2.0
ego:
  model: saloon
  trajectory: {kind: park, way: in, parking: 5, lane: aisle_right, approach: 14.0, street_speed: 3.0}
actors:
  - name: leaving
    model: small_car
    trajectory: {kind: park, way: out, parking: 3, lane: aisle_right, since: 16.0}
"""


def test_a_scenario_parks_in_a_place_of_its_scene(tmp_path) -> None:
    file = tmp_path / "park.yaml"
    file.write_text(TEXT)
    world = load_world(ScenarioSpec.load(file))  # on the ground, nobody touched
    place = world.document.lanes.parking[5]
    np.testing.assert_allclose(world.at(23.0).actor_pose("ego").position, place.position, atol=0.02)
    assert ScenarioSpec(**ScenarioSpec.load(file).to_dict()) == ScenarioSpec.load(file)
    wheels = [index for index, name in enumerate(world.parts.name) if "ego" in name and "wheel" in name]
    steered = []
    for state in (world.at(time) for time in np.arange(4.0, 20.0, 1.0)):
        axles = [state.part_pose(part).rotation[:, 1] for part in wheels]  # axes, whatever the wheels have rolled
        steered.append([np.degrees(np.arcsin(state.actor_pose("ego").rotation[:, 0] @ axle)) for axle in axles])
    most = np.abs(steered).max(0)
    assert 28.0 < most.max() < 42.0  # the inner front wheel turns more than the bicycle's 32 deg
    assert np.sum(most < 0.1) == np.sum(most > 20.0)  # rear wheels do not turn
    with pytest.raises(ScenarioError, match="no parking place 99") as caught:
        file.write_text(TEXT.replace("parking: 5", "parking: 99"))
        load_world(ScenarioSpec.load(file))
    assert caught.value.problems[0].line == 7
    with pytest.raises(ScenarioError, match="one of `parking`, `position`"):
        file.write_text(TEXT.replace("parking: 5, ", ""))
        ScenarioSpec.load(file)
