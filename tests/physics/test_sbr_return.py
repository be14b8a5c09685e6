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
    mesh, few = (
        folded(80.0),
        {"ray_share": 4.0, "sheet_share": 64.0},
    )  # larger tubes than rays lie apart are cut before they are asked
    whole, kept = solve(tmp_path / "all", mesh, **few), solve(tmp_path / "some", mesh, **few, return_angle=0.25)
    assert (whole.depth == 2).any() and (kept.depth == 1).all()
    assert kept.a.tobytes() == whole.select(whole.depth == 1).a.tobytes()
    assert whole.diagnostics["num_tubes"][2] > 0 and 2 not in kept.diagnostics["num_tubes"]  # not even traced
    seen = solve(tmp_path / "wide", mesh, **few, return_angle=0.45)
    assert (seen.depth == 2).sum() == (whole.depth == 2).sum()


def test_all_angles_are_all_tubes(tmp_path) -> None:
    for number, mesh in enumerate((folded(100.0), corner())):
        whole = solve(tmp_path / f"all{number}", mesh)
        same = solve(tmp_path / f"pi{number}", mesh, return_angle=np.pi)
        assert same.a.tobytes() == whole.a.tobytes() and same.tx_point.tobytes() == whole.tx_point.tobytes()


def bent_but_for_a_strip(start: float, width: float) -> trimesh.Trimesh:
    """Return the plates at a right angle, 40 m ahead, the second turned away by 12 deg but for an upright strip."""
    ridge, along = np.array([40.0, 0.0, 0.0]), np.array([-1.0, -1.0, 0.0]) / np.sqrt(2.0)
    away = np.cos(np.radians(12.0)) * along + np.sin(np.radians(12.0)) * np.array([1.0, -1.0, 0.0]) / np.sqrt(2.0)
    steps = [start * away, width * along, (1.0 - start - width) * away]
    foot = ridge + np.cumsum([np.zeros(3), *steps], axis=0) - [0.0, 0.0, 0.5]
    points = np.concatenate([foot, foot + [0.0, 0.0, 1.0]])
    quads = [(k, k + 1, k + 5, k + 4) for k in range(3)]
    second = trimesh.Trimesh(points, [(a, c, b) for quad in quads for a, b, c in (quad[:3], (quad[0], *quad[2:]))])
    first = folded(90.0).split(only_watertight=False)[0].apply_translation([20.0, 0.0, 0.0])
    return trimesh.util.concatenate([first, second])


@pytest.mark.parametrize("start", [0.2, 0.33, 0.5, 0.71])
@pytest.mark.parametrize("width", [0.03, 0.06])
def test_what_meets_a_strip_of_a_body_comes_back(tmp_path, start: float, width: float) -> None:
    """No ray of a coarse tube may meet it: where rays meet different faces a tube is cut, but not given up."""
    coarse = {"max_phase": 1.5, "edge_share": 0.25}
    whole = solve(tmp_path / "all", bent_but_for_a_strip(start, width), **coarse)
    kept = solve(tmp_path / "some", bent_but_for_a_strip(start, width), **coarse, return_angle=0.3)
    both = [echo_db(paths.select(paths.depth == 2)) for paths in (whole, kept)]
    assert both[1] == pytest.approx(both[0], abs=1.0)  # side lobes of what is turned away are left out; -6.6 dB before
