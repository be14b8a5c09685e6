"""Velocities of time division beyond the unambiguous interval: how many points of street frames are in the wrong one.

    python benchmarks/unfolding.py              six streets, a table

Paths by `raycast`, three transmitters in turn, unambiguous within 8.5 m/s. A point counts if paths of one interval
hold four fifths of the power at its range and aliased velocity; it is wrong if its own interval is another one.
"""

from __future__ import annotations

import sys
import time
import warnings
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

import scarl_sionna as ss
from benchmarks.harness import machine
from benchmarks.street_scenes import street
from scarl_sionna.signal.detection import RadarPoints

RADAR = ss.RadarSpec(multiplexing="tdm")
CLEAR = 0.8


def intervals_off(points: RadarPoints, paths: ss.RadarPaths) -> np.ndarray:
    """Return by how many intervals the velocities of points are off, of those with a clear truth."""
    interval = 2.0 * RADAR.unambiguous_velocity
    distance, rate = (
        np.asarray(of).reshape(paths.num_paths, -1)[:, 0] / 2.0 for of in (paths.length, paths.length_rate)
    )
    power = np.abs(np.asarray(paths.a).reshape(paths.num_paths, -1)[:, 0]) ** 2
    found = []
    for place, velocity in zip(points.range, points.radial_velocity, strict=True):
        turns = (rate - velocity) / interval
        here = np.abs(distance - place) < 0.6 * RADAR.range_resolution
        here &= np.abs(turns - np.rint(turns)) * interval < RADAR.velocity_resolution
        if not here.any():
            continue
        number, which = np.unique(np.rint(turns[here]), return_inverse=True)
        held = np.bincount(which, weights=power[here])
        if held.max() > CLEAR * held.sum():
            found.append(number[held.argmax()])
    return np.array(found)


def main() -> None:
    print(machine())
    print("| street | points | beyond the interval [%] | wrong interval [%] | without `unfold` [%] | CPU s |")
    print("|---|---|---|---|---|---|")
    for seed in range(6):
        frame = street(seed)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            paths = ss.solve_paths(frame.state, RADAR, frame.mount, "raycast")
        cube = ss.virtual_cube(ss.synthesize(paths, RADAR, rng=np.random.default_rng(1)), RADAR)
        rda = ss.range_doppler_angle(cube, RADAR)
        start = time.process_time()
        points = ss.detect(rda)
        cpu = time.process_time() - start
        plain = np.mean(intervals_off(ss.detect(rda, unfold=False), paths) != 0)
        wrong = np.mean(intervals_off(points, paths) != 0)
        beyond = np.mean(np.abs(points.radial_velocity) > RADAR.unambiguous_velocity)
        print(
            f"| {frame.name} | {points.num_points} | {100 * beyond:.0f} | {100 * wrong:.1f} | {100 * plain:.1f} |"
            f" {cpu:.2f} |"
        )


if __name__ == "__main__":
    main()
