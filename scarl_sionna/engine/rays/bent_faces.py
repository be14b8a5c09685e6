"""How the faces of parts that bend move, beyond the motion of their actor as a whole."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from scarl_sionna.core.pose import Pose
from scarl_sionna.engine.twins import MeshData
from scarl_sionna.scene.bodies.bending import BentMesh

from .geometry import closest_in_triangles

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]

CANDIDATES = 16
"""Faces nearest by their centres among which that of a point is looked for first."""
ON_FACE = 1e-4
"""A point farther than this from its best candidate [m] is compared with all faces of its part."""


@dataclass(frozen=True, eq=False)
class BentFaces:
    """Velocity of the faces of parts that bend.

    Attributes
    ----------
    number : ndarray of int64, shape (num_faces,)
        Row of each face of the state in the other columns, -1 for one that does not bend.
    part : ndarray of int64, shape (num_bent,)
    corners : ndarray of float64, shape (num_bent, 3, 3)
        [m, world].
    velocity : ndarray of float64, shape (num_bent, 3, 3)
        Of the corners, beyond that of the actor [m/s, world axes].
    """

    number: Index
    part: Index
    corners: Array
    velocity: Array

    @cached_property
    def affine(self) -> tuple[Array, Array]:
        """Velocity b + G p of the point p of each face: b (num_bent, 3) [m/s] and G (num_bent, 3, 3) [1/s].

        On a face it is what barycentric coordinates make of its corners' velocities.
        """
        along = self.corners[:, 1:] - self.corners[:, :1]
        gained = self.velocity[:, 1:] - self.velocity[:, :1]
        normal = np.cross(along[:, 0], along[:, 1])
        size = np.sqrt(np.linalg.norm(normal, axis=1))
        sound = size > 1e-9 * np.abs(along).max(axis=(1, 2))
        unit = np.divide(normal, np.maximum(size, 1e-300)[:, None])
        frame = np.where(sound[:, None, None], np.stack([*along.swapaxes(0, 1), unit], axis=2), np.eye(3))
        moved = np.stack([*gained.swapaxes(0, 1), np.zeros_like(unit)], axis=2)
        gradient = np.where(sound[:, None, None], moved @ np.linalg.inv(frame), 0.0)
        return self.velocity[:, 0] - np.einsum("nij,nj->ni", gradient, self.corners[:, 0]), gradient

    def at(self, face: Index, point: Array) -> Array:
        """Return the velocity of points (n, 3) [m, world] of faces (n,) of the state, zeros where nothing bends."""
        row = self.number[face]
        base, gradient = self.affine
        found = base[row] + np.einsum("nij,nj->ni", gradient[row], point)
        return np.where((row >= 0)[:, None], found, 0.0)

    def carried(self, face: Index, point: Array, later: BentFaces) -> tuple[Index, Array]:
        """Return which of some points (n, 3) [m, world] of faces (n,) bend, and where those are in another state."""
        rows = np.flatnonzero(self.number[face] >= 0)
        own = self.number[face[rows]]
        _, share = closest_in_triangles(point[rows], self.corners[own])
        return rows, np.einsum("nk,nki->ni", share, later.corners[own])

    def nearest(self, part: Index, point: Array) -> Array:
        """Return the velocity of the nearest point of the surface of parts (n,) to points (n, 3) [m, world]."""
        result = np.zeros_like(point)
        for one in np.intersect1d(part, self.part).tolist():
            rows, own = np.flatnonzero(part == one), np.flatnonzero(self.part == one)
            corners = self.corners[own]
            count = min(CANDIDATES, len(own))
            _, near = cKDTree(corners.mean(axis=1)).query(point[rows], k=count)
            near = near.reshape(len(rows), count)
            away, share = closest_in_triangles(point[rows][:, None], corners[near])
            best = away.argmin(axis=1)
            face, shares = near[np.arange(len(rows)), best], share[np.arange(len(rows)), best]
            for far in np.flatnonzero(away.min(axis=1) > ON_FACE).tolist():
                distances, all_shares = closest_in_triangles(point[rows[far]][None, None], corners[None])
                face[far] = int(distances[0].argmin())
                shares[far] = all_shares[0, face[far]]
            result[rows] = np.einsum("nk,nki->ni", shares, self.velocity[own[face]])
        return result


def bent_faces(
    first: Index, mesh: Callable[[int], MeshData], bent: Mapping[int, BentMesh], places: Mapping[int, Pose]
) -> BentFaces:
    """Return the faces of parts that bend.

    Parameters
    ----------
    first : ndarray of int64, shape (num_parts + 1,)
        Where each part's faces begin.
    mesh : callable
        Mesh of a part, for its faces.
    bent : mapping of int to BentMesh
        By part, in the part's frame.
    places : mapping of int to Pose
        world_from_part.
    """
    number = np.full(int(first[-1]), -1, dtype=np.int64)
    rows = np.concatenate([np.arange(first[part], first[part + 1]) for part in bent])
    number[rows] = np.arange(len(rows))
    owner = np.concatenate([np.full(int(first[part + 1] - first[part]), part) for part in bent])
    corners = [places[part].apply(own.vertices)[mesh(part).faces] for part, own in bent.items()]
    velocity = [places[part].rotate(own.velocity)[mesh(part).faces] for part, own in bent.items()]
    return BentFaces(number, owner, np.concatenate(corners), np.concatenate(velocity))
