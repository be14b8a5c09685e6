"""KITTI's layout: boxes, calibration and points come back where they were, also through nuscenes-devkit's KittiDB."""

from __future__ import annotations

import json
import math
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from scarl_sionna.core.boxes import CORNERS
from scarl_sionna.core.errors import DatasetError, ParameterRangeError, ScarlWarning, UnknownNameError
from scarl_sionna.core.pose import CAMERA_OPTICAL_FROM_SENSOR, Pose
from scarl_sionna.core.specs.camera import CameraSpec
from scarl_sionna.dataset.derived.lidar_points import world_points
from scarl_sionna.dataset.derived.radar_points import sensed_points
from scarl_sionna.dataset.formats import convert
from scarl_sionna.dataset.formats.labelled.kitti import MIN_PIXELS, _occluded, export_kitti
from scarl_sionna.dataset.formats.source import FrameSource, SceneFrames
from tests.client_env import client_python, run_client
from tests.drive import AllFrames, drive

SOURCE = replace(
    drive(num_frames=3, ends=("front", "back"), scenes=("lane", "street")),
    splits={"train": ["lane"], "val": ["street"]},
)
FRAMES = AllFrames(SOURCE)
CAMERA = "front_center/camera"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    calls: list[tuple[int, int]] = []
    out = tmp_path_factory.mktemp("kitti") / "out"
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # the drive's camera is level
        export_kitti(SOURCE, out, on_progress=lambda *state: calls.append(state))
    assert calls == [(k, 6) for k in range(1, 7)]
    return out


def velodyne_pose(folder: Path, number: int) -> Pose:
    row = json.loads((folder / "samples.json").read_text())[number]["world_from_velodyne"]
    return Pose(row["position"], row["quaternion"])


def shown(number: int) -> list:
    """Return the objects that a label is expected for."""
    frame = FRAMES[number]
    return [
        item
        for item in frame.objects[1:3]  # the car and the pedestrian
        if np.count_nonzero(frame.images[CAMERA].instance == item.instance) >= MIN_PIXELS
    ]


def test_folders_and_sets(folder) -> None:
    for kind, suffix in (
        ("image_2", "png"),
        ("label_2", "txt"),
        ("calib", "txt"),
        ("velodyne", "bin"),
        ("radar", "bin"),
    ):
        names = sorted(path.name for path in (folder / "training" / kind).iterdir())
        assert names == [f"{number:06d}.{suffix}" for number in range(6)]
    sets = {path.stem: path.read_text().split() for path in (folder / "ImageSets").iterdir()}
    first, second = [f"{number:06d}" for number in range(3)], [f"{number:06d}" for number in range(3, 6)]
    assert sets == {"train": first, "val": second, "trainval": first + second}
    about = json.loads((folder / "samples.json").read_text())
    assert [(row["scene"], row["frame"], row["timestamp_ns"]) for row in about] == [
        (scene.name, frame.index, frame.timestamp_ns) for scene in SOURCE.scenes for frame in scene
    ]
    pixels = np.asarray(Image.open(folder / "training" / "image_2" / "000001.png"))
    np.testing.assert_array_equal(pixels, FRAMES[1].images[CAMERA].rgb)


def test_points_lie_in_the_world_where_lidars_and_radars_saw_them(folder) -> None:
    for number in (0, 4):
        frame, pose = FRAMES[number], velodyne_pose(folder, number)
        rows = np.fromfile(folder / "training" / "velodyne" / f"{number:06d}.bin", np.float32).reshape(-1, 4)
        expected = np.concatenate([world_points(frame, scan) for scan in frame.lidars.values()])
        np.testing.assert_allclose(pose.apply(rows[:, :3]), expected, atol=2e-5)  # float32 at 200 m
        # a diffuser of half the light: intensity * distance^2 = 0.5 in the drive
        np.testing.assert_allclose(rows[:, 3], 0.5, rtol=1e-5)
        echoes = np.fromfile(folder / "training" / "radar" / f"{number:06d}.bin", np.float32).reshape(-1, 7)
        sensed = [(radar, sensed_points(frame, radar)) for radar in frame.radars.values()]
        places = np.concatenate([radar.world_from_sensor.apply(found.points.position) for radar, found in sensed])
        np.testing.assert_allclose(pose.apply(echoes[:, :3]), places, atol=2e-5)
        rcs = np.concatenate([10.0 * np.log10(found.points.rcs) for _, found in sensed])
        np.testing.assert_allclose(echoes[:, 3], rcs, atol=1e-4)
        over_ground = np.concatenate([found.compensated_velocity for _, found in sensed])
        np.testing.assert_allclose(echoes[:, 5], over_ground, atol=1e-5)


def test_the_devkit_s_reader_finds_boxes_and_pixels_where_they_are(folder, tmp_path, pytestconfig) -> None:
    python = client_python("nuscenes", pytestconfig)
    run_client(python, "kitti_client.py", folder, tmp_path / "result.json")
    found = json.loads((tmp_path / "result.json").read_text())
    assert sorted(found) == [f"training_{number:06d}" for number in range(6)]
    compared = 0
    for number, frame in enumerate(FRAMES):
        sample, pose = found[f"training_{number:06d}"], velodyne_pose(folder, number)
        image = frame.images[CAMERA]
        assert sample["points"] == sum(scan.num_points for scan in frame.lidars.values())
        expected = shown(number)
        assert len(sample["boxes"]) == len(expected) == len(sample["flat"])
        for box, flat, item in zip(sample["boxes"], sample["flat"], expected, strict=True):
            assert box["name"] == ("Car" if item.name.startswith("Car") else "Pedestrian")
            corners = item.world_from_box.apply(CORNERS * item.size)
            gap = np.linalg.norm(pose.apply(box["corners"])[:, None] - corners[None], axis=-1)
            # 4 decimals of 11 numbers and a turn: 1e-4 m and 1e-4 rad over 2.5 m; their matrices are float32
            assert gap.min(axis=0).max() < 1e-3
            assert sorted(gap.argmin(axis=1)) == list(range(8))
            sensor = image.world_from_sensor.inverse().apply(corners)
            pixel, depth = image.spec.project(sensor @ CAMERA_OPTICAL_FROM_SENSOR.T)
            if depth.min() > 1.0:
                theirs = np.array(box["pixels"])[gap.argmin(axis=0)]
                np.testing.assert_allclose(theirs, pixel - 0.5, atol=0.02)
            mask = image.instance == item.instance
            rows, columns = np.nonzero(mask)
            assert flat == [columns.min(), rows.min(), columns.max(), rows.max()]
            compared += 1
        cloud = np.concatenate([world_points(frame, scan) for scan in frame.lidars.values()])[::50]
        sensor = image.world_from_sensor.inverse().apply(cloud)
        pixel, depth = image.spec.project(sensor @ CAMERA_OPTICAL_FROM_SENSOR.T)
        ahead = depth > 1.0
        theirs = np.array(sample["projected"])[ahead]
        np.testing.assert_allclose(theirs[:, :2], pixel[ahead] - 0.5, atol=0.02)
        np.testing.assert_allclose(theirs[:, 2], depth[ahead], rtol=1e-5)
    assert compared >= 6


def test_alpha_and_turn_follow_the_definition(folder) -> None:
    """A car seen straight ahead and driving away has turn and alpha of -90 deg."""
    lines = (folder / "training" / "label_2" / "000000.txt").read_text().splitlines()
    for line, item in zip(lines, shown(0), strict=True):
        numbers = [float(text) for text in line.split()[1:]]
        alpha, turn, (x, _, z) = numbers[2], numbers[13], numbers[10:13]
        assert alpha == pytest.approx(math.remainder(turn - math.atan2(x, z), 2 * math.pi), abs=2e-4)
        camera = FRAMES[0].images[CAMERA].world_from_sensor
        ahead = camera.inverse().rotate(item.world_from_box.rotate([1.0, 0.0, 0.0]))
        assert math.remainder(turn + math.pi / 2 + math.atan2(ahead[1], ahead[0]), 2 * math.pi) == pytest.approx(
            0.0, abs=2e-4
        )
        assert numbers[0] == -1.0 and numbers[1] == 3  # truncation and occlusion are not told by the drive


@pytest.mark.parametrize(("share", "number"), [(0.0, 0), (0.1, 0), (0.11, 1), (0.5, 1), (0.51, 2), (math.nan, 3)])
def test_occlusion_in_three_steps(share, number) -> None:
    assert _occluded(share) == number


def test_a_tilted_camera_warns(tmp_path) -> None:
    frame = FRAMES[0]
    image = frame.images[CAMERA]
    tilted = replace(image, world_from_sensor=image.world_from_sensor.compose(Pose.from_euler([0, 0, 0], pitch=0.1)))
    source = FrameSource(SOURCE.rig, [SceneFrames("x", [replace(frame, results={**frame.results, CAMERA: tilted})])])
    with pytest.warns(ScarlWarning, match=r"tilted by up to 5\.7 deg"):
        export_kitti(source, tmp_path / "x")


def test_what_cannot_be_is_refused_and_leaves_nothing(tmp_path) -> None:
    with pytest.raises(UnknownNameError, match="front_center/camera"):
        export_kitti(SOURCE, tmp_path / "x", camera="front")
    with pytest.raises(ParameterRangeError, match="no frames"):
        convert(FrameSource(SOURCE.rig, []), "kitti", tmp_path / "x")
    frame = FRAMES[0]
    bent = CameraSpec(
        width=160, height=90, lens={"model": "brown_conrady", "k1": -0.1, "k2": 0.0, "p1": 0.0, "p2": 0.0, "k3": 0.0}
    )
    results = {**frame.results, CAMERA: replace(frame.images[CAMERA], spec=bent)}
    with pytest.raises(DatasetError, match="distorts"):
        export_kitti(FrameSource(SOURCE.rig, [SceneFrames("x", [replace(frame, results=results)])]), tmp_path / "x")
    less = replace(frame, results={})
    with pytest.raises(DatasetError, match="has no image"):
        export_kitti(FrameSource(SOURCE.rig, [SceneFrames("x", [frame, less])]), tmp_path / "x")
    assert not list(tmp_path.iterdir())
