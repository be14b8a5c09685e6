"""Official names of scenes, ground truth, evaluation and CAN bus, by nuscenes-devkit itself."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.dataset.formats.nuscenes import export_nuscenes
from scarl_sionna.dataset.formats.nuscenes_parts.can_bus import GRAVITY, messages
from scarl_sionna.dataset.formats.nuscenes_parts.splits import NUMBERS, WITHOUT_CAN_BUS, _expanded, official_names
from tests.client_env import client_python, run_client
from tests.drive import EGO_TWIST, drive

SOURCE = replace(
    drive(num_frames=3, scenes=("street", "lane", "park")), splits={"train": ["street", "park"], "val": ["lane"]}
)


def test_the_devkit_takes_our_scenes_for_its_splits(tmp_path, pytestconfig) -> None:
    python = client_python("nuscenes", pytestconfig)
    export_nuscenes(SOURCE, tmp_path / "out", official_names=True, raw_radar=False)
    (tmp_path / "work").mkdir()
    result = tmp_path / "work" / "result.json"
    run_client(python, "nuscenes_splits_client.py", tmp_path / "out", "v1.0-mini", "mini_train", result)
    found = json.loads(result.read_text())
    assert found["scenes"] == ["scene-0061", "scene-0553"]
    assert found["custom"] == {"scarl_train": ["scene-0061", "scene-0553"], "scarl_val": ["scene-0103"]}
    assert found["samples"] == 6
    assert found["names"] == ["car", "pedestrian"]
    for name in ("car", "pedestrian"):  # boxes that are the truth itself score all
        assert found["average_precision"][name] == pytest.approx(1.0, abs=1e-3)
    for split, scenes in found["official"].items():  # our table of names is the devkit's
        assert [f"scene-{number:04d}" for number in _expanded(NUMBERS[split])] == scenes
    for name, messages_of in found["can"].items():
        ego = found["ego"][name]
        assert len(messages_of["pose"]) == len(ego) == 3
        for row, pose in zip(messages_of["pose"], ego, strict=True):
            assert row["pos"] == pose["translation"] and row["orientation"] == pose["rotation"]
            assert row["utime"] == pose["timestamp"]
        np.testing.assert_allclose(messages_of["route"], [pose["translation"][:2] for pose in ego])
        speed = np.linalg.norm(EGO_TWIST.linear) * 3.6
        assert [row["vehicle_speed"] for row in messages_of["vehicle_monitor"]] == pytest.approx([speed] * 3)
        assert [row["yaw_rate"] for row in messages_of["vehicle_monitor"]] == pytest.approx([np.degrees(0.1)] * 3)
        # the drive's velocity is constant in the world: an inertial sensor feels gravity alone
        np.testing.assert_allclose(
            [row["linear_accel"] for row in messages_of["ms_imu"]], [[0, 0, GRAVITY]] * 3, atol=1e-9
        )
        assert messages_of["meta"]["pose"]["message_count"] == 3
        assert messages_of["meta"]["pose"]["message_freq"] == pytest.approx(10.0)


def test_motion_on_a_circle_feels_the_centripetal_acceleration() -> None:
    """10 m/s on a circle of 50 m: 2 m/s2 to the left, 0.2 rad/s."""
    times = np.arange(0, 1_000_001, 10_000)
    motion = []
    for angle in times * 1e-6 * 0.2:
        place = [50.0 * np.sin(angle), 50.0 * (1.0 - np.cos(angle)), 0.0]
        velocity = [10.0 * np.cos(angle), 10.0 * np.sin(angle), 0.0]
        motion.append((Pose.from_euler(place, yaw=angle), Twist(velocity, [0.0, 0.0, 0.2])))
    found = messages(times.tolist(), motion)
    # second order: the error is (omega dt)^2 / 3 of the acceleration at the ends
    np.testing.assert_allclose([row["accel"] for row in found["pose"]], [[0.0, 2.0, 0.0]] * 101, atol=1e-5)
    np.testing.assert_allclose([row["vel"] for row in found["pose"]], [[10.0, 0.0, 0.0]] * 101, atol=1e-9)
    np.testing.assert_allclose([row["linear_accel"] for row in found["ms_imu"]], [[0.0, 2.0, GRAVITY]] * 101, atol=1e-5)


def test_own_names_stay_without_the_option_and_one_frame_has_no_can_bus(tmp_path) -> None:
    export_nuscenes(SOURCE.subset(["street"], 1), tmp_path / "one", raw_radar=False)
    assert not (tmp_path / "one" / "can_bus").exists()
    scene = json.loads((tmp_path / "one" / "v1.0-mini" / "scene.json").read_text())[0]
    assert scene["name"] == "street" and "scarl_scene" not in scene
    export_nuscenes(SOURCE.subset(["lane"], 2), tmp_path / "two", raw_radar=False, official_names=True)
    scene = json.loads((tmp_path / "two" / "v1.0-mini" / "scene.json").read_text())[0]
    assert (scene["name"], scene["scarl_scene"]) == ("scene-0103", "lane")
    names = {path.name for path in (tmp_path / "two" / "can_bus").iterdir()}
    assert names == {f"scene-0103_{kind}.json" for kind in ("pose", "ms_imu", "vehicle_monitor", "route", "meta")}


def test_names_follow_the_version_and_pass_over_scenes_without_can_bus() -> None:
    source = drive(num_frames=1, ends=("front",), scenes=[f"s{number:03d}" for number in range(200)])
    names = list(official_names(source, "v1.0-trainval").values())
    assert names[0] == "scene-0001" and len(set(names)) == 200
    assert set(names) <= {f"scene-{number:04d}" for number in _expanded(NUMBERS["train"])}
    assert not set(names) & {f"scene-{number:04d}" for number in _expanded(WITHOUT_CAN_BUS)}
    test = replace(source, splits={"test": [scene.name for scene in source.scenes[:100]]}, scenes=source.scenes[:100])
    assert set(official_names(test, "my-test").values()) <= {f"scene-{n:04d}" for n in _expanded(NUMBERS["test"])}


@pytest.mark.parametrize(
    ("version", "splits", "message"),
    [
        ("v1.0", {"train": ["a"]}, "ends with -trainval, -test, -mini"),
        ("v1.0-mini", {"test": ["a"]}, "train or val in v1.0-mini"),
        ("v1.0-trainval", {}, "None of scene a"),
    ],
)
def test_splits_that_a_version_has_not_are_refused(tmp_path, version, splits, message) -> None:
    source = replace(drive(num_frames=1, ends=("front",), scenes=("a",)), splits=splits)
    with pytest.raises(ParameterRangeError, match=message):
        export_nuscenes(source, tmp_path / "x", version=version, official_names=True)
    assert not list(tmp_path.iterdir())


def test_more_scenes_than_names_are_refused(tmp_path) -> None:
    source = drive(num_frames=1, ends=("front",), scenes=[f"s{number}" for number in range(9)])
    with pytest.raises(ParameterRangeError, match="8 with official names"):
        export_nuscenes(source, tmp_path / "x", official_names=True)
