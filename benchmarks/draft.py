"""What the draft quality's tolerance is worth: paths, cells and CPU time at 1 and 6 dB, with as few tubes.

    python benchmarks/draft.py [--times 0.5 3.7] [--reference] [PLACE ...]        (no PLACE: all nine)

The front radar of a draft rig, noise left out. Cells are those 10 dB over the noise of the range-Doppler map, mean over
the channels; by how much they are off at the median, nine of ten of them, and the worst one, from the map at 1 dB, or
with `--reference` from that at 3 dB and 1,000,000 tubes, which takes a minute each.
"""

from __future__ import annotations

import argparse
import sys
import time
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

sys.path.insert(0, str(Path(__file__).parents[1]))

import scarl_sionna as ss
from benchmarks.harness import machine
from benchmarks.street_scenes import PLACES
from scarl_sionna.core.errors import ScarlWarning

SENSOR = ss.Rig.preset("front", "draft")["front_center/radar"]
KNOBS: dict[str, dict[str, Any]] = {
    "1 dB": {"channel_tolerance_db": 1.0},
    "6 dB": {"channel_tolerance_db": 6.0},
    "6 dB, second look": {"channel_tolerance_db": 6.0, "look_share": 0.25},
}
REFERENCE = {"channel_tolerance_db": 3.0, "tube_budget": 1_000_000, "cpu_budget": None}


def solved(state: Any, mount: ss.Mount, **knobs: Any) -> tuple[npt.NDArray[np.float64], dict[str, Any], float, int]:
    """Return the power of the map's cells, the diagnostics, CPU seconds, and the number of warnings."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", ScarlWarning)
        start = time.process_time()
        paths = ss.solve_paths(state, SENSOR.spec, mount, settings=SENSOR.settings, **knobs)
        cpu = time.process_time() - start
    return power(ss.synthesize(paths, SENSOR.spec)), paths.diagnostics, cpu, len(caught)


def power(adc: npt.NDArray[np.complex64]) -> npt.NDArray[np.float64]:
    """Return the power of the cells of a range-Doppler map, mean over the channels."""
    cells = ss.range_doppler(ss.virtual_cube(adc, SENSOR.spec), SENSOR.spec).data
    return np.asarray((np.abs(cells.astype(np.complex128)) ** 2).mean(axis=0))


def noise() -> float:
    """Return the mean power of a cell's noise."""
    nothing = ss.point_targets(
        np.array([[50.0, 0.0, 0.0]]), np.zeros((1, 3)), np.full(1, 1e-30), SENSOR.spec, ss.Pose()
    )
    return float(power(ss.synthesize(nothing, SENSOR.spec, rng=np.random.default_rng(0))).mean())


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("places", nargs="*", metavar="PLACE", choices=[[], *PLACES])
    parser.add_argument("--times", type=float, nargs="+", default=(0.5, 3.7), help="[s]")
    parser.add_argument("--reference", action="store_true")
    args = parser.parse_args()
    least = 10.0 * noise()
    heads = (
        "frame",
        "tolerance",
        "level [dB]",
        "CPU [s]",
        "`met`",
        "warnings",
        "by class",
        "cells off [dB]",
        "power [dB]",
    )
    print(machine(), f"| {' | '.join(heads)} |", "|---" * len(heads) + "|", sep="\n", flush=True)
    for name in args.places or PLACES:
        world = ss.load_scene(name)
        for when in args.times:
            state = world.at(when)
            mount = state.mount(world.ego, SENSOR.vehicle_from_sensor)
            solved(state, mount)  # kernels are compiled
            found = {key: solved(state, mount, **knobs) for key, knobs in KNOBS.items()}
            first = solved(state, mount, **REFERENCE)[0] if args.reference else found["1 dB"][0]
            for key, (cells, says, cpu, count) in found.items():
                seen = first > least
                off = np.abs(10.0 * np.log10(cells[seen] / first[seen])) if seen.any() else np.zeros(1)
                text = ", ".join(f"{value:.2f}" for value in (np.median(off), np.percentile(off, 90), off.max()))
                print(
                    f"| {name} at {when:g} s | {key} | {says['level_db']:g} | {cpu:.1f} | {str(says['met']).lower()} | "
                    f"{count} | {says['num_by_class']} of {says['num_counted']} | {text} | "
                    f"{10.0 * np.log10(cells.sum() / first.sum()):+.1f} |",
                    flush=True,
                )


if __name__ == "__main__":
    main()
