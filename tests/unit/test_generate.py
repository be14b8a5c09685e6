"""observe, simulate and run on small scenes: time, motion, seeds, order, and what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from scarl_sionna.app.demo import run
from scarl_sionna.core.errors import OutputError, PlacementError, TimeRangeError, UnknownNameError
from scarl_sionna.core.mount import Mount
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.settings.radar import RadarSettings
from scarl_sionna.core.specs.camera import CameraSpec
from scarl_sionna.core.specs.lidar.spec import LidarSpec
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.dataset import open_dataset
from scarl_sionna.engine.load import load_scene
from scarl_sionna.fusion import Rig, SensorMount
from scarl_sionna.scenario.spec.scenario import ScenarioSpec
from scarl_sionna.simulation import observe, simulate
from tests.frames import assert_same
from tests.scenes import Thing, box, plane, write_scene

CAMERA = CameraSpec(width=32, height=18, samples_per_pixel=4)
LIDAR = LidarSpec(num_azimuth=31, num_elevation=9, range_noise_variance_per_metre=1e-4)
RADAR = RadarSpec().with_(num_chirps=8, num_samples=64)
SETTINGS = RadarSettings(raycast={"num_rays": 500}, accuracy={"tube_budget": 50})
TURN = (np.cos(np.pi / 4), 0.0, 0.0, np.sin(np.pi / 4))  # +90 deg about z

RIG = Rig(
    "test",
    (
        SensorMount("front/camera", "camera", CAMERA, Pose([2.0, 0.0, 1.0])),
        SensorMount("front/lidar", "lidar", LIDAR, Pose([2.0, 0.0, 1.0])),
        SensorMount("front/radar", "radar", RADAR, Pose([2.0, 0.0, 1.0]), SETTINGS),
        SensorMount(
            "left/lidar", "lidar", LIDAR.with_(range_noise_variance_per_metre=0.0), Pose([1.0, 0.8, 1.0], TURN)
        ),
    ),
)


@pytest.fixture(scope="module")
def scene_path(tmp_path_factory) -> Path:
    """Return a scene: a turning ego, a car that drives away, a wall ahead and a road; known from 0 to 2 s."""
    times = [0.0, 1.0, 2.0]
    return write_scene(
        tmp_path_factory.mktemp("scene"),
        instances=[
            Thing("road", plane(400.0, 100.0), "Roads", is_object=False),
            Thing("wall", plane(40.0, 10.0, (60.0, 0.0, 5.0), (-1, 0, 0)), "Wall"),
            Thing("side", plane(200.0, 10.0, (0.0, 30.0, 5.0), (0, -1, 0)), "Wall"),
        ],
        actors=[
            Thing(
                "ego",
                box([4.0, 1.6, 0.6], [0, 0, 0.4]),
                "Car",
                trajectory={
                    "kind": "constant_twist",
                    "position": [0.0, 0.0, 0.0],
                    "velocity": [10.0, 0.0, 0.0],
                    "angular_velocity_z": 0.2,
                },
            ),
            Thing(
                "car",
                box([4.0, 1.6, 1.4], [0, 0, 0.7]),
                "Car",
                "steel",
                trajectory={
                    "kind": "waypoints",
                    "times": times,
                    "positions": [[20.0 + 15.0 * t, 0.0, 0.0] for t in times],
                },
            ),
        ],
        ego="ego",
    )


@pytest.fixture(scope="module")
def world(scene_path):
    return load_scene(scene_path)


@pytest.fixture(scope="module")
def frame(world):
    return observe(world, RIG, 0.1, seed=3)


def test_every_sensor_stands_at_its_mount_on_the_ego(world, frame) -> None:
    ego = world.at(0.1).actor_pose("ego")
    assert list(frame.results) == list(RIG.names)
    for mount in RIG.sensors:
        expected = ego.matrix @ mount.vehicle_from_sensor.matrix
        # two products of matrices of order 1 in float64, entries up to 3 m
        np.testing.assert_allclose(frame.results[mount.name].world_from_sensor.matrix, expected, atol=1e-14)


def test_one_timestamp_in_whole_nanoseconds(frame) -> None:
    assert frame.timestamp_ns == 100_000_000
    assert isinstance(frame.timestamp_ns, int)


def test_a_sensor_off_the_vehicles_origin_moves_with_the_turning_vehicle(world, frame) -> None:
    # the lidar on the left looks at a wall that stands still: its radial velocity is minus its own velocity along the
    # ray
    scan = frame.lidars["left/lidar"]
    pose, twist = world.at(0.1).actor_pose("ego"), world.at(0.1).actor_twist("ego")
    lever = pose.rotate([1.0, 0.8, 1.0])
    own = twist.linear + np.cross(twist.angular, lever)
    assert np.linalg.norm(own - twist.linear) > 0.2  # 0.2 rad/s at 1.28 m: leaving it out would be seen
    rays = scan.world_from_sensor.rotate(scan.position / scan.distance[:, None])
    assert scan.num_points > 50
    # float32: 10 m/s * 2^-24 from the velocity, and as much from each of three components of the direction
    np.testing.assert_allclose(scan.radial_velocity, -rays @ own, atol=10.0 * 4 * 2**-24)


def test_objects_carry_what_the_sensors_see_of_them(world, frame) -> None:
    by_name = {item.name: item for item in frame.objects}
    assert set(by_name) == {"wall", "side", "ego", "car"}
    car = by_name["car"]
    assert car.num_pixels == int((frame.images["front/camera"].instance == car.instance).sum()) > 0
    assert car.num_lidar_points == sum(int((s.instance == car.instance).sum()) for s in frame.lidars.values()) > 0
    np.testing.assert_allclose(car.world_from_box.position, [21.5, 0.0, 0.7], atol=1e-6)  # meshes are float32
    np.testing.assert_allclose(car.twist.linear, [15.0, 0.0, 0.0], atol=1e-9)


def test_the_same_seed_gives_the_same_bytes(world, frame) -> None:
    again = observe(world, RIG, 0.1, seed=3)
    for name, result in frame.results.items():
        if name != "front/radar":
            assert_same(result, again.results[name], name)
    assert frame.radars["front/radar"].adc_int.tobytes() == again.radars["front/radar"].adc_int.tobytes()
    assert_same(frame.objects, again.objects)


def test_another_seed_time_or_name_gives_other_noise(world, frame) -> None:
    noisy = frame.radars["front/radar"].adc_int
    assert (observe(world, RIG, 0.1, seed=4).radars["front/radar"].adc_int != noisy).mean() > 0.5
    lidar = Rig("two", tuple(SensorMount(n, "lidar", LIDAR, Pose([2.0, 0.0, 1.0])) for n in ("a", "b")))
    scans = observe(world, lidar, 0.1, seed=3).lidars
    assert not np.array_equal(scans["a"].distance, scans["b"].distance)


def test_a_sensor_does_not_depend_on_the_others_or_on_their_order(world, frame) -> None:
    turned = observe(world, Rig("turned", tuple(reversed(RIG.sensors))), 0.1, seed=3)
    alone = observe(world, RIG.subset("front/camera"), 0.1, seed=3)
    for name in ("front/camera", "front/lidar", "left/lidar"):
        assert_same(turned.results[name], frame.results[name], name)
    assert turned.radars["front/radar"].adc_int.tobytes() == frame.radars["front/radar"].adc_int.tobytes()
    assert_same(alone.results["front/camera"], frame.results["front/camera"])


def test_a_frame_does_not_depend_on_the_frames_before(world, frame) -> None:
    rig = RIG.subset("*/lidar")
    frames = list(simulate(world, rig, (0.0, 0.05, 0.1), seed=3, skip={1}))
    assert [f.index for f in frames] == [0, 2]
    for name in rig.names:
        assert_same(frames[-1].results[name], frame.results[name], name)


def test_stages_are_reported_and_timed(world) -> None:
    seen: list[tuple[str, float]] = []
    result = observe(world, RIG, 0.1, on_stage=lambda stage, part: seen.append((stage, part)))
    assert seen == [(name, i / 4) for i, name in enumerate(RIG.names)]
    assert set(result.timings) == {"world", "camera", "lidar", "radar", "labels"}


def test_a_world_without_ego_needs_a_pose(tmp_path) -> None:
    world = load_scene(write_scene(tmp_path, instances=[Thing("wall", plane(9, 9, (20, 0, 0), (-1, 0, 0)), "Wall")]))
    rig = RIG.subset("front/lidar")
    with pytest.raises(PlacementError, match="vehicle=Pose"):
        observe(world, rig)
    pose, twist = Pose([1.0, 0.0, -1.0]), Twist([4.0, 0.0, 0.0])
    standing = observe(world, rig, vehicle=pose).lidars["front/lidar"]
    driving = observe(world, rig, vehicle=Mount(pose, twist)).lidars["front/lidar"]
    middle = np.argmin(np.abs(standing.position[:, 1:]).sum(axis=1))
    # the middle ray is within 4 deg / 1.9 deg of the axis (raster of 31 x 9): cosine > 0.997
    assert standing.radial_velocity[middle] == 0.0
    assert -4.0 <= driving.radial_velocity[middle] <= -4.0 * 0.997
    # the wall is 20 - (1 + 2) m away along x; six sigma of the noise, variance 1e-4 * 17 m2
    assert abs(standing.position[middle, 0] - 17.0) < 6 * np.sqrt(1e-4 * 17.1)


def test_a_time_outside_the_motion_is_refused(world) -> None:
    with pytest.raises(TimeRangeError, match="outside the motion"):
        observe(world, RIG, 2.5)


def tiny_scenario(scene_path: Path, folder: Path, **changes) -> ScenarioSpec:
    """Return a scenario with a rig file of two small sensors."""
    rig = folder / "rig.yaml"
    RIG.subset("front/lidar", "front/radar").save(rig)
    return ScenarioSpec(**{"scene": str(scene_path), "rig": str(rig), "num_frames": 2, **changes})


def test_run_writes_frames_that_are_what_observe_gives(world, scene_path, tmp_path) -> None:
    scenario = tiny_scenario(scene_path, tmp_path, seed=3)
    summary = run(scenario, tmp_path / "out")
    assert (summary.num_written, summary.num_kept) == (2, 0)
    assert summary.contact_sheet.stat().st_size > 10_000
    stored = open_dataset(tmp_path / "out")[1].to_frame()
    direct = observe(world.with_noise_of(scenario.noise_name), RIG, 0.1, seed=3)
    assert_same(stored.results["front/lidar"], direct.results["front/lidar"])
    assert stored.radars["front/radar"].adc.tobytes() == direct.radars["front/radar"].adc.tobytes()


def test_run_goes_on_where_it_was_and_may_ask_for_more_frames(scene_path, tmp_path) -> None:
    run(tiny_scenario(scene_path, tmp_path, num_frames=1), tmp_path / "out")
    before = [frame.to_frame() for frame in open_dataset(tmp_path / "out")]
    with pytest.raises(OutputError, match="seed: 0 there, 1 asked for"):
        run(tiny_scenario(scene_path, tmp_path, num_frames=1, seed=1), tmp_path / "out")
    summary = run(tiny_scenario(scene_path, tmp_path, num_frames=2), tmp_path / "out")
    assert (summary.num_written, summary.num_kept) == (1, 1)
    for frame, again in zip(before, open_dataset(tmp_path / "out"), strict=False):
        assert_same(again.to_frame(), frame)


def test_run_refuses_before_it_works(scene_path, tmp_path) -> None:
    with pytest.raises(TimeRangeError):  # 2 s are known, the last frame is at 2.9 s
        run(tiny_scenario(scene_path, tmp_path, num_frames=30), tmp_path / "long")
    assert not (tmp_path / "long").exists()
    with pytest.raises(UnknownNameError, match="rig 'sideways'"):
        run(tiny_scenario(scene_path, tmp_path, rig="sideways"), tmp_path / "rig")
    with pytest.raises(UnknownNameError, match="scene 'highway_guardrial'.*did you mean 'highway_guardrail'"):
        run(tiny_scenario(scene_path, tmp_path, scene="highway_guardrial"), tmp_path / "scene")
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="choose a folder"):
        run(tiny_scenario(scene_path, tmp_path), tmp_path / "file" / "out")
