"""The Mie series for drops of any size: one pass over the orders, nothing kept but the sums."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


def mie_drops(index: complex, size: Array) -> tuple[Array, Array]:
    """Return the efficiencies of extinction and of backscatter of spheres of rising sizes x = pi D / wavelength.

    `index` with a positive imaginary part; Bohren and Huffman 1983, chapter 4. Riccati-Bessel functions by upward
    recurrence, which holds up to the last order that counts; the logarithmic derivative by downward recurrence.
    """
    last = np.ceil(size + 4.05 * np.cbrt(size) + 2.0).astype(int)
    orders = int(last.max())
    inner = index * size
    derivative = np.zeros((orders + 1, size.size), dtype=complex)
    current = np.zeros(size.size, dtype=complex)
    for order in range(int(max(orders, np.abs(inner).max())) + 16, 0, -1):
        current = order / inner - 1.0 / (current + order / inner)
        if order - 1 <= orders:
            derivative[order - 1] = current
    before, now = np.stack([np.cos(size), -np.sin(size)]), np.stack([np.sin(size), np.cos(size)])
    extinction, back = np.zeros(size.size), np.zeros(size.size, dtype=complex)
    for order in range(1, orders + 1):
        on = slice(int(np.searchsorted(last, order)), None)
        x = size[on]
        after = (2 * order - 1) / x * now[:, on] - before[:, on]
        old = now[:, on].copy()
        before[:, on], now[:, on] = old, after
        hankel, old_hankel = after[0] - 1j * after[1], old[0] - 1j * old[1]
        electric = derivative[order, on] / index + order / x
        magnetic = derivative[order, on] * index + order / x
        a = (electric * after[0] - old[0]) / (electric * hankel - old_hankel)
        b = (magnetic * after[0] - old[0]) / (magnetic * hankel - old_hankel)
        extinction[on] += (2 * order + 1) * (a + b).real
        back[on] += (2 * order + 1) * (-1) ** order * (a - b)
    return 2.0 / size**2 * extinction, np.abs(back) ** 2 / size**2
