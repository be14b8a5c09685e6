"""Integral of a plane wave's phase over triangles, exact for every size from a point to thousands of wavelengths."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Real = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]

_SERIES_BELOW = 1.0
"""Largest difference of the corner phases [rad] for which the power series is used."""
_SERIES_TERMS = 15
"""The first term left out is below 1 / 17! = 3e-15 of the sum."""


def triangle_phase_integral(corners: Real, wave_vector: Real) -> Complex:
    r"""Return the integral of exp(j q . r) over triangles.

    Parameters
    ----------
    corners : ndarray of float64, shape (num_triangles, 3, 3)
        Corner points [m].
    wave_vector : ndarray of float64, shape (num_triangles, 3)
        q [rad/m].

    Returns
    -------
    ndarray of complex128, shape (num_triangles,)
        [m2].

    Notes
    -----
    With the corner phases :math:`a_i = q \cdot r_i` and the area A, the integral is the second divided difference of
    the exponential, :math:`2 A \exp[j a_0, j a_1, j a_2]` (Hermite-Genocchi). It is formed over the two phases that
    differ most, so nothing cancels, and by a power series where all phases nearly agree.

    References
    ----------
    .. [1] C. de Boor, "Divided Differences", Surveys in Approximation Theory 1, 2005, section 9.
    """
    side_a, side_b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    twice_area = np.linalg.norm(np.cross(side_a, side_b), axis=1)
    phase = np.sort(np.einsum("nij,nj->ni", corners, wave_vector), axis=1)
    return twice_area * _second_difference(phase)


def _second_difference(phase: Real) -> Complex:
    """Return exp[j a0, j a1, j a2] of rising phases, shape (n, 3)."""
    low, middle, high = phase.T
    spread = high - low
    large = spread > _SERIES_BELOW
    result = np.empty(len(phase), dtype=np.complex128)
    upper = _first_difference(high[large], middle[large])
    lower = _first_difference(middle[large], low[large])
    result[large] = (upper - lower) / (1j * spread[large])
    result[~large] = _series(phase[~large])
    return result


def _first_difference(x: Real, y: Real) -> Complex:
    """Return exp[j x, j y], which is exp(j (x + y) / 2) times sinc."""
    return np.asarray(np.exp(0.5j * (x + y)) * np.sinc((x - y) / (2.0 * np.pi)))


def _series(phase: Real) -> Complex:
    """Return the sum of j^n h_n / (n + 2)! about the mean phase; h_n are complete symmetric polynomials."""
    mean = phase.mean(axis=1)
    a, b, c = (phase - mean[:, None]).T
    e2, e3 = a * b + b * c + c * a, a * b * c  # e1 = 0 about the mean
    h = [np.ones_like(a), np.zeros_like(a), -e2]
    for order in range(3, _SERIES_TERMS):
        h.append(-e2 * h[order - 2] + e3 * h[order - 3])
    total = np.zeros(len(phase), dtype=np.complex128)
    factor = 0.5 + 0j
    for order, polynomial in enumerate(h):
        total += factor * polynomial
        factor *= 1j / (order + 3)
    return np.asarray(np.exp(1j * mean) * total)
