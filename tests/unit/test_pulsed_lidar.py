"""The pulsed receiver in the lidar as a sensor: a wall, glass, weather, storage, refusals."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import scarl_sionna as ss
from camera_lidar import Lidar
from camera_lidar.lidar import shot_directions
from scarl_sionna.core.errors import SpecError
from scarl_sionna.core.mount import Mount
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.results import LidarScan
from scarl_sionna.core.specs.atmosphere import Atmosphere
from scarl_sionna.core.specs.lidar.presets import PRESETS
from scarl_sionna.core.specs.lidar.receiver import PulsedReceiver
from scarl_sionna.core.specs.lidar.spec import LidarSpec
from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.dataset.write import write_dataset
from scarl_sionna.engine.load import load_scene
from scarl_sionna.engine.world import WorldState
from scarl_sionna.fusion import Rig, SensorMount
from tests.scenes import Thing, box, plane, write_scene

pytestmark = pytest.mark.own_process(shared=True)  # beside what a worker has already, it would pass the bound of memory

IDEAL = PulsedReceiver(noise=False, speckle=False)
SPEC = LidarSpec(
    wavelength=905e-9,
    beam_divergence=1e-3,
    num_azimuth=21,
    num_elevation=11,
    azimuth_fov_deg=(-20.0, 20.0),
    elevation_fov_deg=(-4.0, 4.0),
    receiver=IDEAL,
    max_distance=60.0,
)
POSE = Pose.from_euler([0.0, 0.0, 1.5])


@pytest.fixture(scope="module")
def state(tmp_path_factory: pytest.TempPathFactory) -> WorldState:
    ground = Thing("ground", plane(100.0, 100.0), "Roads", is_object=False)
    wall = Thing("wall", box((1.0, 40.0, 8.0), (15.5, 0.0, 1.5)), "Wall", "white")
    return load_scene(write_scene(tmp_path_factory.mktemp("scene"), [ground, wall])).at(0.0)


def observe(state: WorldState, spec: LidarSpec, seed: int = 0) -> LidarScan:
    return Lidar(spec).observe(state, Mount(POSE, Twist([2.0, 0.0, 0.0])), np.random.default_rng(seed))


def test_an_ideal_receiver_gives_the_geometry_and_no_velocity(state: WorldState) -> None:
    scan = observe(state, SPEC)
    assert scan.num_points == SPEC.num_shots
    assert np.allclose(scan.distance, 15.0 / shot_directions(SPEC)[scan.shot, 0], rtol=1e-6)
    assert np.all(np.isnan(scan.radial_velocity))
    ideal = observe(state, SPEC.with_(receiver=ss.ScarlReceiver()))
    assert np.allclose(scan.intensity, ideal.intensity * _widening(SPEC, ideal), rtol=1e-5)
    assert np.array_equal(scan.instance, ideal.instance)


def _widening(spec: LidarSpec, scan: LidarScan) -> np.ndarray:
    """Return by how much a slanting wall lowers a pulse."""
    tangent = np.sqrt(1.0 - scan.cos_incidence.astype(float) ** 2) / scan.cos_incidence
    depth = np.hypot(spec.aperture_diameter / 2.0, 0.5e-3 * scan.distance) / 2.0 * tangent
    pulse = IDEAL.pulse_deviation * SPEED_OF_LIGHT / 2.0
    return pulse * np.sqrt(2.0) / np.sqrt(2.0 * pulse**2 + depth**2)


def test_waveforms_show_the_wall_where_it_is(state: WorldState) -> None:
    raw = IDEAL.with_(raw_signal=True)
    scan = observe(state, SPEC.with_(receiver=raw))
    assert scan.waveform is not None and scan.waveform.dtype == np.float32 and scan.beat_signal is None
    assert scan.waveform.shape == (SPEC.num_shots, SPEC.with_(receiver=raw).num_samples)
    assert np.allclose(scan.distance, 15.0 / shot_directions(SPEC)[scan.shot, 0], atol=1e-3)
    top = scan.waveform.argmax(axis=1) * SPEED_OF_LIGHT / 2.0 / raw.sampling_frequency
    assert np.abs(top - scan.distance).max() < 0.08  # half a sample
    assert np.allclose(scan.intensity, observe(state, SPEC).intensity, rtol=2e-3)


def test_noise_repeats_with_its_seed(state: WorldState) -> None:
    spec = SPEC.with_(receiver=PulsedReceiver(), max_returns=2, atmosphere=Atmosphere(visibility=150.0))
    first, same, other = (observe(state, spec, seed) for seed in (1, 1, 2))
    assert first.distance.tobytes() == same.distance.tobytes() and first.cnr.tobytes() == same.cnr.tobytes()
    assert first.distance.tobytes() != other.distance.tobytes()
    air = first.instance == 0
    assert np.count_nonzero(air) > 0 and np.all(first.reflectance[air] == 0.0)


def test_fog_without_backscatter_only_dims(state: WorldState) -> None:
    fog = SPEC.with_(atmosphere=Atmosphere(visibility=100.0), receiver=PulsedReceiver(backscatter=False), max_returns=3)
    scan = observe(state, fog)
    assert np.all(scan.instance > 0)
    clear = observe(state, SPEC)
    both = np.exp(-2.0 * (fog.extinction - SPEC.extinction) * 15.0)
    assert np.median(scan.intensity) == pytest.approx(float(np.median(clear.intensity)) * both, rel=0.05)


def test_a_stored_waveform_comes_back(state: WorldState, tmp_path: Path) -> None:
    spec = SPEC.with_(receiver=PulsedReceiver(raw_signal=True))
    rig = Rig("one", (SensorMount("lidar", "lidar", spec, POSE),))
    frame = ss.observe(state.world, rig, time=0.0, seed=3, vehicle=Pose())
    write_dataset(tmp_path / "data", rig.to_dict(), {"one": [frame]})
    stored = ss.open_dataset(tmp_path / "data")[0].lidar["lidar"]
    scan = frame.lidars["lidar"]
    assert np.array_equal(stored.waveform, scan.waveform)
    assert stored.spec == scan.spec


@pytest.fixture(scope="module")
def street() -> WorldState:
    return load_scene("urban_crossing").at(0.0)


@pytest.mark.parametrize("name", sorted(PRESETS))
def test_every_named_lidar_scans_a_street(street: WorldState, name: str) -> None:
    """With a tenth of its columns: shares of some thousand shots, whose bounds are far from what all of them have."""
    spec = LidarSpec.preset(name)
    spec = spec.with_(scan=spec.scan.with_(num_azimuth=spec.scan.num_azimuth // 10))
    mount = street.mount("ego", Pose(np.array([0.0, 0.0, 1.9])))
    scan = Lidar(spec).observe(street, mount, np.random.default_rng(0))
    assert 0.15 < np.unique(scan.shot).size / spec.num_shots <= 1.0
    assert np.isnan(scan.radial_velocity).all() == isinstance(spec.receiver, PulsedReceiver)
    assert np.count_nonzero(scan.instance > 0) > 0.8 * scan.num_points
    assert scan.distance.max() <= spec.max_distance and scan.distance.min() > 0.3


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"blind_distance": (2.0, 1.0)}, "blind_distance"),
        ({"sampling_frequency": 1e8}, "sampling_frequency of at least 4.71e"),
        ({"pulse_energy": 0.0}, "pulse_energy"),
        ({"avalanche_gain": 0.5}, "avalanche_gain"),
        ({"false_alarm_probability": 1.0}, "false_alarm_probability"),
    ],
)
def test_what_cannot_be_is_refused(changes: dict[str, object], message: str) -> None:
    with pytest.raises(SpecError, match=message):
        PulsedReceiver(**changes)


def test_too_many_waveforms_are_refused() -> None:
    with pytest.raises(SpecError, match="shoot at most"):
        LidarSpec(num_azimuth=2000, num_elevation=200, receiver=PulsedReceiver(raw_signal=True))
