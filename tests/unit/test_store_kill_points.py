"""A process that is killed at any step of its work on the disk.

The next run loses nothing, makes the same bytes and cleans up.

Each step (a rename, a removal, a new folder) is one kill point: all of them are tried (by default every fifth, of
the layout "files" every sixteenth), so that what a kill at a random moment finds only now and then is found every time.
"""

from __future__ import annotations

import os
import shutil
import signal
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Literal

import pytest

from scarl_sionna.core.errors import DatasetError, OutputError
from scarl_sionna.dataset import StoreOptions, open_dataset
from scarl_sionna.dataset.encoding import EncodedFrame, encode_frame
from scarl_sionna.dataset.store import shard_writer as shard_writer_module
from scarl_sionna.dataset.store.manifest import DatasetPlan, ScenePlan
from scarl_sionna.dataset.store.writer import DatasetFolder
from scarl_sionna.dataset.verify import verify
from scarl_sionna.fusion import Rig
from tests.frames import RIG, make_frame

DEPTH = next(mount for mount in RIG.sensors if mount.name == "front/depth")
OPTIONS = StoreOptions(shard_frames=2)
NUM_FRAMES = 3
Layout = Literal["packed", "files"]
STEPS = ("replace", "unlink", "rmdir", "mkdir")
FOREIGN = {"notes.txt": "mine", "shards/a/mine.zip": "mine", ".work/mine": "mine"}


@pytest.fixture(autouse=True)
def no_waiting_for_the_disk(monkeypatch) -> None:
    """What a killed process has written is there without it, and it takes most of the time of this test."""
    monkeypatch.setattr(os, "fsync", lambda descriptor: None)


def plan(seed: int = 0, layout: Layout = "packed") -> DatasetPlan:
    options = replace(OPTIONS, layout=layout)
    return DatasetPlan(Rig("one", (DEPTH,)).to_dict(), (ScenePlan("a", NUM_FRAMES, {"seed": seed}),), options)


@pytest.fixture(scope="module")
def frames() -> list[EncodedFrame]:
    made = [make_frame(index) for index in range(NUM_FRAMES)]
    with ThreadPoolExecutor(1) as pool:
        return [
            encode_frame(replace(f, results={"front/depth": f.results["front/depth"]}), OPTIONS, pool) for f in made
        ]


def run(
    out: Path, frames: list[EncodedFrame], *, overwrite: bool = False, seed: int = 0, layout: Layout = "packed"
) -> int:
    """Export; return the number of frames that were not there before."""
    made = 0
    with DatasetFolder(out, plan(seed, layout), overwrite=overwrite) as folder:
        for number in range(2):
            if not folder.is_finished("a", number):
                with folder.shard("a", number) as shard:
                    for index in shard.missing:
                        shard.add(frames[index])
                        made += 1
                    shard.commit()
        folder.finalize()
    return made


def killed(work: Callable[[], object], step: int) -> bool:
    """Do something in a process that is killed before its n-th step on the disk; return whether it came so far."""
    process = os.fork()
    if process == 0:
        try:
            done = 0

            def before(real: Callable) -> Callable:
                def stepwise(*arguments, **options):
                    nonlocal done
                    done += 1
                    if done == step:
                        os.kill(os.getpid(), signal.SIGKILL)
                    return real(*arguments, **options)

                return stepwise

            for name in STEPS:
                setattr(Path, name, before(getattr(Path, name)))
            work()
            os._exit(0)
        finally:
            os._exit(1)
    status = os.waitpid(process, 0)[1]
    assert os.WIFSIGNALED(status) or os.WEXITSTATUS(status) == 0
    return os.WIFSIGNALED(status)


def contents(out: Path) -> dict[str, bytes]:
    """Return every file, that of the two locks that stay left out."""
    names = [path for path in out.rglob("*") if path.is_file()]
    return {
        path.relative_to(out).as_posix(): path.read_bytes()
        for path in names
        if path.name not in ("run.lock", "manifest.lock")
    }


def assert_tidy(out: Path, expected: dict[str, bytes]) -> None:
    """Assert that the folder holds what it should and nothing else, empty folders included."""
    assert contents(out) == expected
    empty = [path for path in out.rglob("*") if path.is_dir() and not any(path.iterdir())]
    assert not empty
    assert verify(out).complete


@pytest.fixture(scope="module")
def expected(frames, tmp_path_factory) -> dict[str, bytes]:
    out = tmp_path_factory.mktemp("kill") / "out"
    run(out, frames)
    return contents(out)


@pytest.mark.parametrize(
    ("layout", "stride"),
    [
        ("packed", 5),
        ("files", 16),
        *(pytest.param(layout, 1, marks=pytest.mark.slow) for layout in ("packed", "files")),
    ],
)
def test_killed_at_every_step_of_an_export(frames, tmp_path, layout, stride) -> None:
    run(tmp_path / "whole", frames, layout=layout)
    expected = contents(tmp_path / "whole")
    out, step = tmp_path / "out", 1
    while killed(lambda: run(out, frames, layout=layout), step):
        try:
            found = verify(out)
        except DatasetError:
            assert not (out / "shards").exists() and not (out / ".work").exists()
            kept = 0
        else:
            assert found.ok and not found.foreign, (step, found)
            assert not found.complete or contents(out) == expected, step  # all is there: only empty folders are to go
            finished = {frame.index for frame in open_dataset(out)}
            kept = len(finished | {int(path.stem) for path in out.glob(".work/a/*/*.pack")})
        assert run(out, frames, layout=layout) == NUM_FRAMES - kept, step  # nothing is made twice
        assert_tidy(out, expected)
        shutil.rmtree(out)
        step += stride
    assert step > (
        60 if layout == "files" else 45
    )  # files of two shards, three kept frames, manifest, its copy and the card
    assert_tidy(out, expected)


def test_killed_at_every_step_of_tidying_up(frames, expected, tmp_path, monkeypatch) -> None:
    """What a kill right after a shard is in place leaves is removed by a run that may be killed itself."""
    left = tmp_path / "left"
    real = shard_writer_module.clear_work

    def clear_or_die(folder: Path, keep=None) -> None:
        if keep is None:  # the record is written
            os.kill(os.getpid(), signal.SIGKILL)
        real(folder, keep)

    monkeypatch.setattr(shard_writer_module, "clear_work", clear_or_die)
    for number in range(2):
        assert killed(lambda: run(left, frames), 0)
        assert (
            sorted(path.name for path in left.glob(".work/a/*/*.pack"))
            == [["000000.pack", "000001.pack"], ["000002.pack"]][number]
        )
    monkeypatch.undo()
    (left / ".work" / "a" / "000000").mkdir()
    (left / ".work" / "a" / "000000" / "part_000000").write_text("cut")
    (left / ".work" / "a" / "000000" / ".partial_000001.pack_77").write_text("cut")
    (left / ".partial_manifest.json_77").write_text("cut")
    (left / "shards" / "a" / ".partial_000000.json_77").write_text("cut")
    out, step = tmp_path / "out", 1
    shutil.copytree(left, out)
    while killed(lambda: run(out, frames), step):
        assert verify(out).ok
        run(out, frames)
        assert_tidy(out, expected)
        shutil.rmtree(out)
        shutil.copytree(left, out)
        step += 1
    assert step > 5
    assert_tidy(out, expected)


@pytest.mark.some(1)
@pytest.mark.parametrize("lost", [(), ("manifest.json", "manifest.backup.json")])
def test_killed_at_every_eighth_step_of_an_overwrite(frames, expected, tmp_path, lost) -> None:
    """A later run without it either goes on rightly or refuses.

    With it, only the new dataset and the user's files are there.
    """
    old = tmp_path / "old"
    run(old, frames, seed=7)
    foreign_files = {".work/mine": "mine"} if lost else FOREIGN
    for name, text in foreign_files.items():
        (old / name).parent.mkdir(exist_ok=True)
        (old / name).write_text(text)
    for name in lost:
        (old / name).unlink()
    foreign = {name: text.encode() for name, text in foreign_files.items()}
    out, step = tmp_path / "out", 1
    shutil.copytree(old, out)
    while killed(lambda: run(out, frames, overwrite=True), step):
        assert foreign.items() <= contents(out).items(), step
        if step % 16 == 1:
            try:
                run(out, frames)
            except OutputError as error:
                assert "of another configuration" in str(error), step
        run(out, frames, overwrite=True)
        assert_tidy(out, expected | foreign)
        shutil.rmtree(out)
        shutil.copytree(old, out)
        step += 8
    assert step > 50
    assert_tidy(out, expected | foreign)
