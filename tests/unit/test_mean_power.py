"""The power of an echo over the band and over what rough surfaces may be."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.engine.paths.tracing import DIFFUSE, SPECULAR
from scarl_sionna.radar.channel.compose.expected_error import band_power, mean_power
from scarl_sionna.radar.paths import RadarPaths
from scarl_sionna.radar.points import point_targets

RADAR = ss.RadarSpec()
NUM = 40


def echo(kind: int, seed: int) -> RadarPaths:
    """Return paths of one distance and one strength, each with a phase of its own."""
    points = np.tile([30.0, 0.0, 0.0], (NUM, 1))
    paths = point_targets(points, np.zeros((NUM, 3)), 1.0, RADAR, ss.Pose())
    turn = np.exp(2j * np.pi * np.random.default_rng(seed).uniform(size=NUM))
    return replace(paths, a=paths.a * turn[:, None, None], interaction=np.full((NUM, 1), kind, dtype=np.int32))


def total(power, paths: RadarPaths) -> float:
    return float(power(paths, RADAR, np.arange(NUM), np.zeros(NUM, dtype=np.int64), 1, 16)[0])


def test_of_rough_surfaces_it_is_the_mean_over_their_phases() -> None:
    one = total(mean_power, echo(DIFFUSE, 0))
    drawn = [total(band_power, echo(DIFFUSE, seed)) for seed in range(400)]
    assert total(mean_power, echo(DIFFUSE, 1)) == pytest.approx(one, rel=1e-12)
    assert np.mean(drawn) == pytest.approx(one, rel=4.0 / np.sqrt(len(drawn)))  # exponential: four sigma
    assert np.std(drawn) > 0.5 * one


def test_of_smooth_surfaces_it_is_the_power_of_the_sum() -> None:
    paths = echo(SPECULAR, 0)
    assert total(mean_power, paths) == pytest.approx(total(band_power, paths), rel=1e-12)
    assert total(mean_power, paths) != pytest.approx(total(mean_power, echo(SPECULAR, 1)), rel=0.1)
