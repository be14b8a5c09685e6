"""Things of the country.

Power poles with wires, straw bales, and land beside a road whose cells have different surfaces.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ..geometry.mesh import Array, Mesh, box, grid_faces, merge, outward, revolve, tube

ARM_HEIGHT, ARM_REACH = 8.1, 0.85
"""Where the wires of a power pole hang: height of the arm, and how far the outer ones are from the middle [m]."""


def power_pole() -> dict[str, Mesh]:
    """Return ``pole``, ``arm`` and ``insulators`` of a wooden pole of 8.8 m whose arm lies along y."""
    z = np.array([-0.5, 0.0, 4.0, 8.8])
    pole = tube(np.column_stack([0 * z, 0 * z, z]), np.array([0.145, 0.14, 0.125, 0.10]), 12)
    arm = box((0.12, 2 * ARM_REACH + 0.3, 0.12), (0.13, 0.0, ARM_HEIGHT - 0.16))
    struts = [
        tube(
            np.array(
                [(0.13, 0.0, ARM_HEIGHT - 0.9), (0.13, s * 0.3, ARM_HEIGHT - 0.5), (0.13, s * 0.55, ARM_HEIGHT - 0.22)]
            ),
            0.02,
            6,
        )
        for s in (-1.0, 1.0)
    ]
    profile = np.array(
        [(0.001, -0.10), (0.03, -0.10), (0.03, -0.04), (0.06, -0.03), (0.06, 0.01), (0.03, 0.03), (0.001, 0.04)]
    )[::-1]
    knob = outward(revolve(profile, 10))
    knobs = [knob.moved((0.13, y, ARM_HEIGHT)) for y in (-ARM_REACH, 0.0, ARM_REACH)]
    plain = [Mesh(part.vertices, part.faces) for part in (arm, *struts)]
    return {"pole": Mesh(pole.vertices, pole.faces), "arm": merge(plain), "insulators": merge(knobs)}


def wires(feet: Array, headings: Array, sag: float = 0.9, pieces: int = 8) -> Mesh:
    """Return three wires that sag between poles with `feet`, shape (n, 3) [m], and `headings` [rad] of the lines."""
    parts = []
    for a, b, turn_a, turn_b in zip(feet, feet[1:], headings, headings[1:], strict=False):
        for y in (-ARM_REACH, 0.0, ARM_REACH):
            ends = [
                foot + [0.13 * np.cos(t) - y * np.sin(t), 0.13 * np.sin(t) + y * np.cos(t), ARM_HEIGHT + 0.04]
                for foot, t in ((a, turn_a), (b, turn_b))
            ]
            share = np.linspace(0.0, 1.0, pieces + 1)[:, None]
            line = ends[0] + share * (ends[1] - ends[0])
            line[:, 2] -= (4.0 * sag * share * (1.0 - share))[:, 0]
            parts.append(tube(line, 0.009, 4))
    return merge([Mesh(part.vertices, part.faces) for part in parts])


def straw_bale(radius: float = 0.62, width: float = 1.2) -> Mesh:
    """Return a round bale that lies on its side, its axis along y."""
    half = width / 2
    profile = np.array(
        [
            (0.001, -half),
            (0.3, -half),
            (radius - 0.05, -half),
            (radius, -half + 0.06),
            (radius, half - 0.06),
            (radius - 0.05, half),
            (0.3, half),
            (0.001, half),
        ]
    )
    return outward(revolve(profile, 20, "y")).moved((0.0, 0.0, radius - 0.02))


def milestone() -> Mesh:
    """Return a stone of 0.7 m with a rounded top that faces -x."""
    lower = box((0.22, 0.34, 0.85), (0.0, 0.0, 0.125))
    top = tube(np.array([(-0.11, 0.0, 0.55), (0.0, 0.0, 0.55), (0.11, 0.0, 0.55)]), 0.17, 16)
    return merge([Mesh(lower.vertices, lower.faces), Mesh(top.vertices, top.faces)])


def cells(points: Array, kinds: Array, tiles: Mapping[str, float], names: Sequence[str]) -> dict[str, Mesh]:
    """Return the surface through `points`, shape (rows, columns, 3), as one mesh for each kind of its cells.

    Parameters
    ----------
    points : ndarray, shape (rows, columns, 3)
        Corners of the cells [m]; the front looks up if rows x columns does.
    kinds : ndarray of int, shape (rows - 1, columns - 1)
        Index of each cell's surface in `names`.
    tiles : mapping of str to float
        Size of the texture's tile [m].
    """
    rows, columns = points.shape[:2]
    faces = grid_faces(rows, columns)
    flat = points.reshape(-1, 3)
    owner = np.repeat(kinds.reshape(-1), 2)
    a, b, c = (flat[faces[:, k]] for k in range(3))
    if np.cross(b - a, c - a)[:, 2].sum() < 0.0:
        faces = faces[:, ::-1]
    result = {}
    for number, name in enumerate(names):
        chosen = faces[owner == number]
        if len(chosen):
            used, index = np.unique(chosen, return_inverse=True)
            result[name] = Mesh(flat[used], index.reshape(-1, 3).astype(np.int64), flat[used][:, :2] / tiles[name])
    return result
