"""Ways over mirrors that the two ends of paths share are computed once."""

from __future__ import annotations

import numpy as np

from scarl_sionna.core.pose import Pose
from scarl_sionna.core.settings.mirrors import DEFAULT_MIRRORS
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.engine.load import load_scene
from scarl_sionna.radar.channel import solve_paths
from scarl_sionna.radar.channel.compose.ghosts import Image, _legs, _shown
from scarl_sionna.radar.channel.compose.mirror_legs import MirrorView
from scarl_sionna.radar.channel.compose.mirrors import find_mirrors
from tests.scenes import Thing, box, plane, write_scene

RADAR, POSE = RadarSpec(), Pose([0.0, 0.0, 0.6])


def test_from_one_image_as_from_two_at_one_place(tmp_path) -> None:
    """Paths of one bounce begin and end at one point, those in the corner do not; a pillar hides some."""
    things = [
        Thing("ground", plane(20.0, 6.0, (6, 0, 0)), "Ground", "steel", is_object=False),
        Thing("one", plane(1.0, 1.0, (10, 0.5, 0.8), (-1, 0, 0)), "Static", "steel"),
        Thing("other", plane(1.0, 1.0, (9.5, 1.0, 0.8), (0, -1, 0)), "Static", "steel"),
        Thing("pillar", box((0.2, 0.2, 3.0), (5, -0.1, 1.5)), "Static", "steel"),
    ]
    state = load_scene(write_scene(tmp_path, things)).at(0.0)
    found = solve_paths(state, RADAR, POSE, "sbr", max_depth=2)
    alike = (found.tx_point == found.rx_point).all(axis=1)
    assert 0.1 < alike.mean() < 1.0
    mirrors = find_mirrors(state, [1], POSE.position, RADAR.wavelength)
    view = MirrorView(state, RADAR, state.as_mount(POSE), (2, 3), mirrors, DEFAULT_MIRRORS)
    image = Image(Pose([0.0, 0.0, -0.6]), (mirrors[0],))
    once, twice = (image, image), (image, Image(*image))
    seen = _shown(view, found, once)
    assert 0.1 < seen.mean() < 0.95
    np.testing.assert_array_equal(seen, _shown(view, found, twice))
    for one, other in zip(_legs(view, found, once), _legs(view, found, twice), strict=True):
        assert len(one.image) == found.num_paths
        for name, column in vars(one).items():
            np.testing.assert_allclose(column, getattr(other, name), rtol=1e-12, atol=1e-12)
