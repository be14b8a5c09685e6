"""What `plan_channel(...).predicted` says that a solve by `auto` will cost, and what it then takes.

    python benchmarks/predicted.py field 126:134 --tolerances 3 1
    python benchmarks/predicted.py street 15:22 --tolerances 3 --budgets 50000 300000
    python benchmarks/predicted.py street 15:22 --tolerances 3 --reach 10

Processor seconds of the faster of two solves, planning, clutter and second look included; of one that takes over 8 s
the first.
"""

from __future__ import annotations

import argparse
import sys
import time
import warnings
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

import scarl_sionna as ss
from benchmarks.harness import ANY_COST, machine
from benchmarks.street_scenes import Street, problem
from scarl_sionna.radar.channel import solve_paths

RADAR = ss.RadarSpec()
UNLIMITED = 10**9
LONG = 8.0


def ratio(street: Street, tolerance: float, budget: int, reach: float) -> tuple[str, float]:
    """Return the row of one solve, and its predicted over its measured processor time."""
    seconds: list[float] = []
    while not seconds or (len(seconds) == 1 and seconds[0] < LONG):
        start = time.process_time()
        paths = solve_paths(
            street.state,
            RADAR,
            street.mount,
            "auto",
            channel_tolerance_db=tolerance,
            tube_budget=budget,
            max_distance=reach,
            **ANY_COST,
        )
        seconds.append(time.process_time() - start)
    predicted, level = paths.diagnostics["predicted"], paths.diagnostics["level_db"]
    found = predicted["cpu_seconds"] / min(seconds)
    limit = "any" if budget == UNLIMITED else f"{budget:,}"
    return (
        f"| {street.name} | {tolerance:g}, {level:g} | {limit} | {reach:g} | {predicted['tubes']:,.0f} | "
        f"{predicted['cpu_seconds']:.1f} | {min(seconds):.1f} | {found:.2f} |"
    ), found


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("kind", choices=("field", "street"))
    parser.add_argument("seeds", help="first:last, the last not included")
    parser.add_argument("--tolerances", type=float, nargs="+", default=(3.0, 1.0), help="[dB]")
    parser.add_argument("--budgets", type=int, nargs="+", default=(UNLIMITED,), help="in tubes")
    parser.add_argument("--reach", type=float, help="of the problem, if not its own [m]")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    print(machine(), "", sep="\n")
    print("| problem | tolerance, level [dB] | tube budget | within [m] | tubes | predicted [s] | CPU [s] | ratio |")
    print("|---|---|---|---|---|---|---|---|")
    found = []
    first, last = map(int, arguments.seeds.split(":"))
    for seed in range(first, last):
        with problem(arguments.kind, seed) as street:
            for tolerance in arguments.tolerances:
                for budget in arguments.budgets:
                    row, one = ratio(street, tolerance, budget, arguments.reach or street.reach)
                    found.append(one)
                    print(row, flush=True)
    low, middle, high = np.percentile(found, [10, 50, 90])
    spread = f"10 % {low:.2f}, median {middle:.2f}, 90 % {high:.2f}"
    print(f"\n{len(found)} solves: {min(found):.2f} to {max(found):.2f}, {spread}")


if __name__ == "__main__":
    main()
