"""The glazed cabin of a car."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import PchipInterpolator

from ...geometry.mesh import Array, Mesh, grid, weld
from .measures import CarShape


def _roof(shape: CarShape, x: Array, y: Array) -> Array:
    """Return the height of the roof surface [m]."""
    rear, front = shape.cabin_top
    middle, reach = 0.5 * (rear + front), 0.5 * (front - rear)
    sag = shape.extra.get("roof_sag", 0.055)
    return shape.height - sag * ((x - middle) / reach) ** 2 - 0.055 * (y / shape.cabin_top_width) ** 2


def _cabin_outline(base: tuple[float, float], half: float, bow: float, breaks: Array, taper: float) -> Array:
    """Return half an outline (y >= 0) of the cabin, from the front middle to the rear middle, shape (n, 2)."""
    rear, front = base
    across = np.array([0.0, 0.3, 0.6, 0.86])
    front_x = front - bow * across**2
    corner = 0.17 * (front - rear) / 2.6
    x_side = front - bow - corner + breaks * (rear + 0.6 * bow + 0.7 * corner - (front - bow - corner))
    y_side = half * (
        1.0 - taper * np.clip((breaks - 0.35) / 0.65, 0, 1) ** 2 - 0.02 * np.clip(0.2 - breaks, 0, 1) / 0.2
    )
    rear_across = np.array([0.84, 0.58, 0.3, 0.0])
    rear_x = rear + 0.6 * bow * rear_across**2
    x = np.concatenate([front_x, x_side, rear_x])
    y = np.concatenate([half * across, y_side, half * (1.0 - taper) * rear_across])
    return np.column_stack([x, y])


def cabin_breaks(shape: CarShape) -> Array:
    """Return where the columns of the cabin's side stand, 0 = front to 1 = rear."""
    inner = [v for pair in shape.glazing for v in pair]
    fill = [0.5 * (a + b) for a, b in shape.glazing]
    return np.unique(np.round([0.0, *inner, *fill, 1.0], 6))


def cabin_points(shape: CarShape) -> tuple[Array, Array, int]:
    """Return the grid of the cabin (rows, columns, 3) [m], the kind of each cell, and the columns of its left half.

    Kinds are those of `_cabin_kinds`.
    """
    breaks = cabin_breaks(shape)
    low = _cabin_outline(shape.cabin_base, shape.cabin_base_width, 0.20, breaks, 0.10)
    high = _cabin_outline(shape.cabin_top, shape.cabin_top_width, 0.10, breaks, 0.06)
    z = np.array(shape.deck)
    deck = PchipInterpolator(z[:, 0], z[:, 1])
    low_z = deck(low[:, 0]) + 0.045 * (1 - (low[:, 1] / (0.9 * shape.width / 2)) ** 2) - 0.03
    high_z = _roof(shape, high[:, 0], high[:, 1]) - 0.015
    levels = np.array([0.0, 0.09, 0.13, 0.3, 0.5, 0.7, 0.86, 0.93, 1.0])
    v = levels[:, None]
    bulge = 4.0 * v * (1.0 - v)
    x = low[:, 0] + (high[:, 0] - low[:, 0]) * v
    y = (low[:, 1] + (high[:, 1] - low[:, 1]) * v) * (1.0 + 0.035 * bulge)
    centre_x = 0.5 * (shape.cabin_top[0] + shape.cabin_top[1])
    x = x + bulge * 0.045 * np.sign(x - centre_x) * np.abs((x - centre_x) / 1.2) ** 2
    walls = np.stack([x, y, low_z + (high_z - low_z) * v], -1)
    spine = np.clip(high[:, 0], shape.cabin_top[0] + 0.25, shape.cabin_top[1] - 0.25)
    roof = []
    for t in (0.035, 0.09, 0.2, 0.4, 0.65, 0.85, 1.0):
        rx, ry = high[:, 0] + (spine - high[:, 0]) * t, high[:, 1] * (1.0 - t)
        drop = 0.015 * (1.0 - np.clip(t / 0.09, 0, 1)) ** 2
        roof.append(np.stack([rx, ry, _roof(shape, rx, ry) - drop], -1))
    half = np.concatenate([walls, np.stack(roof)])
    full = np.concatenate([half, half[:, -2:0:-1] * [1.0, -1.0, 1.0]], axis=1)
    kind = _cabin_kinds(shape, breaks, len(half), half.shape[1], full.shape[1])
    return full, kind, half.shape[1]


def cabin(shape: CarShape) -> tuple[Mesh, Mesh, Mesh]:
    """Return the painted, the glazed and the black part of the cabin.

    Together a closed surface with the shell below.
    """
    full, kind, _ = cabin_points(shape)
    centre_x = 0.5 * (shape.cabin_top[0] + shape.cabin_top[1])
    surface = grid(full, close_columns=True)
    flip = (
        np.einsum(
            "i,i->",
            surface.vertices[surface.faces[0]].mean(0) - [centre_x, 0, 1.0],
            np.cross(*(surface.vertices[surface.faces[0]][1:] - surface.vertices[surface.faces[0]][0])),
        )
        < 0
    )
    surface = surface.flipped() if flip else surface
    pieces = [weld(Mesh(surface.vertices, surface.faces[np.repeat(kind.ravel() == k, 2)])) for k in range(3)]
    return pieces[0], pieces[1], pieces[2]


def _cabin_kinds(shape: CarShape, breaks: Array, rows: int, half: int, columns: int) -> Array:
    """Return the kind of each cell of the cabin grid, shape (rows - 1, columns): 0 paint, 1 glass, 2 black trim."""
    kind = np.zeros((rows - 1, columns), int)
    along = np.full(half - 1, -1.0)
    along[4 : 4 + len(breaks) - 1] = 0.5 * (breaks[1:] + breaks[:-1])
    is_glass = np.array([any(a < s < b for a, b in shape.glazing) for s in along])
    is_black = (along > shape.glazing[0][0]) & (along < shape.glazing[-1][1]) & ~is_glass
    is_glass[:3] = True
    is_glass[-3:] = True
    for j in range(half - 1):
        for column in (j, columns - 1 - j):
            if is_glass[j]:
                kind[2:6, column] = 1
                kind[1, column] = kind[6, column] = 2
            elif is_black[j]:
                kind[1:7, column] = 2
    return kind
