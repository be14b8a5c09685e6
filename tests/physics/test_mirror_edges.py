"""Where a mirror ends: tubes are cut along its edge, so the size of the patches decides nothing.

With sharp ends (`end_reach` 0) that is image theory; what Fresnel's integral makes of them stands in test_mirror_ends.
"""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from scarl_sionna.core.pose import Pose
from scarl_sionna.core.settings.mirrors import MirrorSettings
from scarl_sionna.core.settings.sbr import SbrSettings
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.engine.load import load_scene
from scarl_sionna.radar.channel import ChannelPlan, Share, solve_paths
from tests.scenes import Thing, box, plane, write_scene

RADAR = RadarSpec(elevation_fov_deg=60.0)
POSE = Pose([0.0, 0.0, 0.6])


def solve(state, max_phase: float):
    knobs = SbrSettings(max_phase=max_phase, max_depth=1, floor_db=None)
    plan = ChannelPlan((Share("sbr", ("post",), knobs, through_mirrors=True),), ("road",), echoes=False)
    return solve_paths(state, RADAR, POSE, "hybrid", plan=plan, mirrors=MirrorSettings(end_reach=0.0))


def lowest(paths) -> float:
    """Return the height of the lowest point that is met over the road, on a way there [m]."""
    there = (paths.instance[:, 0] == 1) & (paths.depth == 2)
    return float(paths.rx_point[there, 2].min())


@pytest.mark.parametrize("end", [12.0, 16.0, 19.0])
def test_a_post_behind_the_end_of_the_road_is_seen_from_the_height_of_image_theory_on(tmp_path, end: float) -> None:
    """A point at the height z over x = 20 is met at x = 20 * 0.6 / (0.6 + z), so from z = 0.6 (20 / end - 1) on."""
    post = trimesh.creation.box(extents=(0.1, 0.2, 3.0))
    post.apply_translation([20.05, 0.0, 1.5])
    things = [
        Thing("road", box((end, 8.0, 0.2), (end / 2.0, 0.0, -0.1)), "Roads", "steel", is_object=False),
        Thing("post", post, "Pole", "steel"),
    ]
    state = load_scene(write_scene(tmp_path, things)).at(0.0)
    expected = 0.6 * (20.0 / end - 1.0)
    heights = [lowest(solve(state, max_phase)) for max_phase in (2.0, 0.4)]
    # middles of the lowest patches: a third of a patch (0.5 m and 0.2 m at most) above the cut
    for height, size in zip(heights, (0.5, 0.23), strict=True):
        assert expected - 0.01 < height < expected + 0.67 * size


def test_the_echo_beside_a_road_that_ends_does_not_depend_on_the_patches(tmp_path) -> None:
    """The bisector of a straight and a mirrored way meets the post at its foot, which the road does not reach."""
    things = [
        Thing("road", plane(16.0, 16.0, (8.0, 0.0, 0.0)), "Roads", "steel", is_object=False),
        Thing("post", box((0.1, 0.2, 3.0), (20.05, 0.0, 1.5)), "Pole", "steel"),
    ]
    state = load_scene(write_scene(tmp_path, things)).at(0.0)

    def level(max_phase: float) -> float:
        paths = solve(state, max_phase)
        wave = np.exp(-2j * np.pi * RADAR.center_frequency / 299792458.0 * paths.length)
        return float(20.0 * np.log10(abs(np.sum(paths.a[:, 0, 0] * wave))))

    fine = level(0.2)
    assert [level(max_phase) for max_phase in (2.0, 1.0, 0.4)] == pytest.approx([fine] * 3, abs=0.1)
