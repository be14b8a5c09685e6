"""Figures of docs/lidar.md; drawn by ``python benchmarks/lidar.py --figures docs/figures``."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np

from camera_lidar import Camera
from camera_lidar.lidar import camera_maps, detection_probability, range_view, shot_directions, threshold
from camera_lidar.lidar.heterodyne.air import air_profile
from scarl_sionna.core.specs.atmosphere import Atmosphere
from scarl_sionna.core.specs.camera import CameraSpec
from scarl_sionna.core.specs.lidar.receiver import HeterodyneReceiver
from scarl_sionna.core.specs.lidar.spec import LidarSpec

VELOCITY = {"cmap": "RdBu_r", "vmin": -20.0, "vmax": 20.0}
INTENSITY = {"cmap": "inferno", "vmin": -50.0, "vmax": -15.0}


def draw(
    folder: Path,
    front: Any,
    roof: Any,
    results: list[tuple[float, ...]],
    weathers: dict[str, Atmosphere],
    cnr_of_target: Callable[[LidarSpec, np.ndarray], np.ndarray],
) -> None:
    """Write all figures into a folder."""
    draw_points(roof, folder / "lidar_points.png")
    draw_range_views(front, folder / "lidar_intensity.png")
    draw_beats(front, folder / "lidar_beat.png")
    draw_precision(results, folder / "lidar_precision.png")
    draw_weather(weathers, cnr_of_target, folder / "lidar_weather.png")
    draw_maps(front, folder / "lidar_maps.png")


def draw_points(roof: Any, path: Path) -> None:
    """Draw a spinning scan from above by radial velocity: as measured, and less the sensor's own."""
    spec = LidarSpec.preset("spinning_64").with_(deskew=True)
    scan = roof.scan(spec)
    near = (np.abs(scan.position[:, :2]).max(axis=1) < 45.0) & (scan.instance > 0)
    x, y, z = scan.position[near].T
    own = shot_directions(spec)[scan.shot[near]] @ (roof.twist.linear @ roof.pose.rotation)
    figure, axes = plt.subplots(1, 2, figsize=(13, 5.8), layout="constrained")
    panels = (
        (axes[0], scan.radial_velocity[near], VELOCITY, "radial velocity, as measured [m/s]"),
        (axes[1], scan.radial_velocity[near] + own, VELOCITY, "radial velocity over ground [m/s]"),
    )
    order = np.argsort(z)
    for axis, values, style, label in panels:
        shown = axis.scatter(-y[order], x[order], c=values[order], s=0.6, linewidths=0, **style)
        figure.colorbar(shown, ax=axis, label=label)
        axis.set(xlabel="right [m]", ylabel="forward [m]", aspect="equal", xlim=(-45, 45), ylim=(-45, 45))
        axis.set_facecolor("0.12")
    figure.suptitle("spinning_64 on the roof, one turn, de-skewed")
    figure.savefig(path, dpi=110)
    plt.close(figure)


def draw_range_views(front: Any, path: Path) -> None:
    """Draw the forward lidar in its own view: distance, radial velocity, intensity with one look and with 16."""
    spec = LidarSpec.preset("fmcw_forward")
    one = range_view(front.scan(spec))
    many = range_view(front.scan(spec.with_(receiver=HeterodyneReceiver(num_looks=16))))
    figure, axes = plt.subplots(4, 1, figsize=(11, 11.5), layout="constrained")
    panels = (
        (one.distance, {"cmap": "viridis_r", "vmax": 120.0}, "distance [m]"),
        (one.radial_velocity, VELOCITY, "radial velocity [m/s]"),
        (
            10.0 * np.log10(np.where(one.filled, np.maximum(one.intensity, 1e-9), np.nan)),
            INTENSITY,
            "intensity, 1 look [dB]",
        ),
        (
            10.0 * np.log10(np.where(many.filled, np.maximum(many.intensity, 1e-9), np.nan)),
            INTENSITY,
            "intensity, 16 looks [dB]",
        ),
    )
    for axis, (data, style, label) in zip(axes, panels, strict=True):
        shown = axis.imshow(
            np.where(np.isfinite(data), data, np.nan),
            extent=spec.view_deg,
            aspect="auto",
            interpolation="nearest",
            **style,
        )
        figure.colorbar(shown, ax=axis, label=label)
        axis.set(ylabel="elevation [deg]", facecolor="0.12")
    axes[-1].set_xlabel("azimuth [deg]")
    figure.suptitle("fmcw_forward on the front bumper, own range view")
    figure.savefig(path, dpi=100)
    plt.close(figure)


def draw_beats(front: Any, path: Path) -> None:
    """Draw the spectra of the up and the down chirp of one shot on the car ahead."""
    receiver = HeterodyneReceiver(raw_signal=True, speckle=False)
    wide = front.scan(
        LidarSpec(azimuth_fov_deg=(-20, 20), elevation_fov_deg=(-3, 3), num_azimuth=161, num_elevation=25)
    )
    car = front.state.world.actor("car_ahead").instance
    rows = np.flatnonzero(wide.instance == car)
    aim = wide.position[rows[np.argmin(np.abs(wide.position[rows, 1] - np.median(wide.position[rows, 1])))]]
    azimuth, elevation = np.degrees([np.arctan2(aim[1], aim[0]), np.arctan2(aim[2], np.hypot(aim[0], aim[1]))])
    spec = LidarSpec(
        azimuth_fov_deg=(azimuth, azimuth),
        elevation_fov_deg=(elevation, elevation),
        num_azimuth=1,
        num_elevation=1,
        receiver=receiver,
        max_surfaces=4,
    )
    scan = front.scan(spec)
    assert scan.beat_signal is not None
    number = spec.num_samples
    figure, axis = plt.subplots(figsize=(10, 4.6), layout="constrained")
    for chirp, name, color in ((0, "up chirp", "tab:blue"), (1, "down chirp", "tab:orange")):
        power = np.abs(np.fft.fft(scan.beat_signal[0, chirp], 2 * number)) ** 2 / number
        frequency = np.fft.fftfreq(2 * number, spec.chirp_time / number) / 1e6
        order = np.argsort(frequency)
        axis.plot(frequency[order], 10 * np.log10(power[order]), color=color, lw=0.9, alpha=0.8, label=name)
    level = 10 * np.log10(threshold(spec))
    axis.axhline(level, color="k", ls="--", lw=1, label=f"threshold, {level:.1f} dB")
    axis.axhline(0.0, color="0.5", lw=1, label="mean noise")
    axis.set(xlabel="beat frequency [MHz]", ylabel="power over the mean noise [dB]", ylim=(-20, None), xlim=(-60, 90))
    axis.set_title(
        f"One shot on the car ahead: {scan.distance[0]:.2f} m, {scan.radial_velocity[0]:+.2f} m/s, "
        f"CNR {10 * np.log10(scan.cnr[0]):.1f} dB"
    )
    axis.grid(alpha=0.3)
    axis.legend(loc="upper right")
    figure.savefig(path, dpi=110)
    plt.close(figure)


def draw_precision(results: list[tuple[float, ...]], path: Path) -> None:
    """Draw errors and detection probability over the carrier-to-noise ratio."""
    cnr_db, bound, bound_v, raw, raw_v, raw_pd, some, some_v, some_pd, _ = np.array(results).T
    figure, axes = plt.subplots(1, 3, figsize=(14, 4.4), layout="constrained")
    for axis, line, marks, name, unit in (
        (axes[0], bound, (raw, some), "range", 1e3),
        (axes[1], bound_v, (raw_v, some_v), "radial velocity", 1.0),
    ):
        axis.semilogy(cnr_db, line * unit, "k-", label="Cramer-Rao bound")
        axis.semilogy(cnr_db, marks[0] * unit, "o", label="from raw beats")
        axis.semilogy(cnr_db, marks[1] * unit, "x", label="statistical receiver")
        axis.set(xlabel="CNR [dB]", ylabel=f"standard deviation [{'mm' if unit > 1 else 'm/s'}]", title=name)
        axis.grid(which="both", alpha=0.3)
        axis.legend()
    receiver = HeterodyneReceiver(speckle=False, max_velocity=20.0, sampling_frequency=250e6)
    level = threshold(LidarSpec(chirp_time=1e-6, bandwidth=1.5e8, max_distance=120.0, receiver=receiver))
    fine = np.linspace(5.0, 20.0, 100)
    axes[2].plot(fine, detection_probability(10.0 ** (fine / 10.0), level, 1, False), "k-", label="closed form")
    axes[2].plot(cnr_db, raw_pd, "o", label="from raw beats")
    axes[2].plot(cnr_db, some_pd, "x", label="statistical receiver")
    axes[2].set(
        xlabel="CNR [dB]", ylabel="detection probability", title="both chirps above the threshold", xlim=(5, 20)
    )
    axes[2].grid(alpha=0.3)
    axes[2].legend()
    figure.suptitle("Chirps of 1 us and 150 MHz, no speckle; detected returns only")
    figure.savefig(path, dpi=110)
    plt.close(figure)


def draw_weather(
    weathers: dict[str, Atmosphere], cnr_of_target: Callable[[LidarSpec, np.ndarray], np.ndarray], path: Path
) -> None:
    """Draw carrier-to-noise ratio and detection probability of a 10 % target and the air's returns over distance."""
    spec = LidarSpec.preset("fmcw_forward")
    distance = np.linspace(1.0, 250.0, 500)
    figure, axes = plt.subplots(1, 2, figsize=(12, 4.6), layout="constrained")
    for index, (name, air) in enumerate(weathers.items()):
        some = spec.with_(atmosphere=air)
        cnr = cnr_of_target(some, distance)
        axes[0].plot(distance, 10 * np.log10(cnr), color=f"C{index}", label=f"10 % target, {name}")
        axes[1].plot(distance, detection_probability(cnr, threshold(some)), color=f"C{index}", label=name)
        if air != Atmosphere():
            profile = air_profile(some)
            place = (np.arange(len(profile.cnr)) + 0.5) * some.range_resolution
            axes[0].plot(place, 10 * np.log10(profile.cnr), color=f"C{index}", ls=":")
    axes[0].axhline(10 * np.log10(threshold(spec)), color="k", ls="--", lw=1, label="threshold")
    axes[0].plot([], [], color="0.4", ls=":", label="backscatter of the air, each 15 cm")
    axes[0].set(xlabel="distance [m]", ylabel="CNR [dB]", ylim=(-20, 48))
    axes[1].set(xlabel="distance [m]", ylabel="detection probability with speckle")
    for axis in axes:
        axis.grid(alpha=0.3)
        axis.legend()
    figure.savefig(path, dpi=110)
    plt.close(figure)


def draw_maps(front: Any, path: Path) -> None:
    """Draw a scan's maps beside the camera's images."""
    scan = front.scan(LidarSpec())
    spec = CameraSpec(width=480, height=270, samples_per_pixel=64, images=("rgb", "depth"))
    frame = Camera(spec).observe(front.state, front.pose, np.random.default_rng(0))
    own, projected = range_view(scan), camera_maps(scan, spec, front.pose, radius_px=1)
    figure, axes = plt.subplots(3, 2, figsize=(11, 8), layout="constrained")
    assert frame.rgb is not None and frame.depth is not None
    axes[0, 0].imshow(frame.rgb)
    axes[0, 0].set_title("camera, RGB")
    shown = axes[0, 1].imshow(np.where(np.isfinite(frame.depth), frame.depth, np.nan), vmax=100, cmap="viridis_r")
    figure.colorbar(shown, ax=axes[0, 1], label="depth [m]")
    axes[0, 1].set_title("camera, depth")
    panels = (
        (axes[1, 0], projected.depth, "lidar in the camera's image, depth", "[m]", {"vmax": 100, "cmap": "viridis_r"}),
        (axes[1, 1], projected.radial_velocity, "lidar in the camera's image, Doppler", "[m/s]", VELOCITY),
        (axes[2, 0], own.radial_velocity, "range view, Doppler", "[m/s]", VELOCITY),
        (axes[2, 1], 10 * np.log10(np.where(own.filled, own.intensity, np.nan)), "range view, intensity", "[dB]", {}),
    )
    for axis, data, title, unit, style in panels:
        in_degrees = {"extent": scan.spec.view_deg, "aspect": "auto"} if "range view" in title else {}
        shown = axis.imshow(np.where(np.isfinite(data), data, np.nan), interpolation="nearest", **style, **in_degrees)
        figure.colorbar(shown, ax=axis, label=unit)
        axis.set_title(title)
        labels = ("azimuth [deg]", "elevation [deg]") if in_degrees else ("column [px]", "row [px]")
        axis.set(xlabel=labels[0], ylabel=labels[1])
    figure.savefig(path, dpi=110)
    plt.close(figure)
