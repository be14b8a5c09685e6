"""Closed bodies through rings: superellipses one above the other, and ellipsoids."""

from __future__ import annotations

import numpy as np

from .mesh import Array, Mesh, grid, merge, outward


def loft(rings: Array, segments: int = 20, exponent: float = 2.2) -> Mesh:
    """Return the closed body through superellipses.

    Parameters
    ----------
    rings : ndarray, shape (n, 5)
        Each: z, half extent along x, half extent along y, middle x, middle y [m].
    segments : int
        Corners of a ring.
    exponent : float
        2 is an ellipse, larger is boxier.
    """
    rings = np.asarray(rings, float)
    angle = np.arange(segments) * 2 * np.pi / segments
    cos, sin = np.cos(angle), np.sin(angle)
    unit = np.stack([np.sign(cos) * np.abs(cos) ** (2 / exponent), np.sign(sin) * np.abs(sin) ** (2 / exponent)], -1)
    points = np.empty((len(rings), segments, 3))
    points[..., 0] = rings[:, 3:4] + rings[:, 1:2] * unit[:, 0]
    points[..., 1] = rings[:, 4:5] + rings[:, 2:3] * unit[:, 1]
    points[..., 2] = rings[:, :1]
    parts = [grid(points, close_columns=True)]
    k = np.arange(segments)
    for ring, order in ((points[0], -1), (points[-1], 1)):
        fan = np.stack([k, (k + 1) % segments, np.full(segments, segments)], 1)[:, ::order]
        parts.append(Mesh(np.vstack([ring, ring.mean(0)]), fan.astype(np.int64)))
    side = parts[0]
    rising = rings[-1, 0] > rings[0, 0]
    parts[0] = side.flipped() if rising else side
    if not rising:
        parts[1], parts[2] = parts[1].flipped(), parts[2].flipped()
    return outward(merge(parts))


def ellipsoid(
    centre: tuple[float, float, float],
    radii: tuple[float, float, float],
    low: float = -1.0,
    rows: int = 14,
    segments: int = 22,
) -> Mesh:
    """Return an ellipsoid [m], cut off below `low` of its half height."""
    z = np.sin(np.radians(np.linspace(np.degrees(np.arcsin(max(low, -0.997))), 86.0, rows)))
    r = np.sqrt(1 - z * z)
    columns = [centre[2] + z * radii[2], r * radii[0], r * radii[1], np.full(rows, centre[0]), np.full(rows, centre[1])]
    return loft(np.stack(columns, 1), segments, 2.1)
