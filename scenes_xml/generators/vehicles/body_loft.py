"""Bodies of vans, buses and cabs of lorries.

Rounded cross-sections along x with wheel arches, and panels that lie on them.

Local frame: origin on the ground below the middle of the vehicle, x forward, y left, z up.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.interpolate import PchipInterpolator

from ..geometry.decal import first_hits, slab
from ..geometry.mesh import Array, Mesh, grid, merge, outward, weld

DRAFT = 0.20
"""Slope of walls that meet others at an inner corner: pressed sheets have no right angles, which would send every wave
back."""
Line = tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class BodyShape:
    """Measures of a body [m].

    Attributes
    ----------
    front, rear : float
        x of its ends.
    width : float
    floor : float
        Height of its lower edge.
    top : tuple of (x, z)
        Roof line from the rear to the front, bonnet and windscreen included.
    arches : tuple of (x, z, radius)
        Wheel arches.
    tunnel : float
        Half width of the floor between the wheels.
    edge : float
        Radius of the edges along the roof.
    lean : tuple of (z, share)
        Half width over its maximum against the height.
    front_shift, rear_shift : tuple of (z, shift)
        How far the end faces stand back against the height.
    front_bow, rear_bow : float
        How far the end faces stand back at their sides; `bow_power` says how near to the corners.
    end_radius : float
        Radius of the edges around the end faces.
    """

    front: float
    rear: float
    width: float
    floor: float
    top: Line
    arches: tuple[tuple[float, float, float], ...]
    tunnel: float
    edge: float = 0.10
    lean: Line = ((0.0, 1.0), (4.0, 1.0))
    front_shift: Line = ((0.0, 0.0), (4.0, 0.0))
    rear_shift: Line = ((0.0, 0.0), (4.0, 0.0))
    front_bow: float = 0.10
    rear_bow: float = 0.04
    bow_power: float = 3.0
    bow_reach: float = 0.9
    end_radius: float = 0.08
    more_stations: tuple[float, ...] = field(default_factory=tuple)


def _curve(line: Line) -> PchipInterpolator:
    points = np.array(line)
    return PchipInterpolator(points[:, 0], points[:, 1])


def _stations(shape: BodyShape, fine: bool) -> tuple[Array, Array]:
    """Return the x of the cross-sections and the inset of each [m], front to rear."""
    r = shape.end_radius
    turn = np.radians([0.0, 30.0, 60.0, 90.0])
    ends = r * (1.0 - np.sin(turn))
    xs = [shape.front - ends, shape.rear + ends, np.array(shape.more_stations)]
    theta = np.radians(np.linspace(0.0, 180.0, 13 if fine else 5))
    xs += [x - radius * 0.999 * np.cos(theta) for x, _, radius in shape.arches]
    xs += [np.array([x - radius - 0.004, x + radius + 0.004]) for x, _, radius in shape.arches if fine]
    if fine:
        steps = np.linspace(shape.rear + r, shape.front - r, max(3, int((shape.front - shape.rear) / 0.5)))
        taken = np.concatenate(xs)
        xs.append(steps[[np.abs(taken - s).min() > 0.12 for s in steps]])
    x = np.unique(np.round(np.concatenate(xs), 6))
    x = x[(x >= shape.rear - 1e-9) & (x <= shape.front + 1e-9)][::-1]
    past = np.clip((np.maximum(x - shape.front, shape.rear - x) + r) / r, 0.0, 1.0)
    return x, r * (1.0 - np.sqrt(1.0 - past**2))


def _ring(shape: BodyShape, x: float, inset: float, top: float, lean: PchipInterpolator, fine: bool) -> Array:
    """Return one closed cross-section, shape (n, 3): bottom middle, left side, top middle, right side."""
    low = shape.floor + inset
    arch = low
    for centre, height, radius in shape.arches:
        if abs(x - centre) <= radius:
            arch = max(arch, height + np.sqrt(radius**2 - (x - centre) ** 2))
    top -= inset
    edge = min(shape.edge, 0.4 * (top - arch))
    shoulder = top - edge
    z = arch + (shoulder - arch) * np.array([0.0, 0.06, 0.2, 0.4, 0.6, 0.8, 1.0] if fine else [0.0, 0.5, 1.0])
    y = (shape.width / 2 - inset) * lean(z)
    turn = np.radians([30.0, 60.0, 90.0] if fine else [90.0])
    y_top, z_top = y[-1] - edge + edge * np.cos(turn), shoulder + edge * np.sin(turn)
    inner = y_top[-1] * np.array([0.7, 0.35, 0.0] if fine else [0.0])
    tunnel = min(shape.tunnel, y[0] - 0.01)
    half = np.concatenate(
        [
            [[0.0, low], [tunnel, low], [tunnel - DRAFT * (arch - low), arch + 0.1 * (arch - low)]],
            np.column_stack([y, z]),
            np.column_stack([y_top, z_top]),
            np.column_stack([inner, np.full(len(inner), top)]),
        ]
    )
    ring = np.concatenate([half, half[-2:0:-1] * [-1.0, 1.0]])
    return np.column_stack([np.full(len(ring), x), ring])


def _deform(shape: BodyShape, p: Array) -> Array:
    """Return points with the end faces bowed in plan and sloped in side view."""
    x, y, z = p[..., 0], np.abs(p[..., 1]) / (shape.width / 2), p[..., 2]
    moved = x.copy()
    for end, bow, line, sign in (
        (shape.front, shape.front_bow, shape.front_shift, -1.0),
        (shape.rear, shape.rear_bow, shape.rear_shift, 1.0),
    ):
        share = np.clip(1.0 - np.abs(end - x) / shape.bow_reach, 0.0, 1.0)
        share = share * share * (3 - 2 * share)
        moved = moved + sign * share * (bow * y**shape.bow_power + _curve(line)(z))
    return np.stack([moved, p[..., 1], z], -1)


def loft(shape: BodyShape, fine: bool = True) -> tuple[Mesh, Mesh]:
    """Return the painted outside and the dark floor with its wheel arches; together they are closed."""
    xs, insets = _stations(shape, fine)
    top, lean = _curve(shape.top), _curve(shape.lean)
    rings = np.stack(
        [_ring(shape, float(x), float(i), float(top(x)), lean, fine) for x, i in zip(xs, insets, strict=True)]
    )
    columns = rings.shape[1]
    column = np.repeat(np.tile(np.arange(columns), len(rings) - 1), 2)
    parts = [grid(_deform(shape, rings), close_columns=True)]
    dark = [np.minimum(column, columns - 1 - column) < 3]
    for ring, flip in ((rings[0], False), (rings[-1], True)):
        levels = [_shrunk(ring, t) for t in ((1.0, 0.8, 0.5, 0.2, 0.0) if fine else (1.0, 0.4, 0.0))]
        cap = grid(_deform(shape, np.stack(levels)), close_columns=True)
        parts.append(cap if flip else cap.flipped())
        dark.append(np.zeros(len(cap.faces), bool))
    whole, is_dark = outward(merge(parts)), np.concatenate(dark)
    painted, floor = (weld(Mesh(whole.vertices, whole.faces[chosen])) for chosen in (~is_dark, is_dark))
    return painted, floor


def _shrunk(ring: Array, share: float) -> Array:
    """Return a ring drawn to its vertical middle line: y to 0, so that an end face stays a curve of y and z."""
    return ring * [1.0, share, 1.0]


def side_panel(
    body: Mesh,
    outline: Sequence[tuple[float, float]],
    rise: float = 0.005,
    cells: tuple[int, int] = (2, 2),
    sides: str = "both",
) -> Mesh:
    """Return a four-sided panel lying `rise` [m] above a side of the body, projected along y.

    Parameters
    ----------
    outline : sequence of (x, z)
        Corners [m]: bottom rear, bottom front, top front, top rear.
    cells : (rows, columns)
        Points along z and along x.
    sides : str
        ``"both"``, ``"left"`` or ``"right"``; the shape is taken from the left side, bodies are symmetric.
    """
    corner = np.array(outline, float)
    v, u = np.meshgrid(np.linspace(0, 1, cells[0]), np.linspace(0, 1, cells[1]), indexing="ij")
    weights = ((1 - u) * (1 - v), u * (1 - v), u * v, (1 - u) * v)
    xz = sum(w[..., None] * c for w, c in zip(weights, corner, strict=True))
    start = np.stack([xz[..., 0], np.full(u.shape, 5.0), xz[..., 1]], -1)
    direction = np.array([0.0, -1.0, 0.0])
    distance = first_hits(body, start.reshape(-1, 3), direction).reshape(u.shape)
    distance = np.where(np.isfinite(distance), distance, np.max(distance[np.isfinite(distance)]))
    on_body = start + distance[..., None] * direction
    left = slab(on_body - rise * direction, on_body + 0.01 * direction, None)
    return {"left": left, "right": left.mirrored_y(), "both": merge([left, left.mirrored_y()])}[sides]
