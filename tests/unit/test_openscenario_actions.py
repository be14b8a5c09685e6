"""Actions of OpenSCENARIO against closed forms: positions within 5 cm, most within millimetres."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import fresnel

from scarl_sionna.core.errors import ScarlWarning
from tests import openscenario_files as files
from tests import street_maps as maps

CLOSE = 0.05
"""[m], the bar for positions."""
SHAPES = {
    "linear": lambda x: x,
    "cubic": lambda x: x * x * (3.0 - 2.0 * x),
    "sinusoidal": lambda x: 0.5 * (1.0 - math.cos(math.pi * x)),
}
PEAK = {"linear": 1.0, "cubic": 1.5, "sinusoidal": 0.5 * math.pi}
TIMES = np.arange(0.0, 9.9, 0.1)


def way(speed, time: float, stops: tuple[float, ...] = ()) -> float:
    return float(quad(speed, 0.0, time, points=[one for one in stops if 0.0 < one < time] or None, epsabs=1e-9)[0])


def alone(action: str, *, start: float = 20.0, speed: float = 20.0, lane: int = -1, at: float = 2.0) -> str:
    """Return the scenario of one vehicle that does one action at a time."""
    actions = files.init("Ego", files.on_lane(start, lane), speed)
    return files.scenario(files.vehicle("Ego"), actions, files.group("Ego", files.event(action, files.after(at))))


def test_a_vehicle_keeps_lane_and_speed(tmp_path):
    ego = files.run(tmp_path, files.scenario(files.vehicle("Ego"), files.init("Ego", files.on_lane(20.0), 13.0)))["Ego"]
    for time in TIMES:
        assert files.rear_axle(ego, time) == pytest.approx([20.0 + 13.0 * time, -1.75, 0.0], abs=1e-3)
        assert ego.trajectory.twist(time).linear == pytest.approx([13.0, 0.0, 0.0], abs=1e-3)


@pytest.mark.parametrize("lane, radius", [(-1, files.RADIUS + 1.75), (1, files.RADIUS - 1.75)])
def test_a_bend_is_driven_at_the_speed_of_the_lane(tmp_path, lane, radius):
    start = 5.0 if lane < 0 else 145.0
    actions = files.init("Ego", files.on_lane(start, lane), 10.0)
    ego = files.run(tmp_path, files.scenario(files.vehicle("Ego"), actions), files.ARC)["Ego"]
    for time in TIMES:
        angle = start / files.RADIUS + (10.0 * time / radius) * (1.0 if lane < 0 else -1.0)
        wanted = [radius * math.sin(angle), files.RADIUS - radius * math.cos(angle), 0.0]
        assert files.rear_axle(ego, time) == pytest.approx(wanted, abs=0.01)


@pytest.mark.parametrize("dimension", ["time", "rate"])
@pytest.mark.parametrize("shape", list(SHAPES))
@pytest.mark.parametrize("target", [28.0, 5.0])
def test_speeds_change_by_their_shape(tmp_path, shape, dimension, target):
    amount = 4.0 if dimension == "time" else 3.0
    ego = files.run(tmp_path, alone(files.speed(target, shape, dimension, amount)))["Ego"]
    took = 4.0 if dimension == "time" else abs(target - 20.0) * PEAK[shape] / 3.0

    def wanted(time: float) -> float:
        return 20.0 + (target - 20.0) * SHAPES[shape](min(max((time - 2.0) / took, 0.0), 1.0))

    for time in TIMES[::5]:
        x = 20.0 + way(wanted, time, (2.0, 2.0 + took))
        assert files.rear_axle(ego, time) == pytest.approx([x, -1.75, 0.0], abs=0.01)
        assert ego.trajectory.twist(time).linear[0] == pytest.approx(wanted(time), abs=0.15)


@pytest.mark.parametrize("shape", list(SHAPES))
def test_a_speed_is_reached_after_a_distance(tmp_path, shape):
    ego = files.run(tmp_path, alone(files.speed(10.0, shape, "distance", 60.0)))["Ego"]
    end = 2.0 + 2.0 * 60.0 / 30.0
    assert files.rear_axle(ego, end)[0] == pytest.approx(20.0 + 40.0 + 60.0, abs=CLOSE)
    assert files.rear_axle(ego, end + 2.0)[0] == pytest.approx(140.0, abs=CLOSE)


def test_a_step_of_speed_during_the_run_takes_the_vehicle_s_acceleration(tmp_path):
    ego = files.run(tmp_path, alone(files.speed(28.0)))["Ego"]
    assert files.rear_axle(ego, 6.0)[0] == pytest.approx(20.0 + 40.0 + 24.0 + 3.0 * 28.0, abs=CLOSE)


@pytest.mark.parametrize("dimension, amount", [("time", 3.0), ("rate", 1.5), ("distance", 60.0)])
@pytest.mark.parametrize("shape", list(SHAPES))
@pytest.mark.parametrize("speed", [8.0, 30.0])
def test_lanes_change_by_their_shape(tmp_path, shape, dimension, amount, speed):
    change = files.lane_change('<AbsoluteTargetLane value="-2"/>', shape, dimension, amount)
    ego = files.run(tmp_path, alone(change, speed=speed))["Ego"]
    took = {"time": 3.0, "rate": files.LANE * PEAK[shape] / 1.5, "distance": 60.0 / speed}[dimension]
    worst = 0.0
    for time in TIMES:
        y = -1.75 - files.LANE * SHAPES[shape](min(max((time - 2.0) / took, 0.0), 1.0))
        worst = max(worst, float(np.abs(files.rear_axle(ego, time)[:2] - [20.0 + speed * time, y]).max()))
    # a linear one has a corner at both ends, which the path rounds
    corner = files.LANE / took / speed * max(3.0, 0.75 * (speed - 12.0)) / 6.0 if shape == "linear" else 0.0
    assert worst < CLOSE + corner


@pytest.mark.parametrize("shape", list(SHAPES))
@pytest.mark.parametrize("starts", [False, True])
def test_who_stands_changes_no_lane_and_one_who_sets_off_changes_it_on_its_way(tmp_path, shape, starts):
    acts = [files.event(files.lane_change('<AbsoluteTargetLane value="-2"/>', shape, "time", 2.0), files.after(1.0))]
    if starts:
        acts.append(files.event(files.speed(8.0, "linear", "time", 2.0), files.after(4.0), "off"))
    text = files.scenario(
        files.vehicle("Ego"), files.init("Ego", files.on_lane(20.0, -1), 0.0), files.group("Ego", *acts)
    )
    with pytest.warns(ScarlWarning, match="drives too little meanwhile"):
        ego = next(iter(files.read_openscenario(files.written(tmp_path, text, files.STRAIGHT))))
    times = np.arange(0.0, 9.9, 0.05)
    poses = [ego.trajectory.pose(time) for time in times]
    aside = np.array([files.rear_axle(ego, time)[1] + 1.75 for time in times])
    turned = np.degrees([abs(pose.yaw) for pose in poses])
    assert np.abs(aside[times < 4.0]).max() < 0.25 and np.ptp(turned[times < 4.0]) < 0.01  # it stands
    assert turned[0] < 10.0 and turned.max() < 42.0
    assert abs(aside[-1] - (-3.5 if starts else 0.0)) < 0.05


def test_a_lane_relative_to_another_vehicle_is_to_the_left_of_it(tmp_path):
    actions = files.init("Ego", files.on_lane(20.0, -2), 20.0) + files.init("other", files.on_lane(300.0, 1), 10.0)
    change = files.lane_change('<RelativeTargetLane entityRef="Ego" value="1"/>')
    back = files.lane_change('<RelativeTargetLane entityRef="other" value="1"/>')
    groups = files.group("Ego", files.event(change, files.after(2.0)))
    groups += files.group("other", files.event(back, files.after(2.0)), name="second")
    both = files.vehicle("Ego") + files.vehicle("other")
    found = files.run(tmp_path, files.scenario(both, actions, groups))
    assert files.rear_axle(found["Ego"], 6.0) == pytest.approx([140.0, -1.75, 0.0], abs=0.01)
    assert files.rear_axle(found["other"], 6.0) == pytest.approx([240.0, -1.75, 0.0], abs=0.01)  # the oncoming lane


@pytest.mark.parametrize("shape, factor", [("sinusoidal", 0.5 * math.pi**2), ("cubic", 6.0)])
def test_an_offset_is_reached_with_a_lateral_acceleration(tmp_path, shape, factor):
    offset = (
        '<PrivateAction><LateralAction><LaneOffsetAction continuous="false">'
        f'<LaneOffsetActionDynamics dynamicsShape="{shape}" maxLateralAcc="0.8"/><LaneOffsetTarget>'
        '<AbsoluteTargetLaneOffset value="-0.7"/></LaneOffsetTarget></LaneOffsetAction></LateralAction></PrivateAction>'
    )
    ego = files.run(tmp_path, alone(offset))["Ego"]
    took = math.sqrt(factor * 0.7 / 0.8)
    for time in TIMES:
        y = -1.75 - 0.7 * SHAPES[shape](min(max((time - 2.0) / took, 0.0), 1.0))
        assert files.rear_axle(ego, time) == pytest.approx([20.0 + 20.0 * time, y, 0.0], abs=0.02)


def test_a_speed_is_held_relative_to_another(tmp_path):
    target = '<RelativeTargetSpeed entityRef="lead" value="1.2" speedTargetValueType="factor" continuous="true"/>'
    actions = files.init("lead", files.on_lane(100.0), 10.0)
    actions += (
        f'<Private entityRef="Ego">{files.teleport(files.on_lane(20.0))}{files.speed(0.0, target=target)}</Private>'
    )
    groups = files.group("lead", files.event(files.speed(15.0, "linear", "time", 5.0), files.after(2.0)))
    both = files.vehicle("lead") + files.vehicle("Ego")
    found = files.run(tmp_path, files.scenario(both, actions, groups))
    for time in TIMES[::5]:
        gone = files.rear_axle(found["lead"], time)[0] - 100.0
        assert files.rear_axle(found["Ego"], time)[0] == pytest.approx(20.0 + 1.2 * gone, abs=0.02)


@pytest.mark.parametrize("kind, gap", [('timeGap="1.5"', 1.5 * 15.0), ('distance="20"', 20.0)])
@pytest.mark.parametrize("is_free", [True, False])
def test_a_distance_is_kept(tmp_path, kind, gap, is_free):
    keep = (
        f'<PrivateAction><LongitudinalAction><LongitudinalDistanceAction entityRef="lead" {kind} continuous="true" '
        f'freespace="{str(is_free).lower()}" coordinateSystem="road"><DynamicConstraints maxAcceleration="3" '
        'maxDeceleration="5" maxSpeed="40"/></LongitudinalDistanceAction></LongitudinalAction></PrivateAction>'
    )
    actions = files.init("lead", files.on_lane(120.0), 15.0) + files.init("Ego", files.on_lane(20.0), 15.0)
    both = files.vehicle("lead") + files.vehicle("Ego")
    groups = files.group("Ego", files.event(keep, files.after(0.0)))
    found = files.run(tmp_path, files.scenario(both, actions, groups, 35.0))
    away = files.rear_axle(found["lead"], 35.0)[0] - files.rear_axle(found["Ego"], 35.0)[0]
    assert away == pytest.approx(gap + (4.5 if is_free else 0.0), abs=CLOSE)
    speeds = [found["Ego"].trajectory.twist(time).linear[0] for time in np.arange(0.0, 35.0, 0.1)]
    assert max(np.diff(speeds)) < 0.31 and min(np.diff(speeds)) > -0.51
    assert min(away, 100.0) > 4.5


@pytest.mark.parametrize("final", ["", '<FinalSpeed><AbsoluteSpeed value="8"/></FinalSpeed>'])
def test_two_vehicles_arrive_at_one_time(tmp_path, final):
    action = (
        '<PrivateAction><SynchronizeAction masterEntityRef="Ego">'
        f"<TargetPositionMaster>{files.on_lane(200.0)[10:-11]}</TargetPositionMaster>"
        f"<TargetPosition>{files.on_lane(190.0, -2)[10:-11]}</TargetPosition>"
        f"{final}</SynchronizeAction></PrivateAction>"
    )
    actions = files.init("Ego", files.on_lane(20.0), 20.0) + files.init("other", files.on_lane(60.0, -2), 12.0)
    both = files.vehicle("Ego") + files.vehicle("other")
    groups = files.group("other", files.event(action, files.after(1.0)))
    found = files.run(tmp_path, files.scenario(both, actions, groups, 12.0))
    arrival = 180.0 / 20.0
    assert files.rear_axle(found["other"], arrival)[0] == pytest.approx(190.0, abs=CLOSE)
    time, left, v = arrival - 1.0, 190.0 - 72.0, 12.0  # from the start of the action on
    if final:
        pull, jerk = 6.0 * left / time**2 - (4.0 * v + 16.0) / time, 0.0
        jerk = 2.0 * (8.0 - v - pull * time) / time**2
        assert found["other"].trajectory.twist(arrival + 1.0).linear[0] == pytest.approx(8.0, abs=0.01)
    else:
        pull, jerk = 2.0 * (left - v * time) / time**2, 0.0
    for moment in np.arange(0.0, time, 0.5):
        x = 72.0 + v * moment + 0.5 * pull * moment**2 + jerk * moment**3 / 6.0
        assert files.rear_axle(found["other"], 1.0 + moment)[0] == pytest.approx(x, abs=CLOSE)


def follow(shape: str, timing: str = "<None/>") -> str:
    """Return a PrivateAction that follows a trajectory."""
    return (
        "<PrivateAction><RoutingAction><FollowTrajectoryAction><TrajectoryRef>"
        f'<Trajectory name="t" closed="false"><Shape>{shape}</Shape></Trajectory></TrajectoryRef>'
        f'<TimeReference>{timing}</TimeReference><TrajectoryFollowingMode followingMode="position"/>'
        "</FollowTrajectoryAction></RoutingAction></PrivateAction>"
    )


def world(x: float, y: float, h: float = 0.0) -> str:
    return f'<Position><WorldPosition x="{x!r}" y="{y!r}" h="{h!r}"/></Position>'


def on_trajectory(shape: str, timing: str, speed: float = 10.0) -> str:
    """Return the scenario of a vehicle that follows a trajectory from the origin on."""
    start = f'<Private entityRef="Ego">{files.teleport(world(0.0, 0.0))}{files.speed(speed)}{follow(shape, timing)}'
    return files.scenario(files.vehicle("Ego"), start + "</Private>", map_file=None)


TIMED = '<Timing domainAbsoluteRelative="relative" scale="1" offset="0"/>'


def test_a_polyline_is_driven_at_an_even_speed_between_its_vertices(tmp_path):
    vertices = "".join(
        f'<Vertex time="{t!r}">{world(x, 0.0)}</Vertex>' for t, x in ((0.0, 0.0), (4.0, 40.0), (8.0, 64.0))
    )
    ego = files.run(tmp_path, on_trajectory(f"<Polyline>{vertices}</Polyline>", TIMED))["Ego"]
    for time in np.r_[np.arange(0.0, 3.7, 0.25), np.arange(4.3, 7.9, 0.25)]:
        x = np.interp(time, (0.0, 4.0, 8.0), (0.0, 40.0, 64.0))
        assert files.rear_axle(ego, time)[0] == pytest.approx(x, abs=CLOSE)
    assert ego.trajectory.twist(2.0).linear[0] == pytest.approx(10.0, abs=0.01)


def test_a_polyline_is_followed_by_its_times(tmp_path):
    points = [(2.0 * k, 12.0 * k, 0.02 * (12.0 * k) ** 1.5) for k in range(6)]
    vertices = "".join(f'<Vertex time="{t!r}">{world(x, y)}</Vertex>' for t, x, y in points)
    ego = files.run(tmp_path, on_trajectory(f"<Polyline>{vertices}</Polyline>", TIMED))["Ego"]
    for time, x, y in points[:5]:
        assert files.rear_axle(ego, time)[:2] == pytest.approx([x, y], abs=CLOSE)


@pytest.mark.parametrize("timing", ["<None/>", TIMED])
def test_a_clothoid_is_fresnel_s_integral(tmp_path, timing):
    clothoid = (
        '<Clothoid curvature="0.0" curvaturePrime="0.0005" length="80" startTime="0" stopTime="8">'
        f"{world(0.0, 0.0)}</Clothoid>"
    )
    ego = files.run(tmp_path, on_trajectory(clothoid, timing))["Ego"]
    scale = math.sqrt(math.pi / 0.0005)
    for time in np.arange(0.0, 7.9, 0.4):
        y, x = fresnel(10.0 * time / scale)
        assert files.rear_axle(ego, time)[:2] == pytest.approx([scale * x, scale * y], abs=CLOSE)


def test_a_rational_spline_is_a_circle(tmp_path):
    radius, weight = 40.0, math.sqrt(0.5)
    corners = [(0.0, 0.0, 1.0), (radius, 0.0, weight), (radius, radius, 1.0)]
    inside = "".join(f'<ControlPoint weight="{w!r}">{world(x, y)}</ControlPoint>' for x, y, w in corners)
    inside += "".join(f'<Knot value="{value}"/>' for value in (0, 0, 0, 1, 1, 1))
    ego = files.run(tmp_path, on_trajectory(f'<Nurbs order="3">{inside}</Nurbs>', "<None/>", 6.0))["Ego"]
    for time in np.arange(0.0, 9.9, 0.3):
        angle = 6.0 * time / radius
        wanted = [radius * math.sin(angle), radius * (1.0 - math.cos(angle))]
        assert files.rear_axle(ego, time)[:2] == pytest.approx(wanted, abs=CLOSE)


def route(*places: str) -> str:
    """Return a PrivateAction that assigns a route."""
    points = "".join(f'<Waypoint routeStrategy="shortest">{place}</Waypoint>' for place in places)
    return (
        f'<PrivateAction><RoutingAction><AssignRouteAction><Route name="r" closed="false">{points}</Route>'
        "</AssignRouteAction></RoutingAction></PrivateAction>"
    )


@pytest.mark.parametrize("goal, end", [("0", [1, 0]), ("1", [0, 1]), ("3", [0, -1])])
@pytest.mark.parametrize("how", ["assign", "acquire"])
def test_a_route_leads_through_a_junction(tmp_path, goal, end, how):
    street, there = maps.crossing(False, False), files.on_lane(30.0, -1, goal)
    chosen = route(files.on_lane(40.0, 1, "2"), there)
    if how == "acquire":
        chosen = (
            "<PrivateAction><RoutingAction><AcquirePositionAction>"
            f"{there}</AcquirePositionAction></RoutingAction></PrivateAction>"
        )
    actions = files.init("Ego", files.on_lane(40.0, 1, "2"), 8.0, chosen)
    ego = files.run(tmp_path, files.scenario(files.vehicle("Ego"), actions, stop=11.0), street)["Ego"]
    twist = ego.trajectory.twist(10.5).linear
    assert twist[:2] / np.linalg.norm(twist) == pytest.approx(end, abs=1e-3)
    if goal == "0":  # straight on: 40 m to the middle's 15 m, then 15 m and on
        assert files.rear_axle(ego, 10.5) == pytest.approx([-55.0 + 84.0, -1.75, 0.0], abs=0.02)
