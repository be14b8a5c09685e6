"""Exact answers of mirror multipath: two-ray ground, ghosts behind a wall, ego double bounce.

The numbers come from closed forms, evaluated once by an independent script in double precision (77 GHz, c = 299792458
m/s, e^{+jwt}); the forms stand beside them, so each number can be checked by hand.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

FREQUENCY = 77e9
SPEED_OF_LIGHT = 299_792_458.0
WAVENUMBER = 2.0 * np.pi * FREQUENCY / SPEED_OF_LIGHT

RADAR_HEIGHT = 0.5
GROUND_RANGES = (5.0, 10.0, 20.0, 30.0, 50.0, 75.0, 100.0, 150.0)
TWO_RAY_DB = {
    ("H", 0.3): (6.872253, 7.719707, -2.253144, 11.327426, 11.708339, -30.64924, 4.729038, 11.962377),
    ("H", 0.5): (9.373457, 0.893732, 10.86205, 7.110714, 11.403242, 7.695872, 7.583883, -2.43182),
    ("H", 1.0): (-4.397706, 10.250929, 0.161089, 11.186979, -3.627544, 11.310461, 11.461265, 7.73441),
    ("H", 1.5): (7.898204, -16.379601, 2.015949, 0.057028, 7.827551, -3.576687, -2.151952, 11.480827),
    ("V", 0.3): (3.952393, 6.02729, -2.952726, 10.67313, 11.308387, -30.451815, 4.534464, 11.82671),
    ("V", 0.5): (5.534049, -0.50564, 9.665037, 6.306366, 10.907654, 7.370349, 7.328547, -2.586331),
    ("V", 1.0): (-2.50973, 7.140989, -0.997312, 9.999238, -4.246332, 10.809623, 11.086802, 7.488331),
    ("V", 1.5): (1.959363, -7.944965, 0.336186, -1.024547, 6.905923, -4.145524, -2.569659, 11.147143),
}
"""Two-way power over free space [dB] by (polarisation, target height [m]), in the order of `GROUND_RANGES`.

20 log10 |F|^2 with F = 1 + G (Rd / Rr) exp(-j k (Rr - Rd)), Rd and Rr = hypot(x, h1 -+ h2); G is Fresnel's coefficient
of 3.18 - 0.1j at the grazing angle asin((h1 + h2) / Rr): TE for H, TM for V. Isotropic antennas and scatterer.
"""

NULL_GROUND_RANGES = (
    128.4202299468,
    64.20719491712,
    42.80155210428,
    32.09775734573,
    25.67470180889,
    21.39201588291,
    18.33239830599,
    16.03719844723,
    14.25161040058,
    12.8227506224,
    11.65332958494,
    10.678487603,
)
"""Heights 0.5 m both, G = -1: ground ranges where Rr - Rd is 1, 2, ... 12 wavelengths [m]."""

ASPHALT_EXTREMA = {
    "H": {
        "min_x_m": (128.425109, 64.209806, 42.803342, 32.099202, 25.67568, 21.392903),
        "max_x_m": (85.645619, 51.377025, 36.692344, 28.534072, 23.3419, 19.746935),
        "max_dB": (11.903873, 11.812282, 11.720695, 11.629128, 11.537602, 11.446133),
    },
    "V": {
        "min_x_m": (128.418376, 64.205959, 42.800777, 32.097278, 25.674142, 21.391621),
        "max_x_m": (85.702725, 51.395497, 36.700589, 28.538346, 23.344347, 19.748414),
        "max_dB": (11.60929, 11.326496, 11.047859, 10.773308, 10.502771, 10.236183),
    },
}
"""Numerical extrema over ground range of the two-ray power for heights 0.5 m over 3.18 - 0.1j, the farthest first."""

WALL_GHOST = {
    "R_direct_m": 30.01666203961,
    "az_direct_deg": -1.909152432996,
    "az_image_deg": 16.69924423399,
    "apparent_range_type1_m": 30.66879078317,
    "apparent_range_type2_m": 31.32091952673,
    "v_direct_mps": -10.01110648491,
    "v_type1_mps": -9.866521639951,
    "v_type2_mps": -9.721936794995,
    "amp_type1_each_rel_dB": -0.3694421640089,
    "amp_type2_rel_dB": -0.7388843280177,
    "phase_type1_minus_direct_rad": 3.197068024461,
}
"""Target at (30, -1) m with velocity (-10, 0.5) m/s, perfectly conducting wall y = 4 m, radar at the origin.

Image (x, 2 W - y) with velocity (vx, -vy): type 1 at half the sum of both ranges and velocities, type 2 at the image's.
"""

CONCRETE_GHOST = {
    "R_direct_m": 15.0,
    "az_direct_deg": 0.0,
    "az_image_deg": 21.80140948635,
    "apparent_range_type1_m": 15.5777472107,
    "apparent_range_type2_m": 16.1554944214,
    "v_direct_mps": -5.0,
    "v_type1_mps": -4.821191727213,
    "v_type2_mps": -4.642383454426,
    "amp_type1_each_rel_dB": -3.754477464854,
    "amp_type2_rel_dB": -7.508954929708,
    "phase_type1_minus_direct_rad": 4.496510675008,
}
"""The same with the target at (15, 0) m, velocity (-5, 0) m/s, wall y = 3 m of concrete (ITU-R P.2040-3: 5.24 -
0.3224j), vertical polarisation, which is TE at a vertical wall."""


def ego_double_bounce(distance: float, velocity: float, setback: float) -> tuple[float, float]:
    """Return apparent range [m] and velocity [m/s] of target - own front - target: 2 R + b and 2 v.

    The front stands `setback` b behind the radar, so the length is R + 2 (R + b) + R.
    """
    return 2.0 * distance + setback, 2.0 * velocity


def mirrored(point: npt.ArrayLike, normal: npt.ArrayLike, offset: float) -> npt.NDArray[np.float64]:
    """Return the mirror image of a point in the plane normal . x = offset (unit normal)."""
    n = np.asarray(normal, dtype=np.float64)
    p = np.asarray(point, dtype=np.float64)
    return p - 2.0 * (p @ n - offset) * n
