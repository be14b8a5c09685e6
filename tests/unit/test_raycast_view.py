"""Rays are cast only where something that gives paths can be in view: what is not costs nothing."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

from scarl_sionna.core.pose import Pose
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.engine.load import load_scene
from scarl_sionna.radar.channel import plan_channel, solve_paths
from scarl_sionna.radar.channel.compose.budget import estimate
from scarl_sionna.radar.channel.raycast.kernel import RaycastKernel
from scarl_sionna.radar.optics.viewpoint import Viewpoint
from tests.scenes import Thing, ball, box, plane, write_scene

RADAR = RadarSpec()
POSE = Pose([0.0, 0.0, 0.8])
SIGN = Thing("sign", plane(0.6, 0.6, (20, 0, 1.2), (-1, 0.1, 0)), "TrafficSign", "steel")
TREE = ball(2.0, (-15, 5, 2), 3)


@pytest.fixture
def cast(monkeypatch) -> list[tuple[int, int]]:
    """Ranges of rays that are cast."""
    calls, hits = [], RaycastKernel.hits

    def counted(self, first, stop):
        calls.append((first, stop))
        return hits(self, first, stop)

    monkeypatch.setattr(RaycastKernel, "hits", counted)
    return calls


def test_a_tree_behind_the_radar_costs_no_ray(tmp_path, cast) -> None:
    state = load_scene(write_scene(tmp_path, [SIGN, Thing("tree", TREE, "Vegetation")])).at(0.0)
    paths = solve_paths(state, RADAR, POSE, "auto")
    assert not cast and paths.num_paths and paths.diagnostics["num_out_of_view"] == 1
    (row,) = (row for row in paths.diagnostics["solvers"] if row["solver"] == "raycast")
    assert row["instances"] == ["tree"] and (row["num_paths"], row["detail"]["num_hits"]) == (0, 0)
    few, many = (plan_channel(state, RADAR, POSE, num_rays=count).predicted["cpu_seconds"] for count in (1, 10**8))
    assert few == many  # nor does the plan expect any
    turned = Pose.from_euler(POSE.position, yaw=np.pi)
    assert solve_paths(state, RADAR, turned, "auto", num_rays=5_000).num_paths and len(cast) == 1


def test_what_is_out_of_reach_or_not_asked_for_costs_no_ray(tmp_path, cast) -> None:
    state = load_scene(write_scene(tmp_path, [SIGN, Thing("tree", TREE, "Vegetation")])).at(0.0)
    for asked in ({"max_distance": 19.0}, {"instances": ["tree"]}):
        assert solve_paths(state, RADAR, POSE, "raycast", **asked).num_paths == 0 and not cast
    paths = solve_paths(state, RADAR, POSE, "raycast", max_distance=21.0, num_rays=100_000)
    assert paths.num_paths and len(cast) == 1 and paths.diagnostics["num_hits"] >= paths.num_paths


def test_no_ball_is_sorted_out_of_which_a_part_is_in_view() -> None:
    """Against points on balls all around, of every size, for views up to half a sphere."""
    rng = np.random.default_rng(0)
    unit = rng.normal(size=(4_000, 3))
    unit /= np.linalg.norm(unit, axis=1, keepdims=True)
    held = missed = 0
    for _ in range(400):
        fov = np.radians(rng.uniform([2.0, 2.0], [180.0, 170.0]))
        pose = Pose.from_euler(rng.normal(size=3), *rng.uniform(-1.5, 1.5, 3))
        station = Viewpoint(pose, np.zeros(3), *fov)
        center, radius = pose.position + 10.0 * rng.normal(size=3), 10.0 ** rng.uniform(-1.0, 1.2)
        is_seen = station.sees(center + radius * unit).any()
        may = bool(station.may_hold(center[None], np.array([radius]))[0])
        assert may or not is_seen
        held, missed = held + may, missed + (may and not is_seen)
    assert 50 < held < 350 and missed < 0.15 * held  # nor is much kept of which nothing is seen


def test_a_body_high_up_that_reaches_into_the_view_is_in_view(tmp_path) -> None:
    """A degree of elevation high up is more than one of azimuth: what lies there is wider than its angle."""
    radar = RADAR.with_(azimuth_fov_deg=20.0, elevation_fov_deg=120.0)
    place = 10.0 * np.array([np.cos(0.95) * np.cos(0.45), np.cos(0.95) * np.sin(0.45), np.sin(0.95)])
    across = np.cross(place, [0.0, 0.0, 1.0]) / np.linalg.norm(np.cross(place, [0.0, 0.0, 1.0]))
    bar = box((3.6, 0.05, 0.05))
    turn = np.eye(4)
    turn[:3, :3] = np.column_stack([across, np.cross(place / 10.0, across), place / 10.0])
    bar.apply_transform(turn)
    bar.apply_translation(place)
    state = load_scene(write_scene(tmp_path, [Thing("bar", bar, "Static", "steel")])).at(0.0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        assert solve_paths(state, radar, Pose(), "raycast", num_rays=400_000).num_paths
    assert estimate(state, radar, Pose(), 1, 100.0).in_view
