"""Height of the ground as it is built: the highest surface of a set of meshes above or below a place."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..geometry.mesh import Array, Mesh, grid
from .road import far_height


@dataclass
class Ground:
    """Meshes that things stand on."""

    corners: list[Array] = field(default_factory=list)

    def add(self, part: Mesh) -> Mesh:
        """Count a mesh to the ground and return it."""
        self.corners.append(part.vertices[part.faces])
        return part

    def height(self, places: Array, default: float | None = None) -> Array:
        """Return the height [m] of the ground at places, shape (n, 2 or 3) [m].

        Raises
        ------
        ValueError
            If there is no ground at a place and no `default` is given.
        """
        xy = np.atleast_2d(np.asarray(places, float))[:, :2]
        a, b, c = (np.concatenate(self.corners)[:, k] for k in range(3))
        low, high = np.minimum(np.minimum(a, b), c)[:, :2], np.maximum(np.maximum(a, b), c)[:, :2]
        det = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
        result = np.empty(len(xy))
        for k, p in enumerate(xy):
            near = np.flatnonzero(np.all((low <= p + 1e-9) & (high >= p - 1e-9), axis=1) & (np.abs(det) > 1e-9))
            u = (
                (p[0] - a[near, 0]) * (c[near, 1] - a[near, 1]) - (p[1] - a[near, 1]) * (c[near, 0] - a[near, 0])
            ) / det[near]
            v = (
                (b[near, 0] - a[near, 0]) * (p[1] - a[near, 1]) - (b[near, 1] - a[near, 1]) * (p[0] - a[near, 0])
            ) / det[near]
            within = (u > -1e-6) & (v > -1e-6) & (u + v < 1.0 + 1e-6)
            z = a[near, 2] + u * (b[near, 2] - a[near, 2]) + v * (c[near, 2] - a[near, 2])
            if within.any():
                result[k] = z[within].max()
            elif default is None:
                raise ValueError(f"no ground at {p.round(2).tolist()} m")
            else:
                result[k] = default
        return result

    def on(self, places: Array, default: float | None = None) -> Array:
        """Return places with the height of the ground, shape (n, 3) [m]."""
        xy = np.atleast_2d(np.asarray(places, float))[:, :2]
        return np.column_stack([xy, self.height(xy, default)])


def far_field(radius: float, seed: int, base: float, start: float = 120.0) -> Mesh:
    """Return land from `start` to `radius` [m] about the origin: level at `base` [m], hills beyond 330 m.

    Its uv is in tiles of 11 m.
    """
    r = np.concatenate([[start, 200.0, 300.0], np.geomspace(370.0, radius, 10)])
    angle = np.linspace(0, 2 * np.pi, 61)
    x, y = r[:, None] * np.cos(angle), r[:, None] * np.sin(angle)
    points = np.stack([x, y, far_height(x, y, seed, base)], -1)
    points[:, -1] = points[:, 0]
    return grid(points, points[..., :2] / 11.0)
