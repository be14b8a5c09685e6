"""ROS 2 bags, read with rosbags: every message has what the frame had."""

from __future__ import annotations

import io
import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from scarl_sionna.core.errors import MissingPackageError, OutputError, ParameterRangeError
from scarl_sionna.core.pose import CAMERA_OPTICAL_FROM_SENSOR, Pose
from scarl_sionna.dataset import write_dataset
from scarl_sionna.dataset.derived.lidar_points import world_points
from scarl_sionna.dataset.derived.radar_points import sensed_points
from scarl_sionna.dataset.formats import convert
from scarl_sionna.dataset.formats.rosbag import export_rosbag, record_rosbag
from scarl_sionna.dataset.formats.source import FrameSource, SceneFrames
from tests.drive import AllFrames, drive

SOURCE = drive(num_frames=2, ends=("front",), scenes=("lane", "street"))
FRAMES = AllFrames(SOURCE)
RADAR, CAMERA, LIDAR = "front_center/radar", "front_center/camera", "front_center/lidar"
TIMES = [1_000_000_000, 1_100_000_000, 2_100_000_000, 2_200_000_000]
"""From 1 s on, the second scene 1 s after the first one."""


def read(folder: Path) -> dict[str, list]:
    """Return time and message of every topic, as the package reads them."""
    pytest.importorskip("rosbags")
    from rosbags.highlevel import AnyReader

    found: dict[str, list] = {}
    with AnyReader([folder]) as reader:
        for connection, time, raw in reader.messages():
            found.setdefault(connection.topic, []).append((time, reader.deserialize(raw, connection.msgtype)))
    return found


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> dict[str, list]:
    pytest.importorskip("rosbags")
    calls: list[tuple[int, int]] = []
    out = tmp_path_factory.mktemp("ros") / "out"
    export_rosbag(SOURCE, out, raw_radar=True, on_progress=lambda *state: calls.append(state))
    assert calls == [(k, 4) for k in range(1, 5)]
    return read(out)


def pose_of(place) -> Pose:
    position, turn = getattr(place, "position", None) or place.translation, getattr(place, "orientation", None)
    turn = turn or place.rotation
    return Pose([position.x, position.y, position.z], [turn.w, turn.x, turn.y, turn.z])


def cloud_of(message) -> np.ndarray:
    kinds = {1: "i1", 2: "u1", 3: "<i2", 4: "<u2", 5: "<i4", 6: "<u4", 7: "<f4", 8: "<f8"}
    dtype = np.dtype(
        {
            "names": [field.name for field in message.fields],
            "formats": [kinds[field.datatype] for field in message.fields],
            "offsets": [field.offset for field in message.fields],
            "itemsize": message.point_step,
        }
    )
    rows = np.frombuffer(message.data.tobytes(), dtype)
    assert len(rows) == message.width and message.height == 1 and message.row_step == message.data.size
    return rows


def test_topics_and_times(bag) -> None:
    topics = {
        "/scene", "/tf", "/odom", "/objects", "/front_center/camera/rgb/compressed", "/front_center/camera/depth",
        "/front_center/camera/semantic", "/front_center/camera/instance", "/front_center/camera/camera_info",
        "/front_center/lidar/points", "/front_center/radar/detections", "/front_center/radar/scan",
        "/front_center/radar/adc", "/front_center/radar/adc_info",
    }  # fmt: skip # a table
    assert set(bag) == topics
    for messages in bag.values():
        assert [time for time, _ in messages] == TIMES
    for _, message in bag["/odom"]:
        assert message.header.stamp.sec >= 1
    about = [json.loads(message.data) for _, message in bag["/scene"]]
    assert [(row["scene"], row["frame"], row["time_ns"]) for row in about] == [
        (scene.name, frame.index, frame.timestamp_ns) for scene in SOURCE.scenes for frame in scene
    ]


def test_poses_lead_from_the_world_to_every_sensor(bag) -> None:
    for frame, (_, message) in zip(FRAMES, bag["/tf"], strict=True):
        links = {item.child_frame_id: (item.header.frame_id, pose_of(item.transform)) for item in message.transforms}

        def world_from(name: str, links=links) -> Pose:
            parent, pose = links[name]
            return pose if parent == "world" else world_from(parent).compose(pose)

        for name, result in frame.results.items():
            point = [3.0, -2.0, 1.0]
            np.testing.assert_allclose(world_from(name).apply(point), result.world_from_sensor.apply(point), atol=1e-9)
        optical = np.asarray(CAMERA_OPTICAL_FROM_SENSOR) @ point
        np.testing.assert_allclose(
            world_from(f"{CAMERA}/optical").apply(optical),
            frame.images[CAMERA].world_from_sensor.apply(point),
            atol=1e-9,
        )


def test_odometry_is_in_the_vehicle_s_axes(bag) -> None:
    for frame, (_, message) in zip(FRAMES, bag["/odom"], strict=True):
        np.testing.assert_allclose(pose_of(message.pose.pose).position, frame.world_from_vehicle.position)
        linear = message.twist.twist.linear
        world = frame.world_from_vehicle.rotate([linear.x, linear.y, linear.z])
        np.testing.assert_allclose(world, frame.vehicle_twist.linear, atol=1e-12)
        assert message.twist.twist.angular.z == pytest.approx(frame.vehicle_twist.angular[2])
        assert (message.header.frame_id, message.child_frame_id) == ("world", "vehicle")


def test_images_are_exact_but_the_compressed_one(bag) -> None:
    for number, frame in enumerate(FRAMES):
        image = frame.images[CAMERA]
        for field, dtype in (("depth", "<f4"), ("semantic", "u1"), ("instance", "<u2")):
            message = bag[f"/{CAMERA}/{field}"][number][1]
            found = np.frombuffer(message.data.tobytes(), dtype).reshape(message.height, message.width)
            np.testing.assert_array_equal(found, getattr(image, field))
            assert message.step * message.height == message.data.size and message.is_bigendian == 0
        message = bag[f"/{CAMERA}/rgb/compressed"][number][1]
        shown = np.asarray(Image.open(io.BytesIO(message.data.tobytes())), float)
        assert message.format == "jpeg" and np.abs(shown - image.rgb).mean() < 5.0
        info = bag[f"/{CAMERA}/camera_info"][number][1]
        expected = image.spec.intrinsics - [[0, 0, 0.5], [0, 0, 0.5], [0, 0, 0]]
        np.testing.assert_array_equal(info.k.reshape(3, 3), expected)
        np.testing.assert_array_equal(info.p.reshape(3, 4)[:, :3], expected)
        assert (info.width, info.height, info.distortion_model) == (160, 90, "plumb_bob")
        assert info.header.frame_id == f"{CAMERA}/optical"


def test_clouds_hold_the_returns_and_the_detections(bag) -> None:
    for number, frame in enumerate(FRAMES):
        scan, radar = frame.lidars[LIDAR], frame.radars[RADAR]
        message = bag[f"/{LIDAR}/points"][number][1]
        rows = cloud_of(message)
        place = np.stack([rows[axis] for axis in "xyz"], axis=1)
        np.testing.assert_allclose(scan.world_from_sensor.apply(place), world_points(frame, scan), atol=2e-5)
        np.testing.assert_array_equal(rows["instance"], scan.instance)
        np.testing.assert_array_equal(rows["intensity"], scan.intensity)
        assert message.is_dense and message.header.frame_id == LIDAR
        points = sensed_points(frame, radar).points
        rows = cloud_of(bag[f"/{RADAR}/detections"][number][1])
        np.testing.assert_allclose(rows["radial_velocity"], points.radial_velocity, rtol=1e-6)
        np.testing.assert_allclose(rows["rcs_dbsm"], 10.0 * np.log10(points.rcs), rtol=1e-5)


def test_raw_data_comes_back_with_its_axes_and_scale(bag) -> None:
    for number, frame in enumerate(FRAMES):
        radar = frame.radars[RADAR]
        message = bag[f"/{RADAR}/adc"][number][1]
        shape = [axis.size for axis in message.layout.dim]
        np.testing.assert_array_equal(np.asarray(message.data).reshape(shape), radar.adc_int)
        assert message.layout.dim[1].stride == int(np.prod(shape[1:]))
        assert json.loads(bag[f"/{RADAR}/adc_info"][number][1].data)["scale"] == radar.adc_scale


def test_boxes_are_cubes_and_old_ones_go(bag) -> None:
    for frame, (_, message) in zip(FRAMES, bag["/objects"], strict=True):
        first, *cubes = message.markers
        assert first.action == 3  # DELETEALL
        assert [(cube.ns, cube.id, cube.type, cube.action) for cube in cubes] == [
            (item.name, item.instance, 1, 0) for item in frame.objects[1:]
        ]
        for cube, item in zip(cubes, frame.objects[1:], strict=True):
            np.testing.assert_allclose(pose_of(cube.pose).position, item.world_from_box.position)
            assert [cube.scale.x, cube.scale.y, cube.scale.z] == item.size.tolist()
            assert cube.color.a == pytest.approx(0.35)


def test_velocities_that_are_not_told_are_nan_and_the_cloud_says_so(tmp_path) -> None:
    pytest.importorskip("rosbags")
    frame = FRAMES[0]
    scan = frame.lidars[LIDAR]
    velocity = scan.radial_velocity.copy()
    velocity[0] = np.nan
    results = {LIDAR: replace(scan, radial_velocity=velocity)}
    export_rosbag(FrameSource(SOURCE.rig, [SceneFrames("x", [replace(frame, results=results)])]), tmp_path / "x")
    message = read(tmp_path / "x")[f"/{LIDAR}/points"][0][1]
    assert not message.is_dense and np.isnan(cloud_of(message)["radial_velocity"][0])


def test_a_stored_dataset_by_the_table_of_formats(tmp_path) -> None:
    pytest.importorskip("rosbags")
    place = write_dataset(tmp_path / "ds", SOURCE.rig, {"lane": list(SOURCE.scenes[0])})
    convert(place, "rosbag", tmp_path / "bag")
    found = read(tmp_path / "bag")
    assert len(found["/tf"]) == 2 and f"/{RADAR}/adc" not in found
    with pytest.raises(OutputError, match="is there"):
        convert(place, "rosbag", tmp_path / "bag")
    convert(place, "rosbag", tmp_path / "bag", overwrite=True)
    assert len(read(tmp_path / "bag")["/tf"]) == 2


def test_what_cannot_be_is_refused_and_leaves_nothing(tmp_path, monkeypatch) -> None:
    pytest.importorskip("rosbags")
    with pytest.raises(ParameterRangeError, match="no frames"):
        export_rosbag(FrameSource(SOURCE.rig, []), tmp_path / "x")
    sensors = [{**mount, "name": name} for mount, name in zip(SOURCE.rig["sensors"], ("a-b", "a_b", "c"), strict=True)]
    with pytest.raises(ParameterRangeError, match="another topic than /a_b"):
        export_rosbag(FrameSource({**SOURCE.rig, "sensors": sensors}, SOURCE.scenes), tmp_path / "x")

    class Broken(list):
        def __getitem__(self, index):
            if index == 1:
                raise KeyboardInterrupt
            return super().__getitem__(index)

    with pytest.raises(KeyboardInterrupt):
        export_rosbag(FrameSource(SOURCE.rig, [SceneFrames("x", Broken(FRAMES[:2]))]), tmp_path / "x")
    monkeypatch.setitem(sys.modules, "rosbags", None)
    with pytest.raises(MissingPackageError, match=r"scarl-sionna\[ros\]"):
        export_rosbag(SOURCE, tmp_path / "x")
    assert not list(tmp_path.iterdir())


def test_scans_of_radar_msgs_have_their_azimuth_to_the_left(bag) -> None:
    """As RadarReturn of radar_msgs 0.1.0 to 0.2.2 says: anticlockwise from the sensor, by REP 103."""
    for frame, (_, message), (_, cloud) in zip(
        FRAMES, bag["/front_center/radar/scan"], bag["/front_center/radar/detections"], strict=True
    ):
        assert message.header.frame_id == RADAR
        points = sensed_points(frame, frame.results[RADAR]).points
        rows = np.array([[r.range, r.azimuth, r.elevation, r.doppler_velocity, r.amplitude] for r in message.returns])
        assert len(rows) == points.num_points == cloud.width > 0
        r, left, up = rows[:, 0], rows[:, 1], rows[:, 2]
        place = np.stack([np.cos(up) * np.cos(left), np.cos(up) * np.sin(left), np.sin(up)], axis=1) * r[:, None]
        np.testing.assert_allclose(place, points.position, atol=1e-3)  # float32
        np.testing.assert_allclose(rows[:, 3], points.radial_velocity, atol=1e-4)
        np.testing.assert_allclose(rows[:, 4], points.snr_db, atol=1e-3)


def test_a_bag_is_recorded_frame_by_frame(bag, tmp_path: Path) -> None:
    """As the steps of a session give them: the messages of an export of the same frames."""
    frames = list(SOURCE.scenes[0])
    with record_rosbag(SOURCE.rig, tmp_path / "live", raw_radar=True) as record:
        for frame in frames:
            record(frame)
    found = read(tmp_path / "live")
    assert set(found) == set(bag)
    for topic in set(bag) - {"/scene"}:
        for (time, message), (expected, other) in zip(found[topic], bag[topic][: len(frames)], strict=True):
            assert time == expected and repr(message) == repr(other)
    with pytest.raises(RuntimeError), record_rosbag(SOURCE.rig, tmp_path / "broken") as record:
        raise RuntimeError
    assert not (tmp_path / "broken").exists()
