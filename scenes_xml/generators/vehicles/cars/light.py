"""A car at a light level of geometry: the loft of `shell` through few of its sections, closed wheels, flat lamps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.interpolate import PchipInterpolator

from ...geometry.decal import panel
from ...geometry.mesh import Array, Mesh, grid, merge, outward, revolve, weld
from . import cabin as upper
from . import shell as lower_body
from .measures import WHEELS, CarShape

_COLUMNS = (0, 2, 3, 4, 6, 8, 10, 12, 15, 17, 20)
"""Points of half a cross-section that are kept, of the 21 of `shell`."""
_LEVELS = (0, 2, 4, 6, 8, 10, 12, 15)
"""Rings of the cabin that are kept: five of its walls, three of its roof."""


def light_wheel(radius: float, width: float, x: float, y: float, segments: int = 12) -> Mesh:
    """Return a wheel as a closed disk about the axle (x, y, radius) [m]."""
    half = width / 2
    return outward(
        revolve(np.array([(0.0, -half), (radius, -half), (radius, half), (0.0, half)]), segments, "y")
    ).moved((x, y, radius))


def _stations(shape: CarShape) -> Array:
    arch = shape.wheel_radius + 0.055
    around = arch * np.array([-1.0, -0.75, 0.0, 0.75, 1.0]) * 0.999
    wheels = [shape.front_axle + around, shape.rear_axle + around]
    h = shape.half_length
    ends = [h - 0.12 * (1.0 - np.sin(np.radians(turn))) for turn in (90.0, 60.0, 30.0, 0.0)]
    return np.unique(np.round(np.concatenate([*wheels, ends, [-x for x in ends], [0.0]]), 6))[::-1]


def shell(shape: CarShape) -> tuple[Mesh, Mesh]:
    """Return the painted and the black part of the lower body; together they are closed."""
    xs = _stations(shape)
    past = np.clip((np.abs(xs) - (shape.half_length - 0.12)) / 0.12, 0.0, 1.0)
    insets = 0.12 * (1.0 - np.sqrt(1.0 - past**2))
    line = np.array(shape.deck)
    deck = PchipInterpolator(line[:, 0], line[:, 1])
    rings = np.stack([lower_body.shell_ring(shape, float(x), float(i), deck) for x, i in zip(xs, insets, strict=True)])
    total = rings.shape[1]
    half = list(_COLUMNS)
    rings = rings[:, half + [total - j for j in half[-2:0:-1]]]
    columns = rings.shape[1]
    column = np.repeat(np.tile(np.arange(columns), len(rings) - 1), 2)
    parts = [grid(lower_body.deform(shape, rings), close_columns=True)]
    black = [np.minimum(column, columns - 1 - column) < (4 if shape.cladding else 2)]
    for ring, flip in ((rings[0], False), (rings[-1], True)):
        centre = np.array([ring[0, 0], 0.0, 0.5 * (ring[:, 2].min() + ring[:, 2].max())])
        levels = [centre + (ring - centre) * share for share in (1.0, 0.55, 0.0)]
        cap = grid(lower_body.deform(shape, np.stack(levels)), close_columns=True)
        parts.append(cap if flip else cap.flipped())
        black.append(np.zeros(len(cap.faces), bool))
    whole, is_black = outward(merge(parts)), np.concatenate(black)
    painted, dark = (weld(Mesh(whole.vertices, whole.faces[chosen])) for chosen in (~is_black, is_black))
    return painted, dark


def cabin(shape: CarShape) -> tuple[Mesh, Mesh]:
    """Return the painted and the glazed part of the cabin; pillars between panes count as glass."""
    full, kind, half = upper.cabin_points(shape)
    front, rear = [0, 2, 4], [half - 4, half - 2, half - 1]
    inner = [v for pair in shape.glazing for v in (pair[0], pair[1])]
    breaks = upper.cabin_breaks(shape)
    side = [4 + int(np.argmin(np.abs(breaks - v))) for v in (inner[0], 0.5 * (inner[1] + inner[2]), inner[-1])]
    chosen = sorted({*front, *side, *rear})
    columns = chosen + [full.shape[1] - j for j in chosen[-2:0:-1]]
    points = full[list(_LEVELS)][:, columns]
    glazed = np.zeros((len(_LEVELS) - 1, len(columns)), bool)
    for j, (start, stop) in enumerate(zip(columns, [*columns[1:], full.shape[1]], strict=True)):
        glazed[1:3, j] = (kind[3, start:stop] > 0).mean() > 0.6
    surface = grid(points, close_columns=True)
    whole = weld(surface)
    is_out = (
        np.sum(np.cross(*(whole.vertices[whole.faces][:, k] - whole.vertices[whole.faces][:, 0] for k in (1, 2)))[:, 2])
        > 0
    )
    surface = surface if is_out else surface.flipped()
    mask = np.repeat(glazed.ravel(), 2)
    painted, glass = (weld(Mesh(surface.vertices, surface.faces[k])) for k in (~mask, mask))
    return painted, glass


def build(shape: CarShape) -> dict[str, tuple[Mesh, str]]:
    """Return the parts at the light level: name -> (mesh, role); roles as in `detailed.build`, and ``wheel``."""
    lower, dark = shell(shape)
    painted, glazed = cabin(shape)
    whole = merge([lower, dark, painted, glazed])
    w, lamp = shape.width / 2, shape.lamp_height
    lo, hi = shape.tail_lamp
    inner = shape.extra.get("tail_lamp_inner", 0.58)
    front, rear = np.array([-1.0, 0.0, 0.0]), np.array([1.0, 0.0, 0.0])
    heads, tails = [], []
    for side in (1.0, -1.0):
        outline = [
            (0.52 * w, lamp - 0.035),
            (0.93 * w, lamp - 0.005),
            (0.95 * w, lamp + 0.075),
            (0.55 * w, lamp + 0.03),
        ]
        heads.append(panel(whole, outline, front, side, rise=0.02, cells=(2, 5)))
        outline = [(inner * w, lo), (0.92 * w, lo + 0.01), (0.915 * w, hi), ((inner - 0.03) * w, hi - 0.03)]
        tails.append(panel(whole, outline, rear, side, rise=0.02, cells=(2, 5)))
    parts = {
        "body": (merge([lower, painted]), "paint"),
        "glass": (glazed, "glass"),
        "trim": (dark, "trim"),
        "headlamps": (merge(heads), "headlamp"),
        "taillamps": (merge(tails), "taillamp"),
    }
    for name, (is_front, is_left) in WHEELS.items():
        x = shape.front_axle if is_front else shape.rear_axle
        y = (shape.width / 2 - 0.022 - 0.105) * (1 if is_left else -1)
        parts[f"wheel_{name}_tyre"] = (light_wheel(shape.wheel_radius, 0.20, x, y), "wheel")
    return {name: (replace(mesh, uv=None), role) for name, (mesh, role) in parts.items()}
