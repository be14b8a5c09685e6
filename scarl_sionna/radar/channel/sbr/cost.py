"""What physical optics on a scene will cost, found out before it starts, and what becomes of a solve over its budget.

How right the estimate is stands in docs/sbr.md, cost.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

from scarl_sionna.core.errors import BudgetError, ScarlWarning
from scarl_sionna.core.settings.accuracy import Accuracy
from scarl_sionna.core.settings.auto import SbrLevel
from scarl_sionna.core.settings.sbr import SbrSettings
from scarl_sionna.radar.optics.viewpoint import Viewpoint

from .bodies import Bodies
from .tracing import first_faces, tracer_between

SAMPLES = 1024
"""First tubes that are followed to find out what all of them make: docs/sbr.md, cost."""
MOST_OF_ONE = 100.0
"""Tubes, and patches, that a first tube makes at most, as far as it is believed without a sample: of whole streets with
three bounces it is some 10 to 40. Decides only which solves are small enough not to be sampled."""
LEAST_SECONDS, SECONDS_OF_TUBE, SECONDS_OF_PATCH = 0.3, 1.0e-5, 3.5e-6
"""Processor time of a solve with nothing in view, and what each tube and each patch adds, on one core of 2025 [s];
docs/sbr.md, cost."""
BYTES_OF_PATCH = 700.0
"""Memory of what a patch leaves, at the moment of the most; docs/sbr.md, cost."""
LEAST_GIB = 0.4
"""Memory of what is worked at once, whatever the number of tubes [GiB]; docs/sbr.md, cost."""


@dataclass(frozen=True)
class SolveCost:
    """What a solve by `sbr` is expected to cost.

    Attributes
    ----------
    first_tubes, tubes, patches : float
        Numbers of tubes that start, of those of all bounces, and of patches that the receiver sees.
    sampled : int
        First tubes that were followed to find out; 0: the numbers are what they are at most.
    """

    first_tubes: float = 0.0
    tubes: float = 0.0
    patches: float = 0.0
    sampled: int = 0

    @property
    def cpu_seconds(self) -> float:
        """Processor time [s]."""
        return LEAST_SECONDS + SECONDS_OF_TUBE * self.tubes + SECONDS_OF_PATCH * self.patches

    @property
    def memory_gib(self) -> float:
        """Memory beyond what the process has before [GiB]."""
        return LEAST_GIB + BYTES_OF_PATCH * self.patches / 2.0**30

    def times(self, ways: float, pairs: float) -> SolveCost:
        """Return the cost of tubes traced so often, whose patches are seen so often, all paths kept."""
        return SolveCost(self.first_tubes * ways, self.tubes * ways, self.patches * pairs, self.sampled)

    def __add__(self, other: SolveCost) -> SolveCost:
        one, two = asdict(self), asdict(other)
        return SolveCost(**{name: one[name] + two[name] for name in one})

    def within(self, accuracy: Accuracy) -> bool:
        """Return whether processor time and memory are within their budgets."""
        seconds, memory = accuracy.cpu_budget, accuracy.memory_budget
        return (seconds is None or self.cpu_seconds <= seconds) and (memory is None or self.memory_gib <= memory)

    def report(self) -> dict[str, Any]:
        """Return plain data for the diagnostics."""
        found: dict[str, Any] = {name: round(value) for name, value in asdict(self).items()}
        return found | {"cpu_seconds": round(self.cpu_seconds, 2), "memory_gib": round(self.memory_gib, 2)}

    def __str__(self) -> str:
        most = "" if self.sampled else "at most "
        return (
            f"{most}{self.cpu_seconds:,.3g} CPU s and {self.memory_gib:.2g} GiB ({self.tubes:,.3g} tubes, "
            f"{self.patches:,.3g} patches)"
        )


def patches_in(memory_gib: float) -> int:
    """Return how many patches some memory holds [GiB], beside what is worked at once."""
    return max(int((memory_gib - LEAST_GIB) * 2.0**30 / BYTES_OF_PATCH), 0)


def solve_cost(bodies: Bodies, stations: tuple[Viewpoint, Viewpoint], accuracy: Accuracy | None = None) -> SolveCost:
    """Return what a solve between two stations is expected to cost.

    First tubes are counted from the sizes of the faces in view. Where :data:`MOST_OF_ONE` tubes of each would be over a
    budget, :data:`SAMPLES` of them, evenly among all, are followed to the last bounce, without their fields.

    Parameters
    ----------
    bodies : Bodies
    stations : tuple of two Viewpoint
    accuracy : Accuracy, optional
        With the budgets; if left out, a sample is always taken.

    Raises
    ------
    ParameterRangeError
        If there are more first tubes than `max_patches`.
    """
    with bodies.active():
        tracer, face = tracer_between(bodies, stations), first_faces(bodies, stations)
        starts = tracer.first_tubes(face)
        first = float(starts.pieces.sum())
        most = SolveCost(first, MOST_OF_ONE * first, MOST_OF_ONE * first)
        if (accuracy is not None and most.within(accuracy)) or not first:
            return most
        some, stands_for = tracer.sample(starts, SAMPLES)
        patches = sum(len(found) for found in tracer.bounces(face, [some]))
        return SolveCost(first, tracer.count.total() * stands_for, patches * stands_for, SAMPLES)


@dataclass(frozen=True, eq=False)
class Work:
    """Bodies that are solved, between which stations, by how many ways, and by how many pairs of them."""

    bodies: Bodies
    stations: tuple[Viewpoint, Viewpoint]
    ways: float = 1.0
    pairs: float = 1.0

    def cost(self, knobs: SbrSettings, accuracy: Accuracy | None = None) -> SolveCost:
        """Return what it is expected to cost with some knobs of `sbr`; without budgets a sample is always taken."""
        return solve_cost(with_knobs(self.bodies, knobs), self.stations, accuracy).times(self.ways, self.pairs)


def with_knobs(bodies: Bodies, knobs: SbrSettings) -> Bodies:
    """Return bodies that are solved with other knobs of `sbr`."""
    return bodies if knobs == bodies.knobs else replace(bodies, settings=bodies.settings.with_(sbr=knobs))


def coarser(knobs: SbrSettings, level: SbrLevel) -> SbrSettings:
    """Return knobs of `sbr` that are nowhere finer than a level of `auto`; the number of bounces stays."""
    knobs = knobs.for_scene()
    turn = knobs.max_turn
    assert knobs.bisections is not None  # of a scene
    angles = [angle for angle in (knobs.return_angle, level.return_angle) if angle is not None]
    return knobs.with_(
        max_phase=max(knobs.max_phase, level.max_phase),
        integration_phase=max(knobs.integration_phase, level.integration_phase),
        edge_share=max(knobs.edge_share, level.edge_share),
        sheet_share=max(knobs.sheet_share, level.sheet_share),
        narrow_share=max(knobs.narrow_share, level.narrow_share),
        narrow_shadows=knobs.narrow_shadows and level.narrow_shadows,
        corner_share=max(knobs.corner_share, level.corner_share),
        bisections=min(knobs.bisections, level.bisections),
        max_turn=None if turn is None else max(turn, level.max_phase),
        return_angle=min(angles, default=None),
    )


def affordable(
    work: Sequence[Work], accuracy: Accuracy, levels: Sequence[SbrLevel]
) -> tuple[list[SbrSettings], SolveCost]:
    """Return the knobs with which some work is within the budgets, and what it is then expected to cost.

    Parameters
    ----------
    work : sequence of Work
        Solved one after the other, all paths kept.
    accuracy : Accuracy
        Its `cpu_budget`, `memory_budget` and `over_budget`.
    levels : sequence of SbrLevel
        To which the work may be made coarser, the coarsest first.

    Raises
    ------
    BudgetError
        If `over_budget` is ``"refuse"`` and the work is over a budget, or if it is so at the coarsest level too.

    Warns
    -----
    ScarlWarning
        If the knobs are made coarser, with what either costs.
    """
    own = [one.bodies.knobs for one in work]
    cost = asked = _cost(work, own, accuracy)
    if asked.within(accuracy):
        return own, asked
    if accuracy.over_budget == "coarsen":
        for level in reversed(levels):
            knobs = [coarser(one, level) for one in own]
            if knobs == [one.for_scene() for one in own]:
                continue
            cost = _cost(work, knobs, accuracy)
            if cost.within(accuracy):
                warnings.warn(
                    f"'sbr' with the settings asked for is expected to take {asked}, over {_budgets(accuracy)}: it is "
                    f"computed at the level of {level.tolerance_db:g} dB of 'auto', {cost}; raise the budget of "
                    "Accuracy, or choose fewer `instances`",
                    ScarlWarning,
                    stacklevel=5,
                )
                return knobs, cost
    raise BudgetError(
        "expected cost of 'sbr'",
        str(asked),
        _budgets(accuracy),
        "choose fewer `instances`, a smaller `max_distance` or `max_depth`, coarser settings, "
        + ("a larger budget" if accuracy.over_budget == "coarsen" else "over_budget='coarsen' or a larger budget")
        + ("" if cost is asked else f" (at the coarsest level it is still {cost})"),
        asked.report(),
    )


def check_memory(bodies: Bodies, num_rows: int) -> None:
    """Refuse to go on where rows already take twice the budget: a sample can miss what few tubes make.

    Raises
    ------
    BudgetError
    """
    limit, held = bodies.settings.accuracy.memory_budget, SolveCost(patches=float(num_rows))
    if limit is not None and held.memory_gib > 2.0 * limit:
        raise BudgetError(
            "cost of 'sbr' so far",
            f"{held.memory_gib:.2g} GiB ({num_rows:,} rows)",
            _budgets(bodies.settings.accuracy),
            "the estimate before the solve was too low; choose fewer `instances` or a larger memory_budget",
            held.report(),
        )


def _cost(work: Sequence[Work], knobs: Sequence[SbrSettings], accuracy: Accuracy) -> SolveCost:
    found = [one.cost(own, accuracy) for one, own in zip(work, knobs, strict=True)]
    total = sum(found, SolveCost())
    if total.within(accuracy) or all(cost.sampled for cost in found):
        return total
    # bounds that are within a budget one by one are not so together: nothing is refused for a bound
    known = [cost if cost.sampled else one.cost(own) for one, own, cost in zip(work, knobs, found, strict=True)]
    return sum(known, SolveCost())


def _budgets(accuracy: Accuracy) -> str:
    seconds, memory = accuracy.cpu_budget, accuracy.memory_budget
    parts = [] if seconds is None else [f"cpu_budget = {seconds:g} s"]
    return ", ".join(parts + ([] if memory is None else [f"memory_budget = {memory:g} GiB"]))
