"""Who rides: people of the table, dressed for it, in the posture that a two-wheeler asks for."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

from ...generators.people.garments import Layer, outfit
from ...generators.people.posture import Posture, Rider
from ..model import Color
from .family import colors, packed_bodies, surface
from .table import PEOPLE

GLOVES = Layer("gloves", ("hand",), 0.003)


@dataclass(frozen=True)
class Wear:
    """What a rider wears in place of the person's own.

    Attributes
    ----------
    top : str
        See `scenes_xml.generators.people.garments.outfit`; empty: the person's own.
    bare : tuple of str
        Regions of clothes that are left out, as hems of those who sit.
    gloves : bool
    """

    top: str = ""
    bare: tuple[str, ...] = ()
    gloves: bool = False


@lru_cache(maxsize=16)
def rider(name: str, posture: Posture, light: bool, wear: Wear = Wear()) -> Rider:  # is frozen
    """Return a person of the table in a posture."""
    bodies, person = packed_bodies(), next(person for person in PEOPLE if person.name == name)
    row = bodies.names.index(name)
    worn = outfit(wear.top or person.top, person.bottom, person.hair, person.long_hair)
    layers = [replace(one, regions=tuple(r for r in one.regions if r not in wear.bare)) for one in worn.layers]
    worn = replace(worn, layers=(*layers, GLOVES) if wear.gloves else tuple(layers))
    return Rider(surface(bodies, row, int(light)), worn, bodies.lengths[row], person.arms_out_deg, posture)


def tone(name: str) -> dict[str, Color]:
    """Return the colours of a person's skin, lips and hair by slot."""
    number = next(number for number, person in enumerate(PEOPLE) if person.name == name)
    own = next(iter(colors(PEOPLE[number], number).values()))
    return {slot: own[slot] for slot in ("skin", "lips", "hair")}
