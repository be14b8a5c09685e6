"""What passes the end of the range goes out smoothly, straight and over mirrors."""

from __future__ import annotations

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.radar.channel.compose.expected_error import band_power, owners
from scarl_sionna.radar.channel.range_end import END
from tests.scenes import Thing, ball, box, write_scene

RADAR = ss.RadarSpec(azimuth_fov_deg=140.0)


@pytest.mark.parametrize("reach", [9.9, 12.6])
def test_a_body_passes_the_end_of_the_range_without_a_jump(tmp_path, reach):
    """A ball of 0.3 m at 10 m, straight, and its ghost over a wall at 6 m with one straight leg, 12.6 m.

    With a sharp end the echo of a ball is cut through at the end; it changed by 1 dB in 1 mm there, 75 dB at the first.
    """
    things = [
        Thing("ball", ball(0.3, (10.0, 0.0, 0.6), 4), "Static", "steel"),
        Thing("wall", box((40.0, 0.2, 8.0), (12.0, 6.0, 0.0)), "Wall", "steel"),
    ]
    state = ss.load_scene(write_scene(tmp_path, things)).at(0.0)
    number = next(key for key, info in state.world.instances.items() if info.name == "ball")
    plan = ss.ChannelPlan((ss.Share("sbr", ("ball",), {"max_depth": 1}, True),), ("wall",), echoes=False)

    def level_db(x: float) -> float:
        paths = ss.solve_paths(state, RADAR, ss.Pose([x, 0.0, 0.6]), "hybrid", plan=plan, max_distance=reach)
        rows = np.flatnonzero(owners(paths, [number]) == number)
        power = band_power(paths, RADAR, rows, np.zeros(len(rows), dtype=np.int64), 1, 32)
        return float(10.0 * np.log10(power[0] + 1e-30))

    inside = level_db(0.3)
    places = np.arange(-0.19, 0.06, 0.02)
    before, after = (np.array([level_db(x + step) for x in places]) for step in (0.0, 1e-3))
    counts = after > inside - 35.0
    # sin^2 rises by pi / END cot(pi x / 2 END) of its field a metre: at -35 dB, x = 0.085 END, by 0.8 dB in 1 mm
    assert np.abs(after - before)[counts].max() < 20.0 / np.log(10.0) * np.pi / END / np.tan(0.085 * np.pi / 2.0) * 1e-3
    assert counts.sum() >= 8
    assert np.all(np.diff(before) > 0.0)  # it rises all along: nothing radiates at the end
