"""Traffic lights change while a scene runs, by the plan that its traffic obeys."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pytest

from scarl_sionna.core.errors import UnknownNameError
from scarl_sionna.engine import variant
from scarl_sionna.engine.light.lamps import Lens, lenses
from scarl_sionna.engine.load import load_scene
from scarl_sionna.scenario.spec.scenario import ScenarioSpec
from scarl_sionna.scene.lanes import Signals
from scarl_sionna.simulation import load_world
from tests.scenes import Thing, box, write_scene

PLAN = Signals(40.0, {"a": (0.0, 18.0), "b": (22.0, 35.0), "always": (0.0, 40.0)})


@pytest.mark.parametrize(
    ("time", "first", "second"),
    [
        (0.0, {"green"}, {"red"}),
        (17.99, {"green"}, {"red"}),
        (18.0, {"amber"}, {"red"}),
        (20.99, {"amber"}, {"red"}),
        (21.0, {"red"}, {"red", "amber"}),
        (22.0, {"red"}, {"green"}),
        (36.0, {"red"}, {"amber"}),
        (39.5, {"red", "amber"}, {"red"}),
        (40.0, {"green"}, {"red"}),
        (-0.5, {"red", "amber"}, {"red"}),
    ],
)
def test_a_light_goes_through_its_colours(time: float, first: set[str], second: set[str]) -> None:
    assert PLAN.shown("a", time) == first and PLAN.shown("b", time) == second
    assert PLAN.shown("always", time) == {"green"}


def test_traffic_drives_on_green_only_what_shows_green() -> None:
    for time in np.linspace(0.0, 80.0, 801):
        for group in PLAN.green:
            assert PLAN.is_green(group, time) == ("green" in PLAN.shown(group, time))


def test_a_head_without_amber_shows_red_instead() -> None:
    red, green = Lens("a", "red", False), Lens("a", "green", False)
    for time in np.linspace(0.0, 40.0, 81):
        assert red.is_lit(PLAN, time) != green.is_lit(PLAN, time)


def radiances(twin: object, shapes: Iterable[str]) -> dict[str, np.ndarray]:
    with variant.optical() as mi:
        params = mi.traverse(twin)  # once: it looks at all that the scene holds
        return {shape: np.array(params[f"{shape}.emitter.radiance.value"]).reshape(-1) for shape in shapes}


def test_the_lenses_of_a_drive_shine_as_the_plan_says_at_each_time() -> None:
    world = load_world(ScenarioSpec.preset("stop_at_the_lights").with_(traffic=None))
    switched = lenses(world.document)
    assert {lens.group for lens in switched.values()} == {"main", "side", "walk_main", "walk_side"}
    for time in (17.5, 18.5, 21.5, 17.5):
        state = world.at(time)
        shining = radiances(state.optical_scene(), switched)
        for shape, lens in switched.items():
            shown = state.signals[lens.group]
            lit = lens.color in shown or (lens.color == "red" and "green" not in shown and not lens.has_amber)
            assert (shining[shape].max() > 0.0) == lit, (time, shape)


def test_a_group_that_no_plan_has_is_an_error(tmp_path) -> None:
    path = write_scene(tmp_path, [Thing("block", box((1.0, 1.0, 1.0), (5.0, 0.0, 0.5)), "Static", "concrete")])
    toml = path.parent / "scene.toml"
    text = toml.read_text()
    head = 'name = "block"'
    assert head in text
    toml.write_text(text.replace(head, head + '\nsignal = "nowhere"', 1))
    with pytest.raises(UnknownNameError, match="nowhere"):
        load_scene(path)
