"""Triggers of OpenSCENARIO: when each fires, by closed forms, seen in when a vehicle begins to brake."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from scarl_sionna.scenario.openscenario.drive import read_drive
from tests import openscenario_files as files

BRAKE = files.speed(0.0, "linear", "rate", 4.0)


def begins(drive, name: str = "Ego") -> float:
    """Return when an entity begins to brake with 4 m/s2 [s]."""
    track = drive.run.tracks[name]
    for before, after in pairwise(track):
        if after.acceleration < -3.9:
            return before.time
    return math.inf


def started(
    folder, trigger: str, *, other: str = "", ego: float = 20.0, start: float = 20.0, stop: float = 12.0, **more
):
    actions = files.init("Ego", files.on_lane(start), ego) + other
    both = files.vehicle("Ego") + (files.vehicle("other") if other else "")
    text = files.scenario(both, actions, files.group("Ego", files.event(BRAKE, trigger)), stop, **more)
    return begins(read_drive(files.written(folder, text)))


AHEAD = files.init("other", files.on_lane(150.0), 5.0)


@pytest.mark.parametrize(
    "test, wanted",
    [
        # 130 m ahead, 15 m/s closing: time to collision 8.667 s less the time
        ('<TimeToCollisionCondition value="3" rule="lessThan" freespace="false" coordinateSystem="road" '
         'relativeDistanceType="longitudinal"><TimeToCollisionConditionTarget><EntityRef entityRef="other"/>'
         "</TimeToCollisionConditionTarget></TimeToCollisionCondition>", 130.0 / 15.0 - 3.0),
        ('<TimeToCollisionCondition value="3" rule="lessThan" freespace="true" alongRoute="true">'
         '<TimeToCollisionConditionTarget><EntityRef entityRef="other"/></TimeToCollisionConditionTarget>'
         "</TimeToCollisionCondition>", (130.0 - 4.5) / 15.0 - 3.0),
        ('<TimeToCollisionCondition value="4" rule="lessThan" freespace="false" relativeDistanceType="longitudinal">'
         '<TimeToCollisionConditionTarget><Position><LanePosition roadId="1" laneId="-1" s="200"/></Position>'
         "</TimeToCollisionConditionTarget></TimeToCollisionCondition>", 180.0 / 20.0 - 4.0),
        ('<TimeHeadwayCondition entityRef="other" value="2" rule="lessThan" freespace="false" alongRoute="true"/>',
         (130.0 - 2.0 * 20.0) / 15.0),
        ('<TimeHeadwayCondition entityRef="other" value="2" rule="lessThan" freespace="true" coordinateSystem="entity" '
         'relativeDistanceType="longitudinal"/>', (130.0 - 4.5 - 2.0 * 20.0) / 15.0),
        ('<RelativeDistanceCondition entityRef="other" value="60" rule="lessThan" freespace="false" '
         'relativeDistanceType="cartesianDistance"/>', 70.0 / 15.0),
        ('<RelativeDistanceCondition entityRef="other" value="60" rule="lessOrEqual" freespace="true" '
         'relativeDistanceType="longitudinal" coordinateSystem="lane"/>', (70.0 - 4.5) / 15.0),
        ('<DistanceCondition value="60" rule="lessThan" freespace="false" coordinateSystem="road" '
         'relativeDistanceType="longitudinal"><Position><LanePosition roadId="1" laneId="-2" s="150"/></Position>'
         "</DistanceCondition>", 70.0 / 20.0),
        ('<ReachPositionCondition tolerance="2"><Position><LanePosition roadId="1" laneId="-1" s="130"/></Position>'
         "</ReachPositionCondition>", 108.0 / 20.0),
        ('<TraveledDistanceCondition value="75"/>', 75.0 / 20.0),
        ('<RelativeSpeedCondition entityRef="other" value="14" rule="lessThan"/>', math.inf),
    ],
)  # fmt: skip # a table
def test_a_condition_fires_at_its_closed_form(tmp_path, test, wanted):
    assert started(tmp_path, files.of_entity("Ego", test), other=AHEAD) == pytest.approx(wanted, abs=1e-5)


@pytest.mark.parametrize("delay", [0.0, 0.734])
@pytest.mark.parametrize("edge", ["rising", "none"])
def test_a_delay_is_kept(tmp_path, edge, delay):
    test = '<ReachPositionCondition tolerance="2"><Position><LanePosition roadId="1" laneId="-1" s="130"/></Position>'
    fired = started(tmp_path, files.of_entity("Ego", test + "</ReachPositionCondition>", edge, delay))
    assert fired == pytest.approx(108.0 / 20.0 + delay, abs=1e-5)


def test_speeds_accelerations_and_standing(tmp_path):
    other = files.init("other", files.on_lane(300.0), 10.0)
    slow = files.group("other", files.event(files.speed(0.0, "linear", "time", 4.0), files.after(1.0)), name="slow")
    both, ego = files.vehicle("Ego") + files.vehicle("other"), files.init("Ego", files.on_lane(20.0), 20.0)
    for test, wanted in (
        ('<SpeedCondition value="5" rule="lessThan"/>', 3.0),
        ('<SpeedCondition value="2.5" rule="equalTo"/>', 4.0),
        ('<StandStillCondition duration="1.5"/>', 6.5),
        ('<AccelerationCondition value="-1" rule="lessThan"/>', 1.0),
        ('<RelativeSpeedCondition entityRef="Ego" value="-15" rule="lessThan"/>', 3.0),
    ):
        act = files.group("Ego", files.event(BRAKE, files.of_entity("other", test))) + slow
        fired = begins(read_drive(files.written(tmp_path, files.scenario(both, other + ego, act, 9.0))))
        assert fired == pytest.approx(wanted, abs=0.011), test


def test_a_collision_fires_where_boxes_touch(tmp_path):
    test = '<CollisionCondition><EntityRef entityRef="other"/></CollisionCondition>'
    fired = started(tmp_path, files.of_entity("Ego", test), other=AHEAD)
    assert fired == pytest.approx((130.0 - 4.5) / 15.0, abs=1e-5)


def test_the_end_of_the_road_ends_the_run(tmp_path):
    actions = files.init("Ego", files.on_lane(files.LENGTH - 50.0), 20.0)
    with pytest.warns(match="comes to the end of the roads"):
        drive = read_drive(files.written(tmp_path, files.scenario(files.vehicle("Ego"), actions)))
    assert drive.run.stop == pytest.approx(2.5, abs=0.011)


def test_events_stop_each_other_by_priority(tmp_path):
    first = files.event(files.speed(30.0, "linear", "time", 5.0), files.after(1.0), "first")
    for priority, wanted in (("override", 0.0), ("overwrite", 0.0), ("skip", 30.0)):
        second = files.event(
            files.speed(0.0, "linear", "time", 2.0),
            files.of_entity("Ego", '<TraveledDistanceCondition value="50"/>'),
            "second",
            priority,
        )
        actions = files.init("Ego", files.on_lane(20.0), 20.0)
        text = files.scenario(files.vehicle("Ego"), actions, files.group("Ego", first, second))
        drive = read_drive(files.written(tmp_path, text))
        assert drive.run.tracks["Ego"][-1].speed == pytest.approx(wanted, abs=1e-6)


def element(kind: str, name: str, state: str) -> str:
    return (
        f'<ByValueCondition><StoryboardElementStateCondition storyboardElementType="{kind}" '
        f'storyboardElementRef="{name}" state="{state}"/></ByValueCondition>'
    )


@pytest.mark.parametrize(
    "kind, name, state, wanted",
    [
        ("event", "first", "startTransition", 1.0),
        ("event", "first", "endTransition", 3.0),
        ("action", "first_action", "endTransition", 3.0),
        ("event", "first", "completeState", 3.0),
        ("event", "first", "runningState", 1.0),
        ("maneuver", "one_maneuver", "endTransition", 3.0),
        ("maneuverGroup", "one", "completeState", 3.0),
    ],
)
def test_the_storyboard_s_own_states_fire(tmp_path, kind, name, state, wanted):
    one = files.group(
        "other", files.event(files.speed(9.0, "linear", "time", 2.0), files.after(1.0), "first"), name="one"
    )
    two = files.group(
        "Ego", files.event(BRAKE, files.condition(element(kind, name, state), "none"), "second"), name="two"
    )
    actions = files.init("Ego", files.on_lane(20.0), 20.0) + files.init("other", files.on_lane(300.0), 10.0)
    text = files.scenario(files.vehicle("Ego") + files.vehicle("other"), actions, one + two)
    assert begins(read_drive(files.written(tmp_path, text))) == pytest.approx(wanted, abs=1e-4)


def test_an_event_runs_as_often_as_it_says(tmp_path):
    """A vehicle starts when the other comes near, stops when it is far, time and again."""
    near = (
        '<RelativeDistanceCondition entityRef="Ego" value="30" rule="{}" freespace="false" '
        'relativeDistanceType="longitudinal"/>'
    )
    go = files.event(
        files.speed(20.0, "linear", "rate", 5.0),
        files.of_entity("Ego", near.format("lessThan").replace('entityRef="Ego"', 'entityRef="other"')),
        "go",
        "override",
        50,
    )
    stop = files.event(
        files.speed(0.0, "linear", "rate", 5.0),
        files.of_entity("other", near.format("greaterThan")),
        "stop",
        "override",
        50,
    )
    actions = files.init("Ego", files.on_lane(20.0), 10.0) + files.init("other", files.on_lane(100.0))
    text = files.scenario(files.vehicle("Ego") + files.vehicle("other"), actions, files.group("other", go, stop), 40.0)
    track = read_drive(files.written(tmp_path, text)).run.tracks["other"]
    speeds = np.array([one.speed for one in track])
    assert (np.diff(np.sign(np.diff(speeds[np.r_[True, np.diff(speeds) != 0.0]]))) != 0).sum() >= 6
    assert track[-1].x > 300.0


def test_parameters_are_set_and_asked(tmp_path):
    change = '<GlobalAction><ParameterAction parameterRef="go">{}</ParameterAction></GlobalAction>'
    test = '<ByValueCondition><ParameterCondition parameterRef="go" value="{}" rule="equalTo"/></ByValueCondition>'
    modify = '<ModifyAction><Rule><AddValue value="3"/></Rule></ModifyAction>'
    for inside, value in (('<SetAction value="5"/>', "5"), (modify, "4")):
        act = files.group("", files.event(change.format(inside), files.after(2.0), "set"), name="first")
        act += files.group("Ego", files.event(BRAKE, files.condition(test.format(value)), "brake"))
        text = files.scenario(
            files.vehicle("Ego"),
            files.init("Ego", files.on_lane(20.0), 20.0),
            act,
            parameters='<ParameterDeclaration name="go" parameterType="integer" value="1"/>',
        )
        assert begins(read_drive(files.written(tmp_path, text))) == pytest.approx(2.0, abs=0.011)
