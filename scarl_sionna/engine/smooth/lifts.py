"""How far the middles of faces' edges stand off the curved surface behind them.

The vertices of a mesh are taken to lie on the surface, and its normals there to be known (:mod:`.creases`). The middle
of an edge is lifted onto the arc that its ends ask for: exact on a sphere and on a circular cylinder. Both faces at an
edge have the same lift, so the surface has no cracks.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from .creases import joined_vertices

Array = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]

SAME_NORMAL = 1e-6
"""Normals this near to each other are those of one surface."""
LEAST_CROSS = 0.5
"""Sine of the angle between the surfaces on both sides of an edge from which their line of intersection is sure."""
LEAST_ALONG = 0.8
"""Cosine between that line at an end of an edge, and the edge, below which they do not belong together."""
LEAST_LIFT = 1e-9
"""Lifts below this part of an edge are rounding, and none."""


def edge_lifts(corners: Array, normal: Array, curved: Mask) -> Array:
    """Return from the middle of every edge the vector onto the surface, shape (num_faces, 3, 3) [m].

    Parameters
    ----------
    corners, normal : ndarray of float64, shape (num_faces, 3, 3)
        Triangles of one part [m] and unit normals of the surface at their corners. Edge i runs from corner i to i + 1.
    curved : ndarray of bool, shape (num_faces,)
        Faces that are not flat.
    """
    vertex = joined_vertices(corners)
    start, stop = vertex.ravel(), np.roll(vertex, -1, axis=1).ravel()
    key = np.minimum(start, stop) * (int(vertex.max()) + 1) + np.maximum(start, stop)
    _, first, edge, count = np.unique(key, return_index=True, return_inverse=True, return_counts=True)
    edge = edge.reshape(-1)
    order = np.argsort(edge, kind="stable")
    other = first.copy()  # the edge on its second side
    two = count == 2
    other[two] = order[np.cumsum(count)[two] - 1]
    point, end = corners.reshape(-1, 3), np.roll(corners, -1, axis=1).reshape(-1, 3)
    at_start, at_end = normal.reshape(-1, 3), np.roll(normal, -1, axis=1).reshape(-1, 3)
    turned = (start[first] != start[other])[:, None]  # the second side runs the other way
    own = at_start[first], at_end[first]
    beside = np.where(turned, at_end[other], at_start[other]), np.where(turned, at_start[other], at_end[other])
    chord = end[first] - point[first]
    lift = _on_one_surface(chord, *own)
    apart = np.maximum(*(np.abs(a - b).max(axis=1) for a, b in zip(own, beside, strict=True))) > SAME_NORMAL
    lift[apart] = _between_two(*(a[apart] for a in (chord, *own, *beside)))
    lift[apart & ~(curved[first // 3] | curved[other // 3])] = 0.0
    slight = np.einsum("ij,ij->i", lift, lift) < LEAST_LIFT**2 * np.einsum("ij,ij->i", chord, chord)
    lift[slight | (count > 2)] = 0.0
    return np.asarray(lift[edge].reshape(-1, 3, 3))


def _on_one_surface(chord: Array, first: Array, second: Array) -> Array:
    r"""Return the lift of an edge's middle, with normals at its ends.

    Notes
    -----
    .. math:: d = \frac{w_1 + w_2}{4 (1 + \cos\theta)}, \quad w_1 = -c \cdot n_1, \quad w_2 = c \cdot n_2

    along the mean normal, with the chord c and the angle 2 theta between the normals: exact on a circle of radius a,
    where w = 2 a sin^2(theta) and d = a (1 - cos(theta)), on a sphere, and across a circular cylinder in any direction.
    """
    total = first + second
    length = np.linalg.norm(total, axis=1)  # 2 cos(theta)
    height = np.einsum("ij,ij->i", chord, second - first) / (4.0 + 2.0 * length)
    return np.asarray(total * np.divide(height, length, out=np.zeros_like(height), where=length > 0.0)[:, None])


def _between_two(chord: Array, first: Array, second: Array, beside_first: Array, beside_second: Array) -> Array:
    """Return the lift of an edge in which two surfaces meet: an arc along their intersection, if that is sure."""
    length = np.linalg.norm(chord, axis=1)
    ends, sure = [], np.ones(len(chord), dtype=np.bool_)
    for one, two in ((first, beside_first), (second, beside_second)):
        tangent = np.cross(one, two)
        sine = np.linalg.norm(tangent, axis=1)
        sure &= sine > LEAST_CROSS
        along = np.einsum("ij,ij->i", tangent, chord)
        sure &= np.abs(along) > LEAST_ALONG * sine * length
        tangent *= np.sign(along)[:, None]
        ends.append(np.divide(tangent, sine[:, None], out=np.zeros_like(tangent), where=sine[:, None] > 0.0))
    cosine = np.einsum("ij,ij->i", *ends)
    half = np.sqrt(np.clip(0.5 * (1.0 + cosine), 0.0, 1.0))
    arc = (length / (4.0 * (1.0 + half)))[:, None] * (ends[0] - ends[1])
    return np.where(sure[:, None], arc, 0.0)
