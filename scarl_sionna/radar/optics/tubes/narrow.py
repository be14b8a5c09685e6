"""Where narrow bodies stand in the way of ray tubes, so that no tube is probed too coarsely to see them.

The probes of a tube stand as far apart as its patch allows, and farther apart where the tube has spread after a
reflection. A post or a sign between them would be missed, the mirror image of a post in a wall for instance. A tube
that may meet a body is probed as finely as the body is wide, as seen from where the tube's rays come from.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from scarl_sionna.engine.device import Device
from scarl_sionna.engine.rays.face_planes import FaceTable
from scarl_sionna.engine.threads import many_threads
from scarl_sionna.engine.types import DeviceArray

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]

SHARE = 0.7
"""Distance of probes as a part of a body's width: a square of this side has one at least, however it is turned."""
SLACK = 1.001
"""A ball around others is farther out than its radius by this factor at most: a guard against rounding."""
MOST_PIECES = 32
"""A long body is a chain of so many balls at most; a longer one is seen by tubes side by side."""


@dataclass(frozen=True, eq=False)
class NarrowBodies:
    """Balls that cover bodies.

    Attributes
    ----------
    center : ndarray of float64, shape (num_balls, 3)
        [m, world].
    radius, width : ndarray of float64, shape (num_balls,)
        Of a ball, and the middle one of its body's three extents [m].
    """

    center: Array
    radius: Array
    width: Array

    @classmethod
    def of(cls, faces: FaceTable, chosen: npt.NDArray[np.bool_]) -> NarrowBodies:
        """Return the balls of the parts that have chosen faces, `chosen` (num_faces,)."""
        rows = np.flatnonzero(chosen)
        part, corners = faces.part[rows], faces.triangles.corners[rows]
        order = np.argsort(part, kind="stable")
        first = np.flatnonzero(np.diff(part[order], prepend=-1)) if len(order) else order
        if not len(first):
            return cls(np.zeros((0, 3)), np.zeros(0), np.zeros(0))
        low = np.minimum.reduceat(corners.min(axis=1)[order], first)
        high = np.maximum.reduceat(corners.max(axis=1)[order], first)
        size = high - low
        extents = np.sort(size, axis=1)
        count = np.ceil(extents[:, 2] / np.maximum(2.0 * extents[:, 1], 1e-9)).astype(np.int64)
        kept = np.flatnonzero((count <= MOST_PIECES) & (extents[:, 1] > 0.0))
        of_piece = np.repeat(kept, count[kept])
        number = np.arange(len(of_piece)) - np.searchsorted(of_piece, of_piece)
        along = size[of_piece].argmax(axis=1)
        share = np.full((len(of_piece), 3), 0.5)
        share[np.arange(len(of_piece)), along] = (number + 0.5) / count[of_piece]
        piece = size[of_piece]
        piece[np.arange(len(of_piece)), along] /= count[of_piece]
        return cls(low[of_piece] + share * size[of_piece], np.linalg.norm(piece, axis=1) / 2.0, extents[of_piece, 1])

    @cached_property
    def _tree(self) -> _Tree:
        return _Tree.of(self)

    def spacing(self, on: Device, corners: Array, source: Array, wide: Array) -> Array:
        """Return the largest distance of the probes of tubes, so fine that each body that a tube may meet is probed.

        Parameters
        ----------
        on : Device
        corners : ndarray of float64, shape (n, 3, 3)
            Footprints [m].
        source : ndarray of float64, shape (n, 3) or (3,)
            Where the rays come from [m].
        wide : ndarray of float64, shape (n,)
            Largest distance without bodies [m].

        Returns
        -------
        ndarray of float64, shape (n,)
        """
        if not len(self.center) or not len(corners):
            return wide
        dr, mi, tree = on.dr, on.mi, self._tree
        corner = on.corners(corners)
        center = (corner[0] + corner[1] + corner[2]) / 3.0
        reach = dr.maximum(
            dr.norm(corner[0] - center), dr.maximum(dr.norm(corner[1] - center), dr.norm(corner[2] - center))
        )
        start = on.vector(source) if source.ndim == 1 else on.vectors(source)
        axis = center - start
        distance = dr.norm(axis)
        axis /= distance
        centers, radii, widths = on.reals(tree.center), on.reals(tree.radius), on.reals(tree.width)
        behind = on.index(tree.behind)
        count = dr.opaque(mi.UInt32, len(tree.behind))
        limit = on.reals(wide)

        def step(number: DeviceArray, found: DeviceArray) -> tuple[DeviceArray, DeviceArray]:
            radius, beyond = dr.gather(on.Real, radii, number), dr.gather(mi.UInt32, behind, number)
            is_ball = beyond == number + 1
            around = dr.select(is_ball, 0.0, SLACK * radius)
            way = dr.gather(on.Vector, centers, number) - start
            away, ahead = dr.norm(way), dr.dot(way, axis)
            beside = dr.sqrt(dr.maximum(away * away - ahead * ahead, 0.0))
            meets = (ahead > -radius) & (beside <= radius + reach / distance * (away + around))
            meets &= away + radius > distance - reach  # the tube begins at its footprint
            wanted = SHARE * dr.gather(on.Real, widths, number) * distance / dr.maximum(away + around, 1e-9)
            meets &= wanted < found
            return dr.select(is_ball | meets, number + 1, beyond), dr.select(is_ball & meets, wanted, found)

        state = (dr.zeros(mi.UInt32, len(corners)), limit)
        _, found = dr.while_loop(state, lambda number, found: number < count, step, label="bodies near tubes")
        with many_threads(len(corners)):
            return np.asarray(found.numpy(), dtype=np.float64)


@dataclass(frozen=True, eq=False)
class _Tree:
    """Balls around balls, each before what it holds, so that one that a tube does not meet is passed with all in it.

    Attributes
    ----------
    center, radius : ndarray of float64, shape (num_nodes, 3) and (num_nodes,)
        [m, world].
    width : ndarray of float64, shape (num_nodes,)
        The least of the bodies in it [m].
    behind : ndarray of uint32, shape (num_nodes,)
        The node after all that one holds; of a single ball, the next one.
    """

    center: Array
    radius: Array
    width: Array
    behind: npt.NDArray[np.uint32]

    @classmethod
    def of(cls, balls: NarrowBodies) -> _Tree:
        """Return the tree of at least one ball: halves along the longest side of the box of the centres."""
        center: list[Array] = []
        radius: list[float] = []
        width: list[float] = []
        behind: list[int] = []

        def add(rows: Index) -> None:
            number, places = len(behind), balls.center[rows]
            low, high = places.min(axis=0), places.max(axis=0)
            middle = (low + high) / 2.0
            center.append(middle)
            radius.append(float((np.linalg.norm(places - middle, axis=1) + balls.radius[rows]).max()))
            width.append(float(balls.width[rows].min()))
            behind.append(number + 1)
            if len(rows) > 1:
                radius[-1] *= SLACK
                order = rows[np.argsort(places[:, (high - low).argmax()], kind="stable")]
                add(order[: len(rows) // 2])
                add(order[len(rows) // 2 :])
                behind[number] = len(behind)

        add(np.arange(len(balls.center)))
        return cls(np.array(center), np.array(radius), np.array(width), np.array(behind, dtype=np.uint32))
