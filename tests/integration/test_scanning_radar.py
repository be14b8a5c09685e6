"""A scanning radar in the rig: the world moves on during its turn; stored, exported, and read back."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.batch import ExportSettings, export
from scarl_sionna.core.errors import PlacementError
from scarl_sionna.dataset import StoreOptions, write_dataset
from scarl_sionna.dataset.formats import convert
from scarl_sionna.dataset.readers.samples import FrameSamples
from scarl_sionna.engine.load import load_scene
from scarl_sionna.fusion import Rig, SensorMount
from scarl_sionna.radar.link import received_power
from scarl_sionna.radar.scanning.beats import _bending
from scarl_sionna.radar.scanning.sensor import ScanningRadar
from scarl_sionna.radar.synthesis.blocks import later
from scarl_sionna.radar.weather.attenuation import weather_attenuation
from scarl_sionna.radar.weather.mean_clutter import falling, mean_clutter_power
from tests.exports import contents, scene_file
from tests.scenes import Material, Thing, box, plane, write_scene

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
ROOF = ss.Pose([0.0, 0.0, 2.0])
SPEC = ss.ScanningRadarSpec(
    waveform=ss.Fmcw(start_frequency=76e9, bandwidth=600e6, ramp_time=500e-6, num_chirps=1, num_samples=512),
    num_azimuths=120,
    rotation_rate=4.0,
    num_range_bins=None,
)
FAST = ss.RadarSettings.of("raycast", num_rays=40_000, num_blocks=4, keep_power=True)
EGO = {"kind": "constant_twist", "position": [0, 0, 0], "velocity": [12, 0, 0]}
AHEAD = {"kind": "constant_twist", "position": [25, 3, 0], "velocity": [-8, 0, 0]}


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> ss.World:
    path = write_scene(
        tmp_path_factory.mktemp("street"),
        [
            Thing("ground", plane(400.0, 400.0), "Roads", "road", is_object=False),
            Thing("house", box((80.0, 6.0, 9.0), (40.0, 15.0, 4.5)), "Building"),
            Thing("behind", box((1.0, 8.0, 6.0), (-30.0, 0.0, 3.0)), "Building"),
        ],
        [
            Thing("ego", box((4.0, 1.8, 1.5), (0.0, 0.0, 0.8)), "Car", "steel", EGO),
            Thing("ahead", box((4.0, 1.8, 2.5), (0.0, 0.0, 1.3)), "Car", "steel", AHEAD),
        ],
        {"road": Material(radio="asphalt")},
        ego="ego",
    )
    return load_scene(path)


def rig(settings: ss.RadarSettings = FAST) -> Rig:
    return Rig("street", (SensorMount("roof/radar", "scanning_radar", SPEC, ROOF, settings),))


@pytest.fixture(scope="module")
def frame(world: ss.World) -> ss.Frame:
    return ss.observe(world, rig(), 0.25, seed=3)


@pytest.fixture(scope="module")
def scan(frame: ss.Frame) -> ss.RadarScan:
    return frame.radar_scans["roof/radar"]


def strongest(scan: ss.RadarScan, bearing: float, near: float, far: float) -> float:
    """Return the range of the strongest cell about a bearing, between two ranges [m]."""
    number = np.abs(np.angle(np.exp(1j * (scan.azimuth - bearing)))).argmin()
    inside = (scan.spec.range > near) & (scan.spec.range < far)
    return float(scan.spec.range[inside][scan.power[number, inside].argmax()])


def test_faces_stand_where_their_azimuth_met_them(scan: ss.RadarScan) -> None:
    """The house's front beside the car, the block behind it half a turn later, when the car has gone on."""
    spec, time = scan.spec, 0.25
    found = strongest(scan, np.pi / 2.0, 5.0, 30.0)
    assert found == pytest.approx(12.0, abs=0.4)
    number = np.abs(np.angle(np.exp(1j * (scan.azimuth - np.pi)))).argmin()
    sensor = 12.0 * (time + scan.time[number])
    assert scan.azimuth_pose[number, :3] == pytest.approx([sensor, 0.0, 2.0])
    assert scan.azimuth_twist[number] == pytest.approx([12.0, 0, 0, 0, 0, 0])
    expected = sensor + 29.5 + 12.0 * spec.doppler_range_shift  # it falls behind: seen too far by Doppler
    assert strongest(scan, np.pi, 20.0, 60.0) == pytest.approx(expected, abs=0.5 * spec.range_resolution)
    gap = 25.0 - 8.0 * time - 12.0 * time - 2.0
    bearing = np.arctan2(3.0, gap + 0.5)
    number = np.abs(np.angle(np.exp(1j * (scan.azimuth - bearing)))).argmin()
    nearer = gap - 20.0 * scan.time[number]
    shown = np.hypot(nearer, 3.0) - 20.0 * spec.doppler_range_shift
    assert strongest(scan, bearing, 10.0, 25.0) == pytest.approx(shown, abs=0.9)


def expected_power(world: ss.World, blocks: int) -> np.ndarray:
    """Return the mean power of every third azimuth: of all paths through the beam, without their interference [W]."""
    state = world.at(0.25)
    sensor = ScanningRadar(SPEC, FAST.changed(num_blocks=blocks, num_rays=150_000))
    out = np.zeros(SPEC.num_azimuths)
    for block in sensor._blocks(state, state.mount("ego", ROOF), None):
        paths = _bending(block.paths)
        for number in block.azimuths:
            if number % 3:
                continue
            moved = later(paths, float(SPEC.time[number]) - block.time)
            turn = ss.Pose.from_heading(np.zeros(3), SPEC.azimuth[number] - block.ahead)
            pose = moved.world_from_tx.compose(turn)
            seen = replace(moved, world_from_tx=pose, world_from_rx=pose)
            out[number] = received_power(seen, SPEC.ramp()).sum()
    return out[::3]


def test_any_number_of_blocks_shows_the_same_street(world: ss.World) -> None:
    """Blocks solve the world anew; between them it moves straight on."""
    often = expected_power(world, 12).reshape(8, 5).mean(axis=1)
    for blocks in (1, 4):
        apart = 10.0 * np.log10(expected_power(world, blocks).reshape(8, 5).mean(axis=1) / often)
        assert np.sqrt(np.mean(apart**2)) < 0.25 and np.abs(apart).max() < 0.5, blocks


def test_the_end_of_the_motion_is_carried_straight_on(world: ss.World) -> None:
    last = min(world.time_range[1], 1e9)
    sensor = ScanningRadar(SPEC, FAST.changed(noise=False))
    if not np.isfinite(last) or last > 1e6:
        last = 2.0
    state = world.at(last)
    found = sensor.observe(state, state.mount("ego", ROOF), np.random.default_rng(0))
    assert found.azimuth_pose[-1, 0] == pytest.approx(12.0 * (last + found.time[-1]))
    assert found.image.max() > 50


def test_same_seed_same_bytes_and_noise_is_the_only_difference(world, frame, scan) -> None:
    again = ss.observe(world, rig(), 0.25, seed=3).radar_scans["roof/radar"]
    assert again.image.tobytes() == scan.image.tobytes() and again.power.tobytes() == scan.power.tobytes()
    other = ss.observe(world, rig(), 0.25, seed=4).radar_scans["roof/radar"]
    assert other.image.tobytes() != scan.image.tobytes()
    assert "radar_scans" in repr(frame) and "image" in repr(scan)


def test_a_turn_comes_back_from_a_dataset_as_it_was(tmp_path, frame, scan) -> None:
    out = write_dataset(tmp_path / "out", rig().to_dict(), {"street": [frame]})
    dataset = ss.open_dataset(out)
    stored = dataset[0].radar_scan["roof"]
    again = dataset[0].to_frame().results["roof/radar"]
    assert type(again) is ss.RadarScan and again.spec == SPEC
    for name in scan.__dataclass_fields__:
        value = getattr(scan, name)
        if isinstance(value, np.ndarray):
            for found in (getattr(stored, name), getattr(again, name)):
                assert found.dtype == value.dtype and found.tobytes() == value.tobytes(), name
    assert again.floor_dbm == scan.floor_dbm and again.num_paths == scan.num_paths
    assert dict(again.diagnostics)["method"] == "raycast" and "seconds" not in again.diagnostics
    np.testing.assert_array_equal(FrameSamples(dataset)[0]["roof/radar:image"], scan.image)
    assert dataset.rig == rig().to_dict() and Rig.from_dict(rig().to_dict()).to_dict() == rig().to_dict()
    frame.plot("roof")  # the contact sheet, which has no place for it


@pytest.mark.parametrize("kind", ["hdf5", "mcap"])
def test_other_formats_hold_the_image_or_leave_it_out(tmp_path, frame, scan, kind) -> None:
    out = write_dataset(tmp_path / "out", rig().to_dict(), {"street": [frame]})
    convert(out, kind, tmp_path / f"street.{kind}")
    if kind == "hdf5":
        h5py = pytest.importorskip("h5py")
        with h5py.File(tmp_path / "street.hdf5") as file:
            np.testing.assert_array_equal(file["street/roof/radar/image"][0], scan.image)


@pytest.mark.slow  # workers of any rig: test_body_drives; a turn from a dataset, and the example's rig file: here
@pytest.mark.filterwarnings("ignore")
def test_workers_export_the_same_bytes(tmp_path) -> None:
    """A rig file, a scenario file, and the command: in this process, and in one that is spawned."""
    scene = scene_file(tmp_path / "scene")
    turning = ("roof/radar", "scanning_radar", SPEC.with_(num_azimuths=40), ROOF)
    few = FAST.changed(num_rays=2_000, keep_power=False)
    Rig("roof", (SensorMount(*turning, few),)).save(tmp_path / "rig.yaml")
    text = f"scene: {scene}\nrig: rig.yaml\nname: drive\nnum_frames: 4\nframe_rate: 4.0\nseed: 3\n"
    (tmp_path / "drive.yaml").write_text(text)
    options = StoreOptions(shard_frames=2)
    spec = ss.ScenarioSpec.load(tmp_path / "drive.yaml")
    for name, workers in (("alone", 0), ("spread", 1)):
        settings = ExportSettings(workers=workers, options=options)
        assert export([spec], tmp_path / name, settings).num_made == 4
    assert contents(tmp_path / "alone") == contents(tmp_path / "spread")
    stored = ss.open_dataset(tmp_path / "alone")[3].radar_scan["roof"]
    assert stored.image.shape == (40, SPEC.num_cells) and stored.image.max() > 100


def test_the_example_rig_is_read_and_sees_the_street() -> None:
    rig = Rig.load(EXAMPLES / "scanning_rig.yaml")
    assert rig["roof/radar"].spec == ss.ScanningRadarSpec.preset("cts350x")
    assert rig["roof/radar"].settings.scanning.num_blocks == 4
    draft = rig.in_quality("draft")["roof/radar"].settings
    assert (draft.method, draft.raycast.num_rays, draft.accuracy.tube_budget) == ("raycast", 300_000, 35_000)


def test_power_is_left_out_unless_asked_for_and_datasets_without_one_say_nothing(tmp_path, world) -> None:
    from scarl_sionna.dataset.schema import TABLES, tables_of

    plain = ss.observe(world, rig(FAST.changed(keep_power=False)), 0.25, seed=3)
    out = write_dataset(tmp_path / "out", rig().to_dict(), {"street": [plain]}, options=StoreOptions(layout="files"))
    stored = ss.open_dataset(out)[0].radar_scan["roof/radar"]
    assert stored.power is None and stored.to_result().power is None
    assert tables_of(rig().to_dict())["scanning_radar"] == TABLES["scanning_radar"]
    assert "scanning_radar" not in tables_of(Rig.front().to_dict())


@pytest.mark.some(1)
@pytest.mark.parametrize("method", ["auto", "sionna"])
def test_other_solvers_look_round(world: ss.World, method: str) -> None:
    settings = ss.RadarSettings.of(method, num_blocks=1, keep_power=True, noise=False).changed(
        accuracy=ss.Accuracy(tube_budget=20_000),
        raycast={"num_rays": 20_000},
        sionna={"num_samples": 20_000, "max_depth": 2},
    )
    state = world.at(0.25)
    found = ScanningRadar(SPEC, settings).observe(state, state.mount("ego", ROOF), np.random.default_rng(0))
    assert found.num_paths > 0 and found.power.max() > 0.0


def test_rain_stands_in_the_image_with_its_mean_power(world: ss.World) -> None:
    """The radar equation over the volume through the pencil beam; a cell of the Hann window holds 1.5 resolutions.

    Near the radar a drop falls through the beam while a block of the turn passes: points that did, too, made it 1 to 11
    dB too strong. Means over 500 to 5,000 cells: 0.05 to 0.2 dB one sigma.
    """
    dry = ss.ScanningRadarSpec(
        pattern=ss.FanPattern(azimuth_beamwidth_deg=4.0),
        waveform=SPEC.waveform,
        num_azimuths=60,
        num_range_bins=None,
    )
    state = world.with_weather(ss.Weather(rain_rate=20.0)).at(0.25)
    settings = FAST.changed(noise=False, num_rays=1, num_points=30_000)
    scan = ScanningRadar(dry, settings).observe(state, ss.Pose([0.0, 0.0, 300.0]), np.random.default_rng(1))
    drops = falling(state.world.weather, dry.ramp().carrier_frequency)[0].reflectivity
    per_km = weather_attenuation(state.world.weather, dry.ramp().carrier_frequency, "V")
    for near, far in ((5.0, 10.0), (10.0, 20.0), (20.0, 40.0)):
        inside = (dry.range >= near) & (dry.range < far)
        exact = mean_clutter_power(dry.ramp(), drops, near, far, per_km) / (far - near) * 1.5 * dry.range_resolution
        assert 10.0 * np.log10(scan.power[:, inside].mean() / exact) == pytest.approx(0.0, abs=0.6), (near, far)


def test_a_radar_inside_a_mesh_is_refused(world: ss.World) -> None:
    state = world.at(0.0)
    with pytest.raises(PlacementError, match="inside"):
        ScanningRadar(SPEC, FAST).observe(state, ss.Pose([40.0, 15.0, 4.0]), np.random.default_rng(0))
