"""A road bridge over a motorway: deck on girders, piers, abutments with embankments, parapets with railings.

Local frame: the road below runs along x through the origin, the bridge along y.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..geometry.mesh import Mesh, box, grid, merge, tube

DECK = 0.30
"""Thickness of the slab [m]."""


def overpass(
    piers: Sequence[float],
    abutment: float,
    clearance: float = 5.0,
    width: float = 10.0,
    girder: float = 0.9,
    reach: float = 80.0,
    is_light: bool = False,
) -> dict[str, Mesh]:
    """Return ``road``, ``deck``, ``girders``, ``piers``, ``railing`` and ``bank`` of a bridge.

    Parameters
    ----------
    piers : sequence of float
        Where rows of piers stand across the road below [m].
    abutment : float
        Distance of the abutments from the middle [m].
    clearance : float
        Height below the girders [m].
    width : float
        Of the deck [m].
    girder : float
        Height of the girders [m].
    reach : float
        How far the embankments go [m].
    """
    top = surface(clearance, girder)
    half = width / 2
    road = _level((-half + 1.3, half - 1.3), (-reach, reach), top)
    kerbs = [box((1.3, 2 * abutment + 2.0, 0.15), (sign * (half - 0.65), 0.0, top + 0.07)) for sign in (-1.0, 1.0)]
    deck = [box((width, 2 * abutment, DECK - 0.01), (0.0, 0.0, top - DECK / 2 - 0.01)), *kerbs]
    deck += [box((0.22, 2 * abutment + 2.0, 0.7), (sign * (half - 0.02), 0.0, top - 0.05)) for sign in (-1.0, 1.0)]
    xs = np.linspace(-half + 1.2, half - 1.2, 4)
    girders = [box((0.5, 2 * abutment, girder), (x, 0.0, clearance + girder / 2)) for x in xs]
    girders += [
        box((width - 1.4, 0.35, girder * 0.9), (0.0, y, clearance + girder / 2))
        for y in (*piers, -abutment + 0.3, abutment - 0.3)
    ]
    columns = []
    for y in piers:
        columns.append(box((width - 2.0, 0.9, 0.7), (0.0, y, clearance - 0.35)))
        for x in (-half + 2.0, 0.0, half - 2.0):
            shaft = tube(np.array([(x, y, -0.4), (x, y, 1.0), (x, y, clearance - 0.65)]), 0.42, 10 if is_light else 20)
            columns.append(Mesh(shaft.vertices, shaft.faces, shaft.uv))
    walls = [
        box(
            (width + 0.6, 0.8, clearance + girder + 0.4),
            (0.0, sign * (abutment + 0.4), 0.5 * (clearance + girder) - 0.2),
        )
        for sign in (-1.0, 1.0)
    ]
    rails = []
    length = 2 * abutment + 2.0
    for sign in (-1.0, 1.0):
        x = sign * (half - 0.12)
        rails += [box((0.06, length, 0.06), (x, 0.0, top + z)) for z in ((1.15,) if is_light else (0.35, 0.75, 1.15))]
        rails += [
            box((0.06, 0.06, 1.1), (x, y, top + 0.6))
            for y in np.arange(-length / 2 + 0.1, length / 2, 4.0 if is_light else 2.0)
        ]
    parts = {
        "road": road,
        "deck": merge([*deck, *walls]),
        "girders": merge(girders),
        "piers": merge(columns),
        "railing": merge([Mesh(m.vertices, m.faces) for m in rails]),
        "bank": merge([_bank(sign, abutment, half + 0.6, top, reach) for sign in (-1.0, 1.0)]),
    }
    return parts


def surface(clearance: float = 5.0, girder: float = 0.9) -> float:
    """Return the height of the road on the bridge [m]."""
    return clearance + girder + DECK


def _level(x: tuple[float, float], y: tuple[float, float], z: float) -> Mesh:
    corners = np.array([[(x[0], y[0], z), (x[0], y[1], z)], [(x[1], y[0], z), (x[1], y[1], z)]])
    return grid(corners, corners[..., :2] / 4.0)


def _bank(sign: float, abutment: float, half: float, top: float, reach: float) -> Mesh:
    """Return the embankment behind an abutment, with slopes to both sides and to the road below."""
    slope = 1.6 * top
    y = np.array([abutment - 0.6 * slope + 0.8, abutment + 0.9, reach])
    rows = []
    for k, at in enumerate(y):
        z = -0.6 if k == 0 else top - 0.05
        x = np.array([-half - slope, -half, half, half + slope])
        rows.append(np.column_stack([x, np.full(4, sign * at), [-0.6, z, z, -0.6]]))
    points = np.stack(rows)
    mesh = grid(points, points[..., :2] / 8.0)
    return mesh.flipped() if sign > 0 else mesh
