"""What a scene's light level changes: load, memory, radar, lidar and image of a frame against the detailed level.

    python benchmarks/scene_detail.py [--scene signalised_crossing] [--time 1.5] [--method raycast] [--rays 200000]
    python benchmarks/scene_detail.py --loads [SCENE ...]

Each level runs in a process of its own, so that its peak memory is its own. Radar: front sensor of the ego, no receiver
noise; power of a range-Doppler map (mean over virtual channels) in the window round each actor in view (its box and one
cell, +-1.5 m/s of its radial velocity; those that the lidar does not see are left out) and, as clutter, everywhere
else. The detailed level with 1.3 times the rays shows how much the method's own grid changes. Lidar: a scan of 64 lines
from the roof; points on each actor. Image: mean difference of 8-bit values, denoised, 320 x 180. CPU seconds stand
beside wall seconds; they count both cores. ``--loads``: files, shapes and loading of scenes at both levels, with
actors; the faster of two processes, libraries loaded before.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from harness import machine, peak_memory

from scarl_sionna.core.mount import Mount

Array = npt.NDArray[np.float64]
FRONT = (2.36, 0.0, 0.6)
ROOF = (0.0, 0.0, 1.9)


class Clock:
    """Wall and CPU seconds of a block."""

    def __enter__(self) -> Clock:
        self.wall, self.cpu = -time.perf_counter(), -time.process_time()
        return self

    def __exit__(self, *_: object) -> None:
        self.wall, self.cpu = self.wall + time.perf_counter(), self.cpu + time.process_time()

    @property
    def seconds(self) -> list[float]:
        """Wall and CPU seconds."""
        return [self.wall, self.cpu]


def actors_in_view(state: Any, ego: str) -> dict[str, tuple[float, float, float]]:
    """Return range [m], half length [m] and radial velocity [m/s] of the actors ahead within 60 deg and 90 m."""
    pose, twist = state.actor_pose(ego), state.actor_twist(ego)
    front = pose.apply(np.array(FRONT))
    found = {}
    for actor in state.world.actors:
        offset = state.actor_pose(actor.name).position + [0.0, 0.0, 0.7] - front
        distance = float(np.linalg.norm(offset))
        bearing = pose.rotation.T @ offset
        if actor.name == ego or distance > 90.0 or bearing[0] < 0.5 * distance:
            continue
        size = max(info.size[0] for info in state.world.instances.values() if info.name == actor.name)
        rate = float((state.actor_twist(actor.name).linear - twist.linear) @ offset / distance)
        found[actor.name] = (distance, 0.5 * float(size), rate)
    return found


def radar_power(state: Any, arguments: argparse.Namespace, rays: int) -> tuple[dict[str, float], list[float]]:
    """Return power [W] in the windows of the actors and elsewhere, and the seconds of the frame."""
    import scarl_sionna as ss
    from scarl_sionna.core.pose import Pose
    from scarl_sionna.radar.sensor import Radar

    radar = ss.RadarSpec.preset("awr1843boost")
    options = {"num_rays": rays} if arguments.method == "raycast" else {}
    sensor = Radar(radar, ss.RadarSettings.of(arguments.method, noise=False, **options))
    pose = state.actor_pose("ego").compose(Pose(FRONT))
    with Clock() as clock:
        frame = sensor.observe(state, Mount(pose, state.actor_twist("ego")), np.random.default_rng(0))
    rd = ss.range_doppler(ss.virtual_cube(frame.adc, radar), radar)
    power = np.mean(np.abs(rd.data) ** 2, axis=0)  # (doppler, range)
    rest, result = np.ones(power.shape, bool), {}
    span = 2.0 * float(np.max(np.abs(rd.radial_velocity))) + float(rd.radial_velocity[1] - rd.radial_velocity[0])
    for name, (distance, half, rate) in actors_in_view(state, "ego").items():
        near = np.abs(rd.range - distance) < half + radar.range_resolution
        slow = np.abs((rd.radial_velocity - rate + span / 2) % span - span / 2) < 1.5  # velocities fold
        window = slow[:, None] & near[None, :]
        if near.any():
            result[name] = float(power[window].sum())
            rest &= ~window
    return result | {"clutter": float(power[rest].sum())}, clock.seconds


def one_level(arguments: argparse.Namespace) -> None:
    """Measure one level and write the results."""
    import scarl_sionna as ss
    from camera_lidar import Camera, Lidar
    from scarl_sionna.core.pose import Pose
    from scarl_sionna.core.specs.camera import CameraSpec
    from scarl_sionna.core.specs.lidar.spec import LidarSpec

    warnings.simplefilter("ignore")
    with Clock() as clock:
        world = ss.load_scene(arguments.scene, detail=arguments.level)
    found: dict[str, Any] = {"load": clock.seconds, "after_load": peak_memory(), "shapes": len(world.parts.name)}
    found["triangles"] = sum(len(world.mesh(part).faces) for part in range(len(world.parts.name)))
    state = world.at(arguments.time)
    ego, twist = state.actor_pose("ego"), state.actor_twist("ego")
    found["radar"], cold = radar_power(state, arguments, arguments.rays)
    found["radar_again"], found["radar_seconds"] = radar_power(state, arguments, round(1.3 * arguments.rays))
    lidar = Lidar(LidarSpec.preset("spinning_64"))
    lidar.observe(state, Mount(ego.compose(Pose(ROOF)), twist), np.random.default_rng(0))
    with Clock() as clock:
        scan = lidar.observe(state, Mount(ego.compose(Pose(ROOF)), twist), np.random.default_rng(1))
    found["lidar_seconds"] = clock.seconds
    numbers = {info.name: number for number, info in world.instances.items()}
    found["lidar"] = {name: int(np.sum(scan.instance == numbers[name])) for name in actors_in_view(state, "ego")}
    found["lidar"]["all points"] = len(scan.instance)
    camera = Camera(CameraSpec(width=320, height=180, horizontal_fov_deg=75.0, images=("rgb",), samples_per_pixel=32))
    mount = ego.compose(Pose.from_euler([0.3, 0.0, 1.62], pitch=np.radians(2.0)))
    camera.observe(state, Mount(mount, twist), np.random.default_rng(0))
    with Clock() as clock:
        rgb = camera.observe(state, Mount(mount, twist), np.random.default_rng(1)).rgb
    found |= {"camera_seconds": clock.seconds, "peak": peak_memory(), "radar_cold": cold}
    arguments.out.write_text(json.dumps(found), encoding="utf-8")
    np.save(arguments.out.with_suffix(".npy"), rgb)


def decibels(a: float, b: float) -> str:
    """Return a over b."""
    return f"{10.0 * np.log10(a / b):+6.1f} dB" if a > 0.0 and b > 0.0 else "-"


def report(levels: dict[str, dict[str, Any]], images: dict[str, Array]) -> None:
    """Print the table of differences."""
    for key in ("shapes", "triangles"):
        print(f"{key:24s} detailed {levels['detailed'][key]:9d}   light {levels['light'][key]:9d}")
    for key in ("after_load", "peak"):
        print(f"memory, {key:16s} detailed {levels['detailed'][key]:7.2f} GiB light {levels['light'][key]:7.2f} GiB")
    for key in ("load", "radar_seconds", "lidar_seconds", "camera_seconds"):
        text = "   ".join(f"{name} {row[key][0]:6.2f} s wall {row[key][1]:6.2f} s CPU" for name, row in levels.items())
        print(f"{key:24s} {text}")
    full, light = levels["detailed"], levels["light"]
    print("radar                    light - detailed   other grid - detailed")
    for name in full["radar"]:
        if full["lidar"].get(name, 1) < 5:  # hidden: its window holds what leaks into it from elsewhere
            continue
        print(
            f"  {name:22s} {decibels(light['radar'][name], full['radar'][name])}           "
            f"{decibels(full['radar_again'][name], full['radar'][name])}"
        )
    print("lidar points             detailed     light")
    for name in full["lidar"]:
        print(f"  {name:22s} {full['lidar'][name]:8d}  {light['lidar'][name]:8d}")
    change = np.abs(images["detailed"] - images["light"])
    print(
        f"image: mean difference {change.mean():.2f} of 255, "
        f"{np.mean(change.max(axis=2) > 16):.1%} of the pixels by more than 16"
    )


LOAD = """
import json, sys, time
import numpy as np
import scarl_sionna as ss
ss.load_scene("highway_guardrail")  # libraries, and the kernels of what all scenes do
wall, cpu = time.perf_counter(), time.process_time()
world = ss.load_scene(sys.argv[1], detail=sys.argv[2])
seconds = [time.perf_counter() - wall, time.process_time() - cpu]
parts = range(len(world.parts.name))
still = [part for part in parts if world.parts.actor[part] < 0]
count = lambda chosen: sum(len(world.mesh(part).faces) for part in chosen)
print(json.dumps([*seconds, len(still), count(still), len(parts), count(parts)]))
"""


def loads(scenes: list[str]) -> None:
    """Print files, shapes and loading of scenes at both levels."""
    from scenes_xml import scene_path

    print("scene                level      files MB   shapes  triangles   with actors            load wall s   CPU s")
    for scene in scenes:
        for level in ("detailed", "light"):
            folder = scene_path(scene, 0, level).parent
            size = sum(
                file.stat().st_size for file in folder.rglob("*") if file.suffix in (".ply", ".png", ".xml", ".toml")
            )
            command = [sys.executable, "-c", LOAD, scene, level]
            rows = [
                json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout) for _ in range(2)
            ]
            wall, cpu, still, own, parts, total = min(rows)
            print(
                f"{scene:20s} {level:9s} {size / 1e6:9.2f} {still:8d} {own:10d} {parts:8d} "
                f"{total:10d} {wall:14.2f} {cpu:7.2f}",
                flush=True,
            )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scene", default="signalised_crossing")
    parser.add_argument("--time", type=float, default=1.5)
    parser.add_argument("--method", default="raycast")
    parser.add_argument("--rays", type=int, default=200_000)
    parser.add_argument("--loads", nargs="*", metavar="SCENE", help="load these scenes only, or all that have levels")
    parser.add_argument("--level", choices=("detailed", "light"), help=argparse.SUPPRESS)
    parser.add_argument("--out", type=Path, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.level:
        one_level(arguments)
        return
    print(machine())
    if arguments.loads is not None:
        from scenes_xml import scene_names

        built = ("highway_guardrail", "urban_crossing")  # these come at one level
        loads(arguments.loads or [name for name in scene_names() if name not in built])
        return
    print(f"{arguments.scene} at {arguments.time:g} s, radar by {arguments.method}")
    levels, images = {}, {}
    with tempfile.TemporaryDirectory() as folder:
        for level in ("detailed", "light"):
            out = Path(folder) / f"{level}.json"
            own = [
                f"--scene={arguments.scene}",
                f"--time={arguments.time}",
                f"--method={arguments.method}",
                f"--rays={arguments.rays}",
            ]
            subprocess.run([sys.executable, __file__, *own, f"--level={level}", f"--out={out}"], check=True)
            levels[level] = json.loads(out.read_text(encoding="utf-8"))
            images[level] = np.load(out.with_suffix(".npy")).astype(np.float64)
    report(levels, images)


if __name__ == "__main__":
    main()
