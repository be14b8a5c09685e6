"""What all that is put beside a street needs: the scene, its ground, free room, and a generator for each part."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from scenes_xml.generators.geometry.mesh import Mesh
from scenes_xml.generators.kit import Prefab, SceneKit

from ..building.heights import GroundHeight
from ..model import Array
from .room import Room
from .sides import Side


@dataclass(frozen=True, eq=False)
class Stand:
    """How a thing stands: its foot (3,) [m], heading [rad], size, and materials of parts in place of their own."""

    foot: Array
    yaw: float
    scale: float = 1.0
    materials: Mapping[str, str] = field(default_factory=dict)


@dataclass(eq=False)
class Site:
    """A scene that gets surroundings.

    Attributes
    ----------
    kit : SceneKit
    room : Room
    ground : GroundHeight
    seed : int
    sides : tuple of Side
    centre : ndarray of float64, shape (2,)
        Where the town, or the village, is densest [m].
    reach : float
        How far from there houses stand close [m].
    rows : dict
        Meshes by class and material that are added as one for each block of the map.
    """

    kit: SceneKit
    room: Room
    ground: GroundHeight
    seed: int
    sides: tuple[Side, ...]
    centre: Array
    reach: float
    rows: defaultdict[tuple[str, str], list[Mesh]] = field(default_factory=lambda: defaultdict(list))
    _ready: dict[str, Prefab] = field(default_factory=dict)
    _count: defaultdict[str, int] = field(default_factory=lambda: defaultdict(int))

    def generator(self, part: int, number: int) -> np.random.Generator:
        """Return the generator of one part of the surroundings at one side."""
        return np.random.default_rng([self.seed, part, number])

    def is_dense(self, side: Side, place: int) -> bool:
        """Return whether a place lies in the middle of a town or village."""
        return side.character != "motorway" and bool(np.linalg.norm(side.front[place, :2] - self.centre) < self.reach)

    def on_ground(self, place: Array) -> Array:
        """Return a place (2,) or places (n, 2) with the height of the ground [m]."""
        flat = np.atleast_2d(place)[:, :2]
        found = np.column_stack([flat, self.ground(flat)])
        return found[0] if np.ndim(place) == 1 else found

    def put(self, kind: str, make: Callable[[], Prefab], semantic: str, stand: Stand) -> None:
        """Place a copy of a thing, which is made where it is the first of its kind."""
        if kind not in self._ready:
            self._ready[kind] = make()
        name, thing = f"beside_{kind}_{self._count[kind]}", self._ready[kind]
        self._count[kind] += 1
        yaw = float(np.degrees(stand.yaw))
        self.kit.place(thing, name, semantic, stand.foot, yaw, stand.scale, True, None, **stand.materials)
