"""A scan takes its time: rolling distortion, exact hits and velocities at every shot's own time, de-skewing."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from camera_lidar import Lidar
from camera_lidar.lidar import deskew, shot_directions, shot_times
from camera_lidar.lidar.motion import sensor_motion, shot_rays
from camera_lidar.lidar.rolling import RollingCaster
from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.mount import Mount
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.specs.lidar.pattern import SpinningScan
from scarl_sionna.core.specs.lidar.spec import LidarSpec
from scarl_sionna.engine.load import load_scene
from scarl_sionna.engine.world import World
from tests.scenes import Thing, ball, box, plane, write_scene

RASTER = LidarSpec(
    azimuth_fov_deg=(-40, 40), elevation_fov_deg=(-10, 10), num_azimuth=161, num_elevation=41, scan_time=0.1
)
SPINNING = LidarSpec(scan=SpinningScan(elevation_deg=tuple(np.linspace(-15.0, 5.0, 16)), num_azimuth=900))


def rng() -> np.random.Generator:
    return np.random.default_rng(0)


def moving(kind: str, **table: object) -> dict[str, object]:
    return {"kind": kind, **table}


def test_a_wall_that_comes_nearer_is_skewed_exactly(tmp_path: Path) -> None:
    motion = moving("constant_twist", position=(40.0, 0.0, 0.0), velocity=(-25.0, 6.0, 0.0))
    wall = Thing("wall", plane(150.0, 150.0, normal=(-1.0, 0.0, 0.0)), "Wall", trajectory=motion)
    world = load_scene(write_scene(tmp_path, [Thing("far", plane(1.0, 1.0, (0, 0, -500.0)))], [wall]))
    scan = Lidar(RASTER).observe(world.at(0.2), Pose(), rng())
    time, direction = shot_times(RASTER), shot_directions(RASTER)
    assert scan.num_points == RASTER.num_shots and np.ptp(time) > 0.099
    # float64 hit points on a plane of float32 corners within 100 m of its centre: 100 m * 6e-8, over the cosine (>
    # 0.75)
    expected = (40.0 - 25.0 * (0.2 + time)) / direction[:, 0]
    assert np.abs(scan.distance - expected).max() < 1e-5
    assert np.abs(scan.position[:, 0] - (35.0 - 25.0 * time)).max() < 1e-5
    assert np.abs(scan.radial_velocity - direction @ [-25.0, 6.0, 0.0]).max() < 1e-5
    assert np.array_equal(scan.time, time.astype(np.float32))


def test_every_shot_of_a_scan_is_what_the_scene_at_its_time_shows(tmp_path: Path) -> None:
    world = traffic(tmp_path)
    ego, caster = world.actor("ego").trajectory, RollingCaster(world.at(1.0), 0.1)
    generator = rng()
    number, moved = 3000, 0
    for time in (0.0, 0.0137, 0.0611, 0.1):
        state = world.at(1.0 + time)
        origin = ego.pose(1.0 + time).apply([2.5, 0.0, 1.0])
        azimuth, elevation = generator.uniform(-0.9, 0.9, number), generator.uniform(-0.15, 0.1, number)
        direction = np.stack(
            [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)], axis=-1
        )
        truth = state.cast(origin, direction, 100.0)
        got = caster.cast(np.tile(origin, (number, 1)), direction, np.full(number, time), 100.0, from_sensor=True)
        again = caster.cast(np.tile(origin, (number, 1)), direction, np.full(number, time), 100.0, from_sensor=False)
        assert np.array_equal(got.ray, again.ray) and np.array_equal(got.distance, again.distance)
        # a ray that meets an edge may fall to either side of it in float32: at most 3 of 3000
        both, a, b = np.intersect1d(truth.ray, got.ray, return_indices=True)
        same = truth.part[a] == got.part[b]
        assert len(both) > 2500 and abs(truth.num_hits - got.num_hits) <= 3 and (~same).sum() <= 3
        a, b = a[same], b[same]
        moved += int((world.parts.actor[truth.part[a]] >= 0).sum())
        # the ball is tessellated: a ray near an edge between facets may take the neighbour, so quantiles and not the
        # largest
        for name, tolerance in (("distance", 1e-5), ("normal", 1e-5), ("velocity", 1e-4)):
            error = np.abs(getattr(truth, name)[a] - getattr(got, name)[b])
            assert np.quantile(error, 0.995) < tolerance, name
    assert moved > 1000


def traffic(folder: Path) -> World:
    """Return a road with a crossing, turning car, a ball and an ego car that brakes into a bend."""
    times = np.linspace(0.0, 3.0, 7)
    ego = moving("waypoints", times=tuple(times), positions=[(14.0 * t - 2.0 * t * t, 0.8 * t * t, 0.0) for t in times])
    turning = moving(
        "constant_twist", position=(20.0, 6.0, 0.0), velocity=(3.0, -5.0, 0.0), yaw_deg=40.0, angular_velocity_z=0.8
    )
    crossing = moving("constant_twist", position=(35.0, -12.0, 1.0), velocity=(0.0, 15.0, 0.0))
    actors = [
        Thing("ego", box((4.5, 1.8, 1.4), (0.0, 0.0, 0.75)), "Car", trajectory=ego),
        Thing("turning", box((4.0, 2.0, 1.6), (0.5, 0.0, 0.8)), "Car", trajectory=turning),
        Thing("crossing", ball(1.5, subdivisions=3), "Other", trajectory=crossing),
    ]
    static = [Thing("ground", plane(300.0, 300.0), "Roads"), Thing("wall", box((1.0, 80.0, 6.0), (60, 0, 3)), "Wall")]
    return load_scene(write_scene(folder, static, actors, ego="ego"))


def test_a_carried_lidar_follows_the_ego_car_and_its_scan_deskews(tmp_path: Path) -> None:
    world = traffic(tmp_path)
    trajectory, mount = world.actor("ego").trajectory, Pose.from_euler([2.5, 0.3, 1.0], yaw=0.2)
    pose, twist = trajectory.pose(1.0), trajectory.twist(1.0)
    sensor = pose.compose(mount)
    own = Twist(twist.velocity_at(sensor.position - pose.position), twist.angular)
    raw = Lidar(SPINNING).observe(world.at(1.0), Mount(sensor, own), rng())
    flat = Lidar(SPINNING.with_(deskew=True)).observe(world.at(1.0), Mount(sensor, own), rng())
    wall = raw.instance == 2
    assert np.array_equal(raw.distance, flat.distance) and wall.sum() > 200
    for row in np.flatnonzero(wall)[::40]:
        then = trajectory.pose(1.0 + float(raw.time[row])).compose(mount)
        there = then.apply(raw.position[row])
        # float32 positions of 60 m (4e-6), and the carried pose: below 1e-6 m and 1e-6 rad * 60 m
        assert abs(there[0] - 59.5) < 1e-4
        assert np.abs(sensor.apply(flat.position[row]) - there).max() < 1e-4
        assert np.abs(then.rotate(raw.normal[row]) - [-1.0, 0.0, 0.0]).max() < 1e-5
        assert np.abs(sensor.rotate(flat.normal[row]) - [-1.0, 0.0, 0.0]).max() < 1e-5
    skew = np.abs(sensor.apply(raw.position[wall])[:, 0] - 59.5).max()
    assert skew > 0.3  # the ego car drives 1 m in a turn of the lidar, half of it before the wall is seen
    # with the velocity at the timestamp alone what is left is the acceleration: 4 m/s2 * (0.1 s)^2 / 2 = 2 cm, and half
    # as much again for the turn it causes at 60 m
    later = deskew(raw, own)
    assert np.abs(later.position[wall] - flat.position[wall]).max() < 0.2 * skew
    with pytest.raises(ParameterRangeError, match="de-skewed"):
        deskew(flat, own)


@pytest.mark.parametrize("mount", [(2.6, 0.3, 1.0), (0.0, 0.0, 1.6), (0.5, 1.1, 0.9)])
def test_a_lidar_on_a_car_sees_the_car_as_if_no_ray_were_ruled_out(tmp_path: Path, mount: tuple) -> None:
    world = traffic(tmp_path)
    trajectory = world.actor("ego").trajectory
    pose, twist = trajectory.pose(1.0), trajectory.twist(1.0)
    sensor = pose.compose(Pose(mount))
    own = Twist(twist.velocity_at(sensor.position - pose.position), twist.angular)
    scan = Lidar(SPINNING.with_(scan=SPINNING.scan.with_(elevation_deg=(-70.0, -40.0, -20.0, 0.0)))).observe(
        world.at(1.0), Mount(sensor, own), rng()
    )
    motion = sensor_motion(world.at(1.0), sensor, own, float(shot_times(scan.spec).max()))
    origins, directions = shot_rays(motion, shot_directions(scan.spec), shot_times(scan.spec))
    everything = RollingCaster(world.at(1.0), float(shot_times(scan.spec).max()))
    hits = everything.cast(origins, directions, shot_times(scan.spec), 200.0, from_sensor=True)
    assert np.array_equal(hits.ray, scan.shot) and np.array_equal(hits.distance.astype(np.float32), scan.distance)
    assert (scan.instance == world.actor("ego").instance).sum() > 50


def test_radial_velocity_of_a_rolling_wheel(tmp_path: Path) -> None:
    speed, radius = 20.0, 0.35
    wheel = trimesh.creation.cylinder(radius=radius, height=0.25, sections=64)
    wheel.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [1, 0, 0]))
    wheel.apply_translation([1.4, 0.8, radius])
    motion = moving("constant_twist", position=(8.0, 0.0, 0.0), velocity=(speed, 0.0, 0.0))
    joint = {"kind": "wheel", "shapes": ["shape-wheel"], "center": [1.4, 0.8, radius], "radius": radius}
    car = Thing("wheel", wheel, "Car", trajectory=motion, joints=[joint])
    world = load_scene(write_scene(tmp_path, [Thing("ground", plane(100.0, 100.0))], [car]))
    # from the side, so that the spin shows; at rest
    pose = Pose.from_euler([11.0, 6.0, 0.5], yaw=-np.pi / 2)
    fine = dict(azimuth_fov_deg=(-14.0, 14.0), elevation_fov_deg=(-6.0, 4.0), num_azimuth=141, num_elevation=41)
    for spec in (LidarSpec(**fine), LidarSpec(**fine, scan_time=0.1)):
        scan = Lidar(spec).observe(world.at(0.1), pose, rng())
        on = scan.instance == 2
        assert on.sum() > 30
        time, point = 0.1 + scan.time[on].astype(np.float64), pose.apply(scan.position[on])
        centre = np.stack([9.4 + speed * time, np.full(on.sum(), 0.8), np.full(on.sum(), radius)], axis=-1)
        velocity = [speed, 0.0, 0.0] + np.cross([0.0, speed / radius, 0.0], point - centre)
        expected = np.einsum("ij,ij->i", velocity, pose.rotate(shot_directions(spec)[scan.shot[on]]))
        assert np.ptp(expected) > 1.0
        # positions in float32 (1e-6 m) times 57 rad/s, and 2e-4 m/s of the velocity between the knots; the contract is
        # 1e-3
        assert np.abs(scan.radial_velocity[on] - expected).max() < 1e-3


def test_radial_velocity_of_a_turning_car_during_the_scan(tmp_path: Path) -> None:
    world = traffic(tmp_path)
    scan = Lidar(RASTER).observe(world.at(0.5), Pose([0.0, -3.0, 1.0]), rng())
    turning = world.actor("turning")
    on = scan.instance == turning.instance
    assert on.sum() > 50
    for row in np.flatnonzero(on)[::10]:
        time, point = 0.5 + float(scan.time[row]), scan.position[row].astype(np.float64) + [0.0, -3.0, 1.0]
        pose, twist = turning.trajectory.pose(time), turning.trajectory.twist(time)
        expected = twist.velocity_at(point - pose.position) @ shot_directions(RASTER)[scan.shot[row]]
        assert abs(scan.radial_velocity[row] - expected) < 1e-4  # the contract is 1e-3 m/s


def test_a_lidar_beside_the_road_is_not_carried_by_a_car_at_rest(tmp_path: Path) -> None:
    times = (0.0, 1.0, 2.0, 3.0)
    waits = moving(
        "waypoints", times=times, positions=[(0, 0, 0), (0, 0, 0), (2.0, 0, 0), (12.0, 0, 0)], yaw_deg=(0, 0, 0, 0)
    )
    ego = Thing("ego", box((4.5, 1.8, 1.4), (0.0, 0.0, 0.75)), "Car", trajectory=waits)
    world = load_scene(write_scene(tmp_path, [Thing("wall", box((1, 80, 6), (40, 0, 3)), "Wall")], [ego], ego="ego"))
    state = world.at(2.0)
    own = state.actor_twist("ego")
    on_board = sensor_motion(state, Pose([4.5, 0.0, 1.0]), own, 0.1)
    beside = sensor_motion(state, Pose([4.5, 20.0, 1.0]), own, 0.1)
    assert np.allclose(beside.position[-1], [4.5 + 0.1 * own.linear[0], 20.0, 1.0], atol=1e-12)
    expected = world.at(2.1).actor_pose("ego").position[0] + 2.5
    assert (
        np.isclose(on_board.position[-1, 0], expected, atol=1e-9)
        and on_board.position[-1, 0] > beside.position[-1, 0] + 0.01
    )


def test_past_the_end_of_a_trajectory_the_motion_goes_on(tmp_path: Path) -> None:
    world = traffic(tmp_path)
    scan = Lidar(RASTER).observe(world.at(3.0), Pose([0.0, -3.0, 1.0]), rng())  # the ego's way ends at 3 s
    assert scan.num_points > 1000
