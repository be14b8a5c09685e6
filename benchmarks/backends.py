"""The same work on LLVM and on CUDA: time, and how far the results are apart. Without a CUDA device LLVM runs alone.

    python benchmarks/backends.py [--scene highway_guardrail] [--repeats 3] [--rays 1000000]
    python benchmarks/backends.py --against llvm     LLVM twice: what two runs differ by, of themselves

Each backend has a process of its own. The work: radar paths by several methods, an image with labels, a lidar's scan.
Printed for each is by how much the numbers of the second process depart from those of the first: a single number
relatively, values by the largest difference, labels by the share that is another.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))


def radar_numbers(paths: Any) -> dict[str, Any]:
    power = np.sum(np.abs(paths.a) ** 2, axis=(1, 2))
    strongest = np.argsort(-power, kind="stable")[:100]
    return {"power": power.sum(), "paths": paths.num_paths, "lengths": np.sort(np.asarray(paths.length)[strongest])}


def tasks(scene: str, rays: int) -> dict[str, Callable[[], dict[str, Any]]]:
    """Return what is run: by name, a function that returns numbers."""
    import scarl_sionna as ss
    from camera_lidar import Camera, Lidar

    state = ss.load_scene(scene).at(0.0)
    radar = ss.RadarSpec.preset("awr1843boost")
    front, roof = (state.mount("ego", ss.Pose(place)) for place in ([2.6, 0.0, 0.6], [0.0, 0.0, 2.0]))

    bodies = [
        number
        for number, info in state.world.instances.items()
        if info.is_object and info.name != "ego" and not info.name.startswith("tree")
    ]
    fields: dict[str, dict[str, Any]] = {
        "raycast": {"num_rays": rays},
        "sionna": {},
        "sbr": {"settings": ss.SbrSettings(max_phase=1.0, integration_phase=0.02, max_depth=2), "instances": bodies},
        "auto": {},
    }

    def channel(method: str) -> Callable[[], dict[str, Any]]:
        return lambda: radar_numbers(ss.solve_paths(state, radar, front, method, **fields[method]))

    def camera() -> dict[str, Any]:
        frame = Camera(ss.CameraSpec(width=960, height=540)).observe(state, roof, np.random.default_rng(0))
        return {"depth": frame.depth, "instance": frame.instance, "mean": frame.rgb.mean()}

    def lidar() -> dict[str, Any]:
        scan = Lidar(ss.LidarSpec.preset("spinning_64")).observe(state, roof, np.random.default_rng(0))
        return {"shot": scan.shot, "distance": scan.distance, "returns": scan.num_points}

    return {**{method: channel(method) for method in fields}, "camera": camera, "lidar": lidar}


def work(args: argparse.Namespace) -> None:
    """Run all tasks in this process and store times and numbers."""
    from benchmarks.harness import machine, measure
    from scarl_sionna.core.errors import ScarlWarning
    from scarl_sionna.engine.backend.bootstrap import ensure_engine

    warnings.simplefilter("ignore", ScarlWarning)  # methods are used outside of their range
    print(f"{ensure_engine()}: {machine()}", flush=True)
    found: dict[str, Any] = {}
    for name, call in tasks(args.scene, args.rays).items():
        timing = measure(call, args.repeats)
        print(f"{name:8} {timing}", flush=True)
        found |= {f"{name}.{key}": value for key, value in call().items()} | {f"{name}.wall": timing.wall}
    np.savez(args.out, **found)


def departure(first: Any, second: Any) -> str:
    """Return in words by how much values depart from others."""
    if first.shape != second.shape:
        return f"{first.shape} and {second.shape}"
    if not first.ndim:
        return f"{abs(second - first) / max(abs(float(first)), 1e-300):.1e} of {float(first):.6g}"
    if first.dtype.kind in "iub":
        return f"{np.mean(first != second):.1e} of {first.size} are others"
    known = np.isfinite(first) & np.isfinite(second)
    lost = np.mean(np.isfinite(first) != np.isfinite(second))
    return f"at most {np.abs(first[known] - second[known]).max(initial=0.0):.1e}, {lost:.1e} in one alone"


def compare(first: Path, second: Path) -> None:
    """Print a table of two stored results."""
    with np.load(first) as one, np.load(second) as other:
        print("\n| what | departure |\n|---|---|")
        for name in one.files:
            if name.endswith(".wall"):
                print(f"| {name[:-5]}, time | {one[name]:.3f} s and {other[name]:.3f} s |")
            else:
                print(f"| {name} | {departure(one[name], other[name])} |")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scene", default="highway_guardrail")
    parser.add_argument("--rays", type=int, default=1_000_000, help="of raycast")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--against", choices=("cuda", "llvm"), default="cuda")
    parser.add_argument("--out", type=Path, help=argparse.SUPPRESS)  # the process of one backend
    args = parser.parse_args()
    if args.out:
        return work(args)
    from scarl_sionna.engine.backend.bootstrap import available_backends

    usable = available_backends()
    with tempfile.TemporaryDirectory() as folder:
        files = []
        for number, backend in enumerate(("llvm", args.against)):
            if backend not in usable:
                print(f"{backend}: cannot be used here; scarl-sionna info tells why")
                continue
            files.append(Path(folder) / f"{number}.npz")
            subprocess.run(
                [sys.executable, __file__, *sys.argv[1:], "--out", files[-1]],
                env=os.environ | {"SCARL_BACKEND": backend},
                check=True,
            )
        if len(files) == 2:
            compare(*files)


if __name__ == "__main__":
    main()
