"""Derivatives of the calibration's models against finite differences, and the models against the simulator."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

from scarl_sionna.calibration import (
    CalibrationProblem,
    ForwardModel,
    FreeParameter,
    Lobe,
    LobedTarget,
    RcsPattern,
    ScenePowers,
    SlabMeasurement,
)
from scarl_sionna.calibration.physics import TrialMaterial, derivative
from scarl_sionna.calibration.scene_model import FixedPaths, pose_of
from scarl_sionna.radar.points import solve_points
from scarl_sionna.radar.synthesis import synthesize
from scarl_sionna.scene.materials.fresnel import power_reflectance
from scarl_sionna.scene.materials.table import builtin_materials
from scarl_sionna.signal.processing import range_doppler, virtual_cube
from tests.calibration_street import PARAMETERS, TRUTH, street, street_problem

ANGLES = tuple(np.linspace(0.0, 80.0, 9))
BOUNDS = {
    "relative_permittivity": (1.5, 8.0), "conductivity": (0.01, 5.0), "thickness": (2e-3, 6e-3),
    "roughness_rms": (1e-5, 5e-4),
    "scattering_coefficient": (0.05, 0.8), "xpd_coefficient": (0.05, 0.6), "permittivity_exponent": (-0.5, 0.5),
    "conductivity_exponent": (0.2, 1.8),
}  # fmt: skip # a table


def assert_slopes(model: ForwardModel, point: np.ndarray) -> None:
    """Central differences, step 1e-4 of the range: error of second order below 1e-4 of the largest slope."""
    for channel in model.channels:
        value, jacobian = model.predict_with_jacobian(channel, point)
        np.testing.assert_allclose(value, model.predict(channel, point), rtol=1e-12)
        for column, name in enumerate(model.names):
            step = np.zeros(len(point))
            step[column] = 1e-4 * model.span[column]
            numeric = model.predict(channel, point + step) - model.predict(channel, point - step)
            numeric /= 2.0 * step[column]
            rounding = 1e-9 * np.abs(value).max() / model.span[column]
            np.testing.assert_allclose(
                jacobian[:, column],
                numeric,
                rtol=1e-3,
                atol=1e-3 * np.abs(numeric).max() + rounding,
                err_msg=f"{channel.spec.name} {name}",
            )


@pytest.mark.parametrize(
    ("quantity", "form"),
    [
        (quantity, form)
        for quantity in ("reflection", "transmission", "backscatter", "cross_backscatter")
        for form in ("complex", "amplitude", "power", "power_db")
        if form != "complex" or not quantity.endswith("backscatter")
    ],
)
def test_slopes_of_a_bench(quantity: str, form: str) -> None:
    zeros = (0.0,) * len(ANGLES)
    specs = [
        SlabMeasurement(
            name=polarization,
            material="glass",
            quantity=quantity,
            polarization=polarization,
            angle_deg=ANGLES,
            values=zeros,
            frequency=79e9,
            form=form,
            noise=1.0,
            values_imag=zeros if form == "complex" else (),
        )
        for polarization in ("TE", "TM")
    ]
    free = tuple(FreeParameter(name=f"glass.{field}", lower=a, upper=b) for field, (a, b) in BOUNDS.items())
    free += (FreeParameter(name="TE.gain_db", lower=-3.0, upper=3.0),)
    model = ForwardModel(CalibrationProblem(parameters=free, measurements=specs))
    assert_slopes(model, model.lower + 0.43 * model.span)


def test_slopes_of_faint_scattering() -> None:
    """Where texture and heights scatter little or nothing: sigma0 goes with S^2 + 4 (k h)^2 there."""
    spec = SlabMeasurement(
        name="bench", material="concrete", quantity="backscatter", form="power", noise=1e-9, values=(0.0,)
    )
    free = [
        FreeParameter(name="concrete.roughness_rms", lower=0.0, upper=1e-3),
        FreeParameter(name="concrete.scattering_coefficient", lower=0.0, upper=0.9),
    ]
    model = ForwardModel(CalibrationProblem(parameters=free, measurements=[spec]))
    own = builtin_materials()["concrete"]
    level, k = (
        4.0 * power_reflectance(own, 77e9, 1.0)[0] * (1.0 - own.xpd_coefficient),
        2.0 * np.pi * 77e9 / 299792458.0,
    )
    for height, share in ((0.0, 0.0), (3e-7, 0.0), (1e-6, 1e-3), (0.0, 1e-4), (3e-7, 2e-3)):
        value, slopes = model.predict_with_jacobian(model.channels[0], np.array([height, share]))
        np.testing.assert_allclose(value, level * (share**2 + 4.0 * (k * height) ** 2), rtol=1e-4, atol=1e-15)
        np.testing.assert_allclose(
            slopes[0], level * np.array([8.0 * k**2 * height, 2.0 * share]), rtol=1e-4, atol=1e-9
        )


def test_slopes_of_a_target() -> None:
    target = LobedTarget(floor_dbsm=0.0, lobes={"side": Lobe(center_deg=90.0, width_deg=20.0, peak_dbsm=15.0)})
    free = [("floor_dbsm", -10, 10), ("side.center_deg", 80, 100), ("side.width_deg", 5, 40), ("side.peak_dbsm", 0, 30)]
    problem = CalibrationProblem(
        parameters=[FreeParameter(name=f"car.{name}", lower=a, upper=b) for name, a, b in free],
        targets={"car": target},
        measurements=[
            RcsPattern(name="cut", target="car", aspect_deg=tuple(range(-180, 180, 20)), values=(0.0,) * 18, noise=1.0)
        ],
    )
    model = ForwardModel(problem)
    assert_slopes(model, model.lower + 0.43 * model.span)


def test_derivative_of_a_known_function() -> None:
    value, slope = derivative(
        lambda p: np.array([np.exp(p[0]) * p[1] ** 2]), np.array([0.3, 2.0]), np.array([1.0, 5.0])
    )
    np.testing.assert_allclose(value, 4.0 * np.exp(0.3), rtol=1e-15)
    np.testing.assert_allclose(slope[0], [4.0 * np.exp(0.3), 4.0 * np.exp(0.3)], rtol=1e-11)


@pytest.fixture(scope="module")
def model(tmp_path_factory) -> ForwardModel:
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # the maps of single paths are no scene that is to be warned of
        return ForwardModel(street_problem(street(tmp_path_factory.mktemp("street")), 1e-9))


def test_slopes_of_a_radar_map(model: ForwardModel) -> None:
    assert_slopes(model, TRUTH)


def test_slopes_of_path_powers(model: ForwardModel) -> None:
    shared = {
        name: getattr(model.problem.measurements[0], name)
        for name in ("scene", "position", "targets", "max_depth", "num_samples")
    }
    fixed = FixedPaths.trace(model.problem.measurements[0], model.table, 77e9)
    lengths = tuple(np.unique(np.round(fixed.columns({})["total"], 1))[:12])
    powers = ScenePowers(
        name="powers", lengths=lengths, resolution=0.1, values=(-100.0,) * len(lengths), noise=0.5, **shared
    )
    assert_slopes(ForwardModel(CalibrationProblem(parameters=PARAMETERS, measurements=[powers])), TRUTH)


def test_fixed_geometry_gives_the_solvers_paths_and_map(model: ForwardModel) -> None:
    spec = model.problem.measurements[0]
    materials = [model.trial(TRUTH).materials[name] for name in ("asphalt", "concrete", "brick")]
    fixed = FixedPaths.trace(spec, model.table, spec.radar.center_frequency, spec.radar.wavelength)
    real = {
        item.base.name: item.base.with_(
            relative_permittivity=item.relative_permittivity.real, conductivity=item.conductivity.real
        )
        for item in materials
    }
    world = fixed.state.world
    before = world.materials
    world.materials = {**before, **real}
    try:
        paths = solve_points(
            fixed.state, spec.radar, pose_of(spec), fixed.points, num_samples=spec.num_samples, max_depth=2
        )
    finally:
        world.materials = before
    columns = fixed.columns({item.base.name: item for item in materials})
    np.testing.assert_allclose(columns["a"], paths.a, atol=1e-12 * np.abs(paths.a).max())
    whole = range_doppler(
        virtual_cube(synthesize(paths, spec.radar), spec.radar), spec.radar, window="rect"
    ).data.ravel()
    predicted = model.predict(model.channels[0], TRUTH)
    num = len(predicted) // 2
    # conjugate by convention; complex64 in both
    np.testing.assert_allclose(predicted[:num] - 1j * predicted[num:], whole, atol=3e-6 * np.abs(whole).max())


def test_trial_material_is_the_tables_own() -> None:
    for material in builtin_materials().values():
        frequency = sum(material.frequency_range) / 2.0
        assert TrialMaterial.of(material, {}).at(frequency) == pytest.approx(material.at(frequency), rel=1e-14)
