"""Models named by what somebody is, not by who: each is one of the people of the table, in colours of its own."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from ..model import Color


@dataclass(frozen=True)
class Role:
    """One of the people.

    Attributes
    ----------
    person : str
        Whose body and clothes it has.
    title : str
    colors : mapping
        Name of a variant -> colours of slots; skin and hair are the person's.
    """

    person: str
    title: str
    colors: Mapping[str, Mapping[str, Color]]


def _worn(top: Color, trousers: Color, shoes: Color) -> dict[str, Color]:
    return {"top": top, "trousers": trousers, "shoes": shoes}


WALKERS: Mapping[str, Role] = {
    "adult_man": Role("man_33", "Man who walks", {
        "blue": _worn((0.03, 0.06, 0.16), (0.05, 0.05, 0.055), (0.03, 0.022, 0.018)),
        "red": _worn((0.36, 0.03, 0.035), (0.035, 0.055, 0.11), (0.60, 0.60, 0.58)),
        "olive": _worn((0.10, 0.11, 0.045), (0.22, 0.17, 0.10), (0.10, 0.05, 0.025)),
        "grey": _worn((0.16, 0.165, 0.175), (0.02, 0.02, 0.023), (0.02, 0.02, 0.02)),
    }),
    "adult_woman": Role("woman_28", "Woman who walks", {
        "camel": _worn((0.40, 0.24, 0.11), (0.03, 0.03, 0.035), (0.05, 0.025, 0.015)),
        "teal": _worn((0.02, 0.17, 0.18), (0.035, 0.055, 0.11), (0.60, 0.60, 0.58)),
        "plum": _worn((0.17, 0.03, 0.11), (0.02, 0.02, 0.023), (0.02, 0.02, 0.02)),
        "white": _worn((0.60, 0.58, 0.54), (0.05, 0.08, 0.17), (0.20, 0.11, 0.05)),
    }),
    "child": Role("girl_7", "Child who walks", {
        "yellow": _worn((0.70, 0.42, 0.03), (0.05, 0.08, 0.17), (0.60, 0.60, 0.58)),
        "pink": _worn((0.55, 0.10, 0.25), (0.10, 0.10, 0.12), (0.55, 0.12, 0.22)),
        "green": _worn((0.06, 0.25, 0.09), (0.22, 0.17, 0.10), (0.03, 0.03, 0.03)),
    }),
}  # fmt: skip # a table
"""Models that walk, by name."""
STANDING = Role("man_27", "Adult who stands", {
    "green": _worn((0.05, 0.16, 0.08), (0.035, 0.055, 0.11), (0.03, 0.022, 0.018)),
    "black": _worn((0.022, 0.022, 0.025), (0.16, 0.13, 0.09), (0.03, 0.022, 0.018)),
    "orange": _worn((0.55, 0.16, 0.02), (0.03, 0.03, 0.035), (0.03, 0.022, 0.018)),
})  # fmt: skip # a table
"""The model ``standing_adult``."""
