"""Narrow bars before a large plate: their shadows are found by the probes of coarse tubes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

import scarl_sionna as ss
from scarl_sionna.core.settings.auto import DEFAULT_AUTO
from scarl_sionna.core.settings.sbr import SbrSettings
from scarl_sionna.engine.world import WorldState
from scarl_sionna.radar.channel import solve_paths
from scarl_sionna.radar.channel.compose.budget import sbr_settings
from scarl_sionna.radar.channel.compose.expected_error import mean_power
from tests.scenes import Thing, box, write_scene

RADAR = ss.RadarSpec()


def _power(state: WorldState, knobs: SbrSettings) -> float:
    paths = solve_paths(state, RADAR, ss.Pose([0.0, 0.0, 0.7]), "sbr", settings=knobs, max_distance=30.0)
    rows = np.arange(paths.num_paths)
    return float(10.0 * np.log10(mean_power(paths, RADAR, rows, np.zeros_like(rows), 1, 96)[0]))


def _door_behind_bars(folder: Path, turn_deg: float) -> WorldState:
    door = box((0.02, 2.4, 2.4), (24.0, 0.2, 2.4))
    bars = [box((0.02, 0.025, 2.6), (0.0, y, 0.0)) for y in (-0.73, -0.11, 0.48, 0.87)]
    frame = trimesh.util.concatenate([*bars, box((0.02, 0.2, 0.2), (0.0, 1.3, 1.2))])
    frame.apply_transform(trimesh.transformations.rotation_matrix(np.radians(turn_deg), (1, 0, 0)))
    frame.apply_translation((23.95, 0.2, 2.4))
    things = [Thing("door", door, "Car", "steel"), Thing("frame", frame, "Car", "steel")]
    return ss.load_scene(write_scene(folder, things)).at(0.0)


KNOBS = SbrSettings(max_phase=1.0, integration_phase=0.05, max_depth=1)


@pytest.mark.parametrize("turn_deg", [0.0, 30.0])
def test_shadows_of_bars_of_one_mesh(tmp_path: Path, turn_deg: float) -> None:
    """A door behind a frame of bars 2.5 cm wide, drawn as one mesh, has the echo that probes 1 cm apart find."""
    state = _door_behind_bars(tmp_path, turn_deg)
    fine = _power(state, KNOBS.with_(ray_spacing=2.5, edge_spacing=2.5))
    for max_phase in (3.0, 1.5, 1.0, 0.4):
        coarse = KNOBS.with_(max_phase=max_phase, edge_share=0.25)
        assert _power(state, coarse) == pytest.approx(fine, abs=0.4), max_phase


@pytest.mark.parametrize("knob", [{"narrow_share": 1.0}, {"narrow_shadows": False}])
def test_bars_between_the_rays_are_not_looked_for_where_none_asks(tmp_path: Path, knob: dict[str, object]) -> None:
    """That door is 1 dB off and more then, as at the level of 6 dB: what the knobs leave out."""
    state = _door_behind_bars(tmp_path, 30.0)
    fine = _power(state, KNOBS.with_(ray_spacing=2.5, edge_spacing=2.5))
    coarse = KNOBS.with_(edge_share=0.25)
    assert abs(_power(state, coarse.with_(**knob)) - fine) > 1.0


def test_only_the_coarsest_level_leaves_narrow_shadows_out() -> None:
    knobs = [sbr_settings(level) for level in DEFAULT_AUTO.levels]
    assert [one.narrow_shadows for one in knobs] == [False, True, True, True]
    assert [one.narrow_share for one in knobs] == [1.0 / 3.0, *[1.0 / 12.0] * 3]
