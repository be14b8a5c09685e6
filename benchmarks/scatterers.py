"""Scattering centres of the highway's car against the solver `sbr` at 20 to 200 m: error per range cell and time per frame.

Run: python benchmarks/scatterers.py [--depth 2]
The car stands alone, all of metal, seen from behind and beside; both methods see the same mesh. `sbr` traces with spherical waves
from the radar, the centres were compiled from plane waves by another tracer, so nothing is shared but the mesh.
"""

from __future__ import annotations

import argparse
import tempfile
import time
import xml.etree.ElementTree as ET
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

import scarl_sionna as ss
from scarl_sionna.radar.channel.sbr_settings import SbrChannelSettings
from scarl_sionna.radar.sbr import SbrSettings
from scarl_sionna.radar.scatterer_compile import range_profile

SPEED_OF_LIGHT = 299792458.0


def car_alone(folder: Path) -> tuple[Any, trimesh.Trimesh]:
    """Return a world with nothing but the car as one metal mesh, and that mesh."""
    parts = sorted(Path(str(files("scenes_xml") / "highway_guardrail" / "meshes")).glob("car_ahead_*.ply"))
    mesh = trimesh.util.concatenate([trimesh.load(path, process=False) for path in parts])
    mesh.export(folder / "car.ply")
    root = ET.Element("scene", version="3.0.0")
    bsdf = ET.SubElement(root, "bsdf", type="twosided", id="steel")
    ET.SubElement(bsdf, "bsdf", type="diffuse")
    shape = ET.SubElement(root, "shape", type="ply", id="car")
    ET.SubElement(shape, "string", name="filename", value="car.ply")
    ET.SubElement(shape, "ref", id="steel", name="bsdf")
    ET.ElementTree(root).write(folder / "alone.xml")
    (folder / "scene.toml").write_text(
        '[scene]\nname = "alone"\n[materials.steel]\nradio = "metal"\nlidar_reflectance = 0.4\nsource = "estimate"\n'
        '[[actors]]\nname = "car"\nclass = "Car"\nshapes = ["car"]\n'
        '[actors.trajectory]\nkind = "static"\nposition = [0.0, 0.0, 0.0]\n'
    )
    return ss.load_scene(folder / "alone.xml"), mesh


def profile(paths: Any, radar: Any, pose: Any, start: float) -> np.ndarray:
    """Return the power per range cell (VV) over the radar's band, exact lengths."""
    length = np.linalg.norm(paths.tx_point - pose.position, axis=1) + paths.inner_length
    length += np.linalg.norm(paths.rx_point - pose.position, axis=1)
    frequency = radar.center_frequency + np.arange(-32, 32) * (radar.sampled_bandwidth / 64)
    phase = np.exp(-2j * np.pi * frequency[:, None] * (length - 2.0 * start)[None] / SPEED_OF_LIGHT)
    return range_profile(phase @ paths.a[:, 0, 0])


def timed(call: Any, repeats: int) -> tuple[Any, float]:
    """Return the result and the median time after one warm-up."""
    call()
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        result = call()
        times.append(time.perf_counter() - start)
    return result, float(np.median(times))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--depth", type=int, default=2)
    parser.add_argument("--voxel", type=float, default=0.15)
    parser.add_argument("--step", type=float, default=0.25)
    parser.add_argument("--trace-step", type=float, default=2.0)
    options = parser.parse_args()
    radar = ss.RadarSpec.preset("awr1843boost")
    with tempfile.TemporaryDirectory() as folder:
        world, mesh = car_alone(Path(folder))
        world.at(0.0).radio_scene()  # read while the files are there
    start = time.perf_counter()
    model = ss.compile_scatterers(
        mesh, radar.center_frequency, azimuths_deg=(174.0, 180.5), azimuth_step_deg=options.step,
        elevations_deg=np.arange(-3.0, 1.76, options.step), voxel=options.voxel, trace_step_deg=options.trace_step,
        settings=SbrSettings(max_depth=options.depth, ray_spacing=32.0, edge_spacing=16.0), progress=False,
    )  # fmt: skip
    print(f"compiled in {time.perf_counter() - start:.1f} s: {model.num_centers} centres, {model.amplitude.nbytes / 1e6:.1f} MB")
    print("its own error between aspects:", dict(model.error))
    state = world.at(0.0)
    settings = SbrChannelSettings(max_depth=options.depth, floor_db=None)
    errors = []
    for distance in (20.0, 30.0, 50.0, 80.0, 120.0, 200.0):
        pose = ss.Pose([-distance - 2.15, 0.9, 0.6], [1.0, 0.0, 0.0, 0.0])
        reach = distance + 20.0
        truth, sbr_time = timed(
            lambda p=pose, m=reach: ss.solve_paths(
                state, radar, p, method="sbr", instances=["car"], settings=settings, max_distance=m
            ), 2,
        )  # fmt: skip
        fast, own_time = timed(
            lambda p=pose, m=reach: ss.solve_paths(
                state, radar, p, method="scatterers", models={"car": model}, max_distance=m
            ), 9,
        )  # fmt: skip
        wanted, got = (profile(paths, radar, pose, distance) for paths in (truth, fast))
        strong = wanted > wanted.max() * 1e-2
        error = np.abs(10.0 * np.log10(got[strong] / wanted[strong]))
        errors.append(error)
        print(
            f"{distance:5.0f} m: {strong.sum():2d} cells within 20 dB, error median {np.median(error):.2f} dB, largest "
            f"{error.max():.2f} dB; sbr {1e3 * sbr_time:.0f} ms ({truth.num_paths} paths), scatterers {1e3 * own_time:.2f} ms "
            f"({fast.num_paths} paths), {sbr_time / own_time:.0f} times faster",
            flush=True,
        )
    joined = np.concatenate(errors)
    print(f"all: {len(joined)} cells, median {np.median(joined):.2f} dB, 95 % {np.percentile(joined, 95):.2f} dB")


if __name__ == "__main__":
    main()
