"""Blocks of chirps with hits of raycast: from a radar that moves, what stands still stays as without blocks."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.core.errors import ScarlWarning
from scarl_sionna.engine.world import World
from scarl_sionna.radar.sensor import Radar
from scarl_sionna.signal.processing import range_doppler, virtual_cube
from tests.scenes import Thing, plane, write_scene

RADAR = ss.RadarSpec().with_(num_chirps=64, num_samples=128)
SETTINGS = ss.RadarSettings().with_(noise=False, raycast=ss.RaycastSettings(num_rays=20_000))
PLAN = ss.ChannelPlan((ss.Share("sbr", ("plate",)), ss.Share("raycast", ("road", "wall"))), (), echoes=False)


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> World:
    """A road, a rough wall beside it and a plate that comes at 5 m/s."""
    road = Thing("road", plane(80.0, 30.0, (30.0, 0.0, 0.0), (0.0, 0.0, 1.0)), "Roads", "grey")
    wall = Thing("wall", plane(40.0, 4.0, (25.0, 8.0, 2.0), (0.0, -1.0, 0.0)), "Wall", "grey")
    moving = {"kind": "constant_twist", "position": [15.0, 0.0, 1.0], "velocity": [-5.0, 0.0, 0.0]}
    plate = Thing("plate", plane(0.1, 0.1, (0.0, 0.0, 0.0), (-1.0, 0.0, 0.0)), "Car", "steel", moving)
    return ss.load_scene(write_scene(tmp_path_factory.mktemp("blocks"), [road, wall], [plate]))


@pytest.mark.parametrize("method", ["raycast", "auto", "hybrid"])
@pytest.mark.parametrize("turn", [0.0, 0.3])
def test_what_stands_still_is_the_same_with_and_without_blocks(world: World, method: str, turn: float) -> None:
    """With new casts a tenth of these cells lost 37 dB and more, and others gained 6 to 14 dB."""
    settings = SETTINGS.with_(method=method, plan=PLAN if method == "hybrid" else None)
    mount = ss.Mount(ss.Pose([0.0, 0.0, 1.0]), ss.Twist([20.0, 0.0, 0.0], [0.0, 0.0, turn]))
    maps = []
    for chirps in (None, 16):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ScarlWarning)
            radar = Radar(RADAR, settings.with_(chirps_per_block=chirps))
            frame = radar.observe(world.at(0.0), mount, np.random.default_rng(0))
        maps.append(10.0 * np.log10(range_doppler(virtual_cube(frame.adc, RADAR), RADAR).power))
    one, other = maps
    strong = one > one.max() - 30.0
    assert strong.sum() > 20
    assert np.abs(other - one)[strong].max() < 1.0


def test_blocks_of_raycast_are_told_to_change_nothing(world: World) -> None:
    with pytest.warns(ScarlWarning, match="blocks of chirps change nothing"):
        paths_at = ss.retraced(world, RADAR, ss.Pose([0.0, 0.0, 1.0]), 0.0, "raycast", num_rays=1000)
    start, end = paths_at(0.0), paths_at(RADAR.frame_time)
    assert start.num_paths == end.num_paths
    np.testing.assert_allclose(end.length, start.length + RADAR.frame_time * start.length_rate, rtol=1e-12)


def test_a_radar_that_moves_has_the_hits_in_its_own_frame(world: World) -> None:
    """In one list with what is traced again there."""
    mount = ss.Mount(ss.Pose([0.0, 0.0, 1.0]), ss.Twist([20.0, 0.0, 0.0], [0.0, 0.0, 0.5]))
    paths_at = ss.retraced(world, RADAR, mount, 0.0, settings=SETTINGS.with_(method="hybrid", plan=PLAN))
    start, end = paths_at(0.0), paths_at(0.02)
    held = [paths.select(paths.filled("linear_motion")) for paths in (start, end)]
    assert 0 < held[1].num_paths == held[0].num_paths < end.num_paths
    assert end.world_from_tx.position == pytest.approx([0.4, 0.0, 1.0])
    np.testing.assert_allclose(held[1].tx_point, held[0].tx_point, atol=2e-3)  # still points in the world
    assert not np.array_equal(start.select(~start.filled("linear_motion")).tx_point[0], end.tx_point[0])
