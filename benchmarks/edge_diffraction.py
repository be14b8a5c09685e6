"""What edge diffraction changes: error against full wave, reciprocity, a street's objects, CPU seconds.

Run: ``python benchmarks/edge_diffraction.py [fullwave] [reciprocity] [street]``; all by default, two minutes.
`fullwave` draws docs/figures/edge_diffraction.png.
"""

from __future__ import annotations

import sys
import time
import warnings
from pathlib import Path

import numpy as np
import trimesh

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.harness import machine
from benchmarks.rcs import chart
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.settings.radar import RadarSettings
from scarl_sionna.core.settings.sbr import SbrSettings
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.engine.load import load_scene
from scarl_sionna.radar.channel import solve_paths
from scarl_sionna.radar.rcs import scattering_matrix
from tests.oracles import rcs as oracle
from tests.physics.test_rcs_reference import FREQUENCY, body_of

KNOBS = {False: SbrSettings(), True: SbrSettings(edge_diffraction=True)}
BANDS = ((0, 10), (10, 20), (20, 30))
"""Below the largest echo of the body [dB]."""


def level(matrix: np.ndarray) -> np.ndarray:
    return 20 * np.log10(np.abs(matrix) + 1e-9) + 10 * np.log10(4 * np.pi)


def cases():
    """Yield names, meshes, angles (n, 4) [rad], the full wave's levels of VV and HH, and where a chart begins."""
    for name in ("plate3lam_phi0", "plate3lam_phi45"):
        cut = oracle.table(f"mom_{name}")
        angles = np.deg2rad([cut["theta_deg"], cut["phi_deg"]] * 2).T
        kept = cut["theta_deg"] <= 80.0
        yield name, body_of(name), angles[kept], (cut["vv_dBlam2"][kept], cut["hh_dBlam2"][kept])
    cut = oracle.table("mom_cube3lam")
    angles = np.deg2rad([cut[f"{name}_deg"] for name in ("theta", "phi", "theta_s", "phi_s")]).T
    truth = [level(cut[f"S{p}_re"] + 1j * cut[f"S{p}_im"]) for p in ("vv", "hh")]
    names = ("cube, azimuth", "cube, elevation at azimuth 30", "cube, bistatic 10 deg")
    for name, rows in zip(names, (slice(0, 46), slice(46, 97), slice(97, 143)), strict=True):
        yield name, trimesh.creation.box([3.0, 3.0, 3.0]), angles[rows], [t[rows] for t in truth]


def bench_fullwave() -> None:
    print("\nss.rcs minus moments [dB], bodies of 3 wavelengths: root mean square / largest, and CPU ms an aspect")
    print("| body and cut | channel | below the peak | aspects | off | on | CPU off | CPU on |\n|" + "---|" * 8)
    axes, save = chart("theta [deg]", "RCS [dB over a wavelength squared]", "edge_diffraction.png")
    for name, mesh, angles, truth in cases():
        found, spent = {}, {}
        for on, knobs in KNOBS.items():
            scattering_matrix(mesh, FREQUENCY, *angles[:1, :2].T, "metal", *angles[:1, 2:].T, settings=knobs)
            clock = time.process_time()
            found[on] = scattering_matrix(mesh, FREQUENCY, *angles[:, :2].T, "metal", *angles[:, 2:].T, settings=knobs)
            spent[on] = 1e3 * (time.process_time() - clock) / len(angles)
        peak = 29.94
        for i, channel in enumerate(("VV", "HH")):
            for low, high in BANDS:
                rows = (truth[i] <= peak - low) & (truth[i] > peak - high)
                if not rows.any():
                    continue
                error = {on: level(found[on][rows, i, i]) - truth[i][rows] for on in KNOBS}
                shown = [f"{np.sqrt((e**2).mean()):.2f} / {np.abs(e).max():.2f}" for e in error.values()]
                print(
                    f"| {name} | {channel} | {low} to {high} dB | {rows.sum()} | {shown[0]} | {shown[1]} "
                    f"| {spent[False]:.1f} | {spent[True]:.1f} |"
                )
        if name == "plate3lam_phi0":
            across = np.degrees(angles[:, 0])
            axes.plot(across, truth[0], "k", label="method of moments, VV")
            axes.plot(across, level(found[False][:, 0, 0]), "C1:", label="physical optics")
            axes.plot(across, level(found[True][:, 0, 0]), "C0--", label="with edge diffraction")
    axes.set_ylim(-15, 32)
    axes.legend()
    axes.set_title("Plate of 3 x 3 wavelengths, phi = 0")
    save()


def bench_reciprocity() -> None:
    print(
        "\nBistatic pair 10 deg apart: level with both ends exchanged, within 20 dB of the peak: median / largest [dB]"
    )
    half = 1.5
    plate = trimesh.Trimesh(
        [[-half, -half, 0], [half, -half, 0], [half, half, 0], [-half, half, 0]], [[0, 1, 2], [0, 2, 3]]
    )
    theta, apart = np.deg2rad(np.arange(0.0, 75.0)), np.deg2rad(10.0)
    for name, mesh in (("plate", plate), ("cube", trimesh.creation.box([3.0, 3.0, 3.0]))):
        for scale in (1.0, 5.0 / 3.0, 10.0 / 3.0):
            body = mesh.copy().apply_scale(scale)
            for on, knobs in KNOBS.items():
                one = scattering_matrix(body, FREQUENCY, theta, 0.0, theta_s=theta + apart, settings=knobs)
                other = scattering_matrix(body, FREQUENCY, theta + apart, 0.0, theta_s=theta, settings=knobs)
                shown = []
                for i in range(2):
                    a, b = level(one[:, i, i]), level(other[:, i, i])
                    strong = np.maximum(a, b) > max(a.max(), b.max()) - 20.0
                    off = np.abs(a - b)[strong]
                    shown.append(f"{np.median(off):.2f} / {off.max():.2f}")
                print(
                    f"  {name} of {3 * scale:g} wavelengths, {'on' if on else 'off':3s}: VV {shown[0]}, HH {shown[1]}"
                )


def bench_street(scene: str = "highway_guardrail") -> None:
    print(f"\n{scene}: each object by itself, two bounces; mean power over the band, all channels of the matrix [dB]")
    state, radar = load_scene(scene).at(0.0), RadarSpec.preset("awr1843boost")
    pose = state.actor_pose("ego").compose(Pose([2.40, 0.0, 0.6]))
    line = radar.center_frequency + radar.sampled_bandwidth * np.linspace(-0.5, 0.5, 33)
    change, spent = {}, {False: 0.0, True: 0.0}
    for info in state.world.instances.values():
        if not info.name.startswith(("car", "oncoming", "sign", "barrier", "delineator", "lamp")):
            continue
        power = {}
        for on in KNOBS:
            knobs = RadarSettings(
                max_distance=80.0, sbr=SbrSettings(edge_diffraction=on, max_depth=2, floor_db=None, diffuse=False)
            )
            clock = time.process_time()
            paths = solve_paths(state, radar, pose, method="sbr", settings=knobs.with_(instances=(info.name,)))
            spent[on] += time.process_time() - clock
            length = 2.0 * np.linalg.norm(paths.rx_point - pose.position, axis=1) + paths.inner_length
            total = np.zeros((len(line), 2, 2), dtype=complex)
            for number, frequency in enumerate(line):
                wave = np.exp(-2j * np.pi * frequency / SPEED_OF_LIGHT * length)
                total[number] = np.einsum("nij,n->ij", paths.a, wave)
            power[on] = (np.abs(total) ** 2).mean(axis=0)[[0, 1], [0, 1]] if paths.num_paths else np.zeros(2)
        if power[False].all() and power[True].all():
            change[info.name] = 10 * np.log10(power[True] / power[False]), 10 * np.log10(power[False])
            turn, before = change[info.name]
            print(
                f"  {info.name:22s} VV {turn[0]:+6.2f}  HH {turn[1]:+6.2f}   ({before[0]:.0f} dB path gain)", flush=True
            )
    every = np.abs([turn for turn, _ in change.values()])
    print(f"  {len(every)} objects: median {np.median(every):.2f}, 90 % below {np.percentile(every, 90):.2f} dB;")
    print(f"  CPU {spent[False]:.1f} s off, {spent[True]:.1f} s on")


def main() -> None:
    warnings.simplefilter("ignore")
    known = {"fullwave": bench_fullwave, "reciprocity": bench_reciprocity, "street": bench_street}
    print(machine())
    for name in sys.argv[1:] or list(known):
        known[name]()


if __name__ == "__main__":
    main()
