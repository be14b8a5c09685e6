"""Which lane goes on into which: links of lanes, of roads and through junctions, each from a lane's end of travel."""

from __future__ import annotations

from collections.abc import Iterator

from ..model import Road, StreetMap

Key = tuple[str, int, int]
"""A lane of a map: id of its road, number of its section, its id."""

KINDS = {
    "driving": "drive", "entry": "drive", "exit": "drive", "offRamp": "drive", "onRamp": "drive",
    "connectingRamp": "drive", "slipLane": "drive", "HOV": "drive", "bidirectional": "drive", "bus": "drive",
    "taxi": "drive", "mwyEntry": "drive", "mwyExit": "drive", "shared": "drive", "biking": "cycle",
    "sidewalk": "walk", "walking": "walk", "parking": "parking",
}  # fmt: skip # a table
"""Type of a lane in the file -> kind of lane in the scene's network; others are no lanes to move on."""


def runs_forward(road: Road, lane: int, direction: str = "standard") -> bool:
    """Return whether traffic of a lane runs along the reference line."""
    return (lane < 0) ^ road.is_left_hand ^ (direction == "reversed")


def keys(street: StreetMap) -> Iterator[Key]:
    """Return all lanes on which something moves."""
    for road in street.roads.values():
        for number, section in enumerate(road.sections):
            for lane in section.lanes.values():
                if lane.kind in KINDS:
                    yield road.id, number, lane.id


def forward(street: StreetMap, key: Key) -> bool:
    """Return whether traffic of a lane runs along its road's reference line."""
    road = street.roads[key[0]]
    return runs_forward(road, key[2], road.sections[key[1]].lanes[key[2]].direction)


def following(street: StreetMap, key: Key) -> list[Key]:
    """Return the lanes that the file names as the next of a lane, in the direction of its traffic."""
    road = street.roads[key[0]]
    lane = road.sections[key[1]].lanes[key[2]]
    is_forward = forward(street, key)
    targets = lane.successors if is_forward else lane.predecessors
    number = key[1] + (1 if is_forward else -1)
    if 0 <= number < len(road.sections):
        return [found for one in targets if (found := _lane(street, (road.id, number, one)))]
    link = road.successor if is_forward else road.predecessor
    if link is None:
        return []
    if link.kind == "road":
        return [found for one in targets if (found := _at_contact(street, link.id, link.contact, one))]
    return list(_through(street, link.id, key))


def _through(street: StreetMap, junction: str, key: Key) -> Iterator[Key]:
    """Return the lanes of a junction that begin at the end of a lane."""
    if junction not in street.junctions:
        return
    for way in street.junctions[junction].connections:
        if way.incoming != key[0]:
            continue
        for start, target in way.lanes:
            if start == key[2] and (found := _at_contact(street, way.connecting, way.contact, target)):
                yield found


def _at_contact(street: StreetMap, road: str, contact: str, lane: int) -> Key | None:
    """Return the lane of a road at its start or its end."""
    if road not in street.roads:
        return None
    number = 0 if contact == "start" else len(street.roads[road].sections) - 1
    return _lane(street, (road, number, lane))


def _lane(street: StreetMap, key: Key) -> Key | None:
    """Return a lane if there is one on which something moves."""
    lane = street.roads[key[0]].sections[key[1]].lanes.get(key[2])
    return key if lane is not None and lane.kind in KINDS else None


def beside(street: StreetMap, key: Key) -> list[Key]:
    """Return lanes of the roads that a lane's road is linked to at the end of its traffic, named or not."""
    road = street.roads[key[0]]
    is_forward = forward(street, key)
    is_last = key[1] == (len(road.sections) - 1 if is_forward else 0)
    if not is_last:
        number = key[1] + (1 if is_forward else -1)
        return [
            (road.id, number, lane) for lane in road.sections[number].lanes if _lane(street, (road.id, number, lane))
        ]
    link = road.successor if is_forward else road.predecessor
    if link is None:
        return []
    if link.kind == "road":
        ends = [(link.id, link.contact)]
    elif link.id in street.junctions:
        ways = street.junctions[link.id].connections
        ends = [(way.connecting, way.contact) for way in ways if way.incoming == road.id]
    else:
        return []
    found = []
    for target, contact in ends:
        if target in street.roads:
            sections = street.roads[target].sections
            number = 0 if contact == "start" else len(sections) - 1
            found += [(target, number, one) for one in sections[number].lanes if _lane(street, (target, number, one))]
    return found
