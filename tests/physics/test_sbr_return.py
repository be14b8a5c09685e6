"""Tubes that do not come back: what `return_angle` leaves out is side lobes, and what it keeps is all the rest."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from scarl_sionna.core.pose import Pose
from scarl_sionna.core.settings.sbr import SbrSettings
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.engine.load import load_scene
from scarl_sionna.radar.channel import solve_paths
from tests.oracles.rcs import TRIHEDRAL_MESH
from tests.scenes import Thing, write_scene

RADAR, POSE = RadarSpec(), Pose([0.0, 0.0, 0.0])
ALL = SbrSettings(max_phase=1.0, floor_db=None)


def folded(inside_deg: float) -> trimesh.Trimesh:
    """Return two plates of 1 m that meet upright 20 m ahead, with this angle between them, open to the radar."""
    half = np.radians(inside_deg) / 2.0
    sides = []
    for sign in (1.0, -1.0):
        along = np.array([-np.cos(half), sign * np.sin(half), 0.0])
        up = np.array([0.0, 0.0, 0.5])
        ridge = np.array([20.0, 0.0, 0.0])
        corners = np.array([ridge - up, ridge + along - up, ridge + along + up, ridge + up])
        sides.append(trimesh.Trimesh(corners, [(0, 1, 2), (0, 2, 3)], process=False))
    return trimesh.util.concatenate(sides)


def solve(folder, mesh: trimesh.Trimesh, **knobs):
    state = load_scene(write_scene(folder, [Thing("body", mesh, "Static", "steel")])).at(0.0)
    return solve_paths(state, RADAR, POSE, "sbr", settings=ALL.with_(**knobs))


def echo_db(paths) -> float:
    wave = np.exp(-2j * np.pi * RADAR.center_frequency / 299792458.0 * paths.length)
    return float(20.0 * np.log10(abs(np.sum(paths.a[:, 0, 0] * wave))))


def corner() -> trimesh.Trimesh:
    points = 0.2 * np.array(TRIHEDRAL_MESH[0])
    mesh = trimesh.Trimesh(points, np.array(TRIHEDRAL_MESH[1]), process=False)
    mesh.apply_transform(trimesh.geometry.align_vectors(np.ones(3) / np.sqrt(3.0), [-1.0, 0.1, 0.1]))
    mesh.apply_translation([20.0, 0.0, 0.0])
    return mesh


@pytest.mark.parametrize("body", ["dihedral", "trihedral"])
@pytest.mark.parametrize("angle", [0.3, 0.8])
def test_what_comes_back_is_kept(tmp_path, body: str, angle: float) -> None:
    mesh = folded(90.0) if body == "dihedral" else corner()
    whole, kept = solve(tmp_path / "all", mesh), solve(tmp_path / "some", mesh, return_angle=angle)
    # Not the same rows: first tubes none of whose rays comes back lack their side lobes, some 60 dB below a flash.
    assert echo_db(kept) == pytest.approx(echo_db(whole), abs=0.02)
    assert kept.depth.max() == whole.depth.max() == (2 if body == "dihedral" else 3)


def test_what_goes_away_is_not_followed_and_the_first_bounce_is_the_same(tmp_path) -> None:
    """Between plates at 80 deg two bounces turn a ray by 160 deg: the mirror direction is 20 deg (0.35 rad) off."""
    mesh = folded(80.0)
    whole, kept = solve(tmp_path / "all", mesh), solve(tmp_path / "some", mesh, return_angle=0.25)
    assert (whole.depth == 2).any() and (kept.depth == 1).all()
    assert kept.a.tobytes() == whole.select(whole.depth == 1).a.tobytes()
    assert whole.diagnostics["num_tubes"][2] > 0 and 2 not in kept.diagnostics["num_tubes"]  # not even traced
    seen = solve(tmp_path / "wide", mesh, return_angle=0.45)
    assert (seen.depth == 2).sum() == (whole.depth == 2).sum()


def test_all_angles_are_all_tubes(tmp_path) -> None:
    for number, mesh in enumerate((folded(100.0), corner())):
        whole = solve(tmp_path / f"all{number}", mesh)
        same = solve(tmp_path / f"pi{number}", mesh, return_angle=np.pi)
        assert same.a.tobytes() == whole.a.tobytes() and same.tx_point.tobytes() == whole.tx_point.tobytes()
