"""Chains of mirrors by images of the radar: the same paths as by Sionna RT's rays, and as closed forms say."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
import trimesh

from scarl_sionna.core.mount import Mount
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.settings.mirrors import DEFAULT_MIRRORS
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.engine.load import load_scene
from scarl_sionna.radar.channel import ChannelPlan, Share, solve_paths
from scarl_sionna.radar.channel.compose.mirror_chains import MOST_CHAINS, _chains, mirror_chains, most_mirrors
from scarl_sionna.radar.channel.compose.mirror_legs import MirrorView
from scarl_sionna.radar.channel.compose.mirrors import find_mirrors
from tests.scenes import Thing, plane, write_scene

pytestmark = pytest.mark.own_process(shared=True)  # beside what a worker has, too much memory

RADAR = RadarSpec(elevation_fov_deg=120.0, azimuth_fov_deg=180.0)


def wall(name, size, center, normal, material="grey") -> Thing:
    return Thing(name, plane(*size, center, normal), "Wall", material, is_object=False)


GROUND = Thing("ground", plane(60.0, 60.0, (20, 0, -1.0), (0, 0, 1)), "Roads", "steel", is_object=False)
FRONT = wall("front", (40.0, 40.0), (22, 0, 0), (-1, 0, 0))
LEFT = wall("left", (48.0, 48.0), (4, 9, 0), (0, -1, 0), "steel")
RIGHT = wall("right", (48.0, 48.0), (4, -7, 0), (0, 1, 0))
SCREEN = wall("screen", (3.0, 3.0), (10, 0, 0), (-1, 0, 0), "steel")
TURNED = Thing(
    "turned",
    trimesh.Trimesh([(14, -1, -1), (16, 1, -1), (16, 1, 3), (14, -1, 3)], [(0, 2, 1), (0, 3, 2)], process=False),
    "Wall",
    "steel",
    is_object=False,
)
SCENES = {
    "corner": [FRONT, LEFT],
    "corner on the ground": [FRONT, LEFT, GROUND],
    "canyon": [LEFT, RIGHT],
    "room": [FRONT, LEFT, RIGHT, GROUND],
    "screened wall": [FRONT, SCREEN],
    "askew": [FRONT, LEFT, TURNED],
}


def both(folder, things, depth, mount):
    """Return paths by images and by rays."""
    state = load_scene(write_scene(folder, things, [])).at(0.0)
    names = tuple(thing.name for thing in things)
    found = [
        solve_paths(
            state,
            RADAR,
            mount,
            "hybrid",
            plan=ChannelPlan((Share("raycast", (), {"num_rays": 100}),), names, chains=chains),
            sionna={"num_samples": 100_000, "max_depth": depth},
        )
        for chains in ("images", "sionna")
    ]
    order = [np.lexsort([*np.sort(paths.instance, axis=1).T, np.round(paths.length, 6)]) for paths in found]
    return [paths.select(index) for paths, index in zip(found, order, strict=True)]


@pytest.mark.some(4)
@pytest.mark.parametrize("depth", [1, 2, 3])
@pytest.mark.parametrize("name", SCENES)
def test_paths_are_those_that_rays_find(tmp_path, name, depth) -> None:
    mount = Mount(Pose([0.3, 0.4, 0.2]), Twist((9.0, 1.0, 0.0), (0.0, 0.0, 0.2)))
    images, rays = both(tmp_path, SCENES[name], depth, mount)
    assert images.num_paths == rays.num_paths and images.num_paths > 0
    for field in ("length", "length_rate", "length_acceleration", "tx_point", "rx_point", "rx_image", "rx_velocity"):
        np.testing.assert_allclose(getattr(images, field), getattr(rays, field), rtol=1e-9, atol=1e-9, err_msg=field)
    # Where walls meet at right angles both orders are one path, and either may stay. Of three walls each order has its
    # own cross-polarisation.
    apart = np.abs(images.a - rays.a).max(axis=(1, 2)) / np.abs(rays.a).max(axis=(1, 2))
    assert (apart < np.where(images.depth == 3, 2e-3, 1e-9)).all()
    for field in ("instance", "interaction"):
        assert (np.sort(getattr(images, field), axis=1) == np.sort(getattr(rays, field), axis=1)).all(), field
    alone = images.depth == 1
    assert (images.semantic[alone] == rays.semantic[alone]).all() and (images.depth == rays.depth).all()


def test_lengths_in_a_room_are_those_of_the_images(tmp_path) -> None:
    """Of a radar at the origin: walls at 22 m, 9 m and 7 m, the ground at 1 m.

    The two orders of a corner of 90 deg are one path: each is half of the wave.
    """
    images, _ = both(tmp_path, SCENES["room"], 2, Mount(Pose()))
    alone = [2 * away for away in (22.0, 9.0, 7.0, 1.0)]
    square = [2 * np.hypot(*pair) for pair in ((22, 9), (22, 7), (22, 1), (9, 1), (7, 1))]
    between = [2 * (9.0 + 7.0)] * 2
    np.testing.assert_allclose(np.sort(images.length), np.sort(alone + square + between), rtol=1e-9)


def test_without_reflections_there_is_no_chain(tmp_path) -> None:
    images, rays = both(tmp_path, SCENES["canyon"], 0, Mount(Pose()))
    assert images.num_paths == rays.num_paths == 0


def test_what_is_smaller_than_its_fresnel_zone_is_no_mirror(tmp_path) -> None:
    """At 20 m and 77 GHz the zone is 0.4 m wide; rays take any face for a mirror without end."""
    plate = wall("plate", (0.3, 0.3), (20, 0, 0), (-1, 0, 0), "steel")
    images, rays = both(tmp_path, [plate], 1, Mount(Pose()))
    assert (images.num_paths, rays.num_paths) == (0, 1)


def test_a_hole_in_a_mirror_does_not_reflect(tmp_path) -> None:
    """Four walls around a hole lie in one plane: their box has no hole."""
    frame = [((4.0, 20.0), (0.0, 8.0)), ((4.0, 20.0), (0.0, -8.0)), ((4.0, 4.0), (8.0, 0.0)), ((4.0, 4.0), (-8.0, 0.0))]
    meshes = [plane(size[0] * 3.0, size[1] - 8.0, (20, *place), (-1, 0, 0)) for size, place in frame]
    around = Thing("around", trimesh.util.concatenate(meshes), "Wall", "steel", is_object=False)
    state = load_scene(write_scene(tmp_path, [around], [])).at(0.0)
    for height, expected in ((0.0, 0), (8.0, 1)):
        mount = Mount(Pose([0.0, height, 0.0]))
        mirrors = find_mirrors(state, [around_number(state)], mount.pose.position, RADAR.wavelength)
        view = MirrorView(state, RADAR, mount, (), mirrors, DEFAULT_MIRRORS)
        assert mirror_chains(view, 1, 100.0, 0.1).num_paths == expected


def around_number(state) -> int:
    return next(number for number, info in state.world.instances.items() if info.name == "around")


def test_all_sequences_are_looked_at_once() -> None:
    found = {tuple(row) for piece in _chains(4, 3) for row in piece.tolist()}
    wanted = {row for length in (1, 2, 3) for row in np.ndindex(*[4] * length)}
    assert found == {row for row in wanted if all(a != b for a, b in pairwise(row))}
    assert sum(len(piece) for piece in _chains(4, 3)) == len(found)
    assert sum(len(piece) for piece in _chains(most_mirrors(4), 4)) <= MOST_CHAINS
    assert not list(_chains(0, 2))
