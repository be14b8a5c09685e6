"""Who of the people of all ages is on foot: shares for planned traffic, one by name for traffic that is told."""

from __future__ import annotations

import re
from collections.abc import Sequence

from scarl_sionna.core.seeds import generator
from scarl_sionna.scene.actors.model import person_ages
from scenes_xml.actors.bodies.table import PEOPLE, Person

CHILDREN = 0.16
"""Share of those under 16 years among people on foot; all of an age group are equally likely."""
GROWN = 16
ALONE = 6
"""Younger children [years] are not out alone: traffic that says no more of somebody does not mean them."""
_YOUNG = {"child", "children", "schoolchild", "kid", "kids", "girl", "boy", "pupil", "toddler"}
_FEMALE, _MALE = {"woman", "women", "female", "girl", "lady"}, {"man", "men", "male", "boy"}
_GROWN = {"adult", "adults", "woman", "women", "lady", "man", "men"}
_WORD = re.compile(r"[A-Z]?[a-z]+|[A-Z]+")
HEIGHT_OFF, LEAST = 0.15, 8
"""How far the height of somebody may be from that of the person who is drawn [m], and how many there are to draw from
at least."""


def walkers() -> dict[str, float]:
    """Return the share of each person among people on foot, by model."""
    ages = person_ages()
    young = [name for name, age in ages.items() if age < GROWN]
    old = [name for name in ages if name not in young]
    return {
        **dict.fromkeys(young, CHILDREN / len(young)),
        **dict.fromkeys(old, (1.0 - CHILDREN) / len(old)),
    }


def person_for(name: str, said: str = "", height: float | None = None) -> str:
    """Return the model of somebody in traffic that another program tells of: the same one for the same name.

    Parameters
    ----------
    name : str
        Of the road user there, by which one is drawn.
    said : str
        What the source says of him or her: the name of a type, of a model. Words for children, adults, women and men
        in it are heeded.
    height : float or None
        Of the body [m], as far as the source has one; one of the `LEAST` people nearest to it, or within `HEIGHT_OFF`.

    Returns
    -------
    str
        One of :func:`scarl_sionna.scene.actors.model.person_ages`. Without word and height: adults, and children who
        are out alone, in the shares of `walkers`.
    """
    fitting = _fitting(said, height)
    shares = walkers()
    total, drawn = sum(shares[one.name] for one in fitting), float(generator(0, "people", name=name).uniform())
    reached = 0.0
    for one in fitting:
        reached += shares[one.name] / total
        if drawn < reached:
            return one.name
    return fitting[-1].name


def _fitting(said: str, height: float | None) -> Sequence[Person]:
    words = {word.lower() for word in _WORD.findall(said)}
    people = list(PEOPLE)
    if bool(words & _FEMALE) != bool(words & _MALE):
        people = [one for one in people if one.female == bool(words & _FEMALE)]
    if bool(words & _YOUNG) != bool(words & _GROWN):
        people = [one for one in people if (one.years < GROWN) == bool(words & _YOUNG)]
    if height:
        people = sorted(people, key=lambda one: (abs(one.height - height), one.name))
        near = [one for one in people if abs(one.height - height) <= HEIGHT_OFF]
        return near if len(near) > LEAST else people[:LEAST]
    return people if words & _YOUNG else [one for one in people if one.years >= ALONE]
