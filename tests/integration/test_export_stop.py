"""Ctrl-C and SIGTERM stop an export as a whole, whatever they hit.

No frame fails of them, and the same command goes on.
"""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import threading
import time
from contextlib import suppress
from pathlib import Path

import pytest

from scarl_sionna.batch import ExportSettings, ExportStopped, export
from scarl_sionna.batch import job as job_module
from scarl_sionna.dataset import StoreOptions, open_dataset
from scarl_sionna.dataset.verify import verify
from scarl_sionna.fusion import Rig, SensorMount
from scarl_sionna.scenario.spec.scenario import ScenarioSpec
from tests.exports import RIG, SHARD_FRAMES, contents, kept_frames, scenario_files, start, wait_until, wait_until_gone

OPTIONS = StoreOptions(shard_frames=SHARD_FRAMES)
RECORDING = ExportSettings(options=OPTIONS, on_error="record")
NUM_FRAMES = 9


@pytest.fixture(scope="module")
def files(tmp_path_factory) -> list[Path]:
    return scenario_files(tmp_path_factory.mktemp("scenarios"), one=NUM_FRAMES)


@pytest.fixture(scope="module")
def scenarios(files) -> list[ScenarioSpec]:
    return [ScenarioSpec.load(path) for path in files]


@pytest.fixture(scope="module")
def undisturbed(scenarios, tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("undisturbed") / "out"
    export(scenarios, out, RECORDING)
    return out


def engine_error(number: int) -> None:
    """Do what the engine does with a signal in a callback: its own error takes the exception's place."""
    with suppress(KeyboardInterrupt):
        signal.raise_signal(number)
    raise RuntimeError("jit_freeze(): a callback failed")


def engine_error_of(number: int) -> None:
    try:
        signal.raise_signal(number)
    except KeyboardInterrupt as error:
        raise RuntimeError("a callback failed") from error


def engine_silence(number: int) -> None:
    """Swallow it, as a callback that may not raise does."""
    with suppress(KeyboardInterrupt):
        signal.raise_signal(number)


@pytest.mark.some(2)
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("hit", [signal.raise_signal, engine_error, engine_error_of, engine_silence])
def test_a_signal_in_a_frame_is_no_failed_frame(scenarios, undisturbed, tmp_path, monkeypatch, number, hit) -> None:
    out, real = tmp_path / "out", job_module.observe

    def observe(*arguments, index, **options):
        if index == 5:
            hit(number)
        return real(*arguments, index=index, **options)

    before = [signal.getsignal(item) for item in (signal.SIGINT, signal.SIGTERM)]
    with monkeypatch.context() as patch, pytest.raises(ExportStopped, match=number.name) as stopped:
        patch.setattr(job_module, "observe", observe)
        export(scenarios, out, RECORDING)
    assert stopped.value.signal_number == number
    assert [signal.getsignal(item) for item in (signal.SIGINT, signal.SIGTERM)] == before
    found = verify(out)
    assert (found.ok, found.complete, found.failed) == (True, False, {})
    assert len(list(out.glob(".work/one/000001/*.pack"))) == 1  # frame 4; frame 5 was dropped
    assert f"stopped: ExportStopped: by {number.name}" in (out / "export.log").read_text()
    report = export(scenarios, out, RECORDING)
    assert (report.num_made, report.num_kept) == (NUM_FRAMES - 5, 5)
    assert contents(out) == contents(undisturbed)
    assert not (out / ".work").exists()


def test_a_frame_that_fails_by_itself_is_still_recorded(scenarios, tmp_path, monkeypatch) -> None:
    def observe(*arguments, index, **options):
        raise RuntimeError("out of memory")

    monkeypatch.setattr(job_module, "observe", observe)
    report = export([scenarios[0].with_(num_frames=1)], tmp_path / "out", RECORDING)
    assert report.failed == {("one", 0): "RuntimeError: out of memory"}


def test_an_export_in_a_thread_leaves_the_handlers_alone(scenarios, undisturbed) -> None:
    before, errors = signal.getsignal(signal.SIGTERM), []

    def run() -> None:
        try:
            export(scenarios, undisturbed, RECORDING)
        except BaseException as error:
            errors.append(error)

    thread = threading.Thread(target=run)
    thread.start()
    thread.join()
    assert not errors and signal.getsignal(signal.SIGTERM) == before


def test_a_handler_of_the_program_is_called_too(scenarios, tmp_path, monkeypatch) -> None:
    called = []
    before = signal.signal(signal.SIGTERM, lambda number, frame: called.append(number))
    try:
        monkeypatch.setattr(job_module, "observe", lambda *_, **__: engine_error(signal.SIGTERM))
        with pytest.raises(ExportStopped):
            export(scenarios, tmp_path / "out", RECORDING)
    finally:
        signal.signal(signal.SIGTERM, before)
    assert called == [signal.SIGTERM]


@pytest.fixture(scope="module")
def heavy(tmp_path_factory) -> Path:
    """Return a scenario whose frames are spent in the engine."""
    folder = tmp_path_factory.mktemp("heavy")
    (path,) = scenario_files(folder, one=40)
    camera, lidar, radar = RIG.sensors
    spec = camera.spec.with_(width=320, height=180, samples_per_pixel=32)
    Rig("heavy", (SensorMount(camera.name, "camera", spec, camera.vehicle_from_sensor), lidar, radar)).save(
        folder / "rig.yaml"
    )
    return path


def assert_stopped_whole(process: subprocess.Popen, out: Path, number: int) -> None:
    """Assert that a command ended as it should, and that its folder holds whole frames and no failed one."""
    _, errors = process.communicate(timeout=120)
    assert process.returncode == 128 + number, errors
    assert f"stopped, go on with the same command; finished frames are kept in {out}" in errors
    assert "Traceback" not in errors
    found = verify(out)
    assert (found.ok, found.failed) == (True, {}), found
    assert all(not json.loads(path.read_text())["failed"] for path in out.glob("shards/*/??????.json"))


@pytest.mark.some(1)
@pytest.mark.parametrize(("number", "rounds"), [(signal.SIGINT, 1), (signal.SIGINT, 4), (signal.SIGTERM, 4)])
def test_a_signal_in_the_middle_of_a_render(heavy, tmp_path, number, rounds) -> None:
    """At moments drawn at random, which fall into the engine, into our code and between frames."""
    out, moments = tmp_path / "out", random.Random(number)
    for _ in range(rounds):
        process = start(heavy, "--out", out, "--on-error", "record")
        before = kept_frames(out)
        assert wait_until(lambda before=before: kept_frames(out) != before, process)
        time.sleep(moments.uniform(0.0, 0.3))
        process.send_signal(number)
        assert_stopped_whole(process, out, number)
    assert len(kept_frames(out)) >= rounds
    assert len(open_dataset(out)) < 40


@pytest.mark.some(1)
@pytest.mark.parametrize(
    ("number", "to_group", "workers"),
    [
        (signal.SIGINT, True, 1),
        (signal.SIGINT, True, 2),
        (signal.SIGINT, False, 2),
        (signal.SIGTERM, True, 2),
        (signal.SIGTERM, False, 2),
    ],
)
def test_a_signal_with_workers(files, undisturbed, tmp_path, number, to_group, workers) -> None:
    """Ctrl-C in a terminal reaches the workers, too; kill reaches the main process alone. No process stays behind."""
    pytest.importorskip("distributed")
    out = tmp_path / "out"
    process = start(*files, "--out", out, "--workers", workers, "--on-error", "record", start_new_session=True)
    assert wait_until(lambda: bool(kept_frames(out)), process)
    (os.killpg if to_group else os.kill)(process.pid, number)
    assert_stopped_whole(process, out, number)
    assert wait_until_gone(process.pid)
    export([ScenarioSpec.load(path) for path in files], out, RECORDING)
    assert contents(out) == contents(undisturbed)
    assert not (out / ".work").exists()
