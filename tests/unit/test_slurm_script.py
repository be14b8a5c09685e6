"""The example of a Slurm array: a subset that is submitted again works on the same parts."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

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
