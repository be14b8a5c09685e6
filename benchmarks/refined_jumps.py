"""How far an object's echo jumps when `auto` computes it finer in one frame and not in the next.

    python benchmarks/refined_jumps.py field 142:150                 random fields, a line of JSON each
    python benchmarks/refined_jumps.py street 52:53 --reach 20       a frame of the ready scenes

At a tolerance of 1 dB the radar moves 1 m ahead in steps of 1 mm, and a ready scene runs for 1 s in steps of 1 ms, too.
Which objects are computed finer is compared on a grid of `GRID` steps and a change brought to one step by halving. In
the one of the two neighbouring frames in which the object is computed finer, `second_look_db` is what its echo differs
by from the coarser one of the same frame: the jump.
"""

from __future__ import annotations

import argparse
import sys
import time
import warnings
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.harness import machine
from benchmarks.jumps import COUNTED_DB, STEPS, At, ahead, moves
from benchmarks.row_files import append_rows
from benchmarks.street_scenes import problem
from benchmarks.whole_streets import RADAR, UNLIMITED, echoes
from scarl_sionna.radar.channel import solve_paths

RESULTS = Path("docs/figures/data/refined_jumps.jsonl")
GRID = 50
TOLERANCE = 1.0


class Walk:
    """One move: what its frames are, solved when they are asked for."""

    def __init__(self, at: At, reach: float) -> None:
        self.at, self.reach = at, reach
        self.known: dict[int, dict[str, tuple[bool, float, float | None]]] = {}

    def frame(self, step: int) -> dict[str, tuple[bool, float, float | None]]:
        """Return of each object by `sbr` whether it is computed finer, its echo [dB over the noise], the difference."""
        if step not in self.known:
            state, mount = self.at(step)
            knobs = {"channel_tolerance_db": TOLERANCE, "tube_budget": UNLIMITED, "max_distance": self.reach}
            paths = solve_paths(state, RADAR, mount, "auto", **knobs)
            rows = {row["instance"]: row for row in paths.diagnostics["choices"] if row["method"] == "sbr"}
            numbers = sorted(number for number, info in state.world.instances.items() if info.name in rows)
            level = echoes(paths, numbers)
            names = {number: state.world.instances[number].name for number in numbers}
            self.known[step] = {
                name: (rows[name]["refined"], level[number], rows[name]["second_look_db"])
                for number, name in names.items()
            }
        return self.known[step]

    def finer(self, step: int) -> set[str]:
        """Return the objects that are computed finer after some steps."""
        return {name for name, (is_finer, _, _) in self.frame(step).items() if is_finer}

    def changes(self, low: int, high: int) -> list[int]:
        """Return steps between two in which another set of objects is computed finer."""
        if self.finer(low) == self.finer(high):
            return []
        if high - low == 1:
            return [high]
        middle = (low + high) // 2
        return self.changes(low, middle) + self.changes(middle, high)

    def jumps(self, step: int) -> list[dict[str, Any]]:
        """Return what echoes 10 dB over the noise jump by where they are computed finer before or after a step only."""
        found = []
        for name in sorted(self.finer(step - 1) ^ self.finer(step)):
            before, after = (self.frame(at).get(name, (False, -300.0, None)) for at in (step - 1, step))
            if max(before[1], after[1]) > COUNTED_DB:
                difference = before[2] if before[0] else after[2]
                change = round(abs(after[1] - before[1]), 2)
                found.append({"step": step, "instance": name, "jump_db": difference, "change_db": change})
        return found


def solve(kind: str, seed: int, reach: float | None) -> dict[str, Any]:
    """Return the line of one problem."""
    with problem(kind, seed) as first:
        within = reach or first.reach
        line: dict[str, Any] = {"kind": kind, "seed": seed, "name": first.name, "reach": within, "moves": {}}
        for name, at in (moves(seed) if kind == "street" else {"1 mm": ahead(first)}).items():
            walk, start = Walk(at, within), time.process_time()
            steps = [step for low, high in pairwise(range(0, STEPS + 1, GRID)) for step in walk.changes(low, high)]
            found = [jump for step in steps for jump in walk.jumps(step)]
            looks = [row[2] for frame in walk.known.values() for row in frame.values() if row[2] is not None]
            line["moves"][name] = {
                "changes": steps,
                "jumps": found,
                "looks": np.quantile(looks, [0.5, 0.9, 1.0]).round(2).tolist() if looks else [],
                "frames": len(walk.known),
                "cpu": round(time.process_time() - start),
            }
    return line


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("kind", choices=("field", "street"))
    parser.add_argument("seeds", help="first:last, the last not included")
    parser.add_argument("--reach", type=float, help="of the problem, if not its own [m]")
    parser.add_argument("--out", type=Path, default=RESULTS)
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    for seed in range(*map(int, arguments.seeds.split(":"))):
        line = {**solve(arguments.kind, seed, arguments.reach), "machine": machine()}
        append_rows(arguments.out, line)
        for name, move in line["moves"].items():
            found = [jump["jump_db"] for jump in move["jumps"]]
            most = max(found, default=0.0)
            print(line["name"], name, f"{len(found)} jumps, {most:.2f} dB", move["looks"], move["cpu"], "s", flush=True)


if __name__ == "__main__":
    main()
