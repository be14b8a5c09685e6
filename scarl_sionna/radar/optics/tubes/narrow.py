"""Where narrow bodies stand in the way of ray tubes, so that no tube is probed too coarsely to see them.

The probes of a tube stand as far apart as its patch allows, and farther apart where the tube has spread after a
reflection. A post or a sign between them would be missed, the mirror image of a post in a wall for instance. A tube
that may meet a body is probed as finely as the body is wide, as seen from where the tube's rays come from.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scarl_sionna.engine.device import Device
from scarl_sionna.engine.rays.face_planes import FaceTable
from scarl_sionna.engine.types import DeviceArray

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]

SHARE = 0.7
"""Distance of probes as a part of a body's width: a square of this side has one at least, however it is turned."""
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
        centers, radii, widths = on.reals(self.center), on.reals(self.radius), on.reals(self.width)
        count = dr.opaque(mi.UInt32, len(self.center))
        limit = on.Real(np.ascontiguousarray(wide))

        def step(number: DeviceArray, found: DeviceArray) -> tuple[DeviceArray, DeviceArray]:
            radius = dr.gather(on.Real, radii, number)
            way = dr.gather(on.Vector, centers, number) - start
            away, ahead = dr.norm(way), dr.dot(way, axis)
            beside = dr.sqrt(dr.maximum(away * away - ahead * ahead, 0.0))
            meets = (ahead > -radius) & (beside <= radius + reach / distance * away)
            meets &= away + radius > distance - reach  # the tube begins at its footprint
            wanted = SHARE * dr.gather(on.Real, widths, number) * distance / dr.maximum(away, 1e-9)
            return number + 1, dr.select(meets, dr.minimum(found, wanted), found)

        state = (dr.zeros(mi.UInt32, len(corners)), limit)
        _, found = dr.while_loop(state, lambda number, found: number < count, step, label="bodies near tubes")
        return np.asarray(found.numpy(), dtype=np.float64)
