"""What a radar's paths take by default in each of the ready scenes, whole, and what `auto` says of them.

    python benchmarks/default_solves.py --write docs/accuracy.md
    python benchmarks/default_solves.py tunnel motorway --time 3.7

`ss.solve_paths(state, radar, mount, "auto")` and nothing else: tolerance, budgets and range are the defaults. Processor
seconds of one solve, planning and clutter included; the first of a place also compiles kernels.
"""

from __future__ import annotations

import argparse
import sys
import time
import warnings
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

import scarl_sionna as ss
from benchmarks.harness import machine, write_block
from benchmarks.street_scenes import PLACES


def row(place: str, when: float) -> str:
    """Return the line of a place."""
    state = ss.load_scene(place).at(when)
    mount = state.mount("ego", ss.Pose([3.8, 0.0, 0.6]))
    start = time.process_time()
    paths = ss.solve_paths(state, ss.RadarSpec(), mount, "auto")
    cpu = time.process_time() - start
    said, predicted = paths.diagnostics, paths.diagnostics["predicted"]
    met = "yes" if said["met"] else f"no, {said['expected_error_db']:.1f} dB expected"
    return (
        f"| {place} | {said['num_counted']} | {said['level_db']:g} | {met} | {said['num_by_class']} | "
        f"{predicted['tubes']:,.0f} | {paths.num_paths:,} | {predicted['cpu_seconds']:.1f} | {cpu:.1f} |"
    )


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("places", nargs="*", default=PLACES)
    parser.add_argument("--time", type=float, default=1.3, help="of each scene [s]")
    parser.add_argument("--write", type=Path, metavar="PAGE")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    rows = [
        f"`python benchmarks/default_solves.py --time {arguments.time:g}`, {machine()}.",
        "",
        "| place | objects that count | level [dB] | 1 dB met | by class | tubes planned | paths | CPU predicted [s] | "
        "CPU [s] |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    print("\n".join(rows), flush=True)
    for place in arguments.places:
        rows.append(row(place, arguments.time))
        print(rows[-1], flush=True)
    if arguments.write is not None:
        write_block(arguments.write, "default solves", "\n".join(rows))


if __name__ == "__main__":
    main()
