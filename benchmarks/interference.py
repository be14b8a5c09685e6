"""What a second radar does to a frame of a street, and what zeroing and linear prediction leave of it.

python benchmarks/interference.py [--figure docs/figures/interference.png]
"""

from __future__ import annotations

import argparse
from time import perf_counter

import matplotlib.pyplot as plt
import numpy as np

import scarl_sionna as ss
from scarl_sionna.core.units import watt_to_dbm
from scarl_sionna.signal.processing import RangeDoppler

SCENE = "highway_guardrail"
NUM_RAYS = 50_000


def frames() -> dict[str, ss.RadarFrame]:
    """Return the frame without and with another radar."""
    world = ss.load_scene(SCENE)
    radar = ss.RadarSpec.preset("awr1843boost_3d").with_(num_chirps=128)
    other = ss.Interferer(
        radar=radar.with_(bandwidth=400e6, start_frequency=76.96e9, idle_time=8.02e-6, num_chirps=256),
        actor="oncoming",
        position=(2.45, 0.0, 0.6),
        start_time=0.0,
    )
    rig = ss.Rig.front(radar=radar).subset("*/radar")
    out = {}
    for name, others in (("alone", ()), ("with another radar", (other,))):
        settings = ss.RadarSettings.of("raycast", num_rays=NUM_RAYS, interferers=others, cell_labels=True)
        started = perf_counter()
        out[name] = ss.observe(world, rig, radar=settings).radars["front_center/radar"]
        heard = out[name].diagnostics.get("interferers", "")
        print(f"{name:20} {perf_counter() - started:6.2f} s {heard}")
    return out


def main() -> None:
    """Print floors and peaks, and draw them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--figure", help="path of the PNG")
    options = parser.parse_args()
    found = frames()
    hit = found["with another radar"].interference_hit
    alone, hurt = found["alone"].adc, found["with another radar"].adc
    radar = found["alone"].spec
    cases = {
        "alone": alone,
        "with another radar": hurt,
        "zeroed, by labels": ss.mitigate(hurt, hit),
        "predicted, by labels": ss.mitigate(hurt, hit, "predict"),
        "zeroed, found": ss.mitigate(hurt, ss.find_hits(hurt)),
        "predicted, found": ss.mitigate(hurt, ss.find_hits(hurt), "predict"),
    }
    maps = {name: ss.range_doppler(ss.virtual_cube(adc, radar), radar) for name, adc in cases.items()}
    power = {name: np.mean(np.abs(rd.data) ** 2, axis=0) for name, rd in maps.items()}
    strong = np.unravel_index(power["alone"].argmax(), power["alone"].shape)
    print(f"hit samples {100.0 * hit.mean():.2f} %, found {100.0 * ss.find_hits(hurt).mean():.2f} %")
    print(f"| {'case':22} | floor over thermal | strongest echo |")
    for name, values in power.items():
        floor = 10.0 * np.log10(np.median(values) / np.median(power["alone"]))
        peak = 10.0 * np.log10(values[strong] / power["alone"][strong])
        print(f"| {name:22} | {floor:+.2f} dB | {peak:+.2f} dB |")
    if options.figure:
        draw(cases, power, maps["alone"], options.figure)


def draw(cases: dict[str, np.ndarray], power: dict[str, np.ndarray], rd: RangeDoppler, path: str) -> None:
    """Draw a chirp and the maps."""
    figure, axes = plt.subplots(1, 4, figsize=(13, 3.2), layout="constrained")
    row = int(np.argmax(np.abs(cases["with another radar"] - cases["alone"]).max(axis=(0, 2))))
    for name, style in (("with another radar", "C3"), ("predicted, by labels", "C0")):
        axes[0].plot(1e6 * cases[name][0, row].real, style, lw=0.8, label=name)
    axes[0].set(xlabel="sample of a chirp", ylabel="I [1e-6 sqrt(W)]")
    axes[0].legend(fontsize=7)
    for axis, name in zip(axes[1:], ("alone", "with another radar", "predicted, by labels"), strict=True):
        level = watt_to_dbm(power[name].T)
        image = axis.pcolormesh(rd.radial_velocity, rd.range, level, vmin=-130.0, vmax=-80.0, rasterized=True)
        axis.set(title=name, xlabel="radial velocity [m/s]", ylim=(0.0, 150.0))
    axes[1].set_ylabel("range [m]")
    figure.colorbar(image, ax=axes[1:], label="power [dBm]")
    figure.savefig(path, dpi=55)


if __name__ == "__main__":
    main()
