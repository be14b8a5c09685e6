"""Float32 intersections are not good enough for a phase at 77 GHz.

The float64 hit point is, to 300 m and at grazing.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from scarl_sionna.engine.load import load_scene
from scarl_sionna.engine.rays.geometry import encloses, refine_distance, winding_number
from tests.scenes import Thing, ball, box, plane, write_scene

WAVELENGTH = 299_792_458.0 / 77e9


@pytest.mark.parametrize("distance", [0.5, 50.0, 300.0])
def test_distance_to_a_wall_is_exact(tmp_path: Path, distance: float) -> None:
    # corners that float32 holds exactly, so that the wall stands where it was asked to
    wall = plane(2048, 2048, (512.0, 0, 0), (-1, 0, 0))
    state = load_scene(write_scene(tmp_path, [Thing("wall", wall, "Wall")])).at(0.0)
    azimuth = np.radians(np.linspace(-60, 60, 241))
    directions = np.stack([np.cos(azimuth), np.sin(azimuth), np.zeros_like(azimuth)], axis=1)
    hits = state.cast([512.0 - distance, 0.1, 0.2], directions)
    # 1e-12 relative: float64 rounding of a plane intersection with coordinates up to 1e3 m; float32 has 3e-5 m at 300 m
    np.testing.assert_allclose(hits.distance, distance / np.cos(azimuth), rtol=1e-12)
    np.testing.assert_allclose(hits.point[:, 0], 512.0, atol=1e-10)


def test_small_motion_moves_the_phase(tmp_path: Path) -> None:
    """A wall that moves in steps of lambda/20 at 200 m: the path follows, where float32 has steps of 1.5e-5 m."""
    step = WAVELENGTH / 20
    way = {"kind": "constant_twist", "position": [200.0, 0, 0], "velocity": [step, 0, 0]}
    world = load_scene(
        write_scene(tmp_path, [], [Thing("wall", plane(10, 10, (0, 0, 0), (-1, 0, 0)), "Wall", trajectory=way)])
    )
    distance = [float(world.at(float(k)).cast([0, 0, 0], [[1, 0, 0]]).distance[0]) for k in range(60)]
    # float64 rounding at 200 m is 3e-14 m; 1e-9 m is 1e-4 deg of phase
    np.testing.assert_allclose(distance, 200.0 + step * np.arange(60), atol=1e-9)


def test_grazing_ray_keeps_the_engines_distance() -> None:
    """In the plane of the triangle the float64 plane has no answer: the engine's distance stays."""
    origins, directions = np.zeros(3), np.array([[1.0, 0.0, 0.0]])
    distance, cosine = refine_distance(
        origins, directions, np.array([[0.0, 0.0, 1.0]]), np.array([0.0]), np.array([7.0], dtype=np.float32)
    )
    assert distance[0] == 7.0
    assert cosine[0] == 0.0


def test_grazing_road(tmp_path: Path) -> None:
    """Road hits out to 250 m from a radar 0.5 m above it, at 0.1 deg: height zero to a nanometre times 1/sin."""
    state = load_scene(write_scene(tmp_path, [Thing("road", plane(1024, 1024), "Roads")])).at(0.0)
    elevation = -np.arcsin(0.5 / np.array([5.0, 20.0, 100.0, 250.0]))
    directions = np.stack([np.cos(elevation), np.zeros(4), np.sin(elevation)], axis=1)
    hits = state.cast([0, 0, 0.5], directions)
    np.testing.assert_allclose(hits.distance, [5, 20, 100, 250], rtol=1e-12)
    np.testing.assert_allclose(hits.point[:, 2], 0.0, atol=1e-12)


def test_enclosure_of_closed_open_and_flipped_meshes() -> None:
    sphere = ball(1.0)
    corners = np.asarray(sphere.triangles)
    assert winding_number(np.zeros(3), corners) == pytest.approx(1.0, abs=1e-9)
    assert winding_number(np.array([1.5, 0, 0]), corners) == pytest.approx(0.0, abs=1e-9)
    assert encloses(np.zeros(3), corners[:, ::-1])  # flipped normals
    assert encloses(np.zeros(3), corners[20:])  # a small hole
    assert not encloses(np.array([0, 0, 1e-4]), np.asarray(plane(1e4, 1e4).triangles))  # a half space is not a body
    assert not encloses(np.array([1.0 + 1e-6, 0, 0]), np.asarray(box((2, 2, 2)).triangles))
