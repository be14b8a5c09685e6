"""Parts of a motorway.

Guardrails that follow wide bends with few triangles, median barrier, noise wall, emergency telephone.
"""

from __future__ import annotations

import numpy as np

from ..geometry.mesh import Array, Mesh, box, merge
from .road import RoadCurve
from .sweep import bar, row, sweep

BEAM = np.array(
    [
        (0.0, -0.155),
        (0.08, -0.112),
        (0.08, -0.078),
        (0.0, -0.03),
        (0.0, 0.03),
        (0.08, 0.078),
        (0.08, 0.112),
        (0.0, 0.155),
    ]
)
"""Front line of a W-beam: depth towards the road and height about its middle [m]."""
SHEET = 0.004


def rail(curve: RoadCurve, s: Array, offset: float, side: int, height: float = 0.60) -> Mesh:
    """Return a W-beam along the arc lengths `s` whose back lies at `offset`.

    `side` is +1 if the road lies to its left [m].
    """
    profile = np.vstack([BEAM, BEAM[::-1] - [SHEET, 0.0], BEAM[:1]])
    ring = np.column_stack([offset + side * profile[:, 0], height + profile[:, 1]])
    return sweep(curve, s, ring if side < 0 else ring[::-1])


def rail_posts(curve: RoadCurve, arc_lengths: Array, offset: float, side: int) -> Mesh:
    """Return posts (100 x 55 mm) with spacers behind a beam whose back lies at `offset` [m]."""
    post = merge(
        [box((0.10, 0.055, 1.05), (0.0, -side * 0.20, 0.20)), box((0.08, 0.17, 0.18), (0.0, -side * 0.09, 0.60))]
    )
    return row(curve, arc_lengths, Mesh(post.vertices, post.faces), offset)


def barrier(curve: RoadCurve, s: Array, offset: float = 0.0, height: float = 0.9) -> Mesh:
    """Return a concrete barrier with two sloping sides (0.6 m wide at the foot)."""
    half = np.array([(0.30, -0.05), (0.30, 0.08), (0.18, 0.26), (0.10, height - 0.03), (0.08, height)])
    ring = np.vstack([half, half[::-1] * [-1.0, 1.0]])
    ends = [
        bar(curve, s[k] + np.array([-0.01, 0.01]), (offset - 0.2, -0.05), (offset + 0.2, height - 0.3)) for k in (0, -1)
    ]
    return merge([sweep(curve, s, ring + [offset, 0.0], (2.0, 2.0)), *ends])


def noise_wall(
    curve: RoadCurve, start: float, stop: float, offset: float, height: float, pitch: float = 4.0
) -> dict[str, Mesh]:
    """Return ``panels`` and ``posts`` of a noise wall."""
    posts = np.arange(start, stop + 1e-9, pitch)
    step = box((0.16, 0.18, height + 0.1), (0.0, 0.0, 0.5 * height))
    panels = bar(curve, posts, (offset - 0.06, -0.3), (offset + 0.06, height), (4.0, 4.0))
    return {"panels": panels, "posts": row(curve, posts, step, offset)}


def telephone() -> dict[str, Mesh]:
    """Return ``case`` and ``door`` of an emergency telephone that faces -y."""
    case = merge(
        [
            box((0.32, 0.28, 0.75), (0.0, 0.0, 1.15)),
            box((0.14, 0.14, 1.0), (0.0, 0.0, 0.3)),
            box((0.36, 0.34, 0.08), (0.0, 0.0, 1.55)),
        ]
    )
    return {"case": case, "door": box((0.22, 0.02, 0.5), (0.0, -0.15, 1.15))}
