"""Reflections that method="auto" planned by a part count as a whole where the paths say that they matter."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scarl_sionna.core.pose import Pose
from scarl_sionna.core.settings.accuracy import Accuracy
from scarl_sionna.core.settings.auto import AutoSettings
from scarl_sionna.core.settings.plan import ChannelPlan, Reflection
from scarl_sionna.core.settings.radar import RadarSettings
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.engine.load import load_scene
from scarl_sionna.radar.channel import plan_channel, solve_paths
from scarl_sionna.radar.channel.compose.expected_error import levels_db
from scarl_sionna.radar.channel.compose.reflections import as_found
from tests.scenes import Thing, box, plane, write_scene

RADAR = RadarSpec()
POSE = Pose([0.0, 0.0, 0.6])
WALL, SIGN = 1, 2


@pytest.fixture(scope="module")
def state(tmp_path_factory):
    """A sign turns its flash to the wall's image of the radar and a side lobe, 40 dB below, to the radar."""
    toward = np.array([[-20.0, 0.0, 0.0], [-20.0, 9.6, 0.0]])
    normal = np.sum(toward / np.linalg.norm(toward, axis=1)[:, None], axis=0)
    things = [
        Thing("wall", box((60, 0.2, 6), (20, 4.9, 3.1)), "Wall", "white"),
        Thing("sign", plane(0.3, 0.3, (20, 0, 0.6), normal / np.linalg.norm(normal)), "TrafficSign", "steel"),
    ]
    return load_scene(write_scene(tmp_path_factory.mktemp("found"), things)).at(0.0)


def settings(smallest_change_db: float) -> RadarSettings:
    accuracy = Accuracy(channel_tolerance_db=6.0, tube_budget=10**9)
    return RadarSettings(accuracy=accuracy, auto=AutoSettings(smallest_change_db=smallest_change_db))


def test_a_reflection_that_brings_more_than_was_planned_counts_as_a_whole(state) -> None:
    """Image theory expects some 4 dB of the wall, there are 20; whoever asks for changes of 0.5 dB has them anyway."""
    (share,) = (share for share in plan_channel(state, RADAR, POSE, settings=settings(6.0)).shares if share.reflections)
    assert 0.1 < share.reflections[0].weights[0][0] < 0.9
    part, whole = (solve_paths(state, RADAR, POSE, "auto", settings=settings(least)) for least in (6.0, 0.5))
    assert levels_db(part, RADAR, [SIGN])[SIGN] == pytest.approx(levels_db(whole, RADAR, [SIGN])[SIGN], abs=1e-6)
    (entry,) = (entry for entry in part.diagnostics["plan"]["shares"] if entry["reflections"])
    assert np.array(entry["reflections"][0]["weights"]).tolist() == [[1.0]]  # what `hybrid` needs for the same paths


def test_weights_come_smoothly_whatever_is_found(state) -> None:
    """Of reflections a hundred times, a tenth and a thousandth of the straight field; both legs count."""
    plan = plan_channel(state, RADAR, POSE, settings=settings(0.5))
    found = solve_paths(state, RADAR, POSE, "hybrid", plan=plan, max_distance=100.0)
    legs = np.count_nonzero((found.instance == WALL) & (found.instance[:, :1] >= 0), axis=1)
    legs[~np.isin(found.instance, SIGN).any(axis=1)] = 0
    straight, over = (levels_db(found.select(rows), RADAR, [SIGN])[SIGN] for rows in (legs == 0, legs > 0))

    def taken(planned: float, field: float) -> tuple[float, np.ndarray, np.ndarray]:
        to = field * 10.0 ** ((straight - over) / 20.0)
        scale = np.where(legs > 0, to * planned**legs, 1.0)
        paths = replace(found, a=found.a * scale[:, None, None])
        new, raised = as_found(with_weight(plan, planned), paths, RADAR, 0.5)
        (share,) = (share for share in new.shares if share.reflections)
        return share.reflections[0].weights[0][0], paths.a[:, 0, 0], raised.a[:, 0, 0]

    for field in (100.0, 0.1, 0.001):
        weights = np.array([taken(planned, field)[0] for planned in np.linspace(0.01, 1.0, 34)])
        assert weights[-1] == 1.0 and np.diff(weights).min() >= 0.0 and np.diff(weights).max() < 0.5
        assert bool((weights[4:] > 0.999).all()) == (field > 0.05)  # a tenth of the field is 0.8 dB
    weight, before, after = taken(0.05, 0.05)  # 0.4 dB
    assert 0.05 < weight < 0.5
    np.testing.assert_allclose(after, before * (weight / 0.05) ** legs, rtol=1e-12)


def with_weight(plan: ChannelPlan, weight: float) -> ChannelPlan:
    """Return a plan all of whose reflections have a weight."""
    over = (Reflection((SIGN,), (WALL,), ((weight,),)),)
    return replace(
        plan, shares=tuple(replace(share, reflections=over) if share.reflections else share for share in plan.shares)
    )
