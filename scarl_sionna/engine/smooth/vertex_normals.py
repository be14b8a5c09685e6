"""Normals at the vertices of a curved surface, so that its curvature goes on from one edge to the next.

Of a polygon of unequal bends the circle through three corners gives the normal to second order only: over the surface
between two such normals the curvature is off by some ten per cent, and jumps at the corners. What does not jump is a
spline. On a mesh the same holds along its edges: an edge whose ends have the normals n1 and n2 bends at its ends by
(4 w1 - 2 w2) / c^2 and (4 w2 - 2 w1) / c^2, with w1 = -c . n1 and w2 = c . n2 of its chord c, and around a vertex these
are to be values of one quadratic form. On spheres and circular cylinders they are, and nothing changes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array, diags_array, vstack
from scipy.sparse.linalg import lsqr

from scarl_sionna.core.cores import one_blas_thread

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]
Mask = npt.NDArray[np.bool_]

STEPS = 12
"""Of the solution, at most."""
ACCURACY = 1e-5
"""Of the solution."""
STIFF = 0.1
"""Weight of a normal's turn, in mean lengths of its edges: what decides along tall faces,
over which a bend both ways is a value of a quadratic form as well."""
EVEN = 0.01
"""Weight of a curvature that is the same at both ends of an edge: what decides where a curve ends."""
ROUNDING = 1e-9
"""Part of a quadratic form below which directions around a vertex do not tell it."""
LARGEST_TURN = 0.5
"""A normal is moved by at most this part of the largest angle to those at the other ends of its edges; more is a mesh
whose vertices are not on a surface."""


@dataclass(frozen=True, eq=False)
class _Spokes:
    """Edges as seen from one of their ends: vertices `own` and `other` (n,), the chord between them (n, 3) [m]."""

    own: Index
    other: Index
    chord: Array
    square: Array
    count: int

    @classmethod
    def of(cls, corners: Array, vertex: Index, count: int) -> _Spokes:
        """Return those of triangles, shape (n, 3, 3), between vertices (n, 3)."""
        one, two = np.array([0, 1, 1, 2, 2, 0]), np.array([1, 0, 2, 1, 0, 2])
        own, other = vertex[:, one].ravel(), vertex[:, two].ravel()
        once = np.unique(own * count + other, return_index=True)[1]
        chord = (corners[:, two] - corners[:, one]).reshape(-1, 3)[once]
        return cls(own[once], other[once], chord, np.einsum("ij,ij->i", chord, chord), count)

    def summed(self, values: Array) -> Array:
        """Return the sums of values, shape (n, k), over the edges of each vertex."""
        return np.stack([np.bincount(self.own, column, self.count) for column in values.T], axis=1)


def settled_normals(corners: Array, group: Index, normal: Array, held: Mask) -> Array:
    """Return the normals of groups of corners with which curvature goes on from edge to edge.

    Parameters
    ----------
    corners : ndarray of float64, shape (n, 3, 3)
        Triangles that stand for a curved surface [m].
    group : ndarray of int64, shape (n, 3)
        Corners of one group have one normal.
    normal : ndarray of float64, shape (num_groups, 3)
        Unit normals to start from.
    held : ndarray of bool, shape (num_groups,)
        Which of them are sure.
    """
    number, vertex = np.unique(group, return_inverse=True)
    spokes = _Spokes.of(corners, vertex.reshape(-1, 3), len(number))
    start, sure = normal[number], held[number]
    found = _step(spokes, start, sure)
    cosine = np.einsum("ij,ij->i", start[spokes.own], start[spokes.other])
    largest = np.zeros(len(number))
    np.maximum.at(largest, spokes.own, np.arccos(np.clip(cosine, -1.0, 1.0)))
    turn = np.arccos(np.clip(np.einsum("ij,ij->i", found, start), -1.0, 1.0))
    good = turn <= LARGEST_TURN * largest
    result = normal.copy()
    result[number[good]] = found[good]
    return result


def _step(spokes: _Spokes, normal: Array, held: Mask) -> Array:
    """Return the normals of a spline, shape (num_vertices, 3), to first order in their turns from those given."""
    bends, even, stiff = _bends(spokes, normal), _evenness(spokes, normal), _stiffness(spokes)
    frame = _frames(normal)
    odd = _not_of_a_form(spokes, normal, frame)
    turns = [bends.matrix(frame, spokes, 4.0, -2.0), bends.matrix(frame, spokes, 6.0, -6.0).multiply(even[:, None])]
    whole = vstack([odd @ turns[0], turns[1], diags_array(stiff)]).tocsc()
    now = np.concatenate([odd @ bends.value(4.0, -2.0), even * bends.value(6.0, -6.0), np.zeros(len(stiff))])
    length = np.sqrt(np.asarray(whole.multiply(whole).sum(axis=0)).ravel())
    scale = np.where(np.repeat(held, 2), 0.0, 1.0 / length)
    with one_blas_thread():  # same bytes for any number
        found = lsqr(whole.multiply(scale[None]).tocsr(), -now, atol=ACCURACY, btol=ACCURACY, iter_lim=STEPS)
    moved = scale * found[0]
    result = normal + np.einsum("nk,nki->ni", moved.reshape(-1, 2), frame)
    return np.asarray(result / np.linalg.norm(result, axis=1, keepdims=True))


@dataclass(frozen=True, eq=False)
class _Bends:
    """w1 / c^2 and w2 / c^2 of every edge."""

    near: Array
    far: Array

    def value(self, near: float, far: float) -> Array:
        """Return a sum of both, shape (n,) [1/m]."""
        return near * self.near + far * self.far

    def matrix(self, frame: Array, spokes: _Spokes, near: float, far: float) -> csr_array:
        """Return the derivatives of that sum by the turns of all normals in their frames, shape (n, 2 num_vertices)."""
        ends = ((-near, spokes.own), (far, spokes.other))
        values = [
            (weight / spokes.square)[:, None] * np.einsum("nki,ni->nk", frame[end], spokes.chord)
            for weight, end in ends
        ]
        columns = [2 * end[:, None] + np.arange(2) for _, end in ends]
        count = len(spokes.own)
        place = np.repeat(np.arange(count), 4), np.hstack(columns).ravel()
        return csr_array((np.hstack(values).ravel(), place), shape=(count, 2 * spokes.count))


def _bends(spokes: _Spokes, normal: Array) -> _Bends:
    ends = normal[spokes.own], normal[spokes.other]
    near, far = (np.einsum("ij,ij->i", spokes.chord, end) / spokes.square for end in ends)
    return _Bends(-near, far)


def _evenness(spokes: _Spokes, normal: Array) -> Array:
    """Return the weights of `EVEN`, less for edges that bend less than others at their vertex, shape (n,)."""
    bend = np.abs(_bends(spokes, normal).value(1.0, 1.0))
    most = np.zeros(spokes.count)
    np.maximum.at(most, spokes.own, bend)
    return np.asarray(EVEN * np.divide(bend, most[spokes.own], out=np.zeros_like(bend), where=bend > 0.0))


def _stiffness(spokes: _Spokes) -> Array:
    """Return the weights of `STIFF`, shape (2 num_vertices,) [1/m]."""
    mean = spokes.summed(spokes.square[:, None])[:, 0] / np.bincount(spokes.own, minlength=spokes.count)
    return np.repeat(STIFF / np.sqrt(mean), 2)


def _frames(normal: Array) -> Array:
    """Return two directions across each normal, shape (n, 2, 3)."""
    one = np.cross(normal, np.eye(3)[np.abs(normal).argmin(axis=1)])
    one /= np.linalg.norm(one, axis=1, keepdims=True)
    return np.stack([one, np.cross(normal, one)], axis=1)


def _not_of_a_form(spokes: _Spokes, normal: Array, frame: Array) -> csr_array:
    """Return the projection of values at edges onto what no quadratic form around each vertex has."""
    at_own, at_other = normal[spokes.own], normal[spokes.other]
    mean = at_own + at_other
    mean /= np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), ROUNDING)
    # seen in the plane across the mean normal: there the arc of a cylinder is as long as its chord, in any direction
    place = np.einsum("nki,ni->nk", frame[spokes.own], _turned(spokes.chord, mean, at_own))
    x, y = (place / np.sqrt(spokes.square)[:, None]).T
    forms = np.stack([x * x, 2.0 * x * y, y * y], axis=1)
    gram = spokes.summed((forms[:, :, None] * forms[:, None]).reshape(-1, 9)).reshape(-1, 3, 3)
    inverse = np.linalg.pinv(gram, rcond=ROUNDING, hermitian=True)
    count = len(x)
    columns = (3 * spokes.own[:, None] + np.arange(3)).ravel()
    shape = count, 3 * spokes.count
    some = csr_array((forms.ravel(), (np.repeat(np.arange(count), 3), columns)), shape=shape)
    solved = np.einsum("nk,nkl->nl", forms, inverse[spokes.own])
    other = csr_array((solved.ravel(), (np.repeat(np.arange(count), 3), columns)), shape=shape)
    diagonal = np.arange(count)
    return csr_array((np.ones(count), (diagonal, diagonal)), shape=(count, count)) - other @ some.T


def _turned(vectors: Array, first: Array, second: Array) -> Array:
    """Return vectors turned by what turns one unit vector into another, all of shape (n, 3)."""
    total = first + second
    scale = np.einsum("ij,ij->i", vectors, total) / np.maximum(1.0 + np.einsum("ij,ij->i", first, second), ROUNDING)
    return vectors - scale[:, None] * total + 2.0 * np.einsum("ij,ij->i", vectors, first)[:, None] * second
