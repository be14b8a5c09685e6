"""Rig: SCaRL's placement, files, and what it refuses."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from scarl_sionna.core.errors import ParameterRangeError, UnknownNameError
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.registry import spec_type
from scarl_sionna.core.settings.accuracy import Accuracy
from scarl_sionna.core.settings.auto import AutoSettings
from scarl_sionna.core.settings.radar import QUALITIES, RadarSettings
from scarl_sionna.core.specs.camera import CameraSpec
from scarl_sionna.core.specs.lidar.receiver import HeterodyneReceiver
from scarl_sionna.core.specs.lidar.spec import LidarSpec
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.fusion import Rig, SensorMount

SUITES = ("front_left", "front_center", "front_right", "back_left", "back_center", "back_right")
SENSORS = ("rgb", "semantic", "depth", "lidar", "radar")


def test_scarl_has_six_suites_of_five_sensors() -> None:
    assert Rig.scarl().names == tuple(f"{suite}/{sensor}" for suite in SUITES for sensor in SENSORS)


def test_scarl_suites_are_0_4_m_apart_along_a_horizontal_and_look_outward() -> None:
    rig = Rig.scarl()
    for end, forward in (("front", 1.0), ("back", -1.0)):
        poses = [rig[f"{end}_{side}/radar"].vehicle_from_sensor for side in ("left", "center", "right")]
        # exact: the numbers are written, not computed
        assert [pose.position[1] for pose in poses] == [0.4, 0.0, -0.4]
        assert {(pose.position[0], pose.position[2]) for pose in poses} == {(2.36 * forward, 0.8)}
        for pose in poses:
            np.testing.assert_array_equal(pose.rotate([1.0, 0.0, 0.0]), [forward, 0.0, 0.0])
            np.testing.assert_array_equal(pose.rotate([0.0, 0.0, 1.0]), [0.0, 0.0, 1.0])


def test_the_five_sensors_of_a_suite_share_one_place_and_one_projection() -> None:
    rig = Rig.scarl()
    cameras = [rig[f"back_left/{name}"].spec for name in ("rgb", "semantic", "depth")]
    assert all(isinstance(camera, CameraSpec) for camera in cameras)
    assert len({camera.intrinsics.tobytes() for camera in cameras}) == 1
    assert [camera.images for camera in cameras] == [("rgb",), ("semantic", "instance"), ("depth",)]
    places = {rig[f"back_left/{name}"].vehicle_from_sensor.position.tobytes() for name in SENSORS}
    assert len(places) == 1


def test_full_quality_is_the_default_of_every_spec_and_draft_is_cheaper() -> None:
    full, draft = Rig.front("full"), Rig.front("draft")
    assert full["front_center/radar"].spec == RadarSpec.preset("awr1843boost")
    assert full["front_center/lidar"].spec == LidarSpec()
    assert full["front_center/rgb"].spec == CameraSpec(images=("rgb",))
    assert draft["front_center/radar"].settings.raycast.num_rays < full["front_center/radar"].settings.raycast.num_rays
    assert full["front_center/radar"].settings == RadarSettings()
    assert draft["front_center/rgb"].spec.width < full["front_center/rgb"].spec.width
    shots = [
        rig["front_center/lidar"].spec.num_azimuth * rig["front_center/lidar"].spec.num_elevation
        for rig in (draft, full)
    ]
    assert shots[0] < shots[1]
    # the waveform is the paper's at any quality
    assert draft["front_center/radar"].spec == full["front_center/radar"].spec


def test_radar_of_the_users_choice_is_in_every_suite() -> None:
    board = RadarSpec.preset("awr1843boost_3d")
    assert all(m.spec == board for m in Rig.scarl(radar=board).sensors if m.kind == "radar")


@pytest.mark.parametrize("suffix", ["yaml", "json"])
def test_a_file_gives_the_rig_back(tmp_path, suffix) -> None:
    rig = Rig.scarl("draft", radar=RadarSpec.preset("awr1843boost_3d"))
    path = tmp_path / f"rig.{suffix}"
    rig.save(path)
    again = Rig.load(path)
    assert again.to_dict() == rig.to_dict()
    assert [m.spec for m in again.sensors] == [m.spec for m in rig.sensors]


def test_a_rotated_pose_keeps_every_bit_through_a_file(tmp_path) -> None:
    rng = np.random.default_rng(5)
    poses = [Pose(rng.normal(size=3), rng.normal(size=4)) for _ in range(200)]
    rig = Rig("many", tuple(SensorMount(f"lidar_{i}", "lidar", LidarSpec(), pose) for i, pose in enumerate(poses)))
    rig.save(tmp_path / "rig.json")
    for mount, pose in zip(Rig.load(tmp_path / "rig.json").sensors, poses, strict=True):
        assert mount.vehicle_from_sensor.quaternion.tobytes() == pose.quaternion.tobytes()


def test_a_file_may_leave_out_what_keeps_its_default() -> None:
    rig = Rig.from_dict(
        {"name": "one", "sensors": [{"name": "r", "kind": "radar", "vehicle_from_sensor": {"position": [2, 0, 1]}}]}
    )
    assert rig["r"].spec == RadarSpec()


def test_subset_keeps_the_matching_sensors_in_order() -> None:
    rig = Rig.scarl().subset("front_*/radar", "back_left/rgb")
    assert rig.names == ("front_left/radar", "front_center/radar", "front_right/radar", "back_left/rgb")
    with pytest.raises(UnknownNameError, match=r"sensor pattern 'top/\*'"):
        Rig.scarl().subset("front_*/radar", "top/*")


def test_two_sensors_of_one_name_are_refused() -> None:
    mount = SensorMount("a", "lidar", LidarSpec(), Pose())
    with pytest.raises(ParameterRangeError, match="a more than once"):
        Rig("r", (mount, mount))


def test_a_rig_without_sensors_is_refused() -> None:
    with pytest.raises(ParameterRangeError, match="at least one sensor"):
        Rig("r", ())


def test_an_unknown_kind_names_the_known_ones() -> None:
    with pytest.raises(UnknownNameError, match=r"unknown sensor kind 'lidr'.*lidar.*did you mean 'lidar'"):
        SensorMount("a", "lidr", LidarSpec(), Pose())


def test_a_spec_of_another_kind_is_refused() -> None:
    with pytest.raises(ParameterRangeError, match="a RadarSpec for the sensor kind 'radar'"):
        SensorMount("a", "radar", LidarSpec(), Pose())


@pytest.mark.parametrize("name", ["", "../up", "/root", "a//b", "a/", "a b", "a\n", "."])
def test_a_name_that_is_no_safe_folder_is_refused(name) -> None:
    with pytest.raises(ParameterRangeError, match=r"SensorMount\.name"):
        SensorMount(name, "lidar", LidarSpec(), Pose())


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("name: a", "without sensors"),
        ("[1, 2]", "a mapping with the keys"),
        ("{name: a, sensors: [{name: x, kind: radar}]}", "without vehicle_from_sensor"),
        ("{name: a, sensors: [{name: x, kind: radar, vehicle_from_sensor: {position: [1, 2]}}]}", "three finite"),
        ("{name: a, sensors: [{name: x, kind: sonar, vehicle_from_sensor: {position: [1, 2, 3]}}]}", "sensor kind"),
        ("{name: a, sensors: 3, colour: red}", "unknown key of rig 'colour'"),
        (
            "{name: a, sensors: [{name: x, kind: radar, spec: {bandwith: 1}, vehicle_from_sensor: {position: [1, 2, "
            "3]}}]}",
            r"RadarSpec\.bandwith",
        ),
        ("{", "readable YAML or JSON"),
        ("{name: a, sensors: 3}", r"the form of Rig\.to_dict"),
        ("{name: a, sensors: [{name: 5, kind: radar, vehicle_from_sensor: {position: [1, 2, 3]}}]}", "form of Rig"),
        ("{name: a, sensors: [{name: x, kind: 7, vehicle_from_sensor: {position: [1, 2, 3]}}]}", "form of Rig"),
        ("{name: a, sensors: [{name: x, kind: radar, vehicle_from_sensor: {position: far}}]}", "form of Rig"),
        (
            "{name: a, sensors: [{name: x, kind: radar, spec: [1], vehicle_from_sensor: {position: [1, 2, 3]}}]}",
            "form of Rig",
        ),
    ],
)
def test_a_bad_file_says_what_is_wrong(tmp_path, text, message) -> None:
    path = tmp_path / "rig.yaml"
    path.write_text(text)
    with pytest.raises((ParameterRangeError, UnknownNameError), match=message) as caught:
        Rig.load(path)
    assert str(caught.value).startswith(str(path)) or "rig file" in str(caught.value)
    assert "bandwith" not in text or "sensor 'x'" in str(caught.value)


def test_a_missing_file_and_an_unknown_preset_or_quality() -> None:
    with pytest.raises(ParameterRangeError, match="rig file"):
        Rig.load("does/not/exist.yaml")
    with pytest.raises(UnknownNameError, match="did you mean 'scarl'"):
        Rig.preset("scrl")
    with pytest.raises(UnknownNameError, match="quality 'best'"):
        Rig.scarl("best")


def test_to_dict_is_plain_data() -> None:
    assert json.loads(json.dumps(Rig.scarl().to_dict())) == Rig.scarl().to_dict()


def mount_of(kind: str, **spec: object) -> SensorMount:
    place = {"name": "roof", "kind": kind, "vehicle_from_sensor": {"position": [0.0, 0.0, 1.9]}}
    return SensorMount.from_dict({**place, "spec": spec})


@pytest.mark.parametrize(
    ("kind", "preset", "field", "value"),
    [
        ("lidar", "hdl32e", "max_distance", 60.0),
        ("radar", "awr1642", "num_chirps", 24),
        ("scanning_radar", "ras6", "rotation_rate", 2.0),
    ],
)
def test_a_rig_file_names_devices(kind: str, preset: str, field: str, value: float, tmp_path: Path) -> None:
    """A preset in a file, and fields that replace its own; what is saved is what it stands for."""
    device = spec_type(kind).preset(preset)
    assert mount_of(kind, preset=preset).spec == device
    changed = mount_of(kind, preset=preset, **{field: value})
    assert changed.spec == device.with_(**{field: value}) != device
    Rig("one", (changed,)).save(tmp_path / "rig.yaml")
    text = (tmp_path / "rig.yaml").read_text()
    assert preset not in text and Rig.load(tmp_path / "rig.yaml")["roof"].spec == changed.spec


def test_a_part_of_a_named_device_changes_field_by_field() -> None:
    device = LidarSpec.preset("os1_64")
    part = mount_of("lidar", preset="os1_64", receiver={"range_step": 0.0})
    assert part.spec == device.with_(receiver=device.receiver.with_(range_step=0.0))
    other = mount_of("lidar", preset="os1_64", receiver={"kind": "heterodyne"})
    assert other.spec.receiver == HeterodyneReceiver() and other.spec.scan == device.scan
    radar = mount_of("radar", preset="awr1642", noise_figure_db=9.0, waveform={"num_chirps": 16})
    assert radar.spec == RadarSpec.preset("awr1642").with_(noise_figure_db=9.0, num_chirps=16)


def test_a_device_that_is_not_known_is_refused() -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'hdl32e'"):
        mount_of("lidar", preset="hdl32")
    with pytest.raises(ParameterRangeError, match="as text"):
        mount_of("lidar", preset=32)
    with pytest.raises(ParameterRangeError, match="a CameraSpec has none"):
        mount_of("camera", preset="day")


def test_a_rig_file_names_qualities() -> None:
    """What a radar's settings name stands over the quality of the scenario, `full` as well as `draft`."""
    place = {"name": "r", "kind": "radar", "vehicle_from_sensor": {"position": [4.0, 0.0, 0.6]}}
    for quality, other in (("draft", "full"), ("full", "draft")):
        mount = SensorMount.from_dict({**place, "settings": {"preset": quality, "noise": False}})
        expected = RadarSettings.preset(quality).with_(noise=False)
        assert mount.settings == expected == Rig("one", (mount,)).in_quality(other)["r"].settings
    part = SensorMount.from_dict({**place, "settings": {"preset": "draft", "raycast": {"num_rays": 7}}})
    assert part.settings.raycast.num_rays == 7 and part.settings.accuracy == RadarSettings.preset("draft").accuracy
    with pytest.raises(UnknownNameError, match="quality 'fast'"):
        SensorMount.from_dict({**place, "settings": {"preset": "fast"}})
    with pytest.raises(ParameterRangeError, match="a RadioSettings has none"):
        stations = [{"name": "mast", "position": [60.0, 0.0, 8.0]}]
        SensorMount.from_dict(
            {**place, "kind": "radio", "spec": {"stations": stations}, "settings": {"preset": "draft"}}
        )


def test_the_page_of_settings_has_the_numbers_of_the_qualities() -> None:
    page = (Path(__file__).parents[2] / "docs" / "radar_settings.md").read_text(encoding="utf-8")
    for quality in QUALITIES:
        settings = RadarSettings.preset(quality)
        rays, accuracy = settings.raycast.num_rays, settings.accuracy
        effort = f"{rays:,} | {accuracy.tube_budget:,} | {accuracy.channel_tolerance_db:g} dB"
        assert f"| `{quality}` | {effort} |" in page


def test_a_draft_asks_for_the_coarsest_level_and_nothing_beyond_it() -> None:
    """So few tubes pay for no more; `full` states what stands over it, and what is asked for stands over both."""
    draft, full = RadarSettings.preset("draft"), RadarSettings.preset("full")
    coarsest = AutoSettings().levels[0]
    assert draft.accuracy.channel_tolerance_db == coarsest.tolerance_db and draft.auto.look_share == 0.0
    assert full == RadarSettings() == draft.merged(full)
    asked = draft.merged(RadarSettings(accuracy=Accuracy(channel_tolerance_db=1.0)))
    assert asked.accuracy == draft.accuracy.with_(channel_tolerance_db=1.0)
