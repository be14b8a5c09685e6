"""Smooth motion: exact velocities, the kinematic bicycle, bounded acceleration and jerk, tables."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pytest

from scarl_sionna.core.errors import (
    ParameterRangeError,
    ScenarioFileError,
    ScenarioPlace,
    TimeRangeError,
    TrajectoryFileError,
    UnknownNameError,
)
from scarl_sionna.scenario.motion.bodies import WALKER, ActorBody
from scarl_sionna.scenario.motion.motions import Setting, trajectory_of
from scarl_sionna.scenario.motion.paths import LateralShift, PathTrajectory, SmoothPath, quintic_step
from scarl_sionna.scenario.motion.profiles import SpeedProfile, constant_way, smooth_way
from scarl_sionna.scenario.motion.recorded import Record, smooth_record
from scarl_sionna.scenario.motion.routes import Route, route_points, vehicle_trajectory
from scarl_sionna.scenario.motion.tables import read_table, read_table_actors, write_table
from scarl_sionna.scenario.spec.motion import TableSpec, WaypointsSpec
from scarl_sionna.scene.lanes import LaneNetwork, lanes_from_tables

CAR = ActorBody(4.6, 1.8, 1.45, 2.7, -1.35)


def hill_and_bend() -> LaneNetwork:
    """Up 1 m over 50 m, a quarter circle of radius 15 m to the left, straight on."""
    angle = np.linspace(0.0, np.pi / 2, 13)
    arc = np.column_stack([50.0 + 15.0 * np.sin(angle), 15.0 - 15.0 * np.cos(angle), np.ones_like(angle)])
    way = np.linspace(0.0, 50.0, 26)
    ramp = np.column_stack([way, 0.0 * way, quintic_step(way / 50.0)])
    return lanes_from_tables(
        [
            {"name": "a", "points": ramp, "next": ["b"]},
            {"name": "b", "points": arc, "next": ["c"]},
            {"name": "c", "points": [[65.0, 15.0, 1.0], [65.0, 115.0, 1.0]]},
        ]
    )


def drive(**rest: object) -> PathTrajectory:
    profile = SpeedProfile(9.0).hold(1.0).reach(6.0, 2.0, 3.0).hold(4.0).stop_at(110.0, 4.0, 8.0)
    route = Route(hill_and_bend(), ["a", "b", "c"], **rest)  # type: ignore[arg-type]
    return route.trajectory(6.0, profile, model=CAR, duration=25.0)


def test_twist_is_the_derivative_of_the_pose() -> None:
    motion = drive(shifts=[LateralShift(10.0, 30.0, 0.8)])
    step = 1e-4
    for time in np.linspace(0.01, 24.9, 120):
        before, here, after = (motion.pose(time + shift) for shift in (-step, 0.0, step))
        twist = motion.twist(time)
        # central differences: h^2/6 of the third derivative (< 60 m/s^3), and rounding 1e-14 / h
        assert (after.position - before.position) / (2 * step) == pytest.approx(twist.linear, abs=1e-6)
        spin = (after.rotation - before.rotation) / (2 * step) @ here.rotation.T
        assert np.array([spin[2, 1], spin[0, 2], spin[1, 0]]) == pytest.approx(twist.angular, abs=1e-6)


def test_acceleration_is_continuous() -> None:
    motion = drive()
    # halving the step halves the largest change of the velocity's difference: no jump is left
    jumps = []
    for step in (0.01, 0.005, 0.0025):
        velocity = motion.sample(np.arange(0.0, 25.0, step))[3]
        jumps.append(np.abs(np.diff(velocity, 2, axis=0)).max() / step)
    assert jumps[1] < 0.62 * jumps[0] and jumps[2] < 0.62 * jumps[1]


def test_rear_axle_has_no_slip_and_both_axles_stand_on_the_road() -> None:
    motion = drive()
    network = hill_and_bend()
    for time in np.linspace(0.0, 24.0, 60):
        pose, twist = motion.pose(time), motion.twist(time)
        rear = pose.apply([CAR.rear_axle, 0.0, 0.0])
        velocity = twist.velocity_at(rear - pose.position)
        sideways = velocity @ pose.rotation[:, 1]
        assert abs(sideways) < 1e-9
        front = pose.apply([CAR.rear_axle + CAR.wheelbase, 0.0, 0.0])
        for axle in (rear, front):
            ground = min(
                (network[name].nearest(axle)[1], float(network[name].at(network[name].nearest(axle)[0])[2]))
                for name in "abc"
            )[1]
            assert axle[2] == pytest.approx(
                ground, abs=0.01
            )  # the ramp's points are 2 m apart: a sagitta of 2 mm, and the fit


def test_turning_circle() -> None:
    """Mid-bend of radius R the yaw rate is v / R, and the car's middle is outside by the lever's square / 2R."""
    radius, speed = 15.0, 6.0
    angle = np.linspace(0.0, np.pi, 40)
    points = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), np.zeros_like(angle)])
    path = SmoothPath(points, extend=(6.0, 6.0))
    motion = PathTrajectory(path, constant_way(speed, 0.0, 7.0), CAR)
    rate = motion.sample(np.linspace(2.0, 6.0, 401))[4][:, 2]
    assert rate.mean() == pytest.approx(speed / radius, rel=2e-3)
    assert rate == pytest.approx(speed / radius, rel=0.015)  # the cubics that join the points bend by 1 % more and less
    pose = motion.pose(4.0)
    assert np.linalg.norm(pose.position[:2]) == pytest.approx(np.hypot(radius, CAR.rear_axle), abs=2e-3)
    assert (
        path.deviation < 0.03
    )  # where the straight extensions meet the arc; smoothing^2 / (100 R) is 6 mm in its order
    assert np.linalg.norm(path.at(np.linspace(0.0, path.length, 400), 1), axis=1) == pytest.approx(1.0, abs=1e-3)


def test_pickle_and_range() -> None:
    motion = drive()
    again = pickle.loads(pickle.dumps(motion))
    assert np.array_equal(again.pose(3.3).position, motion.pose(3.3).position)
    with pytest.raises(TimeRangeError, match="'actor'"):
        motion.pose(25.1)


def test_route_errors() -> None:
    network = hill_and_bend()
    with pytest.raises(UnknownNameError, match="lane after 'a' 'c'"):
        Route(network, ["a", "c"]).trajectory(model=CAR)
    with pytest.raises(UnknownNameError, match="lane 'x'"):
        Route(network, ["x"]).trajectory(model=CAR)
    with pytest.raises(ParameterRangeError, match="name more lanes"):
        Route(network, ["a"]).trajectory(5.0, 10.0, model=CAR, duration=30.0)
    with pytest.raises(ParameterRangeError, match="start = 80"):
        Route(network, ["a"]).trajectory(80.0, 10.0, model=CAR)
    points, starts = route_points(network, ["a", "b"])
    assert starts.tolist() == pytest.approx([0.0, network["a"].length], abs=1e-9) and len(points) == 26 + 13 - 1


def test_speed_profile_bounds_and_way() -> None:
    profile = SpeedProfile(8.0).hold(2.0).reach(13.0, 2.0, 4.0).stop_at(150.0, 6.0, 15.0)
    assert profile.final_way == pytest.approx(150.0, abs=1e-9) and profile.final_speed == 0.0
    way = profile.way(profile.duration + 5.0)
    time = np.linspace(0.0, profile.duration + 5.0, 4001)
    speed, pull, jerk = (way(time, order) for order in (1, 2, 3))
    assert speed.min() >= -1e-9 and speed.max() == pytest.approx(13.0)
    assert pull.min() >= -6.0 - 1e-9 and pull.max() <= 2.0 + 1e-9 and np.abs(jerk).max() <= 15.0 + 1e-9
    assert way(time[-1]) == pytest.approx(150.0, abs=1e-6)
    # reach: from 8 to 13 m/s at 2 m/s2 and 4 m/s3 takes dv/a + a/j = 3 s, at the mean of both speeds
    change = SpeedProfile(8.0).reach(13.0, 2.0, 4.0)
    assert change.duration == pytest.approx(3.0) and change.final_way == pytest.approx(3.0 * 10.5)
    with pytest.raises(ParameterRangeError, match="brake harder"):
        SpeedProfile(20.0).stop_at(10.0)


def test_smooth_way_is_exact_monotone_and_stands() -> None:
    time = np.linspace(0.0, 6.0, 13)
    cubic = smooth_way(time, 5.0 * time + 0.3 * time**3)
    fine = np.linspace(0.0, 6.0, 200)
    assert cubic(fine) == pytest.approx(5.0 * fine + 0.3 * fine**3, abs=1e-9)
    stops = smooth_way(np.arange(8.0), [0.0, 10.0, 18.0, 21.0, 21.0, 21.0, 22.0, 26.0])
    fine = np.linspace(0.0, 7.0, 2000)
    assert stops(fine, 1).min() > -0.15  # a quintic between slopes that fall to zero: it may roll back by millimetres
    assert np.ptp(stops(np.linspace(3.0, 5.0, 50))) < 0.05
    assert np.abs(stops(4.5, 1)) < 1e-12
    for knot in range(1, 7):
        assert stops(knot - 1e-9, 2) == pytest.approx(float(stops(knot + 1e-9, 2)), abs=1e-5)


def test_waypoints_with_times_and_speed() -> None:
    points = np.array([[0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [20.0, 2.0, 0.0], [30.0, 6.0, 0.0]])
    motion = vehicle_trajectory(points, [0.0, 1.0, 2.0, 3.1], model=CAR)
    for time, point in zip([0.0, 1.0, 2.0, 3.1], points, strict=True):
        assert motion.pose(time).position == pytest.approx(
            point, abs=0.12
        )  # the middle is outside the bend by a^2/2R, and the fit
    steady = vehicle_trajectory(points, speed=5.0, model=CAR, start_time=2.0)
    assert steady.start == 2.0
    assert steady.speed(np.linspace(2.0, steady.stop, 20)) == pytest.approx(5.0)
    with pytest.raises(ParameterRangeError, match="one of the two"):
        vehicle_trajectory(points)
    with pytest.raises(ParameterRangeError, match="two distinct points"):
        vehicle_trajectory([[0.0, 0.0, 0.0]] * 3, [0.0, 1.0, 2.0], model=WALKER)


def test_lane_change_in_one_step_is_drawn_out() -> None:
    time = np.arange(0.0, 10.05, 0.1)
    points = np.column_stack([12.0 * time, np.where(time > 5.0, 3.2, 0.0), np.zeros_like(time)])
    smoothed = smooth_record(Record("a", time, points, np.zeros_like(time), 2.3), CAR)
    assert smoothed.num_lane_changes == 1 and smoothed.deviation < 0.02
    motion = smoothed.trajectory
    assert isinstance(motion, PathTrajectory)
    fine = np.linspace(0.0, 10.0, 2001)
    position, _, _, velocity, angular = motion.sample(fine)
    assert position[0, 1] == pytest.approx(0.0, abs=0.01) and position[-1, 1] == pytest.approx(3.2, abs=0.01)
    # quintic over 3 s: lateral speed at most 1.875 * 3.2 / 3 s = 2 m/s, lateral acceleration at most 5.77 * 3.2 / 9 =
    # 2.05 m/s2
    assert np.abs(velocity[:, 1]).max() == pytest.approx(2.0, rel=0.1)
    assert np.abs(angular[:, 2] * motion.speed(fine)).max() < 2.05 * 1.25
    assert np.abs(np.diff(position, axis=0)).max() < 13.0 * 0.005
    with pytest.raises(ParameterRangeError, match="carried elsewhere"):
        smooth_record(
            Record("a", time, points + np.where(time > 3.0, 500.0, 0.0)[:, None] * [1.0, 0.0, 0.0], 0.0 * time), CAR
        )


def test_record_is_continued_straight() -> None:
    time = np.arange(2.0, 5.05, 0.1)
    points = np.column_stack([13.9 * time, np.zeros_like(time), np.zeros_like(time)])
    motion = smooth_record(Record("a", time, points, np.zeros_like(time), 2.3), CAR, (0.0, 9.0)).trajectory
    assert motion.start == 0.0 and motion.stop == 9.0
    assert motion.pose(8.0).position == pytest.approx([13.9 * 8.0 - 2.3, 0.0, 0.0], abs=1e-6)


@pytest.mark.parametrize("speed", [10.0, 30.0, 2.0])
@pytest.mark.parametrize("pull", [0.0, -1.5, 1.0])
def test_what_is_before_and_after_a_record_does_not_change_it(speed: float, pull: float) -> None:
    """Ends were rounded together with what follows: 10 m/s became 9.97 to 10.13 m/s."""
    time = np.arange(2.0, 5.05, 0.1)
    way = speed * (time - 2.0) + 0.5 * pull * (time - 2.0) ** 2
    way = np.maximum.accumulate(np.where((pull < 0.0) & (time > 2.0 - speed / min(pull, -1e-9)), way.max(), way))
    record = Record("a", time, np.column_stack([way, 0.0 * way, 0.0 * way]), 0.0 * time, 2.3)
    alone, longer = (smooth_record(record, CAR, span).trajectory for span in (None, (-3.0, 12.0)))
    assert isinstance(alone, PathTrajectory) and isinstance(longer, PathTrajectory)
    inside = np.linspace(2.0, 5.0, 301)
    np.testing.assert_allclose(longer.sample(inside)[3], alone.sample(inside)[3], atol=1e-6)
    np.testing.assert_allclose(longer.sample(inside)[0], alone.sample(inside)[0], atol=1e-6)
    if pull == 0.0:
        np.testing.assert_allclose(longer.speed(inside), speed, atol=0.01)
    fine = np.linspace(-3.0, 12.0, 15001)
    found = longer.speed(fine)
    assert found.min() > -1e-9
    assert np.abs(np.diff(found, 2)).max() < 1e-3 * 0.05  # no step of acceleration: less than 50 m/s3
    assert found[[0, -1]] == pytest.approx([13.9, 13.9], abs=1e-6)


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_table_there_and_back(tmp_path: Path, suffix: str) -> None:
    if suffix == "parquet":
        pytest.importorskip("pyarrow")
    motion = drive()
    times = np.arange(0.0, 20.0, 0.1)
    write_table(tmp_path / f"t.{suffix}", [("ego", motion)], times)
    back = read_table(tmp_path / f"t.{suffix}")["ego"]
    for time in (0.7, 3.33, 9.1):
        # cubic splines over 0.1 s: h^4 / 384 of the fourth derivative, some 100 m/s^4 where the steering goes over
        assert back.pose(time).position == pytest.approx(motion.pose(time).position, abs=1e-4)
        assert back.twist(time).linear == pytest.approx(motion.twist(time).linear, abs=5e-3)


def test_table_without_heading_follows_the_way(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    rows = [f"{t:.1f},a,{10.0 * t},{0.0},bus" for t in np.arange(0.0, 3.0, 0.5)] + [
        "0,still,5,20,adult_man",
        "2,still,5,20,adult_man",
    ]
    path.write_text("t,track_id,x,y,type\n" + "\n".join(rows) + "\n")
    actors = {actor.name: actor for actor in read_table_actors(path, models={"bus": CAR, "adult_man": WALKER})}
    assert actors["a"].model == "bus" and actors["a"].trajectory.twist(1.2).linear == pytest.approx(
        [10.0, 0.0, 0.0], abs=1e-6
    )
    assert actors["a"].trajectory.pose(1.0).position == pytest.approx([10.0, 0.0, 0.0], abs=1e-6)
    assert actors["still"].trajectory.twist(1.0).linear == pytest.approx([0.0, 0.0, 0.0])


@pytest.mark.parametrize(
    ("text", "message", "row", "column"),
    [
        ("time,id,x\n0,a,1\n", "is missing", None, "y"),
        ("time,id,x,y\n0,a,1,2\n1,a,oops,2\n", "'oops' is not a finite number", 2, "x"),
        ("time,id,x,y\n0,a,1,2\n1,a,nan,2\n", "not a finite number", 2, "x"),
        ("time,id,x,y\n0,a,1,2\n0,a,2,2\n", "does not come after", 2, "time"),
        ("time,id,x,y\n0,,1,2\n", "is empty", 1, "id"),
        ("time,id,x,y\n0,a,1\n", "the header has 4 columns", 1, None),
        ("", "is empty", None, None),
        ("time,id,x,y\n", "has no rows", None, None),
    ],
)
def test_a_wrong_table_is_told(tmp_path: Path, text: str, message: str, row: int | None, column: str | None) -> None:
    path = tmp_path / "t.csv"
    path.write_text(text)
    with pytest.raises(TrajectoryFileError, match=message) as caught:
        read_table(path)
    assert caught.value.row == row and caught.value.column == column


def test_formats_that_are_not_read(tmp_path: Path) -> None:
    with pytest.raises(ScenarioFileError, match=r"t\.xosc: is not there"):
        read_table(tmp_path / "t.xosc")
    with pytest.raises(TrajectoryFileError, match="'.json' is not known"):
        read_table(tmp_path / "t.json")
    with pytest.raises(TrajectoryFileError, match="cannot be read"):
        read_table(tmp_path / "t.csv")


@pytest.mark.parametrize("column", ["", "lorry"])
def test_in_a_scenario_the_actors_own_body_drives_a_table(tmp_path: Path, column: str) -> None:
    """A recorded circle of 2 m without headings: who walks stays on it and faces along it, whatever the table says."""
    times = np.arange(0.0, 6.05, 0.1)
    angle = 0.5 * times
    rows = [f"{t:.1f},a,{2 * np.cos(u)},{2 * np.sin(u)},{column}" for t, u in zip(times, angle, strict=True)]
    path = tmp_path / "circle.csv"
    path.write_text("time,id,x,y,model\n" + "\n".join(rows) + "\n")
    setting = Setting("urban_crossing", None, 0.0, 5.0, Path)
    spec = TableSpec(file=str(path), id="a")
    on_foot = trajectory_of(spec, "man", WALKER, setting, lambda *keys: ScenarioPlace())
    driven = trajectory_of(spec, "car", CAR, setting, lambda *keys: ScenarioPlace())
    for time in (1.0, 2.5, 4.0):
        pose = on_foot.pose(time)
        assert np.hypot(*pose.position[:2]) == pytest.approx(2.0, abs=0.01)
        assert np.angle(np.exp(1j * (pose.yaw - 0.5 * time - np.pi / 2.0))) == pytest.approx(0.0, abs=0.01)
        assert abs(np.hypot(*driven.pose(time).position[:2]) - 2.0) > 0.1


@pytest.mark.parametrize("pace", [{"speed": 1.3}, {"times": [0.0, 2.3, 5.4]}])
def test_people_walk_straight_from_point_to_point(pace: dict) -> None:
    """Two legs of 3 m: on both lines up to 1 m before and after their corner, round that on its inner side."""
    setting = Setting("urban_crossing", None, 0.0, 4.0, Path)
    spec = WaypointsSpec(positions=[[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [3.0, 3.0, 0.0]], **pace)
    motion = trajectory_of(spec, "man", WALKER, setting, lambda *keys: ScenarioPlace())
    legs = set()
    for time in np.arange(0.0, 4.3, 0.05):
        pose, twist = motion.pose(time), motion.twist(time)
        x, y = pose.position[:2]
        assert np.degrees(np.arctan2(twist.linear[1], twist.linear[0]) - pose.yaw) == pytest.approx(0.0, abs=1e-3)
        if x < 1.95 or y > 1.05:
            legs.add(y > 1.05)
            assert (y if x < 1.95 else x - 3.0) == pytest.approx(0.0, abs=2e-3)
            assert np.degrees(pose.yaw) == pytest.approx(0.0 if x < 1.95 else 90.0, abs=0.85)
        else:
            assert x < 3.002 and y > -0.002 and np.hypot(x - 3.0, y) > 0.15 and -0.015 < pose.yaw < np.pi / 2 + 0.015
    assert legs == {False, True}
