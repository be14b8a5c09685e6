"""Dr.Jit's derivatives through Sionna's PathSolver.

Against differences of the solver, and against our own in float64.
"""

from __future__ import annotations

import numpy as np
import pytest

from scarl_sionna.calibration.physics import TrialMaterial, derivative
from scarl_sionna.calibration.scene_model import FixedPaths
from scarl_sionna.core.errors import UnknownNameError
from scarl_sionna.core.settings.sionna import SionnaSettings
from scarl_sionna.engine.paths.slopes import TrialParameters, path_slopes
from scarl_sionna.radar.channel.multipath.images import material_coefficients, transfer
from tests.calibration_street import street, street_problem

SETTINGS = SionnaSettings(num_samples=20_000)
SOURCE = (0.0, 0.0, 1.0)
LOSSY = {"relative_permittivity": 5.6, "conductivity": 3.0, "scattering_coefficient": 0.3}
"""Waves do not come back from the far side of Sionna's slab of 10 cm."""


@pytest.fixture(scope="module")
def fixed(tmp_path_factory: pytest.TempPathFactory) -> FixedPaths:
    problem = street_problem(street(tmp_path_factory.mktemp("street")), 1e-9)
    from scarl_sionna.scene.materials.table import load_materials

    return FixedPaths.trace(problem.measurements[0], load_materials(), 77e9)


@pytest.mark.slow
@pytest.mark.parametrize("material", ["asphalt", "concrete", "brick"])
def test_against_differences_of_the_solver(fixed: FixedPaths, material: str) -> None:
    parameters = [(material, field) for field in LOSSY]
    values = np.array(list(LOSSY.values()))
    targets = fixed.points.positions
    found = path_slopes(fixed.state, SOURCE, targets, TrialParameters(parameters, values), SETTINGS)
    for index, value in enumerate(values):
        step = np.zeros(3)
        step[index] = 2e-2 * value  # rounding of float32 gains against changes of 1e-4 of them
        above, below = (
            path_slopes(
                fixed.state,
                SOURCE,
                targets,
                TrialParameters(parameters, values + sign * step),
                SETTINGS,
                with_slopes=False,
            ).a
            for sign in (1.0, -1.0)
        )
        numeric = (above - below) / (2.0 * step[index])
        assert np.abs(numeric).max() > 0.0
        np.testing.assert_allclose(found.slopes[..., index], numeric, atol=1e-3 * np.abs(numeric).max())


def test_against_our_own_in_float64(fixed: FixedPaths) -> None:
    """Half spaces of ours are Sionna's slabs where nothing comes back from the far side."""
    material = "concrete"
    names = ("relative_permittivity", "conductivity")
    values = np.array([LOSSY[name] for name in names])
    parameters = TrialParameters([(material, name) for name in names], values)
    theirs = path_slopes(fixed.state, SOURCE, fixed.points.positions, parameters, SETTINGS)
    base = fixed.state.world.materials[material].with_(
        reference_frequency=77e9, permittivity_exponent=0.0, conductivity_exponent=0.0
    )

    def legs(point: np.ndarray) -> np.ndarray:
        trial = TrialMaterial.of(base, dict(zip(names, point, strict=True)))
        materials = [trial.as_radio() if name == material else fixed.state.world.materials[name] for name in fixed.used]
        coefficients = material_coefficients(materials, fixed.index, fixed.frequency)
        return transfer(fixed.chain, fixed.travel, *fixed.bases, coefficients)[:, 0, 0]

    own, slopes = derivative(legs, values, np.ones(2))
    order = np.lexsort((fixed.legs.length, fixed.legs.target))
    np.testing.assert_allclose(theirs.length, fixed.legs.length[order], atol=1e-4)
    # the logarithmic slope of the magnitude does not depend on conventions of phase and spreading
    only = np.isin(fixed.index[order], [-1, fixed.used.index(material)]).all(axis=1)
    only &= (fixed.index[order] >= 0).any(axis=1)
    assert np.count_nonzero(only) >= 3
    ours = (slopes[order] / own[order, None]).real[only]
    engine = (theirs.slopes[:, 0, 0] / theirs.a[:, 0, 0, None]).real[only]
    assert np.all(np.abs(engine - ours) <= 1e-3 * np.abs(ours).max(axis=0))


def test_unknown_names(fixed: FixedPaths) -> None:
    with pytest.raises(UnknownNameError, match="gold"):
        path_slopes(fixed.state, SOURCE, fixed.points.positions, TrialParameters([("gold", "conductivity")]))
    with pytest.raises(UnknownNameError, match="colour"):
        path_slopes(fixed.state, SOURCE, fixed.points.positions, TrialParameters([("brick", "colour")]))
