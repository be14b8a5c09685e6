"""A scene far from the world's origin, where float32 no longer tells places apart, is as it is at the origin."""

from __future__ import annotations

import gc
import warnings
import weakref

import numpy as np
import pytest

from scarl_sionna.core.errors import ScarlWarning
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.settings.sbr import SbrSettings
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.engine import variant
from scarl_sionna.engine.load import load_scene
from scarl_sionna.engine.rays.nearby import AROUND_ORIGIN, CELL, Nearby, middle_of, scene_near
from scarl_sionna.engine.world import World
from scarl_sionna.radar.channel import solve_paths
from scarl_sionna.radar.paths import RadarPaths
from tests.scenes import Thing, box, plane, write_scene

pytestmark = pytest.mark.filterwarnings("ignore:.*from the world's origin")

RADAR = RadarSpec(elevation_fov_deg=90.0)
SENSOR = (0.0, 0.0, 0.75)
FAR = (300.0, 1024.0, 3000.0, 20000.0)
GROUND, BODY = 1, 2


def _world(folder, x: float, kind: str) -> World:
    """Return a steel box 11 m before the sensor that stands over a steel ground, all moved along x [m].

    All corners are multiples of 1/64 m, which float32 holds up to 131 km, but those of an actor "between" or "turned".
    """
    ground = Thing("ground", plane(64, 32, (16.0 + x, 0, 0)), "Roads", "steel", is_object=False)
    body = box((2.0, 1.5, 1.25))
    if kind == "static":
        body.apply_translation((12.0 + x, 0.25, 0.875))
        return load_scene(write_scene(folder, [ground, Thing("body", body, "Car", "steel")]))
    place = [12.0 + x + (0.7 if kind == "between" else 0.0), 0.25, 0.875]
    trajectory = {"kind": "constant_twist", "position": place, "velocity": [0, 0, 0]}
    trajectory["yaw_deg"] = 5.0 if kind == "turned" else 0.0
    return load_scene(write_scene(folder, [ground], [Thing("body", body, "Car", "steel", trajectory)]))


def _echo(paths: RadarPaths) -> np.ndarray:
    """Return the echoes of the box [dB]: straight, over the ground on one way, and on both."""
    reflected = (paths.instance == GROUND).sum(axis=1)
    level = []
    for count in range(3):
        rows = (paths.instance == BODY).any(axis=1) & (reflected == count)
        phase = np.exp(-2j * np.pi / RADAR.wavelength * paths.length[rows])
        level.append(20.0 * np.log10(abs(np.sum(paths.a[rows, 0, 0] * phase))))
    return np.array(level)


@pytest.mark.some(2)
@pytest.mark.parametrize("kind", ["static", "between", "actor", "turned"])
def test_echo_does_not_depend_on_where_the_world_is(tmp_path, kind) -> None:
    """By `auto`, so over the ground as well; within 0.05 dB, and with about as many rows.

    Rays in the world's coordinates: up to 4 dB off for the static box and 30 to 60 dB for actors.
    """
    echo, rows = [], []
    for x in (0.0, *FAR):
        state = _world(tmp_path / f"{x:g}", x, kind).at(0.0)
        paths = solve_paths(state, RADAR, Pose(np.add(SENSOR, (x, 0, 0))), "auto")
        echo.append(_echo(paths))
        rows.append(paths.num_paths)
    assert np.abs(np.array(echo) - echo[0]).max() < 0.05, np.round(echo, 2)
    assert max(rows) < 1.5 * rows[0], rows


def test_actor_is_seen_by_sbr_alone_as_at_the_origin(tmp_path) -> None:
    """Its front at right angles to the ray, at a place that float32 does not hold."""
    found = []
    for x in (0.0, *FAR):
        trajectory = {"kind": "constant_twist", "position": [14.7 + x, 0, 0.7], "velocity": [0, 0, 0]}
        body = Thing("body", box((4, 1.8, 1.4)), "Car", "steel", trajectory)
        state = load_scene(write_scene(tmp_path / f"{x:g}", actors=[body])).at(0.0)
        settings = SbrSettings(max_phase=0.5, max_depth=1)
        paths = solve_paths(state, RADAR, Pose([x, 0, 0.6]), "sbr", settings=settings)
        phase = np.exp(-2j * np.pi / RADAR.wavelength * (paths.length - 25.4))
        found.append(20.0 * np.log10(abs(np.sum(paths.a[:, 0, 0] * phase))))
    assert np.abs(np.array(found) - found[0]).max() < 0.05, np.round(found, 2)


@pytest.mark.parametrize("twin", ["optical", "radio"])
def test_rays_hit_what_they_hit_at_the_origin(tmp_path, twin) -> None:
    """Each face and, to 1e-9 m, each distance; also where one runs below the box."""
    rng = np.random.default_rng(1)
    azimuth, elevation = rng.uniform(-0.5, 0.5, 4000), rng.uniform(-0.4, 0.4, 4000)
    ray = np.stack([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)], 1)
    low, found = np.array([[1.0, 0.0, 0.0]]), []
    for x in (0.0, 1024.0, 20000.0):
        state = _world(tmp_path / f"{x:g}", x, "actor").at(0.0)
        assert state.cast([x + 5.0, 0.5, 1e-3], low, twin=twin).num_hits == 0
        hits, distance, part = state.cast(np.add(SENSOR, (x, 0, 0)), ray, twin=twin), np.zeros(4000), np.zeros(4000)
        distance[hits.ray], part[hits.ray] = hits.distance, hits.part + 1
        found.append((distance, part))
    for distance, part in found[1:]:
        other = np.abs(distance - found[0][0]) > 1e-9
        assert np.array_equal(other, part != found[0][1])
        assert other.sum() < 4  # a ray that meets an edge may fall to either side


def test_frames_are_shared_and_let_go(tmp_path) -> None:
    """Sensors of one car have one frame, a state that is gone leaves none behind."""
    world = _world(tmp_path, 1000.0, "actor")
    state = world.at(0.0)
    place = np.array([1000.0, 0.0, 0.5])
    with variant.optical():
        assert scene_near(state, np.full(3, AROUND_ORIGIN), "optical") is world.twin("optical")
        scene = scene_near(state, place, "optical")
        assert isinstance(scene, Nearby)
        assert scene_near(state, place + [4.0, 1.0, 0.5], "optical") is scene
        assert np.abs(scene.origin - place).max() <= CELL / 2.0
        assert scene_near(world.at(0.0), place, "optical") is not scene
    held = weakref.ref(scene)
    del state, scene
    with variant.optical():
        scene_near(world.at(0.5), place, "optical")
    gc.collect()
    assert held() is None


def test_rays_from_all_over_a_world_have_no_frame() -> None:
    """Those of one sensor have that in their middle."""
    assert middle_of(np.array([[0.0, 0.0, 0.0], [5000.0, 0.0, 0.0]])) is None
    assert middle_of(np.zeros((0, 3))) is None
    np.testing.assert_array_equal(middle_of(np.array([[500.0, 0.0, 0.0], [510.0, 2.0, 0.0]])), [505.0, 1.0, 0.0])


def test_static_shapes_far_out_are_warned_of(tmp_path) -> None:
    """Those whose vertices are in steps of 0.5 mm and more, with the largest step; actors are not."""
    with pytest.warns(ScarlWarning, match=r"up to 20 km .* steps of 2 mm"):
        _world(tmp_path / "far", 20000.0, "static")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        _world(tmp_path / "near", 3000.0, "static")
        place = {"kind": "constant_twist", "position": [20000.0, 0, 0], "velocity": [0, 0, 0]}
        load_scene(write_scene(tmp_path / "actor", actors=[Thing("body", box((1, 1, 1)), trajectory=place)]))
