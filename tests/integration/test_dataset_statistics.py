"""Statistics of a dataset: planted points and labels are counted as they were planted, and the page says so."""

from __future__ import annotations

import json
import math
import re
import xml.etree.ElementTree as ET
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import scarl_sionna as ss
from scarl_sionna.cli import app
from scarl_sionna.core.errors import OutputError, ParameterRangeError, UnknownNameError
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.results import ObjectState
from scarl_sionna.core.semantics import semantic_id
from scarl_sionna.core.specs.weather import Weather
from scarl_sionna.dataset import write_dataset
from scarl_sionna.dataset.derived.boxes import nearest_footprint
from scarl_sionna.dataset.derived.radar_points import sensed_points
from scarl_sionna.dataset.formats import FrameSource, SceneFrames
from scarl_sionna.dataset.statistics.charts import by_range
from scarl_sionna.dataset.statistics.collect import DatasetStatistics, dataset_statistics
from scarl_sionna.dataset.statistics.counted import OBJECT_ROW, POINT_ROW, SCAN_ROW, SceneFacts, velocity_spread
from scarl_sionna.dataset.statistics.groups import GROUP_NAMES, weather_name
from scarl_sionna.dataset.statistics.published import FIGURES, compare
from tests.drive import drive

SOURCE = drive(num_frames=3, ends=("front",), scenes=("street", "lane"))
CAR, PEDESTRIAN = GROUP_NAMES.index("car"), GROUP_NAMES.index("pedestrian")


def box(place: tuple[float, float, float], yaw: float = 0.0, speed: float = 0.0) -> ObjectState:
    pose = Pose.from_euler(place, yaw=yaw)
    return ObjectState("box", 1, semantic_id("Car"), pose, np.array([4.0, 2.0, 1.5]), Twist([speed, 0.0, 0.0]), True)


@pytest.fixture(scope="module")
def found() -> DatasetStatistics:
    calls: list[tuple[int, int]] = []
    counted = dataset_statistics(SOURCE, on_progress=lambda *state: calls.append(state))
    assert calls == [(k, 6) for k in range(1, 7)]
    return counted


# -- points and boxes ------------------------------------------------------------------------------------------------


def test_a_point_belongs_to_the_nearest_footprint_whatever_its_height() -> None:
    items = [box((10.0, 0.0, 0.75)), box((10.0, 3.0, 0.75)), box((30.0, 0.0, 0.75), yaw=math.pi / 2)]
    points = [
        (10.0, 0.9, 0.0),  # inside of the first
        (10.0, 0.9, 9.0),  # as the one before: height does not count
        (10.0, 1.6, 0.0),  # 0.6 m beside the first, 0.4 m beside the second
        (12.3, 0.0, 0.0),  # 0.3 m before the first
        (12.6, 0.0, 0.0),  # 0.6 m
        (30.0, 1.9, 0.0),  # the third is turned: inside
        (31.9, 0.0, 0.0),  # 0.9 m beside it
        (12.4, 4.3, 0.0),  # 0.4 m and 0.3 m off a corner of the second: 0.5 m
        (12.41, 4.3, 0.0),
    ]
    assert nearest_footprint(items, points, 0.5 + 1e-9).tolist() == [0, 0, 1, 0, -1, 2, -1, 1, -1]
    assert nearest_footprint(items, points, 0.0).tolist() == [0, 0, -1, -1, -1, 2, -1, -1, -1]
    assert nearest_footprint([items[1], items[0], items[0]], points[:1], 0.5).tolist() == [1]  # of two alike the first
    assert nearest_footprint([], points).tolist() == [-1] * 9
    assert nearest_footprint(items, np.zeros((0, 3))).shape == (0,)


def test_velocities_are_spread_about_the_strongest_point_and_folded() -> None:
    assert velocity_spread(np.array([4.9, 5.1, 5.0]), 40.0) == pytest.approx(np.std([4.9, 5.1, 5.0]))
    assert velocity_spread(np.array([9.9, -9.9, 9.8]), 20.0) == pytest.approx(np.std([9.9, 10.1, 9.8]))  # over the edge
    assert math.isnan(velocity_spread(np.array([1.0, 2.0]), 20.0))


# -- counting --------------------------------------------------------------------------------------------------------


def test_labels_of_all_objects_but_the_own_vehicle(found) -> None:
    """Two scenes of three frames, each with a car, a pedestrian and a house beside the vehicle."""
    assert found.num_frames == 6
    assert found.class_balance() == {"Car": (6, 2), "Pedestrian": (6, 2), "Building": (6, 2)}
    for row in found.objects:
        scene = SOURCE.scenes[row["scene"]]
        frames = [frame for frame in scene for item in frame.objects if item.instance == row["instance"]]
        assert any(
            np.linalg.norm((item.world_from_box.position - frame.world_from_vehicle.position)[:2])
            == pytest.approx(row["range"], rel=1e-6)
            and (item.num_pixels, item.num_lidar_points) == (row["pixels"], row["lidar_points"])
            for frame in frames
            for item in frame.objects
            if item.instance == row["instance"]
        )
    moving = found.objects["moving"]
    assert moving[found.objects["group"] >= 0].all() and not moving[found.objects["group"] < 0].any()


def test_planted_points_are_found_with_their_cross_section_at_their_object(found) -> None:
    """The radar's signal is one point of 10 m2 in the middle of each object ahead; the house is behind."""
    assert len(found.points_per_frame) == len(found.points_per_scan) == 6
    assert found.points_per_frame.sum() == len(found.points)
    strong = found.points[found.points["group"] >= 0]
    assert set(strong["group"]) == {CAR, PEDESTRIAN}
    assert found.objects["radar_points"].sum() == found.scans["points"].sum() == len(strong)
    first = SOURCE.scenes[0].frames[0]
    radar = first.radars["front_center/radar"]
    for group, name in ((CAR, "Car_2"), (PEDESTRIAN, "Pedestrian_3")):
        item = next(item for item in first.objects if item.name == name)
        away = np.linalg.norm(item.world_from_box.position - radar.world_from_sensor.position)
        best = strong[strong["group"] == group][0]  # the first frame's strongest
        assert best["range"] == pytest.approx(away, abs=radar.spec.range_resolution)
        assert best["rcs_dbsm"] == pytest.approx(10.0, abs=1.5)  # Hann window: 1.42 dB between two bins
        assert best["moving"]
    looks = found.scans[(found.scans["group"] == CAR)]
    assert len(looks) == 6 and (looks["points"] >= 1).all()


def test_a_margin_takes_points_beside_a_box_and_every_leaves_frames_out(found) -> None:
    shrunk = FrameSource(SOURCE.rig, [SceneFrames("x", [_moved(frame, 2.5) for frame in SOURCE.scenes[0]])])
    none = dataset_statistics(shrunk, margin=0.1)  # boxes moved 2.5 m to their left, 1.6 m off their points
    assert not (none.points["group"] == CAR).any()
    assert (dataset_statistics(shrunk, margin=2.0).points["group"] == CAR).sum() >= 3
    fewer = dataset_statistics(SOURCE, every=2)
    assert fewer.num_frames == 4
    np.testing.assert_array_equal(np.unique(fewer.objects["range"]), np.unique(_of_frames(found, (0, 2))))


def _moved(frame, left: float):
    objects = tuple(
        replace(item, world_from_box=Pose(item.world_from_box.apply([0.0, left, 0.0]), item.world_from_box.quaternion))
        if item.name == "Car_2"
        else item
        for item in frame.objects
    )
    return replace(frame, objects=objects)


def _of_frames(found: DatasetStatistics, frames: tuple[int, ...]) -> np.ndarray:
    per_frame = found.objects["range"].reshape(2, 3, 3)  # scene, frame, object
    return per_frame[:, frames]


def test_a_stored_dataset_gives_the_same_numbers_and_reads_no_picture(found, tmp_path, monkeypatch) -> None:
    place = write_dataset(tmp_path / "ds", SOURCE.rig, {scene.name: list(scene) for scene in SOURCE.scenes})
    monkeypatch.setattr("scarl_sionna.dataset.readers.reader.Scene.read_image", _no_picture)
    stored = ss.dataset_statistics(place)
    order = [[scene.name for scene in stored.scenes].index(scene.name) for scene in found.scenes]
    assert stored.points_per_frame.reshape(2, 3)[order].tolist() == found.points_per_frame.reshape(2, 3).tolist()
    for name in ("points", "scans"):
        assert sorted(map(str, getattr(stored, name))) == sorted(map(str, getattr(found, name)))
    assert stored.class_balance() == found.class_balance()
    assert "Car: 6 of 2" in repr(stored)


def test_the_strongest_point_of_each_radar_and_frame_is_kept(found) -> None:
    few = dataset_statistics(SOURCE, most_points=1)
    assert found.points_per_scan.tolist() == [2] * 6 and few.points_per_scan.tolist() == [1] * 6
    np.testing.assert_array_equal(few.points["snr_db"], found.points["snr_db"].reshape(6, 2).max(axis=1))
    assert "the strongest 1 of a scan" in repr(few) and "the strongest 1 of a radar" in _page(few)


@pytest.mark.parametrize("told", ["wide", "narrow", "nothing"])
def test_spreads_of_velocity_are_folded_to_what_the_points_of_an_object_tell(monkeypatch, told) -> None:
    """Three points at each place, of which two are an interval of the map faster."""

    def three(frame, radar, pfa):
        sensed = sensed_points(frame, radar, pfa)
        old, narrow = sensed.points, 2.0 * radar.spec.unambiguous_velocity
        columns = {one.name: np.repeat(getattr(old, one.name), 3, axis=0) for one in fields(old)}
        columns["radial_velocity"] = columns["radial_velocity"] + np.tile([0.0, narrow, narrow], old.num_points)
        width = {"wide": 3.0 * narrow, "narrow": narrow}.get(told)
        columns["velocity_interval"] = None if width is None else np.full(3 * old.num_points, width)
        return replace(sensed, points=type(old)(**columns))

    monkeypatch.setattr("scarl_sionna.dataset.statistics.collect.sensed_points", three)
    spread = dataset_statistics(SOURCE).scans["velocity_spread"]
    radar = SOURCE.scenes[0].frames[0].radars["front_center/radar"].spec
    known = 2.0 * radar.unambiguous_velocity * np.std([0.0, 1.0, 1.0]) if told == "wide" else 0.0
    assert len(spread[np.isfinite(spread)]) and spread[np.isfinite(spread)] == pytest.approx(known, abs=1e-4)


def _no_picture(*_: object) -> None:
    raise AssertionError("a picture was read")


def test_occlusion_is_that_of_the_camera_that_sees_most(found) -> None:
    assert np.isnan(found.objects["occlusion"]).all()  # the drive's images do not tell it
    frame = SOURCE.scenes[0].frames[0]
    camera = frame.images["front_center/camera"]
    shares = ([math.nan, 0.4, 0.9, math.nan], [math.nan, math.nan, 0.2, math.nan])
    images = {f"c{k}": replace(camera, object_occlusion=np.array(share, np.float32)) for k, share in enumerate(shares)}
    counted = dataset_statistics(FrameSource(SOURCE.rig, [SceneFrames("x", [replace(frame, results=images)])]))
    np.testing.assert_allclose(counted.objects["occlusion"], [0.4, 0.2, math.nan], rtol=1e-6)
    assert not len(counted.points) and not len(counted.scans)
    assert "Occlusion" in _page(counted)  # a dataset without radars has a page, too


@pytest.mark.parametrize(
    "arguments", [{"every": 0}, {"margin": -1.0}, {"margin": math.nan}, {"pfa": 2.0}, {"most_points": 0}]
)
def test_parameters_out_of_range_are_refused(arguments) -> None:
    with pytest.raises(ParameterRangeError):
        dataset_statistics(SOURCE, **arguments)
    with pytest.raises(ParameterRangeError, match="no frames"):
        dataset_statistics(FrameSource(SOURCE.rig, []))


def test_weather_has_the_name_of_its_preset_or_its_rates() -> None:
    def stored(weather: Weather) -> dict:
        return {"weather": {key: value for key, value in weather.model_dump(mode="json").items() if value is not None}}

    assert weather_name({}) == "clear"
    for name in ("rain", "dense_fog", "snow", "winter"):
        assert weather_name(stored(Weather.preset(name))) == name
    assert weather_name(stored(Weather(rain_rate=3.0, visibility=400.0))) == "rain 3 mm/h, fog 400 m"
    snowy = Weather(rain_rate=1.0, temperature_celsius=1.0, lying_snow="everywhere")
    assert weather_name(stored(snowy)) == "rain 1 mm/h, lying snow"
    assert weather_name({"weather": {"hail": 3}}) == "unknown"


# -- published figures -----------------------------------------------------------------------------------------------


def planted() -> DatasetStatistics:
    """Return statistics whose figures can be told by hand."""
    nan = math.nan
    scans = [  # group, moving, range, points, spread
        (CAR, True, 20.0, 4, 0.1),
        (CAR, True, 20.0, 0, nan),
        (CAR, False, 20.0, 9, 5.0),
        (PEDESTRIAN, True, 10.0, 1, nan),
        (PEDESTRIAN, True, 10.0, 1, nan),
        (PEDESTRIAN, True, 10.0, 2, nan),
        (PEDESTRIAN, True, 10.0, 4, 0.6),
    ]
    points = [(CAR, True, 25.0, 30.0, 12.0)] * 10 + [(PEDESTRIAN, True, 25.0, 20.0, 5.0)] * 10
    points += [(CAR, True, 5.0, 30.0, 2.0)] * 10 + [(CAR, True, 85.0, 20.0, 18.0)] * 10
    objects = [  # scene, instance, semantic, group, moving, range, occlusion, pixels, lidar, radar
        (0, 1, semantic_id("Car"), CAR, True, 20.0, 0.1, 9, 5, 1),
        (0, 2, semantic_id("Car"), CAR, True, 49.0, 0.1, 9, 5, 0),
        (0, 3, semantic_id("Car"), CAR, True, 51.0, 0.1, 9, 5, 0),  # beyond the range of the class
        (0, 4, semantic_id("Pedestrian"), PEDESTRIAN, True, 39.0, 0.1, 9, 0, 0),
        (0, 5, semantic_id("Pedestrian"), PEDESTRIAN, True, 10.0, 0.1, 0, 0, 0),  # no sensor sees it
        (0, 6, semantic_id("Building"), -1, False, 10.0, 0.1, 9, 9, 0),
    ]
    scene = SceneFacts("<b>&", "train", "rain", 2)
    return DatasetStatistics(
        (scene,),
        np.array(objects, OBJECT_ROW),
        np.array(scans, SCAN_ROW),
        np.array(points, POINT_ROW),
        np.array([10, 30]),
        np.array([15, 25]),
        1e-6,
        0.5,
    )


def test_figures_beside_the_published_ones_are_those_told_by_hand() -> None:
    here = {item.published.quantity: item.here for item in compare(planted())}
    expected = {
        "points of an object in a scan, mean": 12 / 5,  # moving, with a point
        "pedestrian scans with one point": 50.0,
        "pedestrian scans with at most two": 75.0,
        "range of points, car, mean": (25.0 + 5.0 + 85.0) / 3,
        "range of points, pedestrian, mean": 25.0,
        "spread of radial velocity in an object, car": 0.1,
        "spread of radial velocity in an object, pedestrian": 0.6,
        "RCS, car over pedestrian and two-wheeler": 7.0,
        "rise of the median RCS of detections with range": 16.0,
        "radar points a keyframe, all radars, mean": 20.0,
        "radar points a scan, mean": 20.0,
        "boxes without a radar point": 200.0 / 3,
        "boxes without a lidar point": 100.0 / 3,
        "boxes without both": 100.0 / 3,
        "boxes without both, 20 to 30 m": 0.0,  # the first car; it is the only one there
        "boxes without both, 30 to 40 m": 100.0,  # the pedestrian
        "boxes without both, 40 to 50 m": 0.0,  # the second car has lidar points
        "share of labels, pedestrian": 40.0,
        "share of labels, two-wheeler": 0.0,
        "share of labels, car": 60.0,
    }
    for quantity, value in expected.items():
        assert here[quantity] == pytest.approx(value, rel=1e-5), quantity
    unknown = {quantity for quantity, value in here.items() if math.isnan(value)}
    assert here.keys() == expected.keys() | unknown
    assert unknown == {
        "boxes without both, 0 to 20 m",
        "range of points, large vehicle, mean",
        "range of points, two-wheeler, mean",
        "spread of radial velocity in an object, large vehicle",
        "spread of radial velocity in an object, two-wheeler",
        "RCS, large vehicle over car",
    }


@pytest.mark.parametrize("kind", ["radar", "lidar"])
def test_a_dataset_without_a_sensor_does_not_tell_what_it_misses(kind) -> None:
    blind = planted()
    blind.objects[f"{kind}_points"] = 0
    here = {item.published.quantity: item.here for item in compare(blind)}
    other = {"radar": "lidar", "lidar": "radar"}[kind]
    assert math.isnan(here[f"boxes without a {kind} point"]) and math.isnan(here["boxes without both, 30 to 40 m"])
    assert math.isnan(here["boxes without both"]) and not math.isnan(here[f"boxes without a {other} point"])


def test_published_figures_have_a_source_and_a_value() -> None:
    assert {figure.dataset for figure in FIGURES} == {"RadarScenes", "nuScenes", "View-of-Delft"}
    for figure in FIGURES:
        assert figure.source and figure.condition
        assert figure.value is not None or (figure.low is not None and figure.high is not None)


def test_means_over_classes_of_range() -> None:
    mean, count = by_range([1.0, 3.0, 5.0, 7.0], [0.0, 9.9, 10.0, 120.0])
    assert count.tolist() == [2, 1] + [0] * 8
    assert mean[:2].tolist() == [2.0, 5.0] and np.isnan(mean[2:]).all()


# -- page ------------------------------------------------------------------------------------------------------------


def _page(found: DatasetStatistics) -> str:
    from scarl_sionna.dataset.statistics.page import page

    return page(found)


def test_the_page_stands_alone_and_holds_every_figure(tmp_path) -> None:
    found = planted()
    text = found.save(tmp_path / "below" / "page.html").read_text(encoding="utf-8")
    assert text == _page(found)  # the same bytes each time
    tree = ET.fromstring(
        text.removeprefix("<!doctype html>\n")
        .replace('charset="utf-8">', 'charset="utf-8"/>')
        .replace('initial-scale=1">', 'initial-scale=1"/>')
    )
    words = " ".join(tree.itertext())
    for figure in FIGURES:
        assert figure.quantity in words
    assert "<b>&" in words  # escaped: a scene's name is no markup
    assert not re.search(r'(src|href)\s*=\s*"(?!#)', text)  # nothing is loaded from elsewhere
    assert "7.14" not in words and "66.7" in words  # boxes without a radar point


def test_a_page_that_cannot_be_written_is_said(tmp_path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="cannot write"):
        planted().save(tmp_path / "file" / "page.html")


def test_the_command_writes_the_page_of_a_split(tmp_path) -> None:
    place = _dataset_with_splits(tmp_path / "ds")
    done = CliRunner().invoke(app, ["stats", str(place), "--split", "val", "--out", str(tmp_path / "page.html")])
    assert done.exit_code == 0, done.output
    assert "3 in 1 scenes" in done.output and "val: 3" in done.output
    assert "lane" in (tmp_path / "page.html").read_text() and "street" not in (tmp_path / "page.html").read_text()
    wrong = CliRunner().invoke(app, ["stats", str(place), "--split", "vla"])
    assert wrong.exit_code == 2 and "did you mean 'val'" in wrong.output
    empty = CliRunner().invoke(app, ["stats", str(place), "--split", "test"])
    assert empty.exit_code == 2 and "a split with scenes" in empty.output


def _dataset_with_splits(place: Path) -> Path:
    write_dataset(place, SOURCE.rig, {scene.name: list(scene) for scene in SOURCE.scenes})
    manifest = json.loads((place / "manifest.json").read_text())
    manifest["scenes"]["lane"]["split"] = "val"
    manifest["splits"] = {"train": ["street"], "val": ["lane"], "test": []}
    del manifest["checksum"]  # as before there was one
    (place / "manifest.json").write_text(json.dumps(manifest))
    return place


def test_a_source_gives_one_split() -> None:
    source = replace(SOURCE, splits={"train": ["street"], "val": ["lane"], "test": []})
    assert [scene.name for scene in source.subset(splits=["val"]).scenes] == ["lane"]
    assert source.subset(splits=["val", "train"]).splits == {"train": ["street"], "val": ["lane"]}
    with pytest.raises(ParameterRangeError, match="a split with scenes"):
        source.subset(["street"], splits=["val"])
    with pytest.raises(UnknownNameError):
        source.subset(splits=["all"])
