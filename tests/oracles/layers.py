"""Plane layers by the characteristic matrix of Abeles; numpy only. Time dependence e^{+j w t}.

    M = prod_i [[cos d_i, j sin d_i / Y_i], [j Y_i sin d_i, cos d_i]],
    d_i = k q_i h_i,  q_i = sqrt(eps_i - sin(theta)^2)
    Y_TE = q,  Y_TM = eps / q;   [B, C] = M [1, Y_out];   r = (Y0 B - C) / (Y0 B + C),  t = 2 Y0 / (Y0 B + C)

r and t are of the field along the layers. For TM the field in the ray's own frame has the opposite sign of r.
"""

from __future__ import annotations

import numpy as np

SPEED_OF_LIGHT = 299_792_458.0


def layers(permittivities, depths, cosine, frequency):
    """(r_TE, r_TM), (t_TE, t_TM) between the outer faces, air on both sides, at one angle; r_TM in the ray's frame."""
    sine2, k = 1.0 - cosine**2, 2.0 * np.pi * frequency / SPEED_OF_LIGHT
    reflected, passed = [], []
    for magnetic in (False, True):
        matrix = np.eye(2, dtype=complex)
        for eps, depth in zip(permittivities, depths, strict=True):
            q = np.sqrt(complex(eps) - sine2)
            y, phase = (eps / q if magnetic else q), k * q * depth
            matrix = matrix @ np.array(
                [[np.cos(phase), 1j * np.sin(phase) / y], [1j * y * np.sin(phase), np.cos(phase)]]
            )
        air = 1.0 / cosine if magnetic else cosine
        b, c = matrix @ np.array([1.0, air])
        reflected.append((air * b - c) / (air * b + c) * (-1.0 if magnetic else 1.0))
        passed.append(2.0 * air / (air * b + c))
    return tuple(reflected), tuple(passed)


def shares(direction, normal):
    """Unit vectors across (TE) and in (TM) the plane of incidence of a ray."""
    s = np.cross(normal, direction)
    s = s / np.linalg.norm(s)
    return s, np.cross(s, direction)


def tube_spreading(reflect, source, receiver, hit, step=1e-5):
    """1 / distance-like spreading of a ray tube, by three neighbouring rays: sqrt(solid angle / area at the receiver).

    `reflect(source, direction)` gives the hit point and the reflected direction of a ray.
    """
    middle = (hit - source) / np.linalg.norm(hit - source)
    side = np.cross(middle, [0.0, 0.0, 1.0])
    side = side / np.linalg.norm(side)
    up = np.cross(side, middle)
    plane = reflect(source, middle)[1]
    ends = []
    for turn in (side, -side, up, -up):
        direction = middle + step * turn
        point, along = reflect(source, direction / np.linalg.norm(direction))
        ends.append(point + along * ((receiver - point) @ plane) / (along @ plane))
    area = np.linalg.norm(np.cross(ends[0] - ends[1], ends[2] - ends[3])) / (2.0 * step) ** 2
    return 1.0 / np.sqrt(area)
