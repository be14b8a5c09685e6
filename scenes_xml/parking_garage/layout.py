"""Where things are in the car park, for each variant.

x runs along the aisles, y across, from the middle of the hall [m]. Traffic goes round counter-clockwise: along y =
-`AISLE` towards +x.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

SEED = 400
AISLE = 8.0
"""Distance of the two aisles' middles from the middle of the hall [m]; they are 6 m wide."""
BAY_DEPTH = 5.0
WALL_Y = 16.0
SPAN = 7.8
"""Distance of columns along x: three bays and a column [m]."""
BAY = 2.5
COLUMN = (0.30, 0.60)
COLUMN_Y = (-11.7, -4.3, 4.3, 11.7)
CROSS = 6.2
"""Width of the cross aisles at both ends [m]."""
RAMP_LENGTH = 30.0
RAMP_HALF = 2.1
TIMES = np.arange(0.0, 9.0 + 1e-9, 0.5)
PARKED_MODELS = ("small_car", "saloon", "suv", "saloon", "suv", "small_car")


@dataclass(frozen=True)
class Bay:
    """A parking bay: row, middle [m], heading of a car nose in [deg].

    Rows: 0 outer right, 1 inner right, 2 inner left, 3 outer left.
    """

    row: int
    x: float
    y: float
    yaw_deg: float


@dataclass(frozen=True)
class Layout:
    """All that a variant changes.

    `spans` between columns, ceiling, depth of the beams (0: flat slab), lamps, colours, what is parked.
    """

    spans: int
    ceiling: float
    beam: float
    lamps: float
    core_left: int
    guard: str
    line: str
    tint: tuple[float, float, float]
    parked: tuple[tuple[Bay, str, int, bool], ...]
    free: tuple[Bay, ...]
    ego_speed: float
    shift: float

    @property
    def half(self) -> float:
        """Return the half length of the rows of bays [m]."""
        return 0.5 * self.spans * SPAN

    @property
    def wall_x(self) -> float:
        """Return the distance of the end walls from the middle [m]."""
        return self.half + 0.4 + CROSS

    @property
    def column_x(self) -> np.ndarray:
        """Return where the rows of columns are [m]."""
        return -self.half + SPAN * np.arange(self.spans + 1)

    @property
    def core(self) -> tuple[float, float]:
        """Return from where to where the block of stairs and lift goes along x [m]."""
        start = -self.half + SPAN * self.core_left
        return start, start + SPAN

    @property
    def level(self) -> float:
        """Return the height of the street above the floor [m]."""
        return self.ceiling + 0.35


def bays(spans: int, core_left: int) -> list[Bay]:
    """Return all bays; those of the inner rows that the core takes are left out."""
    found = []
    for row, (y, yaw) in enumerate(((-13.5, -90.0), (-2.5, 90.0), (2.5, -90.0), (13.5, 90.0))):
        for k in range(spans):
            if row in (1, 2) and k == core_left:
                continue
            for n in range(3):
                found.append(Bay(row, round(-0.5 * spans * SPAN + SPAN * k + 0.15 + BAY * (n + 0.5), 3), y, yaw))
    return found


def keep_free(bay: Bay, half: float) -> bool:
    """Return whether the default drive needs a bay: a car backs out of one, and people walk through others."""
    return (bay.row in (0, 1) and abs(bay.x - 17.0) < 2.6) or (bay.row == 0 and abs(bay.x - 9.0) < 3.6)


def layout(variant: int = 0) -> Layout:
    """Return the layout of a variant; 0 has six spans and beams under its ceiling."""
    g = np.random.default_rng([SEED, variant])
    spans = 6 if variant == 0 else int(g.integers(6, 9))
    core = 0 if variant == 0 else int(g.integers(0, 2))
    places = bays(spans, core)
    half = 0.5 * spans * SPAN
    share = 0.24 if variant == 0 else float(g.uniform(0.15, 0.45))
    parked, free = [], []
    for bay in places:
        taken = g.uniform() < share
        model, colour, nose = (
            PARKED_MODELS[int(g.integers(0, len(PARKED_MODELS)))],
            int(g.integers(0, 4)),
            bool(g.uniform() < 0.6),
        )
        if keep_free(bay, half):
            continue
        if taken:
            parked.append((bay, model, colour, nose))
        else:
            free.append(bay)
    ceiling = 2.9 if variant == 0 else float(np.round(g.uniform(2.7, 3.2), 2))
    beam = 0.40 if variant == 0 else float(g.choice([0.0, 0.35, 0.45]))
    guard = (
        "paint_yellow" if variant == 0 else str(g.choice(["paint_yellow", "paint_green", "paint_blue", "paint_red"]))
    )
    line = "line_yellow" if variant == 0 or g.uniform() < 0.5 else "line_white"
    tint = (1.0, 1.0, 1.0) if variant == 0 else tuple(float(v) for v in g.uniform([0.9, 0.9, 0.85], [1.0, 1.0, 1.0]))
    lamps = 5.2 if variant == 0 else float(g.choice([3.9, 5.2, 7.8]))
    speed = 2.8 if variant == 0 else float(g.uniform(2.2, 3.2))
    return Layout(
        spans,
        ceiling,
        beam,
        lamps,
        core,
        guard,
        line,
        tint,
        tuple(parked[:12]),
        tuple(free),
        speed,
        0.0 if variant == 0 else float(g.uniform(0.0, 1.5)),
    )


def ramp_height(u: np.ndarray, level: float) -> np.ndarray:
    """Return the height of a ramp at the distance u from the hall's wall [m].

    It begins and ends level, its curvature is continuous.
    """
    t = np.clip(u / RAMP_LENGTH, 0.0, 1.0)
    return level * t**3 * (10.0 - 15.0 * t + 6.0 * t * t)
