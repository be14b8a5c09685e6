"""Micro-Doppler of a pedestrian and of a cyclist against their kinematic models.

The figures and the table of docs/micro_doppler.md.

``python benchmarks/micro_doppler.py [--columns 40] [--looks 10]``; about three minutes of CPU time. Writes
``docs/figures/micro_doppler_*.png`` and prints the correlations.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from scarl_sionna.core.pose import Pose
from scarl_sionna.core.specs.radar.pattern import IsotropicPattern
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.engine.world import World
from scarl_sionna.radar.micro_doppler import Spectrogram, spectrograms, surface_motion, window_half_width
from scarl_sionna.scene.motion.articulation import Pedal, Walk
from scarl_sionna.scene.motion.gait import SEGMENTS
from tests.actor_scenes import actor_world

FIGURES = Path(__file__).resolve().parent.parent / "docs" / "figures"
BELOW_DB = 45.0
WINDOW = "blackman"
WALK = 1.35
RIDE, SPEED_UP = 5.0, 1.25
"""Speed of the cyclist [m/s], and acceleration where the wheels are looked at [m/s2]."""
LEGS = ("foot", "lower_leg", "upper_leg")


def radar_of(num_chirps: int, interval: float, azimuth_fov_deg: float, elevation_fov_deg: float) -> RadarSpec:
    """Return a radar of one channel whose frame of 6.4 ms is one spectrum."""
    return RadarSpec().with_(
        start_frequency=77e9,
        bandwidth=5e8,
        ramp_time=20e-6,
        idle_time=interval - 20e-6,
        num_chirps=num_chirps,
        num_samples=64,
        tx_positions=((0.0, 0.0, 0.0),),
        rx_positions=((0.0, 0.0, 0.0),),
        pattern=IsotropicPattern(),
        azimuth_fov_deg=azimuth_fov_deg,
        elevation_fov_deg=elevation_fov_deg,
    )


@dataclass(frozen=True)
class Study:
    """Spectrograms of one target and what its kinematic model says.

    Attributes
    ----------
    spectra : mapping of str to Spectrogram
        Of the whole and of each group.
    exact : mapping of str to ndarray, shape (num_times,)
        Mean radial velocity of what is in view of each group [m/s].
    extremes : mapping of str to ndarray, shape (num_times, 2)
        Lowest and highest radial velocity of the whole surface of each group, seen or not [m/s].
    half_width : float
        Of the window at `BELOW_DB` [m/s].
    """

    spectra: Mapping[str, Spectrogram]
    exact: Mapping[str, np.ndarray]
    extremes: Mapping[str, np.ndarray]
    half_width: float

    def correlation(self, group: str) -> float:
        """Return the correlation of a group's mean Doppler velocity with the model."""
        found, exact = self.spectra[group].mean_velocity(), self.exact[group]
        seen = np.isfinite(found) & np.isfinite(exact)
        return float(np.corrcoef(found[seen], exact[seen])[0, 1])

    def rms(self, group: str) -> float:
        """Return the root mean square of its error [m/s]."""
        return float(np.sqrt(np.nanmean((self.spectra[group].mean_velocity() - self.exact[group]) ** 2)))

    def edges(self, group: str) -> np.ndarray:
        """Return the edges of a spectrogram less the half width of the window, shape (num_times, 2) [m/s]."""
        return self.spectra[group].edges(BELOW_DB) + np.array([self.half_width, -self.half_width])

    def pooled(self, groups: Sequence[str]) -> float:
        """Return the correlation over all groups and times together."""
        found = np.concatenate([self.spectra[name].mean_velocity() for name in groups])
        exact = np.concatenate([self.exact[name] for name in groups])
        seen = np.isfinite(found) & np.isfinite(exact)
        return float(np.corrcoef(found[seen], exact[seen])[0, 1])


def study(
    world: World,
    radar: RadarSpec,
    pose: Callable[[float], Pose],
    times: np.ndarray,
    groups: Mapping[str, Sequence[int]],
    looks: Sequence[float],
    **options: Any,
) -> Study:
    """Return the spectrograms of a target and of groups of its parts, with the answers of its kinematics."""
    spectra = spectrograms(
        world,
        radar,
        pose,
        times,
        groups,
        looks=looks,
        num_doppler_bins=2 * radar.num_chirps,
        window=WINDOW,
        hits_per_cell=None,
        **options,
    )
    motion = [surface_motion(world, float(t), pose(float(t))) for t in times]
    groups = {"whole": range(len(world.parts.name)), **groups}
    exact = {name: np.array([one.mean_velocity(parts) for one in motion]) for name, parts in groups.items()}
    extremes = {name: np.array([one.extremes(parts) for one in motion]) for name, parts in groups.items()}
    return Study(spectra, exact, extremes, window_half_width(radar, BELOW_DB, WINDOW))


def walker(folder: Path, columns: int, looks: int, detail: str = "detailed", num_rays: int = 10_000) -> Study:
    """Return the study of a man who walks towards the radar at 12 m.

    `looks` cycles of his gait, each from a place of its own.
    """
    trajectory = {"kind": "constant_twist", "position": [0.0, 0.0, 0.0], "velocity": [WALK, 0.0, 0.0]}
    world = actor_world(folder, "adult_man", trajectory, detail)
    (gait,) = (joint.gait for joint in world.actor("it").joints if isinstance(joint, Walk))
    cycle = 1.0 / gait.cadence(WALK)
    shift = np.random.default_rng(1).uniform(0.0, 0.3, looks)

    def pose(t: float) -> Pose:
        number = int(t // cycle)
        return Pose.from_euler([12.0 + WALK * cycle * number + shift[number], 0.0, 1.0], yaw=np.pi)

    groups = {name: _parts_of(world, name) for name in SEGMENTS}
    times = (np.arange(columns) + 0.25) * cycle / columns
    radar = radar_of(64, 100e-6, 9.0, 14.0)
    return study(world, radar, pose, times, groups, [number * cycle for number in range(looks)], num_rays=num_rays)


def cyclist(folder: Path, columns: int, looks: int, detail: str = "detailed", num_rays: int = 16_000) -> Study:
    """Return the study of a cyclist at 5 m/s, 12 m away, 20 deg beside his way.

    `looks` turns of the cranks, one turn a second.
    """
    trajectory = {"kind": "constant_twist", "position": [0.0, 0.0, 0.0], "velocity": [RIDE, 0.0, 0.0]}
    world = actor_world(folder, "bicycle", trajectory, detail)
    (cadence,) = (joint.cadence for joint in world.actor("it").joints if isinstance(joint, Pedal))
    turn = 2.0 * np.pi / cadence.rate(RIDE)
    shift = np.random.default_rng(2).uniform(0.0, 0.3, looks)

    def pose(t: float) -> Pose:
        return _ahead(RIDE * t, 12.0 + shift[int(t // turn)])

    names = list(world.parts.name)
    groups = {f"{side}_{part}": [names.index(f"it_{side}_{part}")] for side in ("left", "right") for part in LEGS}
    times = (np.arange(columns) + 0.25) * turn / columns
    radar = radar_of(96, 6.4e-3 / 96, 10.0, 12.0)
    return study(world, radar, pose, times, groups, [number * turn for number in range(looks)], num_rays=num_rays)


def tyres(folder: Path, columns: int, detail: str = "detailed", num_rays: int = 16_000) -> Study:
    """Return the study of the tyres of a bicycle that speeds up from 3 to 6.5 m/s, from the same place."""
    clock = np.linspace(0.0, 2.8, 29)
    way = 3.0 * clock + 0.5 * SPEED_UP * clock**2
    trajectory = {"times": list(clock), "positions": [[float(x), 0.0, 0.0] for x in way], "yaw_deg": [0.0] * len(clock)}
    world = actor_world(folder, "bicycle", trajectory, detail)
    times = np.linspace(0.02, clock[-1] - 0.02, columns)

    def pose(t: float) -> Pose:
        return _ahead(float(np.interp(t, clock, way)), 12.0)

    names = list(world.parts.name)
    groups = {name: [names.index(f"it_{name}")] for name in ("wheel_front_tyre", "wheel_rear_tyre")}
    return study(world, radar_of(96, 6.4e-3 / 96, 10.0, 12.0), pose, times, groups, [0.0], num_rays=num_rays)


def _ahead(x: float, distance: float) -> Pose:
    """Return the pose of a radar at a distance from a place on the x axis, 20 deg aside, that looks there."""
    aside = np.radians(20.0)
    return Pose.from_euler([x + distance * np.cos(aside), distance * np.sin(aside), 0.9], yaw=np.pi + aside)


def _parts_of(world: World, segment: str) -> list[int]:
    others = [name for name in SEGMENTS if name != segment and name.startswith(segment)]
    return [
        part
        for part, name in enumerate(world.parts.name)
        if f"{name}_".startswith(f"it_{segment}_")
        and not any(f"{name}_".startswith(f"it_{other}_") for other in others)
    ]


def spectrogram_axes(axes: Any, result: Study, name: str, low: float, high: float) -> Any:
    """Draw a spectrogram, 50 dB deep."""
    spectrum = result.spectra[name]
    level = 10.0 * np.log10(np.maximum(spectrum.power, 1e-30)).T + 30.0
    image = axes.pcolormesh(
        spectrum.time,
        spectrum.radial_velocity,
        level,
        vmin=level.max() - 50.0,
        vmax=level.max(),
        cmap="magma",
        shading="nearest",
        rasterized=True,
    )
    axes.set(xlabel="time [s]", ylabel="radial velocity [m/s]", ylim=(low, high))
    return image


def figure_walker(result: Study, path: Path) -> None:
    """Draw the pedestrian: the whole spectrogram with its exact extremes, and the lines of limbs."""
    import matplotlib.pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(11.5, 4.4), layout="constrained")
    image = spectrogram_axes(left, result, "whole", -7.0, 1.5)
    figure.colorbar(image, ax=left, label="power [dBm]")
    times = result.spectra["whole"].time
    for column, label in ((0, "fastest and slowest point, exact"), (1, None)):
        left.plot(times, result.extremes["whole"][:, column], "c-", lw=1.3, label=label)
        left.plot(
            times,
            result.edges("whole")[:, column],
            "w.",
            ms=4,
            label=None if column else f"edges at -{BELOW_DB:.0f} dB",
        )
    left.legend(loc="lower right", fontsize=8, facecolor="0.25", labelcolor="white")
    left.set_title("whole body")
    shown = ("left_foot", "right_foot", "left_lower_leg", "right_lower_arm", "torso")
    for number, name in enumerate(shown):
        right.plot(
            times,
            result.exact[name],
            f"C{number}-",
            lw=1.4,
            label=f"{name.replace('_', ' ')}: {result.correlation(name):.4f}",
        )
        right.plot(times, result.spectra[name].mean_velocity(), f"C{number}.", ms=5)
    right.set(xlabel="time [s]", ylabel="radial velocity [m/s]", title="limbs: model (lines), mean Doppler (dots)")
    right.legend(title="correlation", fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5))
    right.grid(alpha=0.3)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def figure_cyclist(result: Study, rolling: Study, path: Path) -> None:
    """Draw the cyclist: the whole spectrogram, feet and lower legs, and the span of the front tyre."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 3, figsize=(15.0, 4.4), layout="constrained")
    image = spectrogram_axes(axes[0], result, "whole", -11.0, 2.0)
    figure.colorbar(image, ax=axes[0], label="power [dBm]")
    axes[0].set_title("bicycle and rider at 5 m/s")
    times = result.spectra["whole"].time
    shown = ("left_foot", "right_foot", "left_lower_leg", "right_upper_leg")
    for number, name in enumerate(shown):
        axes[1].plot(
            times,
            result.exact[name],
            f"C{number}-",
            lw=1.4,
            label=f"{name.replace('_', ' ')}: {result.correlation(name):.4f}",
        )
        axes[1].plot(times, result.spectra[name].mean_velocity(), f"C{number}.", ms=5)
    axes[1].set(
        xlabel="time [s]", ylabel="radial velocity [m/s]", title="pedalling: model (lines), mean Doppler (dots)"
    )
    axes[1].legend(title="correlation", fontsize=8, ncol=2, loc="upper center")
    axes[1].set_ylim(top=-2.3)
    axes[1].grid(alpha=0.3)
    image = spectrogram_axes(axes[2], rolling, "wheel_front_tyre", -14.5, 2.0)
    figure.colorbar(image, ax=axes[2], label="power [dBm]")
    for column, label in ((0, "slowest and fastest point, exact"), (1, None)):
        axes[2].plot(
            rolling.spectra["whole"].time, rolling.extremes["wheel_front_tyre"][:, column], "c-", lw=1.3, label=label
        )
        axes[2].plot(
            rolling.spectra["whole"].time,
            rolling.edges("wheel_front_tyre")[:, column],
            "w.",
            ms=4,
            label=None if column else "edges",
        )
    axes[2].legend(loc="lower left", fontsize=8, facecolor="0.25", labelcolor="white")
    axes[2].set_title("front tyre alone, speeding up")
    figure.savefig(path, dpi=110)
    plt.close(figure)


def report(title: str, result: Study) -> None:
    """Print the correlation and the error of every group, and of the edges."""
    print(title)
    for name in result.spectra:
        edges, exact = result.edges(name), result.extremes[name]
        fast, slow = (edges[:, k] - exact[:, k] for k in (0, 1))
        spread = " ".join(f"{np.nanmean(part):+.2f} +- {np.nanstd(part):.2f}" for part in (fast, slow))
        rising = [
            np.corrcoef(*(column[np.isfinite(edges[:, k])] for column in (edges[:, k], exact[:, k])))[0, 1]
            for k in (0, 1)
        ]
        print(
            f"  {name:18s} mean {result.correlation(name):.4f} rms {result.rms(name):.3f} m/s, "
            f"edges {rising[0]:.4f} {rising[1]:.4f},"
            f" off by {spread} m/s"
        )


def main() -> None:
    """Run both studies and write the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--columns", type=int, default=40)
    parser.add_argument("--looks", type=int, default=10)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        begin = time.process_time()
        walking = walker(Path(folder) / "walker", options.columns, options.looks)
        report("pedestrian, 1.35 m/s, towards the radar", walking)
        print(f"  all limbs together {walking.pooled(SEGMENTS):.4f}; {time.process_time() - begin:.0f} s of CPU time")
        figure_walker(walking, FIGURES / "micro_doppler_pedestrian.png")
        begin = time.process_time()
        riding = cyclist(Path(folder) / "cyclist", options.columns, options.looks)
        report("cyclist, 5 m/s, from 20 deg aside", riding)
        legs = [f"{side}_{part}" for side in ("left", "right") for part in LEGS]
        print(f"  all of the legs together {riding.pooled(legs):.4f}; {time.process_time() - begin:.0f} s of CPU time")
        begin = time.process_time()
        rolling = tyres(Path(folder) / "tyres", 2 * options.columns)
        report("tyres, 3 to 6.5 m/s", rolling)
        print(f"  {time.process_time() - begin:.0f} s of CPU time")
        figure_cyclist(riding, rolling, FIGURES / "micro_doppler_cyclist.png")


if __name__ == "__main__":
    main()
