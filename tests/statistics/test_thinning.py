"""Thinning of hits keeps what a radar can measure of them: mean power of every cell, and its speckle."""

from __future__ import annotations

import numpy as np
import pytest

from scarl_sionna.core.mount import Mount
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.engine.load import load_scene
from scarl_sionna.radar.channel import solve_paths
from tests.scenes import Thing, ball, plane, write_scene

RADAR = RadarSpec().with_(num_chirps=64, num_samples=256, sampling_frequency=512 / 30e-6)
SPEED = Twist(linear=[11.0, 0.0, 0.0])


@pytest.fixture(scope="module")
def state(tmp_path_factory):
    things = (
        Thing("ground", plane(256.0, 256.0, (0, 0, 0), (0, 0, 1)), "Roads", "grey", is_object=False),
        Thing("ball", ball(1.0, (12, 2, 1.5)), "Car", "steel"),
        Thing("wall", plane(16.0, 16.0, (24, -8, 8), (-1, 0, 0)), "Building", "grey"),
    )
    return load_scene(write_scene(tmp_path_factory.mktemp("scene"), things)).at(0.0)


def _solve(state, hits_per_cell: int | None):
    """Solve with the ground by class.

    By the law of rough surfaces its echo falls faster with range, and without windows many bins hold but sidelobes of
    the nearest ground, whose response varies by more than the factor that the tolerance below is derived from: 0.236 dB
    rms.
    """
    return solve_paths(
        state,
        RADAR,
        Mount(Pose([0, 0, 0.75]), SPEED),
        "raycast",
        hits_per_cell=hits_per_cell,
        num_rays=200_000,
        rough_ground=False,
    )


def _dirichlet_squared(cycles: np.ndarray, count: int) -> np.ndarray:
    """Return abs(mean of exp(2j pi n cycles) over n = 0 .. count - 1)**2."""
    cycles = cycles - np.round(cycles)
    with np.errstate(invalid="ignore", divide="ignore"):
        value = (np.sin(np.pi * count * cycles) / (count * np.sin(np.pi * cycles))) ** 2
    return np.where(np.abs(cycles) < 1e-12, 1.0, value)


def _expected_power(paths, bins: np.ndarray) -> np.ndarray:
    """Return the mean power in bins (range [m], velocity [m/s], sine of azimuth) over independent phases of the paths.

    Unwindowed transforms of the de-chirped signal and of a 12-element half-wave line: a product of Dirichlet kernels.
    """
    offset = paths.tx_point - paths.world_from_tx.position
    distance = np.linalg.norm(offset, axis=1)
    unit = offset / distance[:, None]
    gain_db = RADAR.array.pattern.gain_db(np.arctan2(unit[:, 1], unit[:, 0]), np.arcsin(unit[:, 2]))
    power = np.abs(paths.a[:, 0, 0]) ** 2 * 10 ** (gain_db / 5)
    velocity = paths.length_rate / 2
    out = np.empty(len(bins))
    for index, (at, speed, sine) in enumerate(bins):
        response = _dirichlet_squared((distance - at) / (RADAR.range_resolution * RADAR.num_samples), RADAR.num_samples)
        response *= _dirichlet_squared(
            (velocity - speed) / (RADAR.velocity_resolution * RADAR.num_chirps), RADAR.num_chirps
        )
        response *= _dirichlet_squared((unit[:, 1] - sine) / 2, 12)
        out[index] = power @ response
    return out


def test_mean_power_of_every_bin_stays(state) -> None:
    full, thinned = _solve(state, None), _solve(state, 8)
    assert thinned.num_paths < 0.4 * full.num_paths  # it does thin here
    generator = np.random.default_rng(3)
    sines = generator.uniform(-0.8, 0.8, 300)
    bins = np.stack([generator.uniform(2.0, 40.0, 300), -11.0 * np.sqrt(1 - sines**2), sines], axis=1)
    before, after = _expected_power(full, bins), _expected_power(thinned, bins)
    strong = before > before.max() * 1e-5
    assert strong.sum() > 200
    error_db = 10 * np.log10(after[strong] / before[strong])
    # A bin's response varies by less than a factor 2 within a cell of half a bin (-3 dB at 0.44 bins), so one share of
    # a cell is uncertain by at most about 30 %; a bin gathers at least 4 strong cells of 8 shares: 0.3 / sqrt(32) = 5
    # %, 0.23 dB rms.
    assert np.sqrt(np.mean(error_db**2)) < 0.23
    # Far below the speckle's 5.6 dB; the mean over bins has no bias beyond 5 sigma.
    assert abs(np.mean(error_db)) < 5 * 0.23 / np.sqrt(strong.sum())


def test_objects_keep_their_power_and_no_object_is_lost(state) -> None:
    full, thinned = _solve(state, None), _solve(state, 8)
    for number in np.unique(full.instance):
        power = [
            np.sum(
                np.abs(paths.a[paths.instance[:, 0] == number, 0, 0]) ** 2
                * _gain(paths)[paths.instance[:, 0] == number]
            )
            for paths in (full, thinned)
        ]
        # Sampling keeps each cell's received power exactly: rounding of running sums over 2e5 hits.
        assert power[1] == pytest.approx(power[0], rel=1e-9)


def _gain(paths) -> np.ndarray:
    unit = paths.tx_point - paths.world_from_tx.position
    unit /= np.linalg.norm(unit, axis=1, keepdims=True)
    return 10 ** (RADAR.array.pattern.gain_db(np.arctan2(unit[:, 1], unit[:, 0]), np.arcsin(unit[:, 2])) / 5)


def test_speckle_of_a_cell_is_exponential(state) -> None:
    """Mean 1 and second moment 2 of power over its mean, over many draws of the phases."""
    thinned = _solve(state, 8)
    offset = thinned.tx_point - thinned.world_from_tx.position
    distance = np.linalg.norm(offset, axis=1)
    # One resolution cell on the wall: range, direction; all at one velocity to within the cell.
    inside = (np.abs(distance - 25.0) < 0.25) & (np.abs(offset[:, 1] / distance + 0.3) < 0.09)
    power = np.abs(thinned.a[inside, 0, 0]) ** 2
    assert 16 < inside.sum() < 200
    draws = 20_000
    phases = np.random.default_rng(5).random((draws, inside.sum()))
    ratio = np.abs(np.exp(2j * np.pi * phases) @ np.sqrt(power)) ** 2 / power.sum()
    # Exponential: variance 1 of the power and 20 of its square, 5 sigma; second moment 2 - sum P^2 / (sum P)^2.
    assert ratio.mean() == pytest.approx(1.0, abs=5 / np.sqrt(draws))
    second = 2.0 - np.sum(power**2) / power.sum() ** 2
    assert np.mean(ratio**2) == pytest.approx(second, abs=5 * np.sqrt(20 / draws))
    assert second > 1.9  # within 5 % of fully developed speckle
