"""Lanes of people on foot: both directions of ways that meet at nodes, on the ground as it is built."""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np

from ..geometry.mesh import Array
from ..geometry.polygon import resample
from ..scene_toml import Lane
from .ground import Ground

WIDTH, NARROW = 1.6, 0.9
"""Of ways for both directions, and for one [m]."""


def walk_lanes(
    ways: Mapping[str, Array],
    ground: Ground,
    speed: float = 1.4,
    signals: Mapping[str, str] | None = None,
    narrow: Collection[str] = (),
) -> list[Lane]:
    """Return two lanes for each way (``name`` and ``name_back``), joined wherever two ways end at the same place.

    Parameters
    ----------
    ways : mapping of str to ndarray, shape (n, 2)
        Lines in plan [m]; those that meet share an end to 1 cm.
    ground : Ground
        Gives the heights.
    speed : float
        At most [m/s].
    signals : mapping of str to str or None
        Groups of lights at the ends of lanes, by the lane's name.
    narrow : collection of str
        Ways too narrow for people who meet: one lane in the direction of the line.
    """
    lines = {}
    for name, way in ways.items():
        points = ground.on(resample(np.asarray(way, float)[:, :2], 1.0))
        lines[name] = points
        if name not in narrow:
            lines[f"{name}_back"] = points[::-1]
    result = []
    for name, points in lines.items():
        own = {name, name.removesuffix("_back"), f"{name}_back"}
        after = [
            other for other, line in lines.items() if other not in own and np.linalg.norm(line[0] - points[-1]) < 0.01
        ]
        width, signal = NARROW if name in narrow else WIDTH, (signals or {}).get(name)
        result.append(Lane(name, points, "walk", width, speed, tuple(after), signal=signal))
    return result


def split_near(line: Array, places: Array) -> list[Array]:
    """Return the pieces of a plane line between the points nearest to `places`, in the order of the line.

    The places become ends.
    """
    line = np.asarray(line, float)[:, :2]
    cuts = sorted(
        (int(np.argmin(np.linalg.norm(line - place, axis=1))), tuple(place))
        for place in np.asarray(places, float)[:, :2]
    )
    pieces = []
    start, head = 0, line[:1]
    for index, place in cuts:
        pieces.append(np.vstack([head, line[start + 1 : index], [place]]))
        start, head = index, np.array([place])
    pieces.append(np.vstack([head, line[start + 1 :]]))
    return pieces
