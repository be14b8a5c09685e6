"""Integral over patches of the phase of a path over them, with spherical waves on both sides, in Dr.Jit."""

from __future__ import annotations

from typing import Any

from scarl_sionna.engine.rays.face_rays import FaceRays

_SERIES_BELOW = 1.0
"""Largest difference of the corner phases [rad] for which the power series is used."""
_SERIES_TERMS = 12
"""The first term left out is below 1 / 14! = 1e-11 of the sum."""

Complex = tuple[Any, Any]


def phase_integral(
    rays: FaceRays, corner: list[Any], source: Any, receiver: Any, wavenumber: float, largest: float
) -> Complex:
    r"""Return the integrals over triangles of exp(-jk (length - length at the centre)) from sources to a receiver.

    Parameters
    ----------
    rays : FaceRays
    corner : list of Dr.Jit Array3f64
        The three corners [m].
    source, receiver : Dr.Jit Array3f64
    wavenumber : float
        [rad/m].
    largest : float
        A triangle is cut into n^2 equal ones, so that the phase departs from a linear one by less than this at half of
        their sides [rad].

    Returns
    -------
    tuple
        Real and imaginary part [m2].

    Notes
    -----
    Over each part the linear phase is integrated exactly, and the quadratic one enters by its mean, a 12th of the sum over
    the corners.
    """
    dr, mi, Real = rays.dr, rays.mi, rays.Real
    center = (corner[0] + corner[1] + corner[2]) / 3.0
    out, home = dr.norm(center - source), dr.norm(center - receiver)
    edge = [corner[(k + 1) % 3] - corner[k] for k in range(3)]
    longest = dr.maximum(dr.maximum(dr.squared_norm(edge[0]), dr.squared_norm(edge[1])), dr.squared_norm(edge[2]))
    cuts = dr.ceil(dr.sqrt(wavenumber * longest * (1.0 / out + 1.0 / home) / 8.0 / largest))
    cuts = dr.maximum(cuts, 1.0)
    step_a, step_b = edge[0] / cuts, edge[1] / cuts
    twice_area = dr.norm(dr.cross(step_a, step_b))
    length = out + home

    def step(index: Any, row: Any, column: Any, re: Any, im: Any) -> tuple[Any, ...]:
        half = dr.floor(0.5 * column)
        down = column - 2.0 * half > 0.5  # every other part of a row stands on its head
        apex = corner[0] + row * step_a + half * step_b
        low = apex + step_a
        parts = [apex, low + dr.select(down, step_b, 0.0 * step_b), dr.select(down, apex, low) + step_b]
        part = _linear_integral(dr, parts, source, receiver, wavenumber, length)
        last = column > 2.0 * row - 0.5
        return (
            index + 1, dr.select(last, row + 1.0, row), dr.select(last, 0.0, column + 1.0), re + part[0], im + part[1],
        )  # fmt: skip

    zero = dr.zeros(Real, dr.width(longest))
    number = mi.UInt32(cuts * cuts)
    state = (dr.zeros(mi.UInt32, dr.width(longest)), zero, Real(zero), Real(zero), Real(zero))
    _, _, _, re, im = dr.while_loop(
        state, lambda index, row, column, re, im: index < number, step, label="parts of patches"
    )
    return re * twice_area, im * twice_area


def _linear_integral(dr: Any, corner: list[Any], source: Any, receiver: Any, wavenumber: float, length: Any) -> Complex:
    """Return the mean of the phase factor over triangles, times a half."""
    center = (corner[0] + corner[1] + corner[2]) / 3.0
    arriving, leaving = center - source, receiver - center
    out, home = dr.norm(arriving), dr.norm(leaving)
    arriving, leaving = arriving / out, leaving / home
    slope = wavenumber * (leaving - arriving)
    phases, spread = [], 0.0
    for point in corner:
        offset = point - center
        square = dr.squared_norm(offset)
        spread += (square - dr.dot(offset, arriving) ** 2) / out + (square - dr.dot(offset, leaving) ** 2) / home
        phases.append(dr.dot(offset, slope))
    phase = wavenumber * (out + home - length + spread / 24.0)
    sine, cosine = dr.sincos(phase)
    re, im = second_difference(dr, *phases)
    return re * cosine + im * sine, im * cosine - re * sine


def second_difference(dr: Any, a: Any, b: Any, c: Any) -> Complex:
    r"""Return the divided difference exp[ja, jb, jc] of three phases that sum to zero.

    Notes
    -----
    Twice the area times it is the integral of the phase factor over a triangle (Hermite-Genocchi). It is formed over the
    two phases that differ most, so nothing cancels, and by the power series of complete symmetric polynomials where all nearly
    agree; e_1 = 0 since the phases sum to zero.

    References
    ----------
    .. [1] C. de Boor, "Divided Differences", Surveys in Approximation Theory 1, 2005, section 9.
    """
    low, high = dr.minimum(dr.minimum(a, b), c), dr.maximum(dr.maximum(a, b), c)
    middle = -(low + high)
    spread = high - low
    upper, lower = _first_difference(dr, high, middle), _first_difference(dr, middle, low)
    large = (upper[1] - lower[1]) / spread, -(upper[0] - lower[0]) / spread
    e2, e3 = a * b + b * c + c * a, a * b * c
    h = [1.0 + 0.0 * e2, 0.0 * e2, -e2]
    for order in range(3, _SERIES_TERMS):
        h.append(-e2 * h[order - 2] + e3 * h[order - 3])
    re, im, factor = 0.0 * e2, 0.0 * e2, 0.5
    for order, polynomial in enumerate(h):  # j^n / (n + 2)!
        term = factor * polynomial * (-1.0) ** (order // 2)
        if order % 2:
            im += term
        else:
            re += term
        factor /= order + 3
    small = spread < _SERIES_BELOW
    return dr.select(small, re, large[0]), dr.select(small, im, large[1])


def _first_difference(dr: Any, x: Any, y: Any) -> Complex:
    """Return exp[j x, j y], which is exp(j (x + y) / 2) times sinc."""
    sine, cosine = dr.sincos(0.5 * (x + y))
    half = 0.5 * (x - y)
    sinc = dr.select(dr.abs(half) < 1e-9, 1.0, dr.sin(half) / half)
    return cosine * sinc, sine * sinc
