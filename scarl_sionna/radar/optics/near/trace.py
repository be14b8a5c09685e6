"""Which patches of a scene the transmitter lights and the receiver sees: directly, and behind mirror reflections of ray tubes.

A tube is a triangle on a face with the image of the transmitter from which its rays seem to come. Its reflection is cast onward
from the image of that image; the footprint where it lands is the central projection of the triangle, exact in float64.
Tubes are cut where the thing that they meet changes (:func:`~.sbr_refine.refine`).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.pose import Pose
from scarl_sionna.core.settings.sbr import SbrChannelSettings
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.engine.rays.face_planes import FaceTable
from scarl_sionna.engine.rays.face_rays import MISS, FaceRays

from .patches import PatchSize, split, too_many_patches
from .rays import PlaneProbe, ScreenedProbe
from .refine import Pieces, Probe, refine
from .tubes import Tubes, middle

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]
Mask = npt.NDArray[np.bool_]

GRAZING = 1e-6
"""Cosine of incidence below which a face is not lit."""
ONE_PROBE = 0.02
"""Tubes that a face meets at less than this cosine are not cut along edges: their field is 34 dB down, and float32 rays do
not tell a face just behind a silhouette from one just before it."""
_COARSE = 16.0
"""Faces are first cut into pieces so many times as long as patches, so that a batch of them is no more than some patches."""
WIDE_FACE = 0.5
"""Faces that look wider than this [rad] are never sorted out before they are cut into patches."""


@dataclass(frozen=True, eq=False)
class Station:
    """A transmitter or receiver: where it stands, how it moves and what it looks at.

    Attributes
    ----------
    pose : Pose
        world_from_radar.
    velocity : ndarray of float64, shape (3,)
        [m/s, world].
    azimuth_fov, elevation_fov : float
        [rad].
    """

    pose: Pose
    velocity: Array
    azimuth_fov: float
    elevation_fov: float

    @classmethod
    def of(cls, radar: RadarSpec, pose: Pose, velocity: Array) -> Station:
        """Return the station of a radar."""
        return cls(pose, velocity, np.radians(radar.azimuth_fov_deg), np.radians(radar.elevation_fov_deg))

    def outside(self, points: Array) -> tuple[Array, Array, Array]:
        """Return by how much points are outside of the field of view in azimuth and elevation [rad], and their distance."""
        local = (points - self.pose.position) @ self.pose.rotation
        distance = np.sqrt(np.einsum("ij,ij->i", local, local))
        azimuth = np.abs(np.arctan2(local[:, 1], local[:, 0])) - self.azimuth_fov / 2.0
        sine = np.divide(local[:, 2], distance, out=np.zeros_like(distance), where=distance > 0.0)
        elevation = np.abs(np.arcsin(np.clip(sine, -1.0, 1.0))) - self.elevation_fov / 2.0
        return azimuth, elevation, distance

    def sees(self, points: Array) -> Mask:
        """Return whether points are in the field of view."""
        local = (points - self.pose.position) @ self.pose.rotation
        flat = local[:, 0] ** 2 + local[:, 1] ** 2
        ahead = local[:, 0] >= np.cos(self.azimuth_fov / 2.0) * np.sqrt(flat)
        return ahead & (np.abs(local[:, 2]) <= np.sin(self.elevation_fov / 2.0) * np.sqrt(flat + local[:, 2] ** 2))

    def may_see(self, faces: FaceTable, reach: float) -> Mask:
        """Return the faces of which a part may be in the field of view and in reach, and that are not edge-on."""
        triangles = faces.triangles
        center = middle(triangles.corners)
        arm = triangles.corners - center[:, None]
        radius = np.sqrt(np.einsum("nij,nij->ni", arm, arm).max(axis=1))
        azimuth, elevation, distance = self.outside(center)
        width = np.arcsin(np.minimum(radius / np.maximum(distance, 1e-9), 1.0))
        cosine = np.cos(np.minimum(elevation + self.elevation_fov / 2.0, 1.4))
        inside = (azimuth <= width / cosine) & (elevation <= width) | (width > WIDE_FACE)
        height = np.abs(triangles.normal @ self.pose.position - triangles.offset)
        return inside & (distance - radius < reach) & (height > GRAZING * distance) & triangles.normal.any(axis=1)


@dataclass(frozen=True, eq=False)
class Tracer:
    """Rays of one transmitter and receiver in one state of the world.

    Attributes
    ----------
    rays : FaceRays
    faces : FaceTable
    chosen : ndarray of bool, shape (num_faces,)
        Faces that scatter; the others are obstacles at which a tube ends.
    tx, rx : Station
        The same object for a monostatic radar.
    reach : float
        Tubes longer than twice this are dropped [m].
    size : PatchSize
    settings : SbrChannelSettings
    count : Counter
        Tubes traced so far, by bounce.
    """

    rays: FaceRays
    faces: FaceTable
    chosen: Mask
    tx: Station
    rx: Station
    reach: float
    size: PatchSize
    settings: SbrChannelSettings
    count: Counter[int] = field(default_factory=Counter)

    def bounces(self, face: Index) -> Iterator[Tubes]:
        """Yield the footprints that the receiver sees, bounce after bounce, of tubes that start on some faces."""
        planes, plane_face = np.unique(self.faces.plane, return_index=True)
        of_plane = np.zeros(int(planes.max(initial=0)) + 1, dtype=np.int64)
        of_plane[planes] = plane_face
        plane_of_face = np.where(self.chosen, self.faces.plane, MISS)
        per_batch = self.settings.tubes_per_batch
        for first in self._starts(face):
            stack = first.batches(per_batch)
            while stack:
                tubes = stack.pop()
                self.count[tubes.depth] += len(tubes)
                if tubes.depth == 1:
                    tubes = self._seen(tubes, self.tx)
                    yield tubes if self.rx is self.tx else self._seen(self._watched(self._in_front(tubes)), self.rx)
                else:
                    yield self._seen(self._watched(self._cut(self._in_front(tubes))), self.rx)
                if tubes.depth < self.settings.max_depth and len(tubes):
                    stack += self._next(tubes, of_plane, plane_of_face).batches(per_batch)

    def _starts(self, face: Index) -> Iterator[Tubes]:
        """Yield the patches of faces that are in the transmitter's view, some batch of them at a time."""
        source, receiver, limit = self.tx.pose.position, self.rx.pose.position, self.settings.max_patches
        size = self._start_size(face)
        corners = self.faces.triangles.corners[face]
        coarse, rows = split(corners, source[None], receiver, size, limit, _COARSE, one_source=True)
        pieces = size.pieces(coarse, source, receiver)
        if pieces.sum() > 1.5 * limit:  # the count is an estimate; split() itself counts too
            too_many_patches(limit)
        batch = (np.cumsum(pieces) / self.settings.tubes_per_batch).astype(np.int64)
        first = np.searchsorted(rows, rows)  # the first coarse piece of the same face
        for part in np.split(np.arange(len(rows)), np.flatnonzero(np.diff(batch)) + 1):
            fine, piece_of = split(coarse[part], source[None], receiver, size, limit, one_source=True)
            number = np.arange(len(piece_of)) - np.searchsorted(piece_of, piece_of)
            whole = part[piece_of]
            kept = np.flatnonzero(self.tx.sees(middle(fine)))
            whole, number, fine = whole[kept], number[kept], fine[kept]
            origin = (whole - first[whole]) * (1 << 32) + number
            start = np.broadcast_to(source, (len(whole), 1, 3))
            yield Tubes(fine, face[rows[whole], None], start, origin)

    def _start_size(self, face: Index) -> PatchSize:
        """Return the size of the first tubes, so that there are about `num_tubes` of them if that is asked for."""
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

    def _cut(self, tubes: Tubes) -> Tubes:
        """Return footprints cut into patches that are small enough."""
        limit = self.settings.max_patches
        corners, rows = split(tubes.corners, tubes.image[:, -1], self.rx.pose.position, self.size, limit)
        return tubes.take(rows, corners)

    def _watched(self, tubes: Tubes) -> Tubes:
        return tubes.take(np.flatnonzero(self.rx.sees(middle(tubes.corners))))

    def _labelled(self, tubes: Tubes, source: Array, probe: Probe) -> Pieces:
        """Return pieces of footprints, each with what its rays meet."""
        rows = np.arange(len(tubes))
        ray = middle(tubes.corners) - source
        distance = np.sqrt(np.einsum("ij,ij->i", ray, ray))
        cosine = np.einsum("ij,ij->i", self.faces.triangles.normal[tubes.face[:, -1]], ray) / distance
        length = np.where(np.abs(cosine) < ONE_PROBE, np.inf, self.size.length(distance))
        return refine(
            tubes.corners, rows, probe, self.settings.probe_spacing * length, self.settings.edge_spacing * length
        )

    def _seen(self, tubes: Tubes, station: Station) -> Tubes:
        """Return the parts of footprints from which a station can be seen."""
        if not len(tubes):
            return tubes
        probe = ScreenedProbe(self.rays, station.pose.position)
        corners, rows, dark = self._labelled(tubes, station.pose.position, probe)
        lit = dark == 0
        return tubes.take(rows[lit], corners[lit])

    def _in_front(self, tubes: Tubes) -> Tubes:
        """Return the footprints whose lit side is turned to the receiver."""
        center = middle(tubes.corners)
        normal = self.faces.triangles.normal[tubes.face[:, -1]]
        lit = np.einsum("ij,ij->i", normal, tubes.image[:, -1] - center)
        towards = np.einsum("ij,ij->i", normal, self.rx.pose.position - center)
        return tubes.take(np.flatnonzero(lit * towards > 0.0))

    def _next(self, tubes: Tubes, of_plane: Index, plane_of_face: Index) -> Tubes:
        """Return the footprints of the reflected tubes on what they meet next."""
        triangles = self.faces.triangles
        last = tubes.face[:, -1]
        normal, offset = triangles.normal[last], triangles.offset[last]
        height = np.einsum("ij,ij->i", normal, tubes.image[:, -1]) - offset
        image = tubes.image[:, -1] - 2.0 * height[:, None] * normal
        lift = normal * np.sign(height)[:, None]
        probe = PlaneProbe(self.rays, plane_of_face, image, lift, self.faces.plane[last])
        if tubes.depth + 1 == self.settings.max_depth:
            probe.only_towards(self.rx.pose.position, triangles.normal, triangles.offset)
        corners, rows, plane = self._labelled(tubes, image, probe)
        met = plane != MISS
        return self._landed(tubes, image, corners[met], rows[met], of_plane[plane[met]])

    def _landed(self, tubes: Tubes, image: Array, corners: Array, rows: Index, face: Index) -> Tubes:
        """Return tubes projected from their images onto the planes of faces."""
        normal, offset = self.faces.triangles.normal[face], self.faces.triangles.offset[face]
        source = image[rows]
        ray = corners - source[:, None]
        slope = np.einsum("nij,nj->ni", ray, normal)
        height = offset - np.einsum("ij,ij->i", normal, source)
        with np.errstate(divide="ignore", invalid="ignore"):
            share = height[:, None] / slope
            length = np.sqrt(np.einsum("nij,nij->ni", ray, ray))
            ahead = (share >= 1.0 - 1e-6) & (length * share < 2.0 * self.reach) & (np.abs(slope) > GRAZING * length)
        kept = ahead.all(axis=1)
        landed = source[kept, None] + share[kept, :, None] * ray[kept]
        chain = np.concatenate([tubes.face[rows[kept]], face[kept, None]], axis=1)
        images = np.concatenate([tubes.image[rows[kept]], source[kept, None]], axis=1)
        return Tubes(landed, chain, images, tubes.origin[rows[kept]])
