"""What the rays of tubes meet, in one kernel for all points of all tubes, and where along a side that changes.

A probe labels points of footprints; equal labels are the same thing. Plane waves (the far field) and spherical ones (a
scene) differ in the direction of the rays only: :class:`ParallelRays` and :class:`CentralRays`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np
import numpy.typing as npt

from scarl_sionna.engine.rays.face_rays import MISS, FaceRays
from scarl_sionna.engine.threads import many_threads
from scarl_sionna.engine.types import DeviceArray

from .tube_shape import WEIGHTS, inset

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]

SAME_DISTANCE = 1e-6
"""What is met this near to a point (relative to 1 m + distance) is the point itself: float32 directions are 6e-8 off,
which a face at grazing incidence makes larger."""


class Directions(Protocol):
    """Directions of the rays of tubes."""

    def at(self, point: DeviceArray, row: DeviceArray) -> DeviceArray:
        """Return the unit directions of rays that leave points of the tubes with some row numbers."""


class ParallelRays:
    """All rays of a tube run in one direction, `direction` (num_rows, 3)."""

    def __init__(self, rays: FaceRays, direction: Array) -> None:
        self._rays, self._direction = rays, rays.reals(direction)

    def at(self, point: DeviceArray, row: DeviceArray) -> DeviceArray:
        """Return the unit directions; see :class:`Directions`."""
        return self._rays.dr.gather(self._rays.Vector, self._direction, row)


class CentralRays:
    """All rays of a tube come from one point, `source` (num_rows, 3) [m]."""

    def __init__(self, rays: FaceRays, source: Array) -> None:
        self._rays, self._source = rays, rays.reals(rays.placed(source))

    def at(self, point: DeviceArray, row: DeviceArray) -> DeviceArray:
        """Return the unit directions; see :class:`Directions`."""
        dr = self._rays.dr
        return dr.normalize(point - dr.gather(self._rays.Vector, self._source, row))


class Receivers:
    """Receivers of tubes on the device, where each tube has some that follow each other.

    Parameters
    ----------
    rays : FaceRays
    stations : sequence of ndarray of float64, shape (num_receivers, 3)
        Groups of them [m].
    group : ndarray of int64, shape (num_rows,)
        That of each tube.
    """

    def __init__(self, rays: FaceRays, stations: Sequence[Array], group: Index) -> None:
        self._rays = rays
        ends = np.cumsum([len(some) for some in stations])
        self._end, self._count = (
            rays.index(column[group]) for column in (ends, np.array([len(some) for some in stations]))
        )
        self._place = rays.reals(rays.placed(np.concatenate(stations)))

    def is_any(self, row: DeviceArray, active: DeviceArray, test: Callable[[DeviceArray], DeviceArray]) -> DeviceArray:
        """Return for which active rays of the tubes `row` the test, given the place of a receiver, holds for one."""
        dr, mi, rays = self._rays.dr, self._rays.mi, self._rays
        end, count = dr.gather(mi.UInt32, self._end, row), dr.gather(mi.UInt32, self._count, row)

        def step(left: DeviceArray, found: DeviceArray) -> tuple[DeviceArray, DeviceArray]:
            return left - 1, found | test(dr.gather(rays.Vector, self._place, end - left))

        state = count, dr.zeros(mi.Bool, dr.width(row))
        return dr.while_loop(
            state, lambda left, found: active & ~found & (left > 0), step, label="receivers of a tube"
        )[1]


class Probe:
    """Labels at points of tubes; subclasses say what the label of a point is."""

    def __init__(self, rays: FaceRays) -> None:
        self.rays = rays

    def _label(self, point: DeviceArray, row: DeviceArray) -> DeviceArray:
        raise NotImplementedError

    def within(self, corners: Array, rows: Index, count: Index, first: Index) -> Index:
        """Return labels at many points of each footprint, footprint after footprint.

        Parameters
        ----------
        corners : ndarray of float64, shape (n, 3, 3)
            Footprints [m].
        rows : ndarray of int64, shape (n,)
            Row of each tube in the tables of the probe.
        count, first : ndarray of int64, shape (n,)
            Each has `count` points, whose barycentric coordinates are the rows of ``tube_shape.WEIGHTS`` from `first`
            on.
        """
        if not len(corners):
            return np.zeros(0, dtype=np.int64)
        dr, mi, rays = self.rays.dr, self.rays.mi, self.rays
        begin = np.cumsum(count) - count
        with rays.active():
            tube = rays.index(np.repeat(np.arange(len(corners), dtype=np.uint32), count))
            shift = dr.gather(mi.Int32, rays.label(first - begin), tube)
            node = mi.UInt32(mi.Int32(dr.arange(mi.UInt32, dr.width(tube))) + shift)
            weights, flat = rays.fine(WEIGHTS), rays.fine(rays.placed(inset(corners)))
            point = rays.FinePoint(0.0)
            for corner in range(3):
                part = dr.gather(rays.Fine, weights, 3 * node + corner)
                point += part * dr.gather(rays.FinePoint, flat, 3 * tube + corner)
            row = dr.gather(mi.UInt32, rays.index(rows), tube)
            with many_threads(dr.width(tube)):
                return np.asarray(self._label(point, row).numpy(), dtype=np.int64)

    def border(self, corners: Array, rows: Index, label: Index, bisections: int) -> tuple[Array, Index]:
        """Return where along the two sides from corner 0 its label ends, (n, 2), and the label beyond, (n, 2).

        `label` holds those of the three corners, (n, 3); the place is found to 2^-bisections of the sides.
        """
        if not len(corners):
            return np.zeros((0, 2)), np.zeros((0, 2), dtype=np.int64)
        dr, mi, rays = self.rays.dr, self.rays.mi, self.rays
        with rays.active():
            side = dr.arange(mi.UInt32, 2 * len(rows))
            tube = side // 2
            flat = rays.reals(rays.placed(inset(corners)))
            start = dr.gather(rays.Vector, flat, 3 * tube)
            along = dr.gather(rays.Vector, flat, 3 * tube + 1 + side % 2) - start
            row, known = dr.gather(mi.UInt32, rays.index(rows), tube), rays.label(label)
            own, other = dr.gather(mi.Int32, known, 3 * tube), dr.gather(mi.Int32, known, 3 * tube + 1 + side % 2)
            steps = dr.opaque(mi.UInt32, bisections)

            def step(
                count: DeviceArray, low: DeviceArray, high: DeviceArray, beyond: DeviceArray
            ) -> tuple[DeviceArray, ...]:
                middle = 0.5 * (low + high)
                found = self._label(start + middle * along, row)
                inside = found == own
                return (
                    count + 1,
                    dr.select(inside, middle, low),
                    dr.select(inside, high, middle),
                    dr.select(inside, beyond, found),
                )

            state = (mi.UInt32(0), dr.zeros(rays.Real, 2 * len(rows)), dr.ones(rays.Real, 2 * len(rows)), other)
            _, low, high, beyond = dr.while_loop(
                state, lambda count, low, high, beyond: count < steps, step, label="bisection of edges"
            )
            share = 0.5 * (low + high)
            with many_threads(bisections * len(known)):
                dr.eval(share, beyond)
                share, beyond = share.numpy(), beyond.numpy()
            return share.reshape(-1, 2), beyond.astype(np.int64).reshape(-1, 2)


class ShadowProbe(Probe):
    """Whether anything stands in the way (1) of rays that leave footprints, or nothing (0).

    Parameters
    ----------
    rays : FaceRays
    directions : Directions
    lift : ndarray of float64, shape (num_rows, 3)
        Unit normal on the side on which the rays run.
    """

    def __init__(self, rays: FaceRays, directions: Directions, lift: Array) -> None:
        super().__init__(rays)
        self._directions, self._lift = directions, rays.reals(lift)

    def _label(self, point: DeviceArray, row: DeviceArray) -> DeviceArray:
        dr, mi, rays = self.rays.dr, self.rays.mi, self.rays
        start = rays.lifted(point, dr.gather(rays.Vector, self._lift, row))
        return dr.select(rays.blocked(start, self._directions.at(point, row)), mi.Int32(1), mi.Int32(0))


class PlaneProbe(Probe):
    """The plane that a tube's ray meets behind a point, `MISS` where it meets none that counts.

    Parameters
    ----------
    rays : FaceRays
    directions : Directions
    lift : ndarray of float64, shape (num_rows, 3)
        Unit normal on the side on which the rays run.
    plane_of_face : ndarray of int64, shape (num_faces,)
        `MISS` for faces at which tubes end.
    own : ndarray of int64, shape (num_rows,), optional
        Plane that the tubes leave, which counts as missed; left out where the lift alone is sure to leave it.
    """

    def __init__(
        self, rays: FaceRays, directions: Directions, lift: Array, plane_of_face: Index, own: Index | None = None
    ) -> None:
        super().__init__(rays)
        self._directions, self._lift = directions, rays.reals(lift)
        self._plane, self._own = rays.label(plane_of_face), None if own is None else rays.label(own)
        self._towards: tuple[Receivers, DeviceArray, DeviceArray] | None = None
        self._cosine: DeviceArray | None = None

    def only_towards(self, receivers: Receivers, normal: Array, offset: Array, angle: float | None = None) -> None:
        """Let planes count as missed of which the lit side is turned away from all receivers, as on the last bounce.

        With an `angle` [rad] also those whose mirror direction is farther from that of each receiver.

        Parameters
        ----------
        receivers : Receivers
        normal, offset : ndarray of float64, shape (num_faces, 3) and (num_faces,)
            Planes of the faces.
        """
        rays = self.rays
        self._towards = receivers, rays.reals(normal), rays.reals(offset)
        self._cosine = None if angle is None else rays.real(float(np.cos(angle)))

    def _label(self, point: DeviceArray, row: DeviceArray) -> DeviceArray:
        dr, mi, rays = self.rays.dr, self.rays.mi, self.rays
        ray = self._directions.at(point, row)
        face = rays.first(rays.lifted(point, dr.gather(rays.Vector, self._lift, row)), ray)
        plane = dr.gather(mi.Int32, self._plane, mi.UInt32(face), face != MISS)
        met = face != MISS
        if self._own is not None:
            met &= plane != dr.gather(mi.Int32, self._own, row)
        if self._towards is not None:
            receivers, normals, offsets = self._towards
            normal = dr.gather(rays.Vector, normals, mi.UInt32(face), met)
            offset = dr.gather(rays.Real, offsets, mi.UInt32(face), met)
            slope = dr.dot(normal, ray)
            height = offset - dr.dot(normal, point)
            end = point + height / dr.select(met, slope, 1.0) * ray
            onward, cosine = ray - 2.0 * slope * normal, self._cosine

            def is_towards(station: DeviceArray) -> DeviceArray:
                lit = slope * (dr.dot(normal, station) - offset) < 0.0
                return lit if cosine is None else lit & (dr.dot(onward, dr.normalize(station - end)) >= cosine)

            met = receivers.is_any(row, met, is_towards)
        return dr.select(met, plane, MISS)
