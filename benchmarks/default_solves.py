"""What a radar's paths take by default in each of the ready scenes, whole, and what `auto` says of them.

    python benchmarks/default_solves.py --write docs/accuracy.md
    python benchmarks/default_solves.py tunnel motorway --time 3.7
    python benchmarks/default_solves.py highway_guardrail --reference

`ss.solve_paths(state, radar, mount, "auto")` and nothing else: tolerance, budgets and range are the defaults. Processor
seconds of one solve, planning and clutter included; the first of a place also compiles kernels. `--reference` solves
the places without a budget at 1 dB first, minutes to an hour each, and keeps the echoes of their objects. Where these
are known the table says what error 90 % of the objects keep that are 10 dB over the noise by them.
"""

from __future__ import annotations

import argparse
import sys
import time
import warnings
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

import scarl_sionna as ss
from benchmarks.harness import ANY_COST, machine, write_block
from benchmarks.row_files import append_rows, read_rows
from benchmarks.street_scenes import PLACES
from benchmarks.whole_street_figures import kept
from benchmarks.whole_streets import RADAR, UNLIMITED, echoes
from scarl_sionna.radar.paths import RadarPaths

REFERENCES = Path("docs/figures/data/place_references.jsonl")
"""Echoes of the references: take a line away where the place or the solver has changed."""


def solved(place: str, when: float, **settings: Any) -> tuple[RadarPaths, dict[str, float], float]:
    """Return the paths of a place, the echo of each object over the noise [dB], and processor time [s]."""
    state = ss.load_scene(place).at(when)
    mount = state.mount("ego", ss.Pose([3.8, 0.0, 0.6]))
    start = time.process_time()
    paths = ss.solve_paths(state, RADAR, mount, "auto", **settings)
    cpu = time.process_time() - start
    objects = {number: info.name for number, info in state.world.instances.items() if info.is_object}
    return paths, {objects[number]: level for number, level in echoes(paths, sorted(objects)).items()}, cpu


def known_references() -> dict[tuple[str, float], dict[str, float]]:
    """Return the echoes of the references, by place and time."""
    return {(line["place"], line["time"]): line["echo_db"] for line in read_rows(REFERENCES)}


def add_reference(place: str, when: float) -> None:
    """Solve a place at 1 dB without a budget, and keep the echoes of the objects."""
    paths, found, cpu = solved(place, when, channel_tolerance_db=1.0, tube_budget=UNLIMITED, **ANY_COST)
    echo = {name: round(level, 2) for name, level in found.items() if level > -100.0}
    line = {"place": place, "time": when, "cpu": round(cpu), "met": paths.diagnostics["met"], "echo_db": echo}
    append_rows(REFERENCES, line)


def error_of(found: dict[str, float], reference: dict[str, float]) -> str:
    """Return the error that 90 % of the objects keep that are 10 dB over the noise by a reference."""
    errors = {name: found[name] - level for name, level in reference.items() if level >= 10.0}
    return f"{kept({'error_db': errors}):.2f} of {len(errors)}"


def row(place: str, when: float, reference: dict[str, float] | None) -> str:
    """Return the line of a place."""
    paths, found, cpu = solved(place, when)
    said, predicted = paths.diagnostics, paths.diagnostics["predicted"]
    met = "yes" if said["met"] else f"no, {said['expected_error_db']:.1f} dB expected"
    error = "" if reference is None else error_of(found, reference)
    return (
        f"| {place} | {said['num_counted']} | {said['level_db']:g} | {met} | {error} | {said['num_by_class']} | "
        f"{predicted['tubes']:,.0f} | {paths.num_paths:,} | {predicted['cpu_seconds']:.1f} | {cpu:.1f} |"
    )


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("places", nargs="*", default=PLACES)
    parser.add_argument("--time", type=float, default=1.3, help="of each scene [s]")
    parser.add_argument("--reference", action="store_true", help="solve the places without a budget first")
    parser.add_argument("--write", type=Path, metavar="PAGE")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    rows = [
        f"`python benchmarks/default_solves.py --time {arguments.time:g}`, {machine()}.",
        "",
        "| place | objects that count | level [dB] | 1 dB met | found [dB] | by class | tubes planned | paths | "
        "CPU predicted [s] | CPU [s] |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    print("\n".join(rows), flush=True)
    for place in arguments.places if arguments.reference else []:
        add_reference(place, arguments.time)
    known = known_references()
    for place in arguments.places:
        rows.append(row(place, arguments.time, known.get((place, arguments.time))))
        print(rows[-1], flush=True)
    if arguments.write is not None:
        write_block(arguments.write, "default solves", "\n".join(rows))


if __name__ == "__main__":
    main()
