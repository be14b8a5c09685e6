"""The power of an echo over the band and over what rough surfaces may be."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.radar.channel.compose.expected_error import band_power, mean_power
from scarl_sionna.radar.paths import RadarPaths
from scarl_sionna.radar.points import point_targets

RADAR = ss.RadarSpec()
NUM = 40


def echo(rough: bool, seed: int) -> RadarPaths:
    """Return paths of one distance and one strength, each with a phase of its own."""
    points = np.tile([30.0, 0.0, 0.0], (NUM, 1))
    paths = point_targets(points, np.zeros((NUM, 3)), 1.0, RADAR, ss.Pose())
    turn = np.exp(2j * np.pi * np.random.default_rng(seed).uniform(size=NUM))
    return replace(paths, a=paths.a * turn[:, None, None], random_phase=np.full(NUM, rough))


def total(power, paths: RadarPaths) -> float:
    return float(power(paths, RADAR, np.arange(NUM), np.zeros(NUM, dtype=np.int64), 1, 16)[0])


def test_of_rough_surfaces_it_is_the_mean_over_their_phases() -> None:
    one = total(mean_power, echo(True, 0))
    drawn = [total(band_power, echo(True, seed)) for seed in range(400)]
    assert total(mean_power, echo(True, 1)) == pytest.approx(one, rel=1e-12, abs=0.0)
    assert np.mean(drawn) == pytest.approx(one, rel=4.0 / np.sqrt(len(drawn)), abs=0.0)  # exponential: four sigma
    assert np.std(drawn) > 0.5 * one


def test_of_smooth_surfaces_it_is_the_power_of_the_sum() -> None:
    paths = echo(False, 0)
    assert total(mean_power, paths) == pytest.approx(total(band_power, paths), rel=1e-12, abs=0.0)
    assert total(mean_power, paths) != pytest.approx(total(mean_power, echo(False, 1)), rel=0.1, abs=0.0)
