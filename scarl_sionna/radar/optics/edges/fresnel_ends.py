"""What the end of a flat mirror does to a reflection near it: Fresnel's integral over the mirror's outline.

In the plane of a mirror the phase of the ways from a source over points about the reflection point R to a receiver is
k (1/d1 + 1/d2) (u . Q u) / 2, with the offset u from R, the distances d1 and d2 of R from both, Q = 1 - d d and the
direction d of the ray. In units in which that is pi/2 r^2, the integral over the mirror, relative to one without end,
is a contour integral over its outline in the polar angle about R.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.special import fresnel

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
Flags = npt.NDArray[np.bool_]

TAPER = 0.75
"""From this part of the reach on, what an edge does falls smoothly to nothing."""
_FAR = 4.0
"""Corners this far along an edge [Fresnel units] count as infinitely far: 1.3e-3 of the field."""
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(24)
"""Of the integral along a piece of an edge that is no longer than `_FAR`: 1e-8."""


def beyond_straight_end(away: npt.ArrayLike) -> Complex:
    r"""Return the field over that of a mirror without end, where the mirror is a half plane.

    Parameters
    ----------
    away : array_like of float
        Distance of the reflection point from the edge [Fresnel units], positive beyond it.

    Notes
    -----
    .. math:: \frac{1+j}{2} \int_\nu^\infty e^{-j\pi t^2/2}\,dt, one half at the edge.

    References
    ----------
    .. [1] M. Born, E. Wolf, *Principles of Optics*, 7th ed., 1999, section 8.7.
    """
    sine, cosine = fresnel(np.asarray(away, dtype=np.float64))
    return np.asarray((0.5 + 0.5j) * ((0.5 - cosine) - 1j * (0.5 - sine)))


def fresnel_axes(normal: Array, ray: Array, inverse: Array, wavelength: float) -> Array:
    """Return what maps offsets in a mirror's plane to units in which the phase is pi/2 r^2.

    Parameters
    ----------
    normal : ndarray of float64, shape (3,)
        Unit normal of the mirror.
    ray : ndarray of float64, shape (num_points, 3)
        Unit direction of each way before or behind the mirror.
    inverse : ndarray of float64, shape (num_points,)
        Sum of the inverse distances of the reflection point from both ends [1/m].
    wavelength : float
        [m].

    Returns
    -------
    ndarray of float64, shape (num_points, 2, 3)
        Along the ray, and across it to the left about the normal [Fresnel units/m].
    """
    cosine = ray @ normal
    along = ray - cosine[:, None] * normal
    length = np.sqrt(np.einsum("ij,ij->i", along, along))
    level = length < 1e-9
    if level.any():
        helper = np.eye(3)[np.abs(normal).argmin()]
        along[level] = helper - (helper @ normal) * normal
        length[level] = np.linalg.norm(along[level], axis=1)
    along /= length[:, None]
    unit = np.sqrt(2.0 * inverse / wavelength)[:, None]
    return np.stack([along * unit * np.abs(cosine)[:, None], across(normal, along) * unit], axis=1)


def across(normal: Array, vectors: Array) -> Array:
    """Return the cross products of a vector with others, (n, 3) or (3,): those of NumPy, which checks longer."""
    (x, y, z), (a, b, c) = normal, vectors.T
    return np.stack([y * c - z * b, z * a - x * c, x * b - y * a], axis=-1)


def edge_distances(start: Array, end: Array) -> tuple[Array, Array]:
    """Return the distances of reflection points from straight pieces of a mirror's outline [Fresnel units].

    Parameters
    ----------
    start, end : ndarray of float64, shape (..., 2)
        As of :func:`edge_terms`.

    Returns
    -------
    height : ndarray of float64, shape (...)
        From the line of the piece, positive on the side of the mirror.
    distance : ndarray of float64, shape (...)
        From the piece.
    """
    first, last, height = _frame(start, end)
    beyond = np.maximum(np.maximum(first, -last), 0.0)
    return height, np.sqrt(height * height + beyond * beyond)


def edge_terms(start: Array, end: Array, reach: float) -> tuple[Complex, Array, Array]:
    r"""Return what pieces of a mirror's outline take from the field of one without end.

    Parameters
    ----------
    start, end : ndarray of float64, shape (..., 2)
        Ends of straight pieces, as seen from the reflection point [Fresnel units]; the mirror is to the left.
    reach : float
        Pieces farther than this do nothing [Fresnel units]; from `TAPER` times it on they do less.

    Returns
    -------
    term : ndarray of complex128, shape (...)
        The sum over the outline is to be taken from 1 where the point is on the mirror, from 0 beyond it.
    height, distance : ndarray of float64, shape (...)
        As of :func:`edge_distances`.

    Notes
    -----
    With the height h and the distance t along the piece,

    .. math:: \frac{1}{2\pi} \int_{t_1}^{t_2} e^{-j\pi(h^2+t^2)/2} \frac{h}{h^2+t^2}\,dt,

    for an endless edge half the complementary error function, :func:`beyond_straight_end`.
    """
    height, distance = edge_distances(start, end)
    term = np.zeros(height.shape, dtype=np.complex128)
    near = distance < reach
    if near.any():
        first, last, own = _frame(start[near], end[near])
        share = np.clip((distance[near] / reach - TAPER) / (1.0 - TAPER), 0.0, 1.0)
        term[near] = (_to(own, last) - _to(own, first)) * np.cos(0.5 * np.pi * share) ** 2
    return term, height, distance


def _frame(start: Array, end: Array) -> tuple[Array, Array, Array]:
    """Return where pieces begin and end along their lines as seen from the reflection point, and their heights."""
    x, y = start[..., 0], start[..., 1]
    side_x, side_y = end[..., 0] - x, end[..., 1] - y
    length = np.maximum(np.sqrt(side_x * side_x + side_y * side_y), 1e-12)
    first = (x * side_x + y * side_y) / length
    return first, first + length, (x * side_y - y * side_x) / length


def _to(height: Array, along: Array) -> Complex:
    """Return the integral of :func:`edge_terms` from the foot of the perpendicular to some distances along the edge."""
    sign = np.where(height < 0.0, -1.0, 1.0) * np.sign(along)
    found = 0.5 * beyond_straight_end(np.abs(height))
    h, t = np.abs(height), np.abs(along)
    some = np.flatnonzero(t < _FAR)
    if len(some):
        h, t = h[some, None], t[some, None]
        s = 0.5 * t * (1.0 + _NODES)
        square = np.maximum(h**2 + s**2, 1e-24)
        sine, cosine = np.sin(0.25 * np.pi * square), np.cos(0.25 * np.pi * square)
        scale = h / square * sine * _WEIGHTS  # exp(-j pi square / 2) - 1 is -2 j sine exp(-j pi square / 4)
        integral = -t[:, 0] * ((scale * sine).sum(axis=1) + 1j * (scale * cosine).sum(axis=1))
        found[some] = (integral + np.arctan2(t[:, 0], np.maximum(h[:, 0], 1e-300))) / (2.0 * np.pi)
    return sign * found
