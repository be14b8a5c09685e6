"""Buildings of an extract of OpenStreetMap: ground plans, heights, roofs; what the tags leave open by seed.

Tags as in "Simple 3D Buildings" (wiki.openstreetmap.org): `height`, `min_height`, `building:levels`, `roof:shape`, ...
"""

from __future__ import annotations

import re
import zlib
from collections.abc import Iterator, Mapping

import numpy as np
import shapely

from ..building.buildings import ROOFS
from ..model import Building
from ..source import Source
from .data import Extract, Tags
from .outlines import Plan, plans

STOREY = 3.0
"""Height of a storey where none is stated [m]."""
TALLEST = 1000.0
_HOUSES = ("house", "detached", "semidetached_house", "terrace", "bungalow", "farm", "cabin", "villa")
_STOREYS: Mapping[str, tuple[int, int]] = {
    **dict.fromkeys(_HOUSES, (1, 2)), "bungalow": (1, 1), "garage": (1, 1), "garages": (1, 1), "shed": (1, 1),
    "hut": (1, 1), "carport": (1, 1), "roof": (1, 1), "kiosk": (1, 1), "greenhouse": (1, 1), "service": (1, 1),
    "apartments": (3, 5), "office": (3, 6), "hotel": (3, 6), "hospital": (3, 5), "commercial": (2, 4),
    "retail": (1, 2), "supermarket": (1, 1), "industrial": (2, 3), "warehouse": (2, 3), "church": (4, 5),
    "school": (2, 3),
}  # fmt: skip # a table
"""Storeys of a building whose height is not stated, by its kind: drawn within these."""
_OTHERS = (2, 4)
_BLIND = (
    "garage",
    "garages",
    "shed",
    "hut",
    "carport",
    "roof",
    "warehouse",
    "church",
    "greenhouse",
    "transformer_tower",
)
_OPEN = ("roof", "carport")
_WALLS = ("facade_white", "facade_cream", "facade_rose", "facade_grey", "facade_brick", "facade_stone")
_MATERIALS = {
    "brick": "facade_brick", "stone": "facade_stone", "sandstone": "facade_stone", "limestone": "facade_stone",
    "concrete": "concrete_grey", "wood": "boards", "timber_framing": "boards", "glass": "shelter_glass",
    "metal": "garage_door", "steel": "garage_door",
}  # fmt: skip # a table
_COVERS = {
    "roof_tiles": "tiles_red", "slate": "tiles_dark", "metal": "galvanized_steel", "copper": "galvanized_steel",
    "grass": "lawn", "concrete": "concrete_grey", "gravel": "gravel_fine", "glass": "shelter_glass",
}  # fmt: skip # a table
_FEET = re.compile(r"""^\s*(\d+(?:\.\d+)?)\s*'(?:\s*(\d+(?:\.\d+)?)\s*")?\s*$""")
_METRES = re.compile(r"^\s*(\d+(?:[.,]\d+)?)\s*(m|ft)?\s*$")


def buildings(extract: Extract, source: Source) -> Iterator[Building]:
    """Return the buildings of an extract; a building that has parts is drawn by its parts."""
    whole = list(plans(extract, source, "building"))
    parts = list(plans(extract, source, "building:part"))
    tree = shapely.STRtree([part.polygon for part in parts])
    for plan in whole:
        polygon = plan.polygon
        inside = [parts[k] for k in tree.query(polygon)] if parts else []
        if "building:part" not in plan.tags and any(
            shapely.intersection(polygon, part.polygon).area > 0.5 * part.polygon.area for part in inside
        ):
            continue
        yield _building(plan, source, plan.tags.get("building", "yes"))
    for plan in parts:
        if plan.tags.get("building", "no") == "no":
            yield _building(plan, source, plan.tags["building:part"])


def length(tags: Tags, key: str, line: int, source: Source) -> float | None:
    """Return a tag as a length [m]: plain numbers are metres, ``ft`` and ``12'6"`` are known; else it is noted."""
    text = tags.get(key)
    if text is None:
        return None
    plain, feet = _METRES.match(text), _FEET.match(text)
    if plain:
        value = float(plain[1].replace(",", ".")) * (0.3048 if plain[2] == "ft" else 1.0)
    elif feet:
        value = 0.3048 * (float(feet[1]) + float(feet[2] or 0.0) / 12.0)
    else:
        value = -1.0
    if not 0.0 <= value <= TALLEST:
        source.note(line, f"{key} = '{text[:40]}' is no length of 0 to {TALLEST:g} m; it is not used")
        return None
    return value


def _levels(tags: Tags, key: str, line: int, source: Source) -> float | None:
    text = tags.get(key)
    if text is None:
        return None
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0.0 <= value <= 300.0:
        source.note(line, f"{key} = '{text[:40]}' is no number of storeys; it is not used")
        return None
    return value


def _building(plan: Plan, source: Source, kind: str) -> Building:
    tags, line = plan.tags, plan.line
    draw = np.random.default_rng(zlib.crc32(plan.id.encode()))  # the same look on every day
    low, high = _STOREYS.get(kind, _OTHERS)
    drawn, wall, hue = int(draw.integers(low, high + 1)), str(draw.choice(_WALLS)), float(draw.random())
    roof, rise = _roof(plan, source, kind)
    height, levels = length(tags, "height", line, source), _levels(tags, "building:levels", line, source)
    foot = length(tags, "min_height", line, source)
    if foot is None:
        foot = STOREY * (_levels(tags, "building:min_level", line, source) or 0.0)
    if height is None and levels is None:
        source.note(line, "a building has neither height nor building:levels; its storeys are drawn by seed")
        levels = float(drawn)
    if height is not None and height > foot:
        top = height
        rise = min(rise, 0.6 * (top - foot)) if "roof:height" not in tags else min(rise, top - foot)
        eaves = top - rise
    else:
        if height is not None:
            source.note(line, f"height = {height:g} m is not above min_height = {foot:g} m; it is not used")
        eaves = max(STOREY * (levels if levels is not None else float(drawn)), foot + 0.5 * STOREY)
        top = eaves + rise
    storeys = 0 if kind in _BLIND else round(levels if levels is not None else (eaves - foot) / STOREY)
    if levels is not None and foot > 0.0:
        storeys = round((eaves - foot) / STOREY) if storeys else 0
    cover = _COVERS.get(tags.get("roof:material", ""), "")
    if not cover:
        cover = "gravel_fine" if roof == "flat" else "tiles_red" if hue < 0.6 else "tiles_dark"
    walls = _MATERIALS.get(tags.get("building:material", tags.get("building:facade:material", "")), wall)
    is_across = tags.get("roof:orientation") == "across"
    return Building(
        line, plan.id, plan.rings, foot, eaves, top, roof, walls, cover, min(storeys, 200), is_across, kind in _OPEN
    )


def _roof(plan: Plan, source: Source, kind: str) -> tuple[str, float]:
    """Return the shape of a roof and how far it rises above the eaves [m]."""
    tags, line = plan.tags, plan.line
    shape = tags.get("roof:shape", "gabled" if kind in _HOUSES and len(plan.rings) == 1 else "flat")
    if shape not in ROOFS:
        source.note(line, f"roof:shape={shape[:40]} is drawn flat")
        shape = "flat"
    if shape == "flat":
        return shape, 0.0
    corners = shapely.get_coordinates(shapely.minimum_rotated_rectangle(plan.polygon))
    short = float(min(np.linalg.norm(np.diff(corners[:3], axis=0), axis=1)))
    rise = length(tags, "roof:height", line, source)
    floors = _levels(tags, "roof:levels", line, source)
    if rise is None and floors:
        rise = STOREY * floors
    steep = {"skillion": 0.2, "pyramidal": 0.6}.get(shape, 0.4)  # of the shorter side
    return shape, min(rise if rise is not None else steep * short, 60.0)
