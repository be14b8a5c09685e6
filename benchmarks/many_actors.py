"""Seconds a frame against the number of actors in one scene: state, acceleration structures of both twins, and loading.

    python benchmarks/many_actors.py [--actors 10,50,200] [--details light,detailed] [--frames 6] [--step 0.1]
        [--scene urban_crossing] [--scene-detail detailed] [--traffic]

Actors of all models of ``scenes_xml/actors`` drive, cycle and walk on bends beside a scene; all of them move in every
frame. `state` is ``world.at(t)`` with the pose of every wheel and limb, `optical` and `radio` write all vertices into a
twin and make its acceleration structure anew (one ray is cast). With ``--traffic`` they are the built-in traffic round
the scene's ego vehicle (``traffic: {actors: 100}``), near ones at the level of `--scene-detail`, far ones light.
`serial` is the part of a frame's CPU seconds that the main thread has.
"""

from __future__ import annotations

import argparse
import importlib.metadata
import platform
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np

import scarl_sionna as ss
from scarl_sionna.core.cores import usable_cores
from scarl_sionna.scene.actors.model import actor_names
from scarl_sionna.scene.motion.trajectory import WaypointTrajectory
from scarl_sionna.simulation import load_world

SPEED = {"vehicle": 10.0, "cycle": 5.0, "walk": 1.3, "stand": 0.0}
"""[m/s]"""
DOWN = np.array([[0.0, 0.0, -1.0]])


@dataclass
class Clock:
    """Wall and CPU seconds of steps, by name, and those of the main thread among them."""

    wall: dict[str, list[float]] = field(default_factory=dict)
    cpu: dict[str, list[float]] = field(default_factory=dict)
    main: dict[str, list[float]] = field(default_factory=dict)

    def run(self, name: str, work: Callable[[], object]) -> object:
        """Do one step and note how long it took."""
        start, busy, own = time.perf_counter(), time.process_time(), time.thread_time()
        result = work()
        self.wall.setdefault(name, []).append(time.perf_counter() - start)
        self.cpu.setdefault(name, []).append(time.process_time() - busy)
        self.main.setdefault(name, []).append(time.thread_time() - own)
        return result


def bend(speed: float, number: int) -> WaypointTrajectory:
    """Return a drive of 8 s along a bend, somewhere on a grid beside the street."""
    times = np.linspace(0.0, 8.0, 17)
    row, column = divmod(number, 20)
    way, turn = speed * times, 0.02 * (-1) ** number
    x = 15.0 * column + np.sin(turn * way) / turn
    y = 60.0 + 14.0 * row + (1.0 - np.cos(turn * way)) / turn
    return WaypointTrajectory(times, np.stack([x, y, np.zeros_like(x)], axis=1), name=f"actor_{number}")


def crowd(count: int, detail: str) -> list[ss.StagedActor]:
    """Return actors of all models and variants, in turn."""
    models = [ss.read_actor_model(name) for name in actor_names()]
    actors = []
    for number in range(count):
        model = models[number % len(models)]
        variants = [*model.variants, None][: max(len(model.variants), 1)]
        variant = variants[number // len(models) % len(variants)]
        motion = bend(SPEED[model.motion], number)
        actors.append(ss.StagedActor(f"actor_{number}", model, motion, detail, variant, phase=0.37 * number % 1.0))
    return actors


def in_traffic(scene: str, scene_detail: str, count: int) -> ss.World:
    """Return a scene with so many actors of built-in traffic, known for 8 s."""
    return load_world(ss.ScenarioSpec(scene=scene, detail=scene_detail, duration=8.0, traffic={"actors": count}))


def measure(
    scene: str, scene_detail: str, count: int, detail: str, times: Sequence[float], is_traffic: bool = False
) -> tuple[ss.World, Clock]:
    """Load a scene with actors and step through frames at times [s]."""
    clock = Clock()
    if is_traffic:
        world = clock.run("load", lambda: in_traffic(scene, scene_detail, count))
    else:
        world = clock.run("load", lambda: ss.stage(scene, crowd(count, detail), detail=scene_detail))
    assert isinstance(world, ss.World)
    above = np.array([0.0, 0.0, 50.0])
    for time_of_frame in times:
        state = clock.run("state", partial(_state, world, time_of_frame))
        assert isinstance(state, ss.WorldState)
        clock.run("optical", partial(state.cast, above, DOWN))
        clock.run("radio", partial(state.cast, above, DOWN, twin="radio"))
        clock.run("boxes", state.boxes)
    return world, clock


def _state(world: ss.World, when: float) -> ss.WorldState:
    """Return a state whose wheels and limbs have their poses."""
    state = world.at(when)
    state.part_pose(len(world.parts.name) - 1)
    return state


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--actors", default="10,50,200")
    parser.add_argument("--details", default="light,detailed")
    parser.add_argument(
        "--scene-detail", default="detailed", help="level of the scene itself; not every scene has a light one"
    )
    parser.add_argument("--scene", default="urban_crossing")
    parser.add_argument("--frames", type=int, default=6)
    parser.add_argument("--step", type=float, default=0.1, help="from frame to frame, from 1 s on [s]")
    parser.add_argument("--traffic", action="store_true", help="built-in traffic; --details has no meaning then")
    given = parser.parse_args()
    packages = ", ".join(
        f"{name} {importlib.metadata.version(name)}" for name in ("mitsuba", "drjit", "sionna-rt", "numpy")
    )
    print(
        f"{platform.processor() or platform.machine()}, {usable_cores()} cores; Python "
        f"{platform.python_version()}, {packages}"
    )
    ss.load_scene(given.scene).at(0.0).cast([0.0, 0.0, 50.0], DOWN)  # the engine starts
    steps = ("state", "optical", "radio", "boxes")
    print("seconds: wall of the first frame, and median of the others as wall / CPU of all cores")
    print(
        "| actors | detail | shapes | triangles | load |"
        + "".join(f" {step} first | {step} |" for step in steps)
        + " frame | serial |"
    )
    print("|" + "---|" * (7 + 2 * len(steps)))
    times = [1.0 + given.step * index for index in range(given.frames)]
    for detail in ["traffic"] if given.traffic else given.details.split(","):
        for count in (int(number) for number in given.actors.split(",")):
            world, clock = measure(given.scene, given.scene_detail, count, detail, times, given.traffic)
            triangles = sum(len(world.mesh(part).faces) for part in range(len(world.parts.name)))
            cells = [
                str(count),
                detail,
                str(len(world.parts.name)),
                str(triangles),
                f"{clock.wall['load'][0]:.2f} / {clock.cpu['load'][0]:.2f}",
            ]
            sums = np.zeros(3)
            for step in steps:
                steady = [float(np.median(kept[step][1:])) for kept in (clock.wall, clock.cpu, clock.main)]
                sums += steady
                cells += [f"{clock.wall[step][0]:.3f}", f"{steady[0]:.3f} / {steady[1]:.3f}"]
            whole = f"{sums[0]:.3f} / {sums[1]:.3f}"
            print("| " + " | ".join([*cells, whole, f"{sums[2] / sums[1]:.0%}"]) + " |", flush=True)


if __name__ == "__main__":
    main()
