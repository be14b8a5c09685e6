"""Where things are at the crossing, for each variant.

The main street runs along x with two lanes in each direction, the side street along y with one; the origin is the
middle of the crossing. Traffic keeps to the right [m].
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..generators.geometry.mesh import Array

SEED = 500
LANE = 3.5
MAIN = 7.0
"""Half width of the main street's carriageway [m]."""
SIDE = 3.75
"""Half width of the side street's carriageway [m]."""
CORNER = 6.0
"""Radius of the kerbs at the corners [m]."""
REACH = (100.0, 80.0)
"""How far the streets go from the middle, along x and along y [m]."""
KERB = 0.12
RAMP = 1.3
"""Width of the strip behind the kerb that slopes where the kerb is dropped [m]."""
DROPPED = 2.2
"""Half length of a dropped kerb [m]."""
CROSS_X, CROSS_Y = (10.0, 13.5), (13.3, 16.3)
"""Zebra crossings: from the middle along x (over the main street) and along y (over the side street) [m]."""
CYCLE = 40.0
GREEN = {"main": (0.0, 18.0), "side": (22.0, 35.0), "walk_main": (23.0, 33.0), "walk_side": (1.0, 14.0)}
"""Traffic of a street, and people who cross it, who have time to get over before its traffic goes [s]."""
TIMES = np.arange(0.0, 9.0 + 1e-9, 0.5)


@dataclass(frozen=True)
class House:
    """A building in the street front: kind of `Layout.kinds`, middle, turn [deg] and material of its walls."""

    kind: int
    x: float
    y: float
    turn: float
    walls: str


@dataclass(frozen=True)
class Layout:
    """All that a variant changes."""

    pavement: tuple[float, float]
    kinds: tuple[tuple[float, int, float, float, bool], ...]
    corner_storeys: tuple[int, int, int, int]
    houses: tuple[House, ...]
    corner_walls: tuple[str, ...]
    lamp_spacing: float
    stop_x: float
    speed: float
    shift: float
    stop: tuple[float, float]
    """Distance of the stop lines from the middle, along x and along y [m]."""
    variant: int


WALLS = ("facade_cream", "facade_rose", "facade_grey", "facade_brick", "facade_white", "facade_stone")
CORNER_SIZE = 15.0
DEPTH = 11.0


def layout(variant: int = 0) -> Layout:
    """Return the layout of a variant.

    Its houses, their heights and colours, widths of pavements, lamps and traffic come from the number.
    """
    g = np.random.default_rng([SEED, variant])
    pavement = (
        (4.0, 3.4)
        if variant == 0
        else (float(np.round(g.uniform(3.4, 5.5), 1)), float(np.round(g.uniform(3.0, 4.2), 1)))
    )
    kinds = []
    for _ in range(5):
        axis = float(np.round(g.uniform(2.3, 3.1), 2))
        width = float(np.round(g.uniform(16.0, 24.0), 1))
        kinds.append(
            (width, int(g.integers(4, 7)), axis, float(np.round(g.uniform(1.0, 1.5), 2)), bool(g.uniform() < 0.5))
        )
    houses = []
    for sx in (-1.0, 1.0):
        for sy in (-1.0, 1.0):
            x = SIDE + pavement[1] + CORNER_SIZE
            while x < REACH[0] - 6.0:
                kind = int(g.integers(0, 5))
                width = kinds[kind][0]
                houses.append(
                    House(
                        kind,
                        sx * (x + width / 2),
                        sy * (MAIN + pavement[0] + DEPTH / 2),
                        0.0 if sy > 0 else 180.0,
                        str(g.choice(WALLS)),
                    )
                )
                x += width + 0.02
            y = MAIN + pavement[0] + CORNER_SIZE
            while y < REACH[1] - 6.0:
                kind = int(g.integers(0, 5))
                width = kinds[kind][0]
                houses.append(
                    House(
                        kind,
                        sx * (SIDE + pavement[1] + DEPTH / 2),
                        sy * (y + width / 2),
                        -90.0 if sx > 0 else 90.0,
                        str(g.choice(WALLS)),
                    )
                )
                y += width + 0.02
    storeys = tuple(int(v) for v in g.integers(5, 8, 4))
    corner_walls = tuple(str(v) for v in g.permutation(np.array(WALLS))[:4])
    lamp = 26.0 if variant == 0 else float(g.uniform(20.0, 32.0))
    stop = 33.0 if variant == 0 else float(g.uniform(30.0, 50.0))
    speed = 8.5 if variant == 0 else float(g.uniform(7.0, 10.0))
    lines = (
        (15.0, 17.8)
        if variant == 0
        else (float(np.round(g.uniform(14.6, 16.5), 2)), float(np.round(g.uniform(17.4, 19.3), 2)))
    )
    return Layout(
        pavement,
        tuple(kinds),
        storeys,
        tuple(houses),
        corner_walls,
        lamp,
        stop,
        speed,
        0.0 if variant == 0 else float(g.uniform(0.0, 4.0)),
        lines,
        variant,
    )


ARMS = {"west": (0.0, True), "south": (90.0, False), "east": (180.0, True), "north": (-90.0, False)}
"""Arm from which one comes -> heading of those who drive in [deg], whether it is the main street."""


def turned(points: Array, heading_deg: float) -> Array:
    """Return points (n, 2) of a frame whose x is the heading of those who drive in, in the world."""
    c, s = np.cos(np.radians(heading_deg)), np.sin(np.radians(heading_deg))
    return np.asarray(points, float) @ np.array([[c, s], [-s, c]])


def bend(a: Array, heading_a: float, b: Array, heading_b: float, reach: float = 1.15, step: float = 0.8) -> Array:
    """Return a smooth way, shape (n, 2), from a to b with the given headings [rad].

    Quintic, level curvature at both ends; the larger `reach`, the less it cuts the corner and the sharper it turns.
    """
    span = float(np.linalg.norm(b - a))
    scale = reach * span
    da, db = (
        scale * np.array([np.cos(heading_a), np.sin(heading_a)]),
        scale * np.array([np.cos(heading_b), np.sin(heading_b)]),
    )
    u = np.linspace(0.0, 1.0, max(6, int(span / step) + 1))[:, None]
    h = u**3 * (10.0 - 15.0 * u + 6.0 * u**2)
    ha, hb = u - 6.0 * u**3 + 8.0 * u**4 - 3.0 * u**5, -4.0 * u**3 + 7.0 * u**4 - 3.0 * u**5
    return a + h * (b - a) + ha * da + hb * db
