"""How often `met` of `auto` is right, and how often its doubts are.

    python benchmarks/doubts.py field 72:97 --tolerance 3      a line of JSON for each random field, then the tables
    python benchmarks/doubts.py street 0:7
    python benchmarks/doubts.py --report                       the tables of the results so far

Each problem is solved against the reference of `whole_streets.py`, once as it is and once with `refine_share=0`: then
objects that are doubted (bounces that differ from their reverse, objects that hardly a probe sees; docs/accuracy.md,
second look) keep the paths that the doubt is about.
"""

from __future__ import annotations

import argparse
import json
import sys
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.harness import ANY_COST, machine
from benchmarks.street_scenes import problem
from benchmarks.whole_street_figures import kept
from benchmarks.whole_streets import FINEST, RADAR, UNLIMITED, _plan, _row, reference, timed
from scarl_sionna.core.settings.auto import AutoSettings
from scarl_sionna.radar.channel import solve_paths

RESULTS = Path("docs/figures/data/doubts.jsonl")


def solve(kind: str, seed: int, tolerance: float) -> dict[str, Any]:
    """Return the line of one problem."""
    with problem(kind, seed) as street, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        plan = _plan(street, FINEST[kind])
        coherent = sorted({number for share in plan.shares if share.solver == "sbr" for number in share.instances})
        level, _ = reference(kind, seed, street, plan, coherent)
        settings = {
            "channel_tolerance_db": tolerance,
            "tube_budget": UNLIMITED,
            "max_distance": street.reach,
            **ANY_COST,
        }
        found = {}
        for name, rules in (("as it is", AutoSettings()), ("not refined", AutoSettings(refine_share=0.0))):
            paths, cpu = timed(
                lambda rules=rules: solve_paths(street.state, RADAR, street.mount, "auto", auto=rules, **settings)
            )
            row = _row(street, paths, cpu, coherent, level)
            doubts = {choice["instance"]: choice["doubt_db"] for choice in paths.diagnostics["choices"]}
            row["doubt_db"] = {name: doubts[name] for name in level if doubts.get(name) is not None}
            found[name] = row | {key: paths.diagnostics[key] for key in ("met", "expected_error_db")}
        return {"kind": kind, "seed": seed, "name": street.name, "tolerance": tolerance, "solves": found}


def report(lines: Sequence[dict[str, Any]]) -> str:
    """Return the tables of the results."""
    text = [
        f"{len(lines)} problems, {lines[-1]['machine']}.",
        "",
        "| problems | tolerance [dB] | `met` true and it is | false, though met | false, and it is not | "
        "true, and it is not | CPU, median [s] |",
        "|---|---|---|---|---|---|---|",
    ]
    groups = sorted({(line["kind"], line["tolerance"]) for line in lines})
    for kind, tolerance in groups:
        solves = [
            line["solves"]["as it is"] for line in lines if (line["kind"], line["tolerance"]) == (kind, tolerance)
        ]
        both = [(row["met"], kept(row) <= tolerance) for row in solves]
        counts = [both.count(pair) for pair in ((True, True), (False, True), (False, False), (True, False))]
        cpu = np.median([row["cpu"] for row in solves])
        text.append("| " + " | ".join(map(str, [f"{len(solves)} {kind}s", tolerance, *counts, f"{cpu:.1f}"])) + " |")
    text += [
        "",
        "| problems | tolerance [dB] | objects | doubted | of them off by more than the tolerance | "
        "not doubted and off | found over doubt, median | CPU over that without refining, median |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for kind, tolerance in groups:
        some = [line["solves"] for line in lines if (line["kind"], line["tolerance"]) == (kind, tolerance)]
        rows = [solves["not refined"] for solves in some]
        errors = [(abs(error), row["doubt_db"].get(name)) for row in rows for name, error in row["error_db"].items()]
        doubted = [(error, doubt) for error, doubt in errors if doubt is not None]
        off = sum(error > tolerance for error, _ in doubted)
        missed = sum(error > tolerance for error, doubt in errors if doubt is None)
        share = f"{np.median([error / doubt for error, doubt in doubted]):.2f}" if doubted else ""
        cost = np.median([solves["as it is"]["cpu"] / solves["not refined"]["cpu"] for solves in some])
        cells = [f"{len(rows)} {kind}s", tolerance, len(errors), len(doubted), off, missed, share, f"{cost:.2f}"]
        text.append("| " + " | ".join(map(str, cells)) + " |")
    return "\n".join(text)


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("kind", nargs="?", choices=("field", "street"))
    parser.add_argument("seeds", nargs="?", default="72:82", help="first:last, the last not included")
    parser.add_argument("--tolerance", type=float, default=3.0, help="[dB]")
    parser.add_argument("--out", type=Path, default=RESULTS)
    parser.add_argument("--report", action="store_true", help="only print the tables")
    arguments = parser.parse_args()
    lines = [json.loads(line) for line in arguments.out.read_text().splitlines()] if arguments.out.exists() else []
    done = {(line["kind"], line["seed"], line["tolerance"]) for line in lines}
    if arguments.kind and not arguments.report:
        for seed in range(*map(int, arguments.seeds.split(":"))):
            if (arguments.kind, seed, arguments.tolerance) in done:
                continue
            line = {**solve(arguments.kind, seed, arguments.tolerance), "machine": machine()}
            lines.append(line)
            with arguments.out.open("a") as file:
                file.write(json.dumps(line) + "\n")
            print(line["name"], line["solves"]["as it is"]["met"], kept(line["solves"]["as it is"]), flush=True)
    if lines:
        print(report(lines))


if __name__ == "__main__":
    main()
