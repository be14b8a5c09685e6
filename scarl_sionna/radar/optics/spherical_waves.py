"""Spherical waves in a scene.

They say which patches the transmitter lights and the receiver sees, directly and over mirrors of ray tubes.

A tube is a triangle on a face with the image of the transmitter from which its rays seem to come. Its reflection is
cast onward from the image of that image; the footprint where it lands is the central projection of the triangle, exact
in float64. Tubes are cut where the thing that they meet changes (:func:`.tubes.refine.refine`). Fields are computed
once a chain of faces is known, at the exact reflection points (:mod:`.near_field`).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Generator, Iterable, Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.settings.sbr import SbrSettings
from scarl_sionna.engine.rays.face_planes import FaceTable
from scarl_sionna.engine.rays.face_rays import MISS, StateRays

from .faces.panes import DARK, MOST_PANES, Panes
from .patches import PatchSize, split, too_many_patches
from .tubes.checks import Lit, Points, spread_points
from .tubes.cutting import Cut, Landing, Seen, cut_at_ends
from .tubes.narrow import NarrowBodies
from .tubes.probes import SAME_DISTANCE
from .tubes.returning import ComingBack, Return
from .tubes.screens import Screen
from .tubes.spacings import NearBodies, Spacings
from .tubes.together import Branch, Question, Tracing, together
from .tubes.trace import Tubes, face_of_plane, landing, lands_ahead
from .tubes.tube_shape import middle
from .viewpoint import Viewpoint

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]
Mask = npt.NDArray[np.bool_]

_COARSE = 16.0
"""Faces are first cut into pieces so many times as long as patches, so that a batch of them is no more than some
patches. Bounds the memory, decides no accuracy."""
_FIRST = (1, 0)
"""Place of what the transmitter lights first."""


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


class Heard(NamedTuple):
    """Patches that a receiver sees.

    Attributes
    ----------
    receiver : int
        Its number.
    patches : ImageTubes
    same_way : bool
        Heard where the transmitter itself stands, over the mirrors on the way there: `way_in` is both ways.
    """

    receiver: int
    patches: ImageTubes
    same_way: bool = False


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
class Tracer:
    """Rays of one transmitter in one state of the world, and what its receivers see of them.

    All receivers share the tubes; what comes back to any of them is followed.

    Attributes
    ----------
    rays : StateRays
    faces : FaceTable
    chosen : ndarray of bool, shape (num_faces,)
        Faces that scatter; the others are obstacles at which a tube ends.
    sheet : ndarray of float64, shape (num_faces,)
        Size of the sheet to which each face belongs [m].
    tx : Viewpoint
    receivers : tuple of Viewpoint
        The same object as `tx` where it receives itself.
    reach : float
        Tubes longer than twice this are dropped [m].
    size : PatchSize
    settings : SbrSettings
        Those of :meth:`.SbrSettings.for_scene`.
    panes : Panes or None
        What lets waves through.
    velocity : ndarray of float64, shape (num_faces, 3), or None
        Of the faces' centres [m/s]; None: patches do not follow from motion.
    narrow : NarrowBodies or None
        Which no tube may miss.
    same_way : callable, optional
        From chains of faces (n, depth) to those after which a transmitter that receives hears the last one over the
        others, too. Those that go on back over the same planes are left out then. Nothing is heard so if left out.
    owner : ndarray of int64, shape (num_faces,), optional
        Instance of each face; what is lit of each is checked then.
    count : Counter
        Tubes traced so far, by bounce.
    checked : Lit
        What is lit of instances, and what of that is wrong.
    """

    rays: StateRays
    faces: FaceTable
    chosen: Mask
    sheet: Array
    tx: Viewpoint
    receivers: tuple[Viewpoint, ...]
    reach: float
    size: PatchSize
    settings: SbrSettings
    panes: Panes | None = None
    velocity: Array | None = None
    narrow: NarrowBodies | None = None
    same_way: Callable[[Index], Mask] | None = None
    owner: Index | None = None
    count: Counter[int] = field(default_factory=Counter)
    checked: Lit = field(default_factory=Lit)

    def bounces(self, face: Index, starts: Iterable[ImageTubes] | None = None) -> Iterator[ImageTubes]:
        """Yield what :meth:`tracing` finds, alone."""
        for _, found in together([self.tracing(face, starts)], self.settings.max_tubes):
            if found is not None:
                yield found.patches

    def tracing(self, face: Index, starts: Iterable[ImageTubes] | None = None) -> Tracing[Heard]:
        """Yield the footprints that each receiver sees, bounce after bounce, of tubes that start on some faces.

        With each its number among the receivers. The last batch that was found goes first, so that few wait at a time.
        What is asked of the rays is yielded, too, see :func:`.together`.

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
                self.count[depth] += len(tubes)
                lit = (yield from self._seen(tubes, self.tx, _FIRST)) if depth == 1 else tubes
                for number in range(len(self.receivers)):
                    yield Branch(self._patches(number, depth, lit))
                    if self.receivers[number] is self.tx:
                        yield Branch(self._back_the_same_way(number, lit))
                if depth < self.settings.max_depth and len(lit):
                    following = yield from self._next(lit)
                    stack += [(depth + 1, batch) for batch in following.batches(self.settings.max_tubes)]

    def first_tubes(self, face: Index) -> StartFaces:
        """Return into what faces are cut first, and about how many first tubes that makes.

        Raises
        ------
        ParameterRangeError
            If they are more than `max_patches`.
        """
        source, receiver, limit = self.tx.pose.position, self._sized_for.pose.position, self.settings.max_patches
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
            self._sized_for.pose.position,
            starts.size,
            self.settings.max_patches,
        )
        made = np.bincount(piece_of, minlength=len(chosen))[of_wanted]
        share = 1.0 - (place[coarse] - wanted) / starts.pieces[coarse]
        number = np.minimum((share * made).astype(np.int64), made - 1)
        rows = np.searchsorted(piece_of, of_wanted) + number
        stands_for = float(place[-1] * np.mean(made / starts.pieces[coarse]) / count)
        return self._first(fine[rows], starts.face[coarse], coarse, number), stands_for

    def _patches(self, number: int, depth: int, lit: ImageTubes) -> Tracing[Heard]:
        """Yield what one receiver sees of the tubes of a bounce, in patches."""
        rx = self.receivers[number]
        if rx is self.tx:
            lit = self._onward(lit)
        if depth == 1 and rx is self.tx:
            seen = replace(lit, way_out=lit.way_in)
        else:
            facing = self._in_front(lit, rx) if depth == 1 else self._turned_back(lit, rx)
            if depth > 1 or rx is not self._sized_for:
                facing = self._cut(facing, rx.pose.position)
            watched = facing.take(np.flatnonzero(rx.touches(facing.corners)))
            seen = yield from self._seen(watched, rx, (depth, 1))
        windows = (self.tx.window, rx.window)[depth > 1 :]
        for patches in self._for_motion(cut_at_ends(seen, windows, self.settings), rx):
            yield Heard(number, patches)

    def _onward(self, lit: ImageTubes) -> ImageTubes:
        """Return the tubes without those that end there and back over the same planes: heard the same way."""
        if self.same_way is None or lit.depth == 1 or lit.depth % 2 == 0:
            return lit
        plane, there = self.faces.plane[lit.face], lit.face[:, : lit.depth // 2 + 1]
        left_out = (plane == plane[:, ::-1]).all(axis=1)
        left_out[left_out] = self.same_way(there[left_out])
        return lit.take(np.flatnonzero(~left_out))

    def _back_the_same_way(self, number: int, lit: ImageTubes) -> Tracing[Heard]:
        """Yield what the transmitter hears of the tubes of a bounce over the mirrors before it, in patches."""
        if self.same_way is None or lit.depth == 1 or 2 * lit.depth - 1 > self.settings.max_depth:
            return
        wanted = lit.take(np.flatnonzero(self.same_way(lit.face)))  # seen as they are lit
        wanted = wanted.take(self._radiates_to(wanted, wanted.image[:, -1]))
        for patches in self._for_motion(self._cut(wanted, wanted.image[:, -1]), None):
            yield Heard(number, patches, same_way=True)

    @property
    def _sized_for(self) -> Viewpoint:
        """The receiver for which first tubes are small enough; patches for the others are cut once more."""
        return self.tx if self.tx in self.receivers else self.receivers[0]

    def _starts(self, face: Index) -> Iterator[ImageTubes]:
        """Yield the patches of faces that are in the transmitter's view, some batch of them at a time."""
        source, receiver, limit = self.tx.pose.position, self._sized_for.pose.position, self.settings.max_patches
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
        corners, source, receiver = (
            self.faces.triangles.corners[face],
            self.tx.pose.position,
            self._sized_for.pose.position,
        )
        for _ in range(30):
            longest = float(np.sqrt(low * high))
            size = replace(self.size, longest=longest)
            more = size.pieces(corners, source, receiver).sum() > wanted
            low, high = (longest, high) if more else (low, longest)
        return replace(self.size, longest=high)

    def _cut(self, tubes: ImageTubes, receiver: Array) -> ImageTubes:
        """Return footprints cut into patches that are small enough; `receiver` is one place or one for each [m]."""
        corners, rows = split(tubes.corners, tubes.image[:, -1], receiver, self.size, self.settings.max_patches)
        return tubes.take(rows, corners)

    def _for_motion(self, tubes: ImageTubes, rx: Viewpoint | None) -> Iterator[ImageTubes]:
        """Yield footprints, cut so that motion over a frame changes the pattern of none: see `max_turn`.

        Without a receiver they are heard the same way as they are lit.
        """
        if self.velocity is None or self.size.max_turn is None or not len(tubes):
            yield tubes
            return
        image = np.broadcast_to(self.tx.drift, (len(tubes), 3))
        for face in tubes.face.T[:-1]:
            normal = self.faces.triangles.normal[face]
            along = np.einsum("ij,ij->i", image - self.velocity[face], normal)
            image = image - 2.0 * along[:, None] * normal
        own = self.velocity[tubes.face[:, -1]]
        home = image if rx is None else rx.drift
        passed = (own - image) * self.size.duration, (own - home) * self.size.duration
        if not (passed[0].any() or passed[1].any()):
            yield tubes
            return
        source = tubes.image[:, -1]
        receiver = source if rx is None else np.broadcast_to(rx.pose.position, source.shape)
        # edges may not do for what moves: the band counts again
        size = replace(self.size, max_phase=np.inf, passed=passed)
        excess = size.excess(tubes.corners, source, np.arange(len(tubes)), receiver)
        batch = (np.cumsum(size.pieces_of(excess)) / self.settings.max_tubes).astype(np.int64)
        for rows in np.split(np.arange(len(tubes)), np.flatnonzero(np.diff(batch)) + 1):
            size = replace(size, passed=(passed[0][rows], passed[1][rows]))
            ends = source[rows], receiver[rows]
            corners, piece_of = split(tubes.corners[rows], *ends, size, self.settings.max_patches)
            yield tubes.take(rows[piece_of], corners)

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
        if self.owner is not None and place == _FIRST and station.window is None:
            owner = self.owner[tubes.face[rows, -1]]
            some, points, share = spread_points(corners, start, owner)
            asked = replace(target, face=tubes.face[rows[some], -1])
            self.checked.add(owner[some], share, dark[some], (yield Points(place, points, asked)))
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

    def _in_front(self, tubes: ImageTubes, rx: Viewpoint) -> ImageTubes:
        """Return the footprints whose lit side is turned to a receiver."""
        center = middle(tubes.corners)
        normal = self.faces.triangles.normal[tubes.face[:, -1]]
        lit = np.einsum("ij,ij->i", normal, tubes.image[:, -1] - center)
        towards = np.einsum("ij,ij->i", normal, rx.pose.position - center)
        return tubes.take(np.flatnonzero(lit * towards > 0.0))

    def _turned_back(self, tubes: ImageTubes, rx: Viewpoint) -> ImageTubes:
        """Return the footprints that radiate to a receiver: see `return_angle`."""
        tubes = self._in_front(tubes, rx)
        return tubes.take(self._radiates_to(tubes, rx.pose.position))

    def _radiates_to(self, tubes: ImageTubes, receiver: Array) -> Index:
        """Return which footprints do so within `return_angle`; one receiver, or one for each [m]."""
        if self._return is None or not len(tubes):
            return np.arange(len(tubes))
        source, last = tubes.image[:, -1], tubes.face[:, -1]
        return np.flatnonzero(self._return.of_footprints(middle(tubes.corners), source, last, receiver))

    @cached_property
    def _of_plane(self) -> Index:
        return face_of_plane(self.faces.plane)

    @cached_property
    def _return(self) -> Return | None:
        angle = self.settings.return_angle
        if angle is None:
            return None
        return Return(self.rays, self.faces, self.chosen, self._stations, angle)

    @cached_property
    def _stations(self) -> Array:
        """Where the receivers stand, shape (num_receivers, 3) [m]."""
        return np.array([rx.pose.position for rx in self.receivers])

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
            target = replace(target, stations=self._stations, angle=self.settings.return_angle)
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
