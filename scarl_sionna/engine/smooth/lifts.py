"""How far the middles of faces' edges stand off the curved surface behind them.

The vertices of a mesh are taken to lie on the surface, and its normals there to be known (:mod:`.creases`). The middle
of an edge is lifted onto the arc that its ends ask for: exact on a sphere and on a circular cylinder. Where they are
turned from the edge by unlike angles the arc slants, and is a cubic that has both normals. Both faces at an edge have
the same arc, so the surface has no cracks, and where it bends across one direction only no gaps between its normals.
"""

from __future__ import annotations

from itertools import permutations

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
ORDERS = tuple(permutations(range(3)))
LEAST_LIFT = 1e-9
"""Lifts and slants below this part of an edge are rounding, and none."""


def edge_lifts(corners: Array, normal: Array, curved: Mask) -> tuple[Array, Array]:
    """Return the lifts d and the slants e of edges, both of shape (num_faces, 3, 3) [m].

    A point of an edge that has the barycentric coordinates s and 1 - s stands for the one that is away from it by
    4 s (1 - s) d + s (1 - s) (2 s - 1) e, with s = 1 at corner i of edge i. The middle is away by d.

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
    lift, slant = _on_one_surface(chord, *own)
    apart = np.maximum(*(np.abs(a - b).max(axis=1) for a, b in zip(own, beside, strict=True))) > SAME_NORMAL
    lift[apart], slant[apart] = _between_two(*(a[apart] for a in (chord, *own, *beside)))
    none = (count > 2) | (apart & ~(curved[first // 3] | curved[other // 3]))
    for part in (lift, slant):
        slight = np.einsum("ij,ij->i", part, part) < LEAST_LIFT**2 * np.einsum("ij,ij->i", chord, chord)
        part[slight | none] = 0.0
    sense = np.where(start == start[first[edge]], 1.0, -1.0)
    return lift[edge].reshape(-1, 3, 3), (sense[:, None] * slant[edge]).reshape(-1, 3, 3)


def _on_one_surface(chord: Array, first: Array, second: Array) -> tuple[Array, Array]:
    r"""Return the lift of an edge's middle and its slant, with normals at its ends.

    Notes
    -----
    .. math:: d = \frac{w_1 + w_2}{4 (1 + \cos\theta)}, \quad w_1 = -c \cdot n_1, \quad w_2 = c \cdot n_2

    along the mean normal, with the chord c and the angle 2 theta between the normals: exact on a circle of radius a,
    where w = 2 a sin^2(theta) and d = a (1 - cos(theta)), on a sphere, and across a circular cylinder in any direction.
    The slant is minus the part of the chord along the mean normal: what is left has the same angle to both.
    """
    total = first + second
    length = np.linalg.norm(total, axis=1)  # 2 cos(theta)
    height = np.einsum("ij,ij->i", chord, second - first) / (4.0 + 2.0 * length)
    mean = np.divide(total, length[:, None], out=np.zeros_like(total), where=length[:, None] > 0.0)
    return mean * height[:, None], -np.einsum("ij,ij->i", chord, mean)[:, None] * mean


def _between_two(
    chord: Array, first: Array, second: Array, beside_first: Array, beside_second: Array
) -> tuple[Array, Array]:
    """Return the same of an edge in which two surfaces meet: an arc along their intersection, if that is sure."""
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
    mean = (ends[0] + ends[1]) / np.maximum(2.0 * half, LEAST_CROSS)[:, None]
    along = np.einsum("ij,ij->i", chord, mean)[:, None]
    arc = along / (4.0 * (1.0 + half))[:, None] * (ends[0] - ends[1])
    return np.where(sure[:, None], arc, 0.0), np.where(sure[:, None], along * mean - chord, 0.0)


def middle_lifts(corners: Array, slant: Array) -> Array:
    r"""Return by what the middles of faces are away besides, shape (num_faces, 3) [m].

    Parameters
    ----------
    corners, slant : ndarray of float64, shape (num_faces, 3, 3)
        Triangles and the slants of their edges [m].

    Notes
    -----
    Edges leave one cubic open, s0 s1 s2. It is added so that the third derivatives over the face, D, are least:

    .. math:: \sum_i e_i \frac{\langle D(s_i^2 s_j - s_i s_j^2), D(b) \rangle}{|D(b)|^2},\; b = s_0 s_1 s_2, j = i + 1

    of b is taken off. A surface that bends across one direction only then is a cubic over both halves of a rectangle.
    """
    side = np.roll(corners, -1, axis=1) - corners
    one, two = side[:, 0], -side[:, 2]
    aa, ab, bb = (np.einsum("ij,ij->i", *pair)[:, None] for pair in ((one, one), (one, two), (two, two)))
    second, third = bb * one - ab * two, aa * two - ab * one
    gradient = np.stack([-second - third, second, third], axis=1)
    gradient /= np.linalg.norm(gradient, axis=(1, 2), keepdims=True)
    product = np.einsum("nik,njk->nij", gradient, gradient)

    def inner(one: tuple[int, int, int]) -> Array:
        """Return the product of the symmetric tensor of three gradients with that of all three."""
        terms = [product[:, one[0], i] * product[:, one[1], j] * product[:, one[2], k] for i, j, k in ORDERS]
        return np.asarray(sum(terms[1:], start=terms[0]))

    whole = inner((0, 1, 2))
    total = np.zeros((len(corners), 3))
    for i, j in ((0, 1), (1, 2), (2, 0)):
        total += ((inner((i, i, j)) - inner((i, j, j))) / whole)[:, None] * slant[:, i]
    return -total / 27.0
