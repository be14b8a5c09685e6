"""Moments of the lidar's drop-out and noise; five to six sigma with fixed seeds."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from camera_lidar.lidar.receiver import Slots, receive
from camera_lidar.lidar.returns import Echoes
from scarl_sionna.core.specs.lidar.receiver import ScarlReceiver

NUM = 200_000
SPEC = ScarlReceiver()
SHOT = np.arange(NUM)
SLOTS = Slots(NUM, SHOT)
SIGMAS = 5.5
Array = npt.NDArray[np.float64]


def ideal(distance: Array, radial_velocity: Array, intensity: Array) -> Echoes:
    """Return one return a shot, from surfaces that face the lidar."""
    normal = np.broadcast_to([-1.0, 0.0, 0.0], (NUM, 3))
    return Echoes(SHOT, distance, radial_velocity, intensity, np.ones(NUM), normal, np.zeros(NUM, dtype=np.int64))


@pytest.mark.parametrize("intensity", [1e-5, 1e-4, 1e-3])
def test_drop_out_keeps_the_stated_share(intensity: float) -> None:
    spec = SPEC.with_(drop_out_intensity=2e-4)
    ones = np.ones(NUM)
    kept = receive(spec, SLOTS, ideal(ones, ones, np.full(NUM, intensity)), np.random.default_rng(1)).kept
    probability = 1.0 - np.exp(-intensity / 2e-4)
    sigma = np.sqrt(NUM * probability * (1.0 - probability))
    assert abs(len(kept) - NUM * probability) < SIGMAS * sigma


def test_drop_outs_of_neighbouring_shots_are_independent() -> None:
    spec = SPEC.with_(drop_out_intensity=1.0)
    ones = np.ones(NUM)
    kept = receive(spec, SLOTS, ideal(ones, ones, np.full(NUM, np.log(2.0))), np.random.default_rng(2)).kept
    mask = np.zeros(NUM)
    mask[kept] = 1.0
    both = np.count_nonzero(mask[1:] * mask[:-1])  # keep probability 1/2: pairs are binomial with 1/4 up to overlap
    # variance of the number of adjacent pairs: n (3/16 + 2 (1/8 - 1/16)) = 5 n / 16
    assert abs(both - NUM / 4) < SIGMAS * np.sqrt(5 * NUM / 16)


@pytest.mark.parametrize("distance", [5.0, 50.0, 200.0])
def test_range_noise_has_a_variance_proportional_to_distance(distance: float) -> None:
    spec = SPEC.with_(range_noise_variance_per_metre=4e-5)
    got = receive(spec, SLOTS, ideal(np.full(NUM, distance), np.zeros(NUM), np.ones(NUM)), np.random.default_rng(3))
    error = got.distance - distance
    variance = 4e-5 * distance
    assert len(got.kept) == NUM
    assert abs(error.mean()) < SIGMAS * np.sqrt(variance / NUM)
    assert abs(error.var() / variance - 1.0) < SIGMAS * np.sqrt(2.0 / NUM)  # chi-square of NUM degrees
    assert abs(np.mean(error**4) / variance**2 - 3.0) < SIGMAS * np.sqrt(96.0 / NUM)  # normal: kurtosis 3


def test_velocity_noise_is_normal_with_the_stated_deviation() -> None:
    spec = SPEC.with_(velocity_noise_std=0.2)
    got = receive(spec, SLOTS, ideal(np.full(NUM, 10.0), np.full(NUM, -7.0), np.ones(NUM)), np.random.default_rng(4))
    error = got.radial_velocity + 7.0
    assert abs(error.mean()) < SIGMAS * 0.2 / np.sqrt(NUM)
    assert abs(error.var() / 0.04 - 1.0) < SIGMAS * np.sqrt(2.0 / NUM)
    assert np.array_equal(got.distance, np.full(NUM, 10.0))


def test_noises_are_uncorrelated() -> None:
    spec = SPEC.with_(range_noise_variance_per_metre=1e-4, velocity_noise_std=0.1)
    got = receive(spec, SLOTS, ideal(np.full(NUM, 10.0), np.zeros(NUM), np.ones(NUM)), np.random.default_rng(5))
    correlation = np.corrcoef(got.distance, got.radial_velocity)[0, 1]
    assert abs(correlation) < SIGMAS / np.sqrt(NUM)


def test_zeros_switch_every_effect_off_exactly() -> None:
    rng = np.random.default_rng(6)
    distance, velocity = rng.uniform(1, 200, NUM), rng.normal(0, 10, NUM)
    got = receive(
        SPEC, SLOTS, ideal(distance, velocity, np.zeros(NUM)), np.random.default_rng(7)
    )  # even at no intensity
    assert np.array_equal(got.kept, SHOT)
    assert np.array_equal(got.distance, distance) and np.array_equal(got.radial_velocity, velocity)


def test_a_distance_is_never_negative() -> None:
    spec = SPEC.with_(range_noise_variance_per_metre=1.0)
    got = receive(spec, SLOTS, ideal(np.full(NUM, 0.1), np.zeros(NUM), np.ones(NUM)), np.random.default_rng(8))
    assert got.distance.min() == 0.0
