"""Who owns a hit, among mirrors that are near to each other: exactly one."""

from __future__ import annotations

import numpy as np
import pytest

from scarl_sionna.radar.channel.multipath.mirror_faces import COINCIDENT, NO_MIRROR, MirrorFaces, inside

OTHER = 4
"""A face of no mirror."""


def level(number: int, x: tuple[float, float], z: float):
    """Return faces, normal, offset and corners of a level mirror of two triangles, 4 m wide."""
    corners = np.array([(x[0], -2, z), (x[1], -2, z), (x[1], 2, z), (x[0], 2, z)])
    return np.array([2 * number, 2 * number + 1]), [0.0, 0.0, 1.0], z, corners[[(0, 1, 2), (0, 2, 3)]]


def owner(mirrors, face, hit, aim=None) -> int:
    faces, normal, offset, corners = zip(*mirrors, strict=True)
    point = np.array([hit], dtype=np.float64)
    aimed = point if aim is None else np.array([aim])
    known = MirrorFaces(OTHER + 1, faces, np.array(normal), np.array(offset), corners)
    return int(known.owner(np.array([face]), point, aimed)[0])


@pytest.mark.parametrize(
    ("second", "face", "hit", "aim", "expected"),
    [
        (((0, 4), 0.004), 0, (1, 1, 0.0), None, 0),  # each mirror's own faces
        (((0, 4), 0.004), 2, (1, 1, 0.004), None, 1),
        (((0, 4), 0.00002), 2, (1, 1, 0.00002), None, 0),  # as good as one plane: the first
        (((4, 8), 0.00002), 2, (5, 1, 0.00002), None, 1),  # but not where it has ended
        (((0, 4), 0.004), OTHER, (1, 1, 0.006), None, 1),  # a marking: the nearer of the two under it
        (((0, 4), 0.00002), OTHER, (1, 1, 0.006), None, 0),
        (((4, 8), 0.004), OTHER, (1, 1, 0.004), None, 0),  # the one that goes on there, not the nearest
        (((4, 8), 0.004), OTHER, (3.9, 1, 0.004), (4.1, 1, 0.004), 1),  # where the ray was aimed
        (((6, 8), 0.004), OTHER, (5, 1, 0.006), None, 1),  # in a gap: the nearest
        (((6, 8), 0.00002), OTHER, (5, 1, 0.006), None, 0),
        (((6, 8), 0.004), OTHER, (5, 1, 0.009), None, 1),
        (((6, 8), 0.004), OTHER, (5, 1, 0.012), None, 1),  # 8 mm over the second, 12 over the first
        (((0, 4), 0.004), OTHER, (1, 1, 0.02), None, NO_MIRROR),
    ],
)
def test_a_hit_has_one_owner(second, face, hit, aim, expected) -> None:
    mirrors = [level(0, (0.0, 4.0), 0.0), level(1, *second)]
    assert owner(mirrors, face, hit, aim) == expected


def barycentric(point, corners):
    """Return which points are in one of some triangles, one pair after the other."""
    found = np.zeros(len(point), dtype=bool)
    for a, b, c in corners:
        matrix = np.stack([b - a, c - a], axis=1)
        if abs(np.linalg.det(matrix)) > 0.0:
            share = np.linalg.solve(matrix, (point - a).T)
            found |= (share >= 0.0).all(axis=0) & (share.sum(axis=0) <= 1.0)
    return found


@pytest.mark.parametrize(("count", "spread"), [(1, 3.0), (40, 0.5), (400, 0.2), (60, 40.0)])
def test_points_over_triangles(count, spread) -> None:
    """The grid finds what a search through all triangles finds; large and flat triangles, one of no area."""
    rng = np.random.default_rng(count)
    corners = rng.uniform(-10.0, 10.0, (count, 1, 2)) + rng.normal(0.0, spread, (count, 3, 2))
    corners[-1] = corners[-1, :1] if count > 1 else corners[-1]
    point = rng.uniform(-14.0 - 3.0 * spread, 14.0 + 3.0 * spread, (3000, 2))
    expected = barycentric(point, corners)
    assert 0.0 < expected.mean() < 1.0
    for axis in range(3):  # planes across each axis
        flat = np.insert(point, axis, 5.0, axis=1), np.insert(corners, axis, 5.0, axis=2)
        np.testing.assert_array_equal(inside(*flat, np.eye(3)[axis]), expected)


def test_points_at_the_edges_of_triangles() -> None:
    corners = np.array([[(0, 0, 0), (4, 0, 0), (0, 4, 0)]], dtype=float)
    near, far = 0.5 * COINCIDENT, 2.0 * COINCIDENT
    point = np.array([(2, -near, 0), (2, -far, 0), (-near, 2, 0), (-far, 2, 0), (4, 0, 0), (2, 2, 0), (2.001, 2, 0)])
    assert inside(point, corners, np.array([0, 0, 1])).tolist() == [True, False, True, False, True, True, False]
    assert not inside(point, corners[:0], np.array([0, 0, 1])).any()
    assert inside(point[:0], corners, np.array([0, 0, 1])).tolist() == []


def test_no_point_is_inside_that_the_box_does_not_hold() -> None:
    """Tilted triangles, points far from their planes."""
    rng = np.random.default_rng(4)
    corners, point = rng.uniform(-5.0, 5.0, (20, 3, 3)), rng.uniform(-6.0, 6.0, (5000, 3))
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    offset = np.einsum("ij,ij->i", normal, corners[:, 0])
    known = MirrorFaces(20, [np.array([k]) for k in range(20)], normal, offset, [own[None] for own in corners])
    for k, (lower, upper) in enumerate(known.boxes):
        held = ((point >= lower) & (point <= upper)).all(axis=1)
        found = inside(point, corners[k : k + 1], normal[k])
        assert not (found & ~held).any() and found.any() and not held.all()
