"""Panes as mirrors for the lidar: places, velocities and powers of what they mirror."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from camera_lidar import Lidar
from camera_lidar.lidar.scan import pane_reflectance, pane_transmittance
from scarl_sionna.core.mount import Mount
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.specs.lidar.pattern import RasterScan
from scarl_sionna.core.specs.lidar.spec import LidarSpec
from scarl_sionna.engine.load import load_scene
from tests.scenes import Material, Thing, box, plane, write_scene

NORMAL = np.array([-1.0, 1.0, 0.0]) / np.sqrt(2.0)
"""Of a pane at 45 deg, 10 m ahead: what lies to the left is mirrored into the view ahead."""
WALL = 0.6
SCAN = RasterScan(azimuth_fov_deg=(-2.0, 2.0), elevation_fov_deg=(-2.0, 2.0), num_azimuth=9, num_elevation=9)


def world_with_pane(tmp_path: Path, pane_speed: tuple[float, float, float] | None = None):
    """Return a pane at 45 deg, a wall 20 m to its left, and a bus-like box behind the pane."""
    motion = {"kind": "constant_twist", "position": (10.0, 0.0, 0.0), "velocity": pane_speed or (0.0, 0.0, 0.0)}
    pane = Thing("pane", plane(4.0, 4.0, (0.0, 0.0, 0.0), tuple(NORMAL)), "Static", "pane", motion)
    things = [
        Thing("wall", plane(200.0, 200.0, (0.0, 20.0, 0.0), (0.0, -1.0, 0.0)), "Wall", "wall"),
        Thing("bus", box((4.0, 12.0, 6.0), (42.0, 0.0, 0.0)), "Bus", "wall"),
    ]
    materials = {"pane": Material(radio="glass", lidar_reflectance=0.0), "wall": Material(lidar_reflectance=WALL)}
    path = write_scene(tmp_path, things, [pane], materials=materials)
    toml = path.parent / "scene.toml"
    toml.write_text(toml.read_text().replace("lidar_reflectance = 0.0", "lidar_transmittance = 0.8", 1))
    return load_scene(path)


def spec_of(**changes: object) -> LidarSpec:
    base = {"max_surfaces": 2, "max_returns": 4, "atmospheric_attenuation": 0.0}
    return LidarSpec(scan=SCAN, **{**base, **changes})


def test_a_pane_shows_what_is_beside_it(tmp_path: Path) -> None:
    state = world_with_pane(tmp_path).at(0.0)
    velocity = np.array([7.0, -3.0, 1.0])
    scan = Lidar(spec_of()).observe(state, Mount(Pose([0.0, 0.0, 0.0]), Twist(velocity, [0.0, 0.0, 0.0])), _rng())
    ghost = scan.instance == 0
    assert ghost.sum() == 81 and (scan.semantic[ghost] == 0).all()  # of nothing that is there
    direction = scan.position[ghost].astype(float) / scan.distance[ghost, None]
    turned = direction - 2.0 * (direction @ NORMAL)[:, None] * NORMAL
    to_pane = 10.0 * NORMAL[0] / (direction @ NORMAL)
    point = to_pane[:, None] * direction
    onward = (20.0 - point[:, 1]) / turned[:, 1]
    np.testing.assert_allclose(scan.distance[ghost], to_pane + onward, rtol=1e-6)
    np.testing.assert_allclose(scan.radial_velocity[ghost], -direction @ velocity, atol=1e-5)
    incidence = np.abs(direction @ NORMAL)
    share = pane_reflectance(0.8, incidence) ** 2
    np.testing.assert_allclose(scan.intensity[ghost], share * WALL * turned[:, 1] / (to_pane + onward) ** 2, rtol=1e-5)
    behind = scan.instance > 0
    assert behind.any() and (scan.distance[behind & (scan.distance > 15.0)] >= 39.9).all()


def test_a_moving_pane_moves_what_it_shows(tmp_path: Path) -> None:
    """The Doppler shift is that of the wall's point: how its image in the moving pane recedes."""
    speed = (3.0, 1.0, 0.0)
    scan = Lidar(spec_of()).observe(world_with_pane(tmp_path, speed).at(0.0), Pose([0.0, 0.0, 0.0]), _rng())
    ghost = scan.instance == 0
    image = scan.position[ghost].astype(float)

    def plane_at(time: float) -> np.ndarray:
        return np.array([10.0, 0.0, 0.0]) + np.array(speed) * time

    def mirrored(point: np.ndarray, time: float) -> np.ndarray:
        return point - 2.0 * ((point - plane_at(time)) @ NORMAL)[:, None] * NORMAL

    wall = mirrored(image, 0.0)
    np.testing.assert_allclose(wall[:, 1], 20.0, atol=1e-4)
    length = [np.linalg.norm(mirrored(wall, time), axis=1) for time in (-1e-4, 1e-4)]
    rate = (length[1] - length[0]) / 2e-4
    np.testing.assert_allclose(scan.radial_velocity[ghost], rate, atol=1e-4)
    assert np.abs(rate).min() > 1.0


def test_mirrors_can_be_left_out_and_need_a_second_surface(tmp_path: Path) -> None:
    state = world_with_pane(tmp_path).at(0.0)
    for spec in (spec_of(pane_reflections=False), spec_of(max_surfaces=1)):
        assert (Lidar(spec).observe(state, Pose([0.0, 0.0, 0.0]), _rng()).instance > 0).all()


@pytest.mark.parametrize("cosine", [1.0, 0.7, 0.2])
def test_what_a_clear_pane_does_not_pass_it_reflects(cosine: float) -> None:
    clear = float(pane_transmittance(1.0, 1.0))
    best = 0.5 * sum((1.0 - r) / (1.0 + r) for r in (0.04, 0.04))  # of n = 1.5, without absorption
    assert clear == 1.0 and best == pytest.approx(12.0 / 13.0)
    passed = float(pane_transmittance(best, cosine))
    assert float(pane_reflectance(best, cosine)) == pytest.approx(1.0 - passed, rel=1e-9)
    # an opaque one has its front alone
    front = ((1.5 - 1.0) / (1.5 + 1.0)) ** 2
    assert float(pane_reflectance(0.0, 1.0)) == pytest.approx(front)


def _rng() -> np.random.Generator:
    return np.random.default_rng(0)
