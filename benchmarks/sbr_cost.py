"""What `sbr` is expected to cost before it starts, against what it then takes, in the nine ready scenes.

    python benchmarks/sbr_cost.py [--places highway_guardrail ...] [--distance 20] [--default]

All objects of a scene within a distance, three bounces, the front radar of the README. Memory is the peak beyond what
the process had before. Without `--default` phases, edges and motion are coarser than by default, so that all nine take
some minutes. `--highway`: the expectation alone, for the whole highway with default settings.
"""

from __future__ import annotations

import argparse
import sys
import time
import warnings
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

import scarl_sionna as ss
from benchmarks.harness import ANY_COST, machine
from benchmarks.street_scenes import PLACES
from scarl_sionna.core.settings.radar import RadarSettings
from scarl_sionna.engine.memory import forget_peak, release_memory, resident_bytes
from scarl_sionna.radar.channel.sbr import solve as solver
from scarl_sionna.radar.channel.sbr.bodies import Bodies
from scarl_sionna.radar.channel.sbr.cost import SolveCost, solve_cost

COARSE = {"max_phase": 1.0, "max_turn": 1.0, "integration_phase": 0.1, "edge_share": 0.25}


def prepared(name: str, distance: float | None, knobs: dict[str, float]) -> tuple[Bodies, ss.Mount]:
    """Return the objects of a scene and the radar, after one small solve that compiles the kernels."""
    state, radar = ss.load_scene(name).at(0.5), ss.RadarSpec.preset("awr1843boost")
    mount = state.mount("ego", ss.Pose([2.36, 0.0, 0.8]))
    settings = RadarSettings().changed("sbr", max_distance=distance, **ANY_COST, **knobs)
    chosen = [number for number, info in state.world.instances.items() if info.is_object or info.actor is not None]
    solver.solve_bodies(Bodies(state, radar, settings.with_(max_distance=6.0), chosen), mount)
    return Bodies(state, radar, settings, chosen), mount


def measured(bodies: Bodies, mount: ss.Mount) -> tuple[SolveCost, float, float, float, float]:
    """Return the expected cost and its CPU seconds, then CPU seconds, GiB and tubes of the solve."""
    start = time.process_time()
    expected = solve_cost(bodies, solver.stations_of(bodies.radar, mount))
    estimating = time.process_time() - start
    release_memory()
    before = resident_bytes()[0]
    forget_peak()
    start = time.process_time()
    paths = solver.solve_bodies(bodies, mount)
    seconds = time.process_time() - start
    tubes = float(sum(paths.diagnostics["num_tubes"].values()))
    return expected, estimating, seconds, (resident_bytes()[1] - before) / 2.0**30, tubes


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--places", nargs="+", default=PLACES, choices=PLACES, metavar="PLACE")
    parser.add_argument("--distance", type=float, default=20.0, help="farthest object [m]")
    parser.add_argument("--default", action="store_true", help="default settings")
    parser.add_argument("--highway", action="store_true")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    print(machine())
    if arguments.highway:
        bodies, mount = prepared("highway_guardrail", None, {})
        print(solve_cost(bodies, solver.stations_of(bodies.radar, mount)))
        return
    print(
        "\n| place | tubes, expected / traced | CPU [s], expected / taken | GiB, expected / taken | estimate, CPU [s] |"
    )
    print("|---|---|---|---|---|", flush=True)
    for name in arguments.places:
        expected, estimating, seconds, memory, tubes = measured(
            *prepared(name, arguments.distance, {} if arguments.default else COARSE)
        )
        print(
            f"| {name} | {expected.tubes:,.0f} / {tubes:,.0f} = {expected.tubes / tubes:.2f} "
            f"| {expected.cpu_seconds:.1f} / {seconds:.1f} = {expected.cpu_seconds / seconds:.2f} "
            f"| {expected.memory_gib:.2f} / {memory:.2f} | {estimating:.2f} |",
            flush=True,
        )
        release_memory()


if __name__ == "__main__":
    main()
