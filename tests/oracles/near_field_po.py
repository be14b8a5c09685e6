"""Physical optics of a perfectly conducting rectangle seen by a radar nearby: the exact surface integral by quadrature.

For a short dipole-like isotropic source at p with field E = e exp(-jkR) / R across the ray, PO's current is J = 2 n x H
with eta H = u x E, and what it radiates back to p across the ray, times lambda / (4 pi) for an isotropic receiver, is
the transfer. C. A. Balanis, *Advanced Engineering Electromagnetics*, 2nd ed., sections 6.8 and 7.10. Gauss-Legendre in
both directions.
"""

from __future__ import annotations

import numpy as np


def rectangle_transfer(origin, side_u, side_v, radar, wavelength, vertical, nodes=400):
    """Return the received over transmitted field of a rectangle with one corner at `origin`, phase included.

    Both antennas are along `vertical` made transverse to each ray (the theta-hat of a radar whose z axis it is).
    """
    k = 2 * np.pi / wavelength
    x, w = np.polynomial.legendre.leggauss(nodes)
    x, w = (x + 1) / 2, w / 2
    s, t = np.meshgrid(x, x, indexing="ij")
    weight = np.outer(w, w)[..., None] * np.linalg.norm(np.cross(side_u, side_v))
    point = origin + s[..., None] * np.asarray(side_u) + t[..., None] * np.asarray(side_v)
    normal = np.cross(side_u, side_v)
    normal = normal / np.linalg.norm(normal)
    ray = point - radar
    distance = np.linalg.norm(ray, axis=-1, keepdims=True)
    u = ray / distance
    e = -(vertical - (u @ vertical)[..., None] * u)  # theta-hat points down where the ray is level
    e /= np.linalg.norm(e, axis=-1, keepdims=True)
    current = 2 * np.cross(normal * -np.sign((u @ normal)[..., None]), np.cross(u, e))
    radiated = -1j * k / (4 * np.pi) * np.sum(current * e, axis=-1, keepdims=True)
    return wavelength / (4 * np.pi) * np.sum(radiated * np.exp(-2j * k * distance) / distance**2 * weight)
