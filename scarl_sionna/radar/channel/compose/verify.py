"""Whether a solve of ``method="auto"`` keeps its tolerance; objects that may not are computed finer.

The formula of `expected_error` says which objects may be off by too much. They are computed one level finer, and what
their echo differs by tells how far it still moves; a solve at the finest level begins one level coarser for that. What
all levels lack shows where the two directions of a bounce differ, or may be where hardly anything is seen of an object,
or where points between the probes of tubes are lit that these say are not.
docs/accuracy.md, expected error.
"""

from __future__ import annotations

import time
import warnings
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ScarlWarning
from scarl_sionna.core.settings.auto import SbrLevel
from scarl_sionna.core.settings.plan import ChannelPlan
from scarl_sionna.engine.paths.tracing import DIFFUSE
from scarl_sionna.radar.link import path_unit
from scarl_sionna.radar.paths import RadarPaths

from .choose import ENOUGH, Chosen, View, counts, level_of, num_tubes_of
from .expected_error import MOST_DB, expected_errors, keeps, kept_error, levels_db, owners, reverse_doubts
from .hybrid import solve_hybrid
from .spend import Choice, num_ways

DIMMER_DB = 10.0
"""Objects that are this much weaker than those that count are looked at, too: they may be brighter than they seem."""
BRIGHT_DB = 20.0
"""Of objects this much stronger than those that count as many keep the tolerance: the weak ones do not make up for
them."""
HOPED = 0.5
"""What the expected error is taken to become by the next finer level, before it is known: it decides how many objects
are computed together."""
ROUNDS = 2
"""How often objects are chosen for one level: the second time by what the first has found."""


@dataclass
class Verified:
    """Paths, and how right they are.

    Attributes
    ----------
    paths : RadarPaths
    errors : dict
        Expected error of the objects computed by `sbr` [dB], by instance.
    differences : dict
        What the echo of the objects that were computed at two levels differed by [dB].
    refined : list of int
        Instances whose paths are those of a finer level.
    levels : dict
        Echo of these objects over the noise of a cell, mean over the band [dB], by instance.
    doubts : dict
        What may be wrong with objects though no level shows it, where it is over the tolerance [dB], by instance.
    tubes : int
        That what was computed finer cost, by the same estimate as the budget.
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


def first_level(view: View, chosen: Chosen) -> SbrLevel:
    """Return the level of the first solve: that asked for, but one coarser than the finest, whose errors nothing tells.

    It is the level of the budget where that does not pay for the one asked for.
    """
    levels, rules = view.rules.levels, view.rules
    asked = level_of(view.settings.accuracy.channel_tolerance_db, rules)
    place = levels.index(chosen.level)
    is_coarser = rules.coarse_first and chosen.level == asked and 1 < place == len(levels) - 1
    return levels[place - 1] if is_coarser else chosen.level


def verified(view: View, chosen: Chosen, plan: ChannelPlan, paths: RadarPaths) -> Verified:
    """Return paths with objects computed more finely where the tolerance asks for it, and what is known of them.

    Parameters
    ----------
    view : View
    chosen : Chosen
    plan : ChannelPlan
        That made the paths, at the level `first_level`.
    paths : RadarPaths

    Notes
    -----
    As long as the tolerance is not expected to be met, the objects with the largest expected errors are computed at the
    next finer level, for at most `refine_share` of the tubes of the plan, and only if that is hoped to be enough; a
    doubt (see `Verified`) is part of the expected error until then. At the finest level of all, whose own errors are
    not known otherwise, all objects are computed that count.
    At the coarsest level all objects that `look_share` of the tubes pays for are computed at the next finer one.
    Where the budget did not pay for the level asked for, nothing is refined, and looked at only what would be called
    met. A `cpu_budget` pays for all of it; a `tube_budget` is that of the plan.
    """
    start = time.perf_counter()
    work = _Work(view, chosen, plan, paths)
    rules, levels = view.rules, view.rules.levels
    asked = level_of(view.settings.accuracy.channel_tolerance_db, rules)
    is_asked = chosen.level == asked
    if work.counted and (is_asked or work.is_met(work.result.errors)):
        work.doubt()
        place, last = levels.index(work.level), levels.index(asked)
        planned = sum(choice.cost for choice in work.own)
        if not place and len(levels) > 1 and (is_asked or work.is_met(work.result.errors)):
            work.look(levels[1], rules.look_share * planned)
        if is_asked and place:
            if work.level != asked:
                work.refine(asked, np.inf, everything=True)
            for level in levels[last + 1 : last + 2]:
                work.refine(level, rules.refine_share * planned)
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
    groups = [_counted(choices, errors, view, levels, above) for above in (0.0, BRIGHT_DB)]
    expected = max(kept_error(found, bounds, ENOUGH, rules.errors) for found, bounds in groups)
    tolerance, stated = view.settings.accuracy.channel_tolerance_db, round(expected, 2)
    if stated <= tolerance < expected:  # what is not met is not stated as if it were
        stated = round(stated + 0.01, 2)
    return {
        "expected_error_db": stated,
        "num_counted": sum(len(group) for group in groups[0]),
        "num_by_class": sum(choice.over_budget and counts(choice, rules) for choice in choices),
        "met": expected <= tolerance,
    }


def _counted(
    choices: Sequence[Choice],
    errors: Mapping[int, float],
    view: View,
    levels: Mapping[int, float] | None,
    above_db: float,
) -> tuple[list[float], list[float]]:
    """Return the expected errors of the objects that count, and those of others, which are certain [dB]."""
    rules = view.rules
    found: list[float] = []
    bounds: list[float] = []
    for choice in choices:
        number = choice.item.number
        if not counts(choice, rules):
            continue
        if choice.over_budget:
            error, group = rules.errors.by_class_db, bounds
        elif choice.method == "sbr" and number in errors:
            left = 0.0 if choice.without is None else float(choice.without.change_db)
            error, group = max(errors[number], left), bounds if left > errors[number] else found
        else:
            continue
        if (levels or {}).get(number, np.inf) + error >= rules.counts_from_db + above_db:
            group.append(error)
    return found, bounds


class _Work:
    """One solve, and what of it is computed finer."""

    def __init__(self, view: View, chosen: Chosen, plan: ChannelPlan, paths: RadarPaths) -> None:
        self.view, self.chosen, self.plan, self.before = view, chosen, plan, paths
        self.level = first_level(view, chosen)
        self.own = [choice for choice in chosen.choices if choice.method == "sbr"]
        self.numbers = sorted(choice.item.number for choice in self.own)
        self.result = Verified(paths, self._errors(paths, self.level))
        self.levels = levels_db(paths, view.radar, self.numbers)
        self.result.levels = self._over_noise(self.levels)
        least = view.rules.counts_from_db - DIMMER_DB
        self.counted = {
            choice.item.number: choice
            for choice in self.own
            if counts(choice, view.rules) and self.result.levels.get(choice.item.number, -np.inf) >= least
        }
        self.undoubted = dict(self.result.errors)
        self.spare = np.inf  # tubes that are left of a budget in seconds
        if (seconds := view.settings.accuracy.cpu_budget) is not None:
            first = sum(self._tubes(choice, self.level) for choice in self.own)
            self.spare = seconds / max(view.rules.tubes.seconds, 1e-12) - first

    def is_met(self, errors: Mapping[int, float]) -> bool:
        """Return whether the tolerance is expected to be met with some errors [dB]."""
        tolerance, fit = self.view.settings.accuracy.channel_tolerance_db, self.view.rules.errors
        return all(
            keeps(tolerance, *_counted(self.chosen.choices, errors, self.view, self.result.levels, above), ENOUGH, fit)
            for above in (0.0, BRIGHT_DB)
        )

    def _over_noise(self, levels: Mapping[int, float]) -> dict[int, float]:
        """Return the levels of objects with a path over the noise of a cell, with the antennas' largest gain [dB]."""
        unit_db = 10.0 * float(np.log10(path_unit(self.view.radar)))
        return {number: levels[number] + unit_db for number in self.result.errors}

    def _errors(self, paths: RadarPaths, level: SbrLevel) -> dict[int, float]:
        return expected_errors(paths, self.view.radar, self.numbers, self.view.rules.errors, level)

    def doubt(self) -> None:
        """Bring what may be wrong with the echo of objects, though no level shows it, into their expected errors."""
        view, result = self.view, self.result
        tolerance = view.settings.accuracy.channel_tolerance_db
        compared = self.level.tolerance_db >= view.rules.errors.doubted_from_db
        reverse = reverse_doubts(self.before, view.radar, self.numbers, self.numbers) if compared else {}
        shadows = _shadows_db(self.before)
        for number, choice in self.counted.items():
            seen = choice.sight.share * view.rules.num_probes
            few = 20.0 * np.log10(1.0 + seen**-0.5) if 0.0 < seen <= view.rules.few_probes else 0.0
            both_ways, shadow = reverse.get(number, 0.0), shadows.get(number, 0.0)
            if max(few, shadow) > tolerance or both_ways > view.rules.errors.doubt_share * tolerance:
                result.doubts[number] = float(max(few, both_ways, shadow))
                weighed = max(few, both_ways, self._weight(shadow))
                result.errors[number] = float(np.hypot(result.errors[number], weighed))

    def _weight(self, shadow: float) -> float:
        """Return the expected error for shadows that are not resolved [dB]: a difference, since points measure them."""
        tolerance = self.view.settings.accuracy.channel_tolerance_db
        return self.view.rules.errors.difference * shadow if shadow > tolerance else 0.0

    def look(self, level: SbrLevel, budget: float) -> None:
        """Take the paths of a finer level for the cheapest objects that count."""
        cost = self._cost(level)
        budget, whole = min(budget, self.spare), []
        for number in sorted(cost, key=lambda one: (cost[one], one)):
            if cost[number] <= budget:
                budget -= cost[number]
                whole.append(number)
        self._compute(whole, level, cost)

    def refine(self, level: SbrLevel, budget: float, everything: bool = False) -> None:
        """Compute objects with the largest expected errors at a finer level, as many as the tolerance asks for.

        Only if that is hoped to be enough; what is doubtful is computed anyway. Or all, `everything`.
        """
        cost = self._cost(level)
        budget = min(budget, self.spare)
        doubted = set(self.result.doubts) - set(self.result.refined)
        left = {number for number in self.counted if everything or self.result.errors[number] > self._small} | doubted
        done: set[int] = set()
        for _ in range(ROUNDS):
            # what this level does not settle, the next one may: others are not computed for it
            errors: dict[int, float] = {**self.result.errors, **dict.fromkeys(done, 0.0)}
            chosen: list[int] = []
            is_met = self.is_met(errors)
            for number in sorted(left, key=lambda one: (-errors[one], one)):
                if (everything or number in doubted or not is_met) and cost[number] <= budget:
                    budget -= cost[number]
                    errors[number] = HOPED * self.undoubted[number]
                    chosen.append(number)
                    is_met = is_met or self.is_met(errors)
            if not (everything or is_met):
                budget += sum(cost[number] for number in chosen if number not in doubted)
                chosen = [number for number in chosen if number in doubted]
            self._compute(chosen, level, cost)
            done |= set(chosen)
            left, doubted = left - done, doubted - done

    @property
    def _small(self) -> float:
        """Expected error of an object that needs no finer level [dB]: if all had it the tolerance would be met."""
        fit = self.view.rules.errors
        odds = len(self.counted) / (1.0 - fit.confidence) - 1.0
        return self.view.settings.accuracy.channel_tolerance_db / fit.median * odds ** (-1.0 / fit.tail)

    def _compute(self, numbers: Sequence[int], level: SbrLevel, cost: Mapping[int, int]) -> None:
        if numbers:
            self._take(self._traced(numbers, level), numbers, level)
            spent = sum(cost[number] for number in numbers)
            self.result.tubes += spent
            self.spare -= spent

    def _cost(self, level: SbrLevel) -> dict[int, int]:
        """Return the tubes of the objects that count at a level: no fewer than the paths that each has already.

        Tubes find what no probe has seen, for which nothing was planned.
        """
        found = Counter(owners(self.before, sorted(self.counted)).tolist())
        return {number: max(self._tubes(choice, level), found[number]) for number, choice in self.counted.items()}

    def _tubes(self, choice: Choice, level: SbrLevel) -> int:
        """Return the tubes of an object at a level, over all of its ways."""
        return num_tubes_of(self.view, choice, level) * num_ways(len(choice.mirrors))

    def _traced(self, lit: Collection[int], level: SbrLevel) -> RadarPaths:
        """Return the paths of some objects at a level; the others only bounce."""
        shares = []
        for share in (share for share in self.plan.shares if share.solver == "sbr"):
            over = [item.only(lit) for item in share.reflections]
            shares.append(
                replace(
                    share,
                    settings=self.view.knobs(level),
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
        other = self._reversed_only(before, found, numbers) | self._twins(before, numbers)
        kept = before.select(~np.isin(owners(before, self.numbers), numbers) | other)
        own = found.select(np.isin(owners(found, self.numbers), numbers))
        diagnostics = dict(before.diagnostics)
        diagnostics["solvers"] = [*diagnostics["solvers"], *found.diagnostics["solvers"]]
        result.paths = RadarPaths.concatenate([kept, own], diagnostics)
        own = RadarPaths.concatenate([before.select(other), own])
        errors = self._errors(own, level)
        levels = levels_db(own, self.view.radar, self.numbers)
        some = [number for number in numbers if number in errors]
        self._compare(some, levels, errors)
        self._doubt_again(some, _shadows_db(found))
        self.levels |= {number: levels[number] for number in some}
        result.levels |= {number: level for number, level in self._over_noise(levels).items() if number in some}
        result.refined = sorted({*result.refined, *numbers})

    def _reversed_only(self, before: RadarPaths, found: RadarPaths, numbers: Sequence[int]) -> npt.NDArray[np.bool_]:
        """Return which paths of some objects a solve of these alone lacks: over mirrors, reversed from other objects.

        Of a way there and another one back only one order is traced.
        """
        first, last = owners(before, self.numbers), owners(before, self.numbers, last=True)
        rows = np.isin(first, numbers) & ~np.isin(last, numbers) & (before.instance[:, 0] != first)
        if not rows.any():
            return rows
        there = found.instance[np.isin(owners(found, self.numbers), numbers)]
        rows[rows] = ~_among(before.instance[rows], there)
        return rows

    def _twins(self, before: RadarPaths, numbers: Sequence[int]) -> npt.NDArray[np.bool_]:
        """Return which paths of some objects are the reverse of tubes from others.

        A solve of some objects alone has the tubes from these only, see :mod:`scarl_sionna.radar.channel.sbr.senses`.
        """
        first, last = owners(before, self.numbers), owners(before, self.numbers, last=True)
        twins = (before.depth > 1) & (before.interaction[:, 0] == DIFFUSE)
        return np.asarray(twins & np.isin(first, numbers) & ~np.isin(last, numbers))

    def _compare(self, numbers: Sequence[int], levels: Mapping[int, float], errors: Mapping[int, float]) -> None:
        """Bring what the echo of objects differs by into their expected error."""
        fit, result = self.view.rules.errors, self.result
        for number in numbers:
            difference = min(abs(levels[number] - self.levels[number]), MOST_DB)
            error = float(np.hypot(fit.looked_at * errors[number], fit.difference * difference))
            result.differences[number] = difference
            result.errors[number] = self.undoubted[number] = error

    def _doubt_again(self, numbers: Sequence[int], shadows: Mapping[int, float]) -> None:
        """Bring shadows that are doubtful at the finer level, too, into the expected error of objects."""
        result = self.result
        for number in numbers:
            if weighed := self._weight(shadow := shadows.get(number, 0.0)):
                result.doubts[number] = max(result.doubts.get(number, 0.0), shadow)
                result.errors[number] = float(np.hypot(result.errors[number], weighed))


def _shadows_db(paths: RadarPaths) -> dict[int, float]:
    """Return by how much the straight echo of objects is off for shadows that `sbr` has not resolved [dB]."""
    rows = [row for row in paths.diagnostics["solvers"] if row["solver"] == "sbr" and "detail" in row]
    return {number: error for row in rows for number, error in row["detail"]["shadows_db"].items()}


def _among(chains: npt.NDArray[np.int32], others: npt.NDArray[np.int32]) -> npt.NDArray[np.bool_]:
    """Return which chains of instances (n, depth) are among others (m, depth), whatever the depths."""
    known = {_chain(row) for row in np.unique(others, axis=0)}
    rows, which = np.unique(chains, axis=0, return_inverse=True)
    return np.array([_chain(row) in known for row in rows], dtype=np.bool_)[which.ravel()]


def _chain(row: npt.NDArray[np.int32]) -> tuple[int, ...]:
    """Return the instances of one path."""
    return tuple(int(number) for number in row if number >= 0)
