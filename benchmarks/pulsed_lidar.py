"""The pulsed receiver: closed form, statistical form and waveforms side by side, reach in weather, time of a scan.

    python benchmarks/pulsed_lidar.py [--figure docs/figures/lidar_pulsed.png]

It prints the tables of docs/lidar.md.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import scarl_sionna as ss
from camera_lidar import Lidar
from camera_lidar.lidar import Detections
from camera_lidar.lidar.pulsed import (
    background_rate,
    density_of_shots,
    detection_probability,
    estimate_waveforms,
    filtered,
    noise_density,
    photoelectrons,
    range_deviation,
    receive_pulsed,
    synthesize_waveforms,
)
from camera_lidar.lidar.pulsed.air import sample_step
from camera_lidar.lidar.pulsed.detection import level_of
from camera_lidar.lidar.returns import Echoes
from scarl_sionna.core.specs.atmosphere import Atmosphere
from scarl_sionna.core.specs.lidar.receiver import PulsedReceiver
from scarl_sionna.core.specs.lidar.spec import LidarSpec

DEVICES = ("hdl32e", "os1_64", "rs_lidar_m1")
WEATHERS = {
    "clear": Atmosphere(),
    "rain 25 mm/h": Atmosphere(rain_rate=25.0),
    "fog, visibility 500 m": Atmosphere(visibility=500.0),
    "fog, visibility 100 m": Atmosphere(visibility=100.0),
}
SHOTS = 2000


def line_of_shots(name: str, number: int, **receiver: object) -> LidarSpec:
    """Return a device that shoots a number of times at one wall."""
    spec = LidarSpec.preset(name)
    assert isinstance(spec.receiver, PulsedReceiver)
    return spec.with_(
        scan=ss.RasterScan(num_azimuth=number, num_elevation=1),
        receiver=spec.receiver.with_(**receiver),
        sub_rays=1,
        max_surfaces=1,
    )


def wall(spec: LidarSpec, reflectance: float, distance: float) -> Echoes:
    """Return a diffuser across the beam in every shot."""
    one = np.ones(spec.num_shots)
    intensity = reflectance * np.exp(-2.0 * spec.extinction * distance) / distance**2 * one
    shots, part = np.arange(spec.num_shots), np.zeros(spec.num_shots, dtype=np.int64)
    return Echoes(shots, distance * one, 0.0 * one, intensity, one, np.zeros((spec.num_shots, 3)), part)


def received(name: str, reflectance: float, distance: float, raw: bool) -> tuple[float, float, float]:
    """Return the share of detected shots, the deviation of their distance [m], and CPU seconds."""
    spec = line_of_shots(name, SHOTS, raw_signal=raw, range_step=0.0, timing_jitter=0.0)
    echoes = wall(spec, reflectance, distance)
    begin = time.process_time()
    density = density_of_shots(spec, echoes, np.array([reflectance]))
    found: Detections
    if raw:
        waveform = synthesize_waveforms(spec, echoes, density, np.random.default_rng(1))
        found = estimate_waveforms(spec, waveform, density, echoes)
    else:
        found = receive_pulsed(spec, echoes, density, np.random.default_rng(2))
    seconds = time.process_time() - begin
    error = found.distance[found.echo >= 0] - distance
    return len(error) / SHOTS, float(np.std(error)), seconds


def expected(name: str, reflectance: float, distance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the closed forms of the share of detected shots and of the deviation of their distance [m]."""
    spec = line_of_shots(name, 1, timing_jitter=0.0)
    density = noise_density(spec, background_rate(spec, reflectance, distance))
    intensity = reflectance * np.exp(-2.0 * spec.extinction * distance) / distance**2
    assert isinstance(spec.receiver, PulsedReceiver)
    spread = np.full(distance.shape, spec.receiver.pulse_deviation)
    peaks = filtered(spec, photoelectrons(spec, intensity, distance), spread, density)
    return detection_probability(spec, reflectance, distance), range_deviation(spec, peaks)


def compare(name: str, reflectance: float, distances: tuple[float, ...]) -> list[tuple[float, ...]]:
    """Print and return closed form, statistical form and waveforms at some distances."""
    rows: list[tuple[float, ...]] = []
    print(f"{name}, diffuser of {reflectance:.0%}")
    print("distance  detected: closed  stat.    raw    std [cm]: closed  stat.   raw   CPU ratio raw/stat.")
    for distance in distances:
        share, deviation = (float(value[0]) for value in expected(name, reflectance, np.array([distance])))
        fast, true = (received(name, reflectance, distance, raw) for raw in (False, True))
        rows.append((distance, share, fast[0], true[0], deviation, fast[1], true[1]))
        print(
            f"{distance:7.0f} {share:16.3f} {fast[0]:7.3f} {true[0]:7.3f} {deviation * 100:17.2f} "
            f"{fast[1] * 100:6.2f} {true[1] * 100:6.2f} {true[2] / fast[2]:12.0f}"
        )
    return rows


def weather_table() -> None:
    """Print how far devices see in weather, and how often the air answers."""
    print("weather                 device        10 % in half of the shots up to   shots with a return from the air")
    far = np.linspace(2.0, 250.0, 2000)
    for weather, air in WEATHERS.items():
        for name in DEVICES:
            spec = line_of_shots(name, SHOTS).with_(atmosphere=air)
            seen = far[detection_probability(spec, 0.1, far) > 0.5].max(initial=0.0)
            black = wall(spec, 1e-9, spec.max_distance)
            found = receive_pulsed(spec, black, noise_density(spec, np.zeros(SHOTS)), np.random.default_rng(3))
            print(f"{weather:22s}  {name:12s} {seen:8.0f} m {np.unique(found.shot).size / SHOTS:36.3f}")


def scan_times() -> None:
    """Print the time of a scan of each device on a street, and with waveforms for a tenth of its shots."""
    state = ss.load_scene("highway_guardrail").at(0.5)
    mount = state.mount("ego", ss.Pose([0.0, 0.0, 1.8]))
    print("device        shots   CPU [s] clear   fog of 100 m")
    for name in DEVICES:
        row = []
        for air in (Atmosphere(), Atmosphere(visibility=100.0)):
            lidar = Lidar(LidarSpec.preset(name).with_(atmosphere=air))
            lidar.observe(state, mount, np.random.default_rng(0))
            begin = time.process_time()
            lidar.observe(state, mount, np.random.default_rng(0))
            row.append(time.process_time() - begin)
        print(f"{name:12s} {lidar.spec.num_shots:7d} {row[0]:12.2f} {row[1]:12.2f}")


def draw(compared: dict[str, list[tuple[float, ...]]], path: Path) -> None:
    """Draw one shot's waveform in fog, and detection and precision over distance."""
    figure, axes = plt.subplots(1, 3, figsize=(14, 4.2), layout="constrained")
    spec = line_of_shots("hdl32e", 1, raw_signal=True).with_(atmosphere=Atmosphere(visibility=100.0))
    echoes = wall(spec, 0.5, 22.0)
    density = density_of_shots(spec, echoes, np.array([0.5]))
    waveform = synthesize_waveforms(spec, echoes, density, np.random.default_rng(4))
    axes[0].plot(np.arange(waveform.shape[1]) * sample_step(spec), waveform[0], lw=0.9)
    axes[0].axhline(float(level_of(spec, density)[0]), color="k", ls="--", lw=1, label="threshold")
    axes[0].set(xlabel="distance [m]", ylabel="photoelectrons", xlim=(0, 40))
    axes[0].set_title("hdl32e, one shot: fog of 100 m, a wall at 22 m")
    for index, (name, rows) in enumerate(compared.items()):
        table = np.array(rows).T
        far = np.linspace(2.0, LidarSpec.preset(name).max_distance, 300)
        share, deviation = expected(name, 0.1, far)
        seen = share > 0.02
        axes[1].plot(far, share, color=f"C{index}", label=f"{name}, 10 %")
        axes[2].semilogy(far[seen], deviation[seen] * 100, color=f"C{index}", label=name)
        for column, style in ((2, "x"), (3, "o")):
            axes[1].plot(table[0], table[column], style, color=f"C{index}", mfc="none")
            axes[2].semilogy(table[0], table[column + 3] * 100, style, color=f"C{index}", mfc="none")
    for axis in axes[1:]:
        axis.plot([], [], "x", color="0.3", label="statistical")
        axis.plot([], [], "o", color="0.3", mfc="none", label="waveforms")
        axis.grid(alpha=0.3)
    axes[1].set(xlabel="distance [m]", ylabel="detection probability, full sun")
    axes[2].set(xlabel="distance [m]", ylabel="standard deviation of the distance [cm]")
    for axis in axes:
        axis.legend(fontsize=8)
    figure.savefig(path, dpi=80)
    plt.close(figure)


def main() -> None:
    """Print all tables, and draw the figure if it is asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--figure", type=Path, default=None, help="where to write the figure")
    options = parser.parse_args()
    compared = {
        "hdl32e": compare("hdl32e", 0.1, (15.0, 30.0, 45.0, 55.0, 65.0)),
        "os1_64": compare("os1_64", 0.1, (10.0, 20.0, 35.0, 42.0, 48.0)),
        "rs_lidar_m1": compare("rs_lidar_m1", 0.1, (40.0, 80.0, 120.0, 155.0, 180.0)),
    }
    weather_table()
    scan_times()
    if options.figure:
        draw(compared, options.figure)


if __name__ == "__main__":
    main()
