"""What an export will take, measured on one frame before it begins."""

from __future__ import annotations

import os
import shutil
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter

from scarl_sionna.dataset.encoding import EncodedFrame, encode_frame
from scarl_sionna.dataset.store.layout import MARKED as AT_THE_TOP
from scarl_sionna.dataset.store.records import metadata_texts
from scarl_sionna.dataset.store.remote import is_address, scratch_folder
from scarl_sionna.simulation import load_world, observe

from .driver import ExportSettings, dataset_folder
from .plan import ExportPlan


@dataclass(frozen=True)
class Estimate:
    """What an export will take.

    Attributes
    ----------
    num_frames : int
    bytes_per_frame : float
        Size of the measured frame on disk [bytes].
    seconds_per_frame : float
        Of one process that has the machine to itself, after its first frame [s].
    start_seconds : float
        Loading and the first frame, once a process [s].
    load_seconds : float
        Of it, loading: every scene is loaded [s].
    num_scenes : int
    stages : mapping of str to float
        Parts of `seconds_per_frame`.
    processes : int
    free_bytes : int
        Room on the disk [bytes].
    num_files : int
        Files of the dataset, if all frames have the arrays and images of the measured one.
    """

    num_frames: int
    bytes_per_frame: float
    seconds_per_frame: float
    start_seconds: float
    load_seconds: float
    num_scenes: int
    stages: Mapping[str, float]
    processes: int
    free_bytes: int
    num_files: int

    @property
    def num_bytes(self) -> float:
        """Size of the dataset [bytes]."""
        return self.num_frames * self.bytes_per_frame

    @property
    def seconds(self) -> float:
        """Time of the export [s], if processes do not slow each other down."""
        shared = self.num_frames * self.seconds_per_frame + (self.num_scenes - 1) * self.load_seconds
        return self.start_seconds + shared / self.processes

    def __str__(self) -> str:
        stages = ", ".join(f"{stage} {taken:.2f}" for stage, taken in self.stages.items())
        lines = [
            f"frames: {self.num_frames} of {self.num_scenes} scene{'s' if self.num_scenes > 1 else ''}",
            f"size:   {size_text(self.num_bytes)} ({size_text(self.bytes_per_frame)} a frame; "
            f"{size_text(self.free_bytes)} free)",
            f"files:  {self.num_files}",
            f"time:   {time_text(self.seconds)} in {self.processes} process{'es' if self.processes > 1 else ''} "
            f"({self.seconds_per_frame:.2f} s a frame: {stages}; {self.load_seconds:.2f} s to load a scene)",
            "measured on the second of two frames; several processes on one machine share its cores, "
            "so that the time falls "
            "less than with their number",
        ]
        if self.num_bytes > self.free_bytes:
            lines.append(f"warning: the disk lacks {size_text(self.num_bytes - self.free_bytes)}")
        return "\n".join(lines)


def estimate(plan: ExportPlan, out: str | Path, settings: ExportSettings) -> Estimate:
    """Simulate two frames of the first scenario without writing them, and return what the export will take.

    Where `out` holds a dataset already, shards are as long as its own, as in the export.

    Raises
    ------
    OutputError
        If `out` is an address that no dataset can be written to.
    DatasetError
        If `out` is an address that does not answer.
    """
    plan = replace(plan, dataset=dataset_folder(out, plan, settings).look())
    scenario = plan.scenarios[sorted(plan.scenarios)[0]]
    started = perf_counter()
    world = load_world(scenario)
    load_seconds = perf_counter() - started
    observe(world, plan.rig, scenario.start_time, scenario.seed)
    start_seconds = perf_counter() - started
    started = perf_counter()
    index = min(1, scenario.num_frames - 1)
    frame = observe(world, plan.rig, scenario.times[index], scenario.seed, index=index)
    simulated = perf_counter()
    with ThreadPoolExecutor(2) as pool:
        encoded = encode_frame(frame, plan.dataset.options, pool)
    encoding = perf_counter() - simulated
    processes = settings.workers or 1
    return Estimate(
        plan.num_frames,
        encoded.num_bytes,
        max(simulated - started, encoding),
        start_seconds,
        load_seconds,
        len(plan.scenarios),
        {**frame.timings, "encoding (beside)": encoding},
        processes,
        _free(scratch_folder(str(out)) if is_address(out) else Path(out)),
        _num_files(plan, encoded),
    )


def _num_files(plan: ExportPlan, frame: EncodedFrame) -> int:
    """Return the number of files of a dataset whose frames are all like one."""
    names = set(AT_THE_TOP)
    options, count = plan.dataset.options, 0
    for scene in plan.dataset.scenes:
        names |= metadata_texts(scene, frame.arrays, options).keys()
        if options.layout == "packed":
            count += 2 * scene.num_shards(options)
        else:
            count += scene.num_shards(options) * (len(frame.arrays) + 2) + scene.num_frames * len(frame.files)
    return count + len(names)


def _free(path: Path) -> int:
    path = Path(os.path.abspath(path))
    while not path.exists():
        path = path.parent
    return shutil.disk_usage(path).free


def size_text(num_bytes: float) -> str:
    """Return a size in a unit that suits it."""
    for unit in ("B", "kB", "MB", "GB"):
        if num_bytes < 1000:
            return f"{num_bytes:.3g} {unit}"
        num_bytes /= 1000
    return f"{num_bytes:.3g} TB"


def time_text(seconds: float) -> str:
    """Return a time in a unit that suits it."""
    if seconds < 100:
        return f"{seconds:.3g} s"
    if seconds < 6000:
        return f"{seconds / 60:.3g} min"
    return f"{seconds / 3600:.3g} h" if seconds < 172_800 else f"{seconds / 86_400:.3g} days"
