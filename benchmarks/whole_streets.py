"""Whether `auto` keeps the tolerance that it was asked for, and at what cost.

    python benchmarks/whole_streets.py field 0:60      random fields of bodies, a line of JSON each
    python benchmarks/whole_streets.py crowd 0:20      dense traffic with recesses
    python benchmarks/whole_streets.py street 0:7      frames of the ready scenes
    python benchmarks/whole_streets.py field 21:40 --tolerances 6 3 1
    python benchmarks/whole_streets.py street 8:9 --tolerances 3 --auto-only --reach 20
    python benchmarks/whole_streets.py --write docs/accuracy.md     table and chart from the results

The reference is `sbr` of all coherent bodies with ways over the mirrors that `auto` found, of fields and crowds at
0.2 rad, of streets at 0.4 rad (at 0.2 rad within less than 30 m), with five bounces, edges cut twice as finely as by
default and no angle of return; they take seconds to minutes and are kept.
Counted are objects whose echo in the reference is 10 dB over the noise of a cell.
"""

from __future__ import annotations

import argparse
import sys
import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

import scarl_sionna as ss
from benchmarks.harness import ANY_COST, machine
from benchmarks.row_files import append_rows, rows_so_far
from benchmarks.street_scenes import Street, problem
from benchmarks.whole_street_figures import WHOLE, kept, write
from scarl_sionna.core.settings.sbr import SbrSettings
from scarl_sionna.core.units import dbm_to_watt
from scarl_sionna.radar.channel import ChannelPlan, plan_channel, solve_paths
from scarl_sionna.radar.channel.band_mean import mean_power
from scarl_sionna.radar.channel.compose.expected_error import owners
from scarl_sionna.radar.paths import RadarPaths
from scarl_sionna.signal.noise import angle_cell_noise_power

RESULTS = Path("docs/figures/data/whole_streets.jsonl.xz")
RADAR = ss.RadarSpec()
REFERENCES = {
    "field": Path("docs/figures/data/field_references.jsonl"),
    "crowd": Path("docs/figures/data/crowd_references.jsonl"),
    "street": Path("docs/figures/data/street_references.jsonl"),
}
"""Echoes of the references: take a line away where the scene or the solver has changed."""
TOLERANCES = (6.0, 3.0, 1.0, 0.3)
UNLIMITED = 10**9
FINE = SbrSettings(max_phase=0.2, integration_phase=0.02, edge_share=0.0625, sheet_share=0.05, max_depth=5)
REFERENCE = {"field": FINE, "crowd": FINE, "street": FINE.with_(max_phase=0.4, max_turn=3.0), "near": FINE}
FINEST = {"field": 0.3, "crowd": 0.3, "street": 1.0}
"""Smallest tolerance asked for: the reference of the streets is not finer than the level of 0.3 dB."""
REACH = {"field": 80.0, "crowd": 60.0, "street": WHOLE}
PLAIN = SbrSettings(max_phase=1.0, integration_phase=0.1, max_depth=3)
LONG = 20.0
"""Calls that take longer are not repeated [s]: what a first call compiles, some 3 s, matters little there."""
GONE_DB = 60.0
"""Stands for no echo at all."""


def echoes(paths: RadarPaths, numbers: list[int], radar: ss.RadarSpec = RADAR) -> dict[int, float]:
    """Return the power of objects over the noise of a cell [dB], mean over the band and so summed over range cells.

    Rough surfaces count by their mean power: their phases are drawn for patches, which differ from method to method.
    """
    unit = dbm_to_watt(radar.front_end.tx_power_dbm) / angle_cell_noise_power(radar)
    if not paths.num_paths:
        return dict.fromkeys(numbers, -300.0)
    owner = owners(paths, numbers)
    rows = np.flatnonzero(owner >= 0)
    place = np.searchsorted(numbers, owner[rows])
    power = unit * mean_power(paths, radar, rows, place, len(numbers), 96)
    return {number: float(10.0 * np.log10(max(power[k], 1e-30))) for k, number in enumerate(numbers)}


def timed(call: Callable[[], RadarPaths]) -> tuple[RadarPaths, float]:
    """Return the paths, and the processor time of the faster of two calls, of a long one that of the first [s]."""
    seconds: list[float] = []
    while not seconds or (len(seconds) == 1 and seconds[0] < LONG):
        start = time.process_time()
        paths = call()
        seconds.append(time.process_time() - start)
    return paths, min(seconds)


def solve(
    kind: str,
    seed: int,
    tolerances: Sequence[float] = TOLERANCES,
    reach: float | None = None,
    is_auto_only: bool = False,
) -> dict[str, Any]:
    """Return the line of one problem, of all methods or of `auto` only, within its own reach unless said [m]."""
    with problem(kind, seed) as street, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        street = replace(street, reach=street.reach if reach is None else reach)
        plan, coherent = widest_plan(street, FINEST[kind])
        level, seconds = reference(kind, seed, street, plan, coherent)
        line: dict[str, Any] = {
            "kind": kind,
            "seed": seed,
            "name": street.name,
            "reach": street.reach,
            "reference_cpu": round(seconds, 2),
            "level_db": level,
            "methods": {},
        }
        for tolerance in (value for value in tolerances if value >= FINEST[kind]):
            settings = {
                "channel_tolerance_db": tolerance,
                "tube_budget": UNLIMITED,
                "max_distance": street.reach,
                **ANY_COST,
            }
            paths, cpu = timed(
                lambda settings=settings: solve_paths(street.state, RADAR, street.mount, "auto", **settings)
            )
            row = row_of(street, paths, cpu, coherent, level)
            expected = {choice["instance"]: choice["expected_error_db"] for choice in paths.diagnostics["choices"]}
            row["expected_db"] = {name: expected.get(name) for name in row["error_db"]}
            row |= {key: paths.diagnostics[key] for key in ("met", "expected_error_db")}
            row["predicted"] = paths.diagnostics["predicted"]
            line["methods"][f"auto {tolerance:g} dB"] = row
        if is_auto_only:
            return line
        for name, knobs, ghosts in (("sbr 1 rad, no mirrors", PLAIN, False), ("sbr 1 rad, mirrors", PLAIN, True)):
            if ghosts and kind == "street":
                continue
            paths, cpu = timed(lambda knobs=knobs, ghosts=ghosts: by_plan(street, plan, knobs, ghosts))
            line["methods"][name] = row_of(street, paths, cpu, coherent, level)
        paths, cpu = timed(lambda: solve_paths(street.state, RADAR, street.mount, "raycast", max_distance=street.reach))
        line["methods"]["raycast"] = row_of(street, paths, cpu, coherent, level)
        return line


def reference(
    kind: str, seed: int, street: Street, plan: ChannelPlan, coherent: list[int]
) -> tuple[dict[str, float], float]:
    """Return the echo of each object 10 dB over the noise [dB], and the processor time that it took [s]."""
    for line in rows_so_far(REFERENCES[kind]):
        if (line["seed"], line["name"], line.get("reach", REACH[kind])) == (seed, street.name, street.reach):
            return line["level_db"], line["reference_cpu"]
    start = time.process_time()
    knobs = REFERENCE["near" if street.reach < WHOLE else kind]
    truth = echoes(by_plan(street, plan, knobs, True), coherent)
    seconds = round(time.process_time() - start, 1)
    level = {name_of(street, n): round(level, 2) for n, level in truth.items() if level > 10.0}
    line = {"seed": seed, "name": street.name, "reach": street.reach, "reference_cpu": seconds}
    line |= {"level_db": level, "machine": machine()}
    append_rows(REFERENCES[kind], line)
    return level, seconds


def widest_plan(street: Street, tolerance: float) -> tuple[ChannelPlan, list[int]]:
    """Return the plan of `auto` without a budget, and the instances that it gives to `sbr`."""
    plan = plan_channel(
        street.state,
        RADAR,
        street.mount,
        channel_tolerance_db=tolerance,
        tube_budget=UNLIMITED,
        max_distance=street.reach,
        **ANY_COST,
    )
    return plan, sorted({number for share in plan.shares if share.solver == "sbr" for number in share.instances})


def by_plan(street: Street, plan: ChannelPlan, knobs: SbrSettings, ghosts: bool) -> RadarPaths:
    """Return the paths of `sbr` of what a plan gives to it, with ways over the plan's mirrors or straight ones only."""
    shares = tuple(
        replace(share, settings=knobs, **({} if ghosts else {"through_mirrors": False, "reflections": ()}))
        for share in plan.shares
        if share.solver == "sbr"
    )
    own = replace(plan, shares=shares, echoes=False)
    return solve_paths(street.state, RADAR, street.mount, "hybrid", plan=own, max_distance=street.reach, **ANY_COST)


def name_of(street: Street, number: int) -> str:
    """Return the name of an instance."""
    return street.state.world.instances[number].name


def row_of(
    street: Street, paths: RadarPaths, cpu: float, coherent: list[int], level: dict[str, float]
) -> dict[str, Any]:
    """Return processor time, number of paths and the error of each object's echo against the reference [dB]."""
    found = {name_of(street, number): value for number, value in echoes(paths, coherent).items()}
    errors = {name: round(float(np.clip(found[name] - true, -GONE_DB, GONE_DB)), 2) for name, true in level.items()}
    return {"cpu": round(cpu, 3), "paths": paths.num_paths, "error_db": errors}


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("kind", nargs="?", choices=tuple(REFERENCES))
    parser.add_argument("seeds", nargs="?", default="0:10", help="first:last, the last not included")
    parser.add_argument("--tolerances", type=float, nargs="+", default=TOLERANCES, help="of `auto` [dB]")
    parser.add_argument("--reach", type=float, help="of the problem, if not its own [m]")
    parser.add_argument("--auto-only", action="store_true", help="leave the other methods out")
    parser.add_argument("--out", type=Path, default=RESULTS)
    parser.add_argument("--write", type=Path, metavar="PAGE")
    arguments = parser.parse_args()
    if arguments.write is not None:
        write(arguments.write, arguments.out)
        return
    arguments.out.parent.mkdir(parents=True, exist_ok=True)
    lines = rows_so_far(arguments.out)
    done = {(line["kind"], line["seed"], line.get("reach", REACH[line["kind"]])) for line in lines}
    first, last = map(int, arguments.seeds.split(":"))
    for seed in range(first, last):
        if (arguments.kind, seed, arguments.reach or REACH[arguments.kind]) in done:
            continue
        found_line = solve(arguments.kind, seed, arguments.tolerances, arguments.reach, arguments.auto_only)
        line = {**found_line, "machine": machine()}
        append_rows(arguments.out, line)
        found = {name: f"{kept(row):.2f} dB {row['cpu']:.1f} s" for name, row in line["methods"].items()}
        print(line["name"], f"reference {line['reference_cpu']:.0f} s", found, flush=True)


if __name__ == "__main__":
    main()
