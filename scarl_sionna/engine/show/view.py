"""What is read of a world and its states to draw them: protocols, so that these modules do not import the world."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.pose import Pose
from scarl_sionna.core.results import ObjectState
from scarl_sionna.engine.rays.bent_faces import BentFaces
from scarl_sionna.engine.twins import MeshData
from scarl_sionna.engine.types import MitsubaObject
from scarl_sionna.scene.document.model import SceneDocument
from scarl_sionna.scene.tables import Actor, PartTable, RayHits

Array = npt.NDArray[np.float64]


class StateView(Protocol):
    """A :class:`scarl_sionna.engine.world.WorldState`."""

    @property
    def world(self) -> WorldView:
        """The world that it is a state of."""

    @property
    def time(self) -> float:
        """Its time [s]."""

    def actor_pose(self, name: str) -> Pose:
        """Return world_from_actor of an actor."""

    def boxes(self) -> tuple[ObjectState, ...]:
        """Return the ground truth of every actor and object."""

    def cast(self, origins: npt.ArrayLike, directions: npt.ArrayLike, max_distance: float = np.inf) -> RayHits:
        """Intersect rays with the scene [m, world]."""

    def radio_scene(self) -> MitsubaObject:
        """Return the Sionna RT scene in this state."""


class WorldView(Protocol):
    """A :class:`scarl_sionna.engine.world.World`."""

    @property
    def name(self) -> str:
        """Name of the scene."""

    @property
    def ego(self) -> str | None:
        """The actor that carries the rig."""

    @property
    def document(self) -> SceneDocument:
        """What the scene was made from."""

    @property
    def parts(self) -> PartTable:
        """Table of the parts."""

    @property
    def actors(self) -> tuple[Actor, ...]:
        """All actors."""

    def mesh(self, part: int) -> MeshData:
        """Return the mesh of a part."""

    def part_bounds(self) -> tuple[Array, Array]:
        """Return the lower and the upper corner of every part's box, each (num_parts, 3) [m]."""

    def with_parts_at(self, places: Mapping[int, Pose], bent_at: float = 0.0) -> StateView:
        """Return a state at rest in which the parts of actors have given places, those that bend as at a time [s]."""

    def bent_faces(self, places: Mapping[int, Pose], time: float) -> BentFaces:
        """Return the faces that bend as at a time [s], their parts in given places."""
