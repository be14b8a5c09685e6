"""Lanes, turns and ways on foot of the crossing."""

from __future__ import annotations

import numpy as np

from ..generators.geometry import polygon
from ..generators.geometry.mesh import Array
from ..generators.roads.ground import Ground
from ..generators.roads.walkways import walk_lanes
from ..generators.scene_toml import Lane
from . import layout as at

LIMIT, TURNING = 13.9, 5.0
ROUND_THE_KERB = 1.42
"""`reach` of turns to the right: 1.27 m from the kerb or more in variants 0 to 39, half a bus; radii from 6.1 m on."""


def _flat(points: Array, z: float = 0.0) -> Array:
    return np.column_stack([points, np.full(len(points), z)])


def _line(a: tuple[float, float], b: tuple[float, float], step: float = 2.0) -> Array:
    n = max(2, int(np.ceil(np.hypot(b[0] - a[0], b[1] - a[1]) / step)) + 1)
    return np.column_stack([np.linspace(a[0], b[0], n), np.linspace(a[1], b[1], n)])


def offsets(is_main: bool) -> tuple[float, ...]:
    """Return the distances of an arm's lanes from the middle of its street, the innermost first [m]."""
    return (0.5 * at.LANE, 1.5 * at.LANE) if is_main else (0.5 * at.LANE,)


def lanes(plan: at.Layout) -> list[Lane]:
    """Return the lanes of vehicles: into the crossing, through it, and out of it."""
    found, ends, starts = [], {}, {}
    for arm, (heading, is_main) in at.ARMS.items():
        stop, reach = (plan.stop[0], at.REACH[0]) if is_main else (plan.stop[1], at.REACH[1])
        for k, d in enumerate(offsets(is_main)):
            inward, outward = _line((-reach + 2.0, -d), (-stop, -d)), _line((-stop, d), (-reach + 2.0, d))
            ends[arm, k], starts[arm, k] = at.turned(inward, heading), at.turned(outward, heading)
    names = list(at.ARMS)
    ways: dict[tuple[str, int], list[tuple[str, str, int]]] = {key: [] for key in ends}
    for arm, (_, is_main) in at.ARMS.items():
        index = names.index(arm)
        opposite, right, left = (names[(index + k) % 4] for k in (2, 1, 3))
        for k in range(len(offsets(is_main))):
            ways[arm, k].append(("ahead", opposite, k))
        ways[arm, 0].append(("left", left, 0))
        ways[arm, len(offsets(is_main)) - 1].append(("right", right, len(offsets(not is_main)) - 1))
    for (arm, k), line in ends.items():
        heading, is_main = at.ARMS[arm]
        group = "main" if is_main else "side"
        left = f"{arm}_in_{k - 1}" if k > 0 else None
        following = tuple(f"{arm}_{k}_{turn}" for turn, _, _ in ways[arm, k])
        found.append(Lane(f"{arm}_in_{k}", _flat(line), "drive", at.LANE, LIMIT, following, left, signal=group))
        for turn, target, lane in ways[arm, k]:
            out = starts[target, lane]
            away = np.radians(at.ARMS[target][0] + 180.0)
            middle = (
                _line(tuple(line[-1]), tuple(out[0]))
                if turn == "ahead"
                else at.bend(line[-1], np.radians(heading), out[0], away, ROUND_THE_KERB if turn == "right" else 1.15)
            )
            opposite = names[(names.index(arm) + 2) % 4]
            first = tuple(f"{opposite}_{n}_ahead" for n in range(len(offsets(is_main)))) if turn == "left" else ()
            speed = LIMIT if turn == "ahead" else TURNING
            found.append(
                Lane(
                    f"{arm}_{k}_{turn}",
                    _flat(middle),
                    "drive",
                    at.LANE,
                    speed,
                    (f"{target}_out_{lane}",),
                    yield_to=first,
                )
            )
    for (arm, k), line in starts.items():
        left = f"{arm}_out_{k - 1}" if k > 0 else None
        found.append(Lane(f"{arm}_out_{k}", _flat(line), "drive", at.LANE, LIMIT, (), left))
    return found


def walkways(ground: Ground) -> list[Lane]:
    """Return the lanes of people on foot: pavements, round the corners, and over the zebra crossings by their lights.

    Those along the main street are between the shelter, benches and the houses, where two cannot meet.
    """
    over_main, over_side = float(np.mean(at.CROSS_X)), float(np.mean(at.CROSS_Y))
    front, side = at.MAIN + 2.9, at.SIDE + 2.0
    ways, signals = {}, {}
    for y, name in ((-1.0, "right"), (1.0, "left")):
        ways[f"pavement_{name}_west"] = np.array([(-at.REACH[0] + 4.0, y * front), (-over_main, y * front)])
        ways[f"pavement_{name}_east"] = np.array([(over_main, y * front), (at.REACH[0] - 4.0, y * front)])
    narrow = set(ways)
    for x, y, name in (
        (-1.0, -1.0, "south_west"),
        (1.0, -1.0, "south_east"),
        (-1.0, 1.0, "north_west"),
        (1.0, 1.0, "north_east"),
    ):
        bend = polygon.fillet([(over_main, front), (side + 0.15, front - 0.3), (side, over_side)], 1.2, 0.4)
        ways[f"corner_{name}"] = bend * [x, y]
        ways[f"side_{name}"] = np.array([(x * side, y * over_side), (x * side, y * (at.REACH[1] - 4.0))])
        for group, start, kerb in (
            ("walk_main", (over_main, front), (over_main, at.MAIN)),
            ("walk_side", (side, over_side), (at.SIDE, over_side)),
        ):
            ways[f"{group}_{name}"] = np.array([start, kerb]) * [x, y]
            signals[f"{group}_{name}"] = group
    for sign, name in ((-1.0, "south"), (1.0, "north")):
        ways[f"zebra_{name}"] = np.array([(-at.SIDE, sign * over_side), (at.SIDE, sign * over_side)])
    for sign, name in ((-1.0, "west"), (1.0, "east")):
        ways[f"zebra_{name}"] = np.array([(sign * over_main, -at.MAIN), (sign * over_main, at.MAIN)])
    return walk_lanes(ways, ground, 1.5, signals, narrow)
