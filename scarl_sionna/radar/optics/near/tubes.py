"""Footprints of ray tubes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]


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
        The transmitter and its images behind all faces but the last: where the rays come from on their way to each face [m].
    origin : ndarray of int64, shape (num_tubes,)
        Number on its first face of the patch from which a tube comes, the same for all pieces into which it is cut later.
    """

    corners: Array
    face: Index
    image: Array
    origin: Index

    def __len__(self) -> int:
        return len(self.face)

    @property
    def depth(self) -> int:
        """Number of bounces, that at the footprint included."""
        return self.face.shape[1]

    def take(self, rows: Index, corners: Array | None = None) -> Tubes:
        """Return some tubes, or pieces of them."""
        corners = self.corners[rows] if corners is None else corners
        return Tubes(corners, self.face[rows], self.image[rows], self.origin[rows])

    def batches(self, size: int) -> list[Tubes]:
        """Return them in batches."""
        parts = (slice(i, i + size) for i in range(0, len(self), size))
        return [Tubes(self.corners[part], self.face[part], self.image[part], self.origin[part]) for part in parts]


def middle(corners: Array) -> Array:
    """Return the centroids of triangles; faster than a mean."""
    return (corners[:, 0] + corners[:, 1] + corners[:, 2]) / 3.0
