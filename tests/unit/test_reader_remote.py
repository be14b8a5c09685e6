"""Datasets on servers that give no parts of files, refuse, or do not answer: what is said is true."""

from __future__ import annotations

import http.server
import re
import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import ClassVar

import fsspec
import pytest
from fsspec.implementations.memory import MemoryFileSystem

from scarl_sionna.core.errors import DatasetError, DatasetUnreachable, ScarlWarning
from scarl_sionna.dataset import open_dataset
from scarl_sionna.dataset.encoding import StoreOptions
from scarl_sionna.dataset.write import write_dataset
from tests.frames import RIG, assert_same, make_frame

with_http = pytest.mark.skipif(find_spec("aiohttp") is None, reason="needs aiohttp")
FRAMES = [make_frame(index) for index in range(3)]


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("remote") / "out"
    return write_dataset(out, RIG.to_dict(), {"a": FRAMES}, options=StoreOptions(shard_frames=2, layout="files"))


class Whole(http.server.SimpleHTTPRequestHandler):
    """Python's own server: it knows no ranges, and sends the whole file."""

    def log_message(self, format: str, *args: object) -> None:
        """Write nothing."""


class Ranged(Whole):
    """Sends parts of files, as most servers do; `sizes` are those of its answers for ZIP files [bytes]."""

    sizes: ClassVar[list[int]] = []

    def do_GET(self) -> None:
        """Answer a request."""
        asked, path = re.fullmatch(r"bytes=(\d+)-(\d*)", self.headers.get("Range", "")), self.translate_path(self.path)
        if asked is None or not Path(path).is_file():
            super().do_GET()
            return
        data = Path(path).read_bytes()
        start, last = int(asked[1]), min(int(asked[2] or len(data)), len(data) - 1)
        self.send_response(206)
        self.send_header("Content-Range", f"bytes {start}-{last}/{len(data)}")
        self.send_header("Content-Length", str(last + 1 - start))
        self.end_headers()
        self.wfile.write(data[start : last + 1])
        if path.endswith(".zip"):
            self.sizes.append(last + 1 - start)


class Refusing(Whole):
    """Answers 500 for all but the manifest and the records."""

    def do_GET(self) -> None:
        """Answer a request."""
        if "/arrays/" in self.path or "/images/" in self.path:
            self.send_error(500)
        else:
            super().do_GET()


@contextmanager
def served(folder: Path, handler: type[Whole]) -> Iterator[str]:
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), partial(handler, directory=str(folder)))
    thread = threading.Thread(target=server.serve_forever)
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_port}"
    finally:
        server.shutdown()
        thread.join()
        server.server_close()


class Unwilling(MemoryFileSystem):
    """A store in memory that sends whole files, or answers as its mood says."""

    protocol = "unwilling"
    mood: Exception | None = None
    store: ClassVar[dict[str, object]] = {}
    pseudo_dirs: ClassVar[list[str]] = [""]

    @classmethod
    def _strip_protocol(cls, path: str) -> str:
        return "/" + path.removeprefix("unwilling://").strip("/")

    def cat_file(self, path: str, start: int | None = None, end: int | None = None, **more: object) -> bytes:
        """Return the whole file."""
        if type(self).mood is not None and "/arrays/" in path:
            raise type(self).mood
        return super().cat_file(path)


class Status(Exception):
    """An answer of a server, as aiohttp raises it."""

    status = 503


@pytest.fixture
def unwilling(folder) -> Iterator[str]:
    fsspec.register_implementation("unwilling", Unwilling, clobber=True)
    Unwilling.mood = None
    for path in folder.rglob("*"):
        if path.is_file():
            Unwilling().pipe_file(f"/out/{path.relative_to(folder).as_posix()}", path.read_bytes())
    yield "unwilling://out"
    Unwilling.store.clear()


def test_whole_files_in_place_of_parts_are_read_and_told_of(unwilling) -> None:
    dataset = open_dataset(unwilling)
    with pytest.warns(ScarlWarning, match="no HTTP ranges") as told:
        assert_same(dataset[0].to_frame(), FRAMES[0])
        assert_same(dataset[2].to_frame(), FRAMES[2])
    assert len(told) == 1


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (Status("Service Unavailable"), r"answers 503 for arrays/.*Service Unavailable"),
        (TimeoutError(), "does not give arrays/.*TimeoutError"),
        (ConnectionRefusedError("refused"), "does not give arrays/.*refused"),
        (PermissionError("no key"), "does not give arrays/.*no key"),
    ],
)
def test_a_store_that_does_not_answer_is_no_damage(unwilling, error: Exception, words: str) -> None:
    dataset = open_dataset(unwilling)
    Unwilling.mood = error
    with pytest.raises(DatasetUnreachable, match=words) as caught:
        dataset[0].to_frame()
    assert "damaged" not in str(caught.value) and "repair" not in str(caught.value)


@with_http
def test_a_server_with_ranges_sends_parts_of_a_shard(tmp_path) -> None:
    out = write_dataset(tmp_path / "out", RIG.to_dict(), {"a": FRAMES}, options=StoreOptions(shard_frames=2))
    with served(out, Ranged) as url, warnings.catch_warnings():
        warnings.simplefilter("error")
        dataset = open_dataset(url)
        assert (dataset[1].image["front/camera"].rgb == FRAMES[1].images["front/camera"].rgb).all()
        assert 0 < sum(Ranged.sizes) < (out / "shards/a/000000.zip").stat().st_size / 3
        for frame, written in zip(dataset, FRAMES, strict=True):
            assert_same(frame.to_frame(), written)


@with_http
def test_a_server_without_ranges_is_read_and_told_of(folder) -> None:
    with served(folder, Whole) as url:
        dataset = open_dataset(url)
        with pytest.warns(ScarlWarning, match="no HTTP ranges"):
            assert_same(dataset[0].to_frame(), FRAMES[0])
        with warnings.catch_warnings():  # once is enough
            warnings.simplefilter("error")
            assert_same(dataset[2].to_frame(), FRAMES[2])


@with_http
def test_a_server_that_goes_away_is_no_damage(folder) -> None:
    with served(folder, Whole) as url:
        dataset = open_dataset(url)
    with pytest.raises(DatasetUnreachable, match=r"does not give .*check the address, the network") as caught:
        dataset[0].to_frame()
    assert "damaged" not in str(caught.value) and "repair" not in str(caught.value)
    with pytest.raises(DatasetUnreachable, match=r"manifest\.json"):
        open_dataset(url)


@with_http
def test_a_server_that_refuses_is_no_damage(folder) -> None:
    with served(folder, Refusing) as url:
        dataset = open_dataset(url)
        with pytest.raises(DatasetUnreachable, match="answers 500 for arrays/"):
            dataset[0].to_frame()


@with_http
def test_a_place_without_a_dataset_says_so(folder) -> None:
    with served(folder, Whole) as url, pytest.raises(DatasetError, match=r"no dataset here \(no manifest\.json\)"):
        open_dataset(f"{url}/arrays")


def test_a_protocol_without_its_package_names_the_remedy() -> None:
    with pytest.raises(DatasetError, match="install the fsspec package of its protocol"):
        open_dataset("nosuchprotocol://bucket/dataset")
