"""Frame folder: a frame comes back as it was written, and a folder is never half a frame or two configurations."""

from __future__ import annotations

import json
from dataclasses import fields, is_dataclass, replace

import numpy as np
import pytest
from PIL import Image

from scarl_sionna.core.camera_spec import CameraSpec
from scarl_sionna.core.errors import OutputError, ParameterRangeError
from scarl_sionna.core.lidar_spec import LidarSpec
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.radar_spec import RadarSpec
from scarl_sionna.core.results import Frame, ImageFrame, LidarScan, ObjectState, RadarFrame
from scarl_sionna.export import FrameFolderWriter, frame_folders, read_frame
from scarl_sionna.export.codec import DEPTH_RATIO, decode_depth, encode_depth
from scarl_sionna.fusion import Rig, SensorMount

CAMERA = CameraSpec(width=24, height=16)
LIDAR = LidarSpec(num_azimuth=5, num_elevation=3)
RADAR = RadarSpec(num_chirps=4, num_samples=8)
RIG = Rig(
    "small",
    (
        SensorMount("front/camera", "camera", CAMERA, Pose([2.0, 0.1, 1.3])),
        SensorMount("front/depth", "camera", CAMERA.with_(images=("depth",)), Pose([2.0, 0.1, 1.3])),
        SensorMount("front/lidar", "lidar", LIDAR, Pose([2.0, 0.0, 0.7])),
        SensorMount("radar", "radar", RADAR, Pose([2.3, 0.0, 0.5], [0.9, 0.1, -0.2, 0.3])),
    ),
)
CONFIGURATION = {"scene": "none", "seed": 0, "rig": RIG.to_dict()}


def make_frame(index: int = 0) -> Frame:
    """Return a frame of arbitrary arrays of the right types; depth is already on the code's steps."""
    rng = np.random.default_rng(index)
    pose = Pose(rng.normal(size=3), rng.normal(size=4))
    shape = (CAMERA.height, CAMERA.width)
    depth = decode_depth(rng.integers(0, 2**16, shape).astype(np.uint16), CAMERA.max_distance)
    images = ImageFrame(
        CAMERA, pose, rng.integers(0, 256, (*shape, 3)).astype(np.uint8), depth,
        rng.integers(0, 29, shape).astype(np.uint8), rng.integers(0, 2**16, shape).astype(np.uint16),
    )  # fmt: skip
    count = 9
    vectors = rng.normal(size=(2, count, 3)).astype(np.float32)
    scalars = rng.normal(size=(4, count)).astype(np.float32)
    lidar = LidarScan(
        LIDAR, pose, np.arange(count, dtype=np.int32), vectors[0], *scalars, vectors[1],
        np.full(count, 14, np.uint8), np.full(count, 60000, np.uint16),
    )  # fmt: skip
    adc = rng.integers(-(2**15), 2**15, (RADAR.num_rx, RADAR.num_chirps_total, RADAR.num_samples, 2)).astype(np.int16)
    radar = RadarFrame(RADAR, pose, adc, 1.0 / 3.0e7, 2, 77, {"method": "raycast", "num_rays": 5})
    car = ObjectState("car", 7, 14, pose, np.array([4.5, 1.8, 1.5]), Twist([1 / 3, 0, 0], [0, 0, 0.1]), True, 3, 4)
    return Frame(
        index, 1_000_000_007 + index, 2**40, pose, Twist([30.1, 0, 0]),
        {"front/camera": images, "front/depth": ImageFrame(CAMERA.with_(images=("depth",)), pose, depth=depth),
         "front/lidar": lidar, "radar": radar},
        (car,), {"camera": 1.0},
    )  # fmt: skip


def assert_same(a, b, where="frame") -> None:
    """Assert that two values are equal bit for bit, dataclasses field by field."""
    assert type(a) is type(b), where
    if is_dataclass(a):
        for item in fields(a):
            if item.name != "timings":
                assert_same(getattr(a, item.name), getattr(b, item.name), f"{where}.{item.name}")
    elif isinstance(a, dict):
        assert list(a) == list(b), where
        for key in a:
            assert_same(a[key], b[key], f"{where}[{key}]")
    elif isinstance(a, tuple):
        for index, pair in enumerate(zip(a, b, strict=True)):
            assert_same(*pair, f"{where}[{index}]")
    elif isinstance(a, np.ndarray):
        assert (a.dtype, a.shape, a.tobytes()) == (b.dtype, b.shape, b.tobytes()), where
    else:
        assert a == b, where


def test_a_frame_comes_back_as_it_was_written(tmp_path) -> None:
    frame = make_frame()
    folder = FrameFolderWriter(tmp_path / "deep" / "out", CONFIGURATION).write(frame)
    assert_same(read_frame(folder), frame)


def test_writing_twice_gives_the_same_bytes(tmp_path) -> None:
    for name in ("a", "b"):
        FrameFolderWriter(tmp_path / name, CONFIGURATION).write(make_frame())
    files = [
        {p.relative_to(tmp_path / n): p.read_bytes() for p in (tmp_path / n).rglob("*") if p.is_file()} for n in "ab"
    ]
    assert len(files[0]) == 9  # dataset.json, frame.json, 4 images + 1 depth, points, adc
    assert files[0] == files[1]


def test_plain_readers_understand_the_files(tmp_path) -> None:
    frame = make_frame()
    folder = FrameFolderWriter(tmp_path, CONFIGURATION).write(frame)
    images = frame.images["front/camera"]
    with Image.open(folder / "front/camera/semantic.png") as image:
        np.testing.assert_array_equal(np.array(image), images.semantic)
        car = np.array(image.convert("RGB"))[images.semantic == 14]
        assert (car == (0, 0, 142)).all()  # CARLA's colour of a car
    dataset = json.loads((tmp_path / "dataset.json").read_text())
    assert dataset["calibration"]["front/camera"]["intrinsics"] == CAMERA.intrinsics.tolist()
    data = json.loads((folder / "frame.json").read_text())
    assert data["timestamp_ns"] == frame.timestamp_ns
    assert data["objects"][0]["semantic_class"] == "Car"


def test_depth_code_is_within_half_a_step() -> None:
    depth = np.geomspace(0.06, 1000.0, 20_001).astype(np.float32)
    again = decode_depth(encode_depth(depth, 1000.0), 1000.0)
    # half a step of the logarithm, and two float32 roundings of 6e-8
    bound = np.expm1(np.log(DEPTH_RATIO) / 65534 / 2) + 1.2e-7
    assert np.max(np.abs(again / depth - 1.0)) <= bound


def test_depth_code_of_nothing_too_near_and_too_far() -> None:
    code = encode_depth(np.array([np.inf, 1e-9, 1000.0, 2000.0], np.float32), 1000.0)
    assert code.tolist() == [0, 1, 65535, 65535]
    assert np.isinf(decode_depth(code, 1000.0)[0])


def test_complete_frames_of_the_same_configuration_are_kept(tmp_path) -> None:
    writer = FrameFolderWriter(tmp_path, CONFIGURATION)
    writer.write(make_frame(0))
    writer.write(make_frame(3))
    assert FrameFolderWriter(tmp_path, CONFIGURATION).complete() == {0, 3}
    assert FrameFolderWriter(tmp_path, CONFIGURATION, overwrite=True).complete() == set()


def test_another_configuration_is_refused_and_the_difference_named(tmp_path) -> None:
    FrameFolderWriter(tmp_path, CONFIGURATION).write(make_frame())
    other = json.loads(json.dumps(CONFIGURATION))
    other["seed"] = 5
    other["rig"]["sensors"][3]["spec"]["bandwidth"] = 1e9
    with pytest.raises(OutputError, match=r"seed: 0 there, 5 asked for.*bandwidth: 300000000\.0 there.*overwrite"):
        FrameFolderWriter(tmp_path, other)
    assert read_frame(tmp_path / "frame_000000").seed == 2**40  # untouched
    FrameFolderWriter(tmp_path, other, overwrite=True)
    assert frame_folders(tmp_path) == []


def test_what_a_killed_run_left_is_removed_and_is_no_frame(tmp_path) -> None:
    writer = FrameFolderWriter(tmp_path, CONFIGURATION)
    whole = writer.write(make_frame())
    half = tmp_path / ".partial_frame_000001_99"
    (half / "front").mkdir(parents=True)
    assert frame_folders(tmp_path) == [whole]
    FrameFolderWriter(tmp_path, CONFIGURATION)
    assert not half.exists()


def test_a_frame_that_fails_in_the_middle_leaves_nothing(tmp_path) -> None:
    writer = FrameFolderWriter(tmp_path, CONFIGURATION)
    frame = make_frame()
    broken = replace(frame, results={**frame.results, "radar": object()})
    with pytest.raises((OutputError, AttributeError)):
        writer.write(broken)
    assert [path.name for path in tmp_path.iterdir()] == ["dataset.json"]


def test_a_frame_that_the_system_does_not_take_leaves_nothing(tmp_path) -> None:
    """Files are limited to 1 kB by the kernel, so that a write fails in the middle as on a full disk."""
    resource = pytest.importorskip("resource")
    writer = FrameFolderWriter(tmp_path, CONFIGURATION)
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1024, before[1]))
    try:
        with pytest.raises(OutputError, match="cannot write"):
            writer.write(make_frame())
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert [path.name for path in tmp_path.iterdir()] == ["dataset.json"]
    assert read_frame(writer.write(make_frame())).index == 0


def test_a_frame_that_is_there_is_not_written_over(tmp_path) -> None:
    writer = FrameFolderWriter(tmp_path, CONFIGURATION)
    writer.write(make_frame())
    with pytest.raises(OutputError, match="is there"):
        writer.write(make_frame())


def test_a_folder_that_cannot_be_is_refused(tmp_path) -> None:
    (tmp_path / "file").write_text("")
    for out in (tmp_path / "file", tmp_path / "file" / "out"):  # holds for root, too
        with pytest.raises(OutputError, match="choose a folder"):
            FrameFolderWriter(out, CONFIGURATION)


def test_a_foreign_dataset_json_is_refused(tmp_path) -> None:
    (tmp_path / "dataset.json").write_text("[]")
    with pytest.raises(OutputError, match="not a dataset of this program"):
        FrameFolderWriter(tmp_path, CONFIGURATION)


def test_reading_something_else_is_refused(tmp_path) -> None:
    with pytest.raises(ParameterRangeError, match="frame folder"):
        read_frame(tmp_path)
    folder = FrameFolderWriter(tmp_path, CONFIGURATION).write(make_frame())
    dataset = json.loads((tmp_path / "dataset.json").read_text())
    (tmp_path / "dataset.json").write_text(json.dumps({**dataset, "format_version": 99}))
    with pytest.raises(ParameterRangeError, match="update scarl-sionna"):
        read_frame(folder)
