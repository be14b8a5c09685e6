"""Radar cross section of the vehicles' models at 77 GHz, detailed against light.

Percentiles over azimuth, and CPU time.

python benchmarks/actor_rcs.py [--aspects 36] [--only saloon bus] [--levels light]
    [--table docs/figures/data/actor_rcs.json]

Azimuths are spread over the whole turn, one at a random place of each of as many equal sectors, the same ones at both
levels. The elevation is that of a radar at 0.6 m that looks at a middle 0.3 m higher from 30 m. Settings are those of
16 and 8 wavelengths with three bounces, whose error stands in docs/rcs.md.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import Any

import numpy as np

import scarl_sionna as ss
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.settings.sbr import SbrSettings
from scarl_sionna.core.units import power_to_db
from scarl_sionna.radar.rcs import actor_parts, load_body, scattering_matrix
from scarl_sionna.scene.motion.trajectory import StaticTrajectory

VEHICLES = (
    "small_car", "saloon", "estate", "suv", "pickup", "van", "box_van", "lorry", "articulated_lorry", "bus", "coach",
    "tram",
)  # fmt: skip # a table
FREQUENCY = 77e9
THETA = np.radians(90.6)
SETTINGS = SbrSettings(ray_spacing=16.0, edge_spacing=8.0, bisections=5)


def azimuths(count: int) -> np.ndarray:
    """Return one azimuth in each of `count` equal sectors [rad]."""
    return 2.0 * np.pi * (np.arange(count) + np.random.default_rng(77).uniform(size=count)) / count


def measure(name: str, detail: str, count: int) -> dict[str, Any]:
    """Return percentiles of the RCS [dBsm], VV and HH together, and CPU seconds an aspect."""
    actor = ss.StagedActor("it", name, StaticTrajectory(Pose()), detail=detail)
    world = ss.stage("highway_guardrail", [actor])
    body = load_body(actor_parts(world, "it"))
    phi = azimuths(count)
    start = time.process_time()
    s = scattering_matrix(body, FREQUENCY, THETA, phi, settings=SETTINGS)
    cpu = (time.process_time() - start) / count
    both = power_to_db(4.0 * np.pi * np.abs(np.concatenate([s[:, 0, 0], s[:, 1, 1]])) ** 2)
    azimuth = np.degrees(phi)
    low, median, high = (round(float(v), 2) for v in np.percentile(both, [10, 50, 90]))
    off = np.abs((azimuth + 45.0) % 90.0 - 45.0) > 10.0
    return {
        "model": name,
        "detail": detail,
        "aspects": count,
        "p10": low,
        "median": median,
        "p90": high,
        "median_off_axes": round(float(np.median(both[np.tile(off, 2)])), 2),
        "mean": round(float(power_to_db(np.mean(10 ** (both / 10)))), 2),
        "cpu_s": round(cpu, 2),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--aspects", type=int, default=36)
    parser.add_argument("--only", nargs="*", default=list(VEHICLES))
    parser.add_argument("--levels", nargs="*", default=["detailed", "light"], choices=["detailed", "light"])
    parser.add_argument("--table", type=Path, default=None)
    arguments = parser.parse_args()
    rows = []
    for name in arguments.only:
        for detail in arguments.levels:
            rows.append(measure(name, detail, arguments.aspects))
            print(rows[-1], flush=True)
    if arguments.table is not None:
        arguments.table.write_text(
            json.dumps({"frequency": FREQUENCY, "rows": rows}, indent=1) + "\n", encoding="utf-8"
        )


if __name__ == "__main__":
    main()
