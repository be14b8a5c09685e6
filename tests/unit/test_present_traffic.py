"""Traffic that is not on the lanes of a scene is not seen in it."""

import numpy as np
import pytest

from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.scenario.compose import build_world, compose
from scarl_sionna.scenario.spec.scenario import ScenarioSpec
from scarl_sionna.scenario.traffic.planned import DEPTH, PresentTrajectory
from scarl_sionna.scene.motion.trajectory import ConstantTwistTrajectory, forward_speeds


def test_only_the_height_changes_and_only_outside_of_the_interval() -> None:
    motion = ConstantTwistTrajectory(Pose(np.array([1.0, 2.0, 0.5])), Twist(np.array([4.0, 0.0, 0.0])), -1.0, 9.0)
    present = PresentTrajectory(motion, (2.0, 5.0), 700.0)
    assert (present.start, present.stop) == (-1.0, 9.0)
    for time, height in ((0.0, -699.5), (2.0, 0.5), (3.3, 0.5), (5.0, 0.5), (5.01, -699.5)):
        assert present.pose(time).position == pytest.approx([1.0 + 4.0 * time, 2.0, height])
        assert present.twist(time).linear == pytest.approx([4.0, 0.0, 0.0])
    assert forward_speeds(present, [0.0, 3.0]) == pytest.approx([4.0, 4.0])


@pytest.mark.filterwarnings("ignore::scarl_sionna.core.errors.ScarlWarning")
def test_in_a_scenario_traffic_is_on_the_lanes_or_deep_below() -> None:
    spec = ScenarioSpec(scene="tunnel", duration=6.0, seed=1, traffic={"density": 20.0})
    composition = compose(spec)
    lanes = composition.scene.lanes
    assert lanes is not None
    line = np.concatenate([lane.at(np.arange(0.0, lane.length, 0.5)) for lane in lanes.lanes])
    deep = 0
    for member in composition.members:
        for time in (0.0, 2.0, 4.0, 5.9):
            position = member.actor.trajectory.pose(time).position
            if position[2] < -0.5 * DEPTH:
                deep += 1
                continue
            assert np.linalg.norm(line - position, axis=1).min() < 2.5, member.actor.name
    assert deep > 0  # in a scene of 320 m some drive out of it within 6 s


@pytest.mark.filterwarnings("ignore::scarl_sionna.core.errors.ScarlWarning")
def test_who_is_not_in_the_scene_has_no_box() -> None:
    world = build_world(ScenarioSpec(scene="tunnel", detail="light", duration=6.0, seed=1, traffic={"density": 20.0}))
    actors = {actor.name for actor in world.actors}
    seen = [{item.name: item for item in world.at(time).boxes() if item.is_actor} for time in (0.0, 5.9)]
    assert all(item.world_from_box.position[2] > -0.5 * DEPTH for boxes in seen for item in boxes.values())
    assert any(set(boxes) < actors for boxes in seen)
    kept = set(seen[0]) & set(seen[1])
    assert kept and all(
        seen[0][name].instance == seen[1][name].instance for name in kept
    )  # ids stay when others come and go
