"""Where things are: the street's cross-section and its lots, as numbers that follow from the variant.

Offsets are measured from the reference line between the two lanes, positive to the left of the ego's direction [m].
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..generators.buildings.houses import HousePlan, family_house
from ..generators.geometry.mesh import Array
from ..generators.roads.way import Way
from ..generators.scene_toml import Lane, Parking

START, STOP = -75.0, 155.0
LANE = 1.4
"""Offset of both lanes' centre lines."""
PARKING_EDGE = -2.75
KERB_RIGHT, KERB_LEFT = -4.85, 2.85
KERB_HEIGHT = 0.12
VERGE, WALK = 1.75, 3.65
"""Distance from the kerb to the outer edge of the verge and of the footway."""
CROSSING = 44.0
"""Arc length where the kerbs are lowered for pedestrians who cross."""
DRIVE_HALF = 1.55
FRONTS = ("hedge", "picket", "hedge", "wall", "hedge", "none")
KINDS = 7
"""How many different houses there are."""


@dataclass(frozen=True)
class Lot:
    """A house with its place.

    Side (+1 left), arc length of its middle, of its drive and its ends, and how far it is set back [m].
    """

    name: str
    side: int
    middle: float
    drive: float
    ends: tuple[float, float]
    setback: float
    kind: int
    house: HousePlan
    front: str
    is_near: bool

    @property
    def door(self) -> float:
        """Arc length of the door [m]."""
        return self.middle + self.side * self.house.shape.doors[0][1]


@dataclass(frozen=True)
class Plan:
    """What a variant decides."""

    variant: int
    way: Way
    lots: tuple[Lot, ...]
    bays: tuple[float, ...]

    def kerb(self, side: int) -> float:
        """Return the offset of the kerb on a side."""
        return KERB_LEFT if side > 0 else KERB_RIGHT

    def pavement(self, side: int) -> float:
        """Return the offset of the outer edge of the footway on a side."""
        return self.kerb(side) + side * WALK


def plan(variant: int) -> Plan:
    """Return the numbers of a variant; 0 is the scene of the package."""
    generator = np.random.default_rng(8000 + variant)
    radius = (
        190.0 if variant == 0 else float(np.round(generator.uniform(140.0, 320.0) * generator.choice((-1.0, 1.0)), 0))
    )
    way = Way(bends=((5.0, 120.0, radius),), start=-110.0, stop=190.0, transition=40.0)
    houses = [family_house(generator, has_garage=True) for _ in range(KINDS)]
    lots = []
    for side in (1, -1):
        s = START + float(generator.uniform(4.0, 9.0))
        number = 0
        while s < STOP - 12.0:
            kind = (number + int(generator.integers(0, 2)) + 3 * (side < 0)) % KINDS
            house = houses[kind]
            half = house.shape.length / 2
            width = float(np.round(2 * half + house.garage + generator.uniform(3.6, 6.0), 1))
            middle = s + 1.4 + half + (house.garage if side < 0 else 0.0)
            away = half + house.garage / 2
            # a house faces the street with its front (-y): its right end (+x) lies against the street's direction on
            # the left side
            drive = middle + away if side > 0 else middle - away
            middle, drive = round(middle, 2), round(drive, 2)
            front = FRONTS[(number + 2 * (side > 0) + variant) % len(FRONTS)]
            near = -32.0 < middle < 100.0
            lots.append(
                Lot(
                    f"{'left' if side > 0 else 'right'}_{number:02d}",
                    side,
                    middle,
                    drive,
                    (s, s + width),
                    float(np.round(generator.uniform(5.5, 7.5), 2)),
                    kind,
                    house,
                    front,
                    near,
                )
            )
            s += width
            number += 1
    drives = np.array([lot.drive for lot in lots if lot.side < 0])
    bays, s = [], START + 12.0
    while s < STOP - 12.0:
        if np.all(np.abs(drives - s) > DRIVE_HALF + 3.4) and abs(s - CROSSING) > 7.0:
            bays.append(round(s, 2))
            s += 6.2
        else:
            s += 0.5
    return Plan(variant, way, tuple(lots), tuple(bays))


def drive_lines(p: Plan) -> dict[str, Array]:
    """Return the centre lines of the two lanes, shape (n, 3)."""
    return {
        "east": p.way.line(START + 1.0, STOP - 1.0, -LANE, 1.5),
        "west": p.way.line(STOP - 1.0, START + 1.0, LANE, 1.5),
    }


def lanes(p: Plan) -> list[Lane]:
    """Return the lanes of vehicles."""
    return [Lane(name, line, "drive", 2.75, 8.3) for name, line in drive_lines(p).items()]


def parking(p: Plan, height: float) -> list[Parking]:
    """Return the places of parked cars: along the right kerb, and on the drive of every house near by."""
    places = []
    for s in p.bays:
        at, yaw = p.way.place(s, 0.5 * (PARKING_EDGE + KERB_RIGHT) + 0.05)
        places.append(Parking((float(at[0]), float(at[1]), 0.0), round(yaw, 4), 5.6, 2.0))
    for lot in p.lots:
        if lot.is_near:
            at, yaw = p.way.place(lot.drive, p.pavement(lot.side) + lot.side * 2.9)
            places.append(
                Parking((float(at[0]), float(at[1]), height), round((yaw + 90.0 * lot.side) % 360.0, 4), 5.0, 2.6)
            )
    return places
