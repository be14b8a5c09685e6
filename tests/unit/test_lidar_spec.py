"""Scan patterns, presets and refusals of the lidar's specification."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from camera_lidar.lidar import shot_directions, shot_times, threshold
from scarl_sionna.core.errors import ParameterRangeError, UnknownNameError
from scarl_sionna.core.specs.lidar.pattern import RasterScan, RisleyScan, SpinningScan, TableScan
from scarl_sionna.core.specs.lidar.receiver import HeterodyneReceiver, ScarlReceiver
from scarl_sionna.core.specs.lidar.spec import MAX_RAW_BYTES, LidarSpec


def degrees(spec: LidarSpec) -> tuple[np.ndarray, np.ndarray]:
    directions = shot_directions(spec)
    return np.degrees(np.arctan2(directions[:, 1], directions[:, 0])), np.degrees(np.arcsin(directions[:, 2]))


def test_parameters_of_raster_and_receiver_may_be_given_directly() -> None:
    short = LidarSpec(num_azimuth=30, scan_time=0.1, velocity_noise_std=0.2)
    assert short == LidarSpec(
        scan=RasterScan(num_azimuth=30, scan_time=0.1), receiver=ScarlReceiver(velocity_noise_std=0.2)
    )
    assert short.with_(num_azimuth=40).scan == RasterScan(num_azimuth=40, scan_time=0.1)
    assert short.with_(num_azimuth=40).receiver == short.receiver


@pytest.mark.parametrize("name", ["spinning_64", "fmcw_forward"])
def test_presets_survive_a_file(name: str) -> None:
    spec = LidarSpec.preset(name)
    again = LidarSpec(**json.loads(json.dumps(spec.model_dump(mode="json"))))
    assert again == spec and hash(again) == hash(spec)
    assert threshold(spec) > 8.0
    assert spec.num_elevation * spec.num_azimuth == spec.num_shots


def test_an_unknown_preset_is_named() -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'spinning_64'"):
        LidarSpec.preset("spining_64")


def test_a_spinning_fan_turns_between_its_beams() -> None:
    scan = SpinningScan(
        elevation_deg=(-10.0, 5.0),
        firing_time=(0.0, 0.01),
        num_azimuth=4,
        rotation_rate=10.0,
        start_azimuth_deg=180.0,
        azimuth_offset_deg=(0.0, 2.0),
    )
    spec = LidarSpec(scan=scan)
    azimuth, elevation = degrees(spec)
    assert np.allclose(shot_times(spec), [0.0, 0.01, 0.025, 0.035, 0.05, 0.06, 0.075, 0.085], atol=1e-15)
    assert np.allclose(elevation, [-10.0, 5.0] * 4, atol=1e-12)
    # clockwise: 90 deg a column, 36 deg in 10 ms, and the beam's own offset to the left
    expected = 180.0 - 3600.0 * shot_times(spec) + np.tile([0.0, 2.0], 4)
    assert np.allclose((azimuth - expected + 180.0) % 360.0 - 180.0, 0.0, atol=1e-10)
    row, column = scan.cells()
    assert row.tolist() == [1, 0] * 4 and column.tolist() == [0, 0, 1, 1, 2, 2, 3, 3]
    assert SpinningScan(elevation_deg=(0.0,), num_azimuth=3, clockwise=False).cells()[1].tolist() == [2, 1, 0]


def test_lines_at_once_share_their_time_and_a_serpentine_runs_back() -> None:
    scan = RasterScan(num_azimuth=3, num_elevation=4, scan_time=0.6, lines_at_once=2, serpentine=True)
    assert np.allclose(scan.times().reshape(4, 3), [[0, 0.1, 0.2]] * 2 + [[0.5, 0.4, 0.3]] * 2, atol=1e-15)
    assert not RasterScan().times().any()  # a flash


def test_risley_prisms_draw_a_rosette_over_a_round_field() -> None:
    spec = LidarSpec(scan=RisleyScan(wedge_angles_deg=(8.0, 4.0), num_shots=20_000))
    azimuth, elevation = degrees(spec)
    radius = np.hypot(azimuth, elevation)
    assert 11.99 < radius.max() <= 12.0 + 1e-9 and 4.0 - 1e-9 <= radius.min() < 4.01
    row, column = spec.scan.cells()
    rows, columns = spec.scan.grid_shape
    assert rows * columns >= 0.9 * 20_000 and row.max() == rows - 1 and column.max() == columns - 1
    assert row[np.argmax(elevation)] == 0 and column[np.argmax(azimuth)] == 0


@pytest.mark.parametrize("ending", ["csv", "npz", "xyz"])
def test_a_table_is_read_from_a_file(tmp_path: Path, ending: str) -> None:
    azimuth, elevation, time = np.array([10.0, -20.0, 3.0]), np.array([0.0, 5.0, -7.0]), np.array([0.0, 1e-3, 2e-3])
    if ending == "csv":
        path = tmp_path / "scan.csv"
        np.savetxt(
            path, np.c_[azimuth, elevation, time], delimiter=",", header="azimuth_deg,elevation_deg,time", comments=""
        )
    elif ending == "npz":
        path = tmp_path / "scan.npz"
        np.savez(path, azimuth_deg=azimuth, elevation_deg=elevation, time=time)
    else:
        path = tmp_path / "scan.npz"
        a, e = np.radians(azimuth), np.radians(elevation)
        np.savez(path, x=3 * np.cos(e) * np.cos(a), y=3 * np.cos(e) * np.sin(a), z=3 * np.sin(e), time=time)
    scan = TableScan.read(path)
    assert np.allclose(scan.azimuth_deg, azimuth, atol=1e-12) and np.allclose(scan.elevation_deg, elevation, atol=1e-12)
    assert np.allclose(shot_times(LidarSpec(scan=scan)), time, atol=1e-15) and scan.scan_time == 2e-3


def test_an_unusable_table_says_what_is_needed(tmp_path: Path) -> None:
    path = tmp_path / "scan.csv"
    path.write_text("azimuth_deg,time\n1,2\n")
    for bad in (path, tmp_path / "missing.csv", tmp_path / "scan.txt"):
        with pytest.raises(ParameterRangeError, match="columns azimuth_deg, elevation_deg"):
            TableScan.read(bad)


@pytest.mark.parametrize(
    ("bad", "message"),
    [
        ({"scan": {"kind": "table", "azimuth_deg": [], "elevation_deg": []}}, "at least 1 item"),
        ({"scan": {"kind": "table", "azimuth_deg": [1.0], "elevation_deg": [1.0, 2.0]}}, "same length"),
        ({"scan": {"kind": "table", "azimuth_deg": [1.0], "elevation_deg": [1.0], "time": [-1.0]}}, "0 to 10 s"),
        ({"scan": {"kind": "spinning", "elevation_deg": []}}, "at least 1 item"),
        ({"scan": {"kind": "spinning", "elevation_deg": [95.0]}}, "-90 to 90 deg"),
        ({"scan": {"kind": "spinning", "elevation_deg": [1.0], "firing_time": [1.0]}}, "column's time"),
        ({"scan": {"kind": "spinning", "elevation_deg": [1.0], "rotation_rate": 0.0}}, "greater than 0"),
        ({"scan": {"kind": "risley", "wedge_angles_deg": [0.0, 0.0]}}, "sum above 0"),
        ({"scan": {"kind": "spiral"}}, "'raster', 'spinning', 'risley', 'table'"),
        ({"num_azimuth": 100_000, "num_elevation": 1000}, "at most 4000000 shots"),
        ({"num_elevation": 7, "lines_at_once": 2}, "divides num_elevation"),
        ({"num_azimuth": 3, "scan": RisleyScan()}, "num_azimuth inside of `scan`"),
        ({"drop_out_intensity": 0.1, "receiver": HeterodyneReceiver()}, "inside of `receiver`"),
        ({"aperture_diameter": 0.0}, "greater than 0"),
        ({"transmit_power": -1.0}, "greater than 0"),
        ({"beam_divergence": 1e-5}, "diffraction limit of the aperture"),
        ({"wavelength": 10e-6}, "less than or equal"),
        ({"sub_rays": 0}, "greater than or equal to 1"),
        ({"atmosphere": {"visibility": 0.0}}, "greater than 0"),
        ({"atmosphere": {"rain_rate": -1.0}}, "greater than or equal to 0"),
        ({"receiver": {"kind": "heterodyne", "quantum_efficiency": 1.1}}, "less than or equal to 1"),
        ({"receiver": {"kind": "heterodyne", "thermal_current_density": -1e-12}}, "greater than or equal to 0"),
        ({"receiver": {"kind": "heterodyne", "num_looks": 0}}, "greater than or equal to 1"),
        ({"receiver": {"kind": "heterodyne", "raw_signal": True, "num_looks": 2}}, "num_looks = 1"),
        ({"receiver": {"kind": "heterodyne", "sampling_frequency": 1e6}}, "16 or more samples"),
        ({"receiver": {"kind": "heterodyne", "raw_signal": True}}, f"at most {MAX_RAW_BYTES >> 20} MiB"),
    ],
)
def test_bad_specifications_are_refused(bad: dict, message: str) -> None:
    with pytest.raises(ParameterRangeError, match=message):
        LidarSpec(**bad)


def test_a_false_alarm_rate_out_of_reach_is_refused() -> None:
    receiver = HeterodyneReceiver(false_alarm_probability=0.49)
    with pytest.raises(ParameterRangeError, match="level above the mean noise"):
        threshold(LidarSpec(receiver=receiver))
