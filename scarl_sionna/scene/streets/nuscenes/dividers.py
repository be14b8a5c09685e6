"""Lines between lanes and between directions, each as a road without lanes that is marked along its middle."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from ..model import Cubics, Finding, LaneSection, Road, RoadMark
from ..sumo.lines import distinct, rounded
from .tables import Expansion

MARKS = "marks"
"""Junction of all these roads: nothing stands beside them."""
WIDTH = 0.12
"""Of a line [m]."""
_STYLES: Mapping[str, str] = {"SOLID": "solid", "DASHED": "broken", "ZIGZAG": "solid"}
_SLOW = 0.5
"""Speed for which corners are rounded [m/s]: as little as may be."""


def dividers(tables: Expansion, is_left_hand: bool, findings: list[Finding]) -> Iterator[Road]:
    """Return the lines of a map; those between directions state no kind: solid, yellow where traffic keeps right."""
    between = "SINGLE_SOLID_WHITE" if is_left_hand else "SINGLE_SOLID_YELLOW"
    for layer in ("lane_divider", "road_divider"):
        for row in tables.rows(layer):
            names, points = tables.line(row, layer)
            segments = row.get(f"{layer}_segments")
            kinds = {
                str(one.get("node_token")): str(one.get("segment_type"))
                for one in (segments if isinstance(segments, list) else [])
                if isinstance(one, dict)
            }
            way = distinct(np.column_stack([points, np.zeros(len(points))]))
            if len(way) < 2:
                continue
            line = rounded(way, _SLOW, (0.0, 0.0))
            chord = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))]
            scale = line.length / max(float(chord[-1]), 1e-9)
            marks: list[RoadMark] = []
            kind = between if layer == "road_divider" else "NIL"
            for name, start in zip(names[:-1] or names, (scale * chord).tolist(), strict=False):
                found = kinds.get(name, kind)
                if not marks or found != kind:
                    marks.append(_mark(found, start, findings))
                kind = found
            section = LaneSection(0, 0.0, line.length, {}, tuple(marks))
            yield Road(
                0, f"{layer}:{row['token']}", "", line.length, MARKS, is_left_hand, line.plan, line.elevation, Cubics(),
                (Cubics(), Cubics()), np.zeros((0, 6)), Cubics(), (section,),
            )  # fmt: skip # a row of a table


def _mark(kind: str, start: float, findings: list[Finding]) -> RoadMark:
    """Return the mark of a kind of segment, as ``DOUBLE_DASHED_WHITE``; ``NIL`` is none."""
    words = kind.split("_")
    style = next((_STYLES[word] for word in words if word in _STYLES), "none")
    if "ZIGZAG" in words:
        findings.append(Finding(0, f"a divider of kind {kind} is drawn as a solid line"))
    elif style == "none" and kind != "NIL":
        findings.append(Finding(0, f"a divider of kind {kind[:40]} is not drawn"))
    color = "yellow" if "YELLOW" in words else "white"
    number = 2 if "DOUBLE" in words and style != "none" else 1
    return RoadMark(0, start, " ".join([style] * number), color, "standard", WIDTH)
