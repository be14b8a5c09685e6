"""Bodies that bend, in a world: places, boxes and velocities for rays, lidar and radar against closed forms."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import scarl_sionna as ss
from camera_lidar import Lidar
from camera_lidar.camera.labels import cast_pixels, render_labels
from camera_lidar.camera.projection import camera_optical_from_world, pixel_centres
from camera_lidar.lidar import shot_directions, shot_times
from examples.breathing_person import BREATH, BREATHS, Gltf, breathing, capsule, write_person
from scarl_sionna.core.errors import MeshError, ParameterRangeError, ScenarioError
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.specs.camera import CameraSpec
from scarl_sionna.core.specs.lidar.spec import LidarSpec
from scarl_sionna.core.specs.radar.pattern import IsotropicPattern
from scarl_sionna.engine.load import load_scene, stage
from scarl_sionna.engine.world import World
from scarl_sionna.radar.micro_doppler import spectrograms, surface_motion
from scarl_sionna.scene.motion.trajectory import ConstantTwistTrajectory, StaticTrajectory
from scarl_sionna.simulation import load_world
from tests.scenes import Thing, plane, write_scene

LENGTH = 0.6
PIVOT = np.array([0.0, 1.2, 0.0])
SWING, FREQUENCY = 0.6, 0.8
RATE = 1.5


@pytest.fixture(scope="module", autouse=True)
def cache(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SCARL_CACHE_DIR", str(tmp_path_factory.mktemp("cache")))
        yield


def limb(folder: Path, angle: Callable[[np.ndarray], np.ndarray], times: np.ndarray) -> Path:
    """A bar that hangs from a pivot and turns about the axis to its left: y up, z forward."""
    file = Gltf()
    vertices, faces = capsule(PIVOT, PIVOT - [0.0, LENGTH, 0.0], 0.03)
    attributes = {
        "POSITION": file.add(vertices, "VEC3"),
        "JOINTS_0": file.add(np.zeros((len(vertices), 4)), "VEC4", "<u2"),
        "WEIGHTS_0": file.add(np.tile([1.0, 0.0, 0.0, 0.0], (len(vertices), 1)), "VEC4"),
    }
    bind = np.eye(4)
    bind[:3, 3] = -PIVOT
    file.tables |= {
        "meshes": [{"primitives": [{"attributes": attributes, "indices": file.add(faces, "SCALAR", "<u4")}]}],
        "skins": [{"joints": [1], "inverseBindMatrices": file.add(bind.T, "MAT4")}],
        "nodes": [{"name": "limb", "mesh": 0, "skin": 0}, {"name": "pivot", "translation": PIVOT.tolist()}],
    }
    turned = -angle(times) / 2.0  # about x of the file, so that a positive angle brings the end forward
    none = np.zeros_like(turned)
    file.channel(1, "rotation", times, np.stack([np.sin(turned), none, none, np.cos(turned)], axis=1))
    return file.write(folder / "limb.glb")


def swinging(folder: Path) -> World:
    """A limb at 6 m that swings towards the origin, its pivot 0.6 m above the ground on which its end is at rest."""
    times = np.linspace(0.0, 1.0 / FREQUENCY, 101)
    file = limb(folder, lambda t: SWING * np.sin(2.0 * np.pi * FREQUENCY * t), times)
    return world_of(folder, file, StaticTrajectory(Pose.from_euler([6.0, 0.0, 0.0], yaw=np.pi)), smooth=True)


def world_of(folder: Path, file: Path, trajectory, **options) -> World:
    model = ss.actor_from_body(file, materials="metal", motion="stand", **options)
    world = load_scene(write_scene(folder, [Thing("far", plane(1.0, 1.0, (0, 0, -500.0)))]))
    return stage(world, [ss.StagedActor("limb", model, trajectory)])


def turning(folder: Path, trajectory=None, **options) -> World:
    """The limb turns by 1.5 rad/s from straight down."""
    file = limb(folder, lambda t: RATE * t, np.linspace(0.0, 2.0, 9))
    return world_of(folder, file, trajectory or StaticTrajectory(Pose([3.0, 0.0, 0.0])), **options)


def at_limb(origin: np.ndarray, middle: np.ndarray, number: int = 4000) -> np.ndarray:
    target = middle + np.random.default_rng(0).uniform(-0.7, 0.7, (number, 3))
    return (target - origin) / np.linalg.norm(target - origin, axis=1)[:, None]


@pytest.mark.parametrize("twin", ["optical", "radio"])
def test_rays_meet_the_body_where_it_is_with_its_velocity(tmp_path, twin):
    """Beside a moving and turning actor: v = v0 + w0 x r + w x (p - pivot). Keys of 0.25 s in float32: 3e-7 rad/s."""
    moving = ConstantTwistTrajectory(Pose([3.0, 0.5, 0.0]), Twist([1.0, -2.0, 0.0], [0.0, 0.0, 0.7]))
    world = turning(tmp_path, moving)
    for time in (0.6, 0.1, 0.6):  # there and back: trees are rebuilt
        state = world.at(time)
        pose, twist = state.actor_pose("limb"), state.actor_twist("limb")
        pivot = pose.apply([0.0, 0.0, LENGTH + 0.03])
        axis = pose.rotate([0.0, -1.0, 0.0])
        hits = state.cast(np.zeros(3), at_limb(np.zeros(3), pose.apply([0.0, 0.0, 0.4])), twin=twin)
        assert hits.num_hits > 50
        exact = twist.velocity_at(hits.point - pose.position) + np.cross(RATE * axis, hits.point - pivot)
        np.testing.assert_allclose(hits.velocity, exact, atol=1e-6)
        along = pose.rotate([np.sin(RATE * time), 0.0, -np.cos(RATE * time)])
        way = (hits.point - pivot) @ along
        away = np.linalg.norm(hits.point - pivot - np.clip(way, 0.0, LENGTH)[:, None] * along, axis=1)
        assert away.min() > 0.0285 and away.max() < 0.03001  # 16 sides: cos(pi / 16) = 0.981
        np.testing.assert_allclose(
            state.point_velocity(hits.part, hits.point), exact, atol=1e-5
        )  # grazing: not on a face


def test_boxes_follow_the_posture(tmp_path):
    world = turning(tmp_path)
    for time in (0.0, 0.5, 1.0):
        box = world.at(time).boxes()[-1]
        angle = RATE * time
        size = [abs(np.sin(angle)) * LENGTH + 0.06, 0.06, abs(np.cos(angle)) * LENGTH + 0.06]
        np.testing.assert_allclose(box.tight_size, size, atol=3e-3)  # facets
        middle = [3.0 + 0.5 * LENGTH * np.sin(angle), 0.0, LENGTH + 0.03 - 0.5 * LENGTH * np.cos(angle)]
        np.testing.assert_allclose(box.world_from_box.apply(box.tight_center), middle, atol=2e-3)
    np.testing.assert_allclose(box.size[0], 0.6 + 0.03 + 0.06, atol=0.1)  # of the track: all postures of 3 rad
    assert box.size[2] > 1.1


@pytest.mark.parametrize("twin", ["optical", "radio"])
def test_trees_follow_a_body_whose_actor_stands(tmp_path, twin):
    """A level ray to the middle of the limb meets it half its thickness before, over the cosine of its slope."""
    world = turning(tmp_path)
    for time in (0.0, 0.5, 0.2):
        angle = RATE * time
        middle = np.array([3.0 + 0.5 * LENGTH * np.sin(angle), 0.0, LENGTH + 0.03 - 0.5 * LENGTH * np.cos(angle)])
        hits = world.at(time).cast([0.0, 0.0, middle[2]], [[1.0, 0.0, 0.0]], twin=twin)
        np.testing.assert_allclose(hits.distance, middle[0] - 0.03 / np.cos(angle), atol=1e-3)  # facets


@pytest.mark.parametrize("method", ["raycast", "sbr"])
def test_paths_of_a_radar_have_the_rates_of_the_surface(tmp_path, method):
    """Each path: 2 x the radial velocity of the point of the limb at its place."""
    state = turning(tmp_path).at(0.4)
    paths = ss.solve_paths(state, narrow(), Pose([0.0, 0.0, 0.5]), method=method)
    assert paths.num_paths > 3
    sight = paths.tx_point - [0.0, 0.0, 0.5]
    sight /= np.linalg.norm(sight, axis=1)[:, None]
    exact = np.cross([0.0, -RATE, 0.0], paths.tx_point - [3.0, 0.0, LENGTH + 0.03])
    single = paths.depth == 1
    np.testing.assert_allclose(paths.length_rate[single], 2.0 * np.einsum("ij,ij->i", sight, exact)[single], atol=5e-3)
    np.testing.assert_allclose((paths.tx_velocity)[single], exact[single], atol=5e-3)
    assert np.abs(paths.length_rate).max() > 0.5


def narrow(**changes) -> ss.RadarSpec:
    values = {
        "bandwidth": 5e8,
        "ramp_time": 20e-6,
        "idle_time": 230e-6,
        "num_chirps": 64,
        "num_samples": 64,
        "tx_positions": ((0.0, 0.0, 0.0),),
        "rx_positions": ((0.0, 0.0, 0.0),),
        "pattern": IsotropicPattern(),
        "azimuth_fov_deg": 16.0,
        "elevation_fov_deg": 20.0,
    }
    return ss.RadarSpec().with_(**{**values, **changes})


def pendulum(time: np.ndarray) -> np.ndarray:
    """Mean radial velocity of a thin limb, uniform along its length, far from the radar: L / 2 cos(a) a'."""
    angle = SWING * np.sin(2.0 * np.pi * FREQUENCY * time)
    rate = SWING * 2.0 * np.pi * FREQUENCY * np.cos(2.0 * np.pi * FREQUENCY * time)
    return -0.5 * LENGTH * np.cos(angle) * rate


def test_micro_doppler_of_a_swinging_limb(tmp_path):
    world = swinging(tmp_path)
    radar, pose = narrow(), Pose([0.0, 0.0, 0.5])
    times = np.linspace(0.0, 1.0 / FREQUENCY, 16, endpoint=False)
    looks = np.arange(8) / FREQUENCY

    def places(time: float) -> Pose:
        return Pose([0.037 * np.floor(time * FREQUENCY + 1e-6), 0.0, 0.5])

    found = spectrograms(world, radar, places, times, looks=looks, num_rays=20_000, hits_per_cell=None)["whole"]
    exact = pendulum(times)
    assert np.corrcoef(found.mean_velocity(), exact)[0, 1] > 0.99
    assert np.ptp(exact) > 1.5
    motion = [surface_motion(world, float(time), pose) for time in times]
    own = [one.mean_velocity([1]) for one in motion]
    np.testing.assert_allclose(own, exact, atol=0.05)  # 6 m away is not far: sights are 3 deg off the level


@pytest.mark.slow
def test_breathing_is_in_the_phase(tmp_path):
    """The echo of the chest turns by -4 pi / wavelength a metre; a tenth of a millimetre is 0.3 rad."""
    times = np.linspace(0.0, 0.4, 5)
    exact = BREATH * np.sin(2.0 * np.pi * BREATHS * times)
    np.testing.assert_allclose(breathing(tmp_path, times), exact, atol=1e-4)
    assert exact[-1] > 2.9e-3


def test_a_lidar_that_takes_its_time_meets_the_body_at_each_shot(tmp_path):
    world = turning(tmp_path)
    spec = LidarSpec(
        azimuth_fov_deg=(-15, 15), elevation_fov_deg=(-15, 20), num_azimuth=61, num_elevation=61, scan_time=0.1
    )
    scan = Lidar(spec).observe(world.at(0.3), Pose([0.0, 0.0, 0.5]), np.random.default_rng(0))
    rows = scan.instance == world.instances[2].instance
    assert rows.sum() > 40
    time, direction = shot_times(spec)[scan.shot[rows]], shot_directions(spec)[scan.shot[rows]]
    point = direction * scan.distance[rows, None] + [0.0, 0.0, 0.5]
    angle = RATE * (0.3 + time)
    along = np.stack([np.sin(angle), 0.0 * angle, -np.cos(angle)], axis=1)
    offset = point - [3.0, 0.0, LENGTH + 0.03]
    way = np.clip(np.einsum("ij,ij->i", offset, along), 0.0, LENGTH)
    away = np.linalg.norm(offset - way[:, None] * along, axis=1)
    assert away.min() > 0.0283 and away.max() < 0.0302
    exact = np.einsum("ij,ij->i", direction, np.cross([0.0, -RATE, 0.0], offset))
    np.testing.assert_allclose(scan.radial_velocity[rows], exact, atol=1e-6)


def test_flow_of_a_camera_follows_the_bending(tmp_path):
    """A point of the limb is on the circle about its pivot 0.1 s later."""
    world = turning(tmp_path)
    spec = CameraSpec(width=120, height=120, horizontal_fov_deg=40.0, flow_interval=0.1)
    state, pose = world.at(0.4), Pose([0.0, 0.0, 0.5])
    labels = render_labels(state, spec, pose, images=("depth", "semantic", "instance", "flow"))
    rows = np.flatnonzero(labels.instance.ravel() == world.instances[2].instance)
    hits = cast_pixels(state, spec, pose)
    of_limb = np.isin(hits.pixel, rows)
    offset = hits.point[of_limb] - [3.0, 0.0, LENGTH + 0.03]
    turn = Rotation.from_rotvec([0.0, -RATE * 0.1, 0.0])
    pixel, _ = spec.project(camera_optical_from_world(pose).apply(turn.apply(offset) + [3.0, 0.0, LENGTH + 0.03]))
    exact = pixel - pixel_centres(spec)[hits.pixel[of_limb]]
    found = labels.flow.reshape(-1, 2)[hits.pixel[of_limb]]
    assert of_limb.sum() > 50 and np.abs(exact).max() > 1.0
    np.testing.assert_allclose(found, exact, atol=0.02)  # float32 hits that graze a facet


def test_what_is_no_body_is_told(tmp_path):
    (tmp_path / "bad.glb").write_bytes(b"glTF" + bytes(30))
    with pytest.raises(MeshError, match="bad.glb"):
        ss.actor_from_body(tmp_path / "bad.glb")
    with pytest.raises(MeshError, match="cannot be read"):
        ss.actor_from_body(tmp_path / "none.bvh")
    file = limb(tmp_path, lambda t: t, np.linspace(0.0, 1.0, 3))
    with pytest.raises(MeshError, match="no animation 'dance'"):
        ss.actor_from_body(file, clip="dance")
    with pytest.raises(ParameterRangeError, match="speed"):
        ss.actor_from_body(file, speed=0.0)
    model = ss.actor_from_body(file, folder=tmp_path / "model")
    mesh = next((tmp_path / "model" / "meshes").iterdir())
    mesh.write_bytes(mesh.read_bytes().replace(b"element vertex", b"comment x\nelement vertex"))
    other = limb(tmp_path / "model", lambda t: t, np.linspace(0.0, 1.0, 3))
    other.replace(tmp_path / "model" / "body.glb")
    write_person(tmp_path / "model" / "body.glb")
    scene = load_scene(write_scene(tmp_path / "scene", [Thing("far", plane(1.0, 1.0))]))
    with pytest.raises(MeshError, match="no part 'limb'"):
        stage(scene, [ss.StagedActor("it", model, StaticTrajectory(Pose()))])


def test_a_scenario_file_takes_a_body(tmp_path):
    write_person(tmp_path / "person.glb")
    text = """
scene: highway_guardrail
keep_default_actors: false
duration: 0.1
ego: {trajectory: {kind: static, position: [0.0, 0.0, 0.0]}}
actors:
  - name: person
    body: {file: person.glb, smooth: true}
    trajectory: {kind: static, position: [12.0, 0.0, 0.0], yaw_deg: 180.0}
"""
    (tmp_path / "scenario.yaml").write_text(text)
    world = load_world(ss.ScenarioSpec.load(tmp_path / "scenario.yaml"))
    assert world.actor("person").bending is not None
    hits = world.at(0.05).cast([4.0, 0.0, 1.1], [[1.0, 0.0, 0.0]])
    rate = BREATH * 2.0 * np.pi * BREATHS * np.cos(2.0 * np.pi * BREATHS * 0.05)
    np.testing.assert_allclose(hits.velocity, [[-rate, 0.0, 0.0]], atol=1e-6)
    (tmp_path / "scenario.yaml").write_text(text.replace("person.glb", "other.glb"))
    with pytest.raises(ScenarioError, match="other.glb"):
        load_world(ss.ScenarioSpec.load(tmp_path / "scenario.yaml"))
