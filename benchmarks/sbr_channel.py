"""Error and time of the channel solver sbr: plate, trihedral, a car near and far, 10^6 tubes, a whole frame, memory.

Run: ``python benchmarks/sbr_channel.py [plate] [trihedral] [car] [speed] [scene] [memory]`` (all by default). Prints
Markdown tables. Seconds are of warm calls: wall, and CPU of all threads, which another load on the machine changes
less.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import scarl_sionna as ss
from benchmarks.harness import ANY_COST, machine, measure, peak_memory
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.settings.sbr import SbrSettings
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.radar.channel import solve_paths
from tests.oracles import rcs as oracle
from tests.oracles.near_field_po import rectangle_transfer
from tests.scenes import Thing, plane, write_scene

ALL = SbrSettings(floor_db=None, diffuse=False)
WIDE = RadarSpec(elevation_fov_deg=120.0)
WAVELENGTH = SPEED_OF_LIGHT / WIDE.center_frequency
DEFAULT = SbrSettings().max_phase


def _state(mesh: trimesh.Trimesh) -> Any:
    with tempfile.TemporaryDirectory() as folder:
        return ss.load_scene(write_scene(Path(folder), [Thing("target", mesh, "Static", "steel")])).at(0.0)


def _signal(paths: ss.RadarPaths) -> complex:
    center = paths.world_from_tx.position
    length = sum(np.linalg.norm(point - center, axis=1) for point in (paths.tx_point, paths.rx_point))
    return complex(np.sum(paths.a[:, 0, 0] * np.exp(-2j * np.pi * length / WAVELENGTH)))


def _looking_back(x: float, y: float, z: float, distance: float) -> Pose:
    unit = np.array([x, y, z]) / np.linalg.norm([x, y, z])
    return Pose.from_euler(unit * distance, yaw=np.pi + np.arctan2(y, x), pitch=np.arcsin(unit[2]))


def plate() -> None:
    """Largest error over +-5 deg of plates at 10 m for each knob."""
    print(
        "\n| plate at 10 m | max_phase, integration_phase | paths | largest error [dB] | "
        "mean [dB] | a solve [s] | CPU [s] |"
    )
    print("|---|---|---|---|---|---|---|")
    for size in (0.1, 1.0):
        state = _state(plane(size, size, normal=(1, 0, 0)))
        poses = [_looking_back(np.cos(angle), np.sin(angle), 0.0, 10.0) for angle in np.radians(np.linspace(-5, 5, 21))]
        edges = np.array([0, -size / 2, -size / 2]), [0, size, 0], [0, 0, size]
        up = np.array([0, 0, 1.0])
        exact = [
            rectangle_transfer(*edges, pose.position, WAVELENGTH, up, nodes=int(100 + 300 * size)) for pose in poses
        ]
        for max_phase, integration_phase in ((2.0, 0.1), (1.0, 0.05), (0.4, 0.02), (0.2, 0.01), (0.1, 0.01)):
            knobs = ALL.with_(max_phase=max_phase, integration_phase=integration_phase)
            errors, wall, cpu = [], 0.0, 0.0
            for pose, truth in zip(poses, exact, strict=True):
                start = time.perf_counter(), time.process_time()
                paths = solve_paths(state, WIDE, pose, method="sbr", settings=knobs, **ANY_COST)
                wall, cpu = wall + (time.perf_counter() - start[0]) / 21, cpu + (time.process_time() - start[1]) / 21
                errors.append(abs(20 * np.log10(abs(_signal(paths) / truth))))
            print(
                f"| {size:g} m | {max_phase:g}, {integration_phase:g}{' (default)' if max_phase == DEFAULT else ''} | "
                f"{paths.num_paths} | {max(errors):.3f} | {np.mean(errors):.3f} | {wall:.3f} | {cpu:.3f} |"
            )


def trihedral() -> None:
    """Error of a trihedral of 10 cm at 50 m against the far-field solver, boresight and 10 deg off it."""
    vertices, faces = oracle.TRIHEDRAL_MESH
    mesh = trimesh.Trimesh(np.array(vertices) * 0.1, faces, process=False)
    state = _state(mesh)
    print("\n| trihedral at 50 m | max_phase | edge_share | paths | error [dB] | 10 deg off [dB] | CPU [s] |")
    print("|---|---|---|---|---|---|---|")
    corner = np.arccos(1 / 3**0.5)
    angles = ((corner, np.pi / 4), (corner + np.radians(10), np.pi / 4 + np.radians(5)))
    exact = [float(ss.rcs(mesh, WIDE.center_frequency, *angle)) for angle in angles]
    for max_phase, edge_share in ((2.0, 1.0), (0.4, 0.5), (0.4, 0.125), (0.2, 0.125), (0.1, 0.125), (0.02, 0.125)):
        knobs = ALL.with_(max_phase=max_phase, edge_share=edge_share)
        errors, cpu = [], time.process_time()
        for (theta, phi), sigma in zip(angles, exact, strict=True):
            pose = _looking_back(np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta), 50.0)
            paths = solve_paths(state, WIDE, pose, method="sbr", settings=knobs, **ANY_COST)
            found = abs(_signal(paths)) ** 2 * (4 * np.pi) ** 3 * 50.0**4 / WAVELENGTH**2
            errors.append(10 * np.log10(found / sigma))
        print(
            f"| | {max_phase:g} | {edge_share:g} | {paths.num_paths} | {errors[0]:+.3f} | {errors[1]:+.3f} | "
            f"{(time.process_time() - cpu) / 2:.3f} |"
        )


def _highway() -> tuple[Any, RadarSpec, Pose]:
    state = ss.load_scene("highway_guardrail").at(0.0)
    return state, RadarSpec.preset("awr1843boost"), state.actor_pose("ego").compose(Pose([2.40, 0.0, 0.6]))


def car() -> None:
    """Error in the range cells of the two cars of highway_guardrail against a finer run, and time."""
    state, radar, pose = _highway()
    radar = radar.with_(num_chirps=1)
    runs: list[tuple[str, dict[str, Any]]] = [
        ("**default**", {}), ("max_phase 0.4", {"max_phase": 0.4}), ("max_phase 1", {"max_phase": 1.0}),
        ("max_phase 0.1", {"max_phase": 0.1}), ("num_tubes 10^5", {"num_tubes": 100_000}),
        ("num_tubes 10^6", {"num_tubes": 1_000_000}), ("edge_share 0.25", {"edge_share": 0.25}),
        ("edge_share 1, ray_share 1", {"edge_share": 1.0, "ray_share": 1.0}),
        ("max_depth 2", {"max_depth": 2}), ("max_depth 1", {"max_depth": 1}),
        ("corner_share 0.5", {"corner_share": 0.5}), ("corner_share 0.0625", {"corner_share": 0.0625}),
        ("bisections 5", {"bisections": 5}), ("bisections 12", {"bisections": 12}),
        ("grazing_cosine 0.1", {"grazing_cosine": 0.1}), ("grazing_cosine 0.005", {"grazing_cosine": 0.005}),
    ]  # fmt: skip # a table
    for name in ("car_ahead", "oncoming"):

        def cells(knobs: SbrSettings, name: str = name) -> tuple[np.ndarray, int, float]:
            cpu = time.process_time()
            paths = solve_paths(state, radar, pose, method="sbr", instances=[name], settings=knobs, **ANY_COST)
            cpu = time.process_time() - cpu
            rd = ss.range_doppler(ss.virtual_cube(ss.synthesize(paths, radar), radar), radar)
            length = np.linalg.norm(paths.rx_point - pose.position, axis=1)
            inside = (rd.range > length.min() - 0.25) & (rd.range < length.max() + 0.25)
            return np.mean(np.abs(rd.data[:, 0]) ** 2, axis=0)[inside], paths.num_paths, cpu

        cells(ALL)
        exact, num_paths, cpu = cells(ALL.with_(max_phase=0.05, integration_phase=0.005, ray_share=0.25))
        distance = np.linalg.norm(state.actor_pose(name).position - pose.position)
        print(
            f"\n{name}, centre at {distance:.1f} m: reference of {num_paths} paths, {cpu:.2f} CPU-s, {len(exact)} cells"
        )
        print("| knobs | paths | median [dB] | largest [dB] | CPU [s] |\n|---|---|---|---|---|")
        for label, changed in runs:
            power, num_paths, cpu = cells(ALL.with_(**changed))
            strong = exact[: len(power)] > 1e-4 * exact.max()
            error = np.abs(10 * np.log10(power[: len(exact)] / exact[: len(power)]))[strong]
            print(f"| {label} | {num_paths} | {np.median(error):.2f} | {error.max():.2f} | {cpu:.2f} |")


def speed() -> None:
    """10^6 first tubes, 3 bounces, 12 channels, 512 samples x 256 chirps: paths and cube."""
    state, radar, pose = _highway()
    print(f"\n{radar.num_virtual} channels, {radar.num_samples} x {radar.num_chirps}")
    print(
        "| scene | tubes by bounce | paths | cold [s] | solve and cube, warm [s] | CPU [s] |\n|---|---|---|---|---|---|"
    )
    for label, names in (
        ("car ahead", ["car_ahead"]),
        ("both cars and signs", ["car_ahead", "oncoming", "sign_speed"]),
    ):
        last: list[ss.RadarPaths] = []

        def frame(names: list[str] = names, last: list[ss.RadarPaths] = last) -> None:
            paths = solve_paths(
                state, radar, pose, method="sbr", instances=names, settings=SbrSettings(num_tubes=1_000_000), **ANY_COST
            )
            ss.virtual_cube(ss.synthesize(paths, radar), radar)
            last[:] = [paths]

        timing = measure(frame, repeats=3)
        tubes = ", ".join(str(count) for count in last[0].diagnostics["num_tubes"].values())
        print(f"| {label} | {tubes} | {last[0].num_paths} | {timing.cold:.1f} | {timing.wall:.2f} | {timing.cpu:.2f} |")


def scene() -> None:
    """Objects of highway_guardrail, with the default knobs."""
    state, radar, pose = _highway()
    every = [info.name for info in state.world.instances.values() if info.is_object or info.actor]
    print(
        "\n| objects | max_depth | patches | paths | warm [s] | CPU [s] | peak memory [GiB] "
        "|\n|---|---|---|---|---|---|---|"
    )
    for label, names, depth in (
        ("car ahead", ["car_ahead"], 3),
        ("guardrail", ["guardrail_right"], 1),
        ("guardrail", ["guardrail_right"], 3),
        ("all without trees", [name for name in every if not name.startswith("tree")], 1),
        ("all", every, 1),
        ("all without trees", [name for name in every if not name.startswith("tree")], 3),
    ):
        for _ in range(2):
            wall, cpu = time.perf_counter(), time.process_time()
            paths = solve_paths(
                state, radar, pose, method="sbr", instances=names, settings=SbrSettings(max_depth=depth), **ANY_COST
            )
            wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
            if wall > 30.0:
                break
        print(
            f"| {label} | {depth} | {paths.diagnostics['num_patches']} | {paths.num_paths} | "
            f"{wall:.2f} | {cpu:.2f} | {peak_memory():.2f} |",
            flush=True,
        )


def memory() -> None:
    """Peak memory of 10^7 tubes in a process of its own."""
    print("\n| first tubes | paths | CPU [s] | peak memory of the process [GiB] |\n|---|---|---|---|")
    for wanted in (1_000_000, 10_000_000):
        done = subprocess.run(
            [sys.executable, __file__, f"memory-of={wanted}"], capture_output=True, text=True, check=True
        )
        print(done.stdout.strip().splitlines()[-1], flush=True)


def _memory_of(wanted: int) -> None:
    state, radar, pose = _highway()
    cpu = time.process_time()
    paths = solve_paths(
        state, radar, pose, method="sbr", instances=["car_ahead"], settings=SbrSettings(num_tubes=wanted), **ANY_COST
    )
    cpu = time.process_time() - cpu
    print(f"| {paths.diagnostics['num_tubes'][1]} | {paths.num_paths} | {cpu:.1f} | {peak_memory():.2f} |")


if __name__ == "__main__":
    if sys.argv[1:] and sys.argv[1].startswith("memory-of="):
        _memory_of(int(sys.argv[1].split("=")[1]))
        sys.exit()
    print(machine())
    tasks = (plate, trihedral, car, speed, scene, memory)
    chosen = sys.argv[1:] or [task.__name__ for task in tasks]
    for task in tasks:
        if task.__name__ in chosen:
            task()
