"""Double diffraction: waves that run from one edge of a flat face across it to another and are diffracted there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .fringe import GRAZING, SMALLEST_SINE, far_fringe, transition, wedge_current
from .wedges import Wedges

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
Index = npt.NDArray[np.int64]

AHEAD = 1e-6
"""The second edge is at least so many times the first piece's length away."""
PAIRS = 400_000
"""Rays and edges of one plane looked at together: bounds the memory, changes no result."""
SHORTEST = 1e-6
"""Least way across in radians of the phase: keeps the root of its inverse finite."""
LEAST_SINE = 0.02
"""Of the angle between the ray across the face and the second edge: rays that run along it are left out."""


@dataclass(frozen=True, eq=False)
class Crossings:
    """Rays across faces from pieces of edges to others, one row each.

    Attributes
    ----------
    first, second : ndarray of int64, shape (n,)
        Pieces.
    side, other : ndarray of int64, shape (n,)
        Which of their two faces the ray runs along.
    direction : ndarray of float64, shape (n, 3)
        Of the ray.
    length : ndarray of float64, shape (n, 2)
        From the ends of the first piece to the line of the second [m].
    """

    first: Index
    second: Index
    side: Index
    other: Index
    direction: Array
    length: Array

    def __len__(self) -> int:
        return len(self.first)

    def take(self, rows: npt.NDArray[np.bool_]) -> Crossings:
        """Return some rows."""
        return Crossings(*(column[rows] for column in vars(self).values()))


def crossings(wedges: Wedges, plane: Index, lit: Index, direction: Array) -> Crossings:
    """Return the rays that diffracted waves take across faces.

    Parameters
    ----------
    wedges : Wedges
    plane : ndarray of int64, shape (num_wedges, 2)
        Numbers of the planes of both faces.
    lit : ndarray of int64, shape (n,)
        Pieces that a wave meets.
    direction : ndarray of float64, shape (n, 3)
        Its direction there.
    """
    found = [_of_side(wedges, plane, lit, direction, side) for side in range(2)]
    return Crossings(*(np.concatenate(columns) for columns in zip(*(vars(one).values() for one in found), strict=True)))


def _of_side(wedges: Wedges, plane: Index, lit: Index, direction: Array, side: int) -> Crossings:
    ray = wedges.take(lit).side(side).grazing(direction)
    far = wedges.stop - wedges.start
    along = far / np.linalg.norm(far, axis=1, keepdims=True)
    best, target, target_side = np.full(len(lit), np.inf), np.zeros(len(lit), np.int64), np.zeros(len(lit), np.int64)
    own = np.argsort(plane[lit, side], kind="stable")
    number, first = np.unique(plane[lit, side][own], return_index=True)
    for other in range(2):
        order = np.argsort(plane[:, other], kind="stable")
        ranges = [np.searchsorted(plane[order, other], number, where) for where in ("left", "right")]
        for rows, low, high in zip(np.split(own, first[1:]), *ranges, strict=True):
            there = order[low:high]
            for some in np.array_split(rows, max(len(rows) * len(there) // PAIRS, 1)):
                distance, nearest = _nearest(wedges, along, (lit[some], side, ray[some]), (there, other))
                nearer = distance < best[some]
                best[some[nearer]] = distance[nearer]
                target[some[nearer]], target_side[some[nearer]] = nearest[nearer], other
    kept = np.flatnonzero(np.isfinite(best))
    one, two = lit[kept], target[kept]
    ends = [
        _line(point[one], ray[kept], wedges.normal[one, side], wedges.start[two], along[two])
        for point in (wedges.start, wedges.stop)
    ]
    reach = np.maximum(np.stack(ends, axis=1), 0.0)
    return Crossings(one, two, np.full(len(kept), side), target_side[kept], ray[kept], reach)


def _nearest(
    wedges: Wedges, along: Array, start: tuple[Index, int, Array], stop: tuple[Index, int]
) -> tuple[Array, Index]:
    """Return how far rays over one side of pieces run to the nearest of others [m], infinite for none, and which."""
    (rows, side, ray), (there, other) = start, stop
    if not len(there):
        return np.full(len(rows), np.inf), np.zeros(len(rows), dtype=np.int64)
    normal = wedges.normal[rows, side]
    far, where = _distance(wedges.center[rows], ray, normal, wedges.start[there], along[there])
    length = np.linalg.norm(wedges.stop - wedges.start, axis=1)
    usable = (normal @ wedges.normal[there, other].T > 0.5) & (ray @ wedges.inward[there, other].T < -LEAST_SINE)
    usable &= (where >= 0.0) & (where <= length[there]) & (far > AHEAD * length[rows, None])
    far = np.where(usable, far, np.inf)
    nearest = far.argmin(axis=1)
    return far[np.arange(len(rows)), nearest], there[nearest]


def _distance(center: Array, ray: Array, normal: Array, start: Array, along: Array) -> tuple[Array, Array]:
    """Return how far along rays (n) lines (m) are met, and how far along the lines, both of shape (n, m)."""
    gap = start[None] - center[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        slope = np.einsum("nmi,ni->nm", np.cross(ray[:, None], along[None]), normal)
        far = np.einsum("nmi,ni->nm", np.cross(gap, along[None]), normal) / slope
        where = np.einsum("nmi,ni->nm", np.cross(gap, ray[:, None]), normal) / slope
    return far, where


def _line(point: Array, ray: Array, normal: Array, start: Array, along: Array) -> Array:
    """Return how far along rays (n) one line each is met, shape (n,)."""
    slope = np.einsum("ni,ni->n", np.cross(ray, along), normal)
    return np.asarray(np.einsum("ni,ni->n", np.cross(start - point, along), normal) / slope)


@dataclass(frozen=True, eq=False)
class Crossed:
    """What waves across faces do for one observer.

    Attributes
    ----------
    end, fringe : ndarray of complex128, shape (n, 3, p)
        k eta times the currents at the second edge, per length [V/m]: what ends there of that of the first edge, and
        what begins there; without the factors of :meth:`strength`.
    start, stop : ndarray of float64, shape (n, 3)
        Part of the second edge that the piece of the first one lights [m].
    length : ndarray of float64, shape (n, 2)
        Of the way across, to both ends [m].
    wedge : tuple of ndarray
        Of the first edge: opening over pi, azimuth of the source, squared sine of its angle with the edge.
    turn : ndarray of float64, shape (n,)
        1 - the cosine between the way across and the observer.
    """

    end: Complex
    fringe: Complex
    start: Array
    stop: Array
    length: Array
    wedge: tuple[Array, Array, Array]
    turn: Array

    def strength(self, wavenumber: Array) -> tuple[Complex, Complex]:
        """Return the factors of both currents [rad/m]: the field on the face, without its phase -k length."""
        ratio, azimuth, square = self.wedge
        path = np.maximum(wavenumber * self.length.mean(axis=1), SHORTEST)
        arriving = far_fringe(ratio, azimuth, path * square) * np.exp(1j * path * square)
        return np.asarray(arriving * transition(path * self.turn)), arriving


def crossed(
    wedges: Wedges, level: Complex, ways: Crossings, direction: Array, field: Complex, observer: Array
) -> Crossed:
    """Return what arrives over faces and is diffracted towards an observer.

    Parameters
    ----------
    wedges : Wedges
    level : ndarray of complex128, shape (num_wedges, 2)
        What scales the currents of each face.
    ways : Crossings
    direction : ndarray of float64, shape (n, 3)
        Of the wave at the first piece.
    field : ndarray of complex128, shape (n, 3, p)
        There.
    observer : ndarray of float64, shape (n, 3)

    Notes
    -----
    Only the wave with its magnetic field along the face is followed: the other one falls faster, by a further k times
    the distance. On the face it is a current along its way. At the second edge that current ends, which the integral
    over the first fringe left out, and it meets the edge as a plane wave of half of its field at grazing incidence.
    Where the observer is near the direction of the way, what ends is the rest of a Fresnel integral
    (:func:`.fringe.transition`).
    """
    first, second = wedges.take(ways.first), wedges.take(ways.second)
    row = np.arange(len(ways))
    normal = first.normal[row, ways.side]
    edge = np.cross(first.inward[row, ways.side], normal)
    square = np.maximum(1.0 - np.einsum("ij,ij->i", direction, edge) ** 2, SMALLEST_SINE**2)
    magnetic = np.einsum("ij,ijp->ip", np.cross(edge, direction), field) / np.sqrt(square)[:, None]
    magnetic = magnetic * level[ways.first, ways.side][:, None]
    turn = np.maximum(1.0 - np.einsum("ij,ij->i", observer, ways.direction), GRAZING)
    crossing = -np.einsum("ij,ij->i", ways.direction, second.inward[row, ways.other])
    end = 1j * ways.direction[:, :, None] * (crossing / turn)[:, None, None] * magnetic[:, None]
    grazing = 0.5 * normal[:, :, None] * magnetic[:, None]
    fringe = np.zeros_like(grazing)
    for side in range(2):
        own = ways.other == side
        source = np.where(own, 0.0, second.opening), own
        part = wedge_current(second.side(side), source, ways.direction, grazing, observer)
        fringe += level[ways.second, side][:, None, None] * part
    azimuth = np.where(ways.side == 0, first.side(0).azimuth(-direction), first.side(1).azimuth(-direction))
    start, stop = (
        point + ways.length[:, end_, None] * ways.direction for end_, point in enumerate((first.start, first.stop))
    )
    return Crossed(end, fringe, start, stop, ways.length, (first.opening / np.pi, azimuth, square), turn)
