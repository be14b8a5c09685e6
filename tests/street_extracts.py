"""Extracts of OpenStreetMap written from metres: a crossing with lights, buildings, a roundabout, a bridge."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

LON, LAT = 10.0, 52.0
_A, _E2 = 6378137.0, 0.0066943799901413165  # WGS 84


def degrees(x: float, y: float) -> tuple[float, float]:
    """Return longitude and latitude of a place, by the radii of curvature at the middle [deg], rounded as in OSM."""
    sine = math.sin(math.radians(LAT))
    across = _A / math.sqrt(1.0 - _E2 * sine * sine)
    along = _A * (1.0 - _E2) / (1.0 - _E2 * sine * sine) ** 1.5
    lon = LON + math.degrees(x / (across * math.cos(math.radians(LAT))))
    return round(lon, 7), round(LAT + math.degrees(y / along), 7)


@dataclass
class Writer:
    """Collects nodes, ways and multipolygons; `text` is the file."""

    rows: list[str] = field(default_factory=list)
    count: int = 0
    known: dict[tuple[float, float], int] = field(default_factory=dict)

    def node(self, x: float, y: float, **tags: str) -> int:
        """Add a node, or find the one there."""
        if (x, y) in self.known and not tags:
            return self.known[x, y]
        self.count += 1
        lon, lat = degrees(x, y)
        inner = "".join(_tag(key, value) for key, value in tags.items())
        self.rows.append(f' <node id="{self.count}" lat="{lat:.7f}" lon="{lon:.7f}">{inner}</node>')
        self.known[x, y] = self.count
        return self.count

    def way(self, points: Sequence[tuple[float, float]], tags: Mapping[str, str]) -> int:
        """Add a way."""
        nodes = [self.node(*point) for point in points]
        self.count += 1
        inner = "".join(f'<nd ref="{one}"/>' for one in nodes) + "".join(_tag(*pair) for pair in tags.items())
        self.rows.append(f' <way id="{self.count}">{inner}</way>')
        return self.count

    def multipolygon(self, outer: Sequence[int], inner: Sequence[int], tags: Mapping[str, str]) -> None:
        """Add a multipolygon of ways."""
        self.count += 1
        members = "".join(
            f'<member type="way" ref="{ref}" role="{role}"/>'
            for role, refs in (("outer", outer), ("inner", inner))
            for ref in refs
        )
        inside = members + "".join(_tag(*pair) for pair in {"type": "multipolygon", **tags}.items())
        self.rows.append(f' <relation id="{self.count}">{inside}</relation>')

    @property
    def text(self) -> str:
        """The file."""
        head = '<?xml version="1.0" encoding="UTF-8"?>\n<osm version="0.6">\n'
        bounds = f' <bounds minlat="{LAT - 0.01}" minlon="{LON - 0.01}" maxlat="{LAT + 0.01}" maxlon="{LON + 0.01}"/>\n'
        order = {"<node": 0, "<way ": 1, "<rela": 2}
        rows = sorted(self.rows, key=lambda row: order[row.strip()[:5]])
        return head + bounds + "\n".join(rows) + "\n</osm>\n"


def _tag(key: str, value: str) -> str:
    return f'<tag k="{key}" v="{value}"/>'


def rectangle(x: float, y: float, length: float, width: float) -> list[tuple[float, float]]:
    """Return a closed rectangle from its lower left corner."""
    return [(x, y), (x + length, y), (x + length, y + width), (x, y + width), (x, y)]


COURT = {"outer": rectangle(20.0, 20.0, 40.0, 30.0), "inner": rectangle(32.0, 30.0, 12.0, 9.0)}
"""Rings of the building with a court in `town`."""
HOUSES = {
    "flat": ((-45.0, 20.0, 15.0, 10.0), {"building": "yes", "height": "12.5", "building:levels": "4"}),
    "gabled": (
        (-70.0, 20.0, 12.0, 8.0),
        {"building": "house", "height": "9", "roof:height": "3", "roof:shape": "gabled", "building:levels": "2"},
    ),
    "hipped": (
        (-95.0, 20.0, 14.0, 8.0),
        {"building": "house", "building:levels": "2", "roof:shape": "hipped", "roof:height": "2.5"},
    ),
    "pyramidal": (
        (-45.0, 50.0, 8.0, 8.0),
        {"building": "yes", "height": "20", "roof:shape": "pyramidal", "roof:height": "6"},
    ),
    "skillion": (
        (-70.0, 50.0, 12.0, 6.0),
        {"building": "yes", "height": "6", "roof:shape": "skillion", "roof:height": "2"},
    ),
}
"""Place (x, y, length, width) and tags of buildings in `town`."""


def town() -> str:
    """Return a crossing with lights, pavements, buildings, and what stands beside the roads."""
    w = Writer()
    w.node(0.0, 0.0, highway="traffic_signals")
    w.node(40.0, 0.0, highway="crossing", crossing="zebra")
    main = {"highway": "secondary", "lanes": "4", "maxspeed": "50", "sidewalk": "both", "name": "High Street"}
    side = {"highway": "tertiary", "maxspeed": "50", "sidewalk": "both"}
    w.way([(-200.0, 0.0), (0.0, 0.0), (40.0, 0.0), (200.0, 0.0)], main)
    w.way([(0.0, -150.0), (0.0, 0.0), (0.0, 120.0), (15.0, 160.0), (60.0, 190.0)], side)
    outer = [w.way(COURT["outer"][:3], {}), w.way(COURT["outer"][2:], {})]  # a ring in two pieces
    w.multipolygon(
        outer, [w.way(COURT["inner"], {})], {"building": "apartments", "height": "15", "building:levels": "5"}
    )
    for (x, y, length, width), tags in HOUSES.values():
        w.way(rectangle(x, y, length, width), tags)
    tower = {"building:part": "yes", "min_height": "6", "height": "18", "building:levels": "6"}
    w.way(rectangle(-120.0, 20.0, 12.0, 12.0), {"building": "office"})
    w.way(rectangle(-120.0, 20.0, 12.0, 12.0), {"building:part": "yes", "height": "6", "building:levels": "2"})
    w.way(rectangle(-118.0, 22.0, 8.0, 8.0), tower)
    for x in range(-90, 100, 30):
        w.node(float(x), -14.0, natural="tree", height="9")
        w.node(float(x) + 15.0, 11.5, highway="street_lamp")
    w.way([(20.0, -16.0), (60.0, -16.0), (60.0, -40.0)], {"barrier": "hedge", "height": "1.8"})
    w.way([(70.0, -16.0), (110.0, -16.0)], {"barrier": "wall", "height": "2.2"})
    w.way([(120.0, -16.0), (160.0, -16.0)], {"barrier": "fence"})
    w.way([(-20.0, -60.0), (20.0, -60.0)], {"barrier": "wall"})
    w.way([(-100.0, -30.0), (-60.0, -35.0), (-20.0, -30.0)], {"highway": "footway", "surface": "gravel"})
    w.way(rectangle(-60.0, -60.0, 30.0, 18.0), {"amenity": "parking"})
    w.way(rectangle(70.0, 20.0, 30.0, 30.0), {"leisure": "pitch"})
    return w.text


def roundabout() -> str:
    """Return a roundabout of 20 m radius with four arms."""
    w = Writer()
    ring = [(20.0 * math.cos(k * math.pi / 8.0), 20.0 * math.sin(k * math.pi / 8.0)) for k in range(16)]
    w.way([*ring, ring[0]], {"highway": "tertiary", "junction": "roundabout", "maxspeed": "30", "oneway": "yes"})
    for k in range(0, 16, 4):
        x, y = ring[k]
        w.way([(6.0 * x, 6.0 * y), (x, y)], {"highway": "tertiary", "maxspeed": "50"})
    return w.text


def bridge() -> str:
    """Return a road that passes over another on a bridge."""
    w = Writer()
    w.way([(0.0, -250.0), (0.0, 250.0)], {"highway": "primary", "lanes": "2", "maxspeed": "70"})
    road = {"highway": "tertiary", "maxspeed": "50"}
    w.way([(-250.0, 0.0), (-30.0, 0.0)], road)
    w.way([(-30.0, 0.0), (30.0, 0.0)], {**road, "bridge": "yes", "layer": "1"})
    w.way([(30.0, 0.0), (250.0, 0.0)], road)
    return w.text


EXTRACTS = {"town": town, "roundabout": roundabout, "bridge": bridge}
