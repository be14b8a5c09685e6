"""Camera: time of every image, and the error of the RGB image against time, with and without denoiser.

    python benchmarks/camera.py [--scene highway_guardrail] [--figures docs/figures] [--quick] [--reference-spp 4096]

Prints markdown tables. Times are medians of repeated runs after warm-ups in this process; CPU seconds of the process
stand beside wall seconds. The error is measured on a small image against a reference of another seed: PSNR and SSIM of
the 8-bit sRGB image, which is what a user sees. All points of the chart come from one run.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from harness import Timing, machine, measure

from camera_lidar import Camera
from camera_lidar.camera import render_rgb
from scarl_sionna.core.mount import Mount
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.specs.camera import CameraSpec, ImageSensor, KannalaBrandt
from scarl_sionna.engine.load import load_scene

FRONT = Pose([2.45, 0.0, 0.7])
"""vehicle_from_sensor: in the middle of the front bumper."""
CHART = CameraSpec(width=160, height=90, images=("rgb",), denoise=False)
QUALITIES = {
    "draft": {"samples_per_pixel": 8, "denoise": True},
    "default": {"samples_per_pixel": 16, "denoise": True},
    "full": {"samples_per_pixel": 256, "denoise": False},
}

Image = npt.NDArray[np.uint8]


def psnr(image: Image, reference: Image) -> float:
    """Return the peak signal-to-noise ratio of 8-bit images [dB]."""
    squared = np.mean((image.astype(np.float64) - reference.astype(np.float64)) ** 2)
    return float(10.0 * np.log10(255.0**2 / max(squared, 1e-9)))


def ssim(image: Image, reference: Image) -> float:
    """Return the structural similarity of the luma of 8-bit images.

    Z. Wang, A. C. Bovik, H. R. Sheikh, E. P. Simoncelli, "Image Quality Assessment: From Error Visibility to Structural
    Similarity", IEEE Trans. Image Processing 13(4), 2004: Gaussian window of 1.5 px, K1 = 0.01, K2 = 0.03.
    """
    from scipy.ndimage import gaussian_filter

    a, b = (picture.astype(np.float64) @ [0.299, 0.587, 0.114] for picture in (image, reference))

    def mean(values: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        return gaussian_filter(values, 1.5, truncate=3.5)

    mean_a, mean_b = mean(a), mean(b)
    covariance = mean(a * b) - mean_a * mean_b
    variance = mean(a * a) - mean_a**2 + mean(b * b) - mean_b**2
    c1, c2 = (0.01 * 255.0) ** 2, (0.03 * 255.0) ** 2
    similar = (2 * mean_a * mean_b + c1) * (2 * covariance + c2)
    return float(np.mean(similar / ((mean_a**2 + mean_b**2 + c1) * (variance + c2))))


def row(name: str, timing: Timing, remark: str = "") -> None:
    """Print a row of the table of times."""
    print(f"| {name} | {timing.cold:.2f} | {timing.wall:.2f} | {timing.cpu:.2f} | {remark} |", flush=True)


def time_images(world: Any, state: Any, pose: Pose, repeats: int) -> None:
    """Print the times of label images, RGB images and their options."""
    print("\n| what | cold [s] | warm, wall [s] | warm, CPU [s] | |\n|---|---|---|---|---|")
    moving = Twist([11.0, 0.0, 0.0])

    def run(spec: CameraSpec, where: Any = state, fresh: bool = False) -> Any:
        shown = world.at(state.time) if fresh else where
        return Camera(spec).observe(shown, Mount(pose, moving), np.random.default_rng(0))

    hd = CameraSpec(width=1280, height=720)
    base = hd.with_(images=("depth", "semantic", "instance"))
    row("depth + semantic + instance, 1280 x 720", measure(lambda: run(base, fresh=True), repeats), "target 0.5 s")
    row("the same rays again (second camera of a suite)", measure(lambda: run(base), repeats))
    every = hd.with_(images=("depth", "semantic", "instance", "normal", "flow"))
    row("all labels with normal and flow, 1280 x 720", measure(lambda: run(every, fresh=True), repeats))
    fisheye = base.with_(lens=KannalaBrandt(k1=-0.02), horizontal_fov_deg=180.0)
    row("depth + semantic + instance, fisheye of 180 deg", measure(lambda: run(fisheye, fresh=True), repeats))
    default = CameraSpec(images=("rgb",))
    few = max(1, repeats // 4)
    row("RGB 960 x 540, default", measure(lambda: run(default), few), "target 10 s")
    row("RGB, 8 samples, denoised", measure(lambda: run(default.with_(samples_per_pixel=8)), few), "draft")
    noisy = default.with_(samples_per_pixel=8, sensor=ImageSensor())
    row("RGB, 8 samples, denoised, image sensor", measure(lambda: run(noisy), few))
    blurred = default.with_(samples_per_pixel=8, exposure_time=0.02)
    row("RGB, 8 samples, denoised, blur of 8 instants", measure(lambda: run(blurred), few))


def chart(state: Any, pose: Pose, counts: tuple[int, ...], reference_spp: int) -> dict[bool, list[tuple[float, ...]]]:
    """Return (samples, PSNR [dB], SSIM, CPU seconds) without and with denoiser, against a reference."""

    def shot(spec: CameraSpec, seed: int) -> tuple[Image, float]:
        start = time.process_time()
        image = render_rgb(state, spec, pose, np.random.default_rng(seed))
        return image, time.process_time() - start

    start = time.process_time()
    reference = shot(CHART.with_(samples_per_pixel=reference_spp), 1)[0]
    print(
        f"\nReference: {reference_spp} samples, {CHART.width} x {CHART.height}, "
        f"{time.process_time() - start:.0f} CPU-s.\n"
    )
    print("| samples | denoiser | PSNR [dB] | SSIM | CPU [s] |\n|---|---|---|---|---|")
    results: dict[bool, list[tuple[float, ...]]] = {False: [], True: []}
    for denoise in (False, True):
        for count in counts:
            spec = CHART.with_(samples_per_pixel=count, denoise=denoise)
            shot(spec, 0)  # compile
            shots = [shot(spec, seed) for seed in (7, 8, 9)]
            entry = (
                float(count),
                float(np.mean([psnr(image, reference) for image, _ in shots])),
                float(np.mean([ssim(image, reference) for image, _ in shots])),
                float(np.median([seconds for _, seconds in shots])),
            )
            results[denoise].append(entry)
            print(
                f"| {count} | {'on' if denoise else 'off'} | {entry[1]:.1f} | {entry[2]:.4f} | {entry[3]:.2f} |",
                flush=True,
            )
    return results


def draw(results: dict[bool, list[tuple[float, ...]]], path: Path) -> None:
    """Draw the work-precision chart, draft, default and full marked."""
    import matplotlib.pyplot as plt
    from matplotlib.ticker import NullFormatter

    figure, panels = plt.subplots(1, 2, figsize=(10.5, 4.2), layout="constrained")
    marks = {(quality["denoise"], quality["samples_per_pixel"]): name for name, quality in QUALITIES.items()}
    for axis, column, label in ((panels[0], 1, "PSNR [dB]"), (panels[1], 2, "SSIM")):
        for denoise, style, place, side in ((False, "o--", (6, -10), "left"), (True, "s-", (-5, 6), "right")):
            rows = np.array(results[denoise])
            axis.semilogx(rows[:, 3], rows[:, column], style, label="denoised" if denoise else "as traced")
            for line in rows:
                name = marks.get((denoise, int(line[0])))
                label_text = f"{line[0]:.0f}" + (f" = {name}" if name else "")
                axis.annotate(
                    label_text, (line[3], line[column]), textcoords="offset points", xytext=place, fontsize=8, ha=side
                )
        axis.set(xlabel=f"CPU time of one image of {CHART.width} x {CHART.height} [s]", ylabel=label)
        axis.set_xticks([0.2, 0.5, 1, 2, 5], ["0.2", "0.5", "1", "2", "5"])
        axis.xaxis.set_minor_formatter(NullFormatter())
        axis.margins(0.15)
        axis.grid(True, which="both", alpha=0.3)
        axis.legend(loc="lower right")
    figure.suptitle("RGB image against a reference of many samples; numbers: samples a pixel")
    figure.savefig(path, dpi=110)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scene", default="highway_guardrail")
    parser.add_argument("--lighting", default=None, help="a preset of Lighting; default: the scene's own")
    parser.add_argument("--time", type=float, default=0.5, help="[s]")
    parser.add_argument("--figures", type=Path, default=None, help="folder for the figure")
    parser.add_argument("--reference-spp", type=int, default=4096)
    parser.add_argument("--quick", action="store_true", help="fewer repeats, fewer samples")
    parser.add_argument("--chart-only", action="store_true", help="no table of times")
    options = parser.parse_args()
    world = load_scene(options.scene)
    world = world.with_lighting(options.lighting) if options.lighting else world
    state = world.at(options.time)
    front = (state.actor_pose(world.ego) if world.ego else Pose()).compose(FRONT)
    print(machine())
    print(f"\nScene {world.name}, {len(world.parts.name)} parts.")
    if not options.chart_only:
        time_images(world, state, front, repeats=2 if options.quick else 4)
    counts = (4, 16, 64) if options.quick else (2, 4, 8, 16, 32, 64, 256)
    results = chart(state, front, counts, options.reference_spp)
    if options.figures:
        options.figures.mkdir(parents=True, exist_ok=True)
        draw(results, options.figures / "camera_quality.png")


if __name__ == "__main__":
    main()
