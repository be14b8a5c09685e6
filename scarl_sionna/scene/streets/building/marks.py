"""Road marks of a map: lines along the borders of lanes, by type and colour, on the mesh that they lie on."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from scenes_xml.generators.geometry.mesh import Mesh, grid, merge

from ..geometry.road import RoadShape
from ..model import Array, Finding, LaneSection, MarkLine, RoadMark
from .surfaces import upwards

RAISED = 0.004
"""Height of a mark above its lane [m]."""
DASH, GAP, WIDTH, BOLD = 3.0, 6.0, 0.12, 0.25
"""What a mark has whose lines are not stated [m]."""
COLORS = {
    "standard": "line_white", "white": "line_white", "yellow": "line_yellow", "blue": "line_blue",
    "green": "line_green", "red": "line_red", "orange": "line_orange", "black": "line_black", "violet": "line_violet",
}  # fmt: skip # a table
_SIDE = {"solid": 0.0, "broken": DASH}
_DOT = 0.10


def road_marks(shape: RoadShape, section: LaneSection, s: Array, findings: list[Finding]) -> Iterator[tuple[str, Mesh]]:
    """Return the marks of a section at its stations: material and mesh."""
    rows: list[tuple[int, RoadMark]] = [(0, mark) for mark in section.center_marks]
    rows += [(lane.id, mark) for lane in section.lanes.values() for mark in lane.marks]
    for lane in {number for number, _ in rows}:
        marks = sorted((mark for number, mark in rows if number == lane), key=lambda mark: mark.s_offset)
        ends = [section.s + mark.s_offset for mark in marks[1:]] + [section.stop]
        for mark, stop in zip(marks, ends, strict=True):
            start = section.s + max(mark.s_offset, 0.0)
            if mark.kind == "none" or min(stop, section.stop) - start < 0.05:
                continue
            if mark.color not in COLORS:
                findings.append(Finding(mark.line, f"<roadMark> of colour '{mark.color}' is drawn white"))
            material = COLORS.get(mark.color, "line_white")
            for line in _lines(mark, findings):
                own = COLORS.get(line.color or "", material)
                sides = [_beside(shape, section, lane, s, line.t + side * line.width) for side in (0.5, -0.5)]
                dashes = [stripe(s, sides, dash) for dash in _dashes(line, start, min(stop, section.stop), mark)]
                if dashes:
                    yield own, merge(dashes)


def _lines(mark: RoadMark, findings: list[Finding]) -> Sequence[MarkLine]:
    """Return the lines of a mark: those of the file, or those of its type."""
    if mark.explicit:
        return mark.explicit
    width = mark.width or (BOLD if mark.weight == "bold" else WIDTH)
    if mark.lines:
        return [line if line.width > 0.0 else _with_width(line, width) for line in mark.lines]
    words = mark.kind.split()
    if mark.kind == "botts dots":
        return [MarkLine(_DOT, 1.2, 0.0, 0.0, _DOT)]
    if words and all(word in _SIDE for word in words):
        shifts = [0.0] if len(words) == 1 else [width, -width]  # the left line first
        return [
            MarkLine(_SIDE[word], GAP if _SIDE[word] else 0.0, shift, 0.0, width)
            for word, shift in zip(words, shifts, strict=False)
        ]
    if mark.kind not in ("curb", "grass", "edge"):
        findings.append(Finding(mark.line, f"<roadMark> of type '{mark.kind}' is not drawn"))
    elif mark.kind == "edge":
        return [MarkLine(0.0, 0.0, 0.0, 0.0, width)]
    return []


def _with_width(line: MarkLine, width: float) -> MarkLine:
    return MarkLine(line.length, line.space, line.t, line.s, width, line.color)


def _dashes(line: MarkLine, start: float, stop: float, mark: RoadMark) -> Iterator[tuple[float, float]]:
    """Return from where to where the dashes of a line go."""
    first = start + line.s
    if mark.explicit:
        if line.length > 0.0:
            yield first, min(first + line.length, stop)
        return
    if line.space <= 0.0:
        if stop - max(first, start) > 0.02:
            yield max(first, start), stop
        return
    period = max(line.length + line.space, 0.1)
    for k in range(int(np.ceil((stop - first) / period))):
        low, high = first + k * period, min(first + k * period + line.length, stop)
        if high - low > 0.02:
            yield max(low, start), high


def stripe(s: Array, sides: Sequence[Array], span: tuple[float, float], raised: float = RAISED) -> Mesh:
    """Return a dash between two lines of points at the stations `s`, which lies `raised` [m] above their chords."""
    low, high = span
    own = np.r_[low, s[(s > low + 1e-6) & (s < high - 1e-6)], high]
    lines = [np.column_stack([np.interp(own, s, corner[:, k]) for k in range(3)]) for corner in sides]
    points = np.stack(lines, 1) + [0.0, 0.0, raised]
    return upwards(grid(points, points[..., :2]))


def _beside(shape: RoadShape, section: LaneSection, lane: int, s: Array, t: float) -> Array:
    """Return the surface at a distance `t` to the left of a lane's outer border, shape (n, 3)."""
    border = shape.edges(section, lane, s)[1]
    number = _neighbour(lane, t > 0.0)
    if number in section.lanes:
        inner, outer = shape.edges(section, number, s)
        away = np.linalg.norm((outer - inner)[:, :2], axis=1)
        ends = (inner, outer) if (number > 0) == (t > 0.0) else (outer, inner)
        share = np.where(away > 0.05, abs(t) / np.maximum(away, 0.05), 0.0)[:, None]
        found = ends[0] + share * (ends[1] - ends[0])
        found[:, 2] = np.where(away > 0.05, found[:, 2], border[:, 2])
        if np.abs(ends[0][:, 2] - border[:, 2]).max() > 0.01:  # a kerb: the mark stays on its own side
            found[:, 2] = border[:, 2]
    else:
        found = border.copy()
    thin = np.linalg.norm((found - border)[:, :2], axis=1) < 0.5 * abs(t)
    if thin.any():
        heading = shape.frame(s).heading
        normal = np.column_stack([-np.sin(heading), np.cos(heading)])
        found[thin, :2] = border[thin, :2] + t * normal[thin]
        found[thin, 2] = border[thin, 2]
    return found


def _neighbour(lane: int, is_left: bool) -> int:
    """Return the lane that lies to the left or to the right of a lane's outer border."""
    if lane > 0:
        return lane + 1 if is_left else lane
    if lane < 0:
        return lane if is_left else lane - 1
    return 1 if is_left else -1


def crossing_bars(corners: Array, period: float = 1.0, share: float = 0.5) -> list[Array]:
    """Return the bars of a zebra crossing within an outline of four corners (4, 3), each a quadrilateral (4, 3).

    Bars lie along the traffic, which crosses the longer sides.
    """
    a, b, c, d = corners
    if np.linalg.norm(b - a) < np.linalg.norm(d - a):
        a, b, c, d = b, c, d, a
    length = float(np.linalg.norm(b - a))
    edges = np.arange(0.25 * period, length, period)
    bars = []
    for start, stop in ((edge, min(edge + share * period, length)) for edge in edges):
        u, v = start / length, stop / length
        bars.append(np.stack([a + u * (b - a), a + v * (b - a), d + v * (c - d), d + u * (c - d)]))
    return bars
