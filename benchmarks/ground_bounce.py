"""Two-ray fading of a post and of a car on a flat road: `auto` against image theory.

    python benchmarks/ground_bounce.py post 0:31       distances by number, a line of JSON each; 1 minute
    python benchmarks/ground_bounce.py car 0:31:5      3 minutes, every fifth distance
    python benchmarks/ground_bounce.py --write docs/figures/ground_bounce.webp

The post's reference is an integral over the round surface, not a mesh; the car's is `sbr` of the car alone, finely and
without a ground, between the radar and its images, with Fresnel's coefficient of every path (tests/oracles/two_ray.py).
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import scarl_sionna as ss
from benchmarks.row_files import append_rows, read_rows
from scarl_sionna.core.settings.sbr import SbrSettings
from scarl_sionna.engine.world import WorldState
from scarl_sionna.radar.channel import solve_paths
from scarl_sionna.radar.channel.band_mean import band_power
from scarl_sionna.radar.channel.compose.expected_error import owners
from scarl_sionna.scene.materials.table import MaterialTable, builtin_materials
from scenes_xml import scene_path
from tests.oracles import two_ray as oracle
from tests.scenes import Material, Thing, plane, write_scene

RADAR = ss.RadarSpec()
HEIGHT = 0.6
REACH = 200.0
RADIUS, POST = 0.1, 2.0
DISTANCES = np.geomspace(10.0, 150.0, 31)
RESULTS = Path("docs/figures/data/ground_bounce.jsonl")
GROUND = builtin_materials()["asphalt"].with_(name="smooth_asphalt", scattering_coefficient=0.0)
TABLE = MaterialTable([*builtin_materials().values(), GROUND])
FINE = SbrSettings(max_phase=0.4, integration_phase=0.02, edge_share=0.0625, max_depth=4, floor_db=None)
TOLERANCES = (1.0, 0.3)
SHALLOW_DB = 8.0
"""An error counts in decibels down to fades of this depth, in deeper ones as the same difference of the field."""

SHARE = (np.arange(32) + 0.5) / 32
WEIGHT = np.sin(np.pi * SHARE) ** 4 / np.sum(np.sin(np.pi * SHARE) ** 4)
FREQUENCIES = RADAR.center_frequency + (SHARE - 0.5) * RADAR.sampled_bandwidth


def body(kind: str, distance: float) -> Thing:
    """Return a round metal post of 48 sides, or the highway's car ahead from behind, in metal."""
    if kind == "post":
        mesh = trimesh.creation.cylinder(RADIUS, POST, sections=48)
        mesh.apply_translation([distance, 0.0, POST / 2.0])
        return Thing("body", mesh, "Pole", "steel")
    parts = sorted((scene_path("highway_guardrail").parent / "meshes").glob("car_ahead_*.ply"))
    mesh = trimesh.util.concatenate([trimesh.load(path, process=False) for path in parts])
    mesh.apply_translation([distance, 0.3, 0.0])
    return Thing("body", mesh, "Car", "steel")


def states(kind: str, distance: float, folder: Path) -> tuple[WorldState, WorldState]:
    """Return a body on the road, and alone."""
    one, road = (
        body(kind, distance),
        Thing("road", plane(400.0, 60.0, (100, 0, 0)), "Roads", "asphalt", is_object=False),
    )
    materials = {"asphalt": Material(radio=GROUND.name)}
    both = write_scene(folder / "both", [road, one], materials=materials)
    alone = write_scene(folder / "alone", [one], materials=materials)
    return ss.load_scene(both, TABLE).at(0.0), ss.load_scene(alone, TABLE).at(0.0)


def in_band(field: np.ndarray) -> float:
    """Return the power in the band of a field over the frequencies."""
    return float(np.sum(WEIGHT * np.abs(field) ** 2))


def by_image_theory(kind: str, distance: float, alone: WorldState) -> tuple[float, float]:
    """Return the power in the band of a body over the ground, and of the same without a ground."""
    permittivity = complex(GROUND.at(RADAR.center_frequency))
    if kind == "post":
        size = (distance, RADIUS, POST, HEIGHT)
        fields = [oracle.post_by_image_theory(*size, value, FREQUENCIES) for value in (permittivity, 1.0)]
        return in_band(fields[0]), in_band(fields[1])
    kept: dict[tuple[float, float], tuple[np.ndarray, ...]] = {}

    def between(tx: np.ndarray, rx: np.ndarray) -> tuple[np.ndarray, ...]:
        key = (tx[2], rx[2])
        if key not in kept:
            mount, receiver = alone.as_mount(ss.Pose(tx)), None if key[0] == key[1] else alone.as_mount(ss.Pose(rx))
            found = solve_paths(alone, RADAR, mount, "sbr", settings=FINE, max_distance=REACH, receiver=receiver)
            kept[key] = found.tx_point, found.rx_point, found.length, found.a[:, 0, 0]
        return kept[key]

    wave = 2.0 * np.pi * FREQUENCIES / oracle.SPEED_OF_LIGHT
    whole, free = (oracle.body_by_image_theory(between, HEIGHT, value, wave) for value in (permittivity, 1.0))
    return in_band(whole), in_band(free)


def by_auto(state: WorldState, tolerance: float) -> dict[str, Any]:
    """Return the power in the band of a body by `auto`, whether the road is among its mirrors, and CPU seconds."""
    start = time.process_time()
    knobs = {"channel_tolerance_db": tolerance, "tube_budget": 10**9, "max_distance": REACH}
    paths = solve_paths(state, RADAR, ss.Pose([0.0, 0.0, HEIGHT]), "auto", **knobs)
    seconds = time.process_time() - start
    number = next(number for number, info in state.world.instances.items() if info.name == "body")
    rows = np.flatnonzero(owners(paths, [number]) == number)
    power = band_power(paths, RADAR, rows, np.zeros(len(rows), dtype=np.int64), 1, len(FREQUENCIES))
    choice = next(one for one in paths.diagnostics["choices"] if one["instance"] == "body")
    return {"power": float(power[0]), "road": "road" in choice["mirrors"], "cpu": round(seconds, 2)}


def line(kind: str, number: int) -> dict[str, Any]:
    """Return the line of one distance."""
    distance = float(DISTANCES[number])
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        state, alone = states(kind, distance, Path(folder))
        exact, free = by_image_theory(kind, distance, alone)
        found = {f"{tolerance:g}": by_auto(state, tolerance) for tolerance in TOLERANCES}
    return {"kind": kind, "number": number, "distance": distance, "exact": exact, "free": free, "auto": found}


def error_db(power: float, exact: float, free: float) -> float:
    """Return the error [dB]: that of the field over the reference, or over a fade of `SHALLOW_DB` if it is deeper."""
    field = np.sqrt(max(exact, free * 10.0 ** (-SHALLOW_DB / 10.0)))
    return float(20.0 * np.log10(1.0 + abs(np.sqrt(power) - np.sqrt(exact)) / field))


def write(picture: Path) -> None:
    """Draw the figure and print the table."""
    import matplotlib.pyplot as plt

    lines = sorted(read_rows(RESULTS), key=lambda one: one["number"])
    figure, axes = plt.subplots(2, 2, figsize=(10.0, 5.5), sharex=True, height_ratios=(2, 1), layout="constrained")
    print("| body | tolerance | largest error | 90 % of the distances | road a mirror at | CPU, median |")
    print("|---|---|---|---|---|---|")
    for column, kind in enumerate(("post", "car")):
        own = [one for one in lines if one["kind"] == kind]
        distance = [one["distance"] for one in own]
        level = 10.0 * np.log10([one["exact"] for one in own])
        top, bottom = axes[:, column]
        top.semilogx(distance, level, "k", label="image theory")
        top.semilogx(distance, 10.0 * np.log10([one["free"] for one in own]), ":", color="0.5", label="no reflection")
        for tolerance, mark in zip(TOLERANCES, "ox", strict=True):
            found = [one["auto"][f"{tolerance:g}"] for one in own]
            power = np.array([one["power"] for one in found])
            top.semilogx(distance, 10.0 * np.log10(power), mark, ms=4, label=f"auto {tolerance:g} dB")
            errors = np.array([error_db(p, one["exact"], one["free"]) for p, one in zip(power, own, strict=True)])
            bottom.semilogx(distance, errors, mark, ms=4)
            cells = f"{errors.max():.2f} dB | {np.quantile(errors, 0.9):.2f} dB"
            road, cpu = sum(one["road"] for one in found), np.median([one["cpu"] for one in found])
            print(f"| {kind} | {tolerance:g} dB | {cells} | {road} of {len(own)} | {cpu:.1f} s |")
        bottom.axhline(0.5, color="0.6", lw=0.8)
        top.set(title=kind, ylabel="received over transmitted [dB]")
        top.legend(fontsize=8)
        bottom.set(xlabel="distance [m]", ylabel="error [dB]", ylim=(0.0, None))
        bottom.set_xticks([10, 20, 50, 100, 150], ["10", "20", "50", "100", "150"])
        bottom.minorticks_off()
    figure.savefig(picture, dpi=80)


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("kind", nargs="?", choices=("post", "car"))
    parser.add_argument("numbers", nargs="?", default="0:31", help="first:last[:step], the last not included")
    parser.add_argument("--write", type=Path, metavar="PICTURE")
    arguments = parser.parse_args()
    if arguments.write is not None:
        write(arguments.write)
        return
    for number in range(*map(int, arguments.numbers.split(":"))):
        found = line(arguments.kind, number)
        append_rows(RESULTS, found)
        errors = [round(error_db(one["power"], found["exact"], found["free"]), 3) for one in found["auto"].values()]
        print(f"{found['distance']:.2f} m", errors, flush=True)


if __name__ == "__main__":
    main()
