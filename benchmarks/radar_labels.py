"""Error and time of the labels of a range-Doppler map, against the synthesis of each instance alone.

python benchmarks/radar_labels.py
"""

from __future__ import annotations

import argparse
import time
import warnings
from pathlib import Path

import numpy as np

import scarl_sionna as ss
from scarl_sionna.core.mount import Mount
from scarl_sionna.core.pose import Twist
from scarl_sionna.core.semantics import SEMANTIC_CLASSES, SEMANTIC_COLORS
from scarl_sionna.fusion import Rig


def place(scene: str = "highway_guardrail"):
    world = ss.load_scene(scene)
    state = world.at(0.5)
    radar = ss.RadarSpec()
    vehicle = state.actor_pose(world.ego)
    pose = vehicle.compose(Rig.front("draft")["front_center/radar"].vehicle_from_sensor)
    return state, radar, pose, Twist(state.actor_twist(world.ego).velocity_at(pose.position - vehicle.position))


def compare(rd, paths, state) -> None:
    """Print the errors of both fast methods against the synthesis, and the times of all three."""
    seconds, labels = {}, {}
    for method in ("synthesis", "spread", "sidelobes"):
        started = time.process_time()
        labels[method] = ss.label_cells(rd, paths, state, method)
        seconds[method] = time.process_time() - started
    expected = labels.pop("synthesis")
    groups = len(np.unique(expected.entry_instance))
    times = ", ".join(f"{name} {value:.2f} s CPU" for name, value in seconds.items())
    print(f"\n{paths.num_paths} paths, {groups} instances: {times}")
    for method, found in labels.items():
        print(f"\n{method}:\n")
        errors(rd, found, expected)


def errors(rd, found, expected) -> None:
    """Print how far shares and instances of cells are from the expected ones."""
    print("| Cells | number | same instance | rms error of share | median | 99 % |\n|---|---|---|---|---|---|")
    peak = expected.power.max()
    for name, chosen in (
        ("within 20 dB of the peak", expected.power > 1e-2 * peak),
        ("within 40 dB of the peak", expected.power > 1e-4 * peak),
        ("10 dB above the noise", expected.power > 10.0 * rd.noise_power),
        ("the same, true share > 0.8", (expected.power > 10.0 * rd.noise_power) & (expected.share > 0.8)),
    ):
        error = np.abs(found.share - expected.share)[chosen]
        same = (found.instance == expected.instance)[chosen].mean()
        print(
            f"| {name} | {chosen.sum()} | {100.0 * same:.2f} % | {np.sqrt(np.mean(error**2)):.4f} | "
            f"{np.median(error):.1e} | {np.quantile(error, 0.99):.3f} |"
        )


def draw(path: Path) -> None:
    """Draw the map of the highway, the class of each cell above the noise, and the share of its instance."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    from matplotlib.patches import Patch

    state, radar, pose, twist = place()
    paths = ss.solve_paths(state, radar, Mount(pose, twist), "raycast", num_rays=200_000)
    adc = ss.synthesize(paths, radar, rng=np.random.default_rng(0))
    rd = ss.range_doppler(ss.virtual_cube(adc, radar), radar, "blackmanharris")
    labels = ss.label_cells(rd, paths, state)
    shown = labels.power > rd.noise_power
    figure, axes = plt.subplots(1, 3, figsize=(13, 4.2), sharey=True, layout="constrained")
    extent = (rd.radial_velocity[0], rd.radial_velocity[-1], rd.range[0], rd.range[-1])
    options = {"origin": "lower", "aspect": "auto", "extent": extent, "interpolation": "nearest"}
    level = 10.0 * np.log10(rd.power.T) + 30.0
    image = axes[0].imshow(level, vmin=level.max() - 70.0, vmax=level.max(), **options)
    figure.colorbar(image, ax=axes[0], label="power [dBm]")
    axes[1].imshow(np.where(shown[..., None], SEMANTIC_COLORS[labels.semantic], 255).transpose(1, 0, 2), **options)
    classes = np.unique(labels.semantic[shown])
    handles = [Patch(color=SEMANTIC_COLORS[k] / 255.0, label=SEMANTIC_CLASSES[k]) for k in classes]
    axes[1].legend(handles=handles, fontsize=7, loc="upper right")
    image = axes[2].imshow(np.where(shown, labels.share, np.nan).T, vmin=0.0, vmax=1.0, cmap="viridis", **options)
    figure.colorbar(image, ax=axes[2], label="share of the strongest instance")
    for axis, title in zip(axes, ("power", "class", "share"), strict=True):
        axis.set(title=title, xlabel="radial velocity [m/s]", ylim=(0.0, 120.0))
    axes[0].set_ylabel("range [m]")
    figure.savefig(path, dpi=110)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scene", default="highway_guardrail", help="scene whose cells are labelled, by raycast alone")
    parser.add_argument("--figure", type=Path, help="draw the map and its labels into this file, and stop")
    options = parser.parse_args()
    figure = options.figure
    warnings.simplefilter("ignore", ss.ScarlWarning)
    if figure is not None:
        draw(figure)
        return
    for method in ("raycast", "auto") if options.scene == "highway_guardrail" else ("raycast",):
        state, radar, pose, twist = place(options.scene)
        paths = ss.solve_paths(state, radar, Mount(pose, twist), method)
        cube = ss.virtual_cube(ss.synthesize(paths, radar), radar)
        for window in ("hann", "blackmanharris"):
            print(f"\n{method}, {window}:")
            compare(ss.range_doppler(cube, radar, window), paths, state)
    rda = ss.range_doppler_angle(cube, radar)
    points = ss.detect(rda, radar)
    started = time.process_time()
    labels = ss.label_points(points, paths, radar, state)
    seconds = time.process_time() - started
    print(f"\n{points.num_points} detections labelled in {seconds:.2f} s CPU; {labels.is_ghost.sum()} ghosts")


if __name__ == "__main__":
    main()
