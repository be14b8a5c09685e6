"""`auto` beside what stands close to the radar: coherent as farther away, without a step at a distance."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.radar.channel.band_mean import mean_power
from scarl_sionna.radar.channel.compose.auto import plan_channel
from tests.scenes import Thing, ball, box, write_scene

RADAR = ss.RadarSpec()
POSE = ss.Pose([0.0, 0.0, 0.8])


def _power_db(paths: ss.RadarPaths) -> float:
    rows = np.arange(paths.num_paths)
    return float(10.0 * np.log10(mean_power(paths, RADAR, rows, np.zeros(len(rows), dtype=np.int64), 1, 32)[0]))


@pytest.mark.parametrize("distance", [1.02, 0.98, 0.4])
@pytest.mark.parametrize("kind", ["car beside", "ball ahead"])
def test_near_bodies_are_as_by_sbr(tmp_path, kind: str, distance: float) -> None:
    """Left to classes they were 7 to 37 dB stronger from one centimetre to the next."""
    car = box((4.5, 1.8, 1.4), (1.5, distance + 0.9, 0.9))
    mesh = car if kind == "car beside" else ball(0.3, (distance + 0.3, 0.0, 0.8), 5)
    state = ss.load_scene(write_scene(tmp_path, [Thing("body", mesh, "Car", "steel")])).at(0.0)
    found = _power_db(ss.solve_paths(state, RADAR, POSE, "auto"))
    assert found == pytest.approx(_power_db(ss.solve_paths(state, RADAR, POSE, "sbr", max_phase=0.4)), abs=0.5)


def test_what_carries_the_radar_is_left_to_raycast() -> None:
    state = ss.load_scene("highway_guardrail").at(0.5)
    mount = state.mount("ego", ss.Pose([2.0, 0.0, 1.9]))  # over its own bonnet
    own = next(number for number, info in state.world.instances.items() if info.actor == "ego")
    for place, solver in ((mount, "raycast"), (replace(mount, actor=None, actor_from_sensor=None), "sbr")):
        plan = plan_channel(state, RADAR, place, max_distance=3.0, auto={"carrier_near": 3.0})
        assert own in next(share.instances for share in plan.shares if share.solver == solver)
