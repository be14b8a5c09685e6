"""Clusters: planted groups are found as they were planted, at every range, with their labels."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.core.errors import InputTypeError, ParameterRangeError, UnknownNameError
from tests.radar_points import planted

RADAR = ss.RadarSpec()


@dataclass
class Labels:
    instance: np.ndarray
    semantic: np.ndarray


def groups_of(found: ss.RadarClusters) -> set[frozenset[int]]:
    return {frozenset(np.flatnonzero(found.member == row).tolist()) for row in range(found.num_clusters)}


def test_planted_groups_are_found_whatever_their_order() -> None:
    rng = np.random.default_rng(1)
    centres = [[10.0, -3.0], [10.0, 3.0], [40.0, 0.0], [70.0, 20.0], [90.0, -30.0]]
    xy = np.concatenate([np.array(centre) + rng.uniform(-0.7, 0.7, (6, 2)) for centre in centres])
    velocity = np.repeat([0.0, 0.0, -5.0, 3.0, 8.0], 6) + rng.uniform(-0.4, 0.4, 30)
    order = rng.permutation(30)
    found = ss.cluster(planted(xy[order], velocity[order]))
    place = np.argsort(order)
    assert groups_of(found) == {frozenset(place[6 * k : 6 * k + 6].tolist()) for k in range(5)}
    for row in range(5):
        members = np.flatnonzero(found.member == row)
        np.testing.assert_allclose(found.position[row, :2], xy[order[members]].mean(axis=0), atol=1e-12)
        np.testing.assert_allclose(found.extent[row, :2], np.ptp(xy[order[members]], axis=0), atol=1e-12)
        assert found.radial_velocity[row] == pytest.approx(velocity[order[members]].mean(), abs=1e-12)


def test_velocity_tells_a_person_from_the_car_that_it_passes() -> None:
    xy = [[15.0, 2.0], [16.0, 2.0], [15.3, 2.4], [15.4, 2.5]]
    together = ss.cluster(planted(xy, [0.0, 0.0, 0.0, 0.0]))
    apart = ss.cluster(planted(xy, [0.0, 0.0, 2.5, 2.6]))
    assert groups_of(together) == {frozenset({0, 1, 2, 3})}
    assert groups_of(apart) == {frozenset({0, 1}), frozenset({2, 3})}


@pytest.mark.parametrize(("across", "range_", "one"), [(4.0, 20.0, False), (4.0, 100.0, True), (6.0, 100.0, False)])
def test_reach_across_the_line_of_sight_grows_with_range(across: float, range_: float, one: bool) -> None:
    # sqrt(2^2 + (0.05 * 20)^2) = 2.2 m, sqrt(2^2 + (0.05 * 100)^2) = 5.4 m
    xy = np.array([[range_, -across / 2.0], [range_, across / 2.0]])
    assert ss.cluster(planted(xy, [0.0, 0.0])).num_clusters == int(one)
    along = np.array([[range_ - across / 2.0, 0.0], [range_ + across / 2.0, 0.0]])
    assert ss.cluster(planted(along, [0.0, 0.0])).num_clusters == 0


def test_scaled_distance_is_one_at_the_border() -> None:
    step = 2.0 * np.sqrt(1.0 - (0.9 / 1.5) ** 2)  # (along / 2 m)^2 + (0.9 / 1.5)^2 = 1
    for factor, count in ((0.999, 1), (1.001, 0)):
        points = planted([[30.0, 0.0], [30.0 + factor * step, 0.0]], [0.0, 0.9])
        assert ss.cluster(points).num_clusters == count


def test_the_end_of_the_velocity_interval_splits_nothing() -> None:
    edge = RADAR.unambiguous_velocity
    points = planted([[30.0, 0.0], [30.5, 0.0]], [edge - 0.2, -edge + 0.4])
    assert ss.cluster(points).num_clusters == 0
    found = ss.cluster(points, RADAR)
    assert found.num_clusters == 1
    assert found.radial_velocity[0] == pytest.approx(-edge + 0.1, abs=1e-9)


def test_velocities_are_compared_modulo_what_both_points_tell() -> None:
    narrow, wide = 2.0 * RADAR.unambiguous_velocity, 6.0 * RADAR.unambiguous_velocity
    one_apart = planted([[30.0, 0.0], [30.5, 0.0]], [0.2, narrow + 0.4])
    ends = planted([[30.0, 0.0], [30.5, 0.0]], [wide / 2.0 - 0.2, -wide / 2.0 + 0.4])
    for points, told, velocity in (
        (one_apart, None, 0.3),
        (one_apart, (narrow, narrow), 0.3),
        (one_apart, (wide, narrow), 0.3),
        (one_apart, (wide, wide), None),
        (ends, (wide, wide), -wide / 2.0 + 0.1),
    ):
        known = replace(points, velocity_interval=None if told is None else np.array(told))
        found = ss.cluster(known, RADAR)
        assert found.num_clusters == int(velocity is not None)
        assert velocity is None or found.radial_velocity[0] == pytest.approx(velocity, abs=1e-9)
    more = planted([[30.0, 0.0], [30.5, 0.0], [60.0, 0.0]], [0.2, narrow + 0.4, 0.0])  # one elsewhere changes nothing
    assert ss.cluster(replace(more, velocity_interval=np.array([wide, wide, narrow])), RADAR).num_clusters == 0


def test_labels_are_those_of_most_points_and_of_the_stronger_of_as_many() -> None:
    xy = [[20.0, 0.0], [20.5, 0.0], [21.0, 0.0], [50.0, 0.0], [50.5, 0.0], [80.0, 0.0]]
    points = planted(xy, np.zeros(6), power=[1.0, 2.0, 30.0, 4.0, 5.0, 9.0])
    labels = Labels(np.array([7, 7, 8, 7, 9, 5], np.int32), np.array([14, 14, 12, 14, 19, 1], np.uint8))
    found = ss.cluster(points, labels=labels)
    assert found.instance.tolist() == [7, 9] and found.semantic.tolist() == [14, 19]
    np.testing.assert_allclose(found.share, [2.0 / 3.0, 0.5])
    assert found.member.tolist() == [0, 0, 0, 1, 1, -1]
    np.testing.assert_allclose(found.power, [33.0, 9.0])
    assert ss.cluster(points).instance.tolist() == [0, 0]


def test_one_neighbour_less_leaves_single_points_out_or_in() -> None:
    points = planted([[20.0, 0.0], [50.0, 0.0]], [0.0, 0.0])
    assert ss.cluster(points).num_clusters == 0
    assert ss.cluster(points, min_points=1).num_points.tolist() == [1, 1]


@pytest.mark.parametrize("min_points", [1, 2])
def test_no_points_give_no_clusters(min_points: int) -> None:
    found = ss.cluster(planted(np.zeros((0, 2)), []), RADAR, min_points=min_points)
    assert found.num_clusters == 0 and found.position.shape == (0, 3) and found.member.shape == (0,)


def test_bad_input_is_refused() -> None:
    points = planted([[20.0, 0.0]], [0.0])
    with pytest.raises(InputTypeError, match="points"):
        ss.cluster(np.zeros((3, 3)))  # type: ignore[arg-type]
    with pytest.raises(InputTypeError, match="radar"):
        ss.cluster(points, "awr1843boost")  # type: ignore[arg-type]
    with pytest.raises(ParameterRangeError, match="distance"):
        ss.cluster(points, distance=0.0)
    with pytest.raises(ParameterRangeError, match="angle"):
        ss.cluster(points, angle=-0.1)
    with pytest.raises(ParameterRangeError, match="velocity"):
        ss.cluster(points, velocity=float("nan"))
    with pytest.raises(ParameterRangeError, match="min_points"):
        ss.cluster(points, min_points=0)
    with pytest.raises(ParameterRangeError, match="labels"):
        ss.cluster(points, labels=Labels(np.zeros(2, np.int32), np.zeros(2, np.uint8)))
    with pytest.raises(UnknownNameError, match="eps"):
        ss.cluster(points, eps=1.0)  # type: ignore[call-arg]
