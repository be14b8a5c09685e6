"""Time and memory of one raycast radar frame of highway_guardrail, stage by stage, against the number of rays.

    python benchmarks/radar_frame.py [--rays 100000 1000000] [--repeats 3]

The first frame (kernel compilation, scene into the engine) is reported apart from the following ones. The error of a run is
the difference of its range-Doppler power, summed over each object's paths, from the finest run of the table.
"""

from __future__ import annotations

import argparse
import os
import platform
import resource
import time

import numpy as np

import scarl_sionna as ss
from scarl_sionna.radar.paths import RadarPaths
from scarl_sionna.radar.sensor import Radar


def object_powers(paths: RadarPaths) -> dict[int, float]:
    """Return the received over transmitted power of each instance, for unit gains."""
    power = np.abs(paths.a[:, 0, 0]) ** 2
    return {int(number): float(power[paths.instance[:, 0] == number].sum()) for number in np.unique(paths.instance)}


def main() -> None:
    """Run the table and print it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scene", default="highway_guardrail")
    parser.add_argument("--rays", type=int, nargs="+", default=[10_000, 100_000, 1_000_000])
    parser.add_argument("--repeats", type=int, default=3)
    arguments = parser.parse_args()

    start = time.perf_counter()
    world = ss.load_scene(arguments.scene)
    state = world.at(max(world.time_range[0], 0.0))
    ego = world.ego
    mount = ss.Pose.from_euler([2.6, 0.0, 0.6])
    pose = state.actor_pose(ego).compose(mount) if ego else ss.Pose([0.0, 0.0, 1.0])
    twist = state.actor_twist(ego) if ego else ss.Twist()
    print(f"{platform.processor() or platform.machine()}, {os.cpu_count()} threads; scene loaded in "
          f"{time.perf_counter() - start:.2f} s")  # fmt: skip
    print(f"{'rays':>9} {'paths':>8} {'cold s':>7} {'warm s':>7}  stages of the fastest warm frame [s]")
    powers = {}
    for num_rays in arguments.rays:
        spec = ss.RadarSpec.preset("awr1843boost").with_(num_rays=num_rays)
        sensor = Radar(spec)
        runs = []
        for repeat in range(arguments.repeats + 2):
            begin = time.perf_counter()
            frame = sensor.observe(state, pose, twist, np.random.default_rng(repeat))
            runs.append((time.perf_counter() - begin, frame))
        warm, frame = min(runs[2:], key=lambda run: run[0])
        stages = ", ".join(f"{name} {seconds:.3f}" for name, seconds in frame.diagnostics["seconds"].items())
        print(
            f"{num_rays:9d} {frame.num_paths:8d} {runs[0][0]:7.2f} {warm:7.2f}  {stages}; saturated {frame.num_saturated}"
        )
        powers[num_rays] = object_powers(ss.solve_paths(state, spec, pose, "raycast"))
    finest = powers[max(powers)]
    print("\npower of each object against the finest run [dB]")
    for number, reference in finest.items():
        errors = (10 * np.log10(max(powers[n].get(number, 0.0), 1e-300) / reference) for n in arguments.rays)
        print(f"  {world.instances[number].name:24s}" + "".join(f"{error:10.3f}" for error in errors))
    print(f"peak memory {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20:.2f} GiB")


if __name__ == "__main__":
    main()
