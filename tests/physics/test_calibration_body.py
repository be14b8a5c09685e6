"""Calibration against the RCS of meshes: tubes traced once give what a fresh trace gives, and derivatives are exact."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

import scarl_sionna as ss
from scarl_sionna.calibration import (
    CalibrationProblem,
    ForwardModel,
    FreeParameter,
    MeshRcs,
    UnusedParameterError,
    calibrate,
)
from scarl_sionna.core.errors import MeshError, ParameterRangeError
from scarl_sionna.radar.optics.body.parts import load_body
from scarl_sionna.radar.optics.far_field import scattering_matrices
from scarl_sionna.radar.optics.plane_waves import Looks
from scarl_sionna.radar.optics.replay import FixedTubes
from scarl_sionna.radar.optics.surfaces import PartSurfaces, Surface
from scarl_sionna.scene.materials.table import builtin_materials

FREQUENCY = 77e9
THETA = np.linspace(40.0, 80.0, 9)
PHI = np.linspace(20.0, 70.0, 9)


def corner(side: float = 0.04) -> trimesh.Trimesh:
    """A trihedral: up to three bounces."""
    points = side * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float)
    return trimesh.Trimesh(points, [[0, 1, 2], [0, 2, 3], [0, 3, 1]], process=False)


def looks(frequency: float = FREQUENCY) -> Looks:
    theta, phi = np.radians(THETA), np.radians(PHI)
    return Looks(np.full(9, frequency), theta, phi, theta, phi)


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("mesh") / "corner.ply"
    corner().export(path)
    return path


def test_kept_tubes_give_what_a_fresh_trace_gives() -> None:
    plate = trimesh.creation.box((0.03, 0.002, 0.03))
    plate.apply_translation((0.03, 0.03, 0.03))
    body = load_body([(corner(), "metal"), (plate, "glass")])
    tubes = FixedTubes.trace(body, looks())
    for permittivity in (3.0 - 0.1j, 9.0 - 4.0j):
        surfaces = PartSurfaces((Surface(permittivity, None, FREQUENCY), Surface(6.0 - 0.2j, 3e-3, FREQUENCY)))
        fresh = scattering_matrices(body, surfaces, looks())
        np.testing.assert_allclose(tubes.matrices(surfaces), fresh, atol=1e-12 * np.abs(fresh).max())


def test_kept_tubes_have_one_frequency() -> None:
    two = Looks(np.array([76e9, 77e9]), *(np.ones(2) for _ in range(4)))
    with pytest.raises(ParameterRangeError, match="frequency"):
        FixedTubes.trace(load_body(corner()), two)


def problem(file: Path, values: np.ndarray, **changes: object) -> CalibrationProblem:
    measurements = tuple(
        MeshRcs(
            name=name,
            mesh=str(file),
            material="concrete",
            theta_deg=tuple(THETA),
            phi_deg=tuple(PHI),
            polarization=name,
            values=tuple(values[row]),
            noise=0.05,
        )
        for row, name in enumerate(("VV", "HH"))
    )
    free = (
        FreeParameter(name="concrete.relative_permittivity", lower=2.0, upper=12.0, start=4.0),
        FreeParameter(name="concrete.conductivity", lower=0.0, upper=40.0, start=10.0),
    )
    return CalibrationProblem(**{"parameters": free, "measurements": measurements, "num_starts": 1, **changes})


def test_model_is_the_simulators_and_its_slopes_are_exact(file: Path) -> None:
    model = ForwardModel(problem(file, np.zeros((2, 9))))
    for channel, name in zip(model.channels, ("VV", "HH"), strict=True):
        level = 10.0 * np.log10(
            ss.rcs(str(file), FREQUENCY, np.radians(THETA), np.radians(PHI), name, builtin_materials()["concrete"])
        )
        own = np.array([getattr(builtin_materials()["concrete"], n.partition(".")[2]) for n in model.names])
        np.testing.assert_allclose(model.predict(channel, own), level, atol=1e-9)
        point = model.lower + 0.43 * model.span
        _, slopes = model.predict_with_jacobian(channel, point)
        for column in range(2):
            step = np.zeros(2)
            step[column] = 1e-4 * model.span[column]
            numeric = (model.predict(channel, point + step) - model.predict(channel, point - step)) / (2 * step[column])
            np.testing.assert_allclose(slopes[:, column], numeric, atol=1e-3 * np.abs(numeric).max())


def test_a_mesh_is_seen_along_x_in_vertical_polarisation_at_77_ghz_unless_said(tmp_path: Path) -> None:
    """Broadside to a plate across x: 4 pi (A / wavelength)^2, and the reflectivity of the material head-on."""
    path, side = tmp_path / "plate.ply", 0.05
    corners = 0.5 * side * np.array([[0, -1, -1], [0, 1, -1], [0, 1, 1], [0, -1, 1]], dtype=float)
    trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]], process=False).export(path)
    free = FreeParameter(name="plate.gain_db", lower=-3.0, upper=3.0)
    plate = MeshRcs(name="plate", mesh=str(path), material="metal", values=(0.0,), noise=1.0)
    model = ForwardModel(CalibrationProblem(parameters=(free,), measurements=(plate,)))
    found = model.predict(model.channels[0], np.zeros(1))
    wavelength = 299792458.0 / 77e9
    assert found == pytest.approx(10.0 * np.log10(4.0 * np.pi * (side**2 / wavelength) ** 2), abs=0.01)  # of a metal
    tilted = plate.with_(theta_deg=89.0)
    other = ForwardModel(CalibrationProblem(parameters=(free,), measurements=(tilted,)))
    assert other.predict(other.channels[0], np.zeros(1)) < found - 0.5


@pytest.mark.some(1)
@pytest.mark.parametrize("optimizer", ["least_squares", "adam"])
def test_recovers_a_dielectric_from_its_rcs(file: Path, optimizer: str) -> None:
    truth = np.array([5.5, 16.0])
    model = ForwardModel(problem(file, np.zeros((2, 9)), optimizer=optimizer))
    rng = np.random.default_rng(4)
    for channel in model.channels:
        clean = model.predict(channel, truth)
        channel.data[:] = clean + channel.sigma * rng.normal(size=clean.shape)
    result = calibrate(model)
    assert result.converged, result.reason
    assert np.all(np.abs(result.values - truth) < 4.0 * result.std)
    assert np.all(result.std < 0.2 * model.span)


def test_roughness_does_not_enter(file: Path) -> None:
    free = (FreeParameter(name="concrete.roughness_rms", lower=0.0, upper=1e-3),)
    with pytest.raises(UnusedParameterError):
        calibrate(problem(file, np.zeros((2, 9)), parameters=free))


def test_missing_mesh(tmp_path: Path) -> None:
    with pytest.raises(MeshError, match="no such file"):
        ForwardModel(problem(tmp_path / "none.ply", np.zeros((2, 9))))
