"""The road, its ground and its guardrail."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..generators.geometry.mesh import Mesh, levelled, merge
from ..generators.roads import guardrail, road
from . import layout as at
from .layout import CURVE, SEED

Add = Callable[..., None]
MARKING_HEIGHT = 0.004


def add_road(add: Add) -> None:
    """Add pavement, markings, verges and the ground."""
    s = np.arange(at.ROAD_START, at.ROAD_STOP + 1e-9, 2.0)
    right, left = at.PAVEMENT_RIGHT, at.PAVEMENT_LEFT
    span = left - right
    d = np.array([right, right, at.EDGE_RIGHT, 0.0, 1.75, 3.5, at.EDGE_LEFT, left, left])
    pavement = road.strip(CURVE, s, d, np.array([-0.2, 0, 0, 0, 0, 0, 0, 0, -0.2]))
    u = np.broadcast_to((d - right) / span, (len(s), len(d)))
    v = np.broadcast_to(s[:, None] / span, (len(s), len(d)))
    add("road_asphalt", Mesh(pavement.vertices, pavement.faces, np.stack([u, v], -1).reshape(-1, 2)), "asphalt_worn")
    for name, offset in (("right", at.EDGE_RIGHT + 0.06), ("left", at.EDGE_LEFT - 0.06)):
        across = np.array([offset - 0.06, offset + 0.06])
        add(f"marking_edge_{name}", road.strip(CURVE, s, across, np.full(2, MARKING_HEIGHT)), "road_marking")
    starts = np.arange(at.ROAD_START, at.ROAD_STOP - 4.0, 12.0) + 2.0
    add("marking_centre", road.dashes(CURVE, starts, 4.0, 1.75, 0.12, MARKING_HEIGHT), "road_marking")
    for name, edge, sign in (("right", right, -1.0), ("left", left, 1.0)):
        reach = np.array([-0.08, 0.5, at.GRAVEL])
        d = np.sort(edge + sign * reach)
        add(
            f"gravel_{name}",
            road.strip(CURVE, s, d, road.verge_heights(CURVE, s, d, edge, SEED + 5), (2.0, 2.0)),
            "gravel_verge",
        )
        reach = np.concatenate([[at.GRAVEL], np.linspace(2.0, 8.0, 9), np.geomspace(9.5, road.VERGE_WIDTH, 12)])
        d = np.sort(edge + sign * reach)
        heights = road.verge_heights(CURVE, s, d, edge, SEED + 5)
        add(f"terrain_{name}", levelled(road.strip(CURVE, s, d, heights, (7.0, 7.0)), 0.08), "grass_meadow")
    add("terrain_far", road.far_ground(2500.0, SEED + 6), "grass_meadow", 0.5)  # flat: crests seen from below


def add_guardrail(add: Add) -> None:
    """Add the guardrail along the right side."""
    start, stop, offset = at.RAIL_START, at.RAIL_STOP, at.RAIL_OFFSET
    add("guardrail_beam", guardrail.beam(CURVE, start, stop, offset), "galvanized_steel", 50.0)
    posts = np.arange(start + 1.3, stop - 1.0, 2.0)
    add("guardrail_post_row", guardrail.posts(CURVE, posts, offset), "galvanized_steel")
    noses = [guardrail.end_nose(CURVE, start, offset, forward=-1), guardrail.end_nose(CURVE, stop, offset, forward=1)]
    add("guardrail_end_noses", merge(noses), "galvanized_steel")
