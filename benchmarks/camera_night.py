"""The camera at night: light that the default image keeps, against many samples.

    python benchmarks/camera_night.py [--views urban_crossing tunnel] [--reference-spp 512]
    python benchmarks/camera_night.py --others

Prints a markdown table. From the roof of each scene's ego vehicle (or from `OTHERS`, on which nothing was chosen),
default samples, denoised, the mean of several seeds. "before" is the same with Mitsuba's choice of lamps and the
denoiser over the whole image, "filtered once" without the passes over what the filter left. What is dark is chosen by
one reference and measured against another of another seed, else noise of the reference would count as brightening.
"""

from __future__ import annotations

import argparse
import importlib
import sys
import time
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from camera_lidar.camera import render
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.specs.camera import CameraSpec
from scarl_sionna.engine.load import load_scene


class View(NamedTuple):
    """A scene, its variant and weather, a time [s], and a camera relative to the ego: x, y, z [m], yaw, pitch [deg]."""

    scene: str
    variant: int = 0
    weather: str = "clear"
    time: float = 0.5
    mount: tuple[float, ...] = (0.3, 0.0, 1.62, 0.0, 3.0)


SCENES = ("highway_guardrail", "urban_crossing", "suburban_street", "signalised_crossing", "roundabout", "tunnel")
OTHERS = (
    View("motorway", time=2.0),
    View("country_road", time=1.0),
    View("roundabout", 3, time=3.0, mount=(-8.0, -1.0, 4.0, 0.0, 10.0)),
    View("signalised_crossing", 2, "rain", 2.0),
    View("suburban_street", 5, time=2.0, mount=(0.3, 0.0, 1.62, 180.0, 3.0)),
    View("highway_guardrail", time=3.0, mount=(-8.0, -1.0, 4.0, 20.0, 10.0)),
    View("urban_crossing", 0, "winter", 2.5),
)
SPEC = CameraSpec(width=96, height=54, horizontal_fov_deg=70.0, images=("rgb",))
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
SEEDS = (1, 2, 3, 4, 5, 6)
HAS_LAMPS = render.has_lamps
denoising = importlib.import_module("camera_lidar.camera.denoise")
PASSES = denoising.PASSES

Array = npt.NDArray[np.float64]


def shot(state: Any, pose: Pose, spec: CameraSpec, seed: int) -> Array:
    """Return the luminance of one image."""
    return np.asarray(render.render_radiance(state, spec, pose, np.random.default_rng(seed)) @ LUMINANCE, np.float64)


def errors(image: Array, first: Array, second: Array) -> list[float]:
    """Return errors of an image.

    Of the mean, of the mean but for the one pixel that differs most, of the darker half and of the darkest quarter [%],
    and of logarithms [dB rms].
    """
    both = 0.5 * (first + second)
    others = np.arange(both.size) != np.abs(image - both).argmax()
    row = [100.0 * (image.ravel()[kept].mean() / both.ravel()[kept].mean() - 1.0) for kept in (slice(None), others)]
    for share in (0.5, 0.25):
        parts = [(chosen <= np.quantile(chosen, share), other) for chosen, other in ((first, second), (second, first))]
        row.append(float(np.mean([100.0 * (image[dark].mean() / other[dark].mean() - 1.0) for dark, other in parts])))
    floor = 1e-2 * np.median(both)
    row.append(float(np.sqrt(np.mean((10.0 * np.log10((image + floor) / (both + floor))) ** 2))))
    return row


def measure(view: View, reference_spp: int) -> None:
    """Print the rows of a view."""
    world = load_scene(view.scene, variant=view.variant)
    if not world.document.info.get("enclosed", False):
        world = world.with_lighting("night")
    world = world.with_weather(view.weather)
    state = world.at(view.time)
    ego = state.actor_pose(world.ego) if world.ego else Pose()
    yaw, pitch = np.radians(view.mount[3:])
    pose = ego.compose(Pose.from_euler(view.mount[:3], yaw=yaw, pitch=pitch))
    name = f"`{view.scene}`" + (f" {view.variant}" if view.variant else "")
    name += "" if view.weather == "clear" else f", {view.weather}"
    many = SPEC.with_(samples_per_pixel=reference_spp, denoise=False)
    first, second = (shot(state, pose, many, seed) for seed in (101, 102))
    spread = 100.0 * abs(first.mean() / second.mean() - 1.0) / 2.0
    raw = SPEC.with_(denoise=False)
    for title, switch, passes, spec in (
        ("before", lambda _: False, 0, SPEC),
        ("filtered once", HAS_LAMPS, 0, SPEC),
        ("now", HAS_LAMPS, PASSES, SPEC),
        ("now, not denoised", HAS_LAMPS, 0, raw),
    ):
        render.has_lamps, denoising.PASSES = switch, passes
        shot(state, pose, spec, 0)  # compile
        start = time.process_time()
        images = [shot(state, pose, spec, seed) for seed in SEEDS]
        seconds = (time.process_time() - start) / len(SEEDS)
        bias = errors(np.mean(images, axis=0), first, second)
        single = [errors(image, first, second) for image in images]
        print(
            f"| {name} | {title} | {bias[0]:+.1f} ± {np.std([row[0] for row in single]):.1f} | {spread:.1f} "
            f"| {bias[1]:+.1f} | {bias[2]:+.1f} | {bias[3]:+.1f} | {np.mean([row[4] for row in single]):.1f} "
            f"| {seconds:.2f} |",
            flush=True,
        )
    render.has_lamps, denoising.PASSES = HAS_LAMPS, PASSES


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--views", nargs="*", default=SCENES, help="scenes")
    parser.add_argument("--others", action="store_true", help="other views, weather, variants in their place")
    parser.add_argument("--reference-spp", type=int, default=512)
    options = parser.parse_args()
    print(
        "| scene | | mean [%] ± one image | reference | but for one pixel | darker half [%] | darkest quarter [%] "
        "| rms [dB] | CPU [s] |"
    )
    print("|---|---|---|---|---|---|---|---|---|")
    for view in OTHERS if options.others else [View(scene) for scene in options.views]:
        measure(view, options.reference_spp)


if __name__ == "__main__":
    main()
