"""Traffic lights of the picture show what the storyboard's signals show, each at its own time."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.engine import variant
from scarl_sionna.engine.light.lamps import lenses
from scarl_sionna.scenario.compose import build_world
from scarl_sionna.scenario.openscenario.drive import read_drive
from scarl_sionna.scenario.openscenario.lights import colors_of
from scarl_sionna.scene.lanes import Signals
from tests import openscenario_files as files
from tests import street_maps as maps

pytestmark = pytest.mark.own_process(shared=True)


def controller() -> str:
    """Light s0: green for 4 s, amber for 1 s, red for 3 s; s1: what two or three lamps do, in the same phases."""
    phases = (
        ("go", 4.0, "green", "off;off;on"),
        ("clear", 1.0, "yellow", "off;on;off"),
        ("stop", 3.0, "red", "on;off"),
    )
    inside = "".join(
        f'<Phase name="{name}" duration="{time!r}"><TrafficSignalState trafficSignalId="s0" state="{first}"/>'
        f'<TrafficSignalState trafficSignalId="s1" state="{second}"/></Phase>'
        for name, time, first, second in phases
    )
    return f'<TrafficSignals><TrafficSignalController name="plan">{inside}</TrafficSignalController></TrafficSignals>'


def drive(folder, groups: str = ""):
    actions = files.init("Ego", files.on_lane(20.0, 1, "0"), 2.0)
    text = files.scenario(files.vehicle("Ego"), actions, groups, 12.0)
    text = text.replace("</RoadNetwork>", f"{controller()}</RoadNetwork>")
    return files.written(folder, text, maps.MAPS["crossing"])


def set_state(name: str, state: str) -> str:
    return (
        "<GlobalAction><InfrastructureAction><TrafficSignalAction>"
        f'<TrafficSignalStateAction name="{name}" state="{state}"/>'
        "</TrafficSignalAction></InfrastructureAction></GlobalAction>"
    )


def wanted(time: float) -> str:
    """Return the colour of the controller's phase at a time, in closed form."""
    return "green" if time % 8.0 < 4.0 else "amber" if time % 8.0 < 5.0 else "red"


def test_lamps_shine_as_the_storyboard_says(tmp_path) -> None:
    """s2, opposite to s0, is set to red at 6.5 s and goes with s0 before; s3 goes with s1 all the time."""
    path = drive(tmp_path, files.group("", files.event(set_state("s2", "red"), files.after(6.5))))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        spec = ss.ScenarioSpec.load(path)
        world = build_world(spec)
    heads = dict(world.document.info["heads"])
    assert set(heads) == {"s0", "s1", "s2", "s3"}
    switched = lenses(world.document)
    head_of = {shape: entry.name for entry in world.document.instances for shape in entry.shapes}
    for time in (0.0, 3.999, 4.001, 4.999, 5.5, 6.6, 8.001, 11.9):
        scene = world.at(time).optical_scene()
        with variant.optical() as mi:
            params = mi.traverse(scene)
            lit = {
                (head_of[shape], lens.color)
                for shape, lens in switched.items()
                if np.array(params[f"{shape}.emitter.radiance.value"]).max() > 0.0
            }
        for light in ("s0", "s1"):
            assert {color for head, color in lit if head == heads[light]} == {wanted(time)}, (light, time)
        ours = {color for head, color in lit if head == heads["s2"]}
        assert ours == {"red" if time > 6.5 else wanted(time)}, time
        assert {color for head, color in lit if head == heads["s3"]} == {wanted(time)}


@pytest.mark.parametrize(
    ("state", "shown"),
    [
        ("green", {"green"}), ("red", {"red"}), ("Yellow", {"amber"}), ("red;yellow", {"red", "amber"}),
        ("off;off;on", {"green"}), ("on;on;off", {"red", "amber"}), ("off;on", {"green"}), ("off", set()),
        ("off;off;off", set()), ("walk carefully", None),
    ],
)  # fmt: skip # a table
def test_states_are_words_or_lamps(state: str, shown: set[str] | None) -> None:
    assert colors_of(state) == shown


def test_traffic_goes_by_what_is_stated() -> None:
    """Of a group that is stated from 10 s on: green until 14 s, then red; before, and of others, the plan holds."""
    states = ((10.0, frozenset({"green"})), (14.0, frozenset({"red"})))
    plan = Signals(40.0, {"a": (0.0, 8.0), "b": (0.0, 8.0)}, {"a": states})
    for time in np.arange(0.0, 60.0, 0.25):
        assert plan.is_green("a", time) == (time < 8.0 or 10.0 <= time < 14.0)
        assert plan.is_green("b", time) == (time % 40.0 < 8.0)
        assert plan.green_left("a", time) == pytest.approx(
            8.0 - time if time < 8.0 else max(14.0 - time, 0.0) * (time >= 10.0)
        )


def test_what_no_light_shows_is_said(tmp_path) -> None:
    path = drive(tmp_path, files.group("", files.event(set_state("elsewhere", "walk carefully"), files.after(1.0))))
    with pytest.warns(match="the map has no light 'elsewhere': it decides conditions alone and 1 more"):
        found = read_drive(path)
    assert any("state 'walk carefully' is none that lamps show" in one for one in found.findings)
