"""Error and CPU seconds of knobs that no work-precision chart has as its axis, a table each.

    python benchmarks/knobs.py cells|drafts|probes|returns|corners|mirrors|drops ...

cells     `RaycastSettings.cells_per_resolution` and `widest_cosine`: expected power in a range-azimuth map against
          every hit of the same rays, so this is the error of thinning alone
drafts    the same map of 250,000 rays, thinned in several ways, against 2,000,000 rays with every hit; a cell
          that is missed counts 40 dB
probes    `AutoSettings.num_probes`: objects that are seen or hidden otherwise than by 16,384 probes
returns   `SbrSettings.return_angle`: echo of objects within 40 m against all tubes, at the level of 1 dB
corners   `SbrSettings.corner_share` and `bisections` at the levels of 6 and 3 dB: by how far echoes within 18 m change,
          and how far the level is from that of 1 dB (median), three bounces; bounded at 40 dB
mirrors   `MirrorSettings.max_mirrors`: power of cars (3GPP models) seen through mirrors against 32 of them, in range
          bins of 1 m, at most 30 dB off a bin
drops     `WeatherEchoSettings.num_points`: contrast of a range-Doppler cell, 1 for speckle
"""

from __future__ import annotations

import sys
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
sys.path.insert(0, str(Path(__file__).resolve().parent))

from harness import ANY_COST, machine
from radar_frame import expected_map

import scarl_sionna as ss
from benchmarks.whole_streets import echoes
from scarl_sionna.core.settings.sbr import SbrSettings
from scarl_sionna.radar.channel import plan_channel
from scarl_sionna.radar.channel.compose.budget import Surface, sbr_settings
from scarl_sionna.radar.channel.compose.mirror_legs import MirrorView
from scarl_sionna.radar.channel.compose.reflections import sights
from scarl_sionna.radar.link import received_power
from scarl_sionna.radar.weather.clutter import VolumeSampling, volume_clutter

PLACES = ("highway_guardrail", "urban_crossing")
DRAFT_PLACES = ("highway_guardrail", "urban_crossing", "country_road", "roundabout", "motorway", "tunnel")
CORNER_PLACES = ("highway_guardrail", "country_road", "roundabout", "motorway", "tunnel", "parking_garage")
MIRROR_PLACES = ("urban_crossing", "motorway", "tunnel", "signalised_crossing")
RADAR = ss.RadarSpec.preset("awr1843boost")


def place(name: str) -> tuple[Any, Any]:
    """Return a state, and the radar's mount: on the ego vehicle where there is one."""
    world = ss.load_scene(name)
    state = world.at(0.5)
    pose = ss.Pose([4.0, 0.0, 0.7])
    return state, state.mount(world.ego, pose) if world.ego else ss.Mount.of(ss.Pose([0.0, 0.0, 1.0]))


def timed(call: Callable[[], Any]) -> tuple[Any, float]:
    """Return what a call gives, and its CPU seconds, the second time that it is made."""
    call()
    start = time.process_time()
    return call(), time.process_time() - start


def map_error(paths: Any, whole: np.ndarray) -> tuple[float, float]:
    """Return the error of a map within 60 dB of its peak, rms and 95 % below [dB]; a missed cell counts 40 dB."""
    loud = whole > whole.max() * 1e-6
    ratio = np.maximum(expected_map(paths, RADAR)[loud] / whole[loud], 1e-4)
    error = np.abs(10.0 * np.log10(ratio))
    return float(np.sqrt(np.mean(error**2))), float(np.percentile(error, 95))


def cells() -> None:
    print("| place | cells per resolution | widest cosine | error rms [dB] | 95 % below [dB] | paths | CPU [s] |")
    print("|---|---|---|---|---|---|---|")
    for name in PLACES:
        state, mount = place(name)
        every = ss.solve_paths(state, RADAR, mount, "raycast", num_rays=200_000, hits_per_cell=None)
        whole = expected_map(every, RADAR)
        for fine, wide in ((0.5, 0.1), (1.0, 0.1), (2.0, 0.1), (4.0, 0.1), (2.0, 0.02), (2.0, 0.4)):
            knobs = ss.RaycastSettings(num_rays=200_000, cells_per_resolution=fine, widest_cosine=wide)
            paths, cpu = timed(lambda knobs=knobs: ss.solve_paths(state, RADAR, mount, settings=knobs))  # noqa: B023
            rms, most = map_error(paths, whole)
            print(
                f"| {name} | {fine:g} | {wide:g} | {rms:.3f} | {most:.2f} | {paths.num_paths:,} | {cpu:.2f} |",
                flush=True,
            )


def drafts() -> None:
    print("| place | cells per resolution, hits a cell | error rms [dB] | 95 % below [dB] | paths |")
    print("|---|---|---|---|---|")
    for name in DRAFT_PLACES:
        state, mount = place(name)
        every = ss.solve_paths(state, RADAR, mount, "raycast", num_rays=2_000_000, hits_per_cell=None)
        whole = expected_map(every, RADAR)
        for fine, hits in ((2.0, None), (2.0, 8), (1.0, 16), (1.0, 8), (1.0, 4)):
            knobs = ss.RaycastSettings(num_rays=250_000, cells_per_resolution=fine, hits_per_cell=hits)
            paths = ss.solve_paths(state, RADAR, mount, settings=knobs)
            rms, most = map_error(paths, whole)
            print(f"| {name} | {fine:g}, {hits} | {rms:.3f} | {most:.2f} | {paths.num_paths:,} |", flush=True)


def corners() -> None:
    print("| place | level [dB] | corner_share, bisections | echoes | change, median, most [dB] | off by | CPU ratio |")
    print("|---|---|---|---|---|---|---|")
    levels = {level.tolerance_db: sbr_settings(level).with_(max_depth=3) for level in ss.AutoSettings().levels}
    for name in CORNER_PLACES:
        state, mount = place(name)
        ego = state.world.ego
        own = [number for number, info in state.world.instances.items() if ego is not None and info.actor == ego]
        scatter = [number for number, info in state.world.instances.items() if info.is_object or info.actor is not None]
        bodies = tuple(sorted(set(scatter) - set(own)))

        def found(knobs: SbrSettings) -> tuple[dict[int, float], float]:
            asked = {"sbr": knobs, "instances": bodies}  # noqa: B023
            start = time.process_time()
            paths = ss.solve_paths(state, RADAR, mount, "sbr", **asked, **ANY_COST, max_distance=18.0)  # noqa: B023
            return echoes(paths, list(bodies), RADAR), time.process_time() - start  # noqa: B023

        finest, _ = found(levels[1.0])
        loud = [number for number, power in finest.items() if power > max(finest.values()) - 40.0]

        def apart(one: dict[int, float], other: dict[int, float]) -> np.ndarray:
            return np.minimum(np.abs([one[number] - other[number] for number in loud]), 40.0)  # noqa: B023

        for level in (6.0, 3.0):
            before, seconds = found(levels[level].with_(corner_share=0.125, bisections=9))
            off = np.median(apart(before, finest))
            for share, steps in ((0.25, 9), (0.5, 9), (0.125, 6), (0.5, 6)):
                after, cpu = found(levels[level].with_(corner_share=share, bisections=steps))
                change = apart(after, before)
                cell = f"{share:g}, {steps} | {len(loud)} | {np.median(change):.2f}, {change.max():.2f} | {off:.2f}"
                print(f"| {name} | {level:g} | {cell} | {cpu / seconds:.2f} |", flush=True)


def probes() -> None:
    print("| place | probes | objects seen otherwise | of | CPU [s] |\n|---|---|---|---|---|")
    for name in PLACES:
        state, mount = place(name)
        view = MirrorView(state, RADAR, mount, (), [], ss.MirrorSettings())
        numbers = [number for number, info in state.world.instances.items() if info.is_object]
        faces = {number: Surface.of(state, number) for number in numbers}
        exact = sights(view, faces, ss.AutoSettings(num_probes=16_384))
        for count in (16, 64, 256, 1024):
            rules = ss.AutoSettings(num_probes=count)
            found, cpu = timed(lambda rules=rules: sights(view, faces, rules))  # noqa: B023
            other = sum((found[number][0].share > 0.0) != (exact[number][0].share > 0.0) for number in numbers)
            print(f"| {name} | {count} | {other} | {len(numbers)} | {cpu:.3f} |", flush=True)


def returns() -> None:
    print("| place | return angle [rad] | error that 90 % of the objects keep [dB] | tubes | CPU [s] |")
    print("|---|---|---|---|---|")
    level = SbrSettings(max_phase=1.0, integration_phase=0.05, edge_share=0.25, max_depth=4, floor_db=None)
    for name in PLACES:
        state, mount = place(name)
        plan = plan_channel(state, RADAR, mount, tube_budget=10**9, max_distance=40.0)
        bodies = [number for share in plan.shares if share.solver == "sbr" for number in share.instances]

        def found(angle: float | None) -> tuple[dict[int, float], int]:
            knobs = {"sbr": level.with_(return_angle=angle), "instances": tuple(bodies)}  # noqa: B023
            paths = ss.solve_paths(state, RADAR, mount, "sbr", **knobs, **ANY_COST, max_distance=40.0)  # noqa: B023
            return echoes(paths, bodies), sum(paths.diagnostics["num_tubes"].values())  # noqa: B023

        truth = found(None)[0]
        counted = [number for number, power in truth.items() if power > 10.0]
        for angle in (None, 2.0, 1.5, 0.8, 0.5, 0.3, 0.15):
            (echo, tubes), cpu = timed(lambda angle=angle: found(angle))
            error = [min(abs(echo[number] - truth[number]), 60.0) for number in counted]
            most = np.quantile(error, 0.9, method="inverted_cdf")
            print(f"| {name} | {angle or 'all'} | {most:.2f} | {tubes:,} | {cpu:.1f} |", flush=True)


def mirrors() -> None:
    print("| place | mirrors | error rms [dB] | paths through mirrors | CPU [s] |\n|---|---|---|---|---|")
    for name in MIRROR_PLACES:
        state, mount = place(name)
        cars = [actor.name for actor in state.world.actors if actor.name != state.world.ego]
        common = ss.RadarSettings.of(
            "auto", tube_budget=0, models=dict.fromkeys(cars, "tr38901:car"), max_distance=80.0
        )

        def ghosts(count: int) -> tuple[np.ndarray, int]:
            paths = ss.solve_paths(state, RADAR, mount, settings=common.changed(max_mirrors=count))  # noqa: B023
            rows = [row for row in paths.diagnostics["solvers"] if row["mechanism"] == "objects through mirrors"]
            number = sum(row["num_paths"] for row in rows)
            late = paths.select(np.arange(paths.num_paths - number, paths.num_paths))
            return np.histogram(late.length / 2.0, np.arange(0.0, 81.0), weights=received_power(late, RADAR))[0], number

        whole, _ = ghosts(32)
        loud = whole > whole.max() * 1e-3
        for count in (1, 2, 4, 8, 16):
            (power, number), cpu = timed(lambda count=count: ghosts(count))
            error = np.abs(10.0 * np.log10(np.maximum(power[loud], 1e-3 * whole[loud]) / whole[loud]))
            rms = np.sqrt(np.mean(error**2)) if loud.any() else 0.0
            print(f"| {name} | {count} | {rms:.2f} | {number:,} | {cpu:.1f} |", flush=True)


def drops() -> None:
    print("| weather | points, at most | points | contrast, 5 to 20 m | contrast, 60 to 100 m | CPU [s] |")
    print("|---|---|---|---|---|---|")
    radar = RADAR
    for weather in ("rain", "heavy_rain"):
        state = ss.load_scene("highway_guardrail").with_weather(weather).at(0.0)
        for count in (5_000, 20_000, 50_000, 100_000, 200_000):
            power, start = [], time.process_time()
            for seed in range(12):
                rng, sampling = np.random.default_rng(seed), VolumeSampling(None, count)
                paths = volume_clutter(state.world.weather, radar, ss.Pose(), rng, sampling=sampling)
                cube = ss.virtual_cube(ss.synthesize(paths, radar), radar)
                power.append(np.abs(ss.range_doppler(cube, radar).data) ** 2)
            cpu = (time.process_time() - start) / 12
            found, power = ss.range_doppler(cube, radar), np.array(power)
            contrast: list[float] = []
            for near, far in ((5.0, 20.0), (60.0, 100.0)):
                bins = (found.range >= near) & (found.range < far)
                slow = np.abs(found.radial_velocity) < 0.5
                some = power[..., slow, :][..., bins]
                mean, spread = some.mean(axis=0), some.var(axis=0, ddof=1)
                contrast.append(float(np.mean(spread) / np.mean(mean**2 - spread / 12)))
            print(
                f"| {weather} | {count:,} | {paths.num_paths:,} | {contrast[0]:.2f} | {contrast[1]:.2f} | {cpu:.2f} |",
                flush=True,
            )


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    print(machine())
    for asked in sys.argv[1:]:
        tables = (cells, drafts, probes, returns, corners, mirrors, drops)
        {table.__name__: table for table in tables}[asked]()
