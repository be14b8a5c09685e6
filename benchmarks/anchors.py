"""Synthesis and `raycast` beside the plainest fast programs for the same numbers, timed in turn in one run.

    python benchmarks/anchors.py [--paths 100000] [--rays 1000000] [--rounds 3]

Of the signal: the separable sum by BLAS (complex64, with its exponentials and without them), one non-uniform transform
by finufft, both without the migration of ranges over the frame that `synthesize` has, and the FFT of the finished cube.
Of `raycast`: its rays alone through Embree, in float32 and without what is done with a hit.
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections.abc import Callable

import finufft
import numpy as np
import scipy.fft
from harness import machine
from synthesis import STRAIGHT, random_points

import scarl_sionna as ss
from scarl_sionna.core.errors import ScarlWarning
from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.engine import variant

TOLERANCE = 1e-4
"""Of finufft: the default of `synthesize`."""


def signal_calls(count: int) -> dict[str, Callable[[], object]]:
    """Return the calls of the signal's part, by their names in the table."""
    radar = ss.RadarSpec()
    paths = random_points(radar, count, -70.0, 70.0)
    delay = np.linalg.norm(paths.tx_point, axis=1) * 2.0 / SPEED_OF_LIGHT
    beat = 2.0 * np.pi * radar.sampled_bandwidth * delay / radar.num_samples
    turn = 2.0 * np.pi * paths.length_rate / radar.wavelength * radar.frame_time / radar.num_chirps
    rng = np.random.default_rng(0)
    weights = np.exp(2j * np.pi * rng.uniform(size=(radar.num_virtual, count))).astype(np.complex64)
    sizes = radar.num_chirps, radar.num_samples
    slow, fast = (np.remainder(phase + np.pi, 2.0 * np.pi) - np.pi for phase in (turn, beat))

    def factors() -> tuple[np.ndarray, np.ndarray]:
        return tuple(
            np.exp(1j * np.arange(size)[:, None] * phase).astype(np.complex64)
            for size, phase in zip(sizes, (slow, fast), strict=True)
        )

    ready = factors()

    def separable(pair: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
        return np.stack([(pair[0] * weight) @ pair[1].T for weight in weights])

    def transform() -> np.ndarray:
        return finufft.nufft2d1(slow, fast, weights.astype(np.complex128), sizes, eps=TOLERANCE)

    cube = separable(ready)
    found = transform()
    shift = np.exp(1j * (sizes[0] // 2 * slow + sizes[1] // 2 * fast))  # its indices are centred
    exact = (ready[0][:3] * weights[0]) @ ready[1][:3].T
    again = finufft.nufft2d1(slow, fast, (weights[0] * shift).astype(np.complex128), sizes, eps=TOLERANCE)
    assert np.abs(again[:3, :3] - exact).max() < 1e-3 * np.abs(again).max(), "both sum the same tones"
    assert found.shape == cube.shape
    accuracy = ss.Accuracy(**STRAIGHT)
    return {
        f"`synthesize`, {count:,} paths, {radar.num_virtual} channels, within 70 m/s, migration included": lambda: (
            ss.synthesize(paths, radar, accuracy=accuracy)
        ),
        "the same tones by one finufft transform, no migration": transform,
        "the same tones by the separable sum in BLAS, no migration": lambda: separable(factors()),
        "the same, exponentials ready": lambda: separable(ready),
        "FFT of the finished cube": lambda: scipy.fft.fft2(cube, workers=1),
    }


def ray_calls(count: int) -> dict[str, Callable[[], object]]:
    """Return the calls of `raycast`'s part, by their names in the table."""
    state, radar = ss.load_scene("highway_guardrail").at(0.0), ss.RadarSpec.preset("awr1843boost")
    mount = state.mount("ego", ss.Rig.front()["front_center/radar"].vehicle_from_sensor)
    rng = np.random.default_rng(0)
    half = np.radians([radar.azimuth_fov_deg, radar.elevation_fov_deg]) / 2.0
    azimuth, elevation = (rng.uniform(-limit, limit, count) for limit in half)
    local = [np.cos(azimuth) * np.cos(elevation), np.sin(azimuth) * np.cos(elevation), np.sin(elevation)]
    directions = (mount.pose.rotation @ np.array(local)).astype(np.float32)

    def plain() -> object:
        import drjit as dr

        with variant.optical() as mi:
            scene = state.optical_scene()
            origin = mi.Point3f(mount.pose.position.tolist())
            hit = scene.ray_intersect_preliminary(mi.Ray3f(origin, mi.Vector3f(directions)), coherent=False)
            dr.eval(hit.t, hit.prim_index, hit.shape)
            dr.sync_thread()
            return hit

    return {
        f"`raycast`, highway_guardrail, {count:,} rays to the path table": lambda: ss.solve_paths(
            state, radar, mount, "raycast", num_rays=count
        ),
        "as many rays over the same view through Embree, nothing else": plain,
    }


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--paths", type=int, default=100_000)
    parser.add_argument("--rays", type=int, default=1_000_000)
    parser.add_argument("--rounds", type=int, default=3)
    arguments = parser.parse_args()
    warnings.simplefilter("ignore", ScarlWarning)
    calls = {**signal_calls(arguments.paths), **ray_calls(arguments.rays)}
    rows: dict[str, list[tuple[float, float]]] = {name: [] for name in calls}
    for number in range(arguments.rounds + 1):
        for name, call in calls.items():
            start = time.process_time(), time.thread_time()
            call()
            if number:  # the first compiles
                rows[name].append((time.process_time() - start[0], time.thread_time() - start[1]))
    print(machine(), "\n\n| what | CPU [s] | on the main thread [s] |\n|---|---|---|")
    for name, values in rows.items():
        cpu, thread = np.median(values, axis=0).tolist()
        print(f"| {name} | {cpu:.3f} | {thread:.3f} |")


if __name__ == "__main__":
    main()
