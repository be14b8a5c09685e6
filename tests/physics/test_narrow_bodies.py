"""A narrow body that a radar sees in the side of a large one: no tube is so coarse that it slips through."""

from __future__ import annotations

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.core.settings.sbr import SbrSettings
from scarl_sionna.engine.device import device
from scarl_sionna.engine.load import load_scene
from scarl_sionna.radar.channel import solve_paths
from scarl_sionna.radar.optics.tubes import narrow
from tests.scenes import Thing, box, write_scene

RADAR, POSE = ss.RadarSpec(), ss.Pose([0.0, 0.0, 0.0])
COARSE = SbrSettings(max_phase=3.0, integration_phase=0.1, max_turn=3.0, max_depth=2, floor_db=None)


def scene(folder, width: float, place: float):
    """A wall of steel at 45 deg, 20 m ahead, and a post 15 m to its right, which it shows at 35 m."""
    wall = box((0.1, 6.0, 3.0))
    wall.apply_transform(np.array([[1, -1, 0, 0], [1, 1, 0, 0], [0, 0, np.sqrt(2.0), 0], [0, 0, 0, 1]]) / np.sqrt(2.0))
    wall.vertices[:, 0] += 20.0
    post = box((width, width, 1.0), (20.0 + place, -15.0, 0.1))
    return load_scene(
        write_scene(folder, [Thing("wall", wall, "Wall", "steel"), Thing("post", post, "Pole", "steel")])
    ).at(0.0)


def seen_in_wall(state, knobs: SbrSettings) -> float:
    """Return the power of the post's echo by the wall alone [dB], each patch by itself."""
    paths = solve_paths(state, RADAR, POSE, "sbr", settings=knobs)
    table = {info.name: number for number, info in state.world.instances.items()}
    by = (paths.depth == 2) & (paths.instance[:, 0] == table["wall"]) & (paths.instance[:, 1] == table["post"])
    wave = np.exp(-2j * np.pi * RADAR.center_frequency / 299792458.0 * paths.length)
    return float(20.0 * np.log10(max(abs(np.sum((paths.a[:, 0, 0] * wave)[by])), 1e-30)))


@pytest.mark.some(2)
@pytest.mark.parametrize("width", [0.04, 0.1])
@pytest.mark.parametrize("place", [-0.31, 0.0, 0.47])
def test_a_post_is_found_in_a_wall_by_coarse_tubes(tmp_path, width: float, place: float) -> None:
    state = scene(tmp_path, width, place)
    wanted = seen_in_wall(
        state, COARSE.with_(ray_spacing=2.5, edge_spacing=2.5)
    )  # a probe every centimetre of the wall
    assert wanted > -200.0
    assert seen_in_wall(state, COARSE.with_(edge_share=0.03)) == pytest.approx(wanted, abs=0.5)


def test_without_its_balls_it_is_missed_or_found_in_part(tmp_path) -> None:
    errors = []
    for number, place in enumerate((-0.31, 0.0, 0.47)):
        state = scene(tmp_path / str(number), 0.04, place)
        knobs = COARSE.with_(edge_share=0.03, narrow_share=1.0)
        errors.append(seen_in_wall(state, knobs) - seen_in_wall(state, knobs.with_(ray_spacing=5.0)))
    assert np.abs(errors).max() > 1.0, errors


def test_balls_cover_their_body(tmp_path) -> None:
    state = scene(tmp_path, 0.1, 0.0)
    post = next(number for number, info in state.world.instances.items() if info.name == "post")
    points = np.concatenate([state.part_corners(part) for part in state.world.instances[post].parts])
    balls = narrow.NarrowBodies.of_mesh(points)
    single = balls.behind == np.arange(len(balls.behind)) + 1
    away = np.linalg.norm(points.reshape(-1, 1, 3) - balls.center[single], axis=2)
    assert (away <= balls.radius[single] * (1.0 + 1e-9)).any(axis=1).all()
    assert balls.width == pytest.approx(0.1, rel=1e-5)
    assert single.sum() == 5 and balls.radius[single].max() < 0.13


@pytest.mark.parametrize(("seed", "num_balls"), [(0, 1), (1, 2), (2, 17), (3, 400)])
def test_the_tree_of_balls_gives_what_all_balls_give(seed: int, num_balls: int) -> None:
    """Against every ball by NumPy, with bodies beside, behind and around the tubes."""
    rng = np.random.default_rng(seed)
    center = rng.uniform(-40.0, 40.0, (num_balls, 3))
    radius, width = rng.uniform(0.05, 3.0, num_balls), rng.uniform(0.02, 2.0, num_balls)
    one = np.ones(1, dtype=np.int64)
    rows = [slice(k, k + 1) for k in range(num_balls)]
    parts = [narrow.NarrowBodies(center[k], radius[k], width[k], one) for k in rows]
    balls = narrow.NarrowBodies.of_parts([(part, ss.Pose()) for part in parts])
    corners = rng.uniform(-20.0, 20.0, (3000, 1, 3)) + rng.normal(0.0, 0.3, (3000, 3, 3))
    source, wide = rng.uniform(-30.0, 30.0, (3000, 3)), rng.choice([0.05, 0.4, np.inf], 3000)
    nothing = np.zeros(3000)
    for is_way_in in (True, False):
        with device() as on:
            found = balls.spacing(on, corners, source, (wide, nothing), is_way_in)
            from_one = balls.spacing(on, corners, source[0], (wide, nothing), is_way_in)
            enough = np.maximum(balls.spacing(on, corners, source, (wide, nothing + 0.03), is_way_in), 0.03)
        assert found == pytest.approx(of_all_balls(balls, corners, source, wide, is_way_in), rel=1e-12)
        assert from_one == pytest.approx(of_all_balls(balls, corners, source[:1], wide, is_way_in), rel=1e-12)
        assert np.array_equal(enough, np.maximum(found, 0.03))
        assert num_balls < 3 or (found < wide).any()


def of_all_balls(tree: narrow.NarrowBodies, corners, source, wide, is_way_in: bool) -> np.ndarray:
    single = tree.behind == np.arange(len(tree.behind)) + 1
    balls = narrow.NarrowBodies(*(column[single] for column in vars(tree).values()))
    center = corners.mean(axis=1)
    reach = np.linalg.norm(corners - center[:, None], axis=2).max(axis=1)
    axis = center - source
    distance = np.linalg.norm(axis, axis=1)
    way = balls.center - source[:, None]
    away, ahead = np.linalg.norm(way, axis=2), np.einsum("nbi,ni->nb", way, axis / distance[:, None])
    beside = np.sqrt(np.maximum(away**2 - ahead**2, 0.0))
    meets = (ahead > -balls.radius) & (beside <= balls.radius + (reach / distance)[:, None] * away)
    if is_way_in:
        meets &= away - balls.radius < (distance + reach)[:, None]
    else:
        meets &= away + balls.radius > (distance - reach)[:, None]
    side = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    side /= np.linalg.norm(side, axis=1)[:, None]
    side *= np.where((np.einsum("ni,ni->n", side, axis) < 0.0) == is_way_in, 1.0, -1.0)[:, None]
    meets &= np.einsum("nbi,ni->nb", balls.center - center[:, None], side) > -balls.radius
    wanted = np.where(meets, narrow.SHARE * balls.width * distance[:, None] / away, np.inf)
    return np.minimum(wide, wanted.min(axis=1))
