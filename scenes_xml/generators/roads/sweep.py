"""Cross-sections swept along a road, and rows of equal things along it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..geometry.mesh import Array, Mesh, grid, merge
from .road import RoadCurve

STRAIGHT = RoadCurve(bend_start=1e6, bend_stop=1e6 + 1.0)
"""A road along +x."""


def stations(curve: RoadCurve, start: float, stop: float, step: float = 4.0) -> Array:
    """Return arc lengths from `start` to `stop` [m], `step` apart where the road bends, else only the two ends."""
    fine = np.linspace(start, stop, max(2, round((stop - start) / step) + 1))
    return fine if np.any(curve.curvature(fine) != 0.0) else np.array([start, stop])


def sweep(curve: RoadCurve, s: Array, profile: Array, tile: tuple[float, float] = (1.0, 1.0)) -> Mesh:
    """Return the surface of an open `profile`, shape (n, 2).

    Offset to the left and height [m], along the arc lengths `s` [m].

    Texture: u = arc length / tile[0], v = way along the profile / tile[1] [m]. The front looks to the right of the
    profile's direction as seen along the road: a profile over the road from the left foot to the right one faces
    inwards.
    """
    profile = np.asarray(profile, float)
    points = curve.point(s[:, None], profile[None, :, 0], profile[None, :, 1])
    way = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(profile, axis=0), axis=1))]
    u, v = np.broadcast_arrays(s[:, None] / tile[0], way[None, :] / tile[1])
    return grid(points, np.stack([u, v], -1))


def bar(
    curve: RoadCurve, s: Array, low: Sequence[float], high: Sequence[float], tile: tuple[float, float] = (1.0, 1.0)
) -> Mesh:
    """Return a closed bar along the road between the corners `low` and `high` (offset, height) [m]."""
    (d0, z0), (d1, z1) = low, high
    ring = np.array([(d0, z0), (d0, z1), (d1, z1), (d1, z0), (d0, z0)])
    ends = []
    for at, flip in ((s[0], False), (s[-1], True)):
        corners = curve.point(np.full((2, 2), at), np.array([[d0, d1], [d0, d1]]), np.array([[z0, z0], [z1, z1]]))
        uv = np.array([[(d0, z0), (d1, z0)], [(d0, z1), (d1, z1)]]) / tile[1]
        cap = grid(corners, uv)
        ends.append(cap.flipped() if flip else cap)
    return merge([sweep(curve, s, ring, tile), *ends])


def row(
    curve: RoadCurve,
    arc_lengths: Sequence[float] | Array,
    thing: Mesh,
    offset: float,
    height: float = 0.0,
    turn_deg: float = 0.0,
) -> Mesh:
    """Return copies of `thing` along the road as one mesh, turned by `turn_deg` from the road's direction."""
    copies = []
    for s in arc_lengths:
        yaw = float(curve.heading(np.array(s))) + np.radians(turn_deg)
        copies.append(thing.moved(curve.point(np.array(s), offset, height), yaw))
    return merge(copies)


def lane_line(
    curve: RoadCurve, start: float, stop: float, offset: float, height: float = 0.0, step: float = 2.0
) -> Array:
    """Return the centre line of a lane from `start` to `stop`, points `step` [m] apart, shape (n, 3).

    Against the road where `stop` is smaller.
    """
    s = np.linspace(start, stop, max(2, int(np.ceil(abs(stop - start) / step)) + 1))
    return curve.point(s, offset, height)
