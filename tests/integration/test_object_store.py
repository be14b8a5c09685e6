"""Datasets in an object store: whole shards or none, whatever the server answers, and the bytes of a folder."""

from __future__ import annotations

import itertools
import os
import re
import signal
import subprocess
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from typer.testing import CliRunner

from scarl_sionna.batch import ExportSettings, export
from scarl_sionna.cli import app
from scarl_sionna.core.errors import DatasetError, DatasetUnreachable, OutputError
from scarl_sionna.dataset import StoreOptions, open_dataset, write_dataset
from scarl_sionna.dataset.encoding import EncodedFrame, encode_frame
from scarl_sionna.dataset.store import remote
from scarl_sionna.dataset.store.manifest import DatasetPlan, ScenePlan
from scarl_sionna.dataset.store.remote import RemoteFolder, fetch_shard, scratch_folder, send_shard
from scarl_sionna.dataset.verify import verify
from tests.children import with_parent
from tests.exports import command, contents, scenario_files
from tests.frames import RIG, assert_same, make_frame
from tests.s3_server import S3Server, s3_server

pytest.importorskip("s3fs")
pytest.importorskip("moto")
pytestmark = pytest.mark.own_process

FRAMES = [make_frame(index) for index in range(5)]
OPTIONS = StoreOptions(shard_frames=2)
URL = "s3://data/drives/one"


@pytest.fixture(scope="module")
def server() -> Iterator[S3Server]:
    with s3_server() as started:
        yield started


@pytest.fixture(autouse=True)
def clean(server, tmp_path, monkeypatch) -> None:
    server.begin()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    store = remote.RemoteTarget("s3://data")
    for name in store.walk():
        store.remove(name)


@pytest.fixture(scope="module")
def expected(tmp_path_factory) -> dict[str, bytes]:
    out = tmp_path_factory.mktemp("store") / "out"
    return contents(write_dataset(out, RIG.to_dict(), {"a": FRAMES}, options=OPTIONS))


@pytest.fixture(scope="module")
def encoded() -> list[EncodedFrame]:
    with ThreadPoolExecutor(1) as pool:
        return [encode_frame(frame, OPTIONS, pool) for frame in FRAMES]


def plan(count: int = 5, seed: int | None = None, options: StoreOptions = OPTIONS) -> DatasetPlan:
    return DatasetPlan(RIG.to_dict(), (ScenePlan("a", count, {} if seed is None else {"seed": seed}),), options)


def run(
    encoded: list[EncodedFrame], count: int = 5, url: str = URL, seed: int | None = None, *, overwrite: bool = False
) -> int:
    """Export as a job does; return the number of frames that were made."""
    made = 0
    folder = RemoteFolder(url, plan(count, seed), overwrite=overwrite)
    with folder:
        for number in range(-(-count // 2)):
            if folder.is_finished("a", number):
                continue
            scene = folder.plan.scene("a")
            if folder.rows["a"][number] is not None:
                fetch_shard(folder.target.url, folder.root, scene, number)
            with folder.shard("a", number) as shard:
                for index in shard.missing:
                    shard.add(encoded[index])
                    made += 1
                send_shard(folder.target.url, folder.root, scene, number, shard.commit())
        folder.finalize()
    return made


def stored(url: str = URL) -> dict[str, bytes]:
    target = remote.RemoteTarget(url)
    return {name: target.read(name) for name in target.walk()}


def scratch_files() -> list[str]:
    """Return what an export has left on this machine."""
    root = scratch_folder(URL)
    return sorted(path.relative_to(root).as_posix() for path in root.rglob("*") if path.is_file())


def test_the_store_holds_what_a_folder_holds(server, encoded, expected, tmp_path) -> None:
    assert run(encoded) == 5
    assert stored() == expected
    assert scratch_files() == [".locks/manifest.lock", ".locks/run.lock"]
    assert run(encoded) == 0
    dataset = open_dataset(URL)
    for frame, written in zip(dataset, FRAMES, strict=True):
        assert_same(frame.to_frame(), written)
    expected_adc = np.stack([frame.radars["radar"].adc_int for frame in FRAMES])
    np.testing.assert_array_equal(dataset.scene("a").group["radar/adc"][1:4], expected_adc[1:4])
    found = verify(URL)
    assert found.complete and not found.foreign and found.num_frames == 5
    called = CliRunner().invoke(app, ["verify", URL])
    assert called.exit_code == 0, called.output
    called = CliRunner().invoke(app, ["repack", URL, str(tmp_path / "files"), "--layout", "files"])
    assert called.exit_code == 0 and verify(tmp_path / "files").complete
    called = CliRunner().invoke(app, ["info", URL])
    assert f"Dataset {URL}: 5 frames in 1 scenes" in called.output


def test_only_a_part_is_read(server, encoded) -> None:
    run(encoded)
    sizes: list[int] = []
    whole = remote.RemoteTarget.read

    dataset = open_dataset(URL)
    dataset.files.read = lambda *a: sizes.append(len(data := whole(dataset.files, *a))) or data  # type: ignore[method-assign]
    assert dataset.scene("a").read_image(3, "front/camera", "rgb")
    assert 0 < max(sizes) < len(stored()["shards/a/000001.zip"])


@pytest.mark.slow
def test_access_denied_from_any_request_on(server, encoded, expected) -> None:
    """Credentials that expire at any request of an export: whole shards only are there; the next run completes it."""
    for step in itertools.count():
        clear()
        server.begin(lambda method, path, number, step=step: 403 if number >= step else None)
        try:
            run(encoded)
        except (OutputError, DatasetUnreachable) as error:
            assert re.search("refuses|does not give|answers|credentials", str(error))
        else:
            assert 20 < server.requests <= step  # it was through before
            server.begin()
            assert stored() == expected
            return
        server.begin()
        names = stored().keys()
        assert all(name.replace(".json", ".zip") in names for name in names if name.startswith("shards/"))
        if "manifest.json" in names:
            found = verify(URL)
            assert found.ok, (step, found.faults)
            for frame in open_dataset(URL):
                assert_same(frame.to_frame(), FRAMES[frame.index])
        kept = len(list(scratch_folder(URL).glob(".work/a/*/*.pack")))
        whole = sum(2 if "0002" not in name else 1 for name in shards_there(names) | shards_here())
        assert run(encoded) == 5 - kept - whole, step
        assert stored() == expected and scratch_files() == [".locks/manifest.lock", ".locks/run.lock"]


def shards_there(names) -> set[str]:
    return {name for name in names if name.startswith("shards/") and name.endswith(".json")}


def shards_here() -> set[str]:
    root = scratch_folder(URL)
    return {path.relative_to(root).as_posix() for path in root.glob("shards/*/*.json")}


def clear() -> None:
    target = remote.RemoteTarget("s3://data")
    for name in target.walk():
        target.remove(name)


def test_access_denied_in_the_middle(server, encoded, expected) -> None:
    server.begin(lambda method, path, number: 403 if method == "PUT" and path.endswith("000001.json") else None)
    with pytest.raises(OutputError, match=r"refuses shards/a/000001\.json .*credentials and permissions"):
        run(encoded)
    server.begin()
    assert "shards/a/000001.zip" in stored() and "shards/a/000001.json" not in stored()
    assert [frame.index for frame in open_dataset(URL)] == [0, 1]
    found = verify(URL)
    assert found.ok and not found.complete
    assert run(encoded) == 1 and stored() == expected  # the other two are kept on this machine


def test_a_store_that_may_not_be_listed_is_not_taken_for_an_empty_one(server, encoded, expected) -> None:
    run(encoded)
    server.begin(lambda method, path, number: 403 if method == "GET" and path.strip("/") == "data" else None)
    with pytest.raises(OutputError, match=r"refuses a list of shards/a .*credentials and permissions"):
        run(encoded)
    server.begin()
    assert stored() == expected


@pytest.mark.slow
def test_a_server_that_fails_once_is_asked_again(server, encoded, expected) -> None:
    failed = set[str]()

    def once(method: str, path: str, number: int) -> int | None:
        if method != "PUT" or path in failed:
            return None
        failed.add(path)
        return 503

    server.begin(once)
    run(encoded)
    assert len(failed) == 9 and stored() == expected


def test_more_frames_and_a_new_configuration(server, encoded, expected) -> None:
    assert run(encoded, 3) == 3
    assert verify(URL).complete
    assert run(encoded, 5) == 2  # the frame of the shard that grows comes from the store
    assert stored() == expected
    with pytest.raises(OutputError, match=rf"{URL} holds frames of another configuration.*seed"):
        run(encoded, 5, seed=1)
    assert stored() == expected
    remote.RemoteTarget(URL).write("notes.txt", b"mine")
    assert run(encoded, 5, seed=1, overwrite=True) == 5
    names = stored()
    assert names.pop("notes.txt") == b"mine" and names.keys() == expected.keys() and names != expected
    assert run(encoded, 5, overwrite=True) == 5
    assert stored() == expected | {"notes.txt": b"mine"}
    assert verify(URL).foreign == ["notes.txt"]


def test_a_damaged_object_is_named_and_repaired(server, encoded, expected) -> None:
    run(encoded)
    target = remote.RemoteTarget(URL)
    data = bytearray(expected["shards/a/000001.zip"])
    data[len(data) // 2] ^= 4
    target.write("shards/a/000001.zip", bytes(data))
    with pytest.raises(DatasetError, match=r"frame [23] of a: .*in shards/a/000001\.zip"):
        [open_dataset(URL)[index].to_frame() for index in (2, 3)]
    assert_same(open_dataset(URL)[4].to_frame(), FRAMES[4])
    assert not verify(URL).ok
    found = verify(URL, repair=True)
    assert found.removed == [("a", 1)]
    target.write("shards/a/000001.zip", b"left by a put that was stopped")
    assert verify(URL).ok and not verify(URL).complete and verify(URL).unfinished
    verify(URL, repair=True)
    assert "shards/a/000001.zip" not in stored() and verify(URL).num_frames == 3
    assert run(encoded) == 2
    assert stored() == expected


def test_what_cannot_be_says_why(server, encoded, expected, monkeypatch, tmp_path) -> None:
    with pytest.raises(OutputError, match=r"s3://nowhere/x .*make the bucket first"):
        run(encoded, url="s3://nowhere/x")
    for url in ("https://host/data", "ftp://host/data", "file:///data"):
        with pytest.raises(OutputError, match="give a folder, or an object store"):
            run(encoded, url=url)
    with pytest.raises(OutputError, match="layout 'packed' only"):
        RemoteFolder(URL, plan(options=replace(OPTIONS, layout="files")))
    target = remote.RemoteTarget(URL)
    target.write("thesis.txt", b"mine")
    with pytest.raises(OutputError, match=r"holds other files \(thesis.txt\) and no dataset; they are kept"):
        run(encoded)
    assert stored() == {"thesis.txt": b"mine"}
    with pytest.raises(DatasetError, match="no dataset here"):
        verify(URL)
    files = [str(path) for path in scenario_files(tmp_path / "s", one=1)]
    called = CliRunner().invoke(app, ["export", *files, "--out", "memory://x", "--workers", "2"])
    assert called.exit_code == 2 and "memory of this process" in called.output

    def missing(url: str) -> None:
        raise ImportError("Install s3fs to access S3")

    monkeypatch.setattr("fsspec.core.url_to_fs", missing)
    with pytest.raises(DatasetError, match=r"scarl-sionna\[s3\]"):
        open_dataset("s3://data/other")


@pytest.mark.slow
def test_a_server_that_is_down(encoded, tmp_path) -> None:
    with s3_server() as other:
        run(encoded, 2)
        other.stop()
        with pytest.raises(DatasetUnreachable, match="check the address, the network"):
            open_dataset(URL)
        with pytest.raises(DatasetUnreachable):
            run(encoded)


@pytest.mark.slow
def test_an_export_from_python(server, tmp_path) -> None:
    """The same bytes as in a folder."""
    files = scenario_files(tmp_path / "scenarios", one=3)
    from scarl_sionna.scenario.spec.scenario import ScenarioSpec

    scenarios = [ScenarioSpec.load(path) for path in files]
    settings = ExportSettings(options=OPTIONS)
    report = export(scenarios, "s3://data/made", settings)
    assert (report.num_made, report.address) == (3, "s3://data/made") and "s3://data/made" in str(report)
    export(scenarios, tmp_path / "out", settings)
    assert stored("s3://data/made") == contents(tmp_path / "out")
    assert export(scenarios, "s3://data/made", settings).num_kept == 3


@pytest.mark.slow
def test_killed_exports_with_workers_to_the_store(server, tmp_path) -> None:
    files = scenario_files(tmp_path / "scenarios", one=9, two=6)
    from scarl_sionna.scenario.spec.scenario import ScenarioSpec

    arguments = command(*files, "--out", URL, "--workers", 2)
    for attempt in range(6):
        process = subprocess.Popen(
            arguments, stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True, **with_parent()
        )
        try:
            process.wait(12 + 3 * attempt)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
        if "manifest.json" in stored():
            assert verify(URL).ok
    done = subprocess.run(arguments, capture_output=True, text=True, check=False, timeout=600, **with_parent())
    assert done.returncode == 0, done.stderr
    export(
        [ScenarioSpec.load(path) for path in files],
        tmp_path / "out",
        ExportSettings(options=StoreOptions(shard_frames=4)),
    )
    assert stored() == contents(tmp_path / "out")
