"""Points from maps: direction to the maximum of the beamformer, not to the next direction of the map."""

from __future__ import annotations

import tracemalloc
import warnings

import numpy as np
import pytest
import scipy.special
from scipy.optimize import minimize_scalar

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.radar.points import point_targets
from scarl_sionna.radar.synthesis import synthesize
from scarl_sionna.signal.angle import RangeDopplerAngle, range_doppler_angle, steering
from scarl_sionna.signal.detection import cfar, detect
from scarl_sionna.signal.detection.statistics import factor_on_mean
from scarl_sionna.signal.detection.subbin import _axis
from scarl_sionna.signal.detection.threshold import RANK, TrainingWindow, _threshold_factor
from scarl_sionna.signal.processing import range_doppler, virtual_cube
from scarl_sionna.signal.windows import window_values

RADAR = RadarSpec().with_(num_chirps=32, num_samples=64)


@pytest.mark.parametrize("azimuth_deg", [-41.3, -7.7, 0.4, 22.3])
def test_the_azimuth_of_one_point_is_that_of_the_beamformers_maximum(azimuth_deg: float) -> None:
    azimuth = np.radians(azimuth_deg)
    place = 20.0 * RADAR.range_resolution * np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    cube = virtual_cube(synthesize(point_targets([place], [np.zeros(3)], 1.0, RADAR, Pose()), RADAR), RADAR)
    rda = range_doppler_angle(cube, RADAR)
    points = detect(rda, RADAR)
    found = float(points.azimuth[points.power.argmax()])
    rd = rda.range_doppler
    cell = np.unravel_index(rd.power.argmax(), rd.power.shape)
    snapshot = rd.data[(slice(None), *cell)].astype(np.complex128)

    def against(angle: float) -> float:
        beam = steering(RADAR, np.array([[np.cos(angle), np.sin(angle), 0.0]]))[0]
        return -(abs(np.vdot(beam, snapshot)) ** 2)

    best = minimize_scalar(against, bounds=(found - 0.1, found + 0.1), method="bounded", options={"xatol": 1e-10}).x
    assert found == pytest.approx(best, abs=2e-6)  # the power is flat there: float64 cannot tell 1e-7 rad apart
    assert best == pytest.approx(azimuth, abs=2e-4)  # a wavefront from 10 m is curved over 2 cm


def test_a_wall_beside_a_cell_does_not_count_as_its_noise() -> None:
    """Guard cells are left out and training cells beyond them count: with the guard at 0 a wide echo hides itself."""
    rng = np.random.default_rng(1)
    cube = 1e-9 * (rng.normal(size=(12, 32, 64)) + 1j * rng.normal(size=(12, 32, 64)))
    place = [[20.0 * RADAR.range_resolution, 0.0, 0.0]]
    cube = cube + virtual_cube(synthesize(point_targets(place, np.zeros((1, 3)), 1.0, RADAR, Pose()), RADAR), RADAR)
    rd = range_doppler(cube.astype(np.complex64), RADAR)
    row, column = np.unravel_index(rd.power.argmax(), rd.power.shape)
    with_guard, without = cfar(rd, guard=(3, 3), training=(6, 8)), cfar(rd, guard=(0, 0), training=(1, 1))
    assert with_guard[row, column] and with_guard[row, column + 1]
    assert not without[row, column + 1]


def noise_map(radar: RadarSpec) -> RangeDopplerAngle:
    rng = np.random.default_rng(5)
    shape = (radar.num_virtual, radar.num_chirps, radar.num_samples)
    return range_doppler_angle((rng.normal(size=shape) + 1j * rng.normal(size=shape)).astype(np.complex64), radar)


def test_the_window_is_the_documented_one_and_that_of_cfar() -> None:
    """Half-widths of 3 and 3 guard cells and 6 and 8 training cells over Doppler and range, unless others are given."""
    rda = noise_map(RADAR)
    documented = cfar(rda.range_doppler, 0.05, (3, 3), (6, 8))
    assert documented.any()
    assert np.array_equal(cfar(rda.range_doppler, 0.05), documented)
    found = detect(rda, pfa=0.05, peaks_only=False)
    assert len(found.range) == np.count_nonzero(documented)
    for guard, training in (((4, 3), (6, 8)), ((3, 2), (6, 8)), ((3, 3), (7, 8)), ((3, 3), (6, 7))):
        other = cfar(rda.range_doppler, 0.05, guard, training)
        assert not np.array_equal(other, documented)
        assert len(detect(rda, None, 0.05, guard, training, peaks_only=False).range) == np.count_nonzero(other)


def test_training_cells_are_those_of_a_loop_over_the_window() -> None:
    """Around each cell: periodic over Doppler, none beyond the ends of range, the guard left out."""
    rd = noise_map(RADAR).range_doppler
    guard, training = (1, 2), (2, 3)
    window = TrainingWindow.of(rd, guard, training, "both")
    assert window.outer == (7, 11) and window.inner == (3, 5)
    power = rd.power.astype(np.float64)
    mean, count = np.zeros_like(power), np.zeros_like(power)
    for row in range(-3, 4):
        for column in range(-5, 6):
            if abs(row) <= guard[0] and abs(column) <= guard[1]:
                continue
            first, stop = max(-column, 0), power.shape[1] - max(column, 0)
            mean[:, first:stop] += np.roll(power, -row, axis=0)[:, first + column : stop + column]
            count[:, first:stop] += 1.0
    # the factor itself is held by the rate of false alarms, statistics/test_radar_noise.py
    for pfa in (0.6, 0.4, 0.2, 0.1, 0.02):
        factor = _threshold_factor(window, len(rd.data), pfa, count)
        assert np.array_equal(cfar(rd, pfa, guard, training, along="both"), power > factor * mean / count)
    assert count.max() == 7 * 11 - 3 * 5 and count[0, 0] == 7 * 6 - 3 * 3


def test_peaks_are_the_largest_of_their_neighbours() -> None:
    rda = noise_map(RADAR)
    power = np.pad(rda.range_doppler.power, ((1, 1), (0, 0)), mode="wrap")
    power = np.pad(power, ((0, 0), (1, 1)), constant_values=-1.0)
    rows, columns = rda.range_doppler.power.shape
    around = [power[i : i + rows, j : j + columns] for i in range(3) for j in range(3) if (i, j) != (1, 1)]
    peak = np.all([rda.range_doppler.power > other for other in around], axis=0)
    wanted = np.count_nonzero(cfar(rda.range_doppler, 0.05) & peak)
    assert len(detect(rda, pfa=0.05).range) == wanted < np.count_nonzero(cfar(rda.range_doppler, 0.05))


def test_the_window_may_fill_the_map_but_not_leave_it() -> None:
    rd = noise_map(RADAR).range_doppler  # 32 by 64 cells
    assert cfar(rd, guard=(5, 15), training=(10, 16)).shape == (32, 64)  # 31 by 63
    for guard, training in (((6, 15), (10, 16)), ((5, 16), (10, 16))):
        with pytest.raises(ParameterRangeError, match="at most"):
            cfar(rd, guard=guard, training=training)
    assert cfar(rd, guard=(0, 0), training=(1, 1)).shape == (32, 64)
    for guard, training in (((-1, 0), (1, 1)), ((0, 0), (0, 1))):
        with pytest.raises(ParameterRangeError, match="guard"):
            cfar(rd, guard=guard, training=training)
    for pfa in (0.0, 1.0):
        with pytest.raises(ParameterRangeError, match="pfa"):
            cfar(rd, pfa=pfa)


@pytest.mark.parametrize("num_looks", [1, 12])
@pytest.mark.parametrize("pfa", [0.9, 1e-6, 1e-16, 1e-40, 1e-300])
def test_factors_of_any_rate(num_looks, pfa) -> None:
    """One training cell's ratio to one look has the closed form 1 / (1 + T); others by their survival function."""
    assert factor_on_mean(pfa, 1, np.ones(1)) == pytest.approx(1.0 / pfa - 1.0, rel=1e-9)
    found = factor_on_mean(pfa, num_looks, np.array([2.0, 30.5]))
    shape = num_looks * np.array([2.0, 30.5])
    np.testing.assert_allclose(
        scipy.special.betainc(shape, num_looks, shape / (shape + num_looks * found)), pfa, rtol=0.02
    )
    window = TrainingWindow.of(noise_map(RADAR).range_doppler, (0, 0), (1, 1), "range")
    assert 0.0 < window.linked("ca", pfa, num_looks, RANK) < np.inf


def test_a_strong_point_is_found_at_a_rate_of_1e_300() -> None:
    paths = point_targets([[20.0, 3.0, 0.0]], [np.zeros(3)], 1000.0, RADAR, Pose())
    cube = virtual_cube(synthesize(paths, RADAR, rng=np.random.default_rng(0)), RADAR)
    rda = range_doppler_angle(cube, RADAR)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert detect(rda, pfa=1e-300).num_points == 1
    with pytest.raises(ParameterRangeError, match="1e-300 <= pfa < 1"):
        detect(rda, pfa=1e-310)


@pytest.mark.parametrize("distance", [7.0, 8.0, 16.0])
def test_one_point_beyond_the_fraunhofer_distance_of_a_long_line_is_one_point(distance: float) -> None:
    """It ends at 7.7 m; plane waves left two more points, 18 dB below and 1.2 deg beside the true one."""
    places = tuple((0.0, 0.5 * RADAR.wavelength * (k - 31.5), 0.0) for k in range(64))
    line = RADAR.with_(tx_positions=((0.0, 0.0, 0.0),), rx_positions=places)
    paths = point_targets([[distance, 0.0, 0.0]], [np.zeros(3)], 10.0, line, Pose())
    cube = virtual_cube(synthesize(paths, line, rng=np.random.default_rng(0)), line)
    points = detect(range_doppler_angle(cube, line))
    assert points.num_points == 1 and points.azimuth[0] == pytest.approx(0.0, abs=1e-3)


def test_no_direction_at_all_is_refused() -> None:
    with pytest.raises(ParameterRangeError, match="most_directions"):
        detect(noise_map(RADAR), most_directions=0)


def test_a_long_range_axis_is_searched_in_little_memory() -> None:
    """Offsets times cells times bins took 3.6 GB at 32,768 bins."""
    many, few = (window_values("hann", count) for count in (20_000, 2_000))
    tracemalloc.start()
    axis = _axis(tuple(many.tolist()), tuple((many**2).tolist()), 20_000, 1)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 300e6
    assert np.allclose(axis.tones, _axis(tuple(few.tolist()), tuple((few**2).tolist()), 2_000, 1).tones, atol=0.02)
