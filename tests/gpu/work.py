"""What runs on a backend for `test_cuda.py`: every solver, camera and lidar; the numbers go into a file.

SCARL_BACKEND=cuda python -m tests.gpu.work numbers.npz
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np

import scarl_sionna as ss
from camera_lidar import Camera, Lidar
from scarl_sionna.core.errors import ScarlWarning
from scarl_sionna.engine.backend.bootstrap import ensure_engine

SCENE = "highway_guardrail"
BODY = "sign_bend"
COARSE = {"max_phase": 1.0, "max_depth": 2}
SOLVERS: dict[str, dict[str, Any]] = {
    "raycast": {"num_rays": 50_000},
    "sionna": {},
    "sbr": {"instances": [BODY, "car_ahead"], "settings": ss.SbrSettings(**COARSE)},
    "scatterers": {"models": {"car_ahead": ss.ScattererModel.tr38901("car")}},
    "hybrid": {"plan": ss.ChannelPlan((ss.Share("sbr", (BODY,), COARSE, through_mirrors=True),), ("road",))},
    "auto": {"accuracy": ss.Accuracy(tube_budget=3000)},
}
LIDARS = ("fmcw_forward", "hdl32e")
"""By heterodyning, and by the pulse."""


def power_and_lengths(paths: ss.RadarPaths) -> dict[str, Any]:
    """Return the number of paths, the sum of their powers, and the lengths of the strongest [m]."""
    power = np.sum(np.abs(paths.a) ** 2, axis=(1, 2))
    strongest = np.argsort(-power, kind="stable")[:50]
    return {"count": paths.num_paths, "power": power.sum(), "lengths": np.sort(np.asarray(paths.length)[strongest])}


def tasks() -> dict[str, Callable[[], dict[str, Any]]]:
    """Return what is run, by name."""
    state = ss.load_scene(SCENE).at(0.0)
    radar = ss.RadarSpec.preset("awr1843boost")
    front, roof = (state.mount("ego", ss.Pose(place)) for place in ([2.6, 0.0, 0.6], [0.0, 0.0, 2.0]))

    def channel(method: str) -> Callable[[], dict[str, Any]]:
        return lambda: power_and_lengths(ss.solve_paths(state, radar, front, method, **SOLVERS[method]))

    def camera() -> dict[str, Any]:
        spec = ss.CameraSpec(width=320, height=180, samples_per_pixel=16)
        frame = Camera(spec).observe(state, roof, np.random.default_rng(0))
        return {"depth": frame.depth, "instance": frame.instance, "rgb": frame.rgb.mean(axis=(0, 1))}

    def lidar(name: str) -> Callable[[], dict[str, Any]]:
        def scan() -> dict[str, Any]:
            found = Lidar(ss.LidarSpec.preset(name)).observe(state, roof, np.random.default_rng(0))
            return {"points": found.num_points, "distance": np.sort(found.distance)}

        return scan

    solvers, lidars = {method: channel(method) for method in SOLVERS}, {name: lidar(name) for name in LIDARS}
    return {**solvers, "camera": camera, **lidars}


def main() -> None:
    warnings.simplefilter("ignore", ScarlWarning)
    numbers: dict[str, Any] = {"backend": ensure_engine()}
    for name, call in tasks().items():
        numbers |= {f"{name}.{key}": value for key, value in call().items()}
    np.savez(sys.argv[1], **numbers)


if __name__ == "__main__":
    main()
