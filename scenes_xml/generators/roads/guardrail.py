"""Guardrail: W-beam swept along a road, C-posts with spacers, turned-away end pieces."""

from __future__ import annotations

import numpy as np

from ..geometry.mesh import Array, Mesh, extrude, grid, merge, outward
from .road import RoadCurve

BEAM_FRONT = np.array(
    [(-0.155, 0.004), (-0.148, 0.012), (-0.122, 0.066), (-0.110, 0.078), (-0.095, 0.081), (-0.080, 0.078), (-0.068,
    0.066),
     (-0.030, 0.012), (-0.016, 0.002), (0.0, 0.0)]
)  # fmt: skip # a table
"""Lower half of the beam's front line: height about the middle and depth towards the road [m] (310 x 83 mm beam)."""

SHEET = 0.004
"""Thickness of the beam's sheet [m]; a little above the real 3 mm, for float32 ray offsets."""


def _profile() -> Array:
    """Return the closed beam profile, shape (n, 2): depth towards the road and height about the middle [m]."""
    lower = BEAM_FRONT[:, ::-1]
    upper = (lower * [1.0, -1.0])[-2::-1]
    front = np.concatenate([lower, upper])
    return np.concatenate([front, front[::-1] - [SHEET, 0.0]])


def beam(curve: RoadCurve, start: float, stop: float, offset: float, height: float = 0.60, side: int = 1) -> Mesh:
    """Return the beam between two arc lengths [m].

    Parameters
    ----------
    curve : RoadCurve
        Line to follow.
    start, stop : float
        First and last arc length [m]; the last metre at each end turns away from the road.
    offset : float
        Lateral offset of the beam's back [m].
    height : float
        Height of the beam's middle [m].
    side : int
        +1 if the road lies to the left of the beam, -1 if to the right.
    """
    inner = np.linspace(start + 1.2, stop - 1.2, int(np.ceil(stop - start - 2.4)) + 1)
    ends = np.array([0.0, 0.08, 0.18, 0.32, 0.5, 0.75, 1.0])
    s = np.concatenate([start + ends, inner, stop - ends[::-1]])
    to_end = np.minimum(s - start, stop - s)
    away = 0.42 * np.clip(1.0 - to_end, 0.0, 1.0) ** 2.2
    profile = _profile()
    lateral = offset + side * (profile[None, :, 0] - away[:, None])
    points = curve.point(s[:, None], lateral, height + profile[None, :, 1] * np.ones((len(s), 1)))
    surface = grid(points, close_columns=True)
    caps = []
    n = len(profile)
    half = n // 2
    for row in (points[0], points[-1]):
        caps.append(grid(np.stack([row[:half], row[half:][::-1]])))
    joint = merge([surface, caps[0], caps[1].flipped()])
    return outward(joint)


def posts(curve: RoadCurve, arc_lengths: Array, offset: float, top: float = 0.72, side: int = 1) -> Mesh:
    """Return C-section posts (120 x 55 x 5 mm) and their spacers behind a beam whose back lies at `offset` [m]."""
    parts = []
    for s in arc_lengths:
        yaw = float(curve.heading(np.array(s)))
        centre = curve.point(np.array(s), offset)
        walls = [
            extrude(np.array([(a, b), (c, b), (c, d), (a, d)]), -0.25, top)
            for a, b, c, d in ((0, 0, 0.12, 0.006), (0, 0.006, 0.006, 0.055), (0.114, 0.006, 0.12, 0.055))
        ]
        spacer = extrude(np.array([(0.0, -0.03), (0.15, -0.03), (0.15, 0.03), (0.0, 0.03)]), 0.50, 0.70)
        local = merge([w.moved((-0.275, -0.0275, 0.0)) for w in walls] + [spacer.moved((-0.153, 0.0, 0.0))])
        local = local if side > 0 else local.moved(yaw=np.pi)
        parts.append(local.moved(centre, yaw + np.pi / 2))
    return merge(parts)


def end_nose(curve: RoadCurve, s: float, offset: float, height: float = 0.60, side: int = 1, forward: int = -1) -> Mesh:
    """Return the round nose that closes a beam end at arc length `s` [m]: a half cylinder as high as the beam."""
    angle = np.linspace(-np.pi / 2, np.pi / 2, 9)
    radius = 0.11
    outline = np.column_stack([forward * (0.02 + radius * np.cos(angle)), radius * np.sin(angle)])
    yaw = float(curve.heading(np.array(s)))
    centre = curve.point(np.array(s), offset - side * 0.40)
    return extrude(outline, height - 0.165, height + 0.165).moved(centre, yaw)
