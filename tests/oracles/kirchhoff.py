"""Kirchhoff's integral over a flat mirror that ends in a straight edge, by quadrature along the exact lengths.

The field that a point source sends over a conducting plane to a point is an integral over the plane of
exp(-jk (r1 + r2)) / (r1 r2), times a cosine that is all but constant about the reflection point; what an edge leaves of
it is the integral over the mirror over that over the whole plane. M. Born, E. Wolf, *Principles of Optics*, 7th ed.,
section 8.3.
"""

from __future__ import annotations

import numpy as np


def share_of_half_plane(source, point, end, wavelength, nodes=200_001, within=4.0):
    """Return the field over the half plane x < end of the plane y = 0, over that over all of it, complex.

    `source` and `point` are (x, y) on one side of it, at the same height z: along z, in which the mirror has no end,
    the integral is done by stationary phase. The infinite sides are faded out smoothly `within` metres from the
    reflection point.
    """
    (xs, ys), (xp, yp) = source, point
    middle = xs + (xp - xs) * ys / (ys + yp)
    k = 2 * np.pi / wavelength

    def integral(last):
        x = np.linspace(middle - within, last, nodes)
        fade = np.clip((within - np.abs(x - middle)) / (0.7 * within), 0.0, 1.0)
        fade = fade**3 * (10 - 15 * fade + 6 * fade**2)
        r1, r2 = np.hypot(x - xs, ys), np.hypot(x - xp, yp)
        along = 1 / np.sqrt(1 / r1 + 1 / r2)
        values = fade * along / (r1 * r2) * np.exp(-1j * k * (r1 + r2 - np.hypot(xp - xs, ys + yp)))
        return np.trapezoid(values, x)

    return integral(min(end, middle + within)) / integral(middle + within)
