"""Raster, return equations and their limits."""

from __future__ import annotations

import numpy as np
import pytest

from camera_lidar.lidar.pattern import shot_directions
from camera_lidar.lidar.scan import radial_velocity, return_intensity
from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.specs.lidar.spec import LidarSpec


def test_raster_runs_from_the_first_azimuth_line_by_line_from_the_lowest() -> None:
    spec = LidarSpec(azimuth_fov_deg=(-30, 30), elevation_fov_deg=(-10, 10), num_azimuth=3, num_elevation=2)
    directions = shot_directions(spec)
    azimuth = np.degrees(np.arctan2(directions[:, 1], directions[:, 0]))
    elevation = np.degrees(np.arcsin(directions[:, 2]))
    # eps * 90 deg
    assert np.allclose(azimuth, [-30, 0, 30, -30, 0, 30], atol=1e-12)
    assert np.allclose(elevation, [-10, -10, -10, 10, 10, 10], atol=1e-12)
    assert np.allclose(np.linalg.norm(directions, axis=-1), 1.0, atol=4e-16)
    assert directions[2, 1] > 0  # positive azimuth is to the left (y)


def test_a_scan_may_run_to_the_right() -> None:
    spec = LidarSpec(azimuth_fov_deg=(30, -30), num_azimuth=3, num_elevation=1)
    assert np.allclose(np.degrees(spec.scan.column_azimuth), [30, 0, -30], atol=1e-12)


def test_a_full_turn_does_not_shoot_twice_at_its_seam() -> None:
    spec = LidarSpec(azimuth_fov_deg=(-180, 180), num_azimuth=4, num_elevation=1)
    assert np.allclose(np.degrees(spec.scan.column_azimuth), [-180, -90, 0, 90], atol=1e-12)


def test_a_single_shot_looks_along_the_middle() -> None:
    spec = LidarSpec(azimuth_fov_deg=(-10, 30), elevation_fov_deg=(2, 4), num_azimuth=1, num_elevation=1)
    azimuth, elevation = spec.scan.angles()
    assert np.allclose(np.degrees([azimuth[0], elevation[0]]), [10, 3], atol=1e-12)
    staring = LidarSpec(azimuth_fov_deg=(5, 5), elevation_fov_deg=(0, 0), num_azimuth=1, num_elevation=1)
    assert shot_directions(staring).shape == (1, 3)


@pytest.mark.parametrize(
    ("bad", "message"),
    [
        ({"azimuth_fov_deg": (10, 10)}, "azimuth_fov_deg with two different ends"),
        ({"azimuth_fov_deg": (-200, 200)}, "at most a full turn"),
        ({"elevation_fov_deg": (5, -5)}, r"\(lowest, highest\)"),
        ({"elevation_fov_deg": (0, 95)}, "within -90 to 90 deg"),
        ({"elevation_fov_deg": (1, 1)}, "num_elevation = 1"),
        ({"num_azimuth": 0}, "greater than or equal to 1"),
        ({"range_noise_variance_per_metre": -1.0}, "greater than or equal to 0"),
        ({"atmospheric_attenuation": -1e-3}, "greater than or equal to 0"),
        ({"azimuth_fov_deg": (float("nan"), 1.0)}, "finite"),
    ],
)
def test_bad_specifications_are_refused(bad: dict, message: str) -> None:
    with pytest.raises(ParameterRangeError, match=message):
        LidarSpec(**bad)


def test_intensity_law() -> None:
    # the reference: white diffuser, 1 m, normal incidence, no air
    assert return_intensity(1.0, 1.0, 1.0, 0.0) == 1.0
    # 0.4 * cos 60 deg * exp(-2 * 0.01 * 50) / 50^2 = 0.2 * e^-1 / 2500
    assert np.isclose(return_intensity(0.4, 0.5, 50.0, 0.01), 0.2 * np.exp(-1.0) / 2500.0, rtol=1e-15)
    distance = np.array([1.0, 2.0, 4.0])
    assert np.allclose(return_intensity(1.0, 1.0, distance, 0.0), [1.0, 0.25, 0.0625], rtol=1e-15)


def test_radial_velocity_is_positive_when_the_distance_opens() -> None:
    ahead = [1.0, 0.0, 0.0]
    assert radial_velocity([10.0, 3.0, 0.0], [0.0, 0.0, 0.0], ahead) == 10.0
    assert radial_velocity([0.0, 0.0, 0.0], [10.0, 0.0, 0.0], ahead) == -10.0  # driving towards a wall
    assert radial_velocity([7.0, 0.0, 0.0], [7.0, 0.0, 0.0], ahead) == 0.0
