"""Typical mistakes at a prompt: each is an error of the project that says what was meant."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import scarl_sionna as ss
from camera_lidar.camera import Camera
from camera_lidar.lidar import Lidar
from scarl_sionna.core.errors import InputTypeError, ScarlError, SpecError, UnknownFieldError
from scarl_sionna.core.prompt.arguments import check_radians
from scarl_sionna.core.prompt.refusals import home_of, in_our_unit, parts_of, scaled
from scarl_sionna.core.specs.camera import CameraSpec
from tests.lane_scene import lane_scene

RADAR = ss.RadarSpec().with_(num_chirps=8, num_samples=16)
POSE = ss.Pose([5.0, 0.0, 1.0])


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> ss.World:
    return ss.load_scene(lane_scene(tmp_path_factory.mktemp("scene")))


def _rda() -> Any:
    return ss.range_doppler_angle(np.zeros((12, 8, 16), np.complex64), RADAR)


def _set(item: Any, name: str, value: Any) -> None:
    setattr(item, name, value)


MISTAKES: list[tuple[str, Callable[[ss.World], Any], str]] = [
    ("misspelt field", lambda w: ss.RadarSpec(bandwith=1e9), "did you mean 'bandwidth'"),
    ("misspelt field of a copy", lambda w: RADAR.with_(num_chrips=8), "did you mean 'num_chirps'"),
    ("field of a part", lambda w: CameraSpec(k1=0.1), r"lens=BrownConrady\(k1="),
    (
        "field of a part, misspelt",
        lambda w: ss.LidarSpec(scan={"kind": "raster", "num_azimut": 3}),
        "did you mean 'num_azimuth'",
    ),
    ("number with its unit", lambda w: ss.RadarSpec().with_(bandwidth="300 MHz"), r"write 3e\+08: numbers are in Hz"),
    ("frequency in GHz", lambda w: ss.RadarSpec().with_(start_frequency=77), r"7.7e\+10 for 77 GHz"),
    ("time in microseconds", lambda w: ss.RadarSpec().with_(ramp_time=30), "3e-05 for 30 us"),
    ("a word for another", lambda w: ss.RadarSpec(multiplexing="tmd"), "did you mean 'tdm'"),
    ("a frozen field set", lambda w: _set(ss.Weather(), "rain_rate", 5.0), r"with_\(rain_rate=5\)"),
    ("unknown radar", lambda w: ss.RadarSpec.preset("awr1843"), "did you mean 'awr1843boost'"),
    ("unknown scene", lambda w: ss.load_scene("highway_gardrail"), "did you mean 'highway_guardrail'"),
    ("a number for a scene", lambda w: ss.load_scene(3), "name of a scene"),
    ("unknown weather", lambda w: w.with_weather("hevy_rain"), "did you mean 'heavy_rain'"),
    ("unknown lighting", lambda w: w.with_lighting("nigth"), "did you mean 'night'"),
    ("unknown actor", lambda w: w.at(0.0).actor_pose("egoo"), "did you mean 'ego'"),
    ("a text for a time", lambda w: w.at("0.5"), r"world.at\(0.5\)"),
    ("many times", lambda w: w.at(np.arange(3)), "for one in times"),
    ("a negative time", lambda w: w.at(-1.0), "ask for a time inside"),
    ("a world for a state", lambda w: ss.solve_paths(w, RADAR, POSE), r"world.at\(time\)"),
    ("a name for a radar", lambda w: ss.solve_paths(w.at(0.0), "awr1843boost", POSE), "RadarSpec.preset"),
    ("a tuple for a pose", lambda w: ss.solve_paths(w.at(0.0), RADAR, (5.0, 0.0, 1.0)), r"ss.Pose\("),
    ("unknown method", lambda w: ss.solve_paths(w.at(0.0), RADAR, POSE, "raycats"), "did you mean 'raycast'"),
    ("two coordinates", lambda w: ss.Pose([1.0, 2.0]), r"write Pose\(\[x, y, z\]\)"),
    ("a text for a position", lambda w: ss.Pose("ego"), r"write Pose\(\[x, y, z\]\)"),
    ("angles for a quaternion", lambda w: ss.Pose([0, 0, 0], [0.0, 0.0, 90.0]), "from_euler"),
    ("degrees for radians", lambda w: ss.Pose.from_euler([0, 0, 0], yaw=90.0), r"np.radians\(90\)"),
    ("degrees of a direction", lambda w: ss.rcs("none.ply", 77e9, 90.0, 0.0), r"np.radians\(90\)"),
    ("RCS in GHz", lambda w: ss.rcs("none.ply", 77.0, 1.5, 0.0), r"7.7e\+10 for 77 GHz"),
    ("a name for a rig", lambda w: ss.observe(w, "scarl"), r"ss.Rig.preset\('scarl'\)"),
    ("a state for a world", lambda w: ss.observe(w.at(0.0), ss.Rig.front()), "state.world"),
    (
        "a suite for a sensor",
        lambda w: ss.Rig.scarl()["front/radar"],
        "did you mean 'front_left/radar'|'front_center/radar'",
    ),
    ("a number for a sensor", lambda w: ss.Rig.scarl()[0], "sensors go by their names"),
    (
        "a seed for a generator",
        lambda w: ss.synthesize(ss.point_targets([[9, 0, 0]], [[0, 0, 0]], 1.0, RADAR, ss.Pose()), RADAR, rng=0),
        "default_rng",
    ),
    ("a seed for a camera", lambda w: Camera(CameraSpec(width=8, height=8)).observe(w.at(0.0), POSE, 3), "default_rng"),
    ("a seed for a lidar", lambda w: Lidar(ss.LidarSpec()).observe(w.at(0.0), POSE, 3), "default_rng"),
    ("a map without angles", lambda w: ss.detect(_rda().range_doppler), "range_doppler_angle"),
    ("a cube without its radar", lambda w: ss.range_doppler(np.zeros((12, 8, 16))), "RadarSpec"),
    ("raw data for a cube", lambda w: ss.range_doppler(np.zeros((4, 24, 16)), RADAR), "virtual_cube"),
    ("no dataset", lambda w: ss.open_dataset("nowhere"), "export"),
]


@pytest.mark.parametrize(("make", "hint"), [row[1:] for row in MISTAKES], ids=[row[0] for row in MISTAKES])
def test_a_typical_mistake_says_what_was_meant(world: ss.World, make: Callable[[ss.World], Any], hint: str) -> None:
    with pytest.raises(ScarlError, match=hint):
        make(world)


def test_errors_are_also_what_python_raises() -> None:
    with pytest.raises(TypeError):
        ss.Weather(rain=3)  # as of a function without this argument
    with pytest.raises(ValueError, match="rain_rate"):
        ss.Weather(rain_rate=-3)
    with pytest.raises(AttributeError):
        ss.Weather().rain_rate = 3.0  # type: ignore[misc]


def test_errors_keep_their_data() -> None:
    with pytest.raises(UnknownFieldError) as unknown:
        ss.LidarSpec(scan={"kind": "raster", "num_azimut": 3})
    assert unknown.value.model is ss.LidarSpec and unknown.value.owner is ss.RasterScan
    assert unknown.value.path[-1] == "num_azimut" and set(ss.RasterScan.model_fields) == set(unknown.value.known)
    with pytest.raises(SpecError) as bad:
        ss.Weather(rain_rate=1e3)
    assert (bad.value.model, bad.value.path, bad.value.allowed) == (
        ss.Weather,
        ("rain_rate",),
        "less than or equal to 200 [mm/h]",
    )
    with pytest.raises(InputTypeError) as wrong:
        ss.Rig.scarl()[0]
    assert (wrong.value.name, wrong.value.value) == ("name", 0)


def test_what_is_right_is_not_refused(world: ss.World) -> None:
    for time in (1, 1.0, np.float32(1.0), np.int64(1)):
        assert world.at(time).time == 1.0
    assert ss.Pose.from_euler((0, 0, 0), yaw=-2.0 * np.pi).yaw == pytest.approx(0.0, abs=1e-12)
    assert ss.Pose.from_heading((0, 0, 0), 100.0 * np.pi).yaw == pytest.approx(0.0, abs=1e-12)  # 50 turns
    check_radians("yaw", np.array([-4.0, 4.0]) * np.pi)


def test_units_that_people_write() -> None:
    assert in_our_unit("77 GHz", "Hz") == "write 7.7e+10: numbers are in Hz, without a unit"
    assert in_our_unit("50km/h", "m/s").startswith("write 13.8889:")
    assert in_our_unit("50 km/h", "m") == "write a number in m, without a unit"
    assert in_our_unit("fast", "m/s") == "" and in_our_unit("3 m", "") == ""
    assert scaled(77.0, "Hz", {"ge": 1e9}) == "numbers are in Hz: write 7.7e+10 for 77 GHz"
    assert scaled(-77.0, "Hz", {"ge": 1e9}) == "" and scaled(3.0, "dB", {"ge": 5.0}) == ""


def test_a_field_of_no_part_has_no_hint() -> None:
    assert home_of("zzzzzz", parts_of(CameraSpec)) is None and home_of("k1", parts_of(CameraSpec)) is not None
    with pytest.raises(UnknownFieldError) as unknown:
        CameraSpec(zzzzzz=3)
    assert unknown.value.remedy == "" and str(unknown.value).endswith(")")
