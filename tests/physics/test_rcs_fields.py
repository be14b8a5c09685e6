"""ss.rcs: dielectrics, reciprocity, bistatic laws, and the phase of the scattering matrix."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

import scarl_sionna as ss
from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.radar.rcs import scattering_matrix
from scarl_sionna.scene.materials.table import RadioMaterial, builtin_materials
from tests.oracles import fresnel
from tests.oracles import rcs as oracle

F77 = 77e9
K77 = 2 * np.pi / oracle.WAVELENGTH_77
PLATE = trimesh.Trimesh(0.1 * np.array(oracle.PLATE_MESH[0]), oracle.PLATE_MESH[1], process=False)
CORNER = trimesh.Trimesh(0.05 * np.array(oracle.TRIHEDRAL_MESH[0]), oracle.TRIHEDRAL_MESH[1], process=False)


def mirror_ratio_db(material, incidence, polarization):
    """Return the level of a plate's mirror reflection against a metal plate's [dB]."""
    angles = (incidence, 0.0)
    levels = [ss.rcs(PLATE, F77, *angles, polarization, m, incidence, np.pi) for m in (material, "metal")]
    return 10 * np.log10(levels[0] / levels[1])


@pytest.mark.parametrize("permittivity", list(fresnel.HALFSPACE), ids=str)
def test_halfspace_level(permittivity):
    """In the mirror direction the level is Fresnel's, both polarisations: exact up to the oracle's 12 digits.

    The field incident on the surface radiates nothing there; at 89 deg the difference of two nearly equal terms costs
    digits.
    """
    incidence = np.deg2rad(fresnel.INCIDENCE_DEG[:-1])
    for polarization, kind in (("HH", "te"), ("VV", "tm")):
        exact = np.array([abs(complex(*value)) for value in fresnel.HALFSPACE[permittivity][kind]][:-1])
        found = mirror_ratio_db(permittivity, incidence, polarization)
        assert np.abs(found - 20 * np.log10(exact)).max() < 1e-4


@pytest.mark.parametrize("name", ["glass", "car_glass", "plastic", "asphalt"])
def test_table_materials(name):
    """A material with a thickness reflects as a layer, without as a half space; head-on V and H agree."""
    entry = builtin_materials()[name]
    root = np.sqrt(entry.at(F77))
    gamma = (1 - root) / (1 + root)
    if entry.thickness is not None:
        round_trip = np.exp(-2j * K77 * entry.thickness * root)
        gamma = gamma * (1 - round_trip) / (1 - gamma**2 * round_trip)
    for polarization in ("VV", "HH"):
        assert mirror_ratio_db(name, 0.0, polarization) == pytest.approx(20 * np.log10(abs(gamma)), abs=1e-6)


def test_brewster_angle():
    """The V-polarised mirror reflection of a lossless half space vanishes at atan(sqrt(eps)), within 0.5 deg (bar).

    On a grid of 0.05 deg the minimum is within half a step.
    """
    incidence = np.deg2rad(np.arange(50.0, 75.0, 0.05))
    level = mirror_ratio_db(3.18, incidence, "VV")
    assert np.rad2deg(incidence[level.argmin()]) == pytest.approx(np.rad2deg(np.arctan(np.sqrt(3.18))), abs=0.03)
    assert level.min() < -50.0


@pytest.mark.parametrize("name", ["glass", "car_glass", "plastic", "asphalt"])
def test_table_materials_against_angle(name):
    """Layers and half spaces of the table from 0 to 85 deg, both polarisations.

    Within 0.1 dB (bar) of Fresnel and slab formulas.

    Against an independent formula of the layer; measured below 1e-6 dB outside of the nulls.
    """
    entry = builtin_materials()[name]
    incidence = np.deg2rad(np.arange(0.0, 86.0, 5.0))
    exact = np.array([fresnel.reflection(entry.at(F77), float(angle), entry.thickness) for angle in incidence])
    for column, polarization in enumerate(("HH", "VV")):
        wanted = 20 * np.log10(np.abs(exact[:, column]))
        strong = wanted > -40.0
        assert np.abs(mirror_ratio_db(name, incidence, polarization) - wanted)[strong].max() < 0.1


@pytest.mark.parametrize("name", ["glass", "asphalt", "plastic"])
def test_brewster_angle_of_materials(name):
    """The V-polarised minimum of a half space of each material is at its pseudo-Brewster angle within 0.5 deg (bar).

    For small losses that is atan(sqrt(eps')); a layer with its thickness has a minimum there as well.
    """
    entry = builtin_materials()[name]
    permittivity = entry.at(F77)
    brewster = np.rad2deg(np.arctan(np.sqrt(permittivity.real)))
    grid = np.arange(brewster - 4.0, brewster + 4.0, 0.05)
    level = mirror_ratio_db(permittivity, np.deg2rad(grid), "VV")
    assert grid[level.argmin()] == pytest.approx(brewster, abs=0.5)
    exact = [abs(fresnel.reflection(permittivity, float(np.deg2rad(angle)))[1]) for angle in grid]
    assert grid[level.argmin()] == pytest.approx(grid[int(np.argmin(exact))], abs=0.06)
    if entry.thickness is not None:
        layer = mirror_ratio_db(name, np.deg2rad(grid), "VV")
        assert grid[layer.argmin()] == pytest.approx(brewster, abs=0.5)


def test_corner_of_dielectric_is_weaker():
    """On the axis of a corner each of three reflections has the same incidence.

    54.7 deg, as a sequence of TE/TM mixtures.

    So the level lies between those of three pure TE and of three pure TM reflections, within 1 dB for the faces' own
    echoes.
    """
    boresight = (np.arccos(1 / np.sqrt(3)), np.pi / 4)
    eps = 6.31 - 0.283j
    cosine = np.sqrt(1 / 3)
    q = np.sqrt(eps - 2 / 3)
    te, tm = abs((cosine - q) / (cosine + q)), abs((eps * cosine - q) / (eps * cosine + q))
    ratio = 10 * np.log10(ss.rcs(CORNER, F77, *boresight, "VV", eps) / ss.rcs(CORNER, F77, *boresight))
    assert 60 * np.log10(tm) - 1.0 < ratio < 60 * np.log10(te) + 1.0


def test_sweep_uses_each_frequency_of_a_dispersive_layer():
    """A frequency sweep gives the same as one call a frequency."""
    layer = RadioMaterial(
        name="slab", relative_permittivity=4.0, conductivity=0.1, thickness=3e-3, source="t", uncertainty="t"
    )
    frequency = np.array([76e9, 78e9, 81e9])
    sweep = ss.rcs(PLATE, frequency, 0.1, 0.0, material=layer)
    single = [ss.rcs(PLATE, f, 0.1, 0.0, material=layer) for f in frequency]
    assert np.allclose(sweep, single, rtol=1e-12)
    assert np.ptp(10 * np.log10(sweep)) > 1.0


def test_phase_of_a_moved_plate():
    """Moved by d, S turns by exp(2 j k d . r_hat): path length, e^{+jwt}. Head-on S = -j a b / lambda at the origin."""
    matrix = scattering_matrix(PLATE, F77, 0.0, 0.0)
    assert matrix[0, 0] == pytest.approx(-1j * 0.01 / oracle.WAVELENGTH_77, rel=1e-9)
    assert matrix[1, 1] == pytest.approx(matrix[0, 0])
    shift = np.array([0.3, -0.2, 0.1])
    theta, phi = 0.4, 0.7
    ahead = shift @ [np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)]
    moved = PLATE.copy().apply_translation(shift)
    ratio = scattering_matrix(moved, F77, theta, phi)[0, 0] / scattering_matrix(PLATE, F77, theta, phi)[0, 0]
    assert ratio == pytest.approx(np.exp(2j * K77 * ahead), abs=1e-7)


def test_translation_leaves_corner():
    """A corner 1 km away from the origin has the same RCS: rays are traced about the mesh's centre (phase eps 1e-9)."""
    angles = (0.9, 0.8)
    near, far = (ss.rcs(mesh, F77, *angles) for mesh in (CORNER, CORNER.copy().apply_translation([1e3, -5e2, 2e2])))
    # the vertices' own rounding, 1e-13 m of 1 km, and edges found to 2^-11 of a quarter wavelength with other rays
    assert 10 * np.log10(far / near) == pytest.approx(0.0, abs=0.01)


def test_reciprocity_monostatic():
    """Monostatic cross-polar terms are equal but for sign conventions: S_vh = S_hv in the backscatter alignment.

    Ray methods keep this only as well as their tubes do: measured 3e-4 of the co-polar field off the axis of a corner.
    """
    matrix = scattering_matrix(CORNER, F77, np.array([0.7, 0.9, 1.0]), np.array([0.6, 0.9, 1.1]))
    difference = np.abs(matrix[:, 0, 1] - matrix[:, 1, 0])
    assert np.all(difference < 2e-3 * np.abs(matrix).max(axis=(1, 2)))


def test_bistatic_plate_pattern():
    """In the plane of incidence a plate's pattern is sinc about the mirror direction.

    (cos i for HH) x sinc(k a (sin i - sin s) / 2).
    """
    incidence, a = np.deg2rad(30.0), 0.1
    scattered = np.deg2rad(np.linspace(20.0, 40.0, 81))
    found = ss.rcs(PLATE, F77, incidence, 0.0, "HH", "metal", scattered, np.pi)
    pattern = oracle.sinc(K77 * a / 2 * (np.sin(incidence) - np.sin(scattered)))
    exact = 4 * np.pi * (a * a / oracle.WAVELENGTH_77 * np.cos(incidence) * pattern) ** 2
    assert np.allclose(found, exact, rtol=1e-9, atol=1e-9 * exact.max())


def test_forward_scattering_is_the_shadow():
    """Behind a sphere the RCS is 4 pi A^2 / lambda^2 with the shadow's area A.

    That of the inscribed mesh is 0.1 % smaller.
    """
    sphere = trimesh.creation.icosphere(subdivisions=4, radius=0.1)
    found = ss.rcs(sphere, F77, 0.5, 0.0, "VV", "metal", np.pi - 0.5, np.pi)
    exact = 4 * np.pi * (np.pi * 0.01) ** 2 / oracle.WAVELENGTH_77**2
    assert 10 * np.log10(found / exact) == pytest.approx(0.0, abs=0.02)


def test_shadow_of_another_body_and_of_the_observer():
    """A screen before a plate hides it: from the source, and (bistatic) from the observer alone.

    The screen is tilted so that its own mirror reflection goes elsewhere; without it the plate gives its full level.
    """
    screen = trimesh.Trimesh(
        0.3 * np.array(oracle.PLATE_MESH[0]) @ trimesh.transformations.rotation_matrix(0.5, [1, 0, 0])[:3, :3].T,
        oracle.PLATE_MESH[1],
        process=False,
    )
    angle = np.deg2rad(30.0)
    mirror = {"theta_s": angle, "phi_s": np.pi}
    open_level = ss.rcs(PLATE, F77, angle, 0.0, **mirror)
    for side in (0.0, np.pi):  # stands in the way from the source, or to the observer
        centre = [0.5 * np.sin(angle) * np.cos(side), 0.0, 0.5 * np.cos(angle)]
        both = trimesh.util.concatenate([PLATE, screen.copy().apply_translation(centre)])
        # what is left are sidelobes of the screen's rim, which is 100 wavelengths away from any mirror direction
        assert ss.rcs(both, F77, angle, 0.0, **mirror) < open_level / 1e3


def test_depth_of_the_corner():
    """One bounce sees only the faces, two see the dihedrals, three the corner; a fourth adds nothing on the axis."""
    from scarl_sionna.core.settings.sbr import SbrSettings

    boresight = (np.arccos(1 / np.sqrt(3)), np.pi / 4)
    level = [10 * np.log10(ss.rcs(CORNER, F77, *boresight, settings=SbrSettings(max_depth=d))) for d in (1, 2, 3, 4)]
    assert level[2] > level[1] + 10.0 and level[2] > level[0] + 10.0
    assert level[3] == pytest.approx(level[2], abs=1e-6)


def test_frequency_scaling():
    """Twice the size at half the frequency is four times the RCS: all of PO depends on size over wavelength only."""
    double = CORNER.copy().apply_scale(2.0)
    ratio = ss.rcs(double, F77 / 2, 0.9, 0.8) / ss.rcs(CORNER, F77, 0.9, 0.8)
    assert ratio == pytest.approx(4.0, rel=1e-6)
    assert pytest.approx(oracle.WAVELENGTH_77) == SPEED_OF_LIGHT / F77
