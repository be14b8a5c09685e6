"""What an instance of a scene is: its parts, its box, and whether it is a room."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.semantics import semantic_id
from scarl_sionna.scene.document.model import InstanceEntry
from scarl_sionna.scene.motion.trajectory import Motion
from scarl_sionna.scene.tables import Actor, InstanceInfo, PartTable

from .rays.geometry import upright_box
from .twins import MeshData

Array = npt.NDArray[np.float64]

SMALLEST_ROOM = 2.0
"""In a scene without scene.toml, a mesh with all sides at least this long [m] that holds everything is taken for a
room."""


class Shapes:
    """The parts of a scene with their meshes."""

    def __init__(self, parts: PartTable, meshes: Mapping[str, MeshData]) -> None:
        self.parts = parts
        self.meshes = meshes

    def of_instance(self, number: int) -> tuple[int, ...]:
        """Return the rows of the parts of an instance."""
        return tuple(int(part) for part in np.flatnonzero(self.parts.instance == number))

    def vertices(self, parts: Sequence[int], moved: Mapping[str, Motion]) -> Array:
        """Return the vertices of parts in the frame of their instance, those with a joint where that has them.

        Parameters
        ----------
        parts : sequence of int
            Rows of the part table, at least one.
        moved : mapping of str to Motion
            Motion relative to the instance, by the name of the shape.

        Returns
        -------
        ndarray of float64, shape (num_vertices, 3)
            [m].
        """
        vertices = []
        for part in parts:
            name = self.parts.name[part]
            own = self.meshes[name].vertices
            vertices.append(moved[name].pose.apply(own) if name in moved else own)
        return np.concatenate(vertices)


def describe_instance(shapes: Shapes, number: int, entry: InstanceEntry, scene_corners: Array | None) -> InstanceInfo:
    """Return what a sensor knows of an instance.

    Parameters
    ----------
    shapes : Shapes
    number : int
        Of the instance, from 1.
    entry : InstanceEntry
    scene_corners : ndarray of float64, shape (num_corners, 3), or None
        Corners of all triangles [m, world], given where a mesh that holds them all is to be taken for a room.

    Returns
    -------
    InstanceInfo
    """
    parts = shapes.of_instance(number)
    moved: dict[str, Motion] = {}
    if entry.trajectory is not None:
        start = entry.trajectory.start
        actor = Actor(entry.name, number, entry.trajectory, entry.joints)
        moved = actor.motions(start if np.isfinite(start) else 0.0)
    vertices = shapes.vertices(parts, moved)
    is_actor = entry.trajectory is not None
    frame_from_box, size = upright_box(vertices, fixed_axes=is_actor or not entry.is_object)
    is_room = entry.is_room or (scene_corners is not None and _holds_all(vertices, scene_corners))
    name = entry.name if is_actor else None
    return InstanceInfo(
        entry.name, number, semantic_id(entry.semantic), parts, entry.is_object, is_room, name, frame_from_box, size
    )


def _holds_all(vertices: Array, corners: Array) -> bool:
    """Return whether the bounding box of an instance is room-sized and holds the whole scene."""
    lower, upper = vertices.min(axis=0), vertices.max(axis=0)
    whole = np.all(corners.min(axis=0) >= lower) and np.all(corners.max(axis=0) <= upper)
    return bool(whole and np.all(upper - lower >= SMALLEST_ROOM))
