"""An object over a flat ground by image theory: four ways, each from the free-space field towards the image points.

The ways are straight, ground on the way there, ground on the way back, and both. Each is the field of the object alone
between the radar or its image below the ground and the radar or its image, times Fresnel's coefficient of every point
of the object for each leg over the ground. Vertical polarisation, e^{+jwt}, amplitudes of isotropic antennas.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

SPEED_OF_LIGHT = 299_792_458.0
Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]


def fresnel_tm(permittivity: complex, sine: Array) -> Complex:
    """Return the reflection coefficient of a half space for the electric field in the plane of incidence.

    Parameters
    ----------
    permittivity : complex
    sine : ndarray of float64
        Of the grazing angle.

    References
    ----------
    .. [1] Recommendation ITU-R P.2040-3, Eq. (37b); its sign is that of a perfect conductor, +1.
    """
    root = np.sqrt(permittivity - (1.0 - sine**2))
    return np.asarray((permittivity * sine - root) / (permittivity * sine + root))


def post_by_image_theory(
    distance: float, radius: float, post: float, radar: float, permittivity: complex, frequencies: Array
) -> Complex:
    """Return the field of a perfectly conducting round post that stands on the ground, shape (num_frequencies,).

    Parameters as of :func:`post_by_ways`; by definition, the sum of its ways.
    """
    return np.asarray(post_by_ways(distance, radius, post, radar, permittivity, frequencies).sum(axis=(0, 1)))


def post_by_ways(
    distance: float, radius: float, post: float, radar: float, permittivity: complex, frequencies: Array
) -> Complex:
    r"""Return the field of a perfectly conducting upright round post by its four ways.

    Parameters
    ----------
    distance : float
        From the radar to the axis [m].
    radius, post, radar : float
        Radius and height of the post, height of the radar [m].
    permittivity : complex
        Of the ground.
    frequencies : ndarray of float64, shape (num_frequencies,)
        [Hz].

    Returns
    -------
    ndarray of complex128, shape (2, 2, num_frequencies)
        First index: 0 straight there, 1 over the ground; second: the same of the way back.

    Notes
    -----
    Physical optics of the round surface, not of facets: with the horizontal distance rho from the radar to the front of
    the post, R_s and R_r from source and receiver to a point of its front line at height z, and the angle e of the way
    back over the horizontal,

    .. math:: a = \frac{-j}{8 \pi} \int_0^H \frac{2 \cos e}{R_s R_r} e^{-jk(R_s + R_r)}
              \sqrt{\frac{2 \pi a}{k d (1/R_s + 1/R_r)}} e^{-j \pi/4} dz

    The integral over the angle around the post is that by stationary phase, right to 1 / (k a).
    """
    wave = 2.0 * np.pi * frequencies[:, None] / SPEED_OF_LIGHT
    count = int(np.ceil(post / 2.5e-4))
    z = (np.arange(count) + 0.5) * post / count
    ground = distance - radius
    found = np.zeros((2, 2, len(frequencies)), dtype=np.complex128)
    legs = []
    for sign in (1.0, -1.0):
        height = z - sign * radar
        length = np.hypot(ground, height)
        legs.append((length, fresnel_tm(permittivity, height / length) if sign < 0.0 else np.ones(count)))
    for i, (there, first) in enumerate(legs):
        for j, (back, second) in enumerate(legs):
            around = np.sqrt(2.0 * np.pi * radius / (wave * distance * (1.0 / there + 1.0 / back)))
            along = 2.0 * ground / back / (there * back) * first * second
            found[i, j] = (along * around * np.exp(-1j * wave * (there + back))).sum(axis=1)
    return np.asarray(-1j / (8.0 * np.pi) * np.exp(-0.25j * np.pi) * found * post / count)


def body_by_image_theory(between, radar: float, permittivity: complex, wavenumber: Array) -> Complex:
    """Return the field of a body over a ground, shape (num_frequencies,), from what it scatters in free space.

    Parameters
    ----------
    between : callable
        From two stations (3,) [m], transmitter and receiver, to the paths of the body alone between them: end points
        that the transmitter and the receiver see, (num_paths, 3) each, lengths and amplitudes (VV).
    radar : float
        Height of the radar over the ground [m].
    permittivity : complex
        Of the ground.
    wavenumber : ndarray of float64, shape (num_frequencies,)
        [rad/m].
    """
    total: Complex = np.zeros(len(wavenumber), dtype=np.complex128)
    for there in (1.0, -1.0):
        for back in (1.0, -1.0):
            ends = [np.array([0.0, 0.0, sign * radar]) for sign in (there, back)]
            *points, length, amplitude = between(*ends)
            for sign, end, seen in zip((there, back), ends, points, strict=True):
                if sign < 0.0:
                    ray = seen - end
                    amplitude = amplitude * fresnel_tm(permittivity, ray[:, 2] / np.linalg.norm(ray, axis=1))
            for k, wave in enumerate(wavenumber):
                total[k] += (amplitude * np.exp(-1j * wave * length)).sum()
    return total
