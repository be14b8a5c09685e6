"""How fast a dataset is read and converted: megabytes a second of every reader, seconds a frame of every exporter.

Prints markdown tables. The data are draft frames of ``highway_guardrail`` with the radar of SCaRL's Table 1 (6.3 MB
raw), simulated once, stored several times over, so that every frame is read from its own place on the disk.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))

from harness import machine

import scarl_sionna as ss
from scarl_sionna.dataset import write_dataset
from scarl_sionna.dataset.formats import convert
from scarl_sionna.dataset.formats.tfrecord import read_tfrecord
from scarl_sionna.dataset.readers import shard_files
from scarl_sionna.dataset.readers.samples import FrameSamples
from scarl_sionna.dataset.readers.shard_files import ShardFiles
from scarl_sionna.dataset.readers.tables import box_table
from scarl_sionna.dataset.readers.tf_data import tensorflow, tf_dataset

SUITE = "front_center"
READS = {
    "raw radar, int16": [f"{SUITE}/radar:adc_int"],
    "raw radar, complex64": [f"{SUITE}/radar:adc"],
    "range-Doppler map": [f"{SUITE}/radar:range_doppler"],
    "RGB image": [f"{SUITE}/rgb:rgb"],
    "lidar points": [f"{SUITE}/lidar:points"],
    "boxes": ["boxes", "box_semantic"],
    "radar, RGB, depth, lidar, boxes": [
        f"{SUITE}/radar:adc_int",
        f"{SUITE}/rgb:rgb",
        f"{SUITE}/depth:depth",
        f"{SUITE}/lidar:points",
        "boxes",
    ],
}


def make_dataset(folder: Path, num_frames: int) -> Path:
    """Simulate two draft frames and store them over and over."""
    rig = ss.Rig.front("draft")
    frames = list(ss.simulate(ss.load_scene("highway_guardrail"), rig, [0.0, 0.1], seed=0))
    copies = [replace(frames[k % 2], index=k, timestamp_ns=k * 10**8) for k in range(num_frames)]
    return write_dataset(folder, rig.to_dict(), {"highway": copies})


def rate(samples: Iterable[dict[str, Any]], count: int) -> tuple[float, float, float]:
    """Return frames/s, MB/s of wall time and MB/s of CPU time of `count` samples after the first two."""
    iterator = iter(samples)
    next(iterator), next(iterator)
    wall, cpu, size = time.perf_counter(), time.process_time(), 0
    for _ in range(count):
        size += sum(num_bytes(value) for value in next(iterator).values())
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    return count / wall, size / wall / 1e6, size / cpu / 1e6


def num_bytes(value: Any) -> int:
    """Return the size of an array or a tensor."""
    return int(value.nbytes) if isinstance(value, np.ndarray) else int(np.prod(value.shape)) * value.dtype.size


def endless(samples: FrameSamples) -> Iterable[dict[str, Any]]:
    """Yield samples in a random order without end."""
    rng = np.random.default_rng(0)
    while True:
        yield samples[int(rng.integers(len(samples)))]


def readers(place: Path, count: int, threads: int) -> None:
    """Print a row for every reader."""
    print("\n| read | as | frames/s | MB/s | MB a CPU second |\n|---|---|---|---|---|")
    for name, items in READS.items():
        frames, wall, cpu = rate(endless(FrameSamples(place, items)), count)
        print(f"| {name} | arrays, random access | {frames:.0f} | {wall:.0f} | {cpu:.0f} |", flush=True)
        data = tf_dataset(place, items, shuffle_seed=0, repeat=True, num_threads=threads)
        frames, wall, cpu = rate(data, count)
        print(
            f"| {name} | `tf.data`, {threads} threads, shuffled | {frames:.0f} | {wall:.0f} | {cpu:.0f} |", flush=True
        )
    started = time.perf_counter()
    rows = len(box_table(place))
    print(f"\nbox_table: {rows} rows in {time.perf_counter() - started:.2f} s")


def checks(place: Path, rounds: int) -> None:
    """Print what the checks of images and records cost: whole frames with and without them, in turns.

    Without: SHA-256 is not computed, and JSON is not held to its models. The CRC-32C of chunks stays, in any Zarr
    reader.
    """
    whole: list[float] = []
    bare: list[float] = []
    for _ in range(rounds):
        whole.append(_seconds(place))
        with (
            mock.patch.object(
                ShardFiles, "_read_checked", lambda files, name, record, index: files._read(record, name, index)
            ),
            mock.patch.object(
                shard_files, "checked", lambda form, data: form.model_construct(root=[*map(_Bare, data)])
            ),
            mock.patch.object(shard_files, "plain", dict),
        ):
            bare.append(_seconds(place))
    share = float(np.median(np.array(whole) / np.array(bare)) - 1.0)
    print(
        f"\nchecks: {np.median(whole) * 1e3:.2f} ms of CPU a frame, {np.median(bare) * 1e3:.2f} ms without "
        f"({share * 100.0:+.1f} %, median of {rounds} pairs)"
    )


class _Bare(dict[str, Any]):
    """JSON of a frame as it stands."""

    @property
    def index(self) -> int:
        """Number of the frame."""
        return int(self["index"])


def _seconds(place: Path) -> float:
    """Return the CPU time of reading one frame with all that it has [s], the dataset opened anew."""
    dataset = ss.open_dataset(place)
    started = time.process_time()
    for frame in dataset:
        frame.to_frame()
    return (time.process_time() - started) / len(dataset)


def exporters(place: Path, folder: Path, num_frames: int) -> None:
    """Print a row for every exporter."""
    print("\n| format | ms a frame, wall | ms a frame, CPU | MB a frame |\n|---|---|---|---|")
    for form in ("nuscenes", "tfrecord", "hdf5", "mcap", "dca1000"):
        wall, cpu = time.perf_counter(), time.process_time()
        out = convert(place, form, folder / form)
        wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
        files = [out] if out.is_file() else [path for path in out.rglob("*") if path.is_file()]
        size = sum(path.stat().st_size for path in files)
        print(
            f"| {form} | {wall / num_frames * 1e3:.0f} | {cpu / num_frames * 1e3:.0f} | "
            f"{size / num_frames / 1e6:.2f} |",
            flush=True,
        )
    data = read_tfrecord(folder / "tfrecord").repeat()
    frames, wall, cpu = rate(data, 3 * num_frames)
    print(f"\nread_tfrecord: {frames:.0f} frames/s, {wall:.0f} MB/s, {cpu:.0f} MB a CPU second")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=24, help="frames of the dataset")
    parser.add_argument("--reads", type=int, default=60, help="frames read for each row")
    parser.add_argument("--threads", type=int, default=2, help="frames that tf.data reads at once")
    parser.add_argument("--folder", type=Path, default=None, help="where to put the data (default: a temporary folder)")
    parser.add_argument("--part", choices=["all", "checks"], default="all")
    arguments = parser.parse_args()
    os.environ.setdefault("TF_CPP_MIN_LOG_LEVEL", "3")
    print(machine())
    with tempfile.TemporaryDirectory(dir=arguments.folder) as name:
        place = make_dataset(Path(name) / "ds", arguments.frames)
        size = sum(path.stat().st_size for path in place.rglob("*") if path.is_file())
        print(f"dataset: {arguments.frames} frames, {size / arguments.frames / 1e6:.2f} MB a frame on disk")
        if arguments.part == "checks":
            checks(place, 15)
            return
        tensorflow()
        readers(place, arguments.reads, arguments.threads)
        exporters(place, Path(name), arguments.frames)
        checks(place, 15)


if __name__ == "__main__":
    main()
