"""Where a road passes over another without a bridge in the file: it gets one there, so that the road below is open."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import shapely

from ..model import Array, Finding, Road, StreetMap, Structure
from .road import RoadShape

OVER = 3.5
"""Heights that differ by more are roads one above the other [m]."""
AHEAD = 8.0
"""How far a deck reaches beyond the road below [m]."""
STEP = 4.0
_NONE = ("none", "border")


@dataclass(frozen=True, eq=False)
class _Strip:
    """Quadrilaterals across a road, STEP long: stations of their ends (n, 2), ground plans and heights (n,)."""

    road: str
    s: Array
    plans: Array
    z: Array


def with_decks(street: StreetMap, shapes: Mapping[str, RoadShape], findings: list[Finding]) -> StreetMap:
    """Return a map in which roads that pass over others have bridges.

    Parameters
    ----------
    street : StreetMap
    shapes : mapping
        Geometry of each road by its id.
    findings : list of Finding
        Gets the roads that a bridge was added to.
    """
    strips = [_strip(shapes[road.id]) for road in street.roads.values()]
    if not strips:
        return street
    plans = np.concatenate([strip.plans for strip in strips])
    z = np.concatenate([strip.z for strip in strips])
    owner = np.concatenate([np.full(len(strip.z), k) for k, strip in enumerate(strips)])
    if np.ptp(z) < OVER:
        return street
    one, other = shapely.STRtree(plans).query(plans, predicate="intersects")
    above = (z[one] - z[other] > OVER) & (owner[one] != owner[other])
    found: dict[str, list[Array]] = {}
    for k, below in zip(one[above], other[above], strict=True):
        strip, under = strips[owner[k]], strips[owner[below]]
        first = int(np.searchsorted(owner, owner[k]))
        span = strip.s[k - first]
        lower = under.s[below - int(np.searchsorted(owner, owner[below]))]
        if _is_on(street.roads[strip.road], "bridge", span) or _is_on(street.roads[under.road], "tunnel", lower):
            continue
        found.setdefault(strip.road, []).append(span)
    roads = dict(street.roads)
    for name, spans in found.items():
        road = roads[name]
        own = tuple(
            Structure(road.line, "bridge", low, high - low)
            for low, high in _joined(np.array(spans) + [-AHEAD, AHEAD], road.length)
        )
        findings.append(Finding(road.line, "a road passes over another without a <bridge>; it gets one"))
        roads[name] = replace(road, structures=(*road.structures, *own))
    return replace(street, roads=roads)


def _strip(shape: RoadShape) -> _Strip:
    """Return a road cut into quadrilaterals over its lanes of use."""
    spans, plans, heights = [], [], []
    for section in shape.road.sections:
        used = [number for number, lane in section.lanes.items() if lane.kind not in _NONE]
        if not used:
            continue
        s = np.linspace(section.s, section.stop, max(2, int((section.stop - section.s) / STEP) + 1))
        edges = [
            shape.edges(section, number, s)[1 if side * number > 0 else 0]
            for side, number in ((1, max(used)), (-1, min(used)))
        ]
        left, right = edges
        corners = np.stack([left[:-1], left[1:], right[1:], right[:-1]], 1)
        plans.append(shapely.polygons(corners[..., :2]))
        heights.append(corners[..., 2].mean(1))
        spans.append(np.column_stack([s[:-1], s[1:]]))
    if not spans:
        return _Strip(shape.road.id, np.zeros((0, 2)), np.zeros(0, dtype=object), np.zeros(0))
    return _Strip(shape.road.id, np.concatenate(spans), np.concatenate(plans), np.concatenate(heights))


def _is_on(road: Road, kind: str, span: Array) -> bool:
    middle = float(span.mean())
    return any(one.kind == kind and one.s <= middle <= one.s + one.length for one in road.structures)


def _joined(spans: Array, length: float) -> list[tuple[float, float]]:
    """Return spans within a road, those that touch as one."""
    joined: list[tuple[float, float]] = []
    for low, high in np.clip(spans[np.argsort(spans[:, 0])], 0.0, length):
        if joined and low <= joined[-1][1] + AHEAD:
            joined[-1] = (joined[-1][0], max(joined[-1][1], float(high)))
        else:
            joined.append((float(low), float(high)))
    return joined
