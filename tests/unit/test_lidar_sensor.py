"""The lidar as a sensor: contracts, errors, repeatability."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from camera_lidar import Lidar
from camera_lidar.lidar import shot_directions
from scarl_sionna.core.errors import PlacementError
from scarl_sionna.core.mount import Mount
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.results import LidarScan
from scarl_sionna.core.specs.lidar.spec import LidarSpec
from scarl_sionna.engine.load import load_scene
from scarl_sionna.engine.world import WorldState
from tests.scenes import Thing, box, plane, write_scene

NOISY = LidarSpec(
    num_azimuth=61,
    num_elevation=31,
    drop_out_intensity=2e-3,
    range_noise_variance_per_metre=1e-5,
    velocity_noise_std=0.1,
)
CLEAN = NOISY.with_(drop_out_intensity=0.0, range_noise_variance_per_metre=0.0, velocity_noise_std=0.0)
POSE = Pose.from_euler([0.0, 0.0, 1.5], yaw=0.3, pitch=-0.1, roll=0.2)


@pytest.fixture(scope="module")
def state(tmp_path_factory: pytest.TempPathFactory) -> WorldState:
    folder: Path = tmp_path_factory.mktemp("scene")
    ground = Thing("ground", plane(100.0, 100.0), "Roads", is_object=False)
    wall = Thing("wall", box((1.0, 40.0, 3.0), (15.5, 0.0, 1.5)), "Wall", "white")
    return load_scene(write_scene(folder, [ground, wall])).at(0.0)


def observe(state: WorldState, spec: LidarSpec, seed: int = 0) -> LidarScan:
    return Lidar(spec).observe(state, Mount(POSE, Twist([2.0, 0.0, 0.0])), np.random.default_rng(seed))


def arrays(scan: LidarScan) -> dict[str, np.ndarray]:
    return {f.name: getattr(scan, f.name) for f in fields(scan) if isinstance(getattr(scan, f.name), np.ndarray)}


def test_shapes_and_types(state: WorldState) -> None:
    scan = observe(state, CLEAN)
    expected = {
        "shot": np.int32,
        "position": np.float32,
        "distance": np.float32,
        "radial_velocity": np.float32,
        "intensity": np.float32,
        "cos_incidence": np.float32,
        "normal": np.float32,
        "semantic": np.uint8,
        "instance": np.uint16,
        "time": np.float32,
        "return_index": np.uint8,
        "reflectance": np.float32,
        "cnr": np.float32,
    }
    assert {name: array.dtype.type for name, array in arrays(scan).items()} == expected
    assert all(len(array) == scan.num_points for array in arrays(scan).values())
    assert 0 < scan.num_points < 61 * 31  # some shots go to the sky
    assert (np.diff(scan.shot) > 0).all()  # firing order
    assert (scan.distance <= CLEAN.max_distance).all()


def test_fields_agree_with_each_other_also_under_noise(state: WorldState) -> None:
    scan = observe(state, NOISY)
    along = shot_directions(NOISY)[scan.shot]
    # the position lies on its ray at the measured distance; float32: 40 m * 6e-8 * 2
    assert np.abs(scan.position - along * scan.distance[:, None]).max() < 5e-6
    # the normal points to the sensor, and its cosine is the one stored; float32
    assert np.abs(scan.cos_incidence + np.einsum("ij,ij->i", scan.normal, along)).max() < 1e-6
    assert np.abs(np.linalg.norm(scan.normal, axis=-1) - 1.0).max() < 1e-6
    assert (scan.cos_incidence > 0).all()


def test_same_seed_gives_the_same_bytes_and_another_seed_other_ones(state: WorldState) -> None:
    first, same, other = (observe(state, NOISY, seed) for seed in (1, 1, 2))
    assert all(array.tobytes() == arrays(same)[name].tobytes() for name, array in arrays(first).items())
    assert not np.array_equal(first.shot, other.shot)


def test_switching_one_effect_leaves_the_noise_of_the_others(state: WorldState) -> None:
    noisy = observe(state, NOISY)
    no_drop_out = observe(state, NOISY.with_(drop_out_intensity=0.0))
    rows = np.searchsorted(no_drop_out.shot, noisy.shot)
    assert noisy.num_points < no_drop_out.num_points
    assert np.array_equal(no_drop_out.distance[rows], noisy.distance)
    assert np.array_equal(no_drop_out.radial_velocity[rows], noisy.radial_velocity)


def test_nothing_beyond_the_maximum_distance(state: WorldState) -> None:
    near = observe(state, CLEAN.with_(max_distance=10.0))
    everything = observe(state, CLEAN)
    assert near.num_points == np.count_nonzero(everything.distance <= 10.0) < everything.num_points


def test_a_scan_that_hits_nothing_is_empty(state: WorldState) -> None:
    scan = observe(state, CLEAN.with_(max_distance=0.5))
    assert scan.num_points == 0 and scan.position.shape == (0, 3)


def test_lidar_inside_a_mesh_is_refused(state: WorldState) -> None:
    with pytest.raises(PlacementError, match=r"lidar at \(15\.500, 0\.000, 1\.500\) m .*'wall'"):
        Lidar(CLEAN).observe(state, Pose([15.5, 0.0, 1.5]), np.random.default_rng(0))
