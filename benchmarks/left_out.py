"""Whether what `auto` says of what it leaves out holds: reflections and bounces that a limit takes, against them all.

    python benchmarks/left_out.py field 300:310

Each problem is solved with everything, at the level of 6 dB, and planned with one mirror, then with three tenths of the
tubes. Of what the plan lacks the strongest echo is printed beside what `left_out` says: bound, estimate.
"""

from __future__ import annotations

import argparse
import sys
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

sys.path.insert(0, str(Path(__file__).parents[1]))

import scarl_sionna as ss
from benchmarks.harness import ANY_COST
from benchmarks.street_scenes import Street, problem
from scarl_sionna.core.units import dbm_to_watt
from scarl_sionna.radar.channel import ChannelPlan, plan_channel, solve_paths
from scarl_sionna.radar.channel.band_mean import mean_power
from scarl_sionna.radar.channel.compose.expected_error import owners
from scarl_sionna.radar.paths import RadarPaths
from scarl_sionna.signal.antenna import boresights, largest_field_gain
from scarl_sionna.signal.noise import angle_cell_noise_power

RADAR = ss.RadarSpec()
UNLIMITED = 10**9


def strongest(paths: RadarPaths, groups: npt.NDArray[np.int64]) -> float:
    """Return the power of the strongest group of paths over the noise of a cell, mean over the band [dB]."""
    gain = float(largest_field_gain(RADAR.array, boresights(RADAR.array)).max()) ** 4
    unit = dbm_to_watt(RADAR.front_end.tx_power_dbm) / angle_cell_noise_power(RADAR) * gain
    _, place = np.unique(groups, axis=0, return_inverse=True)
    place = place.ravel()
    power = mean_power(paths, RADAR, np.arange(len(place)), place, int(place.max()) + 1, 16)
    return float(10.0 * np.log10(max(unit * power.max(), 1e-20)))


def bodies(plan: ChannelPlan) -> set[int]:
    """Return the instances that `sbr` computes."""
    return {int(number) for share in plan.shares if share.solver == "sbr" for number in share.instances}


def said(plan: ChannelPlan, kind: str, words: tuple[str, ...]) -> str:
    """Return what a plan says of a kind of its omissions."""
    entries = [entry for entry in plan.left_out if entry["kind"] == kind and any(w in entry["reason"] for w in words)]
    return "; ".join(f"{entry['bound_to_noise_db']}, {entry['expected_to_noise_db']}" for entry in entries)


def compare(street: Street, whole: RadarPaths, every: ChannelPlan, plan: ChannelPlan) -> dict[str, str]:
    """Return what a plan lacks of all paths, and what it says of it."""
    own, kept = bodies(every), bodies(plan)
    over = {(int(n), int(m)) for s in plan.shares for r in s.reflections for n in r.instances for m in r.mirrors}
    paths = whole.select(np.isin(whole.instance, list(own)).any(axis=1))
    first, last = owners(paths, sorted(own)), owners(paths, sorted(own), last=True)
    chains = [[int(one) for one in row if one >= 0] for row in paths.instance]
    mirrors = [[one for one in chain if one not in own] for chain in chains]
    is_lost = [any((int(at), one) not in over for one in some) for some, at in zip(mirrors, first, strict=True)]
    both = np.isin(first, list(kept)) & np.isin(last, list(kept))
    reflected = np.array(is_lost) & both
    straight = np.array([not some for some in mirrors]) & (first != last) & (paths.depth == 2) & ~both
    found: dict[str, str] = {}
    rows: Mapping[str, Any] = {
        "reflections": (reflected, first[:, None], ("budget", "max_mirrors")),
        "bounces": (straight, np.sort(np.stack([first, last], axis=1), axis=1), ("both computed",)),
    }
    for kind, (some, groups, words) in rows.items():
        if some.any():
            found[kind] = f"{strongest(paths.select(some), groups[some]):.1f} of {said(plan, kind, words)}"
    return found


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("kind", choices=("field", "street"))
    parser.add_argument("seeds", help="first:last, the last not included")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    first, last = map(int, arguments.seeds.split(":"))
    print("strongest that is lacking, of its bound, estimate [dB over the noise of a cell]")
    for seed in range(first, last):
        with problem(arguments.kind, seed) as street:
            options: dict[str, Any] = {"channel_tolerance_db": 6.0, "max_distance": street.reach}
            place = street.state, RADAR, street.mount
            every = plan_channel(*place, tube_budget=UNLIMITED, **options, **ANY_COST)
            reach = {"max_distance": street.reach}
            whole = solve_paths(*place, "hybrid", plan=every, num_rays=2000, **reach, **ANY_COST)
            one = plan_channel(*place, tube_budget=UNLIMITED, mirrors={"max_mirrors": 1}, **options, **ANY_COST)
            few = plan_channel(*place, tube_budget=max(int(0.3 * every.predicted["tubes"]), 1), **options)
            for name, plan in (("one mirror", one), ("0.3 of the tubes", few)):
                print(street.name, name, compare(street, whole, every, plan), flush=True)


if __name__ == "__main__":
    main()
