"""Density of built-in traffic over time: queues at junctions do not grow without end."""

from __future__ import annotations

import numpy as np
import pytest

from scarl_sionna.scenario.spec.actors import TrafficSpec
from scarl_sionna.scenario.traffic import simulated
from scarl_sionna.scenario.traffic.drivers import thinned
from scarl_sionna.scenario.traffic.simulated import simulate_traffic
from scarl_sionna.scene.document.find import find_scene
from scarl_sionna.scene.document.scene_file import read_document
from scarl_sionna.scene.lanes import LaneNetwork

SPAN = 30.0
"""Time within which a queue without a bound is far beyond what is asked for [s]: of three seeds at either place 2.7
times and more, and at most 1.5 times with the bound."""


def lanes_of(scene: str) -> LaneNetwork:
    network = read_document(find_scene(scene)).lanes
    assert network is not None
    return network


def density(scene: str, asked: float, seed: int, times: np.ndarray) -> np.ndarray:
    """Return the vehicles on a kilometre of lane at some times."""
    network = lanes_of(scene)
    kilometres = sum(lane.length for lane in network.of_kind("drive")) / 1000.0
    actors = simulate_traffic(network, TrafficSpec(density=asked, seed=seed), (0.0, SPAN))
    return np.array([sum(one.active[0] <= time <= one.active[1] for one in actors) for time in times]) / kilometres


@pytest.mark.some(1)  # the bound is one for signals and right of way
@pytest.mark.parametrize(("scene", "asked"), [("signalised_crossing", 12.0), ("roundabout", 10.0)])
def test_queues_do_not_grow_without_end(scene, asked, monkeypatch) -> None:
    late = np.arange(20.0, SPAN, 2.0)
    held = density(scene, asked, 1, late).mean()
    monkeypatch.setattr(simulated, "PASSES", 1)
    free = density(scene, asked, 1, late).mean()
    assert free > 1.8 * asked  # what comes is more than signals and right of way let through
    assert 0.6 * asked < held < 1.6 * asked


def test_where_the_way_is_free_nothing_changes(monkeypatch) -> None:
    times = np.arange(0.0, SPAN, 5.0)
    held = density("country_road", 8.0, 0, times)
    monkeypatch.setattr(simulated, "PASSES", 1)
    np.testing.assert_array_equal(held, density("country_road", 8.0, 0, times))


def test_who_is_inside_stays_and_a_share_of_the_others_is_left_out_evenly() -> None:
    coming = [False, True, True, True, False, True] * 10
    kept = thinned(coming, 0.25)
    assert all(stays for stays, is_new in zip(kept, coming, strict=True) if not is_new)
    new = [stays for stays, is_new in zip(kept, coming, strict=True) if is_new]
    assert sum(new) == 30
    assert max(abs(sum(new[:count]) - 0.75 * count) for count in range(41)) <= 1.0
    assert thinned(coming, 0.0) == [True] * 60
