"""What an instance of a scene is: its parts, its box, and whether it is a room."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import MeshError
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.semantics import semantic_id
from scarl_sionna.scene.bodies.bending import Bending, BentMesh
from scarl_sionna.scene.document.model import InstanceEntry
from scarl_sionna.scene.motion.articulation import Joint, joints_on
from scarl_sionna.scene.motion.trajectory import Motion, StaticTrajectory, body_from_road
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
        self._boxes: dict[object, tuple[Pose, Array]] = {}

    def of_instance(self, number: int) -> tuple[int, ...]:
        """Return the rows of the parts of an instance."""
        return tuple(int(part) for part in np.flatnonzero(self.parts.instance == number))

    def vertices(
        self, parts: Sequence[int], moved: Mapping[str, Motion], bent: Mapping[str, BentMesh] | None = None
    ) -> Array:
        """Return the vertices of parts in the frame of their instance, those with a joint where that has them.

        Parameters
        ----------
        parts : sequence of int
            Rows of the part table, at least one.
        moved : mapping of str to Motion
            Motion relative to the instance, by the name of the shape.
        bent : mapping of str to BentMesh, optional
            Meshes of shapes that bend.

        Returns
        -------
        ndarray of float64, shape (num_vertices, 3)
            [m].
        """
        vertices = []
        for part in parts:
            name = self.parts.name[part]
            own = bent[name].vertices if bent and name in bent else self.meshes[name].vertices
            vertices.append(moved[name].pose.apply(own) if name in moved else own)
        return np.concatenate(vertices)

    def box_of_track(
        self, parts: Sequence[int], joints: Sequence[Joint], bending: Bending | None = None
    ) -> tuple[Pose, Array] | None:
        """Return the one box of an actor that changes its shape, in the actor's frame; None for one that does not.

        It holds every posture between which the joints move, so that neither its size nor its place in the actor's
        frame follows single steps.

        Parameters
        ----------
        parts : sequence of int
            Rows of the part table, at least one.
        joints : sequence of Joint
            The actor's, on its trajectory.
        bending : Bending, optional
            How it bends.

        Returns
        -------
        tuple of (Pose, ndarray of float64, shape (3,)), or None
            Pose of the centre, and length, width and height [m].
        """
        reaches = tuple(joint.reach for joint in joints if joint.reach is not None)
        if not reaches and bending is None:
            return None
        key = tuple(parts), reaches, bending
        if key not in self._boxes:
            boxes = [
                upright_box(self.vertices(parts, moved), fixed_axes=True)
                for reach in reaches
                for moved in reach.postures()
            ]
            for bent in () if bending is None else bending.postures():
                boxes.append(upright_box(self.vertices(parts, {}, bent), fixed_axes=True))
            corners = np.array([box.position + sign * size / 2.0 for box, size in boxes for sign in (-1.0, 1.0)])
            self._boxes[key] = upright_box(corners, fixed_axes=True)
        return self._boxes[key]

    def with_boxes(self, instances: Mapping[int, InstanceInfo], actors: Iterable[Actor]) -> dict[int, InstanceInfo]:
        """Return instances with the boxes that actors have on other trajectories."""
        found = dict(instances)
        for actor in actors:
            info = found[actor.instance]
            if (box := self.box_of_track(info.parts, actor.joints, actor.bending)) is not None:
                found[actor.instance] = replace(info, frame_from_box=box[0], size=box[1])
        return found


def check_bodies(actors: Iterable[Actor], meshes: Mapping[str, MeshData]) -> None:
    """Raise `MeshError` unless shapes that bend are those of the bodies behind them."""
    for actor in actors:
        if actor.bending is None:
            continue
        for shape, part in actor.bending.shapes.items():
            skin, mesh = actor.bending.body.skins[part], meshes[shape]
            if len(mesh.vertices) != len(skin.vertices) or not np.array_equal(mesh.faces, skin.faces):
                remedy = "write the actor model again with actor_from_body"
                raise MeshError(f"shape '{shape}' is not part '{part}' of the body behind it", remedy=remedy)


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
    bent: dict[str, BentMesh] = {}
    of_track = None
    if entry.trajectory is not None:
        start = entry.trajectory.start
        first = start if np.isfinite(start) else 0.0
        actor = Actor.of(entry, number, entry.trajectory)
        if body_from_road(entry.trajectory, first) is not None:  # its box is that of a body as level as its wheels
            still = StaticTrajectory(entry.trajectory.pose(first))
            actor = replace(actor, trajectory=still, joints=joints_on(entry.joints, still))
        moved, bent = actor.motions(first), actor.bent(first)
        of_track = shapes.box_of_track(parts, actor.joints, actor.bending)
    vertices = shapes.vertices(parts, moved, bent)
    is_actor = entry.trajectory is not None
    frame_from_box, size = of_track or upright_box(vertices, fixed_axes=is_actor or not entry.is_object)
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
