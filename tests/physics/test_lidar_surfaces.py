"""Glass, edges and the footprint of the beam."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from camera_lidar import Lidar
from camera_lidar.lidar import beam_radius, mean_cnr, pane_transmittance, range_view, shot_directions
from camera_lidar.lidar.beam import footprint, sub_directions
from scarl_sionna.core.errors import MaterialError
from scarl_sionna.core.mount import Mount
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.results import LidarScan
from scarl_sionna.core.specs.lidar.receiver import HeterodyneReceiver
from scarl_sionna.core.specs.lidar.spec import LidarSpec
from scarl_sionna.engine.load import load_scene
from scarl_sionna.engine.world import World
from tests.scenes import Material, Thing, box, plane, write_scene

SMALL = LidarSpec(
    azimuth_fov_deg=(-20, 20), elevation_fov_deg=(-8, 8), num_azimuth=41, num_elevation=17, atmospheric_attenuation=2e-3
)
AT = Pose([0.0, 0.0, 5.0])


def observe(world: World, spec: LidarSpec) -> LidarScan:
    return Lidar(spec).observe(world.at(0.0), Mount(AT, Twist([3.0, 0.0, 0.0])), np.random.default_rng(0))


def glazed(folder: Path, panes: int = 1) -> World:
    """Return a wall at 30 m behind panes at 10 m, 11 m, ... with transmittance 0.8 and reflectance 0.05."""
    materials = {"pane": Material(radio="glass", lidar_reflectance=0.05), "wall": Material(lidar_reflectance=0.6)}
    things = [Thing("wall", plane(100.0, 100.0, (30.0, 0.0, 5.0), (-1, 0, 0)), "Wall", "wall")]
    things += [
        Thing(f"pane{index}", plane(100.0, 100.0, (10.0 + index, 0.0, 5.0), (-1, 0, 0)), "Building", "pane")
        for index in range(panes)
    ]
    path = write_scene(folder, things, materials=materials)
    toml = path.parent / "scene.toml"
    toml.write_text(
        toml.read_text().replace("lidar_reflectance = 0.05", "lidar_reflectance = 0.05\nlidar_transmittance = 0.8")
    )
    return load_scene(path)


def test_behind_glass_a_return_is_attenuated_twice(tmp_path: Path) -> None:
    scan = observe(glazed(tmp_path), SMALL.with_(max_surfaces=2, max_returns=2))
    assert scan.num_points == 2 * SMALL.num_shots
    assert np.array_equal(scan.return_index, np.tile([0, 1], SMALL.num_shots))
    cosine = shot_directions(SMALL)[:, 0]
    pane, wall = (slice(first, None, 2) for first in (0, 1))
    assert np.allclose(scan.distance[pane], 10.0 / cosine, rtol=1e-6) and np.allclose(
        scan.distance[wall], 30 / cosine, rtol=1e-6
    )
    direct = 0.6 * cosine * np.exp(-2 * 2e-3 * 30.0 / cosine) / (30.0 / cosine) ** 2
    through = pane_transmittance(0.8, cosine)
    assert np.allclose(scan.intensity[wall], direct * through**2, rtol=1e-5)
    assert np.allclose(scan.reflectance[pane], 0.05) and np.allclose(scan.reflectance[wall], 0.6)
    # parallel panes: at 20 deg the incoherent Fresnel transmittance of glass has fallen by 0.06 %, at 70 deg by 24 %
    assert np.isclose(pane_transmittance(0.8, 1.0), 0.8, rtol=1e-12)
    assert 0.70 < pane_transmittance(1.0, np.cos(np.radians(70.0))) < 0.80 and pane_transmittance(0.8, 0.0) == 0.0


def test_the_strongest_returns_are_kept_and_panes_multiply(tmp_path: Path) -> None:
    world = glazed(tmp_path, panes=3)
    first = observe(world, SMALL)
    assert (first.instance == 2).all()  # the first surface only
    strongest = observe(world, SMALL.with_(max_surfaces=8))
    axis = shot_directions(SMALL)[strongest.shot, 0] > 0.9999
    # on the axis: panes 0.05 / 10^2 = 5e-4 (11 m, 12 m: 0.64 and 0.41 of less), wall 0.6 / 30^2 * 0.8^6 = 1.7e-4
    assert (strongest.instance[axis] == 2).all() and strongest.num_points == SMALL.num_shots
    all_four = observe(world, SMALL.with_(max_surfaces=8, max_returns=4))
    assert all_four.num_points == 4 * SMALL.num_shots
    wall = all_four.instance == 1
    cosine = shot_directions(SMALL)[all_four.shot[wall], 0]
    expected = 0.6 * cosine**3 / 900.0 * np.exp(-4e-3 * 30.0 / cosine) * pane_transmittance(0.8, cosine) ** 6
    assert np.allclose(all_four.intensity[wall], expected, rtol=1e-5)
    maps = range_view(all_four)
    assert maps.filled.all() and (maps.instance == 2).all()  # the nearest return shows


def test_a_beam_across_an_edge_gives_two_returns_that_share_its_power(tmp_path: Path) -> None:
    things = [
        Thing("wall", plane(200.0, 200.0, (60.0, 0.0, 5.0), (-1, 0, 0)), "Wall", "white"),
        Thing("box", box((2.0, 10.0, 10.0), (41.0, 5.0, 5.0)), "Building", "white"),  # its edge is on the axis: y = 0
    ]
    world = load_scene(write_scene(tmp_path, things))
    fan = LidarSpec(
        azimuth_fov_deg=(-0.3, 0.3),
        elevation_fov_deg=(0, 0),
        num_azimuth=61,
        num_elevation=1,
        beam_divergence=4e-3,
        sub_rays=64,
        max_returns=2,
        atmospheric_attenuation=0.0,
    )
    scan = observe(world, fan)
    twice = np.flatnonzero(np.bincount(scan.shot, minlength=61) == 2)
    # the beam is 2 mrad wide to 1/e2: within about that of the edge both are seen
    azimuth = np.radians(np.linspace(-0.3, 0.3, 61))
    assert np.abs(azimuth[twice]).max() < 4e-3 and len(twice) > 25
    share = np.zeros(61)
    box_row = scan.instance == 2
    share[scan.shot[box_row]] = scan.intensity[box_row] * 40.0**2
    wall_share = np.zeros(61)
    wall_share[scan.shot[~box_row]] = scan.intensity[~box_row] * 60.0**2
    assert np.allclose(share + wall_share, 1.0, atol=2e-4)  # cosines and slant distances within 1e-4
    # the share of a Gaussian beam beyond a straight edge, from 64 rays: one ray is 1.6 %
    from scipy.special import erf

    expected = 0.5 * (1.0 + erf(np.sqrt(2.0) * azimuth / 2e-3))
    assert np.abs(share - expected).max() < 0.04
    assert np.all(np.diff(scan.shot) >= 0) and set(scan.return_index) == {0, 1}
    assert np.all(np.isclose(scan.distance, 40.0, atol=0.01) | np.isclose(scan.distance, 60.0, atol=0.01))


@pytest.mark.parametrize("number", [5, 16, 64])
def test_sub_rays_sample_a_gaussian_beam(number: int) -> None:
    points = footprint(number)
    assert np.allclose(points.mean(axis=0), 0.0, atol=1e-12)
    assert np.allclose(points.T @ points / number, np.eye(2) / 4.0, atol=1e-12)  # of exp(-2 r^2)
    spec = LidarSpec(sub_rays=number, beam_divergence=1e-3)
    axis = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.6, 0.0, -0.8]])
    rays = sub_directions(spec, axis)
    assert rays.shape == (3, number, 3) and np.allclose(np.linalg.norm(rays, axis=-1), 1.0, atol=1e-15)
    spread = np.linalg.norm(np.cross(rays, axis[:, None, :]), axis=-1)
    assert np.allclose(spread, np.linalg.norm(points, axis=-1) * 0.5e-3, rtol=1e-6)
    assert np.array_equal(footprint(1), [[0.0, 0.0]])
    assert beam_radius(spec, 100.0) == pytest.approx(np.hypot(5e-3, 0.05))


def test_a_tilted_surface_within_the_beam_is_one_return(tmp_path: Path) -> None:
    road = Thing("road", plane(400.0, 400.0), "Roads", "white")
    world = load_scene(write_scene(tmp_path, [road]))
    spec = SMALL.with_(sub_rays=16, max_returns=4, elevation_fov_deg=(-20, -5), beam_divergence=1e-3)
    scan = observe(world, spec)
    assert scan.num_points == spec.num_shots and not scan.return_index.any()
    thin = observe(world, spec.with_(sub_rays=1))
    # the mean over a footprint of 0.25 mrad rms at 5 deg: second order, (0.25e-3 / 0.087)^2 = 8e-6 of 57 m, weighted by
    # intensity that falls by 3 * 0.3 % over it: 2e-5 more
    assert np.allclose(scan.distance, thin.distance, rtol=1e-4)
    assert np.allclose(scan.intensity, thin.intensity, rtol=1e-3)
    assert np.allclose(scan.radial_velocity, thin.radial_velocity, atol=1e-4)


def test_the_heterodyne_scan_holds_the_cnr_of_its_returns(tmp_path: Path) -> None:
    spec = SMALL.with_(max_surfaces=2, max_returns=2, receiver=HeterodyneReceiver(noise=False, speckle=False))
    scan = observe(glazed(tmp_path), spec)
    assert scan.num_points == 2 * SMALL.num_shots
    assert np.allclose(scan.cnr, mean_cnr(spec, scan.intensity, scan.distance), rtol=1e-5)
    assert np.allclose(scan.radial_velocity, -3.0 * shot_directions(SMALL)[scan.shot, 0], atol=1e-5)


def test_raw_beats_resolve_a_pane_and_the_wall_behind(tmp_path: Path) -> None:
    receiver = HeterodyneReceiver(raw_signal=True, speckle=False)
    spec = SMALL.with_(max_surfaces=2, max_returns=2, num_azimuth=7, num_elevation=3, receiver=receiver)
    scan = observe(glazed(tmp_path), spec)
    assert scan.beat_signal is not None and scan.beat_signal.shape == (21, 2, 2500)
    assert scan.beat_signal.dtype == np.complex64
    assert scan.num_points == 42 and np.array_equal(scan.instance, np.tile([2, 1], 21))
    truth = np.tile([10.0, 30.0], 21) / shot_directions(spec)[scan.shot, 0]
    assert np.abs(scan.distance - truth).max() < 0.02  # 15 cm resolution, 30 dB and more


def test_reflectance_and_transmittance_above_one_are_refused(tmp_path: Path) -> None:
    path = write_scene(tmp_path, [Thing("wall", plane(1.0, 1.0))], materials={"grey": Material(lidar_reflectance=0.5)})
    toml = tmp_path / "scene.toml"
    text = toml.read_text()
    toml.write_text(text.replace("lidar_reflectance = 0.5", "lidar_reflectance = 0.5\nlidar_transmittance = 0.6"))
    with pytest.raises(MaterialError, match=r"= 1\.1 > 1"):
        load_scene(path)
