"""Traffic lights: heads with three lenses, heads for people on foot, masts and cantilevers.

A head faces -x (towards a driver who travels along +x); its back stands at x = 0.
"""

from __future__ import annotations

import numpy as np

from ..geometry.mesh import Array, Mesh, box, grid, merge, tube

LENS = 0.10
"""Radius of a lens [m]."""


def _lens(y: float, z: float, x: float, segments: int, radius: float = LENS) -> Mesh:
    """Return a lens, slightly bulged, that faces -x."""
    angle = np.linspace(0.0, 2.0 * np.pi, segments, endpoint=False)
    ring = np.column_stack([np.full(segments, x), y + radius * np.cos(angle), z + radius * np.sin(angle)])
    k = np.arange(segments)
    fan = np.stack([(k + 1) % segments, k, np.full(segments, segments)], 1).astype(np.int64)
    return Mesh(np.vstack([ring, [[x - 0.02, y, z]]]), fan)


def _visor(z: float, x: float, segments: int = 9) -> Mesh:
    """Return the shade over a lens: a piece of a tube that is open below."""
    angle = np.linspace(np.radians(-20.0), np.radians(200.0), segments)
    rows = [
        np.column_stack([np.full(segments, px), r * np.cos(angle), z + r * np.sin(angle)])
        for px, r in ((x, 0.115), (x - 0.18, 0.12))
    ]
    return grid(np.stack(rows))


def head(is_light: bool = False) -> dict[str, Mesh]:
    """Return ``case``, ``red``, ``amber`` and ``green`` of a head 0.96 m high with a backing board.

    Its lower edge is at the origin.
    """
    x = -0.20
    case = [box((0.19, 0.30, 0.96), (-0.105, 0.0, 0.48)), box((0.012, 0.62, 1.25), (-0.05, 0.0, 0.48))]
    heights = {"red": 0.80, "amber": 0.48, "green": 0.16}
    if not is_light:
        case += [_visor(z, x) for z in heights.values()]
    parts = {"case": merge([Mesh(m.vertices, m.faces) for m in case])}
    return parts | {name: _lens(0.0, z, x - 0.004, 8 if is_light else 16) for name, z in heights.items()}


def walker_head() -> dict[str, Mesh]:
    """Return ``case``, ``red`` and ``green`` of a head for people on foot, 0.55 m high.

    Its lower edge is at the origin.
    """
    case = merge(
        [
            Mesh(m.vertices, m.faces)
            for m in (box((0.16, 0.26, 0.55), (-0.08, 0.0, 0.275)), _visor(0.41, -0.16), _visor(0.14, -0.16))
        ]
    )
    return {"case": case, "red": _lens(0.0, 0.41, -0.164, 14, 0.085), "green": _lens(0.0, 0.14, -0.164, 14, 0.085)}


def mast(height: float = 3.4) -> dict[str, Mesh]:
    """Return ``pole`` and ``button`` of a post at the kerb; the button's box looks to -y."""
    pole = tube(
        np.array([(0.0, 0.0, -0.3), (0.0, 0.0, 0.25), (0.0, 0.0, 0.3), (0.0, 0.0, height)]),
        np.array([0.085, 0.085, 0.055, 0.055]),
        12,
    )
    return {"pole": Mesh(pole.vertices, pole.faces), "button": box((0.11, 0.10, 0.20), (0.0, -0.09, 1.0))}


def cantilever(reach: float, height: float = 6.1) -> dict[str, Mesh]:
    """Return ``pole`` of a mast with an arm of `reach` [m] to +y whose middle is at `height` [m]."""
    shaft = tube(
        np.array([(0.0, 0.0, -0.4), (0.0, 0.0, 0.0), (0.0, 0.0, 3.0), (0.0, 0.0, height + 0.4)]),
        np.array([0.15, 0.15, 0.12, 0.10]),
        14,
    )
    arm = tube(
        np.array([(0.0, 0.0, height - 0.1), (0.0, 0.5 * reach, height + 0.08), (0.0, reach, height + 0.15)]),
        np.array([0.09, 0.075, 0.05]),
        12,
    )
    foot = box((0.5, 0.5, 0.12), (0.0, 0.0, 0.05))
    return {"pole": merge([Mesh(m.vertices, m.faces) for m in (shaft, arm, foot)])}


def plate(width: float, height: float) -> dict[str, Mesh]:
    """Return ``face`` and ``back`` of a hanging sign in the plane x = 0 that faces -x, its middle at the origin."""
    corners: Array = np.array(
        [
            [(-0.03, -width / 2, -height / 2), (-0.03, width / 2, -height / 2)],
            [(-0.03, -width / 2, height / 2), (-0.03, width / 2, height / 2)],
        ]
    )
    uv = np.array([[(1.0, 1.0), (0.0, 1.0)], [(1.0, 0.0), (0.0, 0.0)]])
    return {"face": grid(corners, uv).flipped(), "back": box((0.05, width, height))}
