"""What is told of shadows that tubes have not resolved, and of what."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.radar.channel.compose.verify import _Work
from scarl_sionna.radar.channel.sbr.rows import joined
from scarl_sionna.radar.channel.sbr.shadows import MOST_DB, shadows_db
from scarl_sionna.radar.link import path_unit
from scarl_sionna.radar.optics.tubes.checks import NUM_POINTS, Wrong, spread_points

RADAR = ss.RadarSpec()


@pytest.mark.parametrize("order", [[0, 1, 2], [1, 0, 2], [2, 1, 0]])
def test_points_of_a_body_that_is_seen_edge_on_are_of_no_other(order: list[int]) -> None:
    front = np.array([[10.0, 0.0, 0.0], [10.0, 1.0, 0.0], [10.0, 0.0, 1.0]])
    edge_on = np.array([[10.0, 0.0, 0.0], [12.0, 0.0, 0.0], [12.0, 0.0, 1.0]])
    corners = np.stack([front, edge_on, front + [1.0, 2.0, 0.0]])[order]
    rows, points, share = spread_points(corners, np.zeros(3), np.array([0, 1, 2]))
    found, count = np.unique(rows, return_counts=True)
    assert found.tolist() == np.flatnonzero(np.array(order) != 1).tolist()
    assert set(count) == {NUM_POINTS} and len(points) == len(share) == 2 * NUM_POINTS


def test_a_larger_doubt_is_kept() -> None:
    result = SimpleNamespace(doubts={1: 5.0, 2: 0.5}, errors={1: 4.0, 2: 4.0, 3: 4.0})
    one = SimpleNamespace(result=result, _weight=lambda shadow: 0.5 * shadow)
    _Work._doubt_again(one, [1, 2, 3], {1: 2.0, 2: 2.0})
    assert result.doubts == {1: 5.0, 2: 2.0}
    assert result.errors[3] == 4.0 < result.errors[1]


@pytest.mark.parametrize(("over_db", "told"), [(-1.0, {}), (1.0, {7: MOST_DB})])
def test_what_stays_below_the_floor_is_not_told(over_db: float, told: dict[int, float]) -> None:
    """A body that no tube lights, of which a point is seen: as a flash it is below the floor, or over it."""
    floor_db = -10.0
    missed = 4.0 * np.pi * np.sqrt(10.0 ** ((floor_db + over_db) / 10.0) / path_unit(RADAR))
    wrong = {7: Wrong(np.inf, 1, float(missed))}
    assert shadows_db(wrong, joined([], 1), RADAR, floor_db) == told
    assert shadows_db(wrong, joined([], 1), RADAR, None) == {7: MOST_DB}
