"""Legs over mirrors, from a radar to points: what the mirrors do to polarisation and rate, what hides them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.arrays.rows import row_norm
from scarl_sionna.core.mount import Mount
from scarl_sionna.core.settings.mirrors import MirrorSettings
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.radar.channel.multipath.images import Chain, material_coefficients, spherical_basis, transfer
from scarl_sionna.radar.channel.multipath.mirror_ends import MirrorEnds, Reflections
from scarl_sionna.radar.channel.multipath.mirror_faces import MirrorFaces
from scarl_sionna.radar.channel.multipath.mirror_rays import LIFT, Met, MirrorRays
from scarl_sionna.radar.channel.multipath.station import Station
from scarl_sionna.radar.optics.tubes.screens import Strips
from scarl_sionna.radar.tuned import material_frequency

from .mirrors import Mirror

if TYPE_CHECKING:
    from scarl_sionna.engine.world import WorldState

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
Flags = npt.NDArray[np.bool_]
Ways = npt.NDArray[np.int64]
"""Numbers of mirrors in the order from the radar, (num_points, num_mirrors)."""


@dataclass(frozen=True, eq=False)
class Leg:
    """One way from a radar to points of an object.

    Attributes
    ----------
    image : ndarray of float64, shape (num_points, 3)
        The points as the radar sees them [m, world].
    jones : ndarray of complex128, shape (num_points, 2, 2)
        From the radar's spherical basis to that of the image of the radar (axes `rotation`), both along the wave.
    direction : ndarray of float64, shape (num_points, 3)
        From the image of the radar to the points.
    station_velocity : ndarray of float64, shape (num_points, 3)
        Of the image of the radar, by the motion of the radar and of the mirrors [m/s, world].
    image_velocity : ndarray of float64, shape (num_points, 3)
        Of `image` relative to the radar [m/s, world].
    weight : ndarray of complex128, shape (num_points,)
        What the ends of the mirrors leave of the field.
    """

    image: Array
    jones: Complex
    direction: Array
    station_velocity: Array
    image_velocity: Array
    weight: Complex

    def take(self, rows: npt.NDArray[np.int64]) -> Leg:
        """Return the ways to some of the points."""
        return Leg(*(column[rows] for column in vars(self).values()))


@dataclass(frozen=True, eq=False)
class MirrorView:
    """A radar that looks at objects over mirrors.

    Attributes
    ----------
    state : WorldState
    radar : RadarSpec
    mount : Mount
        Pose and velocity of the radar.
    owned : sequence of int
        Instances of the objects. They hide nothing here: the solver that made their points has seen to that.
    mirrors : sequence of Mirror
        All of the solve, as of :func:`.mirrors.find_mirrors`; the number of each is its place here.
    knobs : MirrorSettings
    thin : ndarray of int64
        Rows of the part table that let waves through on the last leg, to a point; see
        :func:`~scarl_sionna.radar.optics.faces.panes.pane_parts`.
    """

    state: WorldState
    radar: RadarSpec
    mount: Mount
    owned: Sequence[int]
    mirrors: Sequence[Mirror]
    knobs: MirrorSettings
    thin: npt.NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, dtype=np.int64))

    @cached_property
    def station(self) -> Station:
        """The radar as the end of a link."""
        return Station(self.mount.pose.position, self.mount.twist.linear, self.mount.pose.rotation)

    @cached_property
    def rays(self) -> MirrorRays:
        """Finds what is on the ways."""
        faces = MirrorFaces(
            len(self.state._triangles.normal),
            [mirror.faces for mirror in self.mirrors],
            np.array([mirror.normal for mirror in self.mirrors]),
            np.array([mirror.offset for mirror in self.mirrors]),
            [mirror.corners.reshape(-1, 3, 3) for mirror in self.mirrors],
            self.knobs.thickness,
        )
        is_thin = np.isin(np.arange(len(self.state.world.parts.name)), self.thin)
        return MirrorRays(self.state, faces, self.owned, is_thin)

    @cached_property
    def _planes(self) -> tuple[Array, Array, npt.NDArray[np.int64]]:
        """Normals, offsets and parts of the mirrors, by their numbers."""
        return (
            np.array([mirror.normal for mirror in self.mirrors]).reshape(-1, 3),
            np.array([mirror.offset for mirror in self.mirrors]),
            np.array([mirror.part for mirror in self.mirrors], dtype=np.int64),
        )

    @cached_property
    def ends(self) -> MirrorEnds | None:
        """The ends of the mirrors, or None if they end sharply; ways over several mirrors always do."""
        if not self.knobs.end_reach or not self.mirrors:
            return None
        position, wavelength = self.station.position, self.radar.wavelength
        return MirrorEnds(self.state, self.mirrors, position, wavelength, self.knobs)

    @property
    def tail(self) -> float:
        """How far beyond mirrors' ends reflections go on, in the unit of :func:`~.mirrors.beyond_ends`."""
        return self.knobs.end_reach * float(np.sqrt(self.radar.wavelength))

    def reflections(self, ways: Ways, points: Array) -> Reflections:
        """Return where ways over one mirror each, (num_points, 1), are reflected on their way to points."""
        chain, position = self.chain(ways), self.station.position
        images = chain.images(points)
        vertices, _ = chain.vertices(position, images)
        return self._reflections(ways, vertices, chain.travel(position, images)[:, 0], points)

    def _reflections(self, ways: Ways, vertices: Array, travel: Array, points: Array) -> Reflections:
        at = vertices[:, 0]
        inverse = sum(1.0 / np.maximum(row_norm(end - at), LIFT) for end in (self.station.position, points))
        return Reflections(ways[:, 0], at, travel, np.asarray(inverse))

    def strips(self, number: int, points: Array, together: int) -> Strips | None:
        """Return the strips beside a mirror over which reflections on their way to points may go on.

        `points` are corners of objects, `together` of each, (n, 3) [m, world]; of one behind the mirror the part before
        it counts.
        """
        if self.ends is None:
            return None
        return self.ends.strips(number, self._reflected(number, points), together)

    def across_ends(self, number: int, corners: Array) -> Array:
        """Return how far the sides of triangles, (n, 3, 3) [m, world], reach across ends of a mirror.

        Shape (n, 3) [Fresnel units]; side i runs from corner i to i + 1.
        """
        if self.ends is None or not len(corners):
            return np.zeros((len(corners), 3))
        return self.ends.across(number, self._reflected(number, corners.reshape(-1, 3)))

    def _reflected(self, number: int, points: Array) -> Reflections:
        """Return the reflections at a mirror on the way to points; those behind it are taken to be just before it."""
        normal, offset = self._planes[0][number], self._planes[1][number]
        side = float(np.sign(self.station.position @ normal - offset))
        sunk = np.maximum(2.0 * self.knobs.thickness - side * (points @ normal - offset), 0.0)
        points = points + (side * sunk)[:, None] * normal
        return self.reflections(np.full((len(points), 1), number), points)

    def chain(self, ways: Ways) -> Chain:
        """Return the chains of reflections of ways."""
        flat = np.ones(ways.shape, dtype=np.bool_)
        return Chain(flat, ~flat, self._planes[0][ways], self._planes[1][ways])

    def shows(self, ways: Ways, points: Array, owner: npt.NDArray[np.int64] | None = None) -> npt.NDArray[np.bool_]:
        """Return which points ways show, with nothing in between.

        Parameters
        ----------
        ways : ndarray of int64, shape (num_points, num_mirrors)
            Numbers of the mirrors from the radar on, for each point. One call for many ways is many times cheaper than
            one for each.
        points : ndarray of float64, shape (num_points, 3)
            [m, world].
        owner : ndarray of int64, shape (num_points,), optional
            Instances of the points: panes of their own hide them.
        """
        chain = self.chain(ways)
        vertices, right = chain.vertices(self.station.position, chain.images(points))
        return np.asarray(self._open(ways, vertices, points, owner, right))

    def leg(self, ways: Ways, rotation: Array, points: Array, velocities: Array) -> Leg:
        """Return ways to points, whether they are open or not.

        Parameters
        ----------
        ways : ndarray of int64, shape (num_points, num_mirrors)
            As of :meth:`shows`.
        rotation : ndarray of float64, shape (3, 3)
            Axes, as columns, of the frame of the radar's image.
        points : ndarray of float64, shape (num_points, 3)
            What the length is counted to: points of the object, or their images by its own bounces, which are seen in
            the direction in which the wave meets the object first [m, world].
        velocities : ndarray of float64, shape (num_points, 3)
            Of these points [m/s, world].
        """
        state, station = self.state, self.station
        chain, parts = self.chain(ways), self._planes[2][ways]
        images = chain.images(points)
        vertices, _ = chain.vertices(station.position, images)
        travel = chain.travel(station.position, images)
        names, index = np.unique(np.array(state.world.parts.material)[parts], return_inverse=True)
        jones = transfer(
            chain,
            travel,
            spherical_basis(station.rotation, travel[:, 0]),
            spherical_basis(rotation, travel[:, -1]),
            material_coefficients(
                [state.world.materials[name] for name in names.tolist()],
                index.reshape(parts.shape),
                material_frequency(self.radar),
            ),
        )
        surface = state.point_velocity(parts.ravel(), vertices.reshape(-1, 3)).reshape(vertices.shape)
        velocity = np.broadcast_to(station.velocity, points.shape).copy()
        for k in range(chain.max_depth):
            normal = chain.normal[:, k]
            velocity -= 2.0 * np.einsum("pi,pi->p", velocity - surface[:, k], normal)[:, None] * normal
        seen = chain.image_velocity(velocities, surface) - station.velocity
        weight = np.ones(len(points), dtype=np.complex128)
        if self.ends is not None and ways.shape[1] == 1:
            weight = self.ends.weight(self._reflections(ways, vertices, travel[:, 0], points))
        return Leg(images[:, 0], jones, travel[:, -1], velocity, seen, weight)

    def _open(
        self,
        ways: Ways,
        vertices: Array,
        points: Array,
        owner: npt.NDArray[np.int64] | None,
        right: npt.NDArray[np.bool_],
    ) -> npt.NDArray[np.bool_]:
        """Return which ways meet each mirror where it is, and no other mirror in its place, with nothing in between.

        Of those only that `right` has.
        """
        normals, offsets, _ = self._planes
        start, rows, seen = self.station.position, np.flatnonzero(right), np.zeros(len(points), dtype=np.bool_)
        tails = self.ends is not None and ways.shape[1] == 1
        for k in range(ways.shape[1]):
            end, mirror = vertices[rows, k], ways[rows, k]
            met = self.rays.meet(start, end, mirror)
            kept = np.flatnonzero(met.on | self._beside(ways[rows], points[rows], met) if tails else met.on)
            normal, offset = normals[mirror[kept]], offsets[mirror[kept]]
            side = np.sign(_dot(np.broadcast_to(start, end.shape)[kept], normal) - offset)
            lift = np.where(met.above[kept], self.knobs.thickness, LIFT)  # out from under a marking
            start, rows = end[kept] + (lift * side)[:, None] * normal, rows[kept]
        seen[rows[self.rays.reach(start, points[rows], None if owner is None else owner[rows])]] = True
        return seen

    def _beside(self, ways: Ways, points: Array, met: Met) -> Flags:
        """Return which rays to points pass a mirror's end where its reflection goes on, and meet nothing before."""
        some = np.flatnonzero(met.free & ~met.on)
        found = np.zeros(len(ways), dtype=np.bool_)
        if self.ends is not None and len(some):
            found[some] = self.ends.goes_on(self.reflections(ways[some], points[some]))
        return found


def _dot(first: Array, second: Array) -> Array:
    return np.asarray(np.einsum("ij,ij->i", first, second))
