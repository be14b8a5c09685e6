"""nuScenes: nuscenes-devkit itself opens, links, projects and renders what we write."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from scarl_sionna.core.boxes import CORNERS
from scarl_sionna.core.errors import OutputError, ParameterRangeError
from scarl_sionna.core.pose import CAMERA_OPTICAL_FROM_SENSOR, Pose, Twist
from scarl_sionna.core.results import LidarScan, ObjectState, RadarFrame
from scarl_sionna.core.semantics import semantic_id
from scarl_sionna.dataset.derived.boxes import visible_fraction
from scarl_sionna.dataset.derived.radar_points import radar_points, sensed_points
from scarl_sionna.dataset.formats.nuscenes import export_nuscenes
from scarl_sionna.dataset.formats.nuscenes_parts.files import deviation_code, tone_deviation
from scarl_sionna.dataset.formats.nuscenes_parts.tables import (
    ATTRIBUTES,
    CATEGORIES,
    LIDARSEG_LABEL,
    TABLES,
    attribute_tokens,
    category_of,
    has_boxes,
    lidarseg_labels,
    models_of,
    token,
    visibility_token,
)
from scarl_sionna.dataset.formats.output import FILES, MARK
from scarl_sionna.dataset.formats.source import FrameSource, SceneFrames
from scarl_sionna.radar.points import point_targets
from scarl_sionna.radar.synthesis import synthesize
from scarl_sionna.signal.converter import quantize
from tests.client_env import client_python, run_client
from tests.drive import RADAR, _image, drive

SOURCE = drive(num_frames=3, scenes=("street", "lane"))


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> Path:
    calls: list[tuple[int, int]] = []
    out = tmp_path_factory.mktemp("nuscenes") / "out"
    export_nuscenes(SOURCE, out, on_progress=lambda done, total: calls.append((done, total)))
    assert calls == [(k, 6) for k in range(1, 7)]
    return out


@pytest.fixture(scope="module")
def devkit(exported: Path, tmp_path_factory: pytest.TempPathFactory, pytestconfig: pytest.Config) -> tuple[dict, Path]:
    python = client_python("nuscenes", pytestconfig)
    pictures = tmp_path_factory.mktemp("pictures")
    run_client(python, "nuscenes_client.py", exported, "v1.0-mini", pictures)
    return json.loads((pictures / "result.json").read_text()), pictures


def table(folder: Path, name: str) -> list[dict]:
    return json.loads((folder / "v1.0-mini" / f"{name}.json").read_text())


def test_the_devkit_finds_all_tables_and_follows_all_links(devkit) -> None:
    found = devkit[0]["tables"]
    assert set(TABLES) <= set(found)
    assert (found["scene"], found["sample"], found["sample_data"], found["lidarseg"]) == (2, 6, 6 * 5, 6)
    assert list(devkit[0]["chains"].values()) == [3, 3]
    assert devkit[0]["instances"]
    assert all(walked == stated for walked, stated in devkit[0]["instances"].values())


def test_the_devkit_projects_our_boxes_to_our_pixels(devkit) -> None:
    """Corners that the devkit computes, through its tables and quaternions, are those of our own projection."""
    compared = 0
    for sample, frame in zip(devkit[0]["samples"], (f for scene in SOURCE.scenes for f in scene), strict=True):
        for end, channel in (("front", "CAM_FRONT"), ("back", "CAM_BACK")):
            image = frame.images[f"{end}_center/camera"]
            for item in frame.objects[1:]:
                sensor = image.world_from_sensor.inverse().apply(item.world_from_box.apply(CORNERS * item.size))
                pixel, depth = image.spec.project(sensor @ CAMERA_OPTICAL_FROM_SENSOR.T)
                if depth.min() < 0.1:
                    continue
                pixel -= 0.5  # nuScenes counts from the first pixel's centre
                for theirs in sample["data"][channel]["boxes"].values():
                    gap = np.linalg.norm(np.array(theirs)[:, None] - pixel[None], axis=-1)
                    if gap.min(axis=0).max() < 1.0:
                        # one to one; 1e-5 px: their quaternions and ours are float64
                        assert sorted(gap.argmin(axis=1)) == list(range(8))
                        assert gap.min(axis=0).max() < 1e-5
                        compared += 1
    assert compared == 12  # car and pedestrian ahead in 6 frames


def test_boxes_enclose_the_pixels_of_their_instance(devkit) -> None:
    samples = devkit[0]["samples"]
    frame = SOURCE.scenes[0].frames[0]
    labels = frame.images["front_center/camera"].instance
    shapes = [np.array(box) for box in samples[0]["data"]["CAM_FRONT"]["boxes"].values()]
    assert len(shapes) == 2
    for instance in (2, 3):
        line, column = np.nonzero(labels == instance)
        # a box's outline is at most a pixel larger than the pixels whose centres it covers, where nothing hides it
        fits = [
            s[:, 0].min() - 1 <= column.min() and column.max() <= s[:, 0].max() + 1 and line.max() <= s[:, 1].max() + 1
            for s in shapes
        ]
        assert any(fits)


def test_lidar_points_counts_and_place(devkit) -> None:
    for sample, frame in zip(devkit[0]["samples"][:3], SOURCE.scenes[0], strict=True):
        entry = sample["data"]["LIDAR_TOP"]
        scans: list[LidarScan] = list(frame.lidars.values())
        assert entry["points"] == sum(scan.num_points for scan in scans)
        assert entry["low"][3] >= 0 and entry["high"][3] <= 255
        world = np.concatenate([s.world_from_sensor.apply(s.position) for s in scans])
        offset = world.mean(axis=0) - entry["global"]
        assert np.allclose(offset[:2], np.rint(offset[:2]), atol=1e-4)  # the map's origin is in whole metres
        assert abs(offset[2]) < 1e-4
        for box in sample["boxes"]:
            # they count to the faces, we 1 cm beyond, so that rounding does not take the returns that lie on a face
            assert entry["inside"].get(box["token"], 0) <= box["num_lidar_pts"]
        labelled = {item.semantic: item.num_lidar_points for item in frame.objects[1:3]}
        counted = {box["category"]: box["num_lidar_pts"] for box in sample["boxes"]}
        for name, category in (("Car", "vehicle.car"), ("Pedestrian", "human.pedestrian.adult")):
            # a return of the ground within 1 cm of the box's lower face counts as well
            assert 0 <= counted[category] - labelled[semantic_id(name)] <= 3


def test_radar_points_are_our_detections(devkit) -> None:
    frame = SOURCE.scenes[0].frames[0]
    radar = frame.radars["front_center/radar"]
    sensed = sensed_points(frame, radar)
    entry = devkit[0]["samples"][0]["data"]["RADAR_FRONT"]
    rows = np.array(entry["rows"])
    assert entry["points"] == entry["unfiltered"] == sensed.points.num_points >= 2
    assert rows.shape[1] == 18
    np.testing.assert_allclose(rows[:, :3], sensed.points.position, rtol=1e-6)
    np.testing.assert_allclose(rows[:, 5], 10 * np.log10(sensed.points.rcs), rtol=1e-5)
    for item in frame.objects[1:3]:  # the compensated velocity is the object's own, along the ray
        place = radar.world_from_sensor.inverse().apply(item.world_from_box.position)
        nearest = int(np.linalg.norm(rows[:, :3] - place, axis=1).argmin())
        ray = place / np.linalg.norm(place)
        expected = radar.world_from_sensor.inverse().rotate(item.twist.linear) @ ray
        found = rows[nearest, 8] * ray[0] + rows[nearest, 9] * ray[1]
        assert found == pytest.approx(expected, abs=0.5 * RADAR.velocity_resolution)


def test_labels_say_who_is_hidden_and_who_moves(devkit) -> None:
    sample = devkit[0]["samples"][0]
    by_category = {box["category"]: box for box in sample["boxes"]}
    assert set(by_category) == {"vehicle.car", "human.pedestrian.adult"}  # not the house, not the vehicle itself
    assert by_category["vehicle.car"]["visibility"] == "v80-100"
    assert by_category["human.pedestrian.adult"]["visibility"] == "v40-60"  # half behind the car
    assert by_category["vehicle.car"]["attributes"] == ["vehicle.moving"]
    # central difference over frames of 100 ms of what moves straight: exact but for timestamps in microseconds
    middle = {box["category"]: box for box in devkit[0]["samples"][1]["boxes"]}
    np.testing.assert_allclose(middle["vehicle.car"]["velocity"][:2], (6.0, 4.0), rtol=1e-4)


def test_pictures_are_drawn(devkit) -> None:
    names = {path.name for path in devkit[1].glob("*.png")}
    assert {"CAM_FRONT.png", "CAM_BACK.png", "LIDAR_TOP.png", "RADAR_FRONT.png", "lidarseg.png"} <= names
    with Image.open(devkit[1] / "CAM_FRONT.png") as image:
        pixels = np.array(image.convert("RGB")).astype(int)
    orange = np.abs(pixels - (255, 158, 0)).max(axis=-1) < 30  # the devkit's colour of a car
    assert np.count_nonzero(orange) > 500


# -- without the devkit ----------------------------------------------------------------------------------------------


def test_files_are_of_the_documented_form(exported) -> None:
    record = next(r for r in table(exported, "sample_data") if "LIDAR_TOP" in r["filename"])
    points = np.fromfile(exported / record["filename"], np.float32).reshape(-1, 5)
    labels = np.fromfile(exported / "lidarseg" / "v1.0-mini" / f"{record['token']}_lidarseg.bin", np.uint8)
    assert len(points) == len(labels)
    assert labels.max() < len(CATEGORIES)
    assert set(points[:, 4]) <= set(range(32))
    assert (
        points[np.argsort(points[:, 2])[-1], 4] > points[np.argsort(points[:, 2])[0], 4]
    )  # higher line, higher number
    radar = next(r for r in table(exported, "sample_data") if "RADAR" in r["filename"])
    data = (exported / radar["filename"]).read_bytes()
    header, _, body = data.partition(b"DATA binary\n")
    width = int(header.split(b"WIDTH ")[1].split()[0])
    assert len(header.split(b"FIELDS ")[1].split(b"\n")[0].split()) == 18
    assert len(body) == width * 43 + 1


def test_raw_radar_is_kept_bit_for_bit(exported) -> None:
    rows = table(exported, "scarl_radar")
    by_token = {r["token"]: r for r in table(exported, "sample_data")}
    frame = SOURCE.scenes[0].frames[0]
    row = next(
        r for r in rows if r["sensor"] == "front_center/radar" and by_token[r["sample_data_token"]]["timestamp"] == 0
    )
    radar = frame.radars["front_center/radar"]
    assert np.array_equal(np.load(exported / row["filename"]), radar.adc_int)
    assert row["scale"] == radar.adc_scale


def test_the_map_shows_road_where_the_lidar_saw_it(exported) -> None:
    mask = np.array(Image.open(exported / table(exported, "map")[0]["filename"]))
    assert set(np.unique(mask)) == {0, 255}
    origin = np.array(table(exported, "scene")[0]["scarl_world_from_map"])
    scan = SOURCE.scenes[0].frames[0].lidars["front_center/lidar"]
    road = scan.world_from_sensor.apply(scan.position[scan.instance == 60_000]) - origin
    inside = np.all((road[:, :2] >= 0) & (road[:, :2] < np.array(mask.shape)[::-1] / 10 - 0.1), axis=1)
    column, line = (
        np.floor(road[inside, 0] * 10).astype(int),
        mask.shape[0] - 1 - np.floor(road[inside, 1] * 10).astype(int),
    )
    assert inside.sum() > 100
    assert (mask[line, column] == 255).all()
    poses = np.array([p["translation"] for p in table(exported, "ego_pose")])
    assert (poses[:, :2] >= 100).all()  # room for the devkit's drawings on all sides


def test_frames_between_keyframes_are_sweeps(tmp_path) -> None:
    export_nuscenes(drive(num_frames=4, ends=("front",)), tmp_path / "out", keyframe_every=3, raw_radar=False)
    records = table(tmp_path / "out", "sample_data")
    assert [r["is_key_frame"] for r in records if "LIDAR" in r["filename"]] == [True, False, False, True]
    assert all(r["filename"].startswith("samples" if r["is_key_frame"] else "sweeps") for r in records)
    samples = table(tmp_path / "out", "sample")
    assert [samples.index(next(s for s in samples if s["token"] == r["sample_token"])) for r in records[:4]] == [
        0,
        0,
        1,
        1,
    ]
    assert len(table(tmp_path / "out", "lidarseg")) == 2
    assert not (tmp_path / "out" / "scarl_radar").exists()


def test_a_source_without_lidar_or_radar_is_written(tmp_path) -> None:
    full = drive(num_frames=1, ends=("front",))
    frame = full.scenes[0].frames[0]
    for keep, channels in (("camera", ["CAM_FRONT"]), ("radar", ["RADAR_FRONT"])):
        results = {name: r for name, r in frame.results.items() if name.endswith(keep)}
        part = FrameSource(full.rig, [SceneFrames("one", [type(frame)(**{**vars(frame), "results": results})])])
        export_nuscenes(part, tmp_path / keep)
        assert [s["channel"] for s in table(tmp_path / keep, "sensor")] == channels
        assert not (tmp_path / keep / "v1.0-mini" / "lidarseg.json").exists()


def test_two_cameras_of_one_suite_do_not_share_a_channel(tmp_path) -> None:
    full = drive(num_frames=1, ends=("front",))
    frame = full.scenes[0].frames[0]
    mount = next(m for m in full.rig["sensors"] if m["kind"] == "camera")
    names = ("front_center/wide", "front_center/narrow", "roof-rack/camera")
    rig = {"name": "three", "sensors": [{**mount, "name": name} for name in names]}
    same = type(frame)(**{**vars(frame), "results": dict.fromkeys(names, frame.results["front_center/camera"])})
    export_nuscenes(FrameSource(rig, [SceneFrames("one", [same])]), tmp_path / "out")
    channels = [s["channel"] for s in table(tmp_path / "out", "sensor")]
    assert channels == ["CAM_FRONT", "CAM_FRONT_CENTER_NARROW", "CAM_ROOF_RACK_CAMERA"]
    assert len({r["filename"] for r in table(tmp_path / "out", "sample_data")}) == 3


def test_scene_names_stay_inside_the_folder() -> None:
    for name in ("", "..", "a/b", "a\\b"):
        with pytest.raises(ParameterRangeError, match="scene name"):
            SceneFrames(name, [])


def test_only_an_export_is_overwritten(tmp_path) -> None:
    source = drive(num_frames=1, ends=("front",))
    out = tmp_path / "out"
    export_nuscenes(source, out)
    with pytest.raises(OutputError, match="--overwrite"):
        export_nuscenes(source, out)
    written = {path.relative_to(out) for path in out.rglob("*")}
    for name in ("notes.txt", "samples/CAM_FRONT/mine.jpg", ".git/config"):
        (out / name).parent.mkdir(exist_ok=True)
        (out / name).write_text("mine")
        with pytest.raises(OutputError, match=rf"holds files that no exporter wrote \({name}\) and is kept"):
            export_nuscenes(source, out, overwrite=True)
        assert (out / name).read_text() == "mine"
        (out / name).unlink()
    export_nuscenes(source, out, overwrite=True)
    assert {path.relative_to(out) for path in out.rglob("*")} == written
    names = (out / FILES).read_bytes()
    (out / FILES).write_bytes(names[:-9])
    with pytest.raises(OutputError, match="does not tell which of its files an exporter wrote"):
        export_nuscenes(source, out, overwrite=True)
    (out / FILES).write_bytes(names)
    (out / MARK).unlink()
    with pytest.raises(OutputError, match="was not written by an exporter"):
        export_nuscenes(source, out, overwrite=True)
    assert (out / "v1.0-mini").is_dir()
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_a_frame_that_fails_leaves_nothing(tmp_path) -> None:
    good = drive(num_frames=1, ends=("front",)).scenes[0].frames[0]

    class Broken(list):
        def __getitem__(self, index):
            if index == 1:
                raise OSError(28, "No space left on device")
            return super().__getitem__(index)

    source = FrameSource(drive(ends=("front",)).rig, [SceneFrames("one", Broken([good, good]))])
    with pytest.raises(OutputError, match="free some space"):
        export_nuscenes(source, tmp_path / "out")
    assert not list(tmp_path.iterdir())


def test_bad_parameters(tmp_path) -> None:
    for options in ({"keyframe_every": 0}, {"image_format": "gif"}, {"version": "../up"}, {"version": "samples"}):
        with pytest.raises(ParameterRangeError):
            export_nuscenes(SOURCE, tmp_path / "out", **options)
    with pytest.raises(ParameterRangeError, match="no frames"):
        export_nuscenes(FrameSource(SOURCE.rig, []), tmp_path / "out")
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError):
        export_nuscenes(SOURCE, tmp_path / "file" / "out")


def test_visible_part_of_a_box_is_the_visible_part_of_its_pixels() -> None:
    frame = SOURCE.scenes[0].frames[0]
    image = frame.images["front_center/camera"]
    seen = np.count_nonzero(image.instance == 3)
    free = _image(image.spec, image.world_from_sensor, [frame.objects[2]])
    alone = np.count_nonzero(free.instance == 3)
    assert 0 < seen < alone
    # the outline of some 5 x 7 pixels: half a pixel on the hidden side
    assert visible_fraction(frame.objects[2], image) == pytest.approx(seen / alone, abs=0.1)
    assert visible_fraction(frame.objects[2], free) == 1.0
    assert visible_fraction(frame.objects[3], image) == 0.0  # behind the camera


@pytest.mark.parametrize(("num_chirps", "num_samples"), [(8, 16), (3, 64), (64, 3)])
def test_a_radar_with_a_small_map_is_detected_in(num_chirps, num_samples) -> None:
    spec = RADAR.with_(num_chirps=num_chirps, num_samples=num_samples)
    paths = point_targets([[spec.max_range / 3, 0.0, 0.0]], [[0.0, 0.0, 0.0]], 10.0, spec, Pose())
    codes, scale, _ = quantize(synthesize(paths, spec), spec)
    points = radar_points(RadarFrame(spec, Pose(), codes, scale), pfa=1e-2)
    assert points.num_points <= num_chirps * num_samples
    if min(num_chirps, num_samples) >= 8:
        assert abs(points.range[0] - spec.max_range / 3) < spec.range_resolution


def test_codes() -> None:
    assert deviation_code([0.001, 0.005, 10.0, 50.0]).tolist() == [0, 0, 30, 31]
    assert 0.1 / 1.289 < 0.005 * 2000 ** (int(deviation_code([0.1])[0]) / 30) / 1.289 <= 0.1 * 1.0001
    # Rife and Boorstyn: 6 / (4 pi^2 N (N^2 - 1) snr / N^2) -> 6 / (4 pi^2 snr_integrated) bins^2
    assert tone_deviation(100.0) == pytest.approx(np.sqrt(6 / 100) / (2 * np.pi))
    assert [visibility_token(v) for v in (0.0, 0.4, 0.41, 0.6, 0.7, 0.9, 1.0)] == ["1", "1", "2", "2", "3", "4", "4"]
    assert LIDARSEG_LABEL.dtype == np.uint8


def test_a_child_is_no_adult_among_boxes_and_points() -> None:
    """Only what is a person: a low car stays a car."""
    lidar = semantic_id("Pedestrian"), semantic_id("Pedestrian"), semantic_id("Car")
    items = [
        ObjectState(name, number, semantic, Pose(), np.array([0.6, 0.6, height]), Twist(), True)
        for number, (name, semantic, height) in enumerate(
            zip(("child", "adult", "car"), lidar, (1.26, 1.64, 1.3), strict=True), start=1
        )
    ]
    names = [category_of(item) for item in items]
    assert names == ["human.pedestrian.child", "human.pedestrian.adult", "vehicle.car"]
    labels = lidarseg_labels(np.array(lidar, np.uint8), np.array([1, 2, 3], np.uint16), items)
    assert [CATEGORIES[label] for label in labels] == names


def person(name: str, kind: str, height: float, number: int = 1) -> ObjectState:
    return ObjectState(name, number, semantic_id(kind), Pose(), np.array([1.0, 0.6, height]), Twist(), True)


def test_people_are_what_their_models_say() -> None:
    """By the model that the scenario states, or that traffic's names hold; sizes would say child, cart and bicycle."""
    models = models_of({"actors": [{"name": "aunt", "model": "wheelchair"}, {"name": "rex", "model": "dog"}]})
    assert models == {"aunt": "wheelchair", "rex": "dog"} and models_of({"scene": "street"}) == {}
    people = [
        (person("aunt", "Pedestrian", 1.41), "human.pedestrian.wheelchair"),
        (person("traffic_sitting_man_0", "Pedestrian", 1.38), "human.pedestrian.adult"),
        (person("traffic_boy_10_2", "Pedestrian", 1.42), "human.pedestrian.child"),
        (person("traffic_woman_82_0", "Pedestrian", 1.57), "human.pedestrian.adult"),
        (person("pram", "Dynamic", 1.06), "human.pedestrian.stroller"),
        (person("rex", "Dynamic", 0.82), "animal"),
        (person("traffic_scooter_11", "Bicycle", 1.79), "human.pedestrian.personal_mobility"),
        (person("traffic_bicycle_0", "Bicycle", 1.71), "vehicle.bicycle"),
        (person("cart", "Dynamic", 1.0), "movable_object.pushable_pullable"),
        (person("dog", "Car", 1.5), "vehicle.car"),
    ]
    for item, category in people:
        assert category_of(item, models) == category and has_boxes(category), item.name
        label = lidarseg_labels(np.array([item.semantic], np.uint8), np.array([1], np.uint16), [item], models)
        assert CATEGORIES[label[0]] == category


def test_attributes_say_who_sits_and_who_rides() -> None:
    """A cyclist who waits at the lights is still on the bicycle."""
    rows = [
        ("vehicle.bicycle", person("a", "Bicycle", 1.71), 0.0, "cycle.with_rider"),
        ("vehicle.motorcycle", person("a", "Motorcycle", 1.1), 0.0, "cycle.without_rider"),
        ("human.pedestrian.wheelchair", person("wheelchair", "Pedestrian", 1.41), 1.0, "pedestrian.sitting_lying_down"),
        ("human.pedestrian.adult", person("man_66", "Pedestrian", 1.7), 1.0, "pedestrian.moving"),
        ("human.pedestrian.adult", person("man_66", "Pedestrian", 1.7), 0.0, "pedestrian.standing"),
        ("vehicle.car", person("a", "Car", 1.5), 0.0, "vehicle.stopped"),
    ]
    for category, item, speed, name in rows:
        assert attribute_tokens(category, item, speed) == [token("attribute", name)], name
    assert attribute_tokens("animal", person("dog", "Dynamic", 0.8), 1.0) == []
    assert len(ATTRIBUTES) == 8  # those of nuScenes
