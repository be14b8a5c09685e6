"""Scanning radars as data: specifications, presets, the image's codes, its pictures, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
from PIL import Image

import scarl_sionna as ss
from scarl_sionna.core.errors import InputTypeError, ParameterRangeError, SpecError, UnknownNameError
from scarl_sionna.radar.scanning.sensor import ScanningRadar
from scarl_sionna.signal.polar import image_codes

SMALL = ss.ScanningRadarSpec(
    waveform=ss.Fmcw(start_frequency=76e9, bandwidth=600e6, ramp_time=500e-6, num_chirps=1, num_samples=128),
    num_azimuths=90,
    num_range_bins=None,
)


@pytest.mark.parametrize(
    ("name", "cell", "cells", "reach"),
    [("cts350x", 0.0432, 3768, 162.8), ("cir204h", 0.0596, 3360, 200.3), ("ras6", 0.0438, 6848, 299.9)],
)
def test_presets_have_the_cells_of_their_datasets(name: str, cell: float, cells: int, reach: float) -> None:
    radar = ss.ScanningRadarSpec.preset(name)
    assert radar.range_bin == pytest.approx(cell, rel=1e-9) and radar.num_cells == cells == len(radar.range)
    assert radar.max_range == pytest.approx(reach, abs=0.05)
    assert (radar.num_azimuths, radar.rotation_rate) == (400, 4.0)
    assert radar.doppler_range_shift == pytest.approx(0.0505, abs=1e-4)  # Boreas states 0.049 and 0.0502
    assert radar.ramp().waveform.top_frequency < 77e9 and radar.waveform.ramp_time < radar.azimuth_interval
    again = ss.ScanningRadarSpec(**radar.model_dump(mode="json"))
    assert again == radar


def test_times_and_azimuths_go_round_once() -> None:
    radar = ss.ScanningRadarSpec()
    assert np.diff(radar.time) == pytest.approx(0.25 / 400) and np.diff(radar.azimuth) == pytest.approx(-np.pi / 200)
    assert radar.time[0] == pytest.approx(radar.middle_time)
    assert radar.with_(rotation="counterclockwise").azimuth[1] == pytest.approx(np.pi / 200)
    assert radar.is_up.all() and radar.with_(alternating=True).is_up.tolist() == [True, False] * 200


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"waveform": ss.Fmcw(num_chirps=2)}, "one ramp an azimuth"),
        ({"rotation_rate": 8.0}, "fits into the time of an azimuth"),
        ({"num_range_bins": 10_000}, "num_range_bins <= 3768"),
        ({"front_end": ss.FrontEnd(leakage=(ss.Leakage(length=0.1, level_db=-40.0),))}, "alone"),
        ({"num_azimuths": 3}, "num_azimuths"),
        ({"image_step_db": 0.0}, "image_step_db"),
        ({"window": "kaiser"}, "window"),
        ({"pattern": {"kind": "fan", "peak_gain_dbi": 45.0}}, "would radiate"),
        ({"pattern": {"kind": "fan", "cosecant_deg": 0.5}}, "beyond half"),
    ],
)
def test_wrong_specifications_are_refused(change: dict, message: str) -> None:
    with pytest.raises(SpecError, match=message):
        ss.ScanningRadarSpec().with_(**change)


def test_wrong_names_types_and_settings_are_refused() -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'cts350x'"):
        ss.ScanningRadarSpec.preset("cts350")
    with pytest.raises(InputTypeError, match="a ScanningRadarSpec"):
        ScanningRadar(ss.RadarSpec())  # type: ignore[arg-type]
    with pytest.raises(InputTypeError, match="a RadarSettings"):
        ScanningRadar(SMALL, "raycast")  # type: ignore[arg-type]
    heard = ss.RadarSettings(interferers=({"radar": "awr1843boost", "pose": ss.Pose([9.0, 0.0, 1.0])},))
    with pytest.raises(ParameterRangeError, match="interferers"):
        ScanningRadar(SMALL, heard)
    with pytest.raises(ParameterRangeError, match="num_band_frequencies"):
        ScanningRadar(SMALL, ss.RadarSettings(num_band_frequencies=3))
    with pytest.raises(InputTypeError, match="paths"):
        ss.scan_paths(np.zeros(3), SMALL)  # type: ignore[arg-type]
    apart = ss.point_targets([[9, 0, 0]], [[0, 0, 0]], 1.0, SMALL.ramp(), ss.Pose(), receiver=ss.Pose([0, 1, 0]))
    with pytest.raises(ParameterRangeError, match="separate receiver"):
        ss.scan_paths(apart, SMALL)


def test_codes_are_the_nearest_step_and_stop_at_both_ends() -> None:
    dbm = np.array([-200.0, -100.0, -99.76, -99.74, -50.0, 27.4, 27.6, 60.0])
    codes, above = image_codes(1e-3 * 10 ** (dbm / 10.0), -100.0, 0.5)
    assert codes.tolist() == [0, 0, 0, 1, 100, 255, 255, 255] and above == 1


def test_code_and_power_agree_within_half_a_step() -> None:
    paths = ss.point_targets([[10.0, 3.0, 0.0]], [[0.0, 0.0, 0.0]], 1.0, SMALL.ramp(), ss.Pose())
    kept = ss.RadarSettings(scanning={"keep_power": True})
    scan = ss.scan_paths(paths, SMALL, np.random.default_rng(1), kept)
    coded = (scan.image > 0) & (scan.image < 255)
    apart = scan.power_dbm - (10.0 * np.log10(scan.power) + 30.0)
    assert np.abs(apart[coded]).max() < 0.251 and coded.mean() > 0.8
    assert ss.scan_paths(paths, SMALL, np.random.default_rng(1)).power is None
    assert scan.num_saturated == 0


def test_encoder_counts_rise_to_the_right() -> None:
    scan = ss.scan_paths(ss.RadarPaths.empty(ss.Pose()), ss.ScanningRadarSpec())
    assert scan.encoder[:3].tolist() == [0, 14, 28] and scan.encoder[-1] == 5586
    left = ss.scan_paths(
        ss.RadarPaths.empty(ss.Pose()), SMALL.with_(rotation="counterclockwise", start_azimuth_deg=90.0)
    )
    assert left.encoder[0] == 4200


def test_rows_of_oxford_are_read_as_their_documents_say(tmp_path) -> None:
    """Decoded by the documents' words: int64 microseconds, uint16 counts of 5600 a turn, a flag, then cells."""
    scan = ss.scan_paths(ss.RadarPaths.empty(ss.Pose()), ss.ScanningRadarSpec(), np.random.default_rng(1))
    start = 1_547_131_046_353_776_000
    Image.fromarray(scan.oxford_rows(start)).save(tmp_path / "scan.png")
    rows = np.array(Image.open(tmp_path / "scan.png"))
    assert rows.shape == (400, 3779) and rows.dtype == np.uint8
    time = np.array([int.from_bytes(bytes(row[:8]), "little") for row in rows])
    azimuth = np.array([int.from_bytes(bytes(row[8:10]), "little") for row in rows]) * np.pi / 2800.0
    assert np.abs(time - (start / 1e3 + scan.time * 1e6)).max() <= 1.0
    assert azimuth == pytest.approx(-scan.azimuth % (2.0 * np.pi), abs=1e-9)
    assert (rows[:, 10] == 255).all()
    np.testing.assert_array_equal(rows[:, 11:], scan.image)


def test_pictures_from_above_put_targets_where_they_are_and_close_the_turn() -> None:
    radar = SMALL.with_(start_azimuth_deg=17.0, num_azimuths=360)
    places = np.array([[12.0, 0.0, 0.0], [0.0, 9.0, 0.0], [-6.0, -8.0, 0.0]])
    paths = ss.point_targets(places, np.zeros((3, 3)), 1.0, radar.ramp(), ss.Pose())
    scan = ss.scan_paths(paths, radar)
    picture = scan.cartesian(cell=0.1, reach=15.0)
    assert picture.shape == (301, 301) and picture.dtype == np.float32
    for x, y, _ in places:
        row, column = round(150 - x / 0.1), round(150 - y / 0.1)
        around = picture[row - 8 : row + 9, column - 8 : column + 9]
        assert picture[row, column] > around.max() - 3.0 > picture.max() - 10.0
    # the first azimuth meets the last one: no gap there
    azimuth = np.radians(17.0 + 2.0)
    line = scan.cartesian(cell=0.1, reach=8.0)
    assert np.isfinite(line[round(80 - 60 * np.cos(azimuth)), round(80 - 60 * np.sin(azimuth))])
    whole = scan.cartesian(cell=1.0)
    assert whole[0, 0] == np.float32(scan.floor_dbm)  # beyond the last range
    for cell, reach in ((0.0, 5.0), (6.0, 5.0), (1e-4, 50.0)):
        with pytest.raises(ParameterRangeError, match="cell"):
            scan.cartesian(cell, reach)


def test_plots_and_what_they_refuse() -> None:
    scan = ss.scan_paths(ss.RadarPaths.empty(ss.Pose()), SMALL, np.random.default_rng(0))
    shown = scan.plot(max_range=20.0).images[0]
    assert shown.get_extent() == pytest.approx([20.0, -20.0, -20.0, 20.0])
    lines = scan.plot("polar", max_range=20.0).images[0].get_array()
    assert lines.shape[0] == 90
    with pytest.raises(UnknownNameError, match="view"):
        scan.plot("round")


def test_settings_of_files_from_before_stay_as_they_are() -> None:
    assert "scanning" not in ss.RadarSettings().model_dump(mode="json")
    chosen = ss.RadarSettings.of("raycast", num_blocks=4)
    assert chosen.scanning.num_blocks == 4
    assert ss.RadarSettings(**chosen.model_dump(mode="json")) == chosen


def test_fan_pattern_is_half_at_its_beamwidth_and_has_the_slopes_of_its_gain() -> None:
    fan = ss.FanPattern(azimuth_beamwidth_deg=2.0, elevation_beamwidth_deg=4.0, cosecant_deg=30.0, peak_gain_dbi=30.0)
    half = 30.0 - 10.0 * np.log10(2.0)
    assert fan.gain_db(np.radians([-1.0, 1.0]), 0.0) == pytest.approx(half)
    assert fan.gain_db(0.0, np.radians([-2.0, 2.0])) == pytest.approx(half)
    down = np.radians([5.0, 10.0, 30.0])
    assert fan.gain_db(0.0, -down) == pytest.approx(half + 20.0 * np.log10(np.sin(np.radians(2.0)) / np.sin(down)))
    rng = np.random.default_rng(3)
    azimuth, elevation = rng.uniform(-3.0, 3.0, 500), rng.uniform(-1.5, 1.5, 500)
    step = 1e-7
    across, up = fan.slopes_db(azimuth, elevation)
    by_azimuth = (fan.gain_db(azimuth + step, elevation) - fan.gain_db(azimuth - step, elevation)) / (2 * step)
    by_elevation = (fan.gain_db(azimuth, elevation + step) - fan.gain_db(azimuth, elevation - step)) / (2 * step)
    assert across == pytest.approx(by_azimuth, abs=1e-4, rel=1e-5)
    assert up == pytest.approx(by_elevation, abs=1e-4, rel=1e-5)
    assert ss.FanPattern(peak_gain_dbi=40.0).radiated_share == pytest.approx(
        0.89, abs=0.01
    )  # Gaussian: (1.0645 w)^2 G / 4 pi


def test_beam_reach_is_where_the_two_way_gain_has_fallen() -> None:
    radar = ss.ScanningRadarSpec()
    for floor in (3.0, 40.0, 80.0):
        reach = radar.beam_reach(floor)
        assert 2.0 * (radar.pattern.gain_db(reach, 0.0) - 36.0) < -floor
        assert 2.0 * (radar.pattern.gain_db(reach - np.radians(0.051), 0.0) - 36.0) >= -floor
    assert radar.with_(pattern={"kind": "isotropic"}).beam_reach(80.0) == pytest.approx(np.pi)
