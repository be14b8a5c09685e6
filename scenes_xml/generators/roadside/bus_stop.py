"""A bus stop: shelter with glass walls, bench, lit poster and a post with its sign.

It is open to -y, its back stands at y = 0.
"""

from __future__ import annotations

import numpy as np

from ..geometry.mesh import Mesh, box, grid, merge, tube


def shelter(length: float = 4.2, depth: float = 1.5, height: float = 2.5) -> dict[str, Mesh]:
    """Return ``frame``, ``glass``, ``roof``, ``bench`` and ``poster`` of a shelter along x."""
    posts = [box((0.08, 0.08, height), (x, y, height / 2)) for x in (-length / 2, length / 2) for y in (0.0, -depth)]
    posts += [box((0.06, 0.06, height), (x, 0.0, height / 2)) for x in np.linspace(-length / 2, length / 2, 4)[1:-1]]
    posts += [box((length, 0.06, 0.06), (0.0, 0.0, z)) for z in (0.35, height - 0.1)]
    third = (length - 0.24) / 3
    panes = [
        box((third - 0.04, 0.012, height - 0.75), (x, 0.0, 0.5 * height + 0.12))
        for x in (np.arange(3) - 1) * (third + 0.06)
    ]
    panes.append(box((0.012, depth - 0.15, height - 0.75), (-length / 2, -depth / 2, 0.5 * height + 0.12)))
    corners = np.array(
        [
            [(length / 2 - 0.09, -1.3, 0.5), (length / 2 - 0.09, -0.15, 0.5)],
            [(length / 2 - 0.09, -1.3, 2.2), (length / 2 - 0.09, -0.15, 2.2)],
        ]
    )
    poster = grid(corners, np.array([[(1.0, 1.0), (0.0, 1.0)], [(1.0, 0.0), (0.0, 0.0)]])).flipped()
    cabinet = box((0.14, 1.25, 1.9), (length / 2, -0.72, 1.35))
    bench = [
        box((2.2, 0.38, 0.05), (-0.4, -0.45, 0.48)),
        *(box((0.05, 0.34, 0.46), (x, -0.45, 0.23)) for x in (-1.3, 0.5)),
    ]
    return {
        "frame": merge([*posts, cabinet]),
        "glass": merge(panes),
        "roof": box((length + 0.3, depth + 0.35, 0.12), (0.0, -depth / 2, height + 0.06)),
        "bench": merge(bench),
        "poster": poster,
    }


def post(height: float = 2.9) -> dict[str, Mesh]:
    """Return ``pole``, ``flag`` and ``board`` of the stop's post; the flag faces +-x."""
    pole = tube(np.array([(0.0, 0.0, -0.3), (0.0, 0.0, 1.0), (0.0, 0.0, height)]), 0.035, 10)
    flag = []
    for x, flip in ((-0.016, False), (0.016, True)):
        corners = np.array(
            [[(x, -0.5, height - 0.5), (x, -0.04, height - 0.5)], [(x, -0.5, height - 0.04), (x, -0.04, height - 0.04)]]
        )
        uv = np.array([[(1.0, 1.0), (0.0, 1.0)], [(1.0, 0.0), (0.0, 0.0)]])
        if flip:
            uv[..., 0] = 1.0 - uv[..., 0]
        face = grid(corners, uv)
        flag.append(face if flip else face.flipped())
    return {
        "pole": Mesh(pole.vertices, pole.faces),
        "flag": merge(flag),
        "board": box((0.04, 0.34, 0.6), (0.0, -0.2, 1.5)),
    }
