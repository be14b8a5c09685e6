"""Sign gantries over a motorway. Local frame: the road runs along x, signs face -x."""

from __future__ import annotations

import numpy as np

from ..geometry.mesh import Mesh, box, merge


def gantry(right: float, left: float, height: float = 6.6, is_light: bool = False) -> dict[str, Mesh]:
    """Return ``frame`` of a portal of lattice beams between feet at y = `right` and y = `left`.

    `height` of the lower chord [m].
    """
    span, middle = left - right, 0.5 * (left + right)
    bars = [box((0.10, span, 0.10), (x, middle, z)) for x in (-0.4, 0.4) for z in (height, height + 0.9)]
    for y in (right, left):
        bars += [box((0.22, 0.22, height + 1.4), (x, y, 0.5 * (height + 1.4) - 0.4)) for x in (-0.4, 0.4)]
        bars.append(box((1.3, 0.8, 0.5), (0.0, y, 0.05)))
    if not is_light:
        places = np.linspace(right, left, max(4, int(span / 1.5)))
        bars += [box((0.06, 0.06, 0.9), (x, y, height + 0.45)) for y in places for x in (-0.4, 0.4)]
        bars += [box((0.8, 0.05, 0.05), (0.0, y, height + dz)) for y in places[::2] for dz in (0.0, 0.9)]
        bars += [
            _strut((x, a, height), (x, b, height + 0.9))
            for a, b in zip(places[:-1:2], places[1::2], strict=False)
            for x in (-0.4, 0.4)
        ]
        bars += [
            _strut((x, b, height), (x, a, height + 0.9))
            for a, b in zip(places[1:-1:2], places[2::2], strict=False)
            for x in (-0.4, 0.4)
        ]
        bars.append(box((0.7, span - 0.6, 0.03), (0.0, middle, height + 0.07)))
    return {"frame": merge([Mesh(b.vertices, b.faces) for b in bars])}


def _strut(a: tuple[float, float, float], b: tuple[float, float, float], size: float = 0.05) -> Mesh:
    """Return a thin bar between two points of the same x."""
    start, stop = np.array(a), np.array(b)
    bar = box((size, float(np.linalg.norm(stop - start)), size))
    angle = np.arctan2(stop[2] - start[2], stop[1] - start[1])
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
    return Mesh(bar.vertices @ turn.T + 0.5 * (start + stop), bar.faces)
