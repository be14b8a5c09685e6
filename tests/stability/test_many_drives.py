"""Thousands of drives planned by the jobs of an array: each once, in bounded memory."""

from __future__ import annotations

import sys
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor

import pytest

from scarl_sionna.batch import Sweep
from scarl_sionna.batch import plan as planning
from scarl_sionna.dataset.encoding import StoreOptions
from scarl_sionna.dataset.store.manifest import DatasetPlan
from scarl_sionna.engine.memory import forget_peak, release_memory, resident_bytes
from scarl_sionna.scenario.spec.named import scenario_of

NUM_JOBS = 2
MOST_PER_DRIVE = 0.4e6
"""What a process may grow by a drive that is planned [bytes]: with the 0.2 GB that it has before, 1 GB holds 1,900."""


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
@pytest.mark.parametrize("count", [10, pytest.param(1900, marks=pytest.mark.slow)])
def test_jobs_that_start_at_once_compute_one_plan_and_keep_little(count: int, tmp_path, monkeypatch, capsys) -> None:
    """The CPU time is told and not held: it is the machine's as well."""
    drives = Sweep(range(count)).apply([scenario_of("cut_in")])
    computed: Counter[int] = Counter()
    compute = planning.scene_configuration

    def counted(drive) -> dict[str, object]:
        computed[drive.seed] += 1
        return compute(drive)

    monkeypatch.setattr(planning, "scene_configuration", counted)
    planning.plan_export(drives[:1], StoreOptions())  # what is loaded once
    computed.clear()
    release_memory()
    forget_peak()
    before, began = resident_bytes()[0], time.process_time()

    def job(number: int) -> DatasetPlan:
        return planning.plan_export(drives, StoreOptions(), plan_file=tmp_path / "plan.json").dataset

    with ThreadPoolExecutor(NUM_JOBS) as pool:
        plans = list(pool.map(job, range(NUM_JOBS)))
    peak, seconds = resident_bytes()[1], time.process_time() - began
    assert computed == Counter(range(count))
    assert plans[0] == plans[1] and len(plans[0].scenes) == count
    assert len({plan.configuration["seed"] for plan in plans[0].scenes}) == count
    with capsys.disabled():
        print(f" {count} drives: {seconds:.1f} s of CPU, {peak / 1e9:.2f} GB, {before / 1e9:.2f} GB of them before")
    assert peak - before < 20e6 + MOST_PER_DRIVE * count
