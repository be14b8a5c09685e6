"""Tracks: known motion, seen without noise or with noise as assumed, from a radar at rest or on the move."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import scipy.stats

import scarl_sionna as ss
from scarl_sionna.core.errors import InputTypeError, ParameterRangeError, UnknownNameError
from tests.radar_points import planted

STEP = 0.05


def seen(mount: ss.Mount, place: np.ndarray, velocity: np.ndarray) -> ss.RadarClusters:
    """Return one cluster an object as an ideal radar sees it: (n, 3) in the world, (n, 3) [m/s]."""
    away = place - mount.pose.position
    rate = ((velocity - mount.twist.linear) * away).sum(axis=1) / np.linalg.norm(away, axis=1)
    points = planted(mount.pose.inverse().apply(place)[:, :2], rate)
    clusters = ss.cluster(points, min_points=1, distance=0.01, angle=0.0, labels=Numbered(len(place)))
    return clusters


class Numbered:
    """Labels of points that are objects of their own: instance 1, 2, ..."""

    def __init__(self, count: int) -> None:
        self.instance = np.arange(1, count + 1, dtype=np.int32)
        self.semantic = np.full(count, 14, dtype=np.uint8)


def run(
    mount_at: Callable[[float], ss.Mount], start: np.ndarray, velocity: np.ndarray, count: int, **options: float
) -> ss.RadarTracks:
    times = STEP * np.arange(count)
    mounts = [mount_at(time) for time in times]
    frames = [seen(mount, start + time * velocity, velocity) for mount, time in zip(mounts, times, strict=True)]
    return ss.track(frames, times, mounts, **options)


def at_rest(_: float) -> ss.Mount:
    return ss.Mount(ss.Pose([2.0, -1.0, 0.0]))


def test_a_straight_way_is_followed_to_its_place_and_velocity() -> None:
    start, velocity = np.array([[30.0, -8.0, 0.0]]), np.array([[-4.0, 3.0, 0.0]])
    found = run(at_rest, start, velocity, 60)
    assert found.num_tracks == 1
    assert found.frame.tolist() == list(range(2, 60))  # confirmed by the third cluster
    last = found.select(found.frame == 59)
    np.testing.assert_allclose(last.position[0], (start + 59 * STEP * velocity)[0, :2], atol=0.05)
    np.testing.assert_allclose(last.velocity[0], velocity[0, :2], atol=0.15)
    assert (found.instance == 1).all() and (found.semantic == 14).all() and (found.cluster == 0).all()


def test_what_stands_has_no_speed_for_a_radar_that_drives_and_turns() -> None:
    """Exact data: the error is that of the start, which has no velocity across the line of sight: zero by luck.

    A wrong sign or frame of the radar's own motion shows as its 12 m/s, a lost turn as 12 m/s * 0.3 rad.
    """

    def driving(time: float) -> ss.Mount:
        heading = 0.3 * time
        radius = 12.0 / 0.3
        place = np.array([radius * np.sin(heading), radius * (1.0 - np.cos(heading)), 0.0])
        ahead = np.array([np.cos(heading), np.sin(heading), 0.0])
        return ss.Mount(ss.Pose.from_heading(place, heading + 0.2), ss.Twist(12.0 * ahead, [0.0, 0.0, 0.3]))

    poles = np.array([[35.0, 8.0, 0.0], [45.0, -3.0, 0.0], [50.0, 25.0, 0.0]])
    found = run(driving, poles, np.zeros((3, 3)), 30)
    assert found.num_tracks == 3
    assert np.abs(found.velocity).max() < 0.02
    for number in range(3):
        own = found.select(found.track == number)
        np.testing.assert_allclose(own.position, np.broadcast_to(poles[own.instance[0] - 1, :2], (28, 2)), atol=0.02)


def test_a_tilted_radar_sees_motion_over_ground() -> None:
    """A radar 30 deg nose up at the ground: direction and range rate are brought to the ground plan."""
    mount = ss.Mount(ss.Pose.from_euler([0.0, 0.0, 0.0], pitch=-0.5))
    start, velocity = np.array([[20.0, 0.0]]), np.array([6.0, 0.0])
    frames, times = [], STEP * np.arange(20)
    for time in times:
        place = np.array([*(start[0] + time * velocity), np.tan(0.5) * (20.0 + 6.0 * time)])  # in the radar's plane
        away = mount.pose.inverse().apply(place)
        frames.append(ss.cluster(planted([away[:2]], [6.0 * np.cos(0.5)]), min_points=1))
    found = ss.track(frames, times, mount)
    assert found.velocity[-1] == pytest.approx([6.0, 0.0], abs=0.02)
    assert found.position[-1] == pytest.approx([20.0 + 6.0 * times[-1], 0.0], abs=0.05)


def test_objects_that_cross_keep_their_numbers() -> None:
    start = np.array([[30.0, -6.0, 0.0], [30.0, 6.0, 0.0]])
    velocity = np.array([[0.5, 4.0, 0.0], [-0.5, -4.0, 0.0]])
    found = run(at_rest, start, velocity, 60)
    assert found.num_tracks == 2
    for number in (0, 1):
        own = found.select(found.track == number)
        assert len(set(own.instance.tolist())) == 1
        sign = 1.0 if own.instance[0] == 1 else -1.0
        np.testing.assert_allclose(own.velocity[-1], sign * np.array([0.5, 4.0]), atol=0.2)


def test_a_track_lives_through_as_many_gaps_as_it_may() -> None:
    start, velocity = np.array([[30.0, 0.0, 0.0]]), np.array([[3.0, 0.0, 0.0]])
    none = ss.cluster(planted(np.zeros((0, 2)), []))
    times = STEP * np.arange(14)
    for gap, tracks in ((2, 1), (3, 2)):
        frames = [seen(at_rest(0.0), start + time * velocity, velocity) for time in times]
        frames[5 : 5 + gap] = [none] * gap
        found = ss.track(frames, times, at_rest(0.0), max_missed=2)
        assert found.num_tracks == tracks
        assert found.cluster[found.frame == 5].tolist() == [-1]
        size = np.trace(found.covariance, axis1=1, axis2=2)
        assert size[found.frame == 6] > size[found.frame == 5] > size[found.frame == 4]


def test_one_false_cluster_makes_no_track() -> None:
    """Nor do clusters farther apart than anything drives: 30 m a frame."""
    times = STEP * np.arange(6)
    frames = [ss.cluster(planted([[20.0 + 30.0 * k, 0.0]], [0.0]), min_points=1) for k in range(6)]
    found = ss.track(frames, times, ss.Pose())
    assert found.num_tracks == 0 and found.position.shape == (0, 2) and found.covariance.shape == (0, 4, 4)
    assert ss.track(frames, times, ss.Pose(), confirm=1).num_tracks == 6


def test_the_gate_is_where_its_probability_says() -> None:
    """A second cluster just within or beyond the gate of range rate alone, from exact quantities of a fresh track.

    After one cluster at rest on the x axis, the rate's variance of the prediction is that of the first measurement and
    of the prior, and the acceleration's q T; the innovation adds the measurement's own.
    """
    q, prior, deviation = 1.0, 8.0, 0.3
    variance = (deviation**2 + prior**2 + q * STEP) + deviation**2
    edge = np.sqrt(scipy.stats.chi2.ppf(0.99, 3))
    # position is correlated with the rate after the step: the cluster is put where the gain expects it, at r + v T
    for share, count in ((0.98, 1), (1.02, 0)):
        rate = share * edge * np.sqrt(variance)
        rows = (deviation**2 + prior**2) * STEP + q * STEP**2 / 2.0
        place = 40.0 + rate * rows / (deviation**2 + prior**2 + q * STEP + deviation**2)
        frames = [ss.cluster(planted([[x, 0.0]], [v]), min_points=1) for x, v in ((40.0, 0.0), (place, rate))]
        assert ss.track(frames, [0.0, STEP], ss.Pose(), confirm=2).num_tracks == count


def test_the_first_covariance_is_that_of_the_measurement_and_of_the_prior() -> None:
    """On the x axis at 40 m: 0.5 m along, sqrt((0.02 * 40)^2 + 0.5^2) across, the rate along beside the prior."""
    found = ss.track([ss.cluster(planted([[40.0, 0.0]], [1.0]), min_points=1)], [0.0], ss.Pose(), confirm=1)
    expected = np.diag([0.5**2, 0.8**2 + 0.5**2, 0.3**2 + 8.0**2, 8.0**2])
    np.testing.assert_allclose(
        found.covariance[0], expected, rtol=0.01, atol=0.03
    )  # the slope of the rate over y: 1/40
    assert found.velocity[0] == pytest.approx([1.0, 0.0], abs=1e-9)


def test_a_track_is_labelled_by_most_of_its_clusters() -> None:
    frames = []
    for number, instance in enumerate((3, 3, 5, 5, 5, 0)):
        labels = Numbered(1)
        labels.instance[:], labels.semantic[:] = instance, 10 + instance
        frames.append(ss.cluster(planted([[30.0 + 0.1 * number, 0.0]], [2.0]), labels=labels, min_points=1))
    found = ss.track(frames, STEP * np.arange(6), ss.Pose())
    assert found.instance.tolist() == [3, 5, 5, 5]  # 3 3 5, then as many: the latest, then most; 0 has no vote
    assert found.semantic.tolist() == [13, 15, 15, 15]


def test_errors_are_as_large_as_the_covariances_say() -> None:
    """Normalised squared errors of 24 ways with the assumed noise: chi-square with 4 degrees each [99.9 %]."""
    runs, count, q = 24, 25, 0.5
    errors = np.zeros((runs, count))
    for seed in range(runs):
        rng = np.random.default_rng(seed)
        state = np.concatenate([[40.0, 0.0] + rng.normal(0.0, 5.0, 2), rng.normal(0.0, 8.0, 2)])
        times, frames, mounts, truth = STEP * np.arange(count), [], [], []
        step = np.eye(4) + STEP * np.eye(4, k=2)
        noise = q * np.kron([[STEP**3 / 3.0, STEP**2 / 2.0], [STEP**2 / 2.0, STEP]], np.eye(2))
        for time in times:
            mount = ss.Mount(ss.Pose([5.0 * time, 0.0, 0.0]), ss.Twist([5.0, 0.0, 0.0]))
            away = state[:2] - mount.pose.position[:2]
            range_, angle = np.hypot(*away), np.arctan2(away[1], away[0])
            rate = (state[2:] - [5.0, 0.0]) @ away / range_
            range_seen = range_ + rng.normal(0.0, 0.5)
            # the filter takes 0.5 m across at the range that it measures
            angle += rng.normal(0.0, np.hypot(0.02, 0.5 / range_seen))
            xy = range_seen * np.array([np.cos(angle), np.sin(angle)])
            frames.append(ss.cluster(planted([xy], [rate + rng.normal(0.0, 0.3)]), min_points=1))
            mounts.append(mount)
            truth.append(state)
            state = step @ state + rng.multivariate_normal(np.zeros(4), noise)
        found = ss.track(frames, times, mounts, acceleration=q, gate=1.0 - 1e-9, confirm=1)
        assert found.num_tracks == 1
        away = np.concatenate([found.position, found.velocity], axis=1) - truth
        errors[seed] = np.einsum("ni,nij,nj->n", away, np.linalg.inv(found.covariance), away)
    low, high = scipy.stats.chi2.ppf([0.0005, 0.9995], 4 * runs) / runs
    assert low < errors[:, -1].mean() < high
    assert low < errors[:, count // 2].mean() < high


def test_bad_input_is_refused() -> None:
    one = ss.cluster(planted([[20.0, 0.0]], [0.0]), min_points=1)
    pose = ss.Pose()
    with pytest.raises(ParameterRangeError, match="no frames"):
        ss.track([], [], pose)
    with pytest.raises(InputTypeError, match="clusters"):
        ss.track(one, [0.0], pose)  # type: ignore[arg-type]
    with pytest.raises(InputTypeError, match=r"clusters\[0\]"):
        ss.track([planted([[20.0, 0.0]], [0.0])], [0.0], pose)  # type: ignore[list-item]
    with pytest.raises(ParameterRangeError, match="increasing"):
        ss.track([one, one], [0.1, 0.1], pose)
    with pytest.raises(ParameterRangeError, match="times"):
        ss.track([one, one], [0.1], pose)
    with pytest.raises(ParameterRangeError, match="times"):
        ss.track([one], [np.nan], pose)
    with pytest.raises(ParameterRangeError, match="mounts"):
        ss.track([one, one], [0.1, 0.2], [pose])
    with pytest.raises(InputTypeError, match="mount"):
        ss.track([one], [0.1], [[0.0, 0.0, 0.0]])  # type: ignore[list-item]
    for name, value in (("gate", 1.0), ("confirm", 0), ("max_missed", -1), ("confirm", 1.5), ("position_std", 0.0)):
        with pytest.raises(ParameterRangeError, match=name):
            ss.track([one], [0.1], pose, **{name: value})  # type: ignore[arg-type]
    with pytest.raises(UnknownNameError, match="gates"):
        ss.track([one], [0.1], pose, gates=0.9)  # type: ignore[call-arg]
