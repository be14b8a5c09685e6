"""Where ray casting breaks: float32 distances far away, small motion, grazing incidence, hits in step."""

from __future__ import annotations

import numpy as np
import pytest

from scarl_sionna.core.pose import Pose
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.engine.load import load_scene
from scarl_sionna.radar.channel import solve_paths
from tests.scenes import Thing, box, plane, write_scene

pytestmark = pytest.mark.own_process(shared=True)  # what it leaves behind would stay in the worker

RADAR = RadarSpec(azimuth_fov_deg=10.0, elevation_fov_deg=5.0)
WAVENUMBER = 2 * np.pi * RADAR.waveform.start_frequency / SPEED_OF_LIGHT


def _lengths(paths) -> np.ndarray:
    return 2.0 * np.linalg.norm(paths.tx_point - paths.world_from_tx.position, axis=1)


def test_far_oblique_wall_has_distances_in_float64(tmp_path) -> None:
    # A square turned by 45 deg about z, made of coordinates that float32 holds: x + y = 250.
    corners = np.array([(378, -128, -64), (122, 128, -64), (122, 128, 64), (378, -128, 64)], dtype=np.float64)
    mesh = plane(1.0, 1.0)
    mesh.vertices = corners
    state = load_scene(write_scene(tmp_path, [Thing("wall", mesh, "Wall", "steel")])).at(0.0)
    paths = solve_paths(
        state, RADAR, Pose([0.1, 0.2, 0.3]), "raycast", max_distance=400.0, hits_per_cell=None, num_rays=20_000
    )
    assert paths.num_paths > 19_000
    # On the plane to rounding of float64 (250 m * 2.2e-16 * a few operations); float32 alone would give 1.5e-5 m.
    assert np.abs(paths.tx_point[:, 0] + paths.tx_point[:, 1] - 250.0).max() < 1e-11
    assert _lengths(paths).min() > 300.0


def test_steps_of_a_twentieth_wavelength_turn_the_phase_by_as_much(tmp_path) -> None:
    step = RADAR.wavelength / 20
    actor = Thing(
        "truck",
        box((4, 32, 32), (2, 0, 0)),
        "Truck",
        "steel",
        {"kind": "constant_twist", "position": [200.0, 0, 0], "velocity": [1.0, 0, 0]},
    )
    world = load_scene(write_scene(tmp_path, actors=[actor]))
    pose = Pose.from_euler([0, 0, 0], yaw=0.02)
    lengths = [
        _lengths(solve_paths(world.at(k * step), RADAR, pose, "raycast", num_rays=400, hits_per_cell=None))
        for k in range(21)
    ]
    cosine = 200.0 / (lengths[0] / 2.0)
    turned = WAVENUMBER * np.diff(np.stack(lengths), axis=0)
    # Two ways: 4 pi / 20 for each step along the ray, 1 / cos for oblique rays. Meshes near the origin are exact in
    # float32 and are moved in float64, so only rounding of 200 m (3e-14 m, 1e-10 rad in the phase) is left, times a
    # few.
    assert np.abs(turned - 4 * np.pi / 20 / cosine).max() < 1e-9


def test_grazing_ground_stays_on_the_ground(tmp_path) -> None:
    ground = Thing("ground", plane(1024.0, 1024.0, (0, 0, 0), (0, 0, 1)), "Roads", "steel")
    state = load_scene(write_scene(tmp_path, [ground])).at(0.0)
    paths = solve_paths(state, RADAR.with_(elevation_fov_deg=1.0), Pose([0, 0, 0.5]), "raycast", num_rays=20_000)
    distance = _lengths(paths) / 2
    assert distance.max() > 200.0  # grazing angle of 0.14 deg
    # z = 0.5 + d * uz: rounding of d (1e-16 / sine of grazing, 2e-3 -> 5e-14 relative) times uz * d = 0.5 m.
    assert np.abs(paths.tx_point[:, 2]).max() < 1e-12
    assert np.isfinite(paths.a).all() and (np.abs(paths.a[:, 0, 0]) > 0).all()


def test_level_radar_over_flat_ground_adds_powers_when_rough_and_amplitudes_when_geometric(tmp_path) -> None:
    """Each row of rays hits a flat ground in a circle: all its hits are at one distance, in step."""
    ground = Thing("ground", plane(256.0, 256.0, (0, 0, 0), (0, 0, 1)), "Roads", "grey")
    state = load_scene(write_scene(tmp_path, [ground])).at(0.0)

    def gain(hit_phase: str) -> tuple[float, int, float]:
        """Return coherent over incoherent power of the rows in the mean, hits in a row, and VH over VV."""
        paths = solve_paths(
            state,
            RADAR,
            Pose([0, 0, 0.5]),
            "raycast",
            grid="regular",
            hit_phase=hit_phase,
            max_distance=100.0,
            hits_per_cell=None,
            num_rays=20_000,
        )
        signal = paths.a[:, 0, 0] * np.exp(-1j * WAVENUMBER * _lengths(paths))
        _, row = np.unique(np.round(_lengths(paths), 6), return_inverse=True)
        sums = np.bincount(row, signal.real) + 1j * np.bincount(row, signal.imag)
        powers = np.bincount(row, np.abs(signal) ** 2)
        crossed = float(np.mean(np.abs(paths.a[:, 0, 1]) ** 2) / np.mean(np.abs(paths.a[:, 0, 0]) ** 2))
        return float(np.mean(np.abs(sums) ** 2 / powers)), len(signal) // len(powers), crossed

    rough, *_ = gain("rough")
    geometric, in_a_row, crossed = gain("geometric")
    assert in_a_row > 150
    # In step: the whole row adds up, so the power is too large by the number of hits (23 dB here). As much of it as is
    # cross-polar has a random sign in V and H, whatever the phases of lengths.
    assert geometric == pytest.approx(in_a_row * (1.0 - crossed) + crossed, rel=0.01)
    # Rough: a row's power over its mean is exponential with mean 1 and variance 1: 5 sigma over about 47 rows.
    assert rough == pytest.approx(1.0, abs=5 / np.sqrt(47))


def test_staggered_rays_hit_a_road_at_all_distances(tmp_path) -> None:
    """Rows of a regular grid are circles on a flat ground, farther apart than a range bin from 16 m on."""
    ground = Thing("ground", plane(256.0, 256.0, (0, 0, 0), (0, 0, 1)), "Roads", "grey")
    state = load_scene(write_scene(tmp_path, [ground])).at(0.0)
    radar = RadarSpec()
    edges = np.arange(20.0, 60.0, radar.range_resolution)
    empty = {}
    for grid in ("regular", "staggered"):
        paths = solve_paths(state, radar, Pose([0, 0, 0.5]), "raycast", grid=grid, num_rays=1_000_000)
        empty[grid] = int((np.histogram(_lengths(paths) / 2, edges)[0] == 0).sum())
    # 80 bins; the rows at h / sine of elevation between 20 and 60 m number 0.5 (1/20 - 1/60) / 1.04e-3 = 16.
    assert empty["regular"] >= 80 - 17
    assert empty["staggered"] == 0
