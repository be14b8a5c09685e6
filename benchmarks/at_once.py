"""What several processes that make frames at once cost each other, against one alone: the floor of an export's workers.

    python benchmarks/at_once.py [--part suite-highway] [--rounds 4] [--frames 4] [--threads 2 1]
    python benchmarks/at_once.py --start        (what the start of a process takes, step by step)

For each number of the engine's threads two processes are started that make the warm frames of a part of
``benchmarks/parts.py``, the same ones, with nothing between them. In turn the first makes them alone, then both at
once, then the second alone; so `--rounds` times, all numbers of threads in each round. Printed are medians a frame and
process: CPU seconds, those of the user, of the system and of the main thread, and page faults.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import time
import warnings
from typing import Any

import numpy as np
from harness import machine
from parts import PARTS

import scarl_sionna.engine.threads as engine_threads
from scarl_sionna.core.errors import ScarlWarning

COLUMNS = ("cpu", "user", "system", "main", "faults", "wall")
WARM_UP = 3
"""Frames before the first that counts: images are recorded in three of them."""

START = """
import resource, warnings
def lap(step, before=[0.0]):
    spent = resource.getrusage(resource.RUSAGE_SELF)
    now = spent.ru_utime + spent.ru_stime
    print(f"| {step} | {now - before[0]:.2f} |", flush=True)
    before[0] = now
warnings.simplefilter("ignore")
import distributed
lap("Python and Dask")
from scarl_sionna.batch.job import make_shard
from scarl_sionna.engine.threads import limit_threads
from scarl_sionna.scenario.spec.scenario import ScenarioSpec
from scarl_sionna.simulation import load_world, observe, resolve_rig
lap("our imports, SciPy among them")
limit_threads(2)
lap("engine")
scenario = ScenarioSpec(quality="draft", num_frames=8, name="drive")
rig, world = resolve_rig(scenario), load_world(scenario)
lap("scene")
for index in range(5):
    observe(world, rig, 0.1 * index, 0, index=index)
    lap(f"frame {index}")
"""
"""What a worker of an export does until it is warm."""


def child(part: str, threads: int, frames: int) -> None:
    """Make frames whenever a line comes in, and answer with what each took."""
    warnings.simplefilter("ignore", ScarlWarning)
    call = PARTS[part]()
    engine_threads.LEAST = 1  # no image is written here
    engine_threads.limit_threads(threads)
    for index in range(WARM_UP):
        call(index)
    print("ready", flush=True)
    for _ in sys.stdin:
        rows = []
        for index in range(frames):
            before, start = resource.getrusage(resource.RUSAGE_SELF), (time.thread_time(), time.perf_counter())
            call(WARM_UP + index)
            after, end = resource.getrusage(resource.RUSAGE_SELF), (time.thread_time(), time.perf_counter())
            user, system = after.ru_utime - before.ru_utime, after.ru_stime - before.ru_stime
            faults = after.ru_minflt - before.ru_minflt
            rows.append((user + system, user, system, end[0] - start[0], faults, end[1] - start[1]))
        print(json.dumps(rows), flush=True)


def at_once(children: list[subprocess.Popen[str]]) -> list[list[float]]:
    """Let some children make their frames at once; return what each frame took."""
    for one in children:
        _write(one)
    return [row for one in children for row in json.loads(_read(one))]


def _write(one: subprocess.Popen[str]) -> None:
    assert one.stdin is not None
    one.stdin.write("\n")
    one.stdin.flush()


def _read(one: subprocess.Popen[str]) -> str:
    assert one.stdout is not None
    return one.stdout.readline()


def started(args: argparse.Namespace, threads: int) -> subprocess.Popen[str]:
    """Return a child that is ready."""
    command = [sys.executable, __file__, "--child", str(threads), "--part", args.part, "--frames", str(args.frames)]
    one = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    if _read(one).strip() != "ready":
        raise SystemExit("a child did not start")
    return one


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--part", default="suite-highway", choices=PARTS)
    parser.add_argument("--rounds", type=int, default=4)
    parser.add_argument("--frames", type=int, default=4)
    parser.add_argument("--threads", type=int, nargs="+", default=(2, 1))
    parser.add_argument("--child", type=int, help=argparse.SUPPRESS)
    parser.add_argument("--start", action="store_true", help="only what the start of a process takes")
    args = parser.parse_args()
    if args.start:
        print(machine(), "\n\n| step | CPU [s] |\n|---|---|", flush=True)
        subprocess.run([sys.executable, "-c", START], check=True)
        return
    if args.child is not None:
        child(args.part, args.child, args.frames)
        return
    print(machine(), flush=True)
    pairs = {threads: [started(args, threads) for _ in range(2)] for threads in args.threads}
    found: dict[tuple[int, bool], list[Any]] = {}
    for _ in range(args.rounds):
        for threads, pair in pairs.items():
            for group in (pair[:1], pair, pair[1:]):
                rows = at_once(group)
                found.setdefault((threads, len(group) == 2), []).extend(rows)
                taken = [round(row[0], 2) for row in rows]
                print(f"{threads} threads, {len(group)} at once: CPU {taken} s", flush=True)
    for pair in pairs.values():
        for one in pair:
            one.communicate()
    print(f"\n| {args.part}, threads | processes | " + " | ".join(COLUMNS) + " | CPU to one alone |")
    print("|---|---|" + "---|" * (len(COLUMNS) + 1))
    for (threads, both), rows in found.items():
        median = np.median(rows, axis=0)
        alone = float(np.median(found[threads, False], axis=0)[0])
        cells = [
            f"{value:.0f}" if name == "faults" else f"{value:.3f}" for name, value in zip(COLUMNS, median, strict=True)
        ]
        print(f"| {threads} | {1 + both} | " + " | ".join(cells) + f" | {median[0] / alone:.2f} |")


if __name__ == "__main__":
    main()
