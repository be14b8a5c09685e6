"""Flipped bits in the files of a dataset: a reader gives what was written, or an error that names the file."""

from __future__ import annotations

import hashlib
import json
import random
import shutil
import warnings
from pathlib import Path
from typing import Literal

import numpy as np
import pytest

from scarl_sionna.core.errors import DatasetError, ScarlWarning
from scarl_sionna.dataset import open_dataset
from scarl_sionna.dataset.encoding import StoreOptions, encode_png
from scarl_sionna.dataset.store.manifest import dump_manifest, manifest_data
from scarl_sionna.dataset.verify import verify
from scarl_sionna.dataset.write import write_dataset
from tests.frames import RIG, assert_same, make_frame

FRAMES = [make_frame(index) for index in range(4)]


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> Path:
    return written(tmp_path_factory.mktemp("damage") / "out", "files")


def written(out: Path, layout: Literal["packed", "files"]) -> Path:
    return write_dataset(out, RIG.to_dict(), {"a": FRAMES}, options=StoreOptions(shard_frames=2, layout=layout))


def read_by(out: Path) -> dict[int, str]:
    """Return what became of each frame: nothing if it is as written, else the error."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a manifest that is read from its copy says so
        try:
            dataset = open_dataset(out)
        except DatasetError as error:
            return dict.fromkeys(range(len(FRAMES)), str(error))
    outcome = {}
    for index, written in enumerate(FRAMES):
        try:
            assert_same(dataset[index].to_frame(), written)
            outcome[index] = ""
        except DatasetError as error:
            outcome[index] = str(error)
    return outcome


def flipped(path: Path, bit: int) -> bytes:
    data = bytearray(path.read_bytes())
    data[bit // 8] ^= 1 << bit % 8
    return bytes(data)


@pytest.mark.parametrize("count", [30, pytest.param(1000, marks=pytest.mark.slow)])
def test_no_flipped_bit_is_read_in_silence(whole, tmp_path, count: int) -> None:
    out = tmp_path / "out"
    shutil.copytree(whole, out)
    # what readers of ours do not read: the card, metadata for other readers, the copy of the manifest
    unread = ("README.md", "zarr.json", "manifest.backup.json")
    files = sorted(
        path for path in out.rglob("*") if path.is_file() and path.name not in unread and path.stat().st_size
    )
    rng, seen = random.Random(5), 0
    for _ in range(count):
        path = rng.choice(files)
        before = path.read_bytes()
        path.write_bytes(flipped(path, rng.randrange(8 * len(before))))
        outcome = read_by(out)
        path.write_bytes(before)
        name = path.relative_to(out).as_posix()
        if path.name == "manifest.json":
            continue  # any outcome of `read_by` will do: another frame than the one written fails there
        assert any(outcome.values()), f"{name} was read as if nothing had happened"
        assert all(not text or name.rpartition("/")[2].partition(".")[0] in text for text in outcome.values()), outcome
        seen += 1
    assert seen > 0.8 * count


@pytest.mark.parametrize("count", [30, pytest.param(1000, marks=pytest.mark.slow)])
def test_no_flipped_bit_of_a_packed_dataset_is_read_in_silence(tmp_path, count: int) -> None:
    """What no reader of ours reads of a ZIP file, its own headers, `verify` still holds to the record."""
    out = written(tmp_path / "out", "packed")
    places = {
        path.with_suffix(".zip"): [(start, start + size) for size, _, start in files.values()]
        for path in out.glob("shards/a/*.json")
        if (files := json.loads(path.read_text())["files"])
    }
    files = [*places, *out.glob("shards/a/*.json"), out / "manifest.json"]
    rng, seen, unread = random.Random(6), 0, 0
    for _ in range(count):
        path = rng.choice([*places, *files])  # most bytes are in the ZIP files
        before = path.read_bytes()
        bit = rng.randrange(8 * len(before))
        path.write_bytes(flipped(path, bit))
        outcome = read_by(out)
        if path in places and not any(start <= bit // 8 < stop for start, stop in places[path]):
            assert not any(outcome.values()), outcome
            if unread < 10:
                assert path.relative_to(out).as_posix() in {fault.name for fault in verify(out).faults}
            unread += 1
        elif path.name != "manifest.json":  # of that any outcome of `read_by` will do, as above
            assert any(outcome.values()), f"{path.name}, byte {bit // 8}, was read as if nothing had happened"
            assert all(not text or path.relative_to(out).as_posix() in text for text in outcome.values()), outcome
            seen += 1
        path.write_bytes(before)
    assert seen > 0.5 * count and unread


def just_killed(out: Path, layout: Literal["packed", "files"]) -> Path:
    """Write a dataset as a kill leaves it when its shards are in place: the manifest lists none of them yet."""
    plan = open_dataset(written(out, layout)).plan
    for name in ("manifest.json", "manifest.backup.json"):
        (out / name).write_text(dump_manifest(manifest_data(plan, {"a": [None, None]})))
    return out


@pytest.mark.parametrize("layout", ["packed", "files"])
@pytest.mark.parametrize("count", [15, pytest.param(500, marks=pytest.mark.slow)])
def test_no_flipped_bit_is_read_in_silence_before_the_manifest_lists_the_shards(tmp_path, layout, count: int) -> None:
    """A record has a checksum of its own; one that is damaged costs its frames, and the rest is read."""
    out = just_killed(tmp_path / "out", layout)
    assert not any(read_by(out).values())
    rng = random.Random(7)
    for _ in range(count):
        number = rng.randrange(2)
        path = out / f"shards/a/{number:06d}.json"
        before = path.read_bytes()
        path.write_bytes(flipped(path, rng.randrange(8 * len(before))))
        with pytest.warns(ScarlWarning, match=f"{path.name}: (the record of a shard is damaged|nothing holds)") as seen:
            dataset = open_dataset(out)
        if "nothing holds" in str(seen[0].message):  # the word "checksum" itself, which is no data
            assert_same(dataset[2 * number].to_frame(), FRAMES[2 * number])
        else:
            assert [frame.index for frame in dataset] == [2 - 2 * number, 3 - 2 * number]
            assert_same(dataset[0].to_frame(), FRAMES[2 - 2 * number])
            with pytest.raises(DatasetError, match=f"no frame {2 * number} .*{path.name}.*damaged"):
                dataset.scene("a").frame(2 * number)
        path.write_bytes(before)


def test_a_damaged_record_that_is_not_listed_is_removed_and_the_rest_kept(tmp_path) -> None:
    out = just_killed(tmp_path / "out", "packed")
    path = out / "shards/a/000001.json"
    text = path.read_text()
    size = str(json.loads(text)["bundle"][1])
    path.write_text(text.replace(size, str(int(size) + 1)))  # right in form, and a number that nothing else tells
    found = verify(out, repair=True)
    assert found.removed == [("a", 1)] and any("its checksum is wrong" in fault.what for fault in found.faults)
    assert not list(out.glob("shards/a/000001*"))
    assert [frame.index for frame in open_dataset(out)] == [0, 1]
    assert verify(out).ok


def test_a_record_without_a_checksum_that_is_not_listed_is_told(tmp_path) -> None:
    """As earlier versions wrote them, if they were killed before the manifest had one."""
    out = just_killed(tmp_path / "out", "packed")
    path = out / "shards/a/000001.json"
    text = path.read_text()
    path.write_text(text[: text.index(',\n "checksum"')] + "\n}\n")
    with pytest.warns(ScarlWarning, match=r"000001\.json: nothing holds its checksum; `scarl-sionna verify --repair`"):
        assert len(open_dataset(out)) == len(FRAMES)
    verify(out, repair=True)
    assert verify(out).complete and not any(read_by(out).values())


def test_another_number_in_the_manifest_is_seen(whole, tmp_path) -> None:
    """What is in the manifest, specifications for instance, is handed out, too."""
    out = tmp_path / "out"
    shutil.copytree(whole, out)
    text = (out / "manifest.json").read_text()
    other = text.replace('"num_azimuth": 5', '"num_azimuth": 4')
    assert text.count('"num_azimuth": 5') == 2 and len(other) == len(text)  # the rig and the calibration
    (out / "manifest.json").write_text(other)
    with pytest.warns(ScarlWarning, match=r"manifest\.json is damaged: its checksum is wrong"):
        assert_same(open_dataset(out)[0].to_frame(), FRAMES[0])
    (out / "manifest.backup.json").write_text(other)
    with pytest.raises(DatasetError, match=r"manifest\.json is damaged: its checksum is wrong"):
        open_dataset(out)
    (out / "manifest.json").write_text(text[: text.index(',\n "checksum"')] + "\n}\n")  # as before there was one
    assert_same(open_dataset(out)[0].to_frame(), FRAMES[0])
    (out / "manifest.json").write_text(other[: other.index(',\n "checksum"')] + "\n}\n")
    with pytest.raises(DatasetError, match=r"manifest\.json is damaged: its checksum is wrong"):
        open_dataset(out)


@pytest.mark.parametrize(
    "data", [b"no picture", b"\x89PNG\r\n\x1a\n cut", encode_png("rgb", np.zeros((9, 9, 3), np.uint8))[:-30]]
)
def test_a_picture_that_was_written_as_no_picture_is_a_typed_error(whole, tmp_path, data: bytes) -> None:
    """Checksums are right where somebody else wrote the file."""
    out = tmp_path / "out"
    shutil.copytree(whole, out)
    name, record = "images/a/front/camera/rgb/000003.png", json.loads((out / "shards/a/000001.json").read_text())
    (out / name).write_bytes(data)
    record["files"][name] = [len(data), hashlib.sha256(data).hexdigest()]
    del record["checksum"]
    text = json.dumps(record)
    (out / "shards/a/000001.json").write_text(text)
    manifest = json.loads((out / "manifest.json").read_text())
    del manifest["checksum"]
    manifest["shards"]["a"][1][0] = hashlib.sha256(text.encode()).hexdigest()
    (out / "manifest.json").write_text(json.dumps(manifest))
    with pytest.raises(DatasetError, match="frame 3, front/camera/rgb: an image cannot be decoded"):
        open_dataset(out)[3].to_frame()
    assert any("an image cannot be decoded" in fault.what for fault in verify(out).faults)


@pytest.mark.parametrize("image", ["rgb", "instance", "semantic", "depth"])
def test_a_damaged_image_names_its_file(whole, tmp_path, image: str) -> None:
    out = tmp_path / "out"
    shutil.copytree(whole, out)
    path = out / f"images/a/front/camera/{image}/000003.png"
    path.write_bytes(flipped(path, 8 * (path.stat().st_size // 2)))
    dataset = open_dataset(out)
    words = rf"{image}/000003.png cannot be read: it is not what was written.*repair"
    with pytest.raises(DatasetError, match=words):
        dataset[3].to_frame()
    assert_same(dataset[2].to_frame(), FRAMES[2])
