"""Shapes, types, identities and errors of the radar's signal chain."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

from scarl_sionna.core.errors import ParameterRangeError, PlacementError, ScarlWarning, UnknownNameError
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.radar.points import point_targets
from scarl_sionna.radar.synthesis import synthesize
from scarl_sionna.signal.angle import range_doppler_angle, uniform_line
from scarl_sionna.signal.converter import _TOGETHER, quantize
from scarl_sionna.signal.detection import detect
from scarl_sionna.signal.noise import add_noise
from scarl_sionna.signal.peaks import tone_offset
from scarl_sionna.signal.processing import range_doppler, virtual_cube
from scarl_sionna.signal.windows import noise_bandwidth, window_values

SMALL = RadarSpec().with_(num_chirps=16, num_samples=64)
STILL = [[0.0, 0.0, 0.0]]


def small_cube(rng=None):
    paths = point_targets([[10.0, 1.0, 0.0]], [[2.0, 0.0, 0.0]], 1.0, SMALL, Pose())
    return virtual_cube(synthesize(paths, SMALL, rng=rng), SMALL)


def test_import_needs_no_engine():
    code = "import sys, scarl_sionna.radar; sys.exit(any(m in sys.modules for m in ('mitsuba', 'drjit', 'sionna')))"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_shapes_and_types():
    cube = small_cube()
    assert cube.shape == (12, 16, 64) and cube.dtype == np.complex64
    rd = range_doppler(cube, SMALL, num_range_bins=128, num_doppler_bins=32)
    assert rd.data.shape == (12, 32, 128) and rd.data.dtype == np.complex64
    assert rd.range.shape == (128,) and rd.radial_velocity.shape == (32,)
    assert np.all(np.diff(rd.radial_velocity) > 0) and rd.radial_velocity[16] == 0.0
    rda = range_doppler_angle(cube, SMALL)
    assert rda.data.shape == (16, 64, len(rda.azimuth)) and rda.data.dtype == np.float32
    assert rda.elevation is None and np.all(np.diff(rda.azimuth) > 0)


def test_axes_step_by_the_resolutions():
    rd = range_doppler(small_cube(), SMALL)
    assert np.diff(rd.range) == pytest.approx(SMALL.range_resolution)
    assert np.diff(rd.radial_velocity) == pytest.approx(SMALL.velocity_resolution)


def test_virtual_cube_sorts_transmitters_before_receivers():
    adc = np.arange(4 * 48 * 64).reshape(4, 48, 64).astype(np.complex64)
    cube = virtual_cube(adc, SMALL)
    for tx, rx, chirp in ((0, 0, 0), (2, 1, 5), (1, 3, 15)):
        assert np.array_equal(cube[tx * 4 + rx, chirp], adc[rx, chirp * 3 + tx])


def test_line_of_the_default_array_is_uniform_and_the_board_is_not():
    line = uniform_line(RadarSpec())
    assert line is not None and line.spacing == pytest.approx(RadarSpec().wavelength / 2.0)
    assert uniform_line(RadarSpec.preset("awr1843boost_3d")) is None


def test_line_by_transform_and_by_steering_agree():
    cube = small_cube()
    radar = SMALL.with_(
        rx_positions=(*SMALL.array.rx_positions[:3], (1e-5, *SMALL.array.rx_positions[3][1:]))
    )  # 10 um off the line
    assert uniform_line(radar) is None
    fast, general = range_doppler_angle(cube, SMALL), range_doppler_angle(cube, radar)
    cell = np.unravel_index(fast.data.argmax(), fast.data.shape)[:2]
    beam = np.interp(np.sin(general.azimuth)[2:-2], np.sin(fast.azimuth), fast.data[cell])
    # linear interpolation over a 1/5 beamwidth: the sagitta of the main lobe is below 4 %
    assert np.abs(beam - general.data[cell][2:-2]).max() < 0.04 * beam.max()


def test_no_generator_means_no_noise():
    adc = np.ones((4, 48, 64), dtype=np.complex64)
    assert np.array_equal(add_noise(adc, SMALL, None), adc)
    assert not np.array_equal(add_noise(adc, SMALL, np.random.default_rng(0)), adc)
    assert np.array_equal(small_cube(np.random.default_rng(4)), small_cube(np.random.default_rng(4)))


def test_quantize_full_scale_and_saturation():
    peak = np.sqrt(1e-3 * 10 ** (SMALL.adc.full_scale_dbm / 10))
    codes, scale, saturated = quantize(np.array([peak, -1j * peak], dtype=np.complex64), SMALL)
    assert codes.dtype == np.int16 and codes.shape == (2, 2) and saturated == 0
    assert codes.tolist() == [[32767, 0], [0, -32767]]
    assert scale * 32767 == pytest.approx(peak)
    codes, _, saturated = quantize(np.array([2 * peak + 3j * peak], dtype=np.complex64), SMALL)
    assert codes.tolist() == [[32767, 32767]] and saturated == 2


def test_a_signal_is_converted_as_its_rows_one_after_the_other():
    """More rows than are converted in one piece; noise and decimation of the converter included, one row clipped."""
    radar = SMALL.with_(adc=SMALL.adc.model_copy(update={"enob": 8.0, "response": ((0.0, 0.0), (0.5, -6.0))}))
    peak = np.sqrt(1e-3 * 10 ** (SMALL.adc.full_scale_dbm / 10))
    rng = np.random.default_rng(5)
    adc = (peak * rng.uniform(-0.5, 0.5, (2, 650, 64, 2))).astype(np.float32).view(np.complex64)[..., 0]
    adc[1, 640] *= 5.0
    assert adc[0].size > _TOGETHER
    whole, alone = np.random.default_rng(6), np.random.default_rng(6)
    codes, scale, saturated = quantize(adc, radar, whole)
    rows = [quantize(row, radar, alone) for row in adc.reshape(-1, 64)]
    np.testing.assert_array_equal(codes, np.reshape([row[0] for row in rows], (2, 650, 64, 2)))
    assert saturated == sum(row[2] for row in rows) > 0 and scale == rows[0][1]
    assert quantize(adc[:, :0], radar)[0].shape == (2, 0, 64, 2)


@pytest.mark.parametrize("name", ["rect", "hann", "hamming", "blackman", "blackmanharris", "chebyshev", "taylor", None])
@pytest.mark.parametrize("count", [1, 2, 3, 64, 65])
def test_windows_sum_to_one_and_are_symmetric(name, count):
    values = window_values(name, count)
    assert values.shape == (count,) and values.sum() == pytest.approx(1.0)
    assert np.allclose(values, values[::-1]) and (values > 0).all()


def test_noise_bandwidths():
    assert noise_bandwidth("rect", 512) == pytest.approx(1.0)
    assert noise_bandwidth("hann", 4096) == pytest.approx(1.5, rel=1e-3)  # Harris 1978, table 1
    assert noise_bandwidth("blackman", 4096) == pytest.approx(1.727, rel=1e-3)


@pytest.mark.parametrize("window", ["rect", "hann", "blackman", "chebyshev"])
def test_tone_offset_is_exact(window):
    count, true = 64, np.linspace(-0.49, 0.49, 23)
    values = window_values(window, count)
    n = np.arange(count)
    powers = [np.abs(np.exp(2j * np.pi * np.outer(true - step, n) / count) @ values) ** 2 for step in (-1, 0, 1)]
    # 129 entries, linear between them: the curvature of the map leaves below 1e-4 of a bin
    assert np.abs(tone_offset(*powers, window, count, count) - true).max() < 5e-4


@pytest.mark.parametrize(
    ("positions", "velocities", "rcs", "name"),
    [
        ([1.0, 2.0, 3.0], STILL, 1.0, "positions"),
        ([[1.0, 2.0]], STILL, 1.0, "positions"),
        ([[1.0, np.nan, 0.0]], STILL, 1.0, "positions"),
        ([["a", "b", "c"]], STILL, 1.0, "positions"),
        ([[9.0, 0.0, 0.0]], [[0.0] * 3] * 2, 1.0, "velocities"),
        ([[9.0, 0.0, 0.0]], STILL, -1.0, "rcs"),
        ([[9.0, 0.0, 0.0]], STILL, [1.0, 2.0], "rcs"),
        ([[9.0, 0.0, 0.0]], STILL, np.inf, "rcs"),
    ],
)
def test_bad_points_are_refused(positions, velocities, rcs, name):
    with pytest.raises(ParameterRangeError) as caught:
        point_targets(positions, velocities, rcs, SMALL, Pose())
    assert caught.value.name == name


def test_target_at_the_origin_is_refused():
    with pytest.raises(PlacementError, match="target 1"):
        point_targets([[9.0, 0, 0], [1.0, 2.0, 3.0]], [[0.0] * 3] * 2, 1.0, SMALL, Pose([1.0, 2.0, 3.0]))


def test_target_at_an_antenna_is_refused():
    radar = SMALL.with_(tx_positions=((0.0, 0.3, 0.0),))
    with pytest.raises(ParameterRangeError, match="antenna"):
        synthesize(point_targets([[0.0, 0.3, 0.0]], STILL, 1.0, radar, Pose()), radar)


def test_wrong_shapes_and_names_are_refused():
    cube = small_cube()
    with pytest.raises(ParameterRangeError, match="num_rx"):
        virtual_cube(cube, SMALL)
    with pytest.raises(ParameterRangeError, match="virtual_cube"):
        range_doppler(cube[:3], SMALL)
    with pytest.raises(ParameterRangeError, match="num_range_bins"):
        range_doppler(cube, SMALL, num_range_bins=32)
    with pytest.raises(UnknownNameError, match="hann"):
        range_doppler(cube, SMALL, window="han")
    with pytest.raises(ParameterRangeError, match="method"):
        synthesize(point_targets([[9.0, 0, 0]], STILL, 1.0, SMALL, Pose()), SMALL, method="exact")
    rda = range_doppler_angle(cube, SMALL)
    with pytest.raises(ParameterRangeError, match="pfa"):
        detect(rda, SMALL, pfa=0.0)
    with pytest.raises(ParameterRangeError, match="window of"):
        detect(rda, SMALL, training=(20, 20))


def test_detection_on_silence_is_empty():
    rda = range_doppler_angle(np.zeros((12, 64, 64), dtype=np.complex64), SMALL.with_(num_chirps=64))
    points = detect(rda, SMALL)
    assert points.num_points == 0 and points.position.shape == (0, 3)


def test_raw_data_that_is_not_finite_is_refused():
    """It gave no points, without a word."""
    radar = RadarSpec().with_(num_chirps=8, num_samples=16)
    adc = np.zeros((4, 24, 16), dtype=np.complex64)
    adc[1, 2, 3] = np.nan
    with pytest.raises(ParameterRangeError, match=r"adc = 1 of 1536 values not finite, first \(1, 2, 3\)"):
        virtual_cube(adc, radar)
    cube = np.full((12, 8, 16), np.inf, dtype=np.complex64)
    with pytest.raises(ParameterRangeError, match="cube = 1536 of 1536 values not finite"):
        range_doppler(cube, radar)


def test_more_power_than_is_sent_is_told_once():
    radar = RadarSpec().with_(num_chirps=8, num_samples=16)
    near = point_targets([[0.01, 0.0, 0.0]], [[0.0, 0.0, 0.0]], 1.0, radar, Pose())
    with pytest.warns(ScarlWarning, match=r"up to \d+\.\d dBm of 12\.0 dBm sent") as told:
        synthesize(near, radar)
    assert len(told) == 1
