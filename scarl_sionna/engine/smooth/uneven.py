"""How wrong the echo of a curved surface can be where its curvature changes much from face to face.

The vertices of a mesh say where the surface is at some points. The curvature between them is interpolated, and the more
it changes from one face to the next the less it is known.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from .creases import Edges

Array = npt.NDArray[np.float64]

PER_SQUARE = 0.5
"""Error by the square of the logarithm of the ratio of two neighbours' curvatures [dB]: median over polygons of 8 to 32
sides in ellipses up to 4 times as long as wide."""
LARGEST_RATIO = 12.0
"""Beyond which, or where the curvature changes its sign, nothing more is said."""
SLIGHT = np.radians(1.0)
"""Faces over which the surface is turned by less than this on both sides of an edge do not bend across it [rad]."""


def uneven_error(corners: Array, lift: Array, joined: Edges) -> Array:
    """Return the error of the echo of every face to be expected, shape (num_faces,) [dB].

    Parameters
    ----------
    corners, lift : ndarray of float64, shape (num_faces, 3, 3)
        Triangles, and the lifts of their edges [m].
    joined : Edges
        Over which the surface goes on.
    """
    curvature, turn = (np.empty((len(joined.bend), 2)) for _ in range(2))
    for side in range(2):
        face, corner = joined.face[:, side], joined.corner[:, side]
        own = np.stack([corners[face, (corner + k) % 3] for k in range(3)], axis=1)
        along = own[:, 1] - own[:, 0]
        normal = np.cross(along, own[:, 2] - own[:, 0])
        inward = np.cross(normal, along)
        inward /= np.linalg.norm(inward, axis=1, keepdims=True)
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        width = np.einsum("ij,ij->i", own[:, 2] - own[:, 0], inward)
        place = np.einsum("ij,ij->i", own[:, 2] - own[:, 0], along) / np.einsum("ij,ij->i", along, along)
        heights = [np.einsum("ij,ij->i", lift[face, (corner + k) % 3], normal) for k in range(3)]
        # of the barycentric coordinates along `inward`, in widths: place - 1, -place and 1
        second = heights[0] * (place - 1.0) * -place - heights[1] * place + heights[2] * (place - 1.0)
        curvature[:, side] = -8.0 * second / width**2
        turn[:, side] = np.abs(curvature[:, side]) * width
    size = np.abs(curvature)
    ratio = size.max(axis=1) / np.maximum(size.min(axis=1), size.max(axis=1) / LARGEST_RATIO + 1e-300)
    ratio = np.where(curvature.prod(axis=1) < 0.0, LARGEST_RATIO, ratio)
    ratio = np.where((turn > SLIGHT).any(axis=1), np.maximum(ratio, 1.0), 1.0)
    error = np.zeros(len(corners))
    np.maximum.at(error, joined.face, (PER_SQUARE * np.log(ratio) ** 2)[:, None])
    return error
