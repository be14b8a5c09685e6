"""Other radars from a scenario file to stored data: in a street with blockage, on actors, in the rig."""

from __future__ import annotations

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.core.errors import ParameterRangeError, PlacementError, ScarlError
from scarl_sionna.fusion import Rig, SensorMount
from scarl_sionna.radar.interference.heard import hear
from scarl_sionna.radar.weather.attenuation import weather_attenuation
from scarl_sionna.scenario.spec.scenario import ScenarioSpec
from tests.exports import FEW_RAYS, PLACE, scene_file
from tests.scenes import Thing, box, plane, write_scene

ISOTROPIC = ss.AntennaArray(
    tx_positions=((0.0, 0.0, 0.0),), rx_positions=((0.0, 0.0, 0.0),), pattern={"kind": "isotropic"}
)
SMALL = ss.RadarSpec(array=ISOTROPIC).with_(num_chirps=16, num_samples=64)
CAMERA = SensorMount("a/camera", "camera", ss.CameraSpec(width=32, height=18, samples_per_pixel=1), PLACE)
FACING = (0.0, 0.0, 0.0, 1.0)
OTHER = SMALL.with_(bandwidth=330e6, start_frequency=76.98e9, num_chirps=64, noise_figure_db=9.0)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory):
    return tmp_path_factory.mktemp("interference")


def walled(tmp_path, *things):
    road = Thing("road", plane(200.0, 60.0), "Roads", material="steel", is_object=False)
    return ss.load_scene(write_scene(tmp_path, instances=[road, *things])).at(0.0)


def test_paths_are_the_line_of_sight_and_reflections_by_image_theory(tmp_path) -> None:
    here, there = ss.Pose([30.0, 0.0, 1.5], FACING), ss.Pose([0.0, 0.0, 0.5])
    state = walled(tmp_path, Thing("wall", plane(200.0, 6.0, (15.0, 8.0, 3.0), (0, -1, 0)), "Wall", material="steel"))
    paths = ss.one_way_paths(SMALL, here, there, state)
    straight = np.hypot(30.0, 1.0)
    ground, wall, both = np.hypot(30.0, 2.0), np.sqrt(901.0 + 256.0), np.sqrt(904.0 + 256.0)
    assert np.sort(paths.length) == pytest.approx(np.sort([straight, ground, wall, both]), abs=1e-6)
    free = ss.one_way_paths(SMALL, here, there)
    first = paths.length.argmin()
    assert paths.a[first] == pytest.approx(free.a[0], abs=1e-9 * float(np.abs(free.a).max()))
    assert paths.length[first] == pytest.approx(free.length[0], abs=1e-9)
    assert paths.length_rate[first] == pytest.approx(free.length_rate[0], abs=1e-12)
    assert np.abs(paths.a[1:, 0, 0]) == pytest.approx(SMALL.wavelength / (4 * np.pi * paths.length[1:]), rel=0.02)


def test_rain_lowers_them_by_its_attenuation(tmp_path) -> None:
    state = walled(tmp_path)
    rain = ss.Weather(rain_rate=50.0)
    wet = state.world.with_weather(rain).at(0.0)
    here, there = ss.Pose([900.0, 0.0, 30.5], FACING), ss.Pose([0.0, 0.0, 30.5])
    dry, lowered = (np.abs(ss.one_way_paths(SMALL, here, there, one).a[0, 0, 0]) for one in (state, wet))
    lost = 0.9 * weather_attenuation(rain, SMALL.center_frequency, "V")
    assert lost > 5.0
    assert 20.0 * np.log10(dry / lowered) == pytest.approx(lost, abs=1e-6)


def test_what_stands_between_blocks_the_line_of_sight(tmp_path) -> None:
    lorry = Thing("lorry", box([4.0, 2.5, 4.0], [15.0, 0.0, 2.2]))
    state = walled(tmp_path, lorry)
    paths = ss.one_way_paths(SMALL, ss.Pose([30.0, 0.0, 1.5], FACING), ss.Pose([0.0, 0.0, 0.5]), state)
    assert not np.isclose(paths.length, np.hypot(30.0, 1.0), atol=0.01).any()


def rig_of(*interferers: ss.Interferer) -> Rig:
    settings = FEW_RAYS.with_(interferers=interferers, noise=False, method="raycast")
    second = SensorMount("side/radar", "radar", OTHER, ss.Pose([2.0, 0.5, 1.0]), FEW_RAYS.with_(method="raycast"))
    return Rig("two", (SensorMount("front/radar", "radar", SMALL, PLACE, settings), second))


def test_no_interferers_change_no_byte_and_one_stands_in_the_data(folder) -> None:
    world = ss.load_scene(scene_file(folder))
    plain = ss.observe(world, rig_of()).radars["front/radar"]
    assert plain.interference_hit is None and plain.interference_power is None
    assert "interferers" not in plain.diagnostics and "interferers" not in rig_of().to_dict()["sensors"][0]["settings"]
    radar = SMALL.with_(full_scale_dbm=-60.0)
    ahead = ss.Interferer(
        radar=OTHER, position=(45.0, 6.0, 0.8), quaternion=FACING, velocity=(-8.0, 0.0, 0.0), start_time=0.0
    )
    frame = ss.observe(world, rig_of(ahead)).radars["front/radar"]
    mount = world.at(0.0).mount("ego", PLACE)
    paths = ss.one_way_paths(OTHER, ss.Mount(ahead.pose, ss.Twist(ahead.velocity)), mount, world.at(0.0))
    expected = ss.synthesize_interference(paths, OTHER, radar, 0.0)
    left = frame.adc - plain.adc
    assert left == pytest.approx(expected, abs=2.0 * frame.adc_scale)
    assert frame.num_paths == plain.num_paths
    hit = frame.interference_hit
    assert hit.shape == (16, 64) and 0.01 < hit.mean() < 0.3
    assert np.abs(expected[0][hit]).min() > np.abs(expected[0][~hit]).max()
    rd = ss.range_doppler(ss.virtual_cube(expected, radar), radar)
    assert frame.interference_power == pytest.approx(np.abs(rd.data[0]) ** 2, rel=1e-3)
    assert np.array_equal(frame.cell_instance, plain.cell_instance)  # labels of objects are those of the echoes
    source = frame.diagnostics["interferers"][0]
    assert source["num_paths"] == paths.num_paths and source["start_time"] == 0.0


def test_one_with_a_velocity_goes_straight_on_from_its_place_at_time_zero(folder) -> None:
    world = ss.load_scene(scene_file(folder))
    passing = ss.Interferer(radar=OTHER, position=(45.0, 6.0, 3.0), quaternion=FACING, velocity=(-8.0, 1.0, 0.0))
    vehicle = ss.Mount(ss.Pose([0.0, 0.0, 2.0]), ss.Twist([3.0, 0.0, 0.0]))
    for time in (0.0, 0.05):
        frame = ss.observe(world, rig_of(passing, ss.Interferer(sensor="side/radar")), time, vehicle=vehicle)
        far, near = (
            10.0 ** (one["path_gain_db"] / 20.0) for one in frame.radars["front/radar"].diagnostics["interferers"]
        )
        there = passing.pose.position + time * np.array(passing.velocity)
        apart = np.linalg.norm(there - vehicle.at(PLACE).pose.position)
        assert OTHER.wavelength / (4.0 * np.pi * far) == pytest.approx(apart, rel=1e-6)
        apart = np.linalg.norm(PLACE.position - [2.0, 0.5, 1.0])  # on the vehicle, wherever that is said to be
        assert OTHER.wavelength / (4.0 * np.pi * near) == pytest.approx(apart, rel=1e-6)


def test_one_that_has_gone_by_the_clock_of_unix_is_told(tmp_path) -> None:
    passing = ss.Interferer(radar=OTHER, position=(45.0, 6.0, 3.0), quaternion=FACING, velocity=(-8.0, 1.0, 0.0))
    later = walled(tmp_path).world.at(1.76e9)
    with pytest.warns(ss.ScarlWarning, match="1.42e\\+07 km away at 1760000000 s: it is not heard"):
        found = hear(later, SMALL, ss.Mount(ss.Pose([0.0, 0.0, 2.0])), [passing], np.random.default_rng(0))
    assert found.sources[0]["num_paths"] == 0


def test_start_times_that_are_not_given_follow_the_seed(folder) -> None:
    world = ss.load_scene(scene_file(folder))
    other = ss.Interferer(radar=OTHER, actor="car", position=(-2.6, 0.0, 0.8), quaternion=FACING)
    starts = [
        ss.observe(world, rig_of(other), seed=seed).radars["front/radar"].diagnostics["interferers"][0]["start_time"]
        for seed in (0, 0, 1)
    ]
    assert starts[0] == starts[1] != starts[2]
    assert all(0.0 <= start < OTHER.frame_time for start in starts)


def heard(frame, *names: str) -> list[list[float]]:
    return [[one["start_time"] for one in frame.radars[name].diagnostics["interferers"]] for name in names]


def test_all_radars_of_a_rig_hear_another_at_one_time_and_each_other_at_opposite_times(folder) -> None:
    world = ss.load_scene(scene_file(folder))
    foreign = ss.Interferer(radar=OTHER, actor="car", position=(-2.6, 0.0, 0.8), quaternion=FACING)
    names = ("front/radar", "side/radar")
    every = (foreign, *(ss.Interferer(sensor=name, frame_interval=0.05) for name in names))
    rig = rig_of().with_radar(ss.RadarSettings(interferers=every))
    here, there = heard(ss.observe(world, rig, seed=3), *names)
    assert here[1] == -there[1] != 0.0 and max(map(abs, here)) < 0.05
    assert here[0] - there[0] == pytest.approx(here[1])  # by as much as their own frames start apart
    assert heard(ss.observe(world, rig, seed=3, only=names[1:]), names[1]) == [there]
    assert heard(ss.observe(world, rig, seed=3, only=names[:1]), names[0]) == [here]
    later = heard(ss.observe(world, rig, 0.05, seed=3), *names)
    assert later[0] != here and later[0][0] - later[1][0] == pytest.approx(later[0][1])
    for intervals in ((None, None), (0.05, 0.05), (0.05, None), (0.05, 0.08)):  # lists of their own
        first, second = (ss.Interferer(sensor=one, frame_interval=t) for one, t in zip(names, intervals, strict=True))
        listens = FEW_RAYS.with_(interferers=(first, foreign), method="raycast")
        side = SensorMount(names[1], "radar", OTHER, ss.Pose([2.0, 0.5, 1.0]), listens)
        two = Rig("two", (rig_of(second, foreign).sensors[0], side))
        here, there = heard(ss.observe(world, two, seed=3), *names)
        assert here[0] == -there[0] != 0.0 and here[1] - there[1] == pytest.approx(here[0])
    alone = SensorMount(names[1], "radar", OTHER, ss.Pose([2.0, 0.5, 1.0]), listens.with_(interferers=(foreign,)))
    here, there = heard(ss.observe(world, Rig("two", (rig_of(foreign).sensors[0], alone)), seed=3), *names)
    assert here == there and 0.0 <= here[0] < OTHER.frame_time  # none hears another of the rig


def test_a_scenario_file_brings_them_into_a_dataset(folder, tmp_path) -> None:
    rig_of().save(tmp_path / "rig.yaml")
    text = f"""
scene: {scene_file(folder)}
rig: {tmp_path / "rig.yaml"}
num_frames: 1
name: one
radar:
  interferers:
    - sensor: side/radar
      start_time: 1.0e-6
    - radar: awr1843boost_3d
      actor: car
      position: [-2.6, 0.0, 0.8]
      quaternion: [0.0, 0.0, 0.0, 1.0]
"""
    (tmp_path / "drive.yaml").write_text(text)
    spec = ScenarioSpec.load(tmp_path / "drive.yaml")
    assert ScenarioSpec(**spec.to_dict()) == spec
    both = ss.observe(ss.load_scene(spec.scene), rig_of().with_radar(spec.radar)).radars
    heard = {name: len(radar.diagnostics["interferers"]) for name, radar in both.items()}
    assert heard == {"front/radar": 2, "side/radar": 1}  # a radar leaves itself out
    rig = rig_of(*spec.radar.interferers)
    rig.save(tmp_path / "rig.yaml")
    assert Rig.load(tmp_path / "rig.yaml")["front/radar"].settings == rig["front/radar"].settings
    spec = spec.with_(radar=None)
    ss.export([spec], tmp_path / "out")
    stored = ss.open_dataset(tmp_path / "out")[0].radar
    radar = stored["front/radar"].to_result()
    direct = ss.observe(ss.load_scene(spec.scene), rig, seed=spec.seed).radars["front/radar"]
    assert np.array_equal(radar.adc_int, direct.adc_int)
    assert np.array_equal(radar.interference_hit, direct.interference_hit) and radar.interference_hit.dtype == bool
    assert np.array_equal(radar.interference_power, direct.interference_power)
    assert len(radar.diagnostics["interferers"]) == 2
    assert stored["side/radar"].interference_hit is None


def test_what_is_refused_says_so(folder) -> None:
    with pytest.raises(ParameterRangeError, match="either radar or sensor"):
        ss.Interferer()
    with pytest.raises(ParameterRangeError, match="no place beside sensor"):
        ss.Interferer(sensor="side/radar", position=(1.0, 0.0, 0.0))
    with pytest.raises(ParameterRangeError, match="frame_interval"):
        ss.Interferer(radar="awr1843boost", frame_interval=1e-3)
    with pytest.raises(ParameterRangeError, match="no velocity beside actor"):
        ss.Interferer(radar="awr1843boost", actor="car", velocity=(1.0, 0.0, 0.0))
    world = ss.load_scene(scene_file(folder))
    with pytest.raises(ScarlError, match="nobody"):
        ss.observe(world, rig_of(ss.Interferer(radar=OTHER, actor="nobody")))
    at_the_radar = tuple(PLACE.position.tolist())
    with pytest.raises(PlacementError, match="one place"):
        ss.observe(world, rig_of(ss.Interferer(radar=OTHER, actor="ego", position=at_the_radar)))
    with pytest.raises(ScarlError, match="no/radar"):
        ss.observe(world, rig_of(ss.Interferer(sensor="no/radar")))
    with_camera = ss.Rig("c", (*rig_of(ss.Interferer(sensor="a/camera")).sensors, CAMERA))
    with pytest.raises(ParameterRangeError, match="a radar of the rig"):
        ss.observe(world, with_camera)
    with pytest.raises(ScarlError, match="one place"):
        ss.one_way_paths(OTHER, ss.Pose(), ss.Pose())
