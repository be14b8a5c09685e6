"""Small corners and recesses of large vehicles, which shine by three bounces: `auto` against a fine reference."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from benchmarks.corner_range import corner
from benchmarks.street_scenes import lorry_with_a_recess
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.settings.sbr import SbrSettings
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.engine.load import load_scene
from scarl_sionna.radar.channel import solve_paths
from scarl_sionna.radar.channel.compose.expected_error import levels_db
from tests.scenes import Thing, box, write_scene

RADAR = RadarSpec()
POSE = Pose([0.0, 0.0, 0.8])
FINE = SbrSettings(max_phase=0.2, edge_share=0.0625, sheet_share=0.05, max_depth=5, floor_db=None)
REAR = 20.0
"""Where the rear of the lorry is [m]."""


def _turned(mesh: trimesh.Trimesh, degrees: float) -> trimesh.Trimesh:
    """Turn about the middle of the rear, so that it does not flash."""
    mesh.apply_transform(trimesh.transformations.rotation_matrix(np.radians(degrees), (0, 0, 1), (REAR, 0.0, 0.0)))
    return mesh


def lorry_with_a_corner() -> trimesh.Trimesh:
    """A trihedral of 7 cm, open to the radar, 2 cm before the rear."""
    body = _turned(box((8.0, 2.5, 3.0), (REAR + 4.0, 0.0, 2.0)), 12.0)
    small = corner(0.07)
    small.apply_transform(trimesh.geometry.align_vectors(np.ones(3) / np.sqrt(3.0), [-1.0, 0.0, 0.0]))
    small.apply_translation([body.bounds[0][0] - 0.02, 0.5, 0.9])
    return trimesh.util.concatenate([body, small])


def lorry_with_a_niche() -> trimesh.Trimesh:
    """A niche 0.6 m square and 0.4 m deep in the rear, so high that two of its faces alone send little back."""
    mesh = lorry_with_a_recess((-0.4, 0.2), (2.3, 2.9), 0.4)
    mesh.apply_translation([REAR, 0.0, 0.0])
    return _turned(mesh, 20.0)


@pytest.mark.parametrize(("make", "lost"), [(lorry_with_a_corner, 15.0), (lorry_with_a_niche, 15.0)])
def test_a_niche_of_a_lorry_keeps_the_tolerance(tmp_path: Path, make, lost: float) -> None:
    """Two bounces, a limit that vehicles once had, lose their echo."""
    state = load_scene(write_scene(tmp_path, [Thing("lorry", make(), "Truck", "steel")])).at(0.0)

    def level(paths) -> float:
        return levels_db(paths, RADAR, [1])[1]

    exact, two = (level(solve_paths(state, RADAR, POSE, "sbr", sbr=FINE.with_(max_depth=depth))) for depth in (5, 2))
    assert two < exact - lost
    for tolerance in (3.0, 1.0, 0.3):
        paths = solve_paths(state, RADAR, POSE, "auto", channel_tolerance_db=tolerance, num_rays=1_000)
        said = paths.diagnostics
        assert said["num_counted"] == 1 and said["choices"][0]["method"] == "sbr"
        assert said["met"] and said["expected_error_db"] <= tolerance and abs(level(paths) - exact) < tolerance
