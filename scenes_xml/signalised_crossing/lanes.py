"""Lanes, turns and ways on foot of the crossing."""

from __future__ import annotations

import numpy as np

from ..generators.geometry.mesh import Array
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
    """Return all lanes: into the crossing, through it, out of it, and over the zebra crossings."""
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
    for sign, name in ((-1.0, "south"), (1.0, "north")):
        y = sign * np.mean(at.CROSS_Y)
        found.append(Lane(f"zebra_{name}", _flat(_line((-at.SIDE, y), (at.SIDE, y))), "walk", 3.0, 1.5))
    for sign, name in ((-1.0, "west"), (1.0, "east")):
        x = sign * np.mean(at.CROSS_X)
        found.append(Lane(f"zebra_{name}", _flat(_line((x, -at.MAIN), (x, at.MAIN))), "walk", 3.0, 1.5))
    for sign, name in ((-1.0, "right"), (1.0, "left")):
        for side, a, b in (
            ("west", -at.REACH[0] + 4.0, -at.SIDE - at.CORNER - 1.0),
            ("east", at.SIDE + at.CORNER + 1.0, at.REACH[0] - 4.0),
        ):
            y = sign * (at.MAIN + 2.9)  # between the shelter, benches and the houses
            found.append(Lane(f"pavement_{name}_{side}", _flat(_line((a, y), (b, y)), at.KERB), "walk", 0.9, 1.5))
    return found
