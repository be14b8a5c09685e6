"""What finer knobs of `sbr` buy in frames of the ready scenes and in random fields, object by object.

    python benchmarks/street_levels.py 0:7                 a line of JSON a frame; only the levels that it lacks
    python benchmarks/street_levels.py 97:132 --fields     the same of fields
    python benchmarks/street_levels.py --write docs/accuracy.md     tables from the results

All coherent bodies are traced by the plan of `auto` at 1 dB, of fields at 0.3 dB, with its reflections and without a
budget; only the knobs differ. Problems and references as in `whole_streets.py`.
"""

from __future__ import annotations

import argparse
import sys
import time
import warnings
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.harness import machine, write_block
from benchmarks.row_files import put_row, read_rows, rows_so_far
from benchmarks.street_scenes import problem
from benchmarks.whole_streets import FINEST, PLAIN, by_plan, echoes, name_of, reference, widest_plan
from scarl_sionna.core.settings.auto import DEFAULT_AUTO
from scarl_sionna.core.settings.sbr import SbrSettings
from scarl_sionna.radar.channel.compose.budget import sbr_settings

RESULTS = Path("docs/figures/data/street_levels.jsonl.xz")
OF_FIELDS = Path("docs/figures/data/field_levels.jsonl.xz")
ROUGH, COARSE, MIDDLE = DEFAULT_AUTO.levels[:3]
BEFORE = COARSE.with_(max_phase=3.0, integration_phase=0.2, return_angle=0.8)
LEVELS = {
    "3 rad, edges 1, three bounces": ROUGH.with_(max_depth=3),
    "3 rad, edges 1 (`auto`, 6 dB)": ROUGH,
    "3 rad, edges 0.25 (3 dB, before)": BEFORE,
    "3 rad, edges 0.125": BEFORE.with_(edge_share=0.125),
    "2 rad, edges 0.125": BEFORE.with_(edge_share=0.125, max_phase=2.0, integration_phase=0.15),
    "1.5 rad, edges 0.125": BEFORE.with_(edge_share=0.125, max_phase=1.5, integration_phase=0.1),
    "1 rad, edges 0.125 (`auto`, 1 dB)": MIDDLE,
    "1 rad, edges 0.0625": MIDDLE.with_(edge_share=0.0625),
    "0.6 rad, edges 0.0625": MIDDLE.with_(edge_share=0.0625, max_phase=0.6),
}
FIELD_LEVELS = {
    "3 rad, edges 0.25, return 0.8 rad (3 dB, before)": sbr_settings(BEFORE),
    "the same, return 1.1 rad": sbr_settings(BEFORE.with_(return_angle=1.1)),
    "2 rad, edges 0.25, return 1.1 rad": sbr_settings(BEFORE.with_(max_phase=2.0, return_angle=1.1)),
    "1.5 rad, edges 0.25, return 1.1 rad (`auto`, 3 dB)": sbr_settings(COARSE),
    "1 rad, edges 0.25, return 1.1 rad": sbr_settings(COARSE.with_(max_phase=1.0)),
    "1.5 rad, edges 0.125, return 1.5 rad": sbr_settings(MIDDLE.with_(max_phase=1.5)),
    "1 rad, edges 0.125, return 1.5 rad (`auto`, 1 dB)": sbr_settings(MIDDLE),
    "1 rad, edges 0.125, all tubes, 3 bounces": PLAIN,
}
SHARE = 0.9


def solve(kind: str, seed: int, line: dict[str, Any] | None = None) -> dict[str, Any]:
    """Return the line of one problem, or one with the levels that it lacks."""
    with problem(kind, seed) as frame:
        plan, bodies = widest_plan(frame, FINEST[kind])
        if line is None:
            level, seconds = reference(kind, seed, frame, plan, bodies)
            line = {"seed": seed, "name": frame.name, "reference_cpu": seconds, "level_db": level, "levels": {}}
        counted = {name_of(frame, number): number for number in bodies if name_of(frame, number) in line["level_db"]}
        for label, knobs in levels_of(kind).items():
            if label in line["levels"]:
                continue
            start = time.process_time()
            paths = by_plan(frame, plan, knobs, True)
            cpu = time.process_time() - start
            found = echoes(paths, bodies)
            line["levels"][label] = {
                "cpu": round(cpu, 2),
                "paths": paths.num_paths,
                "error_db": {name: round(found[n] - line["level_db"][name], 2) for name, n in counted.items()},
            }
        return line


def levels_of(kind: str) -> dict[str, SbrSettings]:
    """Return the knobs that are compared."""
    return FIELD_LEVELS if kind == "field" else {label: sbr_settings(level) for label, level in LEVELS.items()}


def table(kind: str, lines: list[dict[str, Any]]) -> str:
    """Return the block of the page."""
    lines = [line for line in lines if line["level_db"]]
    count = sum(len(line["level_db"]) for line in lines)
    first, last = min(line["seed"] for line in lines), max(line["seed"] for line in lines)
    places = ", ".join(line["name"] for line in lines) if kind == "street" else f"seeds {first} to {last}"
    flag = " --fields" if kind == "field" else ""
    rows = [
        f"{len(lines)} {'frames' if kind == 'street' else 'fields'} ({places}), {count} objects 10 dB over the noise; "
        f"`python benchmarks/street_levels.py {first}:{last + 1}{flag}`, {lines[-1]['machine']}.",
        "",
        "| patches and edges | objects within 3 dB | within 1 dB | problems with 90 % within 3 dB | within 1 dB | "
        "CPU of all [s] |",
        "|---|---|---|---|---|---|",
    ]
    for label in levels_of(kind):
        error = [np.abs(list(line["levels"][label]["error_db"].values())) for line in lines]
        kept = [float(np.sort(one)[int(np.ceil(SHARE * len(one))) - 1]) for one in error]
        everything = np.concatenate(error)
        cpu = sum(line["levels"][label]["cpu"] for line in lines)
        within = [f"{int((everything <= limit).sum())} | " for limit in (3.0, 1.0)]
        frames = [f"{sum(value <= limit for value in kept)} | " for limit in (3.0, 1.0)]
        rows.append(f"| {label} | {''.join(within)}{''.join(frames)}{cpu:.0f} |")
    return "\n".join(rows)


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("seeds", nargs="?", default="0:7", help="first:last, the last not included")
    parser.add_argument("--fields", action="store_true", help="random fields, not frames of the ready scenes")
    parser.add_argument("--out", type=Path, help="results, if not those of the page")
    parser.add_argument("--write", type=Path, metavar="PAGE")
    arguments = parser.parse_args()
    if arguments.write is not None:
        for kind, block, results in (("street", "street levels", RESULTS), ("field", "field levels", OF_FIELDS)):
            write_block(arguments.write, block, table(kind, sorted(read_rows(results), key=lambda line: line["seed"])))
        return
    kind = "field" if arguments.fields else "street"
    results = arguments.out or (OF_FIELDS if arguments.fields else RESULTS)
    lines = rows_so_far(results)
    warnings.simplefilter("ignore")
    for seed in range(*map(int, arguments.seeds.split(":"))):
        old = next((line for line in lines if line["seed"] == seed), None)
        if old is not None and all(label in old["levels"] for label in levels_of(kind)):
            continue
        line = {**solve(kind, seed, old), "machine": machine()}
        put_row(results, line, "seed")
        print(line["name"], f"reference {line['reference_cpu']:.0f} s", flush=True)


if __name__ == "__main__":
    main()
