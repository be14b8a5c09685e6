"""Work and precision of the solver `sionna`.

Paths and power found against the number of rays, and the time that it takes.

    python benchmarks/sionna_paths.py [--depth 1 2] [--samples 20000 50000 ...] [--scene highway_guardrail]
    [--diffraction]

The reference is the largest number of rays at the same depth. Times are warm: the second of two solves, one variant
held.
"""

from __future__ import annotations

import argparse
import time
import warnings

import numpy as np

import scarl_sionna as ss
from scarl_sionna.engine import variant
from scarl_sionna.radar.point_scatterers import PointScatterers
from scarl_sionna.radar.points import solve_points


def main() -> None:
    """Print one table a depth."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scene", default="highway_guardrail")
    parser.add_argument("--depth", type=int, nargs="+", default=[1, 2])
    parser.add_argument(
        "--samples", type=int, nargs="+", default=[20_000, 50_000, 100_000, 200_000, 500_000, 1_000_000]
    )
    parser.add_argument("--diffraction", action="store_true")
    arguments = parser.parse_args()
    world = ss.load_scene(arguments.scene)
    state = world.at(max(0.0, world.time_range[0]))
    ego = state.actor_pose(world.ego)
    pose = ego.compose(ss.Pose([5.2, 0.0, 0.6]))
    boxes = [box for box in state.boxes() if box.is_actor and box.name != world.ego]
    points = PointScatterers(
        [box.world_from_box.position + [0, 0, box.size[2] / 2 + 0.3] for box in boxes],
        [box.twist.linear for box in boxes],
        10.0,
    )
    warnings.simplefilter("ignore", ss.ScarlWarning)
    with variant.radio():
        for depth in arguments.depth:
            rows = []
            for count in arguments.samples:
                for _ in range(2):
                    start, busy = time.perf_counter(), time.process_time()
                    paths = solve_points(
                        state,
                        ss.RadarSpec(),
                        pose,
                        points,
                        num_samples=count,
                        max_depth=depth,
                        environment=True,
                        diffraction=arguments.diffraction,
                    )
                    taken, spent = time.perf_counter() - start, time.process_time() - busy
                through = (paths.interaction == 0).any(axis=1)
                power = [float(np.sum(np.abs(paths.a[rows_, 0, 0]) ** 2)) for rows_ in (through, ~through)]
                rows.append((count, paths.num_paths, *power, paths.diagnostics["num_candidates"], taken, spent))
            print(f"\n{world.name}, {len(boxes)} scatterers, max_depth {depth}\n")
            print(
                "| rays | paths | power through scatterers [dB] | power of the environment [dB] "
                "| candidates | wall [s] | CPU [s] |"
            )
            print("|---|---|---|---|---|---|---|")
            for count, number, scattered, own, candidates, taken, spent in rows:
                levels = [
                    f"{10 * np.log10(value / last):.3f}" if value > 0 and last > 0 else "-"
                    for value, last in ((scattered, rows[-1][2]), (own, rows[-1][3]))
                ]
                print(
                    f"| {count:,} | {number} | {levels[0]} | {levels[1]} | {candidates} | {taken:.2f} | {spent:.2f} |"
                )


if __name__ == "__main__":
    main()
