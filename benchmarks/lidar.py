"""Lidar: time of scans and maps, what sub-rays buy, precision against the Cramer-Rao bound, reach in fog and rain.

    python benchmarks/lidar.py [--scene highway_guardrail] [--figures docs/figures] [--quick]

Prints markdown tables. Each time is the median of repeated runs after two warm-ups in this process ("warm"); the first
run is given apart ("cold", with kernel compilation); CPU seconds count all threads.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any

import numpy as np
from harness import machine, measure, peak_memory

from camera_lidar import Lidar
from camera_lidar.lidar import (
    camera_maps,
    detection_probability,
    mean_cnr,
    range_deviation,
    range_view,
    threshold,
    velocity_deviation,
)
from camera_lidar.lidar.heterodyne import receive_heterodyne
from camera_lidar.lidar.heterodyne.beat import estimate_beats, synthesize_beats
from camera_lidar.lidar.returns import Echoes
from scarl_sionna.core.mount import Mount
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.specs.atmosphere import Atmosphere
from scarl_sionna.core.specs.camera import CameraSpec
from scarl_sionna.core.specs.lidar.receiver import HeterodyneReceiver
from scarl_sionna.core.specs.lidar.spec import LidarSpec
from scarl_sionna.engine.load import load_scene

FRONT = Pose([2.45, 0.0, 0.7])  # vehicle_from_sensor: in the middle of the front bumper
ROOF = Pose([0.0, 0.0, 2.0])
MILLION = LidarSpec(num_azimuth=4000, num_elevation=250)
WEATHERS = {
    "clear": Atmosphere(),
    "rain 25 mm/h": Atmosphere(rain_rate=25.0),
    "fog 500 m": Atmosphere(visibility=500.0),
    "fog 100 m": Atmosphere(visibility=100.0),
}


class Place:
    """A lidar's place on the ego vehicle at one time."""

    def __init__(self, state: Any, mount: Pose) -> None:
        ego = state.world.ego
        vehicle, twist = state.actor_pose(ego), state.actor_twist(ego)
        self.state, self.pose = state, vehicle.compose(mount)
        self.twist = Twist(twist.velocity_at(vehicle.rotate(mount.position)), twist.angular)

    def scan(self, spec: LidarSpec) -> Any:
        """Return a scan from here; always with the same random numbers."""
        return Lidar(spec).observe(self.state, Mount(self.pose, self.twist), np.random.default_rng(0))


def table(title: str, head: tuple[str, ...], rows: list[tuple[str, ...]]) -> None:
    print(f"\n{title}\n\n| {' | '.join(head)} |\n|{'---|' * len(head)}")
    for row in rows:
        print(f"| {' | '.join(row)} |", flush=True)


def time_scans(front: Place, roof: Place, repeats: int) -> None:
    heterodyne = HeterodyneReceiver()
    raw = LidarSpec(
        num_azimuth=50, num_elevation=10, receiver=HeterodyneReceiver(raw_signal=True), max_returns=2, max_surfaces=3
    )
    cases = (
        ("10^6 shots, flash, SCaRL's receiver (default)", front, MILLION),
        ("10^6 shots, heterodyne", front, MILLION.with_(receiver=heterodyne)),
        ("10^6 shots over 0.1 s, heterodyne", front, MILLION.with_(receiver=heterodyne, scan_time=0.1)),
        ("preset spinning_64 on the roof", roof, LidarSpec.preset("spinning_64")),
        ("preset fmcw_forward", front, LidarSpec.preset("fmcw_forward")),
        ("500 shots with raw beats", front, raw),
    )
    rows = []
    for name, place, spec in cases:
        timing = measure(lambda place=place, spec=spec: place.scan(spec), repeats)
        rays, points = spec.num_shots * spec.sub_rays, place.scan(spec).num_points
        rows.append((name, f"{spec.num_shots}", f"{rays}", f"{points}", *seconds(timing)))
    scan, camera = front.scan(MILLION), CameraSpec(width=1280, height=720)
    for name, call in (
        ("range view of the first", lambda: range_view(scan)),
        ("camera maps of the first, 1280 x 720", lambda: camera_maps(scan, camera, front.pose)),
    ):
        rows.append((name, "", "", f"{scan.num_points}", *seconds(measure(call, repeats))))
    table("Times", ("what", "shots", "rays", "returns", "cold [s]", "warm [s]", "CPU [s]"), rows)


def seconds(timing: Any) -> tuple[str, str, str]:
    return f"{timing.cold:.2f}", f"{timing.wall:.3f}", f"{timing.cpu:.2f}"


def sub_ray_quality(front: Place, repeats: int) -> None:
    """Print how far the power of the strongest returns is from that with 256 rays, against time."""
    spec = LidarSpec(num_azimuth=300, num_elevation=60, max_surfaces=4, max_returns=2, beam_divergence=1e-3)
    reference = power_of_first(front.scan(spec.with_(sub_rays=256)), spec)
    seen = reference > 0.0
    rows = []
    for number in (1, 3, 5, 9, 17, 33, 65):
        some = spec.with_(sub_rays=number)
        timing = measure(lambda some=some: front.scan(some), repeats)
        power = power_of_first(front.scan(some), spec)
        both = seen & (power > 0.0)
        error = 10.0 * np.log10(power[both] / reference[both])
        off = np.mean(np.abs(error) > 1.0) * 100.0
        missing = np.mean(power[seen] == 0.0) * 100.0
        rows.append((str(number), f"{error.std():.2f}", f"{off:.1f}", f"{missing:.2f}", f"{timing.cpu:.2f}"))
    head = ("sub_rays", "rms error of the power [dB]", "off by > 1 dB [%]", "lost [%]", "CPU [s]")
    table(f"Sub-rays: strongest return against 256 rays, {spec.num_shots} shots of 1 mrad", head, rows)


def power_of_first(scan: Any, spec: LidarSpec) -> np.ndarray:
    power = np.zeros(spec.num_shots)
    np.maximum.at(power, scan.shot, scan.intensity)
    return power


def single_returns(spec: LidarSpec, distance: np.ndarray, velocity: float, cnr: float) -> Echoes:
    """Return one return a shot of a mean carrier-to-noise ratio."""
    one = np.ones(len(distance))
    intensity = cnr / mean_cnr(spec, 1.0, distance)
    number = np.arange(len(distance))
    return Echoes(number, distance, velocity * one, intensity, one, np.zeros((len(distance), 3)), 0 * number)


def precision(shots: int) -> list[tuple[float, ...]]:
    """Print and return errors of raw and statistical estimates in units of the bound, and detection probabilities."""
    receiver = HeterodyneReceiver(speckle=False, saturation_power=None, max_velocity=20.0, sampling_frequency=250e6)
    spec = LidarSpec(
        num_azimuth=shots, num_elevation=1, chirp_time=1e-6, bandwidth=1.5e8, max_distance=120.0, receiver=receiver
    )
    raw = spec.with_(receiver=receiver.with_(raw_signal=True))
    distance = np.random.default_rng(1).uniform(50.0, 70.0, shots)
    results = []
    for seed, cnr_db in enumerate((6.0, 8.0, 10.0, 12.0, 14.0, 16.0, 18.0, 20.0, 25.0, 30.0, 40.0)):
        cnr = 10.0 ** (cnr_db / 10.0)
        true = single_returns(spec, distance, 7.0, cnr)
        signal = synthesize_beats(raw, true, np.zeros(shots), np.random.default_rng(100 + seed))
        found = [estimate_beats(raw, signal, true)]
        found.append(receive_heterodyne(spec, true, np.zeros(shots), np.random.default_rng(200 + seed)))
        row = [cnr_db, float(range_deviation(spec, cnr)), float(velocity_deviation(spec, cnr))]
        for one in found:
            kept = one.echo >= 0
            errors = one.distance[kept] - distance[one.shot[kept]], one.radial_velocity[kept] - 7.0
            row += [float(np.std(error)) if np.count_nonzero(kept) >= 50 else np.nan for error in errors]
            row.append(np.count_nonzero(kept) / shots)
        row.append(float(detection_probability(cnr, threshold(spec), 1, False, 2)))
        results.append(tuple(row))
    rows = [
        (
            f"{r[0]:.0f}",
            f"{r[1] * 1e3:.1f}",
            *(f"{r[i] / r[j]:.2f}" for i, j in ((3, 1), (4, 2), (6, 1), (7, 2))),
            f"{r[5]:.3f}",
            f"{r[8]:.3f}",
            f"{r[9]:.3f}",
        )
        for r in results
    ]
    head = (
        "CNR [dB]",
        "bound, range [mm]",
        "raw range",
        "raw velocity",
        "statistical range",
        "statistical velocity",
        "raw Pd",
        "statistical Pd",
        "closed form Pd",
    )
    table(f"Errors in units of the Cramer-Rao bound, {shots} shots of 1 us and 150 MHz, no speckle", head, rows)
    return results


def reach(spec: LidarSpec) -> None:
    """Print at which distance half of the shots on a 10 % target are detected, by weather."""
    distance = np.linspace(1.0, spec.max_distance, 500)
    rows = []
    for name, air in WEATHERS.items():
        some = spec.with_(atmosphere=air)
        cnr = cnr_of_target(some, distance)
        detected = detection_probability(cnr, threshold(some))
        half = distance[detected >= 0.5].max(initial=0.0)
        nothing = single_returns(some, np.zeros(0), 0.0, 1.0)
        air_speed = np.full(some.num_shots, -12.0)
        found = receive_heterodyne(some, nothing, air_speed, np.random.default_rng(1))
        near = len(np.unique(found.shot)) / some.num_shots
        right = np.mean(np.abs(found.radial_velocity + 12.0) < 0.5) if near > 1e-3 else np.nan
        loss = some.extinction * 2.0 * 100.0 * 10.0 / np.log(10.0)
        rows.append((name, f"{some.extinction:.2e}", f"{loss:.1f}", f"{half:.0f}", f"{near:.2g}", f"{right:.2f}"))
    head = (
        "weather",
        "extinction [1/m]",
        "loss to 100 m and back [dB]",
        "Pd 0.5 up to [m]",
        "shots with a return from the air",
        "of them within 0.5 m/s of the air",
    )
    table("Reach of fmcw_forward on a 10 % target, one look", head, rows)


def cnr_of_target(spec: LidarSpec, distance: np.ndarray) -> np.ndarray:
    return mean_cnr(spec, 0.1 * np.exp(-2.0 * spec.extinction * distance) / distance**2, distance)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scene", default="highway_guardrail")
    parser.add_argument("--time", type=float, default=0.5, help="[s]")
    parser.add_argument("--figures", type=Path, default=None, help="folder for the figures")
    parser.add_argument("--quick", action="store_true", help="fewer repeats and shots")
    options = parser.parse_args()
    started = time.perf_counter()
    world = load_scene(options.scene)
    state = world.at(options.time)
    front, roof = Place(state, FRONT), Place(state, ROOF)
    print(machine())
    print(f"scene {world.name}, {len(world.parts.name)} parts")
    repeats = 2 if options.quick else 5
    time_scans(front, roof, repeats)
    sub_ray_quality(front, 1 if options.quick else 3)
    results = precision(500 if options.quick else 4000)
    reach(LidarSpec.preset("fmcw_forward"))
    if options.figures:
        import lidar_figures

        options.figures.mkdir(parents=True, exist_ok=True)
        lidar_figures.draw(options.figures, front, roof, results, WEATHERS, cnr_of_target)
    print(f"\n{time.perf_counter() - started:.0f} s in all, peak memory {peak_memory():.2f} GiB")


if __name__ == "__main__":
    main()
