"""Boxes seen from above, for tests of scenes."""

from __future__ import annotations

import numpy as np

from scarl_sionna.core.results import ObjectState


def overlap(first: ObjectState, second: ObjectState) -> bool:
    """Return whether two upright boxes overlap in plan, by separating axes."""
    corners = []
    for box in (first, second):
        half = np.array([(1, 1), (1, -1), (-1, -1), (-1, 1)]) * box.size[:2] / 2
        corners.append(box.world_from_box.apply(np.column_stack([half, np.zeros(4)]))[:, :2])
    for box in (first, second):
        for axis in box.world_from_box.rotation[:2, :2].T:
            (a, b), (c, d) = ((p.min(), p.max()) for p in (corner @ axis for corner in corners))
            if b < c or d < a:
                return False
    return True
