"""Maps from a point-spread table are those of raw data and transforms; what a table cannot do is said."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.core.errors import InputTypeError, ParameterRangeError, ScarlWarning, SpecError
from scarl_sionna.radar.closed.maps import half_power_width
from tests.closed_radars import RADAR, apart_db, points, processed

WHOLE = 64
"""Cells on each side of a table over all 128 ranges."""


@pytest.fixture(scope="module")
def device() -> ss.ClosedRadarSpec:
    return ss.closed_radar_of(processed(points(10.0, 0.0)), 16, WHOLE)


@pytest.mark.parametrize("window", ["hann", "rect"])
@pytest.mark.parametrize(
    ("distance", "azimuth", "velocity"),
    [(20 * RADAR.range_resolution, 0.0, 0.0), (20.13, 23.0, 2.3), (41.7, -38.0, -17.1), (3.0, 8.0, 0.4)],
)
def test_a_point_on_and_between_the_cells_has_the_map_of_its_raw_data(window, distance, azimuth, velocity) -> None:
    paths = points(distance, azimuth, velocity)
    true = processed(paths, window)
    found = ss.map_of_paths(paths, ss.closed_radar_of(true, 16, WHOLE))
    # what is left: the array's squint over the band, migration (2 cm at 17 m/s), spherical waves 3 m away
    assert apart_db(true, found) < (-64.0 if window == "hann" else -48.0)
    assert np.allclose(found.range, true.range) and np.allclose(found.azimuth, true.azimuth)


@pytest.mark.parametrize(
    ("interpolation", "bars"), [("linear", (-16.0, -27.0, -39.0)), ("cubic", (-36.0, -62.0, -68.0))]
)
def test_the_error_falls_with_the_values_a_cell(interpolation, bars) -> None:
    paths = points(20.13, 7.0, 2.3)
    true, found = processed(paths), []
    for oversampling in (2, 4, 8):
        device = ss.closed_radar_of(true, oversampling, WHOLE)
        device = device.with_(spread=device.spread.with_(interpolation=interpolation))
        found.append(apart_db(true, ss.map_of_paths(paths, device)))
    assert all(error < bar for error, bar in zip(found, bars, strict=True)), found
    order = np.diff(found)[0] / -6.02  # dB a halving: second order, or fourth and more
    assert 1.5 < order < 2.5 if interpolation == "linear" else order > 3.5


def test_crowded_echoes_add_up_with_their_phases(device) -> None:
    rng = np.random.default_rng(0)
    distance, azimuth = rng.uniform(20.0, 38.0, 40), rng.uniform(-50.0, 50.0, 40)
    paths = points(distance, azimuth, rng.uniform(-3.0, 3.0, 40), distance**4)
    paths = replace(paths, a=paths.a * np.exp(2j * np.pi * rng.uniform(size=(40, 1, 1))))
    true = processed(paths)
    assert apart_db(true, ss.map_of_paths(paths, device)) < -52.0
    power = device.with_(spread=_of_power(device.spread))
    assert apart_db(true, ss.map_of_paths(paths, power)) > -12.0  # the phases do matter
    pair = points([20.0, 20.0 + RADAR.wavelength / 4.0], 0.0)  # in opposite phase
    alone, both = (ss.map_of_paths(one, device).data.max() for one in (pair.select([0]), pair))
    assert both < 1e-4 * alone
    assert ss.map_of_paths(pair, power).data.max() == pytest.approx(2.0 * alone, rel=1e-3)


def _of_power(spread: ss.PointSpread) -> ss.PointSpread:
    squares = {
        f"{axis}_response": tuple((abs(value) ** 2, 0.0) for value in factor.tolist())
        for axis, factor in zip(spread.axes, spread.factors, strict=True)
    }
    return spread.with_(kind="power", **squares)


def test_the_power_table_is_the_mean_over_phases(device) -> None:
    rng, total = np.random.default_rng(1), 0.0
    paths = points([20.0, 20.2, 20.3], [0.0, 2.0, -1.0])
    device = device.with_(axes=device.axes.with_(range=device.axes.range[35:46]))
    for _ in range(400):
        turn = np.exp(2j * np.pi * rng.uniform(size=3))
        turned = replace(paths, a=paths.a * turn[:, None, None])
        total = total + ss.map_of_paths(turned, device).data
    mean = total / 400.0
    power = ss.map_of_paths(paths, device.with_(spread=_of_power(device.spread))).data
    cell = np.unravel_index(int(power.argmax()), power.shape)
    assert mean[cell] == pytest.approx(power[cell], rel=5.0 * 1.0 / np.sqrt(400.0))


def test_compensated_motion_shears_the_factors_over_range_and_velocity() -> None:
    paths = points([20.1, 24.3], [5.0, -9.0], [9.0, -14.0])
    true = processed(paths, compensate_motion=True)
    default = ss.closed_radar_of(true)
    assert default.spread.is_separable and default.spread.range_per_velocity > 0.0
    assert apart_db(true, ss.map_of_paths(paths, default)) < -60.0
    factors = ss.closed_radar_of(processed(paths), 16, WHOLE).with_(compensates_motion=True)
    assert -55.0 < apart_db(true, ss.map_of_paths(paths, factors)) < -30.0
    whole = _whole(ss.closed_radar_of(true, 4, 8))
    assert apart_db(true, ss.map_of_paths(paths, whole)) < -50.0


def _whole(device: ss.ClosedRadarSpec) -> ss.ClosedRadarSpec:
    """Return the device with one table over all axes."""
    spread = device.spread
    velocity, azimuth = (spread.velocity_offset, ()), (spread.azimuth_offset_deg, ())
    return device.with_(spread=ss.PointSpread.of_arrays(spread.range_offset, spread.values, velocity, azimuth))


def test_sheared_sidelobes_come_in_at_the_other_end_of_the_ranges() -> None:
    # 24 m/s stand in the last row and, 51.2 m/s off, in the first one, whose ranges are compensated for -25.6 m/s
    paths = points([30.0, 63.6], [5.0, -9.0], [24.0, 24.0], [1.0, 20.0])
    for window, bar in (("hann", -55.0), ("rect", -38.0)):  # a tenth of a cell aside in the first row: -12 dB
        true = processed(paths, window, compensate_motion=True)
        assert apart_db(true, ss.map_of_paths(paths, ss.closed_radar_of(true, 16, WHOLE))) < bar


def test_the_radar_in_place_of_its_map_is_told_what_to_give() -> None:
    with pytest.raises(InputTypeError, match="range_doppler_angle"):
        ss.closed_radar_of(RADAR)
    with pytest.raises(ParameterRangeError, match="at most 131072 values"):
        ss.closed_radar_of(processed(points(10.0, 0.0)), 100_000)


def test_folded_velocities_stand_where_the_device_shows_them(device) -> None:
    paths = points(20.0, 10.0, 31.0)  # 25.6 m/s are told
    true = processed(paths)
    with pytest.warns(ScarlWarning, match="too sharp") if _migrates(paths, device) else warnings.catch_warnings():
        found = ss.map_of_paths(paths, device)
    row = np.unravel_index(int(found.data.argmax()), found.data.shape)[0]
    folded = 31.0 - 2.0 * RADAR.unambiguous_velocity
    assert abs(found.radial_velocity[row] - folded) < RADAR.velocity_resolution
    assert apart_db(true, found) < -45.0


def test_a_folded_velocity_moves_the_range_of_a_map_that_compensates_motion() -> None:
    paths = points(20.0, 10.0, 31.0)
    true = processed(paths, compensate_motion=True)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ScarlWarning)
        found = ss.map_of_paths(paths, ss.closed_radar_of(true, 8, 10))
    assert apart_db(true, found) < -40.0  # by its own, folded velocity: 51 m/s off over half a frame are 3 cm


def _migrates(paths: ss.RadarPaths, device: ss.ClosedRadarSpec) -> bool:
    width = half_power_width(device.spread, "range")
    return bool((0.5 * np.abs(paths.length_rate) * RADAR.frame_time > 0.5 * width).any())


def test_migration_over_the_cells_is_loud() -> None:
    slow = RADAR.with_(num_chirps=512)
    paths = ss.point_targets([[20.0, 0.0, 0.0]], [[24.0, 0.0, 0.0]], 1.0, slow, ss.Pose())
    adc = ss.synthesize(paths, slow)
    true = ss.range_doppler_angle(ss.virtual_cube(adc, slow), slow, compensate_motion=False)
    device = ss.closed_radar_of(true, 8, 16)
    with pytest.warns(ScarlWarning, match=r"1 of 1 paths move over range in a frame by up to 0.467 m"):
        found = ss.map_of_paths(paths, device)
    assert -30.0 < apart_db(true, found) < -25.0  # what the warning is for: -60 dB at rest


def test_scanning_antennas_keep_their_width_in_degrees() -> None:
    beam = np.exp(-0.5 * (np.linspace(-12.0, 12.0, 97) / 2.0) ** 2)
    degrees = np.linspace(-12.0, 12.0, 97)
    axes = ss.MapAxes(range=(10.0, 11.0), azimuth_deg=tuple(np.arange(-70.0, 70.1, 0.5)))
    widths = {}
    for scale in ("sine", "angle"):
        spread = ss.PointSpread.of_arrays((-2.0, 0.0, 2.0), (0.0, 1.0, 0.0), None, (degrees, beam), azimuth_scale=scale)
        device = ss.ClosedRadarSpec(radar=RADAR, spread=spread.with_(interpolation="linear"), axes=axes)
        row = ss.map_of_paths(points(10.0, 60.0), device).data[0, 0]
        widths[scale] = 0.5 * np.count_nonzero(row > 0.5 * row.max())
    at_boresight = 2.0 * 2.0 * np.sqrt(np.log(2.0))  # of the power of a Gaussian amplitude of 2 deg
    assert widths["angle"] == pytest.approx(at_boresight, abs=0.5)
    assert widths["sine"] == pytest.approx(at_boresight / np.cos(np.radians(60.0)), abs=1.0)


@pytest.mark.parametrize("looks", [1, 4])
@pytest.mark.parametrize("kind", ["amplitude", "power"])
def test_noise_has_its_mean_and_variance(device, kind, looks) -> None:
    spread = device.spread if kind == "amplitude" else _of_power(device.spread)
    noisy = device.with_(spread=spread, num_looks=looks)
    paths = points(20 * RADAR.range_resolution, 0.0)
    strong = ss.map_of_paths(paths, noisy)
    cell, noise = np.unravel_index(int(strong.data.argmax()), strong.data.shape), noisy.noise_power
    far = ss.map_of_paths(paths.select(slice(0, 0)), noisy, np.random.default_rng(3)).data.astype(np.float64)
    count = far.size
    assert far.mean() == pytest.approx(noise, rel=5.0 / np.sqrt(count * looks))
    assert far.var() == pytest.approx(noise**2 / looks, rel=5.0 * np.sqrt((2.0 + 6.0 / looks) / count))
    rng, signal = np.random.default_rng(4), float(strong.data[cell])
    weak = noisy.with_(noise_power_dbm=float(10.0 * np.log10(signal / 1e-3)))
    small = weak.with_(axes=weak.axes.with_(range=weak.axes.range[19:22], azimuth_deg=weak.axes.azimuth_deg[31:34]))
    draws = np.array([ss.map_of_paths(paths, small, rng).data[cell[0], 1].max() for _ in range(10)])
    assert (draws > 0.0).all()
    mean = np.array([ss.map_of_paths(paths, small, rng).data[16, 1, 1] for _ in range(300)])
    expected = float(ss.map_of_paths(paths, small).data[16, 1, 1])
    spread_of_mean = np.sqrt((2.0 * expected * signal + signal**2) / looks / 300.0)
    assert mean.mean() == pytest.approx(expected + signal, abs=5.0 * spread_of_mean)


def test_saturated_cells_are_cut_and_said(device) -> None:
    paths = points(20.0, 0.0)
    peak = float(ss.map_of_paths(paths, device).data.max())
    cut = device.with_(full_scale_dbm=10.0 * np.log10(peak / 1e-3) - 6.0, gain_db=20.0)
    with pytest.warns(ScarlWarning, match=r"up to 6.0 dB above full scale"):
        found = ss.map_of_paths(paths, cut)
    assert found.data.max() == pytest.approx(100.0 * peak * 10.0**-0.6, rel=1e-3)


def test_paths_beyond_the_map_are_said(device) -> None:
    near = device.with_(axes=device.axes.with_(range=device.axes.range[:40]), range_period=None)
    with pytest.warns(ScarlWarning, match="1 of 2 paths are outside of the map's ranges"):
        ss.map_of_paths(points([10.0, 30.0], 0.0), near)


def test_peaks_are_the_points_that_are_there(device) -> None:
    paths = points([12.3, 20.7, 31.2], [10.0, -25.0, 3.0], [0.0, 5.0, -5.0], np.array([1.0, 8.0, 40.0]))
    rda = ss.map_of_paths(paths, device, np.random.default_rng(0))
    found = ss.peaks_of_map(rda, 25.0)
    order = np.argsort(found.range[:3])
    assert np.allclose(found.range[:3][order], [12.3, 20.7, 31.2], atol=0.05)
    assert np.allclose(np.degrees(found.azimuth[:3])[order], [10.0, -25.0, 3.0], atol=0.3)
    assert np.allclose(found.radial_velocity[:3][order], [0.0, 5.0, -5.0], atol=0.1)
    assert np.allclose(10.0 * np.log10(found.rcs[:3][order] / (1.0, 8.0, 40.0)), 0.0, atol=3.5)  # straddling
    loud = ss.peaks_of_map(ss.map_of_paths(paths, device.with_(gain_db=30.0)), 25.0, 30.0)
    assert np.allclose(np.sort(loud.power)[-3:], np.sort(found.power)[-3:], rtol=0.05)
    empty = ss.peaks_of_map(ss.map_of_paths(paths.select(slice(0, 0)), device, np.random.default_rng(1)), 13.0)
    cells = rda.data.size  # false alarms of an exponential power, at most all cells above
    assert empty.num_points <= cells * np.exp(-(10.0**1.3)) + 5.0 * np.sqrt(cells * np.exp(-(10.0**1.3))) + 1.0
    for wrong, match in (({"threshold_db": 0.0}, "threshold_db = 0.0 dB"), ({"noise_power": 0.0}, "noise_power")):
        with pytest.raises(ParameterRangeError, match=match):
            ss.peaks_of_map(rda, **wrong)


def test_what_is_no_closed_radar_is_refused(device) -> None:
    with pytest.raises(InputTypeError, match="device"):
        ss.map_of_paths(points(10.0, 0.0), RADAR)
    with pytest.raises(ParameterRangeError, match="oversampling"):
        ss.closed_radar_of(processed(points(10.0, 0.0)), 0)
    symbols = ss.RadarSpec(waveform=ss.Ofdm())
    paths = ss.point_targets([[20.0, 0.0, 0.0]], [[0.0, 0.0, 0.0]], 1.0, symbols, ss.Pose())
    rda = ss.range_doppler_angle(ss.virtual_cube(ss.synthesize(paths, symbols), symbols), symbols)
    with pytest.raises(ParameterRangeError, match="Ofdm"):
        ss.closed_radar_of(rda)
    for changes in (
        {"filters": ss.IfFilter(high_pass=(1e6,))},
        {"phase_noise": ss.PhaseNoise(mask=((1e6, -60.0),))},
        {"leakage": (ss.Leakage(length=0.1, level_db=-40.0),)},
        {"amplifier": ss.Amplifier(p1db_dbm=-150.0)},
    ):
        known = RADAR.with_(**changes)
        with pytest.raises(SpecError, match=r"front_end.ideal\(\)"):
            device.with_(radar=known)
        adc = ss.synthesize(points(10.0, 0.0), known)
        with pytest.raises(SpecError, match=r"front_end.ideal\(\)"):
            ss.closed_radar_of(ss.range_doppler_angle(ss.virtual_cube(adc, known), known))
    with pytest.raises(SpecError, match="offset over azimuth"):
        device.with_(axes=device.axes.with_(azimuth_deg=(0.0,)))
    with pytest.raises(SpecError, match="half the period of velocity"):
        device.with_(velocity_period=10.0)
