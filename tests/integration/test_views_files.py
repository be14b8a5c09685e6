"""HDF5, MCAP and Rerun files: read back with the packages of others, number by number."""

from __future__ import annotations

import base64
import io
import json
import os
import subprocess
import sys
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from scarl_sionna.core.errors import DatasetError, MissingPackageError, OutputError, ParameterRangeError
from scarl_sionna.core.results import ImageFrame, LidarScan
from scarl_sionna.core.specs.camera import CameraSpec
from scarl_sionna.dataset import open_dataset, write_dataset
from scarl_sionna.dataset.derived.boxes import points_inside
from scarl_sionna.dataset.derived.lidar_points import world_points
from scarl_sionna.dataset.derived.radar_points import sensed_points
from scarl_sionna.dataset.formats import FORMATS, FrameSource, SceneFrames, as_source, convert
from scarl_sionna.dataset.formats.hdf5 import export_hdf5
from scarl_sionna.dataset.formats.mcap import export_mcap
from scarl_sionna.dataset.formats.mcap_schemas import SCHEMAS
from tests.client_env import REPO, client_python, run_client
from tests.drive import AllFrames, drive

SOURCE = drive(num_frames=3, ends=("front",), scenes=("lane", "street"))
FRAMES = AllFrames(SOURCE)
RADAR, CAMERA, LIDAR = "front_center/radar", "front_center/camera", "front_center/lidar"


# -- HDF5 ------------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def hdf5(tmp_path_factory: pytest.TempPathFactory):
    h5py = pytest.importorskip("h5py")
    path = tmp_path_factory.mktemp("hdf5") / "drive.h5"
    calls: list[tuple[int, int]] = []
    assert export_hdf5(SOURCE, path, on_progress=lambda *state: calls.append(state)) == path
    assert calls == [(k, 6) for k in range(1, 7)]
    with h5py.File(path) as file:
        yield file


def test_hdf5_holds_every_field_of_every_result(hdf5) -> None:
    for scene in SOURCE.scenes:
        group = hdf5[scene.name]
        for index, frame in enumerate(scene):
            for name, result in frame.results.items():
                for item in fields(result):
                    value = getattr(result, item.name)
                    if item.name in ("spec", "diagnostics") or value is None:
                        continue
                    stored = group[f"{name}/{'adc' if item.name == 'adc_int' else item.name}"]
                    if item.name == "world_from_sensor":
                        value = np.concatenate([value.position, value.quaternion])
                    if isinstance(result, LidarScan) and item.name != "world_from_sensor":
                        start, stop = group[f"{name}/offsets"][index : index + 2]
                        found = stored[start:stop]
                    else:
                        found = stored[index]
                    assert found.dtype == np.asarray(value).dtype, item.name
                    np.testing.assert_array_equal(found, value)
            assert json.loads(group[f"{RADAR}/diagnostics"][index])["method"] == "points"


def test_hdf5_labels_times_axes_and_units(hdf5) -> None:
    group = hdf5["street"]
    frame = SOURCE.scenes[1].frames[2]
    start, stop = group["objects/offsets"][2:4]
    assert group["objects/name"].asstr()[start:stop].tolist() == [item.name for item in frame.objects]
    np.testing.assert_array_equal(group["objects/size"][start:stop], [item.size for item in frame.objects])
    np.testing.assert_array_equal(
        group["objects/world_from_box"][start + 1, :3], frame.objects[1].world_from_box.position
    )
    assert group["timestamp_ns"][:].tolist() == [0, 10**8, 2 * 10**8]
    adc = group[f"{RADAR}/adc"]
    assert [d.label for d in adc.dims] == ["frame", "receiver", "chirp", "sample", "iq"]
    np.testing.assert_allclose(adc.dims[0][0][:], [0.0, 0.1, 0.2])  # the dimension scale
    assert group[f"{LIDAR}/position"].attrs["units"] == "m"
    cameras = [name for name, result in frame.results.items() if getattr(result, "depth", None) is not None]
    assert cameras
    for name in cameras:  # decoded, not the code of a dataset
        assert group[f"{name}/depth"].attrs["units"] == "m" and "code" not in group[f"{name}/depth"].attrs["long_name"]
    assert json.loads(hdf5.attrs["rig"]) == json.loads(json.dumps(SOURCE.rig))
    assert hdf5.attrs["semantic_classes"][14] == "Car"
    assert adc.chunks[0] == 1  # a frame is read alone


def test_hdf5_has_offsets_of_objects_beside_those_of_returns(tmp_path) -> None:
    """Frames of 4, 2 and 3 objects: what a lidar and a camera have for each of them is read back by its own offsets."""
    h5py = pytest.importorskip("h5py")
    frames = []
    for index, count in enumerate((4, 2, 3)):
        points, pixels = np.arange(count, dtype=np.int32) + 10 * index, np.arange(count, dtype=np.int32) + 100 * index
        results = dict(FRAMES[index].results)
        results[LIDAR] = replace(results[LIDAR], object_points=points)
        results[CAMERA] = replace(results[CAMERA], object_pixels=pixels)
        frames.append(replace(FRAMES[index], objects=FRAMES[index].objects[:count], results=results))
    export_hdf5(FrameSource(SOURCE.rig, [SceneFrames("x", frames)]), tmp_path / "x.h5")
    with h5py.File(tmp_path / "x.h5") as file:
        assert file.attrs["format_version"] == 2
        lidar, camera = file[f"x/{LIDAR}"], file[f"x/{CAMERA}"]
        assert lidar["object_points"].attrs["offsets"] == camera["object_pixels"].attrs["offsets"] == "object_offsets"
        assert lidar["position"].attrs["offsets"] == "offsets" and "offsets" not in camera
        assert [dimension.label for dimension in camera["rgb"].dims][0] == "frame" and len(camera["rgb"].dims[0]) == 1
        assert file["x/objects/offsets"][:].tolist() == [0, 4, 6, 9]
        for index, frame in enumerate(frames):
            start, stop = lidar["object_offsets"][index : index + 2]
            np.testing.assert_array_equal(lidar["object_points"][start:stop], frame.results[LIDAR].object_points)
            start, stop = camera["object_offsets"][index : index + 2]
            np.testing.assert_array_equal(camera["object_pixels"][start:stop], frame.results[CAMERA].object_pixels)
            start, stop = lidar["offsets"][index : index + 2]
            np.testing.assert_array_equal(lidar["position"][start:stop], frame.results[LIDAR].position)


def test_hdf5_says_what_a_frame_lacks_and_leaves_nothing(tmp_path) -> None:
    pytest.importorskip("h5py")
    less = replace(FRAMES[1], results={name: r for name, r in FRAMES[1].results.items() if name != LIDAR})
    source = FrameSource(SOURCE.rig, [SceneFrames("x", [FRAMES[0], less])])
    with pytest.raises(DatasetError, match=r"frame 1 of x lacks front_center/lidar"):
        export_hdf5(source, tmp_path / "x.h5")
    assert not list(tmp_path.iterdir())
    with pytest.raises(ParameterRangeError, match="compression"):
        export_hdf5(SOURCE, tmp_path / "x.h5", compression="zip")


# -- MCAP ------------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> list[tuple[str, str, int, dict]]:
    reader = pytest.importorskip("mcap.reader")
    path = tmp_path_factory.mktemp("mcap") / "drive.mcap"
    export_mcap(SOURCE, path, raw_radar=True)
    with path.open("rb") as file:
        messages = reader.make_reader(file).iter_messages()
        return [(c.topic, s.name, m.log_time, json.loads(m.data)) for s, c, m in messages]


def of_topic(recording, topic: str) -> list[dict]:
    return [content for name, _, _, content in recording if name == topic]


def cloud(content: dict) -> np.ndarray:
    """Return the rows of a point cloud by its own description."""
    types = {1: "u1", 3: "<u2", 7: "<f4"}
    names, kinds, offsets = zip(*((f["name"], types[f["type"]], f["offset"]) for f in content["fields"]), strict=True)
    kind = np.dtype({"names": names, "formats": kinds, "offsets": offsets, "itemsize": content["point_stride"]})
    return np.frombuffer(base64.b64decode(content["data"]), kind)


def test_mcap_messages_follow_their_schemas_and_the_clock_goes_on(recording) -> None:
    assert len(recording) == 6 * 11
    times = [time for _, _, time, _ in recording]
    assert times == sorted(times) and len(set(times)) == 6  # the second scene comes after the first
    for _, name, _, content in recording:
        check_schema(content, SCHEMAS[name], name)


def check_schema(value, schema: dict, where: str) -> None:
    """Assert that a value has all properties of a JSON schema, of the right types, and no other."""
    kinds = {"object": dict, "array": list, "string": str, "number": (int, float), "integer": int, "boolean": bool}
    assert isinstance(value, kinds[schema["type"]]), where
    if "properties" in schema:
        assert set(value) == set(schema["properties"]), where
        for key, part in schema["properties"].items():
            check_schema(value[key], part, f"{where}.{key}")
    if "items" in schema:
        for part in value:
            check_schema(part, schema["items"], f"{where}[]")


def test_mcap_points_boxes_and_images(recording) -> None:
    for index, frame in enumerate(FRAMES):
        scan = frame.results[LIDAR]
        points = cloud(of_topic(recording, f"/{LIDAR}/points")[index])
        np.testing.assert_allclose(np.stack([points[a] for a in "xyz"], axis=1), scan.position, atol=1e-5)
        np.testing.assert_array_equal(points["instance"], scan.instance)
        sensed = sensed_points(frame, frame.results[RADAR])
        echoes = cloud(of_topic(recording, f"/{RADAR}/detections")[index])
        np.testing.assert_allclose(echoes["x"], sensed.points.position[:, 0], rtol=1e-6)
        np.testing.assert_allclose(echoes["rcs_dbsm"], 10 * np.log10(sensed.points.rcs), rtol=1e-5)
        boxes = of_topic(recording, "/objects")[index]["entities"]
        assert [box["id"] for box in boxes] == [item.name for item in frame.objects[1:]]
        assert boxes[0]["cubes"][0]["size"]["x"] == frame.objects[1].size[0]
        assert boxes[0]["cubes"][0]["pose"]["position"]["y"] == frame.objects[1].world_from_box.position[1]
        image = of_topic(recording, f"/{CAMERA}/semantic")[index]
        with Image.open(io.BytesIO(base64.b64decode(image["data"]))) as png:
            assert png.size == (160, 90)
        raw = of_topic(recording, f"/{RADAR}/adc")[index]
        adc = np.frombuffer(base64.b64decode(raw["data"]), "<i2").reshape(raw["shape"])
        np.testing.assert_array_equal(adc, frame.results[RADAR].adc_int)
    assert of_topic(recording, "/scene")[4] == {**of_topic(recording, "/scene")[4], "scene": "street", "frame": 1}


def test_mcap_boxes_do_not_stay_when_their_objects_are_gone(recording) -> None:
    """Each message takes away all boxes with earlier timestamps, those of the scene before, too."""
    for content in of_topic(recording, "/objects"):
        (gone,) = content["deletions"]
        assert gone["type"] == 1 and all(box["timestamp"] == gone["timestamp"] for box in content["entities"])


def test_mcap_transforms_lead_from_the_world_to_every_message(recording) -> None:
    transforms = of_topic(recording, "/tf")[0]["transforms"]
    parents = {t["child_frame_id"]: t["parent_frame_id"] for t in transforms}
    used = {
        content["frame_id"]
        for _, name, _, content in recording
        if "frame_id" in content and "range_doppler" not in name
    }
    for frame_id in used - {f"{RADAR}/map"}:
        while frame_id != "world":
            frame_id = parents[frame_id]
    calibration = of_topic(recording, f"/{CAMERA}/calibration")[0]
    assert calibration["K"][2] == 79.5  # middle of 160 columns, counted from the first pixel's centre
    assert calibration["distortion_model"] == ""


# -- Rerun -----------------------------------------------------------------------------------------------------------


def test_rerun_file_holds_all_frames(tmp_path, pytestconfig) -> None:
    """In an environment of its own: the recording is written, then read with Rerun's own data frames."""
    python = client_python("rerun", pytestconfig)
    found = json.loads(run_client(python, "rerun_client.py", REPO, tmp_path / "x.rrd").splitlines()[-1])
    assert found["frames"] == [0, 1]
    assert found["lidar_rows"] == [f.results[LIDAR].num_points for f in drive(2, ends=("front",)).scenes[0]]
    assert {"/street/objects", f"/street/vehicle/{LIDAR}/points", f"/street/maps/{RADAR}"} <= set(found["entities"])
    assert found["center"] == pytest.approx(FRAMES[0].objects[1].world_from_box.position.tolist())


def test_rerun_missing_names_the_extra(tmp_path, monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "rerun", None)
    with pytest.raises(MissingPackageError, match=r"scarl-sionna\[viewer\]"):
        convert(SOURCE, "rerun", tmp_path / "x.rrd")
    assert not list(tmp_path.iterdir())


# -- all exporters ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("form", "module", "extra"), [("hdf5", "h5py", "hdf5"), ("mcap", "mcap", "mcap")])
def test_a_missing_package_names_its_extra(tmp_path, monkeypatch, form, module, extra) -> None:
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(MissingPackageError, match=rf"scarl-sionna\[{extra}\]"):
        convert(SOURCE, form, tmp_path / "x")


@pytest.mark.parametrize("form", [name for name, item in FORMATS.items() if not item.is_folder and name != "rerun"])
def test_files_are_whole_or_not_there(tmp_path, form) -> None:
    class Broken(list):
        def __getitem__(self, index):
            if index == 1:
                raise KeyboardInterrupt
            return super().__getitem__(index)

    broken = FrameSource(SOURCE.rig, [SceneFrames("x", Broken(FRAMES[:2]))])
    with pytest.raises(KeyboardInterrupt):
        convert(broken, form, tmp_path / "x")
    assert not list(tmp_path.iterdir())
    convert(SOURCE.subset(["lane"], 1), form, tmp_path / "x")
    before = (tmp_path / "x").read_bytes()
    with pytest.raises(OutputError, match="--overwrite"):
        convert(SOURCE, form, tmp_path / "x")
    with pytest.raises(KeyboardInterrupt):
        convert(broken, form, tmp_path / "x", overwrite=True)
    assert (tmp_path / "x").read_bytes() == before  # the old one stays until the new one is whole
    convert(SOURCE.subset(["lane"]), form, tmp_path / "x", overwrite=True)
    assert (tmp_path / "x").read_bytes() != before
    assert [path.name for path in tmp_path.iterdir()] == ["x"]
    for text in (b"a thesis", b"", (tmp_path / "x").read_bytes()[:8]):
        (tmp_path / "thesis").write_bytes(text)
        with pytest.raises(OutputError, match="was not written by this exporter and is kept"):
            convert(SOURCE, form, tmp_path / "thesis", overwrite=True)
        assert (tmp_path / "thesis").read_bytes() == text
    (tmp_path / "folder").mkdir()
    with pytest.raises(OutputError, match="is a folder"):
        convert(SOURCE, form, tmp_path / "folder", overwrite=True)


KILLED = """
import os, signal, sys
from scarl_sionna.dataset.formats import FrameSource, SceneFrames, convert
from tests.drive import drive
frame = drive(1, ends=("front",)).scenes[0].frames[0]
class Deadly(list):
    def __getitem__(self, index):
        if index == 1:
            os.kill(os.getpid(), signal.SIGKILL)
        return super().__getitem__(index)
convert(FrameSource(drive(ends=("front",)).rig, [SceneFrames("x", Deadly([frame, frame]))]), *sys.argv[1:3])
"""


@pytest.mark.some(1)
@pytest.mark.parametrize("form", ["hdf5", "nuscenes"])
def test_a_killed_export_leaves_no_output_and_its_rest_goes_with_the_next(tmp_path, form) -> None:
    command = [sys.executable, "-c", KILLED, form, str(tmp_path / "x")]
    done = subprocess.run(command, cwd=REPO, capture_output=True, text=True, check=False)
    assert done.returncode == -9, done.stderr
    assert not (tmp_path / "x").exists()
    assert len(list(tmp_path.iterdir())) == 1
    convert(SOURCE.subset(["lane"], 1), form, tmp_path / "x")
    assert [path.name for path in tmp_path.iterdir()] == ["x"]


def test_an_export_killed_between_the_renames_gives_the_old_folder_back(tmp_path) -> None:
    convert(SOURCE.subset(["lane"], 1), "nuscenes", tmp_path / "x")
    (tmp_path / "x").rename(tmp_path / ".partial_x_999999999_old")
    (tmp_path / ".partial_x_999999999").mkdir()
    (tmp_path / f".partial_x_{os.getpid()}").mkdir()  # of a process that runs
    (tmp_path / ".partial_x_999999999_7").mkdir()  # of another output, named x_999999999
    with pytest.raises(OutputError, match="is there"):
        convert(SOURCE, "nuscenes", tmp_path / "x")
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(
        [f".partial_x_{os.getpid()}", ".partial_x_999999999_7", "x"]
    )


@pytest.mark.parametrize("keep", ["camera", "lidar", "radar"])
@pytest.mark.parametrize("form", ["hdf5", "mcap"])
def test_a_drive_with_one_kind_of_sensor(tmp_path, form, keep) -> None:
    results = {name: result for name, result in FRAMES[0].results.items() if name.endswith(keep)}
    convert(FrameSource(SOURCE.rig, [SceneFrames("x", [replace(FRAMES[0], results=results)])]), form, tmp_path / "x")
    assert (tmp_path / "x").stat().st_size > 1000


@pytest.mark.parametrize("form", ["hdf5", "mcap", "nuscenes", "dca1000"])
def test_a_full_disk_is_an_output_error(tmp_path, form) -> None:
    """Files are limited to 20 kB by the kernel: a write fails in the middle, as on a full disk."""
    resource = pytest.importorskip("resource")
    signal = pytest.importorskip("signal")
    before, handler = resource.getrlimit(resource.RLIMIT_FSIZE), signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, before[1]))
    try:
        with pytest.raises(OutputError, match="cannot write"):
            convert(SOURCE, form, tmp_path / "x")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, handler)
    assert not list(tmp_path.iterdir())


def test_a_moving_scan_is_put_where_its_shots_were() -> None:
    """A return measured 50 ms after the timestamp from a turning vehicle is where the sensor then was."""
    frame = FRAMES[0]
    scan = frame.results[LIDAR]
    late = replace(scan, time=np.full(scan.num_points, 0.05, np.float32))
    again = drive(2, ends=("front",)).scenes[0].frames
    moved = world_points(frame, late)
    # half way to the next frame: the vehicle's own trajectory is straight with a constant turn rate
    ahead = again[1].results[LIDAR].world_from_sensor
    middle = 0.5 * (scan.world_from_sensor.position + ahead.position)
    expected = np.linalg.norm(scan.position, axis=1)
    # position of the sensor half way: chord against arc of 5 mrad over a lever of 2.4 m, 3e-5 m; distances keep
    np.testing.assert_allclose(np.linalg.norm(moved - middle, axis=1), expected, atol=1e-4)
    np.testing.assert_array_equal(world_points(frame, scan), scan.world_from_sensor.apply(scan.position))
    car = frame.objects[1]
    assert points_inside(car, world_points(frame, scan)).sum() >= car.num_lidar_points
    assert points_inside(car, moved).sum() < car.num_lidar_points


def test_a_distorted_camera_is_undistorted_for_nuscenes() -> None:
    """A grid seen through a lens becomes the grid that a pinhole camera with the same matrix sees."""
    from scarl_sionna.core.pose import Pose
    from scarl_sionna.core.specs.lens import BrownConrady
    from scarl_sionna.dataset.formats.pictures import undistorted

    lens = BrownConrady(k1=-0.25, k2=0.05)
    spec = CameraSpec(width=320, height=200, focal_length_px=200.0, lens=lens)
    plain = CameraSpec(width=320, height=200, focal_length_px=200.0)

    def grid(camera: CameraSpec) -> np.ndarray:
        line, column = np.mgrid[: camera.height, : camera.width] + 0.5
        ray = camera.rays(np.stack([column, line], axis=-1))
        plane = ray[..., :2] / ray[..., 2:]
        shade = 127.5 + 60.0 * (np.sin(12.0 * plane[..., 0]) + np.sin(12.0 * plane[..., 1]))
        return np.repeat(np.rint(shade)[..., None], 3, axis=-1).astype(np.uint8)

    found = undistorted(ImageFrame(spec, Pose(), rgb=grid(spec)))
    expected = grid(plain)
    inside = found.max(axis=-1) > 0
    assert inside.mean() > 0.7
    error = np.abs(found.astype(int) - expected)[inside]
    # bilinear: 1/8 h^2 f'' = (12 / 200)^2 * 60 / 8 = 0.03 levels and magnification below 1.5; two roundings of half a
    # level
    assert np.percentile(error, 99) <= 2
    assert np.abs(grid(spec).astype(int) - expected)[inside].mean() > 5 * error.mean()


def test_sources_of_all_kinds_give_the_same(tmp_path) -> None:
    stored = write_dataset(tmp_path / "ds", SOURCE.rig, {"lane": FRAMES[:2]})
    for place in (stored, str(stored), f"file://{stored}", open_dataset(stored)):
        source = as_source(place)
        assert [scene.name for scene in source.scenes] == ["lane"]
        assert source.num_frames == 2
        again = source.scenes[0].frames[1]
        np.testing.assert_array_equal(again.results[RADAR].adc_int, FRAMES[1].results[RADAR].adc_int)
        np.testing.assert_array_equal(again.results[LIDAR].position, FRAMES[1].results[LIDAR].position)
        assert [item.name for item in again.objects] == [item.name for item in FRAMES[1].objects]
    with pytest.raises(DatasetError, match="is a file"):
        as_source(stored / "manifest.json")
    with pytest.raises(DatasetError):
        as_source(tmp_path)


def test_a_cut_dataset_is_an_error_and_no_half_export(tmp_path) -> None:
    stored = write_dataset(tmp_path / "ds", SOURCE.rig, {"lane": FRAMES[:2]})
    (shard,) = (stored / "shards" / "lane").glob("*.zip")
    os.truncate(shard, 5000)
    with pytest.raises(DatasetError, match="verify"):
        convert(Path(stored), "dca1000", tmp_path / "out")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["ds"]
