"""Triangles of a state around a place that is far from the world's origin, for the engine in a frame of its own.

The engine holds coordinates in float32, whose step is 4e-6 m at 50 m, 1e-4 m at 1.5 km and 2e-3 m at 20 km. Near the
origin that is far below what rays are told apart by (1e-6 of 1 m + distance); away from it a ray that runs to a point
meets the face on which that point is before it. So where a sensor stands far out the triangles are given to the engine
relative to a place near the sensor, rounded from float64, and rays alike.
"""

from __future__ import annotations

from collections import OrderedDict
from types import ModuleType
from typing import Protocol, TypeVar
from weakref import WeakKeyDictionary, ref

import numpy as np
import numpy.typing as npt

from scarl_sionna.engine import variant
from scarl_sionna.engine.device import Device
from scarl_sionna.engine.joined import number_of
from scarl_sionna.engine.threads import many_threads
from scarl_sionna.engine.twins import MISS
from scarl_sionna.engine.types import DeviceArray, MitsubaObject
from scarl_sionna.scene.tables import PartTable

from .geometry import Triangles

Array = npt.NDArray[np.float64]
Kept = TypeVar("Kept")

AROUND_ORIGIN = 128.0
"""A place with no coordinate beyond this [m] is near the origin: there the engine's own scene, which is in the world's
frame, serves. Its float32 step is at most 8e-6 m there."""
CELL = 64.0
"""Farther out frames stand at multiples of this [m], so that sensors of one car, and of many frames, share one."""
WIDEST = 1024.0
"""Rays that begin farther apart than this [m] have no place in common; the world's frame serves."""
KEPT = 4
"""Frames of a world that are kept at a time: those of a car that stands where four of them meet."""


class Owner(Protocol):
    """A world whose triangles are placed."""

    @property
    def _triangles(self) -> Triangles:
        """At its start, of all parts."""

    @property
    def parts(self) -> PartTable:
        """Table of its parts."""


class State(Protocol):
    """A state of a world, :class:`~scarl_sionna.engine.world.WorldState`."""

    @property
    def world(self) -> Owner:
        """Of which it is a state."""

    @property
    def _triangles(self) -> Triangles:
        """Where they are."""

    def _applied(self, kind: str) -> EngineScene:
        """Return the twin of a kind in this state."""


class EngineScene(Protocol):
    """What rays run through: a twin, or the triangles of a state around a place."""

    @property
    def kind(self) -> str:
        """That of the variant in which it works."""

    @property
    def mi_scene(self) -> MitsubaObject:
        """The engine's scene."""

    @property
    def origin(self) -> Array | None:
        """Origin of its frame [m, world]; None for the world's own frame."""

    def faces(self, found: MitsubaObject) -> DeviceArray:
        """Return the face of each of the engine's intersections, a row of the state's triangles, or `MISS`."""


class Nearby:
    """The triangles of a state in a frame whose axes are the world's; see :class:`EngineScene`.

    Parameters
    ----------
    mi : module
        Mitsuba in the variant of `kind`.
    kind : {"optical", "radio"}
    state : State
    origin : ndarray of float64, shape (3,)
        [m, world].
    still : mitsuba.Shape or None
        What stands still as a group in the same frame, which keeps its tree from state to state; None: nothing does.
    """

    def __init__(self, mi: ModuleType, kind: str, state: State, origin: Array, still: MitsubaObject | None) -> None:
        self.kind, self.origin = kind, origin
        on, moves = Device(mi), _moves(state)
        moving = np.flatnonzero(moves)
        groups = [] if still is None else [still]
        if len(moving):
            groups.append(_group(mi, state._triangles.corners[moving] - origin))
        placed = [mi.load_dict({"type": "instance", "group": group}) for group in groups]
        objects = {f"{number}": each for number, each in enumerate((*groups, *placed))}
        with many_threads():
            self.mi_scene = mi.load_dict({"type": "scene", **objects})
        self._moving = on.index(np.array([number_of(mi, placed[-1]) if len(moving) else 0]))
        self._first_moving = on.index(np.array([len(moves) - len(moving)]))
        self._face = on.label(np.concatenate([np.flatnonzero(~moves), moving]))

    def faces(self, found: MitsubaObject) -> DeviceArray:
        """Return the face of each of the engine's intersections, `MISS` for none."""
        import drjit as dr
        import mitsuba as mi

        valid = found.is_valid()
        moves = dr.reinterpret_array(mi.UInt32, found.instance) == self._moving
        row = found.prim_index + dr.select(valid & moves, self._first_moving, 0)
        return dr.select(valid, dr.gather(mi.Int32, self._face, row, valid), MISS)


_groups: WeakKeyDictionary[Triangles, OrderedDict[tuple[object, ...], MitsubaObject]] = WeakKeyDictionary()
_scenes: WeakKeyDictionary[Triangles, OrderedDict[tuple[object, ...], tuple[ref[State], Nearby]]] = WeakKeyDictionary()
"""Both by the triangles of a world, which its copies in other weather and with other motion share."""


def scene_near(state: State, place: npt.ArrayLike | None, kind: str) -> EngineScene:
    """Return the scene for rays that begin around a place.

    Parameters
    ----------
    state : State
    place : array_like of float, shape (3,), or None
        [m, world]; None: the origin.
    kind : {"optical", "radio"}
    """
    cell = np.round(np.zeros(3) if place is None else np.asarray(place, dtype=np.float64) / CELL)
    if place is None or not np.isfinite(cell).all() or np.abs(place).max() <= AROUND_ORIGIN:
        return state._applied(kind)
    frame, known = (kind, *cell.tolist()), _scenes.setdefault(state.world._triangles, OrderedDict())
    key = (*frame, id(state))
    if key not in known or known[key][0]() is not state:
        for old in [each for each, (owner, _) in known.items() if owner() is None]:
            del known[old]
        with variant.use(kind) as mi:
            origin = CELL * cell
            known[key] = ref(state), Nearby(mi, kind, state, origin, _still_group(mi, state, frame, origin))
    return _latest(known, key)[1]


def release_near(triangles: Triangles, kind: str) -> None:
    """Let go of the scenes of a world, given by its triangles; they are made again when they are asked for."""
    for name in [name for name in _groups.get(triangles, ()) if name[0] == kind]:
        del _groups[triangles][name]
    for name in [name for name in _scenes.get(triangles, ()) if name[0] == kind]:
        del _scenes[triangles][name]


def middle_of(origins: Array) -> Array | None:
    """Return the place around which rays begin, of origins (3,) or (num_rays, 3) [m], None where they have none."""
    if origins.ndim == 1 or not len(origins):
        return origins if origins.ndim == 1 else None
    lower, upper = origins.min(axis=0), origins.max(axis=0)
    return None if (upper - lower).max() > WIDEST else np.asarray((lower + upper) / 2.0)


def mesh_of(mi: ModuleType, points: Array) -> MitsubaObject:
    """Return a mesh of triangles with corners of their own, points (3 num_faces, 3)."""
    mesh = mi.Mesh("triangles", vertex_count=len(points), face_count=len(points) // 3)
    parameters, on = mi.traverse(mesh), Device(mi)
    parameters["vertex_positions"] = on.single(points)
    parameters["faces"] = on.index(np.arange(len(points)))
    parameters.update()
    return mesh


def _moves(state: State) -> npt.NDArray[np.bool_]:
    """Return which triangles belong to an actor."""
    return np.asarray((state.world.parts.actor >= 0)[state.world._triangles.part])


def _group(mi: ModuleType, corners: Array) -> MitsubaObject:
    """Return triangles (n, 3, 3) as a group: its tree takes a third of the time of one in the scene itself."""
    mesh = mesh_of(mi, corners.reshape(-1, 3))
    with many_threads():
        return mi.load_dict({"type": "shapegroup", "mesh": mesh})


def _still_group(mi: ModuleType, state: State, frame: tuple[object, ...], origin: Array) -> MitsubaObject | None:
    """Return what stands still as a group in a frame, None if nothing does."""
    triangles, rows = state.world._triangles, np.flatnonzero(~_moves(state))
    if not len(rows):
        return None
    known = _groups.setdefault(triangles, OrderedDict())
    if frame not in known:
        known[frame] = _group(mi, triangles.corners[rows] - origin)
    return _latest(known, frame)


def _latest(known: OrderedDict[tuple[object, ...], Kept], key: tuple[object, ...]) -> Kept:
    """Return an entry as the latest that was used, and forget the oldest ones."""
    known.move_to_end(key)
    while len(known) > KEPT:
        known.popitem(last=False)
    return known[key]
