"""Entities that go backwards: by closed forms of their speeds, along lanes, trajectories and into other lanes."""

from __future__ import annotations

import numpy as np
import pytest

from scarl_sionna.core.errors import ScenarioError, UnsupportedElementError
from scarl_sionna.scenario.checks.motion import check_motion
from scarl_sionna.scenario.motion.paths import sample_motion
from scarl_sionna.scenario.openscenario.drive import read_drive
from scarl_sionna.scene.motion.trajectory import forward_speeds, wheel_way
from tests import openscenario_files as files


def ego(folder, start: float, first: float, *events: str, street: str = files.STRAIGHT, stop: float = 12.0, more=""):
    actions = files.init("Ego", files.on_lane(start), first, more)
    text = files.scenario(files.vehicle("Ego"), actions, files.group("Ego", *events) if events else "", stop)
    return files.run(folder, text, street)["Ego"]


def is_smooth(actor, stop: float) -> None:
    """Its velocity is the derivative of its motion at all times, and nothing jumps."""
    assert check_motion([(actor.name, actor.trajectory)], np.arange(0.0, stop, 0.05)) == []
    times = np.arange(0.0, stop, 0.005)  # a jump of 0.25 mm counts, wherever it is
    motion = sample_motion(actor.trajectory, times)
    steps = np.diff(motion.position, axis=0) / 0.005
    assert np.abs(steps - 0.5 * (motion.velocity[1:] + motion.velocity[:-1])).max() < 0.05


def test_a_vehicle_goes_back_at_a_constant_speed(tmp_path) -> None:
    actor = ego(tmp_path, 200.0, -5.0)
    for time in (0.0, 3.0, 9.5):
        assert files.rear_axle(actor, time)[0] == pytest.approx(200.0 - 5.0 * time, abs=0.01)
        assert actor.trajectory.pose(time).yaw == pytest.approx(0.0, abs=1e-6)
        assert actor.trajectory.twist(time).linear[0] == pytest.approx(-5.0, abs=1e-3)
    is_smooth(actor, 12.0)


@pytest.mark.parametrize("shape", ["linear", "sinusoidal"])
def test_a_speed_goes_through_zero(tmp_path, shape: str) -> None:
    """From 6 to -4 m/s in 5 s: the way is the integral of the shape; its wheels roll on, and then back."""
    actor = ego(tmp_path, 100.0, 6.0, files.event(files.speed(-4.0, shape, "time", 5.0), files.after(2.0)))
    part = lambda t: np.clip((t - 2.0) / 5.0, 0.0, 1.0)  # noqa: E731 # a formula
    share = (lambda x: x) if shape == "linear" else (lambda x: 0.5 * (1.0 - np.cos(np.pi * x)))
    times = np.linspace(0.0, 11.5, 24)
    fine = np.linspace(0.0, 12.0, 120_001)
    speeds = 6.0 - 10.0 * share(part(fine))
    ways = np.r_[0.0, np.cumsum(0.5 * np.diff(fine) * (speeds[1:] + speeds[:-1]))]
    for time in times:
        wanted = float(np.interp(time, fine, ways))
        assert files.rear_axle(actor, float(time))[0] == pytest.approx(100.0 + wanted, abs=0.01)
        wheel = wheel_way(actor.trajectory, float(time), (actor.body.rear_axle, 0.8))
        assert wheel.rolled == pytest.approx(wanted, abs=0.01)
        assert wheel.speed == pytest.approx(float(np.interp(time, fine, speeds)), abs=0.05)
    is_smooth(actor, 12.0)


def test_it_goes_back_round_the_bend_that_it_came(tmp_path) -> None:
    """The rear axle stays on the lane's arc of 61.75 m; the heading is that of the arc, there and back."""
    turn = files.event(files.speed(-6.0, "linear", "rate", 3.0), files.after(3.0))
    actor = ego(tmp_path, 20.0, 6.0, turn, street=files.ARC, stop=10.0)
    centre, radius = np.array([0.0, files.RADIUS]), files.RADIUS + 1.75
    for time in np.linspace(0.5, 9.5, 19):
        away = files.rear_axle(actor, float(time))[:2] - centre
        assert np.hypot(*away) == pytest.approx(radius, abs=0.02)
        way = 6.0 * time if time < 3.0 else 18.0 + 6.0 * (time - 3.0) - 1.5 * (time - 3.0) ** 2
        way = way if time < 7.0 else 18.0 - 6.0 * (time - 7.0)
        angle = 20.0 / files.RADIUS + way / radius
        assert np.arctan2(away[0], -away[1]) * radius == pytest.approx(angle * radius, abs=0.05)
        # beyond where it turns back its path goes on straight: there the heading is 5 mrad off
        assert actor.trajectory.pose(float(time)).yaw == pytest.approx(angle, abs=6e-3)
    is_smooth(actor, 10.0)


def test_it_goes_back_into_another_lane(tmp_path) -> None:
    """There along one lane, back into the other: two paths, joined where it stands, its nose ahead all the time."""
    back = files.event(files.speed(-8.0, "linear", "rate", 4.0), files.after(2.0), "back")
    aside = files.lane_change('<AbsoluteTargetLane value="-2"/>', "cubic", "time", 4.0)
    actor = ego(tmp_path, 200.0, 8.0, back, files.event(aside, files.after(6.5), "aside"), stop=12.0)
    for time in np.linspace(0.0, 11.8, 28):
        way = 8.0 * time if time < 2.0 else 16.0 + 8.0 * (time - 2.0) - 2.0 * (time - 2.0) ** 2
        way = way if time < 6.0 else 16.0 - 8.0 * (time - 6.0)
        x = np.clip((time - 6.5) / 4.0, 0.0, 1.0)
        place = files.rear_axle(actor, float(time))
        assert place[0] == pytest.approx(200.0 + way, abs=0.05)
        assert place[1] == pytest.approx(-1.75 - 3.5 * x * x * (3.0 - 2.0 * x), abs=0.05)
        assert abs(actor.trajectory.pose(float(time)).yaw) < 0.4
    assert forward_speeds(actor.trajectory, [11.0])[0] == pytest.approx(-8.0, abs=0.01)
    is_smooth(actor, 12.0)


def test_a_trajectory_is_followed_with_the_rear_ahead_and_left_where_it_began(tmp_path) -> None:
    """-22 + 5 t m/s from (200, -1.75) towards (250, 1.75): it stands after 4.4 s and is back after 8.8 s."""
    places = "".join(f"<Vertex>{files.on_lane(s, lane)}</Vertex>" for s, lane in ((200.0, -1), (250.0, 1)))
    follow = (
        "<PrivateAction><RoutingAction><FollowTrajectoryAction><TimeReference><None/></TimeReference>"
        '<TrajectoryFollowingMode followingMode="position"/><TrajectoryRef><Trajectory name="t" closed="false"><Shape>'
        f"<Polyline>{places}</Polyline></Shape></Trajectory></TrajectoryRef></FollowTrajectoryAction>"
        "</RoutingAction></PrivateAction>"
    )
    faster = files.event(files.speed(22.0, "linear", "rate", 5.0), "")
    actor = ego(tmp_path, 200.0, -22.0, faster, stop=8.5, more=follow)
    along = np.array([50.0, 3.5]) / np.hypot(50.0, 3.5)
    for time in np.linspace(0.1, 8.4, 30):
        wanted = np.array([200.0, -1.75]) + along * (22.0 * time - 2.5 * time**2)
        assert np.hypot(*(files.rear_axle(actor, float(time))[:2] - wanted)) < 0.05
        heading = actor.trajectory.pose(float(time)).yaw - np.arctan2(3.5, 50.0)
        assert abs(np.cos(heading) + 1.0) < 1e-4
    is_smooth(actor, 8.5)


def test_who_does_not_go_back_is_named(tmp_path) -> None:
    entities = files.vehicle("Ego") + files.vehicle("rider", "bicycle")
    actions = files.init("Ego", files.on_lane(20.0), 5.0) + files.init("rider", files.on_lane(90.0), -2.0)
    with pytest.raises(UnsupportedElementError, match=r"asks for -2 m/s of 'rider' \(bicycle\); let it turn round"):
        files.run(tmp_path, files.scenario(entities, actions))
    over = files.event(files.speed(-4.0, "linear", "distance", 20.0), files.after(2.0))
    with pytest.raises(UnsupportedElementError, match="turns from 6 to -4 m/s over a distance; give a rate or a time"):
        ego(tmp_path, 100.0, 6.0, over)
    lorry = files.vehicle("Ego", "truck", "").replace('length="4.5"', 'length="16.5"')
    with pytest.raises(ScenarioError, match="without a trailer go backwards"):
        files.run(tmp_path, files.scenario(lorry, files.init("Ego", files.on_lane(200.0), -3.0)))


def test_the_way_is_counted_and_ends_at_the_end_of_the_road(tmp_path) -> None:
    """Back from 30 m with 6 m/s: the travelled distance is 18 m after 3 s, and the road ends after 5 s."""
    stop = files.of_entity("Ego", '<TraveledDistanceCondition value="18"/>')
    text = files.scenario(files.vehicle("Ego"), files.init("Ego", files.on_lane(30.0), -6.0), stop=stop)
    assert read_drive(files.written(tmp_path, text)).run.stop == pytest.approx(3.0, abs=1e-5)
    text = files.scenario(files.vehicle("Ego"), files.init("Ego", files.on_lane(30.0), -6.0), stop=20.0)
    with pytest.warns(match="'Ego' comes to the end of the roads"):
        assert read_drive(files.written(tmp_path, text)).run.stop == pytest.approx(5.0, abs=0.02)
