"""Scattering of a homogeneous sphere, the Mie series: extinction, scattering and backscatter of drops and flakes."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.special import spherical_jn, spherical_yn

from scarl_sionna.core.errors import ParameterRangeError

Array = npt.NDArray[np.float64]

LARGEST_SIZE = 200.0
"""Size parameter up to which the series is summed; a drop of 8 mm at 80 GHz has 6.7."""


def mie_efficiencies(permittivity: complex, size: npt.ArrayLike) -> tuple[Array, Array, Array]:
    r"""Return the efficiencies of a sphere: cross-sections over the area of its disc.

    Parameters
    ----------
    permittivity : complex
        Relative, imaginary part <= 0 for losses.
    size : array_like of float, shape (num_sizes,)
        Size parameter x = pi D / wavelength, > 0 and at most `LARGEST_SIZE`.

    Returns
    -------
    extinction, scattering, backscatter : ndarray of float64, shape (num_sizes,)
        The last is the monostatic radar cross-section over :math:`\pi a^2`, the same for every polarisation.

    Raises
    ------
    ParameterRangeError
        If a size is outside the range above.

    Notes
    -----
    .. math:: Q_e = \frac{2}{x^2} \sum_n (2n + 1) \Re(a_n + b_n), \quad
              Q_s = \frac{2}{x^2} \sum_n (2n + 1) (|a_n|^2 + |b_n|^2), \quad
              Q_b = \frac{1}{x^2} \Big| \sum_n (2n + 1) (-1)^n (a_n - b_n) \Big|^2

    summed to :math:`x + 4 x^{1/3} + 2`; the logarithmic derivative of the inner field is found by downward recurrence.

    References
    ----------
    .. [1] C. F. Bohren, D. R. Huffman, *Absorption and Scattering of Light by Small Particles*, Wiley, 1983, chapter 4.
    .. [2] W. J. Wiscombe, "Improved Mie scattering algorithms", Appl. Opt. 19(9), 1980.
    """
    x = np.atleast_1d(np.asarray(size, dtype=np.float64))
    if x.size and not (x.min() > 0.0 and x.max() <= LARGEST_SIZE):
        raise ParameterRangeError("size", f"{x.min():g} to {x.max():g}", f"> 0 and <= {LARGEST_SIZE:g}")
    index = np.conj(np.sqrt(permittivity + 0j))  # with a positive imaginary part for losses, as in [1]
    a, b, weight = _coefficients(index, x)
    sign = (-1.0) ** np.arange(1, a.shape[0] + 1)[:, None]
    extinction = 2.0 / x**2 * np.sum(weight * (a + b).real, axis=0)
    scattering = 2.0 / x**2 * np.sum(weight * (np.abs(a) ** 2 + np.abs(b) ** 2), axis=0)
    backscatter = np.abs(np.sum(weight * sign * (a - b), axis=0)) ** 2 / x**2
    return extinction, scattering, backscatter


def _coefficients(
    index: complex, x: Array
) -> tuple[npt.NDArray[np.complex128], npt.NDArray[np.complex128], npt.NDArray[np.int64]]:
    """Return a_n and b_n, shape (num_orders, num_sizes), zero beyond a size's last order, and 2 n + 1."""
    last = np.ceil(x + 4.0 * np.cbrt(x) + 2.0)
    orders = np.arange(1, int(last.max()) + 1)[:, None]
    inner = index * x
    derivative = np.zeros((len(orders) + 1, len(x)), dtype=np.complex128)
    current: npt.NDArray[np.complex128] = np.zeros(len(x), dtype=np.complex128)
    for order in range(int(max(last.max(), np.abs(inner).max())) + 20, 0, -1):  # D_(n-1) from D_n
        current = np.asarray(order / inner - 1.0 / (current + order / inner), dtype=np.complex128)
        if order - 1 <= len(orders):
            derivative[order - 1] = current
    with np.errstate(over="ignore", invalid="ignore"):
        bessel = x * spherical_jn(np.arange(len(orders) + 1)[:, None], x)
        hankel = bessel + 1j * x * spherical_yn(np.arange(len(orders) + 1)[:, None], x)
        electric = derivative[1:] / index + orders / x
        magnetic = derivative[1:] * index + orders / x
        a = (electric * bessel[1:] - bessel[:-1]) / (electric * hankel[1:] - hankel[:-1])
        b = (magnetic * bessel[1:] - bessel[:-1]) / (magnetic * hankel[1:] - hankel[:-1])
    beyond = orders > last
    return np.where(beyond, 0.0, a), np.where(beyond, 0.0, b), 2 * orders + 1
