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
    world = state.world
    part = world._triangles.part
    if world not in _numbers:
        _numbers[world] = plane_numbers(world._triangles.normal, world._triangles.offset, part), repeated_faces(world)
    plane, repeated = _numbers[world]
    if state._bent:
        bends = np.isin(part, list(state._bent))
        plane = np.where(bends, plane.max() + 1 + np.arange(len(plane)), plane)
    return FaceTable(state._triangles, part, plane, repeated)


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
