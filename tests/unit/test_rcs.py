"""ss.rcs: shapes, broadcasting, polarisations, typed errors, warnings, files, cuts, bytes."""

from __future__ import annotations

import hashlib
import inspect
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh

import scarl_sionna as ss
from scarl_sionna.core.errors import MaterialRangeError, MeshError, ParameterRangeError, UnknownNameError
from scarl_sionna.core.settings.sbr import SbrSettings
from scarl_sionna.radar.optics.phase import plane_wave_integral
from scarl_sionna.radar.rcs import load_body, rcs_cut, scattering_matrix
from scarl_sionna.scene.materials.table import RadioMaterial, UnknownMaterialError
from tests.oracles import rcs as oracle

REPO = Path(__file__).resolve().parents[2]
F77 = 77e9
PLATE = trimesh.Trimesh(0.1 * np.array(oracle.PLATE_MESH[0]), oracle.PLATE_MESH[1], process=False)
CORNER = trimesh.Trimesh(0.1 * np.array(oracle.TRIHEDRAL_MESH[0]), oracle.TRIHEDRAL_MESH[1], process=False)


def test_broadcasting():
    frequency = np.array([76e9, 77e9])[:, None, None]
    theta = np.array([0.0, 0.1, 0.2])[:, None]
    phi = np.array([0.0, 0.4, 0.8, 1.2])
    sigma = ss.rcs(PLATE, frequency, theta, phi)
    assert sigma.shape == (2, 3, 4)
    assert sigma.dtype == np.float64
    assert sigma[1, 2, 3] == pytest.approx(float(ss.rcs(PLATE, 77e9, 0.2, 1.2)), rel=1e-12)
    assert ss.rcs(PLATE, F77, 0.0, 0.0).shape == ()
    assert ss.rcs(PLATE, F77, np.zeros((0, 3)), 0.0).shape == (0, 3)
    assert ss.rcs(PLATE, F77, 0.1, 0.2, theta_s=np.linspace(0, 1, 5), phi_s=0.3).shape == (5,)


def test_polarizations_are_the_entries_of_the_matrix():
    """Receive letter first; seen off its axis and rolled, a corner has four different entries."""
    angles = (0.8, 0.6, "metal", 0.9, 0.4)
    matrix = scattering_matrix(CORNER, F77, *angles)
    for name, (i, j) in {"VV": (0, 0), "VH": (0, 1), "HV": (1, 0), "HH": (1, 1)}.items():
        sigma = ss.rcs(CORNER, F77, 0.8, 0.6, name, theta_s=0.9, phi_s=0.4)
        assert sigma == pytest.approx(4 * np.pi * abs(matrix[i, j]) ** 2)
    assert len({round(abs(value), 6) for value in matrix.reshape(-1)}) == 4


@pytest.mark.parametrize("call", [ss.rcs, scattering_matrix, rcs_cut])
def test_arguments_have_names_and_options_need_theirs(call):
    """Every argument can be given by its name; tables and settings, which could be swapped unseen, only so."""
    kinds = {name: item.kind.name for name, item in inspect.signature(call).parameters.items()}
    assert set(kinds.values()) == {"POSITIONAL_OR_KEYWORD", "KEYWORD_ONLY"}
    assert kinds["materials"] == kinds["settings"] == "KEYWORD_ONLY"
    assert kinds["mesh"] == kinds["frequency"] == kinds["material"] == "POSITIONAL_OR_KEYWORD"


def test_file_and_trimesh_and_body_agree(tmp_path):
    path = tmp_path / "corner.stl"
    CORNER.export(path)
    expected = ss.rcs(CORNER, F77, 0.9, 0.8)
    assert ss.rcs(load_body(CORNER), F77, 0.9, 0.8) == expected
    # STL holds float32: 0.1 m is off by 1.5e-9 m, 5e-6 rad of phase
    assert ss.rcs(path, F77, 0.9, 0.8) == pytest.approx(expected, rel=1e-4)
    assert ss.rcs(str(path), F77, 0.9, 0.8) == ss.rcs(path, F77, 0.9, 0.8)


def test_same_bytes_twice():
    angle = np.linspace(0.3, 1.2, 7)
    first = scattering_matrix(CORNER, F77, angle, 0.7)
    assert first.tobytes() == scattering_matrix(CORNER, F77, angle, 0.7).tobytes()


@pytest.mark.slow
def test_same_bytes_in_another_process():
    code = (
        "import hashlib, tests.unit.test_rcs as t;"
        "print(hashlib.sha256(t.scattering_matrix(t.CORNER, t.F77, [0.4, 0.9], 0.7).tobytes()).hexdigest())"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=REPO, check=True)
    here = scattering_matrix(CORNER, F77, [0.4, 0.9], 0.7)
    assert done.stdout.split()[-1] == hashlib.sha256(here.tobytes()).hexdigest()


def test_batches_do_not_change_the_result():
    """Rays in batches of 20,000 or of a million: only the order of the sum differs (1e-12)."""
    whole = scattering_matrix(CORNER, F77, [0.8, 0.9], 0.7)
    small = scattering_matrix(CORNER, F77, [0.8, 0.9], 0.7, settings=SbrSettings(max_rays=20_000))
    assert np.abs(small - whole).max() < 1e-9 * np.abs(whole).max()


@pytest.mark.parametrize("frequency", [0.0, -77e9, np.nan, np.inf])
def test_bad_frequency(frequency):
    with pytest.raises(ParameterRangeError, match="frequency"):
        ss.rcs(PLATE, frequency, 0.0, 0.0)


def test_bad_angles_polarization_and_settings():
    with pytest.raises(ParameterRangeError, match="theta"):
        ss.rcs(PLATE, F77, np.nan, 0.0)
    with pytest.raises(ParameterRangeError, match="phi_s"):
        ss.rcs(PLATE, F77, 0.0, 0.0, theta_s=0.0, phi_s=np.inf)
    with pytest.raises(UnknownNameError, match="polarization 'LR'"):
        ss.rcs(PLATE, F77, 0.0, 0.0, "LR")
    with pytest.raises(ParameterRangeError, match="max_depth"):
        SbrSettings(max_depth=0)
    with pytest.raises(ParameterRangeError, match="edge_spacing"):
        SbrSettings(ray_spacing=0.1, edge_spacing=0.2)


def test_bad_material():
    with pytest.raises(UnknownMaterialError, match="asfalt.*did you mean 'asphalt'"):
        ss.rcs(PLATE, F77, 0.0, 0.0, material="asfalt")
    with pytest.raises(MaterialRangeError, match="asphalt.*no data at 10 GHz"):
        ss.rcs(PLATE, [77e9, 10e9], 0.0, 0.0, material="asphalt")
    for value in (0.5, 3.0 + 0.1j, complex(np.nan, 0.0), [1, 2]):
        with pytest.raises(ParameterRangeError, match="material"):
            ss.rcs(PLATE, F77, 0.0, 0.0, material=value)


def test_own_material():
    material = RadioMaterial(
        name="resin", relative_permittivity=4.0, conductivity=0.0, source="test", uncertainty="none"
    )
    ratio = ss.rcs(PLATE, F77, 0.0, 0.0, material=material) / ss.rcs(PLATE, F77, 0.0, 0.0)
    assert ratio == pytest.approx(1 / 9)  # ((2 - 1) / (2 + 1))^2


def test_bad_meshes(tmp_path):
    with pytest.raises(MeshError, match="no such file"):
        ss.rcs(tmp_path / "no.ply", F77, 0.0, 0.0)
    text = tmp_path / "text.ply"
    text.write_text("this is no mesh")
    with pytest.raises(MeshError, match="cannot be read"):
        ss.rcs(text, F77, 0.0, 0.0)
    odd = tmp_path / "mesh.xyzzy"
    odd.write_text("?")
    with pytest.raises(MeshError):
        ss.rcs(odd, F77, 0.0, 0.0)
    with pytest.raises(MeshError, match="no faces"):
        ss.rcs(trimesh.Trimesh(np.eye(3), np.zeros((0, 3), int), process=False), F77, 0.0, 0.0)
    broken = np.eye(3)
    broken[1, 1] = np.nan
    with pytest.raises(MeshError, match="not finite"):
        ss.rcs(trimesh.Trimesh(broken, [[0, 1, 2]], process=False), F77, 0.0, 0.0)
    with pytest.raises(MeshError, match="no area"):
        ss.rcs(trimesh.Trimesh(np.zeros((3, 3)), [[0, 1, 2]], process=False), F77, 0.0, 0.0)
    with pytest.raises(MeshError, match="vertex 7"):
        ss.rcs(trimesh.Trimesh(np.eye(3), [[0, 1, 7]], process=False, validate=False), F77, 0.0, 0.0)


def test_warnings_of_size():
    with pytest.warns(ss.ScarlWarning, match="millimetres"):
        ss.rcs(PLATE.copy().apply_scale(3000.0), 1e9, 0.0, 0.0)
    plate = PLATE.copy().apply_scale(60.0 / np.ptp(PLATE.bounds, axis=0).max())
    with pytest.warns(ss.ScarlWarning, match=r"m across; is it in millimetres"):
        ss.rcs(plate, 1e9, 0.0, 0.0)
    with pytest.warns(ss.ScarlWarning, match="wavelengths"):
        ss.rcs(PLATE, 3e9, 0.0, 0.0)


def test_cut_table_and_plot(tmp_path):
    cut = rcs_cut(PLATE, F77, "elevation", ("VV", "HV"), step_deg=10.0)
    assert cut.angle_deg[0] == 0.0 and cut.angle_deg[-1] == 180.0 and len(cut.angle_deg) == 19
    assert cut.rcs.shape == (2, 19)
    assert cut.rcs_dbsm[0, 0] == pytest.approx(oracle.PLATE_DBSM[0])
    lines = cut.table().splitlines()
    assert lines[0] == "theta_deg,VV_dbsm,HV_dbsm" and lines[1].startswith("0,19.185,")
    cut.plot(tmp_path / "cut.png")
    assert (tmp_path / "cut.png").read_bytes().startswith(b"\x89PNG")
    assert len(rcs_cut(PLATE, F77, step_deg=90.0).angle_deg) == 5
    with pytest.raises(UnknownNameError, match="cut"):
        rcs_cut(PLATE, F77, "diagonal")
    with pytest.raises(ParameterRangeError, match="step_deg"):
        rcs_cut(PLATE, F77, step_deg=0.0)


def test_phase_integral_against_quadrature():
    """From a point to 200 rad across, and the change from series to closed form: all within 1e-10 of Gauss's rule."""
    rng = np.random.default_rng(5)
    nodes, weights = np.polynomial.legendre.leggauss(160)
    u, wu = (nodes[:, None] + 1) / 2, weights[:, None] / 2
    v, wv = (nodes[None, :] + 1) / 2 * (1 - u), weights[None, :] / 2 * (1 - u)
    corners = rng.normal(size=(60, 3, 3))
    wave = rng.normal(size=(60, 3)) * np.geomspace(1e-6, 40.0, 60)[:, None]
    wave[::7] *= [0, 0, 1]
    corners[::7, :2, 2] = 0.0  # two corners of equal phase
    for tri, q, found in zip(corners, wave, plane_wave_integral(corners, wave), strict=True):
        a, b = tri[1] - tri[0], tri[2] - tri[0]
        area = np.linalg.norm(np.cross(a, b))
        exact = area * np.sum(wu * wv * np.exp(1j * (q @ tri[0] + u * (q @ a) + v * (q @ b))))
        assert abs(found - exact) < 1e-10 * area
