"""Where narrow bodies stand in the way of ray tubes, so that no tube is probed too coarsely to see them.

The probes of a tube stand as far apart as its patch allows, and farther apart where the tube has spread after a
reflection. A post or a sign between them would be missed: the mirror image of a post in a wall, or the shadow of a
locking bar on a lorry's door. A tube that may meet a body is probed as finely as the body is wide, as seen from where
the tube's rays come from. A body is what hangs together in a mesh: a bar of a frame, whatever else the frame has.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from scarl_sionna.core.pose import Pose
from scarl_sionna.engine.device import Device
from scarl_sionna.engine.smooth.creases import connected_faces
from scarl_sionna.engine.threads import many_threads
from scarl_sionna.engine.types import DeviceArray

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]

SHARE = 0.7
"""Distance of probes as a part of a body's width: a square of this side has one at least, however it is turned."""
SLACK = 1.001
"""A ball around others is farther out than its radius by this factor at most: a guard against rounding."""
MOST_PIECES = 128
"""A long body is a chain of so many balls at most; a longer one is seen by tubes side by side."""
LEAST_GAP = 0.1
"""Narrower gaps, as parts of the bodies beside them, are not looked for: no 10 dB of what is behind shows through."""
NEAREST = 24
"""Pieces among which that of the next body is sought: a body's own are twice its width apart, rails' are between."""
TOUCHING = 1e-3
"""Bodies nearer than this part of their width touch, as a paling its rail: no gap is between them anywhere."""
MOST_BODIES = 4096
"""A mesh of more bodies, leaves for instance, counts as one."""


@dataclass(frozen=True, eq=False)
class NarrowBodies:
    """Balls that cover bodies, and balls around those, each before what it holds.

    So a ball that a tube does not meet is passed with all in it.

    Attributes
    ----------
    center : ndarray of float64, shape (num_balls, 3)
        [m].
    radius : ndarray of float64, shape (num_balls,)
        [m].
    width : ndarray of float64, shape (num_balls,)
        The middle one of the body's three extents, of a ball around others the least of what is in it [m].
    behind : ndarray of int64, shape (num_balls,)
        The ball after all that one holds; of one that covers a body, the next one.
    """

    center: Array
    radius: Array
    width: Array
    behind: Index

    @classmethod
    def of_mesh(cls, corners: Array) -> NarrowBodies:
        """Return the balls of the bodies of a mesh, whose triangles (num_faces, 3, 3) are in any frame [m]."""
        label = connected_faces(corners)
        if label.max(initial=-1) >= MOST_BODIES:
            label = np.zeros_like(label)
        pieces = _Pieces.of_boxes(*_boxes(corners, label))
        width = np.minimum(pieces.width, _gaps(pieces))
        one = np.ones(len(width), dtype=np.int64)
        return _tree(cls(pieces.middle, np.linalg.norm(pieces.size, axis=1) / 2.0, width, one), one)

    @classmethod
    def of_parts(cls, parts: Sequence[tuple[NarrowBodies, Pose]]) -> NarrowBodies:
        """Return the balls of meshes at their poses, `world_from_mesh`."""
        placed = [cls(pose.apply(part.center), part.radius, part.width, part.behind) for part, pose in parts]
        columns = zip(*(vars(part).values() for part in (_NOTHING, *placed)), strict=True)
        sizes = np.array([len(part.radius) for part in placed], dtype=np.int64)
        return _tree(cls(*map(np.concatenate, columns)), sizes[sizes > 0])

    def spacing(self, on: Device, corners: Array, source: Array, span: tuple[Array, Array], is_way_in: bool) -> Array:
        """Return the largest distance of the probes of tubes, so fine that each body that a tube may meet is probed.

        Parameters
        ----------
        on : Device
        corners : ndarray of float64, shape (n, 3, 3)
            Footprints [m].
        source : ndarray of float64, shape (n, 3) or (3,)
            Where the rays come from [m].
        span : tuple of ndarray of float64, each of shape (n,)
            Largest distance without bodies, and that below which nothing finer is looked for [m].
        is_way_in : bool
            Bodies between the source and the footprint, else those that the rays meet behind it: a reflected tube
            comes from an image behind its footprint.

        Returns
        -------
        ndarray of float64, shape (n,)
        """
        wide, least = span
        if not len(self.center) or not len(corners):
            return wide
        dr, mi = on.dr, on.mi
        corner = on.corners(corners)
        center = (corner[0] + corner[1] + corner[2]) / 3.0
        reach = dr.maximum(
            dr.norm(corner[0] - center), dr.maximum(dr.norm(corner[1] - center), dr.norm(corner[2] - center))
        )
        start = on.vector(source) if source.ndim == 1 else on.vectors(source)
        axis = center - start
        distance = dr.norm(axis)
        axis /= distance
        side = dr.normalize(dr.cross(corner[1] - corner[0], corner[2] - corner[0]))
        side = dr.select((dr.dot(side, axis) < 0.0) == is_way_in, side, -side)  # on which the rays run
        centers, radii, widths = on.reals(self.center), on.reals(self.radius), on.reals(self.width)
        behind = on.index(self.behind)
        count = dr.opaque(mi.UInt32, len(self.behind))
        limit, enough = on.reals(wide), on.reals(least)

        def step(number: DeviceArray, found: DeviceArray) -> tuple[DeviceArray, DeviceArray]:
            radius, beyond = dr.gather(on.Real, radii, number), dr.gather(mi.UInt32, behind, number)
            is_ball = beyond == number + 1
            around = dr.select(is_ball, 0.0, SLACK * radius)
            place = dr.gather(on.Vector, centers, number)
            way = place - start
            away, ahead = dr.norm(way), dr.dot(way, axis)
            beside = dr.sqrt(dr.maximum(away * away - ahead * ahead, 0.0))
            meets = (ahead > -radius) & (beside <= radius + reach / distance * (away + around))
            if is_way_in:
                meets &= away - radius < distance + reach
            else:
                meets &= away + radius > distance - reach
            meets &= dr.dot(place - center, side) > -radius
            wanted = SHARE * dr.gather(on.Real, widths, number) * distance / dr.maximum(away + around, 1e-9)
            meets &= wanted < found
            return dr.select(is_ball | meets, number + 1, beyond), dr.select(is_ball & meets, wanted, found)

        state = (dr.zeros(mi.UInt32, len(corners)), limit)
        _, found = dr.while_loop(
            state, lambda number, found: (number < count) & (found > enough), step, label="bodies near tubes"
        )
        with many_threads(len(corners)):
            return np.asarray(found.numpy(), dtype=np.float64)


_NOTHING = NarrowBodies(np.zeros((0, 3)), np.zeros(0), np.zeros(0), np.zeros(0, dtype=np.int64))


def _tree(leaves: NarrowBodies, sizes: Index) -> NarrowBodies:
    """Return one tree of some, of so many balls each: halves along the longest side of the box of their centres.

    The nodes of one depth are made at once, each a run of `order`.
    """
    head = np.cumsum(sizes) - sizes
    count = len(leaves.radius) + max(len(sizes) - 1, 0)
    center, radius, width = np.empty((count, 3)), np.empty(count), np.empty(count)
    behind, place = np.empty(count, dtype=np.int64), np.empty(len(sizes), dtype=np.int64)
    order = np.arange(len(sizes))
    begin, number, at = np.zeros(1, dtype=np.int64), np.array([len(sizes)]), np.zeros(1, dtype=np.int64)
    while len(begin):
        place[order[begin[number == 1]]] = at[number == 1]
        begin, number, at = begin[number > 1], number[number > 1], at[number > 1]
        if not len(begin):
            break
        node, first = np.repeat(np.arange(len(number)), number), np.cumsum(number) - number
        run = np.arange(len(node)) + (begin - first)[node]
        root = head[order[run]]
        places = leaves.center[root]
        low, high = np.minimum.reduceat(places, first), np.maximum.reduceat(places, first)
        center[at] = (low + high) / 2.0
        away = np.sqrt(((places - center[at][node]) ** 2).sum(axis=1)) + leaves.radius[root]
        radius[at] = SLACK * np.maximum.reduceat(away, first)
        width[at] = np.minimum.reduceat(leaves.width[root], first)
        along = places[np.arange(len(node)), (high - low).argmax(axis=1)[node]]
        order[run] = order[run][np.lexsort((along, node))]
        held = np.concatenate([[0], np.cumsum(sizes[order[run]])])
        behind[at] = at + number - 1 + held[first + number] - held[first]
        half = number // 2
        middle = at + half + held[first + half] - held[first]
        begin, number, at = (
            np.concatenate(pair) for pair in ((begin, begin + half), (half, number - half), (at + 1, middle))
        )
    row = np.arange(len(leaves.radius)) + np.repeat(place - head, sizes)
    center[row], radius[row], width[row] = leaves.center, leaves.radius, leaves.width
    behind[row] = leaves.behind + np.repeat(place, sizes)
    return NarrowBodies(center, radius, width, behind)


def _boxes(corners: Array, label: Index) -> tuple[Array, Array, Array]:
    """Return boxes of bodies: middle (n, 3), sides (n, 3) and their directions (n, 3, 3), as rows.

    Of the boxes along the frame, along the principal axes of the corners and along the body's largest triangle, as the
    sides of a square post are, the one whose sides are least in sum.
    """
    points, owner = corners.reshape(-1, 3), np.repeat(label, 3)
    order = np.argsort(owner, kind="stable")
    points, owner = points[order], owner[order]
    first = np.flatnonzero(np.diff(owner, prepend=-1))
    number = np.diff(first, append=len(owner))[:, None]
    mean = np.add.reduceat(points, first) / number
    away = points - mean[owner]
    spread = np.add.reduceat(away[:, :, None] * away[:, None, :], first)
    frames = [np.broadcast_to(np.eye(3), spread.shape), np.swapaxes(np.linalg.eigh(spread)[1], 1, 2)]
    frames.append(_along_faces(corners, label))
    found = []
    for axes in frames:
        local = np.einsum("nij,nj->ni", axes[owner], away)
        low, high = np.minimum.reduceat(local, first), np.maximum.reduceat(local, first)
        middle = mean + np.einsum("ni,nij->nj", 0.5 * (low + high), axes)
        found.append((middle, high - low, axes))
    total = np.stack([size.sum(axis=1) for _, size, _ in found])
    total[0] *= 0.999
    best, row = total.argmin(axis=0), np.arange(len(mean))
    middle, size, axes = (np.stack(some)[best, row] for some in zip(*found, strict=True))
    return middle, size, axes


def _along_faces(corners: Array, label: Index) -> Array:
    """Return axes of bodies along the shortest side and the normal of their largest triangle, as rows (n, 3, 3)."""
    side = np.roll(corners, -1, axis=1) - corners
    normal = np.cross(side[:, 0], side[:, 1])
    area = np.linalg.norm(normal, axis=1)
    order = np.lexsort((area, label))
    face = order[np.flatnonzero(np.diff(label[order], append=-1))]
    least = side[face, np.linalg.norm(side[face], axis=2).argmin(axis=1)]
    size = np.linalg.norm(least, axis=1)
    flat = (area[face] > 0.0) & (size > 0.0)
    first, second = least[flat] / size[flat, None], normal[face[flat]] / area[face[flat], None]
    axes = np.broadcast_to(np.eye(3), (len(face), 3, 3)).copy()
    axes[flat] = np.stack([first, second, np.cross(first, second)], axis=1)
    return axes


class _Pieces(NamedTuple):
    """Boxes of bodies cut across, so that each piece fits a ball: numbers of the boxes, middles, sides, directions."""

    body: Index
    middle: Array
    size: Array
    axes: Array
    width: Array
    """Of the whole box [m]."""

    @classmethod
    def of_boxes(cls, middle: Array, size: Array, axes: Array) -> _Pieces:
        """Return the pieces of boxes."""
        extents = np.sort(size, axis=1)
        count = np.ceil(extents[:, 2] / np.maximum(2.0 * extents[:, 1], 1e-9)).astype(np.int64)
        kept = np.flatnonzero((count <= MOST_PIECES) & (extents[:, 1] > 0.0))
        body = np.repeat(kept, count[kept])
        number = np.arange(len(body)) - np.searchsorted(body, body)
        along, row = size[body].argmax(axis=1), np.arange(len(body))
        share = (number + 0.5) / count[body] - 0.5
        piece = size[body]
        center = middle[body] + (share * piece[row, along])[:, None] * axes[body, along]
        piece[row, along] /= count[body]
        return cls(body, center, piece, axes[body], extents[body, 1])

    def apart(self, one: Index, other: Index) -> Array:
        """Return how far pieces are from boxes, along their own axes, around other pieces [m]."""
        axes = self.axes[one]
        away = np.abs(np.einsum("nij,nj->ni", axes, self.middle[other] - self.middle[one]))
        around = np.einsum("nij,nj->ni", np.abs(axes @ np.swapaxes(self.axes[other], 1, 2)), self.size[other])
        return np.asarray(np.linalg.norm(np.maximum(away - (self.size[one] + around) / 2.0, 0.0), axis=1))


def _gaps(pieces: _Pieces) -> Array:
    """Return the gap between each piece and the nearest of another body, shape (num_pieces,) [m].

    Infinite where there is none. Bodies that touch have none between them, and a body has none to one that comes nearer
    to it than `LEAST_GAP` of its width, through which hardly anything is seen.
    """
    body, width = pieces.body, pieces.width
    if not len(body) or body[0] == body[-1]:
        return np.full(len(body), np.inf)
    _, other = cKDTree(pieces.middle).query(pieces.middle, min(NEAREST, len(body)))
    gap, pair, back = np.full(other.shape, np.inf), np.full(other.shape, -1), np.full(other.shape, -1)
    for number, near in enumerate(other.T):
        one = np.flatnonzero(body[near] != body)
        near = near[one]
        gap[one, number] = np.maximum(pieces.apart(one, near), pieces.apart(near, one))
        pair[one, number], back[one, number] = (
            first * (body[-1] + 1) + second for first, second in ((body[one], body[near]), (body[near], body[one]))
        )
    touches = gap < TOUCHING * width[:, None]
    close = np.concatenate([pair[gap < LEAST_GAP * width[:, None]], back[touches]])
    gap[np.isin(pair, np.unique(close))] = np.inf
    return np.asarray(gap.min(axis=1))
