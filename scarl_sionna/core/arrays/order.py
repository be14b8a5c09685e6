"""The order of long arrays."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

_CELL, _CELL_BITS = 0.25, 12
"""Points are sorted by cells of this size [m], a kilometre of them."""


def side_by_side(points: npt.NDArray[np.float64]) -> npt.NDArray[np.int64]:
    """Return an order of points (n, 3) [m] in which those that follow each other are near each other.

    Of cells whose numbers have their bits interleaved.
    """
    cell = np.floor((points - points.min(axis=0, initial=np.inf)) / _CELL).astype(np.int64)
    key = np.zeros(len(points), dtype=np.int64)
    for bit in range(_CELL_BITS):
        for axis in range(3):
            key |= ((cell[:, axis] >> bit) & 1) << (3 * bit + axis)
    return np.argsort(key, kind="stable")
