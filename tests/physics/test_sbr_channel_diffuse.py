"""Diffuse scattering in the solver sbr.

Mean power against the integral of the pattern, polarisation, cuts, motion, seeds.
"""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from scarl_sionna.core.pose import Pose
from scarl_sionna.core.seeds import uniform_hash
from scarl_sionna.core.settings.sbr import SbrSettings
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.engine.load import load_scene
from scarl_sionna.radar.channel import solve_paths
from tests.scenes import Material, Thing, plane, write_scene

RADAR = RadarSpec(elevation_fov_deg=120.0)
FREQUENCY = RADAR.center_frequency
WAVELENGTH = SPEED_OF_LIGHT / FREQUENCY
ALL = SbrSettings(floor_db=None, max_depth=1)
ROUGH = {"own": Material(radio="asphalt")}
TILT = np.radians(40.0)
DISTANCE = 20.0
SIZE = 1.0


def _state(folder, mesh=None, **options):
    mesh = mesh or plane(SIZE, SIZE, normal=(1, 0, 0))
    return load_scene(write_scene(folder, [Thing("target", mesh, "Static", "own")], materials=ROUGH, **options)).at(0.0)


def _pose():
    return Pose.from_euler(DISTANCE * np.array([np.cos(TILT), np.sin(TILT), 0.0]), yaw=np.pi + TILT)


def _diffuse(state, pose, settings=ALL):
    """The rows that a rough surface adds: they come after all others, which do not change."""
    every = solve_paths(state, RADAR, pose, method="sbr", settings=settings)
    smooth = solve_paths(state, RADAR, pose, method="sbr", settings=settings.with_(diffuse=False))
    assert np.array_equal(every.a[: smooth.num_paths], smooth.a)
    return every.select(slice(smooth.num_paths, None))


def _signal(paths):
    center = paths.world_from_tx.position
    length = sum(np.linalg.norm(point - center, axis=1) for point in (paths.tx_point, paths.rx_point))
    return np.sum(paths.a[:, 0, 0] * np.exp(-2j * np.pi * FREQUENCY / SPEED_OF_LIGHT * length))


def _expected(state):
    """Integral of (lambda / 4 pi)^2 rho cos^2 / (pi R^4) over the plate, rho the albedo of the table."""
    material = state.world.materials["asphalt"]
    steps = (np.arange(200) + 0.5) / 200 - 0.5
    y, z = np.meshgrid(SIZE * steps, SIZE * steps)
    ray = np.stack([np.zeros_like(y), y, z], axis=-1) - _pose().position
    distance = np.linalg.norm(ray, axis=-1)
    cosine = np.abs(ray[..., 0]) / distance
    density = material.diffuse_albedo * cosine**2 / np.pi / distance**4
    return (WAVELENGTH / (4 * np.pi)) ** 2 * density.sum() * (SIZE / 200) ** 2


def test_power_is_the_integral_of_the_pattern_however_the_surface_is_cut(tmp_path) -> None:
    state = _state(tmp_path)
    crossed = state.world.materials["asphalt"].xpd_coefficient
    expected = _expected(state)
    counts = []
    for max_phase in (0.4, 0.05):
        paths = _diffuse(state, _pose(), ALL.with_(max_phase=max_phase))
        counts.append(paths.num_paths)
        power = (np.abs(paths.a) ** 2).sum(axis=0)
        # One value for the middle of each patch of 0.15 m at 20 m, in place of its mean: second order, (0.15 / 20)^2.
        assert power[:, 0].sum() / expected == pytest.approx(1.0, rel=1e-3)  # of 1e-15: no absolute tolerance
        assert power[1, 0] / power[:, 0].sum() == pytest.approx(crossed, rel=1e-9)
    assert counts[1] > 4 * counts[0] > 100


def test_mean_over_seeds_is_that_power(tmp_path) -> None:
    state = _state(tmp_path)
    num_seeds = 100
    powers = [abs(_signal(_diffuse(state, _pose(), ALL.with_(seed=seed)))) ** 2 for seed in range(num_seeds)]
    expected = _expected(state) * (1.0 - state.world.materials["asphalt"].xpd_coefficient)
    # The sum of hundreds of random phasors: power is exponential, its deviation is its mean; 5 sigma of the mean of
    # 100.
    assert np.mean(powers) / expected == pytest.approx(1.0, rel=5 / np.sqrt(num_seeds))
    assert np.std(powers) / expected == pytest.approx(1.0, rel=0.8)  # a fixed phase would give none


def test_phases_are_uniform_and_independent_of_neighbours() -> None:
    keys = np.stack(np.meshgrid(np.arange(200), np.arange(100)), axis=-1).reshape(-1, 2)
    turn = np.exp(2j * np.pi * uniform_hash(keys, 7))
    bound = 5 / np.sqrt(len(keys))  # 5 sigma of the mean of unit phasors
    assert abs(turn.mean()) < bound and abs((turn**2).mean()) < bound
    for other in (np.roll(turn, 1), np.roll(turn, 200), np.exp(2j * np.pi * uniform_hash(keys, 8))):
        assert abs((turn * other.conj()).mean()) < bound


def test_a_hidden_half_scatters_nothing(tmp_path) -> None:
    plate = Thing("target", plane(SIZE, SIZE, (10, 0, 0), (-1, 0, 0)), "Static", "own")
    screen = plane(2.0, 4.0, (0, 0, 0), (0, 0, 1))
    screen.vertices = screen.vertices[:, [2, 0, 1]] + (5, 1.0, 0)
    wall = Thing("wall", screen, "Wall", "steel")
    powers = []
    for name, things in (("free", [plate]), ("half", [plate, wall])):
        state = load_scene(write_scene(tmp_path / name, things, materials=ROUGH)).at(0.0)
        settings = ALL.with_(max_depth=1)
        every = solve_paths(state, RADAR, Pose(), method="sbr", settings=settings, instances=["target"])
        smooth = solve_paths(
            state, RADAR, Pose(), method="sbr", settings=settings.with_(diffuse=False), instances=["target"]
        )
        powers.append((np.abs(every.a[smooth.num_paths :]) ** 2).sum())
    # The edge's place is found to 2^-9 of 1 cm; the halves of the plate are mirror images.
    assert powers[1] / powers[0] == pytest.approx(0.5, rel=1e-3)


def test_speckle_of_a_moving_surface_has_no_doppler_floor(tmp_path) -> None:
    """The phases move with the surface.

    Chirps in steps of a 20th of a wavelength give a line, and no floor above -60 dB.
    """
    trajectory = {"kind": "constant_twist", "position": [30.0, 0, 0], "velocity": [1.0, 0, 0]}
    mesh = plane(SIZE, SIZE, normal=(-1, 0.7, 0.2))
    actor = Thing("target", mesh, "Static", "own", trajectory)
    world = load_scene(write_scene(tmp_path, actors=[actor], materials=ROUGH))
    step, count = WAVELENGTH / 20, 48
    moved = step * np.arange(count)
    chirps = np.array([_signal(_diffuse(world.at(x), Pose())) for x in moved])
    still = chirps * np.exp(4j * np.pi / WAVELENGTH * (30.0 + moved))
    spectrum = np.abs(np.fft.fft(still * np.blackman(count) ** 2))
    bins = np.abs((np.arange(count) + count // 2) % count - count // 2)
    # As for smooth bodies: the slow drift of the line of sight stays within 10 bins, where the window is below -110 dB.
    assert 20 * np.log10(spectrum[bins > 10].max() / spectrum[bins < 4].max()) < -60.0


def test_mirror_before_a_rough_surface(tmp_path) -> None:
    """A metal mirror shows the rough plate once more, as its image, on the way there or on the way back."""
    rough = Thing("rough", plane(0.5, 0.5, (10, 0, 0), (-1, 0.5, 0)), "Static", "own")
    mirror = Thing("mirror", plane(6.0, 3.0, (5, 4, 0), (0, -1, 0)), "Wall", "steel")
    state = load_scene(write_scene(tmp_path, [rough, mirror], materials=ROUGH)).at(0.0)
    every = solve_paths(state, RADAR, Pose(), method="sbr", settings=ALL.with_(max_depth=2))
    smooth = solve_paths(state, RADAR, Pose(), method="sbr", settings=ALL.with_(max_depth=2, diffuse=False))
    diffuse = every.select(slice(smooth.num_paths, None))
    once, double = diffuse.select(diffuse.depth == 1), diffuse.select(diffuse.depth == 2)
    there = double.interaction[:, 0] == 1
    twice, back = double.select(there), double.select(~there)
    assert np.array_equal(twice.instance, back.instance[:, ::-1]) and set(back.interaction[:, 1]) == {1}
    assert np.array_equal(twice.tx_point, back.rx_point) and np.array_equal(twice.rx_point, back.tx_point)
    assert np.array_equal(twice.a, back.a.transpose(0, 2, 1))
    direct = np.array([10.0, 0, 0])
    image = np.array([10.0, 8.0, 0])
    normal = np.array([-1, 0.5, 0]) / np.hypot(1, 0.5)
    seen_from = {"direct": -direct, "image": np.array([0, 8.0, 0]) - direct}
    cosine = {name: normal @ ray / np.linalg.norm(ray) for name, ray in seen_from.items()}
    # Direct both ways: cos^2 / R^4. By the mirror there and direct back: cos cos' / (R R')^2.
    ratio = cosine["image"] / cosine["direct"] * 10.0**2 / (image @ image)
    found = (np.abs(twice.a[:, 0, 0]) ** 2).sum() / (np.abs(once.a[:, 0, 0]) ** 2).sum()
    # The patch of 0.5 m is taken at its middle: cosines and distances change by 5 % over it, second order 0.3 %; metal
    # 0.2 %.
    assert found == pytest.approx(ratio, rel=0.01)
    assert set(twice.interaction[:, 0]) == {1} and set(twice.interaction[:, 1]) == {2}


def test_the_size_of_batches_changes_no_path(tmp_path) -> None:
    """Pieces of one patch that are traced in different batches have the same phase, and edges of both cancel."""
    corner = trimesh.util.concatenate([plane(SIZE, SIZE, normal=(1, 0, 0)), plane(SIZE, SIZE, normal=(0, 1, 0))])
    state = _state(tmp_path, corner)
    settings = SbrSettings(floor_db=None, max_depth=2)
    whole = solve_paths(state, RADAR, _pose(), method="sbr", settings=settings)
    batched = solve_paths(state, RADAR, _pose(), method="sbr", settings=settings.with_(max_tubes=100, max_rays=2000))
    assert np.any((whole.depth == 2) & (whole.interaction[:, 0] == 1) & (whole.interaction[:, 1] == 2))
    # corners that pieces of two batches share stay two paths, with the same sum
    for depth in (1, 2):  # the order of the sums differs: 1e-16 of each, times 1e3 rad of phase
        signals = [_signal(paths.select(paths.depth == depth)) for paths in (batched, whole)]
        assert signals[0] == pytest.approx(signals[1], rel=1e-9)
