"""Actions of OpenSCENARIO that are rarer, and what ends or repeats them."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from scipy.special import fresnel

from scarl_sionna.core.errors import ScenarioError
from scarl_sionna.scenario.openscenario.drive import read_drive
from tests import openscenario_files as files

BOTH = files.vehicle("Ego") + files.vehicle("other")


def drive(folder, groups: str, *, ego: float = 20.0, other: str = "", stop: float = 10.0, **more):
    actions = files.init("Ego", files.on_lane(20.0), ego) + (other or files.init("other", files.on_lane(300.0), 0.0))
    return read_drive(files.written(folder, files.scenario(BOTH, actions, groups, stop, **more)))


def at(found, name: str, time: float):
    return min(found.run.tracks[name], key=lambda one: abs(one.time - time))


@pytest.mark.parametrize("times", [(2.0, 3.0, 1.0), None])
def test_a_profile_of_speeds(tmp_path, times):
    speeds = (26.0, 26.0, 20.0)
    entries = "".join(
        f'<SpeedProfileEntry speed="{value!r}"{"" if times is None else f" time={chr(34)}{times[k]!r}{chr(34)}"}/>'
        for k, value in enumerate(speeds)
    )
    action = (
        '<PrivateAction><LongitudinalAction><SpeedProfileAction followingMode="position"><DynamicConstraints '
        f'maxAcceleration="4" maxDeceleration="6"/>{entries}</SpeedProfileAction></LongitudinalAction></PrivateAction>'
    )
    found = drive(tmp_path, files.group("Ego", files.event(action, files.after(1.0))))
    if times is None:  # as fast as the constraints allow
        knots, values = [0.0, 1.0, 2.5, 3.5, 10.0], [20.0, 20.0, 26.0, 20.0, 20.0]
    else:
        knots, values = [0.0, 1.0, 3.0, 6.0, 7.0, 10.0], [20.0, 20.0, 26.0, 26.0, 20.0, 20.0]
    area = np.r_[0.0, np.cumsum(np.diff(knots) * 0.5 * (np.array(values[1:]) + values[:-1]))]
    for time in knots:
        assert at(found, "Ego", time).speed == pytest.approx(np.interp(time, knots, values), abs=0.05)
        assert at(found, "Ego", time).x == pytest.approx(20.0 + np.interp(time, knots, area), abs=0.25)
    assert found.run.tracks["Ego"][-1].x == pytest.approx(20.0 + area[-1] + 20.0, abs=1e-3)


def test_an_offset_relative_to_another_vehicle(tmp_path):
    offset = (
        '<PrivateAction><LateralAction><LaneOffsetAction continuous="false"><LaneOffsetActionDynamics '
        'dynamicsShape="cubic" maxLateralAcc="1"/><LaneOffsetTarget><RelativeTargetLaneOffset entityRef="other" '
        'value="0.4"/></LaneOffsetTarget></LaneOffsetAction></LateralAction></PrivateAction>'
    )
    other = files.init("other", files.on_lane(300.0, offset=-0.6), 10.0)
    found = drive(tmp_path, files.group("Ego", files.event(offset, files.after(1.0))), other=other)
    assert at(found, "Ego", 6.0).y == pytest.approx(-1.75 - 0.6 + 0.4, abs=1e-6)


@pytest.mark.parametrize("side, wanted", [("leftToReferencedEntity", 1.0), ("rightToReferencedEntity", -1.0)])
def test_a_lateral_distance_is_kept(tmp_path, side, wanted):
    keep = (
        f'<PrivateAction><LateralAction><LateralDistanceAction entityRef="other" distance="2.5" freespace="false" '
        f'continuous="true" displacement="{side}"/></LateralAction></PrivateAction>'
    )
    change = files.lane_change('<AbsoluteTargetLane value="-1"/>', "cubic", "time", 4.0)
    groups = files.group("Ego", files.event(keep, files.after(0.0)))
    groups += files.group("other", files.event(change, files.after(6.0)), name="second")
    found = drive(tmp_path, groups, other=files.init("other", files.on_lane(60.0, -2), 20.0), stop=30.0)
    assert at(found, "Ego", 30.0).y - at(found, "other", 30.0).y == pytest.approx(2.5 * wanted, abs=0.02)
    jumps = np.abs(np.diff([one.y for one in found.run.tracks["Ego"]]))
    assert jumps.max() < 0.03


def follow(inside: str, timing: str) -> str:
    return (
        "<PrivateAction><RoutingAction><FollowTrajectoryAction><TrajectoryRef>"
        f'<Trajectory name="t" closed="false"><Shape>{inside}</Shape></Trajectory></TrajectoryRef>'
        f'<TimeReference>{timing}</TimeReference><TrajectoryFollowingMode followingMode="position"/>'
        "</FollowTrajectoryAction></RoutingAction></PrivateAction>"
    )


def test_a_spline_of_clothoids_joins_them(tmp_path):
    start = '<PositionStart><RelativeLanePosition entityRef="Ego" dLane="0" ds="0"/></PositionStart>'
    segment = '<ClothoidSplineSegment curvatureStart="{}" curvatureEnd="{}" length="40">{}</ClothoidSplineSegment>'
    spline = f"<ClothoidSpline>{segment.format(0.0, 0.01, start)}{segment.format(0.01, 0.0, '')}</ClothoidSpline>"
    found = drive(tmp_path, files.group("Ego", files.event(follow(spline, "<None/>"), files.after(1.0))), ego=10.0)
    scale = math.sqrt(math.pi * 40.0 / 0.01)
    y, x = fresnel(40.0 / scale)
    middle, end = at(found, "Ego", 5.0), at(found, "Ego", 8.99)
    assert [middle.x, middle.y] == pytest.approx([30.0 + scale * x, -1.75 + scale * y], abs=0.02)
    assert end.heading == pytest.approx(0.4, abs=2e-3)  # the curvature's integral


@pytest.mark.parametrize("domain, offset", [("absolute", 0.0), ("relative", -2.0)])
def test_the_times_of_a_trajectory_are_moved_and_stretched(tmp_path, domain, offset):
    vertices = "".join(
        f'<Vertex time="{time!r}"><Position><WorldPosition x="{40.0 + 20.0 * k!r}" y="-1.75"/></Position></Vertex>'
        for k, time in enumerate((1.0, 2.0, 3.0))
    )
    timing = f'<Timing domainAbsoluteRelative="{domain}" scale="2" offset="{offset!r}"/>'
    act = files.group("Ego", files.event(follow(f"<Polyline>{vertices}</Polyline>", timing), files.after(2.0)))
    found = drive(tmp_path, act, ego=10.0)
    if domain == "absolute":  # at 40 m at 2 s, at 80 m at 6 s
        assert at(found, "Ego", 4.0).x == pytest.approx(60.0, abs=0.02)
        assert at(found, "Ego", 5.99).x == pytest.approx(79.9, abs=0.02)
    else:  # it waits for nothing: the times begin at 2 s, the first is twice 1 s less 2 s
        assert at(found, "Ego", 4.0).x == pytest.approx(60.0, abs=0.02)
    assert at(found, "Ego", 8.0).y == pytest.approx(-1.75, abs=1e-3)


def test_an_act_stops_what_runs_in_it(tmp_path):
    group = files.group("Ego", files.event(files.speed(30.0, "linear", "time", 10.0), files.after(1.0)))
    text = files.scenario(BOTH, files.init("Ego", files.on_lane(20.0), 20.0), group)
    stopped = text.replace("</Act>", f"<StopTrigger>{files.after(4.0)}</StopTrigger></Act>")
    with pytest.warns(match="never given a place"):
        found = read_drive(files.written(tmp_path, stopped))
    assert found.run.tracks["Ego"][-1].speed == pytest.approx(23.0, abs=1e-3)


def test_who_is_deleted_is_gone(tmp_path):
    gone = '<GlobalAction><EntityAction entityRef="other"><DeleteEntityAction/></EntityAction></GlobalAction>'
    found = drive(tmp_path, files.group("", files.event(gone, files.after(2.5))))
    assert found.run.seen["other"] == [(0.0, pytest.approx(2.5, abs=1e-4))]


def test_a_vehicle_leads_by_a_distance(tmp_path):
    keep = (
        '<PrivateAction><LongitudinalAction><LongitudinalDistanceAction entityRef="other" distance="30" '
        'continuous="false" freespace="false" coordinateSystem="road" displacement="leadingReferencedEntity">'
        '<DynamicConstraints maxAcceleration="4" maxDeceleration="4"/></LongitudinalDistanceAction>'
        "</LongitudinalAction></PrivateAction>"
    )
    other = files.init("other", files.on_lane(40.0, -2), 15.0)
    act = files.group("Ego", files.event(keep, files.after(0.0), "keep"))
    found = drive(tmp_path, act, ego=15.0, other=other, stop=30.0)
    assert at(found, "Ego", 30.0).x - at(found, "other", 30.0).x == pytest.approx(30.0, abs=0.2)


def test_too_many_states_end_the_run(tmp_path, monkeypatch):
    from scarl_sionna.scenario.openscenario.running import simulation

    monkeypatch.setattr(simulation, "MOST_STATES", 500)
    with pytest.warns(match="more than 500 states"):
        assert drive(tmp_path, "").run.stop < 3.0


def test_a_trajectory_gives_the_first_place(tmp_path):
    vertices = "".join(f'<Vertex><Position><WorldPosition x="{x}" y="-1.75"/></Position></Vertex>' for x in (30, 90))
    walk = follow(f"<Polyline>{vertices}</Polyline>", "<None/>")
    walks = f'<Private entityRef="other">{files.speed(5.0)}{walk}</Private>'
    found = drive(tmp_path, "", other=walks)
    assert at(found, "other", 4.0).x == pytest.approx(50.0, abs=1e-3)


def test_a_tight_turn_of_a_fast_vehicle_stays_where_it_is(tmp_path):
    """A vehicle of 25 m/s slows down and turns on a radius of 10 m."""
    turn = '<Clothoid curvature="0.1" curvaturePrime="0" length="24"><Position>{}</Position></Clothoid>'
    turn = turn.format('<RelativeLanePosition entityRef="Ego" dLane="0" ds="0"/>')
    slow = files.event(files.speed(4.0, "linear", "time", 3.0), files.after(0.5), "slow")
    act = files.group("Ego", slow, files.event(follow(turn, "<None/>"), files.after(5.0)))
    actions = files.init("Ego", files.on_lane(20.0), 25.0)
    ego = files.run(tmp_path, files.scenario(files.vehicle("Ego"), actions, act, 8.0))["Ego"]
    assert ego.deviation < 0.05


def test_a_lane_of_no_kind_is_beside_the_road(tmp_path):
    from tests import street_maps as maps

    lanes = maps.section([maps.lane(1)], [maps.lane(-1), maps.lane(-2, kind="none")])
    street = maps.street_map(maps.road(maps.piece("<line/>", 900.0), 900.0, lanes))
    leave = files.lane_change('<AbsoluteTargetLane value="-2"/>', "linear", "time", 3.5)
    brake = files.event(
        files.speed(0.0, "linear", "rate", 4.0), files.of_entity("Ego", '<OffroadCondition duration="1"/>')
    )
    act = files.group("Ego", files.event(leave, files.after(2.0), "leave"), brake)
    text = files.scenario(files.vehicle("Ego"), files.init("Ego", files.on_lane(20.0), 20.0), act)
    track = read_drive(files.written(tmp_path, text, street)).run.tracks["Ego"]
    begins = next(before.time for before, after in pairwise(track) if after.acceleration < -3.9)
    assert begins == pytest.approx(2.0 + 1.75 + 1.0, abs=1e-4)  # its reference point leaves the lane after half the way


def test_beside_one_who_drives_against_the_traffic_others_do(tmp_path):
    around = '<Orientation type="relative" h="3.14159265"/>'
    beside = '<Position><RelativeLanePosition entityRef="Ego" dLane="-1" ds="-30"/></Position>'
    actions = files.init("Ego", files.on_lane(200.0, -1, more=around), 10.0) + files.init("other", beside, 12.0)
    second = beside.replace('dLane="-1"', 'dLane="0"').replace('"-30"', '"-60"')
    actions += files.init("third", second, 8.0)
    everyone = BOTH + files.vehicle("third")
    found = read_drive(files.written(tmp_path, files.scenario(everyone, actions)))
    assert at(found, "third", 5.0).x == pytest.approx(260.0 - 40.0, abs=1e-3)
    assert at(found, "Ego", 5.0).x == pytest.approx(150.0, abs=1e-3)
    assert at(found, "other", 0.0).x == pytest.approx(230.0, abs=1e-3)  # behind, on its right
    assert at(found, "other", 0.0).y == pytest.approx(1.75, abs=1e-3)
    assert at(found, "other", 5.0).x == pytest.approx(170.0, abs=1e-3)


@pytest.mark.parametrize("free, wanted", [("false", 5.0), ("true", 5.0 + 4.5 / 10.0)])
def test_a_lane_is_clear_when_who_is_on_it_is_far_ahead(tmp_path, free, wanted):
    test = (
        '<RelativeClearanceCondition oppositeLanes="false" distanceForward="40" distanceBackward="10" '
        f'freeSpace="{free}"><RelativeLaneRange from="-1" to="-1"/></RelativeClearanceCondition>'
    )
    other = files.init("other", files.on_lane(10.0, -2), 30.0)  # 10 m behind, 10 m/s faster
    act = files.group("Ego", files.event(files.speed(0.0, "linear", "rate", 4.0), files.of_entity("Ego", test)))
    track = drive(tmp_path, act, other=other).run.tracks["Ego"]
    begins = next(before.time for before, after in pairwise(track) if after.acceleration < -3.9)
    assert begins == pytest.approx(wanted, abs=1e-4)


def test_who_follows_a_trajectory_arrives_with_the_other(tmp_path):
    """A vehicle crosses on a polyline and is at its middle, 40 m along, when the other has driven 100 m."""
    corners = ((150, -42), (150, 58))
    vertices = "".join(f'<Vertex><Position><WorldPosition x="{x}" y="{y}"/></Position></Vertex>' for x, y in corners)
    sync = (
        '<PrivateAction><SynchronizeAction masterEntityRef="Ego">'
        '<TargetPositionMaster><LanePosition roadId="1" laneId="-1" s="120"/></TargetPositionMaster>'
        '<TargetPosition><WorldPosition x="150" y="-2"/></TargetPosition>'
        '<FinalSpeed><AbsoluteSpeed value="9"/></FinalSpeed></SynchronizeAction></PrivateAction>'
    )
    cross = follow(f"<Polyline>{vertices}</Polyline>", "<None/>")
    found = drive(tmp_path, "", other=f'<Private entityRef="other">{files.speed(6.0)}{cross}{sync}</Private>')
    assert at(found, "other", 5.0).y == pytest.approx(-2.0, abs=0.05)
    assert at(found, "other", 6.0).speed == pytest.approx(9.0, abs=1e-3)


def test_who_is_no_entity_is_named(tmp_path):
    for wrong in (
        files.init("nobody", files.on_lane(30.0)),
        files.init("Ego", files.on_lane(20.0)) + '<GlobalAction><EntityAction entityRef="nobody"><AddEntityAction>'
        f"{files.on_lane(20.0)}</AddEntityAction></EntityAction></GlobalAction>",
    ):
        with pytest.raises(ScenarioError, match="'nobody' is no entity"):
            read_drive(files.written(tmp_path, files.scenario(BOTH, wrong)))


def test_variables_are_declared_set_and_asked(tmp_path):
    """Declared as 4, +15 at 2 s: the ego vehicle brakes with 4 m/s2 from when it is 19."""
    change = (
        '<GlobalAction><VariableAction variableRef="count"><ModifyAction><Rule><AddValue value="15"/></Rule>'
        "</ModifyAction></VariableAction></GlobalAction>"
    )
    asked = '<VariableCondition variableRef="count" value="19" rule="equalTo"/>'
    brake = files.speed(0.0, "linear", "rate", 4.0)
    groups = files.group("", files.event(change, files.after(2.0), "change"), name="first")
    groups += files.group("Ego", files.event(brake, files.condition(f"<ByValueCondition>{asked}</ByValueCondition>")))
    actions = files.init("Ego", files.on_lane(20.0), 20.0)
    text = files.scenario(files.vehicle("Ego"), actions, groups)
    declared = '<VariableDeclarations><VariableDeclaration name="count" variableType="integer" value="4"/>'
    text = text.replace("<CatalogLocations>", f"{declared}</VariableDeclarations><CatalogLocations>")
    found = read_drive(files.written(tmp_path, text))
    assert at(found, "Ego", 5.0).speed == pytest.approx(20.0 - 4.0 * 3.0, abs=1e-4)


@pytest.mark.parametrize("system, angle", [("world", 0.5), ("road", 0.2), ("lane", 0.2)])
def test_an_angle_is_that_of_its_system(tmp_path, system, angle):
    """On a bend of 60 m, on the lane outside (61.75 m): 0.5 rad in the world where the arc has turned by as much.

    Beside the road it is an angle to it: a lane change of 3.5 m in 4 s has its steepest slope in its middle.
    """
    kind = f'angle="{angle + 0.05}" angleTolerance="0.05" coordinateSystem="{system}"'
    test = f'<AngleCondition angleType="heading" {kind}/>'  # true from the angle on that is 0.05 rad less
    stop = files.of_entity("Ego", test, "none")
    if system == "world":
        text = files.scenario(files.vehicle("Ego"), files.init("Ego", files.on_lane(6.0), 6.175), stop=stop)
        found = read_drive(files.written(tmp_path, text, files.ARC))
        assert found.run.stop == pytest.approx((0.5 - 0.1) * 10.0, abs=1e-4)
        return
    change = files.lane_change('<AbsoluteTargetLane value="-1"/>', "cubic", "time", 4.0)
    group = files.group("Ego", files.event(change, files.after(1.0)))
    text = files.scenario(files.vehicle("Ego"), files.init("Ego", files.on_lane(20.0, -2), 6.0), group, stop)
    slope = 6.0 * math.tan(0.2) * 4.0 / 3.5  # 6 x (1 - x), rising
    wanted = 1.0 + 4.0 * (0.5 - math.sqrt(0.25 - slope / 6.0))
    assert read_drive(files.written(tmp_path, text)).run.stop == pytest.approx(wanted, abs=0.01)


def test_a_place_on_a_trajectory_is_on_its_line(tmp_path):
    line = "".join(f"<Vertex>{files.on_lane(s, lane)}</Vertex>" for s, lane in ((100.0, -1), (112.0, -2), (200.0, -2)))
    line = f'<Trajectory name="t" closed="false"><Shape><Polyline>{line}</Polyline></Shape></Trajectory>'
    inside = f'<TrajectoryPosition s="6.25" t="2"><TrajectoryRef>{line}</TrajectoryRef></TrajectoryPosition>'
    text = files.scenario(files.vehicle("Ego"), files.init("Ego", f"<Position>{inside}</Position>", 0.0))
    found = at(read_drive(files.written(tmp_path, text)), "Ego", 0.0)
    along = np.array([12.0, -3.5]) / 12.5  # half of the first piece, 2 m to its left
    assert (found.x, found.y) == pytest.approx(tuple([106.0, -3.5] + 2.0 * np.array([-along[1], along[0]])), abs=1e-9)
    assert found.heading == pytest.approx(math.atan2(-3.5, 12.0))
    with pytest.raises(ScenarioError, match="s = 300 m is not on the trajectory, which is 100.5 m long"):
        read_drive(files.written(tmp_path, text.replace('s="6.25"', 's="300"')))
