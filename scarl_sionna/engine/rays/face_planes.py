"""The float64 planes of all triangles of a state, and which of them are the same plane."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt

from .geometry import Triangles

if TYPE_CHECKING:
    from scarl_sionna.engine.world import World, WorldState

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]

SAME_PLANE = 1e-6
"""Faces of one part whose unit normals and offsets agree within this have one plane number; offsets in metres for a
scene, in radii of the mesh for one mesh: 1 um of a metre."""

_numbers: WeakKeyDictionary[World, tuple[Index, Flags]] = WeakKeyDictionary()


@dataclass(frozen=True, eq=False)
class FaceTable:
    """Triangles of a state.

    Attributes
    ----------
    triangles : Triangles
        Float64, world frame.
    part : ndarray of int64, shape (num_faces,)
        Row of the part table.
    plane : ndarray of int64, shape (num_faces,)
        Faces of one part that lie in one plane, whichever way they are turned, have one number.
    repeated : ndarray of bool, shape (num_faces,)
        Has the corners of an earlier face, as the second side of a sheet that is modelled with two has.
    """

    triangles: Triangles
    part: Index
    plane: Index
    repeated: Flags


def face_table(state: WorldState) -> FaceTable:
    """Return the triangles of a state; plane numbers are the same at all times, one a face where parts bend."""
    part = state.world._triangles.part
    plane, repeated = _known_numbers(state.world)
    if state._bent:
        bends = np.isin(part, list(state._bent))
        plane = np.where(bends, plane.max() + 1 + np.arange(len(plane)), plane)
    return FaceTable(state._triangles, part, plane, repeated)


def rigid_planes(world: World) -> Index:
    """Return the plane numbers of the triangles of a world as they are modelled, before anything bends."""
    return _known_numbers(world)[0]


def _known_numbers(world: World) -> tuple[Index, Flags]:
    """Return plane numbers and which faces are repeated, found once for a world."""
    if world not in _numbers:
        triangles = world._triangles
        planes = plane_numbers(triangles.normal, triangles.offset, triangles.part)
        _numbers[world] = planes, repeated_faces(world)
    return _numbers[world]


def repeated_faces(world: World) -> Flags:
    """Return which faces have the corners of an earlier one of the same body."""
    corners = np.round(world._triangles.corners / SAME_PLANE).astype(np.int64)
    order = np.lexsort(np.moveaxis(corners, 2, 0)[::-1], axis=1)
    corners = np.take_along_axis(corners, order[..., None], axis=1)
    keys = np.column_stack([world.parts.actor[world._triangles.part], corners.reshape(len(corners), 9)])
    order = np.lexsort(keys.T)  # stable: the earliest of equal ones comes first
    repeated = np.zeros(len(keys), dtype=np.bool_)
    repeated[order[1:]] = np.all(np.diff(keys[order], axis=0) == 0, axis=1)
    return repeated


def plane_numbers(normal: Array, offset: Array, part: Index) -> Index:
    """Return the number of each face's plane, shape (num_faces,).

    Both sides of a plane have one number, two parts never.

    Parameters
    ----------
    normal : ndarray of float64, shape (num_faces, 3)
        Unit normals.
    offset : ndarray of float64, shape (num_faces,)
        normal . vertex, in the unit in which 1e-6 is the same plane.
    part : ndarray of int64, shape (num_faces,)
    """
    pivot = np.abs(normal).argmax(axis=1)
    sign = np.where(normal[np.arange(len(normal)), pivot] < 0.0, -1.0, 1.0)
    rounded = np.round(np.column_stack([normal, offset]) * (sign / SAME_PLANE)[:, None]).astype(np.int64)
    keys = np.column_stack([part, rounded])
    order = np.lexsort(keys.T)
    new = np.any(np.diff(keys[order], axis=0) != 0, axis=1)
    number = np.empty(len(keys), dtype=np.int64)
    number[order] = np.concatenate([[0], np.cumsum(new)])
    return number
