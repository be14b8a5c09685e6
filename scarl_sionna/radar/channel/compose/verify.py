"""Whether a solve of ``method="auto"`` keeps its tolerance, by a second look at its objects; some are computed finer.

The formula of `expected_error` sees what cancels and what is cut; it does not see a tube that no ray probed. So objects
that count are computed a second time at the next coarser level, and what their echo differs by tells how far it still
moves. What both levels lack shows where the two directions of a bounce differ, or may be where hardly anything is seen
of an object: these are computed at a finer level. docs/accuracy.md, second look.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ScarlWarning
from scarl_sionna.core.settings.auto import SbrLevel
from scarl_sionna.core.settings.plan import ChannelPlan
from scarl_sionna.core.units import dbm_to_watt
from scarl_sionna.radar.paths import RadarPaths
from scarl_sionna.signal.antenna import boresights, largest_field_gain
from scarl_sionna.signal.noise import angle_cell_noise_power

from .budget import sbr_settings
from .choose import ENOUGH, Chosen, View, counts, first_share, level_of, num_tubes_of
from .expected_error import MOST_DB, expected_errors, kept_error, levels_db, owners, reverse_doubts
from .hybrid import solve_hybrid
from .spend import Choice, num_pairs

DIMMER_DB = 10.0
"""Objects that are this much weaker than those that count are looked at, too: they may be brighter than they seem."""
BRIGHT_DB = 20.0
"""Of objects this much stronger than those that count as many keep the tolerance: the weak ones do not make up for
them."""


@dataclass
class Verified:
    """Paths, and how right they are.

    Attributes
    ----------
    paths : RadarPaths
    errors : dict
        Expected error of the objects computed by `sbr` [dB], by instance.
    differences : dict
        What the echo of the objects that were looked at again differed by [dB].
    refined : list of int
        Instances whose paths are those of a finer level.
    levels : dict
        Echo of these objects over the noise of a cell, mean over the band [dB], by instance.
    doubts : dict
        What may be wrong with objects though no level shows it, where it is over the tolerance [dB], by instance.
    tubes : int
        That the second look and what it refined cost, by the same estimate as the budget.
    seconds : float
    """

    paths: RadarPaths
    errors: dict[int, float]
    differences: dict[int, float] = field(default_factory=dict)
    refined: list[int] = field(default_factory=list)
    levels: dict[int, float] = field(default_factory=dict)
    doubts: dict[int, float] = field(default_factory=dict)
    tubes: int = 0
    seconds: float = 0.0

    @property
    def diagnostics(self) -> dict[str, Any]:
        """What a user may want to know of it."""
        names = {"num_looked_at": len(self.differences), "num_refined": len(self.refined)}
        return {**names, "second_look_tubes": self.tubes}


def verified(view: View, chosen: Chosen, plan: ChannelPlan, paths: RadarPaths) -> Verified:
    """Return paths that were looked at again, with objects computed more finely where the tolerance asks for it.

    Parameters
    ----------
    view : View
    chosen : Chosen
    plan : ChannelPlan
        That made the paths.
    paths : RadarPaths

    Notes
    -----
    First, doubtful objects are computed at a finer level, those that cost least first; what that does not pay for keeps
    its doubt in its expected error.
    Looked at are the other objects that count, those first that cost least, for at most `look_share` of the tubes;
    what that does not pay for with its reflections is compared without them.
    At the coarsest level the look is finer and its paths are taken. Then, as long as the tolerance is not expected to
    be met, the objects with the largest expected error are computed at the next finer level, with the doubtful ones
    for at most `refine_share` of the tubes; their difference from the level before is their second look. Where the
    budget did not pay for the level asked for, nothing is refined, and looked at only what would be called met. A
    `cpu_budget` pays for all of it; a `tube_budget` is that of the plan.
    """
    start = time.perf_counter()
    work = _Work(view, chosen, plan, paths)
    rules = view.rules
    asked = level_of(view.settings.accuracy.channel_tolerance_db, rules)
    is_asked = chosen.level == asked
    if work.counted and (is_asked or met(chosen.choices, work.result.errors, view, work.result.levels)["met"]):
        place = rules.levels.index(chosen.level)
        spent = sum(choice.cost for choice in work.own)
        seconds = view.settings.accuracy.cpu_budget
        spare = np.inf if seconds is None else seconds / max(rules.tubes.seconds, 1e-12) - spent
        finer = rules.levels[max(place + 1, 2) :]
        share = rules.refine_share * spent
        share -= work.settle(finer[0] if finer and is_asked else None, min(share, spare))
        spare -= work.result.tubes
        if place:
            work.look(rules.levels[place - 1], min(rules.look_share * spent, spare))
            if is_asked and finer:
                work.refine(finer[0], min(share, spare))
        elif place + 1 < len(rules.levels):
            work.look(rules.levels[place + 1], min(rules.look_share * spent, spare))
    work.result.seconds = time.perf_counter() - start
    return work.result


def met(
    choices: Sequence[Choice], errors: Mapping[int, float], view: View, levels: Mapping[int, float] | None = None
) -> dict[str, Any]:
    """Return whether the objects that can be seen are within the tolerance, and the error that 90 % of them keep.

    With the `levels` of their echoes over the noise [dB] only those are counted that may be detected with their errors,
    and 90 % of those that are `BRIGHT_DB` stronger keep it, too.
    """
    rules = view.rules
    found: dict[int, float] = {}
    bounds: dict[int, float] = {}
    by_class = 0
    for choice in choices:
        item = choice.item
        if not counts(choice, rules):
            continue
        if choice.over_budget:
            bounds[item.number] = rules.errors.by_class_db
            by_class += 1
        elif choice.method == "sbr" and item.number in errors:
            left = 0.0 if choice.without is None else float(choice.without.change_db)
            (bounds if left > errors[item.number] else found)[item.number] = max(errors[item.number], left)

    def kept(above_db: float) -> tuple[int, float]:
        least = rules.counts_from_db + above_db
        some = [
            [error for number, error in group.items() if (levels or {}).get(number, np.inf) + error >= least]
            for group in (found, bounds)
        ]
        return len(some[0]) + len(some[1]), kept_error(some[0], some[1], ENOUGH, rules.errors)

    (counted, expected), (_, of_bright) = kept(0.0), kept(BRIGHT_DB)
    expected = max(expected, of_bright)
    return {
        "expected_error_db": round(expected, 2),
        "num_counted": counted,
        "num_by_class": by_class,
        "met": expected <= view.settings.accuracy.channel_tolerance_db,
    }


class _Work:
    """One solve that is looked at again."""

    def __init__(self, view: View, chosen: Chosen, plan: ChannelPlan, paths: RadarPaths) -> None:
        self.view, self.chosen, self.plan, self.before = view, chosen, plan, paths
        self.own = [choice for choice in chosen.choices if choice.method == "sbr"]
        self.numbers = sorted(choice.item.number for choice in self.own)
        self.result = Verified(paths, self._errors(paths, chosen.level))
        self.result.levels = self._over_noise(self.levels)
        least = view.rules.counts_from_db - DIMMER_DB
        self.counted = {
            choice.item.number: choice
            for choice in self.own
            if counts(choice, view.rules) and self.result.levels.get(choice.item.number, -np.inf) >= least
        }

    def _over_noise(self, levels: Mapping[int, float]) -> dict[int, float]:
        """Return the levels of objects with a path over the noise of a cell, with the antennas' largest gain [dB]."""
        radar = self.view.radar
        gain = float(largest_field_gain(radar.array, boresights(radar.array)).max())
        unit = dbm_to_watt(radar.front_end.tx_power_dbm) / angle_cell_noise_power(radar) * gain**4
        return {number: levels[number] + 10.0 * float(np.log10(unit)) for number in self.result.errors}

    def _errors(self, paths: RadarPaths, level: SbrLevel) -> dict[int, float]:
        return expected_errors(paths, self.view.radar, self.numbers, self.view.rules.errors, level)

    @cached_property
    def levels(self) -> dict[int, float]:
        """Power of each object by the first solve [dB]."""
        return levels_db(self.before, self.view.radar, self.numbers)

    def settle(self, level: SbrLevel | None, budget: float) -> int:
        """Compute the cheapest doubtful objects at a finer level, return its tubes; the others keep their doubt."""
        doubts, result, chosen, spent = self._doubts(), self.result, [], 0
        result.doubts = doubts
        cost = {} if level is None else self._cost(level)
        if level is not None:  # what is hidden ends with the first tubes
            for number, tubes in cost.items():
                seen = min(2.0 * self.counted[number].sight.share, 1.0)
                first = first_share(self.view, self.counted[number], level)
                cost[number] = int(tubes * (first + (1.0 - first) * seen))
        for number in sorted(doubts, key=lambda one: (cost.get(one, 0), one)):
            if level is not None and spent + cost[number] <= budget:
                spent += cost[number]
                chosen.append(number)
            else:
                result.errors[number] = float(np.hypot(result.errors[number], doubts[number]))
        if level is not None and chosen:
            self._take(self._traced(chosen, level, chosen), chosen, level)
        result.tubes += spent
        return spent

    def _doubts(self) -> dict[int, float]:
        """Return what may be wrong with the echo of objects beyond the tolerance [dB], though no level shows it."""
        view, found = self.view, {}
        reverse = reverse_doubts(self.before, view.radar, self.numbers, self.numbers)
        for number, choice in self.counted.items():
            seen = choice.sight.share * view.rules.num_probes
            few = 20.0 * np.log10(1.0 + seen**-0.5) if 0.0 < seen <= view.rules.few_probes else 0.0
            doubt = float(max(few, reverse.get(number, 0.0)))
            if doubt > view.settings.accuracy.channel_tolerance_db:
                found[number] = doubt
        return found

    def look(self, level: SbrLevel, budget: float) -> None:
        """Compute the cheapest objects that count at another level; take their paths if it is a finer one.

        What the budget does not pay for with its reflections is compared without them.
        """
        cost, finer = self._cost(level), level.tolerance_db < self.chosen.level.tolerance_db
        whole: list[int] = []
        straight: list[int] = []
        for number in sorted(set(cost) - set(self.result.refined), key=lambda one: (cost[one], one)):
            alone = num_tubes_of(self.view, self.counted[number], level)
            for price, group in ((cost[number], whole), (alone, straight)):
                if price <= budget and not (finer and group is straight):
                    budget -= price
                    self.result.tubes += price
                    group.append(number)
                    break
        if not (whole or straight):
            return
        found = self._traced([*whole, *straight], level, whole)
        if finer:
            self._take(found, whole, level)
            return
        then = levels_db(self._comparable(found, whole), self.view.radar, self.numbers)
        self._compare(whole, levels_db(found, self.view.radar, self.numbers), then, self.result.errors)
        if straight:
            now, then = (
                levels_db(self._without_mirrors(paths), self.view.radar, self.numbers) for paths in (found, self.before)
            )
            self._compare(straight, now, then, self.result.errors)

    def refine(self, level: SbrLevel, budget: float) -> None:
        """Compute objects with the largest expected errors at a finer level, as many as the tolerance asks for."""
        cost, errors = self._cost(level), dict(self.result.errors)
        gain = level.tolerance_db / self.chosen.level.tolerance_db
        chosen: list[int] = []
        is_met = False
        for number in sorted(set(self.counted) - set(self.result.refined), key=lambda one: (-errors[one], one)):
            if is_met := met(self.chosen.choices, errors, self.view, self.result.levels)["met"]:
                break
            if cost[number] <= budget:
                budget -= cost[number]
                errors[number] *= gain  # what is hoped for: the solve says what it is
                chosen.append(number)
        is_met = is_met or met(self.chosen.choices, errors, self.view, self.result.levels)["met"]
        if not chosen or not is_met:  # what is in doubt or too dear still is: the others would be computed in vain
            return
        self._take(self._traced(chosen, level, chosen), chosen, level)
        self.result.tubes += sum(cost[number] for number in chosen)

    def _cost(self, level: SbrLevel) -> dict[int, int]:
        """Return the tubes of the objects that count at a level, over all of their ways."""
        return {
            number: num_tubes_of(self.view, choice, level) * num_pairs(len(choice.mirrors))
            for number, choice in self.counted.items()
        }

    def _without_mirrors(self, paths: RadarPaths) -> RadarPaths:
        return paths.select(np.isin(paths.instance, [*self.numbers, -1]).all(axis=1))

    def _traced(self, lit: Collection[int], level: SbrLevel, whole: Collection[int]) -> RadarPaths:
        """Return the paths of some objects at a level, of some with their reflections; the others only bounce."""
        shares = []
        for share in (share for share in self.plan.shares if share.solver == "sbr"):
            over = [item.only(whole) for item in share.reflections]
            shares.append(
                replace(
                    share,
                    settings=sbr_settings(level),
                    lit=tuple(sorted(lit)),
                    through_mirrors=False,
                    reflections=tuple(item for item in over if item.instances),
                    reason="second look",
                )
            )
        plan = replace(self.plan, shares=tuple(shares), echoes=False, left_out=())
        with warnings.catch_warnings():  # said by the solve itself
            warnings.simplefilter("ignore", ScarlWarning)
            return solve_hybrid(self.view.state, self.view.radar, self.view.mount, self.view.settings.with_(plan=plan))

    def _take(self, found: RadarPaths, numbers: Sequence[int], level: SbrLevel) -> None:
        """Take the paths of some objects from a finer solve, with what it says of them."""
        before, result = self.result.paths, self.result
        other = self._reversed_only(before, found, numbers)
        kept = before.select(~np.isin(owners(before, self.numbers), numbers) | other)
        own = found.select(np.isin(owners(found, self.numbers), numbers))  # not what ends at them: it is there already
        diagnostics = dict(before.diagnostics)
        diagnostics["solvers"] = [*diagnostics["solvers"], *found.diagnostics["solvers"]]
        result.paths = RadarPaths.concatenate([kept, own], diagnostics)
        own = RadarPaths.concatenate([before.select(other), own])
        errors = self._errors(own, level)
        levels = levels_db(own, self.view.radar, self.numbers)
        some = [number for number in numbers if number in errors]
        self._compare(some, levels, self.levels, errors)
        result.levels |= {number: level for number, level in self._over_noise(levels).items() if number in some}
        result.refined = sorted({*result.refined, *numbers})

    def _comparable(self, found: RadarPaths, numbers: Sequence[int]) -> RadarPaths:
        """Return the paths of the first solve without what a solve of some objects cannot have."""
        return self.before.select(~self._reversed_only(self.before, found, numbers))

    def _reversed_only(self, before: RadarPaths, found: RadarPaths, numbers: Sequence[int]) -> npt.NDArray[np.bool_]:
        """Return which paths of some objects a solve of these alone lacks: over mirrors, reversed from other objects.

        Of a way there and another one back only one order is traced.
        """
        first, last = owners(before, self.numbers), owners(before, self.numbers, last=True)
        rows = np.isin(first, numbers) & ~np.isin(last, numbers) & (before.instance[:, 0] != first)
        if not rows.any():
            return rows
        chains, which = np.unique(before.instance[rows], axis=0, return_inverse=True)
        there = {
            _chain(row) for row in np.unique(found.instance[np.isin(owners(found, self.numbers), numbers)], axis=0)
        }
        rows[rows] = np.array([_chain(row) not in there for row in chains])[which.ravel()]
        return rows

    def _compare(
        self,
        numbers: Sequence[int],
        levels: Mapping[int, float],
        before: Mapping[int, float],
        errors: Mapping[int, float],
    ) -> None:
        """Bring what the echo of objects differs by into their expected error."""
        fit, result = self.view.rules.errors, self.result
        for number in numbers:
            difference = min(abs(levels[number] - before[number]), MOST_DB)
            error = float(np.hypot(fit.looked_at * errors[number], fit.difference * difference))
            result.differences[number] = difference
            result.errors[number] = error


def _chain(row: npt.NDArray[np.int32]) -> tuple[int, ...]:
    """Return the instances of one path."""
    return tuple(int(number) for number in row if number >= 0)
