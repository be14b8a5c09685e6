"""Rays along ways over mirrors, each leg of all in one Dr.Jit kernel: float64 but for the engine's intersection."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.arrays.blocks import in_blocks
from scarl_sionna.engine import variant
from scarl_sionna.engine.device import Device
from scarl_sionna.engine.rays.cast import RAYS_PER_BATCH
from scarl_sionna.engine.rays.face_rays import StateRays
from scarl_sionna.engine.rays.moving_faces import MovingFaces
from scarl_sionna.engine.rays.nearby import middle_of
from scarl_sionna.engine.threads import many_threads
from scarl_sionna.engine.types import DeviceArray
from scarl_sionna.radar.optics.faces.panes import MOST_PANES

from .mirror_faces import COINCIDENT, MirrorFaces

if TYPE_CHECKING:
    from scarl_sionna.engine.world import WorldState

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]
Index = npt.NDArray[np.int64]

LIFT = 1e-4
"""Rays start this far above a mirror [m], so that they do not meet it again: a guard against the rounding of float32
hits."""
_ON, _DOUBTED, _FREE, _ABOVE = 1, 2, 4, 8
"""Bits of what a ray to a mirror meets: what only that mirror may own, what others may own, too; see :class:`Met`."""
_HIDDEN, _PANE = 1, 2
"""What a ray to a point meets before it; nothing is 0."""
_NOBODY = -1
"""Instance of points whose own panes let waves through as others do."""


class Met(NamedTuple):
    """What rays to mirrors meet first, each shape (num_rays,)."""

    on: Flags
    """What belongs to the mirror, see :class:`.mirror_faces.MirrorFaces`."""
    free: Flags
    """Nothing before the point that they are sent to."""
    above: Flags
    """What is not in the mirror's plane."""


class MirrorRays:
    """Rays over mirrors in a state of the world.

    Parameters
    ----------
    state : WorldState
    faces : MirrorFaces
    owned : sequence of int
        Instances that hide nothing.
    is_thin : ndarray of bool, shape (num_parts,)
        Parts that let waves through on the last leg.
    """

    def __init__(self, state: WorldState, faces: MirrorFaces, owned: Sequence[int], is_thin: Flags) -> None:
        self._state, self._faces = state, faces
        self._foreign = ~np.isin(state.world.parts.instance, np.asarray(owned, dtype=np.int64))
        self._is_thin = is_thin

    def meet(self, start: Array, end: Array, mirror: Index) -> Met:
        """Return what rays meet that are sent to points in the planes of mirrors.

        Parameters
        ----------
        start : ndarray of float64, shape (3,) or (num_rays, 3)
            [m, world].
        end : ndarray of float64, shape (num_rays, 3)
            [m, world].
        mirror : ndarray of int64, shape (num_rays,)
            Numbers of the mirrors.
        """
        on, free, above = np.zeros((3, len(end)), dtype=np.bool_)
        for some in in_blocks(len(end), RAYS_PER_BATCH):
            code, face, point = self._met(start if start.ndim == 1 else start[some], end[some], mirror[some])
            on[some], free[some], above[some] = ((code & bit) > 0 for bit in (_ON, _FREE, _ABOVE))
            rows = np.flatnonzero(code & _DOUBTED)
            number = some.start + rows
            on[number] = self._faces.owner(face[rows], point[rows], end[number]) == mirror[number]
        return Met(on, free, above)

    def reach(self, start: Array, end: Array, owner: Index | None = None) -> Flags:
        """Return which rays meet nothing foreign that lets nothing through, and not too many panes, before points.

        Parameters
        ----------
        start : ndarray of float64, shape (3,) or (num_rays, 3)
            [m, world].
        end : ndarray of float64, shape (num_rays, 3)
            The points [m, world]: what is within the mirrors' thickness before them does not hide them.
        owner : ndarray of int64, shape (num_rays,), optional
            Instances of the points: panes of their own hide them.
        """
        found, gone = np.ones(len(end), dtype=np.bool_), np.zeros(len(end))
        owner = np.full(len(end), _NOBODY) if owner is None else owner
        for some in in_blocks(len(end), RAYS_PER_BATCH):
            rows = np.arange(some.start, some.stop)
            for panes_left in range(MOST_PANES, -1, -1):
                own = start if start.ndim == 1 else start[rows]
                code, gone[rows] = self._before(own, end[rows], (gone[rows], owner[rows], panes_left > 0))
                found[rows[code == _HIDDEN]] = False
                rows = rows[code == _PANE]
                if not len(rows):
                    break
        return found

    @cached_property
    def _tables(self) -> _Tables:
        with variant.use("optical") as mi:
            return _Tables(Device(mi), self._state, self._faces, self._foreign, self._is_thin)

    def _met(self, start: Array, end: Array, mirror: Index) -> tuple[Index, Index, Array]:
        """Return the bits of what rays meet, its face, and where [m, world]; both arbitrary where there is nothing."""
        with variant.use("optical") as mi:
            rays, tables = StateRays(mi, self._state, middle_of(start)), self._tables
            dr, aim, number = rays.dr, rays.vectors(end), rays.index(mirror)
            here, ray, distance = _sent(rays, start, aim)
            valid, face, hit = tables.first(rays, here, ray)
            point = here + hit * ray
            own = dr.gather(mi.Int32, tables.of_face, face)
            limit = dr.select(own < 0, rays.real(self._faces.thickness), COINCIDENT)
            limit += dr.select(own < 0, 0.0, tables.height(point, mi.UInt32(dr.maximum(own, 0))))
            height, far = tables.height(point, number), distance > LIFT
            close = far & valid & (height < limit)
            on, doubted = tables.owned((point, aim), (limit, number, own), close)
            code = dr.select(on, mi.UInt32(_ON), dr.select(doubted, mi.UInt32(_DOUBTED), 0))
            code |= dr.select(far & ~(valid & (hit < distance - LIFT)), mi.UInt32(_FREE), 0)
            code |= dr.select(valid & (height > LIFT), mi.UInt32(_ABOVE), 0)
            with many_threads(len(end)):
                dr.eval(code, face, point)
            return code.numpy(), face.numpy(), rays.on_host(point)

    def _before(self, start: Array, end: Array, rest: tuple[Array, Index, bool]) -> tuple[Index, Array]:
        """Return what rays meet before points, and how far those have come that meet a pane [m].

        `rest` has how far they have come before, whose the points are, and whether a pane may be passed.
        """
        with variant.use("optical") as mi:
            rays, tables = StateRays(mi, self._state, middle_of(start)), self._tables
            dr, gone, owner = rays.dr, rays.reals(rest[0]), rays.label(rest[1])
            here, ray, distance = _sent(rays, start, rays.vectors(end))
            origin = here + gone * ray
            valid, face, hit = tables.first(rays, origin, ray)
            part = tables.faces.part(face)
            foreign = valid & (gone + hit < distance - rays.real(self._faces.thickness))
            foreign &= dr.gather(mi.Bool, tables.foreign, part)
            pane = foreign & dr.gather(mi.Bool, tables.is_thin, part) & dr.opaque(mi.Bool, rest[2])
            pane &= dr.gather(mi.Int32, tables.instance, part) != owner
            code = dr.select(pane, mi.UInt32(_PANE), dr.select(foreign | (distance <= LIFT), mi.UInt32(_HIDDEN), 0))
            gone = gone + hit + LIFT
            with many_threads(len(end)):
                dr.eval(code, gone)
            return code.numpy(), gone.numpy()


class _Tables:
    """Tables of mirrors and parts on the device."""

    def __init__(self, on: Device, state: WorldState, faces: MirrorFaces, foreign: Flags, is_thin: Flags) -> None:
        self._on, self.faces = on, MovingFaces.of(on, state)
        self._normal, self._offset = on.reals(faces.normal), on.reals(faces.offset)
        self.of_face = on.label(faces.of_face)
        self._box = on.reals(faces.boxes)
        self._count = on.dr.opaque(on.mi.UInt32, len(faces.offset))
        self.foreign, self.is_thin = on.mask(foreign), on.mask(is_thin)
        self.instance = on.label(state.world.parts.instance)

    def first(
        self, rays: StateRays, origin: DeviceArray, ray: DeviceArray
    ) -> tuple[DeviceArray, DeviceArray, DeviceArray]:
        """Return whether rays meet anything, its face, and how far it is [m]; both arbitrary where there is nothing."""
        dr = rays.dr
        face, rough = rays.first_within(origin, ray, dr.inf, coherent=True)
        valid, face = face >= 0, rays.mi.UInt32(dr.maximum(face, 0))
        return valid, face, self.faces.meet(origin, ray, face, rough)[0]

    def height(self, point: DeviceArray, number: DeviceArray) -> DeviceArray:
        """Return the distances of points from the planes of mirrors, one mirror each [m]."""
        on, dr = self._on, self._on.dr
        normal, offset = dr.gather(on.Vector, self._normal, number), dr.gather(on.Real, self._offset, number)
        return dr.abs(dr.dot(normal, point) - offset)

    def owned(
        self,
        hit: tuple[DeviceArray, DeviceArray],
        may: tuple[DeviceArray, DeviceArray, DeviceArray],
        active: DeviceArray,
    ) -> tuple[DeviceArray, DeviceArray]:
        """Return which hits belong to a mirror for sure, and which may, by :meth:`.mirror_faces.MirrorFaces.owner`.

        It is the only one that may own it, or that of the face that is hit, the first of all, and as near as any. Of
        hits on a mirror's own face only mirrors count whose box holds what the ray was aimed at.

        Parameters
        ----------
        hit : tuple
            Where hits are and what the rays were aimed at [m, world].
        may : tuple
            Distance from planes below which a mirror may own each hit [m], the number of the mirror that is asked for,
            and that of the face, below 0 for none.
        active : Dr.Jit Bool
        """
        (point, aim), (limit, number, own), mi = hit, may, self._on.mi
        is_own = mi.Int32(number) == own

        def first_of_all(count: DeviceArray, first: DeviceArray, least: DeviceArray) -> DeviceArray:
            return (count == 1) | (is_own & (first == number) & (self.height(point, number) < least + COINCIDENT))

        on = active & first_of_all(*self._near(point, limit, active, lambda other: mi.Bool(True)))
        left = active & ~on & (own >= 0)
        count, first, least = self._near(
            point, limit, left, lambda other: (mi.Int32(other) == own) | self._holds(other, aim)
        )
        on |= left & is_own & first_of_all(count, first, least)
        return on, active & ~on & ~(left & (count == 1))

    def _near(
        self, point: DeviceArray, limit: DeviceArray, active: DeviceArray, counts: Callable[[DeviceArray], DeviceArray]
    ) -> tuple[DeviceArray, DeviceArray, DeviceArray]:
        """Return how many of the mirrors that count are nearer to points than a limit, the first, and how near any is.

        The number of mirrors for the first where there is none.
        """
        dr, mi = self._on.dr, self._on.mi

        def compare(
            other: DeviceArray, count: DeviceArray, first: DeviceArray, least: DeviceArray
        ) -> tuple[DeviceArray, ...]:
            height = self.height(point, other)
            near = (height < limit) & counts(other)
            first = dr.select(near & (other < first), other, first)
            return other + 1, count + dr.select(near, 1, 0), first, dr.select(near, dr.minimum(least, height), least)

        state = mi.UInt32(0), mi.UInt32(0), dr.zeros(mi.UInt32, dr.width(point)) + self._count, limit
        _, count, first, least = dr.while_loop(
            state, lambda other, *_: active & (other < self._count), compare, label="planes near to hits"
        )
        return count, first, least

    def _holds(self, number: DeviceArray, point: DeviceArray) -> DeviceArray:
        """Return whether the box about a mirror's triangles holds points."""
        dr, on = self._on.dr, self._on
        lower, upper = (dr.gather(on.Vector, self._box, 2 * number + k) for k in (0, 1))
        return dr.all((point >= lower) & (point <= upper))


def _sent(rays: StateRays, start: Array, aim: DeviceArray) -> tuple[DeviceArray, DeviceArray, DeviceArray]:
    """Return starts, unit directions and lengths of rays to points; any direction where there is no way to go."""
    dr = rays.dr
    here = rays.vector(start) if start.ndim == 1 else rays.vectors(start)
    ahead = aim - here
    distance = dr.sqrt(ahead.x * ahead.x + ahead.y * ahead.y + ahead.z * ahead.z)
    ray = dr.select(distance > LIFT, ahead / dr.maximum(distance, LIFT), rays.Vector(1.0, 0.0, 0.0))
    return here, ray, distance
