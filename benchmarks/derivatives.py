"""Error and time of the derivatives that a calibration uses.

Cauchy's integral, differences, and Dr.Jit through PathSolver.

Run: python -m benchmarks.derivatives    (about half a minute; the tables stand in docs/calibration.md)
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path
from time import perf_counter, process_time
from typing import TypeVar

import numpy as np

from scarl_sionna.calibration import ForwardModel
from scarl_sionna.calibration.scene_model import FixedPaths
from scarl_sionna.core.settings.sbr import SbrSettings
from scarl_sionna.core.settings.sionna import SionnaSettings
from scarl_sionna.engine.paths.slopes import TrialParameters, path_slopes
from scarl_sionna.radar.optics.body.parts import load_body
from scarl_sionna.radar.optics.far_field import scattering_matrices
from scarl_sionna.radar.optics.replay import FixedTubes
from scarl_sionna.radar.optics.surfaces import PartSurfaces, Surface
from scarl_sionna.scene.materials.table import load_materials
from tests.calibration_street import TRUTH, street, street_problem
from tests.physics.test_calibration_body import corner, looks

T = TypeVar("T")


def timed(work: Callable[[], T], repeats: int = 3) -> tuple[T, str]:
    """Return a result and the least wall and CPU time [ms]."""
    times = []
    for _ in range(repeats):
        wall, cpu = perf_counter(), process_time()
        result = work()
        times.append((perf_counter() - wall, process_time() - cpu))
    wall, cpu = min(times)
    return result, f"{1e3 * wall:.1f} ({1e3 * cpu:.1f})"


def differences(function: Callable[[np.ndarray], np.ndarray], point: np.ndarray, steps: np.ndarray) -> np.ndarray:
    """Return central differences of fourth order."""
    columns = []
    for index, step in enumerate(steps):
        unit = np.zeros(len(point))
        unit[index] = step
        f = [function(point + factor * unit) for factor in (-2, -1, 1, 2)]
        columns.append((f[0] - 8.0 * f[1] + 8.0 * f[2] - f[3]) / (12.0 * step))
    return np.stack(columns, axis=-1)


def of_maps(folder: Path) -> None:
    """Print the errors of a radar map's derivatives, six parameters."""
    model = ForwardModel(street_problem(street(folder), 1e-9))
    channel = model.channels[0]
    (_, exact), cauchy = timed(lambda: model.predict_with_jacobian(channel, TRUTH))
    print("| radar map, 6 parameters | largest difference from Cauchy's integral | wall (CPU) [ms] |\n|---|---|---|")
    print(f"| Cauchy's integral, float64 | | {cauchy} |")
    for step in (1e-2, 1e-4, 1e-6, 1e-8):
        numeric, time = timed(
            lambda step=step: differences(lambda p: model.predict(channel, p), TRUTH, step * model.span)
        )
        error = np.abs(numeric - exact).max(axis=0) / np.abs(exact).max(axis=0)
        print(f"| central differences, 4th order, step {step:g} of the range | {error.max():.1e} | {time} |")


def of_paths(folder: Path) -> None:
    """Print the errors of Dr.Jit's derivatives of path gains, lossy walls."""
    problem = street_problem(street(folder), 1e-9)
    fixed = FixedPaths.trace(problem.measurements[0], load_materials(), 77e9)
    names = [(m, f) for m in ("asphalt", "concrete", "brick") for f in ("relative_permittivity", "conductivity")]
    values = np.array([3.6, 3.0, 5.6, 3.0, 4.2, 3.0])
    settings = SionnaSettings(num_samples=20_000)
    targets = fixed.points.positions

    def gains(point: np.ndarray) -> np.ndarray:
        trial = TrialParameters(names, point)
        return path_slopes(fixed.state, (0, 0, 1), targets, trial, settings, with_slopes=False).a

    found, time = timed(lambda: path_slopes(fixed.state, (0, 0, 1), targets, TrialParameters(names, values), settings))
    _, once = timed(lambda: gains(values))
    print("\n| path gains, 6 parameters | largest difference from Dr.Jit's | wall (CPU) [ms] |\n|---|---|---|")
    print(f"| Dr.Jit forward mode through PathSolver, float32, {len(found.a)} paths | | {time} |")
    for step in (1e-1, 3e-2, 1e-2, 1e-3, 1e-4):
        numeric = differences(gains, values, step * values)
        error = np.abs(numeric - found.slopes).max(axis=(0, 1, 2)) / np.abs(found.slopes).max(axis=(0, 1, 2))
        print(
            "| central differences of PathSolver, 4th order, "
            f"step {step:g} of the value | {error.max():.1e} | 24 x {once} |"
        )


def of_a_mesh() -> None:
    """Print time and error of kept tubes against a fresh trace."""
    body = load_body(corner())
    settings = SbrSettings().for_size(body.size * 77e9 / 299792458.0)
    surfaces = PartSurfaces((Surface(5.5 - 3.7j, None, 77e9),))
    fresh, whole = timed(lambda: scattering_matrices(body, surfaces, looks(), settings))
    tubes, trace = timed(lambda: FixedTubes.trace(body, looks(), settings))
    kept, again = timed(lambda: tubes.matrices(surfaces))
    print("\n| RCS of a trihedral, 9 aspects | wall (CPU) [ms] |\n|---|---|")
    print(
        f"| trace and fields (`ss.rcs`) | {whole} |\n| trace kept, "
        f"once | {trace} |\n| fields of another material | {again} |"
    )
    print(f"largest difference: {np.abs(kept - fresh).max() / np.abs(fresh).max():.1e}; {len(tubes.source)} tubes")


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as name:
        of_maps(Path(name))
        of_paths(Path(name))
    of_a_mesh()
