"""Bodies that stand on a road: `auto` over ground bounce against image theory."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from benchmarks import ground_bounce as problem
from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.engine.load import load_scene
from scarl_sionna.radar.channel import solve_paths
from tests.oracles import two_ray as oracle
from tests.scenes import Thing, ball, box, plane, write_scene


def test_the_foot_of_a_post_is_seen_over_the_road(tmp_path) -> None:
    """There, at the corner of post and road, is the specular point of the way over the road and straight back."""
    distance = 13.11
    state, _ = problem.states("post", distance, tmp_path)
    pose = problem.ss.Pose([0.0, 0.0, problem.HEIGHT])
    asked = {"channel_tolerance_db": 0.3, "auto": {"coarse_first": False}, "max_distance": problem.REACH}
    paths = solve_paths(state, problem.RADAR, pose, "auto", **asked)
    number = {info.name: number for number, info in state.world.instances.items()}
    paths = paths.select((paths.instance == number["body"]).any(axis=1))
    wave = 2.0 * np.pi * problem.RADAR.center_frequency / SPEED_OF_LIGHT
    field = paths.a[:, 0, 0] * np.exp(-1j * wave * paths.length)
    last = paths.instance[np.arange(paths.num_paths), paths.depth - 1]
    mixed = (paths.instance[:, 0] == number["road"]) & (last != number["road"])
    permittivity = complex(problem.GROUND.at(problem.RADAR.center_frequency))
    size = (distance, problem.RADIUS, problem.POST, problem.HEIGHT)
    exact = oracle.post_by_ways(*size, permittivity, np.array([problem.RADAR.center_frequency]))[1, 0, 0]
    # facets of 48 sides, Fresnel's coefficient by patches; 0.11 and 0.9 dB where the lowest centimetre is cut off
    assert abs(field[mixed].sum() - exact) < 0.04 * abs(exact)


def test_curved_faces_are_integrated_finely_enough_at_the_level_of_3_db(tmp_path) -> None:
    """Where parts are too large what their borders radiate does not cancel: 0.49, 0.47 and 0.68 dB with 0.1 rad."""
    for number in (9, 10, 24):
        distance = float(problem.DISTANCES[number])
        state, alone = problem.states("post", distance, tmp_path / f"{number}")
        exact, free = problem.by_image_theory("post", distance, alone)
        assert problem.error_db(problem.by_auto(state, 3.0)["power"], exact, free) < 0.25


@pytest.mark.slow
@pytest.mark.parametrize(("tolerance", "most"), [(1.0, 0.5), (0.3, 0.3)])
def test_two_ray_fading_of_a_post_is_that_of_image_theory(tmp_path, tolerance, most) -> None:
    errors = []
    for distance in problem.DISTANCES:
        state, alone = problem.states("post", float(distance), tmp_path / f"{distance:.1f}")
        exact, free = problem.by_image_theory("post", float(distance), alone)
        found = problem.by_auto(state, tolerance)
        assert found["road"]
        errors.append(problem.error_db(found["power"], exact, free))
    assert max(errors) < most


@pytest.mark.slow
def test_two_ray_fading_of_a_car_is_that_of_image_theory(tmp_path) -> None:
    for number in (0, 8, 16, 24, 30):
        distance = float(problem.DISTANCES[number])
        state, alone = problem.states("car", distance, tmp_path / f"{number}")
        exact, free = problem.by_image_theory("car", distance, alone)
        found = problem.by_auto(state, 0.3)  # at 1 dB the round body is up to 1.0 dB off, docs/accuracy.md
        assert found["road"]
        assert problem.error_db(found["power"], exact, free) < 0.5


def _mixed_db(paths, number: int) -> float:
    """Return the power of paths with one reflection before or after a body, mean over the band [dB]."""
    some = paths.select((paths.instance == number).any(axis=1) & (paths.depth == 2))
    frequency = problem.RADAR.center_frequency + np.linspace(-0.5, 0.5, 33) * problem.RADAR.sampled_bandwidth
    wave = np.exp(-2j * np.pi * np.outer(some.length, frequency) / SPEED_OF_LIGHT)
    field = (some.a[:, 0, 0, None] * wave).sum(axis=0)
    return float(10.0 * np.log10(max(np.mean(np.abs(field) ** 2), 1e-30)))


def _ball_db(radius: float, away: float, over: float) -> float:
    """Return the power of both ways over one lossless mirror and back straight from a ball, by its cross section."""
    mean = problem.RADAR.wavelength**2 * np.pi * radius**2 / ((4.0 * np.pi) ** 3 * away**2 * over**2)
    return float(10.0 * np.log10(4.0 * mean))


GROUNDS = {
    "sag of 2 km in strips": (np.arange(-10.0, 60.0, 2.0), (-8.0, 8.0), lambda x, y: (x - 6.0) ** 2 / 4000.0),
    "twist of 2 %": (np.arange(-10.0, 60.0, 2.0), np.linspace(-8.0, 8.0, 9), lambda x, y: 4e-4 * (x - 6.0) * y),
    "waves of 5 mm": (
        np.arange(-10.0, 60.0, 1.0),
        np.linspace(-8.0, 8.0, 9),
        lambda x, y: 0.005 * np.cos(0.1 * np.pi * (x - 6.0)) - 0.005,
    ),
}


@pytest.mark.parametrize("kind", GROUNDS)
def test_a_ground_of_many_small_faces_has_its_bounce(tmp_path, kind: str) -> None:
    """The faces of a road that is not quite flat are small, and the largest lie where nothing is."""
    x, y, height = GROUNDS[kind]
    points = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    first = (np.arange(len(x) - 1)[:, None] * len(y) + np.arange(len(y) - 1)).ravel()
    faces = np.concatenate(
        [
            np.stack([first, first + len(y), first + len(y) + 1], axis=1),
            np.stack([first, first + len(y) + 1, first + 1], axis=1),
        ]
    )
    road = trimesh.Trimesh(np.column_stack([points, height(*points.T)]), faces, process=False)
    things = [
        Thing("road", road, "Roads", "steel", is_object=False),
        Thing("ball", ball(0.3, (12.0, 0.5, 0.9), 4), "Static", "steel"),
    ]
    state = problem.ss.load_scene(write_scene(tmp_path, things)).at(0.0)
    pose = problem.ss.Pose([0.0, 0.0, 0.8])
    plan = problem.ss.plan_channel(state, problem.RADAR, pose)
    assert 1 <= len(plan.mirror_faces) <= 16  # those that matter, out of many
    paths = solve_paths(state, problem.RADAR, pose, "auto")
    away, over = np.linalg.norm([12.0, 0.5, 0.1]), np.linalg.norm([12.0, 0.5, 1.7])
    assert _mixed_db(paths, 2) == pytest.approx(_ball_db(0.3, away, over), abs=1.0)


@pytest.mark.parametrize("yaw_deg", [0.0, 40.0])
def test_a_wall_ahead_shows_what_stands_before_it_from_behind(tmp_path, yaw_deg: float) -> None:
    """The way over the wall leads back into the view of the radar, far off the axis between image and object."""
    wall = box((0.2, 20.0, 6.0), (10.1, 0.0, 3.0))
    things = [Thing("wall", wall, "Wall", "steel"), Thing("ball", ball(0.3, (5.0, 1.5, 0.8), 5), "Static", "steel")]
    state = problem.ss.load_scene(write_scene(tmp_path, things)).at(0.0)
    pose = problem.ss.Pose.from_euler([0.0, 0.0, 0.8], yaw=np.radians(yaw_deg))
    paths = solve_paths(state, problem.RADAR, pose, "auto")
    away, over = np.linalg.norm([5.0, 1.5, 0.0]), np.linalg.norm([15.0, -1.5, 0.0])
    # physical optics forward of a ball ripples by a decibel
    assert _mixed_db(paths, 2) == pytest.approx(_ball_db(0.3, away, over), abs=2.0)


@pytest.mark.parametrize("gap", [0.003, 0.008, 0.0101])
def test_nothing_comes_out_of_a_body_that_stands_just_over_the_road(tmp_path, gap: float) -> None:
    """Within the thickness of a marking rays began inside of the box, whose faces made a corner: 4.7 dB too strong."""
    turn = trimesh.transformations.rotation_matrix(np.radians(20.0), (0.0, 0.0, 1.0))
    car = trimesh.creation.box(
        (4.2, 1.8, 1.4), trimesh.transformations.translation_matrix((14.0, 2.0, 0.7 + gap)) @ turn
    )
    things = [
        Thing("road", plane(30.0, 16.0, (12.0, 0.0, 0.0)), "Ground", "grey"),
        Thing("car", car, "Static", "steel"),
    ]
    state = load_scene(write_scene(tmp_path, things)).at(0.0)
    radar = problem.ss.RadarSpec(azimuth_fov_deg=120.0, elevation_fov_deg=40.0)
    paths = solve_paths(state, radar, problem.ss.Pose([0.0, 0.0, 0.6]), "auto", channel_tolerance_db=3.0)
    assert ((paths.instance == 2).sum(axis=1) <= 1).all()
    assert (paths.instance == 2).any()
