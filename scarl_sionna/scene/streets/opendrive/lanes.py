"""Reads the lane sections of a road: lanes, widths, heights and road marks."""

from __future__ import annotations

import numpy as np

from scarl_sionna.core.untrusted.xml_text import LinedElement

from ..model import Array, LaneSection, MapLane, MarkLine, RoadMark
from ..source import Source, child, children

_MOST_LANES = 200


def read_sections(source: Source, lanes: LinedElement, length: float) -> tuple[LaneSection, ...]:
    """Return the lane sections in the order of the file, each up to where the next begins."""
    elements = children(lanes, "laneSection")
    if not elements:
        raise source.error(lanes, "has no <laneSection>")
    starts = [source.number(element, "s") for element in elements]
    sections = []
    for index, element in enumerate(elements):
        start = min(max(starts[index], 0.0), length)
        stop = min(starts[index + 1], length) if index + 1 < len(starts) else length
        if stop < start:
            raise source.error(elements[index + 1], f"s = {stop:g} comes after {start:g}", "put sections in order")
        if source.text(element, "singleSide", "false") == "true":
            source.note(element.line, "<laneSection> with singleSide is read for both sides")
        if stop - start < 1e-6:
            source.note(element.line, "<laneSection> of no length is passed over")
            continue
        sections.append(_section(source, element, start, stop))
    if not sections:
        raise source.error(lanes, "has no <laneSection> of any length")
    return tuple(sections)


def _section(source: Source, element: LinedElement, start: float, stop: float) -> LaneSection:
    found: dict[int, MapLane] = {}
    for side, sign in (("left", 1), ("right", -1)):
        for lane in children(child(element, side), "lane"):
            read = _lane(source, lane)
            if read.id * sign <= 0:
                raise source.error(lane, f"id = {read.id} stands in <{side}>", "left lanes have ids above 0")
            if read.id in found:
                raise source.error(lane, f"id = {read.id} stands twice")
            found[read.id] = read
    for sign in (1, -1):
        own = sorted(abs(k) for k in found if k * sign > 0)
        if own != list(range(1, len(own) + 1)) or len(own) > _MOST_LANES:
            raise source.error(
                element, f"has lanes {[sign * k for k in own][:9]} on a side", "number them 1, 2, 3, ..."
            )
    center = child(child(element, "center"), "lane")
    marks = () if center is None else tuple(_mark(source, one) for one in children(center, "roadMark"))
    return LaneSection(element.line, start, stop, dict(sorted(found.items())), marks)


def _lane(source: Source, element: LinedElement) -> MapLane:
    link = child(element, "link")
    widths, borders = children(element, "width"), children(element, "border")
    return MapLane(
        element.line,
        source.whole(element, "id"),
        source.text(element, "type", "none"),
        source.text(element, "level", "false") in ("true", "1"),
        source.cubics(widths, "sOffset"),
        source.cubics(borders, "sOffset") if borders and not widths else None,
        _heights(source, children(element, "height")),
        tuple(_mark(source, one) for one in children(element, "roadMark")),
        tuple(source.whole(one, "id") for one in children(link, "predecessor")),
        tuple(source.whole(one, "id") for one in children(link, "successor")),
        tuple(_speed(source, one) for one in children(element, "speed")),
        source.text(element, "direction", "standard"),
    )


def _heights(source: Source, elements: list[LinedElement]) -> Array:
    rows = [
        [source.number(e, "sOffset"), *(source.number(e, key, 0.0, -10.0, 10.0) for key in ("inner", "outer"))]
        for e in elements
    ]
    return np.array(sorted(rows)).reshape(-1, 3)


def _speed(source: Source, element: LinedElement) -> tuple[float, float]:
    return source.number(element, "sOffset", 0.0), source.speed(element) or 0.0


def _mark(source: Source, element: LinedElement) -> RoadMark:
    width = source.number(element, "width", -1.0, high=10.0)
    lines = [line for kind in children(element, "type") for line in _lines(source, kind, max(width, 0.0))]
    explicit = [line for kind in children(element, "explicit") for line in _lines(source, kind, max(width, 0.0))]
    return RoadMark(
        element.line,
        source.number(element, "sOffset", 0.0),
        source.text(element, "type", "none"),
        source.text(element, "color", "standard"),
        source.text(element, "weight", "standard"),
        width if width > 0.0 else None,
        tuple(lines),
        tuple(explicit),
    )


def _lines(source: Source, element: LinedElement, width: float) -> list[MarkLine]:
    width = source.number(element, "width", width, 0.0, 10.0)
    return [
        MarkLine(
            source.number(line, "length", 0.0, 0.0),
            source.number(line, "space", 0.0, 0.0),
            source.number(line, "tOffset", 0.0),
            source.number(line, "sOffset", 0.0),
            source.number(line, "width", width, 0.0, 10.0) or width,
            line.get("color"),
        )
        for line in children(element, "line")
    ]
