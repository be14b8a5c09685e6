"""Whether `auto` solves any frame: random places, variants, times, radars, tolerances and budgets.

    python benchmarks/many_frames.py 0:500 --out frames.jsonl     a line of JSON a frame
    python benchmarks/many_frames.py --report frames.jsonl        counts, and what failed

A frame fails if it raises anything, or gives paths that are not finite. Each frame can be made again from its seed.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
import traceback
import warnings
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

import scarl_sionna as ss
from benchmarks.street_scenes import PLACES

VARIANTS = 12
ONE_VARIANT = ("highway_guardrail", "urban_crossing")
PRESETS = ("awr1843boost", "awr1843boost_3d")
LARGEST_BUDGET = 300_000


def problem(seed: int) -> dict[str, Any]:
    """Return the choices of a seed, as plain data."""
    rng = np.random.default_rng([4, seed])
    return {
        "seed": seed,
        "place": PLACES[seed % len(PLACES)],
        "variant": int(rng.integers(VARIANTS)),
        "time": float(np.round(rng.uniform(0.0, 4.0), 3)),
        "height": float(np.round(rng.uniform(0.3, 1.5), 2)),
        "yaw": float(np.round(rng.choice([0.0, 0.0, np.pi / 2.0, np.pi, rng.uniform(-np.pi, np.pi)]), 3)),
        "pitch": float(np.round(rng.choice([0.0, 0.0, rng.uniform(-0.3, 0.3)]), 3)),
        "preset": str(rng.choice(PRESETS)),
        "tolerance_db": float(rng.choice([3.0, 3.0, 1.0, 0.3])),
        "budget": int(rng.choice([0, int(10.0 ** rng.uniform(2.0, np.log10(LARGEST_BUDGET)))], p=[0.1, 0.9])),
        "max_distance": float(np.round(rng.uniform(10.0, 80.0), 1)),
    }


def solve(chosen: dict[str, Any]) -> dict[str, Any]:
    """Return the line of a frame."""
    start = time.process_time()
    line: dict[str, Any] = dict(chosen)
    try:
        kind = {} if chosen["place"] in ONE_VARIANT else {"variant": chosen["variant"], "detail": "light"}
        state = ss.load_scene(chosen["place"], **kind).at(chosen["time"])
        radar = ss.RadarSpec.preset(chosen["preset"])
        side = 0.0 if abs(np.cos(chosen["yaw"])) > 0.5 else float(np.sign(chosen["yaw"]))
        pose = ss.Pose.from_euler([3.8 * np.cos(chosen["yaw"]), 1.2 * side, chosen["height"]], chosen["yaw"])
        pose = pose.compose(ss.Pose.from_euler([0.0, 0.0, 0.0], pitch=chosen["pitch"]))
        knobs = {"channel_tolerance_db": chosen["tolerance_db"], "tube_budget": chosen["budget"]}
        paths = ss.solve_paths(
            state, radar, state.mount("ego", pose), num_rays=100_000, max_distance=chosen["max_distance"], **knobs
        )
        whole = bool(
            np.isfinite(paths.a).all() and np.isfinite(paths.length).all() and np.isfinite(paths.length_rate).all()
        )
        line |= {"paths": paths.num_paths, "met": paths.diagnostics["met"], "finite": whole}
    except Exception as error:  # what is looked for
        line |= {"error": f"{type(error).__name__}: {error}", "where": traceback.format_exc(limit=-3)}
    return {**line, "cpu": round(time.process_time() - start, 2)}


def report(file: Path) -> str:
    """Return what happened."""
    lines = [json.loads(line) for line in file.read_text().splitlines()]
    failed = [line for line in lines if "error" in line or not line["finite"]]
    cpu = [line["cpu"] for line in lines]
    text = f"{len(lines)} frames, {len(failed)} failed; CPU with the scene's loading, median {np.median(cpu):.1f} s"
    return "\n".join([text, *(f"seed {line['seed']}: {line.get('error', 'not finite')}" for line in failed)])


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("seeds", nargs="?", default="0:500", help="first:last, the last not included")
    parser.add_argument("--out", type=Path, default=Path("frames.jsonl"))
    parser.add_argument("--report", type=Path, metavar="FILE")
    arguments = parser.parse_args()
    if arguments.report is not None:
        print(report(arguments.report))
        return
    warnings.simplefilter("ignore")
    for seed in range(*map(int, arguments.seeds.split(":"))):
        line = solve(problem(seed))
        with arguments.out.open("a") as file:
            file.write(json.dumps(line) + "\n")
        if "error" in line:
            print(seed, line["error"], flush=True)


if __name__ == "__main__":
    main()
