"""What finer knobs of `sbr` buy in frames of the ready scenes, object by object.

    python benchmarks/street_levels.py 0:7                 a line of JSON a frame; only the levels that it lacks
    python benchmarks/street_levels.py --write docs/accuracy.md     table from the results

All coherent bodies of a frame are traced by the plan of `auto` at 1 dB, with its reflections and without a budget; only
the knobs differ. Frames and reference as in `whole_streets.py street`.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
import warnings
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.harness import machine, write_block
from benchmarks.street_scenes import street
from benchmarks.whole_streets import RADAR, _by_plan, _name, _plan, echoes, reference
from scarl_sionna.core.settings.auto import DEFAULT_AUTO
from scarl_sionna.radar.channel.compose.budget import sbr_settings
from scarl_sionna.radar.channel.compose.expected_error import expected_errors

RESULTS = Path("docs/figures/data/street_levels.jsonl")
ROUGH, COARSE, MIDDLE = DEFAULT_AUTO.levels[:3]
LEVELS = {
    "3 rad, edges 1, three bounces": ROUGH.with_(max_depth=3),
    "3 rad, edges 1 (`auto`, 6 dB)": ROUGH,
    "3 rad, edges 0.25 (`auto`, 3 dB)": COARSE,
    "3 rad, edges 0.125": COARSE.with_(edge_share=0.125),
    "2 rad, edges 0.125": COARSE.with_(edge_share=0.125, max_phase=2.0, integration_phase=0.15),
    "1.5 rad, edges 0.125": COARSE.with_(edge_share=0.125, max_phase=1.5, integration_phase=0.1),
    "1 rad, edges 0.125 (`auto`, 1 dB)": MIDDLE,
    "1 rad, edges 0.0625": MIDDLE.with_(edge_share=0.0625),
    "0.6 rad, edges 0.0625": MIDDLE.with_(edge_share=0.0625, max_phase=0.6),
}
SHARE = 0.9


def solve(seed: int, line: dict[str, Any] | None = None) -> dict[str, Any]:
    """Return the line of one frame, or one with the levels that it lacks."""
    frame = street(seed)
    plan = _plan(frame, 1.0)
    bodies = sorted({number for share in plan.shares if share.solver == "sbr" for number in share.instances})
    if line is None:
        level, seconds = reference("street", seed, frame, plan, bodies)
        line = {"seed": seed, "name": frame.name, "reference_cpu": seconds, "level_db": level, "levels": {}}
    counted = {_name(frame, number): number for number in bodies if _name(frame, number) in line["level_db"]}
    for label in (label for label in LEVELS if label not in line["levels"]):
        start = time.process_time()
        paths = _by_plan(frame, plan, sbr_settings(LEVELS[label]), True)
        cpu = time.process_time() - start
        found = echoes(paths, bodies)
        expected = expected_errors(paths, RADAR, bodies, DEFAULT_AUTO.errors, LEVELS[label])
        line["levels"][label] = {
            "cpu": round(cpu, 1),
            "paths": paths.num_paths,
            "error_db": {name: round(found[n] - line["level_db"][name], 2) for name, n in counted.items()},
            "expected_db": {name: round(expected.get(n, -1.0), 2) for name, n in counted.items()},
        }
    return line


def table(lines: list[dict[str, Any]]) -> str:
    """Return the block of the page."""
    count = sum(len(line["level_db"]) for line in lines)
    places = ", ".join(line["name"] for line in lines)
    rows = [
        f"{len(lines)} frames ({places}), {count} objects 10 dB over the noise; `python benchmarks/street_levels.py "
        f"{min(line['seed'] for line in lines)}:{max(line['seed'] for line in lines) + 1}`, {lines[-1]['machine']}.",
        "",
        "| patches and edges | objects within 3 dB | within 1 dB | frames with 90 % within 3 dB | within 1 dB | "
        "CPU of all frames [s] |",
        "|---|---|---|---|---|---|",
    ]
    for label in LEVELS:
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
    parser.add_argument("--out", type=Path, default=RESULTS)
    parser.add_argument("--write", type=Path, metavar="PAGE")
    arguments = parser.parse_args()
    lines = [json.loads(line) for line in arguments.out.read_text().splitlines()] if arguments.out.exists() else []
    if arguments.write is not None:
        write_block(arguments.write, "street levels", table(sorted(lines, key=lambda line: line["seed"])))
        return
    warnings.simplefilter("ignore")
    for seed in range(*map(int, arguments.seeds.split(":"))):
        old = next((line for line in lines if line["seed"] == seed), None)
        if old is not None and all(label in old["levels"] for label in LEVELS):
            continue
        line = {**solve(seed, old), "machine": machine()}
        lines = [one for one in lines if one["seed"] != seed] + [line]
        text = "".join(json.dumps(one) + "\n" for one in sorted(lines, key=lambda one: one["seed"]))
        arguments.out.write_text(text)
        print(line["name"], f"reference {line['reference_cpu']:.0f} s", flush=True)


if __name__ == "__main__":
    main()
