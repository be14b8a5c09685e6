"""Error against time of one raycast radar frame of highway_guardrail: number of rays, and hits kept of a cell.

    python benchmarks/radar_frame.py [--rays 10000 100000 1000000] [--hits-per-cell 0 8 2] [--figure FILE.png]

Time: the whole sensor (rays, amplitudes, thinning, beat signal, noise, converter), fastest of the repeats after two
warm-ups; the first frame, with kernel compilation, apart. Error: expected power over independent phases in the cells of
a range-azimuth map (12-element line, no window), against four times the rays with every hit kept; cells within 60 dB of
the peak. Both from the same run. ``0`` hits a cell stands for every hit.
"""

from __future__ import annotations

import argparse
import time
import warnings

import numpy as np
import numpy.typing as npt
from harness import machine, peak_memory

import scarl_sionna as ss
from scarl_sionna.core.mount import Mount
from scarl_sionna.radar.paths import RadarPaths
from scarl_sionna.radar.sensor import Radar

RANGES = np.arange(2.0, 80.0, 1.0)
SINES = np.linspace(-0.85, 0.85, 35)


def dirichlet_squared(cycles: npt.NDArray[np.float64], count: int) -> npt.NDArray[np.float64]:
    """Return abs(mean of exp(2j pi n cycles) over n = 0 .. count - 1)**2."""
    cycles = cycles - np.round(cycles)
    with np.errstate(invalid="ignore", divide="ignore"):
        value = (np.sin(np.pi * count * cycles) / (count * np.sin(np.pi * cycles))) ** 2
    return np.where(np.abs(cycles) < 1e-12, 1.0, value)


def expected_map(paths: RadarPaths, radar: ss.RadarSpec) -> npt.NDArray[np.float64]:
    """Return the expected power over range and sine of azimuth, shape (num_ranges, num_sines)."""
    pose = paths.world_from_tx
    offset = pose.inverse().apply(paths.tx_point)
    distance = np.linalg.norm(offset, axis=1)
    unit = offset / distance[:, None]
    gain_db = radar.array.pattern.gain_db(np.arctan2(unit[:, 1], unit[:, 0]), np.arcsin(unit[:, 2]))
    power = np.abs(paths.a[:, 0, 0]) ** 2 * 10.0 ** (gain_db / 5.0)
    beams = np.stack([dirichlet_squared((unit[:, 1] - sine) / 2.0, radar.num_virtual) for sine in SINES], axis=1)
    out = np.zeros((len(RANGES), len(SINES)))
    for row, center in enumerate(RANGES):
        near = np.abs(distance - center) < 8.0 * radar.range_resolution
        response = dirichlet_squared((distance[near] - center) / radar.max_range, radar.num_samples)
        out[row] = (power[near] * response) @ beams[near]
    return out


def draw(results: dict[int, list[tuple[int, float, float]]], file: str) -> None:
    """Draw error against time: one line for each number of hits a cell, one point for each number of rays."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(6.5, 4.2), layout="constrained")
    for hits, points in results.items():
        axes.loglog(
            [p[1] for p in points], [p[2] for p in points], "o-", label=f"{hits} hits a cell" if hits else "every hit"
        )
        for rays, seconds, error in points:
            axes.annotate(f"{rays:.0e} rays", (seconds, error), textcoords="offset points", xytext=(5, 5), fontsize=7)
    axes.set(xlabel="time of a radar frame [s]", ylabel="error of expected power, rms over cells [dB]")
    axes.grid(which="both", alpha=0.3)
    axes.legend()
    figure.savefig(file, dpi=150)


def main() -> None:
    """Run the table, print it, and draw the chart."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scene", default="highway_guardrail")
    parser.add_argument("--rays", type=int, nargs="+", default=[10_000, 100_000, 1_000_000])
    parser.add_argument("--hits-per-cell", type=int, nargs="+", default=[0, 8, 2])
    parser.add_argument("--repeats", type=int, default=2)
    parser.add_argument("--figure")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore", ss.ScarlWarning)  # a coarse grid warns of small objects, as it should

    world = ss.load_scene(arguments.scene)
    start = max(world.time_range[0], 0.0)
    state = world.at(start)
    ego = world.ego
    pose = state.actor_pose(ego).compose(ss.Pose([2.6, 0.0, 0.6])) if ego else ss.Pose([0.0, 0.0, 1.0])
    twist = state.actor_twist(ego) if ego else ss.Twist()
    spec = ss.RadarSpec.preset("awr1843boost")
    finest = ss.solve_paths(
        state, spec, Mount(pose, twist), "raycast", num_rays=4 * max(arguments.rays), hits_per_cell=None
    )
    reference = expected_map(finest, spec)
    strong = reference > reference.max() * 1e-6
    print(machine())
    print(f"{strong.sum()} cells compared")
    print(
        f"{'rays':>9} {'hits/cell':>9} {'paths':>8} {'cold s':>7} {'warm s':>7} {'rms dB':>7} "
        f"{'95 % dB':>8}  stages [s]"
    )
    results: dict[int, list[tuple[int, float, float]]] = {hits: [] for hits in arguments.hits_per_cell}
    for num_rays in arguments.rays:
        for hits in arguments.hits_per_cell:
            settings = ss.RadarSettings.of("raycast", num_rays=num_rays, hits_per_cell=hits or None)
            sensor = Radar(spec, settings)
            runs = []
            for repeat in range(arguments.repeats + 2):
                begin = time.perf_counter()
                frame = sensor.observe(state, Mount(pose, twist), np.random.default_rng(repeat))
                runs.append((time.perf_counter() - begin, frame))
            warm, frame = min(runs[2:], key=lambda run: run[0])
            paths = ss.solve_paths(
                state, spec, Mount(pose, twist), "raycast", num_rays=num_rays, hits_per_cell=hits or None
            )
            found = expected_map(paths, spec)[strong]
            errors = 10.0 * np.log10(np.maximum(found / reference[strong], 1e-3))
            rms, high = float(np.sqrt(np.mean(errors**2))), float(np.percentile(np.abs(errors), 95))
            results[hits].append((num_rays, warm, rms))
            stages = ", ".join(f"{name} {seconds:.2f}" for name, seconds in frame.diagnostics["seconds"].items())
            print(
                f"{num_rays:9d} {hits or 'all':>9} {frame.num_paths:8d} {runs[0][0]:7.2f} "
                f"{warm:7.2f} {rms:7.3f} {high:8.3f}"
                f"  {stages}",
                flush=True,
            )
    print(f"peak memory {peak_memory():.2f} GiB")
    if arguments.figure:
        draw(results, arguments.figure)


if __name__ == "__main__":
    main()
