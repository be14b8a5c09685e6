"""Small scenarios to export, the command as a process, and the contents of a dataset."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

from scarl_sionna.core.pose import Pose
from scarl_sionna.core.settings.radar import RadarSettings
from scarl_sionna.core.specs.camera import CameraSpec
from scarl_sionna.core.specs.lidar.spec import LidarSpec
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.fusion import Rig, SensorMount
from scarl_sionna.scenario.spec.scenario import ScenarioSpec
from tests.children import with_parent
from tests.scenes import Thing, box, plane, write_scene

PLACE = Pose([2.0, 0.0, 1.0])
FEW_RAYS = RadarSettings(raycast={"num_rays": 500}, accuracy={"tube_budget": 50})
RIG = Rig(
    "tiny",
    (
        SensorMount("front/camera", "camera", CameraSpec(width=32, height=18, samples_per_pixel=1), PLACE),
        SensorMount("front/lidar", "lidar", LidarSpec(num_azimuth=31, num_elevation=9), PLACE),
        SensorMount("front/radar", "radar", RadarSpec().with_(num_chirps=8, num_samples=64), PLACE, FEW_RAYS),
    ),
)
SHARD_FRAMES = 4
BESIDE = (".locks", ".work", "export.log", "contact_sheet.png")
"""What is no data of a dataset."""


def scene_file(folder: Path) -> Path:
    """Return a scene with a driving ego, a car ahead and a wall, known from 0 to 2 s."""
    times = [0.0, 1.0, 2.0]
    return write_scene(
        folder,
        instances=[
            Thing("road", plane(400.0, 100.0), "Roads", is_object=False),
            Thing("wall", plane(40.0, 10.0, (60.0, 0.0, 5.0), (-1, 0, 0)), "Wall"),
        ],
        actors=[
            Thing(
                "ego",
                box([4.0, 1.6, 0.6], [0, 0, 0.4]),
                "Car",
                trajectory={
                    "kind": "constant_twist",
                    "position": [0.0, 0.0, 0.0],
                    "velocity": [10.0, 0.0, 0.0],
                    "angular_velocity_z": 0.2,
                },
            ),
            Thing(
                "car",
                box([4.0, 1.6, 1.4], [0, 0, 0.7]),
                "Car",
                "steel",
                trajectory={
                    "kind": "waypoints",
                    "times": times,
                    "positions": [[20.0 + 15.0 * t, 0.0, 0.0] for t in times],
                },
            ),
        ],
        ego="ego",
    )


def scenario_files(folder: Path, **frames: int) -> list[Path]:
    """Write a scenario file for each name with its number of frames; their seeds differ."""
    folder.mkdir(parents=True, exist_ok=True)
    scene = scene_file(folder)
    RIG.save(folder / "rig.yaml")
    paths = []
    for seed, (name, count) in enumerate(frames.items()):
        scenario = ScenarioSpec(
            scene=str(scene), rig=str(folder / "rig.yaml"), num_frames=count, frame_rate=50.0, seed=seed, name=name
        )
        paths.append(folder / f"{name}.yaml")
        scenario.save(paths[-1])
    return paths


def command(*arguments: object) -> list[str]:
    """Return the command line of an export with small shards."""
    return [
        sys.executable,
        "-m",
        "scarl_sionna.cli",
        "export",
        *map(str, arguments),
        "--shard-frames",
        str(SHARD_FRAMES),
    ]


def start(*arguments: object, **options: object) -> subprocess.Popen:
    """Start an export as a process."""
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    return subprocess.Popen(command(*arguments), **pipes, **with_parent(), **options)  # type: ignore[call-overload]


def run(*arguments: object) -> subprocess.CompletedProcess:
    """Run an export as a process to its end."""
    return subprocess.run(
        command(*arguments), capture_output=True, text=True, check=False, timeout=300, **with_parent()
    )


def contents(out: Path) -> dict[str, bytes]:
    """Return all data of a dataset: every file but locks, kept frames, the log and the picture."""
    found = {}
    for folder, _, names in os.walk(out):
        for name in names:
            path = Path(folder) / name
            relative = path.relative_to(out)
            if relative.parts[0] not in BESIDE:
                found[relative.as_posix()] = path.read_bytes()
    return found


def wait_until(condition: Callable[[], bool], process: subprocess.Popen, seconds: float = 120.0) -> bool:
    """Wait until a condition holds (True) or a process has ended (False)."""
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        if condition():
            return True
        if process.poll() is not None:
            return False
        time.sleep(0.005)
    raise AssertionError(f"nothing happened in {seconds:g} s")


def wait_until_gone(group: int, seconds: float = 30.0) -> bool:
    """Wait until no process of a group is left."""
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        try:
            os.killpg(group, 0)
        except ProcessLookupError:
            return True
        time.sleep(0.1)
    return False


def kept_frames(out: Path) -> set[tuple[str, int]]:
    """Return scene and index of the frames that are finished: kept alone, or in a finished shard."""
    while True:
        try:
            alone = {(path.parts[-3], int(path.stem)) for path in out.glob(".work/*/*/*.pack")}
            records = [(path.parent.name, path.read_text()) for path in out.glob("shards/*/??????.json")]
        except FileNotFoundError:
            continue  # a running export removed it meanwhile
        return alone.union((scene, index) for scene, text in records for index in json.loads(text)["frames"])
