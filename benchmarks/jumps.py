"""How far an object's echo jumps when the plan of `auto` changes as the scene moves.

    python benchmarks/jumps.py 0:6                      six frames of the ready scenes, a line of JSON each
    python benchmarks/jumps.py 0:6 --budget 1000000     with that many tubes; unlimited unless said
    python benchmarks/jumps.py 0:6 --reach 15           of what is within 15 m, in place of 30
    python benchmarks/jumps.py --write docs/accuracy.md     table from the results

The radar moves 1 m ahead in steps of 1 mm, and the scene runs for 1 s in steps of 1 ms. As long as the plan stays, the
echo moves as that of the reference. Where the plan changes, the same state is solved by the plan before and by the
plan after: what an object's echo differs by is the jump that the planning adds, whatever the scene does meanwhile.
A plan changes if an object has another solver or is seen over other mirrors. That is found on a grid of `GRID` steps
and brought to one step by halving: one that is undone within them is not seen. Where weights of mirrors differ between
two points of the grid, the step in which they change most is sought, too. Within a plan, echoes before and after single
steps are compared at `PAIRS` random places of each move; what they differ by is the scene's own change and the
solver's noise together. Where it is more than `LARGE_DB`, both states are solved again at the finest level of `auto`,
that of 0.3 dB, which says what the scene itself does.
"""

from __future__ import annotations

import argparse
import sys
import time
import warnings
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

import scarl_sionna as ss
from benchmarks.harness import ANY_COST, machine, write_block
from benchmarks.row_files import append_rows, read_rows
from benchmarks.street_scenes import PLACES, Street, street
from benchmarks.whole_streets import RADAR, UNLIMITED, echoes
from scarl_sionna.core.mount import Mount
from scarl_sionna.core.settings.auto import DEFAULT_AUTO
from scarl_sionna.core.settings.plan import ChannelPlan
from scarl_sionna.engine.world import WorldState
from scarl_sionna.radar.channel import plan_channel, solve_paths
from scarl_sionna.radar.channel.compose.budget import sbr_settings

RESULTS = Path("docs/figures/data/jumps.jsonl")
STEPS, GRID = 1000, 50
"""Steps of 1 mm or 1 ms, and those between two plans of the first search."""
REACH = 30.0
"""Of what is within so many metres, unless said."""
TOLERANCE = 3.0
PAIRS = 1
WEIGHT_STEP = 0.02
"""Weights that differ by less between two steps are not looked at: 0.35 dB of an echo that is all over mirrors."""
LARGE_DB = 0.5
"""A jump above the reference's by more is one."""
REFERENCE = sbr_settings(DEFAULT_AUTO.levels[-1])
COUNTED_DB = 10.0
"""Objects this far over the noise of a cell are counted."""

At = Callable[[int], tuple[WorldState, Mount]]


def ahead(first: Street) -> At:
    """Return the state and the radar's mount after a number of steps of 1 mm."""
    pose = first.mount.pose

    def moved(step: int) -> tuple[WorldState, Mount]:
        there = ss.Pose(pose.apply(np.array([1e-3 * step, 0.0, 0.0])), pose.quaternion)
        return first.state, replace(first.mount, pose=there)

    return moved


def moves(seed: int) -> dict[str, At]:
    """Return the state and the radar's mount after a number of steps of 1 mm, and of 1 ms."""
    first = street(seed)
    world, begin = first.state.world, first.state.time
    on_ego = first.state.actor_pose("ego").inverse().compose(first.mount.pose)

    def later(step: int) -> tuple[WorldState, Mount]:
        state = world.at(begin + 1e-3 * step)
        return state, state.mount("ego", on_ego)

    return {"1 mm": ahead(first), "1 ms": later}


def signature(plan: ChannelPlan) -> dict[int, tuple[str, tuple[int, ...]]]:
    """Return the solver of each instance and the mirrors that it is seen over."""
    found: dict[int, tuple[str, tuple[int, ...]]] = {}
    for share in plan.shares:
        over: dict[int, tuple[int, ...]] = {}
        for reflection in share.reflections:
            for number in reflection.instances:
                over[int(number)] = tuple(int(mirror) for mirror in reflection.mirrors)
        for number in share.instances:
            found[int(number)] = (share.solver, over.get(int(number), ()))
    return found


def moved(before: ChannelPlan, after: ChannelPlan) -> dict[int, float]:
    """Return by how much weights of mirrors differ between two plans, at most, for each instance that has some."""
    both: list[dict[tuple[int, int], float]] = [{}, {}]
    for found, plan in zip(both, (before, after), strict=True):
        for item in (item for share in plan.shares for item in share.reflections):
            for number, row in zip(item.instances, item.weights, strict=True):
                found |= {(int(number), int(at)): weight for at, weight in zip(item.mirrors, row, strict=True)}
    most: dict[int, float] = {}
    for key in both[0].keys() | both[1].keys():
        most[key[0]] = max(most.get(key[0], 0.0), abs(both[0].get(key, 0.0) - both[1].get(key, 0.0)))
    return most


def only(plan: ChannelPlan, numbers: list[int]) -> ChannelPlan:
    """Return the part of a plan that computes some instances."""
    shares = []
    for share in plan.shares:
        own = tuple(number for number in map(int, share.instances) if number in numbers)
        over = [item.only(own) for item in share.reflections]
        if own:
            kept = tuple(item for item in over if item.instances)
            shares.append(replace(share, instances=own, reflections=kept, through_mirrors=bool(kept)))
    return replace(plan, shares=tuple(shares), echoes=False)


class Walk:
    """One move of one place: its plans, made when they are asked for."""

    def __init__(self, at: At, budget: int, reach: float) -> None:
        self.at, self.budget, self.reach = at, budget, reach
        self.plans: dict[int, ChannelPlan] = {}

    def plan(self, step: int) -> ChannelPlan:
        """Return the plan after some steps."""
        if step not in self.plans:
            state, mount = self.at(step)
            knobs = {"channel_tolerance_db": TOLERANCE, "tube_budget": self.budget, "max_distance": self.reach}
            self.plans[step] = plan_channel(state, RADAR, mount, **knobs)
        return self.plans[step]

    def changes(self, low: int, high: int) -> list[int]:
        """Return steps between two at which the plan is another than a step before."""
        if signature(self.plan(low)) == signature(self.plan(high)):
            return []
        if high - low == 1:
            return [high]
        middle = (low + high) // 2
        return self.changes(low, middle) + self.changes(middle, high)

    def steepest(self, low: int, high: int) -> list[int]:
        """Return the step between two in which weights change most, by halving, if it is by more than `WEIGHT_STEP`."""
        while max(moved(self.plan(low), self.plan(high)).values(), default=0.0) > WEIGHT_STEP:
            if high - low == 1:
                return [high]
            middle = (low + high) // 2
            first, last = (moved(self.plan(at), self.plan(middle)) for at in (low, high))
            is_first = max(first.values(), default=0.0) > max(last.values(), default=0.0)
            low, high = (low, middle) if is_first else (middle, high)
        return []

    def jump(self, step: int) -> list[dict[str, Any]]:
        """Return what echoes differ by between the plan before a step and that after it, in the state after it."""
        before, after = self.plan(step - 1), self.plan(step)
        old, new = signature(before), signature(after)
        most = moved(before, after)
        changed = sorted(
            number
            for number in new
            if new[number] != old.get(number, ("none", ())) or most.get(number, 0.0) > WEIGHT_STEP
        )
        both = [echoes(self._solved(step, only(plan, changed)), changed) for plan in (before, after)]
        table = self.at(step)[0].world.instances
        return [
            {
                "instance": table[number].name,
                "class": table[number].semantic,
                "before": list(map(str, old.get(number, ("none", ())))),
                "after": list(map(str, new[number])),
                "level_db": round(max(both[0][number], both[1][number]), 2),
                "jump_db": round(abs(both[0][number] - both[1][number]), 2),
            }
            for number in changed
            if max(both[0][number], both[1][number]) > COUNTED_DB
        ]

    def step_db(self, step: int) -> list[dict[str, Any]]:
        """Return what the echoes of all coherent objects change by in one step, with the plan before it [dB]."""
        plan = self.plan(step)
        numbers = sorted(number for number, (solver, _) in signature(plan).items() if solver == "sbr")
        change, level = self._change(step, plan, numbers)
        table = self.at(step)[0].world.instances
        counted = [number for number in numbers if level[number] > COUNTED_DB]
        found = [
            {"instance": table[number].name, "level_db": round(level[number], 2), "change_db": round(change[number], 2)}
            for number in counted
        ]
        if any(abs(change[number]) > LARGE_DB for number in counted):
            shares = [
                replace(share, settings=REFERENCE) if share.solver == "sbr" else share
                for share in only(plan, numbers).shares
            ]
            true, _ = self._change(step, replace(plan, shares=tuple(shares), echoes=False), numbers)
            for row, number in zip(found, counted, strict=True):
                row["reference_db"] = round(true[number], 2)
        return found

    def _change(self, step: int, plan: ChannelPlan, numbers: list[int]) -> tuple[dict[int, float], dict[int, float]]:
        """Return by how much each echo rises in one step, and the larger of both levels over the noise [dB]."""
        before, after = (echoes(self._solved(place, plan), numbers) for place in (step, step + 1))
        return {n: after[n] - before[n] for n in numbers}, {n: max(before[n], after[n]) for n in numbers}

    def _solved(self, step: int, plan: ChannelPlan) -> ss.RadarPaths:
        """Return the paths of a plan after some steps."""
        state, mount = self.at(step)
        return solve_paths(state, RADAR, mount, "hybrid", plan=plan, max_distance=self.reach, **ANY_COST)


def solve(seed: int, budget: int, reach: float) -> dict[str, Any]:
    """Return the line of one place."""
    line: dict[str, Any] = {"seed": seed, "name": street(seed).name, "budget": budget, "reach": reach, "moves": {}}
    for name, at in moves(seed).items():
        walk, start = Walk(at, budget, reach), time.process_time()
        marks = list(range(0, STEPS, GRID)) + [STEPS]
        steps = {step for low, high in pairwise(marks) for step in walk.changes(low, high)}
        steps |= {step for low, high in pairwise(marks) for step in walk.steepest(low, high)}
        found = [{"step": step, "objects": walk.jump(step)} for step in sorted(steps)]
        rng = np.random.default_rng([3, seed])
        within = [row for step in rng.integers(0, STEPS, PAIRS) for row in walk.step_db(int(step))]
        seconds = round(time.process_time() - start)
        line["moves"][name] = {"changes": found, "within": within, "plans": len(walk.plans), "cpu": seconds}
        print(line["name"], name, line["moves"][name], flush=True)
    return line


def report(lines: list[dict[str, Any]]) -> str:
    """Return the markdown of the results."""
    seeds = ", ".join(str(line["seed"]) for line in lines)
    text = [
        f"`python benchmarks/jumps.py SEED:SEED+1 --reach METRES`, seeds {seeds}, tolerance {TOLERANCE:g} dB, "
        f"{lines[-1]['machine']}.",
        "",
        "| place | within [m] | move | changes of plan in 1,000 steps | echoes 10 dB over the noise that they touch | "
        "of them above 0.5 dB | largest jump [dB] | echoes within a plan, largest change in a step [dB] | "
        "beyond the reference's |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for line in lines:
        for name, move in line["moves"].items():
            jumps = [item["jump_db"] for change in move["changes"] for item in change["objects"]]
            above = sum(jump > LARGE_DB for jump in jumps)
            largest = f"{max(jumps):.2f}" if jumps else "none"
            within = f"{len(move['within'])}, {max((abs(row['change_db']) for row in move['within']), default=0.0):.2f}"
            more = [abs(row["change_db"]) - abs(row["reference_db"]) for row in move["within"] if "reference_db" in row]
            beyond = f"{max(more):.2f}" if more else ""
            cells = [
                line["name"],
                f"{line['reach']:g}",
                name,
                len(move["changes"]),
                len(jumps),
                above,
                largest,
                within,
                beyond,
            ]
            text.append("| " + " | ".join(map(str, cells)) + " |")
    return "\n".join(text)


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("seeds", nargs="?", default=f"0:{len(PLACES)}", help="first:last, the last not included")
    parser.add_argument("--out", type=Path, default=RESULTS)
    parser.add_argument("--budget", type=int, default=UNLIMITED, help="tubes (default: unlimited)")
    parser.add_argument("--reach", type=float, default=REACH, help="of what is so near [m]")
    parser.add_argument("--write", type=Path, metavar="PAGE")
    arguments = parser.parse_args()
    if arguments.write is not None:
        lines = read_rows(arguments.out)
        write_block(arguments.write, "jumps", report(lines))
        return
    warnings.simplefilter("ignore")
    for seed in range(*map(int, arguments.seeds.split(":"))):
        line = {**solve(seed, arguments.budget, arguments.reach), "machine": machine()}
        append_rows(arguments.out, line)
        print(report([line]).splitlines()[-2:], flush=True)


if __name__ == "__main__":
    main()
