"""A car drives on a map by its lane network, and radar and camera see what is before it; other projects' maps as well.

Maps of others stay outside of the repository: `SCARL_STREET_MAPS` names a folder of them.
"""

from __future__ import annotations

import os
import warnings
from pathlib import Path

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.core.errors import MapWarning
from scarl_sionna.core.semantics import semantic_id
from scarl_sionna.core.settings.radar import RadarSettings
from scarl_sionna.core.specs.camera import CameraSpec
from scarl_sionna.fusion import Rig, SensorMount
from scarl_sionna.scene.document.find import MAP_SUFFIXES
from scarl_sionna.simulation import load_world
from tests import street_maps as maps
from tests.street_drives import drive, longest_route, stays_on_its_lanes

pytestmark = pytest.mark.own_process(shared=True)  # beside what a worker has, too much memory

FOLDER = os.environ.get("SCARL_STREET_MAPS")
OTHERS = sorted(f for f in Path(FOLDER).rglob("*") if f.name.endswith(MAP_SUFFIXES)) if FOLDER else []


@pytest.mark.parametrize("variant", [0, pytest.param(2, marks=pytest.mark.slow)])  # 2: test_street_surroundings
def test_a_car_turns_at_a_crossing_behind_another_and_sensors_see_it(tmp_path, variant):
    file = tmp_path / "crossing.xodr"
    file.write_text(maps.MAPS["crossing"])
    route = ["2/0/1", "121/0/-1", "1/0/-1"]  # from the west, to the left
    other = {
        "name": "lead",
        "model": "suv",
        "trajectory": {"kind": "route", "lanes": route, "start": 25.0, "speed": 6.0},
    }
    world = load_world(drive(str(file), route, 18.0, 6.0, other, variant=variant))
    headings = [world.at(t).actor_pose("ego").yaw for t in (0.0, 17.0)]
    turn = np.degrees(headings[1] - headings[0])
    assert (turn + 180.0) % 360.0 - 180.0 == pytest.approx(90.0, abs=1.0)
    for time in np.arange(0.0, 17.5, 0.5):
        pose = world.at(float(time)).actor_pose("ego")
        assert abs(pose.position[2]) < 1e-6
        assert min(world.document.lanes[name].nearest(pose.position)[1] for name in route) < 0.6
    camera = CameraSpec(width=160, height=90, samples_per_pixel=4, images=("rgb", "semantic", "depth"))
    rig = Rig(
        "two",
        (
            SensorMount("a/radar", "radar", ss.RadarSpec.preset("awr1843boost"), ss.Pose([2.4, 0.0, 0.6])),
            SensorMount("a/camera", "camera", camera, ss.Pose([0.3, 0.0, 1.6])),
        ),
    )
    few = RadarSettings(  # among houses 'auto' has 56 objects to weigh: the same answer for three times the time
        method="auto" if variant == 0 else "raycast", raycast={"num_rays": 100_000}, accuracy={"tube_budget": 10_000}
    )
    frame = ss.observe(world, rig, time=1.0, radar=few)
    radar, image = frame.results["a/radar"], frame.results["a/camera"]
    profile = (np.abs(np.asarray(ss.range_doppler(radar).data)) ** 2).sum((0, 1))
    ranges = np.arange(len(profile)) * radar.spec.range_resolution
    state = world.at(1.0)
    box = next(one for one in state.boxes() if one.name == "lead")
    back = state.actor_pose("ego").apply([2.4, 0.0, 0.6]) - box.world_from_box.position
    near = np.linalg.norm(back) - 0.5 * box.size[0]
    ahead = (ranges > 9.0) & (ranges < 30.0)  # nearer are road and kerb, as strong
    assert ranges[ahead][profile[ahead].argmax()] == pytest.approx(near, abs=1.5)
    assert len(np.unique(image.semantic)) >= 4 and np.isfinite(image.depth[60:]).all()
    built = float(np.mean(image.semantic == semantic_id("Building")))
    assert built == 0.0 if variant == 0 else built > 0.05


@pytest.mark.skipif(not OTHERS, reason="SCARL_STREET_MAPS names no folder with maps")
@pytest.mark.parametrize("file", OTHERS, ids=lambda file: file.stem)
def test_maps_of_other_projects_are_driven_for_a_minute(file):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", MapWarning)
        network = ss.load_scene(file).document.lanes
        route = longest_route(network)
        length = sum(network[name].length for name in route)
        world = load_world(drive(str(file), route, 60.0, min(13.0, (length - 20.0) / 60.0)))
    assert stays_on_its_lanes(world, network, route, 59.0)
