"""Boxes of actors: one size a track, a centre that moves at the velocity of the label, the tight box beside it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.results import ObjectState
from scarl_sionna.core.semantics import semantic_id
from scarl_sionna.engine.load import load_scene
from scarl_sionna.engine.world import World
from scarl_sionna.loop.motion import ToldTrajectory
from scarl_sionna.scenario.compose import build_world
from scarl_sionna.scenario.spec.scenario import ScenarioSpec, scenario_names
from scarl_sionna.scene.document.staging import StagedActor
from scarl_sionna.scene.motion.trajectory import StaticTrajectory, WaypointTrajectory

HALF = 0.002
"""Half of the time between two boxes whose difference is a velocity [s]: a jerk of 100 m/s^3 makes 7e-5 m/s of it."""
APART = 0.01
"""Largest difference allowed between a label's velocity and its box's [m/s]; the bar is 0.1 m/s."""
BEYOND = 0.03
"""How far a limb may be beyond the box of its track [m]: in bends."""
TURNING = {"stop_at_the_lights": np.array([BEYOND, 0.06, BEYOND])}
"""The same of who turns on to a crossing in a scenario: to the side, 0.051 m there."""
AT_KERBS = np.array([0.16 + BEYOND, BEYOND, 0.09])
"""The same of who crosses a kerb of 12 cm: the step before it is longer, by up to 0.16 m in these scenarios, and the
feet are up to half of the kerb above and below the middle of the body's own way, which is smooth."""
PEDESTRIAN = semantic_id("Pedestrian")
QUICK = ("child_between_parked_cars",)


def named(world: World, time: float) -> dict[str, ObjectState]:
    return {item.name: item for item in world.at(time).boxes() if item.is_actor}


def pairs(name: str, count: int) -> Iterator[tuple[ObjectState, np.ndarray]]:
    """Yield boxes of all actors of a scenario at some times, each with the velocity of its centre."""
    spec = ScenarioSpec.preset(name)
    world = build_world(spec)
    for time in np.linspace(spec.times[0] + HALF, spec.times[-1] - HALF, count):
        before, now, after = (named(world, time + shift) for shift in (-HALF, 0.0, HALF))
        for item in now.values():
            if item.name in before and item.name in after:
                way = after[item.name].world_from_box.position - before[item.name].world_from_box.position
                yield item, way / (2.0 * HALF)


def check(name: str, count: int) -> None:
    sizes: dict[str, np.ndarray] = {}
    spread, heights = [], {}
    reaches: dict[str, np.ndarray] = {}
    for item, velocity in pairs(name, count):
        np.testing.assert_allclose(velocity, item.twist.linear, rtol=0.0, atol=APART, err_msg=item.name)
        np.testing.assert_array_equal(item.size, sizes.setdefault(item.name, item.size))
        reach = np.abs(item.tight_center) + (item.tight_size - item.size) / 2.0
        reaches[item.name] = np.maximum(reaches.get(item.name, -np.ones(3)), reach)
        heights.setdefault(item.name, []).append(item.world_from_box.position[2])
        if item.semantic == PEDESTRIAN:
            spread.append(item.tight_size[0] / item.size[0])
        else:
            np.testing.assert_array_equal(item.tight_size, item.size)
            np.testing.assert_array_equal(item.world_from_tight_box.position, item.world_from_box.position)
    for actor, reach in reaches.items():
        on_kerb = np.ptp(heights[actor]) > BEYOND
        assert np.all(reach <= (AT_KERBS if on_kerb else TURNING.get(name, BEYOND))), (actor, reach)
    assert not spread or min(spread) < 0.75  # legs close: the tight box follows the steps


@pytest.mark.parametrize("name", QUICK)
def test_boxes_move_at_the_velocity_of_their_labels(name) -> None:
    check(name, 12)


@pytest.mark.some(6)
@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in scenario_names() if name not in QUICK])
def test_boxes_of_all_scenarios_move_at_the_velocity_of_their_labels(name) -> None:
    check(name, 40)


@pytest.fixture(scope="module")
def street() -> World:
    away = ToldTrajectory(0.0, Pose([0.0, 0.0, -50.0]))
    away.tell(0.0, Pose([30.0, 6.0, 0.0]), Twist([1.5, 0.0, 0.0]))
    turn = np.linspace(0.0, np.pi, 9)
    bend = np.column_stack([20.0 + 3.0 * np.sin(turn), 3.0 - 3.0 * np.cos(turn), 0.0 * turn])
    return load_scene("highway_guardrail").with_actors(
        [
            StagedActor("stands", "adult_man", StaticTrajectory(Pose([25.0, 6.0, 0.0]))),
            StagedActor("turns", "adult_man", WaypointTrajectory(np.linspace(0.0, 7.0, 9), bend)),
            StagedActor("told", "adult_man", away),
        ]
    )


def test_who_stands_has_the_box_of_a_body_that_stands(street) -> None:
    item = named(street, 0.0)["stands"]
    np.testing.assert_allclose(item.size, item.tight_size, atol=1e-9)
    np.testing.assert_allclose(item.tight_center, 0.0, atol=1e-9)
    assert item.size[0] < 0.6  # [m]: no room for steps


def test_a_walker_in_a_bend_has_one_box_at_its_velocity(street) -> None:
    for time in np.linspace(0.5, 6.5, 8):
        before, now, after = (named(street, time + shift)["turns"] for shift in (-HALF, 0.0, HALF))
        velocity = (after.world_from_box.position - before.world_from_box.position) / (2.0 * HALF)
        np.testing.assert_allclose(velocity, now.twist.linear, atol=APART)
        assert np.all(np.abs(now.tight_center) + (now.tight_size - now.size) / 2.0 <= BEYOND)


def test_who_is_told_step_by_step_has_room_for_the_steps_of_a_walk(street) -> None:
    standing = named(street, 0.0)["stands"].size
    told = named(street, 0.0)["told"].size
    assert told[0] > standing[0] + 0.4 and told[2] == pytest.approx(standing[2], abs=0.02)
    again = street.with_motion({"told": WaypointTrajectory([0.0, 9.0], [[30.0, 6.0, 0.0], [30.5, 6.0, 0.0]])})
    assert named(again, 0.0)["told"].size[0] < told[0] - 0.3  # on another way, another box
    assert named(street, 0.0)["told"].size[0] == told[0]


def test_what_is_not_said_of_the_tight_box_is_the_box() -> None:
    item = ObjectState("car", 1, 14, Pose([1.0, 2.0, 3.0]), np.array([4.0, 2.0, 1.5]), Twist(), True)
    assert item.tight_size is item.size
    np.testing.assert_array_equal(item.world_from_tight_box.position, [1.0, 2.0, 3.0])
