"""The side on which an extract of OpenStreetMap is driven: as its root, its roads or its boundaries say."""

from __future__ import annotations

from collections import Counter

from ..source import Source
from .data import SIDE, SIDES, Extract


def is_driven_on_the_left(extract: Extract, source: Source) -> bool:
    """Return whether an extract is driven on the left; where that is not told once and for all, a finding says so.

    The file's root counts before the tags of its roads, those before the tags of all else (boundaries of countries). Of
    tags that contradict each other those of more elements count; without any it is the right.

    References
    ----------
    .. [1] OpenStreetMap wiki, Key:driving_side: on roads, and on the boundaries of countries.
    """
    if extract.driving_side:
        return extract.driving_side == "left"
    roads = [one.tags for one in extract.ways.values() if "highway" in one.tags]
    others = [one.tags for one in extract.ways.values() if "highway" not in one.tags]
    others += [one.tags for one in extract.relations] + [one.tags for one in extract.nodes]
    for tags in (roads, others):
        told = Counter(one[SIDE] for one in tags if one.get(SIDE) in SIDES)
        if told:
            side = "left" if told["left"] > told["right"] else "right"
            if len(told) > 1:
                source.note(
                    0,
                    f"driven on the {side}: of the tags '{SIDE}' {told['left']} say left and {told['right']} right; "
                    "cut the extract at the change",
                )
            return side == "left"
    source.note(0, f"driven on the right, which is assumed: no tag '{SIDE}' (else write <osm {SIDE}='left' ...>)")
    return False
