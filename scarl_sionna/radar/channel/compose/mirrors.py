"""Large flat surfaces of a scene as mirrors: their planes, and the ways over them from a radar to an object."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from scarl_sionna.engine.paths.tracing import mirror_extent
from scarl_sionna.engine.rays.face_planes import face_table
from scarl_sionna.radar.channel.multipath.images import Chain, material_coefficients, spherical_basis, transfer
from scarl_sionna.radar.channel.multipath.station import Station

if TYPE_CHECKING:
    from scarl_sionna.engine.world import WorldState

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]

AT_THE_PLANE = 1e-2
"""What lies this near to a mirror's plane [m], such as a road marking, belongs to it."""
MOST_MIRRORS = 16
"""The largest so many are used: the number of pairs of ways grows with the square."""
_LIFT = 1e-4
"""Rays start this far above a mirror [m], so that they do not meet it again."""


@dataclass(frozen=True, eq=False)
class Mirror:
    """A flat region of one part.

    Attributes
    ----------
    part : int
        Row of the part table.
    normal : ndarray of float64, shape (3,)
    offset : float
        normal . x = offset [m, world].
    corners : ndarray of float64, shape (num_corners, 3)
        Of its faces [m, world].
    extent : float
        Smaller width of its convex hull [m].
    """

    part: int
    normal: Array
    offset: float
    corners: Array
    extent: float

    def height(self, points: Array) -> Array:
        """Return the signed distance of points (..., 3) from the plane [m]."""
        return points @ self.normal - self.offset

    def near(self, point: Array, margin: float) -> bool:
        """Return whether a point of the plane is within the mirror's box, `margin` [m] around it."""
        return bool(
            np.all(point >= self.corners.min(axis=0) - margin) and np.all(point <= self.corners.max(axis=0) + margin)
        )


Way = tuple[Mirror, ...]
"""Mirrors in the order from the radar; empty: straight."""


def find_mirrors(state: WorldState, instances: Sequence[int], position: Array, wavelength: float) -> list[Mirror]:
    r"""Return the flat regions of instances that are larger than the first Fresnel zone on them, the largest first.

    Parameters
    ----------
    state : WorldState
    instances : sequence of int
    position : ndarray of float64, shape (3,)
        Radar [m, world].
    wavelength : float
        [m].

    Notes
    -----
    The zone is that of a scatterer as far behind the mirror as the radar is before it, at the mirror's nearest corner:
    ``sqrt(2 wavelength d)``. Nearer scatterers have a smaller one.
    """
    faces = face_table(state)
    triangles = faces.triangles
    found: list[Mirror] = []
    chosen = np.flatnonzero(np.isin(state.world.parts.instance[faces.part], instances) & triangles.normal.any(axis=1))
    _, group = np.unique(faces.plane[chosen], return_inverse=True)
    area = np.linalg.norm(
        np.cross(
            triangles.corners[chosen, 1] - triangles.corners[chosen, 0],
            triangles.corners[chosen, 2] - triangles.corners[chosen, 0],
        ), axis=1,
    ) / 2.0  # fmt: skip
    total = np.bincount(group, area)
    distance = np.linalg.norm(triangles.corners[chosen] - position, axis=2).min(axis=1)
    nearest = np.full(len(total), np.inf)
    np.minimum.at(nearest, group, distance)
    zone = np.sqrt(2.0 * wavelength * nearest)
    seen: set[tuple[int, ...]] = set()
    for number in np.flatnonzero(total >= zone**2)[np.argsort(-total[total >= zone**2], kind="stable")]:
        rows = chosen[group == number]
        first, part = rows[0], int(faces.part[rows[0]])
        normal, offset = triangles.normal[first], float(triangles.offset[first])
        sign = 1.0 if normal[np.abs(normal).argmax()] > 0.0 else -1.0
        key = (part, *np.round(np.append(sign * normal, sign * offset), 3))  # as coarse as mirror_extent joins faces
        extent = mirror_extent(state, part, int(first - triangles.first[part]))
        if key in seen or extent < zone[number]:
            continue
        seen.add(key)
        if len(found) == MOST_MIRRORS:
            break
        found.append(Mirror(part, normal, offset, triangles.corners[rows].reshape(-1, 3), extent))
    return found


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


def may_reach(way: Way, position: Array, points: Array) -> bool:
    """Return whether the way leads from a position to one of some points over the boxes of its mirrors."""
    chain = _chain(way, len(points))
    images = chain.images(points)
    vertices, right = chain.vertices(position, images)
    return any(
        bool(ok) and all(mirror.near(vertex, 0.1 * mirror.extent) for mirror, vertex in zip(way, row, strict=True))
        for ok, row in zip(right, vertices, strict=True)
    )


@dataclass(frozen=True, eq=False)
class Leg:
    """One way from a radar to points of an object.

    Attributes
    ----------
    visible : ndarray of bool, shape (num_points,)
        Whether the mirrors are there and nothing hides the way.
    image : ndarray of float64, shape (num_points, 3)
        The points as the radar sees them [m, world].
    jones : ndarray of complex128, shape (num_points, 2, 2)
        From the radar's spherical basis to that of the image of the radar (axes `rotation`), both along the wave.
    direction : ndarray of float64, shape (num_points, 3)
        From the image of the radar to the points.
    station_velocity : ndarray of float64, shape (num_points, 3)
        Of the image of the radar, by the motion of the radar and of the mirrors [m/s, world].
    """

    visible: npt.NDArray[np.bool_]
    image: Array
    jones: Complex
    direction: Array
    station_velocity: Array


def leg(
    state: WorldState,
    way: Way,
    station: Station,
    rotation: Array,
    points: Array,
    owner: Sequence[int],
    frequency: float,
) -> Leg:
    """Return a way to points.

    Parameters
    ----------
    state : WorldState
    way : Way
        Mirrors from the radar on.
    station : Station
        The radar.
    rotation : ndarray of float64, shape (3, 3)
        Axes, as columns, of the frame of the radar's image.
    points : ndarray of float64, shape (num_points, 3)
        What the length is counted to: points of the object, or their images by its own bounces, which are seen in the
        direction in which the wave meets the object first [m, world].
    owner : sequence of int
        Instances that do not hide these points: the solver that made them has seen to that.
    frequency : float
        [Hz].
    """
    chain = _chain(way, len(points))
    images = chain.images(points)
    vertices, right = chain.vertices(station.position, images)
    travel = chain.travel(station.position, images)
    names = sorted({state.world.parts.material[mirror.part] for mirror in way})
    index = np.array([[names.index(state.world.parts.material[mirror.part]) for mirror in way]] * len(points))
    jones = transfer(
        chain,
        travel,
        spherical_basis(station.rotation, travel[:, 0]),
        spherical_basis(rotation, travel[:, -1]),
        material_coefficients(
            [state.world.materials[name] for name in names], index.reshape(len(points), len(way)), frequency
        ),
    )
    parts = np.array([[mirror.part for mirror in way]] * len(points), dtype=np.int64).reshape(len(points), len(way))
    surface = state.point_velocity(parts.ravel(), vertices.reshape(-1, 3)).reshape(vertices.shape)
    velocity = np.broadcast_to(station.velocity, points.shape).copy()
    for k, mirror in enumerate(way):
        velocity -= 2.0 * np.einsum("pi,i->p", velocity - surface[:, k], mirror.normal)[:, None] * mirror.normal
    visible = right & _open(state, way, station.position, vertices, points, owner)
    return Leg(visible, images[:, 0], jones, travel[:, -1], velocity)


def _chain(way: Way, count: int) -> Chain:
    depth = len(way)
    normal = np.array([mirror.normal for mirror in way]).reshape(1, depth, 3)
    offset = np.array([mirror.offset for mirror in way]).reshape(1, depth)
    flat = np.ones((count, depth), dtype=bool)
    return Chain(flat, ~flat, np.repeat(normal, count, axis=0), np.repeat(offset, count, axis=0))


def _open(
    state: WorldState, way: Way, start: Array, vertices: Array, points: Array, owner: Sequence[int]
) -> npt.NDArray[np.bool_]:
    """Return which ways meet each mirror where it is, with nothing in between."""
    count = len(points)
    here, seen = np.broadcast_to(start, (count, 3)).copy(), np.ones(count, dtype=bool)
    for k in range(len(way) + 1):
        end = vertices[:, k] if k < len(way) else points
        rows = np.flatnonzero(seen)
        if len(rows) == 0:
            return seen
        ahead = end[rows] - here[rows]
        distance = np.linalg.norm(ahead, axis=1)
        far = distance > _LIFT
        direction = np.where(far[:, None], ahead / np.maximum(distance, _LIFT)[:, None], [1.0, 0.0, 0.0])
        hits = state.cast(here[rows], direction)
        met = np.zeros(len(rows), dtype=bool)
        if k < len(way):
            met[hits.ray] = np.abs(way[k].height(hits.point)) < AT_THE_PLANE
            side = np.sign(way[k].height(here[rows]))
            here[rows] = vertices[rows, k] + _LIFT * side[:, None] * way[k].normal
        else:
            met[:] = True
            foreign = ~np.isin(state.world.parts.instance[hits.part], owner)
            met[hits.ray[foreign & (hits.distance < distance[hits.ray] - AT_THE_PLANE)]] = False
        seen[rows] = met & far
    return seen
