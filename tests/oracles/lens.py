"""Lens models written out for one point at a time, as their papers print them; imports math only."""

from __future__ import annotations

import math


def brown_conrady(x: float, y: float, c: tuple[float, ...]) -> tuple[float, float]:
    """Return the image point of (x, y) = (X/Z, Y/Z); c = k1, k2, p1, p2, k3, k4, k5, k6."""
    k1, k2, p1, p2, k3, k4, k5, k6 = c
    r2 = x**2 + y**2
    ratio = (1 + k1 * r2 + k2 * r2**2 + k3 * r2**3) / (1 + k4 * r2 + k5 * r2**2 + k6 * r2**3)
    return x * ratio + 2 * p1 * x * y + p2 * (r2 + 2 * x**2), y * ratio + p1 * (r2 + 2 * y**2) + 2 * p2 * x * y


def kannala_brandt(x: float, y: float, z: float, k: tuple[float, ...]) -> tuple[float, float]:
    """Return the image point of a direction."""
    across = math.hypot(x, y)
    theta = math.atan2(across, z)
    radius = theta + sum(value * theta ** (2 * i + 3) for i, value in enumerate(k))
    return radius * x / across, radius * y / across
