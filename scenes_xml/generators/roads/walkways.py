"""Lanes of people on foot: both directions of ways that meet at nodes, on the ground as it is built."""

from __future__ import annotations

import numpy as np

from ..geometry.mesh import Array
from ..geometry.polygon import resample
from ..scene_toml import Lane
from .ground import Ground


def walk_lanes(
    ways: dict[str, Array], ground: Ground, width: float = 1.6, speed: float = 1.4, step: float = 1.0
) -> list[Lane]:
    """Return two lanes for each way (``name`` and ``name_back``), joined wherever two ways end at the same place.

    Parameters
    ----------
    ways : mapping of str to ndarray, shape (n, 2)
        Lines in plan [m]; those that meet share an end to 1 cm.
    ground : Ground
        Gives the heights.
    """
    lines = {}
    for name, way in ways.items():
        points = ground.on(resample(np.asarray(way, float)[:, :2], step))
        lines[name], lines[f"{name}_back"] = points, points[::-1]
    result = []
    for name, points in lines.items():
        own = {name, name.removesuffix("_back"), f"{name}_back"}
        after = [
            other for other, line in lines.items() if other not in own and np.linalg.norm(line[0] - points[-1]) < 0.01
        ]
        result.append(Lane(name, points, "walk", width, speed, tuple(after)))
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
