"""The ready scenarios: each can be, and what it is named after happens."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import yaml
from typer.testing import CliRunner

from scarl_sionna.core.errors import UnknownNameError
from scarl_sionna.scenario.compose import compose
from scarl_sionna.scenario.spec.named import scenario_of
from scarl_sionna.scenario.spec.scenario import LIBRARY, ScenarioSpec, scenario_names
from scarl_sionna.scene.motion.trajectory import is_present
from scarl_sionna.simulation import load_world

REPO = Path(__file__).resolve().parents[2]
NAMES = scenario_names()


class Run:
    """Motions of a scenario's actors."""

    def __init__(self, name: str) -> None:
        self.spec = ScenarioSpec.preset(name)
        self.composition = compose(self.spec)
        self.motions = {m.actor.name: m.actor.trajectory for m in self.composition.members}
        self.models = {m.actor.name: m.actor.model for m in self.composition.members}
        self.bodies = {m.actor.name: m.body for m in self.composition.members}
        self.times = np.array(self.spec.times)

    def way(self, name: str) -> np.ndarray:
        return np.array([self.motions[name].pose(t).position for t in self.times])

    def speed(self, name: str) -> np.ndarray:
        return np.array([np.linalg.norm(self.motions[name].twist(t).linear) for t in self.times])

    def in_ego(self, name: str, time: float) -> np.ndarray:
        """Return where an actor is in the ego vehicle's frame [m]: ahead, to the left, up."""
        return self.motions["ego"].pose(time).inverse().apply(self.motions[name].pose(time).position[None])[0]

    @property
    def first(self) -> float:
        return float(self.times[0])

    @property
    def last(self) -> float:
        return float(self.times[-1])


@cache
def run_of(name: str) -> Run:
    return Run(name)


def braking(run: Run) -> None:
    assert run.speed("car_ahead")[0] == pytest.approx(16.0, abs=0.01) and run.speed("car_ahead")[-1] < 1e-6
    assert run.speed("ego")[-1] < 1e-6
    assert np.abs(np.gradient(run.speed("car_ahead"), run.times)).max() > 7.0  # m/s2: an emergency
    room = run.in_ego("car_ahead", run.last)[0] - (run.bodies["ego"].length + run.bodies["car_ahead"].length) / 2.0
    assert room == pytest.approx(10.0, abs=0.5)


def cut_in(run: Run) -> None:
    assert run.in_ego("cutter", 0.0)[0] < -8.0 and run.in_ego("cutter", 0.0)[1] > 3.0  # from behind, in the other lane
    ahead, side, _ = run.in_ego("cutter", run.last)
    pose = run.motions["ego"].pose(run.last)
    assert 8.0 < ahead < 40.0
    lane = run.composition.scene.lanes["right"]
    for name in ("ego", "cutter"):
        assert lane.nearest(run.motions[name].pose(run.last).position)[1] < 0.2, (name, pose, side)


def oncoming(run: Run) -> None:
    assert run.in_ego("lorry", 0.0)[0] > 80.0 and run.in_ego("lorry", run.last)[0] < 0.0
    hidden, lorry = run.in_ego("hidden", 1.0), run.in_ego("lorry", 1.0)
    assert hidden[0] > lorry[0] > 0.0  # behind the lorry


def beside_the_rail(run: Run) -> None:
    assert all(np.hypot(*run.in_ego("van", t)[:2]) == pytest.approx(24.0, abs=0.2) for t in run.times)  # steady
    lane = run.composition.scene.lanes["right"]
    ways = [lane.nearest(run.motions["van"].pose(t).position)[0] - 115.0 for t in run.times]
    assert min(ways) > 6.2 and max(ways) < 84.5  # along the guardrail (scenes_xml/highway_guardrail/layout.py)


def steps_out(name: str) -> Callable[[Run], None]:
    def check(run: Run) -> None:
        y = run.way(name)[:, 1]
        assert y[0] < -3.9 < -1.0 < y[-1]  # from the pavement into the ego vehicle's lane
        assert run.speed("ego")[0] > 8.0 and run.speed("ego")[-1] < 1e-6
        ahead = run.in_ego(name, run.last)[0] - run.bodies["ego"].length / 2.0
        assert 0.5 < ahead < 12.0  # it stops in front

    return check


def overtakes(run: Run) -> None:
    assert run.in_ego("cyclist", 0.0)[0] > 10.0 and run.in_ego("cyclist", run.last)[0] < -10.0
    beside = min(run.times, key=lambda t: abs(run.in_ego("cyclist", t)[0]))
    room = -run.in_ego("cyclist", beside)[1] - run.bodies["ego"].width / 2.0 - run.bodies["cyclist"].width / 2.0
    assert room > 1.2
    assert abs(run.way("ego")[-1, 1]) < 0.1  # back in its lane
    assert run.in_ego("oncoming", run.last)[0] > 5.0


def queue(run: Run) -> None:
    assert run.speed("ego")[0] > 10.0 and run.speed("ego")[-1] < 1e-6
    assert 5.0 < run.in_ego("third", run.last)[0] < 9.0
    assert run.in_ego("cyclist", 0.0)[0] < -4.0 and run.in_ego("cyclist", run.last)[0] > 5.0
    assert all(run.speed(name).max() < 1e-9 for name in ("first", "second", "third"))


def rainy_night(run: Run) -> None:
    assert run.spec.weather.rain_rate == 50.0 and run.spec.weather.spray is not None
    assert run.spec.lighting.sun_elevation_deg < -18.0
    assert (
        run.speed("ego")[-1] < 1e-6 and run.way("ego")[-1, 0] + run.bodies["ego"].length / 2.0 < 20.0
    )  # before the zebra
    for name in ("woman", "man"):
        y = run.way(name)[:, 1]
        assert y.min() < 0.0 < y.max()


def gives_way(run: Run) -> None:
    speed = run.speed("ego")
    waiting = np.flatnonzero(speed < 0.01)
    assert len(waiting) > 5 and speed[-1] > 3.0
    ring = [np.hypot(*run.way(name)[waiting[0] : waiting[-1], :2].T) for name in ("in_the_ring", "cyclist")]
    assert all(radii.min() < 18.0 for radii in ring)  # they are in the ring while it waits
    lanes = run.composition.scene.lanes
    assert lanes["west_in"].nearest(run.way("ego")[waiting[0]])[0] < lanes["west_in"].length


def traffic(run: Run) -> None:
    vehicles = [name for name in run.motions if name.startswith("traffic_")]
    assert len(vehicles) > 8
    assert "walk" in {run.models[name].motion for name in vehicles}


def tunnel(run: Run) -> None:
    assert all(15.0 < run.in_ego("lorry", t)[0] < 45.0 for t in run.times)
    assert run.in_ego("oncoming", 0.0)[0] > 50.0 > 0.0 > run.in_ego("oncoming", run.last)[0]
    assert run.speed("ego")[-1] == pytest.approx(11.5, abs=0.01)


def car_park(run: Run) -> None:
    assert run.speed("ego").max() < 3.0 and run.speed("ego")[-1] < 1e-6
    pose, twist = run.motions["backing"].pose(5.0), run.motions["backing"].twist(5.0)
    assert pose.inverse().rotate(twist.linear[None])[0, 0] < -0.3  # backwards
    assert sum(name.startswith("traffic_parked") for name in run.motions) > 20


def left_turn(run: Run) -> None:
    speed = run.speed("ego")
    waits = np.flatnonzero(speed < 0.01)
    assert len(waits) > 5
    assert run.in_ego("van", run.times[waits[-1]])[0] < 0.0 and run.in_ego("motorcycle", run.times[waits[-1]])[0] < 0.0
    assert run.way("ego")[-1, 1] > run.way("ego")[0, 1] + 1.5  # turning left
    turned = run.motions["ego"].pose(run.last).yaw - run.motions["ego"].pose(run.first).yaw
    assert np.degrees(turned) == pytest.approx(90.0, abs=3.0)
    assert run.way("man")[0, 0] < -3.0 and run.speed("man")[-1] > 0.9
    beyond = run.way("ego")[:, 1] > 9.0
    assert run.way("man")[beyond, 0].min() > 5.0  # on the pavement when the ego vehicle comes


def red_light(run: Run) -> None:
    assert run.composition.scene.lanes.signals.is_green("main", run.first)
    assert not run.composition.scene.lanes.signals.is_green("main", run.last)
    assert run.speed("ego")[0] > 8.0 and run.speed("ego")[-1] < 1e-6
    traffic(run)


def pulls_out(run: Run) -> None:
    lanes = run.composition.scene.lanes
    start, stop = (run.motions["lorry"].pose(t).position for t in (0.0, run.last))
    assert lanes["east_0"].nearest(start)[1] < 0.1 and lanes["east_1"].nearest(stop)[1] < 0.2
    assert run.speed("ego")[0] == pytest.approx(32.0, abs=0.05) and run.speed("ego")[-1] == pytest.approx(
        23.0, abs=0.05
    )
    assert 8.0 < run.in_ego("lorry", run.last)[0] < 50.0


def between_lanes(run: Run) -> None:
    assert run.in_ego("motorcycle", 0.0)[0] < -10.0 and run.in_ego("motorcycle", run.last)[0] > 10.0
    assert all(1.5 < run.in_ego("motorcycle", t)[1] < 2.3 for t in run.times)


def backs_out(run: Run) -> None:
    y = run.way("backing")[:, 1]
    assert y[0] > 9.0 and y[-1] - run.bodies["backing"].length / 2.0 < 2.4  # onto the other lane, 1.4 m from the middle
    assert run.speed("ego")[-1] == pytest.approx(3.0, abs=0.05)
    assert 0.0 < run.spec.lighting.sun_elevation_deg < 35.0


def overtaken(run: Run) -> None:
    lanes = run.composition.scene.lanes
    start, stop = (run.motions["overtaker"].pose(t).position for t in (0.0, run.last))
    assert (
        lanes["east"].nearest(start)[1] < 0.3 and lanes["west"].nearest(stop)[1] < 0.3
    )  # from the ego vehicle's lane back to its own
    assert run.in_ego("overtaker", 2.8)[0] > 15.0  # in time
    assert run.speed("ego")[-1] == pytest.approx(10.0, abs=0.05)


EVENTS: dict[str, Callable[[Run], None]] = {
    "backing_out_of_a_drive": backs_out,
    "car_park_search": car_park,
    "child_between_parked_cars": steps_out("child"),
    "crossing_at_night_in_rain": rainy_night,
    "cut_in": cut_in,
    "cyclist_passing_a_queue": queue,
    "emergency_braking": braking,
    "left_turn_across_traffic": left_turn,
    "lorry_in_a_tunnel": tunnel,
    "lorry_pulls_out": pulls_out,
    "motorcycle_between_lanes": between_lanes,
    "oncoming_lorry": oncoming,
    "oncoming_overtaker": overtaken,
    "overtaking_a_cyclist": overtakes,
    "pedestrian_behind_parked_car": steps_out("man"),
    "roundabout_entry": gives_way,
    "stop_at_the_lights": red_light,
    "town_traffic": traffic,
    "van_along_a_guardrail": beside_the_rail,
}


def test_there_are_enough_and_all_have_a_test() -> None:
    assert len(NAMES) >= 12 and set(NAMES) == set(EVENTS)
    assert len({ScenarioSpec.preset(name).scene for name in NAMES}) >= 8


@pytest.mark.some(6)
@pytest.mark.parametrize("name", NAMES)
def test_what_it_is_named_after_happens(name) -> None:
    run = run_of(name)  # no collision, no motion that ends early: these are errors
    assert run.spec.name == name and run.spec.collisions == "error"
    EVENTS[name](run)


@pytest.mark.some(6)
@pytest.mark.parametrize("name", NAMES)
def test_nobody_appears_or_vanishes_in_view(name) -> None:
    run = run_of(name)
    for when in np.arange(run.first, run.last, 0.25).tolist():
        ego = run.motions["ego"].pose(when).position
        for other, motion in run.motions.items():
            if is_present(motion, when) != is_present(motion, when + 0.25 if when + 0.25 < run.last else run.last):
                assert np.linalg.norm(motion.motion.pose(when).position - ego) > 300.0, (other, when)


@pytest.mark.parametrize("name", NAMES)
def test_its_file_says_what_to_look_at_and_says_the_same_when_saved(name, tmp_path) -> None:
    text = (LIBRARY / f"{name}.yaml").read_text(encoding="utf-8")
    assert text.startswith("# ") and "# Look at: " in text
    spec = ScenarioSpec.preset(name)
    spec.save(tmp_path / "again.yaml")
    assert ScenarioSpec.load(tmp_path / "again.yaml") == spec


def test_the_examples_are_those_of_the_package() -> None:
    assert (REPO / "examples" / "scenarios").resolve() == LIBRARY.resolve()


def test_they_are_found_by_name() -> None:
    assert scenario_of("cut_in") == ScenarioSpec.preset("cut_in")
    assert scenario_of("cut_in").with_(num_frames=3).num_frames == 3
    assert scenario_of("urban_crossing") == ScenarioSpec(scene="urban_crossing")
    with pytest.raises(UnknownNameError, match="did you mean 'cut_in'"):
        ScenarioSpec.preset("cutin")


def test_the_demo_takes_one_by_name(tmp_path) -> None:
    from scarl_sionna.cli import app

    result = CliRunner().invoke(app, ["demo", "--scenario", "cutin", "--out", str(tmp_path / "out")])
    assert result.exit_code == 2 and "did you mean 'cut_in'" in result.stderr


@pytest.mark.some(6)
@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_its_world_loads_and_all_stand_on_the_ground(name) -> None:
    world = load_world(ScenarioSpec.preset(name))
    spec = ScenarioSpec.preset(name)
    assert world.ego == "ego" and world.time_range[0] <= spec.times[0] and spec.times[-1] <= world.time_range[1]
    last = spec.times[-1]
    there = {actor.name for actor in world.actors if is_present(actor.trajectory, last)}
    assert "ego" in there and {box.name for box in world.at(last).boxes() if box.is_actor} == there


def test_the_files_in_the_documentation_can_be(tmp_path) -> None:
    page = (REPO / "docs" / "scenarios.md").read_text(encoding="utf-8")
    blocks = re.findall(r"```yaml\n(.*?)```", page, flags=re.DOTALL)
    assert len(blocks) == 4  # the whole format, actors by a mesh and by a body, and changes
    specs = []
    for number, block in enumerate(blocks):
        (tmp_path / f"{number}.yaml").write_text(block, encoding="utf-8")
        specs.append(ScenarioSpec.load(tmp_path / f"{number}.yaml"))
    given = yaml.safe_load(blocks[0])
    assert set(given) == set(ScenarioSpec.model_fields) - {"num_frames"}  # all keys of the format
    assert {"ego", "cyclist", "man", "parked"} <= {member.actor.name for member in compose(specs[0]).members}
    assert all(f"| `{name}` |" in page for name in NAMES)
