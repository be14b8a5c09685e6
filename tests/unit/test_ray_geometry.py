"""Nearest points of triangles, against a plain search."""

from __future__ import annotations

import numpy as np
import pytest

from scarl_sionna.engine.rays.geometry import closest_in_triangles

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
