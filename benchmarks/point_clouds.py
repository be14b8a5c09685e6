"""Statistics of radar points beside RadarScenes: a radar like theirs in traffic of five places, `auto`, draft.

    python benchmarks/point_clouds.py frames [--each 6]      30 frames into build/point_clouds, 20 min; goes on
    python benchmarks/point_clouds.py table [--write docs/statistics.md]

RadarScenes (arXiv 2104.02493): four radars alike, 100 m, 60 deg to each side, 0.15 m, 0.1 km/h, 0.5 to 2 deg. That
takes frames of 70 ms and some 60 channels; here it is 35 ms, 32 channels, 0.2 km/h and 3.6 deg. Chirps, places of the
antennas, power and noise are this project's. Their devices send a list of limited length; 206 is its mean in motion.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import scarl_sionna as ss
from benchmarks.detection import PLACES, TRAFFIC
from benchmarks.harness import machine, write_block
from scarl_sionna.core.specs.radar.array import HALF_WAVE, uniform_line
from scarl_sionna.dataset.statistics.published import compare
from scarl_sionna.fusion.rig import SensorMount
from scarl_sionna.scenario.spec.scenario import ScenarioSpec

STORE = Path("build/point_clouds")
LISTS = (None, 206)
"""Points of a radar and frame that are kept, the strongest; None: all."""
ARRAY = ss.AntennaArray(tx_positions=uniform_line(4, 8 * HALF_WAVE), rx_positions=uniform_line(8, HALF_WAVE))
RADAR = ss.RadarSpec(
    waveform=ss.Fmcw(bandwidth=1e9, ramp_time=28e-6, idle_time=6e-6, num_chirps=1024, num_samples=680),
    array=ARRAY,
    azimuth_fov_deg=120.0,
)
MOUNT = ss.Pose.from_euler([2.3, 0.7, 0.6], yaw=np.radians(25.0))
RIG = ss.Rig("like_radarscenes", [SensorMount("corner/radar", "radar", RADAR, MOUNT, ss.RadarSettings.preset("draft"))])


def scenarios(each: int) -> list[ScenarioSpec]:
    """Return the drives: so many frames in six seconds each, at seeds that nothing was tuned on."""
    found, rig = [], STORE.with_suffix(".rig.yaml")
    rig.parent.mkdir(exist_ok=True)
    RIG.save(rig)
    for number, (place, (name, changes)) in enumerate(PLACES.items()):
        if place == "parking_garage":
            continue  # RadarScenes has streets only
        spec = ScenarioSpec.preset(name)
        drive = {
            "name": place,
            "seed": 900 + number,
            "rig": str(rig),
            "frame_rate": each / 6.0,
            "num_frames": each,
            "duration": None,
        }
        found.append(spec.with_(traffic=TRAFFIC | changes, **drive))
    return found


def table() -> str:
    """Return the figures of RadarScenes beside those of the frames."""
    start = time.process_time()
    counted = [ss.dataset_statistics(STORE, most_points=most) for most in LISTS]
    lines = [
        f"{counted[0].num_frames} frames of {len(counted[0].scenes)} places; {machine()}.", "",
        "| RadarScenes | published | all points | the strongest 206 of a scan |", "|---|---|---|---|",
    ]  # fmt: skip # a table
    for several in zip(*(compare(one) for one in counted), strict=True):
        figure = several[0].published
        if figure.dataset != "RadarScenes":
            continue
        value = f"{figure.low:g} to {figure.high:g}" if figure.value is None else f"{figure.value:g}"
        here = ["not told" if np.isnan(one.here) else f"{one.here:.3g}" for one in several]
        unit = f" [{figure.unit}]" * bool(figure.unit)
        lines.append(f"| {figure.quantity}{unit} | {value} | {here[0]} | {here[1]} |")
    scans = [one.points_per_scan for one in counted]
    lines.append(f"| points of a scan, vehicle in motion | 206 | {np.mean(scans[0]):.0f} | {np.mean(scans[1]):.0f} |")
    print(f"{time.process_time() - start:.0f} CPU s", file=sys.stderr)
    return "\n".join(lines)


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("what", choices=("frames", "table"))
    parser.add_argument("--write", type=Path, metavar="PAGE")
    parser.add_argument("--each", type=int, default=6, help="frames of a place")
    arguments = parser.parse_args()
    if arguments.what == "frames":
        print(
            ss.export(
                scenarios(arguments.each), STORE, on_progress=lambda done, total: print(done, "of", total, flush=True)
            )
        )
    elif arguments.write is None:
        print(table())
    else:
        write_block(arguments.write, "point clouds", table())
