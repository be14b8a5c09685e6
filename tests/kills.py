"""Exports that are killed at random moments: no frame lost, doubled or different, nothing left, nobody's files touched.

``python -m tests.kills COUNT [SEED]`` kills COUNT times and prints what was killed: mostly the process that exports,
then one that has workers, one of the workers, a Dask scheduler.
"""

from __future__ import annotations

import json
import multiprocessing
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from multiprocessing.process import BaseProcess
from multiprocessing.util import get_temp_dir
from pathlib import Path
from typing import Literal

from scarl_sionna.batch import ExportSettings, export
from scarl_sionna.core.errors import DatasetError
from scarl_sionna.core.specs.lidar.spec import LidarSpec
from scarl_sionna.dataset import StoreOptions
from scarl_sionna.dataset.verify import verify
from scarl_sionna.fusion import Rig, SensorMount
from scarl_sionna.scenario.spec.scenario import ScenarioSpec
from tests.children import with_parent
from tests.exports import PLACE, contents, kept_frames, scenario_files, wait_until_gone

Victim = Literal["alone", "with workers", "worker", "scheduler"]
TURNS: tuple[Victim, ...] = (
    "alone", "with workers", "alone", "worker", "alone", "alone", "alone", "scheduler", "alone", "alone",
    "worker", "alone", "with workers", "alone", "alone", "worker", "alone", "alone", "alone", "alone",
)  # fmt: skip # a table
FRAMES = {"one": 5, "two": 4}
OPTIONS = StoreOptions(shard_frames=2)
FOREIGN = {"notes.txt": b"mine", "shards/one/mine.zip": b"mine", ".work/mine": b"mine", ".git/config": b"mine"}
PROCESSES = multiprocessing.get_context("forkserver")
"""Processes for which everything is imported already: that takes three times as long as the export of a few frames."""
PROCESSES.set_forkserver_preload(["scarl_sionna.cli", "scarl_sionna.batch.driver", "scarl_sionna.simulation"])
MOST_SECONDS = 500.0
"""Longest that a run may take to its end [s]."""
NOT_STARTED = "of this machine did not start"
"""What an export says that ends since a worker was killed while it started."""


class Kills:
    """Kills exports of a tiny scenario, and holds what is there to what an undisturbed one makes.

    `killed` counts the kills by what was hit, `at_work` those that came when frames were there, `runs` the exports that
    were held to the undisturbed one byte for byte, `not_started` those that ended since workers did not start.
    """

    def __init__(self, folder: Path, seed: int) -> None:
        self.files = scenario_files(folder / "scenarios", **FRAMES)
        lidar = SensorMount("front/lidar", "lidar", LidarSpec(num_azimuth=9, num_elevation=3), PLACE)
        Rig("lidar", (lidar,)).save(folder / "scenarios/rig.yaml")
        self.scenarios = [ScenarioSpec.load(path) for path in self.files]
        self.out, self.folder, self.random = folder / "out", folder, random.Random(seed)
        self.killed: Counter[str] = Counter()
        self.at_work = self.runs = self.not_started = 0
        export(self.scenarios, folder / "whole", ExportSettings(options=OPTIONS))
        self.expected = contents(folder / "whole")

    def kill(self, victim: Victim) -> None:
        """Kill an export once (or a worker of it, up to twice), check what is there, and in half of the cases go on."""
        before = sum(self.killed.values())
        while sum(self.killed.values()) == before:  # an export may be through before its moment comes
            workers = ["--workers", str(self.random.choice((1, 2)))]
            if victim == "scheduler":
                with self._cluster() as (scheduler, address):
                    self._run(victim, ["--scheduler", address], lambda process: scheduler.kill())
            elif victim == "worker":
                self._run(victim, workers, self._kill_worker)
            else:
                self._run(victim, workers if victim == "with workers" else [], lambda process: process.kill())
            self._check()
            if self.random.random() < 0.5:
                self._complete()

    def _run(self, victim: Victim, options: list[str], hit: Callable[[BaseProcess], object]) -> None:
        """Run an export, hit it at a random moment, and wait until all of its processes are gone."""
        arguments = ["export", *map(str, self.files), "--out", str(self.out)]
        arguments += ["--shard-frames", str(OPTIONS.shard_frames), *options]
        there = len(kept_frames(self.out))
        process = PROCESSES.Process(target=run_command, args=(arguments, str(self.folder / "printed")))
        process.start()
        try:
            for _ in range(2 if victim == "worker" else 1):
                if self._moment(process, there) and hit(process) is not False:
                    self.killed[victim] += 1
                    self.at_work += bool(kept_frames(self.out))
            process.join(MOST_SECONDS)
            code = process.exitcode
        finally:
            process.kill()
        assert wait_until_gone(process.pid or 0), f"{victim}: processes of the export are left"
        text = (self.folder / "printed").read_text() if (self.folder / "printed").exists() else ""
        allowed = {"worker": (0,), "scheduler": (0, 2)}.get(victim, (0, -signal.SIGKILL))
        if victim == "worker" and NOT_STARTED in text:  # an interrupted run as any other: the same command goes on
            allowed = (2,)
            self.not_started += 1
        assert code in allowed and "Traceback" not in text, f"{victim}: ended with {code}:\n{text[-3000:]}"

    def _moment(self, process: BaseProcess, there: int) -> bool:
        """Wait for a random moment; return whether the export is still at work then."""
        deadline = time.monotonic() + MOST_SECONDS
        if self.random.random() < 0.15:  # as it starts
            deadline, count = time.monotonic() + self.random.uniform(0.0, 2.0), sys.maxsize
        else:
            count = self.random.randint(0, max(sum(FRAMES.values()) - there, 0))
        while time.monotonic() < deadline and len(kept_frames(self.out)) < there + count and process.is_alive():
            time.sleep(0.004)
        process.join(self.random.uniform(0.0, 0.1))
        return process.is_alive()

    def _kill_worker(self, process: BaseProcess) -> bool:
        """Kill one of the workers; return whether there was one."""
        found = [child for child in children(process.pid or 0) if "spawn_main" in command_line(child)]
        if found:
            with suppress(ProcessLookupError):
                os.kill(self.random.choice(found), signal.SIGKILL)
                return True
        return False

    def _check(self) -> None:
        """Check a folder as a kill left it: what is finished is whole and the same, foreign files are as they were."""
        there = contents(self.out)
        for name, data in there.items():
            if name.startswith("shards/") and name.endswith((".json", ".zip")) and name not in FOREIGN:
                assert ".partial" in name or data == self.expected[name], name
        try:
            found = verify(self.out)
        except DatasetError:
            assert not any(name.startswith("shards/") for name in there), there.keys()
        else:
            assert found.ok and not found.failed, found
            assert set(found.foreign) <= FOREIGN.keys(), found.foreign
            self._check_foreign()
            for name, data in FOREIGN.items():
                (self.out / name).parent.mkdir(parents=True, exist_ok=True)
                (self.out / name).write_bytes(data)

    def _check_foreign(self) -> None:
        there = [name for name in FOREIGN if (self.out / name).exists()]
        assert not there or len(there) == len(FOREIGN), there
        assert all((self.out / name).read_bytes() == FOREIGN[name] for name in there)

    def _complete(self) -> None:
        """Let the next run end: all is as if nothing had happened, and nothing is left."""
        kept = len(kept_frames(self.out))
        is_begun = (self.out / "notes.txt").exists()
        report = export(self.scenarios, self.out, ExportSettings(options=OPTIONS))
        assert (report.num_kept, report.num_made) == (kept, sum(FRAMES.values()) - kept)
        assert verify(self.out).complete
        foreign = FOREIGN if is_begun else {}
        found = {p.relative_to(self.out).as_posix(): p.read_bytes() for p in self.out.rglob("*") if p.is_file()}
        for name in (".locks/run.lock", ".locks/manifest.lock", "export.log"):
            found.pop(name)
        assert found == self.expected | foreign, found.keys() ^ (self.expected | foreign).keys()
        left = [path for path in Path(tempfile.gettempdir()).glob("scarl_sionna_*")]
        assert not left, left
        shutil.rmtree(self.out)
        self.runs += 1

    @contextmanager
    def _cluster(self) -> Iterator[tuple[subprocess.Popen[bytes], str]]:
        """Start a Dask scheduler and a worker."""
        file = self.folder / "scheduler.json"
        file.unlink(missing_ok=True)
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, **with_parent()}
        module, place = [sys.executable, "-m"], ["--scheduler-file", str(file), "--no-dashboard"]
        scheduler = subprocess.Popen([*module, "distributed.cli.dask_scheduler", "--port", "0", *place], **quiet)
        worker = None
        try:
            while not file.exists():
                assert scheduler.poll() is None
                time.sleep(0.05)
            alone = ["--nworkers", "1", "--nthreads", "1", "--no-nanny", "--death-timeout", "60"]
            alone += ["--local-directory", str(self.folder)]
            worker = subprocess.Popen([*module, "distributed.cli.dask_worker", *place, *alone], **quiet)
            yield scheduler, json.loads(file.read_text())["address"]
        finally:
            for item in (scheduler, worker):
                if item is not None:
                    item.kill()
                    item.wait()


def children(process: int) -> list[int]:
    """Return the processes that one has started, and those that they have started."""
    found: list[int] = []
    for path in Path(f"/proc/{process}/task").glob("*/children"):
        with suppress(OSError):
            for child in map(int, path.read_text().split()):
                found += [child, *children(child)]
    return found


def command_line(process: int) -> str:
    """Return the command of a process; empty if it is gone."""
    with suppress(OSError):
        return Path(f"/proc/{process}/cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace")
    return ""


def run_command(arguments: list[str], printed: str) -> None:
    """Run the command line in this process, a session of its own, and let a file take what it prints."""
    os.setsid()
    with open(printed, "wb") as file:
        for descriptor in (1, 2):
            os.dup2(file.fileno(), descriptor)
    sys.argv = ["scarl-sionna", *arguments]
    from scarl_sionna.cli import app

    app()


def victims(count: int) -> list[Victim]:
    """Return what to kill, in turn."""
    return [TURNS[index % len(TURNS)] for index in range(count)]


def main(count: int, seed: int) -> None:
    """Kill exports and print the counts."""
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        (place / "tmp").mkdir()
        get_temp_dir()  # of multiprocessing, which wants to find it at the very end
        os.environ["TMPDIR"] = tempfile.tempdir = str(place / "tmp")
        kills = Kills(place, seed)
        while sum(kills.killed.values()) < count:
            for victim in victims(count):
                kills.kill(victim)
                print(dict(kills.killed), kills.runs, flush=True)
                if sum(kills.killed.values()) >= count:
                    break
        tempfile.tempdir = None
        print(
            f"{sum(kills.killed.values())} kills {dict(kills.killed)}, {kills.at_work} with frames there; "
            f"{kills.runs} datasets completed, each the same as the undisturbed one; {kills.not_started} exports ended "
            "since a worker was killed as it started"
        )


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 1)
