"""Which faces of a mesh stand for a curved surface, and the normals of that surface at their corners.

A mesh does not say whether an edge is one of the body (a box) or only of the drawing (a post of 14 sides). The rule is
that of curvature: along a curve one bend is followed by others of the same sense and about the same size, while beside
an edge of the body the faces are flat, or bend otherwise. So an edge is smooth where its bend goes on, on both sides;
four faces in a row are the least that make a curve. Skin and clothes have no flat faces: there every bend is of the
drawing, however unlike a simplified mesh made it to the next.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from .vertex_normals import settled_normals

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]
Mask = npt.NDArray[np.bool_]

SAME_VERTEX = 1e-6
"""Vertices this near to each other, in sizes of the mesh, are one."""
FLAT = np.radians(0.05)
"""Bends below this [rad] are none."""
TIGHT = 1.75
"""The bend of a curve that is drawn with bends below the crease angle may go on up to so many times that angle: where
an ellipse of 14 sides, half as wide as long, is most curved, it has 49 deg."""
PAIR = 0.25
"""Faces are halves of a quadrilateral where the diagonal bends by less than this part of the largest bend."""
ALIKE = 2.5
"""The next bend is at most so many times as large, or as small."""
WIDTHS = 3.0
"""Faces on both sides of a smooth edge are at most so many times as wide as each other."""
SHEET = np.radians(35.0)
"""Bend of an edge at which a sheet ends [rad]."""
END_WIDTHS = 2.0
"""The last face of a curve is at most so many times as wide as its neighbour; a wider one is a flat face that the curve
runs into."""
END_BEND = 0.75
"""The bend towards the last face of a curve is at least this part of the one before; where a curve runs into a flat
face it is a half, since its first chord leaves the tangent by half of a step."""


@dataclass(frozen=True, eq=False)
class Edges:
    """Edges between two faces that are turned the same way, all arrays with one row an edge.

    Attributes
    ----------
    face, corner : ndarray of int64, shape (n, 2)
        The two faces; in each the corner from which the edge runs to the next corner.
    bend : ndarray of float64, shape (n,)
        Angle between the normals [rad], positive where the mesh is convex.
    is_diagonal : ndarray of bool, shape (n,)
        Whether it is the longest edge of both faces, as that of a quadrilateral cut in two is.
    """

    face: Index
    corner: Index
    bend: Array
    is_diagonal: Mask

    def take(self, rows: Mask | Index) -> Edges:
        """Return some of the edges."""
        return Edges(self.face[rows], self.corner[rows], self.bend[rows], self.is_diagonal[rows])


@dataclass(frozen=True, eq=False)
class Curved:
    """What :func:`curved_surface` finds.

    Attributes
    ----------
    faces : ndarray of bool, shape (num_faces,)
        Faces that stand for a curved surface.
    normal : ndarray of float64, shape (num_faces, 3, 3)
        Unit normals at their corners; those of the face itself where it is flat.
    joined : Edges
        Those over which the surface goes on.
    """

    faces: Mask
    normal: Array
    joined: Edges


def joined_vertices(corners: Array) -> Index:
    """Return numbers of vertices, shape (num_faces, 3): corners at one place have the same."""
    points = corners.reshape(-1, 3)
    size = float(np.ptp(points, axis=0).max())
    keys = np.round((points - points.min(axis=0)) / (SAME_VERTEX * size)).astype(np.int64)
    order = np.lexsort(keys.T)
    new = np.any(np.diff(keys[order], axis=0) != 0, axis=1)
    number = np.empty(len(keys), dtype=np.int64)
    number[order] = np.concatenate([[0], np.cumsum(new)])
    return number.reshape(-1, 3)


def connected_faces(corners: Array) -> Index:
    """Return the number of the body to which each triangle, shape (num_faces, 3, 3), belongs.

    Those that have a corner in common, directly or by others, are one body.
    """
    if not len(corners):
        return np.zeros(0, dtype=np.int64)
    vertex = joined_vertices(corners)
    face = np.repeat(np.arange(len(vertex)), 3)
    count = len(vertex) + int(vertex.max()) + 1
    graph = coo_array((np.ones(len(face), dtype=np.bool_), (face, len(vertex) + vertex.ravel())), shape=(count, count))
    return np.asarray(connected_components(graph, directed=False)[1][: len(vertex)], dtype=np.int64)


def curved_surface(corners: Array, crease_angle: float, wider: float, rounded: bool = False) -> tuple[Curved, Mask]:
    """Return the curved surface for which a mesh of one part stands.

    Parameters
    ----------
    corners : ndarray of float64, shape (num_faces, 3, 3)
        Triangles, none without area [m].
    crease_angle : float
        Edges that bend by more than this are edges of the body [rad].
    wider : float
        A second such angle, at least as large [rad].
    rounded : bool
        Whether all edges that bend by less are smooth, not only those of which the bend goes on.

    Returns
    -------
    curved : Curved
    wider : ndarray of bool, shape (num_faces,)
        Faces that would be curved by the second angle.

    Notes
    -----
    Normals at vertices are weighted as by Max, exact where the vertices around one lie on a sphere, or on a circular
    cylinder, and then moved so that curvature goes on from edge to edge (:mod:`.vertex_normals`). Where a curve runs
    into a flat face it takes that face's normal there.

    A curve of uneven bends has some beyond the crease angle where it is most curved: those count as well, where the
    bend goes on on both sides of them, and the curve reaches them from bends below that angle.

    References
    ----------
    .. [1] N. Max, "Weights for Computing Vertex Normals from Facet Normals", J. Graphics Tools 4(2), 1999.
    """
    normal, weighted = _normals(corners)
    edges = _edges(joined_vertices(corners), normal, corners)
    bend = np.abs(edges.bend)
    is_soft = bend < crease_angle
    drawn = np.zeros(len(bend), dtype=np.bool_)
    if rounded:
        drawn[is_soft & (bend > FLAT)] = True
    else:
        drawn[is_soft] = _smooth(edges.take(is_soft), corners, normal, weighted)[0]
        tight = _reached(edges, is_soft, drawn, TIGHT * crease_angle, (corners, normal, weighted))
        is_soft[tight] = drawn[tight] = True
    other = np.zeros(len(corners), dtype=np.bool_)
    if not rounded and np.any(~is_soft & (bend < wider)):
        softer = edges.take(is_soft | (bend < wider))
        other[softer.face[_smooth(softer, corners, normal, weighted)[0]]] = True
    return _with_normals(corners, edges.take(is_soft), drawn[is_soft], (normal, weighted), crease_angle), other


def sheet_sizes(corners: Array) -> Array:
    """Return the size of the sheet to which each face belongs, shape (num_faces,) [m].

    A sheet ends where the mesh bends by `SHEET` or more, or ends itself: each face of a corner reflector is one, and so
    is a panel of a car with all of its small faces. Its size is twice the distance of its farthest corner from its
    middle.

    Parameters
    ----------
    corners : ndarray of float64, shape (num_faces, 3, 3)
        Triangles of one part, none without area [m].
    """
    edges = _edges(joined_vertices(corners), _normals(corners)[0], corners)
    joined = edges.take(np.abs(edges.bend) < SHEET)
    graph = coo_array((np.ones(len(joined.bend), dtype=np.bool_), tuple(joined.face.T)), shape=(len(corners),) * 2)
    sheet = connected_components(graph, directed=False)[1]
    low, high = (np.full((int(sheet.max()) + 1, 3), sign * np.inf) for sign in (1.0, -1.0))
    np.minimum.at(low, sheet, corners.min(axis=1))
    np.maximum.at(high, sheet, corners.max(axis=1))
    away = corners - (0.5 * (low + high))[sheet][:, None]
    farthest = np.zeros(len(low))
    np.maximum.at(farthest, sheet, np.sqrt(np.einsum("nij,nij->ni", away, away).max(axis=1)))
    return np.asarray(2.0 * farthest[sheet])


def _with_normals(
    corners: Array, soft: Edges, smooth: Mask, normals: tuple[Array, Array], crease_angle: float
) -> Curved:
    """Return the faces at smooth edges, and the normals at corners; `normals` are those of :func:`_normals`."""
    normal, weighted = normals
    count = len(normal)
    if not smooth.any():
        none = np.zeros(count, dtype=np.bool_)
        return Curved(none, np.repeat(normal[:, None], 3, axis=1), soft.take(smooth))
    largest = np.zeros(count)
    np.maximum.at(largest, soft.face[smooth], np.abs(soft.bend[smooth, None]))
    pair = soft.is_diagonal & (np.abs(soft.bend)[:, None] <= 0.5 * largest[soft.face]).any(axis=1)
    largest[soft.face[pair]] = largest[soft.face[pair]].max(axis=1, keepdims=True)
    curved = largest > 0.0
    sides = curved[soft.face]
    slight = np.abs(soft.bend)[:, None] <= largest[soft.face]
    link = smooth | (sides.all(axis=1) & slight.any(axis=1))
    group = _groups(soft.take(link), count)
    result = _mean_normal(group, weighted)
    held = _run_into_flat_faces(result, group, soft, sides, sides & slight, normal)
    pointed = _pointed(result, group, normal, crease_angle)  # the tip of a cone has no normal
    settled = settled_normals(corners[curved], group[curved], result, held)
    worse = group[_pointed(settled, group, normal, crease_angle) & ~pointed]
    settled[worse] = result[worse]
    found = settled[group]
    kept = np.where((curved[:, None] & ~pointed)[:, :, None], found, normal[:, None])
    return Curved(curved, kept, soft.take(link))


def _normals(corners: Array) -> tuple[Array, Array]:
    """Return unit normals, and the weighted ones of every corner, shape (num_faces, 3, 3)."""
    side = np.roll(corners, -1, axis=1) - corners
    square = np.einsum("nij,nij->ni", side, side)
    across = np.cross(side[:, 0], side[:, 1])
    weight = 1.0 / (square * np.roll(square, 1, axis=1))
    return across / np.linalg.norm(across, axis=1, keepdims=True), weight[:, :, None] * across[:, None]


def _edges(vertex: Index, normal: Array, corners: Array) -> Edges:
    """Return the edges that two faces run along in opposite senses, and no third one."""
    start, stop = vertex, np.roll(vertex, -1, axis=1)
    low, high = np.minimum(start, stop).ravel(), np.maximum(start, stop).ravel()
    key = low * (int(vertex.max()) + 1) + high
    order = np.argsort(key, kind="stable")
    first = np.flatnonzero(np.diff(key[order], prepend=-1))
    pair = first[np.diff(first, append=len(order)) == 2]
    half = np.stack([order[pair], order[pair + 1]], axis=1)
    half = half[start.ravel()[half[:, 0]] != start.ravel()[half[:, 1]]]
    face, corner = half // 3, half % 3
    one, two = normal[face[:, 0]], normal[face[:, 1]]
    beyond = corners[face[:, 1], (corner[:, 1] + 2) % 3] - corners[face[:, 0], corner[:, 0]]
    sine = np.linalg.norm(np.cross(one, two), axis=1)
    angle = np.arctan2(sine, np.einsum("ij,ij->i", one, two))
    side = np.roll(corners, -1, axis=1) - corners
    square = np.einsum("nij,nij->ni", side, side)
    longest = (square[face, corner] >= (1.0 - SAME_VERTEX) * square.max(axis=1)[face]).all(axis=1)
    return Edges(face, corner, np.where(np.einsum("ij,ij->i", one, beyond) > 0.0, -angle, angle), longest)


def _groups(edges: Edges, num_faces: int) -> Index:
    """Return the group of every corner, shape (num_faces, 3): corners at one vertex that edges join."""
    (f, g), (i, j) = edges.face.T, edges.corner.T
    ends = [(3 * f + i, 3 * g + (j + 1) % 3), (3 * f + (i + 1) % 3, 3 * g + j)]
    row, column = (np.concatenate([pair[k] for pair in ends]) for k in range(2))
    graph = coo_array((np.ones(len(row), dtype=np.bool_), (row, column)), shape=(3 * num_faces,) * 2)
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64).reshape(-1, 3)


def _mean_normal(group: Index, weighted: Array) -> Array:
    """Return the unit normal of every group of corners."""
    total = np.stack([np.bincount(group.ravel(), weighted[..., axis].ravel()) for axis in range(3)], axis=1)
    length = np.linalg.norm(total, axis=1, keepdims=True)
    return np.divide(total, length, out=np.zeros_like(total), where=length > 0.0)


def _reached(edges: Edges, is_soft: Mask, drawn: Mask, largest: float, mesh: tuple[Array, Array, Array]) -> Index:
    """Return the edges of more bend than soft ones that a curve reaches, from one to the next.

    Their bend is below `largest` [rad] and goes on on both sides. `drawn` (n,) are the edges where the curve is
    already; both halves of a quadrilateral count as one face. `mesh` are corners, and normals as of :func:`_normals`.
    """
    rows = np.flatnonzero(is_soft | (np.abs(edges.bend) < largest))
    if len(rows) == np.count_nonzero(is_soft) or not drawn.any():
        return rows[:0]
    some = edges.take(rows)
    goes_on = _smooth(some, *mesh)[1] & ~is_soft[rows]
    slight = np.abs(some.bend) <= PAIR * np.abs(some.bend).max()
    joined = some.face[some.is_diagonal & slight]
    graph = coo_array((np.ones(len(joined), dtype=np.bool_), tuple(joined.T)), shape=(len(mesh[0]),) * 2)
    panel = connected_components(graph, directed=False)[1][some.face]
    on_curve = np.zeros(len(mesh[0]), dtype=np.bool_)
    on_curve[panel[drawn[rows]]] = True
    reached = np.zeros(len(rows), dtype=np.bool_)
    while np.any(more := goes_on & ~reached & on_curve[panel].any(axis=1)):
        reached |= more
        on_curve[panel[more]] = True
    return np.asarray(rows[reached])


def _smooth(soft: Edges, corners: Array, normal: Array, weighted: Array) -> tuple[Mask, Mask]:
    """Return the edges whose bend goes on, on both sides, or that end such a row of bends; and only the former.

    Over a surface that bends along an edge as well, or is twisted there, two triangles are turned to each other by more
    or less than strips across the edge would be: what the normals at its ends say of both is taken off.
    """
    if not np.any(np.abs(soft.bend) > FLAT):
        return np.zeros(len(soft.bend), dtype=np.bool_), np.zeros(len(soft.bend), dtype=np.bool_)
    group = _groups(soft, len(corners))
    vertex_normal = _mean_normal(group, weighted)
    tilt, width, arch = (np.empty((len(soft.bend), 2)) for _ in range(3))
    twist = np.zeros(len(soft.bend))
    for side in range(2):
        face, corner = soft.face[:, side], soft.corner[:, side]
        onto, far = (corner + 1) % 3, (corner + 2) % 3
        stop, away = (corners[face, k] - corners[face, corner] for k in (onto, far))
        length = np.linalg.norm(stop, axis=1)
        along = stop / length[:, None]
        inward = np.cross(normal[face], along)
        width[:, side] = np.einsum("ij,ij->i", away, inward)
        tilt[:, side] = np.arcsin(np.clip(np.einsum("ij,ij->i", vertex_normal[group[face, far]], inward), -1.0, 1.0))
        turn = vertex_normal[group[face, onto]] - vertex_normal[group[face, corner]]
        place = np.einsum("ij,ij->i", away, along)
        # by how much the face leans less than a strip across the edge, since the surface bends along the edge as well
        arch[:, side] = np.einsum("ij,ij->i", turn, along) / length * place * (length - place) / width[:, side]
        twist -= np.einsum("ij,ij->i", turn, inward) * (place / length - 0.5)
    bends = np.abs(soft.bend) > FLAT
    # over a curve of equal steps the normal beyond a face is turned by half of the bend before it
    sign = np.where(bends, np.sign(soft.bend), 1.0)[:, None]
    onward = sign * (2.0 * tilt - arch)
    size = sign * (soft.bend + 0.5 * arch.sum(axis=1) + twist)[:, None]
    goes_on = bends[:, None] & (size > 0.0) & (onward * ALIKE >= size) & (onward <= ALIKE * size)
    ratio = width.max(axis=1) / width.min(axis=1)
    core = goes_on.all(axis=1) & (ratio <= WIDTHS)
    at_core = np.zeros(int(group.max()) + 1, dtype=np.bool_)
    for k in range(2):
        at_core[group[soft.face[core], (soft.corner[core] + k) % 3]] = True
    beyond = at_core[group[soft.face, (soft.corner + 2) % 3]]
    before = np.where(goes_on & beyond, onward, 0.0)  # on the side of the curve
    last = (before > 0.0) & (size >= END_BEND * before) & (ratio <= END_WIDTHS)[:, None]
    return core | last.any(axis=1), core


def _pointed(vertex_normal: Array, group: Index, normal: Array, crease_angle: float) -> Mask:
    """Return the corners, shape (num_faces, 3), where the surface is turned too far from the face."""
    return np.asarray(np.einsum("nij,nj->ni", vertex_normal[group], normal) < np.cos(crease_angle))


def _run_into_flat_faces(result: Array, group: Index, soft: Edges, sides: Mask, tangent: Mask, normal: Array) -> Mask:
    """Give groups of curved faces' corners the normals of the flat faces beside them, in place; return which.

    `sides` (n, 2) says on which sides of an edge the face is curved, `tangent` (n, 2) on which of them the edge bends
    no more than that face does elsewhere.
    """
    total, touched = np.zeros_like(result), np.zeros(len(result), dtype=np.bool_)
    for side in range(2):
        rows = np.flatnonzero(tangent[:, side] & ~sides[:, 1 - side])
        face, corner = soft.face[rows, side], soft.corner[rows, side]
        for k in range(2):
            at = group[face, (corner + k) % 3]
            np.add.at(total, at, normal[soft.face[rows, 1 - side]])
            touched[at] = True
    length = np.linalg.norm(total, axis=1, keepdims=True)
    usable = touched & (length[:, 0] > 0.5)
    result[usable] = total[usable] / length[usable]
    return usable
