"""Where things are: ring and arms, their kerbs, islands and lanes, as numbers that follow from the variant.

The middle of the ring is the origin. An arm's own frame has x outwards along its axis and y to the left of that: who
comes in drives at y > 0, who leaves at y < 0; the ring turns anticlockwise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..generators.geometry.mesh import Array
from ..generators.geometry.polygon import resample
from ..generators.scene_toml import Lane

ARMS = ("east", "north", "west", "south")
REACH = 150.0
"""Length of the arms from the middle [m]."""
PAVEMENT = 2.7
KERB_HEIGHT = 0.12
WIDE, NARROW = 4.7, 3.5
"""Half width of an arm beside its island, and far out [m]."""
LANE_NEAR, LANE_FAR = 2.9, 1.75
ISLAND = 1.1
KERB_FILLET, LANE_FILLET = 11.0, 13.0
ZEBRA = 6.5, 9.5
"""The crossing lies between these distances from the ring's outer edge [m]."""


@dataclass(frozen=True)
class Plan:
    """What a variant decides.

    Radius of the ring's outer edge [m], directions of the arms [deg], and what stands in the middle.
    """

    variant: int
    outer: float
    directions: tuple[float, float, float, float]
    middle: str

    @property
    def centre_line(self) -> float:
        """Radius of the ring's lane [m]."""
        return self.outer - 3.3

    @property
    def apron(self) -> tuple[float, float]:
        """Inner and outer radius of the paved apron round the central island [m]."""
        return self.outer - 8.2, self.outer - 6.4

    @property
    def zebra(self) -> tuple[float, float]:
        """Where crossings lie along an arm [m]."""
        return self.outer + ZEBRA[0], self.outer + ZEBRA[1]


def plan(variant: int) -> Plan:
    """Return the numbers of a variant; 0 is the scene of the package."""
    if variant == 0:
        return Plan(0, 17.0, (0.0, 88.0, 180.0, 273.0), "sculpture")
    generator = np.random.default_rng(7000 + variant)
    turn = generator.uniform(-3.0, 3.0, 3)
    directions = (round(float(turn[0]), 1), round(90.0 + float(turn[1]), 1), 180.0, round(270.0 + float(turn[2]), 1))
    return Plan(
        variant,
        round(float(generator.uniform(15.5, 20.0)), 1),
        directions,
        str(generator.choice(("sculpture", "trees", "stones"))),
    )


def turned(points: Array, direction_deg: float) -> Array:
    """Return points of an arm's frame in the world, in plan."""
    c, s = np.cos(np.radians(direction_deg)), np.sin(np.radians(direction_deg))
    return np.asarray(points, float)[..., :2] @ np.array([[c, s], [-s, c]])


def _widening(x: Array, outer: float) -> Array:
    """Return the share, 0 to 1, of an arm's widening at a distance from the middle [m]."""
    t = np.clip((outer + 45.0 - x) / 28.0, 0.0, 1.0)
    return t * t * (3 - 2 * t)


def arm_half_width(x: Array, outer: float) -> Array:
    """Return half the width of an arm [m]."""
    return NARROW + (WIDE - NARROW) * _widening(x, outer)


def _to_circle(y: float, radius: float, fillet: float) -> tuple[float, Array]:
    """Return where a line at `y` leaves for an arc onto a circle about the origin, and the arc's points, (n, 2)."""
    middle = np.array([np.sqrt((radius + fillet) ** 2 - (y + fillet) ** 2), y + fillet])
    start, stop = -np.pi / 2, np.arctan2(-middle[1], -middle[0])
    angles = np.linspace(start, stop, max(4, int(np.ceil((start - stop) * fillet / 0.6)) + 1))
    return float(middle[0]), middle + fillet * np.column_stack([np.cos(angles), np.sin(angles)])


def kerb_half(p: Plan) -> Array:
    """Return the kerb on an arm's left side from far out to the ring's edge, in the arm's frame, shape (n, 2)."""
    bend, arc = _to_circle(WIDE, p.outer, KERB_FILLET)
    x = np.linspace(REACH, bend, int((REACH - bend) / 2.0) + 1)
    return np.vstack([np.column_stack([x, arm_half_width(x, p.outer)]), arc[1:]])


def _arc(radius: float, start_deg: float, stop_deg: float, step: float = 0.6) -> Array:
    """Return points of a circle about the origin, anticlockwise."""
    start, stop = np.radians(start_deg), np.radians(stop_deg)
    stop += 2 * np.pi * np.ceil((start - stop) / (2 * np.pi) - 1e-9)
    angles = np.linspace(start, stop, max(3, int(np.ceil((stop - start) * radius / step)) + 1))
    return radius * np.column_stack([np.cos(angles), np.sin(angles)])


def block_kerb(p: Plan, number: int) -> Array:
    """Return the kerb line of the block between an arm and the next.

    In along the first, out along the second, shape (n, 2).
    """
    half = kerb_half(p)
    first, second = p.directions[number], p.directions[(number + 1) % 4]
    angle = float(np.degrees(np.arctan2(half[-1, 1], half[-1, 0])))
    ring = _arc(p.outer, first + angle, second - angle)
    return np.vstack([turned(half, first), ring[1:-1], turned(half[::-1] * [1.0, -1.0], second)])


def lane_half(p: Plan) -> Array:
    """Return the centre line of the lane into the ring, in the arm's frame, shape (n, 2).

    Mirrored and reversed, it leads out.
    """
    bend, arc = _to_circle(LANE_NEAR, p.centre_line, LANE_FILLET)
    x = np.linspace(REACH - 5.0, bend, int((REACH - 5.0 - bend) / 1.5) + 1)
    y = LANE_FAR + (LANE_NEAR - LANE_FAR) * _widening(x, p.outer)
    return np.vstack([np.column_stack([x, y]), arc[1:]])


def drive_lines(p: Plan) -> dict[str, Array]:
    """Return the centre lines of the lanes of vehicles by name, in plan."""
    half = lane_half(p)
    stop = int(np.argmax(np.hypot(*half.T) < p.outer + 0.7))
    join = float(np.degrees(np.arctan2(half[-1, 1], half[-1, 0])))
    lines = {}
    for number, (arm, direction) in enumerate(zip(ARMS, p.directions, strict=True)):
        following = p.directions[(number + 1) % 4]
        lines[f"{arm}_in"] = turned(half[: stop + 1], direction)
        lines[f"{arm}_entry"] = turned(half[stop:], direction)
        back = turned(half[::-1] * [1.0, -1.0], direction)
        lines[f"{arm}_exit"] = back[: len(half) - stop]
        lines[f"{arm}_out"] = back[len(half) - stop - 1 :]
        lines[f"ring_{arm}"] = _arc(p.centre_line, direction - join, direction + join)
        lines[f"ring_after_{arm}"] = _arc(p.centre_line, direction + join, following - join)
    return lines


def lanes(p: Plan) -> list[Lane]:
    """Return the lanes of vehicles, flat at z = 0."""
    result = []
    lines = drive_lines(p)
    for number, arm in enumerate(ARMS):
        following = ARMS[(number + 1) % 4]
        links: dict[str, tuple[tuple[str, ...], tuple[str, ...], float]] = {
            f"{arm}_in": ((f"{arm}_entry",), (f"ring_{arm}",), 13.9),
            f"{arm}_entry": ((f"ring_after_{arm}",), (), 8.3),
            f"ring_{arm}": ((f"ring_after_{arm}",), (), 8.3),
            f"ring_after_{arm}": ((f"{following}_exit", f"ring_{following}"), (), 8.3),
            f"{arm}_exit": ((f"{arm}_out",), (), 8.3),
            f"{arm}_out": ((), (), 13.9),
        }
        for name, (after, giving_way, speed) in links.items():
            points = np.column_stack([lines[name], np.zeros(len(lines[name]))])
            result.append(Lane(name, points, "drive", 3.5, speed, after, yield_to=giving_way))
    return result


def island_outlines(p: Plan) -> tuple[Array, Array]:
    """Return the two parts of an arm's island, before and behind the crossing, anticlockwise, in the arm's frame."""
    near, far = p.zebra
    start = p.outer + 1.4
    flare = 1.25
    first = np.array(
        [
            (start + 0.9, -ISLAND),
            (near, -ISLAND),
            (near, ISLAND),
            (start + 0.9, ISLAND),
            (start + 0.25, 0.8 * flare),
            (start, 0.4),
            (start, -0.4),
            (start + 0.25, -0.8 * flare),
        ]
    )
    end = far + 8.0
    tip = 0.28
    second = np.array(
        [
            (far, -ISLAND),
            (end - 5.5, -ISLAND),
            (end - 0.2, -tip),
            (end, -0.1),
            (end, 0.1),
            (end - 0.2, tip),
            (end - 5.5, ISLAND),
            (far, ISLAND),
        ]
    )
    return tuple(resample(np.vstack([o, o[:1]]), 0.6)[:-1] for o in (first, second))  # type: ignore[return-value]
