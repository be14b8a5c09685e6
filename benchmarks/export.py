"""Exports: bytes a frame, writing and reading, where the time goes, and what 140,000 frames would take.

    python benchmarks/export.py [--part store|export|all] [--quality draft] [--frames 12]

`store` simulates one frame of a suite and writes and reads copies of it; `export` runs the whole export in this
process, and with one and two workers. The rates of the disk are those of the folder for temporary files (TMPDIR), with
its cache in memory.
"""

from __future__ import annotations

import argparse
import resource
import shutil
import tempfile
import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from harness import machine, peak_memory

import scarl_sionna as ss
from scarl_sionna.batch import ExportReport, ExportSettings, export
from scarl_sionna.batch.estimate import size_text, time_text
from scarl_sionna.batch.job import TimedPool
from scarl_sionna.core.errors import ScarlWarning
from scarl_sionna.core.results import Frame
from scarl_sionna.dataset import StoreOptions
from scarl_sionna.dataset.encoding import encode_frame
from scarl_sionna.dataset.store.manifest import DatasetPlan, ScenePlan
from scarl_sionna.dataset.store.writer import DatasetFolder
from scarl_sionna.scenario.spec.scenario import ScenarioSpec
from scarl_sionna.simulation import load_world, observe, resolve_rig

PLANNED_FRAMES, PLANNED_SUITES = 140_000, 6  # of SCaRL
FLEET_EFFICIENCY = 0.9  # of many machines: the last shards, start-up, a shared disk


def kind_of(name: str) -> str:
    """Return what a chunk or an image belongs to, for the table of sizes."""
    parts = name.split("/")
    if name.endswith(".png"):
        return f"{parts[-2]} (PNG)"
    return {"radar": "radar ADC", "lidar": "lidar"}.get(parts[-2] if len(parts) > 1 else "", "poses, objects, counts")


def decoded_bytes(frame: Frame) -> int:
    """Return the size of a frame's arrays in memory [bytes]."""
    values = [value for result in frame.results.values() for value in vars(result).values()]
    return sum(value.nbytes for value in values if isinstance(value, np.ndarray))


def timed(call: Callable[[], object]) -> tuple[float, float]:
    """Return wall and CPU seconds of a call."""
    wall, cpu = time.perf_counter(), time.process_time()
    call()
    return time.perf_counter() - wall, time.process_time() - cpu


def sizes(frame: Frame, options: StoreOptions) -> tuple[float, float]:
    """Print the bytes of a frame by kind; return their sum and the CPU seconds of compression."""
    with TimedPool(2) as pool:
        encoded = encode_frame(frame, options, pool)
    seconds = pool.cpu_seconds
    by_kind: dict[str, int] = {}
    for name, data in {**encoded.chunks, **encoded.files}.items():
        by_kind[kind_of(name)] = by_kind.get(kind_of(name), 0) + len(data)
    print(f"\n| part of a frame ({options.radar_format}) | kB |\n|---|---|")
    for kind, size in sorted(by_kind.items(), key=lambda item: -item[1]):
        print(f"| {kind} | {size / 1e3:.1f} |")
    print(f"| sum, one suite | {encoded.num_bytes / 1e3:.1f} |")
    return encoded.num_bytes, seconds


def store(quality: str, count: int, place: Path) -> tuple[float, float]:
    """Measure sizes, writing and reading; return bytes a frame and CPU seconds of its compression."""
    scenario = ScenarioSpec(quality=quality)
    world, rig = load_world(scenario), resolve_rig(scenario)
    first = observe(world, rig, 0.0)
    sizes(first, StoreOptions(radar_format="complex64"))
    num_bytes, encoding = sizes(first, StoreOptions())
    frames = [replace(first, index=index, timestamp_ns=index * 10**8) for index in range(count)]
    plan = DatasetPlan(rig.to_dict(), (ScenePlan("drive", count),))

    def write() -> None:
        with DatasetFolder(place, plan) as folder, TimedPool(2) as pool:
            for number in range(plan.scenes[0].num_shards(plan.options)):
                with folder.shard("drive", number) as shard:
                    for index in shard.missing:
                        shard.add(encode_frame(frames[index], plan.options, pool))
                    shard.commit()
            folder.finalize()

    raw = decoded_bytes(first)
    wall, cpu = timed(write)
    print("\n| store | wall | CPU | rate (of arrays in memory) |\n|---|---|---|---|")

    def row(name: str, wall: float, cpu: float, size: float) -> None:
        print(f"| {name} | {wall * 1e3:.1f} ms | {cpu * 1e3:.1f} ms | {size / wall / 1e6:.0f} MB/s |")

    row("compress and write, a frame", wall / count, cpu / count, raw)
    dataset = ss.open_dataset(place)
    order = np.random.default_rng(0).permutation(count)
    cube = first.radars["front_center/radar"].adc_int.nbytes
    reads: dict[str, tuple[Callable[[ss.Frame], object], int]] = {
        "read a whole frame, random order": (lambda item: item.to_frame(), raw),
        "read an ADC cube as int16": (lambda item: item.radar["front_center"].adc_int, cube),
        "read an ADC cube as complex64": (lambda item: item.radar["front_center"].adc, cube),
        "read an RGB image": (lambda item: item.image["front_center"].rgb, first.images["front_center/rgb"].rgb.nbytes),
        "read the boxes": (lambda item: item.labels, 1000),
    }
    for name, (read, size) in reads.items():
        read(dataset[0])
        wall, cpu = timed(lambda read=read: [read(dataset[int(index)]) for index in order])
        row(name, wall / count, cpu / count, size)
    array = dataset.scene("drive").group["front_center/radar/adc"]
    wall, cpu = timed(lambda: [array[int(index), 0, :64] for index in order])
    row("slice of a cube by zarr: one receiver, 64 chirps", wall / count, cpu / count, cube)
    return num_bytes, encoding


def cpu_and_system() -> tuple[float, float]:
    """Return CPU seconds of this process and of those that it has waited for, and the system's part of them."""
    spent = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    system = sum(one.ru_stime for one in spent)
    return sum(one.ru_utime for one in spent) + system, system


def export_times(quality: str, count: int, place: Path, numbers: Sequence[int]) -> ExportReport:
    """Run exports in this process and in some numbers of workers; return the report of the first."""
    scenario = ScenarioSpec(quality=quality, num_frames=count, name="drive")
    options = StoreOptions(shard_frames=max(count // 4, 1))
    reports, rows = {}, []
    for workers in (0, *numbers):
        name = f"{workers} worker{'s'[: workers - 1]}" if workers else "this process"
        before = cpu_and_system()
        reports[name] = report = export(
            [scenario], place / name.replace(" ", "_"), ExportSettings(workers, options=options)
        )
        cpu, system = (np.subtract(cpu_and_system(), before) / count).tolist()
        stages = ", ".join(f"{stage} {taken / count:.3f}" for stage, taken in report.seconds.items())
        print(f"{name}: by stage, summed over processes, a frame [s]: {stages}", flush=True)
        rows.append((name, report.wall_seconds / count, cpu, system))
    print("\n| export, a frame, start included | wall [s] | CPU [s] | of it system [s] | CPU to this process |")
    print("|---|---|---|---|---|")
    for name, wall, cpu, system in rows:
        print(f"| {name} | {wall:.2f} | {cpu:.2f} | {system:.2f} | {cpu / rows[0][2]:.2f} |")
    first = reports["this process"]
    simulation = sum(first.seconds.get(stage, 0.0) for stage in ("world", "camera", "lidar", "radar"))
    print("\n| stage, this process | s a frame | of the simulation |\n|---|---|---|")
    for stage, taken in first.seconds.items():
        print(f"| {stage} | {taken / count:.3f} | {taken / simulation:.1%} |")
    return first


def projection(report: ExportReport, count: int, num_bytes: float) -> None:
    """Print what SCaRL's number of frames would take."""
    simulation = sum(report.seconds.get(stage, 0.0) for stage in ("world", "camera", "lidar", "radar")) / count
    rest = sum(report.seconds.get(stage, 0.0) for stage in ("waiting", "putting in place")) / count
    seconds = PLANNED_FRAMES * PLANNED_SUITES * (simulation + rest)
    size = PLANNED_FRAMES * PLANNED_SUITES * num_bytes
    print(f"\n{PLANNED_FRAMES} frames of {PLANNED_SUITES} suites: {size_text(size)} (six times one suite, int16)")
    print("\n| machines like this one, one process each | time |\n|---|---|")
    for machines in (1, 16, 256):
        efficiency = 1.0 if machines == 1 else FLEET_EFFICIENCY
        print(f"| {machines} | {time_text(seconds / machines / efficiency)} |")
    print(
        f"\nAssumed: every suite takes as long as the front one ({simulation + rest:.2f} s, warm); "
        "frames do not depend on each "
        f"other, so that machines add up, with {FLEET_EFFICIENCY:.0%} left for start-up, "
        "the last shards and a shared disk of "
        f"{size_text(256 * FLEET_EFFICIENCY * num_bytes / (simulation + rest))}/s at 256 machines."
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--part", default="all", choices=("store", "export", "all"))
    parser.add_argument("--quality", default="draft", choices=("draft", "full"))
    parser.add_argument("--frames", type=int, default=12)
    parser.add_argument(
        "--workers", type=int, nargs="+", default=(1, 2), help="processes of the exports after the first"
    )
    args = parser.parse_args()
    warnings.simplefilter("ignore", ScarlWarning)
    print(machine())
    place = Path(tempfile.mkdtemp(prefix="scarl_export_"))
    try:
        num_bytes = encoding = None
        if args.part != "export":
            num_bytes, encoding = store(args.quality, args.frames, place / "store")
        if args.part != "store":
            print()
            report = export_times(args.quality, args.frames, place, args.workers)
            projection(report, args.frames, num_bytes or report.num_bytes / args.frames)
        if encoding is not None and args.part == "all":
            print(f"\ncompression: {encoding:.3f} s CPU a frame")
        print(f"peak memory of this process: {peak_memory():.2f} GiB")
    finally:
        shutil.rmtree(place, ignore_errors=True)


if __name__ == "__main__":
    main()
