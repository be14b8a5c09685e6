"""Fresnel and layer reflection: exact values, Brewster angle, energy and polarisation."""

from __future__ import annotations

import numpy as np
import pytest

from scarl_sionna.scene.materials.fresnel import (
    halfspace_reflection,
    layer_reflection,
    power_reflectance,
    te_fraction_of_h,
)
from scarl_sionna.scene.materials.table import load_materials
from tests.oracles import fresnel as oracle

# The tabulated values carry 13 digits; the evaluation is a handful of double-precision operations.
EXACT = 1e-12


@pytest.mark.parametrize("permittivity", oracle.HALFSPACE)
def test_half_space_matches_the_exact_values(permittivity: complex) -> None:
    te, tm = halfspace_reflection(permittivity, np.cos(np.radians(oracle.INCIDENCE_DEG)))
    expected = oracle.HALFSPACE[permittivity]
    assert np.abs(te - [complex(*value) for value in expected["te"]]).max() < EXACT
    assert np.abs(tm - [complex(*value) for value in expected["tm"]]).max() < EXACT


@pytest.mark.parametrize(("permittivity", "thickness", "incidence_deg", "te", "tm"), oracle.LAYERS)
def test_layer_matches_the_exact_values(permittivity, thickness, incidence_deg, te, tm) -> None:
    found = layer_reflection(permittivity, np.cos(np.radians(incidence_deg)), thickness, oracle.FREQUENCY)
    # The values were made with a permittivity rounded to 13 digits; the layer's phase multiplies that by up to 3e3 rad.
    assert abs(found[0] - complex(*te)) < 1e-9 and abs(found[1] - complex(*tm)) < 1e-9


@pytest.mark.parametrize("permittivity", oracle.PSEUDO_BREWSTER_DEG)
def test_vertical_reflection_is_smallest_at_the_pseudo_brewster_angle(permittivity: complex) -> None:
    step_deg = 1e-3
    angles = np.arange(40.0, 80.0, step_deg)
    _, tm = halfspace_reflection(permittivity, np.cos(np.radians(angles)))
    # A search on a grid is right to half its step (the minimum is flat: 1e-3 deg changes abs(tm) by 1e-10 of double's
    # 1e-16).
    assert angles[np.argmin(np.abs(tm))] == pytest.approx(oracle.PSEUDO_BREWSTER_DEG[permittivity], abs=step_deg / 2)


def test_lossless_brewster_angle_reflects_nothing() -> None:
    permittivity = 4.0
    _, tm = halfspace_reflection(permittivity, np.cos(np.arctan(np.sqrt(permittivity))))
    assert abs(tm) < 1e-15  # tan(theta_B) = n; rounding of one subtraction of numbers near 1.8


def test_half_wave_layer_without_losses_is_transparent() -> None:
    permittivity, wavelength = 2.6, oracle.SPEED_OF_LIGHT / oracle.FREQUENCY
    te, tm = layer_reflection(permittivity, 1.0, wavelength / (2 * np.sqrt(permittivity)), oracle.FREQUENCY)
    # |1 - e^{-2jq}| for q = pi in double precision: a few times 2 pi * 1.1e-16.
    assert abs(te) < 5e-15 and abs(tm) < 5e-15


def test_thin_layer_vanishes_and_thick_lossy_layer_is_a_half_space() -> None:
    cosine = np.cos(np.radians(np.arange(0.0, 89.0, 5.0)))
    te, tm = layer_reflection(oracle.ITU_GLASS, cosine, 1e-12, oracle.FREQUENCY)
    assert max(np.abs(te).max(), np.abs(tm).max()) < 1e-6  # first order: k d (eps - 1) / (2 cos) = 5e-7 at 85 deg
    thick = layer_reflection(oracle.ITU_CONCRETE, cosine, 1.0, oracle.FREQUENCY)
    half = halfspace_reflection(oracle.ITU_CONCRETE, cosine)
    # e^{-2 k d Im q} for 1 m of concrete is below 1e-90.
    assert np.abs(np.array(thick) - np.array(half)).max() < 1e-14


def test_reflectance_of_every_material_is_between_nothing_and_all() -> None:
    cosine = np.cos(np.linspace(0.0, np.pi / 2, 2001))
    for name, material in load_materials().items():
        if name == "vacuum":
            continue  # reflects nothing at any angle
        for reflectance in power_reflectance(material, 77e9, cosine):
            assert np.isfinite(reflectance).all(), name
            assert reflectance.min() >= 0.0 and reflectance.max() <= 1.0 + 1e-12, name
            assert reflectance[-1] == pytest.approx(1.0, abs=1e-9), name  # grazing: everything is reflected


def test_layers_without_losses_keep_energy() -> None:
    # |R|^2 + |T|^2 = 1 with T of the same recommendation, computed here from its own formula.
    permittivity, thickness, angles = 3.0, 2.3e-3, np.radians(np.arange(0.0, 89.0, 1.0))
    cosine = np.cos(angles)
    found = layer_reflection(permittivity, cosine, thickness, oracle.FREQUENCY)
    phase = (
        2 * np.pi * thickness * oracle.FREQUENCY / oracle.SPEED_OF_LIGHT * np.sqrt(permittivity - np.sin(angles) ** 2)
    )
    for gamma, reflected in zip(halfspace_reflection(permittivity, cosine), found, strict=True):
        transmitted = (1 - gamma**2) * np.exp(-1j * phase) / (1 - gamma**2 * np.exp(-2j * phase))
        assert np.abs(np.abs(reflected) ** 2 + np.abs(transmitted) ** 2 - 1.0).max() < 1e-12


def test_metal_loses_what_its_surface_resistance_takes() -> None:
    # 1 - R = 4 Rs / eta0 at normal incidence, Rs = sqrt(pi f mu0 / sigma): 0.008047 dB for 1e7 S/m; next order
    # (Rs/eta0)^2.
    te, tm = power_reflectance(load_materials()["metal"], 77e9, 1.0)
    loss_db = -10 * np.log10([te, tm])
    assert loss_db == pytest.approx(0.008047, abs=1e-5)


def _split(rays: np.ndarray, normals: np.ndarray) -> np.ndarray:
    cosine = -np.einsum("ij,ij->i", rays, normals)
    towards = np.where(cosine < 0, -1.0, 1.0)
    return te_fraction_of_h(rays[:, 2], np.abs(cosine), towards * normals[:, 2])


def test_ground_and_wall_split_the_polarisations_as_they_must() -> None:
    # Level ray, wall with a level normal at 45 deg: V lies in the wall, so V is TE and H is TM.
    ray = np.array([[1.0, 0.0, 0.0]])
    assert _split(ray, np.array([[-1.0, 1.0, 0.0]]) / np.sqrt(2)) == pytest.approx([0.0], abs=1e-15)
    # Ray down on level ground: H is TE, V is TM.
    down = np.array([[np.cos(0.1), 0.0, -np.sin(0.1)]])
    assert _split(down, np.array([[0.0, 0.0, 1.0]])) == pytest.approx([1.0], abs=1e-15)
    # A plane tilted by 45 deg about the ray: half and half.
    assert _split(ray, np.array([[-1.0, 1.0, 1.0]]) / np.sqrt(3)) == pytest.approx([0.5], abs=1e-15)


def test_polarisation_split_agrees_with_the_vectors() -> None:
    generator = np.random.default_rng(1)
    rays, normals = generator.normal(size=(2, 500, 3))
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    perpendicular = np.cross(rays, normals)
    perpendicular /= np.linalg.norm(perpendicular, axis=1, keepdims=True)
    phi_hat = np.stack([-rays[:, 1], rays[:, 0], np.zeros(500)], axis=1)
    phi_hat /= np.linalg.norm(phi_hat, axis=1, keepdims=True)
    expected = np.einsum("ij,ij->i", perpendicular, phi_hat) ** 2
    # Both divide by sine**2 and rho**2, at least 1e-4 over these draws: rounding of 1e-16 / 1e-4.
    assert _split(rays, normals) == pytest.approx(expected, abs=1e-11)
