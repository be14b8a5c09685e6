"""Spherical waves in a scene.

They say which patches the transmitter lights and the receiver sees, directly and over mirrors of ray tubes.

A tube is a triangle on a face with the image of the transmitter from which its rays seem to come. Its reflection is
cast onward from the image of that image; the footprint where it lands is the central projection of the triangle, exact
in float64. Tubes are cut where the thing that they meet changes (:func:`.tubes.refine.refine`). Fields are computed
once a chain of faces is known, at the exact reflection points (:mod:`.near_field`).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Generator, Iterable, Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.arrays.rows import row_any, row_max
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.settings.sbr import SbrSettings
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.engine.rays.face_planes import FaceTable
from scarl_sionna.engine.rays.face_rays import MISS, StateRays

from .faces.panes import DARK, MOST_PANES, Panes
from .patches import PatchSize, split, too_many_patches
from .tubes.cutting import Cut, Landing, Seen, cut_at_ends
from .tubes.narrow import NarrowBodies
from .tubes.probes import SAME_DISTANCE
from .tubes.returning import ComingBack, Return
from .tubes.screens import FieldOfView, Screen, Window
from .tubes.spacings import NearBodies, Spacings
from .tubes.together import Question, Tracing, together
from .tubes.trace import GRAZING, Tubes, face_of_plane, landing, lands_ahead
from .tubes.tube_shape import middle

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]
Mask = npt.NDArray[np.bool_]

_COARSE = 16.0
"""Faces are first cut into pieces so many times as long as patches, so that a batch of them is no more than some
patches. Bounds the memory, decides no accuracy."""
WIDE_FACE = 0.5
"""Faces that look wider than this [rad] are never sorted out before they are cut into patches, which are tested alone:
decides the time, not the accuracy."""


@dataclass(frozen=True, eq=False)
class ImageTubes(Tubes):
    """Footprints of ray tubes of spherical waves.

    Attributes
    ----------
    face : ndarray of int64, shape (num_tubes, depth)
        Faces in the order in which they are met; the footprint is on the last one.
    image : ndarray of float64, shape (num_tubes, depth, 3)
        The transmitter and its images behind all faces but the last: where the rays come from on their way to each face
        [m].
    origin : ndarray of int64, shape (num_tubes,)
        Number on its first face of the patch from which a tube comes, the same for all pieces into which it is cut
        later.
    way_in, way_out : ndarray of int64, shape (num_tubes, MOST_PANES)
        Faces of the panes between the transmitter and the first face, and between the last face and the receiver;
        `MISS` for none.
    """

    face: Index
    image: Array
    origin: Index
    way_in: Index
    way_out: Index

    @property
    def depth(self) -> int:
        """Number of bounces, that at the footprint included."""
        return self.face.shape[1]


@dataclass(frozen=True, eq=False)
class Viewpoint:
    """Where a transmitter or receiver stands, how it moves and what it looks at.

    Attributes
    ----------
    pose : Pose
        world_from_radar.
    velocity : ndarray of float64, shape (3,)
        [m/s, world].
    azimuth_fov, elevation_fov : float
        [rad].
    window : Window, optional
        Of a station that is an image: the plane of the mirror, through which it looks.
    passing : ndarray of float64, shape (3,), optional
        Of an image: its velocity as far as the size of patches goes [m/s]; `velocity` if left out.
    axes : ndarray of float64, shape (3, 3), optional
        Of an image: the mirrored axes of the radar, as columns, in which its field of view is meant; those of `pose` if
        left out.
    """

    pose: Pose
    velocity: Array
    azimuth_fov: float
    elevation_fov: float
    window: Window | None = None
    axes: Array | None = None
    passing: Array | None = None

    @property
    def drift(self) -> Array:
        """Velocity that counts for the size of patches, shape (3,) [m/s]."""
        return self.velocity if self.passing is None else self.passing

    @property
    def _axes(self) -> Array:
        return self.pose.rotation if self.axes is None else self.axes

    @property
    def view(self) -> FieldOfView:
        """What it looks at."""
        return FieldOfView(self._axes, self.azimuth_fov, self.elevation_fov)

    @classmethod
    def of(cls, radar: RadarSpec, pose: Pose, velocity: Array) -> Viewpoint:
        """Return the station of a radar."""
        return cls(pose, velocity, np.radians(radar.azimuth_fov_deg), np.radians(radar.elevation_fov_deg))

    def outside(self, points: Array) -> tuple[Array, Array, Array]:
        """Return by how much points are outside of the view in azimuth and elevation [rad], and their distance [m]."""
        local = (points - self.pose.position) @ self._axes
        distance = np.sqrt(np.einsum("ij,ij->i", local, local))
        azimuth = np.abs(np.arctan2(local[:, 1], local[:, 0])) - self.azimuth_fov / 2.0
        sine = np.divide(local[:, 2], distance, out=np.zeros_like(distance), where=distance > 0.0)
        elevation = np.abs(np.arcsin(np.clip(sine, -1.0, 1.0))) - self.elevation_fov / 2.0
        return azimuth, elevation, distance

    def sees(self, points: Array) -> Mask:
        """Return whether points are in the field of view."""
        local = (points - self.pose.position) @ self._axes
        flat = local[:, 0] ** 2 + local[:, 1] ** 2
        ahead = local[:, 0] >= np.cos(self.azimuth_fov / 2.0) * np.sqrt(flat)
        return ahead & (np.abs(local[:, 2]) <= np.sin(self.elevation_fov / 2.0) * np.sqrt(flat + local[:, 2] ** 2))

    def touches(self, corners: Array) -> Mask:
        """Return whether a corner or the middle of triangles (n, 3, 3) is in the field of view, shape (n,)."""
        points = np.concatenate([corners, middle(corners)[:, None]], axis=1)
        return row_any(self.sees(points.reshape(-1, 3)).reshape(-1, 4))

    def may_see(self, faces: FaceTable, rows: Index, reach: float) -> Mask:
        """Return of which of some faces a part may be in the field of view and in reach, and that are not edge-on."""
        corners, normal, offset = (
            column[rows] for column in (faces.triangles.corners, faces.triangles.normal, faces.triangles.offset)
        )
        center = middle(corners)
        arm = corners - center[:, None]
        radius = np.sqrt(row_max(np.einsum("nij,nij->ni", arm, arm)))
        azimuth, elevation, distance = self.outside(center)
        width = np.arcsin(np.minimum(radius / np.maximum(distance, 1e-9), 1.0))
        cosine = np.cos(np.minimum(elevation + self.elevation_fov / 2.0, 1.4))
        inside = (azimuth <= width / cosine) & (elevation <= width) | (width > WIDE_FACE)
        height = np.abs(normal @ self.pose.position - offset)
        return inside & (distance - radius < reach) & (height > GRAZING * distance) & row_any(normal)


@dataclass(frozen=True, eq=False)
class StartFaces:
    """Pieces of faces, some patches large, from which first tubes are cut.

    Attributes
    ----------
    face : ndarray of int64, shape (num_pieces,)
        Of each piece.
    corners : ndarray of float64, shape (num_pieces, 3, 3)
        [m].
    pieces : ndarray of float64, shape (num_pieces,)
        About how many first tubes each gives.
    size : PatchSize
        To which they are cut.
    """

    face: Index
    corners: Array
    pieces: Array
    size: PatchSize


@dataclass(frozen=True, eq=False)
class Arrival:
    """Tubes of one bounce."""

    lit: ImageTubes
    """What goes on from there."""
    seen: ImageTubes
    """Patches of it that the receiver sees."""


@dataclass(frozen=True, eq=False)
class Tracer:
    """Rays of one transmitter and receiver in one state of the world.

    Attributes
    ----------
    rays : StateRays
    faces : FaceTable
    chosen : ndarray of bool, shape (num_faces,)
        Faces that scatter; the others are obstacles at which a tube ends.
    sheet : ndarray of float64, shape (num_faces,)
        Size of the sheet to which each face belongs [m].
    tx, rx : Viewpoint
        The same object for a monostatic radar.
    reach : float
        Tubes longer than twice this are dropped [m].
    size : PatchSize
    settings : SbrSettings
        Those of :meth:`.SbrSettings.for_scene`.
    panes : Panes or None
        What lets waves through.
    velocity : ndarray of float64, shape (num_faces, 3), or None
        Of the faces' centres [m/s]; None: patches do not follow from motion.
    count : Counter
        Tubes traced so far, by bounce.
    """

    rays: StateRays
    faces: FaceTable
    chosen: Mask
    sheet: Array
    tx: Viewpoint
    rx: Viewpoint
    reach: float
    size: PatchSize
    settings: SbrSettings
    panes: Panes | None = None
    velocity: Array | None = None
    narrow: NarrowBodies | None = None
    count: Counter[int] = field(default_factory=Counter)

    def bounces(self, face: Index, starts: Iterable[ImageTubes] | None = None) -> Iterator[ImageTubes]:
        """Yield what :meth:`tracing` finds, alone."""
        for _, found in together([self.tracing(face, starts)], self.settings.max_tubes):
            if found is not None:
                yield found

    def tracing(self, face: Index, starts: Iterable[ImageTubes] | None = None) -> Tracing[ImageTubes]:
        """Yield the footprints that the receiver sees, bounce after bounce, of tubes that start on some faces.

        The last batch that was found goes first, so that few wait at a time. What is asked of the rays is yielded, too,
        see :func:`.together`.

        Parameters
        ----------
        face : ndarray of int64
            On which tubes start.
        starts : iterable of ImageTubes, optional
            The first tubes; all of `face` if left out.
        """
        for start in self._starts(face) if starts is None else starts:
            stack = [(1, start)]
            while stack:
                depth, tubes = stack.pop()
                arrival = yield from self._arrive(depth, tubes)
                windows = (self.tx.window, self.rx.window)[depth > 1 :]
                yield from self._for_motion(cut_at_ends(arrival.seen, windows, self.settings))
                if depth < self.settings.max_depth and len(arrival.lit):
                    following = yield from self._next(arrival.lit)
                    stack += [(depth + 1, batch) for batch in following.batches(self.settings.max_tubes)]

    def first_tubes(self, face: Index) -> StartFaces:
        """Return into what faces are cut first, and about how many first tubes that makes.

        Raises
        ------
        ParameterRangeError
            If they are more than `max_patches`.
        """
        source, receiver, limit = self.tx.pose.position, self.rx.pose.position, self.settings.max_patches
        size = self._start_size(face)
        coarse, rows = split(self.faces.triangles.corners[face], source[None], receiver, size, limit, _COARSE)
        pieces = size.pieces(coarse, source, receiver)
        if pieces.sum() > 1.5 * limit:  # the count is an estimate; split() itself counts too
            too_many_patches(limit)
        return StartFaces(face[rows], coarse, pieces, size)

    def sample(self, starts: StartFaces, count: int) -> tuple[ImageTubes, float]:
        """Return some of the first tubes, evenly among all, and how many tubes each of them stands for.

        Parameters
        ----------
        starts : StartFaces
        count : int
            Tubes; those out of the transmitter's view are left out of them.
        """
        place = np.cumsum(starts.pieces)
        wanted = (np.arange(count) + 0.5) / count * place[-1]
        coarse = np.minimum(np.searchsorted(place, wanted, side="right"), len(place) - 1)
        chosen, of_wanted = np.unique(coarse, return_inverse=True)
        fine, piece_of = split(
            starts.corners[chosen],
            self.tx.pose.position[None],
            self.rx.pose.position,
            starts.size,
            self.settings.max_patches,
        )
        made = np.bincount(piece_of, minlength=len(chosen))[of_wanted]
        share = 1.0 - (place[coarse] - wanted) / starts.pieces[coarse]
        number = np.minimum((share * made).astype(np.int64), made - 1)
        rows = np.searchsorted(piece_of, of_wanted) + number
        stands_for = float(place[-1] * np.mean(made / starts.pieces[coarse]) / count)
        return self._first(fine[rows], starts.face[coarse], coarse, number), stands_for

    def _arrive(self, depth: int, tubes: ImageTubes) -> Generator[Question, Any, Arrival]:
        self.count[depth] += len(tubes)
        if depth > 1:
            seen = yield from self._seen(self._watched(self._cut(self._turned_back(tubes))), self.rx, (depth, 1))
            return Arrival(tubes, seen)
        lit = yield from self._seen(tubes, self.tx, (depth, 0))
        if self.rx is self.tx:
            return Arrival(lit, replace(lit, way_out=lit.way_in))
        return Arrival(lit, (yield from self._seen(self._watched(self._in_front(lit)), self.rx, (depth, 1))))

    def _starts(self, face: Index) -> Iterator[ImageTubes]:
        """Yield the patches of faces that are in the transmitter's view, some batch of them at a time."""
        source, receiver, limit = self.tx.pose.position, self.rx.pose.position, self.settings.max_patches
        starts = self.first_tubes(face)
        batch = (np.cumsum(starts.pieces) / self.settings.max_tubes).astype(np.int64)
        new = np.diff(starts.face, prepend=-1) != 0
        first = np.maximum.accumulate(np.where(new, np.arange(len(new)), 0))  # coarse piece of the same face
        for part in np.split(np.arange(len(batch)), np.flatnonzero(np.diff(batch)) + 1):
            fine, piece_of = split(starts.corners[part], source[None], receiver, starts.size, limit)
            number = np.arange(len(piece_of)) - np.searchsorted(piece_of, piece_of)
            whole = part[piece_of]
            tubes = self._first(fine, starts.face[whole], whole - first[whole], number)
            yield from tubes.batches(self.settings.max_tubes)

    def _first(self, corners: Array, face: Index, piece: Index, number: Index) -> ImageTubes:
        """Return first tubes of faces in the transmitter's view; `piece` and `number` say which of a face each is."""
        kept = np.flatnonzero(self.tx.touches(corners))
        start = np.broadcast_to(self.tx.pose.position, (len(kept), 1, 3))
        way = np.full((len(kept), MOST_PANES), MISS)
        return ImageTubes(corners[kept], face[kept, None], start, piece[kept] * (1 << 32) + number[kept], way, way)

    def _start_size(self, face: Index) -> PatchSize:
        """Return the size of the first tubes, so that there are about `num_tubes` of them if it is set."""
        wanted = self.settings.num_tubes
        if wanted is None:
            return self.size
        low, high = 1e-6, 1e3
        corners, source, receiver = self.faces.triangles.corners[face], self.tx.pose.position, self.rx.pose.position
        for _ in range(30):
            longest = float(np.sqrt(low * high))
            size = replace(self.size, longest=longest)
            more = size.pieces(corners, source, receiver).sum() > wanted
            low, high = (longest, high) if more else (low, longest)
        return replace(self.size, longest=high)

    def _cut(self, tubes: ImageTubes) -> ImageTubes:
        """Return footprints cut into patches that are small enough."""
        limit = self.settings.max_patches
        corners, rows = split(tubes.corners, tubes.image[:, -1], self.rx.pose.position, self.size, limit)
        return tubes.take(rows, corners)

    def _for_motion(self, tubes: ImageTubes) -> Iterator[ImageTubes]:
        """Yield footprints, cut so that motion over a frame changes the pattern of none: see `max_turn`."""
        if self.velocity is None or self.size.max_turn is None or not len(tubes):
            yield tubes
            return
        image = np.broadcast_to(self.tx.drift, (len(tubes), 3))
        for face in tubes.face.T[:-1]:
            normal = self.faces.triangles.normal[face]
            along = np.einsum("ij,ij->i", image - self.velocity[face], normal)
            image = image - 2.0 * along[:, None] * normal
        own = self.velocity[tubes.face[:, -1]]
        passed = (own - image) * self.size.duration, (own - self.rx.drift) * self.size.duration
        if not (passed[0].any() or passed[1].any()):
            yield tubes
            return
        source, receiver = tubes.image[:, -1], self.rx.pose.position
        # edges may not do for what moves: the band counts again
        size = replace(self.size, max_phase=np.inf, passed=passed)
        excess = size.excess(tubes.corners, source, np.arange(len(tubes)), receiver)
        batch = (np.cumsum(size.pieces_of(excess)) / self.settings.max_tubes).astype(np.int64)
        for rows in np.split(np.arange(len(tubes)), np.flatnonzero(np.diff(batch)) + 1):
            size = replace(size, passed=(passed[0][rows], passed[1][rows]))
            corners, piece_of = split(tubes.corners[rows], source[rows], receiver, size, self.settings.max_patches)
            yield tubes.take(rows[piece_of], corners)

    def _watched(self, tubes: ImageTubes) -> ImageTubes:
        return tubes.take(np.flatnonzero(self.rx.touches(tubes.corners)))

    def _spacings(self, tubes: ImageTubes, source: Array, is_way_in: bool) -> Spacings:
        """Return how finely footprints are probed and halved; those at grazing incidence only for narrow bodies."""
        ray = middle(tubes.corners) - source
        distance = np.sqrt(np.einsum("ij,ij->i", ray, ray))
        cosine = np.einsum("ij,ij->i", self.faces.triangles.normal[tubes.face[:, -1]], ray) / distance
        grazing = np.abs(cosine) < self.settings.grazing_cosine
        wavelength = 2.0 * np.pi / self.size.wavenumber
        sheet = self.sheet[tubes.face[:, -1]]
        wide, fine = self.settings.spacings(wavelength, self.size.length(distance), sheet)
        phase = Spacings(np.where(grazing, np.inf, wide), np.where(grazing, np.inf, fine))
        if self.narrow is None or self.settings.narrow_share == 1.0 or (is_way_in and not self.settings.narrow_shadows):
            return phase
        source, least = np.broadcast_to(source, ray.shape), np.full(len(ray), self.settings.narrow_share * wide)
        near = NearBodies(self.rays, self.narrow, is_way_in, source, phase.wide, least)
        return Spacings.beside(near, tubes.corners, phase.fine)

    def _seen(
        self, tubes: ImageTubes, station: Viewpoint, place: tuple[int, int]
    ) -> Generator[Question, Any, ImageTubes]:
        """Return the parts of footprints from which a station can be seen, through panes or not, with that column.

        At the first of the places of a bounce the column is that of the way in.
        """
        if not len(tubes):
            return tubes
        start = station.pose.position
        spacings = self._spacings(tubes, start, is_way_in=True)
        screen = Screen(start, station.window, station.view)
        target = Seen(self.rays, screen, tubes.face[:, -1], self.panes)
        corners, rows, dark = yield Cut(place, tubes.corners, spacings, target, self.settings)
        lit = dark != DARK
        found = tubes.take(rows[lit], corners[lit])
        behind = np.flatnonzero(dark[lit] > DARK)
        if self.panes is None or not len(behind):
            return found
        faces = np.full((len(found), MOST_PANES), MISS)
        center = middle(found.corners[behind])
        first = start if station.window is None else station.window.entry(start, center)
        faces[behind] = self.panes.crossed(first, center, 1.0 - SAME_DISTANCE)
        return replace(found, way_in=faces) if place[1] == 0 else replace(found, way_out=faces)

    def _in_front(self, tubes: ImageTubes) -> ImageTubes:
        """Return the footprints whose lit side is turned to the receiver."""
        center = middle(tubes.corners)
        normal = self.faces.triangles.normal[tubes.face[:, -1]]
        lit = np.einsum("ij,ij->i", normal, tubes.image[:, -1] - center)
        towards = np.einsum("ij,ij->i", normal, self.rx.pose.position - center)
        return tubes.take(np.flatnonzero(lit * towards > 0.0))

    def _turned_back(self, tubes: ImageTubes) -> ImageTubes:
        """Return the footprints that radiate to the receiver: see `return_angle`."""
        tubes = self._in_front(tubes)
        if self._return is None or not len(tubes):
            return tubes
        last = tubes.face[:, -1]
        return tubes.take(np.flatnonzero(self._return.of_footprints(middle(tubes.corners), tubes.image[:, -1], last)))

    @cached_property
    def _of_plane(self) -> Index:
        return face_of_plane(self.faces.plane)

    @cached_property
    def _return(self) -> Return | None:
        angle = self.settings.return_angle
        if angle is None:
            return None
        return Return(self.rays, self.faces, self.chosen, self.rx.pose.position, angle)

    def _next(self, tubes: ImageTubes) -> Generator[Question, Any, ImageTubes]:
        """Return the footprints of the reflected tubes on what they meet next."""
        triangles = self.faces.triangles
        last = tubes.face[:, -1]
        normal, offset = triangles.normal[last], triangles.offset[last]
        height = np.einsum("ij,ij->i", normal, tubes.image[:, -1]) - offset
        image = tubes.image[:, -1] - 2.0 * height[:, None] * normal
        lift = normal * np.sign(height)[:, None]
        place, rest = tubes.depth, self.settings.max_depth - tubes.depth
        spacings = self._spacings(tubes, image, is_way_in=False)
        if self._return is not None:
            kept = yield ComingBack((place, 2), self._return, tubes.corners, image, lift, spacings, rest)
            tubes, image, lift, last = tubes.take(kept), image[kept], lift[kept], last[kept]
            spacings = spacings.take(np.flatnonzero(kept))
        if not len(tubes):
            return self._landed(tubes, image, tubes.corners, last, last)
        target = Landing(self.rays, self.faces, self.chosen, image, lift, last)
        if rest == 1:
            target = replace(target, station=self.rx.pose.position, angle=self.settings.return_angle)
        corners, rows, plane = yield Cut((place, 3), tubes.corners, spacings, target, self.settings)
        met = plane != MISS
        return self._landed(tubes, image, corners[met], rows[met], self._of_plane[plane[met]])

    def _landed(self, tubes: ImageTubes, image: Array, corners: Array, rows: Index, face: Index) -> ImageTubes:
        """Return tubes projected from their images onto the planes of faces."""
        normal, offset = self.faces.triangles.normal[face], self.faces.triangles.offset[face]
        source = image[rows]
        ray = corners - source[:, None]
        share, slope = landing(corners, ray, normal, offset)
        length = np.sqrt(np.einsum("nij,nij->ni", ray, ray))
        kept = lands_ahead(corners, length, share, slope)
        with np.errstate(invalid="ignore"):
            kept &= (length * (1.0 + share) < 2.0 * self.reach).all(axis=1)
        landed = corners[kept] + share[kept, :, None] * ray[kept]
        chain = np.concatenate([tubes.face[rows[kept]], face[kept, None]], axis=1)
        images = np.concatenate([tubes.image[rows[kept]], source[kept, None]], axis=1)
        rows = rows[kept]
        return ImageTubes(landed, chain, images, tubes.origin[rows], tubes.way_in[rows], tubes.way_out[rows])
