"""Openings in a body: what lies behind a window is cut out of its panels."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .mesh import MIN_AREA, Array, Mesh

Outline = Sequence[tuple[float, float]]
"""Corners of a convex polygon in the plane that an axis is the normal of [m]."""


def shrunk(outline: Outline, border: float) -> list[tuple[float, float]]:
    """Return an outline whose edges are drawn in by `border` [m]."""
    points = np.array(outline, float)
    if _area(points) < 0.0:
        points = points[::-1]
    edge = np.roll(points, -1, axis=0) - points
    normal = np.column_stack([-edge[:, 1], edge[:, 0]]) / np.linalg.norm(edge, axis=1)[:, None]
    level = (normal * points).sum(1) + border
    found = []
    for k in range(len(points)):
        pair = [k - 1, k]
        found.append(np.linalg.solve(normal[pair], level[pair]))
    return [(float(a), float(b)) for a, b in found]


def cut_out(mesh: Mesh, outline: Outline, axis: str, side: float, beyond: float) -> Mesh:
    """Return a mesh without what lies behind an outline, seen along an axis.

    Parameters
    ----------
    mesh : Mesh
        Texture coordinates are dropped.
    outline : sequence of (float, float)
        Convex: y and z for `axis` "x", x and z for "y" [m].
    axis : str
        ``"x"`` or ``"y"``.
    side : float
        1 or -1: triangles whose middle has `side` times the axis's coordinate above `beyond` [m] are cut.
    """
    along, across = (0, 1) if axis == "x" else (1, 0)
    polygon = np.array(outline, float)
    if _area(polygon) < 0.0:
        polygon = polygon[::-1]
    corners = mesh.vertices[mesh.faces]
    low, high = polygon.min(0), polygon.max(0)
    flat = corners[:, :, [across, 2]]
    near = (side * corners[:, :, along].mean(1) > beyond) & np.all(flat.max(1) > low, 1) & np.all(flat.min(1) < high, 1)
    pieces = [corners[~near]]
    for triangle in corners[near]:
        for piece in _outside(triangle, polygon, across):
            pieces.append(np.stack([piece[[0, k, k + 1]] for k in range(1, len(piece) - 1)]))
    whole = np.concatenate(pieces)
    area = 0.5 * np.linalg.norm(np.cross(whole[:, 1] - whole[:, 0], whole[:, 2] - whole[:, 0]), axis=1)
    whole = whole[area > 5.0 * MIN_AREA]
    return Mesh(whole.reshape(-1, 3), np.arange(3 * len(whole)).reshape(-1, 3))


def _area(points: Array) -> float:
    x, y = points.T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


def _outside(triangle: Array, polygon: Array, across: int) -> list[Array]:
    """Return convex pieces of a triangle outside of a polygon that goes round counter-clockwise."""
    found, rest = [], triangle
    for start, stop in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        edge = stop - start
        away = edge[0] * (rest[:, 2] - start[1]) - edge[1] * (rest[:, across] - start[0])
        away = np.where(np.abs(away) < 1e-9, 0.0, away)
        if (away <= 0.0).all():
            return [triangle]
        if (away < 0.0).any():
            found.append(_half(rest, -away))
            rest = _half(rest, away)
    return found


def _half(points: Array, level: Array) -> Array:
    """Return the part of a convex polygon where a linear level is not negative."""
    kept = []
    for k in range(len(points)):
        a, b = level[k - 1], level[k]
        if a * b < 0.0:
            kept.append(points[k - 1] + a / (a - b) * (points[k] - points[k - 1]))
        if b >= 0.0:
            kept.append(points[k])
    return np.array(kept)
