"""Tables and figures of docs/calibration.md: the measured studies, and the recovery of three materials from noisy maps.

Run: python -m benchmarks.calibration [--seeds 100]    (under a minute; writes docs/figures/calibration_*.png)
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from scipy.stats import chi2

from scarl_sionna.calibration import CalibrationProblem, CalibrationResult, ForwardModel, calibrate
from tests.calibration_street import TRUTH, noisy, street, street_problem
from tests.statistics.test_calibration_recovery import NOISE

REPO = Path(__file__).resolve().parents[1]
FIGURES = REPO / "docs" / "figures"
STUDIES = ("rexolite", "car_rcs", "drywall")


def studies() -> dict[str, CalibrationResult]:
    print("| study | measurement | values | rms before | rms after | noise |\n|---|---|---|---|---|---|")
    results = {}
    for name in STUDIES:
        result = results[name] = calibrate(CalibrationProblem.load(REPO / "examples" / f"calibration_{name}.yaml"))
        for item in result.model.channels:
            kind = "held out: " if item.spec.held_out else ""
            before, after = result.rms(item, result.model.start), result.rms(item)
            noise = float(np.sqrt(np.mean(item.sigma**2)))
            print(f"| {name} | {kind}{item.spec.name} | {len(item.data)} | {before:.3g} | {after:.3g} | {noise:.2g} |")
    print("\n| parameter | before | estimate | 95 % | outcome |\n|---|---|---|---|---|")
    for name, result in results.items():
        state = "converged" if result.converged else "not converged"
        for key, value, (low, high), start in zip(
            result.names, result.values, result.interval, result.model.start, strict=True
        ):
            print(f"| {key} | {start:.4g} | {value:.4g} | {low:.4g} to {high:.4g} | {name}: {state} |")
    return results


def draw(results: dict[str, CalibrationResult]) -> None:
    for name, chosen, unit, axis in (
        ("rexolite", (0, 1, 2, 3), "amplitude", "frequency [GHz]"),
        ("car_rcs", (0, 1, 2, 3), "RCS [dBsm]", "aspect [deg]"),
    ):
        result = results[name]
        figure = Figure(figsize=(10.0, 6.0), layout="constrained")
        for axes, index in zip(figure.subplots(2, 2).ravel(), chosen, strict=True):
            item = result.model.channels[index]
            spec = item.spec
            along = np.array(spec.aspect_deg) if name == "car_rcs" else np.array(spec.frequency) / 1e9
            axes.errorbar(along, item.data, 1.96 * item.sigma, fmt="k.", ms=4, lw=0.8, label="measured, 95 %")
            axes.plot(along, result.model.predict(item, result.model.start), color="tab:orange", label="before")
            axes.plot(along, result.model.predict(item, result.values), color="tab:blue", label="after")
            axes.set(title=spec.name + (" (held out)" if spec.held_out else ""), xlabel=axis, ylabel=unit)
        handles = figure.axes[0].get_legend_handles_labels()
        figure.legend(*handles, loc="outside upper center", ncols=3)
        figure.savefig(FIGURES / f"calibration_{name}.png", dpi=90)


def recovery(num_seeds: int) -> None:
    with tempfile.TemporaryDirectory() as folder:
        model = ForwardModel(street_problem(street(Path(folder)), NOISE, max_depth=1))
    jacobian = model.jacobian(TRUTH)
    bound = np.sqrt(np.diag(np.linalg.inv(jacobian.T @ jacobian)))
    errors, inside, joint = [], [], 0
    wall, cpu = time.perf_counter(), time.process_time()
    for seed in range(num_seeds):
        noisy(model, TRUTH, np.random.default_rng(seed))
        result = calibrate(model)
        error = result.values - TRUTH
        errors.append(error / bound)
        inside.append(np.abs(error) <= 1.96 * result.std)
        joint += error @ np.linalg.solve(result.covariance, error) <= chi2.ppf(0.95, len(error))
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    ratio = np.sqrt(np.mean(np.square(errors), axis=0))
    print(f"\n{num_seeds} seeds, {wall / num_seeds:.2f} s ({cpu / num_seeds:.2f} CPU s) each\n")
    print("| parameter | truth | Cramer-Rao std | rms error / bound | inside 95 % |\n|---|---|---|---|---|")
    for name, truth, least, value, count in zip(model.names, TRUTH, bound, ratio, np.sum(inside, axis=0), strict=True):
        print(f"| {name} | {truth:g} | {least:.2g} | {value:.2f} | {count} of {num_seeds} |")
    print(
        f"| all six together | | | {np.sqrt(np.mean(np.square(errors))):.2f} | {joint} of {num_seeds} (joint region) |"
    )
    figure = Figure(figsize=(8.0, 3.6), layout="constrained")
    axes = figure.subplots()
    axes.violinplot(np.array(errors), showextrema=False)
    axes.plot(1.0 + np.tile(np.arange(len(TRUTH)), (num_seeds, 1)), errors, "k.", ms=2)
    axes.set_xticks(1 + np.arange(len(TRUTH)), [name.replace(".", "\n") for name in model.names], fontsize=7)
    for level in (-1.96, 1.96):
        axes.axhline(level, color="tab:red", lw=0.8)
    axes.set_ylabel("error / Cramer-Rao bound")
    figure.savefig(FIGURES / "calibration_recovery.png", dpi=90)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=100)
    chosen = parser.parse_args()
    draw(studies())
    recovery(chosen.seeds)
