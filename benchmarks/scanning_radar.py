"""Error and CPU seconds of a turn of a scanning radar, by its knobs.

    python benchmarks/scanning_radar.py turn|beam [--scenario town_traffic]

turn      `raycast.num_rays` and `num_blocks`: mean power over 0.9 deg and 0.69 m against 4 million rays and 25 blocks,
          in cells above the noise; CPU of a whole turn
beam      `num_pointings` and `beam_floor_db`: image of the same paths against 12 pointings and 150 dB, in cells above
          the noise; CPU of the beat signals
"""

from __future__ import annotations

import argparse
import sys
import time
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
sys.path.insert(0, str(Path(__file__).resolve().parent))

from harness import machine

import scarl_sionna as ss
from scarl_sionna.radar.link import received_power
from scarl_sionna.radar.scanning.beats import Block, _bending, block_beats
from scarl_sionna.radar.scanning.sensor import ScanningRadar
from scarl_sionna.radar.synthesis.blocks import later
from scarl_sionna.scenario.spec.scenario import ScenarioSpec
from scarl_sionna.signal.polar import polar_noise_power, polar_power
from scarl_sionna.simulation import load_world

SPEC = ss.ScanningRadarSpec.preset("cts350x")
ROOF = ss.Pose([0.0, 0.0, 2.0])
CELL = 4.0 * SPEC.range_resolution
"""Width of the cells of mean power [m]."""
REFERENCE = {"num_rays": 4_000_000, "num_blocks": 25}


def blocks(state: ss.WorldState, mount: ss.Mount, **knobs: int) -> list[Block]:
    """Return the paths of a turn."""
    return list(ScanningRadar(SPEC, ss.RadarSettings.of("raycast", **knobs))._blocks(state, mount, None))


def mean_power(turn: list[Block]) -> np.ndarray:
    """Return the mean power over azimuth and range, without interference of paths, (num_azimuths, num_cells) [W]."""
    count = int(SPEC.max_range / CELL)
    out = np.zeros((SPEC.num_azimuths, count))
    for block in turn:
        paths = _bending(block.paths)
        bearing = np.arctan2(*(paths.end_vectors()[0] @ paths.world_from_tx.rotation)[:, [1, 0]].T) + block.ahead
        for number in block.azimuths:
            away = np.angle(np.exp(1j * (bearing - SPEC.azimuth[number])))
            moved = later(paths.select(np.abs(away) < np.radians(12.0)), float(SPEC.time[number]) - block.time)
            turned = ss.Pose.from_heading(np.zeros(3), SPEC.azimuth[number] - block.ahead)
            pose = moved.world_from_tx.compose(turned)
            power = received_power(replace(moved, world_from_tx=pose, world_from_rx=pose), SPEC.ramp())
            place = 0.5 * moved.length + SPEC.doppler_range_shift * 0.5 * moved.length_rate
            inside = (place >= 0.0) & (place < count * CELL)
            out[number] += np.bincount((place[inside] / CELL).astype(int), power[inside], count)
    return out


def apart(found: np.ndarray, exact: np.ndarray, least: float) -> tuple[float, float, float]:
    """Return root mean square and 95th percentile of differences [dB] in cells above a power [W], and what is missed.

    The last is the share of these cells in which nothing was found; they do not count in the others.
    """
    loud = exact > least
    there = loud & (found > 1e-3 * exact)
    error = np.abs(10.0 * np.log10(found[there] / exact[there]))
    missed = 1.0 - np.count_nonzero(there) / np.count_nonzero(loud)
    return float(np.sqrt(np.mean(error**2))), float(np.percentile(error, 95)), missed


def turn(world: ss.World) -> None:
    """Print the table of rays and blocks."""
    state = world.at(0.5)
    mount = state.mount(world.ego, ROOF)
    noise = polar_noise_power(SPEC)
    exact = mean_power(blocks(state, mount, **REFERENCE))
    print("| rays | blocks | error rms [dB] | 95 % below [dB] | missed | paths | paths: CPU [s] | turn: CPU [s] |")
    print("|---|---|---|---|---|---|---|---|")
    variants = [(rays, 8) for rays in (10**5, 3 * 10**5, 10**6, 2 * 10**6)] + [(10**6, k) for k in (1, 4, 16)]
    for rays, count in variants:
        knobs = {"num_rays": rays, "num_blocks": count}
        found = blocks(state, mount, **knobs)
        rms, most, missed = apart(mean_power(found), exact, noise)
        sensor = ScanningRadar(SPEC, ss.RadarSettings.of("raycast", **knobs))
        cpu, wall = time.process_time(), time.perf_counter()
        scan = sensor.observe(state, mount, np.random.default_rng(0))
        cpu, wall = time.process_time() - cpu, time.perf_counter() - wall
        solve = scan.diagnostics["seconds"]["solve"] / wall * cpu
        errors = f"{rms:.2f} | {most:.2f} | {100.0 * missed:.1f} %"
        print(f"| {rays:,} | {count} | {errors} | {scan.num_paths:,} | {solve:.1f} | {cpu:.1f} |", flush=True)


def beam(world: ss.World) -> None:
    """Print the table of pointings and the beam's floor."""
    state = world.at(0.5)
    found = blocks(state, state.mount(world.ego, ROOF), num_rays=300_000)

    def image(**knobs: float) -> tuple[np.ndarray, float]:
        start = time.process_time()
        beats = [block_beats(one, SPEC, ss.ScanningSettings(**knobs)) for one in found]
        return polar_power(np.concatenate(beats), SPEC), time.process_time() - start

    exact, _ = image(num_pointings=12, beam_floor_db=150.0)
    print("| pointings | beam floor [dB] | error rms [dB] | 95 % below [dB] | CPU [s] |\n|---|---|---|---|---|")
    for pointings, floor in ((1, 80), (2, 80), (3, 80), (4, 80), (3, 40), (3, 60), (3, 100)):
        power, cpu = image(num_pointings=pointings, beam_floor_db=floor)
        rms, most, _ = apart(power, exact, polar_noise_power(SPEC))
        print(f"| {pointings} | {floor} | {rms:.3f} | {most:.3f} | {cpu:.1f} |", flush=True)


def main() -> None:
    """Make what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("turn", "beam"))
    parser.add_argument("--scenario", default="town_traffic")
    asked = parser.parse_args()
    warnings.simplefilter("ignore")
    print(machine())
    {"turn": turn, "beam": beam}[asked.what](load_world(ScenarioSpec.preset(asked.scenario)))


if __name__ == "__main__":
    main()
