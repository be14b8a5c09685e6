"""Currents and fields of a perfectly conducting wedge, exact: series of Bessel functions, and Keller's coefficients.

The wedge has its edge along z; its faces are at the azimuths 0 and N pi, and the field is outside between them. Time
dependence e^{+jwt}. Sources: J. J. Bowman et al., *Electromagnetic and Acoustic Scattering by Simple Shapes*, 1969,
section 6.2 (series); P. Ya. Ufimtsev, *Fundamentals of the Physical Theory of Diffraction*, 2007, chapters 2 to 4, and
J. B. Keller, "Geometrical theory of diffraction", J. Opt. Soc. Am. 52(2), 1962 (coefficients).
"""

from __future__ import annotations

import numpy as np
from scipy.integrate import simpson
from scipy.special import jv

FARTHEST, STEP = 70.0, 0.02
"""Range of k sin(b) times the distance from the edge over which currents are integrated; the outer half is faded."""


def face_currents(ratio, source, distance):
    """Return H_z and the normal derivative of E_z, over j k_t, on the face at azimuth 0; unit E_z and H_z come in.

    `distance` is k_t times the distance from the edge, `ratio` N, `source` the azimuth of the source [rad].
    """
    order = np.arange(0, int(ratio * (distance.max() + 40.0)))[:, None] / ratio
    waves = np.exp(0.5j * np.pi * order) * jv(order, distance[None])
    hard = 2.0 / ratio * ((np.where(order > 0.0, 2.0, 1.0) * np.cos(order * source)) * waves).sum(axis=0)
    soft = 4.0 / ratio * (order * np.sin(order * source) * waves).sum(axis=0) / (1j * distance)
    return hard, soft


def fringe_integrals(ratio, source, mu):
    """Return k_t times the integrals of both currents, less those of physical optics, with the phase exp(j mu k_t x).

    The last value is the first current of the fringe at the edge itself.
    """
    s = np.linspace(1e-6, FARTHEST, int(FARTHEST / STEP) + 1)
    t = s**2 / FARTHEST  # fine near the edge, where currents have a root
    hard, soft = face_currents(ratio, source, t)
    if source < np.pi:
        plain = 2.0 * np.exp(1j * t * np.cos(source))
        hard, soft = hard - plain, soft - np.sin(source) * plain
    fade = np.clip(2.0 - 2.0 * t / FARTHEST, 0.0, 1.0)
    fade = fade**4 * (35.0 - 84.0 * fade + 70.0 * fade**2 - 20.0 * fade**3)
    weight = fade * np.exp(1j * mu * t) * 2.0 * np.sqrt(t / FARTHEST)
    tip = 2.0 / ratio - 2.0 * (source < np.pi)
    return simpson(hard * weight, x=s), simpson(soft * weight, x=s), tip


def keller(ratio, source, observer):
    """Return the soft and the hard diffraction coefficient, f and g of Ufimtsev, at azimuths away from the borders."""
    first = 1.0 / (np.cos(np.pi / ratio) - np.cos((observer - source) / ratio))
    second = 1.0 / (np.cos(np.pi / ratio) - np.cos((observer + source) / ratio))
    scale = np.sin(np.pi / ratio) / ratio
    return scale * (first - second), scale * (first + second)


def optics(ratio, source, observer):
    """Return what physical optics has of both coefficients, f0 and g0: of the lit faces."""
    f, g = np.zeros(2)
    for own, seen in ((source, observer), (ratio * np.pi - source, ratio * np.pi - observer)):
        if own < np.pi:
            f += np.sin(own) / (np.cos(own) + np.cos(seen))
            g -= np.sin(seen) / (np.cos(own) + np.cos(seen))
    return f, g
