"""Where things are: bends and heights of the road, its cross-section and the land beside it, from the variant.

Offsets are measured from the middle of the road, positive to the left of the ego's direction [m].
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..generators.geometry.mesh import Array
from ..generators.roads.road import smooth_noise
from ..generators.roads.way import Way
from ..generators.scene_toml import Lane

START, STOP = -140.0, 260.0
HALF = 3.05
LANE = 1.45
SHOULDER = 0.8
DITCH, BANK = 5.2, 7.2
PATH = 8.2, 10.4
"""Offsets of the edges of the path for bicycles, on the left."""
EDGE = 82.0
BASE = -2.2
"""Height of the land around [m]."""
OFFSETS = np.array(
    [HALF - 0.15, HALF + SHOULDER, 4.4, DITCH, 6.1, BANK, *PATH, 12.0, 16.0, 22.0, 30.0, 40.0, 54.0, 66.0, 74.0, EDGE]
)


@dataclass(frozen=True)
class Plan:
    """What a variant decides.

    The road, the bend with the guardrail, the farm's arc length, and what grows right and left.
    """

    variant: int
    way: Way
    rail: tuple[float, float]
    rail_side: int
    farm: float
    crops: tuple[str, str]


def plan(variant: int) -> Plan:
    """Return the numbers of a variant; 0 is the scene of the package."""
    generator = np.random.default_rng(9000 + variant)
    first, second, sign, farm = 170.0, 210.0, 1.0, 76.0
    crops = ("crop", "soil")
    hill = 1.0
    if variant:
        first, second = (float(np.round(generator.uniform(150.0, 260.0), 0)) for _ in range(2))
        sign = float(generator.choice((-1.0, 1.0)))
        farm = float(np.round(generator.uniform(62.0, 95.0), 1))
        crops = tuple(str(c) for c in generator.choice(("crop", "soil", "lawn"), 2))  # type: ignore[assignment]
        hill = float(np.round(generator.uniform(-1.2, 1.4), 2))
    bends = ((-150.0, -35.0, -sign * second), (8.0, 112.0, sign * first), (125.0, 250.0, -sign * second))
    heights = [
        (-200.0, 1.0),
        (-110.0, 0.9),
        (-60.0, 0.35),
        (0.0, 0.0),
        (60.0, 0.45 * hill),
        (120.0, 0.8 * hill),
        (170.0, 2.2),
        (220.0, 3.9),
        (300.0, 3.2),
    ]
    way = Way(bends=bends, heights=tuple(heights), crown=0.02, half=HALF, start=-230.0, stop=330.0, transition=32.0)
    return Plan(variant, way, (20.0, 104.0), -int(sign), farm, crops)


def _culvert(p: Plan, s: Array) -> Array:
    """Return how much of the ditch is left, 0 to 1, near the farm's drive."""
    return 1.0 - np.exp(-(((s - p.farm) / 4.5) ** 4))


def land_height(p: Plan, s: Array, offset: Array) -> Array:
    """Return the height of the land above the road [m] at an arc length and an offset beyond the carriageway."""
    away = np.abs(offset)
    edge = -p.way.crown * HALF
    ditch = np.interp(
        away, [HALF - 0.15, HALF + SHOULDER, 4.4, DITCH, 6.1, BANK], [-0.05, -0.08, -0.30, -0.62, -0.45, -0.16]
    )
    filled = np.interp(away, [HALF - 0.15, HALF + SHOULDER, BANK], [-0.05, -0.08, -0.16])
    share = np.where(offset > 0, _culvert(p, s), 1.0)
    x, y, _ = np.moveaxis(p.way.point(s, offset), -1, 0)
    roll = 0.22 * smooth_noise(x, y, p.variant + 5, wavelength=26.0) * np.clip((away - 13.0) / 12.0, 0.0, 1.0)
    yard = np.exp(-(((s - p.farm) / 22.0) ** 4)) * (offset > 0) * (away < 50.0)
    rise = np.clip((away - 10.4) / 40.0, 0.0, 1.0) * 0.8
    level = edge + share * ditch + (1.0 - share) * filled + (roll + rise) * (1.0 - yard)
    outer = np.clip((away - 54.0) / (EDGE - 54.0), 0.0, 1.0)
    outer = outer * outer * (3 - 2 * outer)
    return (1.0 - outer) * level + outer * (BASE - 1.0 - p.way.elevation(s))


def drive_lines(p: Plan) -> dict[str, Array]:
    """Return the centre lines of the lanes, shape (n, 3)."""
    way = p.way
    return {"east": way.line(START + 2.0, STOP - 2.0, -LANE), "west": way.line(STOP - 2.0, START + 2.0, LANE)}


def lanes(p: Plan, cycle: dict[str, Array]) -> list[Lane]:
    """Return the lanes of vehicles and of bicycles."""
    drive = [Lane(name, line, "drive", 2.9, 22.2) for name, line in drive_lines(p).items()]
    return drive + [Lane(name, line, "cycle", 1.1, 6.9) for name, line in cycle.items()]
