"""The scene `urban_crossing`: who stands where, nobody in anybody's way, built the same again."""

from __future__ import annotations

import numpy as np
import pytest

import scarl_sionna as ss
from scenes_xml import scene_path
from scenes_xml.urban_crossing import build as builder
from scenes_xml.urban_crossing import layout
from tests.built_files import hold_the_same
from tests.plan_view import overlap

TIMES = np.arange(0.0, 8.01, 0.5)


@pytest.fixture(scope="module")
def world():
    return ss.load_scene("urban_crossing")


def _lowest(world, state, name):
    info = next(info for info in world.instances.values() if info.name == name)
    return min(float(state._triangles.of_parts([part])[..., 2].min()) for part in info.parts)


def test_classes(world):
    names = {info.name: info for info in world.instances.values()}
    assert len(world.actors) == 8 and world.ego == "ego"
    assert sum(name.startswith("house") for name in names) > 20
    pedestrian = {info.semantic for name, info in names.items() if name.startswith("walker")}
    assert len(pedestrian) == 1 and pedestrian != {names["ego"].semantic}


def test_cars_and_people_stand_on_the_street(world):
    for time in TIMES:
        state = world.at(time)
        for actor in world.actors:
            _, y, z = state.actor_pose(actor.name).position
            away = min(abs(y - layout.KERB_LEFT), abs(y - layout.KERB_RIGHT))
            near_kerb = away < layout.RAMP[1] + 0.01
            below = layout.KERB_HEIGHT if away < layout.RAMP[1] + 0.6 else 0.0  # the hind foot is on the ramp yet
            assert -0.025 - below < _lowest(world, state, actor.name) - z < 0.06, (actor.name, time)
            assert _lowest(world, state, actor.name) > -0.025, (actor.name, time)
            assert near_kerb or abs(z - layout.ground(y)) < 1e-6


def test_nobody_runs_into_anybody(world):
    for time in TIMES:
        boxes = [box for box in world.at(time).boxes() if box.is_actor or box.name.startswith("parked")]
        for number, first in enumerate(boxes):
            for second in boxes[number + 1 :]:
                assert not overlap(first, second), (first.name, second.name, time)


def test_the_ego_car_stops_before_the_crossing(world):
    last = world.at(8.0)
    front = last.actor_pose("ego").position[0] + 2.3
    assert layout.ZEBRA[0] - 2.5 < front < layout.ZEBRA[0] - 1.0
    assert np.linalg.norm(last.actor_twist("ego").linear) < 0.02
    speeds = [last.world.at(t).actor_twist("ego").linear[0] for t in np.linspace(0, 8, 81)]
    assert min(speeds) > -0.02 and speeds[0] == pytest.approx(8.0, rel=0.01)


def test_a_radar_sees_limbs_faster_than_the_walker(world):
    state, radar = world.at(1.75), ss.RadarSpec.preset("awr1843boost")
    pose = ss.Pose([21.1, 4.0, 0.8], [np.cos(-np.pi / 4), 0.0, 0.0, np.sin(-np.pi / 4)])
    paths = ss.solve_paths(state, radar, pose, method="raycast", num_rays=200_000, hits_per_cell=None)
    walker = next(info.instance for info in world.instances.values() if info.name == "walker_0")
    rate = paths.length_rate[paths.instance[:, 0] == walker] / 2
    assert len(rate) > 100
    assert np.ptp(rate) > 1.5 * 1.35  # the swinging leg moves several times as fast as the standing one


@pytest.mark.slow
def test_built_again_it_is_the_same(tmp_path):
    builder.build(tmp_path)
    there = scene_path("urban_crossing").parent
    files = [p.relative_to(tmp_path) for p in tmp_path.rglob("*") if p.is_file()]
    assert len(files) > 300
    assert [str(file) for file in files if not hold_the_same(tmp_path / file, there / file)] == []
