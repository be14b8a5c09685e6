"""All moving bodies of a scene apart from each other, for rays that each have a time of their own.

A ray that is carried into a body's frame at its own time meets the body where it stands still. Here every body stands
alone, below the scene, so that such a ray meets nothing else, and rays above meet the static scene only.
"""

from __future__ import annotations

from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from scarl_sionna.core.pose import Pose
from scarl_sionna.engine.show.view import StateView, WorldView
from scarl_sionna.scene.motion.trajectory import Motion
from scarl_sionna.scene.tables import Actor

from .bent_faces import BentFaces

Array = npt.NDArray[np.float64]

_REACH = 3.0
"""A ray that starts on a body's sphere and runs at most two radii stays within so many radii of the centre."""
_BETWEEN = 0.05
"""Farthest that a vertex comes out of the box around the postures of a body that bends, between two of them [m]."""


@dataclass(frozen=True, eq=False)
class RigidPart:
    """Parts of an actor that move as one rigid body: the actor itself, a wheel, a limb.

    Attributes
    ----------
    actor : Actor
    shape : str or None
        A shape with the body's joint; None for what is fixed to the actor.
    centre : ndarray of float64, shape (3,)
        Of a sphere that holds the body, in the frame of its parts [m].
    radius : float
        Of the sphere [m].
    half_size : ndarray of float64, shape (3,)
        Half extents of a box around the same centre along the axes of the parts [m].
    """

    actor: Actor
    shape: str | None
    centre: Array
    radius: float
    half_size: Array


@dataclass(frozen=True, eq=False)
class Apart:
    """All bodies of a world and the state in which they stand apart.

    Attributes
    ----------
    bodies : tuple of RigidPart
    body_of_part : ndarray of int32, shape (num_parts,)
        Index into `bodies`; -1 for a static part.
    centre : ndarray of float64, shape (num_bodies, 3)
        Where the centre of each body's sphere stands in `state` [m]; its axes are the world's.
    state : StateView
        Static parts in their places, bodies apart; those that bend as at time 0.
    places : dict of int to Pose
        Where each moving part is in `state`.
    """

    bodies: tuple[RigidPart, ...]
    body_of_part: npt.NDArray[np.int32]
    centre: Array
    state: StateView
    places: dict[int, Pose]

    @property
    def bends(self) -> bool:
        """Whether a body bends."""
        return any(body.actor.bending is not None for body in self.bodies)

    def bent_state(self, time: float) -> StateView:
        """Return the state in which bodies that bend are as at a time [s]."""
        return self.state.world.with_parts_at(self.places, time)

    def bent_faces(self, time: float) -> BentFaces:
        """Return the faces that bend as at a time [s], where the bodies stand apart."""
        return self.state.world.bent_faces(self.places, time)

    def motions(self, time: float) -> list[Motion]:
        """Return the motion in the world of every body: that of the centre of its sphere, with the axes of its parts.

        Past the end of its actor's trajectory a body keeps its last velocity and angular velocity.
        """
        of_actor: dict[str, tuple[Motion, dict[str, Motion], float]] = {}
        found = []
        for body in self.bodies:
            actor = body.actor
            if actor.name not in of_actor:
                known = min(time, actor.trajectory.stop)
                whole = Motion(actor.trajectory.pose(known), actor.trajectory.twist(known))
                of_actor[actor.name] = whole, actor.motions(known) if actor.joints else {}, time - known
            moved, jointed, beyond = of_actor[actor.name]
            if body.shape is not None:
                moved = moved.then(jointed[body.shape])
            moved = moved.then(Motion(Pose(body.centre)))
            found.append(_kept_moving(moved, beyond) if beyond > 0.0 else moved)
        return found


def _kept_moving(moved: Motion, time: float) -> Motion:
    turn = Rotation.from_rotvec(moved.twist.angular * time).as_matrix()
    place = moved.pose.position + moved.twist.linear * time
    return Motion(Pose.from_rotation(place, turn @ moved.pose.rotation), moved.twist)


_kept: WeakKeyDictionary[WorldView, Apart] = WeakKeyDictionary()


def stand_apart(world: WorldView) -> Apart:
    """Return the bodies of a world and the state in which they stand apart; made once for each world."""
    if world not in _kept:
        bodies, body_of_part = _bodies(world)
        lower, _ = world.part_bounds()
        static = lower[body_of_part < 0]
        lowest = float(static[:, 2].min()) if len(static) else 0.0
        largest = max((body.radius for body in bodies), default=0.0)
        side = int(np.ceil(np.sqrt(max(len(bodies), 1))))
        row, column = np.divmod(np.arange(len(bodies)), side)
        height = np.full(len(bodies), lowest - (_REACH + 1.0) * largest - 1.0)
        spacing = (2.0 * _REACH + 1.0) * largest
        centre = np.stack([(column - side / 2.0) * spacing, (row - side / 2.0) * spacing, height], axis=-1)
        places = {
            part: Pose(centre[body] - bodies[body].centre)
            for part, body in enumerate(body_of_part.tolist())
            if body >= 0
        }
        _kept[world] = Apart(bodies, body_of_part, centre, world.with_parts_at(places), places)
    return _kept[world]


def _bodies(world: WorldView) -> tuple[tuple[RigidPart, ...], npt.NDArray[np.int32]]:
    bodies: list[RigidPart] = []
    body_of_part = np.full(len(world.parts.name), -1, dtype=np.int32)
    for index, actor in enumerate(world.actors):
        start = actor.trajectory.start
        jointed = actor.motions(start if np.isfinite(start) else 0.0) if actor.joints else {}
        groups: dict[int, list[int]] = {}
        for part in np.flatnonzero(world.parts.actor == index).tolist():
            motion = jointed.get(world.parts.name[part])
            groups.setdefault(0 if motion is None else id(motion), []).append(part)
        for key, parts in groups.items():
            vertices = np.concatenate([_reached(world, actor, part) for part in parts])
            lower, upper = vertices.min(axis=0), vertices.max(axis=0)
            centre = (lower + upper) / 2.0
            radius = float(np.linalg.norm(vertices - centre, axis=1).max()) * (1.0 + 1e-6) + 1e-5
            body_of_part[parts] = len(bodies)
            bodies.append(
                RigidPart(actor, world.parts.name[parts[0]] if key else None, centre, radius, (upper - lower) / 2.0)
            )
    return tuple(bodies), body_of_part


def _reached(world: WorldView, actor: Actor, part: int) -> Array:
    """Return points that hold a part between them, in the frame of its body: its vertices, or a box if it bends."""
    name = world.parts.name[part]
    if actor.bending is None or name not in actor.bending.shapes:
        return world.mesh(part).vertices
    vertices = np.concatenate([posture[name].vertices for posture in actor.bending.postures()])
    lower, upper = vertices.min(axis=0) - _BETWEEN, vertices.max(axis=0) + _BETWEEN
    return np.array(
        [[x, y, z] for x in (lower[0], upper[0]) for y in (lower[1], upper[1]) for z in (lower[2], upper[2])]
    )
