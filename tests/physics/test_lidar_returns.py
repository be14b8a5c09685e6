"""What a lidar measures on surfaces that are known exactly."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from camera_lidar import Camera, Lidar
from camera_lidar.camera.projection import camera_optical_from_world, project
from camera_lidar.lidar import camera_maps, range_view, shot_directions
from scarl_sionna.core.mount import Mount
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.specs.camera import CameraSpec
from scarl_sionna.core.specs.lidar.spec import LidarSpec
from scarl_sionna.engine.load import load_scene
from tests.scenes import Material, Thing, ball, box, plane, write_scene

SPEC = LidarSpec(azimuth_fov_deg=(-40, 40), elevation_fov_deg=(-15, 15), num_azimuth=161, num_elevation=61)
RNG = np.random.default_rng


def test_distance_incidence_and_intensity_on_a_tilted_plane(tmp_path: Path) -> None:
    normal = np.array([-1.0, 0.4, 0.2]) / np.linalg.norm([-1.0, 0.4, 0.2])
    centre = np.array([30.0, 2.0, 1.0])
    wall = Thing("wall", plane(300.0, 300.0, centre, normal), "Wall", "paint")
    materials = {"paint": Material(lidar_reflectance=0.37)}
    state = load_scene(write_scene(tmp_path, [wall], materials=materials)).at(0.0)
    pose = Pose.from_euler([1.0, -2.0, 1.5], yaw=0.2, pitch=0.05)
    spec = SPEC.with_(atmospheric_attenuation=5e-3)
    scan = Lidar(spec).observe(state, pose, RNG(0))
    direction = pose.rotate(shot_directions(spec))[scan.shot]
    cosine = -direction @ normal
    distance = -((centre - pose.position) @ normal) / cosine
    assert scan.num_points == 161 * 61
    # the mesh holds the plane in float32 corners 150 m from its centre: 150 * 6e-8 / 150 rad of tilt and 1e-5 m of
    # offset, so 1e-6 relative at 30 m, over the cosine (>= 0.3) 3e-6
    assert np.abs(scan.distance / distance - 1.0).max() < 3e-6
    assert np.abs(scan.cos_incidence - cosine).max() < 1e-6
    expected = 0.37 * cosine * np.exp(-2 * 5e-3 * distance) / distance**2
    # 2 * relative error of d, that of the cosine (1e-6 / 0.3) and 2 alpha d (<= 0.5) * 3e-6
    assert np.abs(scan.intensity / expected - 1.0).max() < 1.2e-5
    assert np.abs(scan.normal - normal @ pose.rotation).max() < 1e-6


def test_radial_velocity_of_a_translating_actor_and_a_moving_sensor(tmp_path: Path) -> None:
    velocity, sensor_velocity = np.array([12.0, -3.0, 0.0]), np.array([-5.0, 2.0, 1.0])
    motion = {"kind": "constant_twist", "position": (25.0, 0.0, 0.0), "velocity": tuple(velocity)}
    car = Thing("car", box((4.0, 2.0, 1.5), (0.0, 0.0, 0.75)), "Car", trajectory=motion)
    ground = Thing("ground", plane(400.0, 400.0), "Roads")
    world = load_scene(write_scene(tmp_path, [ground], [car]))
    pose = Pose([0.0, 0.0, 1.2])
    # the sensor's own rotation must not enter
    scan = Lidar(SPEC).observe(world.at(0.3), Mount(pose, Twist(sensor_velocity, [0.0, 0.5, 2.0])), RNG(0))
    direction = shot_directions(SPEC)[scan.shot]
    is_car = scan.instance == 2
    surface = np.where(is_car[:, None], velocity, 0.0)
    expected = np.einsum("ij,ij->i", surface - sensor_velocity, direction)
    assert is_car.sum() > 50 and (~is_car).sum() > 1000
    # the contract is 1e-3 m/s; float32 storage of 20 m/s gives 1e-6
    assert np.abs(scan.radial_velocity - expected).max() < 1e-5


def test_radial_velocity_of_a_turning_actor_is_that_of_its_surface_points(tmp_path: Path) -> None:
    motion = {
        "kind": "constant_twist", "position": (15.0, 3.0, 0.0), "velocity": (6.0, -4.0, 0.0), "yaw_deg": 30.0,
        "angular_velocity_z": 1.5,
    }  # fmt: skip # a table
    car = Thing("car", box((6.0, 2.0, 3.0), (1.0, 0.0, 1.5)), "Car", trajectory=motion)
    world = load_scene(write_scene(tmp_path, [Thing("ground", plane(100.0, 100.0))], [car]))
    pose, time, step = Pose([0.0, 0.0, 1.0]), 0.4, 1e-4
    scan = Lidar(SPEC).observe(world.at(time), pose, RNG(0))
    on_car = scan.instance == 2
    point = pose.apply(scan.position[on_car])
    attached = world.at(time).actor_pose("car").inverse().apply(point)
    later = np.linalg.norm(world.at(time + step).actor_pose("car").apply(attached) - pose.position, axis=-1)
    earlier = np.linalg.norm(world.at(time - step).actor_pose("car").apply(attached) - pose.position, axis=-1)
    rate = (later - earlier) / (2.0 * step)
    assert on_car.sum() > 200
    assert np.ptp(scan.radial_velocity[on_car]) > 1.0  # a body that only translates would differ far less
    # third-order term: step^2 / 6 * omega^3 * 4 m = 2e-8; rounding: eps * 15 m / step = 3e-11; position in float32:
    # 1e-6 m * omega = 2e-6; the contract is 1e-3 m/s
    assert np.abs(scan.radial_velocity[on_car] - rate).max() < 1e-5


@pytest.mark.parametrize("offset", [(0.0, 0.0, 0.0), (0.0, 0.3, 0.2)])
def test_lidar_points_meet_the_instance_and_depth_images(tmp_path: Path, offset: tuple[float, float, float]) -> None:
    things = [
        Thing("ground", plane(200.0, 200.0), "Roads"),
        Thing("wall", box((1.0, 60.0, 8.0), (40.0, 0.0, 4.0)), "Building"),
        Thing("left", box((4.0, 2.0, 1.5), (15.0, 4.0, 0.75)), "Car"),
        Thing("right", ball(1.5, (12.0, -3.0, 1.5)), "Other"),
    ]
    state = load_scene(write_scene(tmp_path, things)).at(0.0)
    camera_spec = CameraSpec(width=960, height=540, horizontal_fov_deg=70.0, images=("instance", "depth"))
    camera_pose = Pose.from_euler([0.0, 0.0, 1.6], yaw=0.05, pitch=0.03)
    frame = Camera(camera_spec).observe(state, camera_pose, RNG(0))
    lidar_pose = Pose.from_euler(camera_pose.apply(offset), yaw=-0.1, pitch=0.02, roll=0.01)
    spec = LidarSpec(azimuth_fov_deg=(-45, 45), elevation_fov_deg=(-20, 15), num_azimuth=900, num_elevation=300)
    scan = Lidar(spec).observe(state, lidar_pose, RNG(0))
    optical = camera_optical_from_world(camera_pose).compose(lidar_pose)
    pixel, depth = project(optical.apply(scan.position), camera_spec.intrinsics)
    with np.errstate(invalid="ignore"):
        column, row = np.floor(pixel).T
    instance, image = frame.instance, frame.depth
    assert instance is not None and image is not None
    # interior: a pixel that sees the same instance as its eight neighbours
    interior = np.zeros_like(instance, dtype=bool)
    interior[1:-1, 1:-1] = True
    for dv in (-1, 0, 1):
        for du in (-1, 0, 1):
            interior &= np.roll(instance, (dv, du), axis=(0, 1)) == instance
    seen = (column >= 0) & (column < 960) & (row >= 0) & (row < 540)
    seen[seen] = interior[row[seen].astype(int), column[seen].astype(int)]
    v, u = row[seen].astype(int), column[seen].astype(int)
    # from another place the lidar sees behind edges: leave out what the camera's depth says is hidden (5 %)
    visible = depth[seen] < image[v, u] * 1.05
    hit = instance[v, u] == scan.instance[seen]
    assert visible.sum() > 100_000 and len(np.unique(scan.instance[seen])) == 4
    assert hit[visible].mean() > 0.999
    if offset == (0.0, 0.0, 0.0):
        assert hit.all()  # one centre: nothing that the lidar sees is hidden from the camera, hidden test or not


def test_camera_map_and_range_view_show_the_scan(tmp_path: Path) -> None:
    things = [Thing("ground", plane(200.0, 200.0), "Roads"), Thing("car", box((4, 2, 1.5), (15, 0, 0.75)), "Car")]
    state = load_scene(write_scene(tmp_path, things)).at(0.0)
    pose = Pose([0.0, 0.0, 1.6])
    scan = Lidar(SPEC).observe(state, Mount(pose, Twist([10.0, 0.0, 0.0])), RNG(0))
    maps = range_view(scan)
    assert maps.filled.sum() == scan.num_points
    assert not maps.filled[0].any() and maps.filled[-1].all()  # sky above, road below
    camera = CameraSpec(width=160, height=90, horizontal_fov_deg=80.0, images=("depth",))
    image = Camera(camera).observe(state, pose, RNG(0)).depth
    assert image is not None
    projected = camera_maps(scan, camera, pose)
    road = projected.filled & (projected.semantic == 1)
    # on the road depth = height * focal / (v - 45): a point up to half a pixel off its pixel's centre shifts that by
    # 0.5 / (v - 45), plus float32
    rows = np.nonzero(road)[0] + 0.5
    relative = np.abs(projected.depth[road] / image[road] - 1.0)
    on_road = np.isfinite(relative) & (np.abs(image[road] - 1.6 * camera.intrinsics[0, 0] / (rows - 45.0)) < 1e-3)
    assert on_road.sum() > 500
    assert (relative[on_road] <= 0.5 / (rows[on_road] - 45.0 - 0.5) + 1e-5).all()
    assert (projected.radial_velocity[projected.filled] < 0).all()  # all that stands still comes nearer
