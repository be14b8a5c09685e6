"""Nearest points of triangles and boxes around points, against plain searches."""

from __future__ import annotations

import numpy as np
import pytest

from scarl_sionna.engine.rays.geometry import closest_in_triangles, upright_box

ORIGINS = pytest.mark.parametrize("origin", [(0.0, 0.0, 0.0), (3000.0, -2000.0, 40.0)], ids=["near", "far"])
TRIANGLES = {
    "point": [(1, 2, 3), (1, 2, 3), (1, 2, 3)],
    "collinear": [(0, 0, 0), (4, 2, 1), (2, 1, 0.5)],
    "collinear, the first between": [(2, 1, 0.5), (4, 2, 1), (0, 0, 0)],
    "two corners in one": [(0, 0, 0), (0, 0, 0), (4, 2, 1)],
    "thin": [(0, 0, 0), (4, 2, 1), (2, 1, 0.5 + 1e-6)],
    "sound": [(0, 0, 0), (4, 2, 1), (-1, 3, 0.5)],
}


@ORIGINS
@pytest.mark.parametrize("corners", TRIANGLES.values(), ids=TRIANGLES.keys())
def test_the_nearest_point_of_a_triangle(corners, origin) -> None:
    """No point of a fine grid over the triangle is nearer; triangles without area are measured, too."""
    corners = np.array(corners, dtype=np.float64) + origin
    point = np.random.default_rng(1).normal(0.0, 3.0, (200, 3)) + origin
    count = 200
    share = np.array([(i, j, count - i - j) for i in range(count + 1) for j in range(count + 1 - i)]) / count
    places = share @ corners
    expected = np.array([np.linalg.norm(places - one, axis=1).min() for one in point])
    away, found = closest_in_triangles(point, corners)
    np.testing.assert_allclose(found.sum(axis=1), 1.0, atol=1e-12)
    assert found.min() >= -1e-12
    np.testing.assert_allclose(np.linalg.norm(found @ corners - point, axis=1), away, rtol=1e-9)
    assert (away <= expected + 1e-9).all()
    assert (away >= expected - 0.02).all() and away.min() > 0.0


def test_triangles_of_all_kinds_at_once() -> None:
    corners, point = np.array(list(TRIANGLES.values()), dtype=np.float64), np.array([[1.0, 1.0, 1.0]])
    away, share = closest_in_triangles(point, corners)
    for one, distance, own in zip(corners, away, share, strict=True):
        alone = closest_in_triangles(point[0], one)
        assert distance == alone[0]
        np.testing.assert_array_equal(own, alone[1])


def smallest_area(points) -> float:
    """Return the area of the smallest rectangle around points (n, 2), at angles so fine that 1e-4 is left."""
    points = points - points.mean(axis=0)
    angles = np.linspace(0.0, np.pi / 2.0, 20_001)
    axes = np.stack([[np.cos(angles), np.sin(angles)], [-np.sin(angles), np.cos(angles)]])  # (2, 2, num_angles)
    places = np.einsum("ni,kia->kna", points, axes)
    return float(np.ptp(places, axis=1).prod(axis=0).min())


def boxed(flat) -> tuple[float, np.ndarray]:
    """Return yaw and size of the box around points (n, 2) at heights of 1 to 3 m, which holds them and no more."""
    points = np.concatenate([np.insert(flat, 2, z, axis=1) for z in (1.0, 3.0)])
    pose, size = upright_box(points, fixed_axes=False)
    local = pose.inverse().apply(points)
    np.testing.assert_allclose(local.max(axis=0), size / 2.0, atol=1e-9)
    np.testing.assert_allclose(local.min(axis=0), -size / 2.0, atol=1e-9)
    return float(np.arctan2(pose.rotation[1, 0], pose.rotation[0, 0])), size


SHAPES = {
    "triangle": [(0, 0), (4, 1), (1, 2)],
    "square": [(0, 0), (1, 0), (1, 1), (0, 1)],
    "turned": [(0, 0), (4, 3), (2.5, 5), (-1.5, 2)],
    "cloud": np.random.default_rng(2).normal(size=(60, 2)) * [3.0, 1.0],
    "ring": 2.0 * np.stack([np.cos(np.arange(31) / 5.0), np.sin(np.arange(31) / 5.0)], axis=1),
    "narrow": np.random.default_rng(3).uniform(-1.0, 1.0, (20, 2)) @ [[4.0, 2.0], [-0.01, 0.02]],
}


@ORIGINS
@pytest.mark.parametrize("kind", [np.float32, np.float64])
@pytest.mark.parametrize("shape", SHAPES.values(), ids=SHAPES.keys())
def test_the_smallest_footprint(shape, kind, origin) -> None:
    """No angle gives a smaller one; the numbers may be as coarse as those of meshes."""
    flat = (np.array(shape) + origin[:2]).astype(kind).astype(np.float64)
    _, size = boxed(flat)
    expected = smallest_area(flat)
    assert size[0] >= size[1] and size[2] == 2.0
    assert size[0] * size[1] <= expected * (1.0 + 1e-9)
    assert size[0] * size[1] == pytest.approx(expected, rel=2e-2 if shape is SHAPES["narrow"] else 1e-3)


@ORIGINS
@pytest.mark.parametrize(
    ("flat", "yaw", "length", "width"),
    [
        ([(1, 2)], 0.0, 0.0, 0.0),
        ([(1, 2)] * 4, 0.0, 0.0, 0.0),
        ([(1, 2), (4, 6)], np.arctan2(4, 3), 5.0, 0.0),
        ([(1, 6), (4, 2), (1, 6)], np.arctan2(-4, 3), 5.0, 0.0),
        ([(2.5, 4), (1, 2), (4, 6), (1.75, 3)], np.arctan2(4, 3), 5.0, 0.0),
        ([(1, 2), (4, 2), (3, 2)], 0.0, 3.0, 0.0),
        ([(1, 2), (1, 6), (1, 3)], 0.0, 0.0, 4.0),  # the frame's own axes
    ],
)
def test_footprints_without_area(flat, yaw, length, width, origin) -> None:
    found, size = boxed(np.array(flat, dtype=np.float64) + origin[:2])
    assert found == pytest.approx(yaw, abs=1e-12)
    np.testing.assert_allclose(size, [length, width, 2.0], atol=1e-12)
