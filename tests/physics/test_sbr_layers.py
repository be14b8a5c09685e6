"""Thin layers, one close behind the other: only the first scatters, however far away the radar is."""

from __future__ import annotations

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.core.settings.sbr import SbrChannelSettings
from tests.scenes import Thing, plane, write_scene


@pytest.mark.parametrize("distance", [20.0, 200.0, 1000.0])
def test_what_is_5_mm_behind_a_sheet_is_hidden(tmp_path, distance: float) -> None:
    things = [
        Thing("front", plane(0.5, 0.5, (distance, 0, 0), (-1, 0, 0)), material="steel"),
        Thing("behind", plane(0.4, 0.4, (distance + 0.005, 0, 0), (-1, 0, 0)), material="steel"),
    ]
    radar = ss.RadarSpec.preset("awr1843boost")
    settings = SbrChannelSettings(max_depth=1, floor_db=None)
    state = ss.load_scene(write_scene(tmp_path, instances=things)).at(0.0)
    paths = ss.solve_paths(state, radar, ss.Pose(), method="sbr", max_distance=2 * distance, settings=settings)
    assert paths.num_paths and set(np.unique(paths.instance)) == {1}
