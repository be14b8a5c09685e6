"""Kerbs between lanes of different height, bridges with parapets and piers, tunnels with lamps."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby

import numpy as np
import shapely

from scenes_xml.generators.geometry.mesh import Mesh, box, grid, merge, tube

from ..model import Array
from .heights import GroundHeight
from .surfaces import Piece, height_of, polygons, wall

STEP_HEIGHT = 0.005
"""Borders that differ by less are no kerb [m]."""
DECK, PARAPET, THICK = 0.9, 1.0, 0.3
"""Thickness of a bridge, height and thickness of its parapets [m]."""
CLEAR, ROOM, LINING = 5.0, 0.5, 0.6
"""Height of a tunnel, room beside its lanes, thickness of its lining [m]."""
BESIDE = 5
"""Rank of lanes of no use."""
_FOOT = 0.05
_PIERS, _LAMPS = 25.0, 8.0
_UP = np.array([0.0, 0.0, 1.0])


def kerbs(pieces: Sequence[Piece]) -> Iterator[Mesh]:
    """Return walls where a lane stands higher than its neighbour, and around raised lanes that others cut."""
    by_place: dict[tuple[str, float, int], Piece] = {(p.road, float(p.s[0]), p.lane): p for p in pieces}
    for piece in pieces:
        if piece.is_cut:
            if piece.height > STEP_HEIGHT:
                yield from _skirts(piece)
            continue
        toward = piece.lane - (1 if piece.lane > 0 else -1)
        other = by_place.get((piece.road, float(piece.s[0]), toward if toward else -1 if piece.lane > 0 else 1))
        if other is None or len(other.s) != len(piece.s) or (other.is_cut and other.height > piece.height):
            continue
        border = other.inner if toward == 0 else other.outer
        if toward == 0 and piece.lane < 0:
            continue  # the pair at the centre once
        if np.abs(border[:, 2] - piece.inner[:, 2]).max() > STEP_HEIGHT:
            yield wall(border, piece.inner)


def _skirts(piece: Piece) -> Iterator[Mesh]:
    height = height_of(piece)
    for part in polygons(piece.footprint):
        for ring in (part.exterior, *part.interiors):
            plane = shapely.get_coordinates(ring)
            top = np.column_stack([plane, height(plane)])
            yield wall(top - (piece.height + _FOOT) * _UP, top)


def spans(pieces: Sequence[Piece], structure: str) -> Iterator[tuple[Array, Array]]:
    """Return the left and the right border of the road on bridges or in tunnels, shape (n, 3) each.

    Lanes of no use beside the road do not count.
    """
    own = [piece for piece in pieces if piece.structure == structure and piece.rank < BESIDE]
    own.sort(key=lambda piece: (piece.road, float(piece.s[0]), piece.lane))
    for _, group in groupby(own, key=lambda piece: (piece.road, float(piece.s[0]))):
        lanes = list(group)
        right, left = lanes[0], lanes[-1]
        yield (left.outer if left.lane > 0 else left.inner), (right.outer if right.lane < 0 else right.inner)


def _outward(left: Array, right: Array) -> Array:
    across = (left - right) * [1.0, 1.0, 0.0]
    return np.asarray(across / np.maximum(np.linalg.norm(across, axis=1), 1e-6)[:, None])


def bridge(left: Array, right: Array, height: GroundHeight, taken: shapely.Geometry) -> dict[str, Mesh]:
    """Return ``deck`` with parapets and, where it stands high over free ground, ``piers``."""
    out = _outward(left, right)
    lo, ro = left + THICK * out, right - THICK * out
    rows = [left, left + PARAPET * _UP, lo + PARAPET * _UP, lo - DECK * _UP]
    rows += [ro - DECK * _UP, ro + PARAPET * _UP, right + PARAPET * _UP, right]
    parts = [_swept(rows), *(_cap([row[end] for row in rows]) for end in (0, -1))]
    found = {"deck": merge(parts)}
    middle = 0.5 * (left + right)
    way = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(middle, axis=0), axis=1))]
    piers = []
    for at in np.arange(0.5 * _PIERS, way[-1], _PIERS):
        foot = np.array([np.interp(at, way, middle[:, k]) for k in range(3)])
        ground = float(height(foot[None, :2])[0])
        clear = shapely.distance(taken, shapely.Point(foot[:2])) > 1.0
        if clear and foot[2] - DECK - ground > 2.0:
            piers.append(tube(np.array([[*foot[:2], ground - 0.5], [*foot[:2], foot[2] - 0.5 * DECK]]), 0.6, 16))
    if piers:
        found["piers"] = merge([Mesh(part.vertices, part.faces) for part in piers])
    return found


def tunnel(left: Array, right: Array) -> dict[str, Mesh]:
    """Return ``lining``, ``shell`` and ``lamps`` of a tunnel of rectangular section over a road."""
    out = _outward(left, right)
    inner = [left + ROOM * out - 0.3 * _UP, left + ROOM * out + CLEAR * _UP]
    inner += [right - ROOM * out + CLEAR * _UP, right - ROOM * out - 0.3 * _UP]
    wide = ROOM + LINING
    outer = [left + wide * out - 0.3 * _UP, left + wide * out + (CLEAR + LINING) * _UP]
    outer += [right - wide * out + (CLEAR + LINING) * _UP, right - wide * out - 0.3 * _UP]
    rings = [grid(np.stack([[row[end] for row in rows] for rows in (inner, outer)])) for end in (0, -1)]
    shell = [_swept(outer), *(Mesh(ring.vertices, ring.faces, ring.vertices[:, :2] / 4.0) for ring in rings)]
    middle = 0.5 * (left + right) + (CLEAR - 0.08) * _UP
    way = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(middle, axis=0), axis=1))]
    heading = np.arctan2(*np.gradient(middle[:, 1::-1], axis=0).T)
    lamps = []
    for at in np.arange(0.5 * _LAMPS, way[-1], _LAMPS):
        place = [float(np.interp(at, way, middle[:, k])) for k in range(3)]
        yaw = float(np.interp(at, way, np.unwrap(heading)))
        lamp = box((1.4, 0.25, 0.12)).moved(place, yaw)
        lamps.append(Mesh(lamp.vertices, lamp.faces))
    found: dict[str, Mesh] = {"lining": _swept(inner), "shell": merge(shell)}
    if lamps:
        found["lamps"] = merge(lamps)
    return found


def _swept(rows: Sequence[Array]) -> Mesh:
    """Return the surface through lines (n, 3) that lie beside each other; uv in metres along and across."""
    points = np.stack(rows, 1)
    along = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(points[:, 0], axis=0), axis=1))]
    across = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(points[0], axis=0), axis=1))]
    return grid(points, np.stack(np.meshgrid(along, across, indexing="ij"), -1) / 4.0)


def _cap(corners: Sequence[Array]) -> Mesh:
    """Return the end of a bridge: the slab's rectangle and those of the parapets."""
    vertices = np.array(corners)
    quads = [(0, 1, 2, 3), (4, 5, 6, 7), (0, 3, 4, 7)]
    faces = [triangle for a, b, c, d in quads for triangle in ((a, b, c), (a, c, d))]
    return Mesh(vertices, np.array(faces, dtype=np.int64), vertices[:, 1:] / 4.0)


def merged_by(parts: Mapping[str, list[Mesh]]) -> dict[str, Mesh]:
    """Return the meshes of each name as one."""
    return {name: merge(meshes) for name, meshes in parts.items() if meshes}
