"""Three bounces of corner reflectors off their axis with edges cut coarsely: pieces at touching faces are kept."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh

import scarl_sionna as ss
from scarl_sionna.core.settings.sbr import SbrSettings
from scarl_sionna.engine.world import WorldState
from scarl_sionna.radar.channel import solve_paths
from scarl_sionna.radar.channel.band_mean import mean_power
from tests.scenes import Thing, write_scene

RADAR = ss.RadarSpec()
COARSE = SbrSettings(max_phase=1.5, integration_phase=0.02, edge_share=0.25, sheet_share=0.08, floor_db=None)
FINE = SbrSettings(max_phase=0.5, integration_phase=0.02, edge_share=0.0625, sheet_share=0.03, floor_db=None)
ASPECTS = [(0.72, 0.69, 0.027), (0.6, 0.8, 0.06), (0.5, 0.85, 0.1), (0.85, 0.5, 0.15)]
"""Directions to the radar by the three edges: nearly along one face, where three bounces begin or end at its edge."""

MOST_DB = [1.0, 0.2, 0.05, 0.05]
"""1.8 and 0.6 dB where pieces are dropped of which one corner lies a little behind the face that they meet."""


def _triple(state: WorldState, knobs: SbrSettings) -> float:
    paths = solve_paths(state, RADAR, ss.Pose([0.0, 0.0, 0.7]), "sbr", settings=knobs, max_distance=50.0)
    rows = np.flatnonzero(np.asarray(paths.depth) == 3)
    return float(10.0 * np.log10(mean_power(paths, RADAR, rows, np.zeros_like(rows), 1, 96)[0]))


def test_three_bounces_off_axis(tmp_path: Path) -> None:
    """Edges as the level of 3 dB of `auto` cuts them leave the three bounces as they are with much finer ones."""
    errors = []
    for number, aspect in enumerate(ASPECTS):
        points = 0.25 * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=np.float64)
        corner = trimesh.Trimesh(points, [(0, 1, 2), (0, 2, 3), (0, 3, 1)], process=False)
        toward = np.array(aspect) / np.linalg.norm(aspect)
        corner.apply_transform(trimesh.geometry.align_vectors(toward, (-1.0, 0.0, 0.0)))
        corner.apply_translation((35.0, 0.0, 0.7))
        folder = tmp_path / str(number)
        folder.mkdir()
        state = ss.load_scene(write_scene(folder, [Thing("corner", corner, "Static", "steel")])).at(0.0)
        errors.append(_triple(state, COARSE) - _triple(state, FINE))
    assert (np.abs(errors) < MOST_DB).all(), errors
