"""Which patches of a scene the radar lights: directly, and behind mirror reflections of its ray tubes.

A tube is a triangle on a face with the image of the radar from which its rays seem to come. Its reflection is cast onward from
the image of that image; the footprint where it lands is the central projection of the triangle, exact in float64. Tubes are
cut where the thing that they meet changes (:func:`scarl_sionna.radar.sbr.tubes.refine`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scarl_sionna.radar.sbr.tubes import refine
from scarl_sionna.world.face_tracing import MISS, FaceTable, first_faces

from .sbr_patches import PatchSize, split
from .sbr_settings import SbrChannelSettings

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]

GRAZING = 1e-6
"""Cosine of incidence below which a face is not lit."""
LIFT = 4e-7
"""A ray starts this far above its face, relative to the largest coordinate: some float32 steps of it."""
ONE_PROBE = 0.02
"""Tubes that a face meets at less than this cosine are not cut along edges: their field is 34 dB down, and float32 rays do
not tell a face just behind a silhouette from one just before it."""
SMALLEST_LIFT = 1e-6
"""[m]."""
SAME_DISTANCE = 1e-5
"""What is met this near to a point (relative to 1 m + distance) is the point itself: float32 directions are 6e-8 off, which a
face at grazing incidence makes larger."""
PROBES_PER_BATCH = 1_000_000
"""Rays of :func:`refine` worked at once."""


@dataclass(frozen=True, eq=False)
class Tubes:
    """Footprints of ray tubes.

    Attributes
    ----------
    corners : ndarray of float64, shape (num_tubes, 3, 3)
        [m, world].
    face : ndarray of int64, shape (num_tubes, depth)
        Faces in the order in which they are met; the footprint is on the last one.
    image : ndarray of float64, shape (num_tubes, depth, 3)
        The radar and its images behind all faces but the last: where the rays come from on their way to each face [m].
    """

    corners: Array
    face: Index
    image: Array

    def __len__(self) -> int:
        return len(self.face)

    @property
    def depth(self) -> int:
        """Number of bounces, that at the footprint included."""
        return self.face.shape[1]

    def take(self, rows: Index, corners: Array) -> Tubes:
        """Return pieces of some tubes."""
        return Tubes(corners, self.face[rows], self.image[rows])


@dataclass(frozen=True, eq=False)
class Tracer:
    """Rays of one radar in one state of the world.

    Attributes
    ----------
    state : WorldState
    faces : FaceTable
    plane_face : ndarray of int64, shape (num_planes,)
        One face of each plane.
    chosen : ndarray of bool, shape (num_faces,)
        Faces that scatter; the others are obstacles at which a tube ends.
    origin : ndarray of float64, shape (3,)
        The radar [m, world].
    reach : float
        Tubes longer than twice this are dropped [m].
    size : PatchSize
    settings : SbrChannelSettings
    in_view : callable
        Whether points (n, 3) are in the field of view.
    """

    state: object
    faces: FaceTable
    plane_face: Index
    chosen: npt.NDArray[np.bool_]
    origin: Array
    reach: float
    size: PatchSize
    settings: SbrChannelSettings
    in_view: Callable[[Array], npt.NDArray[np.bool_]]

    def bounces(self, face: Index) -> Iterator[Tubes]:
        """Yield the footprints that the radar sees, bounce after bounce, of tubes that start on some faces."""
        triangles = self.faces.triangles
        for first in range(0, len(face), self.settings.tubes_per_batch):
            some = face[first : first + self.settings.tubes_per_batch]
            start = np.broadcast_to(self.origin, (len(some), 1, 3))
            patches = self.cut(Tubes(triangles.corners[some], some[:, None], start))
            stack = self._batches(patches)
            while stack:
                tubes = stack.pop()
                if tubes.depth == 1:
                    tubes = self.seen(tubes)
                    yield tubes
                else:
                    yield self.seen(self.cut(self._in_front(tubes)))
                if tubes.depth < self.settings.max_depth and len(tubes):
                    stack += self._batches(self._next(tubes))

    def _batches(self, tubes: Tubes) -> list[Tubes]:
        step = self.settings.tubes_per_batch
        rows = (np.arange(i, min(i + step, len(tubes))) for i in range(0, len(tubes), step))
        return [tubes.take(part, tubes.corners[part]) for part in rows]

    def cut(self, tubes: Tubes) -> Tubes:
        """Return footprints cut into patches that are small enough and of which the centre is in view."""
        limit = self.settings.max_patches
        corners, rows = split(tubes.corners, np.arange(len(tubes)), tubes.image[:, -1], self.origin, self.size, limit)
        kept = self.in_view(corners.mean(axis=1))
        return tubes.take(rows[kept], corners[kept])

    def _spacings(self, tubes: Tubes, source: Array) -> tuple[Array, Array]:
        """Return the distance of probes and the size down to which tubes are halved; one probe for grazing ones."""
        ray = tubes.corners.mean(axis=1) - source
        distance = np.linalg.norm(ray, axis=1)
        cosine = np.einsum("ij,ij->i", self.faces.triangles.normal[tubes.face[:, -1]], ray) / distance
        length = np.where(np.abs(cosine) < ONE_PROBE, np.inf, self.size.length(distance))
        return self.settings.probe_spacing * length, self.settings.edge_spacing * length

    def seen(self, tubes: Tubes) -> Tubes:
        """Return the parts of footprints from which the radar can be seen."""
        last = tubes.face[:, -1]

        def hidden(points: Array, rows: Index) -> Index:
            ray = points - self.origin
            distance = np.linalg.norm(ray, axis=1)
            met, ahead = first_faces(self.state, self.origin, ray / distance[:, None])  # type: ignore[arg-type]
            near = ahead >= distance - SAME_DISTANCE * (1.0 + distance)
            return ((met != last[rows]) & (met != MISS) & ~near).astype(np.int64)

        if not len(tubes):
            return tubes
        parts = refine(
            tubes.corners, np.arange(len(tubes)), hidden, *self._spacings(tubes, self.origin), PROBES_PER_BATCH
        )
        pieces = [(corners[dark == 0], rows[dark == 0]) for corners, rows, dark in parts]
        corners, rows = (np.concatenate([piece[i] for piece in pieces]) for i in range(2))
        return tubes.take(rows.astype(np.int64), corners)

    def _in_front(self, tubes: Tubes) -> Tubes:
        """Return the footprints whose lit side is turned to the radar."""
        center = tubes.corners.mean(axis=1)
        normal = self.faces.triangles.normal[tubes.face[:, -1]]
        lit = np.einsum("ij,ij->i", normal, tubes.image[:, -1] - center)
        towards = np.einsum("ij,ij->i", normal, self.origin - center)
        rows = np.flatnonzero(lit * towards > 0.0)
        return tubes.take(rows, tubes.corners[rows])

    def _next(self, tubes: Tubes) -> Tubes:
        """Return the footprints of the reflected tubes on what they meet next."""
        triangles = self.faces.triangles
        last = tubes.face[:, -1]
        normal, offset = triangles.normal[last], triangles.offset[last]
        height = np.einsum("ij,ij->i", normal, tubes.image[:, -1]) - offset
        image = tubes.image[:, -1] - 2.0 * height[:, None] * normal
        lit_normal = normal * np.sign(height)[:, None]
        own = self.faces.plane[last]

        def plane_met(points: Array, rows: Index) -> Index:
            ray = points - image[rows]
            ray /= np.linalg.norm(ray, axis=1, keepdims=True)
            lift = np.maximum(LIFT * np.abs(points).max(axis=1), SMALLEST_LIFT)
            face, _ = first_faces(self.state, points + lift[:, None] * lit_normal[rows], ray)  # type: ignore[arg-type]
            plane = np.where(face == MISS, MISS, self.faces.plane[face])
            return np.where(self.chosen[face] & (plane != own[rows]), plane, MISS)

        found = []
        parts = refine(tubes.corners, np.arange(len(tubes)), plane_met, *self._spacings(tubes, image), PROBES_PER_BATCH)
        for corners, rows, plane in parts:
            met = plane != MISS
            found.append(self._landed(tubes, image, corners[met], rows[met], self.plane_face[plane[met]]))
        columns = [np.concatenate([getattr(part, name) for part in found]) for name in ("corners", "face", "image")]
        return Tubes(*columns)

    def _landed(self, tubes: Tubes, image: Array, corners: Array, rows: Index, face: Index) -> Tubes:
        """Return tubes projected from their images onto the planes of faces."""
        normal, offset = self.faces.triangles.normal[face], self.faces.triangles.offset[face]
        source = image[rows]
        ray = corners - source[:, None]
        slope = np.einsum("nij,nj->ni", ray, normal)
        height = offset - np.einsum("ij,ij->i", normal, source)
        with np.errstate(divide="ignore", invalid="ignore"):
            share = height[:, None] / slope
        far = np.linalg.norm(ray, axis=2) * share
        ahead = (
            (share >= 1.0 - 1e-6) & (far < 2.0 * self.reach) & (np.abs(slope) > GRAZING * np.linalg.norm(ray, axis=2))
        )
        kept = ahead.all(axis=1)
        landed = source[kept, None] + share[kept, :, None] * ray[kept]
        chain = np.concatenate([tubes.face[rows[kept]], face[kept, None]], axis=1)
        images = np.concatenate([tubes.image[rows[kept]], source[kept, None]], axis=1)
        return Tubes(landed, chain, images)
