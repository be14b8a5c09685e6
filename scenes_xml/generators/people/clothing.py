"""Helmets and a bag for a body at rest; they are measured by it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..geometry.loft import ellipsoid, loft
from ..geometry.mesh import Array, Mesh, box, merge, tube
from .garments import Surface

HEIGHT = 1.75
"""Of the body whose `Surface.scale` is 1 [m]."""


@dataclass(frozen=True)
class _Skull:
    """Middle of the skull at the height of the brows, its half axes there, and the chin [m]."""

    middle: Array
    radii: Array
    chin: Array


def _skull(surface: Surface) -> _Skull:
    scalp, brow, lips, ears = (
        surface.points[np.unique(surface.faces[surface.regions == name])] for name in ("scalp", "brow", "lips", "ear")
    )
    back, front, height = scalp[:, 0].min(), brow[:, 0].max(), float(brow[:, 2].mean())
    middle = np.array([0.5 * (back + front), 0.0, height])
    wide = 0.5 * (np.abs(scalp[:, 1]).max() + np.abs(ears[:, 1]).max())
    radii = np.array([0.5 * (front - back), wide, scalp[:, 2].max() - height])
    lip = lips[lips[:, 0].argmax()]
    return _Skull(middle, radii, np.array([lip[0] - 0.018, 0.0, lip[2] - 0.055 * surface.scale]))


def backpack(surface: Surface) -> Mesh:
    """Return a backpack, on the back of a body at rest, with straps that lie on the shoulders."""
    h, low = HEIGHT * surface.scale, surface.origins["torso"]
    trunk = surface.points[np.unique(surface.faces[np.isin(surface.regions, ("chest", "collar", "waist"))])] - low

    def reach(y: float, z: float, sign: float) -> float:
        near = trunk[np.hypot(np.abs(trunk[:, 1]) - abs(y), trunk[:, 2] - z) < 0.035 * surface.scale]
        return float(sign * (sign * near[:, 0]).max() + sign * 0.024) if len(near) else 0.0

    rows = [
        (0.045, 0.020, 0.050, -0.108), (0.055, 0.042, 0.074, -0.108), (0.12, 0.052, 0.080, -0.112), (0.20, 0.047,
        0.078, -0.106),
        (0.255, 0.034, 0.066, -0.096), (0.270, 0.015, 0.045, -0.090),
    ]  # fmt: skip # a table
    back = min(reach(0.0, z * h, -1.0) for z in (0.12, 0.20))
    sack = loft(np.array([(z * h, a * h, b * h, (x + 0.060) * h + back, 0.0) for z, a, b, x in rows]), 22, 3.2)
    straps = []
    top = float(trunk[np.abs(np.abs(trunk[:, 1]) - 0.06 * h) < 0.02, 2].max()) + 0.020
    for side in (1.0, -1.0):
        y = side * 0.060 * h
        front = [(reach(y, z * h, 1.0), y, z * h) for z in (0.255, 0.21, 0.16, 0.11)]
        under = [(0.0, side * (float(np.abs(trunk[np.abs(trunk[:, 2] - 0.09 * h) < 0.02, 1]).max()) + 0.018), 0.09 * h)]
        path = [(back, y, 0.25 * h), (reach(y, 0.26 * h, -1.0), y, 0.265 * h), (0.0, y, top), *front, *under]
        straps.append(tube(np.array([*path, (back, y, 0.075 * h)]), 0.006 * h, 6))
    pocket = box((0.02 * h, 0.11 * h, 0.075 * h), (back - 0.104 * h, 0.0, 0.10 * h))
    return merge([sack, pocket, *straps]).moved(low)


def _around(centre: Array, radii: Array, low: float, rows: int, segments: int) -> Mesh:
    x, y, z = centre.tolist()
    a, b, c = radii.tolist()
    return ellipsoid((x, y, z), (a, b, c), low=low, rows=rows, segments=segments)


def bicycle_helmet(surface: Surface, light: bool = False) -> Mesh:
    """Return a bicycle helmet; it goes with the head."""
    skull = _skull(surface)
    radii = skull.radii + [0.024, 0.020, 0.026]
    centre = skull.middle + [-0.002, 0.0, 0.004]
    shell = _around(centre, radii, 0.05, *((4, 10) if light else (9, 22)))
    if light:
        return shell
    t = np.radians(np.linspace(15.0, 165.0, 9))
    ribs = []
    for share in (-0.55, 0.0, 0.55):
        part = np.sqrt(1.0 - share**2)
        arch = np.stack([part * np.cos(t), np.full(9, share), part * np.sin(t)], axis=1)
        ribs.append(tube(centre + arch * (radii + 0.002), 0.008, 6))
    ear, chin = skull.middle + [0.02, 0.0, 0.01], skull.chin + [-0.035, 0.0, 0.0]
    cheek = 0.5 * (ear + chin)
    half = [(ear, 0.98 * skull.radii[1]), (cheek, 0.86 * skull.radii[1]), (chin, 0.35 * skull.radii[1])]
    way = [point + [0.0, y, 0.0] for point, y in half] + [point - [0.0, y, 0.0] for point, y in reversed(half)]
    return merge([shell, *ribs, tube(np.array(way), 0.004, 5)])


def motorcycle_helmet(surface: Surface, light: bool = False) -> tuple[Mesh, Mesh]:
    """Return shell and visor of a full-face helmet; they go with the head, which is inside."""
    skull = _skull(surface)
    rows, segments = (5, 10) if light else (14, 26)
    top, chin = skull.middle[2] + skull.radii[2] + 0.034, skull.chin[2] - 0.008
    middle = np.array([skull.middle[0], 0.0, 0.5 * (top + chin)])
    radii = np.array([skull.radii[0] + 0.036, skull.radii[1] + 0.040, 0.5 * (top - chin)])
    shell = _around(middle, radii, -0.85, rows, segments)
    front = middle[0] + radii[0]
    low = np.array([front - 0.078, 0.0, chin + 0.056])
    bow = _around(low, np.array([0.086, radii[1] - 0.016, 0.060]), -1.0, 3 if light else rows // 2, segments)
    glass = np.array([front - 0.085, 0.0, skull.middle[2] - 0.022])
    visor = _around(glass, np.array([0.097, radii[1] - 0.010, 0.052]), -1.0, 4 if light else rows - 4, segments)
    outside = [_outside(part, middle, 0.94 * radii) for part in (bow, visor)]
    return merge([shell, outside[0]]), outside[1]


def _outside(mesh: Mesh, centre: Array, radii: Array) -> Mesh:
    """Return a mesh without the faces that are wholly inside an ellipsoid."""
    out = np.linalg.norm((mesh.vertices - centre) / radii, axis=1) > 1.0
    return replace(mesh, faces=mesh.faces[out[mesh.faces].any(axis=1)])
