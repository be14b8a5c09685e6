"""What an estimate reports: probability of the misfit, progress, measurements held out, other minima, the page."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.stats import chi2

from scarl_sionna.calibration import (
    CalibrationProblem,
    FreeParameter,
    SlabMeasurement,
    calibrate,
    save_materials,
    write_report,
)
from tests.unit.test_calibration import ANGLES, CONDUCTIVITY, PERMITTIVITY, bench, simulated


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


GLASS = [
    FreeParameter(name="glass.relative_permittivity", lower=5.0, upper=8.0),
    FreeParameter(name="glass.conductivity", lower=0.2, upper=4.0),
    FreeParameter(name="glass.thickness", lower=0.003, upper=0.008),
]
"""Every half wavelength of thickness has a minimum of its own."""


def pane(seed: int, **changes: object) -> CalibrationProblem:
    """Return a layer of 4.7 mm, its reflection and transmission at six angles and six frequencies to 0.3 dB."""
    frequencies, angles = (item.ravel().tolist() for item in np.meshgrid(np.linspace(76e9, 81e9, 6), ANGLES[1::3]))
    size = len(angles)
    bench = [
        SlabMeasurement(
            name=polarization + quantity,
            material="glass",
            polarization=polarization,
            quantity=quantity,
            frequency=frequencies,
            angle_deg=angles,
            noise=0.3,
            values=(-10.0,) * size,
        )
        for polarization in ("TE", "TM")
        for quantity in ("reflection", "transmission")
    ]
    start = {"parameters": GLASS, "measurements": bench, "seed": seed}
    return simulated(CalibrationProblem(**{**start, **changes}), [6.7, 1.6, 0.0047], seed)


def test_more_starts_are_tried_while_the_misfit_is_improbable() -> None:
    steps: list[tuple[int, int]] = []
    result = calibrate(pane(2), on_progress=lambda done, of: steps.append((done, of)))
    assert result.converged and result.p_value > 0.05
    assert result["glass.thickness"] == pytest.approx(0.0047, abs=2e-5)
    assert min(cost for _, cost in result.starts[:4]) > 1.2 * result.chi_square  # the first four miss it
    assert len(result.starts) == 8 and steps == [(1 + n, 4 if n < 4 else 8) for n in range(8)]


def test_two_starts_that_agree_do_not_end_the_search_of_an_improbable_misfit() -> None:
    close = pane(2, num_starts=2)
    close = close.with_(measurements=[item.with_(noise=0.1) for item in close.measurements])
    result = calibrate(close)
    first, second = (cost for _, cost in result.starts[:2])
    assert first == pytest.approx(second, rel=1e-6) and result.p_value < 1e-6
    assert len(result.starts) >= 5  # two that agree leave a share of 2 * 1 / (2 * 1) to others


def test_many_minima_and_an_improbable_misfit_are_not_converged(tmp_path: Path) -> None:
    close = pane(0, num_starts=2)
    result = calibrate(close.with_(measurements=[item.with_(noise=0.1) for item in close.measurements]))
    assert not result.converged and len(result.starts) == 16 and result.at_bound == []
    assert "16 searches ended in 6 minima" in result.reason and "raise num_starts" in result.reason
    assert "NOT CONVERGED: the misfit is improbable" in save_materials(result, tmp_path / "mine.toml").read_text()


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
