"""The raycast solver's power against the number of rays."""

from __future__ import annotations

import numpy as np
import pytest

from scarl_sionna.core.pose import Pose
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.engine.load import load_scene
from scarl_sionna.radar.channel import solve_paths
from tests.scenes import Thing, ball, plane, write_scene

pytestmark = [
    pytest.mark.slow,
    pytest.mark.own_process(shared=True),
]  # it leaves much memory behind

RADAR = RadarSpec(azimuth_fov_deg=60.0, elevation_fov_deg=30.0)


def _power(paths) -> float:
    return float((np.abs(paths.a[:, 0, 0]) ** 2).sum())


@pytest.fixture(scope="module")
def state(tmp_path_factory):
    things = (
        Thing("ground", plane(256.0, 256.0, (0, 0, 0), (0, 0, 1)), "Roads", "grey", is_object=False),
        Thing("ball", ball(1.0, (12, 2, 1.5)), "Car", "steel"),
        Thing("wall", plane(8.0, 4.0, (24, -4, 2), (-1, 0, 0)), "Wall", "grey"),
    )
    return load_scene(write_scene(tmp_path_factory.mktemp("scene"), things)).at(0.0)


@pytest.fixture(scope="module")
def powers(state) -> dict[int, float]:
    pose = Pose([0, 0, 0.75])
    return {
        rays: _power(solve_paths(state, RADAR, pose, "raycast", num_rays=rays)) for rays in (10_000, 100_000, 1_000_000)
    }


def test_power_does_not_depend_on_the_number_of_rays(powers: dict[int, float]) -> None:
    # The ball (strongest) spans 0.17 rad; with N rays its outline is uncertain by about its perimeter of 0.52 rad times
    # a cell's half width, as a fraction of 0.022 sr: at 1e4 rays (cells of 7.4 mrad) at most 9 %, shrinking as 1 /
    # sqrt(N).
    finest = powers[1_000_000]
    assert powers[10_000] == pytest.approx(finest, rel=0.09)
    assert powers[100_000] == pytest.approx(finest, rel=0.03)


def test_constant_rcs_per_hit_grows_with_the_number_of_rays(state) -> None:
    # The paper's literal reading: ten times the rays, ten times the power (3 % as above).
    pose = Pose([0, 0, 0.75])
    few, many = (
        _power(solve_paths(state, RADAR, pose, "raycast", num_rays=n, rcs_model="per_hit"))
        for n in (100_000, 1_000_000)
    )
    assert many / few == pytest.approx(10.0, rel=0.06)


def test_smooth_scene_converges_with_second_order(tmp_path) -> None:
    # A wall wider than the field of view has no edges: midpoint rule, error ~ 1 / num_rays.
    wall = Thing("wall", plane(64.0, 64.0, (20.5, 0, 0), (-1, 0, 0)), "Wall", "grey")
    state = load_scene(write_scene(tmp_path, [wall])).at(0.0)
    power = {
        n: _power(solve_paths(state, RADAR, Pose(), "raycast", num_rays=n, hits_per_cell=None, grid="regular"))
        for n in (400, 6_400, 1_000_000)
    }
    error = {n: abs(power[n] / power[1_000_000] - 1.0) for n in (400, 6_400)}
    # 16 times the rays: 16 times less; the two grids' cells differ in shape by a few per cent, so 12 to 20.
    assert error[400] > 1e-6
    assert error[400] / error[6_400] == pytest.approx(16.0, rel=0.25)
