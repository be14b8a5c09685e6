"""Large flat surfaces of a scene as mirrors: their planes, and the ways over them from a radar to an object."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.arrays.rows import row_all, row_any, row_cross, row_dots, row_min, row_norm
from scarl_sionna.core.settings.mirrors import DEFAULT_MIRRORS, MirrorSettings
from scarl_sionna.engine.paths.tracing import mirror_extent
from scarl_sionna.engine.rays.face_planes import FaceTable, face_table
from scarl_sionna.engine.rays.geometry import Triangles
from scarl_sionna.radar.channel.multipath.images import Chain

if TYPE_CHECKING:
    from scarl_sionna.engine.world import World, WorldState

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]

_WIDE_BOX = 1.5
"""Boxes that reach farther from their middle [m] are looked at more closely: decides the time, no accuracy."""
_COMPARED = 1 << 18
"""Planes and points that are compared in one piece: bounds the memory, changes no result."""
_ROUNDING = 1e-9
"""Of areas, relative."""
PRESELECTION_MARGIN = 0.1
"""Mirrors' boxes are widened by this part of their extent where ways are sorted out before they are traced: decides no
accuracy."""
FLAT_SHARE = 0.9
"""Of the area of a part: what has less of it in flat mirrors has structure, which its class stands for; not charted."""


@dataclass(frozen=True, eq=False)
class Mirror:
    """A flat region of one part.

    Attributes
    ----------
    number : int
        Its place among the mirrors of the solve: no other lies in the same plane of the same part.
    part : int
        Row of the part table.
    faces : ndarray of int64, shape (num_faces,)
        Its triangles, rows of the table of faces.
    normal : ndarray of float64, shape (3,)
    offset : float
        normal . x = offset [m, world].
    corners : ndarray of float64, shape (3 num_faces, 3)
        Of its triangles [m, world].
    extent : float
        Smaller width of its convex hull [m].
    """

    number: int
    part: int
    faces: npt.NDArray[np.int64]
    normal: Array
    offset: float
    corners: Array
    extent: float

    def height(self, points: Array) -> Array:
        """Return the signed distance of points (..., 3) from the plane [m]."""
        return points @ self.normal - self.offset

    def triangle_at(self, point: Array) -> int:
        """Return which triangle a point of the plane (3,) is on, or nearest to: a row of the table of faces."""
        edge = np.roll(triangles := self.corners.reshape(-1, 3, 3), -1, axis=1) - triangles
        inward = np.cross(np.cross(edge[:, :1], -edge[:, 2:]), edge)
        inward /= np.maximum(np.linalg.norm(inward, axis=2, keepdims=True), 1e-300)
        return int(self.faces[np.einsum("tki,tki->tk", inward, point - triangles).min(axis=1).argmax()])

    def near(self, point: Array, margin: float) -> bool:
        """Return whether a point of the plane is within the mirror's box, `margin` [m] around it."""
        return bool(
            np.all(point >= self.corners.min(axis=0) - margin) and np.all(point <= self.corners.max(axis=0) + margin)
        )


Way = tuple[Mirror, ...]
"""Mirrors in the order from the radar; empty: straight."""


def find_mirrors(
    state: WorldState,
    instances: Sequence[int],
    position: Array,
    wavelength: float,
    knobs: MirrorSettings = DEFAULT_MIRRORS,
    more: Sequence[int] | Index = (),
) -> list[Mirror]:
    r"""Return the flat regions of instances that are larger than the first Fresnel zone on them, the largest first.

    Parameters
    ----------
    state : WorldState
    instances : sequence of int
    position : ndarray of float64, shape (3,)
        Radar [m, world].
    wavelength : float
        [m].
    knobs : MirrorSettings
        Its `max_mirrors` is how many are found beside those of `more`.
    more : sequence of int
        Faces, rows of the table of faces: the regions that hold one of them are found, too, behind the others.

    Notes
    -----
    The zone is that of a scatterer as far behind the mirror as the radar is before it, at the mirror's nearest corner:
    ``sqrt(2 wavelength d)``. Nearer scatterers have a smaller one.
    """
    table, (planes, rows) = face_table(state), _Planes.of(state, instances)
    triangles = table.triangles
    found: list[Mirror] = []
    taken = ~row_any(triangles.normal)  # faces without area are no part of any
    large, zone = planes.larger_than_zone(rows, triangles, position, wavelength)
    named = np.isin(planes.number[large], table.plane[np.asarray(more, dtype=np.int64)])
    for row in [*range(len(large)), *np.flatnonzero(named).tolist()]:
        if len(found) >= knobs.max_mirrors and not named[row]:
            continue
        if taken[planes.faces(large[row])].all():
            continue
        first = int(planes.first[large[row]])
        part, normal, offset = int(table.part[first]), triangles.normal[first], float(triangles.offset[first])
        extent = mirror_extent(state, part, int(first - triangles.first[part]))
        if extent < zone[row]:
            continue
        near = np.arange(triangles.first[part], triangles.first[part + 1])
        near = near[~taken[near]]
        own = near[row_all(np.abs(triangles.corners[near] @ normal - offset) < knobs.flatness)]
        taken[own] = True
        found.append(Mirror(len(found), part, own, normal, offset, triangles.corners[own].reshape(-1, 3), extent))
    return found


def faces_towards(
    state: WorldState,
    instances: Sequence[int],
    position: Array,
    boxes: Sequence[Array],
    tail: float,
    most: int,
) -> Index:
    """Return a face of each of the largest planes of instances over which a way may lead into boxes, the largest first.

    Parameters
    ----------
    state : WorldState
    instances : sequence of int
    position : ndarray of float64, shape (3,)
        Radar [m, world].
    boxes : sequence of ndarray of float64, shape (num_points, 3)
        Points of each, its corners among them [m, world].
    tail : float
        That of :func:`beyond_ends`.
    most : int
        No more are returned.

    Returns
    -------
    ndarray of int64, shape (num_planes,)
        Rows of the table of faces.
    """
    planes, rows = _Planes.of(state, instances)
    found: list[Index] = [planes.first[:0]]
    if not boxes:
        return found[0]
    centers = np.array([(box.min(axis=0) + box.max(axis=0)) / 2.0 for box in boxes])
    reach = np.array([np.linalg.norm(np.ptp(box, axis=0)) / 2.0 for box in boxes])
    wide = np.flatnonzero(reach > _WIDE_BOX).tolist()  # by their middle and corners, with half of the reach
    reach[wide] /= 2.0
    points = np.concatenate([centers, *(boxes[number] for number in wide)])
    radius = np.concatenate([reach, *(np.full(len(boxes[number]), reach[number]) for number in wide)])
    step = max(_COMPARED // len(points), 1)
    for some in (rows[first : first + step] for first in range(0, len(rows), step)):
        found.append(planes.first[some[planes.take(some).lead(position, points, radius, tail)]])
        if sum(len(faces) for faces in found) >= most:
            break
    return np.concatenate(found)[:most]


@dataclass(frozen=True, eq=False)
class _Planes:
    """Planes of faces: a row each, the largest first.

    Attributes
    ----------
    number : ndarray of int64, shape (num_planes,)
        In the table of faces.
    first, part : ndarray of int64, shape (num_planes,)
        First face of each, and its part.
    area : ndarray of float64, shape (num_planes,)
        [m2].
    normal, offset : ndarray of float64, shape (num_planes, 3) and (num_planes,)
        Of the first face, normal . x = offset [m, world].
    lower, upper : ndarray of float64, shape (num_planes, 3)
        Corners of the box [m, world].
    start, count : ndarray of int64, shape (num_planes,)
        Where the faces of each begin in `face`, and how many there are.
    face : ndarray of int64, shape (num_faces,)
        Faces, those of one plane one after the other.
    """

    number: Index
    first: Index
    part: Index
    area: Array
    normal: Array
    offset: Array
    lower: Array
    upper: Array
    start: Index
    count: Index
    face: Index

    @classmethod
    def of(cls, state: WorldState, instances: Sequence[int]) -> tuple[_Planes, Index]:
        """Return planes, found once for a world of all that stands still, and which of them are those of instances."""
        parts, table = state.world.parts, face_table(state)
        asked = np.isin(parts.instance, instances)
        if (parts.actor[asked] >= 0).any():
            found = cls._of_faces(table, np.flatnonzero(asked[table.part]))
        else:
            if state.world not in _standing:
                _standing[state.world] = cls._of_faces(table, np.flatnonzero((parts.actor < 0)[table.part]))
            found = _standing[state.world]
        return found, np.flatnonzero(asked[found.part])

    @classmethod
    def _of_faces(cls, table: FaceTable, face: Index) -> _Planes:
        triangles = table.triangles
        face = face[row_any(triangles.normal[face])]
        face = face[np.argsort(table.plane[face], kind="stable")]
        number, start, count = np.unique(table.plane[face], return_index=True, return_counts=True)
        corners, first = triangles.corners[face], face[start]
        area = row_norm(row_cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])) / 2.0
        total = np.bincount(np.repeat(np.arange(len(start)), count), area, len(start)).astype(np.float64)
        lower = upper = np.zeros((0, 3))
        if len(start):
            lower = np.minimum.reduceat(corners.min(axis=1), start)
            upper = np.maximum.reduceat(corners.max(axis=1), start)
        plane = triangles.normal[first], triangles.offset[first]
        found = cls(number, first, table.part[first], total, *plane, lower, upper, start, count, face)
        return found.take(np.argsort(-total, kind="stable"))

    def take(self, rows: Index) -> _Planes:
        """Return some of the planes."""
        taken: dict[str, Any] = {name: column[rows] for name, column in vars(self).items() if name != "face"}
        return _Planes(**taken, face=self.face)

    def faces(self, row: int) -> Index:
        """Return the faces of a plane."""
        return self.face[self.start[row] : self.start[row] + self.count[row]]

    def larger_than_zone(
        self, rows: Index, triangles: Triangles, position: Array, wavelength: float
    ) -> tuple[Index, Array]:
        """Return which of some planes are larger than the first Fresnel zone on them, and its width [m]."""
        square = np.zeros(len(self.area))
        for k in range(3):  # planes are nowhere nearer than their boxes
            out = np.maximum(self.lower[:, k] - position[k], position[k] - self.upper[:, k])
            square += np.maximum(out, 0.0, out=out) ** 2
        may = self.area >= (1.0 - _ROUNDING) * 2.0 * wavelength * np.sqrt(square)
        rows = rows[may[rows]]
        if not len(rows):
            return rows, np.zeros(0)
        count = self.count[rows]
        start = np.cumsum(count) - count
        face = self.face[np.arange(count.sum()) + np.repeat(self.start[rows] - start, count)]
        distance = row_min(row_norm(triangles.corners[face] - position))
        zone = np.sqrt(2.0 * wavelength * np.minimum.reduceat(distance, start))
        large = self.area[rows] >= zone**2
        return rows[large], zone[large]

    def lead(self, position: Array, points: Array, radius: Array, tail: float) -> Flags:
        """Return over which planes, by their boxes, a way may lead from a position into a ball; `tail` as above."""
        own = (self.normal @ position - self.offset)[:, None]
        behind = row_dots(self.normal, points) - self.offset[:, None]
        before, behind = np.abs(own), np.maximum(behind * np.sign(own), 0.0)
        flat = points - behind[..., None] * (self.normal * np.sign(own))[:, None]
        foot = position - own[..., None] * self.normal[:, None]
        share = before / np.maximum(before + behind, 1e-9)
        at = foot + share[..., None] * (flat - foot)
        there, back = row_norm(at - position), row_norm(points - at)
        unit = np.sqrt(there * back / (2.0 * np.maximum(there + back, 1e-9))) * there / np.maximum(before, 1e-9)
        lower, upper = self.lower[:, None], self.upper[:, None]
        margin = (np.maximum(PRESELECTION_MARGIN * row_norm(upper - lower), tail * unit) + radius)[..., None]
        return row_any(row_all((at >= lower - margin) & (at <= upper + margin)))


_standing: WeakKeyDictionary[World, _Planes] = WeakKeyDictionary()
"""Planes of all that stands still."""


def flat_parts(state: WorldState, mirrors: Sequence[Mirror], position: Array) -> list[int]:
    """Return the parts that are little else than flat mirrors where they face a point, by their areas.

    Parameters
    ----------
    state : WorldState
    mirrors : sequence of Mirror
    position : ndarray of float64, shape (3,)
        World [m].
    """
    faces = face_table(state)
    triangles, parts = faces.triangles, sorted({mirror.part for mirror in mirrors})
    rows = np.flatnonzero(np.isin(faces.part, parts))
    corners = triangles.corners[rows]
    across = row_cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    facing = np.where(np.einsum("ij,ij->i", across, position - corners[:, 0]) > 0.0, row_norm(across), 0.0)
    is_flat = np.isin(rows, np.concatenate([mirror.faces for mirror in mirrors]))
    flat, whole = (np.bincount(faces.part[rows], area, max(parts) + 1) for area in (facing * is_flat, facing))
    return [part for part in parts if flat[part] >= FLAT_SHARE * whole[part]]


def ways(mirrors: Sequence[Mirror], depth: int) -> Iterator[Way]:
    """Yield every sequence of up to `depth` mirrors without the same one twice in a row, the straight way first."""
    level: list[Way] = [()]
    for _ in range(depth + 1):
        yield from level
        level = [(*way, mirror) for way in level for mirror in mirrors if not way or way[-1] is not mirror]


def mirrored(way: Way, point: Array) -> Array:
    """Return the image of the radar, at `point`, that an object behind the way's mirrors sees [m]."""
    for mirror in way:
        point = point - 2.0 * mirror.height(point) * mirror.normal
    return point


def reaches(way: Way, position: Array, points: Array, tail: float = 0.0) -> npt.NDArray[np.bool_]:
    """Return for points (n, 3) whether the way leads from a position to them over the boxes of its mirrors.

    `tail` is that of :func:`beyond_ends`.
    """
    return reaches_over([way], position, points, tail)[0]


def reaches_over(ways: Sequence[Way], position: Array, points: Array, tail: float = 0.0) -> npt.NDArray[np.bool_]:
    """Return :func:`reaches` of at least one way, all over as many mirrors, shape (num_ways, num_points)."""
    count, depth = len(points), len(ways[0])
    chain, points = chain_of(ways, count), np.tile(points, (len(ways), 1))
    images = chain.images(points)
    vertices, right = chain.vertices(position, images)
    found = np.asarray(right).reshape(len(ways), count).copy()
    beyond = beyond_ends(chain, position, vertices, points, tail if depth == 1 else 0.0)
    vertices, beyond = vertices.reshape(len(ways), count, depth, 3), beyond.reshape(len(ways), count, depth)
    for number, way in enumerate(ways):
        for k, mirror in enumerate(way):
            margin = np.maximum(PRESELECTION_MARGIN * mirror.extent, beyond[number, :, k, None])
            lower, upper = mirror.corners.min(axis=0), mirror.corners.max(axis=0)
            at = vertices[number, :, k]
            found[number] &= row_all((at >= lower - margin) & (at <= upper + margin))
    return found


def beyond_ends(chain: Chain, start: Array, vertices: Array, end: Array, tail: float) -> Array:
    """Return how far beyond mirrors' ends reflections may be, shape (num_paths, max_depth) [m].

    Parameters
    ----------
    chain : Chain
        Of mirrors only.
    start : ndarray of float64, shape (3,)
    vertices : ndarray of float64, shape (num_paths, max_depth, 3)
        Where paths are reflected [m].
    end : ndarray of float64, shape (3,) or (num_paths, 3)
    tail : float
        Reach in Fresnel units times the root of the wavelength [m^(1/2)]; 0: not at all.
    """
    if not tail:
        return np.zeros(vertices.shape[:2])
    shape = (len(vertices), 3)
    first, last = (np.broadcast_to(point, shape)[:, None] for point in (start, end))
    stops = np.concatenate([first, vertices, last], axis=1)
    step = np.diff(stops, axis=1)
    length = np.maximum(row_norm(step), 1e-9)
    gone = np.cumsum(length, axis=1)
    left = np.maximum(gone[:, -1:] - gone[:, :-1], 1e-9)
    height = np.abs(np.einsum("pki,pki->pk", step[:, :-1], chain.normal))
    unit = np.sqrt(gone[:, :-1] * left / (2.0 * gone[:, -1:])) * length[:, :-1] / np.maximum(height, 1e-9)
    return np.asarray(tail * unit)


def chain_of(ways: Sequence[Way], count: int) -> Chain:
    """Return the chains of reflections of ways over as many mirrors, each of them `count` times."""
    depth = len(ways[0])
    normal = np.array([[mirror.normal for mirror in way] for way in ways]).reshape(len(ways), depth, 3)
    offset = np.array([[mirror.offset for mirror in way] for way in ways]).reshape(len(ways), depth)
    flat = np.ones((len(ways) * count, depth), dtype=bool)
    return Chain(flat, ~flat, np.repeat(normal, count, axis=0), np.repeat(offset, count, axis=0))
