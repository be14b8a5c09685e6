"""What an estimate reports: probability of the misfit, progress, measurements held out, other minima, the page."""

from __future__ import annotations

from pathlib import Path

import pytest
from scipy.stats import chi2

from scarl_sionna.calibration import CalibrationProblem, calibrate, write_report
from tests.unit.test_calibration import CONDUCTIVITY, PERMITTIVITY, bench, simulated


def test_probability_of_the_misfit_and_progress() -> None:
    problem = simulated(CalibrationProblem(parameters=[PERMITTIVITY], measurements=[bench()], num_starts=3), [6.0])
    steps: list[tuple[int, int]] = []
    result = calibrate(problem, on_progress=lambda done, of: steps.append((done, of)))
    assert steps == [(1, 3), (2, 3), (3, 3)]
    assert result.degrees_of_freedom == 15  # 16 values, one parameter
    assert result.p_value == pytest.approx(chi2.sf(result.chi_square, 15), rel=1e-12) and 0.001 < result.p_value < 0.999


def test_a_prior_that_the_data_contradict_is_a_misfit() -> None:
    one = CalibrationProblem(parameters=[PERMITTIVITY], measurements=[bench(angle_deg=30.0, values=(-9.0,), noise=0.1)])
    true = 5.0
    told = {mean: PERMITTIVITY.with_(prior_mean=mean, prior_std=0.05) for mean in (true, 8.8)}
    fits = {mean: calibrate(simulated(one.with_(parameters=[item]), [true])) for mean, item in told.items()}
    for mean, fit in fits.items():
        assert fit.degrees_of_freedom == 1  # a value and a prior, one parameter
        left = fit.model.residuals(fit.values)
        assert len(left) == 2 and fit.chi_square == pytest.approx(left @ left, rel=1e-12), mean
    assert fits[true].p_value > 0.001 and fits[true].misfit < 4.0
    assert fits[8.8].p_value < 1e-30 and fits[8.8].misfit > 10.0


def test_what_is_held_out_does_not_move_the_estimate() -> None:
    fitted = simulated(CalibrationProblem(parameters=[PERMITTIVITY], measurements=[bench()]), [6.0])
    wrong = bench("wrong", polarization="TM", values=(-40.0,) * 16, held_out=True)
    both = fitted.with_(measurements=[*fitted.measurements, wrong])
    alone, beside = calibrate(fitted), calibrate(both)
    assert beside.values == pytest.approx(alone.values, rel=1e-12)
    used = calibrate(both.with_(measurements=[*fitted.measurements, wrong.with_(held_out=False)]))
    assert abs(used.values[0] - alone.values[0]) > 0.1


def test_the_page_says_that_all_is_identified_only_where_it_is(tmp_path: Path) -> None:
    sure = calibrate(simulated(CalibrationProblem(parameters=[PERMITTIVITY], measurements=[bench()]), [6.0]))
    pair = CalibrationProblem(parameters=[PERMITTIVITY, CONDUCTIVITY], measurements=[bench(angle_deg=30.0)])
    vague = calibrate(simulated(pair, [6.0, 3.0]))
    assert vague.weak or vague.correlated
    for result, is_sure in ((sure, True), (vague, False)):
        text = write_report(result, tmp_path / f"{is_sure}.html").read_text()
        assert ("All parameters are identified" in text) == is_sure
