"""Pinhole projection: conventions, inverse, rays."""

from __future__ import annotations

import numpy as np
import pytest

from camera_lidar.camera.projection import camera_optical_from_world, pixel_centres, pixel_rays, project, unproject
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.specs.camera import CameraSpec

SPEC = CameraSpec(width=960, height=540, horizontal_fov_deg=70.0)


def test_project_and_unproject_are_inverse() -> None:
    rng = np.random.default_rng(1)
    pixel = rng.uniform(-500.0, 1500.0, (1000, 2))
    depth = rng.uniform(0.1, 1000.0, 1000)
    points = unproject(pixel, depth, SPEC.intrinsics)
    back, depth_back = project(points, SPEC.intrinsics)
    # float64: eps * 1500 px * a few operations = 1e-12 px; 1e-6 px is the contract
    assert np.abs(back - pixel).max() < 1e-6
    assert np.allclose(depth_back, depth, rtol=1e-12)


def test_optical_axis_meets_the_middle_and_the_field_of_view_ends_at_the_border() -> None:
    half = np.tan(np.radians(35.0))
    pixel, _ = project([[0, 0, 5.0], [half * 5.0, 0, 5.0], [-half * 5.0, 0, 5.0]], SPEC.intrinsics)
    # exact up to rounding of tan: 1e-9 px
    assert np.allclose(pixel, [[480, 270], [960, 270], [0, 270]], atol=1e-9)


def test_left_is_left_and_up_is_up() -> None:
    world_from_sensor = Pose.from_euler([3.0, 4.0, 1.0], yaw=np.pi / 2)  # looks along world y
    optical = camera_optical_from_world(world_from_sensor)
    left_up = optical.apply([2.0, 14.0, 2.0])  # 10 m ahead, 1 m left, 1 m up
    assert np.allclose(left_up, [-1.0, -1.0, 10.0], atol=1e-12)  # eps * 14 m
    (u, v), _ = project(left_up, SPEC.intrinsics)
    assert u < 480 and v < 270


def test_points_behind_have_no_pixel() -> None:
    pixel, depth = project([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0]], SPEC.intrinsics)
    assert np.isnan(pixel).all()
    assert depth.tolist() == [-1.0, 0.0]


def test_pixel_centres_start_at_one_half_and_run_row_by_row() -> None:
    centres = pixel_centres(CameraSpec(width=3, height=2))
    assert centres.tolist() == [[0.5, 0.5], [1.5, 0.5], [2.5, 0.5], [0.5, 1.5], [1.5, 1.5], [2.5, 1.5]]


def test_pixel_rays_project_onto_their_pixels() -> None:
    spec = CameraSpec(width=64, height=48, horizontal_fov_deg=100.0)
    rays = pixel_rays(spec)
    assert np.allclose(np.linalg.norm(rays, axis=-1), 1.0, atol=1e-15 * 4)  # a few eps
    pixel, _ = project(camera_optical_from_world(Pose()).apply(rays * 7.0), spec.intrinsics)
    assert np.abs(pixel - pixel_centres(spec)).max() < 1e-6  # contract; rounding gives 1e-12 px
    with pytest.raises(ValueError):
        rays[0, 0] = 0.0  # shared by all cameras of the kind, so not writable
