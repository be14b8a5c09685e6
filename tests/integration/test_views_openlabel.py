"""ASAM OpenLABEL: boxes come back where they were, by its own schema and coordinate systems, and as vcd reads them."""

from __future__ import annotations

import json
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from scarl_sionna.core.boxes import CORNERS
from scarl_sionna.core.errors import ParameterRangeError, ScarlWarning
from scarl_sionna.core.pose import CAMERA_OPTICAL_FROM_SENSOR, Pose
from scarl_sionna.core.semantics import SEMANTIC_CLASSES
from scarl_sionna.core.specs.camera import CameraSpec
from scarl_sionna.core.specs.lens import BrownConrady, KannalaBrandt
from scarl_sionna.dataset.formats.labelled.openlabel import VEHICLE, WORLD, _intervals, _intrinsics, export_openlabel
from scarl_sionna.dataset.formats.source import FrameSource, SceneFrames
from tests.client_env import client_python, run_client
from tests.drive import drive

SOURCE = drive(num_frames=3, ends=("front", "back"), scenes=("lane", "street"))
CAMERA, LIDAR = "front_center/camera", "back_center/lidar"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    calls: list[tuple[int, int]] = []
    out = tmp_path_factory.mktemp("openlabel") / "out"
    with pytest.warns(ScarlWarning, match=r"OpenLABEL has no place for front_center/lidar \(lidar\)"):
        export_openlabel(SOURCE, out, image_format="png", on_progress=lambda *state: calls.append(state))
    assert calls == [(k, 6) for k in range(1, 7)]
    return out


@pytest.fixture(scope="module")
def labels(folder: Path) -> dict:
    return json.loads((folder / "lane.json").read_text())["openlabel"]


def pose_of(transform: dict) -> Pose:
    x, y, z, w = transform["quaternion"]
    return Pose(transform["translation"], (w, x, y, z))


def box_of(labels: dict, number: int, uid: str) -> dict:
    """Return an object's cuboid in a frame: its own there, else that of all frames."""
    own = labels["frames"][str(number)]["objects"][uid]["object_data"].get("cuboid")
    return (own or labels["objects"][uid]["object_data"]["cuboid"])[0]


def corners_of(labels: dict, number: int, uid: str) -> np.ndarray:
    x, y, z, qx, qy, qz, qw, *size = box_of(labels, number, uid)["val"]
    return Pose((x, y, z), (qw, qx, qy, qz)).apply(CORNERS * np.array(size))


def test_boxes_velocities_and_classes(labels: dict) -> None:
    for number, frame in enumerate(SOURCE.scenes[0]):
        expected = {str(item.instance): item for item in frame.objects[1:]}  # without the car with the sensors
        assert set(labels["frames"][str(number)]["objects"]) == set(expected)
        for uid, item in expected.items():
            about = labels["objects"][uid]
            assert (about["name"], about["type"]) == (item.name, SEMANTIC_CLASSES[item.semantic])
            assert about["frame_intervals"] == [{"frame_start": 0, "frame_end": 2}]
            true = item.world_from_box.apply(CORNERS * item.size)
            np.testing.assert_allclose(corners_of(labels, number, uid), true, rtol=0, atol=1e-9)
            box = box_of(labels, number, uid)
            assert box["coordinate_system"] == WORLD
            assert box["attributes"]["vec"] == [{"name": "velocity", "val": item.twist.linear.tolist()}]


def test_what_stands_still_is_written_once(labels: dict) -> None:
    still = {uid for uid, item in labels["objects"].items() if "object_data" in item}
    kinds = {labels["objects"][uid]["type"] for uid in still}
    assert kinds == {"Building"}
    for frame in labels["frames"].values():
        assert all(("cuboid" in item["object_data"]) == (uid not in still) for uid, item in frame["objects"].items())


def test_rectangles_and_images(folder: Path, labels: dict) -> None:
    compared = 0
    for number, frame in enumerate(SOURCE.scenes[0]):
        image = frame.images[CAMERA]
        properties = labels["frames"][str(number)]["frame_properties"]
        assert properties["timestamp"] == frame.timestamp_ns * 1e-9
        uri = properties["streams"][CAMERA]["uri"]
        np.testing.assert_array_equal(np.asarray(Image.open(folder / uri)), image.rgb)
        for item in frame.objects[1:]:
            mask = image.instance == item.instance
            data = labels["frames"][str(number)]["objects"][str(item.instance)]["object_data"]
            found = [box for box in data.get("bbox", []) if box["coordinate_system"] == CAMERA]
            assert bool(found) == bool(mask.any())
            if found:
                rows, columns = np.nonzero(mask)
                u, v, width, height = found[0]["val"]
                assert (u - (width - 1) / 2, u + (width - 1) / 2) == (columns.min(), columns.max())
                assert (v - (height - 1) / 2, v + (height - 1) / 2) == (rows.min(), rows.max())
                numbers = {entry["name"]: entry["val"] for entry in found[0]["attributes"]["num"]}
                assert numbers["num_pixels"] == mask.sum()
                compared += 1
    assert compared >= 6


def test_coordinate_systems_and_matrix_project_a_box_onto_its_rectangle(labels: dict) -> None:
    """By the file alone: cuboid -> world -> vehicle -> camera -> pixels, against the rectangle of a car."""
    systems, stream = labels["coordinate_systems"], labels["streams"][CAMERA]
    matrix = np.reshape(stream["stream_properties"]["intrinsics_pinhole"]["camera_matrix"], (3, 4))
    compared = 0
    for number in range(3):
        frame = labels["frames"][str(number)]
        move = frame["frame_properties"]["transforms"][f"{VEHICLE}_to_{WORLD}"]
        assert (move["src"], move["dst"]) == (VEHICLE, WORLD)
        camera = pose_of(move["transform_src_to_dst"]).compose(pose_of(systems[CAMERA]["pose_wrt_parent"]))
        for uid, item in frame["objects"].items():
            found = [box for box in item["object_data"].get("bbox", []) if box["coordinate_system"] == CAMERA]
            if found and labels["objects"][uid]["type"] == "Car":
                local = camera.inverse().apply(corners_of(labels, number, uid))
                pixel = np.column_stack([local, np.ones(8)]) @ matrix.T
                u, v = (pixel[:, :2] / pixel[:, 2:]).T
                middle, size = np.array(found[0]["val"][:2]), np.array(found[0]["val"][2:])
                ends = np.array([[u.min(), v.min()], [u.max(), v.max()]])
                np.testing.assert_allclose(ends, [middle - size / 2, middle + size / 2], rtol=0, atol=1.0)
                compared += 1
    assert compared == 3


def test_systems_name_each_other_and_streams_every_sensor(labels: dict) -> None:
    systems = labels["coordinate_systems"]
    assert systems[WORLD]["parent"] == "" and systems[VEHICLE]["parent"] == WORLD
    assert (
        set(systems[VEHICLE]["children"])
        == set(SOURCE.mounts)
        == set(labels["streams"])
        == set(systems) - {WORLD, VEHICLE}
    )
    assert labels["streams"][LIDAR]["type"] == "lidar" and labels["streams"][CAMERA]["type"] == "camera"
    lidar = pose_of(systems[LIDAR]["pose_wrt_parent"])
    np.testing.assert_allclose(lidar.matrix, SOURCE.vehicle_from_sensor(LIDAR).matrix, atol=1e-12)
    camera = pose_of(systems[CAMERA]["pose_wrt_parent"])
    expected = SOURCE.vehicle_from_sensor(CAMERA).rotation @ np.asarray(CAMERA_OPTICAL_FROM_SENSOR).T
    np.testing.assert_allclose(camera.rotation, expected, atol=1e-12)


def test_lenses() -> None:
    image = SOURCE.scenes[0].frames[0].images[CAMERA]
    wide = replace(image, spec=CameraSpec(width=160, height=90, lens=BrownConrady(k1=-0.1, k4=0.02)))
    known = _intrinsics(wide)["intrinsics_pinhole"]
    assert known["distortion_coeffs"] == list(wide.spec.distortion_coefficients) and len(known["camera_matrix"]) == 12
    assert known["camera_matrix"][2] == 79.5  # the middle, counted from the centre of the first pixel
    fish = replace(image, spec=CameraSpec(width=160, height=90, lens=KannalaBrandt(k1=0.01), horizontal_fov_deg=190.0))
    known = _intrinsics(fish)["intrinsics_fisheye"]
    assert known["lens_coeffs"] == list(fish.spec.distortion_coefficients) and known["center_y_px"] == 44.5


def test_objects_that_come_and_go() -> None:
    assert _intervals([0, 1, 4, 6, 7]) == [
        {"frame_start": 0, "frame_end": 1},
        {"frame_start": 4, "frame_end": 4},
        {"frame_start": 6, "frame_end": 7},
    ]


def test_without_images_and_without_instances(tmp_path) -> None:
    frame = SOURCE.scenes[0].frames[0]
    results = {
        name: replace(result, instance=None) if name in frame.images else result
        for name, result in frame.results.items()
    }
    source = FrameSource(SOURCE.rig, [SceneFrames("lane", [replace(frame, results=results)])])
    with pytest.warns(ScarlWarning, match="no instance image has the view of back_center/camera, front_center/camera"):
        out = export_openlabel(source, tmp_path / "out", images=False)
    assert not (out / "images").exists()
    found = json.loads((out / "lane.json").read_text())["openlabel"]["frames"]["0"]
    assert "streams" not in found["frame_properties"]
    assert all("bbox" not in item["object_data"] for item in found["objects"].values())


def test_bad_input(tmp_path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ScarlWarning)
        with pytest.raises(ParameterRangeError, match="no frames"):
            export_openlabel(FrameSource(SOURCE.rig, []), tmp_path / "x")
        with pytest.raises(ParameterRangeError, match="image_format"):
            export_openlabel(SOURCE, tmp_path / "x", image_format="gif")
    assert not (tmp_path / "x").exists()


def test_vcd_reads_it(folder: Path, tmp_path, pytestconfig) -> None:
    """The file is valid by the standard's schema, and vcd carries its boxes into a sensor's coordinates."""
    python = client_python("openlabel", pytestconfig)
    for sensor in (LIDAR, CAMERA):
        run_client(python, "openlabel_client.py", folder / "lane.json", sensor, tmp_path / "found.json")
        found = json.loads((tmp_path / "found.json").read_text())
        assert set(found) == {"0", "1", "2"}
        for number, frame in enumerate(SOURCE.scenes[0]):
            optical = Pose.from_rotation(np.zeros(3), np.asarray(CAMERA_OPTICAL_FROM_SENSOR).T)
            place = SOURCE.vehicle_from_sensor(sensor).compose(optical if sensor == CAMERA else Pose())
            to_sensor = frame.world_from_vehicle.compose(place).inverse()
            assert len(found[str(number)]) == len(frame.objects) - 1
            for item in frame.objects[1:]:
                true = to_sensor.apply(item.world_from_box.apply(CORNERS * item.size))
                corners = np.array(found[str(number)][item.name]["corners"])
                gap = np.linalg.norm(true[:, None] - corners[None], axis=-1)
                assert gap.min(axis=0).max() < 1e-9 and gap.min(axis=1).max() < 1e-9
