"""Integral of the phase factor of spherical waves over triangles seen obliquely: by their edges alone."""

from __future__ import annotations

from types import ModuleType

import numpy as np

from scarl_sionna.engine.device import Device
from scarl_sionna.engine.types import DeviceArray

Pair = tuple[DeviceArray, DeviceArray]

OBLIQUE = 20.0
"""Phase [rad] over the longest side from which on a triangle is integrated by its edges, and over a side from which on
that is by its ends: what is left out is the curvature of the phase over the square of its slope, with a departure from
a linear phase by 1 rad 2 %, the same on both sides of a common edge."""
NODES = 16
"""Gauss-Legendre nodes of a side that is integrated by points: over 25 rad right to 1e-6."""


def is_oblique(
    dr: ModuleType, corner: list[DeviceArray], source: DeviceArray, receiver: DeviceArray, wavenumber: float
) -> DeviceArray:
    """Return which triangles :func:`edge_integral` is right for."""
    edge = [corner[(k + 1) % 3] - corner[k] for k in range(3)]
    longest = dr.maximum(dr.maximum(dr.squared_norm(edge[0]), dr.squared_norm(edge[1])), dr.squared_norm(edge[2]))
    normal = dr.normalize(dr.cross(edge[0], edge[1]))
    least = dr.inf
    for point in corner:
        slope = _slope(dr, point, source, receiver, normal, wavenumber)
        least = dr.minimum(least, dr.squared_norm(slope))
    return least * longest > OBLIQUE**2


def edge_integral(
    on: Device, corner: list[DeviceArray], source: DeviceArray, receiver: DeviceArray, wavenumber: float
) -> Pair:
    r"""Return the integrals over triangles of exp(-jk (length - length at the centre)) by their edges.

    Parameters
    ----------
    on : Device
    corner : list of Dr.Jit Array3f64
        The three corners [m].
    source, receiver : Dr.Jit Array3f64
    wavenumber : float
        [rad/m].

    Returns
    -------
    tuple
        Real and imaginary part [m2].

    Notes
    -----
    With the slope :math:`g = \nabla \phi` of the phase along the face and the outward normal n of an edge, the
    divergence theorem gives

    .. math:: \int e^{j \phi} dA = \oint \frac{n \cdot g}{j |g|^2} e^{j \phi} dl + O(\nabla g / g^2)

    and in the same way a side whose own slope :math:`\phi' = g \cdot t` does not vanish is

    .. math:: \left[ \frac{n \cdot g}{j |g|^2} \frac{e^{j \phi}}{j \phi'} \right]

    Both depend on the edge alone, so what neighbours have in common cancels, however many there are. A sum of small
    triangles of linear phase keeps instead what each kink between them scatters, which falls with the square root of
    their size only.

    References
    ----------
    .. [1] W. B. Gordon, "Far-Field Approximations to the Kirchhoff-Helmholtz Representations of Scattered Fields",
           IEEE Trans. Antennas Propag. 23(4), 1975.
    """
    dr, mi, Real = on.dr, on.mi, on.Real
    center = (corner[0] + corner[1] + corner[2]) / 3.0
    length = dr.norm(center - source) + dr.norm(center - receiver)
    normal = dr.normalize(dr.cross(corner[1] - corner[0], corner[2] - corner[0]))
    place, share = np.polynomial.legendre.leggauss(NODES)
    places, shares = Real((place + 1.0) / 2.0), Real(share / 2.0)
    total_re, total_im = 0.0, 0.0
    for k in range(3):
        start, side = corner[k], corner[(k + 1) % 3] - corner[k]
        extent = dr.norm(side)
        along = side / dr.maximum(extent, 1e-30)
        outward = dr.cross(along, normal)

        def density(
            point: DeviceArray, along: DeviceArray = along, outward: DeviceArray = outward
        ) -> tuple[DeviceArray, DeviceArray, DeviceArray]:
            """Return (n . g) / |g|^2, the slope along the side, and the phase at points of the side."""
            slope = _slope(dr, point, source, receiver, normal, wavenumber)
            phase = wavenumber * (length - dr.norm(point - source) - dr.norm(receiver - point))
            return dr.dot(outward, slope) / dr.maximum(dr.squared_norm(slope), 1e-30), dr.dot(along, slope), phase

        ends = [density(start), density(start + side)]
        steep = dr.minimum(dr.abs(ends[0][1]), dr.abs(ends[1][1])) * extent > OBLIQUE
        steep &= ends[0][1] * ends[1][1] > 0.0
        re, im = 0.0, 0.0
        for sign, (weight, slope, phase) in zip((1.0, -1.0), ends, strict=True):  # 1 / j^2 = -1
            sine, cosine = dr.sincos(phase)
            factor = sign * weight / dr.select(steep, slope, 1.0)
            re, im = re + factor * cosine, im + factor * sine

        def node(
            number: DeviceArray,
            re: DeviceArray,
            im: DeviceArray,
            start: DeviceArray = start,
            side: DeviceArray = side,
            density: object = density,
        ) -> tuple[DeviceArray, ...]:
            weight, _, phase = density(start + dr.gather(Real, places, number) * side)  # type: ignore[operator]
            weight = weight * dr.gather(Real, shares, number)
            sine, cosine = dr.sincos(phase)
            return number + 1, re + weight * sine, im - weight * cosine  # 1 / j = -j

        width = dr.width(extent)
        state = (dr.zeros(mi.UInt32, width), dr.zeros(Real, width), dr.zeros(Real, width))
        flat = ~steep
        _, by_re, by_im = dr.while_loop(
            state, lambda number, re, im, flat=flat: flat & (number < NODES), node, label="nodes of a side"
        )
        total_re += dr.select(steep, re, extent * by_re)
        total_im += dr.select(steep, im, extent * by_im)
    return total_re, total_im


def _slope(
    dr: ModuleType,
    point: DeviceArray,
    source: DeviceArray,
    receiver: DeviceArray,
    normal: DeviceArray,
    wavenumber: float,
) -> DeviceArray:
    """Return the gradient of the phase -k length along a plane [rad/m]."""
    ahead = dr.normalize(point - source) + dr.normalize(point - receiver)
    return -wavenumber * (ahead - dr.dot(ahead, normal) * normal)
