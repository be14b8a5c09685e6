"""Cameras with a distorting lens: RGB and labels show the same things in the same pixels."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from camera_lidar import Camera
from camera_lidar.camera import render_labels, render_radiance
from camera_lidar.camera.projection import camera_optical_from_world, pixel_rays
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.semantics import SKY
from scarl_sionna.core.specs.camera import BrownConrady, CameraSpec, KannalaBrandt
from scarl_sionna.engine.load import load_scene
from tests.scenes import Light, Thing, ball, box, plane, write_scene

POSE = Pose.from_euler([2.0, -1.0, 1.7], yaw=0.4, pitch=0.1, roll=-0.15)
BARREL = CameraSpec(
    width=240,
    height=136,
    lens=BrownConrady(k1=-0.3, k2=0.11, p1=1e-3, p2=-8e-4),
    horizontal_fov_deg=80.0,
    samples_per_pixel=64,
    denoise=False,
)
FISHEYE = CameraSpec(
    width=200,
    height=200,
    lens=KannalaBrandt(k1=-0.02, k2=0.002, max_angle_deg=100.0),
    horizontal_fov_deg=200.0,
    samples_per_pixel=64,
    denoise=False,
)


@pytest.mark.some(2)
@pytest.mark.parametrize(
    ("spec", "pixel"),
    [(BARREL, (40.0, 30.0)), (BARREL, (225.0, 120.0)), (FISHEYE, (100.0, 60.0)), (FISHEYE, (7.0, 96.0))],
)
def test_a_shining_ball_appears_where_it_is_projected(tmp_path: Path, spec: CameraSpec, pixel: tuple) -> None:
    radius, distance = 0.1, 4.0
    centre_optical = spec.rays(pixel) * distance
    optical_from_world = camera_optical_from_world(POSE)
    centre = optical_from_world.inverse().apply(centre_optical)
    far = Thing("far", plane(1.0, 1.0, (0.0, 0.0, -90.0)))
    scene = write_scene(
        tmp_path, [far, Thing("ball", ball(radius, centre), emission=1.0)], light=Light("constant", 0.0)
    )
    state = load_scene(scene).at(0.0)
    image = render_radiance(state, spec, POSE, np.random.default_rng(5))[..., 0].astype(float)
    rows, columns = np.mgrid[0 : spec.height, 0 : spec.width] + 0.5
    centroid = np.array([(image * columns).sum(), (image * rows).sum()]) / image.sum()
    # exact: the mean of the projection over the solid angle of the ball's visible rays, weighted by pixel area
    axis = centre_optical / distance
    fine = spec.width * 4
    u, v = np.meshgrid((np.arange(fine) + 0.5) / 4, (np.arange(spec.height * 4) + 0.5) / 4)
    cosine = spec.rays(np.stack([u, v], -1)) @ axis
    covered = cosine > np.sqrt(1.0 - (radius / distance) ** 2)
    expected = [u[covered].mean(), v[covered].mean()]
    # 20 to 60 border pixels with coverage errors <= 0.06 (64 samples) and 0.13 (grid of 1/16 px2), lever 3 to 6 px,
    # area 25 px: sqrt(40) * 0.14 * 4 / 25 = 0.14 px at most; a shift of half a pixel or a missing distortion (>= 1.5 px
    # here) fails
    assert np.abs(centroid - expected).max() < 0.15


@pytest.mark.parametrize("spec", [BARREL, FISHEYE], ids=["barrel", "fisheye"])
def test_rgb_and_instances_agree_pixel_for_pixel(tmp_path: Path, spec: CameraSpec) -> None:
    things = [
        Thing("far", plane(1.0, 1.0, (0.0, 0.0, -90.0))),
        Thing("box", box((1.0, 2.0, 1.5), (8.0, 2.0, 1.0)), emission=1.0),
        Thing("side", box((1.0, 1.0, 1.0), (3.5, 3.0, 1.5)), emission=1.0),
    ]
    state = load_scene(write_scene(tmp_path, things, light=Light("constant", 0.0))).at(0.0)
    radiance = render_radiance(state, spec, POSE, np.random.default_rng(2))[..., 0]
    shining = render_labels(state, spec, POSE).instance > 1
    assert shining.sum() > 300
    wholly, dark = radiance > 0.999, radiance < 1e-6
    assert shining[wholly].all() and not shining[dark].any()
    assert (~wholly & ~dark).sum() < 4 * np.sqrt(shining.sum()) * 2  # only the outline is mixed


@pytest.mark.parametrize("spec", [BARREL, FISHEYE], ids=["barrel", "fisheye"])
def test_depth_is_the_ray_distance_times_the_cosine(tmp_path: Path, spec: CameraSpec) -> None:
    room = [
        Thing(f"wall{k}", plane(40.0, 40.0, 10.0 * np.array(n), normal=-np.array(n)), "Wall")
        for k, n in enumerate([(1.0, 0, 0), (-1.0, 0, 0), (0, 1.0, 0), (0, -1.0, 0), (0, 0, 1.0), (0, 0, -1.0)])
    ]
    state = load_scene(write_scene(tmp_path, room)).at(0.0)
    depth = render_labels(state, spec, POSE).depth.ravel()
    rays = pixel_rays(spec)
    seen = np.isfinite(rays[:, 0])
    world = POSE.rotate(rays[seen])
    distance = np.min(
        np.where(np.abs(world) > 1e-12, (10.0 * np.sign(world) - POSE.position) / world, np.inf), axis=1
    )  # to the walls of the cube of 20 m
    np.testing.assert_allclose(depth[seen], distance * rays[seen][:, 0], atol=1e-4)  # the contract; float32 gives 2e-6
    assert np.isinf(depth[~seen]).all()


def test_outside_of_the_lens_nothing_is_seen(tmp_path: Path) -> None:
    spec = FISHEYE.with_(lens=KannalaBrandt(max_angle_deg=70.0), horizontal_fov_deg=None, focal_length_px=60.0)
    spec = spec.with_(images=("rgb", "depth", "semantic", "instance", "normal", "flow"), samples_per_pixel=4)
    state = load_scene(write_scene(tmp_path, [Thing("ground", plane(400.0, 400.0), "Roads")])).at(0.0)
    frame = Camera(spec).observe(state, POSE, np.random.default_rng(0))
    outside = np.isnan(pixel_rays(spec)[:, 0]).reshape(spec.height, spec.width)
    assert 0.2 < outside.mean() < 0.8
    assert (frame.rgb[outside] == 0).all() and (frame.rgb[~outside] > 0).all()
    assert (frame.semantic[outside] == SKY).all() and (frame.instance[outside] == 0).all()
    assert np.isinf(frame.depth[outside]).all() and (frame.normal[outside] == 0.0).all()
    assert np.isnan(frame.flow[outside]).all()
