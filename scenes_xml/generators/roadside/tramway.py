"""What hangs over a tram's rails in a street: contact wires, and the wires across that carry them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..geometry.mesh import Array, Mesh, merge, tube

ROSETTE = 0.09
"""Radius of the plates by which wires are fixed to walls [m]."""


def contact_wire(line: Array, height: float) -> Mesh:
    """Return a contact wire along the middle of a track, shape (n, 2 or 3) [m], `height` above its rails."""
    points = np.column_stack([line[:, :2], np.full(len(line), height)])
    return _plain(tube(points, 0.006, 4))


def span_wire(ends: Sequence[Array], tracks: Sequence[Array], height: float, sag: float = 0.35) -> Mesh:
    """Return a wire between two walls, its plates, and what hangs from it down to contact wires.

    Parameters
    ----------
    ends : two arrays, shape (3,)
        Where it is fixed to walls [m].
    tracks : sequence of arrays, shape (2,)
        Where it crosses contact wires, in plan [m].
    height : float
        Of the contact wires [m].
    sag : float
        How far its middle hangs below its ends [m].
    """
    a, b = (np.asarray(end, float) for end in ends)
    share = np.linspace(0.0, 1.0, 9)[:, None]

    def point(at: Array) -> Array:
        return a + at * (b - a) - [0.0, 0.0, 4.0 * sag] * at * (1.0 - at)

    away = (b - a) / np.linalg.norm(b - a)
    parts = [tube(point(share), 0.004, 4)]
    for end, inward in ((a, away), (b, -away)):  # plates begin within the wall: no two faces are in one plane
        parts.append(tube(np.stack([end - 0.01 * inward, end + 0.05 * inward]), ROSETTE, 8))
    for track in tracks:
        along = float((track - a[:2]) @ (b - a)[:2] / ((b - a)[:2] @ (b - a)[:2]))
        top = point(np.array([along]))
        parts.append(tube(np.stack([top, [*top[:2], height]]), 0.005, 4))
        parts.append(tube(np.array([[*top[:2], height + 0.02], [*top[:2], height + 0.14]]), 0.03, 6))
    return merge([_plain(part) for part in parts])


def _plain(part: Mesh) -> Mesh:
    return Mesh(part.vertices, part.faces)
