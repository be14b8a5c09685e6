"""Time of the raw data, of its forward and of its reverse derivatives.

Run: python -m benchmarks.gradients    (two minutes; the table stands in docs/gradients.md)
"""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter

import numpy as np

import scarl_sionna as ss
from scarl_sionna.radar.gradients import PathModel


def seconds(work: Callable[[], object], repeats: int = 2) -> float:
    """Return the least time of some runs, the first of which makes what is kept."""
    times = []
    for _ in range(repeats):
        start = perf_counter()
        work()
        times.append(perf_counter() - start)
    return min(times)


def traffic(count: int, radar: ss.RadarSpec) -> ss.RadarPaths:
    """Return points of moving traffic over the field of view."""
    rng = np.random.default_rng(0)
    distance, azimuth = rng.uniform(10, 200, count), rng.uniform(-0.7, 0.7, count)
    place = np.column_stack([distance * np.cos(azimuth), distance * np.sin(azimuth), rng.uniform(-1, 1, count)])
    velocity = np.column_stack([rng.uniform(-30, 30, count), rng.uniform(-15, 15, count), np.zeros(count)])
    return ss.point_targets(place, velocity, 1.0, radar, ss.Pose([0, 0, 0.5]))


def main() -> None:
    radar = ss.RadarSpec()
    print("| paths | tolerance | synthesize [s] | value [s] | reverse [s] | (value + reverse) / value |")
    print("|---|---|---|---|---|---|")
    for count, tolerance in ((20, 1e-9), (1000, 1e-4), (1000, 1e-6), (10_000, 1e-4)):
        paths = traffic(count, radar)
        model = PathModel(radar, paths, tolerance)
        plain = seconds(lambda paths=paths: ss.synthesize(paths, radar))
        value = seconds(lambda model=model: model.value(model.start))
        data = model.value(model.start)
        reverse = seconds(lambda model=model, data=data: model.reverse(model.start, data))
        ratio = (value + reverse) / value
        print(f"| {count} | {tolerance:g} | {plain:.2f} | {value:.2f} | {reverse:.2f} | {ratio:.1f} |", flush=True)


if __name__ == "__main__":
    main()
