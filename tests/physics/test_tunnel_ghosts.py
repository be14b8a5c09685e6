"""`lorry_in_a_tunnel` shows ghosts: in draft of what hangs on the walls, at full quality of the vehicles as well."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scarl_sionna.core.results import RadarFrame
from scarl_sionna.scenario.spec.scenario import ScenarioSpec
from scarl_sionna.simulation import load_world, observe, resolve_rig


def seen(quality: str, time: float) -> tuple[RadarFrame, dict[str, tuple[float, float]]]:
    """Return what the front rig's radar sees, and the direct and the ghost's power of each object [dBm]."""
    spec = ScenarioSpec.preset("lorry_in_a_tunnel").with_(quality=quality)
    rig = resolve_rig(spec)
    rig = replace(rig, sensors=tuple(one for one in rig.sensors if one.kind == "radar"))
    frame = observe(load_world(spec), rig, time, seed=0)
    (radar,) = frame.radars.values()
    assert radar.object_power is not None and radar.object_ghost_power is not None
    level = 30.0 + 10.0 * np.log10(np.maximum([radar.object_power, radar.object_ghost_power], 1e-30)).T
    return radar, {item.name: (one[0], one[1]) for item, one in zip(frame.objects, level.tolist(), strict=True)}


def test_draft_has_the_ghosts_of_the_walls() -> None:
    """At 5 s the door's ghost is as strong as its echo (-84 and -87 dBm)."""
    radar, level = seen("draft", 5.0)
    assert level["lorry"][0] == pytest.approx(-81.0, abs=5.0)
    assert level["exit_door_1"][1] == pytest.approx(-82.0, abs=6.0)
    assert radar.cell_ghost_share is not None and np.sum(radar.cell_ghost_share > 127) > 50


@pytest.mark.slow
def test_full_quality_has_those_of_the_vehicles() -> None:
    """At 3 s: the oncoming car's ghost is as strong as its echo, and it does not abort (36 CPU s)."""
    radar, level = seen("full", 3.0)
    assert level["oncoming"][1] > level["oncoming"][0] - 10.0
    assert level["lorry"][1] > -95.0 and level["motorcycle"][1] > -130.0
    assert radar.cell_ghost_share is not None and np.sum(radar.cell_ghost_share > 127) > 1000
