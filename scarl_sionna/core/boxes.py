"""Boxes: their corners, where rays enter and leave them, and the rectangle before a camera that holds them."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.arrays.rows import row_max, row_min

Array = npt.NDArray[np.float64]

CORNERS = np.array([(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
"""Of a box with sides of 1 about the origin, shape (8, 3)."""
NEAR = 0.05
"""What is nearer than this to a camera's plane is out of its sight [m]."""
WIDEST = 4.0
"""Tangent of the widest angle off a camera's axis that counts: 76 deg."""


def through_box(start: Array, directions: Array, lower: Array, upper: Array) -> tuple[Array, Array]:
    """Return where rays enter and leave a box, in multiples of their directions, shapes (...).

    `enter` > `leave`: they miss it.

    Parameters
    ----------
    start, directions : ndarray of float64, shape (..., 3)
        In the box's frame [m].
    lower, upper : ndarray of float64, shape (3,)
        Its corners [m].
    """
    safe = np.where(np.abs(directions) < 1e-12, 1e-12, directions)
    first, second = (lower - start) / safe, (upper - start) / safe
    return row_max(np.minimum(first, second)), row_min(np.maximum(first, second))


def rectangle(optical: Array) -> tuple[Array, Array] | None:
    """Return the bounds x / z, y / z (2,) of a box with the corners (8, 3) [m, camera_optical].

    None if all is behind the camera.

    A box that reaches behind the camera has no bounds: the widest that count are returned.
    """
    if optical[:, 2].max() < NEAR:
        return None
    if optical[:, 2].min() < NEAR:
        return np.full(2, -WIDEST), np.full(2, WIDEST)
    plane = np.clip(optical[:, :2] / optical[:, 2:], -WIDEST, WIDEST)
    return plane.min(axis=0), plane.max(axis=0)


def rays_over(low: Array, high: Array, count: tuple[int, int]) -> Array:
    """Return rays with z = 1 [camera_optical] through the cells of a grid over a rectangle, shape (num_x, num_y, 3)."""
    x, y = (a + (b - a) * (np.arange(n) + 0.5) / n for a, b, n in zip(low, high, count, strict=True))
    return np.stack([*np.meshgrid(x, y, indexing="ij"), np.ones(count)], axis=-1)
