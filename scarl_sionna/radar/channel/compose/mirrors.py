"""Large flat surfaces of a scene as mirrors: their planes, and the ways over them from a radar to an object."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.arrays.rows import row_all, row_any, row_cross, row_min, row_norm
from scarl_sionna.core.settings.mirrors import DEFAULT_MIRRORS, MirrorSettings
from scarl_sionna.engine.paths.tracing import mirror_extent
from scarl_sionna.engine.rays.face_planes import FaceTable, face_table
from scarl_sionna.radar.channel.multipath.images import Chain

if TYPE_CHECKING:
    from scarl_sionna.engine.world import WorldState

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]

_WIDE_BOX = 1.5
"""Boxes that reach farther from their middle [m] are looked at more closely: decides the time, no accuracy."""
_COMPARED = 1 << 18
"""Planes and points that are compared in one piece: bounds the memory, changes no result."""
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
    planes = _Planes.of(state, instances, position)
    faces, chosen, group, corners = planes.table, planes.face, planes.group, planes.corners
    triangles = faces.triangles
    found: list[Mirror] = []
    zone = np.sqrt(2.0 * wavelength * planes.nearest)
    taken, of_part = np.zeros(len(chosen), dtype=np.bool_), faces.part[chosen]
    large = planes.area >= zone**2
    named = np.isin(np.arange(len(zone)), group[np.isin(chosen, more)])
    by_size = np.argsort(-planes.area, kind="stable")
    by_size = by_size[large[by_size]]
    for number in [*by_size, *by_size[named[by_size]]]:
        if len(found) >= knobs.max_mirrors and not named[number]:
            continue
        if taken[member := group == number].all():
            continue
        first = chosen[member][0]
        part, normal, offset = int(faces.part[first]), triangles.normal[first], float(triangles.offset[first])
        extent = mirror_extent(state, part, int(first - triangles.first[part]))
        if extent < zone[number]:
            continue
        near = np.flatnonzero(~taken & (of_part == part))
        flat = row_all(np.abs(corners[near] @ normal - offset) < knobs.flatness)
        taken[near[flat]] = True
        rows = chosen[near[flat]]
        found.append(Mirror(len(found), part, rows, normal, offset, triangles.corners[rows].reshape(-1, 3), extent))
    return found


def faces_towards(
    state: WorldState, instances: Sequence[int], position: Array, boxes: Sequence[Array], tail: float = 0.0
) -> Index:
    """Return a face of each plane of some instances over which a way may lead into some boxes, the largest first.

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

    Returns
    -------
    ndarray of int64, shape (num_planes,)
        Rows of the table of faces.
    """
    planes = _Planes.of(state, instances, position)
    if not boxes or not len(planes.area):
        return planes.first[:0]
    found = np.zeros(len(planes.area), dtype=np.bool_)
    centers = np.array([(box.min(axis=0) + box.max(axis=0)) / 2.0 for box in boxes])
    reach = np.array([np.linalg.norm(np.ptp(box, axis=0)) / 2.0 for box in boxes])
    wide = np.flatnonzero(reach > _WIDE_BOX).tolist()  # by their middle and corners, with half of the reach
    reach[wide] /= 2.0
    points = np.concatenate([centers, *(boxes[number] for number in wide)])
    radius = np.concatenate([reach, *(np.full(len(boxes[number]), reach[number]) for number in wide)])
    own = planes.normal @ position - planes.offset
    step = max(_COMPARED // len(points), 1)
    for some in (slice(first, first + step) for first in range(0, len(found), step)):
        normal, before = planes.normal[some], own[some, None]
        behind = normal @ points.T - planes.offset[some, None]
        before, behind = np.abs(before), np.maximum(behind * np.sign(before), 0.0)
        flat = points - behind[..., None] * (normal * np.sign(own[some, None]))[:, None]
        foot = position - own[some, None, None] * normal[:, None]
        share = before / np.maximum(before + behind, 1e-9)
        at = foot + share[..., None] * (flat - foot)
        there, back = row_norm(at - position), row_norm(points - at)
        unit = np.sqrt(there * back / (2.0 * np.maximum(there + back, 1e-9))) * there / np.maximum(before, 1e-9)
        lower, upper = planes.lower[some, None], planes.upper[some, None]
        margin = (np.maximum(PRESELECTION_MARGIN * row_norm(upper - lower), tail * unit) + radius)[..., None]
        found[some] = row_any(row_all((at >= lower - margin) & (at <= upper + margin)))
    order = np.argsort(-planes.area, kind="stable")
    return planes.first[order[found[order]]]


@dataclass(frozen=True, eq=False)
class _Planes:
    """The faces of some instances by their planes.

    `face`, `group` and `corners` have a row for each face, the rest one for each plane: its first face, area [m2],
    distance from the radar [m], normal, offset, and box [m].
    """

    table: FaceTable
    face: Index
    group: Index
    corners: Array
    first: Index
    area: Array
    nearest: Array
    normal: Array
    offset: Array
    lower: Array
    upper: Array

    @classmethod
    def of(cls, state: WorldState, instances: Sequence[int], position: Array) -> _Planes:
        table = face_table(state)
        triangles = table.triangles
        face = np.flatnonzero(np.isin(state.world.parts.instance, instances)[table.part])
        face = face[row_any(triangles.normal[face])]
        _, start, group = np.unique(table.plane[face], return_index=True, return_inverse=True)
        corners = triangles.corners[face]
        area = row_norm(row_cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])) / 2.0
        nearest, lower, upper = (np.full((len(start), *shape), np.inf) for shape in ((), (3,), (3,)))
        np.minimum.at(nearest, group, row_min(row_norm(corners - position)))
        np.minimum.at(lower, group, corners.min(axis=1))
        np.minimum.at(upper, group, -corners.max(axis=1))
        first = face[start]
        plane = triangles.normal[first], triangles.offset[first]
        total = np.bincount(group, area).astype(np.float64)
        return cls(table, face, group, corners, first, total, nearest, *plane, lower, -upper)


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
