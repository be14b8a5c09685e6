"""Exports that are killed: the process, its workers, a Dask scheduler.

Two hundred kills: ``python -m tests.kills 200``.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable
from typing import Any

import pytest

from scarl_sionna.batch import ExportSettings, export
from scarl_sionna.core.errors import ExportError
from scarl_sionna.dataset.verify import verify
from scarl_sionna.scenario.spec.scenario import ScenarioSpec
from tests.children import with_parent
from tests.exports import scenario_files, wait_until_gone
from tests.kills import OPTIONS, Kills, children, command_line, victims

pytest.importorskip("distributed")


@pytest.mark.slow
def test_sixteen_kills(tmp_path, monkeypatch) -> None:
    (tmp_path / "tmp").mkdir()
    monkeypatch.setenv("TMPDIR", str(tmp_path / "tmp"))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "tmp"))
    kills = Kills(tmp_path, seed=3)
    for victim in victims(16):
        kills.kill(victim)
    assert sum(kills.killed.values()) >= 16 and set(kills.killed) == set(victims(16))
    assert kills.at_work > 3 and kills.runs > 0


def killing(then: Callable[[], None]) -> Callable[[str, dict[str, Any]], None]:
    """Return what kills the workers of this process at their first frame, and does something just before."""
    done: list[int] = []

    def on_event(kind: str, data: dict[str, Any]) -> None:
        if kind == "frame" and not done:
            then()
            for child in children(os.getpid()):
                if "spawn_main" in command_line(child):
                    done.append(child)
                    os.kill(child, signal.SIGKILL)

    return on_event


@pytest.fixture
def long(tmp_path) -> list[ScenarioSpec]:
    return [ScenarioSpec.load(path) for path in scenario_files(tmp_path / "scenarios", one=60)]


@pytest.mark.slow
def test_workers_that_cannot_be_started_again_end_the_export(long, tmp_path, monkeypatch) -> None:
    monkeypatch.setattr("scarl_sionna.batch.cluster.RESTART_SECONDS", 2.0)
    no_interpreter = killing(lambda: monkeypatch.setenv("PYTHONHOME", "/nowhere"))
    with pytest.raises(ExportError, match="none could be started again within 2 s.*the same command goes on"):
        export(long, tmp_path / "out", ExportSettings(workers=1, options=OPTIONS), on_event=no_interpreter)
    found = verify(tmp_path / "out")
    assert found.ok and not found.complete


@pytest.mark.slow
def test_a_worker_that_takes_long_to_start_again_is_waited_for(long, tmp_path, monkeypatch) -> None:
    """Dask gives up a worker that is not back after 15 s, and with the last one the export stood still."""
    (tmp_path / "slow").mkdir()
    (tmp_path / "slow/sitecustomize.py").write_text("import time\n\ntime.sleep(20)\n")
    path = os.pathsep.join([str(tmp_path / "slow"), os.environ.get("PYTHONPATH", "")])
    slow_start = killing(lambda: monkeypatch.setenv("PYTHONPATH", path))
    report = export(long, tmp_path / "out", ExportSettings(workers=1, options=OPTIONS), on_event=slow_start)
    assert report.num_frames == 60 and verify(tmp_path / "out").complete
    assert report.wall_seconds > 20.0


@pytest.mark.skipif(sys.platform != "linux", reason="Linux tells a process of its parent's death")
def test_what_a_test_starts_ends_with_the_process_that_started_it() -> None:
    code = (
        "import subprocess, sys; from tests.children import with_parent;"
        "p = subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(60)'], **with_parent());"
        "print(p.pid, flush=True); p.wait()"
    )
    parent = subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, text=True, start_new_session=True, **with_parent()
    )
    assert parent.stdout is not None
    child = int(parent.stdout.readline())
    os.kill(child, 0)
    parent.send_signal(signal.SIGKILL)
    parent.communicate()
    assert wait_until_gone(parent.pid, 10.0)
