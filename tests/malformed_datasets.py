"""Datasets as files that nobody vouches for: in a folder, and in archives."""

from __future__ import annotations

import hashlib
import json
import random
import shutil
import struct
import zipfile
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, Literal

import google_crc32c

from tests.malformed import Kind, evil_text, mutated
from tests.malformed_zip import NAMES, evil_zip


def _write_dataset(folder: Path, layout: Literal["packed", "files"] = "files") -> None:
    from scarl_sionna.dataset.encoding import StoreOptions
    from scarl_sionna.dataset.write import write_dataset
    from tests.frames import RIG as SMALL
    from tests.frames import make_frame

    frames = [make_frame(index) for index in range(3)]
    write_dataset(folder / "d", SMALL.to_dict(), {"a": frames}, options=StoreOptions(shard_frames=2, layout=layout))


def _read_dataset(folder: Path) -> object:
    from scarl_sionna.core.errors import ScarlError
    from scarl_sionna.dataset import open_dataset
    from scarl_sionna.dataset.verify import verify

    errors: list[ScarlError] = []
    try:
        dataset = open_dataset(folder / "d")
        for position in range(len(dataset)):
            try:
                dataset[position].to_frame()
            except ScarlError as error:
                errors.append(error)
        repr(dataset)
    except ScarlError as error:
        errors.append(error)
    try:
        verify(folder / "d", repair=True)
    except ScarlError as error:
        errors.append(error)
    if errors:
        raise errors[0]
    return None


def _evil_dataset(folder: Path, case: int) -> bool:
    """Change values inside of the JSON of a dataset, and put the checksums right that would show it."""
    if case < 12:
        return evil_text()(folder / "d/manifest.json", case)
    root, rng = folder / "d", random.Random(case)
    (root / "manifest.backup.json").unlink(missing_ok=True)
    manifest = json.loads((root / "manifest.json").read_text())
    if case % 3 == 0:
        _change(manifest, rng)
    else:
        record_file, metas_file = root / "shards/a/000000.json", root / "shards/a/000000.frames.json"
        record, metas = json.loads(record_file.read_text()), json.loads(metas_file.read_text())
        _change(record if case % 3 == 1 else metas, rng)
        text = json.dumps(metas).encode()
        metas_file.write_bytes(text)
        if isinstance(record.get("files"), dict) and case % 3 == 2:
            record["files"]["shards/a/000000.frames.json"] = [len(text), hashlib.sha256(text).hexdigest()]
        text = _record_text(record)
        record_file.write_bytes(text)
        manifest["shards"]["a"][0][0] = hashlib.sha256(text).hexdigest()
    _put_manifest(root, manifest)
    return case % 5 != 0


def _put_manifest(root: Path, manifest: dict[str, Any]) -> None:
    """Write a manifest whose own checksums are right."""
    from scarl_sionna.dataset.store.manifest import hash_of

    manifest.pop("checksum", None)  # it may lack
    with suppress(KeyError):
        manifest["configuration_hash"] = hash_of(manifest["configuration"])
    (root / "manifest.json").write_text(json.dumps(manifest))


def _record_text(record: dict[str, Any]) -> bytes:
    """Return the text of a record whose own checksum is not wrong: it may lack."""
    return json.dumps({key: value for key, value in record.items() if key != "checksum"}).encode()


BAD_VALUES = (
    None, True, 0, -1, 1e30, 10**8, 10**30, "", "x", "../x", "/etc/passwd", [], [1], ["x"], {}, {"a": 1}, [[]], 1.5,
)  # fmt: skip # a table


def _change(data: object, rng: random.Random) -> None:
    """Replace, remove or add one value somewhere in plain data."""
    while True:
        keys = list(data) if isinstance(data, dict) else list(range(len(data)))  # type: ignore[arg-type, call-overload]
        if not keys:
            return
        key = rng.choice(keys)
        inner = data[key]  # type: ignore[index]
        if isinstance(inner, dict | list) and inner and rng.random() < 0.8:
            data = inner
            continue
        how = rng.randrange(6)
        if how == 0:
            del data[key]  # type: ignore[attr-defined]
        else:
            data[key] = rng.choice(BAD_VALUES)  # type: ignore[index]
        return


def _read_packed(folder: Path) -> object:
    """Read a packed dataset by all that reads its ZIP files: frames, members, repair; a few into the other layout."""
    from scarl_sionna.core.errors import ScarlError
    from scarl_sionna.dataset import open_dataset
    from scarl_sionna.dataset.repack import repack_dataset

    def members() -> None:
        for shard in (0, 1):
            found = open_dataset(folder / "d").scene("a").members(shard)
            for _ in () if found is None else found[1]:
                pass

    reads: list[Callable[[], object]] = [members, lambda: _read_dataset(folder)]
    if (folder / "d/manifest.json").is_file() and sum((folder / "d/manifest.json").read_bytes()) % 8 == 0:
        reads.insert(0, lambda: repack_dataset(folder / "d", folder / "files", "files"))
    errors: list[ScarlError] = []
    for read in reads:
        try:
            read()
        except ScarlError as error:
            errors.append(error)
    assert sorted(path.name for path in folder.iterdir()) in (["d"], ["d", "files"])
    shutil.rmtree(folder / "files", ignore_errors=True)
    if errors:
        raise errors[0]
    return None


def _evil_packed(folder: Path, case: int) -> bool:
    """Change what is inside of a packed dataset, and put the checksums right that would show it."""
    from scarl_sionna.dataset.store.records import write_members

    if case < 72 and case % 3 == 0:
        number = case // 3
        return evil_text()(folder / ("d/shards/a/000000.json", "d/shards/a/000000.zip")[number % 2], number // 2)
    root, rng, how = folder / "d", random.Random(case), case % 7
    if how == 0:
        return False  # a plain mutation, which the checksums show
    manifest = json.loads((root / "manifest.json").read_text())
    record = json.loads((root / "shards/a/000000.json").read_text())
    place = root / "shards/a/000000.zip"
    members = {name: place.read_bytes()[start : start + size] for name, (size, _, start) in record["files"].items()}
    if how == 1:
        _change(manifest, rng)
    elif how == 2:
        _change(record, rng)
    elif how == 3:
        _move(record["files"], record["bundle"][1], rng)
    elif how == 4:
        place.write_bytes(evil_zip(place.read_bytes(), rng))
        record["bundle"][1:] = _stated(place.read_bytes())
    else:
        name = "shards/a/000000.frames.json" if how == 5 else rng.choice(sorted(members))
        members[name] = _other(name, members[name], rng)
        with open(place, "wb") as file:
            starts = write_members(file, ((key, [data]) for key, data in members.items()))
        record["files"] = {key: [*_stated(data), starts[key]] for key, data in members.items()}
        record["bundle"][1:] = _stated(place.read_bytes())
    (root / "manifest.backup.json").unlink(missing_ok=True)
    text = _record_text(record)
    (root / "shards/a/000000.json").write_bytes(text)
    with suppress(LookupError, TypeError):  # of a manifest in which that was changed
        manifest["shards"]["a"][0][0] = hashlib.sha256(text).hexdigest()
    _put_manifest(root, manifest)
    return True


def _stated(data: bytes) -> list[object]:
    return [len(data), hashlib.sha256(data).hexdigest()]


def _move(files: dict[str, list[object]], size: int, rng: random.Random) -> None:
    """Let the record of a ZIP file state another place, size or name of a member."""
    name = rng.choice(sorted(files))
    how = rng.randrange(4)
    if how < 2:
        files[name][2 * how] = rng.choice((0, 1, -1, size, size + 1, 2**31, 2**63, 2**64, rng.randrange(size)))
    elif how == 2:
        files[name] = list(files[rng.choice(sorted(files))])
    else:
        files[rng.choice(NAMES)] = files.pop(name)


def _other(name: str, data: bytes, rng: random.Random) -> bytes:
    """Return another content of a file of a shard, whose own checksums are right."""
    if name.endswith(".json"):
        values = json.loads(data)
        _change(values, rng)
        return json.dumps(values).encode()
    if name.endswith(".png") or rng.random() < 0.2:
        return mutated(data, rng)
    return _other_chunks(data, rng)


def _other_chunks(data: bytes, rng: random.Random) -> bytes:
    """Return the shard of an array of which a chunk, or the index, is another one with a right checksum."""
    from scarl_sionna.dataset.store.shards import index_length, parse_index, shard_index

    places = parse_index(data[-index_length(2) :], 2)
    chunks = [None if place is None else data[place[0] : sum(place)] for place in places]
    whole = [number for number, chunk in enumerate(chunks) if chunk is not None]
    if not whole or rng.random() < 0.3:
        values = [rng.choice((0, 1, 2**31, 2**63, 2**64 - 1, rng.randrange(len(data)))) for _ in range(4)]
        index = struct.pack("<4Q", *values)
        return data[: -index_length(2)] + index + struct.pack("<I", google_crc32c.value(index))
    number = rng.choice(whole)
    body = bytearray((chunks[number] or b"")[:-4])
    for _ in range(rng.choice((1, 1, 5))):
        body[rng.randrange(min(len(body), 40) if rng.random() < 0.5 else len(body))] = rng.randrange(256)
    chunks[number] = bytes(body) + struct.pack("<I", google_crc32c.value(bytes(body)))
    return b"".join(chunk for chunk in chunks if chunk) + shard_index([c if c is None else len(c) for c in chunks])


def _write_archives(folder: Path) -> None:
    from scarl_sionna.dataset.archive import archive_dataset

    _write_dataset(folder)
    archive_dataset(folder / "d", folder / "a")


def _read_archives(folder: Path) -> object:
    from scarl_sionna.core.errors import ScarlError
    from scarl_sionna.dataset import open_dataset
    from scarl_sionna.dataset.archive import restore_dataset
    from scarl_sionna.dataset.verify import verify

    shutil.rmtree(folder / "back", ignore_errors=True)
    errors: list[ScarlError] = []
    try:
        for frame in open_dataset(folder / "a"):
            frame.to_frame()
    except ScarlError as error:
        errors.append(error)
    for read in (lambda: verify(folder / "a"), lambda: restore_dataset(folder / "a", folder / "back")):
        try:
            read()
        except ScarlError as error:
            errors.append(error)
    if errors:
        raise errors[0]
    return None


def _evil_archives(folder: Path, case: int) -> bool:
    """Write an archive anew with a file in it mutated, of another name or compressed, and state its size."""
    if case < 12:
        return evil_text()(folder / "a/archived.json", case)
    rng = random.Random(case)
    index = json.loads((folder / "a/archived.json").read_text())
    if case % 4 == 0:
        _change(index, rng)
    elif case % 4 == 1 and case % 8 == 1:
        return False
    elif case % 4 == 1:
        which = rng.choice(("dataset.zip", "a/000000.zip"))
        path = folder / "a/archives" / which
        path.write_bytes(evil_zip(path.read_bytes(), rng))
        if which == "dataset.zip":
            index["common"] = path.stat().st_size
        else:
            index["shards"]["a"][0] = path.stat().st_size
    else:
        path = folder / ("a/archives/dataset.zip" if case % 4 == 2 else "a/archives/a/000000.zip")
        with zipfile.ZipFile(path) as archive:
            files = {name: archive.read(name) for name in archive.namelist()}
        name = rng.choice(list(files))
        how = rng.randrange(4)
        if how == 0:
            del files[name]
        elif how == 1:
            files[str(rng.choice(BAD_VALUES)) or "."] = files.pop(name)
        else:
            files[name] = mutated(files[name], rng)
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED if case % 11 == 0 else zipfile.ZIP_STORED) as archive:
            for key, content in files.items():
                archive.writestr(key, content)
        if case % 4 == 2:
            index["common"] = path.stat().st_size
        else:
            index["shards"]["a"][0] = path.stat().st_size
    (folder / "a/archived.json").write_text(json.dumps(index))
    return True


DATASETS: Mapping[str, Kind] = {
    "dataset": Kind(
        _write_dataset,
        ("d/manifest.json", "d/shards/a/000000.json", "d/shards/a/000000.frames.json",
         "d/arrays/a/objects/instance/c/0/0", "d/images/a/front/camera/rgb/000000.png"),
        _read_dataset,
        _evil_dataset,
    ),
    "packed": Kind(
        lambda folder: _write_dataset(folder, "packed"),
        ("d/manifest.json", "d/shards/a/000000.json", "d/shards/a/000000.zip", "d/shards/a/000001.zip"),
        _read_packed,
        _evil_packed,
    ),
    "archives": Kind(
        _write_archives,
        ("a/archived.json", "a/archives/dataset.zip", "a/archives/a/000000.zip", "a/archives/a/000001.zip"),
        _read_archives,
        _evil_archives,
    ),
}  # fmt: skip # a table
