"""A car drives through an extract of OpenStreetMap, a dataset of it names the licence, and the radar sees a car."""

from __future__ import annotations

import json

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.core.settings.radar import RadarSettings
from scarl_sionna.fusion import Rig, SensorMount
from scarl_sionna.simulation import load_world
from tests.street_drives import drive, longest_route, stays_on_its_lanes
from tests.street_extracts import EXTRACTS

pytest.importorskip("sumo", reason="eclipse-sumo is not installed")
pytestmark = [
    pytest.mark.own_process(shared=True),
    pytest.mark.filterwarnings("ignore::scarl_sionna.core.errors.MapWarning"),
]


@pytest.fixture
def town(tmp_path):
    """An extract's file."""
    file = tmp_path / "town.osm"
    file.write_text(EXTRACTS["town"]())
    return file


@pytest.mark.parametrize("name", list(EXTRACTS))
def test_a_car_drives_for_a_minute_and_stays_on_its_lanes(tmp_path, name):
    file = tmp_path / f"{name}.osm"
    file.write_text(EXTRACTS[name]())
    network = ss.load_scene(file).document.lanes
    route = longest_route(network)
    length = sum(network[one].length for one in route)
    assert length > 200.0
    world = load_world(drive(str(file), route, 60.0, min(13.0, (length - 20.0) / 60.0)))
    assert stays_on_its_lanes(world, network, route, 59.0)


def test_a_dataset_of_an_extract_names_its_licence(town, tmp_path):
    network = ss.load_scene(town).document.lanes
    route = longest_route(network)
    few = RadarSettings(method="raycast", raycast={"num_rays": 20_000})
    mount = SensorMount("a/radar", "radar", ss.RadarSpec.preset("awr1843boost"), ss.Pose([2.4, 0.0, 0.6]), few)
    Rig("one", (mount,)).save(tmp_path / "rig.yaml")
    motion = {"kind": "route", "lanes": route, "speed": 5}
    text = json.dumps({"scene": "town.osm", "rig": "rig.yaml", "num_frames": 1, "ego": {"trajectory": motion}})
    (tmp_path / "drive.yaml").write_text(text)
    ss.export([ss.ScenarioSpec.load(tmp_path / "drive.yaml")], tmp_path / "out")
    card = (tmp_path / "out" / "README.md").read_text()
    assert "(c) OpenStreetMap contributors, ODbL 1.0" in card


@pytest.mark.slow
def test_the_radar_sees_the_car_ahead_between_buildings(town):
    network = ss.load_scene(town).document.lanes
    route = longest_route(network)
    lead = {
        "name": "lead",
        "model": "suv",
        "trajectory": {"kind": "route", "lanes": route, "start": 30.0, "speed": 8.0},
    }
    world = load_world(drive(str(town), route, 10.0, 6.0, lead))
    rig = Rig("one", (SensorMount("a/radar", "radar", ss.RadarSpec.preset("awr1843boost"), ss.Pose([2.4, 0.0, 0.6])),))
    few = RadarSettings(method="auto", raycast={"num_rays": 100_000}, accuracy={"tube_budget": 10_000})
    radar = ss.observe(world, rig, time=1.0, radar=few).results["a/radar"]
    rd = ss.range_doppler(radar)
    moving = np.abs(rd.radial_velocity - 2.0) < 0.8  # the lead opens at 2 m/s; what stands closes at up to 6 m/s
    profile, ranges = (np.abs(rd.data[:, moving]) ** 2).sum((0, 1)), rd.range
    state = world.at(1.0)
    box = next(one for one in state.boxes() if one.name == "lead")
    near = (
        np.linalg.norm(state.actor_pose("ego").apply([2.4, 0.0, 0.6]) - box.world_from_box.position) - 0.5 * box.size[0]
    )
    ahead = (ranges > 5.0) & (ranges < 35.0)
    assert ranges[ahead][profile[ahead].argmax()] == pytest.approx(near, abs=1.5)
