"""What stations see of tubes: straight, or over mirrors, through panes or not.

One kernel serves the tubes of many stations, each row with its own.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from scarl_sionna.engine.rays.face_rays import MISS, FaceRays
from scarl_sionna.engine.types import DeviceArray

from ..faces.panes import STEP_ON, Panes
from .probes import SAME_DISTANCE, Probe

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]

BESIDE = -1
"""Label of points that are seen beside a mirror's end, through no pane."""


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
    owner : ndarray of int64, shape (num_faces,), optional
        Number of the mirror that each face is part of, or lies on. Those of `mirror` are what a ray must meet behind
        the window to come from it, and hide nothing; the plane has no end if left out.
    mirror : int
        Its own number there.
    lift : float
        What is so near to the plane may lie on it: rays begin this far from it [m].
    source : ndarray of float64, shape (3,), optional
        What the mirror shows: the station itself, or its image by the mirrors before [m, world]. What stands between
        it and the mirror hides, too; left out, nothing does.
    earlier : Window, optional
        Through which the source looks, where it is an image.
    strips : Strips, optional
        Where the mirror goes on beside its faces, with nothing there that a ray could meet.
    across_ends : callable, optional
        Returns how far the sides of triangles reach across ends of the mirror, (n, 3, 3) to (n, 3) [Fresnel units].
    """

    normal: Array
    offset: float
    owner: Index | None = None
    mirror: int = 0
    lift: float = 0.0
    source: Array | None = None
    earlier: Window | None = None
    strips: Strips | None = None
    across_ends: Callable[[Array], Array] | None = None

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


class Screen(NamedTuple):
    """A station, and what it looks through."""

    station: Array
    """(3,) [m]."""
    window: Window | None
    """Of an image."""
    view: FieldOfView

    @property
    def looks(self) -> list[tuple[Array, Window | None]]:
        """The station and its window, then what the mirror shows and its own, and so on."""
        found, window = [(self.station, self.window)], self.window
        while window is not None and window.source is not None:
            found.append((window.source, window.earlier))
            window = window.earlier
        return found

    @property
    def shape(self) -> tuple[tuple[bool, ...], ...]:
        """What its looks have: screens of the same shape can share a probe."""
        return tuple(
            (window is not None, window is not None and window.owner is not None, _has_strips(window))
            for _, window in self.looks
        )


def _has_strips(window: Window | None) -> bool:
    return window is not None and window.strips is not None and len(window.strips.length) > 0


class ScreenedProbe(Probe):
    """Whether a point is hidden (1) from a station, or not (0): rays run from the station to the point.

    Those of an image begin at its window, since what is before it is not there; points before it are hidden, and so are
    those that are out of its field of view. With panes more than 1 stands for a point that is seen through some.
    `BESIDE` stands for one that is seen beside a mirror's end.

    Parameters
    ----------
    rays : FaceRays
    screens : sequence of Screen
        Of one shape, their windows over the mirrors of one scene.
    screen, face : ndarray of int64, shape (num_rows,)
        Which of them looks at each tube, and on which face that is.
    panes : Panes, optional

    Notes
    -----
    The foot of an object that stands on a mirror is where the way over the mirror and the straight one have their
    common specular point, so it must not be cut off: a point nearer to the plane than `lift` is seen if a ray from it
    back to the image meets the mirror, or what lies on it, first, unless it is on what lies there itself.
    """

    def __init__(
        self, rays: FaceRays, screens: Sequence[Screen], screen: Index, face: Index, panes: Panes | None = None
    ) -> None:
        super().__init__(rays)
        self._panes, self._face, self._screen = panes, rays.index(face), rays.index(screen)
        views = [one.view for one in screens]
        self._axes = [rays.reals([view.axes[:, k] for view in views]) for k in range(3)]
        self._cosine = rays.reals([np.cos(view.azimuth / 2.0) for view in views])
        self._sine = rays.reals([np.sin(view.elevation / 2.0) for view in views])
        owner = next((window.owner for one in screens for _, window in one.looks if window is not None), None)
        self._owner = None if owner is None else rays.label(owner)
        self._looks = [_Looks(rays, looks) for looks in zip(*(one.looks for one in screens), strict=True)]

    def _label(self, point: DeviceArray, row: DeviceArray) -> DeviceArray:
        dr, mi = self.rays.dr, self.rays.mi
        screen, face = dr.gather(mi.UInt32, self._screen, row), dr.gather(mi.UInt32, self._face, row)
        looks = [one.of(screen) for one in self._looks]
        apart, mirror = self._out_of_view(point - looks[0].station, screen), None
        beside, some_beside, strips = mi.Bool(False), mi.Bool(False), None
        last: tuple[DeviceArray, ...] = ()  # the way to the point itself, and where that is too low for it
        for look in looks:
            ray = point - look.station
            distance = dr.norm(ray)
            near = SAME_DISTANCE * (1.0 + distance)
            ray = ray / dr.maximum(distance, 1e-12)
            low, first, met = mi.Bool(False), 0.0, 0.0
            if look.normal is not None:
                own = dr.dot(look.normal, look.station) - look.offset
                there = dr.dot(look.normal, point) - look.offset
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
            if look.mirror is not None:
                begin = dr.select(low, point - STEP_ON * (1.0 + distance) * ray, start)
                missed = self._misses(begin, -ray, look.mirror, ~apart)
                beside, strips = mi.Bool(False), look.strips
                if strips is not None:
                    beside = strips.hold(look.station + met * ray, screen, missed & ~low & ~apart)
                    some_beside |= beside
                apart |= missed & ~beside
                if mirror is None:
                    apart |= low & (dr.gather(mi.Int32, self._owner, face) == look.mirror)
            point, mirror = look.station + met * ray, look.mirror
        start, ray, before, low = last
        hidden = self._hidden((start, ray, before), face, ~apart & ~low)
        hidden = dr.select(some_beside & (hidden == 0), mi.Int32(BESIDE), hidden)
        return dr.select(apart, mi.Int32(1), hidden)

    def _hidden(
        self, way: tuple[DeviceArray, DeviceArray, DeviceArray], face: DeviceArray, active: DeviceArray
    ) -> DeviceArray:
        """Return whether something is in the way of active rays before a distance, or the label of panes that are."""
        dr, mi = self.rays.dr, self.rays.mi
        if self._panes is None:
            return dr.select(self.rays.blocked(*way, active), mi.Int32(1), mi.Int32(0))
        return self._panes.label(*way, face, active)

    def _misses(self, start: DeviceArray, ray: DeviceArray, mirror: DeviceArray, active: DeviceArray) -> DeviceArray:
        """Return which rays first meet something else than some mirrors, one for each ray."""
        dr, mi = self.rays.dr, self.rays.mi
        face = self.rays.first(start, ray, coherent=True)
        met = active & (face != MISS)
        return ~met | (dr.gather(mi.Int32, self._owner, mi.UInt32(face), met) != mirror)

    def _out_of_view(self, ray: DeviceArray, screen: DeviceArray) -> DeviceArray:
        dr, rays = self.rays.dr, self.rays
        x, y, z = (dr.dot(dr.gather(rays.Vector, axis, screen), ray) for axis in self._axes)
        cosine, sine = (dr.gather(rays.Real, limit, screen) for limit in (self._cosine, self._sine))
        flat = dr.sqrt(x * x + y * y)
        return (x < cosine * flat) | (dr.abs(z) > sine * dr.sqrt(flat * flat + z * z))


class _Look(NamedTuple):
    """A station for each ray, and the mirror over which it looks."""

    station: DeviceArray
    normal: DeviceArray | None
    offset: DeviceArray | None
    lift: DeviceArray | None
    mirror: DeviceArray | None
    strips: _Strips | None


class _Looks:
    """The stations of several screens at one step, with their windows, all of one shape."""

    def __init__(self, rays: FaceRays, looks: Sequence[tuple[Array, Window | None]]) -> None:
        self._rays = rays
        self._station = rays.reals(rays.placed(np.array([station for station, _ in looks])))
        windows = [window for _, window in looks if window is not None]
        self._plane = self._mirror = self._strips = None
        if not windows:
            return
        self._plane = tuple(
            rays.reals([getattr(window, name) for window in windows]) for name in ("normal", "offset", "lift")
        )
        if windows[0].owner is not None:
            self._mirror = rays.label(np.array([window.mirror for window in windows]))
        if _has_strips(windows[0]):
            self._strips = _Strips(rays, [window.strips for window in windows if window.strips is not None])

    def of(self, screen: DeviceArray) -> _Look:
        """Return those of rays, by the numbers of their screens."""
        dr, mi, rays = self._rays.dr, self._rays.mi, self._rays
        station = dr.gather(rays.Vector, self._station, screen)
        if self._plane is None:
            return _Look(station, None, None, None, None, None)
        normal, offset, lift = self._plane
        return _Look(
            station,
            dr.gather(rays.Vector, normal, screen),
            dr.gather(rays.Real, offset, screen),
            dr.gather(rays.Real, lift, screen),
            None if self._mirror is None else dr.gather(mi.Int32, self._mirror, screen),
            self._strips,
        )


class _Strips:
    """Strips beside the mirrors of several screens on the device."""

    def __init__(self, rays: FaceRays, strips: Sequence[Strips]) -> None:
        self._rays = rays
        self._end = rays.index(np.cumsum([len(one.length) for one in strips]))
        self._begin = rays.index(np.cumsum([0, *(len(one.length) for one in strips)])[:-1])
        columns = [np.concatenate(column) for column in zip(*(vars(one).values() for one in strips), strict=True)]
        self._vectors = [rays.reals(column) for column in columns[:3]]
        self._lengths = [rays.reals(column) for column in columns[3:]]

    def hold(self, point: DeviceArray, screen: DeviceArray, active: DeviceArray) -> DeviceArray:
        """Return which of the active points, in the plane of the mirror of a screen, are in one of its strips."""
        dr, mi, rays = self._rays.dr, self._rays.mi, self._rays
        end = dr.gather(mi.UInt32, self._end, screen)

        def step(number: DeviceArray, found: DeviceArray) -> tuple[DeviceArray, DeviceArray]:
            corner, along, out = (dr.gather(rays.Vector, one, number) for one in self._vectors)
            length, beyond, width = (dr.gather(rays.Real, one, number) for one in self._lengths)
            place, away = dr.dot(point - corner, along), dr.dot(point - corner, out)
            inside = (place > -beyond) & (place < length + beyond) & (away > 0.0) & (away < width)
            return number + 1, found | inside

        state = dr.gather(mi.UInt32, self._begin, screen), dr.zeros(mi.Bool, dr.width(point))

        def on(number: DeviceArray, found: DeviceArray) -> DeviceArray:
            return active & ~found & (number < end)

        return dr.while_loop(state, on, step, label="strips beside mirrors")[1]
