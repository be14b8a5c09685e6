"""Radars of every multiplexing through an export: stored data, cells' labels, readers, captures."""

from __future__ import annotations

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.dataset.formats.dca1000 import export_dca1000, read_dca1000
from scarl_sionna.dataset.readers.xarray_view import open_xarray, radar_maps_xarray
from scarl_sionna.fusion import Rig, SensorMount
from scarl_sionna.scenario.spec.scenario import ScenarioSpec
from tests.exports import FEW_RAYS, PLACE, scene_file

SMALL = ss.RadarSpec().with_(num_chirps=16, num_samples=64)
REAL = SMALL.with_(
    phase_noise=ss.PhaseNoise(mask=((1e6, -93.0),)),
    leakage=(ss.Leakage(length=0.1, level_db=-50.0),),
    filters=ss.IfFilter(high_pass=(175e3,)),
    mixer=ss.Mixer(iq_gain_db=0.1),
    multiplexing=ss.Ddm(),
    enob=11.0,
)
KINDS = {"random": ss.Tdm(order_seed=1), "ddm": ss.Ddm(), "bpm": ss.Bpm(), "cdm": ss.Cdm()}


@pytest.fixture(scope="module")
def stored(tmp_path_factory: pytest.TempPathFactory) -> ss.Dataset:
    folder = tmp_path_factory.mktemp("coded")
    mounts = [
        SensorMount(f"{name}/radar", "radar", SMALL.with_(multiplexing=kind), PLACE, FEW_RAYS)
        for name, kind in KINDS.items()
    ]
    mounts.append(SensorMount("real/radar", "radar", REAL, PLACE, FEW_RAYS))
    Rig("coded", tuple(mounts)).save(folder / "rig.yaml")
    scene = str(scene_file(folder))
    spec = ScenarioSpec(scene=scene, rig=str(folder / "rig.yaml"), num_frames=1, frame_rate=50.0, seed=0, name="one")
    ss.export([spec], folder / "out")
    return ss.Dataset(folder / "out")


@pytest.mark.parametrize("name", list(KINDS))
def test_stored_frames_make_the_same_maps_and_labels(stored: ss.Dataset, name: str) -> None:
    radar = stored[0].radar[f"{name}/radar"].to_result()
    assert radar.spec.multiplexing == KINDS[name]
    rda = ss.range_doppler_angle(ss.virtual_cube(radar.adc, radar.spec), radar.spec)
    rows = 48 if name == "random" else 16
    assert rda.range_doppler.data.shape == (12, rows, 64) == (12, *radar.cell_instance.shape)
    points = ss.detect(rda, guard=(2, 3), training=(4, 8))
    strongest = points.power.argmax()
    # the car 18 m ahead of the radar fills the strongest cell of its labels, and detection finds it there
    row, column = np.unravel_index(radar.cell_power.argmax(), radar.cell_power.shape)
    assert abs(points.range[strongest] - rda.range[column]) < 1.5 * radar.spec.range_resolution
    assert abs(points.radial_velocity[strongest] - rda.radial_velocity[row]) < 1.5 * radar.spec.velocity_resolution


@pytest.mark.parametrize("name", list(KINDS))
def test_rows_of_raw_data_have_times_and_transmitters(stored: ss.Dataset, name: str) -> None:
    pytest.importorskip("xarray")
    node = open_xarray(stored, "one")[f"{name}/radar"]
    spec = SMALL.with_(multiplexing=KINDS[name])
    np.testing.assert_allclose(node.slow_time, np.arange(spec.num_chirps_total) * spec.chirp_interval)
    sent = node.transmitter.values
    if name != "random":
        assert (sent == -1).all()  # all, each with its code
        return
    assert (np.sort(sent.reshape(16, 3), axis=1) == [0, 1, 2]).all()
    assert not (sent.reshape(16, 3) == sent[:3]).all()
    maps = radar_maps_xarray(stored[0].radar[f"{name}/radar"])
    assert dict(maps.sizes)["radial_velocity"] == 48


def test_a_real_front_end_goes_through_an_export(stored: ss.Dataset) -> None:
    radar, ideal = (stored[0].radar[f"{name}/radar"].to_result() for name in ("real", "ddm"))
    assert radar.spec == REAL
    places = []
    for frame in (radar, ideal):
        power = ss.range_doppler(frame).power
        power[:, :8] = power[:, -8:] = 0.0  # leakage, on both sides of 0 Hz
        places.append(np.unravel_index(power.argmax(), power.shape))
    assert np.abs(np.subtract(*places)).max() <= 1


def test_captures_hold_the_rows(stored: ss.Dataset, tmp_path) -> None:
    export_dca1000(stored, tmp_path / "cap")
    for name in KINDS:
        raw = read_dca1000(tmp_path / "cap" / "one" / f"{name}_radar")
        assert np.array_equal(raw, stored[0].radar[f"{name}/radar"].adc_int)
