"""Plants: broad-leaved trees of leaf cards on blobs, far woods, grass tufts."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..geometry.mesh import Array, Mesh, grid, merge, tube


@dataclass(frozen=True)
class TreeShape:
    """Measures of a tree [m] and how many blobs and leaf cards make its crown."""

    height: float
    crown_radius: float
    crown_base: float
    trunk_radius: float = 0.16
    blobs: int = 16
    leaves: int = 4200
    leaf_size: float = 0.24


LIGHT_LEAVES, LIGHT_SIZE, LIGHT_BLOBS = 220, 0.8, 8
"""Of the light level: number of leaf cards, how large they are [m], and most blobs of a crown."""


def light_shape(shape: TreeShape) -> TreeShape:
    """Return the measures of a tree with the few, large leaf cards of the light level."""
    return replace(shape, blobs=min(shape.blobs, LIGHT_BLOBS), leaves=LIGHT_LEAVES, leaf_size=LIGHT_SIZE)


def blob(centre: Array, radii: Array, seed: int, rings: int = 8, segments: int = 12, bump: float = 0.12) -> Mesh:
    """Return a bumpy closed ellipsoid."""
    generator = np.random.default_rng(seed)
    latitude = np.linspace(-np.pi / 2, np.pi / 2, rings + 1)[1:-1]
    longitude = np.arange(segments) * 2 * np.pi / segments
    radius = 1.0 + bump * generator.uniform(-1, 1, (len(latitude), segments))
    unit = np.stack(
        [
            np.cos(latitude)[:, None] * np.cos(longitude),
            np.cos(latitude)[:, None] * np.sin(longitude),
            np.sin(latitude)[:, None] * np.ones(segments),
        ],
        -1,
    )
    points = centre + radii * unit * radius[..., None]
    body = grid(points, close_columns=True).flipped()
    k = np.arange(segments)
    n = len(body.vertices)
    last = (len(latitude) - 1) * segments
    south = np.stack([(k + 1) % segments, k, np.full(segments, n)], 1)
    north = np.stack([last + k, last + (k + 1) % segments, np.full(segments, n + 1)], 1)
    poles = centre + radii * np.array([[0, 0, -1.0], [0, 0, 1.0]])
    return Mesh(np.vstack([body.vertices, poles]), np.vstack([body.faces, south, north]).astype(np.int64))


def _unit(v: Array) -> Array:
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def _cards(centres: Array, normals: Array, outward: Array, sizes: Array, generator: np.random.Generator) -> Mesh:
    """Return one rhombic leaf card for each centre; shading normals lean towards `outward`; one colour (u) a card."""
    spin = _unit(generator.standard_normal(centres.shape))
    u = _unit(np.cross(normals, spin))
    v = np.cross(normals, u)
    half = sizes[:, None] / 2
    corners = np.stack(
        [centres - 1.25 * half * u, centres - 0.8 * half * v, centres + 1.25 * half * u, centres + 0.8 * half * v], 1
    )
    count = len(centres)
    base = 4 * np.arange(count)[:, None]
    faces = np.concatenate([base + [0, 1, 2], base + [0, 2, 3]]).astype(np.int64)
    shading = _unit(0.55 * normals + 0.45 * outward)
    tone = np.column_stack([generator.uniform(0.02, 0.98, count), np.full(count, 0.5)])
    return Mesh(corners.reshape(-1, 3).round(5), faces, np.repeat(tone, 4, axis=0), np.repeat(shading, 4, axis=0))


@dataclass(frozen=True, eq=False)
class Crown:
    """Blobs of a crown: `centres` and `radii`, shape (n, 3) each, in a hull about `middle` with `extent` (3,) [m]."""

    centres: Array
    radii: Array
    middle: Array
    extent: Array


def tree(shape: TreeShape, seed: int, is_light: bool = False) -> dict[str, Mesh]:
    """Return ``trunk``, ``core`` (inside of the crown) and ``leaves`` of a broad-leaved tree, foot at the origin.

    With `is_light` of few triangles: fewer and coarser blobs, and large cards in place of leaves.
    """
    shape = light_shape(shape) if is_light else shape
    rings, segments = (4, 7) if is_light else (8, 12)
    generator = np.random.default_rng(seed)
    crown_height = shape.height - shape.crown_base
    middle = np.array([0.0, 0.0, shape.crown_base + 0.5 * crown_height])
    extent = np.array([shape.crown_radius, shape.crown_radius, 0.5 * crown_height])
    direction = _unit(generator.standard_normal((shape.blobs, 3)))
    reach = generator.uniform(0.35, 0.72, (shape.blobs, 1))
    centres = middle + direction * reach * extent
    radii = (
        generator.uniform(0.30, 0.44, shape.blobs)[:, None] * extent * generator.uniform(0.85, 1.1, (shape.blobs, 3))
    )
    core = merge(
        [
            blob(c, 0.80 * r, seed * 101 + i, rings, segments)
            for i, (c, r) in enumerate(zip(centres, radii, strict=True))
        ]
    )
    leaves = foliage(Crown(centres, radii, middle, extent), shape.leaves, shape.leaf_size, generator)
    return {"trunk": trunk(shape, centres[: 2 if is_light else 6], generator), "core": core, "leaves": leaves}


def foliage(crown: Crown, count: int, size: float, generator: np.random.Generator, droop: float = 0.0) -> Mesh:
    """Return at most `count` leaf cards of `size` [m] over a crown; they hang up to `droop` [m] below their places."""
    centres, radii = crown.centres, crown.radii
    which = generator.integers(0, len(centres), 3 * count)
    around = _unit(generator.standard_normal((3 * count, 3)))
    points = centres[which] + around * radii[which] * generator.uniform(0.82, 1.10, (len(which), 1))
    depth = np.min(
        np.linalg.norm((points[:, None] - centres) / radii, axis=2)
        + 10.0 * (np.arange(len(centres)) == which[:, None]),
        axis=1,
    )
    outer = np.flatnonzero(depth > 0.85)[:count]  # leaves inside another blob cannot be seen
    normals = _unit(around[outer] + 0.55 * generator.standard_normal((len(outer), 3)))
    normals *= np.sign(np.einsum("ij,ij->i", normals, around[outer]))[:, None]
    sizes = size * generator.uniform(0.6, 1.3, len(outer))
    places = points[outer]
    outward = _unit((places - crown.middle) / crown.extent)
    if droop > 0.0:
        places = places - np.array([0.0, 0.0, droop]) * generator.uniform(0.0, 1.0, (len(outer), 1)) ** 1.5
    return _cards(places, normals, outward, sizes, generator)


def trunk(shape: TreeShape, centres: Array, generator: np.random.Generator) -> Mesh:
    """Return the stem of a tree, with branches to the first of its blobs' `centres`, shape (n, 3) [m]."""
    z = np.array(
        [-0.3, 0.0, 0.25, 0.8, 1.6, shape.crown_base, shape.crown_base + 0.45 * (shape.height - shape.crown_base)]
    )
    lean = np.cumsum(generator.normal(0.0, 0.05, (len(z), 2)), axis=0)
    radius = shape.trunk_radius * np.array([1.5, 1.35, 1.1, 1.0, 0.92, 0.8, 0.35])
    stem = tube(np.column_stack([lean - lean[1], z]), radius, 12)
    branches = [stem]
    start = np.array([*(lean[-2] - lean[1]), shape.crown_base - 0.3])
    for target in centres[: min(6, len(centres))]:
        elbow = start + (target - start) * [0.45, 0.45, 0.62]
        branches.append(tube(np.stack([start, elbow, target]), shape.trunk_radius * np.array([0.5, 0.32, 0.12]), 7))
    return merge(branches)


def woods(positions: Array, heights: Array, seed: int, leaves: int = 80) -> dict[str, Mesh]:
    """Return ``core`` and ``leaves`` of far trees at positions (n, 3) with heights (n,) [m]; few, large leaf clumps."""
    generator = np.random.default_rng(seed)
    cores, cards = [], []
    for i, (p, h) in enumerate(zip(positions, heights, strict=True)):
        middle = p + [0.0, 0.0, 0.55 * h]
        extent = np.array([0.34, 0.34, 0.45]) * h * generator.uniform(0.85, 1.15, 3)
        cores.append(blob(middle, 0.88 * extent, seed * 7919 + i, 5, 8, 0.2))
        around = _unit(generator.standard_normal((leaves, 3)))
        lumps = 1.0 + 0.16 * np.sin(around @ generator.normal(0, 5.0, (3, 2))).sum(1, keepdims=True)
        normals = _unit(around + 0.5 * generator.standard_normal(around.shape))
        normals *= np.sign(np.einsum("ij,ij->i", normals, around))[:, None]
        sizes = 0.16 * h * generator.uniform(0.6, 1.2, leaves)
        cards.append(_cards(middle + around * lumps * extent * 0.94, normals, around, sizes, generator))
    return {"core": merge(cores), "leaves": merge(cards)}


def tufts(feet: Array, seed: int, blades: int = 7, height: float = 0.22) -> Mesh:
    """Return grass tufts: `blades` bent blades of two triangles at every foot, shape (n, 3) [m]."""
    generator = np.random.default_rng(seed)
    foot = np.repeat(feet, blades, axis=0)
    n = len(foot)
    turn, lean = generator.uniform(0, 2 * np.pi, n), generator.uniform(0.05, 0.55, n)
    tall = np.repeat(generator.uniform(0.6, 1.3, len(feet)), blades) * height * generator.uniform(0.5, 1.1, n)
    out = np.column_stack([np.cos(turn), np.sin(turn), np.zeros(n)])
    side = np.column_stack([-out[:, 1], out[:, 0], out[:, 2]])
    up = np.array([0.0, 0.0, 1.0])
    start = foot + out * generator.uniform(0.0, 0.07, (n, 1)) - 0.03 * up
    width = 0.007 + 0.02 * tall[:, None]
    bend = start + (0.35 * lean * tall)[:, None] * out + (0.6 * tall)[:, None] * up
    tip = start + (lean * tall)[:, None] * out + tall[:, None] * up
    corners = np.stack(
        [start - width * side / 2, start + width * side / 2, bend + width * side * 0.4, bend - width * side * 0.4, tip],
        1,
    )
    base = 5 * np.arange(n)[:, None]
    faces = np.concatenate([base + [0, 1, 2], base + [0, 2, 3], base + [3, 2, 4]]).astype(np.int64)
    normals = np.repeat(_unit(out * 0.5 + up), 5, axis=0)
    return Mesh(corners.reshape(-1, 3).round(5), faces, None, normals)
