"""Plants of streets and gardens: clipped hedges, shrubs, flower beds, and conifers."""

from __future__ import annotations

import numpy as np

from ..geometry.mesh import Array, Mesh, grid, merge, outward, tube
from ..geometry.polygon import length_along, resample, shifted
from ..roads.road import smooth_noise
from .vegetation import blob, tufts


def hedge(
    line: Array, height: float = 1.3, width: float = 0.7, seed: int = 0, step: float = 0.22, rough: float = 0.05
) -> Mesh:
    """Return a clipped hedge along a line, shape (n, 3) [m] on the ground.

    Its faces are uneven by `rough` [m], uv in 1.5 m.
    """
    line = resample(np.asarray(line, float), step)
    half = width / 2
    side = np.linspace(-0.15, height - 0.08, max(3, int(height / step) + 1))
    top = np.linspace(-half + 0.08, half - 0.08, max(3, int(width / step) + 1))
    profile = np.concatenate(
        [
            np.column_stack([np.full(len(side), -half), side]),
            np.column_stack([top, np.full(len(top), height)]),
            np.column_stack([np.full(len(side), half), side[::-1]]),
        ]
    )
    points = np.stack([np.column_stack([shifted(line, -d), line[:, 2] + z]) for d, z in profile], 1)
    generator = np.random.default_rng(seed)
    uneven = rough * generator.uniform(-1.0, 1.0, points.shape)
    uneven += (
        rough * 0.7 * smooth_noise(points[..., 0] + points[..., 2], points[..., 1], seed, wavelength=1.6)[..., None]
    )
    uneven[:, [0, -1]] *= 0.3
    uneven[[0, -1]] = 0.0
    points = points + uneven
    v = length_along(profile)
    uv = np.stack(np.broadcast_arrays(length_along(line[:, :2])[:, None], v[None, :]), -1) / 1.5
    faces = [grid(points, uv)]
    for end, flip in ((0, True), (-1, False)):
        half_count = len(profile) // 2
        left, right = points[end, :half_count], points[end, ::-1][:half_count]
        cap = np.stack([left, right])
        cap_uv = np.stack([np.column_stack([np.full(half_count, d), left[:, 2]]) for d in (0.0, width)]) / 1.5
        part = grid(cap, cap_uv)
        faces.append(part.flipped() if flip else part)
    return outward(merge(faces))


def shrub(radius: float = 0.6, height: float = 0.9, seed: int = 0, blobs: int = 5) -> Mesh:
    """Return a bush of bumpy blobs, foot at the origin; uv as on a hedge."""
    generator = np.random.default_rng(seed)
    parts = []
    for k in range(blobs):
        angle = 2 * np.pi * k / blobs + generator.uniform(-0.4, 0.4)
        away = 0.0 if k == 0 else 0.48 * radius
        size = np.array([0.62, 0.62, 0.55]) * [radius, radius, height] * generator.uniform(0.85, 1.1)
        centre = np.array([away * np.cos(angle), away * np.sin(angle), (0.52 if k == 0 else 0.38) * height])
        parts.append(blob(centre, size, seed * 31 + k, 7, 10, 0.16))
    body = merge(parts)
    turn = np.arctan2(body.vertices[:, 1], body.vertices[:, 0])
    return Mesh(body.vertices, body.faces, np.column_stack([turn * radius, body.vertices[:, 2]]) / 1.2)


def flowers(places: Array, seed: int, height: float = 0.28) -> tuple[Mesh, Mesh]:
    """Return the green and the blossoms (small blobs) of plants with feet at `places`, shape (n, 3) [m]."""
    generator = np.random.default_rng(seed)
    green = tufts(places, seed, 5, height)
    tops = places + np.column_stack(
        [generator.normal(0, 0.05, (len(places), 2)), height * generator.uniform(0.7, 1.05, len(places))]
    )
    petals = merge([blob(p, np.full(3, 0.05) * [1.0, 1.0, 0.6], seed * 7 + k, 3, 5, 0.1) for k, p in enumerate(tops)])
    return green, petals


def conifer(height: float, radius: float, seed: int, tiers: int = 7, is_light: bool = False) -> dict[str, Mesh]:
    """Return ``trunk`` and ``core`` of a spruce: drooping cones, one above the other."""
    generator = np.random.default_rng(seed)
    count = 4 if is_light else tiers
    segments = 8 if is_light else 14
    parts = []
    base = 0.12 * height
    for k in range(count):
        share = k / count
        low = base + share * (height - base) * 0.92
        reach = radius * (1.0 - share) ** 0.85 + 0.12
        top = min(low + 1.9 * (height - base) / count, height)
        angle = np.arange(segments) * 2 * np.pi / segments + generator.uniform(0, 1)
        rim = reach * generator.uniform(0.78, 1.1, segments)
        inner = np.column_stack(
            [0.25 * reach * np.cos(angle), 0.25 * reach * np.sin(angle), np.full(segments, low + 0.12 * height / count)]
        )
        outer = np.column_stack(
            [rim * np.cos(angle), rim * np.sin(angle), low - 0.10 * rim + generator.uniform(-0.06, 0.06, segments)]
        )
        waist = np.column_stack(
            [0.5 * rim * np.cos(angle), 0.5 * rim * np.sin(angle), np.full(segments, 0.55 * low + 0.45 * top)]
        )
        tip = np.tile([0.0, 0.0, top], (segments, 1)) + 0.02 * np.column_stack(
            [np.cos(angle), np.sin(angle), 0 * angle]
        )
        parts.append(grid(np.stack([inner, outer, waist, tip]), close_columns=True).flipped())
    stem = tube(
        np.array([(0, 0, -0.3), (0, 0, 0.3 * height), (0, 0, 0.6 * height)]),
        np.array([0.022, 0.018, 0.008]) * height,
        8,
    )
    return {"trunk": stem, "core": merge(parts)}
