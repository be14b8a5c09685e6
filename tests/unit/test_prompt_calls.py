"""One call to a first radar cube, and one to a dataset."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.batch import one_call
from scarl_sionna.batch.driver import ExportSettings
from scarl_sionna.core.errors import InputTypeError, PlacementError, UnknownNameError
from scarl_sionna.scenario.spec.named import scenario_of
from tests.lane_scene import lane_scene

RADAR = ss.RadarSpec().with_(num_chirps=32, num_samples=64)
FAST = ss.RadarSettings.of("raycast", num_rays=2000)


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> ss.World:
    return ss.load_scene(lane_scene(tmp_path_factory.mktemp("scene")))


def test_a_radar_cube_is_that_of_observe(world: ss.World) -> None:
    cube = ss.radar_cube(world, RADAR, time=0.5, seed=3, settings=FAST)
    frame = ss.observe(world, ss.Rig.front(radar=RADAR).subset("*/radar"), 0.5, seed=3, radar=FAST)
    (radar_frame,) = frame.radars.values()
    np.testing.assert_array_equal(cube.data, ss.range_doppler_angle(radar_frame).data)
    again = ss.range_doppler_angle(ss.virtual_cube(radar_frame.adc, RADAR), RADAR)
    np.testing.assert_array_equal(cube.data, again.data)  # a frame and a cube with its radar are the same
    np.testing.assert_array_equal(ss.range_doppler(radar_frame).data, cube.range_doppler.data)
    assert ss.detect(cube).num_points == ss.detect(cube, RADAR).num_points


def test_a_radar_cube_says_what_it_lacks(world: ss.World, tmp_path: Path) -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'awr1843boost'"):
        ss.radar_cube(world, "awr1843bost")
    with pytest.raises(InputTypeError, match="RadarSpec.preset"):
        ss.radar_cube(world, 3)  # type: ignore[arg-type]
    with pytest.raises(PlacementError, match="no ego vehicle"):
        ss.radar_cube(lane_scene(tmp_path, ego=False), RADAR, settings=FAST)


def _recorded(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    calls: list[Any] = []

    def run(scenarios: list[ss.ScenarioSpec], out: Path, settings: ExportSettings, *, on_event: Any) -> str:
        calls.append((scenarios, out, settings))
        on_event("plan", {"frames": 5, "done": 2, "shards": 1})
        on_event("stage", {"scene": "a", "frame": 2, "stage": "radar", "part": 0.5})
        on_event("frame", {"scene": "a", "frame": 2, "seconds": {}, "bytes": 3})
        on_event("shard", {"scene": "a", "shard": 0, "bytes": 3})
        return "report"

    monkeypatch.setattr(one_call, "run", run)
    return calls


def test_export_takes_scenarios_files_and_names(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    calls = _recorded(monkeypatch)
    file = tmp_path / "my drive.yaml"
    file.write_text("scene: urban_crossing\n", encoding="utf-8")
    own = ss.ScenarioSpec(seed=7)
    reported: list[tuple[int, int]] = []
    report = ss.export(
        [own, file, "cut_in", "urban_crossing"],
        tmp_path / "out",
        2,
        on_progress=lambda done, total: reported.append((done, total)),
        overwrite=True,
        licence="CC0",
    )
    ((scenarios, out, settings),) = calls
    assert report == "report" and out == tmp_path / "out"
    assert scenarios == [
        own,
        ss.ScenarioSpec(scene="urban_crossing", name="my_drive"),
        scenario_of("cut_in"),
        scenario_of("urban_crossing"),
    ]
    assert (settings.workers, settings.overwrite, settings.licence) == (2, True, "CC0")
    assert reported == [(2, 5), (3, 5)]


def test_export_takes_one_scenario_and_radar_settings(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    calls = _recorded(monkeypatch)
    ss.export("cut_in", tmp_path, radar=ss.RadarSettings(noise=False))
    ss.export(ss.ScenarioSpec(radar=FAST), tmp_path, radar=ss.RadarSettings(noise=False))
    (first,), (second,) = (call[0] for call in calls)
    assert first.radar is not None and not first.radar.noise
    assert second.radar == FAST.with_(noise=False)  # the scenario's other fields stay


def test_export_refuses_what_it_does_not_know(tmp_path: Path) -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'overwrite'"):
        ss.export("cut_in", tmp_path, overwrit=True)
    with pytest.raises(UnknownNameError, match="did you mean 'cut_in'"):
        ss.export("cutin", tmp_path)
    with pytest.raises(InputTypeError, match="ss.export"):
        ss.export([3], tmp_path)  # type: ignore[list-item]
    assert {item.name for item in fields(ExportSettings)} >= {"workers", "overwrite", "licence"}


def test_export_makes_a_dataset_that_opens(tmp_path: Path) -> None:
    scene = lane_scene(tmp_path / "scene")
    rig = ss.Rig.front("draft", radar=RADAR).subset("*/radar").with_radar(FAST)
    rig.save(tmp_path / "rig.yaml")
    scenario = ss.ScenarioSpec(scene=str(scene), rig=str(tmp_path / "rig.yaml"), num_frames=2, frame_rate=2.0)
    report = ss.export(scenario, tmp_path / "out")
    assert (report.num_made, report.num_kept) == (2, 0)
    dataset = ss.open_dataset(tmp_path / "out")
    assert isinstance(dataset, ss.Dataset) and len(dataset) == 2
    again = ss.export(scenario, tmp_path / "out")
    assert (again.num_made, again.num_kept) == (0, 2)
