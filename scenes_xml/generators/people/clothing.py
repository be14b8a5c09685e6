"""Clothes and bags of people, in the frames of the body segments that carry them (see pedestrian.py).

In its heights.
"""

from __future__ import annotations

import numpy as np

from ..geometry.mesh import Mesh, box, merge, tube
from .pedestrian import LIGHT_TRUNK, BodyShape, ellipsoid, fair_girth, loft


def _skirt(rows: list[tuple[float, float, float, float]], shape: BodyShape, light: bool) -> Mesh:
    """Return a hanging garment around the trunk from (z, half depth, half width, middle x)."""
    h, g = shape.height, shape.height * shape.build * (fair_girth(LIGHT_TRUNK) if light else 1.0)
    return loft(
        np.array([(z * h, depth * g, width * g * shape.hips, x * h, 0.0) for z, depth, width, x in rows]),
        LIGHT_TRUNK if light else 28,
        2.5,
    )


def jacket_hem(shape: BodyShape, light: bool = False) -> Mesh:
    """Return the lower part of a jacket, over the hips; it goes with the pelvis."""
    rows = [
        (-0.072, 0.092, 0.123, 0.004), (-0.065, 0.094, 0.125, 0.004), (-0.03, 0.086, 0.125, 0.002), (0.015, 0.073,
        0.116, 0.0),
        (0.050, 0.064, 0.096, 0.0), (0.075, 0.058, 0.081, 0.0), (0.085, 0.050, 0.070, 0.0),
    ]  # fmt: skip # a table
    return _skirt([rows[k] for k in (0, 3, 6)] if light else rows, shape, light)


def collar(shape: BodyShape) -> Mesh:
    """Return a collar; it goes with the torso."""
    h, g = shape.height, shape.height * shape.build
    rows = [
        (0.300, 0.044, 0.060, -0.006),
        (0.318, 0.041, 0.049, -0.006),
        (0.332, 0.040, 0.043, -0.004),
        (0.338, 0.037, 0.040, -0.003),
    ]
    return loft(np.array([(z * h, a * g, b * g, x * h, 0.0) for z, a, b, x in rows]), 20, 2.2)


def backpack(shape: BodyShape, light: bool = False) -> Mesh:
    """Return a backpack with its straps; it goes with the torso."""
    h, g = shape.height, shape.height * shape.build
    rows = [
        (0.045, 0.020, 0.050, -0.108), (0.055, 0.042, 0.074, -0.108), (0.12, 0.052, 0.080, -0.112), (0.20, 0.047,
        0.078, -0.106),
        (0.255, 0.034, 0.066, -0.096), (0.270, 0.015, 0.045, -0.090),
    ]  # fmt: skip # a table
    if light:
        rows = [rows[k] for k in (1, 3, 5)]
    sack = loft(np.array([(z * h, a * h, b * h, x * g, 0.0) for z, a, b, x in rows]), 8 if light else 22, 3.2)
    if light:
        return sack
    straps = []
    for side in (1.0, -1.0):
        y = side * 0.066 * g
        way = [
            (-0.060, 0.250),
            (-0.040, 0.296),
            (0.0, 0.302),
            (0.045, 0.272),
            (0.070, 0.20),
            (0.062, 0.12),
            (0.0, 0.085),
            (-0.066, 0.075),
        ]
        path = np.array([(x * g, y * (1.0 if z > 0.15 else 1.12), z * h) for x, z in way])
        straps.append(tube(path, 0.006 * h, 6))
    pocket = box((0.02 * h, 0.11 * h, 0.075 * h), (-0.112 * g - 0.052 * h, 0.0, 0.10 * h))
    return merge([sack, pocket, *straps])


def bicycle_helmet(shape: BodyShape, light: bool = False) -> Mesh:
    """Return a bicycle helmet; it goes with the head."""
    h = shape.height * shape.head_scale
    rows, segments = (3, 8) if light else (9, 22)
    shell = ellipsoid(
        (0.004 * h, 0.0, 0.078 * h), (0.069 * h, 0.057 * h, 0.072 * h), low=0.05, rows=rows, segments=segments
    )
    if light:
        return shell
    ribs = []
    for y in (-0.03, 0.0, 0.03):
        t = np.radians(np.linspace(15.0, 165.0, 9))
        top = 0.073 * h * np.sqrt(1.0 - (y / 0.056) ** 2)
        ribs.append(
            tube(
                np.stack([0.004 * h + 0.068 * h * np.cos(t), np.full(9, y * h), 0.078 * h + top * np.sin(t)], 1),
                0.005 * h,
                6,
            )
        )
    strap = tube(
        np.array(
            [
                (0.012, s * y, z)
                for s, y, z in (
                    (1, 0.052, 0.08),
                    (1, 0.046, 0.03),
                    (1, 0.02, 0.006),
                    (-1, 0.02, 0.006),
                    (-1, 0.046, 0.03),
                    (-1, 0.052, 0.08),
                )
            ]
        )
        * h,
        0.003 * h,
        5,
    )
    return merge([shell, *ribs, strap])


def motorcycle_helmet(shape: BodyShape, light: bool = False) -> tuple[Mesh, Mesh]:
    """Return shell and visor of a full-face helmet; they go with the head, whose face they cover."""
    h = shape.height * shape.head_scale
    rows, segments = (4, 7) if light else (14, 26)
    shell = ellipsoid(
        (0.006 * h, 0.0, 0.074 * h), (0.079 * h, 0.067 * h, 0.080 * h), low=-0.75, rows=rows, segments=segments
    )
    chin = ellipsoid(
        (0.040 * h, 0.0, 0.026 * h),
        (0.047 * h, 0.054 * h, 0.032 * h),
        rows=3 if light else rows // 2,
        segments=segments,
    )
    visor = ellipsoid(
        (0.030 * h, 0.0, 0.078 * h), (0.060 * h, 0.062 * h, 0.034 * h), rows=3 if light else rows - 4, segments=segments
    )
    return shell if light else merge([shell, chin]), visor
