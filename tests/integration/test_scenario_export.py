"""An export of a scenario with actors, traffic and draws.

The same bytes in one process and in workers that are spawned.
"""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from scarl_sionna.batch import ExportSettings, export
from scarl_sionna.core.errors import CollisionError, OutputError
from scarl_sionna.dataset import StoreOptions, open_dataset
from scarl_sionna.fusion import Rig
from scarl_sionna.scenario.spec.scenario import ScenarioSpec
from tests.exports import RIG, contents
from tests.lane_scene import lane_scene

TABLE = "id,time,x,y,z\n" + "".join(f"recorded,{t},{10.0 * t - 100.0},7.0,0.0\n" for t in range(4))
TEXT = """\
scene: synthetic.xml
rig: rig.yaml
name: drive
num_frames: 4
seed: 5
detail: light
lighting: dusk
weather: rain
ego:
  trajectory: {kind: route, lanes: [east], start: 100, speed: 8}
actors:
  - name: cut
    model: suv
    trajectory: {kind: route, lanes: [east_2], start: 112, speed: 10,
                 events: [{kind: shift, time: 0.1, duration: 2, by: -3.5}]}
  - name: recorded
    model: van
    trajectory: {kind: table, file: drive.csv}
traffic: {density: 8, pedestrians: 2}
randomization: {colors: true, materials: true, placements: true}
"""


@pytest.fixture
def spec(tmp_path) -> ScenarioSpec:
    lane_scene(tmp_path)
    (tmp_path / "drive.csv").write_text(TABLE)
    Rig("two", RIG.subset("front/lidar", "front/camera").sensors).save(tmp_path / "rig.yaml")
    (tmp_path / "drive.yaml").write_text(TEXT)
    return ScenarioSpec.load(tmp_path / "drive.yaml")


def settings(workers: int) -> ExportSettings:
    return ExportSettings(workers=workers, options=StoreOptions(shard_frames=2))


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_workers_make_the_same_bytes(spec, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(os.path.dirname(tmp_path))  # everything is found beside the scenario's file
    alone, spread = tmp_path / "alone", tmp_path / "spread"
    assert export([spec], alone, settings(0)).num_made == 4
    assert export([spec], spread, settings(2)).num_made == 4
    assert contents(alone) == contents(spread)
    names = {item.name for item in open_dataset(alone)[0].labels}
    assert {"ego", "cut", "recorded"} <= names and any(name.startswith("traffic_") for name in names)
    assert export([ScenarioSpec.load(Path(tmp_path / "drive.yaml"))], alone, settings(0)).num_made == 0
    with pytest.raises(OutputError, match="lighting"):
        export([spec.with_(lighting="night")], alone, settings(0))


def test_an_export_refuses_before_it_writes(spec, tmp_path) -> None:
    text = TEXT.replace("lanes: [east_2], start: 112", "lanes: [east], start: 103").replace("placements: true", "")
    (tmp_path / "drive.yaml").write_text(text.replace(", }", "}"))
    with pytest.raises(CollisionError) as caught:
        export([ScenarioSpec.load(tmp_path / "drive.yaml")], tmp_path / "out", settings(0))
    assert caught.value.line == 12 and not (tmp_path / "out").exists()
