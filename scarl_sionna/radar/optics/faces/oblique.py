"""Flat patches that are seen obliquely: their field comes from their edges and corners alone.

Away from the mirror direction the phase runs over many turns along a face, and what its inside scatters cancels. What
is left is the ends of its edges, each with its own length, and an edge as a whole where the phase stands still along
it. These are what such a patch is made of here. Their strengths hardly depend on the frequency and on the antenna, and
what neighbouring patches have in common cancels, so neither the size of the patches nor their number matters.
"""

from __future__ import annotations

from types import ModuleType
from typing import NamedTuple

import numpy as np

from scarl_sionna.engine.device import Device
from scarl_sionna.engine.types import DeviceArray

CURVATURE = 0.02
"""Largest curvature of the phase over the square of its slope up to which a patch is represented by its edges, and an
edge by its ends: the relative error of them, the same on both sides of a common edge."""
NODES = 20
"""Gauss-Legendre nodes of an edge along which the phase stands still: right to 1e-6 over 35 rad, the most that is flat
by `CURVATURE` where patches depart from a linear phase by 3 rad."""

STEADY = 0.25
"""`max_turn` of edges where patches have none [rad]: 1 %, or -40 dB, over a frame."""


class Ends(NamedTuple):
    """Patches between two points: the image from which the wave comes, and the receiver."""

    corner: list[DeviceArray]
    """The three corners [m]."""
    source: DeviceArray
    receiver: DeviceArray
    wavenumber: DeviceArray
    """[rad/m]."""
    steady: DeviceArray | float = 0.0
    """Slope of the phase that motion over a frame asks for [rad/m], see :func:`steady_slope`."""


def steady_slope(
    dr: ModuleType,
    wavenumber: DeviceArray,
    legs: list[tuple[DeviceArray, DeviceArray, DeviceArray]],
    max_turn: DeviceArray,
    arm: DeviceArray | float = 0.0,
) -> DeviceArray:
    """Return the slope of the phase above which the strength of edges is kept over a frame and a wide array [rad/m].

    The strength of a corner goes with the square of the slope, so a change by d alters it by 2 d / slope. That may be
    max_turn^2 / 6, a rule of the edges alone.

    Parameters
    ----------
    dr : module
    wavenumber : float or Dr.Jit float64 number
        [rad/m].
    legs : list of tuple
        Way over a frame past each end [m], unit direction of its leg, and length [m].
    max_turn : float or Dr.Jit float64 number
        [rad]; `STEADY` where patches do not follow from motion.
    arm : float or Dr.Jit float64 number
        Distance of the outermost antenna of a wide array from its centre [m]; 0 for one that is not wide.
    """
    change = sum((dr.norm(way - dr.dot(way, ray) * ray) + arm) / distance for way, ray, distance in legs)
    return 12.0 / max_turn**2 * wavenumber * change


def is_oblique(dr: ModuleType, ends: Ends) -> DeviceArray:
    """Return which patches :func:`edge_terms` are right for."""
    corner = ends.corner
    normal = dr.normalize(dr.cross(corner[1] - corner[0], corner[2] - corner[0]))
    least = dr.inf
    for point in corner:
        least = dr.minimum(least, dr.squared_norm(_slope(dr, point, ends, normal)))
    return least > _flat(dr, ends)


def edge_terms(on: Device, ends: Ends) -> list[tuple[DeviceArray, DeviceArray]]:
    r"""Return the parts of the integrals of exp(-jk length) over oblique patches, each without its own phase.

    Parameters
    ----------
    on : Device
    ends : Ends

    Returns
    -------
    list of six pairs
        Real and imaginary part of the three corners, then of the middles of the three edges, edge i from corner i to
        i + 1 [m2]. The integral is their sum, each times exp(-jk length) at its point.

    Notes
    -----
    With the slope :math:`g = \nabla \phi` of the phase along the face, the outward normal n of an edge in the face and
    a strength w that changes slowly, the divergence theorem gives

    .. math:: \int w e^{j \phi} dA = \oint w \frac{n \cdot g}{j |g|^2} e^{j \phi} dl + O(\nabla g / g^2)

    and an edge with unit vector t, along which the slope :math:`\phi' = g \cdot t` does not vanish, is in the same way

    .. math:: \left[ w \frac{n \cdot g}{j |g|^2} \frac{e^{j \phi}}{j \phi'} \right]

    w is (cos of incidence + cos of return) / (length there x length back), relative to the patch's middle, to which the
    currents of physical optics of a perfect conductor are proportional.

    References
    ----------
    .. [1] W. B. Gordon, "Far-Field Approximations to the Kirchhoff-Helmholtz Representations of Scattered Fields",
           IEEE Trans. Antennas Propag. 23(4), 1975.
    """
    dr, mi, Real = on.dr, on.mi, on.Real
    corner, source, receiver = ends.corner, ends.source, ends.receiver
    normal = dr.normalize(dr.cross(corner[1] - corner[0], corner[2] - corner[0]))
    strength, flat = _Strength(dr, ends, normal), _flat(dr, ends)
    place, share = np.polynomial.legendre.leggauss(NODES)
    places, shares = Real((place + 1.0) / 2.0), Real(share / 2.0)
    at_corner = [[Real(0.0), Real(0.0)] for _ in range(3)]
    at_middle = []
    for k in range(3):
        start, side = corner[k], corner[(k + 1) % 3] - corner[k]
        extent = dr.norm(side)
        along = side / dr.maximum(extent, 1e-30)
        outward = dr.cross(along, normal)
        tips = [strength.along(start, along, outward), strength.along(start + side, along, outward)]
        steep = dr.minimum(dr.abs(tips[0][1]), dr.abs(tips[1][1])) ** 2 > flat
        steep &= tips[0][1] * tips[1][1] > 0.0
        for sign, number, (weight, slope) in zip((1.0, -1.0), (k, (k + 1) % 3), tips, strict=True):  # 1 / j^2 = -1
            at_corner[number][0] += dr.select(steep, sign * weight / dr.select(steep, slope, 1.0), 0.0)
        middle = start + 0.5 * side
        length = dr.norm(middle - source) + dr.norm(middle - receiver)

        def node(
            number: DeviceArray,
            re: DeviceArray,
            im: DeviceArray,
            line: tuple[DeviceArray, ...] = (start, side, along, outward, length),
        ) -> tuple[DeviceArray, ...]:
            start, side, along, outward, length = line
            point = start + dr.gather(Real, places, number) * side
            weight = strength.along(point, along, outward)[0] * dr.gather(Real, shares, number)
            phase = ends.wavenumber * (length - dr.norm(point - source) - dr.norm(point - receiver))
            sine, cosine = dr.sincos(phase)
            return number + 1, re + weight * sine, im - weight * cosine  # 1 / j = -j

        width = dr.width(extent)
        state = (dr.zeros(mi.UInt32, width), dr.zeros(Real, width), dr.zeros(Real, width))
        _, re, im = dr.while_loop(
            state, lambda number, re, im, wanted=~steep: wanted & (number < NODES), node, label="nodes of an edge"
        )
        at_middle.append((extent * re, extent * im))
    return [(re, im) for re, im in at_corner] + at_middle


class _Strength:
    """What an edge of a patch radiates, a metre, at its points."""

    def __init__(self, dr: ModuleType, ends: Ends, normal: DeviceArray) -> None:
        self._dr, self._ends, self._normal = dr, ends, normal
        center = (ends.corner[0] + ends.corner[1] + ends.corner[2]) / 3.0
        self._heights = [dr.abs(dr.dot(normal, center - end)) for end in (ends.source, ends.receiver)]
        self._middle = self._of_currents(center)

    def _of_currents(self, point: DeviceArray) -> DeviceArray:
        out, home = (self._dr.norm(point - end) for end in (self._ends.source, self._ends.receiver))
        return (self._heights[0] / out + self._heights[1] / home) / (out * home)

    def along(self, point: DeviceArray, along: DeviceArray, outward: DeviceArray) -> tuple[DeviceArray, DeviceArray]:
        """Return w (n . g) / |g|^2, and the slope along the edge."""
        dr = self._dr
        slope = _slope(dr, point, self._ends, self._normal)
        weight = self._of_currents(point) / self._middle
        weight *= dr.dot(outward, slope) / dr.maximum(dr.squared_norm(slope), 1e-30)
        return weight, dr.dot(along, slope)


def _flat(dr: ModuleType, ends: Ends) -> DeviceArray:
    """Return the square of the slope up to which edges do not represent patches [rad2/m2]."""
    center = (ends.corner[0] + ends.corner[1] + ends.corner[2]) / 3.0
    curvature = 1.0 / dr.norm(center - ends.source) + 1.0 / dr.norm(center - ends.receiver)
    return dr.maximum(ends.wavenumber * curvature / CURVATURE, ends.steady**2)


def _slope(dr: ModuleType, point: DeviceArray, ends: Ends, normal: DeviceArray) -> DeviceArray:
    """Return the gradient of the phase -k length along a plane [rad/m]."""
    ahead = dr.normalize(point - ends.source) + dr.normalize(point - ends.receiver)
    return -ends.wavenumber * (ahead - dr.dot(ahead, normal) * normal)
