"""ss.rcs against other solvers' reference cuts: dense ray tubes of another program, and full-wave moments."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.radar.rcs import scattering_matrix
from tests.oracles import rcs as oracle

CHANNEL = {"vv": (0, 0), "hh": (1, 1), "hv": (1, 0)}
MESHES = {"plate": oracle.PLATE_MESH, "dihedral": oracle.DIHEDRAL_MESH, "trihedral": oracle.TRIHEDRAL_MESH}
FREQUENCY = SPEED_OF_LIGHT  # the references are in wavelengths: with this frequency a wavelength is 1 m


def body_of(name):
    if name.startswith("cyl"):
        return trimesh.creation.cylinder(radius=1.0, height=5.0, sections=256)
    vertices, faces = next(mesh for key, mesh in MESHES.items() if name.startswith(key))
    return trimesh.Trimesh(3.0 * np.array(vertices), faces, process=False)


def levels_db(name, cut):
    theta, phi = np.deg2rad(cut["theta_deg"]), np.deg2rad(cut["phi_deg"])
    matrix = scattering_matrix(body_of(name), FREQUENCY, theta, phi)
    return {key: 10 * np.log10(4 * np.pi * np.abs(matrix[:, i, j]) ** 2 + 1e-12) for key, (i, j) in CHANNEL.items()}


CUTS = (
    "plate3lam_phi0",
    "plate3lam_phi45",
    "dihedral3lam_az",
    "dihedral3lam_el",
    "trihedral3lam_az",
    "trihedral3lam_el",
)


@pytest.mark.parametrize("name", CUTS)
def test_same_theory(name):
    """Bar of the project: mean error 0.1 dB, 95th percentile 0.3 dB, down to 20 dB below each peak.

    Measured: means 0.001 to 0.011 dB, 95th percentiles 0.001 to 0.048 dB (0.021 and 0.094 in the trihedral's cross-polar).
    The reference itself has rays every lambda/60, whose area of an edge is uncertain by that much.
    """
    cut, full_wave = oracle.table(f"sbr_{name}"), oracle.table(f"mom_{name}")
    found = levels_db(name, cut)
    for channel in CHANNEL:
        reference = cut[f"{channel}_dBlam2"]
        if full_wave[f"{channel}_dBlam2"].max() < -40.0:  # empty by symmetry; the reference's rays leave up to -3 dB
            assert found[channel].max() < -40.0
            continue
        strong = reference > reference.max() - 20.0
        error = np.abs(found[channel] - reference)[strong]
        assert strong.sum() >= 10
        assert error.mean() <= 0.1
        assert np.percentile(error, 95) <= 0.3


@pytest.mark.parametrize(
    ("name", "theta_deg", "phi_deg", "channel", "expected_db"),
    [
        ("plate3lam_phi0", 0, 0, "vv", 0.18),  # the physics that rays leave out, as listed with the reference data
        ("dihedral3lam_az", 90, 45, "vv", None),
        ("trihedral3lam_az", 54.7356, 45, "vv", None),
    ],
)
def test_full_wave(name, theta_deg, phi_deg, channel, expected_db):
    """What remains against moments is the listed error of a perfect ray solver, within 0.2 dB (accuracy of the moments)."""
    cut = oracle.table(f"mom_{name}")
    row = np.flatnonzero(np.isclose(cut["theta_deg"], theta_deg) & np.isclose(cut["phi_deg"], phi_deg))
    picked = {column: values[row] for column, values in cut.items()}
    mine = levels_db(name, picked)[channel][0] - picked[f"{channel}_dBlam2"][0]
    if expected_db is None:  # the reference solver of the same theory says what it is
        dense = oracle.table(f"sbr_{name}")
        same = np.isclose(dense["theta_deg"], theta_deg) & np.isclose(dense["phi_deg"], phi_deg)
        expected_db = dense[f"{channel}_dBlam2"][same][0] - picked[f"{channel}_dBlam2"][0]
    assert mine == pytest.approx(expected_db, abs=0.2)


def test_capped_cylinder_near_broadside_full_wave():
    """Radius 1, height 5 wavelengths, within 5 deg of broadside: PO is within 1 dB (two polarisations differ by creeping waves)."""
    cut = oracle.table("mom_cyl_a1_h5_theta")
    rows = np.abs(cut["theta_deg"] - 90.0) <= 5.0
    picked = {column: values[rows] for column, values in cut.items()}
    found = levels_db("cyl", picked)
    error = np.concatenate([found[c] - picked[f"{c}_dBlam2"] for c in ("vv", "hh")])
    assert np.abs(error).mean() < 1.0
