"""The edges of meshes that diffract, as pieces of wedges."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from scarl_sionna.engine.rays.face_rays import FaceRays
from scarl_sionna.engine.smooth.creases import joined_vertices

from .fringe import ALONG, Faces, fringe_current

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]
Complex = npt.NDArray[np.complex128]
Mask = npt.NDArray[np.bool_]

LEAST_BEND = np.radians(0.05)
"""Edges that bend by less [rad] are none, whatever the crease angle."""
SAME_SIDE = 1e-6
"""Faces nearer to each other than this [rad] are the two sides of one sheet."""
CLEARANCE = 0.125
"""Something this near to an edge [wavelengths] closes it: a panel that goes on, the ground below a box."""
MARGIN = 0.05
"""Angle [rad] that the loop of rays around an edge keeps from its faces."""


@dataclass(frozen=True, eq=False)
class Wedges:
    """Pieces of edges, each with the two faces that meet there; an edge with space on both sides is there twice.

    Attributes
    ----------
    start, stop : ndarray of float64, shape (n, 3)
        Ends of the pieces [m].
    inward, normal : ndarray of float64, shape (n, 2, 3)
        Of both faces: unit vectors away from the edge, and normal to the face on the outer side.
    opening : ndarray of float64, shape (n,)
        Angle between the faces on that side, above pi [rad].
    face : ndarray of int64, shape (n, 2)
        Both faces; the same one twice at the border of a sheet.
    """

    start: Array
    stop: Array
    inward: Array
    normal: Array
    opening: Array
    face: Index

    def __len__(self) -> int:
        return len(self.opening)

    def take(self, rows: Index | Mask) -> Wedges:
        """Return some rows."""
        return Wedges(*(column[rows] for column in vars(self).values()))

    @property
    def center(self) -> Array:
        """Middle of the pieces, shape (n, 3) [m]."""
        return 0.5 * (self.start + self.stop)

    def side(self, number: int) -> Faces:
        """Return the first or the second faces."""
        return Faces(self.inward[:, number], self.normal[:, number], self.opening)

    def outside(self, towards: Array) -> Mask:
        """Return which of directions (n, 3) run outside of the conductor."""
        return self.side(0).azimuth(towards) <= self.opening + ALONG

    def cut(self, count: Index) -> Wedges:
        """Return these cut into some number of equal pieces each."""
        rows = np.repeat(np.arange(len(self)), count)
        number = np.arange(len(rows)) - np.repeat(np.cumsum(count) - count, count)
        along = (self.stop - self.start)[rows] / count[rows, None]
        start = self.start[rows] + number[:, None] * along
        return Wedges(start, start + along, self.inward[rows], self.normal[rows], self.opening[rows], self.face[rows])

    def turned(self, angle: Array) -> Array:
        """Return unit vectors (n, 3) at angles (n,) around the edge from the first face [rad]."""
        return np.cos(angle)[:, None] * self.inward[:, 0] + np.sin(angle)[:, None] * self.normal[:, 0]

    def middle(self) -> Array:
        """Return unit vectors (n, 3) from the edge away from both faces."""
        return self.turned(0.5 * self.opening)


def wedges_of(corners: Array, face: Index, crease_angle: float) -> Wedges:
    """Return the edges of triangles that bend by more than an angle, and their borders.

    Parameters
    ----------
    corners : ndarray of float64, shape (n, 3, 3)
        [m].
    face : ndarray of int64, shape (n,)
        Numbers of the triangles.
    crease_angle : float
        [rad].

    Notes
    -----
    Edges at which more than two faces meet are left out. Faces with the corners of an earlier one count once.
    """
    if not len(corners):
        none = np.zeros((0, 2, 3))
        return Wedges(none[:, 0], none[:, 0], none, none, np.zeros(0), np.zeros((0, 2), dtype=np.int64))
    vertex = joined_vertices(corners)
    once = np.unique(np.sort(vertex, axis=1), axis=0, return_index=True)[1]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    sound = np.sort(once[across[once].any(axis=1)])
    corners, face, vertex = corners[sound], face[sound], vertex[sound]
    low, high = (pick(vertex, np.roll(vertex, -1, axis=1)).ravel() for pick in (np.minimum, np.maximum))
    key = low * (int(vertex.max(initial=0)) + 1) + high
    order = np.argsort(key, kind="stable")
    first = np.flatnonzero(np.diff(key[order], prepend=-1))
    count = np.diff(first, append=len(order))
    used = (count <= 2) & (low != high)[order[first]]
    one, two = order[first[used]], order[first[used] + count[used] - 1]
    start = corners[one // 3, one % 3]
    stop = corners[one // 3, (one % 3 + 1) % 3]
    far = np.stack([corners[half // 3, (half % 3 + 2) % 3] for half in (one, two)], axis=1)
    return _outer(start, stop, far, face[np.stack([one // 3, two // 3], axis=1)], crease_angle)


def _outer(start: Array, stop: Array, far: Array, face: Index, crease_angle: float) -> Wedges:
    """Return the sides of edges on which they stand out; `far` (n, 2, 3) are points of both faces."""
    along = stop - start
    edge = along / np.linalg.norm(along, axis=1, keepdims=True)
    arm = far - start[:, None]
    arm = arm - np.einsum("nij,nj->ni", arm, edge)[:, :, None] * edge[:, None]
    inward = arm / np.linalg.norm(arm, axis=2, keepdims=True)
    normal = np.cross(edge[:, None], inward)
    angle = np.arctan2(
        np.einsum("ij,ij->i", inward[:, 1], normal[:, 0]), np.einsum("ij,ij->i", inward[:, 1], inward[:, 0])
    )
    angle = np.mod(angle, 2.0 * np.pi)
    sheet = (face[:, 0] == face[:, 1]) | (np.minimum(angle, 2.0 * np.pi - angle) < SAME_SIDE)
    angle = np.where(sheet, 2.0 * np.pi, angle)
    least = np.pi + max(crease_angle, LEAST_BEND)
    signs = np.array([1.0, -1.0])[None, :, None]
    sides = [
        Wedges(start, stop, inward, normal * signs * turn, opening, face)
        for turn, opening in ((1.0, angle), (-1.0, 2.0 * np.pi - angle))
    ]
    kept = [side.take(side.opening > least) for side in sides]
    return Wedges(*(np.concatenate(columns) for columns in zip(*(vars(side).values() for side in kept), strict=True)))


def free_standing(rays: FaceRays, wedges: Wedges, wavelength: float) -> Wedges:
    """Return the pieces around which nothing else is within `CLEARANCE`.

    Parameters
    ----------
    rays : FaceRays
    wedges : Wedges
    wavelength : float
        [m].
    """
    if not len(wedges):
        return wedges
    length = np.linalg.norm(wedges.stop - wedges.start, axis=1)
    radius = np.minimum(CLEARANCE * wavelength, 0.25 * length)[:, None]
    closed = np.zeros(len(wedges), dtype=np.bool_)
    angles = MARGIN + np.linspace(0.0, 1.0, 5)[:, None] * (wedges.opening - 2.0 * MARGIN)
    points = [wedges.center + radius * wedges.turned(angle) for angle in angles]
    for begin, end in pairwise(points):
        closed |= blocked(rays, begin, end)
    return wedges.take(~closed)


def blocked(rays: FaceRays, begin: Array, end: Array) -> Mask:
    """Return whether anything stands between points (n, 3) and others [m]."""
    with rays.active():
        start, ray = rays.placed(begin), rays.placed(end) - rays.placed(begin)
        length = np.linalg.norm(ray, axis=1)
        hit = rays.blocked(rays.vectors(start), rays.vectors(ray / length[:, None]), rays.reals(length))
        return np.asarray(hit.numpy(), dtype=np.bool_)


def hidden(rays: FaceRays, wedges: Wedges, towards: Array) -> Mask:
    """Return whether anything stands before the middles of pieces in directions (n, 3)."""
    if not len(wedges):
        return np.zeros(0, dtype=np.bool_)
    with rays.active():
        point = rays.lifted(rays.vectors(rays.placed(wedges.center)), rays.vectors(wedges.middle()))
        return np.asarray(rays.blocked(point, rays.vectors(towards)).numpy(), dtype=np.bool_)


def edge_current(wedges: Wedges, level: Complex, direction: Array, field: Complex, observer: Array) -> Complex:
    """Return the fringe currents of both faces of pieces; `level` (n, 2) scales them, the rest as of the wedge's."""
    total = np.zeros_like(field)
    for side in range(2):
        total += level[:, side, None, None] * fringe_current(wedges.side(side), direction, field, observer)
    return total
