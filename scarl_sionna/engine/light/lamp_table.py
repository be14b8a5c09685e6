"""What is known of each lamp of an optical scene, by which lamps are chosen."""

from __future__ import annotations

from types import ModuleType
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from scarl_sionna.engine.types import MitsubaObject

from .sky import LUMINANCE_WEIGHTS

Array = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]

SURFACE, BEAM, SKY, SUN = range(4)
APART = 6.0
"""Radius [m] from which a glowing shape of several pieces is as many lamps: tubes under a ceiling, not a bus's pair."""
_KINDS = {
    "AreaLight": SURFACE,
    "Projector": BEAM,
    "EnvironmentMapEmitter": SKY,
    "ConstantBackgroundEmitter": SKY,
    "DirectionalEmitter": SUN,
}
_RADIANCES = ("radiance.value", "radiance.data", "irradiance.value", "data")


class LampTable(NamedTuple):
    """What is known of each lamp of a scene, in the order of ``scene.emitters()``.

    A row is an emitter, or a piece of one (`APART`).

    Attributes
    ----------
    kind : ndarray of int
        Surface, beam, sky or sun.
    center, axis : ndarray of float64, shape (n, 3)
        World [m]; the mean normal of a surface (its length is 1 for a flat one, 0 for a closed one), or where a beam
        points.
    side : ndarray of float64, shape (n, 3)
        To the left of a beam, seen from the lamp.
    strength : ndarray of float64, shape (n,)
        Radiance times area [m2] of a surface, 1 for a beam of full strength, radiance times pi of a sky,
        irradiance of a sun.
    radius : ndarray of float64, shape (n,)
        Of the ball that holds the surface [m].
    emitter : ndarray of int
        Number of the emitter.
    first_share, share : ndarray of float64, shape (n,)
        Part of the emitter's area that comes before this piece, and the piece's own; 0 and 1 for a whole emitter.
    pieces : Pieces
    """

    kind: Ints
    center: Array
    axis: Array
    side: Array
    strength: Array
    radius: Array
    emitter: Ints
    first_share: Array
    share: Array
    pieces: Pieces


class Pieces(NamedTuple):
    """The row of a face of an emitter: ``row[start[emitter] + step[emitter] * face]``; the step is 0 or 1."""

    start: Ints
    step: Ints
    row: Ints


def lamp_table(mi: ModuleType, scene: MitsubaObject) -> LampTable | None:
    """Return the table of a scene's emitters, or None where one is of a kind that it does not know."""
    rows: list[tuple[int, Array, Array, Array, float, float, int, float, float]] = []
    start: list[int] = []
    step: list[int] = []
    row: list[int] = []
    for number, emitter in enumerate(scene.emitters()):
        kind = _KINDS.get(emitter.class_name())
        if kind is None:
            return None
        params = mi.traverse(emitter)
        start.append(len(row))
        if kind == BEAM:
            matrix = np.array(params["to_world"].matrix, dtype=np.float64).reshape(4, 4)
            scale = float(np.array(params["scale"]).ravel()[0]) if "scale" in params else 1.0
            found = [(matrix[:3, 3], matrix[:3, 2], matrix[:3, 0], scale, 0.0, 1.0)]
            pieces = np.zeros(1, dtype=np.int64)
        else:
            name = next((key for key in _RADIANCES if key in params), None)
            if name is None:
                return None
            luminance = _luminance(np.array(params[name], dtype=np.float64))
            if kind == SURFACE:
                found, pieces = _surface(mi, emitter.get_shape(), luminance)
            else:
                whole = luminance * (np.pi if kind == SKY else 1.0)
                found = [(np.zeros(3), np.zeros(3), np.zeros(3), whole, 0.0, 1.0)]
                pieces = np.zeros(1, dtype=np.int64)
        step.append(int(len(pieces) > 1))
        row += (len(rows) + pieces).tolist()
        before = 0.0
        for known in found:
            rows.append((kind, *known[:5], number, before, known[5]))
            before += known[5]
    kinds, centers, axes, sides, strengths, radii, emitters, before_each, shares = (
        zip(*rows, strict=True) if rows else ((),) * 9
    )
    center, axis, side = (np.array(v, dtype=np.float64).reshape(-1, 3) for v in (centers, axes, sides))
    strength, radius, first_share, share = (
        np.array(v, dtype=np.float64) for v in (strengths, radii, before_each, shares)
    )
    kind_of_each, emitter_of_each = (np.array(v, dtype=np.int64) for v in (kinds, emitters))
    faces = Pieces(*(np.array(v, dtype=np.int64) for v in (start, step, row)))
    return LampTable(
        kind_of_each, center, axis, side, strength, radius, emitter_of_each, first_share, share, pieces=faces
    )


def _luminance(radiance: Array) -> float:
    """Return the mean luminance of a colour (3 numbers, any shape) or of a picture (rows, columns, channels)."""
    colors = radiance.reshape(-1, radiance.shape[-1])[:, :3] if radiance.ndim == 3 else radiance.reshape(1, 3)
    return float(colors.mean(axis=0) @ LUMINANCE_WEIGHTS)


_Known = tuple[Array, Array, Array, float, float, float]
"""Centre, mean normal, nothing, strength, radius, and the share of the shape's area."""


def _surface(mi: ModuleType, shape: MitsubaObject, luminance: float) -> tuple[list[_Known], Ints]:
    """Return what is known of a glowing shape or its pieces, and the piece of each face."""
    params = mi.traverse(shape)
    if "vertex_positions" not in params:
        box = shape.bbox()
        low, high = np.array(box.min, dtype=np.float64), np.array(box.max, dtype=np.float64)
        strength = luminance * float(shape.surface_area()[0])
        radius = float(np.linalg.norm(high - low)) / 2.0
        return [((low + high) / 2.0, np.zeros(3), np.zeros(3), strength, radius, 1.0)], np.zeros(1, dtype=np.int64)
    vertices = np.array(params["vertex_positions"], dtype=np.float64).reshape(-1, 3)
    faces = np.array(params["faces"], dtype=np.int64).reshape(-1, 3)
    far_apart = float(np.linalg.norm(np.ptp(vertices, axis=0))) / 2.0 > APART
    pieces = _pieces(vertices, faces) if far_apart else np.zeros(len(faces), dtype=np.int64)
    if pieces[-1] == 0:
        pieces = pieces[:1]
    corners = vertices[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2.0
    areas = np.linalg.norm(normals, axis=1)
    whole = max(float(areas.sum()), 1e-12)
    found = []
    for piece in range(int(pieces[-1]) + 1):
        own = np.broadcast_to(pieces == piece, len(faces))
        points, area = corners[own].reshape(-1, 3), max(float(areas[own].sum()), 1e-12)
        center = (points.min(axis=0) + points.max(axis=0)) / 2.0
        radius = float(np.linalg.norm(points - center, axis=1).max())
        found.append((center, normals[own].sum(axis=0) / area, np.zeros(3), luminance * area, radius, area / whole))
    return found, pieces


def _pieces(vertices: Array, faces: Ints) -> Ints:
    """Return which piece of a mesh each face is of, in their order; 0 for all where a piece's faces are not in a row.

    The area light of a mesh draws a face by the sum of areas before it, so faces in a row are a range of that number.
    """
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    same = np.unique(vertices.round(4), axis=0, return_inverse=True)[1].ravel()[faces]
    links = (np.concatenate([same[:, 0], same[:, 1]]), np.concatenate([same[:, 1], same[:, 2]]))
    size = int(same.max()) + 1
    labels = connected_components(coo_matrix((np.ones(2 * len(same)), links), shape=(size, size)), directed=False)[1]
    changes = np.diff(labels[same[:, 0]], prepend=labels[same[0, 0]]) != 0
    if changes.sum() + 1 != len(np.unique(labels[same])):
        return np.zeros(len(faces), dtype=np.int64)
    return np.asarray(np.cumsum(changes), dtype=np.int64)
