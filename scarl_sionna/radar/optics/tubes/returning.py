"""Which ray tubes are worth following: those some of whose rays come back to the receiver after further bounces.

Physical optics radiates from a facet mainly into the mirror direction. A tube that no sequence of further bounces turns
back towards the receiver adds the side lobes of its facets only, and most tubes of a body are such. So before tubes are
cut at every edge that their reflection meets, which is what bounces cost, single rays find out where they go.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scarl_sionna.engine.rays.face_planes import FaceTable
from scarl_sionna.engine.rays.face_rays import MISS, FaceRays
from scarl_sionna.engine.types import DeviceArray

from .probes import CentralRays, Probe, Receivers
from .spacings import Spacings
from .together import Question
from .tube_shape import COUNTS, OFFSETS, TOO_LONG, layouts, sides_and_height

FINER = 8.0
"""Rays that ask whether a tube comes back lie this much closer than those by which it is cut: where two of the latter
meet different faces the tube is looked at more finely, but it is given up at once where none of the former comes back.
At the same distance a bounce off the last 0.2 m of a box was lost, 13 dB of an echo (docs/sbr.md)."""

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]
Mask = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Return:
    """What counts as coming back.

    Attributes
    ----------
    rays : FaceRays
    faces : FaceTable
    chosen : ndarray of bool, shape (num_faces,)
        Faces that reflect; a ray that meets another one ends there.
    stations : ndarray of float64, shape (num_receivers, 3)
        Receivers [m, world]: what comes back to any of them does.
    angle : float
        Largest angle between the mirror direction and that of a receiver [rad].
    """

    rays: FaceRays
    faces: FaceTable
    chosen: Mask
    stations: Array
    angle: float

    def of_footprints(self, center: Array, source: Array, face: Index, station: Array) -> Mask:
        """Return whether the mirror direction at points of faces is that of a receiver, shape (n,).

        Parameters
        ----------
        center, source : ndarray of float64, shape (n, 3)
            Points, and where their rays come from [m, world].
        face : ndarray of int64, shape (n,)
        station : ndarray of float64, shape (3,) or (n, 3)
            [m, world].
        """
        arriving = center - source
        normal = self.faces.triangles.normal[face]
        mirrored = arriving - 2.0 * np.einsum("ij,ij->i", arriving, normal)[:, None] * normal
        back = station - center
        cosine = np.einsum("ij,ij->i", mirrored, back)
        cosine /= np.maximum(np.linalg.norm(mirrored, axis=1) * np.linalg.norm(back, axis=1), 1e-300)
        return np.asarray(cosine >= np.cos(self.angle))


@dataclass(frozen=True, eq=False)
class ComingBack(Question):
    """Which tubes have a ray that comes back after 1 to `bounces` further bounces; the answer is a mask.

    Attributes
    ----------
    place : tuple of int
    wanted : Return
    corners : ndarray of float64, shape (num_tubes, 3, 3)
        Footprints [m].
    source, lift : ndarray of float64, shape (num_tubes, 3)
        Where the reflected rays seem to come from [m, world], and the unit normal on the side on which they run.
    spacings : Spacings
        Those by which tubes are cut; these rays lie `FINER` times as close as the phase asks for.
    bounces : int
    """

    place: tuple[int, ...]
    wanted: Return
    corners: Array
    source: Array
    lift: Array
    spacings: Spacings
    bounces: int

    def __len__(self) -> int:
        return len(self.corners)

    @property
    def key(self) -> Hashable:
        """What is asked together: rays of one scene that come back within one angle."""
        wanted = self.wanted
        return ComingBack, id(wanted.rays), id(wanted.faces), id(wanted.chosen), wanted.angle

    @classmethod
    def answered(cls, questions: Sequence[ComingBack]) -> list[Mask]:
        """Return which tubes come back, of each question."""
        corners, source, lift = (
            np.concatenate([getattr(one, name) for one in questions]) for name in ("corners", "source", "lift")
        )
        spacing = np.concatenate([np.minimum(one.spacings.wide, one.spacings.plain / FINER) for one in questions])
        longest, height = sides_and_height(corners)
        layout = layouts(longest, height, spacing, np.zeros(len(corners)))
        found = layout == TOO_LONG  # their parts are asked, once they are cut: followed as they are
        short = np.flatnonzero(~found)
        ends = np.cumsum([len(one) for one in questions])
        if len(short):
            asked = np.searchsorted(ends, short, side="right")
            receivers = Receivers(questions[0].wanted.rays, [one.wanted.stations for one in questions], asked)
            bounces = np.array([one.bounces for one in questions])[asked]
            probe = _ReturnProbe(questions[0].wanted, (source[short], lift[short]), receivers, bounces)
            count, first = COUNTS[layout[short]], OFFSETS[layout[short]]
            # the first ray decides every other tube
            found[short] = probe.within(corners[short], np.arange(len(short)), np.ones_like(count), first) > 0
            rest = np.flatnonzero(~found[short] & (count > 1))
            count = count[rest] - 1
            labels = probe.within(corners[short[rest]], rest, count, first[rest] + 1)
            found[short[rest]] = np.maximum.reduceat(labels, np.cumsum(count) - count) > 0
        return np.split(np.asarray(found), ends[:-1])


class _ReturnProbe(Probe):
    """Whether a ray from a point of a tube comes back (1) to one of its receivers after some bounces, or not (0)."""

    def __init__(self, wanted: Return, start: tuple[Array, Array], receivers: Receivers, bounces: Index) -> None:
        rays, (source, lift) = wanted.rays, start
        super().__init__(rays)
        self._directions, self._lift = CentralRays(rays, source), rays.reals(lift)
        self._bounces, self._receivers = rays.index(bounces), receivers
        triangles = wanted.faces.triangles
        self._normal, self._offset = rays.reals(triangles.normal), rays.reals(triangles.offset)
        self._chosen = rays.index(wanted.chosen.astype(np.uint32))
        self._cosine = rays.real(float(np.cos(wanted.angle)))

    def _label(self, point: DeviceArray, row: DeviceArray) -> DeviceArray:
        dr, mi, rays = self.rays.dr, self.rays.mi, self.rays
        above, ray = dr.gather(rays.Vector, self._lift, row), self._directions.at(point, row)
        bounces = dr.gather(mi.UInt32, self._bounces, row)

        def bounce(
            count: DeviceArray,
            alive: DeviceArray,
            back: DeviceArray,
            point: DeviceArray,
            ray: DeviceArray,
            above: DeviceArray,
        ) -> tuple[DeviceArray, ...]:
            face = rays.first(rays.lifted(point, above), ray, alive)
            alive &= face != MISS
            number = mi.UInt32(face)
            alive &= dr.gather(mi.UInt32, self._chosen, number, alive) == 1
            normal = dr.gather(rays.Vector, self._normal, number, alive)
            slope = dr.dot(normal, ray)
            height = dr.gather(rays.Real, self._offset, number, alive) - dr.dot(normal, point)
            point = dr.select(alive, point + height / dr.select(alive, slope, 1.0) * ray, point)
            ray = ray - 2.0 * slope * normal
            back = self._receivers.is_any(
                row, alive, lambda station: dr.dot(ray, dr.normalize(station - point)) >= self._cosine
            )
            return count + 1, alive & ~back, back, point, ray, normal * -dr.sign(slope)

        # a loop, since most rays are decided by the first bounce or two
        state = mi.UInt32(0), mi.Bool(True), mi.Bool(False), point, ray, above
        _, _, back, *_ = dr.while_loop(
            state, lambda count, alive, *_: alive & (count < bounces), bounce, label="bounces of single rays"
        )
        return dr.select(back, mi.Int32(1), mi.Int32(0))
