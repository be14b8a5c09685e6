"""What all benchmarks share: the machine's description, and timing with cold, warm and CPU seconds apart.

CPU seconds of the whole process stand beside wall seconds, since another load on the machine changes only the latter.
"""

from __future__ import annotations

import os
import platform
import re
import resource
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from scarl_sionna.core.cores import usable_cores

ANY_COST: dict[str, None] = {"cpu_budget": None, "memory_budget": None}
"""Fields of settings: a benchmark of physical optics may take what it takes."""
PACKAGES = ("scarl-sionna", "sionna-rt", "mitsuba", "drjit", "numpy", "finufft")


def machine() -> str:
    """Return processor, cores, load and versions in one line, for the head of every report."""
    versions = ", ".join(f"{name} {version(name)}" for name in PACKAGES)
    load = os.getloadavg()[0]
    return f"{_processor()}, {usable_cores()} cores (load {load:.1f}), Python {platform.python_version()}, {versions}"


def _processor() -> str:
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as stream:
            return next(line.split(":", 1)[1].strip() for line in stream if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor() or platform.machine()


def peak_memory() -> float:
    """Return the largest resident memory of this process so far [GiB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20


def write_block(page: Path, name: str, block: str) -> None:
    """Replace what stands between `<!-- begin name -->` and `<!-- end name -->` in a page.

    Raises
    ------
    SystemExit
        If the page has no such marks: a table that lands nowhere would be taken as renewed.
    """
    begin, end = f"<!-- begin {name} -->", f"<!-- end {name} -->"
    text, found = re.subn(
        f"{re.escape(begin)}.*?{re.escape(end)}",
        lambda _: f"{begin}\n{block}\n{end}",
        page.read_text(encoding="utf-8"),
        flags=re.DOTALL,
    )
    if found != 1:
        raise SystemExit(f"{page} has {found} blocks between {begin!r} and {end!r}; one is wanted")
    page.write_text(text, encoding="utf-8")


@dataclass(frozen=True)
class Timing:
    """Seconds of a call: the first one (with kernel compilation), and median wall and CPU of the warm ones."""

    cold: float
    wall: float
    cpu: float

    def __str__(self) -> str:
        return f"cold {self.cold:7.2f} s   warm {self.wall:7.3f} s   cpu {self.cpu:7.2f} s"


def measure(call: Callable[[], Any], repeats: int = 5, warm_ups: int = 1) -> Timing:
    """Return the timing of a call: cold, then `warm_ups` calls that do not count, then the median of the repeats."""
    start = time.perf_counter()
    call()
    cold = time.perf_counter() - start
    for _ in range(warm_ups):
        call()
    walls, cpus = [], []
    for _ in range(repeats):
        wall, cpu = time.perf_counter(), time.process_time()
        call()
        walls.append(time.perf_counter() - wall)
        cpus.append(time.process_time() - cpu)
    return Timing(cold, float(np.median(walls)), float(np.median(cpus)))
