"""Float64 geometry of a state: triangle planes, hit points on them, boxes, and which instance encloses a point.

The engine intersects rays in float32: the triangle that it finds is right, its distance is not good enough for a phase
at 77 GHz. So the hit point is computed again in float64 on the plane of that triangle.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
from scipy.spatial import ConvexHull, QhullError

from scarl_sionna.core.pose import Pose

Array = npt.NDArray[np.float64]

PLANE_MISMATCH = 1e-3
"""A plane hit farther than this from the engine's (relative to 1 m + distance) is not trusted: the ray grazes the
plane."""
NEARLY_IN_PLANE = 1e-12
"""Cosine of incidence below which a ray runs in the plane."""
_SHORTEST_EDGE = 1e-10
"""Of a hull [m], that has a direction."""
_THINNEST = 1e-12
"""Sine of the angle at a triangle's first corner up to which its edges are all of it: rounding may have made its normal
then."""
_ENCLOSED = 0.75
"""Winding number from which a point counts as inside. A closed mesh gives 1, an open half space at most 0.5."""


@dataclass(frozen=True, eq=False)
class Triangles:
    """Triangles of all parts, part after part.

    Attributes
    ----------
    corners : ndarray of float64, shape (num_faces, 3, 3)
        Vertices [m].
    normal : ndarray of float64, shape (num_faces, 3)
        Unit normals by the right-hand rule; zero for a degenerate face.
    offset : ndarray of float64, shape (num_faces,)
        normal . vertex [m].
    first : ndarray of int64, shape (num_parts + 1,)
        Where each part's faces begin.
    """

    corners: Array
    normal: Array
    offset: Array
    first: npt.NDArray[np.int64]

    @cached_property
    def part(self) -> npt.NDArray[np.int64]:
        """Row of each triangle in the part table, shape (num_faces,)."""
        return np.repeat(np.arange(len(self.first) - 1), np.diff(self.first))

    @classmethod
    def from_meshes(cls, vertices: Sequence[Array], faces: Sequence[npt.NDArray[np.int64]]) -> Triangles:
        """Join the meshes of all parts."""
        corners = np.concatenate([v[f] for v, f in zip(vertices, faces, strict=True)])
        first = np.concatenate([[0], np.cumsum([len(f) for f in faces])]).astype(np.int64)
        normal, offset = _planes(corners)
        return cls(corners, normal, offset, first)

    def with_meshes(self, meshes: Mapping[int, Array]) -> Triangles:
        """Return the triangles with other corners, (num_faces of the part, 3, 3), of some parts."""
        if not meshes:
            return self
        corners, normal, offset = self.corners.copy(), self.normal.copy(), self.offset.copy()
        for part, own in meshes.items():
            rows = slice(self.first[part], self.first[part + 1])
            corners[rows] = own
            normal[rows], offset[rows] = _planes(own)
        return Triangles(corners, normal, offset, self.first)

    def moved(self, world_from_part: Mapping[int, Pose]) -> Triangles:
        """Return the triangles with some parts moved from their own frame into the world."""
        if not world_from_part:
            return self
        corners, normal, offset = (np.empty_like(own) for own in (self.corners, self.normal, self.offset))
        done = 0
        for rows, pose in self._runs(world_from_part):
            self._put(slice(done, rows.start), corners, normal, offset)
            turn, points = pose.rotation.T, corners[rows].reshape(-1, 3)
            np.matmul(self.corners[rows].reshape(-1, 3), turn, out=points)
            points += pose.position
            np.matmul(self.normal[rows], turn, out=normal[rows])
            offset[rows] = np.einsum("ij,ij->i", normal[rows], corners[rows, 0])
            done = rows.stop
        self._put(slice(done, None), corners, normal, offset)
        return Triangles(corners, normal, offset, self.first)

    def _put(self, rows: slice, corners: Array, normal: Array, offset: Array) -> None:
        """Copy some triangles as they are."""
        corners[rows], normal[rows], offset[rows] = self.corners[rows], self.normal[rows], self.offset[rows]

    def _runs(self, world_from_part: Mapping[int, Pose]) -> Iterator[tuple[slice, Pose]]:
        """Yield the rows of neighbouring parts that have the same pose, and the pose."""
        first, stop, last = 0, -1, None
        for part in sorted(world_from_part):
            pose = world_from_part[part]
            if part != stop or pose is not last:
                if last is not None:
                    yield slice(self.first[first], self.first[stop]), last
                first, last = part, pose
            stop = part + 1
        if last is not None:
            yield slice(self.first[first], self.first[stop]), last

    def bounds(self) -> tuple[Array, Array]:
        """Return the lower and the upper corner of every part's axis-parallel box, each of shape (num_parts, 3)."""
        vertices = self.corners.reshape(-1, 3)
        starts = 3 * self.first[:-1]
        return np.minimum.reduceat(vertices, starts), np.maximum.reduceat(vertices, starts)

    def of_parts(self, parts: Sequence[int]) -> Array:
        """Return the corners of some parts' faces, shape (n, 3, 3)."""
        return np.concatenate([self.corners[self.first[p] : self.first[p + 1]] for p in parts])


def _planes(corners: Array) -> tuple[Array, Array]:
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    normal = np.divide(normal, length, out=np.zeros_like(normal), where=length > 0)
    return normal, np.einsum("ij,ij->i", normal, corners[:, 0])


def refine_distance(
    origins: Array, directions: Array, normal: Array, offset: Array, distance: npt.NDArray[np.float32]
) -> tuple[Array, Array]:
    """Return the float64 distance of rays to the planes of the triangles that they hit.

    Parameters
    ----------
    origins : ndarray, shape (3,) or (num_hits, 3)
    directions, normal : ndarray, shape (num_hits, 3)
    offset : ndarray, shape (num_hits,)
    distance : ndarray of float32, shape (num_hits,)
        The engine's distance [m]; kept where the ray runs in the plane, within float64's or float32's reach.

    Returns
    -------
    distance : ndarray of float64, shape (num_hits,)
    cosine : ndarray of float64, shape (num_hits,)
        direction . normal: negative where the front is hit.
    """
    cosine = np.einsum("ij,ij->i", directions, normal)
    if origins.ndim == 1:
        height = offset - normal @ origins
    else:
        height = offset - np.einsum("ij,ij->i", origins, normal)
    engine = distance.astype(np.float64)
    plane = np.divide(height, cosine, out=engine.copy(), where=np.abs(cosine) > NEARLY_IN_PLANE)
    trusted = np.abs(plane - engine) <= PLANE_MISMATCH * (1.0 + engine)
    return np.where(trusted, plane, engine), cosine


def winding_number(point: Array, corners: Array) -> float:
    """Return how many times a triangle mesh encloses a point.

    1 inside a closed mesh, 0 outside, parts between when open.

    References
    ----------
    .. [1] A. van Oosterom, J. Strackee, "The Solid Angle of a Plane Triangle", IEEE Trans. Biomed. Eng. 30(2), 1983,
       Eq. (8).
    """
    a, b, c = (corners[:, index] - point for index in range(3))
    la, lb, lc = (np.linalg.norm(side, axis=1) for side in (a, b, c))
    numerator = np.einsum("ij,ij->i", a, np.cross(b, c))
    denominator = (
        la * lb * lc
        + np.einsum("ij,ij->i", a, b) * lc
        + np.einsum("ij,ij->i", b, c) * la
        + np.einsum("ij,ij->i", c, a) * lb
    )
    return float(np.sum(2.0 * np.arctan2(numerator, denominator)) / (4.0 * np.pi))


def encloses(point: Array, corners: Array) -> bool:
    """Return whether a mesh encloses a point, whatever way its faces are turned."""
    lower, upper = corners.reshape(-1, 3).min(axis=0), corners.reshape(-1, 3).max(axis=0)
    if np.any(point < lower) or np.any(point > upper):
        return False
    return abs(winding_number(point, corners)) > _ENCLOSED


def even_directions(count: int) -> Array:
    """Return unit vectors spread evenly over the sphere (Fibonacci lattice), shape (count, 3)."""
    index = np.arange(count) + 0.5
    z = 1.0 - 2.0 * index / count
    azimuth = np.pi * (1.0 + np.sqrt(5.0)) * index
    radius = np.sqrt(1.0 - z * z)
    return np.stack([radius * np.cos(azimuth), radius * np.sin(azimuth), z], axis=1)


def closest_in_triangles(point: Array, corners: Array) -> tuple[Array, Array]:
    """Return distance and barycentric coordinates of the nearest point of triangles, by broadcasting (..., 3, 3).

    Of a triangle without area it is the nearest point of its edges.
    """
    shape = np.broadcast_shapes(point.shape[:-1], corners.shape[:-2])
    best, share = np.full(shape, np.inf), np.zeros((*shape, 3))
    for k in range(3):  # the edges, ends included
        start, along = corners[..., k, :], corners[..., (k + 1) % 3, :] - corners[..., k, :]
        square = np.maximum(np.einsum("...i,...i->...", along, along), 1e-300)
        way = np.clip(np.einsum("...i,...i->...", point - start, along) / square, 0.0, 1.0)
        away = np.linalg.norm(point - start - way[..., None] * along, axis=-1)
        nearer = away < best
        best = np.where(nearer, away, best)
        own = np.zeros((*shape, 3))
        own[..., k], own[..., (k + 1) % 3] = 1.0 - way, way
        share = np.where(nearer[..., None], own, share)
    one, other = (corners[..., k, :] - corners[..., 0, :] for k in (1, 2))
    normal = np.cross(one, other)
    square = np.einsum("...i,...i->...", normal, normal)
    longest = np.einsum("...i,...i->...", one, one) * np.einsum("...i,...i->...", other, other)
    has_area = square > _THINNEST**2 * longest
    square = np.where(has_area, square, 1.0)
    offset = point - corners[..., 0, :]
    second = np.einsum("...i,...i->...", np.cross(offset, other), normal) / square
    third = np.einsum("...i,...i->...", np.cross(one, offset), normal) / square
    within = has_area & (second >= 0.0) & (third >= 0.0) & (second + third <= 1.0)
    away = np.abs(np.einsum("...i,...i->...", offset, normal)) / np.sqrt(square)
    inside = within & (away < best)
    flat = np.stack([1.0 - second - third, second, third], axis=-1)
    return np.where(inside, away, best), np.where(inside[..., None], flat, share)


def _smallest_rectangle(points: Array) -> tuple[Array, Array, float]:
    """Return middle (2,), sides (2,) and direction [rad] of the longer side of the smallest rectangle around points.

    One of its sides lies along one of the hull of the points (n, 2), which must not all be on a line.

    References
    ----------
    .. [1] H. Freeman, R. Shapira, "Determining the Minimum-Area Encasing Rectangle for an Arbitrary Closed Curve",
       Commun. ACM 18(7), 1975.
    """
    hull = ConvexHull(points, qhull_options="QbB")  # in a unit box: as exact for small things as for large ones
    ends, rim = points[hull.simplices], points[hull.vertices].T
    along = ends[:, 1] - ends[:, 0]
    length = np.linalg.norm(along, axis=1)
    along = along[length > _SHORTEST_EDGE] / length[length > _SHORTEST_EDGE, None]
    places = np.stack([along @ rim, np.fliplr(along) * [-1.0, 1.0] @ rim])
    low, high = places.min(axis=2), places.max(axis=2)
    best = int(np.prod(high - low, axis=0).argmin())
    axes = np.array([along[best], [-along[best, 1], along[best, 0]]])
    middle, sides = (low[:, best] + high[:, best]) / 2.0 @ axes, high[:, best] - low[:, best]
    longer = int(sides[1] > sides[0])
    return middle, sides[[longer, 1 - longer]], float(np.arctan2(axes[longer, 1], axes[longer, 0]))


def upright_box(points: Array, fixed_axes: bool) -> tuple[Pose, Array]:
    """Return centre pose and extents (length, width, height) of a box around points, with vertical sides.

    `fixed_axes`: along the frame's own axes; otherwise turned about z for the smallest footprint. One on a line, as of
    a vertical sheet, has this direction and width 0; along x or y the frame's own axes are kept.
    """
    low, high = points[:, 2].min(), points[:, 2].max()
    if fixed_axes:
        lower, upper = points.min(axis=0), points.max(axis=0)
        return Pose(position=(lower + upper) / 2.0), upper - lower
    try:
        center, sides, yaw = _smallest_rectangle(points[:, :2])
    except (QhullError, ValueError):  # a footprint on a line or smaller than rounding has no hull
        first, last = points[[points[:, 0].argmin(), points[:, 0].argmax()], :2]
        along = last - first
        if not along.all():
            return upright_box(points, fixed_axes=True)
        center, sides = (first + last) / 2.0, np.array([np.hypot(*along), 0.0])
        yaw = float(np.arctan2(along[1], along[0]))
    pose = Pose.from_euler([center[0], center[1], (low + high) / 2.0], yaw=yaw)
    return pose, np.array([sides[0], sides[1], high - low])
