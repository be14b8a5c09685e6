"""The Gymnasium environment: its own checker, the way that an action drives, and refused input."""

from __future__ import annotations

import math
import warnings

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.fusion.rig import SensorMount
from tests.scenes import Thing, box, plane, write_scene

pytest.importorskip("gymnasium")
from gymnasium.utils.env_checker import check_env

from scarl_sionna.loop.gymnasium_env import DrivingEnv, DrivingSettings, EgoState

MOUNT = ss.Pose([2.1, 0.0, 0.8])
RADAR = SensorMount(
    "radar",
    "radar",
    ss.RadarSpec().with_(num_chirps=16, num_samples=64),
    MOUNT,
    ss.RadarSettings.of("raycast", num_rays=20_000),
)
CAMERA = SensorMount(
    "camera", "camera", ss.CameraSpec(width=32, height=24, samples_per_pixel=1, images=("rgb",)), MOUNT
)


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> ss.World:
    way = {"kind": "constant_twist", "position": [0, 0, 0], "velocity": [5, 0, 0]}
    road = Thing("road", plane(400, 400), "Roads", is_object=False)
    ego = Thing("ego", box((4, 2, 1.5), (0, 0, 0.95)), "Car", "steel", way)
    house = Thing("house", box((4, 20, 8), (40, 0, 4)), "Building")
    return ss.load_scene(write_scene(tmp_path_factory.mktemp("env"), [road, house], [ego], ego="ego"))


def test_gymnasiums_own_checker_finds_nothing(world: ss.World) -> None:
    settings = ss.SessionSettings(rates={"camera": 10.0})
    env = DrivingEnv(world, ss.Rig("light", (RADAR, CAMERA)), settings, driving=DrivingSettings(num_steps=3))
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)
        warnings.filterwarnings("ignore", category=ss.ScarlWarning)
        warnings.filterwarnings("ignore", message=".*spec.*")  # it is not registered under a name
        check_env(env, skip_render_check=True)


def test_an_episode_drives_and_ends(world: ss.World) -> None:
    env = DrivingEnv(world, ss.Rig("light", (RADAR,)), driving=DrivingSettings(num_steps=2))
    first, _ = env.reset(seed=1)
    assert env.ego.speed == 5.0 and first["ego"].tolist() == [5.0, 0.0]
    assert env.frame.world_from_vehicle.position.tolist() == [0.0, 0.0, 0.0]
    seen, reward, ended, cut, _ = env.step(np.array([1.0, 0.0]))
    # 5 m/s and 4 m/s^2 for 0.05 s: 0.25 + 0.005 m
    assert reward == pytest.approx(0.255) and env.frame.world_from_vehicle.position[0] == pytest.approx(0.255)
    assert env.frame.vehicle_twist.linear[0] == pytest.approx(5.2)
    assert not ended and not cut and env.step(np.array([0.0, 0.0]))[3]
    assert first["radar"].tobytes() == env.reset(seed=1)[0]["radar"].tobytes() != seen["radar"].tobytes()
    with pytest.raises(ParameterRangeError, match="action"):
        env.step(np.array([2.0, 0.0]))
    env.close()


def test_a_bend_is_a_circle_and_braking_ends_at_rest() -> None:
    state, wheelbase, steering = EgoState((0.0, 0.0, 0.0), 0.0, 6.0), 2.7, 0.3
    slip = math.atan(0.5 * math.tan(steering))
    radius = wheelbase / (math.cos(slip) * math.tan(steering))  # of the middle between the axles
    steps = 40
    for _ in range(steps):
        state = state.driven(0.0, steering, wheelbase, 2.0 * np.pi * radius / 6.0 / steps)
    np.testing.assert_allclose(state.position, 0.0, atol=1e-12)  # once round
    assert state.heading == pytest.approx(2.0 * np.pi) and state.rate == pytest.approx(6.0 / radius)
    course = state.actor_pose.twist.linear
    assert math.atan2(course[1], course[0]) == pytest.approx(slip) and np.linalg.norm(course) == pytest.approx(6.0)
    stopped = EgoState((0.0, 0.0, 0.0), 0.0, 2.0).driven(-4.0, 0.0, wheelbase, 1.0)
    assert stopped.speed == 0.0 and stopped.way == pytest.approx(2.0**2 / (2.0 * 4.0))


def test_other_sensors_are_refused(world: ss.World) -> None:
    lidar = SensorMount("lidar", "lidar", ss.LidarSpec(scan=ss.RasterScan(num_azimuth=9, num_elevation=4)), MOUNT)
    with pytest.raises(ParameterRangeError, match="'lidar', a lidar"):
        DrivingEnv(world, ss.Rig("other", (lidar,)))
