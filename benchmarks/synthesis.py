"""Beat signal synthesis: error against time.

    python benchmarks/synthesis.py [--paths 100000] [--chart-paths 20000] [--rounds 3] [--figure FILE.png]

One process, interleaved rounds, the fastest of each; the first call apart. Points at random ranges, directions and
radial velocities within +-70 m/s (the hardest case) and within 30 m/s (a drive). CPU seconds stand beside wall seconds,
since another load on the machine changes these most; plain programs for the same numbers: ``benchmarks/anchors.py``.
A lone path is the hardest case for the error, for no other path hides it: it is one path of the chart's group, all
others with no amplitude, so that it goes through the group's transforms. These tables are of straight paths with the
rates of the array's centre (``motion_tolerance=None``), the transforms alone.

``--cascade`` prints the time and the memory of one frame of 192 channels.

A second part, alone with ``--motion``, is of exact motion: a radar that passes points at rest, tolerance of motion
against CPU time and error. Its error is that of lone paths, one pair at the ends of the array, against the exact sum.
"""

from __future__ import annotations

import argparse
import os
import platform
import resource
import time
from collections.abc import Callable
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path

import numpy as np

from scarl_sionna.core.cores import usable_cores
from scarl_sionna.core.mount import Mount
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.settings.accuracy import Accuracy
from scarl_sionna.core.specs.radar.array import HALF_WAVE, AntennaArray, uniform_line
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.specs.radar.waveform import Fmcw
from scarl_sionna.core.specs.radar.waveforms.coded import Ofdm, Pmcw
from scarl_sionna.radar.paths import RadarPaths
from scarl_sionna.radar.points import point_targets
from scarl_sionna.radar.synthesis import synthesize

TOLERANCES = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-8)
NUM_EXACT_CHIRPS = 16
"""Chirps on which many paths are compared with the exact sum; lone paths are compared on the whole frame."""
NUM_LONE = 12
"""Lone paths tried, of the longest, the shortest, the fastest and the slowest each a quarter."""
MOTION_TOLERANCES = (None, 1e-2, 3e-3, 1e-3, 1e-4)
SPEEDS = (0.0, 1.5, 14.0, 30.0)
STRAIGHT = {"motion_tolerance": None}
CASCADE = {
    "fmcw": Fmcw(),
    "ofdm": Ofdm(num_subcarriers=512, cyclic_prefix=2e-6),
    "pmcw": Pmcw(code_length=511, num_chirps=256),
}


def random_points(radar: RadarSpec, count: int, slowest: float, fastest: float) -> RadarPaths:
    """Return points all over the range, moving along the line of sight, with equal received powers."""
    rng = np.random.default_rng(0)
    distance, azimuth = rng.uniform(3.0, 250.0, count), rng.uniform(-1.0, 1.0, count)
    direction = np.stack([np.cos(azimuth), np.sin(azimuth), np.zeros(count)], axis=1)
    velocity = rng.uniform(slowest, fastest, count)[:, None] * direction
    paths = point_targets(distance[:, None] * direction, velocity, 1e-3 * distance**4, radar, Pose())
    return replace(paths, length_acceleration=np.zeros(count))


def timed(call: Callable[[], np.ndarray]) -> tuple[np.ndarray, float, float]:
    """Return the result, wall and CPU seconds."""
    wall, cpu = time.perf_counter(), time.process_time()
    result = call()
    return result, time.perf_counter() - wall, time.process_time() - cpu


def chart(count: int, rounds: int) -> list[tuple[float, float, float, float, float]]:
    """Return tolerance, error over peak, worst of lone paths, wall and CPU seconds of one pair, by the exact sum."""
    radar = RadarSpec().with_(tx_positions=((0.0, 0.0, 0.0),), rx_positions=((0.0, 0.0, 0.0),))
    paths = random_points(radar, count, -70.0, 70.0)
    # the first chirps, at the edge of the frame, have the largest residual phase; a shorter frame has the same samples
    edge = radar.model_copy(update={"num_chirps": NUM_EXACT_CHIRPS})
    exact, wall, cpu = timed(lambda: synthesize(paths, edge, accuracy=Accuracy(**STRAIGHT), method="direct"))
    print(f"exact sum of {count} paths, one pair, first {NUM_EXACT_CHIRPS} chirps: {wall:.2f} s wall, {cpu:.2f} s CPU")
    best = {tolerance: (np.inf, np.inf, np.inf, np.inf) for tolerance in TOLERANCES}
    for _ in range(rounds):
        for tolerance in TOLERANCES:
            accuracy = Accuracy(synthesis_tolerance=tolerance, **STRAIGHT)
            signal, wall, cpu = timed(lambda accuracy=accuracy: synthesize(paths, radar, accuracy=accuracy))
            error = float(np.abs(signal[:, :NUM_EXACT_CHIRPS] - exact).max() / np.abs(signal).max())
            best[tolerance] = (error, 0.0, min(wall, best[tolerance][2]), min(cpu, best[tolerance][3]))
    return [
        (tolerance, error, lone_error(paths, radar, tolerance), wall, cpu)
        for tolerance, (error, _, wall, cpu) in best.items()
    ]


def lone_error(paths: RadarPaths, radar: RadarSpec, tolerance: float) -> float:
    """Return the largest error over the peak of paths alone in their group."""
    by_distance = np.argsort(np.linalg.norm(paths.tx_point, axis=1))
    by_rate = np.argsort(paths.length_rate)
    few = NUM_LONE // 4
    worst = 0.0
    for index in np.concatenate([by_distance[:few], by_distance[-few:], by_rate[:few], by_rate[-few:]]):
        alone = np.zeros_like(paths.a)
        alone[index] = paths.a[index]
        exact = synthesize(paths.select([index]), radar, accuracy=Accuracy(**STRAIGHT), method="direct")
        accuracy = Accuracy(synthesis_tolerance=tolerance, **STRAIGHT)
        fast = synthesize(replace(paths, a=alone), radar, accuracy=accuracy)
        worst = max(worst, float(np.abs(fast - exact).max() / np.abs(exact).max()))
    return worst


def passed_points(radar: RadarSpec, count: int, speed: float) -> RadarPaths:
    """Return points at rest, 3 to 120 m away on all sides ahead, that a radar passes, with equal received powers."""
    rng = np.random.default_rng(0)
    distance, azimuth = rng.uniform(3.0, 120.0, count), rng.uniform(-1.0, 1.0, count)
    direction = np.stack([np.cos(azimuth), np.sin(azimuth), np.zeros(count)], axis=1)
    mount = Mount(Pose(), Twist([speed, 0.0, 0.0]))
    return point_targets(distance[:, None] * direction, np.zeros((count, 3)), 1e-3 * distance**4, radar, mount)


def motion_table(count: int, rounds: int) -> None:
    """Print CPU seconds and errors against the speed and the tolerance of motion."""
    radar = RadarSpec()
    pair = radar.with_(tx_positions=((0.0, -0.0078, 0.0),), rx_positions=((0.0, 0.003, 0.0),))
    rng = np.random.default_rng(1)
    print(f"\n| {count} points at rest | motion_tolerance | CPU [s] | worst of lone points [dB] |\n|---|---|---|---|")
    for speed in SPEEDS:
        paths, few = passed_points(radar, count, speed), passed_points(pair, count // 10, speed)
        if speed == 0.0:
            accuracy = Accuracy()
            cpu = min(timed(lambda p=paths, a=accuracy: synthesize(p, radar, accuracy=a))[2] for _ in range(rounds))
            print(f"| radar at rest | any | {cpu:.2f} | |")
            continue
        nearest = np.argsort(np.linalg.norm(few.tx_point, axis=1))[:4]
        tried = np.concatenate([nearest, rng.integers(0, few.num_paths, 4)])
        for tolerance in MOTION_TOLERANCES:
            accuracy = Accuracy(motion_tolerance=tolerance)
            cpu = min(timed(lambda p=paths, a=accuracy: synthesize(p, radar, accuracy=a))[2] for _ in range(rounds))
            worst = 0.0
            for index in tried:
                alone = np.zeros_like(few.a)
                alone[index] = few.a[index]
                exact = synthesize(few.select([index]), pair, accuracy=Accuracy(motion_tolerance=1e-9), method="direct")
                fast = synthesize(replace(few, a=alone), pair, accuracy=accuracy)
                worst = max(worst, float(np.abs(fast - exact).max() / np.abs(exact).max()))
            print(
                f"| radar at {speed:g} m/s | {tolerance or 'None'} | {cpu:.2f} | {20 * np.log10(worst):.1f} |",
                flush=True,
            )


def cascade_row(name: str, count: int, senders: int) -> None:
    """Print the cost of a frame of 192 channels, of points within 30 m/s, with exact motion; of fewer transmitters."""
    places = uniform_line(12, 16 * HALF_WAVE)
    array = AntennaArray(
        tx_positions=places[:: 11 // (senders - 1) if senders > 1 else 12][:senders],
        rx_positions=uniform_line(16, HALF_WAVE),
        max_array_extent=1.0,
    )
    radar = RadarSpec(waveform=CASCADE[name], array=array)
    paths = random_points(radar, count, -30.0, 30.0)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    signal, wall, cpu = timed(lambda: synthesize(paths, radar))
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    print("| waveform | samples | wall [s] | CPU [s] | peak [GB] | of it before |")
    print("|---|---|---|---|---|---|")
    print(f"| {name} | {' x '.join(map(str, signal.shape))} | {wall:.3g} | {cpu:.3g} | {peak:.2f} | {before:.2f} |")


def machine() -> str:
    """Return what the figures were measured on."""
    parts = [f"{usable_cores()} cores", platform.machine(), f"Python {platform.python_version()}"]
    return ", ".join(parts + [f"{name} {version(name)}" for name in ("numpy", "scipy", "finufft", "sionna-rt")])


def main() -> None:
    """Print the tables and draw the chart."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--paths", type=int, default=100_000)
    parser.add_argument("--chart-paths", type=int, default=20_000)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--figure", type=Path)
    parser.add_argument("--motion", action="store_true", help="only the table of exact motion")
    parser.add_argument("--cascade", choices=CASCADE, help="only a frame of 12 x 16 antennas with a waveform")
    parser.add_argument("--senders", type=int, default=12, help="of these antennas, for a part of that frame")
    options = parser.parse_args()
    radar = RadarSpec()
    print(machine(), f"load {os.getloadavg()[0]:.1f}")
    if options.cascade:
        cascade_row(options.cascade, options.paths, options.senders)
        return
    if options.motion:
        motion_table(options.paths, options.rounds)
        return

    cases = {"+-70 m/s": (-70.0, 70.0), "-30..0 m/s": (-30.0, 0.0)}
    rows: dict[str, list[tuple[float, float]]] = {}
    for _ in range(options.rounds):
        for label, (slowest, fastest) in cases.items():
            paths = random_points(radar, options.paths, slowest, fastest)
            for tolerance in (1e-4, 1e-5):
                accuracy = Accuracy(synthesis_tolerance=tolerance, **STRAIGHT)
                _, wall, cpu = timed(lambda p=paths, a=accuracy: synthesize(p, radar, accuracy=a))
                name = f"fast, {label}, tolerance {tolerance:g}"
                rows.setdefault(name, []).append((wall, cpu))
    print(
        f"\n| {options.paths} paths, 12 channels, "
        "512 x 256 | first [s] | fastest wall [s] | CPU [s] |\n|---|---|---|---|"
    )
    for name, values in rows.items():
        print(f"| {name} | {values[0][0]:.3g} | {min(v[0] for v in values):.3g} | {min(v[1] for v in values):.3g} |")
    print(f"\npeak memory {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6:.2f} GB\n")

    points = chart(options.chart_paths, options.rounds)
    print("\n| tolerance | error over peak [dB] | of lone paths [dB] | wall [s] | CPU [s] |\n|---|---|---|---|---|")
    for tolerance, error, lone, wall, cpu in points:
        print(f"| {tolerance:g} | {20 * np.log10(error):.1f} | {20 * np.log10(lone):.1f} | {wall:.3f} | {cpu:.3f} |")
    if options.figure:
        draw(points, options.chart_paths, options.figure)


def draw(points: list[tuple[float, float, float, float, float]], count: int, file: Path) -> None:
    """Write the work-precision chart."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(6.0, 4.0), layout="constrained")
    cpu = [p[4] for p in points]
    axes.plot(cpu, [20 * np.log10(p[1]) for p in points], "o-", color="tab:blue", label=f"{count} paths")
    axes.plot(cpu, [20 * np.log10(p[2]) for p in points], "s--", color="tab:orange", label="worst of lone paths")
    for tolerance, _, lone, _, seconds in points:
        axes.annotate(f"{tolerance:g}", (seconds, 20 * np.log10(lone)), (6, 4), textcoords="offset points")
    axes.axhline(-80.0, color="tab:red", linewidth=1.0, label="required: -80 dB")
    axes.set(
        xlabel="CPU time [s]",
        ylabel="largest error over peak [dB]",
        title=f"{count} paths within ±70 m/s, one channel, 512 × 256; numbers: tolerance",
    )
    axes.title.set_fontsize(9)
    axes.legend()
    axes.grid(alpha=0.3)
    file.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(file, dpi=150)


if __name__ == "__main__":
    main()
