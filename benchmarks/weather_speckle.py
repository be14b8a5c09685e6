"""Is rain speckle? Statistics of range-Doppler-angle cells in pure rain over many frames, by the real processing.

    python benchmarks/weather_speckle.py [frames] [rain rate in mm/h] [ego speed in m/s]

Contrast is E[P^2] / E[P]^2 of a cell, 2 for an exponential power, over cells that hold at least 10 dB more than noise.
False points are what `ss.detect` finds (preset ``awr1843boost``, its noise included, rain up to 120 m).
"""

from __future__ import annotations

import sys
import time
import warnings
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
sys.path.insert(0, str(Path(__file__).resolve().parent))

from harness import machine

import scarl_sionna as ss
from scarl_sionna.core.pose import Twist
from scarl_sionna.radar.weather.clutter import VolumeSampling, volume_clutter
from scarl_sionna.signal.noise import add_noise

RANGES = (10.0, 30.0, 90.0)
REACH = 120.0


def main(frames: int = 200, rate: float = 50.0, speed: float = 0.0) -> None:
    """Print contrast, mean, Doppler width, correlation of neighbouring channels at three ranges, and false points."""
    radar = ss.RadarSpec.preset("awr1843boost")
    mount = ss.Mount(ss.Pose(), Twist(np.array([speed, 0.0, 0.0]), np.zeros(3)))
    weather = ss.Weather(rain_rate=rate)
    points, number, seconds = [], [], 0.0
    first = [0.0] * len(RANGES)
    second = [0.0] * len(RANGES)
    spread: list[list[float]] = [[] for _ in RANGES]
    neighbours: list[list[complex]] = [[] for _ in RANGES]
    for seed in range(frames):
        rng, start = np.random.default_rng(seed), time.process_time()
        paths = volume_clutter(weather, radar, mount, rng, sampling=VolumeSampling(REACH))
        adc = ss.synthesize(paths, radar)
        seconds += time.process_time() - start
        clean = ss.range_doppler_angle(ss.virtual_cube(adc, radar), radar)
        rd = clean.range_doppler
        for index, middle in enumerate(RANGES):
            bins = np.abs(rd.range - middle) < 0.15 * middle
            power = clean.data[:, bins].astype(np.float64)
            first[index] = first[index] + power
            second[index] = second[index] + power**2
            map_power = rd.power[:, bins].astype(np.float64).sum(axis=1)
            mean = map_power @ rd.radial_velocity / map_power.sum()
            spread[index].append(float(map_power @ (rd.radial_velocity - mean) ** 2 / map_power.sum()))
            data = rd.data[..., bins].astype(np.complex128)
            neighbours[index].append(np.vdot(data[:-1], data[1:]) / np.vdot(data[:-1], data[:-1]).real)
        noisy = add_noise(adc, radar, rng)
        points.append(ss.detect(ss.range_doppler_angle(ss.virtual_cube(noisy, radar), radar)).num_points)
        number.append(paths.num_paths)
    print(f"{machine()}\n{frames} frames, {rate:g} mm/h, {speed:g} m/s, {np.mean(number):,.0f} paths, ", end="")
    print(f"{seconds / frames:.2f} CPU s a frame")
    print("| range [m] | cells | E[P^2] / E[P]^2 | Doppler rms [m/s] | neighbouring channels |\n|---|---|---|---|---|")
    floor = 10.0 * clean.noise_power
    for index, middle in enumerate(RANGES):
        mean, square = np.asarray(first[index]) / frames, np.asarray(second[index]) / frames
        loud = mean > floor
        unbiased = (frames * mean[loud] ** 2 - square[loud] / 1.0) / (frames - 1)  # of the squared mean
        ratio = square[loud].mean() / unbiased.mean()
        relative = np.mean(square[loud] / unbiased)
        coefficient = np.mean(neighbours[index])
        print(
            f"| {middle:g} | {loud.sum():,} | {ratio:.2f} (each cell: {relative:.2f}) | "
            f"{np.sqrt(np.mean(spread[index])):.3f} | {coefficient.real:.3f} {coefficient.imag:+.3f}j |"
        )
    print(f"false points a frame: {np.mean(points):.1f} +- {np.std(points) / np.sqrt(frames):.1f}")


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    main(*(kind(value) for kind, value in zip((int, float, float), sys.argv[1:], strict=False)))
