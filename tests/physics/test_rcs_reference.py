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


@pytest.mark.some(2)
@pytest.mark.parametrize("name", CUTS)
def test_same_theory(name):
    """Bar of the project: mean error 0.1 dB, 95th percentile 0.3 dB, down to 20 dB below each peak.

    Measured: means 0.001 to 0.011 dB, 95th percentiles 0.001 to 0.048 dB (0.021 and 0.094 in the trihedral's
    cross-polar). The reference itself has rays every lambda/60, whose area of an edge is uncertain by that much.
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


def full_wave_difference(name, axis, centre_deg, within_deg, channel):
    """Return ss.rcs minus moments [dB] at the angles of a cut that are near its centre."""
    cut = oracle.table(f"mom_{name}")
    rows = np.abs(cut[axis] - centre_deg) <= within_deg + 1e-6
    picked = {column: values[rows] for column, values in cut.items()}
    return levels_db(name, picked)[channel] - picked[f"{channel}_dBlam2"]


@pytest.mark.parametrize("channel", ["vv", "hh"])
def test_full_wave(channel):
    """What remains against moments is what the reference data list for a perfect ray solver, within 0.2 dB (bar).

    Listed: plate of 3 wavelengths head-on +0.18 dB; dihedral +1.4 dB, which is the mean over 10 deg on either side in
    azimuth (at the seam itself it is 2.1 to 3 dB); trihedral 0.2 to 0.5 dB, the mean of the absolute difference over
    the same width.
    """
    plate = full_wave_difference("plate3lam_phi0", "theta_deg", 0.0, 0.0, channel)
    assert plate[0] == pytest.approx(0.18, abs=0.2)  # measured +0.14
    dihedral = full_wave_difference("dihedral3lam_az", "phi_deg", 45.0, 10.0, channel)
    assert dihedral.mean() == pytest.approx(1.4, abs=0.2)  # measured +1.41, +1.52
    for name, axis, centre in (("trihedral3lam_az", "phi_deg", 45.0), ("trihedral3lam_el", "theta_deg", 54.7356)):
        trihedral = full_wave_difference(name, axis, centre, 10.0, channel)
        assert 0.0 <= np.abs(trihedral).mean() <= 0.5 + 0.2  # measured 0.21 to 0.44
        assert abs(trihedral.mean()) <= 0.5


def test_capped_cylinder_near_broadside_full_wave():
    """Radius 1, height 5 wavelengths, within 5 deg of broadside.

    PO is within 1 dB (two polarisations differ by creeping waves).
    """
    cut = oracle.table("mom_cyl_a1_h5_theta")
    rows = np.abs(cut["theta_deg"] - 90.0) <= 5.0
    picked = {column: values[rows] for column, values in cut.items()}
    found = levels_db("cyl", picked)
    error = np.concatenate([found[c] - picked[f"{c}_dBlam2"] for c in ("vv", "hh")])
    assert np.abs(error).mean() < 1.0
