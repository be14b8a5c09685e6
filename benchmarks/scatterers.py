"""Scattering centres of the highway's car against the solver `sbr`.

Error per range cell, time per frame, cost of compiling.

Run: python benchmarks/scatterers.py [--sides rear front oblique beside] [--full-turn FILE]
The car stands alone with the materials that it has in the scene (paint, glass, plastic, rubber, metal). Both methods
see the same parts; `sbr` traces with spherical waves from the radar, the centres come from plane waves by another
tracer. Each side's model covers the aspects under which any point of the car is seen from 20 to 200 m. One to two
minutes a side on two quiet cores; ``--trace-step 2`` takes a third of that.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import scarl_sionna as ss
from benchmarks.harness import machine, peak_memory
from scarl_sionna.core.settings.sbr import SbrSettings
from scarl_sionna.radar.optics.body.parts import actor_parts
from scarl_sionna.radar.scatterers.compile import COMPILE_SBR, range_profile

SPEED_OF_LIGHT = 299792458.0
SIDES = {"rear": 180.0, "front": 0.0, "oblique": 45.0, "beside": 90.0}
DISTANCES = (20.0, 50.0, 100.0, 200.0)
HEIGHT = 0.6
"""Of the radar above the ground [m]."""


def car_alone(folder: Path) -> tuple[Any, list[Any]]:
    """Return a world with nothing but the car, part by part, and its parts with their materials."""
    parts = actor_parts(ss.load_scene("highway_guardrail"), "car_ahead")
    root = ET.Element("scene", version="3.0.0")
    text = '[scene]\nname = "alone"\n'
    for name in dict.fromkeys(material.name for _, material in parts):
        bsdf = ET.SubElement(root, "bsdf", type="twosided", id=f"look_{name}")
        ET.SubElement(bsdf, "bsdf", type="diffuse")
        text += f'[materials.look_{name}]\nradio = "{name}"\nlidar_reflectance = 0.4\nsource = "estimate"\n'
    for number, (mesh, material) in enumerate(parts):
        mesh.export(folder / f"part_{number}.ply")
        shape = ET.SubElement(root, "shape", type="ply", id=f"part_{number}")
        ET.SubElement(shape, "string", name="filename", value=f"part_{number}.ply")
        ET.SubElement(shape, "ref", id=f"look_{material.name}", name="bsdf")
    ET.ElementTree(root).write(folder / "alone.xml")
    names = ", ".join(f'"part_{number}"' for number in range(len(parts)))
    text += f'[[actors]]\nname = "car"\nclass = "Car"\nshapes = [{names}]\n'
    text += '[actors.trajectory]\nkind = "static"\nposition = [0.0, 0.0, 0.0]\n'
    (folder / "scene.toml").write_text(text)
    world = ss.load_scene(folder / "alone.xml")
    world.at(0.0).radio_scene()  # read while the files are there
    return world, parts


def radar_pose(side: float, distance: float) -> ss.Pose:
    """Return the radar at a distance from the middle of the car, looking at it."""
    angle = np.radians(side)
    yaw = angle + np.pi
    position = [distance * np.cos(angle), distance * np.sin(angle), HEIGHT]
    return ss.Pose(position, [np.cos(yaw / 2.0), 0.0, 0.0, np.sin(yaw / 2.0)])


def aspects(parts: list[Any], side: float) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return ranges of azimuth and elevation [deg] under which the box's corners see the radar at all distances."""
    points = np.concatenate([mesh.vertices for mesh, _ in parts])
    box = np.stack(np.meshgrid(*np.stack([points.min(axis=0), points.max(axis=0)], axis=1)), axis=-1).reshape(-1, 3)
    offset = np.concatenate([radar_pose(side, distance).position - box for distance in DISTANCES])
    azimuth = np.degrees(np.arctan2(offset[:, 1], offset[:, 0]))
    azimuth = side + (azimuth - side + 180.0) % 360.0 - 180.0
    elevation = np.degrees(np.arctan2(offset[:, 2], np.hypot(offset[:, 0], offset[:, 1])))
    return (float(azimuth.min()), float(azimuth.max())), (float(elevation.min()), float(elevation.max()))


def profile(paths: Any, radar: Any, pose: Any, start: float) -> np.ndarray:
    """Return the power per range cell (VV) over the radar's band, exact lengths."""
    length = np.linalg.norm(paths.tx_point - pose.position, axis=1) + paths.inner_length
    length += np.linalg.norm(paths.rx_point - pose.position, axis=1)
    frequency = radar.center_frequency + np.arange(-32, 32) * (radar.sampled_bandwidth / 64)
    phase = np.exp(-2j * np.pi * frequency[:, None] * (length - 2.0 * start)[None] / SPEED_OF_LIGHT)
    return range_profile(phase @ paths.a[:, 0, 0])


def timed(call: Any, repeats: int) -> tuple[Any, float]:
    """Return the result and the shortest CPU time after one warm-up."""
    call()
    times = []
    for _ in range(repeats):
        start = time.process_time()
        result = call()
        times.append(time.process_time() - start)
    return result, min(times)


def compare(side: str, world: Any, parts: list[Any], options: argparse.Namespace) -> list[np.ndarray]:
    """Print one row a distance; return the errors [dB]."""
    radar = ss.RadarSpec.preset("awr1843boost")
    azimuths, elevations = aspects(parts, SIDES[side])
    steps = int(np.ceil((elevations[1] - elevations[0]) / options.step))
    cpu = time.process_time()
    model = ss.compile_scatterers(
        parts,
        radar.center_frequency,
        azimuths_deg=azimuths,
        azimuth_step_deg=options.step,
        elevations_deg=np.linspace(*elevations, steps + 1),
        voxel=options.voxel,
        trace_step_deg=options.trace_step,
        progress=False,
        num_checks=options.checks,
    )
    cpu = time.process_time() - cpu
    grid = f"{azimuths[1] - azimuths[0]:.1f} x {elevations[1] - elevations[0]:.1f} deg"
    own = (
        f"; own error median {model.error['median_db']:.2f}, 95 % {model.error['p95_db']:.2f} dB" if model.error else ""
    )
    print(
        f"\n{side}: {grid}, {model.num_centers} centres, {model.amplitude.nbytes / 1e6:.0f} MB "
        f"({100 * model.amplitude.share:.0f} % of the full table), {cpu:.0f} CPU s{own}\n\n"
        "| distance [m] | cells within 20 dB | median error [dB] | largest [dB] | sbr CPU ms "
        "| scatterers CPU ms | ratio |\n"
        "|---|---|---|---|---|---|---|",
        flush=True,
    )
    state, errors = world.at(0.0), []
    settings = SbrSettings(max_depth=COMPILE_SBR.max_depth, floor_db=None)
    for distance in DISTANCES:
        pose, reach = radar_pose(SIDES[side], distance), distance + 20.0
        truth, sbr_time = timed(
            lambda p=pose, m=reach: ss.solve_paths(
                state, radar, p, method="sbr", instances=["car"], settings=settings, max_distance=m
            ),
            2,
        )
        fast, own_time = timed(
            lambda p=pose, m=reach: ss.solve_paths(
                state, radar, p, method="scatterers", models={"car": model}, max_distance=m
            ),
            9,
        )
        wanted, got = (profile(paths, radar, pose, distance - 3.0) for paths in (truth, fast))
        strong = wanted > wanted.max() * 1e-2
        errors.append(np.abs(10.0 * np.log10(got[strong] / wanted[strong])))
        print(
            f"| {distance:.0f} | {strong.sum()} | {np.median(errors[-1]):.2f} | "
            f"{errors[-1].max():.2f} | {1e3 * sbr_time:.0f} "
            f"| {1e3 * own_time:.2f} | {sbr_time / own_time:.0f} |",
            flush=True,
        )
    return errors


def full_turn(parts: list[Any], path: str, options: argparse.Namespace) -> None:
    """Compile the car all round, within 1 deg of its horizon; save and load it."""
    cpu, wall = time.process_time(), time.perf_counter()
    model = ss.compile_scatterers(
        parts,
        77e9,
        azimuth_step_deg=options.step,
        elevations_deg=np.arange(-1.0, 1.01, options.step),
        voxel=options.voxel,
        trace_step_deg=options.trace_step,
        num_checks=options.checks,
    )
    print(f"\nfull turn, 2 deg of elevation: {model.num_centers} centres, table {model.amplitude.shape[:2]} aspects")
    print(f"  {time.process_time() - cpu:.0f} CPU s, {time.perf_counter() - wall:.0f} s; error {dict(model.error)}")
    print(f"  {model.amplitude.nbytes / 1e6:.0f} MB, {100 * model.amplitude.share:.0f} % of the full table")
    for name, call in (("saved", lambda: model.save(path)), ("loaded", lambda: ss.ScattererModel.load(path))):
        start = time.perf_counter()
        call()
        print(f"  {name} in {time.perf_counter() - start:.1f} s ({Path(path).stat().st_size / 1e6:.0f} MB)")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sides", nargs="*", default=list(SIDES), choices=list(SIDES))
    parser.add_argument("--full-turn", metavar="FILE", help="compile the car all round into this file instead")
    parser.add_argument("--voxel", type=float, default=0.15)
    parser.add_argument("--step", type=float, default=0.25)
    parser.add_argument("--trace-step", type=float, default=1.0)
    parser.add_argument("--checks", type=int, default=4)
    options = parser.parse_args()
    print(machine())
    with tempfile.TemporaryDirectory() as folder:
        world, parts = car_alone(Path(folder))
    if options.full_turn:
        full_turn(parts, options.full_turn, options)
    else:
        errors = np.concatenate([error for side in options.sides for error in compare(side, world, parts, options)])
        print(f"\nall: {len(errors)} cells, median {np.median(errors):.2f} dB, 95 % {np.percentile(errors, 95):.2f} dB")
    print(f"largest memory {peak_memory():.2f} GiB")


if __name__ == "__main__":
    main()
