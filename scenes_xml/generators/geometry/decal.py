"""Thin parts that follow a surface: lamps, grilles, plates and shut lines projected onto a body."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .mesh import Array, Mesh, grid, merge


def first_hits(mesh: Mesh, origins: Array, direction: Array) -> Array:
    """Return the distance [m] along `direction` to the first triangle, shape (num_origins,); inf where none is hit."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    e1, e2 = b - a, c - a
    p = np.cross(direction, e2)
    det = np.einsum("ij,ij->i", e1, p)
    usable = np.abs(det) > 1e-12
    a, e1, e2, p, det = a[usable], e1[usable], e2[usable], p[usable], det[usable]
    best = np.full(len(origins), np.inf)
    for i, origin in enumerate(origins):
        t = origin - a
        u = np.einsum("ij,ij->i", t, p) / det
        q = np.cross(t, e1)
        v = q @ direction / det
        distance = np.einsum("ij,ij->i", q, e2) / det
        hit = (u >= -1e-9) & (v >= -1e-9) & (u + v <= 1 + 1e-9) & (distance > 0)
        if hit.any():
            best[i] = distance[hit].min()
    return best


def slab(front: Array, back: Array, uv: Array | None) -> Mesh:
    """Return the front surface of a patch and the skirt that joins it to `back`; both of shape (rows, columns, 3)."""
    surface = grid(front, uv)
    rim = np.concatenate([front[0], front[1:, -1], front[-1, -2::-1], front[-2:0:-1, 0]])
    foot = np.concatenate([back[0], back[1:, -1], back[-1, -2::-1], back[-2:0:-1, 0]])
    skirt = grid(np.stack([foot, rim]), None if uv is None else np.zeros((2, len(rim), 2)), close_columns=True)
    return merge([surface, skirt])


def panel(
    body: Mesh,
    outline: Sequence[tuple[float, float]],
    direction: Array,
    side: float,
    rise: float = 0.005,
    with_uv: bool = False,
    cells: tuple[int, int] = (4, 9),
    reach: float = 5.0,
) -> Mesh:
    """Return a four-sided panel lying `rise` [m] above the body, projected along +-x.

    Parameters
    ----------
    body : Mesh
        Surface to lie on.
    outline : sequence of (y, z)
        Corners [m]: bottom near the middle, bottom outer, top outer, top near the middle.
    direction : ndarray, shape (3,)
        Direction of projection, from outside to the body.
    side : float
        +1 keeps the outline's y, -1 mirrors it.
    reach : float
        Where the projection starts, abs(x) [m], outside the body.
    """
    corner = np.array(outline, float)
    v, u = np.meshgrid(np.linspace(0, 1, cells[0]), np.linspace(0, 1, cells[1]), indexing="ij")
    weights = ((1 - u) * (1 - v), u * (1 - v), u * v, (1 - u) * v)
    yz = sum(w[..., None] * c for w, c in zip(weights, corner, strict=True))
    start = np.stack([np.full(u.shape, -reach * direction[0]), side * yz[..., 0], yz[..., 1]], -1)
    distance = first_hits(body, start.reshape(-1, 3), direction).reshape(u.shape)
    distance = np.where(np.isfinite(distance), distance, np.max(distance[np.isfinite(distance)]))
    on_body = start + distance[..., None] * direction
    front, back = on_body - rise * direction, on_body + 0.01 * direction
    facing = -direction[0] * side
    uv = np.stack([u if facing > 0 else 1 - u, 1 - v], -1) if with_uv else None
    order = slice(None) if facing < 0 else slice(None, None, -1)
    return slab(front[:, order], back[:, order], None if uv is None else uv[:, order])


def strips(body: Mesh, lines: Sequence[Array], width: float, rise: float) -> Mesh:
    """Return bands of `width` [m] along x-z `lines`, lying `rise` [m] above both sides (+y and -y) of the body."""
    parts = []
    direction = np.array([0.0, -1.0, 0.0])
    for line in lines:
        length = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))]
        at = np.linspace(0, length[-1], max(3, int(length[-1] / 0.12)))
        path = np.column_stack([np.interp(at, length, line[:, k]) for k in range(2)])
        tangent = np.gradient(path, axis=0)
        tangent /= np.linalg.norm(tangent, axis=1)[:, None]
        normal = np.column_stack([-tangent[:, 1], tangent[:, 0]])
        rows = np.stack([path - normal * width / 2, path + normal * width / 2])
        start = np.stack([rows[..., 0], np.full(rows.shape[:2], 5.0), rows[..., 1]], -1)
        distance = first_hits(body, start.reshape(-1, 3), direction).reshape(rows.shape[:2])
        if not np.isfinite(distance).all():
            continue
        on_body = start + distance[..., None] * direction
        band = slab(on_body - rise * direction, on_body + 0.006 * direction, None)
        # a line along +x has its normal along +z: rows x columns = z x x = +y
        parts += [band, band.mirrored_y()]
    return merge(parts)
