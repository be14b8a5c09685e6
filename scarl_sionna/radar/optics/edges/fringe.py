"""Fringe currents of a perfectly conducting wedge: what the exact currents of its faces have beyond physical optics."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.special import wofz

from ..tubes.trace import GRAZING as UNLIT

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]

SMALLEST_SINE = 1e-6
"""Of the angle between a ray and an edge: below, the ray counts as being that far from it."""
GRAZING = 1e-10
"""How near the projected cosine of the observer comes to 1: at 1 itself, along the face, both senses of an inverse
square root meet, and their mean (nothing) is meant."""
ROOT = 1e-7
"""Angle [rad] by which the border of light and shadow is left, at which a finite product is zero times infinite."""
ALONG = 1e-9
"""Directions nearer than this [rad] to a face are along it."""
SMALL = 1e-2
"""Argument [rad] below which the difference of two cotangents is a series: the next term is 1e-14."""


class Faces(NamedTuple):
    """One face of each of n wedges.

    Attributes
    ----------
    inward, normal : ndarray of float64, shape (n, 3)
        Unit vectors: along the face away from the edge and across it; normal to the face, out of the conductor.
    opening : ndarray of float64, shape (n,)
        Angle outside of the conductor [rad], above pi; 2 pi for a half plane.
    """

    inward: Array
    normal: Array
    opening: Array

    @property
    def edge(self) -> Array:
        """Unit vectors along the edge, shape (n, 3)."""
        return np.cross(self.inward, self.normal)

    def grazing(self, direction: Array) -> Array:
        """Return the unit directions (n, 3) of the diffracted rays along the face, of waves with such a direction."""
        cosine = np.einsum("ij,ij->i", direction, self.edge)
        sine = np.sqrt(np.maximum(1.0 - cosine**2, SMALLEST_SINE**2))
        return np.asarray(sine[:, None] * self.inward + cosine[:, None] * self.edge)

    def azimuth(self, towards: Array) -> Array:
        """Return the angle of directions (n, 3) around the edge from the face, 0 to 2 pi [rad]; along the face 0."""
        across = np.einsum("ij,ij->i", towards, self.normal)
        angle = np.mod(np.arctan2(across, np.einsum("ij,ij->i", towards, self.inward)), 2.0 * np.pi)
        return np.asarray(np.where(angle > 2.0 * np.pi - ALONG, 0.0, angle))

    def lit(self, direction: Array) -> npt.NDArray[np.bool_]:
        """Return which faces physical optics counts as lit by waves of such directions (n, 3)."""
        return np.asarray(np.einsum("ij,ij->i", direction, self.normal) < -UNLIT)


def fringe_current(faces: Faces, direction: Array, field: Complex, observer: Array) -> Complex:
    r"""Return k eta times the fringe current of faces, integrated away from the edge, per length of edge.

    Parameters
    ----------
    faces : Faces
    direction : ndarray of float64, shape (n, 3)
        Unit direction of travel of the incident wave, which comes from outside of the conductor.
    field : ndarray of complex128, shape (n, 3, p)
        Its electric field at the edge for p polarisations.
    observer : ndarray of float64, shape (n, 3)
        Unit direction to the observer.

    Returns
    -------
    ndarray of complex128, shape (n, 3, p)
        [V/m]; a piece of edge of length l scatters towards s the far field
        :math:`-j / (4 \pi) (K - s (s \cdot K))\, l\, e^{-jkr} / r`.

    Notes
    -----
    The exact current of the wedge less that of physical optics is integrated along the grazing diffracted ray, over
    which its phase is slowest, with the phase towards the observer. With the edge z, the angle b between it and the
    direction of travel, the azimuth f of the source and

    .. math:: \mu = (\hat s \cdot \hat \sigma - \cos^2 b) / \sin^2 b, \quad a = \pi - \arccos \mu, \quad N = w / \pi

    where sigma is the direction of that ray and w the opening, the integrals over the current are

    .. math:: G_{e,h} = \frac{1}{2N} \left(\cot\frac{a - f}{2N} \mp \cot\frac{a + f}{2N}\right),
              \quad G_h \to G_h / \sin a

    less the same with N = 1 where the face is lit (f < pi). The infinities at the borders of light and shadow cancel,
    but one: the wave that runs inward along the face, seen where it goes on.

    References
    ----------
    .. [1] A. Michaeli, "Elimination of infinities in equivalent edge currents, part I: Fringe current components", IEEE
           Trans. Antennas Propag. 34(7), 1986.
    .. [2] A. Michaeli, "Equivalent edge currents for arbitrary aspects of observation", IEEE Trans. Antennas Propag.
           32(3), 1984.
    """
    source = faces.azimuth(-direction)
    return wedge_current(faces, (source, faces.lit(direction)), direction, field, observer)


def wedge_current(
    faces: Faces, source: tuple[Array, npt.NDArray[np.bool_]], direction: Array, field: Complex, observer: Array
) -> Complex:
    """Return the same for a source of given azimuths [rad], less physical optics only where a mask says so.

    Without that it is the whole current of the wedge, of which only the end at the edge counts: that of a wave that
    runs along a face towards the edge (azimuth 0, and the opening for the other face).
    """
    azimuth, lit = source
    edge = faces.edge
    cosine = np.einsum("ij,ij->i", direction, edge)
    square = np.maximum(1.0 - cosine**2, SMALLEST_SINE**2)
    mu = (np.einsum("ij,ij->i", observer, faces.grazing(direction)) - cosine**2) / square
    mu = np.where(np.abs(np.abs(mu) - 1.0) < GRAZING, np.sign(mu) * (1.0 - GRAZING), mu)
    ratio = faces.opening / np.pi
    electric, magnetic = _integrals(np.pi - np.arccos(mu + 0j), azimuth, ratio, lit)
    tip = 2.0 / ratio - 2.0 * lit
    e_along = np.einsum("ij,ijp->ip", edge, field)
    h_along = np.einsum("ij,ijp->ip", np.cross(edge, direction), field)  # eta H . edge = (direction x E) . edge
    across = (2j * magnetic / np.sqrt(square))[:, None] * h_along
    upward = (2j * electric / square)[:, None] * e_along
    upward += (cosine / square * (2j * mu * magnetic - 1j * tip))[:, None] * h_along
    return np.asarray(faces.inward[:, :, None] * across[:, None] + edge[:, :, None] * upward[:, None])


def far_fringe(ratio: Array, azimuth: Array, distance: Array) -> Complex:
    r"""Return the magnetic field of the fringe on a face, along the edge, far from the edge.

    Parameters
    ----------
    ratio : ndarray of float64
        Opening over pi; all arguments broadcast.
    azimuth : ndarray of float64
        Of the source from the face [rad].
    distance : ndarray of float64
        k times the distance along the grazing ray times the square of the sine of its angle with the edge.

    Returns
    -------
    ndarray of complex128
        For an incident field of 1 along the edge, which falls with the root of the distance but near grazing incidence.

    References
    ----------
    .. [1] R. G. Kouyoumjian, P. H. Pathak, "A uniform geometrical theory of diffraction for an edge in a perfectly
           conducting surface", Proc. IEEE 62(11), 1974.
    """
    total: Complex = np.zeros(np.broadcast_shapes(ratio.shape, azimuth.shape, distance.shape), dtype=np.complex128)
    for sign in (1.0, -1.0):
        turns = np.round((azimuth + sign * np.pi) / (2.0 * np.pi * ratio))
        size = 2.0 * np.cos(np.pi * ratio * turns - azimuth / 2.0) ** 2
        angle = (np.pi + sign * azimuth) / (2.0 * ratio)
        angle = np.where(np.abs(np.sin(angle)) < ROOT, angle + ROOT, angle)
        total = total + transition(distance * np.maximum(size, ROOT**2 / 2.0)) / np.tan(angle)
    return np.asarray(-np.exp(-1j * (distance + np.pi / 4.0)) / (ratio * np.sqrt(2.0 * np.pi * distance)) * total)


def transition(value: Array) -> Complex:
    r"""Return :math:`2j \sqrt{x} e^{jx} \int_{\sqrt x}^\infty e^{-jt^2} dt` of numbers x >= 0: 1 for large ones.

    References
    ----------
    .. [1] R. G. Kouyoumjian, P. H. Pathak, as of :func:`far_fringe`.
    """
    root = np.sqrt(value)
    # with z = sqrt(x) exp(j pi / 4) the integral is sqrt(pi) / 2 exp(-j pi / 4) erfc(z), and exp(z^2) erfc(z) = w(jz)
    return np.asarray(np.sqrt(np.pi) * np.exp(0.25j * np.pi) * root * wofz(1j * np.exp(0.25j * np.pi) * root))


def _integrals(angle: Complex, source: Array, ratio: Array, lit: npt.NDArray[np.bool_]) -> tuple[Complex, Complex]:
    """Return G_e and G_h of :func:`fringe_current`."""
    less, more = (_cotangent(angle + sign * source, ratio, lit) for sign in (-1.0, 1.0))
    return 0.5 * (less - more), 0.5 * (less + more) / np.sin(angle)


def _cotangent(angle: Complex, ratio: Array, lit: npt.NDArray[np.bool_]) -> Complex:
    """Return cot(x / 2N) / N, less cot(x / 2) where lit."""
    small = (np.abs(angle) < SMALL) & lit
    safe = np.where(small, 1.0, angle)
    plain = 1.0 / (ratio * np.tan(safe / (2.0 * ratio)))
    one = 1.0 / np.tan(np.where(lit, safe, 1.0) / 2.0)
    series = angle / 6.0 * (1.0 - ratio**-2) + angle**3 / 360.0 * (1.0 - ratio**-4)
    series = series + angle**5 / 15120.0 * (1.0 - ratio**-6)
    return np.asarray(np.where(small, series, np.where(lit, plain - one, plain)))
