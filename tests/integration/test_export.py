"""Exports of small scenarios: the same bytes however they are made, and nothing is lost or made twice."""

from __future__ import annotations

import json
import os
import pickle
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest
import trimesh

from scarl_sionna.batch import ExportSettings, export
from scarl_sionna.batch import job as job_module
from scarl_sionna.batch import plan as plan_module
from scarl_sionna.batch.cluster import portable
from scarl_sionna.batch.plan import scene_configuration
from scarl_sionna.core.errors import (
    ExportError,
    OutputError,
    ParameterRangeError,
    PlacementError,
    ScarlError,
    TimeRangeError,
)
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.temporary import temporary_folder
from scarl_sionna.dataset import StoreOptions, open_dataset
from scarl_sionna.dataset.verify import verify
from scarl_sionna.fusion import Rig, SensorMount
from scarl_sionna.scenario.spec.scenario import ScenarioSpec
from scarl_sionna.simulation import load_world, observe
from tests.children import with_parent
from tests.exports import RIG, SHARD_FRAMES, contents, kept_frames, run, scenario_files, start, wait_until
from tests.frames import assert_same

OPTIONS = StoreOptions(shard_frames=SHARD_FRAMES)
SETTINGS = ExportSettings(options=OPTIONS)


@pytest.fixture(scope="module")
def files(tmp_path_factory) -> list[Path]:
    return scenario_files(tmp_path_factory.mktemp("scenarios"), one=7, two=3)


@pytest.fixture(scope="module")
def scenarios(files) -> list[ScenarioSpec]:
    return [ScenarioSpec.load(path) for path in files]


@pytest.fixture(scope="module")
def undisturbed(scenarios, tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("undisturbed") / "out"
    report = export(scenarios, out, SETTINGS)
    assert (report.num_made, report.num_kept, report.failed) == (10, 0, {})
    return out


def test_the_dataset_holds_what_observe_gives(scenarios, undisturbed) -> None:
    dataset = open_dataset(undisturbed)
    assert (dataset.scenes, len(dataset)) == (["one", "two"], 10)
    world = load_world(scenarios[1])
    for index in (0, 2):
        scenario = scenarios[1]
        direct = observe(world, RIG, scenario.times[index], scenario.seed, index=index)
        stored = dataset.scene("two").frame(index).to_frame()
        assert_same(stored.results["front/lidar"], direct.results["front/lidar"])
        assert_same(stored.radars["front/radar"].adc_int, direct.radars["front/radar"].adc_int)
        assert_same(stored.objects, direct.objects)
        assert (stored.timestamp_ns, stored.seed) == (direct.timestamp_ns, direct.seed)
    assert verify(undisturbed).complete


def test_drives_of_one_seed_share_noise_only_if_they_say_so(scenarios, tmp_path) -> None:
    first = scenarios[0].with_(num_frames=1)
    drives = [first, *(first.with_(name=name, noise_of=shared) for name, shared in (("own", None), ("same", "one")))]
    export(drives, tmp_path / "out", SETTINGS)
    dataset = open_dataset(tmp_path / "out")
    one, own, same = (dataset.scene(name).frame(0).to_frame() for name in ("one", "own", "same"))
    for sensor, field in (("radar", "adc_int"), ("camera", "rgb")):
        values = [getattr(frame.results[f"front/{sensor}"], field) for frame in (one, own, same)]
        assert_same(values[0], values[2])
        assert (values[0] != values[1]).any()


def test_a_dataset_whose_noise_went_by_the_seed_alone_is_refused(scenarios, tmp_path, monkeypatch) -> None:
    def before(scenario: ScenarioSpec) -> dict:
        found = scene_configuration(scenario)
        del found["noise_of"]
        return found

    with monkeypatch.context() as patch:
        patch.setattr(plan_module, "scene_configuration", before)
        export([scenarios[1].with_(num_frames=1)], tmp_path / "out", SETTINGS)
    with pytest.raises(OutputError, match=r"scenes\.two\.noise_of: None there, 'two' asked for"):
        export([scenarios[1]], tmp_path / "out", SETTINGS)


def test_a_finished_export_makes_nothing_again(scenarios, undisturbed) -> None:
    before = {path: path.stat().st_mtime_ns for path in undisturbed.rglob("*") if path.is_file()}
    report = export(reversed(scenarios), undisturbed, SETTINGS)
    assert (report.num_made, report.num_kept) == (0, 10)
    changed = [path.name for path, time in before.items() if path.stat().st_mtime_ns != time]
    assert set(changed) <= {"export.log"}


def test_an_export_that_loads_no_scene_removes_what_a_killed_process_left(
    scenarios, undisturbed, tmp_path, monkeypatch
) -> None:
    """As where one of two workers dies at its scene and the other one makes all."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    with temporary_folder() as mine:
        left = mine.name.replace(f"_{os.getpid()}_", "_999999999_")
    (tmp_path / left).mkdir()
    (tmp_path / "notes").mkdir()
    assert export(scenarios, undisturbed, SETTINGS).num_made == 0
    assert [path.name for path in tmp_path.iterdir()] == ["notes"]


@pytest.mark.slow  # a dead worker is replaced is the same with one, test_body_drives with two: they run always
@pytest.mark.parametrize("workers", [1, 2, 3])
def test_any_number_of_workers_gives_the_same_bytes(files, undisturbed, tmp_path, workers) -> None:
    done = run(*files, "--out", tmp_path / "out", "--workers", workers)
    assert done.returncode == 0, done.stderr
    assert "10 frames written" in done.stdout
    assert contents(tmp_path / "out") == contents(undisturbed)


def test_parts_in_any_order_give_the_same_bytes(scenarios, undisturbed, tmp_path) -> None:
    out = tmp_path / "out"
    for index in (2, 0, 1):
        export(scenarios, out, ExportSettings(options=OPTIONS, part=(index, 3)))
        assert verify(out).ok
    assert contents(out) == contents(undisturbed)


@pytest.mark.slow
def test_parts_at_the_same_time_give_the_same_bytes(files, undisturbed, tmp_path) -> None:
    out = tmp_path / "out"
    processes = [start(*files, "--out", out, "--shard", f"{index}/3") for index in range(3)]
    for process in processes:
        _, errors = process.communicate(timeout=300)
        assert process.returncode == 0, errors
    assert contents(out) == contents(undisturbed)
    assert verify(out).complete


@pytest.mark.slow
def test_two_exports_at_the_same_time(files, undisturbed, tmp_path) -> None:
    """One makes the dataset, or each a share in turn; who comes while the other works is refused, and told why."""
    out = tmp_path / "out"
    done = [(process, *process.communicate(timeout=300)) for process in [start(*files, "--out", out) for _ in range(2)]]
    assert 0 in {process.returncode for process, *_ in done}
    for process, _, errors in done:
        assert process.returncode == 0 or (process.returncode == 2 and "is in use: another export" in errors), errors
    assert contents(out) == contents(undisturbed)
    assert verify(out).complete and not verify(out).foreign


def test_scenes_may_come_one_after_the_other(scenarios, undisturbed, tmp_path) -> None:
    out = tmp_path / "out"
    export(scenarios[1:], out, SETTINGS)
    export([scenarios[0].with_(num_frames=2)], out, SETTINGS)
    assert len(open_dataset(out)) == 5
    report = export(scenarios, out, SETTINGS)
    assert (report.num_made, report.num_kept) == (5, 5)
    assert contents(out) == contents(undisturbed)


def kill_and_resume(files: list[Path], out: Path, undisturbed: Path, kills: int, seed: int) -> int:
    """Kill an export at random moments until it is through; return how often it was killed at work."""
    moments = random.Random(seed)
    killed = 0
    for _ in range(20 * kills):
        if killed == kills:
            break
        process = start(*files, "--out", out)
        before = kept_frames(out)
        if wait_until(lambda before=before: kept_frames(out) != before, process):
            delay = moments.uniform(0.0, 0.15)
            try:
                process.wait(delay)
            except subprocess.TimeoutExpired:
                killed += 1
        process.send_signal(signal.SIGKILL)
        process.communicate()
        if verify(out).complete:
            for name in ("one", "two"):  # begin anew: there are more kills than this export has moments
                shutil.rmtree(out / "shards" / name)
            shutil.rmtree(out)
            continue
        dataset = open_dataset(out)  # what is finished can be read at any moment
        for frame in dataset:
            assert frame.radar["front"].adc.shape
    export([ScenarioSpec.load(path) for path in files], out, SETTINGS)
    assert contents(out) == contents(undisturbed)
    assert verify(out).complete
    assert not (out / ".work").exists()
    return killed


def test_kill_at_random_moments(files, undisturbed, tmp_path) -> None:
    assert kill_and_resume(files, tmp_path / "out", undisturbed, kills=1, seed=1) == 1


@pytest.mark.slow
def test_kill_at_random_moments_twenty_times(files, undisturbed, tmp_path) -> None:
    assert kill_and_resume(files, tmp_path / "out", undisturbed, kills=20, seed=2) == 20


@pytest.mark.slow
def test_ctrl_c_keeps_what_is_finished_and_no_frame_is_made_twice(files, scenarios, undisturbed, tmp_path) -> None:
    for attempt in range(5):  # ten small frames may all be finished before the signal is there
        out = tmp_path / f"out{attempt}"
        process = start(*files, "--out", out)
        wait_until(lambda out=out: len(kept_frames(out)) >= 2, process)
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=60)
        if process.returncode != 0:
            break
    assert process.returncode == 130
    assert f"finished frames are kept in {out}" in errors and "Traceback" not in errors
    kept = sum(len(json.loads(path.read_text())["frames"]) for path in out.glob("shards/*/??????.json"))
    kept += len(list(out.glob(".work/*/*/*.pack")))
    assert kept >= 2
    report = export(scenarios, out, SETTINGS)
    assert (report.num_made, report.num_kept) == (10 - kept, kept)
    assert contents(out) == contents(undisturbed)


def full_disk(tmp_path: Path, kilobytes: int) -> Path:
    """Return a folder on a small file system of its own."""
    place = tmp_path / "small"
    place.mkdir()
    done = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", f"size={kilobytes}k", "tmpfs", str(place)],
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode != 0:
        pytest.skip(f"no file system may be mounted here: {done.stderr.strip()}")
    return place


def test_a_full_disk_stops_it_and_nothing_is_lost(scenarios, undisturbed, tmp_path) -> None:
    """The kernel refuses writes in the middle of a shard or of the manifest.

    Where it may be mounted, on a small file system.
    """
    place = full_disk(tmp_path, 230)
    try:
        with pytest.raises(OutputError, match="free some space; the same command goes on"):
            export(scenarios, place / "out", SETTINGS)
        finished = len(open_dataset(place / "out"))
        assert finished < 10
        stopped = (
            "belongs to no finished shard",
            "an export that was stopped",
            "not what follows from",
            "not the card of",
        )
        assert all(any(text in fault.what for text in stopped) for fault in verify(place / "out").faults)
        subprocess.run(["mount", "-o", "remount,size=100m", str(place)], check=True)
        report = export(scenarios, place / "out", SETTINGS)
        assert report.num_kept >= finished
        assert contents(place / "out") == contents(undisturbed)
        assert verify(place / "out").complete
    finally:
        subprocess.run(["umount", str(place)], check=True)


@pytest.mark.some(2)
@pytest.mark.parametrize("limit", [2_000, 12_000, 30_000])
def test_a_file_that_the_system_does_not_take(scenarios, undisturbed, tmp_path, limit) -> None:
    """Files are limited by the kernel, so that a write fails in the middle of a kept frame, a shard or the manifest."""
    out = tmp_path / "out"
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    signal_before = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, before[1]))
    try:
        with pytest.raises(OutputError, match="cannot write"):
            export(scenarios, out, SETTINGS)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, signal_before)
    assert not [path for path in out.rglob("*") if ".partial" in path.name or path.name.startswith("part_")]
    export(scenarios, out, SETTINGS)
    assert contents(out) == contents(undisturbed)


def test_a_dead_worker_is_replaced(files, undisturbed, tmp_path) -> None:
    out = tmp_path / "out"
    process = start(*files, "--out", out, "--workers", 1)
    assert wait_until(lambda: len(kept_frames(out)) >= 1, process)
    victim = lock_holder(out)
    if victim is not None:
        os.kill(victim, signal.SIGKILL)
    _, errors = process.communicate(timeout=240)
    assert process.returncode == 0, errors
    assert victim is not None, "the export was through before a worker could be found"
    assert contents(out) == contents(undisturbed)


def lock_holder(out: Path) -> int | None:
    """Return the process that holds the lock of a shard."""
    for lock in out.glob(".locks/*_000*.lock"):
        inode = lock.stat().st_ino
        for line in Path("/proc/locks").read_text().splitlines():
            words = line.split()
            if f":{inode}" in line and words[1] == "FLOCK" and int(words[4]) != os.getpid():
                return int(words[4])
    return None


@pytest.mark.slow
def test_a_scheduler_elsewhere_and_its_loss(files, scenarios, undisturbed, tmp_path) -> None:
    out, address_file = tmp_path / "out", tmp_path / "scheduler.json"
    module = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--port", "0", "--no-dashboard"]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, **with_parent()}
    scheduler = subprocess.Popen([*module, "--scheduler-file", str(address_file)], **quiet)
    worker = None
    try:
        assert wait_until(address_file.exists, scheduler)
        worker = subprocess.Popen(
            [
                sys.executable,
                "-m",
                "distributed.cli.dask_worker",
                "--scheduler-file",
                str(address_file),
                "--nworkers",
                "1",
                "--nthreads",
                "1",
                "--no-dashboard",
                "--death-timeout",
                "60",
                "--local-directory",
                str(tmp_path),
            ],
            **quiet,
        )
        address = json.loads(address_file.read_text())["address"]
        process = start(*files, "--out", out, "--scheduler", address)
        assert wait_until(lambda: len(kept_frames(out)) >= 2, process)
        scheduler.send_signal(signal.SIGKILL)
        _, errors = process.communicate(timeout=120)
        assert process.returncode == 2
        assert "the Dask scheduler was lost" in errors and "the same command goes on from there" in errors
        assert "Traceback" not in errors  # of Dask's own log
    finally:
        for item in (scheduler, worker):
            if item is not None:
                item.kill()
                item.wait()
    export(scenarios, out, SETTINGS)
    assert contents(out) == contents(undisturbed)


def test_a_scheduler_that_is_not_there(scenarios, tmp_path, monkeypatch) -> None:
    monkeypatch.setattr("scarl_sionna.batch.cluster.CONNECT_SECONDS", 1.0)
    with pytest.raises(ExportError, match=r"no Dask scheduler answers at tcp://127\.0\.0\.1:9 within 1 s"):
        export(scenarios, tmp_path / "out", ExportSettings(options=OPTIONS, scheduler="tcp://127.0.0.1:9"))


@pytest.fixture
def failing(monkeypatch) -> dict[int, Exception]:
    """Return frames that fail, and how: the sensor's own error, as on a machine with too little memory."""
    wrong: dict[int, Exception] = {}
    real = job_module.observe

    def observe_or_fail(*arguments, index, **options):
        if index in wrong:
            raise wrong[index]
        return real(*arguments, index=index, **options)

    monkeypatch.setattr(job_module, "observe", observe_or_fail)
    return wrong


def test_a_failing_frame_is_recorded_and_tried_again(scenarios, undisturbed, tmp_path, failing) -> None:
    out = tmp_path / "out"
    failing[2] = RuntimeError("out of memory")
    recording = ExportSettings(options=OPTIONS, on_error="record")
    report = export(scenarios, out, recording)
    assert report.failed == {("one", 2): "RuntimeError: out of memory", ("two", 2): "RuntimeError: out of memory"}
    assert (report.num_made, len(open_dataset(out))) == (8, 8)
    assert [frame.index for frame in open_dataset(out).scene("two")] == [0, 1]
    found = verify(out)
    assert found.ok and not found.complete and len(found.failed) == 2
    failing.clear()
    again = export(scenarios, out, recording)
    assert (again.num_made, again.num_kept, again.failed) == (2, 8, {})
    assert contents(out) == contents(undisturbed)


def test_a_failing_frame_stops_the_export_if_asked_to(scenarios, undisturbed, tmp_path, failing) -> None:
    failing[2] = RuntimeError("out of memory")
    with pytest.raises(ExportError, match=r"frame 2 of one failed \(RuntimeError: out of memory\).*--on-error record"):
        export(scenarios, tmp_path / "out", SETTINGS)
    failing.clear()
    report = export(scenarios, tmp_path / "out", SETTINGS)
    assert (report.num_made, report.num_kept) == (8, 2)
    assert contents(tmp_path / "out") == contents(undisturbed)


def test_what_cannot_be_is_refused_before_anything_is_made(scenarios, tmp_path) -> None:
    out = tmp_path / "out"
    with pytest.raises(ParameterRangeError, match="two of the name 'one'.*give one of them another `name`"):
        export([scenarios[0], scenarios[0]], out, SETTINGS)
    other = Rig("other", (SensorMount("front/lidar", "lidar", RIG.sensors[1].spec, Pose()),))
    other.save(tmp_path / "other.yaml")
    with pytest.raises(ParameterRangeError, match="rigs of 'one' and 'two' differ"):
        export([scenarios[0], scenarios[1].with_(rig=str(tmp_path / "other.yaml"))], out, SETTINGS)
    with pytest.raises(ParameterRangeError, match="one of them"):
        ExportSettings(workers=2, scheduler="tcp://127.0.0.1:9")
    assert not out.exists()


def test_a_changed_scene_is_another_configuration(tmp_path) -> None:
    paths = scenario_files(tmp_path / "s", one=1)
    scenario = ScenarioSpec.load(paths[0])
    export([scenario], tmp_path / "out", SETTINGS)
    mesh = next((tmp_path / "s").rglob("car.ply"))
    mesh.write_bytes(mesh.read_bytes() + b"\n")
    with pytest.raises(OutputError, match=r"scenes\.one\.scene_files: .* there, .* asked for"):
        export([scenario], tmp_path / "out", SETTINGS)
    with pytest.raises(OutputError, match=r"seed: 0 there, 7 asked for"):
        export([scenario.with_(seed=7)], tmp_path / "out", SETTINGS)


def test_an_edited_scene_is_read_anew_in_the_same_process(tmp_path) -> None:
    scenario = ScenarioSpec.load(scenario_files(tmp_path / "s", one=1)[0])
    mesh, plan_file = next((tmp_path / "s").rglob("car.ply")), tmp_path / "plan.json"
    export([scenario], tmp_path / "short", ExportSettings(options=OPTIONS, plan_file=plan_file))
    body = trimesh.load_mesh(mesh)
    body.apply_scale(2.0)
    body.export(mesh)
    export([scenario], tmp_path / "long", SETTINGS)
    size = {
        name: next(item.size[0] for item in open_dataset(tmp_path / name)[0].to_frame().objects if item.name == "car")
        for name in ("short", "long")
    }
    assert size == pytest.approx({"short": 4.0, "long": 8.0}, rel=1e-3)
    with pytest.raises(ExportError, match="files have changed since"):
        export([scenario], tmp_path / "planned", ExportSettings(options=OPTIONS, plan_file=plan_file))


@pytest.mark.skipif(
    os.geteuid() == 0 and not Path("/proc/self/attr").exists(), reason="needs a user without privileges"
)
def test_a_read_only_folder(scenarios, tmp_path) -> None:
    if os.geteuid() == 0:  # root may write anywhere: take a file system that nobody writes to
        out = Path("/proc/self/out")
    else:
        out = tmp_path / "closed" / "out"
        out.parent.mkdir(mode=0o500)
    with pytest.raises(OutputError, match="choose a folder that you may write to"):
        export(scenarios, out, SETTINGS)


def test_motion_is_checked_for_all_scenarios_before_anything_is_made(scenarios, tmp_path) -> None:
    with pytest.raises(TimeRangeError, match="outside the motion"):  # 2 s are known, the last frame is at 3.98 s
        export([scenarios[0], scenarios[1].with_(num_frames=200)], tmp_path / "out", SETTINGS)
    assert not (tmp_path / "out").exists()


def test_errors_of_workers_can_be_sent() -> None:
    """An error that is made of several values does not survive its way through pickle."""
    for error in (
        OutputError("disk"),
        ExportError("frame"),
        TimeRangeError(3.0, 0.0, 2.0, "scene"),
        PlacementError("inside"),
    ):
        sent = pickle.loads(pickle.dumps(portable(error)))
        assert str(error) in str(sent) and isinstance(sent, ScarlError)
