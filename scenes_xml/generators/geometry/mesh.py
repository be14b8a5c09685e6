"""Triangle meshes: building blocks, crease normals and a deterministic binary PLY writer."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Faces = npt.NDArray[np.int64]

QUANTUM = 1e-5
"""Positions are rounded to this [m]; it makes the files independent of the last bit of the platform's `sin`."""

MIN_AREA = 2e-9
"""Triangles below this area [m2] are dropped: they arise where a grid collapses to a line."""


@dataclass(frozen=True)
class Mesh:
    """Triangles with optional normals and texture coordinates.

    Attributes
    ----------
    vertices : ndarray, shape (num_vertices, 3)
        Positions [m].
    faces : ndarray of int, shape (num_faces, 3)
        Vertex indices, counter-clockwise seen from outside.
    uv : ndarray, shape (num_vertices, 2), optional
        Texture coordinates.
    normals : ndarray, shape (num_vertices, 3), optional
        Unit normals.
    """

    vertices: Array
    faces: Faces
    uv: Array | None = None
    normals: Array | None = None

    def moved(self, offset: Sequence[float] | Array = (0.0, 0.0, 0.0), yaw: float = 0.0, scale: float = 1.0) -> Mesh:
        """Return a copy that is scaled, turned about z by `yaw` [rad], then shifted by `offset` [m]."""
        c, s = np.cos(yaw), np.sin(yaw)
        rotation = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        normals = None if self.normals is None else self.normals @ rotation.T
        return replace(self, vertices=scale * self.vertices @ rotation.T + np.asarray(offset, float), normals=normals)

    def mirrored_y(self) -> Mesh:
        """Return the mirror image in the x-z plane, still facing outward."""
        flip = np.array([1.0, -1.0, 1.0])
        normals = None if self.normals is None else self.normals * flip
        return replace(self, vertices=self.vertices * flip, faces=self.faces[:, ::-1].copy(), normals=normals)

    def flipped(self) -> Mesh:
        """Return the mesh turned inside out."""
        return replace(self, faces=self.faces[:, ::-1].copy(), normals=None if self.normals is None else -self.normals)


def face_normals(mesh: Mesh) -> tuple[Array, Array]:
    """Return the unit face normals, shape (num_faces, 3), and the areas [m2], shape (num_faces,)."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    cross = np.cross(b - a, c - a)
    length = np.linalg.norm(cross, axis=1)
    return cross / np.maximum(length, 1e-300)[:, None], 0.5 * length


def signed_volume(mesh: Mesh) -> float:
    """Return the volume enclosed [m3]; positive if the faces look outward."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)


def outward(mesh: Mesh) -> Mesh:
    """Return a closed mesh with its faces outward."""
    return mesh if signed_volume(mesh) > 0.0 else mesh.flipped()


def merge(meshes: Sequence[Mesh]) -> Mesh:
    """Return all meshes as one; texture coordinates and normals are kept if all have them."""
    offsets = np.cumsum([0] + [len(m.vertices) for m in meshes])
    faces = np.concatenate([m.faces + o for m, o in zip(meshes, offsets[:-1], strict=True)])
    uv = [m.uv for m in meshes if m.uv is not None]
    normals = [m.normals for m in meshes if m.normals is not None]
    return Mesh(
        np.concatenate([m.vertices for m in meshes]),
        faces,
        np.concatenate(uv) if len(uv) == len(meshes) else None,
        np.concatenate(normals) if len(normals) == len(meshes) else None,
    )


def grid_faces(rows: int, columns: int, close_rows: bool = False, close_columns: bool = False) -> Faces:
    """Return the triangles of a grid of vertices (row-major); front side: row direction x column direction."""
    i = np.arange(rows if close_rows else rows - 1)
    j = np.arange(columns if close_columns else columns - 1)
    i, j = (k.ravel() for k in np.meshgrid(i, j, indexing="ij"))
    i1, j1 = (i + 1) % rows, (j + 1) % columns
    a, b, c, d = i * columns + j, i1 * columns + j, i1 * columns + j1, i * columns + j1
    return np.stack([np.stack([a, b, c], 1), np.stack([a, c, d], 1)], 1).reshape(-1, 3).astype(np.int64)


def grid(points: Array, uv: Array | None = None, close_rows: bool = False, close_columns: bool = False) -> Mesh:
    """Return the surface through `points`, shape (rows, columns, 3); front side: row x column direction."""
    rows, columns = points.shape[:2]
    faces = grid_faces(rows, columns, close_rows, close_columns)
    return Mesh(points.reshape(-1, 3).astype(float), faces, None if uv is None else uv.reshape(-1, 2).astype(float))


def box(size: Sequence[float], centre: Sequence[float] = (0.0, 0.0, 0.0)) -> Mesh:
    """Return an axis-aligned box of `size` [m], with its own four vertices on each side and uv in metres."""
    half = np.asarray(size, float) / 2.0
    sides = []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        for sign in (1.0, -1.0):
            corners = np.zeros((2, 2, 3))
            corners[..., axis] = sign * half[axis]
            corners[..., u] = np.array([[-1, -1], [1, 1]]) * half[u] * sign
            corners[..., v] = np.array([[-1, 1], [-1, 1]]) * half[v]
            horizontal, vertical = (u, v) if axis != 1 else (v, u)
            sides.append(grid(corners, np.stack([corners[..., horizontal], corners[..., vertical]], -1)))
    solid = merge(sides)
    return replace(solid, vertices=solid.vertices + np.asarray(centre, float))


def revolve(profile: Array, segments: int, axis: str = "z") -> Mesh:
    """Return the surface of revolution of `profile`, shape (n, 2): radius and height along `axis` [m].

    The front side is outward where the height grows along the profile at a positive radius.
    """
    angle = np.arange(segments) * 2.0 * np.pi / segments
    r, h = np.asarray(profile, float).T
    ring = np.stack([np.outer(np.cos(angle), r), np.outer(np.sin(angle), r), np.tile(h, (segments, 1))], -1)
    if axis == "y":
        ring = ring[..., [1, 2, 0]]
    elif axis == "x":
        ring = ring[..., [2, 0, 1]]
    return grid(ring, close_rows=True)


def tube(path: Array, radius: float | Array, segments: int = 10) -> Mesh:
    """Return a closed round tube along `path`, shape (n, 3), of `radius` [m], a number or one for each point."""
    path = np.asarray(path, float)
    tangent = np.gradient(path, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1)[:, None]
    helper = np.where(np.abs(tangent[:, 2:3]) < 0.9, [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]])
    u = np.cross(helper, tangent)
    u /= np.linalg.norm(u, axis=1)[:, None]
    v = np.cross(tangent, u)
    angle = np.arange(segments) * 2.0 * np.pi / segments
    radii = np.broadcast_to(np.asarray(radius, float), (len(path),))[:, None, None]
    ring = path[:, None] + radii * (
        np.cos(angle)[None, :, None] * u[:, None] + np.sin(angle)[None, :, None] * v[:, None]
    )
    length = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))]
    uv = np.stack(np.meshgrid(length, np.arange(segments) / segments, indexing="ij")[::-1], -1)
    body = grid(ring, uv, close_columns=True)
    caps = []
    for end, order in ((0, 1), (-1, -1)):
        vertices = np.concatenate([ring[end], path[end][None]])
        k = np.arange(segments)
        faces = np.stack([k, np.full(segments, segments), (k + 1) % segments], 1)[:, ::order]
        caps.append(Mesh(vertices, faces.astype(np.int64), np.zeros((segments + 1, 2))))
    return outward(merge([body, *caps]))


def extrude(outline: Array, start: float, stop: float) -> Mesh:
    """Return the prism over a convex-or-star-shaped x-y `outline`, shape (n, 2), from z = `start` to `stop` [m]."""
    outline = np.asarray(outline, float)
    n = len(outline)
    low, high = (np.column_stack([outline, np.full(n, z)]) for z in (start, stop))
    k = np.arange(n)
    parts = [grid(np.stack([low, high]), close_columns=True)]
    for ring in (low, high):
        fan = np.stack([k, (k + 1) % n, np.full(n, n)], 1).astype(np.int64)
        cap = Mesh(np.concatenate([ring, ring.mean(0)[None]]), fan)
        parts.append(cap if ring is high else cap.flipped())
    area = np.sum(outline[:, 0] * np.roll(outline[:, 1], -1) - np.roll(outline[:, 0], -1) * outline[:, 1])
    sides = parts[0].flipped() if area > 0 else parts[0]
    caps = parts[1:] if area > 0 else [p.flipped() for p in parts[1:]]
    return merge([sides, *caps])


def weld(mesh: Mesh) -> Mesh:
    """Return the mesh with equal positions joined, and without degenerate or duplicate triangles (uv is dropped)."""
    keys = np.round(mesh.vertices / QUANTUM).astype(np.int64)
    unique, inverse = np.unique(keys, axis=0, return_inverse=True)
    welded = Mesh(unique * QUANTUM, inverse.reshape(-1)[mesh.faces])
    keep = _sound_faces(welded)
    return replace(welded, faces=welded.faces[keep])


def _sound_faces(mesh: Mesh) -> npt.NDArray[np.bool_]:
    f = mesh.faces
    distinct = (f[:, 0] != f[:, 1]) & (f[:, 1] != f[:, 2]) & (f[:, 2] != f[:, 0])
    keep = distinct & (face_normals(mesh)[1] > MIN_AREA)
    _, first = np.unique(np.sort(f, axis=1), axis=0, return_index=True)
    unique = np.zeros(len(f), bool)
    unique[first] = True
    return keep & unique


def finish(mesh: Mesh, crease_deg: float = 35.0) -> Mesh:
    """Return the mesh with shading normals: smooth across edges flatter than `crease_deg`, split at the others."""
    if mesh.normals is not None:
        return mesh
    keys = np.round(mesh.vertices / QUANTUM).astype(np.int64)
    unique, inverse = np.unique(keys, axis=0, return_inverse=True)
    joint = Mesh(unique * QUANTUM, inverse.reshape(-1)[mesh.faces])
    keep = _sound_faces(joint)
    joint, faces = replace(joint, faces=joint.faces[keep]), mesh.faces[keep]
    normal, area = face_normals(joint)
    corner_normals = _crease_normals(joint.faces, normal, area, np.cos(np.radians(crease_deg)))
    columns = [joint.faces.reshape(-1, 1), np.round(corner_normals * 1e4).astype(np.int64)]
    if mesh.uv is not None:
        corner_uv = np.round(mesh.uv[faces].reshape(-1, 2), 5)
        columns.append(np.round(corner_uv * 1e5).astype(np.int64))
    table, first, corner = np.unique(np.concatenate(columns, 1), axis=0, return_index=True, return_inverse=True)
    normals = table[:, 1:4].astype(float)
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    uv = None if mesh.uv is None else corner_uv[first]
    return Mesh(joint.vertices[table[:, 0]], corner.reshape(-1, 3).astype(np.int64), uv, normals)


def levelled(mesh: Mesh, share: float) -> Mesh:
    """Return smooth ground whose shading normals keep only `share` of their tilt.

    Seen at grazing incidence, an interpolated normal behind a crest would face away from the viewer and render black.
    """
    ground = finish(mesh, 60.0)
    assert ground.normals is not None
    tilted = ground.normals * [share, share, 1.0]
    return replace(ground, normals=tilted / np.linalg.norm(tilted, axis=1)[:, None])


def _crease_normals(faces: Faces, normal: Array, area: Array, cos_crease: float) -> Array:
    """Return one normal for each corner, shape (3 num_faces, 3).

    Area-weighted over the neighbours within the crease.
    """
    corner_vertex = faces.reshape(-1)
    corner_face = np.repeat(np.arange(len(faces)), 3)
    order = np.argsort(corner_vertex, kind="stable")
    counts = np.bincount(corner_vertex)
    starts = np.r_[0, np.cumsum(counts)[:-1]]
    fan = counts[corner_vertex]
    first = np.repeat(np.arange(len(corner_vertex)), fan)
    step = np.arange(len(first)) - np.repeat(np.cumsum(fan) - fan, fan)
    other = corner_face[order[starts[corner_vertex[first]] + step]]
    near = np.einsum("ij,ij->i", normal[corner_face[first]], normal[other]) > cos_crease
    weight = np.where(near, area[other], 0.0)
    total = np.stack([np.bincount(first, weight * normal[other, k], len(corner_vertex)) for k in range(3)], 1)
    return total / np.linalg.norm(total, axis=1)[:, None]


def write_ply(mesh: Mesh, path: Path) -> None:
    """Write a binary little-endian PLY with float32 positions, normals and, where present, texture coordinates."""
    if mesh.normals is None:
        raise ValueError(f"mesh for {path.name} has no normals; call finish() first")
    columns = [np.round(mesh.vertices, 5), np.round(mesh.normals, 4)]
    names = ["x", "y", "z", "nx", "ny", "nz"]
    if mesh.uv is not None:
        columns.append(np.round(mesh.uv, 5))
        names += ["u", "v"]
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(mesh.vertices)}"]
    header += [f"property float {name}" for name in names]
    header += [f"element face {len(mesh.faces)}", "property list uchar int vertex_indices", "end_header", ""]
    faces = np.zeros(len(mesh.faces), dtype=[("count", "u1"), ("index", "<i4", 3)])
    faces["count"] = 3
    faces["index"] = mesh.faces
    data = (np.concatenate(columns, 1) + 0.0).astype("<f4")
    path.write_bytes("\n".join(header).encode("ascii") + data.tobytes() + faces.tobytes())
