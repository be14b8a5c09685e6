"""Narrow bars before a large plate: their shadows are found by the probes of coarse tubes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

import scarl_sionna as ss
from scarl_sionna.core.settings.sbr import SbrSettings
from scarl_sionna.engine.world import WorldState
from scarl_sionna.radar.channel import solve_paths
from scarl_sionna.radar.channel.compose.expected_error import mean_power
from tests.scenes import Thing, box, write_scene

RADAR = ss.RadarSpec()


def _power(state: WorldState, knobs: SbrSettings) -> float:
    paths = solve_paths(state, RADAR, ss.Pose([0.0, 0.0, 0.7]), "sbr", settings=knobs, max_distance=30.0)
    rows = np.arange(paths.num_paths)
    return float(10.0 * np.log10(mean_power(paths, RADAR, rows, np.zeros_like(rows), 1, 96)[0]))


@pytest.mark.parametrize("turn_deg", [0.0, 30.0])
def test_shadows_of_bars_of_one_mesh(tmp_path: Path, turn_deg: float) -> None:
    """A door behind a frame of bars 2.5 cm wide, drawn as one mesh, has the echo that probes 1 cm apart find."""
    door = box((0.02, 2.4, 2.4), (24.0, 0.2, 2.4))
    bars = [box((0.02, 0.025, 2.6), (0.0, y, 0.0)) for y in (-0.73, -0.11, 0.48, 0.87)]
    frame = trimesh.util.concatenate([*bars, box((0.02, 0.2, 0.2), (0.0, 1.3, 1.2))])
    frame.apply_transform(trimesh.transformations.rotation_matrix(np.radians(turn_deg), (1, 0, 0)))
    frame.apply_translation((23.95, 0.2, 2.4))
    things = [Thing("door", door, "Car", "steel"), Thing("frame", frame, "Car", "steel")]
    state = ss.load_scene(write_scene(tmp_path, things)).at(0.0)
    knobs = SbrSettings(max_phase=1.0, integration_phase=0.05, max_depth=1)
    fine = _power(state, knobs.with_(ray_spacing=2.5, edge_spacing=2.5))
    for max_phase in (3.0, 1.5, 1.0, 0.4):
        coarse = knobs.with_(max_phase=max_phase, edge_share=0.25)
        assert _power(state, coarse) == pytest.approx(fine, abs=0.4), max_phase
