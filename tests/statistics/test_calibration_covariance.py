"""Stated covariances against those of linear problems, which have a closed form."""

from __future__ import annotations

import numpy as np
import pytest

from scarl_sionna.calibration import CalibrationProblem, FreeParameter, SlabMeasurement, calibrate

NOISE = np.linspace(0.1, 0.8, 16)
"""[dB]"""


def bench(name: str, noise: np.ndarray = NOISE, seed: int = 0) -> SlabMeasurement:
    """Return a measurement in decibels, in which the gain of the instrument is linear."""
    values = -10.0 + noise * np.random.default_rng(seed).normal(size=noise.size)
    return SlabMeasurement(
        name=name,
        material="asphalt",
        angle_deg=tuple(np.linspace(0.0, 60.0, noise.size)),
        values=tuple(values),
        noise=tuple(noise),
    )


def gain(name: str, **changes: float) -> FreeParameter:
    return FreeParameter(name=f"{name}.gain_db", lower=-40.0, upper=40.0, **changes)


def test_a_gain_has_the_variance_of_a_weighted_mean() -> None:
    result = calibrate(CalibrationProblem(parameters=[gain("bench")], measurements=[bench("bench")], num_starts=1))
    variance = 1.0 / np.sum(NOISE**-2.0)
    # Derivatives by Cauchy's integral of a linear function: rounding, 1e-11 of the range of 80 dB
    assert result.covariance == pytest.approx(variance, rel=1e-8)
    assert result.std == pytest.approx(np.sqrt(variance), rel=1e-8)
    assert np.ptp(result.interval) == pytest.approx(2.0 * 1.959963985 * np.sqrt(variance), rel=1e-8)


def test_a_prior_adds_its_information() -> None:
    known = gain("bench", prior_mean=0.0, prior_std=0.05)
    result = calibrate(CalibrationProblem(parameters=[known], measurements=[bench("bench")], num_starts=1))
    assert result.covariance == pytest.approx(1.0 / (np.sum(NOISE**-2.0) + 0.05**-2.0), rel=1e-8)


def test_gains_of_two_benches_are_independent_and_more_values_narrow_them() -> None:
    wide = np.tile(NOISE, 4)
    problem = CalibrationProblem(
        parameters=[gain("first"), gain("second")],
        measurements=[bench("first"), bench("second", wide, 1)],
        num_starts=1,
    )
    result = calibrate(problem)
    variance = 1.0 / np.sum(NOISE**-2.0)
    assert result.covariance == pytest.approx(np.diag([variance, variance / 4.0]), rel=1e-8, abs=1e-12)
