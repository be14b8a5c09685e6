"""Camera: time of every image, and the error of the RGB image against time.

    python benchmarks/optical.py [--scene highway_guardrail] [--figures docs/figures] [--quick]

Each time is the median of repeated runs after two warm-ups in this process ("warm"); the first run is given apart ("cold",
with kernel compilation). The error of an image is its rms difference to a 1024-sample reference with another seed, in levels
of the 8-bit sRGB image, which is what a user sees; the reference's own error is taken out in quadrature.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any

import numpy as np
from harness import Timing, machine, measure

from camera_lidar import Camera
from camera_lidar.camera.render import integrator_dict, sensor_dict, stratified_samples
from camera_lidar.camera.tone import linear_to_srgb8
from scarl_sionna.core.camera_spec import CameraSpec
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.world import load_scene, variant

FRONT = Pose([2.45, 0.0, 0.7])  # vehicle_from_sensor: in the middle of the front bumper
REFERENCE_SPP = 1024
QUALITY = CameraSpec(width=192, height=108)  # small, so that the reference takes a minute


def report(name: str, timing: Timing, what: str) -> None:
    print(f"{name:44s} {timing}   {what}", flush=True)


def time_sensors(state: Any, world_from_vehicle: Pose, repeats: int) -> None:
    """Print the times of label images, RGB and a frame of six cameras."""
    front = world_from_vehicle.compose(FRONT)

    def observe(sensor: Camera, pose: Pose = front) -> Any:
        return sensor.observe(state, pose, Twist(), np.random.default_rng(0))

    labels = Camera(CameraSpec(width=1280, height=720, images=("depth", "semantic", "instance")))
    report("depth + semantic + instance, 1280 x 720", measure(lambda: observe(labels), repeats), "target 0.5 s")
    for spp in (4, 16):
        rgb = Camera(CameraSpec(samples_per_pixel=spp, images=("rgb",)))
        times = measure(lambda rgb=rgb: observe(rgb), max(1, repeats // 2))
        report(f"RGB 960 x 540, {spp} samples", times, f"{960 * 540 * spp / times.wall / 1e6:.1f} M paths/s")
    draft = Camera(CameraSpec(width=640, height=360, samples_per_pixel=16))
    offsets = [(x, y) for x in (2.45, -2.45) for y in (0.4, 0.0, -0.4)]
    poses = [world_from_vehicle.compose(Pose.from_euler([x, y, 0.7], yaw=0.0 if x > 0 else np.pi)) for x, y in offsets]
    times = measure(lambda: [observe(draft, pose) for pose in poses], 1)
    report("six cameras, all images, 640 x 360, 16 spp", times, "kernels are shared: no compilation for a new pose")


def render(state: Any, spec: CameraSpec, pose: Pose, sampler: str, seed: int) -> tuple[np.ndarray, float]:
    """Return linear radiance and the CPU time of one image with a given sampler: other load on the machine disturbs it least."""
    scene = state.optical_scene()
    with variant.optical() as mi:
        description = sensor_dict(spec, pose)
        description["sampler"]["type"] = sampler
        sensor = mi.load_dict(description)
        integrator = mi.load_dict(integrator_dict(spec))
        start = time.process_time()
        samples = stratified_samples(spec.samples_per_pixel)
        image = np.array(mi.render(scene, sensor=sensor, integrator=integrator, seed=seed, spp=samples))
        return image, time.process_time() - start


def measure_quality(state: Any, pose: Pose, counts: tuple[int, ...]) -> dict[str, list[tuple[int, float, float]]]:
    """Return (samples, rms error [levels], CPU time [s]) of each sampler against the reference."""
    spec = QUALITY
    references = [
        linear_to_srgb8(render(state, spec.with_(samples_per_pixel=REFERENCE_SPP // 2), pose, "multijitter", seed)[0])
        for seed in (101, 102)
    ]
    reference = np.mean(references, axis=0)
    reference_variance = np.mean(np.subtract(*map(np.float64, references)) ** 2) / 4.0  # of the mean of two halves
    print(f"reference: rms {np.sqrt(reference_variance):.2f} levels of its own")
    results: dict[str, list[tuple[int, float, float]]] = {}
    for sampler in ("independent", "multijitter"):
        for count in counts:
            some = spec.with_(samples_per_pixel=count)
            render(state, some, pose, sampler, 0)  # compile: the grid of samples is part of the kernel
            image, seconds = render(state, some, pose, sampler, 7)
            squared = np.mean((linear_to_srgb8(image) - reference) ** 2) - reference_variance
            error = float(np.sqrt(max(squared, 0.0)))
            results.setdefault(sampler, []).append((count, error, seconds))
            print(f"{sampler:12s} {count:5d} samples   error {error:6.2f} levels   {seconds:6.2f} s", flush=True)
    return results


def plot_quality(results: dict[str, list[tuple[int, float, float]]], path: Path) -> None:
    """Draw the work-precision chart."""
    import matplotlib.pyplot as plt
    from matplotlib.ticker import NullFormatter

    figure, axes = plt.subplots(figsize=(6.5, 4.2), layout="constrained")
    for sampler, rows in results.items():
        _, errors, seconds = zip(*rows, strict=True)
        axes.loglog(seconds, errors, "o-", label=f"{sampler}{' (used)' if sampler == 'multijitter' else ''}")
        for count, error, second in rows:
            axes.annotate(str(count), (second, error), textcoords="offset points", xytext=(4, 5), fontsize=8)
    axes.set(
        xlabel=f"CPU time of one image of {QUALITY.width} x {QUALITY.height} [s]",
        ylabel="rms error [levels of 255, sRGB]",
    )
    axes.set_title("RGB image: error against time; numbers: samples a pixel")
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.set_xticks([0.2, 0.5, 1, 2, 5], ["0.2", "0.5", "1", "2", "5"])
    axes.set_yticks([1, 2, 5, 10, 20, 50], ["1", "2", "5", "10", "20", "50"])
    axes.margins(0.08)
    axes.grid(True, which="both", alpha=0.3)
    axes.legend()
    figure.savefig(path, dpi=130)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scene", default="highway_guardrail")
    parser.add_argument("--time", type=float, default=0.5, help="[s]")
    parser.add_argument("--figures", type=Path, default=None, help="folder for the figures")
    parser.add_argument("--quick", action="store_true", help="fewer repeats and no chart of 256 samples")
    options = parser.parse_args()
    world = load_scene(options.scene)
    state = world.at(options.time)
    vehicle = state.actor_pose(world.ego) if world.ego else Pose()
    print(machine())
    print(f"scene {world.name}, {len(world.parts.name)} parts")
    time_sensors(state, vehicle, repeats=2 if options.quick else 5)
    front = vehicle.compose(FRONT)
    results = measure_quality(state, front, (1, 4, 16, 64) if options.quick else (1, 4, 16, 64, 256))
    if options.figures:
        options.figures.mkdir(parents=True, exist_ok=True)
        plot_quality(results, options.figures / "camera_quality.png")


if __name__ == "__main__":
    main()
