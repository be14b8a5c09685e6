"""Planted points come out of the maps where they were planted."""

from __future__ import annotations

import numpy as np
import pytest

from scarl_sionna.core.pose import Pose
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.radar.points import point_targets
from scarl_sionna.radar.synthesis import synthesize
from scarl_sionna.signal.angle import range_doppler_angle
from scarl_sionna.signal.detection import detect
from scarl_sionna.signal.peaks import parabola_offset, tone_offset
from scarl_sionna.signal.processing import virtual_cube

pytestmark = pytest.mark.own_process(shared=True)  # what it leaves behind would stay in the worker

BIN = 0.05
"""Of a bin, from the issue."""


def unit(azimuth, elevation=0.0):
    return np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])


def peak_near(rda, radar, row, column):
    """Interpolated (velocity, range, sine of azimuth) in bins of the strongest cell within two bins."""
    rows = np.arange(row - 2, row + 3) % rda.data.shape[0]
    columns = np.arange(max(column - 2, 0), min(column + 3, rda.data.shape[1]))
    block = rda.data[np.ix_(rows, columns)]
    i, j, k = np.unravel_index(block.argmax(), block.shape)[:3]
    row, column = row - 2 + i, columns[j]
    beam = rda.data[row % rda.data.shape[0], column]
    doppler = rda.data[[(row + s) % rda.data.shape[0] for s in (-1, 0, 1)], column, k]
    distance = rda.data[row % rda.data.shape[0], column - 1 : column + 2, k]
    return (
        row + tone_offset(*doppler, "hann", radar.num_chirps, radar.num_chirps),
        column + tone_offset(*distance, "hann", radar.num_samples, radar.num_samples),
        k + parabola_offset(*np.log(beam[k - 1 : k + 2])),
    )


@pytest.mark.some(2)
@pytest.mark.parametrize("multiplexing", ["ideal", "tdm"])
@pytest.mark.parametrize("azimuth_deg", [0.0, 40.0])
def test_points_over_the_unambiguous_region(multiplexing, azimuth_deg):
    radar = RadarSpec(multiplexing=multiplexing)
    azimuth = np.radians(azimuth_deg)
    distance = np.array([3.0, 20.3, 55.7, 90.1, 130.6, 171.2, 210.9, 252.4])
    fraction = np.array([0.4, -0.97, 0.97, 0.0, -0.53, 0.71, 0.95, -0.95])
    velocity = fraction * radar.unambiguous_velocity
    # equal powers, so that no point hides another: RCS grows with R^4
    paths = point_targets(
        distance[:, None] * unit(azimuth), velocity[:, None] * unit(azimuth), 1e-3 * distance**4, radar, Pose()
    )
    rda = range_doppler_angle(virtual_cube(synthesize(paths, radar), radar), radar)
    sines = np.sin(rda.azimuth)
    for r, v in zip(distance, velocity, strict=True):
        true_row = v / radar.velocity_resolution + 128
        true_column = r / radar.range_resolution
        row, column, beam = peak_near(rda, radar, round(true_row), round(true_column))
        # known: velocity scale S tau / f_c, at most 2e-4 x 122 bins = 0.024; migration smear is symmetric
        assert abs(row - true_row) < BIN, f"velocity at {r} m, {v} m/s"
        assert abs(column - true_column) < BIN, f"range at {r} m, {v} m/s"
        true_beam = (np.sin(azimuth) - sines[0]) / (sines[1] - sines[0])
        assert abs(beam - true_beam) < BIN, f"azimuth at {r} m, {v} m/s"


@pytest.mark.some(3)
@pytest.mark.parametrize("distance", [3.0, 40.0])
@pytest.mark.parametrize(("azimuth_deg", "elevation_deg"), [(0.0, 0.0), (40.0, 0.0), (-25.0, 8.0), (10.0, -12.0)])
def test_board_layout_finds_azimuth_and_elevation(distance, azimuth_deg, elevation_deg):
    radar = RadarSpec.preset("awr1843boost_3d").with_(num_chirps=32)
    azimuth, elevation = np.radians(azimuth_deg), np.radians(elevation_deg)
    direction = unit(azimuth, elevation)
    paths = point_targets([distance * direction], [3.0 * direction], 1.0, radar, Pose())
    rda = range_doppler_angle(virtual_cube(synthesize(paths, radar), radar), radar)
    assert rda.data.shape == (32, 512, len(rda.azimuth), len(rda.elevation))
    points = detect(rda, radar)
    assert points.num_points >= 1
    azimuth_bin = np.diff(np.sin(rda.azimuth))[0]
    elevation_bin = np.diff(np.sin(rda.elevation))[0]
    # Tx 2 stands 2 mm above the others, so the array's phase centre is 0.7 mm up: 0.013 deg at 3 m, 0.003 bins
    assert abs(np.sin(points.azimuth[0]) - np.sin(azimuth)) < BIN * azimuth_bin
    assert abs(np.sin(points.elevation[0]) - np.sin(elevation)) < BIN * elevation_bin
    assert abs(points.range[0] - distance) < BIN * radar.range_resolution
    assert abs(points.radial_velocity[0] - 3.0) < BIN * radar.velocity_resolution
    assert points.position[0] == pytest.approx(distance * direction, abs=0.05 * distance * elevation_bin + 0.03)


def test_detection_gives_rcs_and_position():
    radar = RadarSpec().with_(num_chirps=64)
    position = np.array([41.23, 11.7, 0.0])
    paths = point_targets([position], [[0.0] * 3], 10.0, radar, Pose())
    adc = synthesize(paths, radar, rng=np.random.default_rng(5))
    points = detect(range_doppler_angle(virtual_cube(adc, radar), radar), radar)
    assert points.num_points >= 1
    # SNR 45 dB: one sigma of the power is 8.7 / 10^(45/20) = 0.05 dB
    assert 10 * np.log10(points.rcs[0]) == pytest.approx(10.0, abs=0.3)
    assert points.position[0] == pytest.approx(position, abs=0.15)


def test_aliased_velocity_moves_the_range():
    # stated limit: a point beyond the unambiguous velocity is seen one interval off, and its range is corrected for
    # the velocity that is seen: by S^-1 f_c 2 dv / c (1 + S t_mid / f_c) c / 2 = dv (f_c / S + t_mid)
    radar = RadarSpec().with_(num_chirps=64)
    velocity = 1.4 * radar.unambiguous_velocity
    paths = point_targets([[60.0, 0.0, 0.0]], [[velocity, 0.0, 0.0]], 1.0, radar, Pose())
    points = detect(range_doppler_angle(virtual_cube(synthesize(paths, radar), radar), radar), radar)
    interval = 2.0 * radar.unambiguous_velocity
    assert points.radial_velocity[0] == pytest.approx(velocity - interval, abs=0.05 * radar.velocity_resolution)
    middle = 31.5 * radar.chirp_interval + 255.5 / radar.sample_rate
    expected = 60.0 + interval * (radar.center_frequency / radar.waveform.chirp_slope + middle)
    assert points.range[0] == pytest.approx(expected, abs=0.05 * radar.range_resolution)
