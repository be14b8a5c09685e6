"""Ten thousand frames in one dataset: it opens and goes on at once, and `verify` takes time as there are frames."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import pytest

from scarl_sionna.dataset import StoreOptions, open_dataset
from scarl_sionna.dataset.encoding import encode_frame
from scarl_sionna.dataset.store.manifest import DatasetPlan, ScenePlan, dump_manifest, manifest_data
from scarl_sionna.dataset.store.records import bundle_name, record_name
from scarl_sionna.dataset.store.writer import DatasetFolder
from scarl_sionna.dataset.verify import verify
from scarl_sionna.fusion import Rig
from tests.frames import RIG, make_frame

DEPTH = next(mount for mount in RIG.sensors if mount.name == "front/depth")
PER_SCENE = 200


def plan(num_frames: int) -> DatasetPlan:
    scenes = tuple(ScenePlan(f"s{number:03d}", PER_SCENE) for number in range(num_frames // PER_SCENE))
    return DatasetPlan(Rig("one", (DEPTH,)).to_dict(), scenes, StoreOptions())


def make(out: Path, num_frames: int) -> Path:
    """Write a dataset of small frames, the same ones in every scene."""
    frame = make_frame(1)
    frame = replace(frame, results={"front/depth": frame.results["front/depth"]}, objects=())
    with ThreadPoolExecutor(1) as pool, DatasetFolder(out, plan(num_frames)) as folder:
        encoded = [
            encode_frame(replace(frame, index=index, timestamp_ns=index), StoreOptions(), pool)
            for index in range(PER_SCENE)
        ]
        for scene in folder.plan.scenes:
            for number in range(scene.num_shards(folder.plan.options)):
                with folder.shard(scene.name, number) as shard:
                    for index in shard.missing:
                        shard.add(encoded[index])
                    shard.commit()
        folder.finalize()
    return out


def cpu_seconds(work: Callable[[], object], rounds: int = 2) -> float:
    """Return the least CPU time of a few rounds [s]."""
    taken = []
    for _ in range(rounds):
        started = time.process_time()
        work()
        taken.append(time.process_time() - started)
    return min(taken)


def test_ten_thousand_frames_open_and_go_on_at_once(tmp_path) -> None:
    """Simulated in the index: manifest and names of records are there, and what is not finished is found."""

    def index(num_frames: int) -> Path:
        out, planned = tmp_path / str(num_frames), plan(num_frames)
        rows = [["0" * 64, 8, [], 10**6]] * (PER_SCENE // 8)
        (out / "shards").mkdir(parents=True)
        for scene in planned.scenes:
            (out / "shards" / scene.name).mkdir()
            for number in range(PER_SCENE // 8):
                (out / record_name(scene.name, number)).touch()
                (out / bundle_name(scene.name, number)).touch()
                os.truncate(out / bundle_name(scene.name, number), 10**6)  # of nothing: no block of the disk
        manifest = dump_manifest(manifest_data(planned, {scene.name: rows for scene in planned.scenes}))
        (out / "manifest.json").write_text(manifest)
        return out

    def resume(out: Path, count: int) -> None:
        with DatasetFolder(out, plan(count)) as folder:
            assert all(folder.is_finished(scene.name, n) for scene in folder.plan.scenes for n in range(25))

    small, large = index(2_000), index(10_000)
    assert len(open_dataset(large)) == 10_000
    opened = [cpu_seconds(lambda place=place: open_dataset(place)) for place in (small, large)]
    resumed = [cpu_seconds(lambda p=place, n=n: resume(p, n)) for place, n in ((small, 2_000), (large, 10_000))]
    print(f"CPU seconds of 2,000 and 10,000 frames: open {opened}, resume {resumed}")
    assert opened[1] < 0.1
    assert resumed[1] < 5 * 1.5 * resumed[0] + 0.02  # linear: five times as many, half as much for caches


@pytest.mark.slow
def test_verify_takes_the_time_of_its_frames(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr("os.fsync", lambda descriptor: None)  # the disk's time is not meant
    small, large = make(tmp_path / "small", PER_SCENE), make(tmp_path / "large", 5 * PER_SCENE)
    assert sum(path.is_file() for path in large.rglob("*") if ".locks" not in path.parts) == 2 * 125 + 3
    verified = [cpu_seconds(lambda place=place: verify(place), 1) for place in (small, large)]
    print(f"CPU seconds of verify, 200 and 1,000 frames: {verified}")
    assert verified[1] < 5 * 1.5 * verified[0]
