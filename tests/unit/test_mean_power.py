"""The power of an echo over the band and over what rough surfaces may be."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.radar.channel.band_mean import band_power, mean_over_band, mean_power
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


def test_it_is_that_of_what_the_antennas_hear() -> None:
    """H hears HH; V that sends and H that hears VH by both senses; receivers of V and of H the mean of their powers."""
    a = np.array([[0.5, 0.2j], [0.1, -0.8]])
    paths = replace(echo(False, 0), a=np.tile(a, (NUM, 1, 1)))
    h, v = (ss.AntennaElement(polarization=name) for name in "HV")
    array, most = RADAR.array, NUM**2 * mean_over_band_weight()
    for changes, expected in (
        ({}, 0.25),
        ({"polarization": "H"}, 0.64),
        ({"rx_elements": (h,)}, abs(0.05 + 0.1j) ** 2),
        ({"rx_elements": (v, v, h, h)}, (0.25 + abs(0.05 + 0.1j) ** 2) / 2.0),
    ):
        radar = RADAR.with_(array=array.with_(**changes))
        found = mean_power(paths, radar, np.arange(NUM), np.zeros(NUM, dtype=np.int64), 1, 16)[0]
        assert found == pytest.approx(most * expected, rel=1e-9), changes
    apart = replace(paths, world_from_rx=ss.Pose([0.0, 1.0, 0.0]))  # another radar hears one sense alone
    radar = RADAR.with_(array=array.with_(rx_elements=(h,)))
    found = mean_power(apart, radar, np.arange(NUM), np.zeros(NUM, dtype=np.int64), 1, 16)[0]
    assert found == pytest.approx(most * 0.1**2, rel=1e-9)


def mean_over_band_weight() -> float:
    """Return the sum of the weights over the band."""
    one = np.zeros(1, dtype=np.int64)
    return float(mean_over_band(np.ones(1, dtype=np.complex128), np.ones(1), one, RADAR, 16)[0])
