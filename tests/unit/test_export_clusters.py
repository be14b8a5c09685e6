"""Exports on clusters: the array of Slurm, the job of Kubernetes, and what is forecast of their cost."""

from __future__ import annotations

import contextlib
import os
import shlex
import shutil
import subprocess
import sys
import warnings
from pathlib import Path
from types import SimpleNamespace

import pytest
import yaml

from scarl_sionna.batch.cluster import _local_client, run_on_cluster, work
from scarl_sionna.batch.estimate import Estimate
from scarl_sionna.core.errors import ExportError, OutputError, ScarlWarning

SCRIPT = Path(__file__).resolve().parents[2] / "examples/slurm_export.sh"
pytestmark = pytest.mark.skipif(shutil.which("bash") is None, reason="needs bash")


def submit(tmp_path: Path, task: int, array: tuple[int, int], *arguments: str) -> subprocess.CompletedProcess:
    """Run the script as Slurm does, with an `srun` that shows what it is to run."""
    srun = tmp_path / "srun"
    srun.write_text('#!/bin/bash\necho "$@"\n')
    srun.chmod(0o755)
    variables = {
        "SLURM_ARRAY_TASK_ID": str(task),
        "SLURM_ARRAY_TASK_MIN": str(array[0]),
        "SLURM_ARRAY_TASK_MAX": str(array[1]),
        "PATH": f"{tmp_path}:{os.environ['PATH']}",
    }
    return subprocess.run(["bash", SCRIPT, *arguments], env=variables, capture_output=True, text=True, check=False)


def test_a_resubmitted_subset_works_on_the_same_parts(tmp_path) -> None:
    arguments = ("16", "data/", "cut_in.yaml", "--seeds", "0:1900")
    whole, again = submit(tmp_path, 7, (0, 15), *arguments), submit(tmp_path, 7, (3, 7), *arguments)
    assert whole.returncode == again.returncode == 0
    assert whole.stdout == again.stdout
    assert "--shard 7/16" in whole.stdout and "--plan data.plan.json" in whole.stdout


@pytest.mark.parametrize(("task", "parts"), [(16, "16"), (0, "data/"), (0, "0")])
def test_a_part_that_is_none_is_refused(tmp_path, task: int, parts: str) -> None:
    done = submit(tmp_path, task, (0, 20), parts, "data/", "cut_in.yaml")
    assert done.returncode == 2 and "number of parts first" in done.stderr


def test_the_job_of_kubernetes_makes_as_many_parts_as_pods() -> None:
    job = yaml.safe_load((SCRIPT.parent / "kubernetes_export.yaml").read_text())
    assert (job["apiVersion"], job["kind"], job["spec"]["completionMode"]) == ("batch/v1", "Job", "Indexed")
    container = job["spec"]["template"]["spec"]["containers"][0]
    words = shlex.split(container["args"][0])
    parts = job["spec"]["completions"]
    assert words[:3] == ["exec", "scarl-sionna", "export"]
    assert words[words.index("--shard") + 1] == f"$JOB_COMPLETION_INDEX/{parts}"
    folder = words[words.index("--out") + 1]
    assert words[words.index("--plan") + 1] == f"{folder}.plan.json"  # beside it, as in the array of Slurm
    mounts = {mount["mountPath"] for mount in container["volumeMounts"]}
    assert {"/" + Path(path).parts[1] for path in (folder, words[3])} == mounts


def test_a_forecast_counts_the_loading_of_every_scene() -> None:
    """100 frames of 20 drives: 20 s for the first, then 100 times 0.5 s and 19 times 4 s, by 2 processes."""
    found = Estimate(100, 1e6, 0.5, 20.0, 4.0, 20, {}, 2, 10**12, 400)
    assert found.seconds == pytest.approx(20.0 + (50.0 + 76.0) / 2)
    assert "frames: 100 of 20 scenes" in str(found) and "4.00 s to load a scene" in str(found)
    assert "size:   100 MB" in str(found) and "files:  400" in str(found)


def test_a_scheduler_without_workers_is_told() -> None:
    """Else nothing says why an export stands still."""
    distributed = pytest.importorskip("distributed")
    with (
        distributed.LocalCluster(n_workers=0, processes=False, dashboard_address=None) as cluster,
        warnings.catch_warnings(),
    ):
        warnings.simplefilter("error", ScarlWarning)  # it is not to wait here
        with pytest.raises(ScarlWarning, match=f"at {cluster.scheduler_address} has no worker yet"):
            next(run_on_cluster([], 0, cluster.scheduler_address, lambda kind, data: None))


def test_workers_that_are_killed_while_they_start_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """Found by random kills: Dask does not start such a process again, and its RuntimeError went through."""
    distributed = pytest.importorskip("distributed")

    def dead(**_: object) -> None:
        raise RuntimeError("Nanny failed to start.")

    monkeypatch.setattr(distributed, "LocalCluster", dead)
    told = r"2 worker processes .* \(Nanny failed to start\.\).*call the export again"
    with pytest.raises(ExportError, match=told), _local_client(distributed, 2):
        pass


@pytest.mark.skipif(sys.platform != "linux", reason="page faults of glibc's allocator")
def test_workers_keep_freed_memory_for_the_next_arrays_and_their_algebra_has_one_thread(tmp_path: Path) -> None:
    """Dask tells glibc to give each array over 128 kB back, so that each frame mapped 900,000 pages anew."""
    distributed = pytest.importorskip("distributed")

    job = SimpleNamespace(target=None, root=str(tmp_path), name="none")

    def faults() -> tuple[int, str | None]:
        import resource

        import numpy

        with contextlib.suppress(OutputError):
            work(job, None)  # there is no such dataset
        for _ in range(5):
            numpy.ones(300_000)
        before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
        for _ in range(50):
            numpy.ones(300_000)
        return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before, os.environ.get("OPENBLAS_NUM_THREADS")

    with _local_client(distributed, 1) as client:
        found, threads = client.submit(faults).result()
    assert threads == "1"
    assert found < 50 * 300_000 * 8 / 4096 / 10  # a tenth of all of their pages
