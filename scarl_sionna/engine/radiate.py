"""What many triangles radiate towards many aspects at once, in single precision on the engine."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from . import variant

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex64]

LANES = 1 << 22
"""Pairs of an aspect and a triangle worked at once: some 300 MB."""
_SERIES_BELOW = 1.0
"""Largest difference of the corner phases [rad] for which the power series is used; its first term left out is 2e-8."""


def phase_integrals(points: Array, twice_area: Array, wave_vectors: Array) -> Complex:
    r"""Return the integral of exp(j q . r) over triangles for many q.

    Parameters
    ----------
    points : ndarray of float64, shape (num_triangles, 3, 3)
        Corners from where their phase is zero [m]; single precision keeps 1e-4 rad up to 1000 rad.
    twice_area : ndarray of float64, shape (num_triangles,)
        [m2].
    wave_vectors : ndarray of float64, shape (num_aspects, 3)
        q [rad/m].

    Returns
    -------
    ndarray of complex64, shape (num_aspects, num_triangles)
        [m2]. The same sum as :func:`scarl_sionna.radar.optics.far.phase.triangle_phase_integral`, whose notes explain it.
    """
    count = len(points)
    result = np.zeros((len(wave_vectors), count), dtype=np.complex64)
    if not count:
        return result
    step = max(LANES // count, 1)
    for first in range(0, len(wave_vectors), step):
        some = wave_vectors[first : first + step]
        result[first : first + len(some)] = _integrals(points, twice_area, some)
    return result


def _integrals(points: Array, twice_area: Array, wave_vectors: Array) -> Complex:
    import drjit as dr

    count, num_aspects = len(points), len(wave_vectors)
    with variant.radio() as mi:
        lane = dr.arange(mi.UInt32, count * num_aspects)
        size = dr.opaque(mi.UInt32, count)
        aspect = lane // size
        triangle = lane - aspect * size
        corner = [
            [dr.gather(mi.Float, mi.Float(_single(points[:, i, axis])), triangle) for axis in range(3)]
            for i in range(3)
        ]
        q = [dr.gather(mi.Float, mi.Float(_single(wave_vectors[:, axis])), aspect) for axis in range(3)]
        area = dr.gather(mi.Float, mi.Float(_single(twice_area)), triangle)
        a, b, c = (sum((q[axis] * one[axis] for axis in range(3)), start=mi.Float(0.0)) for one in corner)
        real, imaginary = _second_difference(dr, a, b, c)
        found = np.stack([(area * real).numpy(), (area * imaginary).numpy()], axis=-1)
    return found.reshape(num_aspects, count, 2).view(np.complex64)[..., 0]


def _single(values: Array) -> npt.NDArray[np.float32]:
    return np.ascontiguousarray(values, dtype=np.float32)


def _second_difference(dr: Any, a: Any, b: Any, c: Any) -> tuple[Any, Any]:
    """Return exp[j a, j b, j c], real and imaginary part."""
    low, high = dr.minimum(dr.minimum(a, b), c), dr.maximum(dr.maximum(a, b), c)
    middle = dr.maximum(dr.minimum(a, b), dr.minimum(dr.maximum(a, b), c))
    spread = high - low
    upper, lower = _first_difference(dr, high, middle), _first_difference(dr, middle, low)
    safe = dr.maximum(spread, _SERIES_BELOW)
    real, imaginary = (upper[1] - lower[1]) / safe, (lower[0] - upper[0]) / safe
    mean = (a + b + c) / 3.0
    x, y, z = a - mean, b - mean, c - mean
    e2, e3 = x * y + y * z + z * x, x * y * z
    even = 1.0 / 2.0 + e2 / 24.0 + e2 * e2 / 720.0 + (e2 * e2 * e2 - e3 * e3) / 40320.0
    odd = -e3 / 120.0 - e2 * e3 / 2520.0
    sine, cosine = dr.sincos(mean)
    small = spread < _SERIES_BELOW
    return (
        dr.select(small, even * cosine - odd * sine, real),
        dr.select(small, even * sine + odd * cosine, imaginary),
    )


def _first_difference(dr: Any, x: Any, y: Any) -> tuple[Any, Any]:
    """Return exp[j x, j y], which is exp(j (x + y) / 2) times sinc."""
    half = (x - y) / 2.0
    sinc = dr.select(half < 1e-3, 1.0 - half * half / 6.0, dr.sin(half) / dr.maximum(half, 1e-3))
    sine, cosine = dr.sincos((x + y) / 2.0)
    return sinc * cosine, sinc * sine
