"""Velocities of time multiplexing beyond the unambiguous interval, by the array's own phases."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scarl_sionna.core.pose import Pose
from scarl_sionna.core.specs.radar.array import HALF_WAVE, AntennaArray, uniform_line
from scarl_sionna.core.specs.radar.pattern import IsotropicPattern
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.dataset.derived.radar_points import velocity_over_ground
from scarl_sionna.radar.labels.labels import label_points
from scarl_sionna.radar.points import point_targets
from scarl_sionna.radar.synthesis import synthesize
from scarl_sionna.signal.angle import range_doppler_angle
from scarl_sionna.signal.detection import detect
from scarl_sionna.signal.processing import virtual_cube

RADAR = RadarSpec(multiplexing="tdm").with_(num_chirps=64, num_samples=128)


def target(radar, velocity, azimuth_deg=20.0, distance=30.0):
    azimuth = np.radians(azimuth_deg)
    unit = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    return point_targets([distance * unit], [velocity * unit], 10.0, radar, Pose())


def points_of(paths, radar, **options):
    adc = synthesize(paths, radar, rng=np.random.default_rng(2))
    return detect(range_doppler_angle(virtual_cube(adc, radar), radar), radar, **options)


@pytest.mark.parametrize("velocity", [-24.0, -13.0, -8.6, 0.0, 4.0, 8.6, 17.0, 24.0])
def test_three_transmitters_see_three_intervals(velocity):
    points = points_of(target(RADAR, velocity), RADAR)
    assert RADAR.unambiguous_velocity == pytest.approx(8.52, abs=0.03)
    assert points.radial_velocity[0] == pytest.approx(velocity, abs=0.05 * RADAR.velocity_resolution)
    assert points.range[0] == pytest.approx(30.0, abs=0.05 * RADAR.range_resolution)
    assert np.degrees(points.azimuth[0]) == pytest.approx(20.0, abs=0.3)
    assert 10.0 * np.log10(points.rcs[0]) == pytest.approx(10.0, abs=0.4)
    assert points.velocity_interval[0] == pytest.approx(6.0 * RADAR.unambiguous_velocity)


@pytest.mark.parametrize(("over_ground", "own"), [(13.8, 10.0), (13.8, 12.0), (-12.0, 10.0), (0.0, 10.0), (24.0, 20.0)])
def test_velocity_over_ground_is_within_the_interval_that_a_point_tells(over_ground, own):
    """Folded to +-8.5 m/s a car that departs with 13.8 m/s closed with 3.2 m/s."""
    ahead = np.array([own, 0.0, 0.0])
    points = points_of(target(RADAR, over_ground - own, 0.0), RADAR)
    assert velocity_over_ground(points, ahead)[0] == pytest.approx(over_ground, abs=0.05)


def test_of_a_point_that_tells_no_interval_the_velocity_over_ground_is_within_that_of_the_map():
    ahead, paths = np.array([10.0, 0.0, 0.0]), target(RADAR, -10.0, 0.0)  # at rest
    weak = replace(paths, a=paths.a * 10.0 ** (-30.0 / 20.0))  # 10 dB over the noise of a beam
    for points in (points_of(weak, RADAR, pfa=1e-3), points_of(paths, RADAR, unfold=False)):
        assert points.velocity_interval[0] == pytest.approx(2.0 * RADAR.unambiguous_velocity)
        assert points.radial_velocity[0] == pytest.approx(2.0 * RADAR.unambiguous_velocity - 10.0, abs=0.1)
        assert velocity_over_ground(points, ahead)[0] == pytest.approx(0.0, abs=0.3)  # its direction is wrong, too


def test_without_it_range_and_angle_are_wrong():
    points = points_of(target(RADAR, 13.0), RADAR, unfold=False)
    assert points.radial_velocity[0] == pytest.approx(13.0 - 2 * RADAR.unambiguous_velocity, abs=0.02)
    assert abs(np.degrees(points.azimuth[0]) - 20.0) > 5.0


def test_two_transmitters_see_two_intervals():
    half = 0.5 * RADAR.wavelength
    radar = RADAR.with_(tx_positions=((0, 0, 0), (0, 4 * half, 0)))
    for velocity in (-1.5, 0.0, 1.5):
        wanted = velocity * radar.unambiguous_velocity
        points = points_of(target(radar, wanted), radar)
        assert points.radial_velocity[0] == pytest.approx(wanted, abs=0.05 * radar.velocity_resolution)
        assert np.degrees(points.azimuth[0]) == pytest.approx(20.0, abs=0.5)


def test_an_unfolded_point_keeps_its_label():
    radar = RADAR.with_(pattern=IsotropicPattern())
    paths = target(radar, 13.0)
    paths.instance[:] = 7
    points = points_of(paths, radar)
    labels = label_points(points, paths, radar)
    assert labels.instance[0] == 7 and labels.share[0] == pytest.approx(1.0)
    assert labels.explained[0] == pytest.approx(1.0, abs=0.05)


def test_noise_and_slow_targets_stay_where_they_are():
    for seed in range(10):
        rng = np.random.default_rng(seed)
        adc = synthesize(target(RADAR, rng.uniform(-8, 8), rng.uniform(-50, 50)), RADAR, rng=rng)
        points = detect(range_doppler_angle(virtual_cube(adc, RADAR), RADAR), RADAR, pfa=1e-3)
        assert (np.abs(points.radial_velocity[points.snr_db < 15.0]) < 1.01 * RADAR.unambiguous_velocity).mean() > 0.9
        assert abs(points.radial_velocity[0]) < 8.52


@pytest.mark.parametrize("multiplexing", ["ideal", "tdm"])
@pytest.mark.parametrize("share", [0.98, 0.995, -0.995])
def test_the_upper_half_of_the_last_bin_is_within_the_interval(multiplexing, share):
    """Seen below the first row, it was one interval off, and its range with it."""
    radar = RADAR.with_(num_chirps=32, multiplexing=multiplexing)
    velocity = share * radar.unfolded_velocity
    points = points_of(target(radar, velocity), radar)
    assert points.radial_velocity[0] == pytest.approx(velocity, abs=0.05 * radar.velocity_resolution)
    assert points.range[0] == pytest.approx(30.0, abs=0.05 * radar.range_resolution)
    assert np.degrees(points.azimuth[0]) == pytest.approx(20.0, abs=0.3)


@pytest.mark.parametrize(
    ("num_tx", "apart", "num_rx", "intervals"),
    [(3, 4, 4, 3), (2, 4, 4, 2), (4, 1, 1, 1), (12, 4, 4, 1), (3, 1, 4, 3)],
)
def test_a_radar_promises_the_velocities_that_its_array_tells(num_tx, apart, num_rx, intervals):
    """Where another direction explains the phases between transmitters, their turns tell no more intervals."""
    array = AntennaArray(
        tx_positions=uniform_line(num_tx, apart * HALF_WAVE), rx_positions=uniform_line(num_rx, HALF_WAVE)
    )
    radar = RADAR.with_(array=array, num_chirps=32)
    assert radar.num_turns == num_tx and radar.num_intervals == intervals
    assert radar.unfolded_velocity == pytest.approx(intervals * radar.unambiguous_velocity)
    late = tuple(4e-6 * (np.arange(32) % 2))  # hardly staggered: turns are told apart no better
    assert radar.with_(chirp_offsets=late).unfolded_velocity == pytest.approx(radar.unfolded_velocity, rel=0.02)


def test_what_is_promised_is_found_wherever_the_target_is():
    """A single receiver: the transmitters are the array, and beyond their interval the direction would be another."""
    array = AntennaArray(tx_positions=uniform_line(4, HALF_WAVE), rx_positions=((0.0, 0.0, 0.0),))
    radar = RADAR.with_(array=array, num_chirps=32)
    for azimuth_deg in (-40.0, 0.0, 35.0):
        velocity = 0.9 * radar.unfolded_velocity
        points = points_of(target(radar, velocity, azimuth_deg), radar)
        assert points.radial_velocity[0] == pytest.approx(velocity, abs=0.1 * radar.velocity_resolution)
        assert np.degrees(points.azimuth[0]) == pytest.approx(azimuth_deg, abs=1.0)
