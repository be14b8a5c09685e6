"""The road, its ground and its guardrail."""

from __future__ import annotations

import numpy as np

from ..generators.geometry.mesh import Mesh, levelled, merge
from ..generators.kit import SceneKit
from ..generators.roads import guardrail, road
from ..generators.roads.wear import LaneSurface, add_wear
from . import layout as at
from .layout import Layout

MARKING_HEIGHT = 0.004


def add_road(kit: SceneKit, plan: Layout) -> None:
    """Add pavement, markings, verges and the ground."""
    curve = plan.curve
    s = np.arange(at.ROAD_START, at.ROAD_STOP + 1e-9, 4.0 if kit.is_light else 2.0)
    right, left = at.PAVEMENT_RIGHT, at.PAVEMENT_LEFT
    span = left - right
    d = np.array([right, right, at.EDGE_RIGHT, 0.0, 1.75, 3.5, at.EDGE_LEFT, left, left])
    pavement = road.strip(curve, s, d, np.array([-0.2, 0, 0, 0, 0, 0, 0, 0, -0.2]))
    u = np.broadcast_to((d - right) / span, (len(s), len(d)))
    v = np.broadcast_to(s[:, None] / span, (len(s), len(d)))
    kit.add(
        "road_asphalt", Mesh(pavement.vertices, pavement.faces, np.stack([u, v], -1).reshape(-1, 2)), "asphalt_worn"
    )
    for name, offset in (("right", at.EDGE_RIGHT + 0.06), ("left", at.EDGE_LEFT - 0.06)):
        across = np.array([offset - 0.06, offset + 0.06])
        kit.add(f"marking_edge_{name}", road.strip(curve, s, across, np.full(2, MARKING_HEIGHT)), "road_marking")
    if plan.variant:
        lanes = [LaneSurface.along(curve, s, offset, 3.5) for offset in (0.0, 3.5)]
        add_wear(kit, lanes, np.random.default_rng([plan.seed, 20]), "country")
    starts = np.arange(at.ROAD_START, at.ROAD_STOP - 4.0, 12.0) + 2.0
    kit.add("marking_centre", road.dashes(curve, starts, 4.0, 1.75, 0.12, MARKING_HEIGHT), "road_marking")
    for name, edge, sign in (("right", right, -1.0), ("left", left, 1.0)):
        reach = np.array([-0.08, 0.5, at.GRAVEL])
        d = np.sort(edge + sign * reach)
        kit.add(
            f"gravel_{name}",
            road.strip(curve, s, d, road.verge_heights(curve, s, d, edge, plan.seed + 5), (2.0, 2.0)),
            "gravel_verge",
        )
        reach = np.concatenate([[at.GRAVEL], np.linspace(2.0, 8.0, 9), np.geomspace(9.5, road.VERGE_WIDTH, 12)])
        d = np.sort(edge + sign * reach)
        heights = road.verge_heights(curve, s, d, edge, plan.seed + 5)
        kit.add(f"terrain_{name}", levelled(road.strip(curve, s, d, heights, (7.0, 7.0)), 0.08), "grass_meadow")
    far = road.far_ground(2500.0, plan.seed + 6)
    kit.add("terrain_far", far, "grass_meadow", 0.5)  # flat: crests seen from below
    kit.instance("road", "Roads", ["road_asphalt"])
    kit.instance("lane_markings", "RoadLine", ["marking_*"])
    kit.instance("gravel_verges", "Terrain", ["gravel_*"])
    kit.instance("terrain", "Terrain", ["terrain_*"])


def add_guardrail(kit: SceneKit, plan: Layout) -> None:
    """Add the guardrail along the outside of the bend."""
    curve, side = plan.curve, -plan.outside
    (start, stop), offset = plan.rail, plan.beside(plan.outside, 1.15)
    kit.add("guardrail_beam", guardrail.beam(curve, start, stop, offset, side=side), "galvanized_steel", 50.0)
    posts = np.arange(start + 1.3, stop - 1.0, 4.0 if kit.is_light else 2.0)
    kit.add("guardrail_post_row", guardrail.posts(curve, posts, offset, side=side), "galvanized_steel")
    noses = [
        guardrail.end_nose(curve, start, offset, side=side, forward=-1),
        guardrail.end_nose(curve, stop, offset, side=side, forward=1),
    ]
    kit.add("guardrail_end_noses", merge(noses), "galvanized_steel")
    kit.instance("guardrail_right" if side > 0 else "guardrail_left", "GuardRail", ["guardrail_*"], True)
