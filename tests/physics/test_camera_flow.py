"""Surface normals and optical flow against exact values."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from camera_lidar import Camera
from camera_lidar.camera.projection import pixel_rays
from scarl_sionna.core.mount import Mount
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.specs.camera import BrownConrady, CameraSpec, KannalaBrandt
from scarl_sionna.engine.load import load_scene
from tests.scenes import Thing, ball, plane, write_scene

SPEC = CameraSpec(
    width=160, height=90, horizontal_fov_deg=70.0, images=("depth", "instance", "normal", "flow"), flow_interval=0.2
)
BEHIND = Thing("behind", plane(1.0, 1.0, (-50.0, 0.0, 0.0), (1.0, 0.0, 0.0)))
FLOAT32_FLOW = 2e-5
"""Rounding of a flow below 200 px in float32 [px]."""


def grid(spec: CameraSpec) -> np.ndarray:
    """Return the pixel centres, shape (height, width, 2)."""
    rows, columns = np.mgrid[0 : spec.height, 0 : spec.width] + 0.5
    return np.stack([columns, rows], -1)


def observe(folder: Path, spec: CameraSpec, things: list, actors: list, pose: Pose, twist: Twist | None = None):
    state = load_scene(write_scene(folder, things, actors)).at(0.0)
    return Camera(spec).observe(state, Mount(pose, twist or Twist()), np.random.default_rng(0))


def test_normals_of_a_tilted_plane_and_of_the_sky(tmp_path: Path) -> None:
    pose = Pose.from_euler([0.0, 0.0, 0.0], yaw=0.3, pitch=-0.2, roll=0.1)
    normal = np.array([-0.8, 0.3, 0.2]) / np.linalg.norm([-0.8, 0.3, 0.2])
    frame = observe(tmp_path, SPEC, [Thing("wall", plane(6.0, 6.0, (12.0, 3.0, 2.0), normal))], [], pose)
    hit = frame.instance > 0
    assert 0.05 < hit.mean() < 0.95
    assert np.abs(frame.normal[hit] - normal @ pose.rotation).max() < 1e-6  # float32 plane, 6 m wide at 12 m
    assert (frame.normal[~hit] == 0.0).all()


def test_normals_of_a_ball_point_towards_the_camera(tmp_path: Path) -> None:
    centre = np.array([6.0, 0.5, -0.2])
    frame = observe(tmp_path, SPEC, [Thing("ball", ball(1.0, centre, 5))], [], Pose())
    hit = frame.instance > 0
    rays = pixel_rays(SPEC).reshape(SPEC.height, SPEC.width, 3)[hit]
    point = rays * (frame.depth[hit] / rays[:, 0])[:, None]
    radial = (point - centre) / np.linalg.norm(point - centre, axis=1, keepdims=True)
    # facets of an icosphere with 5 subdivisions are 2.4 deg wide: their normal is within 1.6 deg of the radius
    assert (np.einsum("ij,ij->i", frame.normal[hit], radial) > np.cos(np.radians(1.6))).all()
    assert (np.einsum("ij,ij->i", frame.normal[hit], rays) < 0.0).all()
    np.testing.assert_allclose(np.linalg.norm(frame.normal[hit], axis=1), 1.0, atol=1e-6)  # float32


def test_flow_of_a_translating_wall(tmp_path: Path) -> None:
    velocity = np.array([-3.0, 2.0, 0.5])
    wall = Thing(
        "wall",
        plane(20.0, 20.0, normal=(-1.0, 0.0, 0.0)),
        trajectory={"kind": "constant_twist", "position": (10.0, 0.0, 0.0), "velocity": tuple(velocity.tolist())},
    )
    frame = observe(tmp_path, SPEC, [BEHIND], [wall], Pose())
    focal, _, cu = SPEC.intrinsics[0]
    cv = SPEC.intrinsics[1, 2]
    at = grid(SPEC)
    later = 10.0 + 0.2 * velocity[0]
    u = cu + ((at[..., 0] - cu) * 10.0 - focal * 0.2 * velocity[1]) / later
    v = cv + ((at[..., 1] - cv) * 10.0 - focal * 0.2 * velocity[2]) / later
    np.testing.assert_allclose(frame.flow, np.stack([u, v], -1) - at, atol=FLOAT32_FLOW)


def test_flow_of_a_turning_wall(tmp_path: Path) -> None:
    rate = 1.5
    wall = Thing(
        "wall",
        plane(30.0, 30.0, normal=(-1.0, 0.0, 0.0)),
        trajectory={
            "kind": "constant_twist",
            "position": (10.0, 0.0, 0.0),
            "velocity": (0.0, 0.0, 0.0),
            "angular_velocity_z": rate,
        },
    )
    frame = observe(tmp_path, SPEC, [BEHIND], [wall], Pose())
    focal, _, cu = SPEC.intrinsics[0]
    cv = SPEC.intrinsics[1, 2]
    at = grid(SPEC)
    y, z = (cu - at[..., 0]) * 10.0 / focal, (cv - at[..., 1]) * 10.0 / focal
    angle = rate * 0.2
    x_later, y_later = 10.0 - np.sin(angle) * y, np.cos(angle) * y
    expected = np.stack([cu - focal * y_later / x_later, cv - focal * z / x_later], -1) - at
    np.testing.assert_allclose(frame.flow, expected, atol=FLOAT32_FLOW)


@pytest.mark.parametrize(
    "spec",
    [
        SPEC,
        SPEC.with_(lens=BrownConrady(k1=-0.25, k2=0.07, p1=5e-4)),
        SPEC.with_(lens=KannalaBrandt(k1=-0.02), horizontal_fov_deg=170.0),
    ],
    ids=["pinhole", "barrel", "fisheye"],
)
def test_flow_of_a_turning_camera_needs_no_distance(tmp_path: Path, spec: CameraSpec) -> None:
    rate = np.array([0.0, 0.3, 0.5])  # pitch and yaw
    shell = ball(30.0, (0.0, 0.0, 0.0), 3)
    shell.update_faces(shell.triangles_center[:, 0] > -9.0)  # open behind the camera
    frame = observe(tmp_path, spec, [Thing("shell", shell)], [], Pose([0.0, 0.0, 0.0]), Twist(angular=rate))
    from scipy.spatial.transform import Rotation

    turn = Rotation.from_rotvec(rate * spec.flow_interval).as_matrix()
    optical_from_sensor = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
    pixel, _ = spec.project(pixel_rays(spec) @ turn @ optical_from_sensor.T)  # rows: R^T ray
    expected = pixel.reshape(spec.height, spec.width, 2) - grid(spec)
    seen = np.isfinite(expected[..., 0])
    assert seen.mean() > 0.8
    np.testing.assert_allclose(frame.flow[seen], expected[seen], atol=FLOAT32_FLOW)
    assert np.isnan(frame.flow[~seen]).all()


def test_the_ego_vehicle_carries_its_camera_along_its_trajectory(tmp_path: Path) -> None:
    ego = Thing(
        "ego",
        plane(0.1, 0.1),
        trajectory={
            "kind": "waypoints",
            "times": (0.0, 0.5, 1.0, 1.5),
            "positions": [(0, 0, 0), (2, 0, 0), (5, 0, 0), (9, 0, 0)],
        },
    )
    wall = Thing("wall", plane(40.0, 40.0, (20.0, 0.0, 0.0), (-1.0, 0.0, 0.0)))
    world = load_scene(write_scene(tmp_path, [wall], [ego], ego="ego"))
    state = world.at(0.0)
    mount = Pose([0.2, 0.0, 0.5])
    camera = Camera(SPEC.with_(flow_interval=0.5))
    frame = camera.observe(state, Mount(mount, state.actor_twist("ego")), np.random.default_rng(0))
    at = grid(SPEC)
    middle = SPEC.intrinsics[:2, 2]
    # from 19.8 m to 17.8 m: the accelerating ego is at 2 m after 0.5 s, not at 0.5 s times its first velocity
    np.testing.assert_allclose(frame.flow, (at - middle) * (19.8 / 17.8 - 1.0), atol=FLOAT32_FLOW)
    assert abs(state.actor_twist("ego").linear[0] * 0.5 - 2.0) > 0.1
