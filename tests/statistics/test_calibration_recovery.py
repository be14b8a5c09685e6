"""Three materials from noisy radar maps.

Intervals hold the truth as often as they say, errors are at the Cramer-Rao bound.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.stats import binom, chi2

from scarl_sionna.calibration import ForwardModel, calibrate
from tests.calibration_street import TRUTH, noisy, street, street_problem

NOISE = 5e-10
"""[sqrt(W)] of each part of a cell; the strongest cell has 5e-7."""


def recover(folder: Path, num_seeds: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return estimate minus truth, the stated standard deviations and the joint squared distances of many seeds."""
    model = ForwardModel(street_problem(street(folder), NOISE, max_depth=1))
    errors, stds, distances = [], [], []
    for seed in range(num_seeds):
        noisy(model, TRUTH, np.random.default_rng(seed))
        result = calibrate(model)
        assert result.converged, (seed, result.reason)
        error = result.values - TRUTH
        errors.append(error)
        stds.append(result.std)
        distances.append(error @ np.linalg.solve(result.covariance, error))
    return np.array(errors), np.array(stds), np.array(distances)


def bound(folder: Path) -> np.ndarray:
    """Return the Cramer-Rao bound of the standard deviations at the truth."""
    model = ForwardModel(street_problem(street(folder), NOISE, max_depth=1))
    jacobian = model.jacobian(TRUTH)
    return np.sqrt(np.diag(np.linalg.inv(jacobian.T @ jacobian)))


def test_eight_seeds(tmp_path: Path) -> None:
    errors, stds, distances = recover(tmp_path, 8)
    inside = np.count_nonzero(np.abs(errors) <= 1.96 * stds)
    assert inside >= binom.ppf(1e-4, errors.size, 0.95)  # 48 intervals of 95 %
    assert np.count_nonzero(distances <= chi2.ppf(0.95, 6)) >= binom.ppf(1e-4, 8, 0.95)
    assert chi2.ppf(1e-4, 48) <= distances.sum() <= chi2.ppf(1.0 - 1e-4, 48)  # neither too narrow nor too wide
    ratio = np.sqrt(np.mean((errors / bound(tmp_path)) ** 2))
    assert abs(ratio - 1.0) < 5.0 * np.sqrt(0.5 / errors.size)  # rms over 48 errors, 5 standard deviations of it


@pytest.mark.slow
def test_hundred_seeds(tmp_path: Path) -> None:
    errors, stds, distances = recover(tmp_path, 100)
    inside = np.abs(errors) <= 1.96 * stds
    ratio = np.sqrt(np.mean(errors**2, axis=0)) / bound(tmp_path)
    print("inside of 100:", inside.sum(axis=0), "joint:", np.count_nonzero(distances <= chi2.ppf(0.95, 6)))
    print("rms error over Cramer-Rao bound:", np.round(ratio, 3))
    assert inside.mean() >= 0.93
    assert np.all(inside.sum(axis=0) >= binom.ppf(1e-3, 100, 0.95))  # each of the six parameters
    assert np.count_nonzero(distances <= chi2.ppf(0.95, 6)) >= 93  # all six together
    np.testing.assert_allclose(ratio, 1.0, atol=0.2)  # three standard deviations of an rms over 100 errors are 0.21
