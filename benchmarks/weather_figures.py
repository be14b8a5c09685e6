"""Figures and numbers of docs/weather.md: ``python benchmarks/weather_figures.py --figures docs/figures``."""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np

import scarl_sionna as ss
from camera_lidar.camera import Camera
from camera_lidar.lidar import Lidar
from scarl_sionna.core.mount import Mount
from scarl_sionna.core.settings.weather_echoes import DEFAULT_WEATHER_ECHOES
from scarl_sionna.core.specs.drop_sizes import RAIN_SIZES
from scarl_sionna.core.specs.weather import FULL_FILM, Spray
from scarl_sionna.radar.weather.attenuation import rain_attenuation, weather_attenuation
from scarl_sionna.radar.weather.clutter import volume_clutter
from scarl_sionna.radar.weather.hydrometeors import rain, snow
from scarl_sionna.radar.weather.mean_clutter import beam_share, falling, mean_clutter_power
from scarl_sionna.scene.materials.fresnel import reflection
from scarl_sionna.scene.materials.table import builtin_materials
from scarl_sionna.signal.noise import angle_cell_noise_power

FREQUENCY, KELVIN = 77e9, 283.15
RATES = np.geomspace(0.5, 100.0, 25)
SHOWN = (
    ("clear", "day", ss.Weather()),
    ("rain 50 mm/h", "day", ss.Weather.preset("heavy_rain")),
    ("fog, 100 m", "day", ss.Weather(visibility=100.0)),
    ("snow 2 mm/h", "day", ss.Weather.preset("snow")),
)


def draw_drops(path: Path) -> None:
    """Draw specific attenuation and reflectivity over the rate."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4.2), layout="constrained")
    for name in ("V", "H"):
        values = [rain_attenuation(rate, FREQUENCY, name) for rate in RATES]  # type: ignore[arg-type]
        left.loglog(RATES, values, "k-" if name == "V" else "k--", lw=2, label=f"rain, P.838-3, {name}")
    for index, name in enumerate(RAIN_SIZES):
        drops = [rain(rate, FREQUENCY, KELVIN, name) for rate in RATES]  # type: ignore[arg-type]
        label = f"rain, Mie, {name.replace('_', '-')}"
        left.loglog(RATES, [item.attenuation_db_per_km for item in drops], f"C{index}", lw=1, label=label)
        right.semilogx(RATES, [10 * np.log10(item.reflectivity) for item in drops], f"C{index}", label=label)
    rates = RATES[RATES <= 10.0]
    for kind, color in (("dry", "C7"), ("wet", "C9")):
        flakes = [snow(rate, FREQUENCY, kind, 271.0) for rate in rates]  # type: ignore[arg-type]
        left.loglog(rates, [item.attenuation_db_per_km for item in flakes], color, ls="-.", label=f"{kind} snow")
        right.semilogx(
            rates, [10 * np.log10(item.reflectivity) for item in flakes], color, ls="-.", label=f"{kind} snow"
        )
    left.set(xlabel="rate [mm/h of water]", ylabel="attenuation, one way [dB/km]", title="what the air takes at 77 GHz")
    right.set(xlabel="rate [mm/h of water]", ylabel="reflectivity [dB, 1 m²/m³]", title="what it sends back")
    left.legend(fontsize=7)
    right.legend(fontsize=7)
    for axis in (left, right):
        axis.grid(True, which="both", alpha=0.25)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def draw_clutter(path: Path) -> None:
    """Draw the echo of rain and snow over range.

    One range-Doppler map's mean against noise, and against a pedestrian.
    """
    radar, pose = ss.RadarSpec.preset("awr1843boost"), ss.Pose()
    step = radar.range_resolution
    edges = np.maximum(np.arange(0.0, 101.0, step), DEFAULT_WEATHER_ECHOES.nearest)
    middle = (edges[1:] + edges[:-1]) / 2.0
    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4.4), layout="constrained")
    noise = angle_cell_noise_power(radar) * radar.num_virtual  # of one channel's range-Doppler cell
    for index, (name, weather) in enumerate(
        (
            ("rain 50 mm/h", ss.Weather(rain_rate=50.0)),
            ("rain 10 mm/h", ss.Weather(rain_rate=10.0)),
            ("rain 1 mm/h", ss.Weather(rain_rate=1.0)),
            ("dry snow 2 mm/h", ss.Weather(snow_rate=2.0, temperature_celsius=-2.0)),
        )
    ):
        eta = sum(item.reflectivity for item in falling(weather, radar.center_frequency))
        loss = weather_attenuation(weather, radar.center_frequency, "V")
        spread = min(1.0, radar.velocity_resolution / (np.sqrt(2 * np.pi) * weather.turbulence))
        mean = mean_clutter_power(radar, eta, edges[:-1], edges[1:], loss) * spread
        snr = 10 * np.log10(mean * beam_share(radar) / angle_cell_noise_power(radar))
        left.semilogx(middle, snr, f"C{index}", label=name)
        reported = [f"{np.interp(value, middle, snr):.1f}" for value in (5, 10, 20, 50, 100)]
        print(
            f"{name}: eta {10 * np.log10(eta):.1f} dB, SNR of a cell at 5, 10, 20, 50, 100 m: {', '.join(reported)} dB"
        )
    person = 10.0 ** (-8.0 / 10.0)
    scale = (
        10 ** (radar.front_end.tx_power_dbm / 10) * 1e-3 * 10**2 * radar.wavelength**2 / (4 * np.pi) ** 3 / middle**4
    )
    left.semilogx(
        middle, 10 * np.log10(scale * person / angle_cell_noise_power(radar)), "k--", label="pedestrian, -8 dBsm"
    )
    left.axhline(0.0, color="0.5", lw=1)
    left.text(1.1, 1.0, "noise", color="0.4", fontsize=8)
    left.set(
        xlabel="range [m]", ylabel="over the noise of a range-Doppler-angle cell [dB]", xlim=(1, 100), ylim=(-20, 90)
    )
    left.set_title("mean of the strongest cell, awr1843boost")
    left.legend(fontsize=8)
    left.grid(True, which="both", alpha=0.25)
    weather = ss.Weather(rain_rate=50.0)
    paths = volume_clutter(weather, radar, pose, np.random.default_rng(0))
    start = time.process_time()
    adc = ss.synthesize(paths, radar, rng=np.random.default_rng(1))
    print(f"rain 50 mm/h: {paths.num_paths} points, synthesis with noise {time.process_time() - start:.2f} s CPU")
    rd = ss.range_doppler(ss.virtual_cube(adc, radar), radar)
    shown = 10 * np.log10(rd.power / noise)
    speed = rd.radial_velocity
    near = rd.range < 60.0
    image = right.pcolormesh(speed, rd.range[near], shown[:, near].T, vmin=-5, vmax=45, cmap="inferno", rasterized=True)
    right.set(
        xlabel="radial velocity [m/s]",
        ylabel="range [m]",
        title="rain 50 mm/h alone: fall and turbulence",
        xlim=(-8, 8),
    )
    figure.colorbar(image, ax=right, label="over the noise of a cell [dB]")
    figure.savefig(path, dpi=110)
    plt.close(figure)


def draw_looks(world: Any, path: Path, samples: int) -> None:
    """Render the same moment in four weathers."""
    spec = ss.CameraSpec(width=480, height=270, samples_per_pixel=samples, images=("rgb",), horizontal_fov_deg=70.0)
    figure, axes = plt.subplots(2, 2, figsize=(11, 6.4), layout="constrained")
    for axis, (title, light, weather) in zip(axes.ravel(), SHOWN, strict=True):
        state = world.with_lighting(light).with_weather(weather).at(1.0)
        pose = state.actor_pose("ego").compose(ss.Pose([1.2, 0.0, 1.5]))
        twist = ss.Twist(state.actor_twist("ego").linear, np.zeros(3))
        start = time.process_time()
        image = Camera(spec).observe(state, Mount(pose, twist), np.random.default_rng(0)).rgb
        print(f"image, {title}: {time.process_time() - start:.1f} s CPU")
        axis.imshow(image)
        axis.set_title(title)
        axis.axis("off")
    figure.savefig(path, dpi=100, pil_kwargs={"quality": 86, "optimize": True, "progressive": True})
    plt.close(figure)


def draw_lidar(world: Any, path: Path) -> None:
    """Draw one scan in four weathers from above, returns of the air in red."""
    spec = ss.LidarSpec(
        receiver=ss.HeterodyneReceiver(), num_azimuth=400, num_elevation=80, max_returns=2, max_distance=150.0
    )
    weathers = (
        ("clear", ss.Weather()),
        ("rain 50 mm/h", ss.Weather.preset("heavy_rain")),
        ("fog, 100 m", ss.Weather(visibility=100.0)),
        ("wet road, spray", ss.Weather(wetness=1.0, spray=Spray(airborne_share=0.1))),
    )
    figure, axes = plt.subplots(1, 4, figsize=(13, 5.2), layout="constrained", sharey=True)
    for axis, (title, weather) in zip(axes, weathers, strict=True):
        state = world.with_weather(weather).at(1.0)
        pose = state.actor_pose("ego").compose(ss.Pose([1.8, 0.0, 1.7]))
        twist = ss.Twist(state.actor_twist("ego").linear, np.zeros(3))
        scan = Lidar(spec).observe(state, Mount(pose, twist), np.random.default_rng(0))
        air = scan.instance == 0
        x, y, _ = scan.position.T
        axis.scatter(-y[~air], x[~air], c="0.85", s=0.3, linewidths=0)
        axis.scatter(-y[air], x[air], c="tab:red", s=1.5, linewidths=0)
        axis.set(
            title=f"{title}\n{(~air).sum()} of surfaces, {air.sum()} of the air",
            xlabel="right [m]",
            xlim=(-22, 22),
            ylim=(0, 100),
        )
        axis.set_facecolor("0.1")
        axis.title.set_fontsize(10)
        print(f"lidar, {title}: {(~air).sum()} returns of surfaces, {air.sum()} of the air")
    axes[0].set_ylabel("forward [m]")
    figure.savefig(path, dpi=110)
    plt.close(figure)


def draw_film(path: Path) -> None:
    """Draw what a film of water makes of reflections at 77 GHz, over its depth and over the angle."""
    table = builtin_materials()
    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4.0), layout="constrained")
    depth = np.geomspace(1e-6, 2e-3, 200)
    for index, name in enumerate(("asphalt", "concrete", "metal")):
        values = [
            20 * np.log10(abs(reflection(table[name].with_(water_film=float(one)), FREQUENCY, 1.0)[0])) for one in depth
        ]
        left.semilogx(depth * 1e3, values, f"C{index}", label=name)
        dry = 20 * np.log10(abs(reflection(table[name], FREQUENCY, 1.0)[0]))
        left.axhline(dry, color=f"C{index}", ls=":", lw=1)
    left.set(xlabel="depth of the water [mm]", ylabel="reflection [dB]", title="normal incidence; dotted: dry")
    left.legend()
    elevation = np.linspace(0.5, 90.0, 300)
    sine = np.sin(np.radians(elevation))
    wet = table["asphalt"].with_(water_film=FULL_FILM)
    for index, name in enumerate(("H (TE)", "V (TM)")):
        for material, style in ((table["asphalt"], ":"), (wet, "-")):
            values = 20 * np.log10(np.abs(reflection(material, FREQUENCY, sine)[index]))
            right.plot(
                elevation, values, f"C{index + 3}", ls=style, label=f"{name}, {'dry' if style == ':' else 'wet'}"
            )
    for angle in (1.0, 2.0, 5.0, 10.0, 30.0, 90.0):
        change = [
            20 * np.log10(abs(a / b))
            for a, b in zip(
                reflection(wet, FREQUENCY, np.sin(np.radians(angle))),
                reflection(table["asphalt"], FREQUENCY, np.sin(np.radians(angle))),
                strict=True,
            )
        ]
        print(
            f"asphalt under 0.5 mm of water, {angle:g} deg over the road: H {change[0]:+.2f} dB, V {change[1]:+.2f} dB"
        )
    right.set(
        xlabel="angle over the road [deg]",
        ylabel="reflection [dB]",
        title="asphalt under 0.5 mm of water",
        ylim=(-35, 1),
    )
    right.legend(fontsize=8)
    for axis in (left, right):
        axis.grid(True, which="both", alpha=0.25)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def main() -> None:
    """Draw all figures into a folder and print the numbers of the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--figures", type=Path, default=Path("docs/figures"))
    parser.add_argument("--samples", type=int, default=16, help="light paths a pixel")
    arguments = parser.parse_args()
    arguments.figures.mkdir(parents=True, exist_ok=True)
    draw_drops(arguments.figures / "weather_drops.png")
    draw_film(arguments.figures / "weather_film.png")
    draw_clutter(arguments.figures / "weather_clutter.png")
    world = ss.load_scene("highway_guardrail")
    draw_lidar(world, arguments.figures / "weather_lidar.png")
    draw_looks(world, arguments.figures / "weather_looks.webp", arguments.samples)


if __name__ == "__main__":
    main()
