"""Time and memory of a whole synchronized frame: all sensors of a rig, stage by stage.

    python benchmarks/frame.py [--rig scarl] [--quality draft] [--frames 3] [--scene highway_guardrail]

The first frame holds kernel compilation; the others, at later times, are warm.
"""

from __future__ import annotations

import argparse
import time
import warnings

import numpy as np
from harness import machine, peak_memory

import scarl_sionna as ss
from scarl_sionna.core.errors import ScarlWarning


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rig", default="scarl")
    parser.add_argument("--quality", default="draft", choices=("draft", "full"))
    parser.add_argument("--frames", type=int, default=3)
    parser.add_argument("--scene", default="highway_guardrail")
    args = parser.parse_args()
    warnings.simplefilter("ignore", ScarlWarning)  # rays between far posts, as the demo reports

    print(machine())
    start = time.perf_counter()
    world = ss.load_scene(args.scene)
    rig = ss.Rig.preset(args.rig, args.quality)
    print(
        f"load {args.scene}: {time.perf_counter() - start:.2f} s, {len(world.parts.name)} parts; "
        f"{len(rig.sensors)} sensors"
    )
    rows = []
    for index in range(args.frames):
        wall, cpu = time.perf_counter(), time.process_time()
        frame = ss.observe(world, rig, time=0.1 * index, seed=0, index=index)
        wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
        stages = ", ".join(f"{name} {seconds:.2f} s" for name, seconds in frame.timings.items())
        rows.append((wall, cpu))
        print(f"frame {index}: {wall:6.2f} s wall, {cpu:6.2f} s CPU ({stages})", flush=True)
    if len(rows) > 1:
        warm = np.median(rows[1:], axis=0)
        print(f"warm frame: {warm[0]:.2f} s wall, {warm[1]:.2f} s CPU (median of {len(rows) - 1})")
    print(f"peak memory: {peak_memory():.2f} GiB")


if __name__ == "__main__":
    main()
