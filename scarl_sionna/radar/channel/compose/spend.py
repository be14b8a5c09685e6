"""What the tube budget pays for: road users, then as many other objects as it can, then further reflections."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from .budget import Estimate
from .mirrors import Mirror
from .reflections import HIDDEN, Change, Sight

MOST_DB = 40.0
"""A reflection that alone shows an object changes it by no number of decibels: in the order it counts as so many."""


@dataclass
class Choice:
    """What becomes of one instance.

    Attributes
    ----------
    item : Estimate
    method, reason : str
    tubes : int
        That it costs straight; each further way costs as much.
    changes : list of Change
        What mirrors do to it, as far as it may exceed the tolerance, or `smallest_change_db` where that is less, and is
        above the floor, the largest first.
    mirrors : list of Mirror
        Of them, those that the budget pays for.
    sight : Sight
        The straight way.
    shown : frozenset of int, optional
        Numbers of the mirrors that show something of it; None if nobody looked.
    over_budget : bool
        Whether it is left to its class because its tubes are over the budget.
    """

    item: Estimate
    method: str
    reason: str
    tubes: int = 0
    changes: list[Change] = field(default_factory=list)
    mirrors: list[Mirror] = field(default_factory=list)
    sight: Sight = HIDDEN
    shown: frozenset[int] | None = None
    over_budget: bool = False

    @property
    def without(self) -> Change | None:
        """The reflection that is left out and can change it most, if there is one."""
        left = (change for change in self.changes if change.mirror not in self.mirrors)
        return next(left, None) if self.method in ("sbr", "scatterers") else None

    @property
    def cost(self) -> int:
        """Tubes over all ways."""
        return self.tubes * num_ways(len(self.mirrors))

    @property
    def patches(self) -> int:
        """Patches over all pairs of ways, a patch a tube."""
        return self.tubes * num_pairs(len(self.mirrors))


@dataclass
class _Left:
    """What is left of the budgets."""

    tubes: int
    patches: float

    def pays(self, choice: Choice, mirrors: int, beside: int = 0) -> bool:
        """Pay for an object with some mirrors, of which `beside` and the straight way are paid for; False if it cannot.

        Nothing is paid for yet if `beside` is -1.
        """
        tubes = choice.tubes * (num_ways(mirrors) - num_ways(beside))
        patches = choice.tubes * (num_pairs(mirrors) - num_pairs(beside))
        if tubes > self.tubes or patches > self.patches:
            return False
        self.tubes, self.patches = self.tubes - tubes, self.patches - patches
        return True


def num_ways(mirrors: int) -> int:
    """Return the number of ways to an object, the straight one included: each is traced once for all ways back."""
    return mirrors + 1


def num_pairs(mirrors: int) -> int:
    """Return the number of pairs of a way there and a way back, the reverse of each not counted."""
    return (mirrors + 1) * (mirrors + 2) // 2


def spend(
    own: Sequence[Choice], cost: Mapping[int, int], served: Collection[int], budget: int, patches: float = np.inf
) -> bool:
    """Spend the budgets anew; return whether it pays for everything.

    Road users come first, straight. Then of the other objects as many as it can pay for, each with the reflection that
    changes it most, since without it the echo may be off by as much; then those that are left, straight; then the
    largest reflections of all that have none yet, those first that change most for their tubes, and last the further
    ones by what they change. docs/accuracy.md, budget.

    Parameters
    ----------
    own : sequence of Choice
        Objects that are computed coherently, the first ones first; changed: `tubes`, `mirrors` and `over_budget`.
    cost : mapping
        Tubes of each by one way, by its instance.
    served : collection of int
        Numbers of the mirrors that may be used.
    budget : int
        Tubes.
    patches : float
        That memory holds.
    """
    left = _Left(budget, patches)
    possible = {id(choice): [one for one in choice.changes if one.mirror.number in served] for choice in own}
    for choice in own:
        choice.tubes, choice.mirrors, choice.over_budget = cost[choice.item.number], [], True
    for choice in (one for one in own if one.item.info.actor is not None):
        _take(choice, (), left)
    others = [one for one in own if one.item.info.actor is None]
    whole = {id(choice): possible[id(choice)][:1] for choice in others}
    for choice in sorted(others, key=lambda one: one.tubes * num_ways(len(whole[id(one)]))):
        _take(choice, whole[id(choice)], left)
    for choice in (one for one in others if one.over_budget):
        _take(choice, (), left)
    wanted = [
        (choice, change, rank)
        for choice in own
        for rank, change in enumerate(possible[id(choice)])
        if not choice.over_budget and change.mirror not in choice.mirrors
    ]
    for choice, change, _ in sorted(wanted, key=_place):
        if left.pays(choice, len(choice.mirrors) + 1, len(choice.mirrors)):
            choice.mirrors.append(change.mirror)
    return all(not choice.over_budget and len(choice.mirrors) == len(possible[id(choice)]) for choice in own)


def _place(wanted: tuple[Choice, Change, int]) -> tuple[bool, float]:
    """Return the place of a reflection in the order of spending."""
    choice, change, rank = wanted
    return (True, -change.change_db) if rank else (False, choice.tubes / max(min(change.change_db, MOST_DB), 1e-9))


def _take(choice: Choice, changes: Sequence[Change], left: _Left) -> None:
    """Take an object, with some reflections, if what is left pays for all of that."""
    if left.pays(choice, len(changes), -1):
        choice.over_budget = False
        choice.mirrors = [change.mirror for change in changes]
