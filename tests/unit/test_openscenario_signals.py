"""Traffic signals, the time of day, and entities that jump or come and go, in files that scenariogeneration writes."""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from scarl_sionna.core.errors import ScenarioError, UnsupportedElementError
from scarl_sionna.scenario.openscenario.actors import entity_tracks, read_openscenario
from scarl_sionna.scenario.openscenario.drive import Drive, read_drive
from tests import openscenario_files as files

xosc = pytest.importorskip("scenariogeneration").xosc
STEP = xosc.TransitionDynamics(xosc.DynamicsShapes.step, xosc.DynamicsDimension.time, 0)
BRAKE = xosc.AbsoluteSpeedAction(
    0.0, xosc.TransitionDynamics(xosc.DynamicsShapes.linear, xosc.DynamicsDimension.rate, 4.0)
)


def value(condition: Any, edge: Any = xosc.ConditionEdge.none) -> Any:
    return xosc.ValueTrigger("when", 0, edge, condition)


def after(seconds: float, point: str = "start") -> Any:
    condition = xosc.SimulationTimeCondition(seconds, xosc.Rule.greaterThan)
    return xosc.ValueTrigger("after", 0, xosc.ConditionEdge.none, condition, point)


def written(folder: Path, events: list[tuple[str, Any, Any]], network: Any = None, first: tuple[Any, ...] = ()) -> Path:
    """Write a drive of 20 s: Ego at 20 m/s from 20 m on, `other` at 10 m/s from 300 m on; actor, action, trigger."""
    box = xosc.BoundingBox(1.8, 4.5, 1.5, 1.4, 0, 0.75)
    axles = (xosc.Axle(0.5, 0.8, 1.6, 2.7, 0.4), xosc.Axle(0.0, 0.8, 1.6, 0.0, 0.4))
    entities, init = xosc.Entities(), xosc.Init()
    for name, s, speed in (("Ego", 20.0, 20.0), ("other", 300.0, 10.0)):
        entities.add_scenario_object(name, xosc.Vehicle(name, xosc.VehicleCategory.car, box, *axles, 60, 8, 10))
        init.add_init_action(name, xosc.TeleportAction(xosc.LanePosition(s, 0, -1, "1")))
        init.add_init_action(name, xosc.AbsoluteSpeedAction(speed, STEP))
    for action in first:
        init.add_global_action(action)
    act = xosc.Act("act", after(0))
    for number, (actor, action, trigger) in enumerate(events):
        event = xosc.Event(f"event_{number}", xosc.Priority.parallel)
        event.add_trigger(trigger)
        event.add_action(f"action_{number}", action)
        maneuver = xosc.Maneuver(f"maneuver_{number}")
        maneuver.add_event(event)
        group = xosc.ManeuverGroup(f"group_{number}")
        if actor:
            group.add_actor(actor)
        group.add_maneuver(maneuver)
        act.add_maneuver_group(group)
    board = xosc.StoryBoard(init, after(20, "stop"))
    board.add_act(act)
    network = network or xosc.RoadNetwork("road.xodr")
    whole = xosc.Scenario("a", "tests", xosc.ParameterDeclarations(), entities, board, network, xosc.Catalog())
    (folder / "road.xodr").write_text(files.STRAIGHT)
    whole.write_xml(str(folder / "drive.xosc"))
    return folder / "drive.xosc"


def lights() -> Any:
    """Two controllers of 10 s: `second` is 3 s behind `first`, of which it knows."""
    network = xosc.RoadNetwork("road.xodr")
    for name, delay, reference in (("first", None, None), ("second", 3, "first")):
        controller = xosc.TrafficSignalController(name, delay, reference)
        for phase, duration, state in (("go", 6, "green"), ("stop", 4, "red")):
            one = xosc.Phase(phase, duration)
            one.add_signal_state(f"signal_{name}", state)
            controller.add_phase(one)
        network.add_traffic_signal_controller(controller)
    return network


def brakes(drive: Drive) -> float:
    """Return when Ego begins to brake with 4 m/s2 [s]."""
    for before, now in pairwise(drive.run.tracks["Ego"]):
        if now.acceleration < -3.9:
            return before.time
    return math.inf


@pytest.mark.filterwarnings("ignore:.*decides conditions alone")
@pytest.mark.parametrize(
    ("trigger", "wanted"),
    [
        (lambda: value(xosc.TrafficSignalControllerCondition("first", "stop")), 6.0),
        (lambda: value(xosc.TrafficSignalControllerCondition("second", "stop"), xosc.ConditionEdge.rising), 9.0),
        (lambda: value(xosc.TrafficSignalCondition("signal_first", "red")), 6.0),
        (lambda: value(xosc.TrafficSignalCondition("signal_second", "green")), 3.0),
        (lambda: value(xosc.TrafficSignalCondition("signal_first", "off")), math.inf),
    ],
)
def test_a_trigger_knows_what_signals_show(tmp_path, trigger, wanted) -> None:
    drive = read_drive(written(tmp_path, [("Ego", BRAKE, trigger())], lights()))
    assert brakes(drive) == pytest.approx(wanted, abs=1e-5)


@pytest.mark.filterwarnings("ignore:.*decides conditions alone")
def test_actions_change_signals_and_phases(tmp_path) -> None:
    """A state that is set holds until the next phase; a phase that is set begins then, and the others follow."""
    red = value(xosc.TrafficSignalCondition("signal_first", "red"))
    state = ("", xosc.TrafficSignalStateAction("signal_first", "red"), after(2.5))
    assert brakes(read_drive(written(tmp_path, [("Ego", BRAKE, red), state], lights()))) == pytest.approx(2.5, abs=1e-5)
    phase = ("", xosc.TrafficSignalControllerAction("go", "first"), after(5.0))
    assert brakes(read_drive(written(tmp_path, [("Ego", BRAKE, red), phase], lights()))) == pytest.approx(
        11.0, abs=1e-5
    )
    green = value(xosc.TrafficSignalCondition("signal_first", "green"), xosc.ConditionEdge.rising)
    back = read_drive(written(tmp_path, [("Ego", BRAKE, green), state], lights()))
    assert brakes(back) == pytest.approx(10.0, abs=1e-5)  # red by the action, red by the phase of 6 s, then green
    alone = ("", xosc.TrafficSignalStateAction("unknown_to_all", "red"), after(4.0))
    own = value(xosc.TrafficSignalCondition("unknown_to_all", "red"))
    assert brakes(read_drive(written(tmp_path, [("Ego", BRAKE, own), alone]))) == pytest.approx(4.0, abs=1e-5)


def test_what_no_controller_has_is_named(tmp_path) -> None:
    trigger = value(xosc.TrafficSignalControllerCondition("third", "stop"))
    with pytest.raises(ScenarioError, match="no controller 'third' of traffic signals") as told:
        read_drive(written(tmp_path, [("Ego", BRAKE, trigger)]))
    assert told.value.line
    action = ("", xosc.TrafficSignalControllerAction("slow", "first"), after(1.0))
    with pytest.raises(ScenarioError, match="has no phase 'slow'"):
        read_drive(written(tmp_path, [action], lights()))


def test_it_says_that_a_light_is_not_on_the_map(tmp_path) -> None:
    with pytest.warns(match="the map has no light 'signal_first': it decides conditions alone"):
        read_drive(written(tmp_path, [("Ego", BRAKE, after(1.0))], lights()))


@pytest.mark.parametrize(("goes_on", "wanted"), [(True, 7.0), (False, math.inf)])
def test_the_time_of_day_triggers(tmp_path, goes_on: bool, wanted: float) -> None:
    noon = xosc.EnvironmentAction(xosc.Environment("e", xosc.TimeOfDay(goes_on, 2024, 6, 21, 11, 59, 53)))
    trigger = value(xosc.TimeOfDayCondition(xosc.Rule.greaterThan, 2024, 6, 21, 12, 0, 0))
    assert brakes(read_drive(written(tmp_path, [("Ego", BRAKE, trigger)], first=(noon,)))) == pytest.approx(
        wanted, abs=1e-5
    )
    with pytest.raises(ScenarioError, match="state a <TimeOfDay> in <Init>"):
        read_drive(written(tmp_path, [("Ego", BRAKE, trigger)]))


def test_who_is_carried_elsewhere_is_an_actor_there(tmp_path) -> None:
    """Each way is smooth by itself, and exactly one of both is in the scene at a time."""
    away = ("other", xosc.TeleportAction(xosc.LanePosition(500.0, 0, -2, "1")), after(4.0))
    path = written(tmp_path, [away])
    found = {actor.name: actor for actor in read_openscenario(path)}
    assert sorted(found) == ["Ego", "other", "other_2"]
    first, second = found["other"], found["other_2"]
    assert first.active[1] == pytest.approx(4.0, abs=1e-5) == second.active[0]
    for time in (0.5, 3.9):
        assert files.rear_axle(first, time)[:2] == pytest.approx([300.0 + 10.0 * time, -1.75], abs=0.02)
    for time in (4.0, 9.0):
        place = files.rear_axle(second, time)
        assert place[:2] == pytest.approx([500.0 + 10.0 * (time - 4.0), -5.25], abs=0.02)
        assert second.trajectory.twist(time).linear[:2] == pytest.approx([10.0, 0.0], abs=0.05)
    assert set(entity_tracks(path, None)) == {"Ego", "ego"}  # of two ways none is that of the entity


def test_the_ego_vehicle_does_not_jump(tmp_path) -> None:
    away = ("Ego", xosc.TeleportAction(xosc.LanePosition(500.0, 0, -2, "1")), after(4.0))
    with pytest.raises(UnsupportedElementError, match="carries 'Ego' .* the ego vehicle does not jump") as told:
        read_openscenario(written(tmp_path, [away]))
    assert told.value.line and "carries the sensors" in str(told.value)


def test_who_comes_and_goes_is_an_actor_each_time(tmp_path) -> None:
    hide, show = (xosc.VisibilityAction(seen, seen, seen) for seen in (False, True))
    events = [("other", hide, after(2.0)), ("other", show, after(5.0)), ("other", hide, after(8.0))]
    found = {actor.name: actor for actor in read_openscenario(written(tmp_path, events))}
    assert sorted(found) == ["Ego", "other", "other_2"]
    assert found["other"].active == pytest.approx((-np.inf, 2.0), abs=1e-5)
    assert found["other_2"].active == pytest.approx((5.0, 8.0), abs=1e-5)
    assert files.rear_axle(found["other_2"], 6.0)[0] == pytest.approx(360.0, abs=0.02)
