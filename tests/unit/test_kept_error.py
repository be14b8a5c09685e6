"""The error that a share of objects keeps, against closed forms and draws."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.stats

from scarl_sionna.core.settings.auto import ErrorEstimate
from scarl_sionna.radar.channel.compose.expected_error import LEAST_DB, MOST_DB, kept_error

FIT = ErrorEstimate()


def odds(error: float, expected: float) -> float:
    """Return the probability of an error below one."""
    return float(1.0 / (1.0 + (FIT.median * expected / error) ** FIT.tail))


def test_of_one_object_it_is_the_quantile_of_its_error() -> None:
    found = kept_error([2.0], [], 0.9, FIT)
    assert odds(found, 2.0) == pytest.approx(FIT.confidence, rel=1e-3)


@pytest.mark.parametrize(("count", "allowed"), [(9, 0), (10, 1), (30, 3), (41, 4)])
def test_of_equal_objects_their_number_beyond_is_binomial(count: int, allowed: int) -> None:
    found = kept_error([1.0] * count, [], 0.9, FIT)
    misses = scipy.stats.binom(count, 1.0 - odds(found, 1.0))
    assert misses.cdf(allowed) == pytest.approx(FIT.confidence, abs=2e-3)


def test_of_different_objects_it_is_what_draws_keep() -> None:
    expected = np.array([0.1, 0.2, 0.2, 0.5, 1.0, 1.0, 2.0, 3.0, 4.0, 6.0, 8.0])
    found = kept_error(expected, [], 0.9, FIT)
    rng = np.random.default_rng(0)
    chance = rng.uniform(size=(40_000, len(expected)))
    drawn = FIT.median * expected * (chance / (1.0 - chance)) ** (1.0 / FIT.tail)
    kept = np.sort(drawn, axis=1)[:, int(np.ceil(0.9 * len(expected))) - 1] <= found
    assert kept.mean() == pytest.approx(FIT.confidence, abs=0.01)


def test_what_is_certain_counts_in_full() -> None:
    assert kept_error([1e-6] * 8, [5.0], 0.9, FIT) == pytest.approx(5.0, rel=2e-3)  # one of nine is too many
    assert kept_error([1e-6] * 18, [5.0, 5.0], 0.9, FIT) == LEAST_DB  # two of twenty are not
    assert kept_error([], [np.inf], 0.9, FIT) == MOST_DB
    assert kept_error([], [], 0.9, FIT) == 0.0
