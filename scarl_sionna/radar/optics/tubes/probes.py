"""What the rays of tubes meet, in one kernel for all points of all tubes, and where along a side that changes.

A probe labels points of footprints; equal labels are the same thing. Plane waves (the far field) and spherical ones (a
scene) differ in the direction of the rays only: :class:`ParallelRays` and :class:`CentralRays`.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import ModuleType
from typing import Protocol

import numpy as np
import numpy.typing as npt

from scarl_sionna.engine.rays.face_rays import MISS, FaceRays
from scarl_sionna.engine.threads import many_threads
from scarl_sionna.engine.types import DeviceArray

from ..faces.panes import STEP_ON, Panes
from .tube_shape import WEIGHTS, inset

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]

SAME_DISTANCE = 1e-6
"""What is met this near to a point (relative to 1 m + distance) is the point itself: float32 directions are 6e-8 off,
which a face at grazing incidence makes larger."""


BESIDE = -1
"""Label of points that are seen beside a mirror's end, through no pane."""


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


@dataclass(frozen=True, eq=False)
class Strips:
    """Strips beside free edges of a mirror, in which its reflections go on.

    Attributes
    ----------
    corner : ndarray of float64, shape (num_strips, 3)
        Start of each edge [m].
    along, out : ndarray of float64, shape (num_strips, 3)
        Unit vectors.
    length, beyond, width : ndarray of float64, shape (num_strips,)
        Of the edge, how far the strip goes on at either end of it, and how wide it is [m].
    """

    corner: Array
    along: Array
    out: Array
    length: Array
    beyond: Array
    width: Array


@dataclass(frozen=True, eq=False)
class Window:
    """The plane through which the image of a station looks: that of the mirror which made it.

    Attributes
    ----------
    normal : ndarray of float64, shape (3,)
        Unit normal, from the image to what it sees.
    offset : float
        normal . point of the mirror's plane [m].
    faces : ndarray of bool, shape (num_faces,), optional
        The mirror's faces and what lies on it: what a ray must meet behind the window to come from the mirror, and what
        hides nothing; the plane has no end if left out.
    lift : float
        What is so near to the plane may lie on it: rays begin this far from it [m].
    source : ndarray of float64, shape (3,), optional
        What the mirror shows: the station itself, or its image by the mirrors before [m, world]. What stands between
        it and the mirror hides, too; left out, nothing does.
    earlier : Window, optional
        Through which the source looks, where it is an image.
    strips : Strips, optional
        Where the mirror goes on beside its faces, with nothing there that a ray could meet.
    """

    normal: Array
    offset: float
    faces: npt.NDArray[np.bool_] | None = None
    lift: float = 0.0
    source: Array | None = None
    earlier: Window | None = None
    strips: Strips | None = None

    def entry(self, station: Array, points: Array) -> Array:
        """Return where rays from a station (3,) to points (n, 3) begin, shape (n, 3) [m].

        Points must be farther than `lift` from the plane.
        """
        own, there = station @ self.normal - self.offset, points @ self.normal - self.offset
        return np.asarray(station + ((self.lift - own) / (there - own))[:, None] * (points - station))


@dataclass(frozen=True, eq=False)
class FieldOfView:
    """The directions that a station looks at.

    Attributes
    ----------
    axes : ndarray of float64, shape (3, 3)
        Of the radar as columns: x boresight, z up; mirrored ones of an image.
    azimuth, elevation : float
        Full width and height [rad].
    """

    axes: Array
    azimuth: float
    elevation: float


class ScreenedProbe(Probe):
    """Whether a point is hidden (1) from a station, (3,) [m], or not (0): rays run from the station to the point.

    Those of an image begin at its window, since what is before it is not there; points before it are hidden, and so are
    those that are out of its field of view, if it has one. With panes more than 1 stands for a point that is seen
    through some; `face`, (num_rows,), is that of each tube. `BESIDE` stands for one that is seen beside a mirror's end.

    Notes
    -----
    The foot of an object that stands on a mirror is where the way over the mirror and the straight one have their
    common specular point, so it must not be cut off: a point nearer to the plane than `lift` is seen if a ray from it
    back to the image meets the mirror, or what lies on it, first, unless it is on what lies there itself.
    """

    def __init__(
        self,
        rays: FaceRays,
        station: Array,
        window: Window | None = None,
        panes: Panes | None = None,
        face: Index | None = None,
        view: FieldOfView | None = None,
    ) -> None:
        super().__init__(rays)
        self._panes = panes
        self._view = None
        if view is not None:
            limits = rays.real(float(np.cos(view.azimuth / 2.0))), rays.real(float(np.sin(view.elevation / 2.0)))
            self._view = [rays.vector(axis) for axis in view.axes.T], *limits
        self._face = None if face is None else rays.index(face)
        self._looks = [_Look.of(rays, station, window)]
        while window is not None and window.source is not None:
            self._looks.append(_Look.of(rays, window.source, window.earlier))
            window = window.earlier

    def _label(self, point: DeviceArray, row: DeviceArray) -> DeviceArray:
        dr, mi = self.rays.dr, self.rays.mi
        apart, mirror = self._out_of_view(point), None
        beside, some_beside, strips = mi.Bool(False), mi.Bool(False), None
        last: tuple[DeviceArray, ...] = ()  # the way to the point itself, and where that is too low for it
        for look in self._looks:
            ray = point - look.station
            distance = dr.norm(ray)
            near = SAME_DISTANCE * (1.0 + distance)
            ray = ray / dr.maximum(distance, 1e-12)
            low, first, met = mi.Bool(False), 0.0, 0.0
            if look.normal is not None:
                own, there = look.heights(dr, point)
                low = there <= look.lift
                apart |= there <= near
                slope = dr.select(apart, 1.0, there - own)
                first, met = distance * (look.lift - own) / slope, -distance * own / slope
            start = look.station + first * ray
            if not last:
                last = start, ray, distance - first - near, low
            else:
                if strips is not None:
                    free = dr.select(beside & ~apart, distance - first - near, 0.0)
                    apart |= beside & self.rays.blocked(start, ray, free)
                apart |= ~low & ~beside & self._misses(start, ray, mirror, ~apart & ~low & ~beside)
            if look.behind is not None:
                begin = dr.select(low, point - STEP_ON * (1.0 + distance) * ray, start)
                missed = self._misses(begin, -ray, look.behind, ~apart)
                beside, strips = mi.Bool(False), look.strips
                if strips is not None:
                    beside = strips.hold(look.station + met * ray, missed & ~low & ~apart)
                    some_beside |= beside
                apart |= missed & ~beside
                if mirror is None and self._face is not None:
                    apart |= low & (dr.gather(mi.UInt32, look.behind, dr.gather(mi.UInt32, self._face, row)) != 0)
            point, mirror = look.station + met * ray, look.behind
        start, ray, before, low = last
        hidden = self._hidden(start, ray, before, row, ~apart & ~low)
        hidden = dr.select(some_beside & (hidden == 0), mi.Int32(BESIDE), hidden)
        return dr.select(apart, mi.Int32(1), hidden)

    def _hidden(
        self, start: DeviceArray, ray: DeviceArray, before: DeviceArray, row: DeviceArray, active: DeviceArray
    ) -> DeviceArray:
        """Return whether something is in the way of active rays before a distance, or the label of panes that are."""
        dr, mi = self.rays.dr, self.rays.mi
        if self._panes is None or self._face is None:
            return dr.select(self.rays.blocked(start, ray, before, active), mi.Int32(1), mi.Int32(0))
        return self._panes.label(start, ray, before, dr.gather(mi.UInt32, self._face, row), active)

    def _misses(self, start: DeviceArray, ray: DeviceArray, faces: DeviceArray, active: DeviceArray) -> DeviceArray:
        """Return which rays first meet something else than some faces."""
        dr, mi = self.rays.dr, self.rays.mi
        face = self.rays.first(start, ray)
        met = active & (face != MISS)
        return ~met | (dr.gather(mi.UInt32, faces, mi.UInt32(face), met) == 0)

    def _out_of_view(self, point: DeviceArray) -> DeviceArray:
        dr = self.rays.dr
        if self._view is None:
            return self.rays.mi.Bool(False)
        axes, cosine, sine = self._view
        ray = point - self._looks[0].station
        x, y, z = (dr.dot(axis, ray) for axis in axes)
        flat = dr.sqrt(x * x + y * y)
        return (x < cosine * flat) | (dr.abs(z) > sine * dr.sqrt(flat * flat + z * z))


@dataclass(frozen=True, eq=False)
class _Look:
    """A station on the device, and the mirror over which it looks; its faces and `lift` as of :class:`Window`."""

    station: DeviceArray
    normal: DeviceArray | None = None
    offset: DeviceArray | None = None
    lift: DeviceArray | None = None
    behind: DeviceArray | None = None
    strips: _Strips | None = None

    @classmethod
    def of(cls, rays: FaceRays, station: Array, window: Window | None) -> _Look:
        placed = rays.vector(rays.placed(station))
        if window is None:
            return cls(placed)
        behind = None if window.faces is None else rays.index(window.faces.astype(np.uint32))
        strips = None if window.strips is None or not len(window.strips.length) else _Strips(rays, window.strips)
        return cls(placed, rays.vector(window.normal), rays.real(window.offset), rays.real(window.lift), behind, strips)

    def heights(self, dr: ModuleType, point: DeviceArray) -> tuple[DeviceArray, DeviceArray]:
        """Return the heights of the station and of points over the mirror [m]."""
        return dr.dot(self.normal, self.station) - self.offset, dr.dot(self.normal, point) - self.offset


class _Strips:
    """Strips beside a mirror on the device."""

    def __init__(self, rays: FaceRays, strips: Strips) -> None:
        self._rays = rays
        self._count = rays.dr.opaque(rays.mi.UInt32, len(strips.length))
        self._vectors = [rays.reals(one) for one in (strips.corner, strips.along, strips.out)]
        self._lengths = [rays.reals(one) for one in (strips.length, strips.beyond, strips.width)]

    def hold(self, point: DeviceArray, active: DeviceArray) -> DeviceArray:
        """Return which of the active points, in the plane of the mirror, are in one of the strips."""
        dr, mi, rays = self._rays.dr, self._rays.mi, self._rays

        def step(number: DeviceArray, found: DeviceArray) -> tuple[DeviceArray, DeviceArray]:
            corner, along, out = (dr.gather(rays.Vector, one, number) for one in self._vectors)
            length, beyond, width = (dr.gather(rays.Real, one, number) for one in self._lengths)
            place, away = dr.dot(point - corner, along), dr.dot(point - corner, out)
            inside = (place > -beyond) & (place < length + beyond) & (away > 0.0) & (away < width)
            return number + 1, found | inside

        state = mi.UInt32(0), dr.zeros(mi.Bool, dr.width(point))
        count = self._count

        def on(number: DeviceArray, found: DeviceArray) -> DeviceArray:
            return active & ~found & (number < count)

        return dr.while_loop(state, on, step, label="strips beside mirrors")[1]


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
        self._faces: tuple[DeviceArray, DeviceArray, DeviceArray] | None = None
        self._cosine: DeviceArray | None = None

    def only_towards(self, station: Array, normal: Array, offset: Array, angle: float | None = None) -> None:
        """Let planes of which the lit side is turned away from a station count as missed, as on the last bounce.

        With an `angle` [rad] also those whose mirror direction is farther from that of the station.

        Parameters
        ----------
        station : ndarray of float64, shape (3,)
        normal, offset : ndarray of float64, shape (num_faces, 3) and (num_faces,)
            Planes of the faces.
        """
        rays = self.rays
        self._faces = rays.vector(station), rays.reals(normal), rays.reals(offset)
        self._cosine = None if angle is None else rays.real(float(np.cos(angle)))

    def _label(self, point: DeviceArray, row: DeviceArray) -> DeviceArray:
        dr, mi, rays = self.rays.dr, self.rays.mi, self.rays
        ray = self._directions.at(point, row)
        face = rays.first(rays.lifted(point, dr.gather(rays.Vector, self._lift, row)), ray)
        plane = dr.gather(mi.Int32, self._plane, mi.UInt32(face), face != MISS)
        met = face != MISS
        if self._own is not None:
            met &= plane != dr.gather(mi.Int32, self._own, row)
        if self._faces is not None:
            station, normals, offsets = self._faces
            normal = dr.gather(rays.Vector, normals, mi.UInt32(face), met)
            towards = dr.dot(normal, station) - dr.gather(rays.Real, offsets, mi.UInt32(face), met)
            slope = dr.dot(normal, ray)
            met &= slope * towards < 0.0
            if self._cosine is not None:
                height = dr.gather(rays.Real, offsets, mi.UInt32(face), met) - dr.dot(normal, point)
                back = station - point - height / dr.select(met, slope, 1.0) * ray
                met &= dr.dot(ray - 2.0 * slope * normal, dr.normalize(back)) >= self._cosine
        return dr.select(met, plane, MISS)
