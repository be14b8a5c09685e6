"""Reads what stands beside and over a road: objects with their outlines and rows, signals, bridges and tunnels."""

from __future__ import annotations

from scarl_sionna.core.untrusted.xml_text import LinedElement

from ..model import Corner, MapObject, MapSignal, Outline, Repeat, SignalReference, Structure
from ..source import Source, child, children

_REPEATED = (
    "tStart", "tEnd", "heightStart", "heightEnd", "zOffsetStart", "zOffsetEnd", "widthStart", "widthEnd",
    "lengthStart", "lengthEnd", "radiusStart", "radiusEnd",
)  # fmt: skip # a table
_TALLEST = 1000.0


def read_objects(source: Source, element: LinedElement | None) -> tuple[MapObject, ...]:
    """Return the objects of a road."""
    found = []
    for one in children(element, "object"):
        size = tuple(source.number(one, key, 0.0, 0.0, 1e5) for key in ("length", "width", "height", "radius"))
        outlines = [*children(child(one, "outlines"), "outline"), *children(one, "outline")]
        if abs(source.number(one, "pitch", 0.0)) > 0.01 or abs(source.number(one, "roll", 0.0)) > 0.01:
            source.note(one.line, "pitch and roll of an <object> are not used: it stands upright")
        found.append(
            MapObject(
                one.line,
                source.text(one, "id", ""),
                source.text(one, "type", "none"),
                source.text(one, "name", ""),
                source.number(one, "s"),
                source.number(one, "t"),
                source.number(one, "zOffset", 0.0),
                source.number(one, "hdg", 0.0),
                source.text(one, "orientation", "none"),
                (size[0], size[1], size[2], size[3]),
                tuple(_outline(source, outline) for outline in outlines),
                tuple(_repeat(source, row) for row in children(one, "repeat")),
            )
        )
    return tuple(found)


def _outline(source: Source, element: LinedElement) -> Outline:
    corners = []
    for one in element:
        assert isinstance(one, LinedElement)
        if one.tag not in ("cornerRoad", "cornerLocal"):
            continue
        is_road = one.tag == "cornerRoad"
        a, b, z = (source.number(one, key) for key in (("s", "t", "dz") if is_road else ("u", "v", "z")))
        corners.append(Corner(is_road, a, b, z, source.number(one, "height", 0.0, -_TALLEST, _TALLEST)))
    if len(corners) < 2:
        raise source.error(element, f"has {len(corners)} corners", "give two or more")
    return Outline(tuple(corners), source.text(element, "closed", "true") not in ("false", "0"))


def _repeat(source: Source, element: LinedElement) -> Repeat:
    numbers = {key: source.number(element, key) for key in _REPEATED if element.get(key) is not None}
    s, length = source.number(element, "s"), source.number(element, "length", low=0.0)
    distance = source.number(element, "distance", 0.0, 0.0)
    if distance and length / distance > 100_000:
        raise source.error(element, f"stands {length / distance:.0f} times", "at most 100000 times")
    return Repeat(s, length, distance, numbers)


def read_structures(source: Source, element: LinedElement | None) -> tuple[Structure, ...]:
    """Return the bridges and tunnels of a road."""
    found = []
    for kind in ("bridge", "tunnel"):
        for one in children(element, kind):
            found.append(Structure(one.line, kind, source.number(one, "s"), source.number(one, "length", low=0.0)))
    return tuple(found)


def read_signals(source: Source, element: LinedElement | None) -> tuple[MapSignal, ...]:
    """Return the signs and traffic lights of a road."""
    found = []
    for one in children(element, "signal"):
        value = source.number(one, "value", 0.0) if one.get("value") else None
        found.append(
            MapSignal(
                one.line,
                source.text(one, "id"),
                source.number(one, "s"),
                source.number(one, "t"),
                source.number(one, "zOffset", 0.0),
                source.number(one, "hOffset", 0.0),
                source.text(one, "orientation", "none"),
                source.text(one, "dynamic", "no") == "yes",
                source.text(one, "country", ""),
                source.text(one, "type", "-1"),
                source.text(one, "subtype", "-1"),
                value,
                source.text(one, "unit", ""),
                source.number(one, "height", 0.0, 0.0, _TALLEST),
                source.number(one, "width", 0.0, 0.0, _TALLEST),
                _lanes(source, one),
            )
        )
    return tuple(found)


def _lanes(source: Source, element: LinedElement) -> tuple[int, ...]:
    """Return the lanes for which a signal is valid."""
    lanes: set[int] = set()
    for span in children(element, "validity"):
        ends = sorted((source.whole(span, "fromLane"), source.whole(span, "toLane")))
        if ends[1] - ends[0] > 1000:
            raise source.error(span, f"names lanes {ends[0]} to {ends[1]}")
        lanes |= set(range(ends[0], ends[1] + 1))
    return tuple(sorted(lanes))


def read_references(source: Source, element: LinedElement | None) -> tuple[SignalReference, ...]:
    """Return the signals of other roads that hold for a road."""
    return tuple(
        SignalReference(
            one.line,
            source.text(one, "id"),
            source.number(one, "s"),
            source.text(one, "orientation", "none"),
            _lanes(source, one),
        )
        for one in children(element, "signalReference")
    )
