"""The same input gives the same bytes: twice in one process, and in two processes, for every channel solver."""

from __future__ import annotations

import hashlib
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from scarl_sionna.core.pose import Pose
from scarl_sionna.core.settings.radar import RadarSettings
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.engine.load import load_scene
from scarl_sionna.radar.channel import ChannelPlan, Share, solve_paths
from scarl_sionna.radar.scatterers.model import ScattererModel
from tests.scenes import Thing, ball, box, plane, write_scene

RADAR = RadarSpec()
SETTINGS = RadarSettings(raycast={"num_rays": 50_000}, accuracy={"tube_budget": 5_000})
METHODS = ("raycast", "sionna", "sbr", "scatterers", "hybrid", "auto")


def digests(folder: Path) -> dict[str, str]:
    """Return a hash of the paths of each method."""
    things = [
        Thing("road", plane(64.0, 16.0, (28, 0, 0)), "Roads", "grey", is_object=False),
        Thing("wall", plane(32.0, 8.0, (20, 6, 4), (0, -1, 0)), "Wall", "grey", is_object=False),
        Thing("car", box((4, 2, 1.25), (20, 1, 0.75)), "Car", "steel"),
        Thing("ball", ball(0.25, (12, -2, 1), 3), "Static", "steel"),
    ]
    state = load_scene(write_scene(folder, things)).at(0.0)
    amplitude = np.full((1, 2, 2, 2, 2), 0.3 + 0.1j, np.complex64)
    centers = np.array([[18.0, 0.5, 1.0], [18.0, 1.5, 1.0]])
    model = ScattererModel(
        centers, np.array([0.0, np.pi]), np.zeros(1), amplitude, RADAR.center_frequency, 0.1, 1.0, np.pi
    )
    shares = (Share("sbr", ("ball",), through_mirrors=True), Share("raycast", ("*",)))
    options = {
        "sionna": {"num_samples": 20_000},
        "scatterers": {"models": {"car": model}},
        "hybrid": {"plan": ChannelPlan(shares, ("wall",), sionna={"num_samples": 20_000})},
    }
    result = {}
    for method in METHODS:
        paths = solve_paths(state, RADAR, Pose([0.0, 0.0, 0.6]), method, settings=SETTINGS, **options.get(method, {}))
        assert paths.num_paths, method
        arrays = [value for value in vars(paths).values() if isinstance(value, np.ndarray)]
        result[method] = hashlib.sha256(b"".join(np.ascontiguousarray(value).tobytes() for value in arrays)).hexdigest()
    return result


def test_same_bytes_twice_and_in_another_process(tmp_path) -> None:
    first, second = digests(tmp_path / "a"), digests(tmp_path / "b")
    assert first == second
    done = subprocess.run([sys.executable, "-m", __name__], capture_output=True, text=True, check=True)
    assert dict(line.split() for line in done.stdout.splitlines()) == first


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        for name, digest in digests(Path(folder)).items():
            print(name, digest)
