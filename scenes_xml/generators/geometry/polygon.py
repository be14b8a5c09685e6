"""Plane outlines: offsets, fillets, triangles of any simple polygon, and kerbs with pavements along a line."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .mesh import Array, Faces, Mesh, grid, merge


def length_along(line: Array) -> Array:
    """Return the length of a polyline up to each of its points [m]."""
    return np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))]


def resample(line: Array, step: float) -> Array:
    """Return a polyline in even steps of about `step` [m]; both ends stay."""
    line = np.asarray(line, float)
    s = length_along(line)
    even = np.linspace(0.0, s[-1], max(2, int(np.ceil(s[-1] / step)) + 1))
    return np.column_stack([np.interp(even, s, line[:, k]) for k in range(line.shape[1])])


def normals(line: Array) -> Array:
    """Return the unit normals to the left of a plane polyline, shape (n, 2), scaled so that offsets stay parallel."""
    step = np.diff(line[:, :2], axis=0)
    step /= np.linalg.norm(step, axis=1)[:, None]
    before, after = np.vstack([step[:1], step]), np.vstack([step, step[-1:]])
    mean = before + after
    mean /= np.linalg.norm(mean, axis=1)[:, None]
    mean /= np.maximum(np.einsum("ij,ij->i", mean, after), 0.5)[:, None]
    return np.column_stack([-mean[:, 1], mean[:, 0]])


def shifted(line: Array, offset: float | Array) -> Array:
    """Return the parallel of a plane polyline, `offset` [m] to its left (a number or one for each point)."""
    offset = np.broadcast_to(offset, (len(line),))
    return line[:, :2] + normals(line) * offset[:, None]


def fillet(line: Sequence[Sequence[float]] | Array, radius: float | Sequence[float], step: float = 0.7) -> Array:
    """Return a polyline with corners rounded by `radius` [m], one or one a corner, points `step` [m] apart in them."""
    corners = np.asarray(line, float)
    radii = np.broadcast_to(radius, (len(corners) - 2,))
    points = [corners[:1]]
    for a, b, c, r in zip(corners, corners[1:], corners[2:], radii, strict=False):
        u, v = (a - b) / np.linalg.norm(a - b), (c - b) / np.linalg.norm(c - b)
        half = 0.5 * np.arccos(np.clip(u @ v, -1.0, 1.0))
        if half > np.pi / 2 - 1e-6:
            continue
        reach = min(r / np.tan(half), 0.49 * np.linalg.norm(a - b), 0.49 * np.linalg.norm(c - b))
        size = reach * np.tan(half)
        middle = b + (u + v) / np.linalg.norm(u + v) * size / np.sin(half)
        start, stop = b + u * reach - middle, b + v * reach - middle
        turn = np.arctan2(start[0] * stop[1] - start[1] * stop[0], start @ stop)
        angles = np.linspace(0.0, turn, max(3, int(np.ceil(abs(turn) * size / step)) + 1))
        cos, sin = np.cos(angles), np.sin(angles)
        points.append(middle + np.column_stack([cos * start[0] - sin * start[1], sin * start[0] + cos * start[1]]))
    return np.vstack([*points, corners[-1:]])


def area(outline: Array) -> float:
    """Return the signed area of a polygon [m2]; positive = counter-clockwise."""
    x, y = outline[:, 0], outline[:, 1]
    return float(0.5 * np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


def triangles(outline: Array) -> Faces:
    """Return the triangles of a simple polygon, shape (n - 2, 3), counter-clockwise, by ear clipping.

    The roundest ears first.
    """
    points = np.asarray(outline, float)[:, :2]
    ring = list(range(len(points)))
    if area(points) < 0.0:
        ring.reverse()
    faces = []

    def quality(k: int) -> float:
        """Return the smallest height over the longest side of the ear at a place of the ring.

        Negative where it is none.
        """
        i, j, m = ring[k - 1], ring[k], ring[(k + 1) % len(ring)]
        a, b, c = points[i], points[j], points[m]
        cross = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        if cross <= 1e-12:
            return -1.0
        others = np.array([q for q in ring if q not in (i, j, m)], int)
        if len(others):
            p = points[others]
            sides = [
                (v[0] - u[0]) * (p[:, 1] - u[1]) - (v[1] - u[1]) * (p[:, 0] - u[0]) for u, v in ((a, b), (b, c), (c, a))
            ]
            if np.any(np.min(sides, axis=0) > -1e-9):
                return -1.0
        return float(cross / max(((a - b) ** 2).sum(), ((b - c) ** 2).sum(), ((c - a) ** 2).sum()))

    scores = [quality(k) for k in range(len(ring))]
    while len(ring) > 3:
        k = int(np.argmax(scores))
        if scores[k] <= 0.0:
            raise ValueError(
                f"the outline is no simple polygon: no ear among {len(ring)} corners near {points[ring[0]]}"
            )
        faces.append((ring[k - 1], ring[k], ring[(k + 1) % len(ring)]))
        del ring[k], scores[k]
        for near in (k - 1, k % len(ring)):
            scores[near] = quality(near % len(ring))
    faces.append((ring[0], ring[1], ring[2]))
    return np.array(faces, dtype=np.int64)


def sheet(outline: Array, height: float | Array = 0.0, tile: float = 1.0) -> Mesh:
    """Return a polygon as a surface that looks up, at a height or with one for each corner [m].

    Its uv is in tiles of `tile` [m].
    """
    points = np.asarray(outline, float)[:, :2]
    z = np.broadcast_to(height, (len(points),))
    return Mesh(np.column_stack([points, z]), triangles(points), points / tile)


def disc(radius: float, height: float, tile: float, inner: float = 0.0, segments: int = 72) -> Mesh:
    """Return a round plate or ring about the origin that looks up."""
    angle = np.linspace(0.0, 2.0 * np.pi, segments + 1)
    radii = np.array([max(inner, 1e-3), radius])
    x, y = radii[:, None] * np.cos(angle), radii[:, None] * np.sin(angle)
    points = np.stack([x, y, np.full_like(x, height)], -1)
    points[:, -1] = points[:, 0]
    return grid(points, np.stack([x, y], -1) / tile)


def island(outline: Array, height: float = 0.12, kerb: float = 0.15, tile: float = 1.2) -> tuple[Mesh, Mesh]:
    """Return kerb stones and top of an island with a counter-clockwise `outline`, shape (n, 2) [m]."""
    ring = np.vstack([outline, outline[:1]])
    wrapped = np.vstack([outline[-1:], outline, outline[:2]])
    inward = normals(wrapped)[1:-1]
    levels = [(0.0, -0.08), (0.004, 0.75 * height), (0.02, height), (kerb, height)]
    rows = [np.column_stack([ring + d * inward, np.full(len(ring), z)]) for d, z in levels]
    along = length_along(ring)
    uv = [np.column_stack([along, np.full(len(ring), d)]) for d in (0.0, 0.1, 0.13, 0.26)]
    side = grid(np.stack(rows), np.stack(uv))
    up = side if _looks_up(side) else side.flipped()
    return up, sheet(rows[-1][:-1, :2], height, tile)


def _looks_up(part: Mesh) -> bool:
    a, b, c = (part.vertices[part.faces[:, k]] for k in range(3))
    return bool(np.cross(b - a, c - a)[:, 2].sum() > 0.0)


def band(line: Array, offsets: Sequence[float], heights: Array, tile: float) -> Mesh:
    """Return a strip along a plane line with `offsets` to the left [m].

    Heights have the shape (num_offsets,) or (num_points, num_offsets).
    """
    heights = np.broadcast_to(heights, (len(line), len(offsets)))
    along = length_along(line[:, :2])
    points = np.stack([np.column_stack([shifted(line, d), heights[:, k]]) for k, d in enumerate(offsets)], 1)
    uv = np.stack([np.column_stack([np.full(len(line), d), along]) for d in offsets], 1) / tile
    part = grid(points, uv)
    return part if _looks_up(part) else part.flipped()


def kerb_and_pavement(
    line: Array, side: int, width: float, height: float = 0.12, drop: Array | None = None, tile: float = 1.2
) -> tuple[Mesh, Mesh]:
    """Return kerb stones and pavement along a plane kerb line, shape (n, 2) [m].

    `side` is +1 if the pavement lies to the left of the line; `drop`, shape (n,), is the share of the height that is
    left (0 to 1) where the kerb is lowered.  The pavement reaches `width` from the line, and its outer edge is level.
    """
    left = np.ones(len(line)) if drop is None else drop
    profile = height * left[:, None] * np.array([0.0, 0.75, 1.0, 1.0])
    profile[:, 0] = -0.1
    kerb = band(line, [side * d for d in (0.0, 0.004, 0.02, 0.15)], profile, 1.0)
    level = np.full(len(line), height)
    ramp = min(1.0, 0.5 * (0.15 + width))
    surface = band(line, [side * d for d in (0.15, ramp, width)], np.stack([height * left, level, level], 1), tile)
    return kerb, surface


def lowered(line: Array, places: Array, half: float = 2.0, ramp: float = 1.0, least: float = 0.15) -> Array:
    """Return for each point of a line the share of the kerb's height that is left, near `places`, shape (m, 2) [m]."""
    away = np.linalg.norm(line[:, None, :2] - np.atleast_2d(places)[None, :, :2], axis=2).min(1)
    return 1.0 - (1.0 - least) * np.clip((half + ramp - away) / ramp, 0.0, 1.0)


def stripe(line: Array, width: float, height: float = 0.004, tile: float = 1.0) -> Mesh:
    """Return a painted line of `width` [m] along a plane line."""
    return band(np.asarray(line, float), (-width / 2, width / 2), np.full(2, height), tile)


def stripes(line: Array, dash: float, gap: float, width: float, height: float = 0.004) -> Mesh:
    """Return dashes along a plane line."""
    line = np.asarray(line, float)
    s = length_along(line)
    parts = []
    for start in np.arange(0.0, s[-1] - dash, dash + gap):
        t = np.linspace(start, start + dash, max(2, int(np.ceil(dash / 0.7)) + 1))
        parts.append(stripe(np.column_stack([np.interp(t, s, line[:, k]) for k in range(2)]), width, height))
    return merge(parts)
