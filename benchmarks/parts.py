"""CPU time of the parts of a frame, one a call, on settings that the tables of docs/performance.md name.

    python benchmarks/parts.py [--repeats 5] [--json] PART ...       (no PART: the list)

A part is prepared, run once cold (kernels are compiled, or read from the cache), then `--repeats` times. Printed are
CPU seconds of the process, those of the main thread among them, which no second core takes over, wall seconds, the
medians of the repeats, and a digest of the result, so that two versions can be held against each other:
``benchmarks/side_by_side.py`` does that.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import time
import warnings
from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np
from harness import machine

import scarl_sionna as ss
from camera_lidar import Camera
from scarl_sionna.core.errors import ScarlWarning
from scarl_sionna.scenario.compose import build_world
from scarl_sionna.scenario.spec.scenario import ScenarioSpec

Call = Callable[[int], Any]
"""From the number of the run to what is digested."""
BOARD = "front_center/radar"
STEP = 0.1
"""Between the frames of a part that makes frames [s]."""


def town() -> tuple[ss.World, float]:
    """Return a street with free traffic and the time of the first frame."""
    return build_world(ScenarioSpec.preset("town_traffic")), 1.0


def highway() -> tuple[ss.World, float]:
    """Return a highway with guardrails and the time of the first frame."""
    return ss.load_scene("highway_guardrail"), 0.0


def crossing() -> tuple[ss.World, float]:
    """Return an empty crossing of a town and the time of the first frame."""
    return ss.load_scene("urban_crossing"), 0.0


def suites(place: tuple[ss.World, float], rig: str) -> Call:
    """Return a call that makes whole frames of draft quality."""
    (world, start), sensors = place, ss.Rig.preset(rig, "draft")

    def call(index: int) -> Any:
        frame = ss.observe(world, sensors, time=start + STEP * index, seed=0, index=index)
        return [frame.results[name] for name in sorted(frame.results)]

    return call


def radar(place: tuple[ss.World, float]) -> Call:
    """Return a call that solves the front radar's paths by `auto`, draft quality."""
    (world, start), sensor = place, ss.Rig.preset("front", "draft")[BOARD]

    def call(index: int) -> Any:
        state = world.at(start + STEP * index)
        mount = state.mount(world.ego, sensor.vehicle_from_sensor)
        return ss.solve_paths(state, sensor.spec, mount, settings=sensor.settings)

    return call


def image(place: tuple[ss.World, float]) -> Call:
    """Return a call that makes the front camera's image, draft quality, and the tree that it needs."""
    (world, start), sensor = place, ss.Rig.preset("front", "draft")["front_center/rgb"]

    def call(index: int) -> Any:
        state = world.at(start + STEP * index)
        mount = state.mount(world.ego, sensor.vehicle_from_sensor)
        return Camera(sensor.spec).observe(state, mount, np.random.default_rng(index))

    return call


def raycast(place: tuple[ss.World, float]) -> Call:
    """Return a call that solves the front radar's paths by `raycast`, 10^6 rays."""
    world, start = place
    state, spec = world.at(start), ss.RadarSpec.preset("awr1843boost")
    mount = state.mount(world.ego, ss.Rig.front()[BOARD].vehicle_from_sensor)
    return lambda index: ss.solve_paths(state, spec, mount, "raycast")


def labels(place: tuple[ss.World, float], method: str) -> Call:
    """Return a call that labels the cells of the map of `raycast`'s paths, 10^6 rays."""
    world, start = place
    state, spec = world.at(start), ss.RadarSpec.preset("awr1843boost")
    paths = ss.solve_paths(state, spec, state.mount(world.ego, ss.Rig.front()[BOARD].vehicle_from_sensor), "raycast")
    cells = ss.range_doppler(ss.virtual_cube(ss.synthesize(paths, spec), spec), spec)
    return lambda index: ss.label_cells(cells, paths, state, method)


def street_signal(place: tuple[ss.World, float]) -> Call:
    """Return a call that synthesizes the beat signal of `raycast`'s paths, 10^6 rays, noise left out."""
    world, start = place
    state, spec = world.at(start), ss.RadarSpec.preset("awr1843boost")
    paths = ss.solve_paths(state, spec, state.mount(world.ego, ss.Rig.front()[BOARD].vehicle_from_sensor), "raycast")
    return lambda index: ss.synthesize(paths, spec)


def random_signal(count: int) -> Call:
    """Return a call that synthesizes points within +-70 m/s, 12 channels of 512 x 256, straight paths."""
    from synthesis import STRAIGHT, random_points

    spec = ss.RadarSpec()
    paths = random_points(spec, count, -70.0, 70.0)
    return lambda index: ss.synthesize(paths, spec, accuracy=ss.Accuracy(**STRAIGHT))


def whole_sbr(place: tuple[ss.World, float]) -> Call:
    """Return a call that solves all objects of a place by `sbr`, three bounces, and synthesizes their signal.

    The settings are the finest of the default and the levels of `auto` that are expected to be within 20 CPU s, 3 GiB.
    """
    world, start = place
    state, spec = world.at(start), ss.RadarSpec.preset("awr1843boost")
    mount = state.mount(world.ego, ss.Rig.front()[BOARD].vehicle_from_sensor)
    budget = {"cpu_budget": 20.0, "memory_budget": 3.0, "over_budget": "coarsen"}

    def call(index: int) -> Any:
        paths = ss.solve_paths(state, spec, mount, "sbr", **budget)
        return ss.synthesize(paths, spec)

    return call


PARTS: dict[str, Callable[[], Call]] = {
    "suite-town": lambda: suites(town(), "front"),
    "suite-highway": lambda: suites(highway(), "front"),
    "six-town": lambda: suites(town(), "scarl"),
    "six-highway": lambda: suites(highway(), "scarl"),
    "radar-town": lambda: radar(town()),
    "radar-highway": lambda: radar(highway()),
    "image-town": lambda: image(town()),
    "image-highway": lambda: image(highway()),
    "sbr-highway": lambda: whole_sbr(highway()),
    "raycast-highway": lambda: raycast(highway()),
    "raycast-crossing": lambda: raycast(crossing()),
    "sidelobes-highway": lambda: labels(highway(), "sidelobes"),
    "sidelobes-crossing": lambda: labels(crossing(), "sidelobes"),
    "spread-highway": lambda: labels(highway(), "spread"),
    "spread-crossing": lambda: labels(crossing(), "spread"),
    "signal-highway": lambda: street_signal(highway()),
    "signal-crossing": lambda: street_signal(crossing()),
    "signal-1e5": lambda: random_signal(100_000),
    "signal-1e6": lambda: random_signal(1_000_000),
}


def digest(value: Any) -> str:
    """Return a digest of all arrays in a result, names and order included, timings left out."""
    found = hashlib.blake2b(digest_size=6)

    def add(item: Any) -> None:
        if isinstance(item, np.ndarray):
            found.update(f"{item.dtype}{item.shape}".encode() + np.ascontiguousarray(item).tobytes())
        elif isinstance(item, (list, tuple)):
            for one in item:
                add(one)
        elif hasattr(item, "__dict__"):
            for name, one in sorted(vars(item).items()):
                derived = isinstance(getattr(type(item), name, None), cached_property)
                if not derived and name not in ("timings", "diagnostics", "provenance"):
                    add(one)

    add(value)
    return found.hexdigest()


def measured(name: str, repeats: int) -> dict[str, Any]:
    """Return cold and warm CPU, main thread and wall seconds of a part, and the digest of each warm result."""
    call, rows, digests = PARTS[name](), [], []
    for index in range(repeats + 1):
        begin = time.process_time(), time.thread_time(), time.perf_counter()
        result = call(index)
        rows.append(np.subtract((time.process_time(), time.thread_time(), time.perf_counter()), begin))
        digests.append(digest(result))
    cpu, thread, wall = np.median(rows[1:], axis=0).tolist()
    return {
        "part": name,
        "cold_cpu": float(rows[0][0]),
        "cpu": cpu,
        "thread": thread,
        "wall": wall,
        "digests": digests,
    }


def row(found: dict[str, Any]) -> str:
    """Return the figures of a part as a row of a table."""
    return (
        f"| {found['part']} | {found['cold_cpu']:.2f} | {found['cpu']:.3f} | {found['thread']:.3f} | "
        f"{found['wall']:.3f} | {found['digests'][-1]} |"
    )


HEAD = "| part | first, CPU [s] | warm, CPU [s] | main thread [s] | wall [s] | digest |\n|---|---|---|---|---|---|"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("parts", nargs="*", metavar="PART", choices=[[], *PARTS])
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--json", action="store_true", help="one line of JSON a part, for other scripts")
    args = parser.parse_args()
    warnings.simplefilter("ignore", ScarlWarning)  # rays between far posts, budgets of draft frames
    if not args.parts:
        print("\n".join(PARTS))
        return
    if not args.json:
        print(machine(), HEAD, sep="\n\n", flush=True)
    for name in args.parts:
        found = measured(name, args.repeats)
        print(json.dumps(found) if args.json else row(found), flush=True)


if __name__ == "__main__":
    main()
