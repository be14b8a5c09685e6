"""What the tube budget pays for: each object with the reflection that changes it most, then the others."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field

from .budget import Estimate
from .mirrors import Mirror
from .reflections import HIDDEN, Change, Sight


@dataclass
class Choice:
    """What becomes of one instance.

    Attributes
    ----------
    item : Estimate
    method, reason : str
    tubes : int
        That it costs straight; each further pair of ways costs as much.
    changes : list of Change
        What mirrors do to it, as far as it exceeds the tolerance, or `smallest_change_db` where that is less, and is
        above the floor, the largest first.
    mirrors : list of Mirror
        Of them, those that the budget pays for.
    sight : Sight
        The straight way.
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
    over_budget: bool = False

    @property
    def without(self) -> Change | None:
        """The reflection that is left out and can change it most, if there is one."""
        left = (change for change in self.changes if change.mirror not in self.mirrors)
        return next(left, None) if self.method in ("sbr", "scatterers") else None

    @property
    def cost(self) -> int:
        """Tubes over all pairs of ways."""
        return self.tubes * _num_pairs(len(self.mirrors))


def _num_pairs(mirrors: int) -> int:
    """Return the number of pairs of a way there and a way back, the reverse of each not counted."""
    return (mirrors + 1) * (mirrors + 2) // 2


def spend(own: Sequence[Choice], cost: Mapping[int, int], served: Collection[int], budget: int) -> bool:
    """Spend the budget anew; return whether it pays for everything.

    Parameters
    ----------
    own : sequence of Choice
        Objects that are computed coherently, the first ones first; changed: `tubes`, `mirrors` and `over_budget`.
    cost : mapping
        Tubes of each by one pair of ways, by its instance.
    served : collection of int
        Numbers of the mirrors that may be used.
    budget : int
        Tubes.
    """
    left, paid = budget, True
    further: list[tuple[Choice, Change]] = []
    for choice in own:
        choice.tubes, choice.mirrors = cost[choice.item.number], []
        choice.over_budget = choice.tubes > left
        if choice.over_budget:
            paid = False
            continue
        left -= choice.tubes
        possible = [change for change in choice.changes if change.mirror.number in served]
        for change in possible[:1]:
            left -= _add(choice, change, left)
        further += [(choice, change) for change in possible[1:]]
        paid &= len(choice.mirrors) == len(possible[:1])
    for choice, change in sorted(further, key=lambda pair: -pair[1].change_db):
        left -= _add(choice, change, left)
        paid &= change.mirror in choice.mirrors
    return paid


def _add(choice: Choice, change: Change, left: int) -> int:
    """Add a mirror if the budget pays for it; return what it costs."""
    more = choice.tubes * (_num_pairs(len(choice.mirrors) + 1) - _num_pairs(len(choice.mirrors)))
    if more > left:
        return 0
    choice.mirrors.append(change.mirror)
    return more
