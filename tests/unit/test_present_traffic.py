"""Traffic that is not on the lanes of a scene is not seen in it."""

import numpy as np
import pytest

from scarl_sionna.core.errors import ScarlWarning
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.scenario.compose import build_world, compose
from scarl_sionna.scenario.road_users import SIGHT
from scarl_sionna.scenario.spec.scenario import ScenarioSpec
from scarl_sionna.scenario.traffic.planned import DEPTH, PresentTrajectory
from scarl_sionna.scene.motion.trajectory import ConstantTwistTrajectory, forward_speeds, is_present


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
    spec = ScenarioSpec(scene="tunnel", duration=6.0, seed=1, traffic={"density": 20.0, "open_ends": True})
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
    traffic = {"density": 20.0, "open_ends": True}
    world = build_world(ScenarioSpec(scene="tunnel", detail="light", duration=6.0, seed=1, traffic=traffic))
    actors = {actor.name for actor in world.actors}
    seen = [{item.name: item for item in world.at(time).boxes() if item.is_actor} for time in (0.0, 5.9)]
    assert all(item.world_from_box.position[2] > -0.5 * DEPTH for boxes in seen for item in boxes.values())
    assert any(set(boxes) < actors for boxes in seen)
    kept = set(seen[0]) & set(seen[1])
    assert kept and all(
        seen[0][name].instance == seen[1][name].instance for name in kept
    )  # ids stay when others come and go


def changes_of(spec: ScenarioSpec) -> tuple[int, list[float]]:
    """Return the size of a scenario's cast, and how far from the ego vehicle members come or go [m], at 100 Hz."""
    members = compose(spec).members
    ego = next(member.actor.trajectory for member in members if member.actor.name == "ego")
    times, found = np.arange(spec.times[0], spec.times[-1], 0.01).tolist(), []
    for motion in (member.actor.trajectory for member in members):
        there = np.array([is_present(motion, time) for time in times])
        for row in np.flatnonzero(there[1:] != there[:-1]):
            time = times[row if there[row] else row + 1]
            found.append(float(np.linalg.norm(motion.pose(time).position - ego.pose(time).position)))
    return len(members), found


def test_nobody_comes_or_goes_in_view() -> None:
    spec = ScenarioSpec.preset("town_traffic")
    count, found = changes_of(spec)
    assert not found  # the streets end within sight
    assert spec.traffic is not None
    more, open_found = changes_of(spec.with_(traffic=spec.traffic.with_(open_ends=True)))
    assert len(open_found) >= 4 and min(open_found) < 146.0 < SIGHT
    assert more / 2 < count < more


def test_where_most_come_and_go_it_says_so() -> None:
    stands = {"trajectory": {"kind": "static", "lane": "right", "start": 60.0, "offset": -2.5}}
    long = ScenarioSpec(scene="urban_crossing", duration=25.0, frame_rate=1.0, ego=stands, traffic={"density": 10.0})
    with pytest.warns(ScarlWarning, match="come or go at ends of streets within 300 m .* `open_ends: true`"):
        compose(long)
