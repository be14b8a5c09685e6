"""Whether `auto` solves any frame: random places, variants, scenarios, seeds, times, radars, tolerances and budgets.

    python benchmarks/many_frames.py 0:504 --out frames.jsonl     a line of JSON a frame; goes on where it stopped
    python benchmarks/many_frames.py --report frames.jsonl        counts, and what failed

A frame fails if it raises anything, gives paths that are not finite, or an object whose echo is `ABSURD_DB` over the
bound of `auto` (a flat plate or an image; rough classes 10 dB above their mean), with the antenna at its best. A radar
that stands inside a body by chance is to be refused. Paths only: nothing is synthesised. Each frame can be made again
from its seed; `FRAMES` consecutive ones share a world.
"""

from __future__ import annotations

import argparse
import sys
import time
import traceback
import warnings
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

import scarl_sionna as ss
from benchmarks.row_files import append_rows, read_rows, rows_so_far
from benchmarks.street_scenes import PLACES
from benchmarks.whole_streets import echoes
from scarl_sionna.core.errors import PlacementError
from scarl_sionna.core.settings.auto import DEFAULT_AUTO
from scarl_sionna.engine.world import World, WorldState
from scarl_sionna.radar.channel.compose.budget import estimate
from scarl_sionna.radar.paths import RadarPaths
from scarl_sionna.scenario.spec.scenario import ScenarioSpec, scenario_names
from scarl_sionna.signal.antenna import boresights, largest_field_gain
from scarl_sionna.simulation import load_world

FRAMES = 6
"""Consecutive seeds that share a world: loading it costs as much as a small frame."""
VARIANTS = 12
PRESETS = ("awr1843boost", "awr1843boost_3d")
DRAFT_BUDGET = 50_000
"""Tubes: the most of most frames."""
LARGE_SHARE = 0.05
"""Of frames with more tubes, up to the default budget, which take minutes."""
GAP = 0.3
"""Between the ego's box and the radar [m]."""
ABSURD_DB = 20.0
"""The bound is that of a flat plate seen straight: a corner or a ghost in phase may be some decibels over it."""


def problem(seed: int) -> dict[str, Any]:
    """Return the choices of a seed, as plain data."""
    number = seed // FRAMES
    sources = (*PLACES, *scenario_names())
    name = sources[number % len(sources)]
    of_world, rng = np.random.default_rng([4, number]), np.random.default_rng([4, number, seed])
    world: dict[str, Any] = {"source": name, "seed_of_world": int(of_world.integers(1000))}
    first, last = 0.0, 8.0
    if name in PLACES:
        world |= {"variant": int(of_world.integers(VARIANTS))}
        world |= {"detail": str(of_world.choice(["light", "detailed"]))}
    else:
        spec = ScenarioSpec.preset(name)
        first = spec.start_time
        last = first + float(spec.duration or last)
    chosen = {
        "seed": seed,
        **world,
        "time": float(np.round(rng.uniform(first, last), 3)),
        "height": float(np.round(rng.uniform(0.3, 1.5), 2)),
        "yaw": float(np.round(rng.choice([0.0, 0.0, np.pi / 2.0, np.pi, rng.uniform(-np.pi, np.pi)]), 3)),
        "pitch": float(np.round(rng.choice([0.0, 0.0, rng.uniform(-0.3, 0.3)]), 3)),
        "preset": str(rng.choice(PRESETS)),
        "tolerance_db": float(rng.choice([6.0, 3.0, 1.0, 1.0, 0.3])),
        "budget": int(rng.choice([0, DRAFT_BUDGET, int(10.0 ** rng.uniform(2.0, np.log10(DRAFT_BUDGET)))])),
        "max_distance": None if rng.uniform() < 0.3 else float(np.round(rng.uniform(10.0, 80.0), 1)),
    }
    most = ss.Accuracy().tube_budget
    if rng.uniform() < LARGE_SHARE:
        chosen["budget"] = int(rng.choice([most, int(10.0 ** rng.uniform(np.log10(DRAFT_BUDGET), np.log10(most)))]))
    return chosen


@lru_cache(maxsize=1)
def _world(source: str, seed: int, variant: int, detail: str) -> World:
    if source in PLACES:
        return ss.load_scene(source, variant=variant, detail=detail)
    return load_world(ScenarioSpec.preset(source).with_(seed=seed))


def frame(chosen: dict[str, Any]) -> tuple[WorldState, ss.RadarSpec, ss.Mount]:
    """Return the state, the radar and its mount."""
    world = _world(
        chosen["source"], chosen["seed_of_world"], chosen.get("variant", 0), chosen.get("detail", "detailed")
    )
    state, radar = world.at(chosen["time"]), ss.RadarSpec.preset(chosen["preset"])
    ego = next(info for info in world.instances.values() if info.name == "ego")
    ahead = np.array([np.cos(chosen["yaw"]), np.sin(chosen["yaw"])])
    out = (ego.size[:2] / 2.0 + GAP) / np.maximum(np.abs(ahead), 1e-9)
    x, y = ego.frame_from_box.position[:2] + ahead * out.min()
    pose = ss.Pose.from_euler([x, y, chosen["height"]], chosen["yaw"])
    return state, radar, state.mount("ego", pose.compose(ss.Pose.from_euler([0.0, 0.0, 0.0], pitch=chosen["pitch"])))


def over_bound(state: WorldState, radar: ss.RadarSpec, mount: ss.Mount, paths: RadarPaths) -> tuple[float, str]:
    """Return how far the object that is most over its bound is over it [dB], and its name.

    The antenna is taken at its best, since mirrors show objects in other directions. Mirrors themselves do not count:
    what is seen over them begins with them.
    """
    mirrors = set(paths.diagnostics["plan"]["mirrors"])
    numbers = sorted(set(np.unique(paths.instance).tolist()) - mirrors - {-1})
    level = echoes(paths, numbers, radar) if numbers else {}
    best = float(largest_field_gain(radar.array, boresights(radar.array)).max())
    found = []
    for number in numbers:
        item = estimate(state, radar, mount.pose, number, np.inf)
        if item.distance > DEFAULT_AUTO.too_near:
            class_db = item.level_db(best / item.distance)  # mean of its class, with the best gain
            bound = class_db + item.bound_db - item.expected_db
            found.append((level[number] - bound, item.name))
    return max(found, default=(-300.0, ""))


def solve(chosen: dict[str, Any]) -> dict[str, Any]:
    """Return the line of a frame."""
    start = time.process_time()
    line: dict[str, Any] = dict(chosen)
    try:
        state, radar, mount = frame(chosen)
        paths = ss.solve_paths(
            state,
            radar,
            mount,
            num_rays=100_000,
            max_distance=chosen["max_distance"],
            channel_tolerance_db=chosen["tolerance_db"],
            tube_budget=chosen["budget"],
        )
        whole = bool(
            np.isfinite(paths.a).all() and np.isfinite(paths.length).all() and np.isfinite(paths.length_rate).all()
        )
        over, name = over_bound(state, radar, mount, paths)
        line |= {"paths": paths.num_paths, "met": paths.diagnostics["met"], "finite": whole}
        line |= {"over_bound_db": round(over, 1), "over_bound": name}
    except PlacementError as error:
        line |= {"refused": str(error)}
    except Exception as error:  # what is looked for
        line |= {"error": f"{type(error).__name__}: {error}", "where": traceback.format_exc(limit=-3)}
    return {**line, "cpu": round(time.process_time() - start, 2)}


def what_failed(line: dict[str, Any]) -> str | None:
    """Return what is wrong with a frame, or None."""
    if "error" in line:
        return str(line["error"])
    if "refused" in line:
        return None
    if not line["finite"]:
        return "paths that are not finite"
    if line["over_bound_db"] > ABSURD_DB:
        return f"'{line['over_bound']}' is {line['over_bound_db']:.1f} dB over its bound"
    return None


def report(file: Path) -> str:
    """Return what happened."""
    lines = read_rows(file)
    failed = [(line["seed"], why) for line in lines if (why := what_failed(line)) is not None]
    cpu = [line["cpu"] for line in lines]
    most = max((line["over_bound_db"] for line in lines if "paths" in line), default=-300.0)
    refused = sum("refused" in line for line in lines)
    sources = len({line["source"] for line in lines})
    text = (
        f"{len(lines)} frames of {sources} places and scenarios, {len(failed)} failed, {refused} with the radar inside "
        f"a body refused; largest echo over its bound {most:.1f} dB; CPU with the scene's loading, median "
        f"{np.median(cpu):.1f} s, sum {sum(cpu) / 60.0:.0f} min"
    )
    return "\n".join([text, *(f"seed {seed}: {why}" for seed, why in failed)])


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("seeds", nargs="?", default="0:504", help="first:last, the last not included")
    parser.add_argument("--out", type=Path, default=Path("frames.jsonl"))
    parser.add_argument("--report", type=Path, metavar="FILE")
    arguments = parser.parse_args()
    if arguments.report is not None:
        print(report(arguments.report))
        return
    warnings.simplefilter("ignore")
    done = {line["seed"] for line in rows_so_far(arguments.out)}
    for seed in range(*map(int, arguments.seeds.split(":"))):
        if seed in done:
            continue
        line = solve(problem(seed))
        append_rows(arguments.out, line)
        if (why := what_failed(line)) is not None:
            print(seed, line["source"], why, flush=True)


if __name__ == "__main__":
    main()
