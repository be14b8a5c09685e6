"""The lower body of a car: a loft along x with wheel arches, bowed in plan and sloped in side view."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.interpolate import PchipInterpolator

from ...geometry.mesh import Array, Mesh, grid, merge, outward, weld
from ..body_loft import DRAFT
from .measures import CarShape

SIDE_PROFILE = PchipInterpolator(
    [0.10, 0.20, 0.30, 0.45, 0.60, 0.72, 0.85, 1.00, 1.20], [0.90, 0.935, 0.965, 0.988, 0.998, 1.0, 0.982, 0.955, 0.90]
)
"""Half width over its maximum as a function of the height over 1.46/height [m]."""

CROWN = 0.5
"""Radius of bumpers in side view, below their middle [m]."""


DECK = slice(16, 25)
"""Points of a cross-section that lie on the deck, a hand's breadth inside its edges."""


class Well(NamedTuple):
    """A part of the deck that lies lower: from and to x, and its floor's height [m]."""

    rear: float
    front: float
    floor: float


def _smoothstep(x: Array) -> Array:
    x = np.clip(x, 0.0, 1.0)
    return np.asarray(x * x * (3 - 2 * x))


def _crown(z: Array, middle: float, above: float) -> Array:
    """Return how far a bumper stands back [m] at a height, round by `CROWN` below its middle and by `above` over it."""
    radius = np.where(z < middle, CROWN, above)
    past = np.clip(np.abs(z - middle) / radius, 0.0, 0.7)
    return np.asarray(radius * (1.0 - np.sqrt(1.0 - past**2)))


def deform(shape: CarShape, p: Array) -> Array:
    """Return points with the nose and tail bowed in plan and sloped in side view.

    x = +-half length stays on the axis.
    """
    x, y, z = p[..., 0], p[..., 1] / (shape.width / 2), p[..., 2]
    front = _smoothstep((x - (shape.front_axle + 0.30)) / (shape.half_length - shape.front_axle - 0.30))
    rear = _smoothstep((shape.rear_axle - 0.38 - x) / (shape.half_length + shape.rear_axle - 0.38))
    bow = y**2
    nose = shape.nose_slope * np.clip((z - 0.52) / 0.25, 0, 2) ** 1.5 + _crown(z, 0.475, CROWN)
    tail = shape.tail_slope * np.clip((z - 0.62) / 0.3, 0, 2) ** 1.5 + _crown(
        z, shape.extra.get("plate_z", 0.56), 2 * CROWN
    )
    shifted = x - front * (shape.front_bow * bow + nose) + rear * (shape.rear_bow * bow + tail)
    return np.stack([shifted, p[..., 1], z], -1)


def _stations(shape: CarShape) -> tuple[Array, Array]:
    """Return the x of the cross-sections [m] and the inset of each [m], front to rear."""
    arch = shape.wheel_radius + 0.055
    theta = np.radians([0.0, 12.0, 26.0, 42.0, 58.0, 74.0])
    around = np.concatenate([-np.cos(theta), [0.0], np.cos(theta)]) * arch
    edges = np.array([-arch - 0.003, arch + 0.003])
    wheels = np.concatenate([[axle + d for d in (*around, *edges)] for axle in (shape.front_axle, shape.rear_axle)])
    h = shape.half_length
    middle = np.linspace(shape.rear_axle + arch + 0.12, shape.front_axle - arch - 0.12, 9)
    r = 0.12
    bend = np.radians([90.0, 72.0, 52.0, 30.0, 0.0])
    round_front = h - r + r * np.sin(bend)
    nose = np.linspace(shape.front_axle + arch + 0.06, h - r - 0.05, 4)
    tail = np.linspace(-h + r + 0.05, shape.rear_axle - arch - 0.06, 5)
    x = np.unique(np.round(np.concatenate([wheels, middle, round_front, -round_front, nose, tail, shape.stations]), 6))[
        ::-1
    ]
    past = np.clip((np.abs(x) - (h - r)) / r, 0.0, 1.0)
    inset = r * (1.0 - np.sqrt(1.0 - past**2))
    return x, inset


def shell_ring(shape: CarShape, x: float, inset: float, deck: PchipInterpolator) -> Array:
    """Return one closed cross-section, shape (n, 3): bottom middle, left side, top middle, right side."""
    arch_radius = shape.wheel_radius + 0.055
    low = shape.floor + 0.45 * inset + 0.05 * _smoothstep(np.array((abs(x) - 1.7) / 0.6))
    arch = low
    for axle in (shape.front_axle, shape.rear_axle):
        if abs(x - axle) <= arch_radius + 1e-9:
            rise = np.sqrt(max(arch_radius**2 - (x - axle) ** 2, 0.0))
            arch = max(arch, shape.wheel_radius + rise)
    top = float(deck(x)) - 0.8 * inset
    plan = 1.0 - 0.035 * _smoothstep(np.array((abs(x) - 0.8) / 1.4))
    half = shape.width / 2 * plan - 1.2 * inset
    shoulder = top - 0.055
    z = arch + (shoulder - arch) * np.array([0.0, 0.05, 0.18, 0.34, 0.5, 0.66, 0.82, 0.93, 1.0])
    y = half * SIDE_PROFILE(z * 1.46 / max(shape.height, 1.46))
    y[0] -= 0.012
    edge = y[-1]
    turn = np.radians([30.0, 60.0, 90.0])
    y_top = edge - 0.055 + 0.055 * np.cos(turn)
    z_top = shoulder + 0.055 * np.sin(turn)
    inner = y_top[-1] * np.array([0.9, 0.72, 0.48, 0.24, 0.0])
    crown = 0.045 * (1.0 - (inner / y_top[-1]) ** 2)
    tunnel = 0.56 * shape.width / 2
    half_ring = np.concatenate(
        [
            [
                [0.0, low],
                [tunnel * 0.5, low],
                [tunnel, low],
                [tunnel - DRAFT * (arch - low), arch + 0.1 * (arch - low)],
            ],
            np.column_stack([y, z]),
            np.column_stack([y_top, z_top]),
            np.column_stack([inner, z_top[-1] + crown]),
        ]
    )
    ring = np.concatenate([half_ring, half_ring[-2:0:-1] * [-1.0, 1.0]])
    return np.column_stack([np.full(len(ring), x), ring])


def shell(shape: CarShape, wells: Sequence[Well] = ()) -> tuple[Mesh, Mesh]:
    """Return the painted and the black part of the lower body with its wheel arches; together they are closed.

    In `wells`, and in the bed of a pickup, the deck is lowered; their walls and floors are black.
    """
    wells = [*wells, *([] if shape.bed is None else [Well(*shape.bed)])]
    xs, insets = _stations(shape)
    z = np.array(shape.deck)
    deck = PchipInterpolator(z[:, 0], z[:, 1])
    rings = np.stack([shell_ring(shape, float(x), float(i), deck) for x, i in zip(xs, insets, strict=True)])
    low = np.zeros(len(rings), bool)
    for well in wells:
        inside = (xs >= well.rear) & (xs <= well.front)
        rings[inside, DECK, 2] = well.floor
        low |= inside
    parts = [grid(deform(shape, rings), close_columns=True)]
    columns = rings.shape[1]
    column = np.repeat(np.tile(np.arange(columns), len(rings) - 1), 2)
    black = [np.minimum(column, columns - 1 - column) < (6 if shape.cladding else 3)]
    black[0] |= np.repeat(low[1:] | low[:-1], 2 * columns) & (column >= DECK.start - 1) & (column < DECK.stop)
    for ring, flip in ((rings[0], False), (rings[-1], True)):
        centre = np.array([ring[0, 0], 0.0, 0.5 * (ring[:, 2].min() + ring[:, 2].max())])
        levels = [centre + (ring - centre) * t for t in (1.0, 0.86, 0.66, 0.42, 0.2, 0.0)]
        cap = grid(deform(shape, np.stack(levels)), close_columns=True)
        black.append(np.zeros(len(cap.faces), bool))
        parts.append(cap if flip else cap.flipped())
    whole, is_black = outward(merge(parts)), np.concatenate(black)
    painted, dark = (weld(Mesh(whole.vertices, whole.faces[chosen])) for chosen in (~is_black, is_black))
    return painted, dark
