"""Edges of meshes as wedges, in float64: where two faces of a part meet, or where a sheet ends."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from scarl_sionna.engine.world import WorldState

Array = npt.NDArray[np.float64]

SAME_VERTEX = 1e-5
"""Vertices of one part this close together [m] are one: meshes with a normal for each face hold them apart."""
FLAT = 1e-3
"""Faces that meet at less than this angle from a plane [rad] make no edge."""


@dataclass(frozen=True, eq=False)
class Wedge:
    """One straight edge and the two half planes that meet in it.

    Attributes
    ----------
    origin, direction : ndarray of float64, shape (3,)
        One end [m, world] and the unit vector to the other.
    length : float
        [m].
    tangent : ndarray of float64, shape (3,)
        Unit vector in the 0-face, at right angles to the edge, away from it.
    normal : ndarray of float64, shape (3,)
        Unit normal of the 0-face, out of the body. Angles around the edge are counted from `tangent` to `normal`.
    exterior : float
        Angle outside of the body from the 0-face to the other [rad]: more than pi; 2 pi for the end of a sheet.
    """

    origin: Array
    direction: Array
    length: float
    tangent: Array
    normal: Array
    exterior: float

    def cylindrical(self, point: Array) -> tuple[float, float, float]:
        """Return distance from the edge's line [m], angle around it, 0 to 2 pi, and place along it [m] of a point."""
        away = point - self.origin
        x, y = float(away @ self.tangent), float(away @ self.normal)
        return float(np.hypot(x, y)), float(np.arctan2(y, x) % (2.0 * np.pi)), float(away @ self.direction)

    def seen_from(self, point: Array) -> Wedge | None:
        """Return the same wedge with its 0-face lit from a point, or None where the point is within the body."""
        angle = self.cylindrical(point)[1]
        if self.exterior > 2.0 * np.pi - 1e-9:  # a sheet: the side that the point sees is the 0-face
            return (
                self
                if angle <= np.pi
                else Wedge(self.origin, self.direction, self.length, self.tangent, -self.normal, self.exterior)
            )
        if angle > self.exterior:
            return None
        if angle <= np.pi:
            return self
        cosine, sine = np.cos(self.exterior), np.sin(self.exterior)
        tangent = cosine * self.tangent + sine * self.normal
        normal = sine * self.tangent - cosine * self.normal
        return Wedge(self.origin, self.direction, self.length, tangent, normal, self.exterior)


def wedge_at(state: WorldState, part: int, face: int, point: Array) -> Wedge | None:
    """Return the wedge at the edge of a face that is nearest to a point.

    Parameters
    ----------
    state : WorldState
    part, face : int
        Row of the part table and face within the part.
    point : ndarray of float64, shape (3,)
        [m, world], on the edge up to float32.

    Returns
    -------
    Wedge or None
        None where no edge is: the neighbour is in the same plane, more than two faces meet, or the corner is concave
        for all that surrounds the body (there is then no outside of more than pi).
    """
    triangles = state._triangles
    rows = np.arange(triangles.first[part], triangles.first[part + 1])
    own = triangles.corners[rows[face]]
    ends = own[[(0, 1), (1, 2), (2, 0)]]
    along = ends[:, 1] - ends[:, 0]
    length = np.linalg.norm(along, axis=1)
    if length.min() < SAME_VERTEX:
        return None
    share = np.clip(np.einsum("ei,ei->e", point - ends[:, 0], along) / length**2, 0.0, 1.0)
    nearest = int(np.linalg.norm(ends[:, 0] + share[:, None] * along - point, axis=1).argmin())
    origin, direction = ends[nearest, 0], along[nearest] / length[nearest]
    corners = triangles.corners[rows]
    touches = [(np.abs(corners - end).max(axis=2) < SAME_VERTEX).any(axis=1) for end in ends[nearest]]
    others = np.setdiff1d(np.flatnonzero(touches[0] & touches[1]), [face])
    tangent = _tangent(own, origin, direction)
    if tangent is None or len(others) > 1:
        return None
    if len(others) == 0:
        normal = np.cross(direction, tangent)
        return Wedge(origin, direction, float(length[nearest]), tangent, normal, 2.0 * np.pi)
    other = _tangent(corners[others[0]], origin, direction)
    if other is None:
        return None
    interior = float(np.arccos(np.clip(tangent @ other, -1.0, 1.0)))
    if interior > np.pi - FLAT:
        return None
    if interior < FLAT:  # a sheet folded onto itself
        return Wedge(origin, direction, float(length[nearest]), tangent, np.cross(direction, tangent), 2.0 * np.pi)
    normal = -(other - (other @ tangent) * tangent)
    return Wedge(
        origin, direction, float(length[nearest]), tangent, normal / np.linalg.norm(normal), 2.0 * np.pi - interior
    )


def _tangent(corners: Array, origin: Array, direction: Array) -> Array | None:
    """Return the unit vector in a face across one of its edges, or None for a degenerate face."""
    away = corners - origin
    away = away - (away @ direction)[:, None] * direction
    length = np.linalg.norm(away, axis=1)
    farthest = int(length.argmax())
    return None if length[farthest] < SAME_VERTEX else away[farthest] / length[farthest]
